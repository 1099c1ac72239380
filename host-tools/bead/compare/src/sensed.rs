//! Signals at the sensors of a bead in a simulated chain, strike after strike, and the truth of its report.

use std::ops::Range;
use std::path::Path;

use bead_model::design::{Bead, Followers, Intruder, LEAST_WIDTH, Neighbours, Surroundings};
use bead_model::reduced_chain::FOLLOWERS;
use hertz_chain::{Curve, HostedIntruder, Model, Options, Scenario, Solution, read_text, simulate_with};
use serde::{Deserialize, Serialize};

use crate::error::CompareError;
use crate::front_end::{SAMPLE_RATE_HZ, SensorStimulus};
use bead_instrument::Waveform;
use bead_instrument::trace::{FADE, Trace};
use bead_tables::printable::first_of;

/// Seconds simulated beyond the scenario's end, so that the intruder's ring-down is complete in every window.
pub const RING_DOWN: f64 = 6e-3;

/// The bead and its surroundings, from which its settings are derived.
///
/// # Errors
/// The bead has no intruder, and so senses nothing; the message names those that have one. Or it has several.
pub fn bead_of(solution: &Solution, bead: usize) -> Result<Bead, CompareError> {
    let model = solution.model();
    let unfit = |what: String| Err(CompareError::Unfit(format!("--bead {bead}: {what}")));
    let Some(intruder) = model.intruders().iter().find(|intruder| intruder.bead == bead) else {
        let with: Vec<usize> = model.intruders().iter().map(|one| one.bead).collect();
        let what = if with.is_empty() {
            "no bead of this scenario has an intruder; add an [[intruder]] to it".to_owned()
        } else {
            let some = first_of(&with, BEADS_TOLD);
            format!("this bead has no intruder; give one of: {some}")
        };
        return unfit(what);
    };
    let several = model.intruders_of(bead).len();
    if several > 1 {
        return unfit(format!(
            "this bead has {several} intruders, and a sensing bead has exactly one; choose a bead with one"
        ));
    }
    if bead + 1 == model.bodies() {
        let what = "this is the last bead, and the reduced chain needs one behind it; choose another bead";
        return unfit(what.to_owned());
    }
    let behind = model.contact(bead + 1);
    Ok(Bead {
        mass: model.mass(bead),
        intruder_mass: intruder.oscillator.mass,
        front_mass: 0.0,
        stiffness: intruder.oscillator.stiffness,
        damping: intruder.oscillator.damping,
        contact_stiffness: behind.stiffness,
        relaxation: behind.relaxation,
    })
}

/// Distance within which other intruders change the ringing of a bead within a window, in beads: a wave goes
/// there and back in 6 ms.
const NEAR: usize = 8;

/// The beads around a bead.
pub fn surroundings_of(solution: &Solution, bead: usize) -> Surroundings {
    Surroundings {
        intruders: intruders_around(solution, bead),
        followers: unlike_followers(solution.model(), bead),
    }
}

/// The beads behind a bead, if they are not like it.
fn unlike_followers(model: &Model, bead: usize) -> Option<Followers> {
    let physics = Bead {
        mass: model.mass(bead),
        contact_stiffness: model.contact(bead + 1).stiffness,
        relaxation: model.contact(bead + 1).relaxation,
        ..Bead::paper()
    };
    let like = Followers::like(&physics);
    let mut followers = like;
    for follower in 0..FOLLOWERS {
        let place = bead + 1 + follower;
        followers.stiffness[follower] = 0.0;
        if place < model.bodies() {
            followers.mass[follower] = model.mass(place) as f32;
        }
        if place <= model.contacts() {
            let contact = model.contact(place);
            followers.stiffness[follower] = contact.stiffness as f32;
            followers.relaxation[follower] = contact.relaxation as f32;
            followers.load = contact.load as f32;
            if place == model.bodies() {
                followers.wall = follower as u8 + 1;
            }
        }
    }
    (followers != like).then_some(followers)
}

