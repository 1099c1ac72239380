//! Peaks, widths and energies of a run, in one structure.
//!
//! # Design
//!
//! A peak is looked for among the ends of steps, then inside the steps around it, as the root of the
//! quantity's rate. The equations of motion give that rate, so the root is as exact as the motion. The place
//! of a flat maximum would be known only to the square root of rounding.

use serde::Serialize;

use crate::dop853::{System, crossing};
use crate::quantity::{Inside, Quantity};
use crate::solution::Solution;

/// The results of a run, with the names of the JSON of `bead simulate`. SI units.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Summary {
    /// Greatest force of every contact that ever carried one.
    pub peak_force: Vec<ContactPeak>,
    /// Where the bodies are at the end.
    #[serde(rename = "final")]
    pub final_state: FinalState,
    /// Where the striker's energy is at the end.
    pub energy: EnergySummary,
    /// Each intruder, in the order of the beads.
    pub intruders: Vec<IntruderSummary>,
    /// Cost of the run.
    pub solver: SolverSummary,
}

/// The greatest force of one contact.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ContactPeak {
    /// The contact, which joins bodies `contact - 1` and `contact`; N + 1 joins the last bead and the wall.
    pub contact: usize,
    /// Greatest total force, N.
    pub force: f64,
    /// When, s. It is the end of the run for a force that still rises then, and 0 for a static load that no
    /// wave has added to.
    pub time: f64,
    /// Full width at half of `force`, s, or half way from the static load to it. None if the run ends before
    /// the force has fallen to that.
    pub fwhm: Option<f64>,
}

/// Displacements (m) and velocities (m/s) of bodies 0..=N at one time (s).
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct FinalState {
    /// When.
    pub time: f64,
    /// Displacements.
    pub displacement: Vec<f64>,
    /// Velocities.
    pub velocity: Vec<f64>,
}

/// Energies, J, as [`Energies`](crate::Energies) has them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct EnergySummary {
    /// Kinetic energy of the striker at t = 0.
    pub striker_initial: f64,
    /// The same at the end.
    pub striker_final: f64,
    /// Energy of the chain at the end, with M - m for hosts, without intruders.
    pub chain_final: f64,
    /// Energy of the intruders at the end.
    pub intruders_final: f64,
    /// Greatest energy of the chain in the run.
    pub chain_max: f64,
    /// Dissipated in contacts.
    pub dissipated_contacts: f64,
    /// Dissipated in intruders.
    pub dissipated_intruders: f64,
    /// Greatest distance of the sum from what it was at t = 0, which is `striker_initial` unless other beads
    /// moved then, at the end of any step, as a part of it.
    pub balance_error: f64,
}

/// Motion and losses of one intruder.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct IntruderSummary {
    /// The host bead.
    pub bead: usize,
    /// Greatest absolute acceleration, m/s².
    pub acceleration_max: f64,
    /// Least absolute acceleration, m/s².
    pub acceleration_min: f64,
    /// Greatest distance from its place in the host, m.
    pub relative_displacement_max: f64,
    /// Energy dissipated in its damper, J.
    pub dissipated: f64,
}

/// Cost of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SolverSummary {
    /// Steps taken.
    pub steps: u64,
    /// Number of evaluations of the equations of motion.
    pub evaluations: u64,
    /// Wall-clock time, s.
    pub seconds: f64,
}

/// The integration does not resolve forces below this part of the greatest: such a contact carried none.
pub(crate) const NO_FORCE: f64 = 1e-12;

/// Signs of the peaks that are looked for.
const GREATEST: f64 = 1.0;
const LEAST: f64 = -1.0;

struct Peak {
    value: f64,
    time: f64,
    /// The step that ends next to it.
    knot: usize,
}

