//! The sensing front end of a bead, from newtons and m/s² to 12-bit codes.
//!
//! # Design
//! Each sensor (volts per unit) has a one-pole anti-alias low-pass and two channels behind it. A channel is
//! an amplifier (gain, offset), white noise in the sensor's unit, and a converter that samples at the scan
//! rate, rounds to 12 bits and saturates at the rails. The low-pass is exact for a signal that is straight
//! over half a microsecond. One scan converts the four channels one after the other, [`CONVERSION`] each, so
//! the acceleration is held [`SCAN_SKEW`] after the force; a comparison with the simulation corrects for it.

use bead_model::converter::CONVERSION;
use bead_model::design::{self, SensorScale};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Scans a second: TIM3's trigger rate.
pub const SAMPLE_RATE_HZ: u32 = 100_000;
/// Delay of a scan's acceleration after its force, both at the high gain, s: two conversions.
pub const SCAN_SKEW: f64 = 2.0 * CONVERSION;

/// The converter's reference, which is VDDA, in volts.
pub const REFERENCE_VOLTS: f64 = 3.3;
/// Codes of the 12-bit converter.
pub const CODES: u16 = 4096;

/// Range at the low gain over range at the high gain, in the reference design.
const WIDER: f64 = 16.0;

/// Points of the fine grid in one sample period: 2 MHz at 100 kHz.
const FINE_STEPS: u32 = 20;

/// One sensor with its amplifier and filter. `unit` is N for the force, m/s² for the acceleration.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SensorChannel {
    /// Volts per unit at the sensor.
    pub sensitivity: f64,
    /// Volts at the converter per volt at the sensor.
    pub gain: f64,
    /// Volts at the converter for a quiet sensor.
    pub offset: f64,
    /// Pole of the anti-alias low-pass in Hz, if there is one.
    pub pole_hz: Option<f64>,
    /// Noise at the code, rms, in the sensor's unit; 0 for none.
    pub noise_rms: f64,
}

impl SensorChannel {
    /// This channel at the gain at which its codes span `span` units, with its zero unmoved.
    #[must_use]
    pub fn with_span(self, span: f64) -> Self {
        Self {
            gain: REFERENCE_VOLTS / (self.sensitivity * span),
            ..self
        }
    }

    fn codes_per_unit(&self) -> f64 {
        self.sensitivity * self.gain * f64::from(CODES) / REFERENCE_VOLTS
    }

    /// The code of a quiet sensor, before rounding.
    fn zero_code(&self) -> f64 {
        self.offset * f64::from(CODES) / REFERENCE_VOLTS
    }

    /// Lowest and highest value that a code can express, in the sensor's unit.
    pub fn range(&self) -> (f64, f64) {
        (self.value(0), self.value(CODES - 1))
    }

    /// Value of a code, in the sensor's unit.
    pub fn value(&self, code: u16) -> f64 {
        (f64::from(code) - self.zero_code()) / self.codes_per_unit()
    }

    /// The code of a value, and whether the value lies beyond the rails. The ideal converter of the data
    /// sheet changes code half a step below the step, so it rounds.
    fn convert(&self, value: f64) -> (u16, bool) {
        let code = (self.zero_code() + value * self.codes_per_unit()).round();
        let top = f64::from(CODES - 1);
        (code.clamp(0.0, top) as u16, !(0.0..=top).contains(&code))
    }
}

/// One sensor behind two gains.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DualSensor {
    /// At the high gain: converted first.
    pub sensitive: SensorChannel,
    /// At the low gain.
    pub wide: SensorChannel,
}

impl DualSensor {
    /// This sensor with the gains of a scale times a factor, and its zeros unmoved.
    #[must_use]
    pub fn with_scale(self, scale: &SensorScale, factor: f64) -> Self {
        let span = |per_code: f64| per_code * factor * f64::from(CODES);
        Self {
            sensitive: self.sensitive.with_span(span(scale.per_code)),
            wide: self.wide.with_span(span(scale.wide_per_code)),
        }
    }

