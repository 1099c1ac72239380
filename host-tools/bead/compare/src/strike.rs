//! Device, replay, f64 from the same samples and the full f64 chain, side by side.
//!
//! # Design
//! Each step from the full chain to the device adds one source of error: first sampling, twelve bits, noise
//! and the reduced chain, then fixed point. The last step, from replay to device, adds nothing: they must
//! agree in every bit. The recording does not say when the striker hit. Each strike is placed at the time
//! where its force fits the simulated force best; the acceleration was taken [`SCAN_SKEW`] later.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use bead_model::design::{Bead, Capture, FrontEnd, Surroundings};
use bead_wire::StrikeFlags;
use hertz_chain::{Curve, Pulse, PulseSearch, Scenario, Solution};
use hertz_charts::Chart;
use serde::Serialize;

use crate::agreement::agrees;
use crate::energy_uncertainties::EnergyUncertainties;
use crate::error::CompareError;
use crate::front_end::SCAN_SKEW;
use crate::goal::StrikeGoal;
use crate::pictures::{residual_chart, strike_chart};
use crate::replay::{Replay, ReplayWord, replay};
use crate::sensed::{
    Truth, bead_of, rings_alone, simulate_with_ring_down, surroundings_of, unlike_the_reduced_chain,
};
use crate::signal::{StrikeSignals, force_noise, least};
use crate::spread::Spread;
use crate::traces::{AbsorbedPoint, SensedPoint, Traces};
use crate::values::StrikeValues;
use bead_recording::strikes::RecordedStrike;

/// Supply and temperature next to a strike, as the bead measured them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct StrikeConditions {
    /// Supply of the converter, V.
    pub supply: f64,
    /// Temperature of the die, °C.
    pub die_temperature: f64,
}

impl StrikeConditions {
    /// The conditions of a strike; `None` if they were not measured yet, or not received.
    pub fn of(strike: &RecordedStrike) -> Option<Self> {
        strike.shape?.conditions.map(|conditions| Self {
            supply: conditions.supply.volts(),
            die_temperature: conditions.die_temperature.degrees_celsius(),
        })
    }
}

impl fmt::Display for StrikeConditions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.3} V, {:.1} °C", self.supply, self.die_temperature)
    }
}

/// One strike, from four sources.
#[derive(Debug, Clone, Default, Serialize, schemars::JsonSchema)]
pub struct StrikeComparison {
    /// Its number since the bead's reset.
    pub strike: u32,
    /// Sample index of the trigger.
    pub sample_index: u64,
    /// By the bead.
    pub device: StrikeValues,
    /// The result of the bead's code on this computer, from the same samples; none if it could not be
    /// replayed.
    pub replay: Option<StrikeValues>,
    /// True if the two agree in every bit.
    pub replay_identical: bool,
    /// Their first difference.
    pub first_difference: Option<String>,
    /// Cause for which it was not replayed to its end.
    pub replay_incomplete: Option<String>,
    /// The result of the replay.
    #[serde(skip)]
    pub(crate) replay_word: ReplayWord,
    /// The result of f64 estimates from the same samples; none if samples are missing.
    pub f64_samples: Option<StrikeValues>,
    /// By the full chain.
    pub f64_chain: StrikeValues,
    /// Device against full chain, as a part of it.
    pub deviation: StrikeValues,
    /// Greatest deviations of A and B. What the chain explains is in them.
    pub goal: StrikeGoal,
    /// Expanded uncertainties (95 %) of the deviations of A and B by the strike's own noise; none of one of
    /// several strikes, and where samples or settings are missing.
    pub noise_allowance: Option<StrikeGoal>,
    /// Noise of the force before the strike, N rms.
    pub force_noise: f64,
    /// Names of the strike's flags.
    pub flags: Vec<&'static str>,
    /// Supply and temperature; none if they were not measured yet, or not received.
    pub conditions: Option<StrikeConditions>,
    /// Standard uncertainties of its energies, if the settings state those of all inputs.
    pub uncertainty: Option<EnergyUncertainties>,
    /// Its shape; none if the shape or the samples were not received.
    pub shape: Option<ShapeComparison>,
    /// True if the goals are met and replay is identical; of one of several strikes, only the latter.
    pub pass: bool,
    /// True if it is the only strike, and is itself held to the goals.
    #[serde(skip)]
    pub(crate) alone: bool,
    /// Energy that the main wave brought by the bead's force and the reduced chain behind it, as in estimate
    /// B, in f64, J. None where samples or settings are missing, the force left the range of the sensor, or
    /// the chain is under a load, which the reduced one is not.
    #[serde(skip)]
    pub(crate) incident: Option<f64>,
    #[serde(skip)]
    pub(crate) traces: Option<Traces>,
}