/// The intruders around a bead. Those of its followers count for estimate B if they are like that of the
/// first follower that holds one.
fn intruders_around(solution: &Solution, bead: usize) -> Neighbours {
    let intruders = solution.model().intruders();
    let at = |place: usize| match &intruders[solution.model().intruders_of(place)] {
        [one] => Some(one.oscillator),
        _ => None,
    };
    let followers = std::array::from_fn::<_, FOLLOWERS, _>(|follower| at(bead + 1 + follower));
    let first = followers.iter().flatten().next().copied();
    let behind = followers.map(|held| held.is_some() && held == first);
    let is_counted = |place: usize| {
        let follower = place.checked_sub(bead + 1);
        place == bead || follower.and_then(|follower| behind.get(follower)) == Some(&true)
    };
    let mut others = intruders
        .iter()
        .map(|one| one.bead)
        .filter(|place| !is_counted(*place));
    let elsewhere = others.any(|place| place.abs_diff(bead) <= NEAR);
    let intruder = first.map_or_else(Intruder::default, |held| Intruder {
        mass: held.mass,
        stiffness: held.stiffness,
        damping: held.damping,
    });
    Neighbours::new(behind, elsewhere, intruder)
}

/// True if no other intruder is near enough to change the ringing of a bead's own within a window.
pub(crate) fn rings_alone(solution: &Solution, bead: usize) -> bool {
    let near = |place: usize| place != bead && place.abs_diff(bead) <= NEAR;
    !solution.model().intruders().iter().any(|one| near(one.bead))
}

/// Differences between a bead's chain and the one that its estimators assume.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct UnlikeChain {
    /// A line for each.
    pub notes: Vec<String>,
    /// Errors of A and of B that they explain, as parts of the energy; infinite where there is no bound.
    pub explained: [f64; 2],
}

/// Lists where the reduced chain of estimate B is unlike the real chain, and where its steps are long.
///
/// The reduced chain has the six beads behind the host as they are, except for intruders unlike the first one
/// among them.
pub fn unlike_the_reduced_chain(solution: &Solution, bead: usize) -> UnlikeChain {
    let model = solution.model();
    let mut unlike = UnlikeChain::default();
    let behind = || {
        model
            .intruders()
            .iter()
            .filter(|one| (1..=FOLLOWERS).contains(&one.bead.wrapping_sub(bead)))
    };
    let first = behind().next().map(|one| one.oscillator);
    let is_other =
        |one: &&HostedIntruder| Some(one.oscillator) != first || model.intruders_of(one.bead).len() > 1;
    if let Some(other) = behind().find(is_other) {
        unlike.explained[1] = f64::INFINITY;
        let holds = match model.intruders_of(other.bead).len() {
            1 => format!("another kind of intruder than those nearer to bead {bead}"),
            several => format!("{several} intruders"),
        };
        unlike.notes.push(format!(
            "bead {} has {holds}: estimate B assumes one kind of intruder and is off here; A is not affected",
            other.bead
        ));
    }
    let load = model.contact(model.bodies() - 1).load;
    if load > 0.0 {
        unlike.notes.push(format!(
            "the chain is under a load of {load} N: the bead's forces are those beyond this load"
        ));
    }
    let width = bead_of(solution, bead).map(|physics| physics.pulse_width(1.0));
    let samples = width.unwrap_or(f64::INFINITY) * f64::from(SAMPLE_RATE_HZ);
    // A shorter wave is refused, not warned of.
    if (LEAST_WIDTH..LONG_STEPS).contains(&samples) {
        let [a, b] = short_wave_bounds(samples);
        unlike.notes.push(format!(
            "a wave of 1 m/s is {samples:.1} samples wide at bead {bead}: A is off by up to {a:.1} %, B by up to {b:.1} %; from \
             {LONG_STEPS} samples on, by less than 0.6 and 1.2 %"
        ));
        unlike.explained[0] += a / 100.0;
        unlike.explained[1] += b / 100.0;
    }
    unlike
}

/// Bounds of the errors of A and B for a wave that is `samples` wide, %, from random beads at both gains. The
/// change of gains may cost A 0.6 %.
fn short_wave_bounds(samples: f64) -> [f64; 2] {
    [
        0.6 * f64::max(1.0, 4.0 / samples).powi(2),
        2.6 * (3.9 / samples).powf(2.3),
    ]
}

