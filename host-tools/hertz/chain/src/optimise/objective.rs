//! Quantities of a strike that intruders are to make small.

use std::fmt;
use std::str::FromStr;

use serde::Serialize;

use super::error::OptimiseError;
use super::remaining::{given, struck_at};
use crate::ensemble::{EndSlopes, EnsembleOptions, EnsembleOutcome, single};
use crate::model::Model;
use crate::options::{Accuracy, SimulateError};
use crate::scenario::{InputError, Scenario};

/// A quantity of a strike, of which [`optimise`](crate::optimise()) looks for the least.
///
/// As text it is `remaining`, `force:13`, `energy-behind:13` or `impulse:13`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Objective {
    /// The share of the injected energy that the intruders have not dissipated by the end of the run
    /// ([`Remaining::share`](crate::Remaining::share)).
    #[default]
    Remaining,
    /// The greatest force of this contact during the run, N, with any static load.
    Force(usize),
    /// The mechanical energy of the beads behind this one, with their intruders, at the end of the run, J.
    EnergyBehind(usize),
    /// The impulse ∫ (F - F₀) dt of this contact over the run, N·s: the momentum of all behind it.
    Impulse(usize),
}

impl Objective {
    /// Its value for a strike at `speed`, m/s, on this scenario with its intruders. The run lasts as long as
    /// that of [`remaining`](crate::remaining()).
    ///
    /// # Errors
    /// As [`remaining`](crate::remaining()), and [`SimulateError::Input`] if the chain lacks the contact or
    /// the beads.
    pub fn at(self, scenario: &Scenario, speed: f64, accuracy: Accuracy) -> Result<f64, SimulateError> {
        self.check(scenario)?;
        let struck = struck_at(scenario, speed);
        let outcome = self.end_of(&struck, accuracy)?;
        Ok(self.of(&struck, &outcome)?)
    }