impl StrikeComparison {
    /// Marks the strike as one of several, which are judged together.
    pub(crate) fn join_others(&mut self) {
        self.pass = self.replay_identical;
        self.alone = false;
    }

    /// Judges a single strike by its goals and its own noise.
    pub(crate) fn judge(&mut self, [a, b]: &[Spread; 2]) {
        self.pass = self.replay_identical && a.pass && b.pass;
        self.noise_allowance = a.uncertainty.and(b.uncertainty).map(|_| StrikeGoal {
            absorbed_measured: a.uncertainty,
            absorbed_predicted: b.uncertainty,
        });
    }

    /// Charts of the strike and of its difference from the simulation; `None` if its curves are not kept.
    pub fn charts(&self) -> Option<[Chart; 2]> {
        let traces = self.traces.as_ref()?;
        Some([strike_chart(traces), residual_chart(traces)])
    }
}

/// The shape of a strike: of the bead, and of the full chain.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct ShapeComparison {
    /// As the bead sent it.
    pub device: ShapeValues,
    /// Of the full chain. The ringing is computed for a host that flies free.
    pub f64_chain: ShapeValues,
}

/// The shape of a strike in SI units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct ShapeValues {
    /// Full width at half height of the force, s.
    pub width: f64,
    /// Momentum that came in over the window, N·s.
    pub impulse: f64,
    /// Frequency of the intruder's ringing after the pulse, Hz.
    pub ring_frequency: f64,
    /// Decay of its amplitude, 1/s.
    pub ring_decay: f64,
    /// Stiffness from the ringing, k = μ (ω² + β²), N/m; none where there is no ringing, and for a bead among
    /// others with intruders, whose ringing is not its own alone.
    pub stiffness: Option<f64>,
    /// Damping from the decay, c = 2 μ β, N·s/m; none as the stiffness.
    pub damping: Option<f64>,
}

impl ShapeValues {
    /// A bead's shape. `reduced` is the reduced mass μ of intruder and host, kg, if the bead rings alone.
    fn of(said: &bead_wire::Shape, rate_hz: u32, reduced: Option<f64>) -> Self {
        let (frequency, decay) = (said.ring_frequency.hertz(), said.ring_decay.per_second());
        let omega = std::f64::consts::TAU * frequency;
        let reduced = reduced.filter(|_| frequency > 0.0);
        Self {
            width: said.width.samples() / f64::from(rate_hz),
            impulse: said.impulse.newton_seconds(rate_hz),
            ring_frequency: frequency,
            ring_decay: decay,
            stiffness: reduced.map(|reduced| reduced * (omega * omega + decay * decay)),
            damping: reduced.map(|reduced| 2.0 * reduced * decay),
        }
    }
}

/// Least height of the wave that opens the window of the main wave, as a part of the highest wave's.
const HIGH: f64 = 0.5;
/// Reach of a pulse on either side of its peak, in samples.
const PULSE: f64 = 60.0;