/// Width of a wave of 1 m/s, in samples, below which a sample is a long step.
const LONG_STEPS: f64 = 5.6;

/// The only bead with an intruder, for commands that name no bead.
///
/// # Errors
/// No bead has an intruder, or more than one has.
pub fn only_host(scenario: &Scenario) -> Result<usize, CompareError> {
    let hosts = scenario.hosts();
    match hosts[..] {
        [host] => Ok(host),
        [] => Err(CompareError::Unfit(
            "no bead of this scenario has an intruder; add an [[intruder]] to it".to_owned(),
        )),
        _ => {
            let some = first_of(&hosts, BEADS_TOLD);
            let why = format!("several beads have intruders ({some}); say which with --bead");
            Err(CompareError::Unfit(why))
        }
    }
}

/// Greatest number of beads that a message lists.
pub const BEADS_TOLD: usize = 10;

/// Reads a scenario together with its text.
///
/// # Errors
/// The file is missing or is not a scenario; the message names file, line and key.
pub fn load_scenario(path: &Path) -> Result<(Scenario, String), CompareError> {
    // Read once: a pipe has its text only once.
    let text = read_text(path, "a scenario file in TOML")?;
    let scenario = Scenario::from_toml(&text, &path.display().to_string())?;
    Ok((scenario, text))
}

/// Simulates a scenario and [`RING_DOWN`] beyond its end.
///
/// # Errors
/// The scenario cannot be integrated.
pub fn simulate_with_ring_down(scenario: &Scenario) -> Result<Solution, CompareError> {
    let options = Options::default().with_duration(scenario.duration + RING_DOWN);
    Ok(simulate_with(scenario, &options)?)
}

/// One strike at one bead by the full chain.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Truth {
    /// Highest force at the bead's incoming contact over the scenario's duration, beyond a static load, N.
    pub peak_force: f64,
    /// ∫ c ẋ² dt of its intruder over the scenario's duration, J.
    pub absorbed: f64,
}

impl Truth {
    /// The truth for bead `bead`, from a solution of `scenario`.
    ///
    /// # Errors
    /// The bead has no intruder, or no force ever reaches it.
    pub fn of(scenario: &Scenario, solution: &Solution, bead: usize) -> Result<Self, CompareError> {
        bead_of(solution, bead)?;
        let summary = solution.summary();
        let peak = summary.peak_force.iter().find(|peak| peak.contact == bead);
        let absorbed = solution.at(scenario.duration).intruder_dissipated(bead);
        let (Some(peak), Some(absorbed)) = (peak, absorbed) else {
            let why = format!("no force reaches bead {bead} within {} s", scenario.duration);
            return Err(CompareError::Unfit(format!(
                "{why}; make the scenario's duration longer"
            )));
        };
        let peak_force = peak.force - solution.model().contact(bead).load;
        Ok(Self { peak_force, absorbed })
    }
}

/// Times of the strikes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Timing {
    /// Quiet time before the first strike, s.
    pub lead_in: f64,
    /// Number of strikes.
    pub strikes: u32,
    /// Time from strike to strike, s.
    pub interval: f64,
}

impl Timing {
    /// One strike.
    pub fn once(lead_in: f64) -> Self {
        Self {
            lead_in,
            strikes: 1,
            interval: 1.0,
        }
    }

    /// These strikes on the time of a bead whose first scan is at `began`, s.
    #[must_use]
    pub fn since(self, began: f64) -> Self {
        Self {
            lead_in: self.lead_in - began,
            ..self
        }
    }

    /// Time at which the striker of strike `number`, from 0, touches the chain, s.
    ///
    /// Strikes do not wait for the sample clock. Each comes at another phase of it; the golden ratio spreads
    /// the phases evenly.
    pub fn start(&self, number: u32) -> f64 {
        let phase = (f64::from(number) * 0.618_033_988_749_894_9).fract();
        self.lead_in + f64::from(number) * self.interval + phase / f64::from(SAMPLE_RATE_HZ)
    }

    /// Start of each strike as a fractional sample index, by a clock with `rate` seconds in a true second.
    /// Row 0 of the stimulus is converted by the first trigger, whose scan has the index 1.
    pub fn starts(&self, rate: f64) -> Vec<f64> {
        let index = |number| 1.0 + self.start(number) * rate * f64::from(SAMPLE_RATE_HZ);
        (0..self.strikes).map(index).collect()
    }

