//! From physical quantities in f64 to the settings in fixed point.
//!
//! ```
//! use bead_model::design::{Bead, Capture, FrontEnd, derive};
//! let settings = derive(&Bead::paper(), &FrontEnd::reference(), &Capture::default())?;
//! assert_eq!(settings.sample_rate_hz, 100_000);
//! # Ok::<(), bead_model::design::DesignError>(())
//! ```

use crate::calibration::Channel;
use crate::coefficients::coefficients;
use crate::company::Company;
use crate::layout::{HISTORY_MAX, WINDOW_MAX, WindowSettings};
use crate::observer::Observer;
use crate::quantity::SensedForce;
use crate::reduced_chain::{FOLLOWERS, ReducedChain};
use crate::scale::{INCOMING_MAX, SHIFT_MAX, Scale};
use crate::sensor::Sensor;
use crate::settings::{Name, Settings, SettingsError};
use crate::shape::Ringing;
use fixed::traits::Fixed;
use fixed::types::I16F16;
use fixed::types::extra::LeEqU32;
use std::f64::consts::{PI, TAU};
use std::ops::Range;

pub use crate::coefficients::{Bead, Intruder, SOLITARY_WAVE_ENERGY};

impl Bead {
    /// The paper's bead: Bakelite, R = 19 mm, Y = 4.5 GPa as fitted; m = 3.7 g, k = 3.95e5 N/m, c = 12 N·s/m.
    pub fn paper() -> Self {
        let (radius, density, young, poisson) = (0.019_f64, 1775.0, 4.5e9, 0.44_f64);
        let theta = 0.75 * (1.0 - poisson * poisson) / young;
        Self {
            mass: 4.0 / 3.0 * PI * radius.powi(3) * density,
            intruder_mass: 3.7e-3,
            front_mass: 0.0,
            stiffness: 3.95e5,
            damping: 12.0,
            contact_stiffness: 1.0 / (2.0 * theta) / (2.0 / radius).sqrt(),
            relaxation: 4.2e-6,
        }
    }

    /// Full width at half its height, s, of the pulse of force of a solitary wave that moves the beads of an
    /// elastic chain with at most `speed`, m/s: `w (M/κ)^{2/5} speed^{-1/5}`.
    pub fn pulse_width(&self, speed: f64) -> f64 {
        PULSE_WIDTH * (self.mass / self.contact_stiffness).powf(0.4) * speed.powf(-0.2)
    }
}

/// w of [`Bead::pulse_width`]. Found from the pulse at contact 70 of an elastic chain; a test finds it again.
const PULSE_WIDTH: f64 = 1.556;
/// The least width of the pulse of a wave of 1 m/s, in samples. Estimate A is then off by 1.4 %, and estimate
/// B by 6 % (`cargo test -p bead-model spheres -- --nocapture`).
pub const LEAST_WIDTH: f64 = 2.5;

/// One sensor channel as the converter sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelFrontEnd {
    /// Quantity (N or m/s²) per code.
    pub per_code: f64,
    /// Code at zero quantity, 0 to 4095.
    pub zero_code: f64,
    /// Corner of the anti-alias filter, Hz; `None` for an ideal channel.
    pub pole_hz: Option<f64>,
    /// White noise before sampling, rms, in the channel's quantity.
    pub noise_rms: f64,
}

/// One sensor behind its two amplifiers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorFrontEnd {
    /// The channel of the high gain, which is converted first.
    pub sensitive: ChannelFrontEnd,
    /// The channel of the low gain.
    pub wide: ChannelFrontEnd,
    /// Time from the conversion of the sensitive channel to that of the wide one, s.
    pub delay: f64,
}

/// Both sensors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrontEnd {
    /// Force at the host's incoming contact, N.
    pub force: SensorFrontEnd,
    /// Acceleration of the intruder, m/s².
    pub acceleration: SensorFrontEnd,
}

impl FrontEnd {
    /// One conversion of the ADC: 15 + 12 clocks of 21 MHz.
    pub const CONVERSION: f64 = 27.0 / 21e6;

