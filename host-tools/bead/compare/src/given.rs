//! f64 estimates from a waveform: the bead's equations at much finer steps, without codes and filter. A takes
//! the acceleration, B the force.
//!
//! # Design
//! A record has noise and a zero of its own, and both change energies: a force that is off by 1 % of its peak
//! changes B by more than a quarter. A window is therefore treated as the bead treats its own
//! (docs/estimators.md): its first samples are its zero, the energy that noise adds to A is taken off, and a
//! weak force counts as none for B.

use std::ops::Range;

use bead_model::Settings;
use bead_model::design::{Bead, Surroundings};
use bead_model::layout::{BASELINE, HISTORY_MAX};
use serde::{Deserialize, Serialize};

use crate::f64_estimators;
use crate::sensed::Truth;
use crate::signal::gated;
use bead_instrument::{Trace, Waveform};

/// Steps of A in a sample of the bead: a step is exact for an acceleration that is straight in it.
const FINER_A: usize = 10;
/// Steps of B in a sample of the bead. Each is divided by twenty once more.
const FINER_B: usize = 2;

/// The results of one strike by a waveform, SI units; none where the waveform lacks the quantity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct GivenEstimates {
    /// Highest force, N.
    pub peak_force: Option<f64>,
    /// Estimate A in f64, from the acceleration, J.
    pub absorbed_measured: Option<f64>,
    /// Estimate B in f64, from the force, J.
    pub absorbed_predicted: Option<f64>,
}

impl GivenEstimates {
    /// Estimates for the stretch of a waveform that a window sees: `time`, in s of the waveform.
    pub fn of(waveform: &Waveform, settings: &Settings, time: Range<f64>) -> Self {
        let (bead, around) = physics(settings);
        let rate = f64::from(settings.sample_rate_hz);
        let fine = |trace: &Option<Trace>, finer: usize| {
            let trace = trace.clone()?;
            Some(FineWindow::of(trace, settings, &time, finer))
        };
        let measured = fine(&waveform.acceleration, FINER_A).map(|fine| {
            let energies = f64_estimators::measured(&bead, &fine.values, rate * FINER_A as f64);
            let noise = energies[fine.quiet - 1] / fine.quiet as f64;
            energies[energies.len() - 1] - noise * energies.len() as f64
        });
        let predicted = fine(&waveform.force, FINER_B).map(|fine| {
            let force = gated(&fine.values, settings, fine.noise, FINER_B);
            let energies = f64_estimators::predicted(&bead, &around, &force, rate * FINER_B as f64);
            energies[energies.len() - 1][0]
        });
        let peak = fine(&waveform.force, FINER_A);
        Self {
            peak_force: peak.map(|fine| fine.values.into_iter().fold(0.0, f64::max)),
            absorbed_measured: measured,
            absorbed_predicted: predicted,
        }
    }

    /// Estimates for the window that a bead would open at the rise to the highest force, or around the
    /// highest acceleration.
    pub fn around_its_peak(waveform: &Waveform, settings: &Settings) -> Self {
        let trigger = match (&waveform.force, &waveform.acceleration) {
            (Some(force), _) => trigger(force.clone(), settings),
            (None, acceleration) => acceleration.as_ref().map_or(0.0, |trace| trace.highest().0),
        };
        let rate = f64::from(settings.sample_rate_hz);
        let [before, long] = [settings.window.history, settings.window.length].map(|n| f64::from(n) / rate);
        Self::of(waveform, settings, trigger - before..trigger - before + long)
    }

    /// The truth of a run: the energy from the acceleration if there is one, else from the force.
    pub fn truth(&self) -> Truth {
        Truth {
            peak_force: self.peak_force.unwrap_or(0.0),
            absorbed: self.absorbed_measured.or(self.absorbed_predicted).unwrap_or(0.0),
        }
    }
}

/// A line if noise at the beginning of the force would open windows by itself.
pub fn noise_triggers(waveform: &Waveform, settings: &Settings) -> Option<String> {
    let force = waveform.force.clone()?;
    let rise = f64::from(settings.window.threshold) * settings.force.sensitive.per_code.to_num::<f64>();
    let first = force.begin();
    let baseline = f64::from(BASELINE) / f64::from(settings.sample_rate_hz);
    let noise = FineWindow::of(force, settings, &(first..first + baseline), 1).noise;
    // The difference of two samples has the noise of both.
    (SIGMAS * 2.0_f64.sqrt() * noise > rise).then(|| {
        format!(
            "its force has noise of {noise:.3} N rms at the bead's samples, and the trigger asks for a rise of {rise:.3} N, so \
             noise alone opens windows; filter it, or give the bead a higher threshold"
        )
    })
}

/// Standard deviations within which noise stays for some thousand samples.
const SIGMAS: f64 = 3.5;

/// The instant from which the force rises as steeply as settings ask, on its way to its highest value, s.
fn trigger(mut force: Trace, settings: &Settings) -> f64 {
    let sample = 1.0 / f64::from(settings.sample_rate_hz);
    let rise = f64::from(settings.window.threshold) * settings.force.sensitive.per_code.to_num::<f64>();
    let before = f64::from(settings.window.lookback) * sample;
    let peak = force.highest().0;
    let mut at = |time: f64| force.around(time, 0.5 * sample);
    let rises = |time: &f64| at(*time) >= at(time - before) + rise;
    let back = (0..HISTORY_MAX).map(|n| peak - n as f64 * sample);
    back.take_while(rises).last().unwrap_or(peak)
}