    /// Scale of the sensor, as the settings of a bead state it.
    fn scale(&self) -> SensorScale {
        let pole = |channel: &SensorChannel| channel.pole_hz.unwrap_or(0.0);
        SensorScale {
            per_code: 1.0 / self.sensitive.codes_per_unit(),
            wide_per_code: 1.0 / self.wide.codes_per_unit(),
            pole: pole(&self.sensitive),
            wide_pole: pole(&self.wide),
            noise: self.sensitive.noise_rms,
        }
    }
}

/// The front end of one bead.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct AnalogFrontEnd {
    /// The force at the bead's incoming contact.
    pub force: DualSensor,
    /// The absolute acceleration of its intruder.
    pub acceleration: DualSensor,
}

impl Default for AnalogFrontEnd {
    /// The reference design. Force: -0.5 to 15.5 N at the high gain, a span of 256 N at the low one.
    /// Acceleration: ±250 and ±4000 m/s². The paper's strike of 0.45 m/s peaks at 6.4 N and 194 m/s².
    ///
    /// Poles at 40 kHz: far above the 5.2 kHz of the intruder's relaxation, below half the sample rate.
    /// Noise: at the high gain 5 mN, about one code, and 0.05 m/s², half a code (see `docs/front-end.md` for
    /// what real sensors add); at the low gain it is the converter's, three quarters of a code.
    fn default() -> Self {
        let sensor = |sensitivity: f64, span: f64, zero_code: f64, noise: [f64; 2]| {
            let channel = |span: f64, noise_rms: f64| SensorChannel {
                sensitivity,
                gain: REFERENCE_VOLTS / (sensitivity * span),
                offset: zero_code * REFERENCE_VOLTS / f64::from(CODES),
                pole_hz: Some(40e3),
                noise_rms,
            };
            DualSensor {
                sensitive: channel(span, noise[0]),
                wide: channel(WIDER * span, noise[1]),
            }
        };
        Self {
            force: sensor(112.41e-3, 16.0, 128.0, [5e-3, 0.05]),
            acceleration: sensor(1.02e-3, 500.0, 2048.0, [0.05, 1.5]),
        }
    }
}

/// Signals at the two sensors, as functions of time in seconds. Each channel reads a copy.
pub trait SensorStimulus: Clone + Sync {
    /// Total force at the incoming contact in N, compression positive.
    fn force(&mut self, time: f64) -> f64;
    /// Absolute acceleration of the intruder in m/s².
    fn acceleration(&mut self, time: f64) -> f64;
    /// The time until which both are 0 from `time`; `time` itself if something is felt then, or if that is
    /// unknown.
    fn silent_until(&self, time: f64) -> f64 {
        time
    }
}

/// Codes as the converter delivers them, and how often it met a rail.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Digitised {
    /// One `[force, wide force, acceleration, wide acceleration]` a scan.
    pub scans: Vec<[u16; 4]>,
    /// Scans in which each sensor lay beyond a rail at its low gain: force, acceleration.
    pub saturated: [usize; 2],
}

impl AnalogFrontEnd {
    /// Scales of both sensors, as the settings of a bead state them.
    pub fn calibration(&self) -> design::FrontEnd {
        design::FrontEnd {
            force: self.force.scale(),
            acceleration: self.acceleration.scale(),
        }
    }

    /// This front end behind sensors that are `times` less sensitive: ranges and noise grow by that factor.
    #[must_use]
    pub fn behind_weaker_sensors(mut self, times: f64) -> Self {
        for channel in self.channels_mut() {
            channel.sensitivity /= times;
            channel.noise_rms *= times;
        }
        self
    }