    /// The reference design of `docs/front-end.md`: 16 N and ±250 m/s² over twelve bits at the high gain, 16
    /// times as much at the low one; one-pole filters at 40 kHz.
    pub fn reference() -> Self {
        let sensor = |span: f64, zero_code: f64, [noise, wide_noise]: [f64; 2]| {
            let channel = |span: f64, noise_rms: f64| ChannelFrontEnd {
                per_code: span / 4096.0,
                zero_code,
                pole_hz: Some(40e3),
                noise_rms,
            };
            SensorFrontEnd {
                sensitive: channel(span, noise),
                wide: channel(16.0 * span, wide_noise),
                delay: Self::CONVERSION,
            }
        };
        Self {
            force: sensor(16.0, 128.0, [5e-3, 0.05]),
            acceleration: sensor(500.0, 2048.0, [0.05, 1.5]),
        }
    }
}

/// When and for how long a strike is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capture {
    /// Sample rate, Hz.
    pub sample_rate_hz: u32,
    /// Time before the trigger, s.
    pub history: f64,
    /// Length of the whole window, s.
    pub length: f64,
    /// Rise of the force that triggers, N.
    pub threshold: f64,
    /// Time over which the force must rise by the threshold, s.
    pub lookback: f64,
    /// A strike is flagged if A and B differ by more than this part of the greater.
    pub disagreement: f64,
    /// Part by which the frequency of the ringing may be off before a strike is flagged.
    pub ring_frequency_tolerance: f64,
    /// Part by which the decay of the ringing may be off.
    pub ring_decay_tolerance: f64,
}

impl Capture {
    /// The default, with a threshold above the noise of this front end: at least ten standard deviations and
    /// seven codes. Where pulses are longer than those of the paper's bead, so are the times, as far as a
    /// window goes.
    pub fn of(bead: &Bead, front_end: &FrontEnd) -> Self {
        let quiet = &front_end.force.sensitive;
        let least = f64::max(10.0 * quiet.noise_rms, 7.0 * quiet.per_code);
        let default = Self::default();
        let longer = (bead.pulse_width(1.0) / Bead::paper().pulse_width(1.0)).max(1.0);
        let rate = f64::from(default.sample_rate_hz);
        let most = |time: f64, samples: f64| f64::min(longer * time, samples / rate);
        Self {
            threshold: default.threshold.max(least),
            history: most(default.history, HISTORY_MAX as f64),
            lookback: most(default.lookback, HISTORY_MAX as f64 - 1.0),
            length: most(default.length, WINDOW_MAX.into()),
            ..default
        }
    }
}

impl Default for Capture {
    /// 100 kHz. The history of 1.6 ms has 0.64 ms for the zeros and 0.64 ms for the noise. In the window of
    /// 6.72 ms the paper's intruder rings down to 1e-7 of its energy. The trigger is a rise of 0.1 N in 0.5
    /// ms. A strike is flagged if A and B differ by 3 %, ten times the effect of noise and half the effect of
    /// a chain without viscosity; or if the ringing is off by 3 % in frequency (6 % in k) or 30 % in decay.
    fn default() -> Self {
        Self {
            sample_rate_hz: 100_000,
            history: 1.6e-3,
            length: 6.72e-3,
            threshold: 0.1,
            lookback: 0.5e-3,
            disagreement: 0.03,
            ring_frequency_tolerance: 0.03,
            ring_decay_tolerance: 0.3,
        }
    }
}

/// Why a bead has no settings.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DesignError {
    /// An input that no bead has.
    #[error("{name} = {value}: must be {expected}")]
    Input {
        /// Which one.
        name: &'static str,
        /// What was given.
        value: f64,
        /// What is allowed.
        expected: &'static str,
    },
    /// The waves of this bead are too short for the sample rate.
    #[error("a wave of 1 m/s is {samples:.2} samples wide, and {least} at least can be measured")]
    TooFast {
        /// Full width at half the height of its force, samples.
        samples: f64,
        /// The least.
        least: f64,
    },
    /// An input that does not fit its format, or loses more than 1e-4 of itself in it.
    #[error(
        "{name}: {value:.3e}, and {low:.1e} to {high:.1e} can be computed with",
        low = range.0, high = range.1
    )]
    Scale {
        /// Which one.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The range of the format.
        range: (f64, f64),
    },
    /// The same of a coefficient, which follows from several inputs.
    #[error(
        "{name}: {value:.3e} in the units of the sample rate, and {low:.1e} to {high:.1e} can be computed with",
        low = range.0, high = range.1
    )]
    Coefficient {
        /// Which one.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The range of the format.
        range: (f64, f64),
    },
    /// Settings that the bead refuses.
    #[error(transparent)]
    Window(#[from] SettingsError),
}

