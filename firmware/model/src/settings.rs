//! The settings that a bead measures with, and their form in flash: the settings block.
//!
//! ```text
//! "BEAD"  version u16 LE  length u16 LE  postcard body  CRC-32/ISO-HDLC u32 LE of all bytes before it
//! ```
//!
//! The body is the [`Description`] that the owner states. The coefficients follow from it.

use bead_crc::checksum;
use bead_wire::Conditions;
use fixed::FixedI32;
use fixed::types::extra::{LeEqU32, U26, U30};
use fixed::types::{I2F30, I16F16};
use serde::Serialize;

use crate::calibration::Channel;
use crate::coefficients::{self, Coefficients};
use crate::company::Company;
use crate::description::{Description, Supply};
use crate::energy_uncertainty::UncertaintyTerms;
use crate::layout::{BASELINE, HISTORY_MAX, LEAD, PIECE, WINDOW_MAX, WindowSettings};
use crate::observer::Observer;
use crate::quantity::{SensedAcceleration, SensedForce, nearest};
use crate::quiet::Quiet;
use crate::reduced_chain::ReducedChain;
use crate::ring_down::RingDown;
use crate::scale::Scale;
use crate::sensor::Sensor;
use crate::shape::Ringing;
use crate::violation::{Bound, SettingKey as Key, Violation, require};
use crate::waveform::WaveformJudge;

/// Version of the settings block. The first one lacks the sections at the end of [`Description`], which may
/// all be absent.
pub const VERSION: u16 = 7;
/// The version without those sections.
const FIRST: u16 = 1;
/// Sections that a block of [`FIRST`] lacks: a byte of 0 stands for each that is absent.
const SECTIONS_SINCE: usize = 4;
/// Last of the versions before the first release, which were 2 to this one.
const UNRELEASED: u16 = 6;
/// Upper bound of an encoded block, bytes.
pub const BLOCK_MAX: usize = 448;

/// Bound of the forces, N, from the range of their format.
const FORCE_MOST: u32 = 1 << 15;

/// Greatest relative deviation of the supply from that of the calibration that flags no strike. It changes
/// both energies by 0.6 %.
const SUPPLY_TOLERANCE: f32 = 3e-3;

const MAGIC: [u8; 4] = *b"BEAD";
const HEADER: usize = MAGIC.len() + 4;

/// Settings of a sensor's channels, at the high gain and at the low one: units per code and poles.
const FORCE_UNITS: [Key; 2] = [Key::ForcePerCode, Key::WideForcePerCode];
const FORCE_POLES: [Key; 2] = [Key::ForcePole, Key::WideForcePole];
const ACCELERATION_UNITS: [Key; 2] = [Key::AccelerationPerCode, Key::WideAccelerationPerCode];
const ACCELERATION_POLES: [Key; 2] = [Key::AccelerationPole, Key::WideAccelerationPole];

/// Settings of a bead with the coefficients that follow from them, at one sample rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Settings {
    #[serde(skip)]
    description: Description,
    /// Sample rate for which the coefficients hold, Hz.
    pub sample_rate_hz: u32,
    /// The force sensor, N.
    pub force: Sensor<U30>,
    /// The acceleration sensor, m/s².
    pub acceleration: Sensor<U26>,
    /// 99 % of the force at which its sensor ends; the greatest number if that is unknown.
    pub force_end: SensedForce,
    /// 99 % of the acceleration at which its sensor ends; the greatest number if that is unknown.
    pub acceleration_end: SensedAcceleration,
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
    /// Ringing of the intruder, and the tolerance outside of which a strike is flagged.
    pub ringing: Ringing,
    /// Energy that the intruder holds at the end of a window.
    pub ring_down: RingDown,
    /// Noise of a bead at rest.
    pub quiet: Quiet,
    /// Powers of two between coefficients and their formats.
    pub scale: Scale,
    /// Intruders of the beads near by.
    pub company: Company,
    /// Comparison of the predicted acceleration with the measured one.
    pub waveform: WaveformJudge,
    /// Uncertainties of the energies, if those of all settings are known.
    pub uncertainty: Option<UncertaintyTerms>,
}

