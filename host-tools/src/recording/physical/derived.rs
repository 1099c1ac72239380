//! From physical quantities to the bits of a block, and back.

use bead_model::calibration::Channel;
use bead_model::design::{
    self, Bead, Capture, ChannelFrontEnd, DesignError, FrontEnd, Neighbours, SensorFrontEnd, derive_among,
};
use bead_model::sensor::Sensor;
use bead_model::settings::{Name, Settings, SettingsError};
use fixed::types::extra::LeEqU32;
use hertz_chain::InputError;
use serde_json::Value;

use crate::recording::physical::keys::KEYS;
use crate::recording::physical::quantities::{
    Company, Contact, Host, Intruder, Physical, SensorScale, Taking,
};
use crate::tables::printable::beginning;

/// Letters of a name that are told.
const NAME_TOLD: usize = 32;

impl Physical {
    /// The settings that a bead measures with.
    ///
    /// # Errors
    /// The key that no bead has, what is wrong, and what would do.
    pub fn settings(&self) -> Result<Settings, InputError> {
        let name = Name::new(&self.name).ok_or_else(|| {
            let what = format!("`{}` is no name", beginning(&self.name, NAME_TOLD).escape_debug());
            InputError::at(
                "name",
                what,
                "give up to 16 bytes of text without control characters",
            )
        })?;
        if self.address == 0xFF {
            let what = "255 is the address of every bead";
            return Err(InputError::at("address", what, "give 0 to 254"));
        }
        let (rate, of_image) = (self.capture.sample_rate, Capture::default().sample_rate_hz);
        if rate != of_image {
            let what = format!("{rate} Hz, and the image samples at {of_image} Hz alone");
            let would_do = format!("give {of_image}, or leave it out");
            return Err(InputError::at("capture.sample_rate", what, would_do));
        }
        let neighbours = self.neighbours()?;
        let derived = derive_among(&self.physics(), &neighbours, &self.front_end(), &self.capture());
        let derived = derived.map_err(refused)?;
        let settings = Settings {
            name,
            address: self.address,
            ..derived
        };
        settings.validate().map_err(|error| refused(error.into()))?;
        Ok(settings)
    }

    fn physics(&self) -> Bead {
        Bead {
            mass: self.bead.mass,
            intruder_mass: self.intruder.mass,
            front_mass: self.bead.front_mass,
            stiffness: self.intruder.stiffness,
            damping: self.intruder.damping,
            contact_stiffness: self.contact.stiffness,
            relaxation: self.contact.relaxation,
        }
    }

    fn neighbours(&self) -> Result<Neighbours, InputError> {
        let Company {
            behind,
            elsewhere,
            mass,
            stiffness,
            damping,
        } = self.company;
        let mut neighbours = Neighbours {
            elsewhere: elsewhere == 1,
            intruder: design::Intruder {
                mass,
                stiffness,
                damping,
            },
            ..Neighbours::default()
        };
        let digits = behind.to_string();
        for digit in digits.bytes().filter(|_| behind > 0) {
            let place = usize::from(digit - b'0').checked_sub(1);
            match place.and_then(|place| neighbours.behind.get_mut(place)) {
                Some(holds) if !*holds => *holds = true,
                _ => {
                    let what = format!("{behind} names no beads behind");
                    let would_do =
                        "give the places of those with an intruder, each once: 1234, 13, or 0 for none";
                    return Err(InputError::at("company.behind", what, would_do));
                }
            }
        }
        if elsewhere > 1 {
            let what = format!("{elsewhere} is neither 0 nor 1");
            return Err(InputError::at(
                "company.elsewhere",
                what,
                "give 1 if there are other intruders near by",
            ));
        }
        Ok(neighbours)
    }

    fn front_end(&self) -> FrontEnd {
        let sensor = |scale: &SensorScale| {
            let channel = |per_code: f64, pole: f64, noise_rms: f64| ChannelFrontEnd {
                per_code,
                // The bead finds it in every window.
                zero_code: 0.0,
                pole_hz: (pole != 0.0).then_some(pole),
                noise_rms,
            };
            SensorFrontEnd {
                sensitive: channel(scale.per_code, scale.pole, scale.noise),
                wide: channel(scale.wide_per_code, scale.wide_pole, 0.0),
                delay: FrontEnd::CONVERSION,
            }
        };
        FrontEnd {
            force: sensor(&self.force),
            acceleration: sensor(&self.acceleration),
        }
    }