    /// Scans from power-up to the end of the last strike; a strike takes `long` seconds.
    pub fn scans(&self, long: f64) -> usize {
        let last = self.strikes.saturating_sub(1);
        ((self.start(last) + long) * f64::from(SAMPLE_RATE_HZ)).ceil() as usize + 1
    }
}

/// Signal of one strike at a sensor, in its SI unit over the time since the strike began, s.
#[derive(Clone)]
enum SensorSignal {
    Simulated(Curve),
    Played(Trace),
}

impl SensorSignal {
    fn at(&mut self, since: f64) -> f64 {
        match self {
            Self::Simulated(curve) => curve.at(since),
            Self::Played(trace) => trace.at(since),
        }
    }
}

/// Signals at the sensors of one bead: the same strike again and again, with quiet between.
#[derive(Clone)]
pub struct Sensed {
    timing: Timing,
    /// Seconds of the bead's clock in a true second.
    clock_rate: f64,
    /// Duration of a strike, s.
    long: f64,
    /// Start and end of the strike that was asked for last, s.
    last: Range<f64>,
    /// Of force and acceleration.
    signals: [Option<SensorSignal>; 2],
}

impl Sensed {
    /// The sensors of bead `bead`, which has an intruder, in `solution`. They pass no constant force, so they
    /// feel what comes on top of a static load.
    pub fn new(solution: &Solution, bead: usize, timing: Timing) -> Self {
        let force = Some(SensorSignal::Simulated(solution.force_beyond_curve(bead)));
        let acceleration = solution.acceleration_curve(bead).map(SensorSignal::Simulated);
        Self::of([force, acceleration], solution.end(), timing)
    }

    /// Sensors that play a waveform once for each strike of `timing`. A sensor that the waveform lacks stays
    /// at rest.
    pub fn playing(waveform: &Waveform, timing: Timing) -> Self {
        let traces = [&waveform.force, &waveform.acceleration];
        let signals = traces.map(|trace| trace.clone().map(SensorSignal::Played));
        Self::of(signals, waveform.seconds() + FADE, timing)
    }

    fn of(signals: [Option<SensorSignal>; 2], long: f64, timing: Timing) -> Self {
        Self {
            timing,
            clock_rate: 1.0,
            long,
            last: 0.0..0.0,
            signals,
        }
    }

    /// These sensors on the time of a clock with `rate` seconds in a true second.
    #[must_use]
    pub fn on_clock(self, rate: f64) -> Self {
        Self {
            clock_rate: rate,
            ..self
        }
    }

    /// Duration of a strike, s.
    pub fn long(&self) -> f64 {
        self.long
    }

    /// Start of the strike at `time`, s; `None` if there is none.
    fn strike_at(&self, time: f64) -> Option<f64> {
        let guess = ((time - self.timing.lead_in) / self.timing.interval).floor();
        if guess < 0.0 {
            return None;
        }
        let number = (guess as u32).min(self.timing.strikes.checked_sub(1)?);
        // A strike starts up to one sample after its place in the row. Until then the previous strike still
        // counts.
        let mut start = self.timing.start(number);
        if time < start && number > 0 {
            start = self.timing.start(number - 1);
        }
        Some(start).filter(|start| (0.0..=self.long).contains(&(time - start)))
    }

    /// Time since the start of the strike at `time`, s. It is fast if consecutive times are in one strike.
    fn since_start(&mut self, time: f64) -> Option<f64> {
        let since = time - self.last.start;
        if self.last.contains(&time) && since <= self.long {
            return Some(since);
        }
        let start = self.strike_at(time)?;
        // The next strike may start before the end of this one, by a sample.
        let most = self.timing.interval - 1.0 / f64::from(SAMPLE_RATE_HZ);
        self.last = start..start + self.long.min(most);
        Some(time - start)
    }

    fn felt(&mut self, sensor: usize, time: f64) -> f64 {
        let since = self.since_start(time / self.clock_rate);
        let signal = self.signals[sensor].as_mut().zip(since);
        signal.map_or(0.0, |(signal, since)| signal.at(since))
    }
}