impl Solution {
    /// The results of the run, from t = 0 to the scenario's end (or to the run's, if that is earlier).
    pub fn summary(&self) -> Summary {
        let model = self.model();
        let layout = model.layout();
        let last = self.summary_end;
        let end = self.state(last);
        let energies = model.energies(end);
        let striker_initial = model.striker_energy();
        let initial = model.initial_energy();
        let balance_error = (0..=last)
            .map(|knot| (model.energies(self.state(knot)).total() - initial).abs() / initial)
            .fold(0.0, f64::max);
        Summary {
            peak_force: self.contact_peaks(),
            final_state: FinalState {
                time: self.times[last],
                displacement: (0..model.bodies())
                    .map(|body| end[body] - model.start(body))
                    .collect(),
                velocity: (0..model.bodies())
                    .map(|body| end[layout.velocity(body)])
                    .collect(),
            },
            energy: EnergySummary {
                striker_initial,
                striker_final: energies.striker,
                chain_final: energies.chain,
                intruders_final: energies.intruders,
                chain_max: self.peak(Quantity::ChainEnergy, GREATEST).value,
                dissipated_contacts: energies.dissipated_contacts,
                dissipated_intruders: energies.dissipated_intruders,
                balance_error,
            },
            intruders: (0..model.intruders().len())
                .map(|i| {
                    let relative = Quantity::RelativeDisplacement(i);
                    IntruderSummary {
                        bead: model.intruders()[i].bead,
                        acceleration_max: self.peak(Quantity::Acceleration(i), GREATEST).value,
                        acceleration_min: self.peak(Quantity::Acceleration(i), LEAST).value,
                        relative_displacement_max: self
                            .peak(relative, GREATEST)
                            .value
                            .max(-self.peak(relative, LEAST).value),
                        dissipated: end[layout.intruder_loss(i)],
                    }
                })
                .collect(),
            solver: SolverSummary {
                steps: self.step_times().len() as u64 - 1,
                evaluations: self.evaluations,
                seconds: self.seconds,
            },
        }
    }

    fn contact_peaks(&self) -> Vec<ContactPeak> {
        let load = |contact: usize| self.model().contact(contact).load;
        let peaks: Vec<Peak> = (1..=self.model().contacts())
            .map(|contact| self.peak(Quantity::ForceBeyond(contact), GREATEST))
            .collect();
        let forces = || {
            peaks
                .iter()
                .zip(1..)
                .map(|(peak, contact)| load(contact) + peak.value)
        };
        let least = NO_FORCE * forces().fold(0.0, f64::max);
        let of = |((contact, peak), force): ((usize, &Peak), f64)| {
            let reached = peak.value > least;
            (force > least).then(|| ContactPeak {
                contact,
                force,
                time: if reached { peak.time } else { 0.0 },
                fwhm: self.width(contact, peak).filter(|_| reached),
            })
        };
        (1..).zip(&peaks).zip(forces()).filter_map(of).collect()
    }

    /// The greatest value of a quantity, or its least value where `sign` is [`LEAST`].
    fn peak(&self, quantity: Quantity, sign: f64) -> Peak {
        let last = self.summary_end;
        let value = |knot: usize| sign * quantity.value(self.model(), self.state(knot));
        let values: Vec<f64> = (0..=last).map(value).collect();
        let coarse = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let range = coarse - values.iter().copied().fold(f64::INFINITY, f64::min);
        let mut best = Peak {
            value: coarse,
            time: 0.0,
            knot: 0,
        };
        if range == 0.0 {
            return best;
        }
        best.value = f64::NEG_INFINITY;
        let mut rate = vec![0.0; self.state(0).len()];
        let mut rises = |knot: usize| {
            self.model().rate(self.state(knot), &mut rate);
            sign * quantity.rate(self.model(), self.state(knot), &rate) > 0.0
        };
        for knot in 0..=last {
            let summit = values[knot.saturating_sub(1)] <= values[knot]
                && values[knot] >= values[(knot + 1).min(last)];
            // A step is at most half a contact long, so only knots of some height can have the top beside
            // them.
            if !summit || values[knot] < coarse - 0.5 * range {
                continue;
            }
            let mut consider = |value: f64, time: f64| {
                if value > best.value {
                    best = Peak { value, time, knot };
                }
            };
            consider(values[knot], self.times[knot]);
            for step in knot.saturating_sub(1)..(knot + 1).min(last) {
                if rises(step) && !rises(step + 1) {
                    let mut inside = Inside::new(self, step);
                    let (from, to) = (self.times[step], self.times[step + 1]);
                    let time = crossing(from, to, |t| sign * inside.rate(quantity, t) > 0.0);
                    consider(sign * inside.value(quantity, time), time);
                }
            }
        }
        Peak {
            value: sign * best.value,
            ..best
        }
    }

    /// Time from the last rise through half of a peak before it to the first fall through half after it.
    fn width(&self, contact: usize, peak: &Peak) -> Option<f64> {
        let quantity = Quantity::ForceBeyond(contact);
        let half = 0.5 * peak.value;
        let below = |knot: &usize| quantity.value(self.model(), self.state(*knot)) < half;
        let rise = (0..=peak.knot).rev().find(below)?;
        let fall = (peak.knot..=self.summary_end).find(below)?;
        let through = |step: usize| {
            let mut inside = Inside::new(self, step);
            let (from, to) = (self.times[step], self.times[step + 1]);
            crossing(from, to, |t| inside.value(quantity, t) > half)
        };
        Some(through(fall - 1) - through(rise))
    }
}