    fn capture(&self) -> Capture {
        let Taking {
            sample_rate,
            threshold,
            lookback,
            history,
            length,
            disagreement,
            ring_frequency_tolerance,
            ring_decay_tolerance,
        } = self.capture;
        Capture {
            sample_rate_hz: sample_rate,
            history,
            length,
            threshold,
            lookback,
            disagreement,
            ring_frequency_tolerance,
            ring_decay_tolerance,
        }
    }

    /// The numbers that the bits of a block stand for.
    pub fn of(settings: &Settings) -> Self {
        let rate = f64::from(settings.sample_rate_hz.max(1));
        let bead = &settings.bead;
        let per_code: f64 = settings.force.sensitive.per_code.to_num();
        let gate: f64 = settings.chain.gate.to_num();
        let time = |samples: u16| f64::from(samples) / rate;
        let physical = Self {
            name: settings.name.as_str().to_owned(),
            address: settings.address,
            bead: Host {
                mass: short(bead.mass),
                front_mass: short(bead.front_mass),
            },
            intruder: Intruder {
                mass: short(bead.intruder_mass),
                stiffness: short(bead.stiffness),
                damping: short(bead.damping),
            },
            contact: Contact {
                stiffness: short(bead.contact_stiffness),
                relaxation: short(bead.relaxation),
            },
            company: Company::of(&Neighbours {
                behind: std::array::from_fn(|follower| settings.company.behind >> follower & 1 == 1),
                elsewhere: settings.company.elsewhere,
                intruder: design::Intruder {
                    mass: short(settings.company.intruder.mass),
                    stiffness: short(settings.company.intruder.stiffness),
                    damping: short(settings.company.intruder.damping),
                },
            }),
            force: SensorScale {
                // The gate is three standard deviations of noise and rounding.
                noise: ((gate / 3.0).powi(2) - per_code * per_code / 12.0)
                    .max(0.0)
                    .sqrt(),
                ..scale(&settings.force, rate)
            },
            acceleration: scale(&settings.acceleration, rate),
            capture: Taking {
                sample_rate: settings.sample_rate_hz,
                threshold: f64::from(settings.window.threshold) * per_code,
                lookback: time(settings.window.lookback),
                history: time(settings.window.history),
                length: time(settings.window.length),
                disagreement: settings.disagreement.to_num(),
                ring_frequency_tolerance: settings.ringing.frequency_tolerance.to_num(),
                ring_decay_tolerance: settings.ringing.decay_tolerance.to_num(),
            },
        };
        physical.shortened()
    }

    /// The shortest numbers that give the same bits.
    fn shortened(self) -> Self {
        let Ok(bits) = self.settings() else {
            return self;
        };
        let mut best = self;
        for key in KEYS {
            let Value::Number(number) = best.get(key) else {
                continue;
            };
            let Some(number) = number.as_f64().filter(|number| number.fract() != 0.0) else {
                continue;
            };
            let shorter = (0..15)
                .filter_map(|digits| format!("{number:.digits$e}").parse::<f64>().ok())
                .filter_map(|number| best.with(key, number.into()).ok())
                .find(|shorter| shorter.settings() == Ok(bits));
            best = shorter.unwrap_or(best);
        }
        best
    }
}

/// The shortest number that is this one in the block.
fn short(value: f32) -> f64 {
    // The shortest text of an f32 is a number.
    value.to_string().parse().unwrap_or(value.into())
}

/// The scale of a sensor without its noise: the block has only that of the force.
fn scale<F: LeEqU32>(sensor: &Sensor<F>, rate: f64) -> SensorScale {
    // The slope of a channel is g f_s (1/ω_p - δ)/2.
    let pole = |channel: &Channel<F>, delay: f64| {
        let lead = 2.0 * channel.slope.to_num::<f64>() / channel.per_code.to_num::<f64>() / rate;
        let lag = lead + delay;
        if lag.abs() < 1e-12 {
            0.0
        } else {
            1.0 / (std::f64::consts::TAU * lag)
        }
    };
    SensorScale {
        per_code: sensor.sensitive.per_code.to_num(),
        wide_per_code: sensor.wide.per_code.to_num(),
        pole: pole(&sensor.sensitive, 0.0),
        wide_pole: pole(&sensor.wide, FrontEnd::CONVERSION),
        noise: 0.0,
    }
}