impl SensorStimulus for Sensed {
    fn force(&mut self, time: f64) -> f64 {
        self.felt(0, time)
    }

    fn acceleration(&mut self, time: f64) -> f64 {
        self.felt(1, time)
    }

    fn silent_until(&self, time: f64) -> f64 {
        let true_time = time / self.clock_rate;
        if self.strike_at(true_time).is_some() {
            return time;
        }
        let guess = ((true_time - self.timing.lead_in) / self.timing.interval).floor();
        let guess = guess.max(0.0) as u32;
        // A strike starts up to one sample after its place in the row.
        let near = guess..self.timing.strikes.min(guess.saturating_add(3));
        let mut starts = near.map(|number| self.timing.start(number));
        let next = starts.find(|start| *start >= true_time).unwrap_or(f64::INFINITY);
        next * self.clock_rate
    }
}

#[cfg(test)]
mod tests {
    use bead_model::design::{Capture, derive};
    use bead_model::{Scan, StrikeFlags};
    use bead_testing::Collector;
    use hertz_chain::simulate;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::front_end::AnalogFrontEnd;

    /// The first millisecond of the paper's strike: the wave does not reach the intruder.
    fn short_scenario() -> Scenario {
        let mut scenario = Scenario::paper();
        scenario.duration = 1e-3;
        scenario
    }

    const TIMING: Timing = Timing {
        lead_in: 0.02,
        strikes: 3,
        interval: 0.05,
    };

    #[test]
    fn a_bead_without_an_intruder_is_refused_and_the_others_named() {
        let refused = |scenario: &Scenario| bead_of(&simulate(scenario).unwrap(), 5).unwrap_err().to_string();
        let mut scenario = short_scenario();
        scenario.intruders[0].beads = vec![4, 9];
        let error = refused(&scenario);
        assert!(error.contains("one of: 4, 9"), "{error}");
        scenario.intruders.clear();
        let error = refused(&scenario);
        assert!(error.contains("[[intruder]]"), "{error}");
    }

    #[test]
    fn a_sensor_feels_no_static_load() {
        let mut scenario = short_scenario();
        scenario.chain.precompression = 2.0;
        let solution = simulate(&scenario).unwrap();
        let mut sensed = Sensed::new(&solution, 2, TIMING);
        assert_eq!(sensed.force(TIMING.start(0)), 0.0);
        let there = solution.at(0.3e-3).force(2) - 2.0;
        let felt = sensed.force(TIMING.start(0) + 0.3e-3);
        assert!(there > 1.0 && (felt - there).abs() < 1e-6, "{felt} {there}");
    }

    #[test]
    fn every_strike_is_the_same_signal_at_its_own_phase_of_the_clock() {
        let scenario = Scenario::paper();
        let solution = simulate_with_ring_down(&scenario).unwrap();
        let mut sensed = Sensed::new(&solution, 8, TIMING);
        let phase = |n: u32| (TIMING.start(n) * f64::from(SAMPLE_RATE_HZ)).fract();
        assert!((phase(1) - phase(2)).abs() > 0.1);
        for number in 0..3 {
            for since in [0.5e-3, 1.6e-3, 3e-3, 11.9e-3] {
                let time = TIMING.start(number) + since;
                assert!((sensed.force(time) - solution.at(since).force(8)).abs() < 1e-6);
                let expected = solution.at(since).intruder_acceleration(8).unwrap();
                assert!((sensed.acceleration(time) - expected).abs() < 1e-4);
            }
        }
        for quiet in [0.0, 0.0199, 0.02 + 0.045, 0.15 + 0.02, 1.0] {
            assert_eq!((sensed.force(quiet), sensed.acceleration(quiet)), (0.0, 0.0));
        }
    }

