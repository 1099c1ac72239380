//! Which settings are in force, and how they change. Settings that came over the link come first, then those
//! of a debug probe, then the built-in ones.
//!
//! # Design
//! New settings are offered to the estimators, which take them between two strikes. At that moment a frame
//! with their block is queued: each strike was measured with the settings of the last settings frame before
//! it. There are two blocks, the one in force and the one before it. Frames that wait refer to either. New
//! settings wait until no frame refers to the old block.

use core::cell::RefCell;
use core::slice;

use bead_model::SettingsError;
use bead_model::settings::{BLOCK_MAX, Settings};
use bead_store::Opened;
use bead_wire::SettingsSource;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Timer};
use heapless::Vec;

use crate::outbox::{self, Record};
use crate::sample_clock::SAMPLE_RATE_HZ;
use crate::storage;
use crate::text::Text;

/// The block that `build.rs` derives from the default bead.
pub(crate) static BUILT_IN: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/settings.bin"));

/// Bytes of the probe's sector. A block is much shorter; its header says how long it is.
const SECTOR: usize = 128 * 1024;

/// Settings, and where they came from.
pub(crate) struct Loaded {
    pub(crate) settings: Settings,
    /// The block that they were decoded from.
    pub(crate) block: Vec<u8, BLOCK_MAX>,
    pub(crate) source: SettingsSource,
    /// Why settings in flash were refused, if they were.
    pub(crate) refused: Option<&'static str>,
}

impl Loaded {
    /// Where they came from, for the log.
    pub(crate) fn origin(&self) -> &'static str {
        match self.source {
            SettingsSource::Stored => "came over the link",
            SettingsSource::Flash => "put into flash by a probe",
            SettingsSource::BuiltIn => "built in, as flash has none",
            SettingsSource::FlashRefused => "built in, as those in flash are refused",
        }
    }
}

/// Finds the settings at start-up. A block in flash that fails its check is refused as a whole: the next
/// settings in order are used, and a fault frame says so.
pub(crate) fn load(store: &mut storage::Settings, opened: Opened) -> Loaded {
    let mut refused = opened
        .lost
        .then_some("what was stored is not whole, and was erased");
    match store.read() {
        Ok(None) => {}
        Ok(Some(block)) => match check(block) {
            Ok(settings) => {
                return Loaded {
                    settings,
                    block: copy(block),
                    source: SettingsSource::Stored,
                    refused,
                };
            }
            Err(error) => refused = Some(why(&error)),
        },
        Err(_) => refused = Some("what was stored cannot be read"),
    }
    beneath(refused)
}

/// The settings that come after those of the link: the probe's or the built-in ones. `refused` says why
/// settings that came over the link were refused, if they were.
pub(crate) fn beneath(refused: Option<&'static str>) -> Loaded {
    let sector = sector();
    let refused = match check(sector) {
        Ok(settings) => {
            let length = Settings::block_length(sector).expect("decoded settings have a header");
            return Loaded {
                settings,
                block: copy(&sector[..length]),
                source: SettingsSource::Flash,
                refused,
            };
        }
        Err(SettingsError::Erased) => refused,
        Err(error) => Some(why(&error)),
    };
    Loaded {
        settings: Settings::decode(BUILT_IN).expect("build.rs wrote the block with the same code"),
        block: copy(BUILT_IN),
        source: match refused {
            None => SettingsSource::BuiltIn,
            Some(_) => SettingsSource::FlashRefused,
        },
        refused,
    }
}

fn copy(block: &[u8]) -> Vec<u8, BLOCK_MAX> {
    Vec::from_slice(block).expect("a block that decodes has at most BLOCK_MAX bytes")
}

fn check(block: &[u8]) -> Result<Settings, SettingsError> {
    let settings = Settings::decode(block)?;
    if settings.sample_rate_hz == SAMPLE_RATE_HZ {
        Ok(settings)
    } else {
        Err(SettingsError::Invalid("they are for another sample rate"))
    }
}