/// Why no settings follow, at the key that is to blame, or else at its table.
fn refused(error: DesignError) -> InputError {
    let key = |name: &str| {
        let key = KEYS.iter().find(|key| key.refused_as == name);
        key.map_or("", |key| key.path)
    };
    let told = error.to_string();
    let (place, what, advice) = match error {
        DesignError::Input {
            name,
            value,
            expected,
        } => {
            let advice = match key(name) {
                pole if pole.ends_with("pole") => {
                    format!("give 0 for no filter, or a value that is {expected}")
                }
                _ => format!("give a value that is {expected}"),
            };
            return InputError::at(key(name), format!("{value} is out of range"), advice);
        }
        DesignError::TooFast { .. } => ("bead", told, "take a larger or a softer sphere"),
        DesignError::Scale { name, .. } => (key(name), told, "give what a code is worth, in the SI unit"),
        DesignError::Coefficient { name, .. } => {
            let known = COEFFICIENTS.iter().find(|(coefficient, ..)| *coefficient == name);
            let (_, place, advice) = known.copied().unwrap_or((name, key(name), CHECK));
            (place, told, advice)
        }
        DesignError::Window(SettingsError::Invalid(rule)) => {
            let known = RULES.iter().find(|(begins, ..)| rule.starts_with(begins));
            let (_, place, advice) = known.copied().unwrap_or(("", "", CHECK));
            (place, rule.to_owned(), advice)
        }
        DesignError::Window(_) => ("", told, CHECK),
    };
    InputError::at(place, what, advice)
}

const CHECK: &str = "check the masses, springs and scales, which are in SI units";

/// Coefficients of `bead_model::design` by their names there: which key or which table they come from, and
/// what would do.
const COEFFICIENTS: &[(&str, &str, &str)] = &[
    (
        "relaxation time of the contacts over 2/3 of a sample",
        "contact.relaxation",
        "give 0 for an elastic contact, or more, in s",
    ),
    ("stiffness of the contacts", "contact.stiffness", CHECK),
    ("incident", "contact", CHECK),
    ("stiffness of the intruder's springs", "intruder.stiffness", CHECK),
    ("frequency of the ringing", "intruder.stiffness", CHECK),
    ("damping of the intruder", "intruder.damping", CHECK),
    ("decay of the ringing", "intruder.damping", CHECK),
    (
        "mass of the intruder over that of the host without it",
        "intruder.mass",
        CHECK,
    ),
    ("weight of the old acceleration", "intruder", CHECK),
    ("weight of the new acceleration", "intruder", CHECK),
    ("energy by acceleration", "intruder", CHECK),
    ("energy by velocity", "bead", CHECK),
    ("acceleration of the host by a newton", "bead.mass", CHECK),
    (
        "mass of the bead over that of the host without intruder, less one,",
        "bead.mass",
        CHECK,
    ),
    ("stiffness of the intruders behind", "company.stiffness", CHECK),
    ("damping of the intruders behind", "company.damping", CHECK),
    (
        "mass of the intruders behind over that of their beads",
        "company.mass",
        CHECK,
    ),
];

/// Rules of `bead_model::settings` by how they begin: the key that they are about, and what would do.
const RULES: &[(&str, &str, &str)] = &[
    ("history is", "capture.history", "give 1.28e-3 to 2.56e-3 s"),
    (
        "window is",
        "capture.length",
        "give more than capture.history, and up to 10.24e-3 s",
    ),
    (
        "lookback is",
        "capture.lookback",
        "give more than 0, and less than capture.history, in s",
    ),
    (
        "threshold is",
        "capture.threshold",
        "give N, and check force.per_code and force.noise",
    ),
    (
        "a pole is",
        "",
        "give poles of 8000 Hz and more, or 0 for no filter",
    ),
    ("the intruders behind", "company", CHECK),
];