/// The intruders of the beads around.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Neighbours {
    /// Which of the beads behind the host hold an intruder, from the one next to it on.
    pub behind: [bool; FOLLOWERS],
    /// Whether others near by do: in front of the host, or further behind.
    pub elsewhere: bool,
    /// The intruder that those behind hold. Not looked at if none does.
    pub intruder: Intruder,
}

/// Derives the settings of a bead that is alone. It has no name yet: see [`Settings::name`].
pub fn derive(bead: &Bead, front_end: &FrontEnd, capture: &Capture) -> Result<Settings, DesignError> {
    derive_among(bead, &Neighbours::default(), front_end, capture)
}

/// Derives the settings of a bead among others that hold intruders.
pub fn derive_among(
    bead: &Bead,
    neighbours: &Neighbours,
    front_end: &FrontEnd,
    capture: &Capture,
) -> Result<Settings, DesignError> {
    for (name, value) in [
        ("bead mass", bead.mass),
        ("intruder mass", bead.intruder_mass),
        ("intruder stiffness", bead.stiffness),
        ("intruder damping", bead.damping),
        ("contact stiffness", bead.contact_stiffness),
        ("force per code", front_end.force.sensitive.per_code),
        ("wide force per code", front_end.force.wide.per_code),
        ("acceleration per code", front_end.acceleration.sensitive.per_code),
        ("wide acceleration per code", front_end.acceleration.wide.per_code),
        ("sample rate", f64::from(capture.sample_rate_hz)),
        ("trigger threshold", capture.threshold),
    ] {
        require(value.is_finite() && value > 0.0, name, value, "positive")?;
    }
    let relaxation = bead.relaxation;
    let holds = relaxation.is_finite() && relaxation >= 0.0;
    require(holds, "relaxation", relaxation, "0 or positive")?;
    let (intruder, front) = (bead.intruder_mass, bead.front_mass);
    require(
        intruder < bead.mass,
        "intruder mass",
        intruder,
        "below the bead's",
    )?;
    let holds = (0.0..bead.mass - intruder).contains(&front);
    require(holds, "front mass", front, "0 or more, and below the host's")?;

    let dt = 1.0 / f64::from(capture.sample_rate_hz);
    let (samples, least) = (bead.pulse_width(1.0) / dt, LEAST_WIDTH);
    if samples < least {
        return Err(DesignError::TooFast { samples, least });
    }
    let coefficient = coefficients(bead, f64::from(capture.sample_rate_hz));
    let behind = neighbours
        .behind
        .iter()
        .rev()
        .fold(0, |bits, holds| bits << 1 | u8::from(*holds));
    let intruder = match behind {
        0 => Intruder::default(),
        _ => neighbours.intruder,
    };
    if behind > 0 {
        for (name, value) in [
            ("mass of the intruders behind", intruder.mass),
            ("stiffness of the intruders behind", intruder.stiffness),
            ("damping of the intruders behind", intruder.damping),
        ] {
            require(value.is_finite() && value > 0.0, name, value, "positive")?;
        }
        let mass = intruder.mass;
        require(
            mass < bead.mass,
            "mass of the intruders behind",
            mass,
            "below the bead's",
        )?;
    }
    let [stiffness, damping, ratio] = intruder.coefficients(bead.mass, f64::from(capture.sample_rate_hz));
    let scale = Scale {
        contact: shift(coefficient.contact, SHIFT_MAX),
        incoming: shift(coefficient.incoming, INCOMING_MAX),
        masses: shift(coefficient.intruder.max(coefficient.host).max(ratio), SHIFT_MAX),
        observer: shift(coefficient.end, 1),
        measured: shift_into(coefficient.measured, 1.0 / 65536.0..1.0),
        predicted: shift_into(coefficient.predicted, 0.1..16384.0),
    };
    let without = |value: f64, powers: u8| value * 0.5_f64.powi(powers.into());
    let observer = Observer {
        start: fix("weight of the old acceleration", coefficient.start)?,
        end: fix(
            "weight of the new acceleration",
            without(coefficient.end, scale.observer),
        )?,
        energy: fix(
            "energy by acceleration",
            coefficient.measured * 0.5_f64.powi(scale.measured.into()),
        )?,
    };
    let force = sensor(&front_end.force, dt, FORCE_NAMES)?;
    let acceleration = sensor(&front_end.acceleration, dt, ACCELERATION_NAMES)?;
    let quiet = &front_end.force.sensitive;
    let (noise, most) = (quiet.noise_rms, NOISE_MOST);
    require(
        (0.0..=most).contains(&noise),
        "force noise",
        noise,
        "from 0 to 1e4",
    )?;
    let force_noise = noise.hypot(quiet.per_code / 12f64.sqrt());
    let chain = ReducedChain {
        contact: fix(
            "stiffness of the contacts",
            without(coefficient.contact, scale.contact),
        )?,
        relaxation: fix(
            "relaxation time of the contacts over 2/3 of a sample",
            coefficient.relaxation,
        )?,
        incoming: fix(
            "acceleration of the host by a newton",
            without(coefficient.incoming, scale.incoming),
        )?,
        stiffness: fix("stiffness of the intruder's springs", coefficient.stiffness)?,
        damping: fix("damping of the intruder", coefficient.damping)?,
        intruder: fix(
            "mass of the intruder over that of the host without it",
            without(coefficient.intruder, scale.masses),
        )?,
        host: fix(
            "mass of the bead over that of the host without intruder, less one,",
            without(coefficient.host, scale.masses),
        )?,
        // In range, since both parts of the noise are.
        gate: SensedForce::from_num(3.0 * force_noise),
        energy: fix(
            "energy by velocity",
            coefficient.predicted * 0.5_f64.powi(scale.predicted.into()),
        )?,
    };

    let samples = |seconds: f64| (seconds / dt).round().clamp(0.0, f64::from(u16::MAX)) as u16;
    let settings = Settings {
        name: Name::default(),
        address: 0,
        scale,
        company: Company {
            behind,
            elsewhere: neighbours.elsewhere,
            intruder: Intruder {
                mass: intruder.mass as f32,
                stiffness: intruder.stiffness as f32,
                damping: intruder.damping as f32,
            },
            stiffness: fix("stiffness of the intruders behind", stiffness)?,
            damping: fix("damping of the intruders behind", damping)?,
            ratio: fix(
                "mass of the intruders behind over that of their beads",
                without(ratio, scale.masses),
            )?,
        },
        sample_rate_hz: capture.sample_rate_hz,
        bead: Bead {
            mass: bead.mass as f32,
            intruder_mass: bead.intruder_mass as f32,
            front_mass: bead.front_mass as f32,
            stiffness: bead.stiffness as f32,
            damping: bead.damping as f32,
            contact_stiffness: bead.contact_stiffness as f32,
            relaxation: bead.relaxation as f32,
        },
        force,
        acceleration,
        window: WindowSettings {
            history: samples(capture.history),
            length: samples(capture.length),
            threshold: (capture.threshold / front_end.force.sensitive.per_code).round() as u16,
            lookback: samples(capture.lookback),
        },
        observer,
        chain,
        incident: fix("incident", coefficient.incident)?,
        disagreement: part("disagreement", capture.disagreement)?,
        ringing: Ringing {
            frequency: fix("frequency of the ringing", coefficient.ring_frequency)?,
            frequency_tolerance: part("tolerance of the frequency", capture.ring_frequency_tolerance)?,
            decay: fix("decay of the ringing", coefficient.ring_decay)?,
            decay_tolerance: part("tolerance of the decay", capture.ring_decay_tolerance)?,
        },
    };
    settings.validate()?;
    Ok(settings)
}

