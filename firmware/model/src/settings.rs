//! All that a bead is told, and its form in flash: the settings block.
//!
//! ```text
//! "BEAD"  version u16 LE  length u16 LE  postcard body  CRC-32/ISO-HDLC u32 LE of all bytes before it
//! ```

use crate::coefficients::{Bead, coefficients};
use crate::company::Company;
use crate::layout::{BASELINE, HISTORY_MAX, LEAD, PIECE, WINDOW_MAX, WindowSettings};
use crate::observer::Observer;
use crate::quantity::SensedForce;
use crate::reduced_chain::ReducedChain;
use crate::scale::{INCOMING_MAX, Scale};
use crate::sensor::Sensor;
use crate::shape::Ringing;
use bead_crc::checksum;
use fixed::traits::Fixed;
use fixed::types::extra::{U26, U30};
use fixed::types::{I2F30, I16F16};
use serde::{Deserialize, Serialize};

/// Version of the settings block. Blocks of versions 3 to 5 are migrated; others are refused.
pub const VERSION: u16 = 6;
/// The oldest version that is migrated.
pub(crate) const OLDEST: u16 = 3;
/// Bytes that bring a body of version 3, 4 or 5 to version 6, all zero: version 4 added the address, version
/// 5 the powers of two, version 6 the company.
const SINCE: [usize; 3] = [1 + 6 + COMPANY, 6 + COMPANY, COMPANY];
const COMPANY: usize = 2 + 3 * 4 + 3;
/// Upper bound of an encoded block, bytes.
pub const BLOCK_MAX: usize = 256;

/// Bound of the forces, N, from the range of their format.
const FORCE_MOST: u32 = 1 << 15;

const MAGIC: [u8; 4] = *b"BEAD";
const HEADER: usize = MAGIC.len() + 4;

/// The name of a bead: UTF-8, filled up with zeros.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Name([u8; 16]);

impl Name {
    /// A name of at most 16 bytes, without control characters.
    pub fn new(name: &str) -> Option<Self> {
        let mut bytes = [0; 16];
        bytes.get_mut(..name.len())?.copy_from_slice(name.as_bytes());
        (!name.contains(char::is_control)).then_some(Self(bytes))
    }

    /// Whether it is text that can be shown: a block can hold any bytes.
    fn is_text(&self) -> bool {
        let length = self.0.iter().position(|&byte| byte == 0).unwrap_or(16);
        let (name, rest) = self.0.split_at(length);
        let text = core::str::from_utf8(name);
        text.is_ok_and(|text| !text.contains(char::is_control)) && rest.iter().all(|&byte| byte == 0)
    }

    /// The text; empty if the bead has no name.
    pub fn as_str(&self) -> &str {
        let length = self.0.iter().position(|&byte| byte == 0).unwrap_or(16);
        core::str::from_utf8(&self.0[..length]).unwrap_or_default()
    }
}

/// Identity, physics, calibration, coefficients and window of a bead, at one sample rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// The name that its owner gave the bead.
    pub name: Name,
    /// Sample rate for which the coefficients hold, Hz.
    pub sample_rate_hz: u32,
    /// The bead that the coefficients are derived from.
    pub bead: Bead<f32>,
    /// The force sensor, N.
    pub force: Sensor<U30>,
    /// The acceleration sensor, m/s².
    pub acceleration: Sensor<U26>,
    /// Trigger and window.
    pub window: WindowSettings,
    /// Estimate A.
    pub observer: Observer,
    /// Estimate B.
    pub chain: ReducedChain,
    /// Energy of a solitary wave of 1 N peak, nJ/N^{5/3}.
    pub incident: I16F16,
    /// A strike is flagged if A and B differ by more than this part of the greater.
    pub disagreement: I16F16,
    /// How the intruder rings, and the tolerance outside of which a strike is flagged.
    pub ringing: Ringing,
    /// Address of the bead: it tells beads apart on a shared line and in merged streams. 0 where nobody gave
    /// it one, 254 at most.
    pub address: u8,
    /// Powers of two between coefficients and their formats.
    pub scale: Scale,
    /// Other intruders around.
    pub company: Company,
}