/// Error of reading or writing a settings block.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SettingsError {
    /// Nothing was ever written there (erased flash).
    #[error("no settings block: the flash is erased")]
    Erased,
    /// Not a settings block.
    #[error("not a settings block: it does not start with \"BEAD\"")]
    Magic,
    /// A block that a program from before the first release wrote.
    #[error("settings block of version {0}, unreleased: `bead settings make` remakes it from its bead.toml")]
    Unreleased(u16),
    /// A block of another version.
    #[error("settings block of version {0}, but this program reads version {VERSION}")]
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
    /// A setting that the bead cannot work with.
    #[error("settings that a bead cannot work with: {0}")]
    Invalid(#[from] Violation),
    /// The buffer to encode into is too small.
    #[error("buffer too small for a settings block of up to {BLOCK_MAX} bytes")]
    BufferTooSmall,
}

impl Settings {
    /// Derives the settings of a bead from its description.
    ///
    /// # Errors
    /// The first setting outside its bound, or the one that leads to a coefficient outside its format. With
    /// settings that pass, no sum and no index of the estimators leaves its range.
    pub fn new(description: &Description) -> Result<Self, Violation> {
        description.check()?;
        let dt = 1.0 / f64::from(description.capture.sample_rate_hz);
        let Coefficients {
            observer,
            chain,
            company,
            scale,
            incident,
            ringing,
            waveform,
            phase,
            ring_down,
            quiet,
        } = Coefficients::new(description, description.company.places().unwrap_or(0))?;
        let ends = description.sensor_end.unwrap_or_default();
        let settings = Self {
            description: *description,
            sample_rate_hz: description.capture.sample_rate_hz,
            force: coefficients::sensor(&description.force, [dt, phase], FORCE_UNITS, FORCE_POLES)?,
            acceleration: coefficients::sensor(
                &description.acceleration,
                [dt, phase],
                ACCELERATION_UNITS,
                ACCELERATION_POLES,
            )?,
            force_end: near_end(ends.force),
            acceleration_end: near_end(ends.acceleration),
            window: coefficients::window(description, dt),
            observer,
            chain,
            incident,
            disagreement: nearest(description.capture.disagreement),
            ringing,
            ring_down,
            quiet,
            scale,
            company,
            waveform,
            uncertainty: UncertaintyTerms::new(description, ringing.frequency.to_num()),
        };
        settings.check_channels()?;
        settings.check_window()?;
        Ok(settings)
    }

    /// The owner's statement, from which all coefficients follow.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// Returns `true` if a strike in these conditions has to be flagged
    /// [`SUPPLY_OFF`](bead_wire::StrikeFlags::SUPPLY_OFF): the supply is more than 0.3 % away from that of
    /// the calibration, or was not measured. Always `false` if the settings do not state that of the
    /// calibration.
    ///
    /// Bead and replay compute the same: every operation is one of IEEE 754.
    pub fn supply_is_off(&self, conditions: Option<&Conditions>) -> bool {
        let Some(Supply { voltage }) = self.description.supply else {
            return false;
        };
        let voltage = voltage as f32;
        conditions.is_none_or(|conditions| {
            let measured = f32::from(conditions.supply.bits()) / 4096.0;
            (measured - voltage).abs() > SUPPLY_TOLERANCE * voltage
        })
    }