    /// A chain of spheres of one material, drawn at random, whose wave is short; the strike reaches from a
    /// quarter of the high gain to far into the low one.
    #[test]
    fn bounds_of_short_waves_hold_for_500_random_beads_at_both_gains() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let (mut measured, mut beyond) = (0, 0);
        while measured < 500 {
            let mut between = |least: f64, most: f64| least * (most / least).powf(random.random::<f64>());
            let paper = Bead::paper();
            let mut scenario = Scenario::paper();
            let (density, young) = (between(1000.0, 8000.0), between(1.5e9, 2e11));
            let (radius, part) = (between(2.5e-3, 20e-3), between(0.01, 0.3));
            (scenario.chain.radius, scenario.striker.radius) = (radius, radius);
            (scenario.chain.density, scenario.striker.density) = (density, density);
            (scenario.chain.young, scenario.striker.young) = (young, young);
            (scenario.chain.relaxation, scenario.striker.relaxation) = (0.0, None);
            (scenario.striker.mass, scenario.striker.velocity) = (None, between(0.05, 1.0));
            let mass = density * 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
            let flat = 1.5 * (1.0 - scenario.chain.poisson.powi(2));
            let sphere = Bead {
                mass,
                contact_stiffness: young / flat * (0.5 * radius).sqrt(),
                ..paper
            };
            let slower = sphere.pulse_width(1.0) / paper.pulse_width(1.0);
            let reduced = part * (1.0 - part) * mass * paper.mass
                / (paper.intruder_mass * (paper.mass - paper.intruder_mass));
            let intruder = &mut scenario.intruders[0];
            intruder.mass = part * mass;
            intruder.stiffness = between(0.8, 1.25) * paper.stiffness * reduced / slower.powi(2);
            intruder.damping = between(0.7, 1.4) * paper.damping * reduced / slower;
            let (reach, samples) = (between(0.08, 4.0), 1e5 * sphere.pulse_width(1.0));
            if !(LEAST_WIDTH..2.0 * LONG_STEPS).contains(&samples) {
                continue;
            }
            scenario.duration = 8e-3 * slower.max(0.3);
            let solution = simulate_with_ring_down(&scenario).unwrap();
            let bead = bead_of(&solution, 8).unwrap();
            let times = (0..(solution.end() * 2e5) as usize).map(|n| solution.at(n as f64 * 5e-6));
            let [force, acceleration] = times.fold([0.0_f64; 2], |[force, acceleration], now| {
                let swing = now.intruder_acceleration(8).unwrap().abs();
                [force.max(now.force(8)), acceleration.max(swing)]
            });
            let mut front_end = AnalogFrontEnd::default();
            for (sensor, span, usual) in [
                (&mut front_end.force, 1.05 * force * reach, 16.0),
                (&mut front_end.acceleration, 2.1 * acceleration * reach, 500.0),
            ] {
                for (channel, wider) in [(&mut sensor.sensitive, 1.0), (&mut sensor.wide, 16.0)] {
                    *channel = channel.with_span(span * wider);
                    channel.noise_rms *= span / usual;
                }
            }
            let scales = front_end.calibration();
            let least = f64::max(12.0 * scales.force.noise, 8.0 * scales.force.per_code);
            let capture = Capture {
                threshold: least.max(force / 60.0),
                ..Capture::of(&bead, &scales)
            };
            let Ok(settings) = derive(&bead, &scales, &capture) else {
                // Codes that reach beyond the sums.
                continue;
            };
            let timing = Timing::once(0.01);
            let scans = timing.scans(solution.end());
            let codes = front_end.digitise(&Sensed::new(&solution, 8, timing), scans, Some(measured));
            let scans: Vec<Scan> = codes.scans.into_iter().map(Scan::new).collect();
            let report = Collector::measure(&settings, 0, &scans).reports[0];
            // The reduced chain may leave its range, and says so.
            let left = report.flags.has(StrikeFlags::CHAIN_RANGE);
            beyond += u32::from(left);
            let truth = solution.at(solution.end()).intruder_dissipated(8).unwrap();
            let off = [report.absorbed_measured, report.absorbed_predicted]
                .map(|energy| 100.0 * (energy.joules() / truth - 1.0));
            let bounds = short_wave_bounds(samples.min(LONG_STEPS));
            let what = format!("bead {measured}, {samples:.2} samples: {off:.3?} %, not within {bounds:.3?}");
            assert!(
                off[0].abs() < bounds[0] && (left || off[1].abs() < bounds[1]),
                "{what}"
            );
            measured += 1;
        }
        assert!(beyond < 5, "{beyond} strikes left the range");
    }
}
