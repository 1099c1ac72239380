//! What f64 estimates make of a waveform: the same equations as the bead's, at steps that are much finer,
//! without noise, codes and filter. A takes the acceleration, B the force.

use std::ops::Range;

use bead_model::Settings;
use bead_model::design::{Bead, Intruder, Neighbours};
use serde::{Deserialize, Serialize};

use crate::bench::sensed::Truth;
use crate::comparison::f64_estimators;
use crate::waveform::{Trace, Waveform};

/// Samples a second for A, whose step is exact for an acceleration that is straight between them.
const RATE_A: f64 = 1e6;
/// Samples a second for B, which takes twenty steps in each.
const RATE_B: f64 = 2e5;

/// What a waveform says of one strike, SI units; none where the waveform lacks the quantity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Given {
    /// Highest force, N.
    pub peak_force: Option<f64>,
    /// Estimate A in f64, from the acceleration, J.
    pub absorbed_measured: Option<f64>,
    /// Estimate B in f64, from the force, J.
    pub absorbed_predicted: Option<f64>,
}

impl Given {
    /// Of the stretch of a waveform that a window sees: `time` in s of the waveform.
    pub fn of(waveform: &Waveform, settings: &Settings, time: Range<f64>) -> Self {
        let sampled = |trace: &Option<Trace>, rate: f64| -> Option<Vec<f64>> {
            let mut trace = trace.clone()?;
            let count = ((time.end - time.start) * rate).round().max(1.0) as usize;
            let at = |sample: usize| time.start + sample as f64 / rate;
            Some((0..count).map(|sample| trace.at(at(sample))).collect())
        };
        let (bead, neighbours) = physics(settings);
        let measured = sampled(&waveform.acceleration, RATE_A).map(|acceleration| {
            let energies = f64_estimators::measured(&bead, &acceleration, RATE_A);
            energies.last().copied().unwrap_or(0.0)
        });
        let predicted = sampled(&waveform.force, RATE_B).map(|force| {
            let energies = f64_estimators::predicted(&bead, &neighbours, &force, RATE_B);
            energies.last().copied().unwrap_or(0.0)
        });
        let peak = sampled(&waveform.force, RATE_A);
        Self {
            peak_force: peak.map(|force| force.into_iter().fold(0.0, f64::max)),
            absorbed_measured: measured,
            absorbed_predicted: predicted,
        }
    }

    /// Of the window that a bead would open around the highest value.
    pub fn around_its_peak(waveform: &Waveform, settings: &Settings) -> Self {
        let trace = waveform.force.as_ref().or(waveform.acceleration.as_ref());
        let peak = trace.map_or(0.0, |trace| trace.highest().0);
        let rate = f64::from(settings.sample_rate_hz);
        let [before, long] = [settings.window.history, settings.window.length].map(|n| f64::from(n) / rate);
        Self::of(waveform, settings, peak - before..peak - before + long)
    }

    /// As the truth of a run has it: the energy from the acceleration if there is one, else from the force.
    pub fn truth(&self) -> Truth {
        Truth {
            peak_force: self.peak_force.unwrap_or(0.0),
            absorbed: self.absorbed_measured.or(self.absorbed_predicted).unwrap_or(0.0),
        }
    }
}

/// The bead and its neighbours that settings are made for.
pub(crate) fn physics(settings: &Settings) -> (Bead, Neighbours) {
    let (bead, company) = (&settings.bead, &settings.company);
    let bead = Bead {
        mass: bead.mass.into(),
        intruder_mass: bead.intruder_mass.into(),
        front_mass: bead.front_mass.into(),
        stiffness: bead.stiffness.into(),
        damping: bead.damping.into(),
        contact_stiffness: bead.contact_stiffness.into(),
        relaxation: bead.relaxation.into(),
    };
    let neighbours = Neighbours {
        behind: std::array::from_fn(|follower| company.behind >> follower & 1 == 1),
        elsewhere: company.elsewhere,
        intruder: Intruder {
            mass: company.intruder.mass.into(),
            stiffness: company.intruder.stiffness.into(),
            damping: company.intruder.damping.into(),
        },
    };
    (bead, neighbours)
}

#[cfg(test)]
mod tests {
    use bead_model::design::{Capture, FrontEnd, derive};
    use hertz_chain::Scenario;

    use super::*;
    use crate::bench::sensed::{bead_of, simulate_with_ring_down};

    #[test]
    fn of_the_chains_own_waveform_both_estimates_are_what_its_intruder_dissipates() {
        let scenario = Scenario::paper();
        let solution = simulate_with_ring_down(&scenario).unwrap();
        let bead = bead_of(&solution, 8).unwrap();
        let settings = derive(&bead, &FrontEnd::reference(), &Capture::default()).unwrap();
        let truth = Truth::of(&scenario, &solution, 8).unwrap();
        let rate = 100e3;
        let count = (scenario.duration * rate) as usize;
        let along = |of: &dyn Fn(f64) -> f64| (0..count).map(|n| of(n as f64 / rate)).collect();
        let waveform = Waveform {
            force: Some(Trace::even(along(&|t| solution.at(t).force(8)), rate)),
            acceleration: Some(Trace::even(
                along(&|t| solution.at(t).intruder_acceleration(8).unwrap()),
                rate,
            )),
            start: 0.0,
            remarks: Vec::new(),
        };
        let given = Given::of(&waveform, &settings, 0.0..scenario.duration - 1e-4);
        let off = |joule: Option<f64>| joule.unwrap() / truth.absorbed - 1.0;
        let (a, b) = (off(given.absorbed_measured), off(given.absorbed_predicted));
        println!(
            "A {a:.2e}, B {b:.2e}, peak {:?} of {}",
            given.peak_force, truth.peak_force
        );
        // Settings have the bead's masses as 32-bit floats, and the chain is sampled at 100 kHz.
        assert!(a.abs() < 1e-4 && b.abs() < 1e-3, "{a:e} {b:e}");
        assert!((given.peak_force.unwrap() / truth.peak_force - 1.0).abs() < 1e-4);
        let force_alone = Waveform {
            acceleration: None,
            ..waveform
        };
        let given = Given::around_its_peak(&force_alone, &settings);
        assert_eq!(given.absorbed_measured, None);
        let absorbed = given.truth().absorbed;
        assert!((absorbed / truth.absorbed - 1.0).abs() < 5e-3, "{absorbed:e}");
    }
}