    /// The codes of a scan at a supply other than [`REFERENCE_VOLTS`]. The converter compares the signals
    /// with it. The bias is divided from it, so a zero keeps its code; and so does a signal at a rail.
    #[must_use]
    pub fn at_supply(&self, scan: [u16; 4], volts: f64) -> [u16; 4] {
        let (mut own, mut scan) = (*self, scan);
        let top = f64::from(CODES - 1);
        for (code, channel) in scan.iter_mut().zip(own.channels_mut()) {
            let zero = channel.zero_code();
            if (1..CODES - 1).contains(code) {
                let moved = zero + (f64::from(*code) - zero) * REFERENCE_VOLTS / volts;
                *code = moved.round().clamp(0.0, top) as u16;
            }
        }
        scan
    }

    /// The channels, in the order of their conversion.
    pub fn channels_mut(&mut self) -> [&mut SensorChannel; 4] {
        let Self { force, acceleration } = self;
        [
            &mut force.sensitive,
            &mut force.wide,
            &mut acceleration.sensitive,
            &mut acceleration.wide,
        ]
    }

    /// Converts `scans` scans, the first of which holds the force at time 0. Before time 0 both sensors have
    /// been at their value of time 0.
    ///
    /// `seed` fixes the noise; `None` leaves it out. The same arguments give the same codes.
    pub fn digitise(&self, stimulus: &impl SensorStimulus, scans: usize, seed: Option<u64>) -> Digitised {
        let mut own = *self;
        let channels = own.channels_mut().into_par_iter().enumerate();
        let converted: Vec<_> = channels
            .map(|(number, channel)| convert(channel, number, stimulus, scans, seed))
            .collect();
        let scan = |scan: usize| std::array::from_fn(|channel| converted[channel].0[scan]);
        Digitised {
            scans: (0..scans).map(scan).collect(),
            saturated: [converted[1].1, converted[3].1],
        }
    }
}

/// Streams of the seed's generator, one for each channel: the noise of one does not depend on the others.
const NOISE_STREAMS: [u64; 4] = [0, 2, 1, 3];

/// The codes at times 0, T, 2T, … of the channel with this number in the order of the conversions, and how
/// many lay beyond a rail.
fn convert(
    channel: &SensorChannel,
    number: usize,
    stimulus: &impl SensorStimulus,
    scans: usize,
    seed: Option<u64>,
) -> (Vec<u16>, usize) {
    let mut generator = seed.map(|seed| {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(NOISE_STREAMS[number]);
        generator
    });
    let noise = Normal::new(0.0, channel.noise_rms.abs()).expect("a finite standard deviation");
    let fine = f64::from(SAMPLE_RATE_HZ) * f64::from(FINE_STEPS);
    let time = |step: u64| step as f64 / fine;
    // Seconds by which the channel is held after the force at the high gain.
    let after = number as f64 * CONVERSION;
    let mut signals = stimulus.clone();
    let mut signal = |time: f64| match number {
        0 | 1 => signals.force(time + after),
        _ => signals.acceleration(time + after),
    };
    let mut filter = LowPass::new(channel.pole_hz, 1.0 / fine, signal(0.0));
    let mut codes = Vec::with_capacity(scans);
    let (mut saturated, mut silent) = (0, 0.0);
    for scan in 0..scans as u64 {
        if scan > 0 {
            let steps = (scan - 1) * u64::from(FINE_STEPS)..scan * u64::from(FINE_STEPS);
            if silent <= time(steps.start) {
                silent = stimulus.silent_until(time(steps.start) + after) - after;
            }
            if time(steps.end) < silent {
                filter.rest(FINE_STEPS)
            } else {
                steps.for_each(|step| _ = filter.advance(signal(time(step + 1))))
            }
        }
        let noise = generator
            .as_mut()
            .map_or(0.0, |generator| noise.sample(generator));
        let (code, beyond) = channel.convert(filter.output + noise);
        saturated += usize::from(beyond);
        codes.push(code);
    }
    (codes, saturated)
}

