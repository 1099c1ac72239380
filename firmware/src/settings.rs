//! Which settings are in force, and how they change. Settings that came over the link come first, then those
//! of a debug probe, then the built-in ones.
//!
//! # Design
//! New settings are offered to the estimators, which take them between two strikes. At that moment a frame
//! with their block is queued: each strike was measured with the settings of the last settings frame before
//! it.
//!
//! Settings that this image cannot read are refused as a whole, and a fault frame says why. The bead then
//! works with the next settings in order, and marks each strike that was measured with the built-in ones. A
//! block of another version is intact: its owner's bead must not measure with other settings unasked, so it
//! looks for strikes only when a host arms it.

use core::cell::RefCell;
use core::slice;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use bead_model::settings::{BLOCK_MAX, Settings};
use bead_model::{SettingsError, Violation};
use bead_store::Opened;
use bead_wire::{Block, Detail, MAX_BLOCK, SettingsSource};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, with_timeout};

use crate::sample_clock::SAMPLE_RATE_HZ;
use crate::{built_in, outbox, storage};

const _: () = assert!(BLOCK_MAX <= MAX_BLOCK, "a frame takes every block");

/// Bytes of the probe's sector. A block is much shorter; its header says how long it is.
const SECTOR: usize = 128 * 1024;

/// Settings, and where they came from.
#[derive(Clone)]
pub(crate) struct Loaded {
    pub(crate) settings: Settings,
    source: SettingsSource,
    /// Why settings in flash were refused, if they were.
    pub(crate) refused: Option<Refused>,
}

/// Why settings in flash were refused.
#[derive(Clone, Copy)]
pub(crate) struct Refused {
    reason: Reason,
    /// True for an intact block that this image must not replace by other settings unasked.
    foreign: bool,
}

#[derive(Clone, Copy)]
enum Reason {
    Text(&'static str),
    Invalid(Violation),
}

impl Refused {
    const fn damaged(reason: &'static str) -> Self {
        Self {
            reason: Reason::Text(reason),
            foreign: false,
        }
    }

    const fn foreign(reason: &'static str) -> Self {
        Self {
            reason: Reason::Text(reason),
            foreign: true,
        }
    }

    /// The reason as the detail of a fault frame.
    pub(crate) fn detail(&self) -> Detail {
        match self.reason {
            Reason::Text(text) => text.into(),
            Reason::Invalid(violation) => Detail::new(format_args!("{violation}")),
        }
    }
}

impl From<SettingsError> for Refused {
    fn from(error: SettingsError) -> Self {
        Self::damaged(match error {
            SettingsError::Erased => "erased",
            SettingsError::Magic => "not a settings block",
            SettingsError::Unreleased(_) => {
                return Self::foreign(
                    "a block from before the first release: make it anew of its bead.toml, or arm the bead by request",
                );
            }
            SettingsError::Version(_) => {
                return Self::foreign("a block of another version: arm the bead by request");
            }
            SettingsError::Truncated => "shorter than the header says",
            SettingsError::Checksum => "wrong checksum",
            SettingsError::Body => "the body does not decode",
            SettingsError::Invalid(violation) => {
                return Self {
                    reason: Reason::Invalid(violation),
                    foreign: false,
                };
            }
            SettingsError::BufferTooSmall => "longer than a block may be",
        })
    }
}

impl Loaded {
    /// Where they came from, for the log.
    pub(crate) fn origin(&self) -> &'static str {
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