/// The full chain that strikes are compared with. It is run once for all strikes.
pub struct FullChain {
    bead: usize,
    physics: Bead,
    around: Surroundings,
    /// True if no other intruder changes the bead's ringing.
    rings_alone: bool,
    /// Greatest errors of A and of B that it explains, as parts; infinite without a bound.
    explained: [f64; 2],
    /// Goals for its estimates.
    pub(crate) goal: StrikeGoal,
    solution: Arc<Solution>,
    pub(crate) truth: Truth,
    /// The main wave at its incoming contact.
    pub(crate) pulse: Option<Pulse>,
    /// The greatest force of the main wave beyond the load, N, and when it comes, s.
    peak: (f64, f64),
    /// Static load of the bead's incoming contact, N.
    pub(crate) load: f64,
    /// Force at the bead's incoming contact beyond the load, and acceleration of its intruder.
    force: Curve,
    acceleration: Curve,
}

impl FullChain {
    /// Runs the full chain of `scenario` around bead `bead`.
    ///
    /// # Errors
    /// The bead has no intruder, or the scenario cannot be run.
    pub fn run(scenario: &Scenario, bead: usize) -> Result<Self, CompareError> {
        Self::of(scenario, &Arc::new(simulate_with_ring_down(scenario)?), bead)
    }

    /// Uses a solution of `scenario`, [with ring-down](simulate_with_ring_down).
    ///
    /// # Errors
    /// The bead has no intruder, or no force reaches it.
    pub fn of(scenario: &Scenario, solution: &Arc<Solution>, bead: usize) -> Result<Self, CompareError> {
        let physics = bead_of(solution, bead)?;
        let truth = Truth::of(scenario, solution, bead)?;
        let acceleration = solution.acceleration_curve(bead);
        let load = solution.model().contact(bead).load;
        let explained = unlike_the_reduced_chain(solution, bead).explained;
        let mut pulses = solution.pulses(bead, &PulseSearch::default());
        pulses.retain(|pulse| pulse.time <= scenario.duration);
        let capture = Capture::of(&physics, &FrontEnd::reference());
        let pulse = main_wave(&pulses, load, capture.length - capture.history);
        let summary = || {
            let peaks = solution.summary().peak_force;
            peaks
                .iter()
                .find(|peak| peak.contact == bead)
                .map(|peak| (peak.force, peak.time))
        };
        let peak = pulse.map(|pulse| (pulse.force, pulse.time)).or_else(summary);
        Ok(Self {
            bead,
            physics,
            around: surroundings_of(solution, bead),
            rings_alone: rings_alone(solution, bead),
            goal: StrikeGoal::beyond(explained),
            explained,
            truth,
            pulse,
            peak: peak.map_or((0.0, 0.0), |(force, time)| (force - load, time)),
            load,
            force: solution.force_beyond_curve(bead),
            acceleration: acceleration.expect("a bead without an intruder was refused"),
            solution: Arc::clone(solution),
        })
    }

    /// The energy that the main wave brings to the bead, J: its work on the bead. `None` if the wave comes
    /// from the far end.
    pub(crate) fn incident(&self) -> Option<f64> {
        let pulse = self.pulse?;
        let passed = self.solution.flow(self.bead).between(pulse.from, pulse.to);
        let contact = self.solution.model().contact(self.bead);
        let held = |time: f64| contact.energy(self.solution.at(time).overlap(self.bead));
        let brought = passed.energy - passed.lost - (held(pulse.to) - held(pulse.from));
        Some(brought).filter(|brought| *brought > 0.0)
    }

    /// The instant at which the force at the bead's incoming contact rises through half of the main wave's
    /// height, s since the striker hit.
    pub(crate) fn front(&self) -> f64 {
        let mut force = during(&self.force);
        let (highest, time) = self.peak;
        let (mut below, mut above) = (self.pulse.map_or(0.0, |pulse| pulse.from), time);
        // Bisection, to the last bit or so: the force only rises there.
        for _ in 0..50 {
            let middle = 0.5 * (below + above);
            let is_below = force(middle) < 0.5 * highest;
            *(if is_below { &mut below } else { &mut above }) = middle;
        }
        above
    }