/// A quantity in a window at steps that are finer than the bead's samples.
struct FineWindow {
    /// Values relative to the zero of the window, at least one.
    values: Vec<f64>,
    /// Steps before the strike, at least one.
    quiet: usize,
    /// Noise at the beginning, rms.
    noise: f64,
}

impl FineWindow {
    fn of(mut trace: Trace, settings: &Settings, time: &Range<f64>, finer: usize) -> Self {
        let sample = 1.0 / f64::from(settings.sample_rate_hz);
        let step = sample / finer as f64;
        let count = ((time.end - time.start) / step).round().max(1.0) as usize;
        let at = |n: usize| time.start + n as f64 * step;
        let mut values: Vec<f64> = (0..count).map(|n| trace.around(at(n), 0.5 * sample)).collect();
        let first = &values[..count.min(usize::from(BASELINE) * finer)];
        let zero = first.iter().sum::<f64>() / first.len() as f64;
        let squares = first.iter().map(|value| (value - zero).powi(2));
        let noise = (squares.sum::<f64>() / first.len() as f64).sqrt();
        values.iter_mut().for_each(|value| *value -= zero);
        Self {
            values,
            quiet: count.min(usize::from(settings.window.noise_end()) * finer).max(1),
            noise,
        }
    }
}

/// The bead and its neighbours that settings are made for.
pub(crate) fn physics(settings: &Settings) -> (Bead, Surroundings) {
    let description = settings.description();
    (description.physics(), description.surroundings())
}

#[cfg(test)]
mod tests {
    use bead_model::design::{Capture, FrontEnd, derive};
    use hertz_chain::Scenario;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::sensed::{bead_of, simulate_with_ring_down};
    use crate::testing::waveform;

    /// The paper's strike at bead 8, as an instrument has it: `rate` rows a second, each put through `row`.
    fn recorded(rate: f64, mut row: impl FnMut(usize, f64) -> f64) -> (Waveform, Settings, Truth) {
        let scenario = Scenario::paper();
        let solution = simulate_with_ring_down(&scenario).unwrap();
        let bead = bead_of(&solution, 8).unwrap();
        let settings = derive(&bead, &FrontEnd::reference(), &Capture::default()).unwrap();
        let truth = Truth::of(&scenario, &solution, 8).unwrap();
        let before = 3e-3;
        let times = (0..((before + solution.end()) * rate) as usize).map(|n| n as f64 / rate - before);
        let acceleration_at = |t: f64| solution.at(t.max(0.0)).intruder_acceleration(8).unwrap();
        let force_at = |t: f64| solution.at(t.max(0.0)).force(8);
        let force = times.clone().map(|t| row(0, force_at(t))).collect();
        let acceleration = times.map(|t| row(1, acceleration_at(t))).collect();
        let [force, acceleration] = [force, acceleration].map(|values| Some(Trace::even(values, rate)));
        let waveform = waveform(force, acceleration);
        (waveform, settings, truth)
    }

    fn off(waveform: &Waveform, settings: &Settings, truth: Truth) -> [f64; 2] {
        let given = GivenEstimates::around_its_peak(waveform, settings);
        [given.absorbed_measured, given.absorbed_predicted].map(|joule| joule.unwrap() / truth.absorbed - 1.0)
    }

    #[test]
    fn of_the_chains_own_waveform_both_estimates_are_what_its_intruder_dissipates() {
        for rate in [100e3, 2e6] {
            let (waveform, settings, truth) = recorded(rate, |_, value| value);
            let [a, b] = off(&waveform, &settings, truth);
            println!("{rate} Hz: A {a:.2e}, B {b:.2e}");
            // B has five beads of the chain, and takes weak forces for none.
            assert!(a.abs() < 1e-5 && b.abs() < 3e-4, "{a:e} {b:e}");
            let given = GivenEstimates::around_its_peak(&waveform, &settings);
            assert!((given.peak_force.unwrap() / truth.peak_force - 1.0).abs() < 3e-4);
        }
        let (mut waveform, settings, truth) = recorded(100e3, |_, value| value);
        waveform.acceleration = None;
        let given = GivenEstimates::around_its_peak(&waveform, &settings);
        assert_eq!(given.absorbed_measured, None);
        let absorbed = given.truth().absorbed;
        assert!((absorbed / truth.absorbed - 1.0).abs() < 3e-4, "{absorbed:e}");
    }

    #[test]
    fn a_zero_that_is_off_and_noise_change_neither_estimate() {
        // Zero and noise as parts of the peak, and how far a single strike may be off.
        for (rate, zero, noise, most) in [
            (1e6, 0.01, 0.0, 3e-4),
            (1e6, -0.02, 0.0, 3e-4),
            (1e6, 0.0, 0.01, 6e-3),
            (100e3, 0.005, 0.002, 6e-3),
        ] {
            let mut chance = ChaCha8Rng::seed_from_u64(1);
            // Parts of the highest force, 6 N, and of the greatest acceleration, 300 m/s².
            let (waveform, settings, truth) = recorded(rate, |sensor, value| {
                let scale = [6.0, 300.0][sensor];
                let scatter: f64 = (0..12).map(|_| chance.random_range(-0.5..0.5)).sum();
                value + scale * (zero + noise * scatter)
            });
            let [a, b] = off(&waveform, &settings, truth);
            println!("{rate} Hz, zero {zero}, noise {noise}: A {a:.2e}, B {b:.2e}");
            assert!(a.abs() < most && b.abs() < most, "{a:e} {b:e}");
        }
    }
}