/// The least powers of two, up to `most`, that bring a coefficient below a half. What is still too large then
/// is refused by [`fix`].
fn shift(value: f64, most: u8) -> u8 {
    let fits = |powers: &u8| value * 0.5_f64.powi((*powers).into()) < 0.499_999;
    (0..most).find(fits).unwrap_or(most)
}

/// The powers of two that bring a coefficient of an energy into a range in which its format is exact enough;
/// 0 if it is there.
fn shift_into(value: f64, range: Range<f64>) -> i8 {
    match value {
        _ if value >= range.end => ((value / range.end).log2().floor() as i8).saturating_add(1),
        _ if value < range.start => (value / range.start).log2().floor() as i8,
        _ => 0,
    }
}

/// The force's noise at most, N, rms: three times of it is a gate that has a format.
const NOISE_MOST: f64 = 1e4;
/// What is wrong with a channel is told by these names: of the quantity per code and of the pole, at the high
/// gain and at the low one.
const FORCE_NAMES: [[&str; 2]; 2] = [
    ["force per code", "force pole"],
    ["wide force per code", "wide force pole"],
];
const ACCELERATION_NAMES: [[&str; 2]; 2] = [
    ["acceleration per code", "acceleration pole"],
    ["wide acceleration per code", "wide acceleration pole"],
];