    /// The recorded force as a multiple of the simulated one, over the pulse, by least squares; and its
    /// standard error. None where samples or settings are missing, or the force left the range of the sensor.
    pub(crate) fn force_ratio(&self, strike: &RecordedStrike) -> Option<(f64, f64)> {
        let StrikeSignals { force, rate, .. } =
            StrikeSignals::of(strike).filter(|_| !force_railed(strike))?;
        let points = beside(&force, self.place(&force, rate), rate, &self.force);
        let (highest, time) = self.peak;
        let is_pulse = |point: &&SensedPoint| {
            (point.time - time).abs() * rate < PULSE
                && point.simulated > 0.1 * highest
                && point.sensed.is_finite()
        };
        let pulse: Vec<_> = points.iter().filter(is_pulse).collect();
        let simulated: f64 = pulse.iter().map(|point| point.simulated.powi(2)).sum();
        let both: f64 = pulse.iter().map(|point| point.sensed * point.simulated).sum();
        let ratio = both / simulated;
        let left = |point: &&SensedPoint| (point.sensed - ratio * point.simulated).powi(2);
        let free = pulse.len().checked_sub(2).filter(|free| *free > 0)?;
        let noise = (pulse.iter().map(left).sum::<f64>() / free as f64).sqrt();
        (ratio > 0.0).then_some((ratio, noise / simulated.sqrt()))
    }

    /// Compares a strike from four sources.
    pub fn compare(&self, strike: &RecordedStrike) -> StrikeComparison {
        let replay = replay(strike);
        let device = StrikeValues::of(&strike.said);
        let f64_chain = StrikeValues {
            peak_force: self.truth.peak_force,
            absorbed_measured: self.truth.absorbed,
            absorbed_predicted: self.truth.absorbed,
        };
        let deviation = device.relative_to(&f64_chain);
        let offs = [deviation.absorbed_measured, deviation.absorbed_predicted];
        let met = offs
            .into_iter()
            .zip(self.goal.each())
            .all(|(off, goal)| goal.is_none_or(|goal| agrees(off, goal, 0.0)));
        let pass = replay.identical() && met;
        let mut comparison = StrikeComparison {
            strike: strike.said.strike,
            sample_index: strike.said.trigger_index,
            device,
            replay: replay.said.as_ref().map(StrikeValues::of),
            replay_identical: replay.identical(),
            first_difference: replay.first_difference.clone(),
            replay_incomplete: replay.incomplete.clone(),
            replay_word: replay.word(),
            f64_chain,
            deviation,
            goal: self.goal,
            force_noise: force_noise(strike),
            flags: strike.said.flags.names().collect(),
            conditions: StrikeConditions::of(strike),
            uncertainty: EnergyUncertainties::of(strike, self.explained),
            pass,
            alone: true,
            ..StrikeComparison::default()
        };
        if let Some(signals) = StrikeSignals::of(strike) {
            self.compare_samples(&signals, &replay, &mut comparison);
        }
        comparison
    }

