//! The settings: from their flash sector, or else built in.

use core::slice;

use bead_model::SettingsError;
use bead_model::settings::Settings;
use bead_wire::SettingsSource;

use crate::sample_clock::SAMPLE_RATE_HZ;

/// The block that `build.rs` derives from the default bead.
static BUILT_IN: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/settings.bin"));

/// A flash sector's worth of settings is never needed; the header says how long the block is.
const SECTOR: usize = 128 * 1024;

/// Settings, and how they came.
pub(crate) struct Loaded {
    pub(crate) settings: Settings,
    /// The block that they were decoded from.
    pub(crate) block: &'static [u8],
    pub(crate) source: SettingsSource,
    /// Why those in flash were refused, if they were.
    pub(crate) refused: Option<&'static str>,
}

impl Loaded {
    /// Where they came from, for the log.
    pub(crate) fn origin(&self) -> &'static str {
        match self.source {
            SettingsSource::Flash => "from flash",
            SettingsSource::BuiltIn => "built in, as flash has none",
            SettingsSource::FlashRefused => "built in, as those in flash are refused",
        }
    }
}

/// Reads the settings. A block in flash that fails its check is refused whole: better the built-in bead, and
/// a fault frame that says so, than a half-true one.
pub(crate) fn load() -> Loaded {
    let sector = sector();
    let (source, refused) = match check(sector) {
        Ok(settings) => {
            let length = Settings::block_length(sector).expect("decoded settings have a header");
            return Loaded {
                settings,
                block: &sector[..length],
                source: SettingsSource::Flash,
                refused: None,
            };
        }
        Err(SettingsError::Erased) => (SettingsSource::BuiltIn, None),
        Err(error) => (SettingsSource::FlashRefused, Some(why(&error))),
    };
    Loaded {
        settings: Settings::decode(BUILT_IN).expect("build.rs wrote the block with the same code"),
        block: BUILT_IN,
        source,
        refused,
    }
}

fn check(sector: &[u8]) -> Result<Settings, SettingsError> {
    let settings = Settings::decode(sector)?;
    if settings.sample_rate_hz == SAMPLE_RATE_HZ {
        Ok(settings)
    } else {
        Err(SettingsError::Invalid("they are for another sample rate"))
    }
}

/// A text without values, for a frame that borrows it for ever.
fn why(error: &SettingsError) -> &'static str {
    match error {
        SettingsError::Erased => "erased",
        SettingsError::Magic => "not a settings block",
        SettingsError::Version(_) => "a block of another version",
        SettingsError::Truncated => "shorter than the header says",
        SettingsError::Checksum => "wrong checksum",
        SettingsError::Body => "the body does not decode",
        SettingsError::Invalid(what) => what,
        SettingsError::NotTheBeads(_) => {
            "a coefficient is not what the bead's mass, stiffness and damping give"
        }
        SettingsError::BufferTooSmall => "longer than a block may be",
    }
}

/// The settings sector, memory-mapped.
#[allow(unsafe_code, reason = "the sector is memory that no Rust object stands for")]
fn sector() -> &'static [u8] {
    unsafe extern "C" {
        /// Start of the region SETTINGS of `memory.x`.
        static _settings: u8;
    }
    // SAFETY: `memory.x` reserves SECTOR bytes of flash from this symbol on and nothing is linked there.
    // Flash is always readable, any byte is a valid `u8`, and this image never writes flash.
    unsafe { slice::from_raw_parts(&raw const _settings, SECTOR) }
}