/// Why a block that a host sent is refused.
pub(crate) enum Refusal {
    Invalid(Text),
    SampleRate(Text),
}

/// Checks a block that a host sent.
pub(crate) fn judge(block: &[u8]) -> Result<Loaded, Refusal> {
    let settings =
        Settings::decode(block).map_err(|error| Refusal::Invalid(Text::new(format_args!("{error}"))))?;
    if Settings::block_length(block) != Some(block.len()) {
        return Err(Refusal::Invalid(Text::new(format_args!(
            "bytes follow the settings block"
        ))));
    }
    if settings.sample_rate_hz != SAMPLE_RATE_HZ {
        return Err(Refusal::SampleRate(Text::new(format_args!(
            "settings for {} Hz; this image samples at {SAMPLE_RATE_HZ} Hz",
            settings.sample_rate_hz
        ))));
    }
    Ok(Loaded {
        settings,
        block: copy(block),
        source: SettingsSource::Stored,
        refused: None,
    })
}

/// The error as a text without values, which a frame can borrow for ever.
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

/// A block, and how many frames that wait refer to it.
struct Slot {
    block: Vec<u8, BLOCK_MAX>,
    waiting: u32,
}

struct InForce {
    slots: [Slot; 2],
    /// Index of the slot in force.
    current: usize,
    source: SettingsSource,
}

static IN_FORCE: Mutex<CriticalSectionRawMutex, RefCell<InForce>> = Mutex::new(RefCell::new(InForce {
    slots: [const {
        Slot {
            block: Vec::new(),
            waiting: 0,
        }
    }; 2],
    current: 0,
    source: SettingsSource::BuiltIn,
}));

/// Settings for the estimators to take.
static OFFERED: Signal<CriticalSectionRawMutex, Settings> = Signal::new();
/// The estimators have taken the settings that were offered.
static TAKEN: Signal<CriticalSectionRawMutex, ()> = Signal::new();

fn with<T>(act: impl FnOnce(&mut InForce) -> T) -> T {
    IN_FORCE.lock(|cell| act(&mut cell.borrow_mut()))
}

/// Puts settings in force before the tasks start.
pub(crate) fn begin(loaded: &Loaded) {
    with(|now| {
        now.slots[now.current].block = loaded.block.clone();
        now.source = loaded.source;
    });
}

/// Offers settings, and waits until they are in force. A strike that is being measured is finished first.
pub(crate) async fn change(loaded: &Loaded) {
    while with(|now| now.slots[1 - now.current].waiting > 0) {
        Timer::after(Duration::from_millis(1)).await;
    }
    with(|now| now.slots[1 - now.current].block = loaded.block.clone());
    TAKEN.reset();
    OFFERED.signal(loaded.settings);
    TAKEN.wait().await;
    with(|now| now.source = loaded.source);
}

/// The settings that are offered, if any. The caller uses them from now on. Called between two strikes.
pub(crate) fn take() -> Option<Settings> {
    if !OFFERED.signaled() {
        return None;
    }
    let settings = OFFERED.try_take()?;
    with(|now| now.current = 1 - now.current);
    tell();
    TAKEN.signal(());
    Some(settings)
}

/// Queues a frame with the block in force.
pub(crate) fn tell() {
    let slot = with(|now| {
        now.slots[now.current].waiting += 1;
        now.current
    });
    if !outbox::push(Record::Settings(slot)) {
        told(slot);
    }
}

/// A frame that referred to this slot has left, or found no room.
pub(crate) fn told(slot: usize) {
    with(|now| now.slots[slot].waiting -= 1);
}

/// The block that a frame refers to.
pub(crate) fn block(slot: usize) -> Vec<u8, BLOCK_MAX> {
    with(|now| now.slots[slot].block.clone())
}

/// The block in force.
pub(crate) fn current() -> Vec<u8, BLOCK_MAX> {
    with(|now| now.slots[now.current].block.clone())
}

/// Where the settings in force came from.
pub(crate) fn source() -> SettingsSource {
    with(|now| now.source)
}
