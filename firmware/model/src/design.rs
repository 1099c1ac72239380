//! From physical quantities in f64 to the fixed-point settings: the one place where coefficients come from.
//!
//! ```
//! use bead_model::design::{Bead, Capture, FrontEnd, derive};
//! let settings = derive(&Bead::paper(), &FrontEnd::reference(), &Capture::default())?;
//! assert_eq!(settings.sample_rate_hz, 100_000);
//! # Ok::<(), bead_model::design::DesignError>(())
//! ```

use crate::calibration::Channel;
use crate::observer::Observer;
use crate::quantity::Force;
use crate::reduced_chain::ReducedChain;
use crate::settings::{Settings, SettingsError, WindowSettings};
use fixed::traits::Fixed;
use fixed::types::extra::LeEqU32;
use std::f64::consts::{PI, TAU};
use std::fmt;

/// Energy of the solitary wave of an elastic chain: `E = 1.0465162 κ^{-2/3} F_m^{5/3}`, whatever the beads'
/// mass. From the pulse at contact 70 of a chain with κ = M = 1, integrated to 1e-12; it does not depend on
/// how many beads around the pulse are counted, to 1e-15.
pub const SOLITARY_WAVE_ENERGY: f64 = 1.046_516_203;

/// The bead with its intruder and the chain that it stands in, SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bead {
    /// M, of the host with its intruder, and of the beads behind it, kg.
    pub mass: f64,
    /// m, of the intruder, kg.
    pub intruder_mass: f64,
    /// k, of the intruder's springs, N/m.
    pub stiffness: f64,
    /// c, of the intruder's damping, N·s/m.
    pub damping: f64,
    /// κ, of the contacts between beads, N/m^1.5.
    pub contact_stiffness: f64,
    /// τ, the relaxation time of those contacts, s.
    pub relaxation: f64,
}

impl Bead {
    /// The paper's: Bakelite, R = 19 mm, Y = 4.5 GPa as fitted; m = 3.7 g on k = 3.95e5 N/m, c = 12 N·s/m.
    pub fn paper() -> Self {
        let (radius, density, young, poisson) = (0.019_f64, 1775.0, 4.5e9, 0.44_f64);
        let theta = 0.75 * (1.0 - poisson * poisson) / young;
        Self {
            mass: 4.0 / 3.0 * PI * radius.powi(3) * density,
            intruder_mass: 3.7e-3,
            stiffness: 3.95e5,
            damping: 12.0,
            contact_stiffness: 1.0 / (2.0 * theta) / (2.0 / radius).sqrt(),
            relaxation: 4.2e-6,
        }
    }
}

/// One sensor channel as the converter sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChannelFrontEnd {
    /// Quantity (N or m/s²) per code.
    pub per_code: f64,
    /// Code at zero quantity, 0 to 4095.
    pub zero_code: f64,
    /// Corner of the anti-alias filter, Hz; none for an ideal channel.
    pub pole_hz: Option<f64>,
    /// White noise before sampling, rms, in the channel's quantity.
    pub noise_rms: f64,
}

/// Both channels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrontEnd {
    /// Force at the host's incoming contact, N.
    pub force: ChannelFrontEnd,
    /// Acceleration of the intruder, m/s².
    pub acceleration: ChannelFrontEnd,
}