    /// Its unit; empty for a share.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Remaining => "",
            Self::Force(_) => "N",
            Self::EnergyBehind(_) => "J",
            Self::Impulse(_) => "N·s",
        }
    }

    /// Runs a strike by itself.
    fn end_of(self, struck: &Scenario, accuracy: Accuracy) -> Result<EnsembleOutcome, SimulateError> {
        let peaks = self.peaks();
        single(struck, &EnsembleOptions::default().with_peaks(&peaks), accuracy)
    }

    /// The contacts whose greatest force it needs.
    pub(super) fn peaks(self) -> Vec<usize> {
        match self {
            Self::Force(contact) => vec![contact],
            _ => Vec::new(),
        }
    }

    /// Its value at the end of a run.
    pub(super) fn of(self, struck: &Scenario, outcome: &EnsembleOutcome) -> Result<f64, InputError> {
        Ok(match self {
            Self::Remaining => 1.0 - outcome.absorbed() / given(struck, outcome.injected())?,
            // A contact that never carried a force has no peak.
            Self::Force(_) => outcome.peaks().first().map_or(0.0, |peak| peak.force),
            Self::EnergyBehind(bead) => {
                let last = outcome.model().bodies() - 1;
                outcome.end().region(bead + 1..=last).mechanical()
            }
            Self::Impulse(contact) => outcome.end().impulse(contact),
        })
    }

    /// Derivatives of its value with respect to the end of a run; `None` if no energy was given.
    pub(super) fn slopes(self, outcome: &EnsembleOutcome) -> Option<EndSlopes> {
        let (model, end) = (outcome.model(), outcome.end());
        let (layout, mut state) = (model.layout(), vec![0.0; end.state.len()]);
        let mut peak = 0.0;
        let last = model.bodies() - 1;
        match self {
            Self::Remaining => {
                let injected = outcome.injected();
                if injected <= 0.0 {
                    return None;
                }
                let share = outcome.absorbed() / injected;
                let striker = layout.velocity(0);
                state[striker] = -share / injected * model.mass(0) * end.state[striker];
                let intruders = 0..model.intruders().len();
                intruders.for_each(|number| state[layout.intruder_loss(number)] = -1.0 / injected);
            }
            Self::Force(_) => peak = 1.0,
            Self::EnergyBehind(bead) => {
                for body in bead + 1..=last {
                    state[layout.velocity(body)] = model.shells[body] * end.state[layout.velocity(body)];
                }
                for contact in bead + 1..=model.contacts() {
                    let force = model
                        .contact_at(contact)
                        .elastic_force(model.overlap(&end.state, contact).0);
                    state[contact - 1] += force;
                    if contact <= last {
                        state[contact] -= force;
                    }
                }
                for (number, intruder) in model.intruders().iter().enumerate() {
                    if intruder.bead > bead {
                        let (place, rate) = (layout.relative(number), layout.relative_velocity(number));
                        let velocity = layout.velocity(intruder.bead);
                        let momentum = intruder.oscillator.mass * (end.state[velocity] + end.state[rate]);
                        state[velocity] += momentum;
                        state[rate] = momentum;
                        state[place] = intruder.oscillator.stiffness * end.state[place];
                    }
                }
            }
            Self::Impulse(contact) => {
                // A wall has what the bodies before the contact have lost.
                let walled = layout.wall_impulse().is_some();
                let (sign, bodies) = if walled {
                    (-1.0, 0..contact)
                } else {
                    (1.0, contact..last + 1)
                };
                for body in bodies.clone() {
                    state[layout.velocity(body)] = sign * model.mass(body);
                }
                for (number, intruder) in model.intruders().iter().enumerate() {
                    if bodies.contains(&intruder.bead) {
                        state[layout.relative_velocity(number)] = sign * intruder.oscillator.mass;
                    }
                }
            }
        }
        Some(EndSlopes { state, peak })
    }

    /// Its change from one chain to another with the same end of a run.
    pub(super) fn change(
        self,
        struck: &Scenario,
        outcome: &EnsembleOutcome,
        [from, to]: [&Model; 2],
    ) -> Result<f64, InputError> {
        if matches!(self, Self::Remaining | Self::Force(_)) {
            return Ok(0.0);
        }
        let of = |model: &Model| self.of(struck, &outcome.on(model.clone()));
        Ok(of(to)? - of(from)?)
    }

    /// Value without intruders, by which a search divides each value, so that all objectives are relative.
    pub(super) fn scale(self, bare: &Scenario, speed: f64) -> Result<f64, OptimiseError> {
        if self == Self::Remaining {
            return Ok(1.0);
        }
        let struck = struck_at(bare, speed);
        let outcome = self.end_of(&struck, Accuracy::DRAFT)?;
        let value = self.of(&struck, &outcome)?;
        let rises = outcome.peaks().iter().any(|peak| peak.time >= outcome.time());
        if value > 0.0 && !rises {
            return Ok(value);
        }
        let what = if rises {
            format!("{self} still rises at the end of a strike at {speed} m/s without intruders")
        } else {
            format!("{self} is {value} in a strike at {speed} m/s without intruders")
        };
        let advice = "give the run more time, or choose a place that the wave passes";
        Err(OptimiseError::Search(InputError::at("objective", what, advice)))
    }

    pub(super) fn check(self, scenario: &Scenario) -> Result<(), InputError> {
        let contacts = Model::of(scenario)?.contacts();
        let (number, most, kind) = match self {
            Self::Remaining => return Ok(()),
            Self::Force(contact) | Self::Impulse(contact) => (contact, contacts, "contact"),
            Self::EnergyBehind(bead) => (bead, scenario.chain.beads - 1, "bead"),
        };
        if (1..=most).contains(&number) {
            return Ok(());
        }
        let what = format!("{self}: {kind} {number} is not one of 1 to {most}");
        Err(InputError::at("objective", what, "choose one of these"))
    }
}

impl fmt::Display for Objective {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Remaining => f.write_str("remaining"),
            Self::Force(contact) => write!(f, "force:{contact}"),
            Self::EnergyBehind(bead) => write!(f, "energy-behind:{bead}"),
            Self::Impulse(contact) => write!(f, "impulse:{contact}"),
        }
    }
}

impl FromStr for Objective {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        const ADVICE: &str = "write remaining, force:13, energy-behind:13 or impulse:13, with the number of a \
                              contact or bead";
        if text == "remaining" {
            return Ok(Self::Remaining);
        }
        let (kind, number) = text.split_once(':').ok_or(ADVICE)?;
        let number = number.parse().map_err(|_| ADVICE)?;
        match kind {
            "force" => Ok(Self::Force(number)),
            "energy-behind" => Ok(Self::EnergyBehind(number)),
            "impulse" => Ok(Self::Impulse(number)),
            _ => Err(ADVICE.to_owned()),
        }
    }
}