    /// Derives settings from this description after `change`.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with(&self, change: impl FnOnce(&mut Description)) -> Result<Self, Violation> {
        let mut description = self.description;
        change(&mut description);
        Self::new(&description)
    }

    /// Writes the block into `buffer` and returns its length; [`BLOCK_MAX`] bytes are always enough.
    ///
    /// # Errors
    /// [`SettingsError::BufferTooSmall`].
    pub fn encode(&self, buffer: &mut [u8]) -> Result<usize, SettingsError> {
        let body = buffer.get_mut(HEADER..).ok_or(SettingsError::BufferTooSmall)?;
        let length = postcard::to_slice(&self.description, body)
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

    /// Reads the block at the start of `bytes`, which may be a whole flash sector.
    ///
    /// # Errors
    /// No intact block of this version, or settings that [`Self::new`] refuses.
    pub fn decode(bytes: &[u8]) -> Result<Self, SettingsError> {
        let description = Self::described(bytes)?;
        Ok(Self::new(&description)?)
    }

    /// The description in a block. Never inlined: its buffer would be on the stack while settings are
    /// derived.
    #[inline(never)]
    fn described(bytes: &[u8]) -> Result<Description, SettingsError> {
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
        let mut body = heapless::Vec::<u8, BLOCK_MAX>::from_slice(&bytes[HEADER..end])
            .map_err(|_| SettingsError::Body)?;
        let absent = match u16::from_le_bytes([header[4], header[5]]) {
            VERSION => 0,
            FIRST => SECTIONS_SINCE,
            old @ 2..=UNRELEASED => return Err(SettingsError::Unreleased(old)),
            other => return Err(SettingsError::Version(other)),
        };
        body.extend_from_slice(&[0; SECTIONS_SINCE][..absent])
            .map_err(|_| SettingsError::Body)?;
        let (description, rest): (Description, &[u8]) =
            postcard::take_from_bytes(&body).map_err(|_| SettingsError::Body)?;
        if !rest.is_empty() {
            return Err(SettingsError::Body);
        }
        Ok(description)
    }

    /// Length of the block at the start of `bytes`, if there is a header.
    pub fn block_length(bytes: &[u8]) -> Option<usize> {
        let header = bytes.get(..HEADER)?;
        (header[..4] == MAGIC).then(|| HEADER + usize::from(u16::from_le_bytes([header[6], header[7]])) + 4)
    }

    /// Checks that no code can overflow the sums.
    fn check_channels(&self) -> Result<(), Violation> {
        let most = FORCE_MOST >> self.scale.incoming;
        check_sensor(&self.force, most, FORCE_UNITS)?;
        check_sensor(&self.acceleration, Observer::MOST, ACCELERATION_UNITS)
    }

    /// Checks the window and the trigger in samples and codes.
    fn check_window(&self) -> Result<(), Violation> {
        let WindowSettings {
            history,
            length,
            threshold,
            lookback,
        } = self.window;
        let least = BASELINE + PIECE as u16 + LEAD;
        require(history >= least, Key::History, Bound::LongHistory)?;
        require(history <= HISTORY_MAX as u16, Key::History, Bound::ShortHistory)?;
        require(length > history, Key::Length, Bound::LongWindow)?;
        require(length <= WINDOW_MAX, Key::Length, Bound::ShortWindow)?;
        require((1..history).contains(&lookback), Key::Lookback, Bound::Lookback)?;
        require((1..4096).contains(&threshold), Key::Threshold, Bound::Codes)?;
        require(self.triggers_above_noise(), Key::Threshold, Bound::AboveNoise)
    }

    /// True if the noise that the settings state stays below the trigger. The gate is three standard
    /// deviations of the force. The trigger compares two samples, so at six standard deviations noise
    /// triggers once a second.
    fn triggers_above_noise(&self) -> bool {
        let rise = i64::from(self.window.threshold) * i64::from(self.force.sensitive.per_code.to_bits());
        rise >> (I2F30::FRAC_NBITS - SensedForce::FRAC_NBITS) >= 2 * i64::from(self.chain.gate.to_bits())
    }
}

/// Part of a sensor's end above which a value may be clipped.
const NEAR_END: f64 = 0.99;

/// The least value that may be clipped; the greatest number if the end is unknown.
fn near_end<F: LeEqU32>(end: Option<f32>) -> FixedI32<F> {
    end.map_or(FixedI32::MAX, |end| nearest(NEAR_END * f64::from(end)))
}

fn check_sensor<F: LeEqU32>(sensor: &Sensor<F>, most: u32, units: [Key; 2]) -> Result<(), Violation> {
    let channels: [&Channel<F>; 2] = [&sensor.sensitive, &sensor.wide];
    for (channel, unit) in channels.into_iter().zip(units) {
        require(channel.is_below(most), unit, Bound::Reach)?;
    }
    Ok(())
}