impl FrontEnd {
    /// The reference design of `docs/hardware.md`: 16 N and ±250 m/s² over twelve bits, one-pole filters at 40 kHz.
    pub fn reference() -> Self {
        let codes = 4096.0;
        Self {
            force: ChannelFrontEnd {
                per_code: 16.0 / codes,
                zero_code: 128.0,
                pole_hz: Some(40e3),
                noise_rms: 5e-3,
            },
            acceleration: ChannelFrontEnd {
                per_code: 500.0 / codes,
                zero_code: 2048.0,
                pole_hz: Some(40e3),
                noise_rms: 0.05,
            },
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
    /// Length of the window in all, s.
    pub length: f64,
    /// Rise of the force that triggers, N.
    pub threshold: f64,
    /// Time over which it must rise so much, s.
    pub lookback: f64,
    /// Part of the greater by which A and B may differ before a strike is flagged.
    pub disagreement: f64,
}

impl Default for Capture {
    /// 100 kHz; 1.28 ms of history, of which 0.64 ms give the zero; a window of 6.4 ms, over which the
    /// intruder of the paper rings down to 1e-7 of its energy; 0.1 N of rise in 0.5 ms; a flag where A and B are 3 % apart,
    /// ten times what noise does, half of what a chain without viscosity does.
    fn default() -> Self {
        Self {
            sample_rate_hz: 100_000,
            history: 1.28e-3,
            length: 6.4e-3,
            threshold: 0.1,
            lookback: 0.5e-3,
            disagreement: 0.03,
        }
    }
}

/// Why no settings come of it.
#[derive(Clone, Debug, PartialEq)]
pub enum DesignError {
    /// An input that no bead has.
    Input {
        /// Which one.
        name: &'static str,
        /// What was given.
        value: f64,
        /// What would do.
        expected: &'static str,
    },
    /// A coefficient that does not fit its format, or loses more than 1e-4 of itself in it.
    Coefficient {
        /// Which one.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What the format holds.
        range: (f64, f64),
    },
    /// The window is not one that the bead takes.
    Window(SettingsError),
}

impl fmt::Display for DesignError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Input {
                name,
                value,
                expected,
            } => write!(f, "{name} = {value}: must be {expected}"),
            Self::Coefficient {
                name,
                value,
                range: (low, high),
            } => {
                write!(
                    f,
                    "coefficient {name} = {value:e} does not fit its fixed-point format ({low:e} to {high:e})"
                )
            }
            Self::Window(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for DesignError {}

/// Derives the settings of a bead.
///
/// Sources: estimate A, exact solution of `c ẋ + k x = -m a` for a first-order hold (see [`crate::observer`]);
/// estimate B, Eqs. 1 to 3 of the paper in units of µm and samples (see [`crate::reduced_chain`]).
pub fn derive(bead: &Bead, front_end: &FrontEnd, capture: &Capture) -> Result<Settings, DesignError> {
    for (name, value) in [
        ("bead mass", bead.mass),
        ("intruder mass", bead.intruder_mass),
        ("intruder stiffness", bead.stiffness),
        ("intruder damping", bead.damping),
        ("contact stiffness", bead.contact_stiffness),
        ("force per code", front_end.force.per_code),
        ("acceleration per code", front_end.acceleration.per_code),
        ("sample rate", f64::from(capture.sample_rate_hz)),
        ("trigger threshold", capture.threshold),
    ] {
        if !(value.is_finite() && value > 0.0) {
            return Err(DesignError::Input {
                name,
                value,
                expected: "positive",
            });
        }
    }
    if !(bead.relaxation.is_finite() && bead.relaxation >= 0.0) {
        return Err(DesignError::Input {
            name: "relaxation",
            value: bead.relaxation,
            expected: "0 or positive",
        });
    }
    if bead.intruder_mass >= bead.mass {
        return Err(DesignError::Input {
            name: "intruder mass",
            value: bead.intruder_mass,
            expected: "below the bead's",
        });
    }

    let dt = 1.0 / f64::from(capture.sample_rate_hz);
    const UM: f64 = 1e6; // µm in a metre
    const NJ: f64 = 1e9; // nJ in a joule
    let host_mass = bead.mass - bead.intruder_mass;

    let rate = bead.stiffness / bead.damping; // λ
    let decay = (-rate * dt).exp(); // φ
    // The mean of φ's course over a sample: (1 - φ)/(λ dt).
    let mean = -(-rate * dt).exp_m1() / (rate * dt);
    let observer = Observer {
        start: fix("weight of the old acceleration", mean - decay)?,
        end: fix("weight of the new acceleration", 1.0 - mean)?,
        energy: fix(
            "energy by acceleration",
            bead.intruder_mass * bead.intruder_mass / bead.damping * dt * NJ,
        )?,
    };

    let force_noise = front_end
        .force
        .noise_rms
        .hypot(front_end.force.per_code / 12f64.sqrt());
    // Accelerations are in twelfths, see `ReducedChain`.
    let twelfth = dt * dt / 12.0;
    let chain = ReducedChain {
        contact: fix(
            "contact",
            256.0 * bead.contact_stiffness / UM.sqrt() / bead.mass * twelfth,
        )?,
        relaxation: fix("relaxation", 1.5 * bead.relaxation / dt)?,
        incoming: fix("incoming", 256.0 / host_mass * twelfth * UM)?,
        stiffness: fix("stiffness", 4.0 * bead.stiffness / bead.intruder_mass * twelfth)?,
        damping: fix("damping", bead.damping / bead.intruder_mass * twelfth / dt)?,
        intruder: fix("intruder", bead.intruder_mass / host_mass)?,
        gate: Force::from_num(3.0 * force_noise),
        // c ẋ² dt of a velocity of 1 µm/sample.
        energy: fix("energy by velocity", bead.damping / dt / (UM * UM) * NJ)?,
    };

    let samples = |seconds: f64| (seconds / dt).round().clamp(0.0, f64::from(u16::MAX)) as u16;
    let settings = Settings {
        sample_rate_hz: capture.sample_rate_hz,
        force: channel(&front_end.force, dt)?,
        acceleration: channel(&front_end.acceleration, dt)?,
        window: WindowSettings {
            history: samples(capture.history),
            length: samples(capture.length),
            threshold: (capture.threshold / front_end.force.per_code).round() as u16,
            lookback: samples(capture.lookback),
        },
        observer,
        chain,
        incident: fix(
            "incident",
            SOLITARY_WAVE_ENERGY * bead.contact_stiffness.powf(-2.0 / 3.0) * NJ,
        )?,
        disagreement: fix("disagreement", capture.disagreement)?,
    };
    settings.validate().map_err(DesignError::Window)?;
    Ok(settings)
}

fn channel<F: LeEqU32>(channel: &ChannelFrontEnd, dt: f64) -> Result<Channel<F>, DesignError> {
    let pole = match channel.pole_hz {
        Some(hz) if !(hz.is_finite() && hz > 0.0) => {
            return Err(DesignError::Input {
                name: "anti-alias pole",
                value: hz,
                expected: "positive, Hz",
            });
        }
        Some(hz) => 1.0 / (TAU * hz) / (2.0 * dt),
        None => 0.0,
    };
    Ok(Channel {
        per_code: fix("per code", channel.per_code)?,
        slope: fix("anti-alias pole", channel.per_code * pole)?,
    })
}

/// `value` in the format `F`.
fn fix<F: Fixed>(name: &'static str, value: f64) -> Result<F, DesignError> {
    F::checked_from_num(value)
        .filter(|fixed| (fixed.to_num::<f64>() - value).abs() <= 1e-4 * value.abs())
        .ok_or_else(|| DesignError::Coefficient {
            name,
            value,
            range: (F::DELTA.to_num::<f64>() * 5e3, F::MAX.to_num::<f64>()),
        })
}

#[cfg(test)]
mod tests {
    use super::*;

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
        for bit in 0..length * 8 {
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
        assert!(refused(|b| b.stiffness = 1e12).starts_with("coefficient"));
    }
}
