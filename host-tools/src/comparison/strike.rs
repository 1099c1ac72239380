//! Device, replay, f64 from the same samples and the full f64 chain, side by side.
//!
//! # Design
//! From the full chain to the device, each step adds one source of error: sampling, twelve bits, noise and the
//! reduced chain; then fixed point; then nothing, for replay and device must agree in every bit.
//!
//! The recording does not say when the striker hit. Each strike is therefore placed in time where its force fits the
//! simulated one best; the acceleration, taken [`SCAN_SKEW`] later, follows.

use bead_model::calibration::Channel;
use bead_model::design::Bead;
use bead_model::layout::BASELINE;
use bead_model::reduced_chain::FOOT;
use bead_model::sensor::Sensor;
use bead_wire::{FINE_UNIT, FORCE_UNIT_N};
use fixed::types::extra::LeEqU32;
use hertz_chain::{PulseSearch, Scenario, Snapshot, Solution};
use serde::Serialize;

use crate::bench::front_end::SCAN_SKEW;
use crate::bench::sensed::{Truth, bead_of, simulate_with_ring_down, unlike_the_reduced_chain};
use crate::cli::failure::Failure;
use crate::comparison::f64_estimators;
use crate::comparison::replay::{Replay, replay};
use crate::recording::frames::{flag_names, joules, newton_seconds};
use crate::recording::strikes::{Codes, RecordedStrike};

/// Goal for estimate A against the full chain.
pub const GOAL_A: f64 = 2e-3;
/// Goal for estimate B against the full chain.
pub const GOAL_B: f64 = 5e-3;

/// What one side says of a strike, SI units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Values {
    /// Highest force, N.
    pub peak_force: f64,
    /// Estimate A, J; of the full chain, what the intruder dissipates.
    pub absorbed_measured: f64,
    /// Estimate B, J; of the full chain, what the intruder dissipates.
    pub absorbed_predicted: f64,
}

impl Values {
    fn of(said: &bead_wire::Strike) -> Self {
        Self {
            peak_force: f64::from(said.peak_force) * FORCE_UNIT_N,
            absorbed_measured: joules(said.absorbed_measured),
            absorbed_predicted: joules(said.absorbed_predicted),
        }
    }

    /// Relative to `truth`.
    fn relative_to(&self, truth: &Self) -> Self {
        Self {
            peak_force: self.peak_force / truth.peak_force - 1.0,
            absorbed_measured: self.absorbed_measured / truth.absorbed_measured - 1.0,
            absorbed_predicted: self.absorbed_predicted / truth.absorbed_predicted - 1.0,
        }
    }
}

/// One strike, four times.
#[derive(Debug, Clone, Serialize)]
pub struct StrikeComparison {
    /// Its number since the bead's reset.
    pub strike: u32,
    /// Sample index of the trigger.
    pub sample_index: u64,
    /// What the bead sent.
    pub device: Values,
    /// What this computer makes of the same codes with the same code; none if it could not be replayed.
    pub replay: Option<Values>,
    /// Whether the two agree in every bit.
    pub replay_identical: bool,
    /// Where they part first.
    pub first_difference: Option<String>,
    /// What f64 makes of the same codes; none if codes are missing.
    pub f64_samples: Option<Values>,
    /// What the full chain says.
    pub f64_chain: Values,
    /// Device against full chain, as a part of it.
    pub deviation: Values,
    /// What the deviations of A and B may be.
    pub goal: Goal,
    /// Noise of the force before the strike, N rms.
    pub force_noise: f64,
    /// Names of the strike's flags.
    pub flags: Vec<&'static str>,
    /// Its shape; none if that or the samples were not received.
    pub shape: Option<ShapeComparison>,
    /// Whether the goals are met and replay is identical.
    pub pass: bool,
    /// What the figures show.
    #[serde(skip)]
    pub traces: Option<Traces>,
}

/// The shape of a strike: of the bead, and of the full chain.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ShapeComparison {
    /// As the bead sent it.
    pub device: Shape,
    /// Of the full chain; its ringing is that of a host that flies free.
    pub f64_chain: Shape,
}

/// The shape of a strike in SI units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Shape {
    /// Full width at half height of the force, s.
    pub width: f64,
    /// Momentum that came in over the window, N·s.
    pub impulse: f64,
    /// Frequency of the intruder's ringing after the pulse, Hz.
    pub ring_frequency: f64,
    /// Decay of its amplitude, 1/s.
    pub ring_decay: f64,
    /// Stiffness that rings so, k = μ (ω² + β²), N/m.
    pub stiffness: f64,
    /// Damping that decays so, c = 2 μ β, N·s/m.
    pub damping: f64,
}