    /// Adds the values and curves that need all samples.
    fn compare_samples(&self, signals: &StrikeSignals<'_>, replay: &Replay, to: &mut StrikeComparison) {
        let StrikeSignals { strike, rate, .. } = *signals;
        let start = self.place(&signals.force, rate);
        let measured = signals.measured(&self.physics);
        let predicted = signals.predicted(&self.physics, &self.around);
        let force = beside(&signals.force, start, rate, &self.force);
        let [left_measured, left_predicted] = signals.left();
        to.f64_samples = Some(StrikeValues {
            peak_force: force.iter().map(|point| point.sensed).fold(0.0, f64::max),
            absorbed_measured: measured.last().map_or(0.0, |absorbed| *absorbed) + left_measured,
            absorbed_predicted: predicted.last().map_or(0.0, |[absorbed, _]| *absorbed) + left_predicted,
        });
        to.shape = strike.shape.and_then(|shape| {
            let times = start..force.last()?.time;
            self.shape(&shape, signals.settings.sample_rate_hz, times)
        });
        let work = |time: f64| {
            let sample = ((time - start) * rate).round().max(0.0) as usize;
            predicted[sample.min(predicted.len() - 1)][1]
        };
        let wave = self.pulse.filter(|_| self.load == 0.0 && !force_railed(strike));
        let brought = wave.map(|wave| work(wave.to) - work(wave.from));
        to.incident = brought.filter(|brought| *brought > 0.0);

        let f64_samples = measured.iter().zip(&predicted).map(|(a, [b, _])| [*a, *b]);
        let replayed = replay.energies.iter().map(|(a, b)| [a.joules(), b.joules()]);
        let device = strike.chunks.iter().map(|chunk| {
            let energies = [chunk.absorbed_measured, chunk.absorbed_predicted];
            (chunk.end - 1, energies.map(|energy| energy.joules()))
        });
        // Both estimates of the device use a sample once the next one has come, and count it in full: after
        // sample n they hold for the time n - 1/2.
        let half = start - 0.5 / rate;
        to.traces = Some(Traces {
            acceleration: beside(&signals.acceleration, start + SCAN_SKEW, rate, &self.acceleration),
            f64_samples: self.absorbed(start, rate, f64_samples.enumerate()),
            replay: self.absorbed(half, rate, replayed.enumerate()),
            device: self.absorbed(half, rate, device),
            force,
        });
    }

    /// The curves of A and B from the energies after each sample, beside the chain's. The first sample of the
    /// force is at `start`, s; A uses the acceleration, one skew later.
    fn absorbed(
        &self,
        start: f64,
        rate: f64,
        energies: impl Iterator<Item = (usize, [f64; 2])>,
    ) -> [Vec<AbsorbedPoint>; 2] {
        let mut curves = [Vec::new(), Vec::new()];
        let mut samplers = [self.solution.sampler(), self.solution.sampler()];
        for (sample, estimates) in energies {
            for (which, estimate) in estimates.into_iter().enumerate() {
                let skew = if which == 0 { SCAN_SKEW } else { 0.0 };
                let time = start + sample as f64 / rate + skew;
                let inside = samplers[which].at(time.clamp(0.0, self.solution.end()));
                curves[which].push(AbsorbedPoint {
                    time,
                    estimate,
                    chain: inside.intruder_dissipated(self.bead).unwrap_or(0.0),
                });
            }
        }
        curves
    }

    /// The shape of a strike whose window has its first and its last sample at these times, s.
    fn shape(&self, said: &bead_wire::Shape, rate_hz: u32, times: Range<f64>) -> Option<ShapeComparison> {
        let Bead {
            mass,
            intruder_mass,
            stiffness,
            damping,
            ..
        } = self.physics;
        let reduced = intruder_mass * (mass - intruder_mass) / mass;
        let decay = 0.5 * damping / reduced;
        let [from, to] = [times.start, times.end].map(|time| time.clamp(0.0, self.solution.end()));
        // The bead's sensor passes no constant force.
        let impulse = self.solution.flow(self.bead).between(from, to).impulse - self.load * (to - from);
        Some(ShapeComparison {
            device: ShapeValues::of(said, rate_hz, Some(reduced).filter(|_| self.rings_alone)),
            f64_chain: ShapeValues {
                width: self.pulse?.fwhm?,
                impulse,
                ring_frequency: (stiffness / reduced - decay * decay).max(0.0).sqrt() / std::f64::consts::TAU,
                ring_decay: decay,
                stiffness: Some(stiffness),
                damping: Some(damping),
            },
        })
    }