/// Why a settings block is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SettingsError {
    /// Nothing was ever written there (erased flash).
    #[error("no settings block: the flash is erased")]
    Erased,
    /// Not a settings block.
    #[error("not a settings block: it does not start with \"BEAD\"")]
    Magic,
    /// A block of another version.
    #[error("settings block of version {0}, this program knows {OLDEST} to {VERSION}")]
    Version(u16),
    /// Shorter than its header says.
    #[error("settings block is shorter than its header says")]
    Truncated,
    /// The checksum does not fit: half written, or worn.
    #[error("settings block with a wrong checksum: half written or damaged")]
    Checksum,
    /// The body is not what this version writes.
    #[error("settings block whose body does not decode")]
    Body,
    /// A value that the bead cannot work with.
    #[error("settings that a bead cannot work with: {0}")]
    Invalid(&'static str),
    /// A coefficient that does not follow from the bead's physics.
    #[error("coefficient \"{0}\" does not follow from the bead's masses and springs")]
    NotTheBeads(&'static str),
    /// The buffer to encode into is too small.
    #[error("buffer too small for a settings block of up to {BLOCK_MAX} bytes")]
    BufferTooSmall,
}

impl Settings {
    /// Writes the block into `buffer` and returns its length; [`BLOCK_MAX`] bytes are always enough.
    pub fn encode(&self, buffer: &mut [u8]) -> Result<usize, SettingsError> {
        let body = buffer.get_mut(HEADER..).ok_or(SettingsError::BufferTooSmall)?;
        let length = postcard::to_slice(self, body)
            .map_err(|_| SettingsError::BufferTooSmall)?
            .len();
        let end = HEADER + length;
        let (block, rest) = buffer.split_at_mut(end);
        block[..4].copy_from_slice(&MAGIC);
        block[4..6].copy_from_slice(&VERSION.to_le_bytes());
        block[6..8].copy_from_slice(&(length as u16).to_le_bytes());
        let checksum = checksum(block);
        rest.get_mut(..4)
            .ok_or(SettingsError::BufferTooSmall)?
            .copy_from_slice(&checksum.to_le_bytes());
        Ok(end + 4)
    }

    /// Reads the block at the start of `bytes`, which may be a whole flash sector. A block of version 3 to 5
    /// is migrated.
    pub fn decode(bytes: &[u8]) -> Result<Self, SettingsError> {
        let header = bytes.get(..HEADER).ok_or(SettingsError::Truncated)?;
        if header.iter().all(|&byte| byte == 0xff) {
            return Err(SettingsError::Erased);
        }
        if header[..4] != MAGIC {
            return Err(SettingsError::Magic);
        }
        let end = HEADER + usize::from(u16::from_le_bytes([header[6], header[7]]));
        let stored = bytes.get(end..end + 4).ok_or(SettingsError::Truncated)?;
        if checksum(&bytes[..end]).to_le_bytes() != stored {
            return Err(SettingsError::Checksum);
        }
        let body = &bytes[HEADER..end];
        let mut migrated = [0; BLOCK_MAX];
        let added = match u16::from_le_bytes([header[4], header[5]]) {
            VERSION => 0,
            old @ OLDEST..VERSION => SINCE[usize::from(old - OLDEST)],
            other => return Err(SettingsError::Version(other)),
        };
        // What was added stands at the end, and its zeros say what was meant before it was there.
        let room = migrated
            .get_mut(..body.len() + added)
            .ok_or(SettingsError::Body)?;
        room[..body.len()].copy_from_slice(body);
        let body = &*room;
        let (settings, rest): (Self, &[u8]) =
            postcard::take_from_bytes(body).map_err(|_| SettingsError::Body)?;
        if !rest.is_empty() {
            return Err(SettingsError::Body);
        }
        settings.validate()?;
        Ok(settings)
    }

    /// Length of the block at the start of `bytes`, if there is a header.
    pub fn block_length(bytes: &[u8]) -> Option<usize> {
        let header = bytes.get(..HEADER)?;
        (header[..4] == MAGIC).then(|| HEADER + usize::from(u16::from_le_bytes([header[6], header[7]])) + 4)
    }

    /// Checks all values. A block with a good checksum can still be nonsense.
    pub fn validate(&self) -> Result<(), SettingsError> {
        self.bounds()?;
        if !self.triggers_above_noise() {
            return Err(SettingsError::Invalid(
                "threshold is within the noise: below twice the gate, six standard deviations",
            ));
        }
        self.verify()
    }

    /// Whether the noise that the settings themselves tell of stays below the trigger. The gate is three
    /// standard deviations of the force. The trigger compares two samples, so at six of them noise triggers
    /// once a second.
    fn triggers_above_noise(&self) -> bool {
        let rise = i64::from(self.window.threshold) * i64::from(self.force.sensitive.per_code.to_bits());
        rise >> (I2F30::FRAC_NBITS - SensedForce::FRAC_NBITS) >= 2 * i64::from(self.chain.gate.to_bits())
    }

    /// Checks what the arithmetic relies on. With settings that pass, no sum and no index leaves its range.
    pub fn bounds(&self) -> Result<(), SettingsError> {
        let window = &self.window;
        let channels = [self.force.sensitive, self.force.wide];
        let accelerations = [self.acceleration.sensitive, self.acceleration.wide];
        let bead = &self.bead;
        let positive = [
            bead.mass,
            bead.intruder_mass,
            bead.stiffness,
            bead.damping,
            bead.contact_stiffness,
        ];
        let rules = [
            (self.sample_rate_hz > 0, "sample rate is 0"),
            (
                positive.iter().all(|value| value.is_finite() && *value > 0.0),
                "a mass, a stiffness or the damping is not finite and above 0",
            ),
            (
                bead.relaxation.is_finite() && bead.relaxation >= 0.0,
                "relaxation is not finite, or below 0",
            ),
            (
                (0.0..bead.mass - bead.intruder_mass).contains(&bead.front_mass),
                "front mass or intruder mass is not a part of the bead's",
            ),
            (
                self.name.is_text(),
                "name is not UTF-8, or has a control character",
            ),
            (
                window.history >= BASELINE + PIECE as u16 + LEAD,
                "history is shorter than 128 samples: 64 for the zeros, 32 for the noise, 32 of the wave's foot",
            ),
            (
                usize::from(window.history) <= HISTORY_MAX,
                "history is longer than 256 samples",
            ),
            (
                window.length > window.history,
                "window is not longer than its history",
            ),
            (window.length <= WINDOW_MAX, "window is longer than 1024 samples"),
            (
                window.lookback > 0 && window.lookback < window.history,
                "lookback is 0 or not shorter than the history",
            ),
            (
                channels.iter().all(|channel| channel.is_bounded())
                    && accelerations.iter().all(|channel| channel.is_bounded()),
                "a pole is below f_s/4π, or a unit per code is not above 0",
            ),
            (
                channels
                    .iter()
                    .all(|channel| channel.is_below(FORCE_MOST >> self.scale.incoming.min(INCOMING_MAX)))
                    && accelerations
                        .iter()
                        .all(|channel| channel.is_below(Observer::MOST)),
                "the codes of a channel reach beyond 32 kN, for a small bead less, or 65 km/s²",
            ),
            (self.address < 0xFF, "address 255 is every bead's"),
            (
                self.scale.is_bounded(),
                "a power of two of a coefficient is out of range",
            ),
            (
                self.company.is_bounded(bead.mass),
                "the intruders behind have a number that is not above 0, or too much mass",
            ),
            (self.disagreement > 0, "disagreement is not above 0"),
            (self.observer.is_bounded(), "a weight of the observer is negative"),
            (
                self.chain.is_bounded(),
                "a coefficient of the reduced chain is negative",
            ),
            (
                window.threshold > 0 && window.threshold < 4096,
                "threshold is not a rise of 1 to 4095 codes",
            ),
        ];
        match rules.iter().find(|(holds, _)| !holds) {
            Some((_, what)) => Err(SettingsError::Invalid(what)),
            None => Ok(()),
        }
    }

    /// Checks the coefficients against the physics of the bead, to the accuracy of their formats and of f32.
    fn verify(&self) -> Result<(), SettingsError> {
        let rate = self.sample_rate_hz as f32;
        let expected = coefficients(&self.bead, rate);
        let Self {
            observer,
            chain,
            ringing,
            scale,
            ..
        } = self;
        // Bits, and the power of two that the last of them stands for. A table, for the size of the image.
        let company = &self.company;
        let [stiffness, damping, ratio] = company.intruder.coefficients(self.bead.mass, rate);
        let rows = [
            ("stiffness behind", whole(company.stiffness, 0), stiffness),
            ("damping behind", whole(company.damping, 0), damping),
            ("mass behind", whole(company.ratio, scale.masses as i8), ratio),
            (
                "weight of the old acceleration",
                whole(observer.start, 0),
                expected.start,
            ),
            (
                "weight of the new acceleration",
                whole(observer.end, scale.observer as i8),
                expected.end,
            ),
            (
                "energy by acceleration",
                whole(observer.energy, scale.measured),
                expected.measured,
            ),
            (
                "contact",
                whole(chain.contact, scale.contact as i8),
                expected.contact,
            ),
            ("relaxation", whole(chain.relaxation, 0), expected.relaxation),
            (
                "incoming",
                whole(chain.incoming, scale.incoming as i8),
                expected.incoming,
            ),
            ("stiffness", whole(chain.stiffness, 0), expected.stiffness),
            ("damping", whole(chain.damping, 0), expected.damping),
            (
                "intruder",
                whole(chain.intruder, scale.masses as i8),
                expected.intruder,
            ),
            ("host", whole(chain.host, scale.masses as i8), expected.host),
            (
                "energy by velocity",
                whole(chain.energy, scale.predicted),
                expected.predicted,
            ),
            ("incident energy", whole(self.incident, 0), expected.incident),
            (
                "frequency of the ringing",
                whole(ringing.frequency, 0),
                expected.ring_frequency,
            ),
            (
                "decay of the ringing",
                whole(ringing.decay, 0),
                expected.ring_decay,
            ),
        ];
        // Formats keep a coefficient to 1e-4; f32 loses about 1e-6 here.
        for (name, (bits, power), expected) in rows {
            // 2^power: its exponent, and no fraction.
            let found = bits as f32 * f32::from_bits(((127 + power) as u32) << 23);
            // An infinity would fit any number.
            if !(expected.is_finite() && (found - expected).abs() <= 2e-4 * expected.abs()) {
                return Err(SettingsError::NotTheBeads(name));
            }
        }
        Ok(())
    }
}

/// The bits of a coefficient that has `powers` of two more than they say, and the power of two of their last.
fn whole<F: Fixed<Bits: Into<i64>>>(coefficient: F, powers: i8) -> (i64, i32) {
    (
        coefficient.to_bits().into(),
        i32::from(powers) - F::FRAC_NBITS as i32,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{Bead, Capture, FrontEnd, Intruder, Neighbours, derive, derive_among};
    use fixed::types::I0F32;

    fn paper() -> Settings {
        derive(&Bead::paper(), &FrontEnd::reference(), &Capture::default()).unwrap()
    }

    /// Two of the followers hold an intruder like that of the bead.
    fn in_company() -> Settings {
        let bead = Bead::paper();
        let neighbours = Neighbours {
            behind: [true, false, true, false],
            elsewhere: false,
            intruder: Intruder {
                mass: bead.intruder_mass,
                stiffness: bead.stiffness,
                damping: bead.damping,
            },
        };
        derive_among(&bead, &neighbours, &FrontEnd::reference(), &Capture::default()).unwrap()
    }

    fn bounded(change: impl FnOnce(&mut Settings)) -> bool {
        let mut settings = paper();
        change(&mut settings);
        settings.bounds().is_ok()
    }

    #[test]
    fn each_number_of_the_window_is_allowed_up_to_its_limits_and_not_beyond() {
        type Number = fn(&mut WindowSettings) -> &mut u16;
        // Of the paper's settings, whose window has 160 scans of history and 672 in all.
        let limits: [(Number, [u16; 2]); 4] = [
            (|window| &mut window.history, [128, 256]),
            (|window| &mut window.length, [161, 1024]),
            (|window| &mut window.lookback, [1, 159]),
            (|window| &mut window.threshold, [1, 4095]),
        ];
        for (n, (number, [least, most])) in limits.into_iter().enumerate() {
            for value in [0, least - 1, least, most, most + 1, u16::MAX] {
                let allowed = bounded(|settings| *number(&mut settings.window) = value);
                assert_eq!(allowed, (least..=most).contains(&value), "number {n}: {value}");
            }
        }
    }

    #[test]
    fn rate_address_tolerance_and_front_mass_have_their_limits() {
        assert!(!bounded(|settings| settings.sample_rate_hz = 0));
        assert!(bounded(|settings| settings.sample_rate_hz = 1));
        assert!(bounded(|settings| settings.address = 254));
        assert!(!bounded(|settings| settings.address = 255));
        assert!(!bounded(|settings| settings.disagreement = I16F16::ZERO));
        assert!(bounded(|settings| settings.disagreement = I16F16::DELTA));
        let host = |settings: &Settings| settings.bead.mass - settings.bead.intruder_mass;
        assert!(!bounded(|settings| settings.bead.front_mass = host(settings)));
        assert!(bounded(
            |settings| settings.bead.front_mass = 0.999 * host(settings)
        ));
        assert!(bounded(|settings| settings.bead.relaxation = 0.0));
        assert!(!bounded(|settings| settings.bead.relaxation = -1e-9));
        assert!(!bounded(|settings| settings.scale.contact = 7));
        assert!(!bounded(|settings| settings.company.behind = 1));
    }

    #[test]
    fn the_physics_is_finite_and_above_zero_before_anything_is_computed_from_it() {
        type Number = fn(&mut Settings) -> &mut f32;
        let numbers: [Number; 5] = [
            |settings| &mut settings.bead.mass,
            |settings| &mut settings.bead.intruder_mass,
            |settings| &mut settings.bead.stiffness,
            |settings| &mut settings.bead.damping,
            |settings| &mut settings.bead.contact_stiffness,
        ];
        for (n, number) in numbers.into_iter().enumerate() {
            for value in [0.0, -1.0, f32::NAN, f32::INFINITY] {
                let mut settings = paper();
                *number(&mut settings) = value;
                let refused = settings.bounds().unwrap_err().to_string();
                assert!(
                    refused.contains("a mass, a stiffness or the damping"),
                    "{n}, {value}: {refused}"
                );
            }
        }
        for value in [-1.0, f32::NAN, f32::INFINITY] {
            let mut settings = paper();
            settings.bead.relaxation = value;
            let refused = settings.bounds().unwrap_err().to_string();
            assert!(refused.contains("relaxation"), "{value}: {refused}");
        }
    }

    #[test]
    fn no_coefficient_is_negative_and_each_may_be_zero() {
        type Number = fn(&mut Settings) -> &mut I0F32;
        let numbers: [Number; 8] = [
            |settings| &mut settings.observer.start,
            |settings| &mut settings.observer.end,
            |settings| &mut settings.chain.contact,
            |settings| &mut settings.chain.incoming,
            |settings| &mut settings.chain.stiffness,
            |settings| &mut settings.chain.damping,
            |settings| &mut settings.chain.intruder,
            |settings| &mut settings.chain.host,
        ];
        for (n, number) in numbers.into_iter().enumerate() {
            assert!(!bounded(|settings| *number(settings) = -I0F32::DELTA), "{n}");
            assert!(bounded(|settings| *number(settings) = I0F32::ZERO), "{n}");
        }
        assert!(!bounded(|settings| settings.chain.relaxation = -I2F30::DELTA));
        assert!(bounded(|settings| settings.chain.relaxation = I2F30::ZERO));
    }

    #[test]
    fn the_codes_of_a_channel_reach_as_far_as_the_sums_and_no_further() {
        // 32 kN less the powers of two of a small bead, and 65 km/s², over 4095 codes and three sums.
        let powers = INCOMING_MAX;
        let force = |per_code: i64, slope: i64| {
            bounded(|settings| {
                settings.scale.incoming = powers;
                for channel in [&mut settings.force.sensitive, &mut settings.force.wide] {
                    channel.per_code = I2F30::from_bits(per_code as i32);
                    channel.slope = I2F30::from_bits(slope as i32);
                }
            })
        };
        let most = ((32_768_i64 >> powers) << 30).div_euclid(4095);
        assert!(force(most, 0) && !force(most + 1, 0));
        let (slope, rest) = (most / 4, most - 2 * (most / 4));
        assert!(force(rest, slope) && !force(rest + 1, slope) && !force(rest, slope + 1));
        assert!(force(rest, -slope) && !force(rest, -slope - 1));
        let acceleration = |per_code: i64| {
            bounded(|settings| {
                settings.acceleration.wide.per_code = fixed::FixedI32::from_bits(per_code as i32);
                settings.acceleration.wide.slope = fixed::FixedI32::ZERO;
            })
        };
        let most = (65_536_i64 << 26).div_euclid(4095);
        assert!(acceleration(most) && !acceleration(most + 1));
        // A slope is as great as the unit per code at a pole of f_s/4π.
        let pole = |slope: i32| {
            bounded(|settings| {
                settings.force.wide.slope = settings.force.wide.per_code + I2F30::from_bits(slope)
            })
        };
        assert!(pole(-1) && !pole(0));
        assert!(!bounded(|settings| {
            (settings.force.wide.per_code, settings.force.wide.slope) = (I2F30::ZERO, I2F30::ZERO);
        }));
    }

    #[test]
    fn the_trigger_is_at_least_twice_the_gate() {
        let mut settings = paper();
        let rise =
            i64::from(settings.window.threshold) * i64::from(settings.force.sensitive.per_code.to_bits());
        settings.chain.gate = SensedForce::from_bits((rise >> 15) as i32);
        assert_eq!(settings.validate(), Ok(()));
        settings.chain.gate += SensedForce::DELTA;
        let refused = settings.validate().unwrap_err().to_string();
        assert!(refused.contains("threshold is within the noise"), "{refused}");
    }

    #[test]
    fn each_coefficient_belongs_to_the_physics_and_the_one_that_does_not_is_named() {
        type Change = fn(&mut Settings, f64);
        macro_rules! times {
            ($($field:ident).+) => {
                |settings, factor| {
                    let bits = f64::from(settings.$($field).+.to_bits()) * factor;
                    settings.$($field).+ = Fixed::from_bits(bits.round() as _);
                }
            };
        }
        let rows: [(&str, Change); 17] = [
            ("stiffness behind", times!(company.stiffness)),
            ("damping behind", times!(company.damping)),
            ("mass behind", times!(company.ratio)),
            ("weight of the old acceleration", times!(observer.start)),
            ("weight of the new acceleration", times!(observer.end)),
            ("energy by acceleration", times!(observer.energy)),
            ("contact", times!(chain.contact)),
            ("relaxation", times!(chain.relaxation)),
            ("incoming", times!(chain.incoming)),
            ("stiffness", times!(chain.stiffness)),
            ("damping", times!(chain.damping)),
            ("intruder", times!(chain.intruder)),
            ("host", times!(chain.host)),
            ("energy by velocity", times!(chain.energy)),
            ("incident energy", times!(incident)),
            ("frequency of the ringing", times!(ringing.frequency)),
            ("decay of the ringing", times!(ringing.decay)),
        ];
        for (name, change) in rows {
            for factor in [1.0 - 3e-4, 1.0 + 3e-4, 0.0, 2.0] {
                let mut settings = in_company();
                change(&mut settings, factor);
                assert_eq!(
                    settings.validate(),
                    Err(SettingsError::NotTheBeads(name)),
                    "times {factor}"
                );
            }
            for factor in [1.0 - 5e-5, 1.0 + 5e-5] {
                let mut settings = in_company();
                change(&mut settings, factor);
                assert_eq!(settings.validate(), Ok(()), "{name} times {factor}");
            }
        }
    }

    #[test]
    fn a_block_needs_its_room_and_tells_its_length() {
        let (settings, mut room) = (in_company(), [0; BLOCK_MAX]);
        let length = settings.encode(&mut room).unwrap();
        for short in (0..length).step_by(if cfg!(miri) { 19 } else { 1 }) {
            let refused = settings.encode(&mut [0; BLOCK_MAX][..short]);
            assert_eq!(refused, Err(SettingsError::BufferTooSmall), "{short}");
            assert!(Settings::decode(&room[..short]).is_err(), "{short}");
        }
        assert_eq!(settings.encode(&mut [0; BLOCK_MAX][..length]), Ok(length));
        assert_eq!(Settings::decode(&room[..length]), Ok(settings));
        assert_eq!(Settings::block_length(&room), Some(length));
        assert_eq!(Settings::block_length(&room[..HEADER]), Some(length));
        assert_eq!(Settings::block_length(&room[..HEADER - 1]), None);
        room[0] = b'b';
        assert_eq!(Settings::block_length(&room), None);
        assert_eq!(Settings::decode(&room), Err(SettingsError::Magic));
    }

    #[test]
    fn a_name_is_text_up_to_its_first_zero() {
        let named = |bytes: &[u8]| {
            let mut name = Name::default();
            name.0[..bytes.len()].copy_from_slice(bytes);
            name
        };
        for (bytes, is_text) in [
            (&b""[..], true),
            (b"a", true),
            (b"sixteen bytes ok", true),
            (b"a\0b", false),
            (b"\0b", false),
            (b"a\tb", false),
            (b"\xff", false),
        ] {
            assert_eq!(named(bytes).is_text(), is_text, "{bytes:?}");
        }
        assert_eq!(named(b"bead 8").as_str(), "bead 8");
        assert_eq!(named(b"sixteen bytes ok").as_str(), "sixteen bytes ok");
        assert_eq!(named(b"\xff").as_str(), "");
    }
}