impl Shape {
    /// With the reduced mass μ of intruder and host, kg.
    fn of(said: &bead_wire::Shape, rate_hz: u32, reduced: f64) -> Self {
        let fine = |bits: u32| f64::from(bits) * FINE_UNIT;
        let (frequency, decay) = (fine(said.ring_frequency), fine(said.ring_decay));
        let omega = std::f64::consts::TAU * frequency;
        Self {
            width: fine(said.width) / f64::from(rate_hz),
            impulse: newton_seconds(said.impulse, rate_hz),
            ring_frequency: frequency,
            ring_decay: decay,
            stiffness: reduced * (omega * omega + decay * decay),
            damping: 2.0 * reduced * decay,
        }
    }
}

/// Goals for the estimates of a strike.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Goal {
    /// For A.
    pub absorbed_measured: f64,
    /// For B.
    pub absorbed_predicted: f64,
}

/// What the sensors delivered, or what the chain did, over the time since the striker hit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensed {
    /// When, s.
    pub time: f64,
    /// Sensed, the front end's pole taken out.
    pub sensed: f64,
    /// Simulated at that time.
    pub simulated: f64,
}

/// An estimate of the absorbed energy at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Absorbed {
    /// When, s since the striker hit.
    pub time: f64,
    /// By the estimate, J.
    pub estimate: f64,
    /// By the full chain at that time, J.
    pub chain: f64,
}

/// Curves of a strike.
#[derive(Debug, Clone, Default)]
pub struct Traces {
    /// Force, N.
    pub force: Vec<Sensed>,
    /// Acceleration, m/s², taken [`SCAN_SKEW`] after the force.
    pub acceleration: Vec<Sensed>,
    /// A and B in f64 from the same samples.
    pub f64_samples: [Vec<Absorbed>; 2],
    /// A and B replayed.
    pub replay: [Vec<Absorbed>; 2],
    /// A and B from the device, at the ends of its chunks.
    pub device: [Vec<Absorbed>; 2],
}

/// What is compared against: the full chain, run once for all strikes.
pub struct Chain {
    bead: usize,
    physics: Bead,
    solution: Solution,
    truth: Truth,
    peak_time: f64,
}

impl Chain {
    /// Runs the full chain of `scenario` around bead `bead`.
    ///
    /// # Errors
    /// The bead has no intruder, or the scenario cannot be run.
    pub fn run(scenario: &Scenario, bead: usize) -> Result<Self, Failure> {
        let solution = simulate_with_ring_down(scenario)?;
        let physics = bead_of(&solution, bead)?;
        let truth = Truth::of(scenario, &solution, bead)?;
        let peaks = solution.summary().peak_force;
        let peak_time = peaks
            .iter()
            .find(|peak| peak.contact == bead)
            .map_or(0.0, |peak| peak.time);
        Ok(Self {
            bead,
            physics,
            solution,
            truth,
            peak_time,
        })
    }

    /// What to know about estimate B at this bead, if anything.
    pub fn note(&self) -> Option<String> {
        unlike_the_reduced_chain(&self.solution, self.bead)
    }

    /// The strike, four times.
    pub fn compare(&self, strike: &RecordedStrike) -> StrikeComparison {
        let replay = replay(strike);
        let device = Values::of(&strike.said);
        let f64_chain = Values {
            peak_force: self.truth.peak_force,
            absorbed_measured: self.truth.absorbed,
            absorbed_predicted: self.truth.absorbed,
        };
        let deviation = device.relative_to(&f64_chain);
        let traces = self.traces(strike, &replay);
        let goal = Goal {
            absorbed_measured: GOAL_A,
            absorbed_predicted: GOAL_B,
        };
        let pass = replay.identical()
            && deviation.absorbed_measured.abs() <= goal.absorbed_measured
            && deviation.absorbed_predicted.abs() <= goal.absorbed_predicted;
        StrikeComparison {
            strike: strike.said.strike,
            sample_index: strike.said.trigger_index,
            device,
            replay: replay.said.as_ref().map(Values::of),
            replay_identical: replay.identical(),
            first_difference: replay.first_difference,
            f64_samples: traces.as_ref().map(|traces| {
                let [measured, predicted] = traces
                    .f64_samples
                    .each_ref()
                    .map(|curve| curve.last().map_or(0.0, |last| last.estimate));
                Values {
                    peak_force: traces.force.iter().map(|point| point.sensed).fold(0.0, f64::max),
                    absorbed_measured: measured,
                    absorbed_predicted: predicted,
                }
            }),
            f64_chain,
            deviation,
            goal,
            force_noise: force_noise(strike),
            flags: flag_names(strike.said.flags),
            shape: self.shape(strike, traces.as_ref()),
            pass,
            traces,
        }
    }