    /// Returns `true` if the bead looks for strikes with them unasked.
    pub(crate) fn arm(&self) -> bool {
        !self.refused.is_some_and(|refused| refused.foreign)
    }
}

/// Boots that may fail in a row with the same settings.
const FAILED: u32 = 5;

/// Finds the settings at start-up. A block in flash that fails its check is refused as a whole: the next
/// settings in order are used, and a fault frame says so. If [`FAILED`] boots in a row have failed, those in
/// flash are left alone: whatever they made the bead do, it can be reached again.
pub(crate) fn load(store: &mut storage::SettingsStore, opened: Opened, failed: u32) -> Loaded {
    if failed >= FAILED {
        return Loaded {
            source: SettingsSource::Rescue,
            ..built_in(Some(Refused::foreign(
                "five boots in a row failed with the settings in flash: write others, or reboot",
            )))
        };
    }
    let mut refused = opened
        .lost
        .then_some(Refused::damaged("what was stored is not whole, and was erased"));
    match store.read() {
        Ok(None) => {}
        Ok(Some(block)) => match check(block) {
            Ok(settings) => {
                return Loaded {
                    settings,
                    source: SettingsSource::Stored,
                    refused,
                };
            }
            Err(why) => refused = why.or(refused),
        },
        Err(_) => refused = Some(Refused::damaged("what was stored cannot be read")),
    }
    beneath(refused)
}

/// The settings that come after those of the link: the probe's or the built-in ones. `refused` says why
/// settings that came over the link were refused, if they were.
pub(crate) fn beneath(refused: Option<Refused>) -> Loaded {
    let refused = match check(sector()) {
        Ok(settings) => {
            return Loaded {
                settings,
                source: SettingsSource::Flash,
                refused,
            };
        }
        Err(why) => why.or(refused),
    };
    built_in(refused)
}

fn built_in(refused: Option<Refused>) -> Loaded {
    Loaded {
        settings: of_known_answer(),
        source: match refused {
            None => SettingsSource::BuiltIn,
            Some(_) => SettingsSource::FlashRefused,
        },
        refused,
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
fn check(block: &[u8]) -> Result<Settings, Option<Refused>> {
    match Settings::decode(block) {
        Ok(settings) if settings.sample_rate_hz == SAMPLE_RATE_HZ => Ok(settings),
        Ok(_) => Err(Some(Refused::damaged("they are for another sample rate"))),
        Err(SettingsError::Erased) => Err(None),
        Err(error) => Err(Some(error.into())),
    }
}

/// Why a block that a host sent is refused.
pub(crate) enum Refusal {
    Invalid(Detail),
    SampleRate(Detail),
}

/// Checks a block that a host sent.
pub(crate) fn judge(block: &[u8]) -> Result<Loaded, Refusal> {
    let settings =
        Settings::decode(block).map_err(|error| Refusal::Invalid(Detail::new(format_args!("{error}"))))?;
    if Settings::block_length(block) != Some(block.len()) {
        return Err(Refusal::Invalid("bytes follow the settings block".into()));
    }
    if settings.sample_rate_hz != SAMPLE_RATE_HZ {
        return Err(Refusal::SampleRate(Detail::new(format_args!(
            "settings for {} Hz; this image samples at {SAMPLE_RATE_HZ} Hz",
            settings.sample_rate_hz
        ))));
    }
    Ok(Loaded {
        settings,
        source: SettingsSource::Stored,
        refused: None,
    })
}

/// The settings sector of the probe, memory-mapped.
#[allow(unsafe_code, reason = "the sector is memory that no Rust object stands for")]
fn sector() -> &'static [u8] {
    unsafe extern "C" {
        /// Start of the region SETTINGS of `memory.x`.
        static _settings: u8;
    }
    // SAFETY: `memory.x` reserves SECTOR bytes of flash from this symbol on and nothing is linked there.
    // Flash is always readable, any byte is a valid `u8`, and this image writes other sectors only.
    unsafe { slice::from_raw_parts(&raw const _settings, SECTOR) }
}

static IN_FORCE: Mutex<CriticalSectionRawMutex, RefCell<Option<Loaded>>> = Mutex::new(RefCell::new(None));

/// How often they have changed; wraps.
static CHANGES: AtomicU32 = AtomicU32::new(0);
/// Settings for the estimators to take.
static OFFERED: Mutex<CriticalSectionRawMutex, RefCell<Option<Loaded>>> = Mutex::new(RefCell::new(None));
/// True while settings are offered. It is read for every block, and costs little.
static IS_OFFERED: AtomicBool = AtomicBool::new(false);
/// The estimators have taken the settings that were offered.
static TAKEN: Signal<CriticalSectionRawMutex, ()> = Signal::new();

/// Puts settings in force before the tasks start.
pub(crate) fn begin(loaded: Loaded) {
    outbox::readdress(loaded.settings.description().address);
    IN_FORCE.lock(|cell| {
        cell.replace(Some(loaded));
        CHANGES.fetch_add(1, Ordering::Release);
    });
}

/// Longest wait until the estimators take settings: ten times the longest window.
const PATIENCE: Duration = Duration::from_millis(100);

/// Offers settings to the estimators. [`taken`] waits for them; a task that waits does not hold the settings.
pub(crate) fn offer(loaded: Loaded) {
    TAKEN.reset();
    OFFERED.lock(|cell| cell.replace(Some(loaded)));
    IS_OFFERED.store(true, Ordering::Release);
}

/// Waits until the settings that were offered are in force. A strike that is being measured is finished
/// first. Returns false if no block of samples came in time: then they hold from the first block on.
pub(crate) async fn taken() -> bool {
    with_timeout(PATIENCE, TAKEN.wait()).await.is_ok()
}

/// Returns `true` if settings are offered.
pub(crate) fn is_offered() -> bool {
    IS_OFFERED.load(Ordering::Acquire)
}

/// The settings that are offered, if any. The caller uses them from now on. Called between two strikes.
pub(crate) fn take() -> Option<Settings> {
    if !is_offered() {
        return None;
    }
    IS_OFFERED.store(false, Ordering::Relaxed);
    let loaded = OFFERED.lock(RefCell::take)?;
    let settings = loaded.settings;
    begin(loaded);
    tell();
    TAKEN.signal(());
    Some(settings)
}

/// Returns the result of `get` for the settings in force.
fn in_force<T>(get: impl FnOnce(&Loaded) -> T) -> T {
    IN_FORCE.lock(|cell| {
        get(cell
            .borrow()
            .as_ref()
            .expect("settings are in force before tasks start"))
    })
}

/// Queues a frame with the block in force. If the settings change between reading and queueing, the block is
/// read again: else the old one would be told after the new one, and replay would take it for the one in
/// force. To do both in one lock would keep interrupts waiting for 20 µs.
pub(crate) fn tell() {
    loop {
        let change = CHANGES.load(Ordering::Acquire);
        let message = bead_wire::Settings { block: current() };
        if outbox::tell_if(message, || CHANGES.load(Ordering::Acquire) == change) {
            return;
        }
    }
}

/// The block in force.
#[inline(never)]
pub(crate) fn current() -> Block {
    let settings = in_force(|loaded| loaded.settings);
    let mut bytes = [0; MAX_BLOCK];
    // No `expect`: it would print the error, and formats take 4 KB of flash.
    let Some(Ok(block)) = settings
        .encode(&mut bytes)
        .ok()
        .map(|length| Block::try_from(&bytes[..length]))
    else {
        panic!("a block has at most MAX_BLOCK bytes");
    };
    block
}

/// Returns `true` if the bead looks for strikes unasked with the settings in force.
pub(crate) fn arm() -> bool {
    in_force(Loaded::arm)
}

/// Where the settings in force came from.
pub(crate) fn source() -> SettingsSource {
    in_force(|loaded| loaded.source)
}

/// Returns `true` if the settings in force are not the owner's: built in, with or without a refused block in
/// flash.
pub(crate) fn are_not_owners() -> bool {
    matches!(
        source(),
        SettingsSource::BuiltIn | SettingsSource::FlashRefused | SettingsSource::Rescue
    )
}