    /// Time of the window's first sample since the striker hit, s: the one that minimises the squared
    /// distance of sensed and simulated force.
    fn place(&self, force: &[f64], rate: f64) -> f64 {
        let peak = (0..force.len())
            .max_by(|&a, &b| force[a].total_cmp(&force[b]))
            .unwrap_or(0);
        // The pulse and what directly follows it. Later waves are small and would cost time.
        let near = peak.saturating_sub(40)..(peak + 80).min(force.len());
        let distance = |start: f64| -> f64 {
            let mut simulated = during(&self.force);
            let off = |i: usize| force[i] - simulated(start + i as f64 / rate);
            near.clone().map(off).map(|off| off.powi(2)).sum()
        };
        let guess = self.peak.1 - peak as f64 / rate;
        least(guess - 2.0 / rate, guess + 2.0 / rate, distance)
    }
}

/// True if the force left the range of its sensor.
pub(crate) fn force_railed(strike: &RecordedStrike) -> bool {
    strike.said.flags.has(StrikeFlags::FORCE_RAILED)
}

/// The main wave among a chain's pulses at a bead: the highest in the window, which ends `after` seconds from
/// the first high pulse. A wave that returns later, from a wall or from the far end, may be higher, but it
/// has its own window.
fn main_wave(pulses: &[Pulse], load: f64, after: f64) -> Option<Pulse> {
    let height = |pulse: &Pulse| pulse.force - load;
    let highest = pulses.iter().map(height).fold(0.0, f64::max);
    let first = pulses.iter().find(|pulse| height(pulse) >= HIGH * highest)?;
    let window = first.from..=first.from + after;
    let within = pulses.iter().filter(|pulse| window.contains(&pulse.time));
    within.max_by(|a, b| a.force.total_cmp(&b.force)).copied()
}

/// Samples, each with what the chain did at that time; 0 outside the chain's run.
fn beside(samples: &[f64], start: f64, rate: f64, quantity: &Curve) -> Vec<SensedPoint> {
    let mut simulated = during(quantity);
    let point = |(i, &sensed): (usize, &f64)| {
        let time = start + i as f64 / rate;
        SensedPoint {
            time,
            sensed,
            simulated: simulated(time),
        }
    };
    samples.iter().enumerate().map(point).collect()
}