/// A one-pole low-pass, exact for an input that is straight between the points given to it.
pub(crate) struct LowPass {
    /// Weights of the output and of the input before, and of the next input.
    weights: [f64; 3],
    input: f64,
    output: f64,
}

impl LowPass {
    /// A filter in equilibrium with `value`, to be fed every `period` seconds.
    pub(crate) fn new(pole_hz: Option<f64>, period: f64, value: f64) -> Self {
        let hold = |hz: f64| first_order_hold(std::f64::consts::TAU * hz * period);
        Self {
            weights: pole_hz.map_or([0.0, 0.0, 1.0], hold),
            input: value,
            output: value,
        }
    }

    /// Takes the next input and returns the output at its time.
    pub(crate) fn advance(&mut self, input: f64) -> f64 {
        let [decay, old, new] = self.weights;
        self.output = decay * self.output + old * self.input + new * input;
        self.input = input;
        self.output
    }

    /// Takes 0 as the next `steps` inputs.
    fn rest(&mut self, steps: u32) {
        for _ in 0..steps {
            // An output far below the least noise becomes 0. Subnormal numbers would never vanish, and would
            // cost most of the time.
            if self.input == 0.0 && self.output.abs() < 1e-30 {
                self.output = 0.0;
                return;
            }
            self.advance(0.0);
        }
    }
}