fn sensor<F: LeEqU32>(
    sensor: &SensorFrontEnd,
    dt: f64,
    [sensitive, wide]: [[&'static str; 2]; 2],
) -> Result<Sensor<F>, DesignError> {
    Ok(Sensor {
        sensitive: channel(&sensor.sensitive, 0.0, dt, sensitive)?,
        wide: channel(&sensor.wide, sensor.delay, dt, wide)?,
    })
}

fn channel<F: LeEqU32>(
    channel: &ChannelFrontEnd,
    delay: f64,
    dt: f64,
    [per_code, pole]: [&'static str; 2],
) -> Result<Channel<F>, DesignError> {
    let lag = match channel.pole_hz {
        Some(hz) => {
            require(hz.is_finite() && hz > 0.0, pole, hz, "positive")?;
            1.0 / (TAU * hz)
        }
        None => 0.0,
    };
    Ok(Channel {
        per_code: scale(per_code, channel.per_code)?,
        slope: fix(pole, channel.per_code * (lag - delay) / (2.0 * dt))?,
    })
}

/// Refuses an input that does not hold what is expected.
fn require(holds: bool, name: &'static str, value: f64, expected: &'static str) -> Result<(), DesignError> {
    holds.then_some(()).ok_or(DesignError::Input {
        name,
        value,
        expected,
    })
}

/// A coefficient in the format `F`.
fn fix<F: Fixed>(name: &'static str, value: f64) -> Result<F, DesignError> {
    exact(value).ok_or_else(|| DesignError::Coefficient {
        name,
        value,
        range: range_of::<F>(),
    })
}

/// An input in the format `F`.
fn scale<F: Fixed>(name: &'static str, value: f64) -> Result<F, DesignError> {
    exact(value).ok_or_else(|| DesignError::Scale {
        name,
        value,
        range: range_of::<F>(),
    })
}

/// A part beyond which a strike is flagged. A limit need not be exact: the nearest of the format will do.
fn part(name: &'static str, value: f64) -> Result<I16F16, DesignError> {
    require((1e-3..=1e4).contains(&value), name, value, "from 0.001 to 10000")?;
    Ok(I16F16::from_num(value))
}

/// `value` in the format `F`; none if that does not hold it, or only to less than 1e-4 of it.
fn exact<F: Fixed>(value: f64) -> Option<F> {
    F::checked_from_num(value).filter(|fixed| (fixed.to_num::<f64>() - value).abs() <= 1e-4 * value.abs())
}

/// The numbers that a format holds to 1e-4 of themselves.
fn range_of<F: Fixed>() -> (f64, f64) {
    (F::DELTA.to_num::<f64>() * 5e3, F::MAX.to_num::<f64>())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What settings are derived from; at first that of the paper's bead, with intruders behind it.
    struct Inputs {
        bead: Bead,
        neighbours: Neighbours,
        front_end: FrontEnd,
        capture: Capture,
    }

    impl Default for Inputs {
        fn default() -> Self {
            let bead = Bead::paper();
            Self {
                bead,
                neighbours: Neighbours {
                    behind: [true, false, false, true],
                    elsewhere: false,
                    intruder: Intruder {
                        mass: bead.intruder_mass,
                        stiffness: bead.stiffness,
                        damping: bead.damping,
                    },
                },
                front_end: FrontEnd::reference(),
                capture: Capture::default(),
            }
        }
    }

    impl Inputs {
        fn derive(&self) -> Result<Settings, DesignError> {
            derive_among(&self.bead, &self.neighbours, &self.front_end, &self.capture)
        }

        /// Why changed inputs are refused.
        fn refused(change: impl FnOnce(&mut Self)) -> String {
            let mut inputs = Self::default();
            change(&mut inputs);
            inputs.derive().unwrap_err().to_string()
        }
    }

    #[test]
    fn the_paper_bead_has_the_contact_stiffness_and_mass_of_the_reference() {
        let bead = Bead::paper();
        assert!((bead.contact_stiffness / 3.626_039_562_8e8 - 1.0).abs() < 1e-10);
        assert!((bead.mass / 0.050_997_368_825_967_98 - 1.0).abs() < 1e-12);
    }

    #[test]
    fn settings_survive_their_block() {
        let settings = derive(&Bead::paper(), &FrontEnd::reference(), &Capture::default()).unwrap();
        let mut block = [0; crate::settings::BLOCK_MAX];
        let length = settings.encode(&mut block).unwrap();
        println!("settings block: {length} bytes");
        assert_eq!(Settings::decode(&block), Ok(settings));
        for bit in (0..length * 8).step_by(if cfg!(miri) { 41 } else { 1 }) {
            let mut damaged = block;
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert!(
                Settings::decode(&damaged[..length]).is_err(),
                "bit {bit} flipped and accepted"
            );
        }
        assert_eq!(
            Settings::decode(&block[..length - 1]),
            Err(SettingsError::Truncated)
        );
        assert_eq!(Settings::decode(&[0xff; 64]), Err(SettingsError::Erased));
    }

    #[test]
    fn what_no_bead_has_is_refused_by_name() {
        let refused = |change: fn(&mut Bead)| {
            let mut bead = Bead::paper();
            change(&mut bead);
            derive(&bead, &FrontEnd::reference(), &Capture::default())
                .unwrap_err()
                .to_string()
        };
        assert!(refused(|b| b.damping = 0.0).starts_with("intruder damping = 0"));
        assert!(refused(|b| b.mass = f64::NAN).starts_with("bead mass = NaN"));
        assert!(refused(|b| b.intruder_mass = 1.0).starts_with("intruder mass = 1"));
        assert!(refused(|b| b.front_mass = 0.05).starts_with("front mass = 0.05"));
        assert!(refused(|b| b.stiffness = 1e12).starts_with("stiffness of the intruder's springs: "));
        assert!(refused(|b| b.contact_stiffness = 1e12).starts_with("a wave of 1 m/s is 0.75 samples wide"));
    }

    #[test]
    fn each_input_that_is_not_finite_and_positive_is_refused_by_its_name() {
        type Set = fn(&mut Inputs, f64);
        let numbers: [(&str, Set); 11] = [
            ("bead mass", |inputs, value| inputs.bead.mass = value),
            ("intruder mass", |inputs, value| inputs.bead.intruder_mass = value),
            ("intruder stiffness", |inputs, value| {
                inputs.bead.stiffness = value
            }),
            ("intruder damping", |inputs, value| inputs.bead.damping = value),
            ("contact stiffness", |inputs, value| {
                inputs.bead.contact_stiffness = value
            }),
            ("force per code", |inputs, value| {
                inputs.front_end.force.sensitive.per_code = value
            }),
            ("wide force per code", |inputs, value| {
                inputs.front_end.force.wide.per_code = value
            }),
            ("acceleration per code", |inputs, value| {
                inputs.front_end.acceleration.sensitive.per_code = value
            }),
            ("wide acceleration per code", |inputs, value| {
                inputs.front_end.acceleration.wide.per_code = value
            }),
            ("trigger threshold", |inputs, value| {
                inputs.capture.threshold = value
            }),
            ("wide force pole", |inputs, value| {
                inputs.front_end.force.wide.pole_hz = Some(value)
            }),
        ];
        for (name, set) in numbers {
            for value in [0.0, -1.0, f64::NAN, f64::INFINITY] {
                let mut inputs = Inputs::default();
                set(&mut inputs, value);
                let refused = inputs.derive().unwrap_err().to_string();
                assert!(
                    refused.starts_with(&format!("{name} = {value}: must be positive")),
                    "{refused}"
                );
            }
        }
    }

    #[test]
    fn inputs_at_the_ends_of_their_ranges_are_refused_by_their_name() {
        let refused = |change: fn(&mut Inputs), text: &str| {
            let told = Inputs::refused(change);
            assert!(told.starts_with(text), "{told}");
        };
        refused(
            |inputs| inputs.bead.relaxation = -1e-9,
            "relaxation = -0.000000001: must be 0 or",
        );
        refused(
            |inputs| inputs.bead.relaxation = f64::INFINITY,
            "relaxation = inf",
        );
        refused(
            |inputs| inputs.bead.intruder_mass = inputs.bead.mass,
            "intruder mass = 0.0509",
        );
        refused(
            |inputs| inputs.bead.front_mass = -1e-9,
            "front mass = -0.000000001",
        );
        let host =
            |inputs: &mut Inputs| inputs.bead.front_mass = inputs.bead.mass - inputs.bead.intruder_mass;
        refused(host, "front mass = 0.047");
        type Number = fn(&mut Intruder) -> &mut f64;
        let behind: [(&str, Number); 3] = [
            ("mass", |intruder| &mut intruder.mass),
            ("stiffness", |intruder| &mut intruder.stiffness),
            ("damping", |intruder| &mut intruder.damping),
        ];
        for (name, number) in behind {
            for value in [0.0, f64::NAN, f64::INFINITY] {
                let told = Inputs::refused(|inputs| *number(&mut inputs.neighbours.intruder) = value);
                assert!(
                    told.starts_with(&format!("{name} of the intruders behind = {value}: must be pos")),
                    "{told}"
                );
            }
        }
        let heavy = |inputs: &mut Inputs| inputs.neighbours.intruder.mass = inputs.bead.mass;
        refused(heavy, "mass of the intruders behind = 0.0509");
        // Where none is behind, nobody looks at what it would be.
        let mut alone = Inputs::default();
        alone.neighbours.behind = [false; FOLLOWERS];
        let settings = alone.derive().unwrap();
        alone.neighbours.intruder = Intruder::default();
        assert_eq!(alone.derive(), Ok(settings));
        assert_eq!(
            derive(&alone.bead, &alone.front_end, &alone.capture),
            Ok(settings)
        );
        assert_eq!(settings.company, Company::default());
    }

    #[test]
    fn a_wave_that_is_too_short_is_refused_with_its_width() {
        // As wide as 2.5 samples at the least: M/κ to the power 2/5.
        let stiffer = |width: f64| {
            let mut inputs = Inputs::default();
            let now = inputs.bead.pulse_width(1.0) * 1e5;
            inputs.bead.contact_stiffness *= (now / width).powf(2.5);
            inputs.derive()
        };
        assert!(stiffer(2.501).is_ok());
        let refused = stiffer(2.499).unwrap_err().to_string();
        assert_eq!(
            refused,
            "a wave of 1 m/s is 2.50 samples wide, and 2.5 at least can be measured"
        );
        // A faster wave is shorter, by the power 1/5.
        let bead = Bead::paper();
        assert!((bead.pulse_width(32.0) / bead.pulse_width(1.0) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn those_behind_stand_in_their_bits_with_their_numbers() {
        let settings = Inputs::default().derive().unwrap();
        let company = settings.company;
        assert_eq!((company.behind, company.elsewhere), (0b1001, false));
        assert_eq!(company.intruder.mass, settings.bead.intruder_mass);
        assert_eq!(company.intruder.stiffness, settings.bead.stiffness);
        assert_eq!(company.intruder.damping, settings.bead.damping);
        assert_eq!(
            (company.stiffness, company.damping),
            (settings.chain.stiffness, settings.chain.damping)
        );
        let mut elsewhere = Inputs::default();
        elsewhere.neighbours = Neighbours {
            elsewhere: true,
            ..Neighbours::default()
        };
        assert_eq!(
            elsewhere.derive().unwrap().company,
            Company {
                elsewhere: true,
                ..Company::default()
            }
        );
    }

    #[test]
    fn times_of_a_capture_grow_with_the_pulse_as_far_as_a_window_goes() {
        let (paper, front_end) = (Bead::paper(), FrontEnd::reference());
        let slower = |times: f64| {
            let mass = paper.mass * times.powf(2.5);
            Capture::of(&Bead { mass, ..paper }, &front_end)
        };
        let default = Capture::default();
        assert_eq!(Capture::of(&paper, &front_end), default);
        assert_eq!(slower(0.5), default, "shorter pulses have the same times");
        let close =
            |found: f64, expected: f64| assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
        let a_quarter = slower(1.25);
        close(a_quarter.history, 1.25 * default.history);
        close(a_quarter.length, 1.25 * default.length);
        close(a_quarter.lookback, 1.25 * default.lookback);
        let much = slower(10.0);
        close(much.history, 2.56e-3);
        close(much.length, 10.24e-3);
        close(much.lookback, 2.55e-3);
        // The threshold stays above ten standard deviations of the noise, and above seven codes.
        let threshold = |noise_rms: f64, per_code: f64| {
            let mut front_end = front_end;
            (
                front_end.force.sensitive.noise_rms,
                front_end.force.sensitive.per_code,
            ) = (noise_rms, per_code);
            Capture::of(&paper, &front_end).threshold
        };
        close(threshold(0.02, 4e-3), 0.2);
        close(threshold(0.0, 0.05), 0.35);
        close(threshold(0.0, 4e-3), 0.1);
    }

    #[test]
    fn powers_of_two_bring_a_coefficient_into_its_range() {
        for (value, powers) in [
            (0.0, 0),
            (0.49, 0),
            (0.5, 1),
            (0.99, 1),
            (1.0, 2),
            (3.9, 3),
            (1e9, 6),
        ] {
            assert_eq!(shift(value, 6), powers, "{value}");
        }
        let cases = [
            (0.5, 0),
            (1.0 / 65536.0, 0),
            (1.0, 1),
            (1.99, 1),
            (2.0, 2),
            (100.0, 7),
            (1e60, 127),
            (0.99 / 65536.0, -1),
            (0.49 / 65536.0, -2),
        ];
        for (value, powers) in cases {
            assert_eq!(shift_into(value, 1.0 / 65536.0..1.0), powers, "{value}");
        }
    }

    #[test]
    fn a_number_that_loses_more_than_a_ten_thousandth_in_its_format_is_refused() {
        assert_eq!(fix("", 0.25), Ok(I16F16::from_num(0.25)));
        assert_eq!(fix("", 0.0), Ok(I16F16::ZERO));
        assert!(fix::<I16F16>("", 5000.4 / 65536.0).is_ok());
        assert!(fix::<I16F16>("", 4000.45 / 65536.0).is_err());
        let refused = fix::<I16F16>("what", 40_000.0).unwrap_err().to_string();
        assert_eq!(
            refused,
            "what: 4.000e4 in the units of the sample rate, and 7.6e-2 to 3.3e4 can be computed with"
        );
        assert!(fix::<I16F16>("", -32_768.0).is_ok());
        // Of a number that was given, it is not said that it is in other units.
        let refused = scale::<I16F16>("what", 40_000.0).unwrap_err().to_string();
        assert_eq!(refused, "what: 4.000e4, and 7.6e-2 to 3.3e4 can be computed with");
    }

    #[test]
    fn a_limit_is_the_nearest_number_of_its_format_and_none_that_means_nothing() {
        type Limit = fn(&mut Capture) -> &mut f64;
        let limits: [(&str, Limit); 3] = [
            ("disagreement", |capture| &mut capture.disagreement),
            ("tolerance of the frequency", |capture| {
                &mut capture.ring_frequency_tolerance
            }),
            ("tolerance of the decay", |capture| {
                &mut capture.ring_decay_tolerance
            }),
        ];
        for (name, limit) in limits {
            for (value, bits) in [
                (0.001, 66),
                (0.01, 655),
                (0.015, 983),
                (0.02, 1311),
                (0.03, 1966),
                (0.031, 2032),
                (0.04, 2621),
                (0.3, 19_661),
                (1e4, 655_360_000),
            ] {
                let mut inputs = Inputs::default();
                *limit(&mut inputs.capture) = value;
                let settings = inputs.derive().unwrap();
                let found = match name {
                    "disagreement" => settings.disagreement,
                    "tolerance of the decay" => settings.ringing.decay_tolerance,
                    _ => settings.ringing.frequency_tolerance,
                };
                assert_eq!(found.to_bits(), bits, "{name} {value}");
            }
            for value in [0.0, -0.25, 9e-4, 2e4, f64::INFINITY, f64::NAN] {
                let why = Inputs::refused(|inputs| *limit(&mut inputs.capture) = value);
                let expected = format!("{name} = {value}: must be from 0.001 to 10000");
                assert_eq!(why, expected);
            }
        }
    }

    #[test]
    fn the_noise_of_the_front_end_makes_the_gate() {
        let mut inputs = Inputs::default();
        let quiet = &mut inputs.front_end.force.sensitive;
        (quiet.noise_rms, quiet.per_code) = (3e-3, 4e-3 * 12_f64.sqrt());
        let gate = inputs.derive().unwrap().chain.gate.to_num::<f64>();
        // Three times the root of the squares of 3 and 4 mN.
        assert!((gate - 0.015).abs() < 2e-5, "{gate}");
        for noise in [-1e-3, 1.1e4, f64::INFINITY, f64::NAN] {
            let why = Inputs::refused(|inputs| inputs.front_end.force.sensitive.noise_rms = noise);
            assert!(why.starts_with("force noise = "), "{why}");
        }
        // As much as a code can be makes a gate that has a format.
        let why = Inputs::refused(|inputs| {
            let quiet = &mut inputs.front_end.force.sensitive;
            (quiet.noise_rms, quiet.per_code) = (1e4, 1.9);
        });
        assert!(!why.contains("per code") && !why.contains("noise"), "{why}");
        for per_code in [2.0, 1.8e19, 1e300] {
            let why = Inputs::refused(|inputs| inputs.front_end.force.sensitive.per_code = per_code);
            assert!(why.starts_with("force per code: "), "{why}");
        }
    }
}