/// A quantity of the chain over time; 0 outside the chain's run.
fn during(quantity: &Curve) -> impl FnMut(f64) -> f64 {
    let mut quantity = quantity.clone();
    move |time| {
        let runs = (0.0..=quantity.end()).contains(&time);
        if runs { quantity.at(time) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::LazyLock;

    use hertz_chain::{Material, Start, Wall};

    use super::*;
    use crate::testing::recorded_strike;

    static PAPER: LazyLock<FullChain> = LazyLock::new(|| FullChain::run(&Scenario::paper(), 8).unwrap());

    fn worst(pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
        pairs.map(|(one, other)| (one - other).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn a_strike_made_by_the_model_meets_every_goal_and_one_out_of_a_goal_does_not_pass() {
        let comparison = PAPER.compare(&recorded_strike());
        println!("{:#?} {:#?}", comparison.deviation, comparison.goal);
        assert!(comparison.pass);
        assert_eq!(comparison.first_difference, None);
        // 5 mN of noise and twelve bits over 16 N.
        let noise = comparison.force_noise;
        assert!((noise / 5.1e-3 - 1.0).abs() < 0.3, "{noise}");
        let mut scenario = Scenario::paper();
        // Energy goes with the square of the speed: 0.4 % off, twice A's goal.
        scenario.striker.velocity *= 1.002;
        let other = FullChain::run(&scenario, 8).unwrap();
        assert!(!other.compare(&recorded_strike()).pass);
    }

    #[test]
    fn the_strike_is_placed_in_time_within_a_hundredth_of_a_sample() {
        let strike = recorded_strike();
        let traces = PAPER.compare(&strike).traces.unwrap();
        // The test's strike began at 20 ms, and index 1 is time 0.
        let true_start = (strike.said.first_index as f64 - 1.0) * 1e-5 - 0.02;
        let samples = (traces.force[0].time - true_start) * 1e5;
        assert!(samples.abs() < 0.01, "{samples}");
        let [force, acceleration] = [&traces.force, &traces.acceleration]
            .map(|curve| worst(curve.iter().map(|point| (point.sensed, point.simulated))));
        // Noise of 5 mN at four sigma, and rounding; noise of 0.05 m/s², and rounding to 0.12 m/s².
        assert!(force < 0.03 && acceleration < 0.5, "{force} {acceleration}");
        // The curves of energy stay together all the way, not only at their ends.
        for curve in [&traces.f64_samples, &traces.replay, &traces.device]
            .into_iter()
            .flatten()
        {
            let off = worst(curve.iter().map(|point| (point.estimate, point.chain)));
            assert!(off < 3e-3 * 8.297e-7, "{off:e} J");
        }
    }

    #[test]
    fn the_main_wave_is_the_first_though_a_wall_sends_back_a_higher_one() {
        let mut scenario = Scenario::paper();
        scenario.chain.relaxation = 0.0;
        scenario.chain.beads = 60;
        scenario.wall = Some(Wall::flat(Material::STEEL));
        scenario.duration = 0.034;
        let solution = Arc::new(simulate_with_ring_down(&scenario).unwrap());
        let highest = solution.summary().peak_force[7];
        assert!(highest.contact == 8 && highest.time > 0.01, "{highest:?}");
        let chain = FullChain::of(&scenario, &solution, 8).unwrap();
        assert!(chain.pulse.unwrap().time < 2e-3 && chain.front() < 2e-3);
        // The elastic wave brings nearly all that the striker gave.
        let brought = chain.incident().unwrap();
        assert!((6e-5..7e-5).contains(&brought), "{brought} J");
    }

    #[test]
    fn a_wave_from_the_far_end_brings_no_energy_from_the_striker() {
        let mut scenario = Scenario::paper();
        scenario.striker.velocity = 1e-3;
        scenario.starts = vec![Start::apart([16], 1e-6)];
        scenario.starts[0].velocity = -0.1;
        let chain = FullChain::run(&scenario, 8).unwrap();
        assert!(chain.pulse.is_some_and(|pulse| pulse.energy < 0.0));
        assert_eq!(chain.incident(), None);
    }

    #[test]
    fn a_clipped_force_says_nothing_of_the_speed_and_of_the_energy_that_came() {
        let mut strike = recorded_strike();
        assert!(PAPER.force_ratio(&strike).is_some() && PAPER.compare(&strike).incident.is_some());
        strike.said.flags = StrikeFlags::FORCE_RAILED;
        assert_eq!(PAPER.force_ratio(&strike), None);
        assert_eq!(PAPER.compare(&strike).incident, None);
    }

    #[test]
    fn a_bead_under_a_load_feels_what_comes_on_top_of_it() {
        let mut scenario = Scenario::paper();
        scenario.chain.precompression = 2.0;
        let chain = FullChain::run(&scenario, 8).unwrap();
        let total = chain.solution.summary().peak_force[7].force;
        assert!((chain.truth.peak_force - (total - 2.0)).abs() < 1e-12);
        let mut force = chain.force.clone();
        assert_eq!(force.at(0.0), 0.0);
        // It rises through half of its height, not through half of the total.
        assert!((force.at(chain.front()) / (0.5 * (total - 2.0)) - 1.0).abs() < 1e-9);
        // The wave brings energy, but the bead assumes a chain without a load.
        assert!(chain.incident().is_some_and(|brought| brought > 0.0));
        assert_eq!(chain.compare(&recorded_strike()).incident, None);
    }
}
