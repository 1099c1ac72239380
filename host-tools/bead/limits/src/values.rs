//! The values of a strike with their uncertainties, or why it has none.

use bead_compare::budget::StrikeBudget;
use bead_model::design::{Relative, Uncertainty};
use bead_recording::strikes::RecordedStrike;
use bead_recording::uncertainties::{are_held, of_energies, of_force};
use bead_wire::StrikeFlags as Flags;

use crate::quantity::Scalar;

/// Coverage factor of the expanded uncertainty of a value: 95 % of a normal distribution.
pub const COVERAGE: f64 = 2.0;

/// Flags that mean an error of the acceleration.
const OF_ACCELERATION: Flags = Flags::ACCELERATION_RAILED
    .with(Flags::GAINS_DIFFER)
    .with(Flags::SUPPLY_OFF)
    .with(Flags::SENSOR_END)
    .with(Flags::SENSOR_STILL)
    .with(Flags::SENSOR_FAULT)
    .with(Flags::SETTINGS_NOT_OWNERS);

/// A value with its standard uncertainty, in its unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// The value.
    pub value: f64,
    /// Its standard uncertainty; `None` if it is unknown.
    pub u: Option<f64>,
}

impl Measured {
    /// Its expanded uncertainty, 95 %.
    pub fn expanded(&self) -> Option<f64> {
        self.u.map(|u| COVERAGE * u)
    }
}

/// The values of a strike.
#[derive(Clone, Debug, PartialEq)]
pub struct StrikeValues {
    /// Number of the strike since the bead's reset.
    pub strike: u32,
    /// Each value of [`Scalar::ALL`], or why it is absent, as the end of a sentence.
    values: [Result<Measured, &'static str>; Scalar::ALL.len()],
}

impl StrikeValues {
    /// The values of a strike. `stated` uncertainties replace those in its settings; those of the energies
    /// then need a budget, which takes some 0.4 s, and are unknown unless `with_budget`.
    pub fn of(strike: &RecordedStrike, stated: Option<&Uncertainty>, with_budget: bool) -> Self {
        let said = &strike.said;
        let known = known(strike, stated);
        let [u_a, u_b, u_difference] = match stated {
            Some(_) if !with_budget => [None; 3],
            _ => energies(strike, stated),
        };
        let forces = known.and_then(|known| of_force(said, &known));
        let (a, b) = (said.absorbed_measured.joules(), said.absorbed_predicted.joules());
        let acceleration =
            [said.acceleration_max, said.acceleration_min].map(|one| one.metres_per_second_squared().abs());
        let acceleration = acceleration.into_iter().fold(0.0, f64::max);
        let frequency = strike.shape.as_ref().map(|shape| shape.ring_frequency.hertz());
        let of = |scalar: Scalar| match scalar {
            Scalar::Measured => Ok(Measured { value: a, u: u_a }),
            Scalar::Predicted => Ok(Measured { value: b, u: u_b }),
            // A/B is 1 + (A − B)/B, and what both share cancels in u(A − B).
            Scalar::Ratio if b > 0.0 => Ok(Measured {
                value: a / b,
                u: u_difference.map(|u| u / b),
            }),
            Scalar::Ratio => Err("estimate B is not above 0, so A over B is unknown; check the force sensor"),
            Scalar::PeakForce => Ok(Measured {
                value: said.peak_force.newtons(),
                u: forces.map(|of| of[0]),
            }),
            Scalar::PeakAcceleration => Ok(Measured {
                value: acceleration,
                u: known
                    .and_then(|known| acceleration_part(said.flags, &known))
                    .map(|part| part * acceleration),
            }),
            Scalar::Incident if said.incident_energy.joules() > 0.0 => Ok(Measured {
                value: said.incident_energy.joules(),
                u: forces.map(|of| of[1]),
            }),
            Scalar::Incident => Err("the bead found no incoming wave; check the force sensor"),
            Scalar::RingFrequency => match frequency {
                Some(value) if value > 0.0 => Ok(Measured { value, u: None }),
                Some(_) => {
                    Err("the ringing was too weak or too short to measure its frequency; strike harder")
                }
                None => Err("its shape frame was not received; fetch the strike again with `bead fetch`"),
            },
        };
        Self {
            strike: said.strike,
            values: Scalar::ALL.map(of),
        }
    }

    /// A value, or why it is absent.
    ///
    /// # Errors
    /// The reason, and what next.
    pub fn get(&self, scalar: Scalar) -> Result<Measured, &'static str> {
        self.values[scalar as usize]
    }
}

/// The stated uncertainties, or else those in the settings of a strike.
fn known(strike: &RecordedStrike, stated: Option<&Uncertainty>) -> Option<Uncertainty> {
    let own = || strike.settings.as_ref()?.description().uncertainty;
    stated.copied().or_else(own)
}

/// The standard uncertainties of A, B and A − B, J: by the budget of the strike if uncertainties are stated,
/// else as the bead sent them. `None` where a flag means an error that they do not cover.
fn energies(strike: &RecordedStrike, stated: Option<&Uncertainty>) -> [Option<f64>; 3] {
    let Some(stated) = stated else {
        let sent = strike.shape.as_ref();
        return sent
            .and_then(|shape| of_energies(shape, &strike.said))
            .unwrap_or_default();
    };
    let Ok(budget) = StrikeBudget::of(strike, Some(*stated), None) else {
        return [None; 3];
    };
    let [of_a, of_b] = are_held(strike.said.flags);
    // A budget that lacks an input is incomplete.
    let is_whole = budget.unknown.is_empty();
    [
        Some(budget.measured.u).filter(|_| of_a && is_whole),
        Some(budget.predicted.u).filter(|_| of_b && is_whole),
        Some(budget.difference.u).filter(|_| of_a && of_b && is_whole),
    ]
}

/// The relative standard uncertainty of an acceleration's scale.
fn acceleration_part(flags: Flags, stated: &Uncertainty) -> Option<f64> {
    if flags.has(OF_ACCELERATION) {
        return None;
    }
    let parts = [
        stated.acceleration_gain?,
        stated.acceleration_gain_ratio?,
        stated.acceleration_flatness?,
        stated.supply?,
    ];
    Some(parts.map(Relative::part).into_iter().fold(0.0, f64::hypot))
}

/// The relative standard uncertainty of a force's scale, if the settings state it and no flag doubts it.
pub(crate) fn force_part(strike: &RecordedStrike, stated: Option<&Uncertainty>) -> Option<f64> {
    let [peak, _] = of_force(&strike.said, &known(strike, stated)?)?;
    let value = strike.said.peak_force.newtons().abs();
    Some(peak / value).filter(|part| part.is_finite())
}