    fn shape(&self, strike: &RecordedStrike, traces: Option<&Traces>) -> Option<ShapeComparison> {
        let (said, force) = (strike.shape?, &traces?.force);
        let Bead {
            mass,
            intruder_mass,
            stiffness,
            damping,
            ..
        } = self.physics;
        let reduced = intruder_mass * (mass - intruder_mass) / mass;
        let device = Shape::of(&said, strike.settings?.sample_rate_hz, reduced);
        let inside = |time: f64| time.clamp(0.0, self.solution.end());
        let window = [force.first()?, force.last()?].map(|point| inside(point.time));
        let pulses = self.solution.pulses(self.bead, &PulseSearch::default());
        let pulse = pulses.into_iter().max_by(|a, b| a.force.total_cmp(&b.force))?;
        let decay = 0.5 * damping / reduced;
        Some(ShapeComparison {
            device,
            f64_chain: Shape {
                width: pulse.fwhm?,
                impulse: self
                    .solution
                    .flow(self.bead)
                    .between(window[0], window[1])
                    .impulse,
                ring_frequency: (stiffness / reduced - decay * decay).max(0.0).sqrt() / std::f64::consts::TAU,
                ring_decay: decay,
                stiffness,
                damping,
            },
        })
    }

    fn traces(&self, strike: &RecordedStrike, replay: &Replay) -> Option<Traces> {
        let settings = strike.settings.as_ref()?;
        if strike.missing() > 0 || strike.scans.len() <= usize::from(BASELINE) {
            return None;
        }
        let rate = f64::from(settings.sample_rate_hz);
        let force = sensed(&strike.scans, 0, &settings.force);
        let acceleration = sensed(&strike.scans, 1, &settings.acceleration);
        let gate = f64::max(
            settings.chain.gate.to_num(),
            3.0 * FORCE_UNIT_N * f64::from(strike.said.force_noise),
        );
        // The bead looks at forces from the foot of the wave on, and takes them for noise when some in a row were.
        let foot = usize::from(settings.window.noise_end());
        let mut silent = 0;
        let gated: Vec<f64> = (0..)
            .zip(&force)
            .map(|(sample, &force)| {
                let quiet = sample >= foot && force.abs() < gate;
                silent = if quiet { silent + 1 } else { 0 };
                if sample < foot || silent > FOOT {
                    0.0
                } else {
                    force
                }
            })
            .collect();
        let measured = f64_estimators::measured(&self.physics, &acceleration, rate);
        let predicted = f64_estimators::predicted(&self.physics, &gated, rate);
        let start = self.place(&force, rate);
        let at = |sample: f64| start + sample / rate;
        let force = self.beside(&force, at(0.0), rate, |s| s.force(self.bead));
        let acceleration_at = at(0.0) + SCAN_SKEW;
        let acceleration = self.beside(&acceleration, acceleration_at, rate, |s| {
            s.intruder_acceleration(self.bead).unwrap_or(0.0)
        });
        // Both estimates of the device know a sample when the next one is there, and count it in full: after
        // sample n they stand for the time n - 1/2. A's samples are the acceleration's, a skew later.
        let along = |offset: f64, energies: &mut dyn Iterator<Item = (usize, f64)>| -> Vec<Absorbed> {
            let mut sampler = self.solution.sampler();
            energies
                .map(|(sample, estimate)| {
                    let time = at(sample as f64) + offset;
                    let inside = sampler.at(time.clamp(0.0, self.solution.end()));
                    Absorbed {
                        time,
                        estimate,
                        chain: inside.intruder_dissipated(self.bead).unwrap_or(0.0),
                    }
                })
                .collect()
        };
        let half = -0.5 / rate;
        let chunks = || strike.chunks.iter();
        let replayed = || replay.energies.iter().enumerate();
        Some(Traces {
            force,
            acceleration,
            f64_samples: [
                along(SCAN_SKEW, &mut measured.iter().copied().enumerate()),
                along(0.0, &mut predicted.iter().copied().enumerate()),
            ],
            replay: [
                along(
                    half + SCAN_SKEW,
                    &mut replayed().map(|(i, energy)| (i, joules(energy.0))),
                ),
                along(half, &mut replayed().map(|(i, energy)| (i, joules(energy.1)))),
            ],
            device: [
                along(
                    half + SCAN_SKEW,
                    &mut chunks().map(|c| (c.end - 1, joules(c.absorbed_measured))),
                ),
                along(
                    half,
                    &mut chunks().map(|c| (c.end - 1, joules(c.absorbed_predicted))),
                ),
            ],
        })
    }

