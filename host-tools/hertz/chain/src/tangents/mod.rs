//! Motion of a chain with its exact derivatives with respect to parameters of the scenario.
//!
//! # Design
//! The equations of motion are integrated with dual numbers ([`Dual`]): each value carries its derivatives,
//! so the tangents are those of the computed motion itself, to rounding. Contacts that open and close do not
//! harm them (`chain.rs`). The method is simple and of order 4 (`march.rs`); [`simulate`](crate::simulate) is
//! the reference for the motion.

mod chain;
mod dual;
mod march;
mod monodromy;
mod parameter;
mod sensitivities;
mod sensor;
#[cfg(test)]
mod tests;
mod variation;

pub use dual::Dual;
pub use parameter::Parameter;
pub use sensitivities::{Sensitivities, sensitivities};
pub use sensor::{Push, Sensor, SensorPlace};

use crate::scenario::{InputError, Scenario};
use chain::DualChain;
use march::March;
pub(crate) use monodromy::DrivenChain;
use sensor::cubic;

/// Signals of sensors over a run, with their derivatives.
#[derive(Debug, Clone, PartialEq)]
pub struct SignalTangents<const P: usize> {
    step: f64,
    /// One row for each sensor.
    signals: Vec<Vec<Dual<P>>>,
}

impl<const P: usize> SignalTangents<P> {
    /// The signal of a sensor (by its number) at a time, and its rate in time. It is 0 before the run.
    pub fn at(&self, sensor: usize, t: f64) -> (Dual<P>, f64) {
        let (value, slope) = cubic(&self.signals[sensor], t / self.step, Dual::default());
        (value, slope.value / self.step)
    }

    /// Multiplies the derivatives in each direction by a factor. With the parameter's value as factor, they
    /// become derivatives with respect to its logarithm.
    pub fn scale(&mut self, factors: [f64; P]) {
        for signal in self.signals.iter_mut().flatten() {
            for (by, factor) in signal.by.iter_mut().zip(factors) {
                *by *= factor;
            }
        }
    }

    /// The signal of a sensor at the steps of the run, from t = 0.
    pub fn steps(&self, sensor: usize) -> &[Dual<P>] {
        &self.signals[sensor]
    }

    /// Length of a step, s.
    pub fn step(&self) -> f64 {
        self.step
    }

    /// End of the run, s.
    pub fn end(&self) -> f64 {
        let steps = self.signals.first().map_or(0, Vec::len);
        self.step * steps.saturating_sub(1) as f64
    }
}

/// Simulates a scenario for `duration` s in steps of `step` s, with the derivatives of each sensor's signal
/// with respect to up to P parameters. The scenario's own duration is not used. With a `push` the bodies
/// before its bead are left out.
///
/// For the paper's chain, a step of 2.5 µs is right within 1e-5 of the peak. Stiffer or smaller spheres need
/// shorter steps, as their time of contact is shorter.
///
/// # Errors
/// [`InputError`]: a value of the scenario is out of range, contact forces are clipped, more than P
/// parameters are given, or a sensor or push is at no contact or bead of the chain.
pub fn tangents<const P: usize>(
    scenario: &Scenario,
    parameters: &[Parameter],
    sensors: &[Sensor],
    push: Option<&Push>,
    (duration, step): (f64, f64),
) -> Result<SignalTangents<P>, InputError> {
    let refuse = |what: String, advice: &str| Err(InputError::at("", what, advice));
    if parameters.len() > P {
        let count = parameters.len();
        return refuse(
            format!("{count} parameters are given, but there is only room for {P}"),
            "give fewer",
        );
    }
    if !(step > 0.0 && duration >= 0.0 && duration / step < 1e7) {
        let what = format!("{duration} s in steps of {step} s");
        return refuse(what, "give a positive step and at most ten million of them");
    }
    let chain = DualChain::<P>::new(scenario, parameters)?;
    let (bodies, contacts) = (chain.bodies(), chain.contacts.len());
    for sensor in sensors {
        let (is_there, what) = match sensor.place {
            SensorPlace::Force(contact) => ((1..=contacts).contains(&contact), contact),
            SensorPlace::Acceleration(bead) => ((1..bodies).contains(&bead), bead),
        };
        if !is_there {
            return refuse(
                format!("there is no contact or bead {what}"),
                "give one of the chain",
            );
        }
    }
    if let Some(push) = push.filter(|push| !(1..bodies).contains(&push.bead)) {
        return refuse(format!("there is no bead {}", push.bead), "give one of the chain");
    }
    let steps = (duration / step).ceil() as usize;
    let signals = March::new(&chain, sensors, push, step).run(steps + 1);
    Ok(SignalTangents { step, signals })
}
