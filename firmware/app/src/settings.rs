//! Settings that a bead starts with or is given. Those that came over the link come first, then those of a
//! debug probe, then the built-in ones.
//!
//! # Design
//! Settings that this image cannot read are refused as a whole, and a fault frame says why. The bead then
//! works with the next settings in order, and marks each strike that was measured with the built-in ones. A
//! block of another version is intact: its owner's bead must not measure with other settings unasked, so it
//! looks for strikes only when a host arms it.

use bead_model::settings::{BLOCK_MAX, Settings};
use bead_model::{SettingsError, Violation};
use bead_store::nor_flash::NorFlash;
use bead_store::{Opened, Vault};
use bead_wire::{Detail, MAX_BLOCK, Outcome, SettingsSource};

use crate::answer::Answer;
use crate::block::SAMPLE_RATE_HZ;
use crate::built_in;

const _: () = assert!(BLOCK_MAX <= MAX_BLOCK, "a frame takes every block");
const _: () = assert!(
    bead_store::MAX_SETTINGS == MAX_BLOCK,
    "a block that a request carries fits the store"
);

/// Settings, and where they came from.
#[derive(Clone)]
pub struct Loaded {
    /// The settings.
    pub settings: Settings,
    pub(crate) source: SettingsSource,
    /// Why settings in flash were refused, if they were.
    pub refused: Option<RefusedSettings>,
}

/// Reason for refusing settings in flash.
#[derive(Clone, Copy)]
pub enum RefusedSettings {
    /// No block, or one that is damaged.
    Damaged(&'static str),
    /// An intact block that this image must not replace by other settings unasked.
    Foreign(&'static str),
    /// Settings that a bead cannot work with.
    Invalid(Violation),
}

impl RefusedSettings {
    /// The reason as the detail of a fault frame.
    pub(crate) fn detail(&self) -> Detail {
        match *self {
            Self::Damaged(text) | Self::Foreign(text) => text.into(),
            Self::Invalid(violation) => Detail::new(format_args!("{violation}")),
        }
    }
}

impl From<SettingsError> for RefusedSettings {
    fn from(error: SettingsError) -> Self {
        Self::Damaged(match error {
            SettingsError::Unreleased(_) => {
                return Self::Foreign(
                    "a block from before the first release: remake it from its bead.toml, or arm the bead by request",
                );
            }
            SettingsError::Version(_) => {
                return Self::Foreign("a block of another version: arm the bead by request");
            }
            SettingsError::Invalid(violation) => return Self::Invalid(violation),
            SettingsError::Erased => "erased",
            SettingsError::Magic => "not a settings block",
            SettingsError::Truncated => "shorter than the header says",
            SettingsError::Checksum => "wrong checksum",
            SettingsError::Body => "the body does not decode",
            SettingsError::BufferTooSmall => "longer than a block may be",
        })
    }
}

/// Boots that may fail in a row with the same settings.
const FAILED: u32 = 5;

impl Loaded {
    /// The source of the settings, for the log.
    pub fn origin(&self) -> &'static str {
        match self.source {
            SettingsSource::Stored => "came over the link",
            SettingsSource::Flash => "put into flash by a probe",
            SettingsSource::BuiltIn => "built in, as flash has none",
            SettingsSource::Rescue => "built in, as boots with those in flash failed",
            SettingsSource::FlashRefused | SettingsSource::Unknown(_) => {
                "built in, as those in flash are refused"
            }
        }
    }

    /// Returns `true` if the bead looks for strikes unasked with these settings.
    pub(crate) fn arm(&self) -> bool {
        !matches!(self.refused, Some(RefusedSettings::Foreign(_)))
    }

    /// Finds the settings at start-up: in the store, in the sector `probe`, or built in. A block in flash
    /// that fails its check is refused as a whole: the next settings in order are used, and a fault frame
    /// says so. If five boots in a row have failed, settings in flash are ignored, so that the bead can be
    /// reached whatever they made it do.
    pub fn find<F: NorFlash>(store: &mut Vault<F>, opened: Opened, probe: &[u8], failed: u32) -> Self {
        if failed >= FAILED {
            return Self {
                source: SettingsSource::Rescue,
                ..Self::built_in(Some(RefusedSettings::Foreign(
                    "five boots in a row failed with the settings in flash: write others, or reboot",
                )))
            };
        }
        let mut refused = opened.lost.then_some(RefusedSettings::Damaged(
            "the store held no complete block, and was erased",
        ));
        match store.read().map(|block| block.map(check)) {
            Ok(None) => {}
            Ok(Some(Ok(settings))) => {
                return Self {
                    settings,
                    source: SettingsSource::Stored,
                    refused,
                };
            }
            Ok(Some(Err(why))) => refused = why.or(refused),
            Err(_) => refused = Some(RefusedSettings::Damaged("the stored settings cannot be read")),
        }
        Self::beneath(probe, refused)
    }

    /// The settings that come after those of the link: the probe's or the built-in ones. `refused` says why
    /// settings that came over the link were refused, if they were.
    pub(crate) fn beneath(probe: &[u8], refused: Option<RefusedSettings>) -> Self {
        match check(probe) {
            Ok(settings) => Self {
                settings,
                source: SettingsSource::Flash,
                refused,
            },
            Err(why) => Self::built_in(why.or(refused)),
        }
    }

    fn built_in(refused: Option<RefusedSettings>) -> Self {
        Self {
            settings: of_known_answer(),
            source: match refused {
                None => SettingsSource::BuiltIn,
                Some(_) => SettingsSource::FlashRefused,
            },
            refused,
        }
    }
}

/// The built-in settings, for which the answer of the self-test is known.
pub(crate) fn of_known_answer() -> Settings {
    // No `expect`: it would print the error, and formats take 4 KB of flash.
    let Ok(settings) = Settings::decode(&built_in::SETTINGS) else {
        panic!("a test decodes this block with the same code");
    };
    settings
}

/// The settings in a block of flash.
///
/// # Errors
/// Why they are refused; `None` for erased flash.
fn check(block: &[u8]) -> Result<Settings, Option<RefusedSettings>> {
    match Settings::decode(block) {
        Ok(settings) if settings.sample_rate_hz == SAMPLE_RATE_HZ => Ok(settings),
        Ok(_) => Err(Some(RefusedSettings::Damaged(
            "the settings are for another sample rate",
        ))),
        Err(SettingsError::Erased) => Err(None),
        Err(error) => Err(Some(error.into())),
    }
}

/// Checks a block that a host sent.
///
/// # Errors
/// The outcome of the request, and a line about it.
pub(crate) fn judge(block: &[u8]) -> Result<Loaded, Answer> {
    let invalid = |why| (Outcome::SettingsInvalid, why);
    let settings = Settings::decode(block).map_err(|error| invalid(Detail::new(format_args!("{error}"))))?;
    if Settings::block_length(block) != Some(block.len()) {
        return Err(invalid("bytes follow the settings block".into()));
    }
    if settings.sample_rate_hz != SAMPLE_RATE_HZ {
        let why = format_args!(
            "settings for {} Hz; this image samples at {SAMPLE_RATE_HZ} Hz",
            settings.sample_rate_hz
        );
        return Err((Outcome::SampleRate, Detail::new(why)));
    }
    Ok(Loaded {
        settings,
        source: SettingsSource::Stored,
        refused: None,
    })
}
