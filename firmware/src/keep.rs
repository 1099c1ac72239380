//! The last strikes, for a host that missed them: kept over a reset, and sent again on request.
//!
//! # Design
//! What is queued for the host is copied into memory that a reset leaves alone ([`bead_store::Windows`];
//! region WINDOWS of `memory.x`): the settings, the waveform, the strike, its shape. The copy is made where
//! the frame is, in some 100 instructions for 32 scans. The checksums take longer; a task of the lowest
//! priority makes them little by little after the strike.
//!
//! Fetched frames are bulk: they leave the room that the window of a strike needs, so they never cost one.

use core::cell::RefCell;

use bead_store::{Cursor, Windows};
use bead_wire::{Fetched, Inner, Kept, Packed};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Timer};

use crate::trace::{self, RING};
use crate::{outbox, settings};

static WINDOWS: Mutex<CriticalSectionRawMutex, RefCell<Option<Windows<'static, RING>>>> =
    Mutex::new(RefCell::new(None));
/// A window was closed.
static CLOSED: Signal<CriticalSectionRawMutex, ()> = Signal::new();

/// Steps of a checksum in each [`PAUSE`], 18 instructions a sample. A window of 672 scans takes 25 ms, or 40
/// if it is loud.
const STEPS: u32 = 4;
const PAUSE: Duration = Duration::from_millis(2);

/// Takes up what the boot before left. Called once, before the tasks start.
pub(crate) fn begin() {
    let windows = trace::windows();
    WINDOWS.lock(|cell| cell.replace(Some(windows)));
    CLOSED.signal(());
}

fn with<T>(act: impl FnOnce(&mut Windows<'static, RING>) -> T) -> T {
    WINDOWS.lock(|cell| {
        act(cell
            .borrow_mut()
            .as_mut()
            .expect("the windows are taken up before tasks start"))
    })
}

/// Keeps a frame of a strike. The first one begins its window, with the settings in force.
pub(crate) fn add(packed: &Packed, strike: u32) {
    let boot = trace::boot();
    let (kind, body) = packed.content();
    let append = |windows: &mut Windows<'static, RING>| {
        let is_open = windows.is_open(boot, strike);
        if is_open {
            windows.append(kind, body);
        }
        is_open
    };
    if !with(append) {
        begin_window(boot, strike);
        with(append);
    }
}

#[inline(never)]
fn begin_window(boot: u32, strike: u32) {
    let mut settings = Packed::new();
    let message = bead_wire::Settings {
        block: settings::current(),
    };
    if outbox::pack(&mut settings, &message.into()) {
        let (kind, body) = settings.content();
        with(|windows| {
            windows.open(boot, strike);
            windows.append(kind, body);
        });
    }
}

/// The strike is complete.
pub(crate) fn close() {
    with(Windows::close);
    CLOSED.signal(());
}

/// The strike was cut: it has no result.
pub(crate) fn abandon() {
    with(Windows::abandon);
}

/// Makes the checksums of windows while none is measured, for ever.
#[embassy_executor::task]
pub(crate) async fn seal() -> ! {
    loop {
        CLOSED.wait().await;
        loop {
            Timer::after(PAUSE).await;
            // The blocks of a strike are busy enough.
            if with(|windows| windows.is_filling()) {
                continue;
            }
            if !(0..STEPS).all(|_| with(Windows::seal)) {
                break;
            }
        }
    }
}

/// Queues the list of the strikes that are kept, and returns how many they are.
pub(crate) fn tell() -> u32 {
    let mut number = 0;
    while let Some(kept) = with(|windows| windows.kept(number)) {
        outbox::tell(Kept {
            boot: kept.boot,
            strike: kept.strike,
            parts: kept.parts,
            bytes: kept.bytes,
        });
        number += 1;
    }
    number
}

/// A strike that is being sent again.
pub(crate) struct Again {
    boot: u32,
    strike: u32,
    cursor: Cursor,
}

/// Finds a strike.
pub(crate) fn find(boot: u32, strike: u32) -> Option<Again> {
    let cursor = with(|windows| windows.find(boot, strike))?;
    Some(Again { boot, strike, cursor })
}

/// Progress of a strike that is sent again.
pub(crate) enum Sent {
    Some,
    All,
    /// It gave way to newer ones.
    Gone,
}

impl Again {
    /// Queues the next frame.
    pub(crate) fn push_next(&mut self) -> Sent {
        let mut part = Ok(None);
        let body = Inner::filled_by(|room| {
            part = with(|windows| windows.read(&mut self.cursor, room));
            part.ok().flatten().map_or(0, |part| part.length)
        });
        match part {
            Ok(Some(part)) => {
                outbox::push(Fetched {
                    boot: self.boot,
                    strike: self.strike,
                    part: part.number,
                    parts: part.of,
                    frame_kind: part.kind,
                    body,
                });
                Sent::Some
            }
            Ok(None) => Sent::All,
            Err(_) => Sent::Gone,
        }
    }
}