/// The three constants of `y' = (u - y)/T₀` over one step of `phase` = step/T₀, for `u` straight between the
/// ends: `y₁ = decay·y₀ + old·u₀ + new·u₁`.
pub(crate) fn first_order_hold(phase: f64) -> [f64; 3] {
    let decay = (-phase).exp();
    let mean = -(-phase).exp_m1() / phase;
    [decay, mean - decay, 1.0 - mean]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Amplitude and frequency, Hz, of a sine at both sensors. The force swings about 8 N.
    #[derive(Clone)]
    struct Sine(f64, f64);

    impl SensorStimulus for Sine {
        fn force(&mut self, time: f64) -> f64 {
            8.0 + self.acceleration(time)
        }
        fn acceleration(&mut self, time: f64) -> f64 {
            self.0 * (TAU * self.1 * time).sin()
        }
    }

    fn rms(values: &[f64]) -> f64 {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt()
    }

    fn values(front_end: &AnalogFrontEnd, sine: Sine, scans: usize, seed: Option<u64>) -> [Vec<f64>; 2] {
        let codes = front_end.digitise(&sine, scans, seed).scans;
        let force = codes.iter().map(|c| front_end.force.sensitive.value(c[0]));
        let acceleration = codes.iter().map(|c| front_end.acceleration.sensitive.value(c[2]));
        [force.collect(), acceleration.collect()]
    }

    #[test]
    fn the_noise_has_the_rms_asked_for_and_is_independent_on_both_channels() {
        let mut front_end = AnalogFrontEnd::default();
        front_end.force.sensitive.noise_rms = 0.5;
        front_end.acceleration.sensitive.noise_rms = 15.0;
        let [force, acceleration] = values(&front_end, Sine(0.0, 1.0), 40_000, Some(7));
        // 40 000 samples fix a standard deviation to 0.35 % (one sigma of the estimate).
        let (of_force, of_acceleration) = (rms(&force) / 0.5, rms(&acceleration) / 15.0);
        assert!((of_force - 1.0).abs() < 0.015, "{of_force}");
        assert!((of_acceleration - 1.0).abs() < 0.015, "{of_acceleration}");
        let product = force.iter().zip(&acceleration).map(|(f, a)| (f - 8.0) * a);
        let correlation = product.sum::<f64>() / 40_000.0 / (0.5 * 15.0);
        assert!(correlation.abs() < 0.02, "{correlation}");
    }

    #[test]
    fn what_lies_beyond_a_rail_saturates_and_is_counted() {
        let mut front_end = AnalogFrontEnd::default();
        front_end.acceleration.wide = front_end.acceleration.sensitive;
        front_end.acceleration.wide.pole_hz = None;
        // A period of 100 samples, off the grid by the scan skew: the sine exceeds 250 of 400 m/s² for
        // two arcs of acos(252.8/400)/π of the period.
        let Digitised { scans, saturated } = front_end.digitise(&Sine(400.0, 1e3), 10_000, None);
        let expected = 10_000.0 * 2.0 * (250.0_f64 / 400.0).acos() / std::f64::consts::PI;
        let counted = saturated[1];
        assert!((counted as f64 - expected).abs() <= 200.0, "{counted} {expected}");
        let at_rails = scans.iter().filter(|c| c[3] == 0 || c[3] == CODES - 1);
        assert!(at_rails.count() >= counted);
    }

    #[test]
    fn the_channels_are_converted_one_after_the_other() {
        let mut front_end = AnalogFrontEnd::default();
        for sensor in [&mut front_end.force, &mut front_end.acceleration] {
            sensor.sensitive.pole_hz = None;
            sensor.wide = sensor.sensitive;
        }
        let codes = front_end.digitise(&Sine(7.0, 4850.0), 2000, None).scans;
        // Phase of each channel, from 97 periods in 2000 samples: no two samples share a phase.
        let phase = |channel: usize| {
            let (mut s, mut c) = (0.0, 0.0);
            for (i, scan) in codes.iter().enumerate() {
                let angle = TAU * 4850.0 * i as f64 / f64::from(SAMPLE_RATE_HZ);
                s += f64::from(scan[channel]) * angle.sin();
                c += f64::from(scan[channel]) * angle.cos();
            }
            c.atan2(s)
        };
        for channel in 1..4 {
            let skew = (phase(channel) - phase(0)) / (TAU * 4850.0);
            let expected = channel as f64 * CONVERSION;
            assert!((skew - expected).abs() < 5e-8, "{skew} {expected}");
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_codes_and_another_seed_does_not() {
        let codes = |seed| AnalogFrontEnd::default().digitise(&Sine(5.0, 1e3), 1000, seed);
        assert_eq!(codes(Some(1)), codes(Some(1)));
        assert_ne!(codes(Some(1)), codes(Some(2)));
        assert_ne!(codes(Some(1)), codes(None));
    }

    #[test]
    fn the_default_is_the_reference_design_that_settings_are_derived_from() {
        let both = [
            AnalogFrontEnd::default().calibration(),
            design::FrontEnd::reference(),
        ];
        let pairs = [both.map(|one| one.force), both.map(|one| one.acceleration)];
        for [ours, reference] in pairs {
            assert!((ours.per_code / reference.per_code - 1.0).abs() < 1e-12);
            assert!((ours.wide_per_code / reference.wide_per_code - 1.0).abs() < 1e-12);
            let rest = |scale: SensorScale| (scale.pole, scale.wide_pole, scale.noise);
            assert_eq!(rest(ours), rest(reference));
        }
    }

    #[test]
    fn codes_grow_from_their_zeros_as_the_supply_falls_and_a_rail_stays() {
        let front_end = AnalogFrontEnd::default();
        // Zeros are at 128 and 2048.
        let scan = [128 + 1000, 4095, 2048 - 1000, 0];
        for (volts, expected) in [
            (3.3, scan),
            (3.0, [128 + 1100, 4095, 2048 - 1100, 0]),
            (3.6, [128 + 917, 4095, 2048 - 917, 0]),
            (1.1, [128 + 3000, 4095, 0, 0]),
        ] {
            assert_eq!(front_end.at_supply(scan, volts), expected, "{volts} V");
        }
    }

    #[test]
    fn a_code_and_its_value_round_trip() {
        let channel = AnalogFrontEnd::default().force.sensitive;
        for code in 0..CODES {
            assert_eq!(channel.convert(channel.value(code)), (code, false));
        }
    }
}