    /// Samples beside what the chain did at their times, 0 outside its run.
    fn beside(
        &self,
        samples: &[f64],
        start: f64,
        rate: f64,
        quantity: impl Fn(&Snapshot<'_>) -> f64,
    ) -> Vec<Sensed> {
        let mut sampler = self.solution.sampler();
        samples
            .iter()
            .enumerate()
            .map(|(i, &sensed)| {
                let time = start + i as f64 / rate;
                let inside = (0.0..=self.solution.end()).contains(&time);
                Sensed {
                    time,
                    sensed,
                    simulated: if inside { quantity(&sampler.at(time)) } else { 0.0 },
                }
            })
            .collect()
    }

    /// Time since the striker hit of the window's first sample: where the squared distance of sensed and simulated
    /// force is least.
    fn place(&self, force: &[f64], rate: f64) -> f64 {
        let peak = (0..force.len())
            .max_by(|&a, &b| force[a].total_cmp(&force[b]))
            .unwrap_or(0);
        // The pulse and what follows it at once: later waves are small and cost time.
        let near = peak.saturating_sub(40)..(peak + 80).min(force.len());
        let distance = |start: f64| -> f64 {
            let mut sampler = self.solution.sampler();
            near.clone()
                .map(|i| {
                    let t = start + i as f64 / rate;
                    let inside = (0.0..=self.solution.end()).contains(&t);
                    let simulated = if inside {
                        sampler.at(t).force(self.bead)
                    } else {
                        0.0
                    };
                    (force[i] - simulated).powi(2)
                })
                .sum()
        };
        let guess = self.peak_time - peak as f64 / rate;
        least(guess - 2.0 / rate, guess + 2.0 / rate, distance)
    }
}

/// A sensor's signal in its unit, relative to the quiet start of the window, filter and delay taken out: from the channel of
/// the high gain wherever that is away from its rails.
fn sensed<F: LeEqU32>(scans: &[Codes], sensor: usize, calibration: &Sensor<F>) -> Vec<f64> {
    let sensitive: Vec<f64> = scans.iter().map(|scan| scan.sensitive[sensor].into()).collect();
    // Codes that were not sent had no part in the window.
    let wide = |scan: &Codes| scan.wide.map_or(f64::NAN, |wide| wide[sensor].into());
    let wide: Vec<f64> = scans.iter().map(wide).collect();
    let values = channel(&sensitive, &calibration.sensitive);
    let wides = channel(&wide, &calibration.wide);
    let believable = |at: usize| {
        let reach = at.saturating_sub(1)..(at + 2).min(scans.len());
        sensitive[reach].iter().all(|code| (64.0..=4031.0).contains(code))
    };
    // Where both channels see a signal that moves, they are made to agree.
    let per_code = calibration.sensitive.per_code.to_num::<f64>();
    let differences: Vec<f64> = (0..scans.len())
        .filter(|&at| believable(at) && values[at].abs() >= 1024.0 * per_code)
        .map(|at| wides[at] - values[at])
        .filter(|difference| difference.is_finite())
        .collect();
    let offset = differences.iter().sum::<f64>() / (differences.len() + 1) as f64;
    (0..scans.len())
        .map(|at| match believable(at) || wides[at].is_nan() {
            true => values[at],
            false => wides[at] - offset,
        })
        .collect()
}

/// A channel's codes in its unit.
fn channel<F: LeEqU32>(codes: &[f64], channel: &Channel<F>) -> Vec<f64> {
    let quiet = &codes[..usize::from(BASELINE)];
    let zero = quiet.iter().sum::<f64>() / quiet.len() as f64;
    let (per_code, slope) = (channel.per_code.to_num::<f64>(), channel.slope.to_num::<f64>());
    let values: Vec<f64> = codes.iter().map(|code| (code - zero) * per_code).collect();
    // The slope is per change over two samples.
    f64_estimators::lead(&values, 2.0 * slope / per_code)
}

/// Noise of the force before the strike, N rms.
fn force_noise(strike: &RecordedStrike) -> f64 {
    let quiet = strike
        .scans
        .iter()
        .take(usize::from(BASELINE))
        .map(|scan| f64::from(scan.sensitive[0]));
    let count = quiet.clone().count().max(1) as f64;
    let mean = quiet.clone().sum::<f64>() / count;
    let codes = (quiet.map(|code| (code - mean).powi(2)).sum::<f64>() / count).sqrt();
    let per_code = strike
        .settings
        .map_or(0.0, |settings| settings.force.sensitive.per_code.to_num::<f64>());
    codes * per_code
}

/// Where a function with one minimum between `low` and `high` has it: golden section, to a part in a million of
/// the interval.
fn least(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
    let ratio = 0.5 * (5f64.sqrt() - 1.0);
    let (mut a, mut b) = (high - ratio * (high - low), low + ratio * (high - low));
    let (mut fa, mut fb) = (f(a), f(b));
    for _ in 0..29 {
        if fa < fb {
            (high, b, fb) = (b, a, fa);
            a = high - ratio * (high - low);
            fa = f(a);
        } else {
            (low, a, fa) = (a, b, fb);
            b = low + ratio * (high - low);
            fb = f(b);
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::testing::{paper_scenario, recorded_strike};

    #[test]
    fn a_strike_made_by_the_model_meets_every_goal() {
        let chain = Chain::run(&paper_scenario(), 8).unwrap();
        let comparison = chain.compare(&recorded_strike());
        println!("{:#?} {:#?}", comparison.deviation, comparison.goal);
        assert!(comparison.pass);
        assert_eq!(comparison.first_difference, None);
        // 5 mN of noise and twelve bits over 16 N.
        assert!(
            (comparison.force_noise / 5.1e-3 - 1.0).abs() < 0.3,
            "{}",
            comparison.force_noise
        );
    }

    #[test]
    fn the_strike_is_placed_in_time_within_a_hundredth_of_a_sample() {
        let chain = Chain::run(&paper_scenario(), 8).unwrap();
        let strike = recorded_strike();
        let traces = chain.compare(&strike).traces.unwrap();
        // The test's strike began at 20 ms, and index 1 is time 0.
        let true_start = (strike.said.first_index as f64 - 1.0) * 1e-5 - 0.02;
        let samples = (traces.force[0].time - true_start) * 1e5;
        assert!(samples.abs() < 0.01, "{samples}");
        let worst = |curve: &[Sensed]| {
            curve
                .iter()
                .map(|p| (p.sensed - p.simulated).abs())
                .fold(0.0, f64::max)
        };
        // Noise of 5 mN at four sigma, and rounding; noise of 0.05 m/s², and rounding to 0.12 m/s².
        assert!(worst(&traces.force) < 0.03, "{}", worst(&traces.force));
        assert!(
            worst(&traces.acceleration) < 0.5,
            "{}",
            worst(&traces.acceleration)
        );
        // The curves of energy stay together all the way, not at their ends only.
        for curves in [&traces.f64_samples, &traces.replay, &traces.device] {
            for curve in curves {
                let off = curve
                    .iter()
                    .map(|p| (p.estimate - p.chain).abs())
                    .fold(0.0, f64::max);
                assert!(off < 3e-3 * 8.297e-7, "{off:e} J");
            }
        }
    }

    #[test]
    fn an_estimate_out_of_its_goal_does_not_pass() {
        let chain = Chain::run(&paper_scenario(), 8).unwrap();
        let mut scenario = paper_scenario();
        // Energy goes with the square of the speed: 0.4 % off, twice A's goal.
        scenario.striker.velocity *= 1.002;
        let other = Chain::run(&scenario, 8).unwrap();
        let strike = recorded_strike();
        assert!(chain.compare(&strike).pass);
        assert!(!other.compare(&strike).pass);
    }

    #[test]
    fn golden_section_finds_the_bottom_of_a_parabola() {
        assert!((least(-3.0, 5.0, |x| (x - 1.234).powi(2)) - 1.234).abs() < 1e-5);
    }
}
