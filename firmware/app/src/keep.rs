//! The last strikes, for a host that missed them: kept over a reset, and sent again on request.
//!
//! # Design
//! The frames of a strike are copied into memory that a reset leaves alone ([`bead_store::Windows`]; region
//! WINDOWS of `memory.x`): the settings, the waveform, the strike, its shape. Each frame is copied where it
//! is made, in some 100 instructions for 32 scans. The checksums take longer: a task of the lowest priority
//! makes them little by little after the strike.
//!
//! Fetched frames are bulk: they leave the room that the window of a strike needs, so they never cost one.

use bead_store::{Cursor, Windows};
use bead_wire::{Fetched, Inner, Kept, Packed};

use crate::bead::{BeadState, RING};
use crate::device::{Device, MS};

/// Steps of a checksum in each [`PAUSE`], 18 instructions a sample. A window of 672 scans takes 25 ms, or 40
/// if it is loud.
const STEPS: u32 = 8;
const PAUSE: u64 = 2 * MS;

/// A strike that is being sent again.
pub(crate) struct Refetch {
    boot: u32,
    strike: u32,
    cursor: Cursor,
}

/// Progress of a strike that is sent again.
pub(crate) enum RefetchStep {
    Sent,
    Complete,
    /// The strike gave way to newer ones.
    Gone,
}

impl<D: Device> BeadState<D> {
    /// Keeps a frame of a strike. The first one begins its window, with the settings in force.
    pub(crate) fn keep_frame(&self, packed: &Packed, strike: u32) {
        let boot = self.boot();
        let (kind, body) = packed.content();
        let append = |windows: &mut Windows<'static, RING>| {
            let is_open = windows.is_open(boot, strike);
            if is_open {
                windows.append(kind, body);
            }
            is_open
        };
        if !self.windows.with(append) {
            self.begin_window(boot, strike);
            self.windows.with(append);
        }
    }

    #[inline(never)]
    fn begin_window(&self, boot: u32, strike: u32) {
        let mut settings = Packed::new();
        let message = bead_wire::Settings {
            block: self.settings.block(),
        };
        if self.pack(&mut settings, &message.into()) {
            let (kind, body) = settings.content();
            self.windows.with(|windows| {
                windows.open(boot, strike);
                windows.append(kind, body);
            });
        }
    }

    /// Closes the window of a complete strike.
    pub(crate) fn close_window(&self) {
        self.windows.with(Windows::close);
        self.window_closed.signal(());
    }

    /// Gives up the window of a strike that was cut and has no result.
    pub(crate) fn abandon_window(&self) {
        self.windows.with(Windows::abandon);
    }

    /// Makes the checksums of windows while none is measured, for ever.
    pub async fn seal_windows(&self) -> ! {
        loop {
            self.window_closed.wait().await;
            loop {
                self.device.sleep(PAUSE).await;
                // The core is busy enough during a strike.
                if self.windows.with(|windows| windows.is_filling()) {
                    continue;
                }
                if !(0..STEPS).all(|_| self.windows.with(Windows::seal)) {
                    break;
                }
            }
        }
    }

    /// Queues the list of the strikes that are kept, and returns their number.
    pub(crate) fn send_kept(&self) -> u32 {
        let mut number = 0;
        while let Some(kept) = self.windows.with(|windows| windows.kept(number)) {
            self.send(Kept {
                boot: kept.boot,
                strike: kept.strike,
                parts: kept.parts,
                bytes: kept.bytes,
            });
            number += 1;
        }
        number
    }

    /// Finds a strike.
    pub(crate) fn find_kept(&self, boot: u32, strike: u32) -> Option<Refetch> {
        let cursor = self.windows.with(|windows| windows.find(boot, strike))?;
        Some(Refetch { boot, strike, cursor })
    }

    /// Queues the next frame of a strike.
    pub(crate) fn push_next(&self, refetch: &mut Refetch) -> RefetchStep {
        let mut part = Ok(None);
        let body = Inner::filled_by(|room| {
            part = self
                .windows
                .with(|windows| windows.read(&mut refetch.cursor, room));
            part.ok().flatten().map_or(0, |part| part.length)
        });
        match part {
            Ok(Some(part)) => {
                self.push(Fetched {
                    boot: refetch.boot,
                    strike: refetch.strike,
                    part: part.number,
                    parts: part.of,
                    frame_kind: part.kind,
                    body,
                });
                RefetchStep::Sent
            }
            Ok(None) => RefetchStep::Complete,
            Err(_) => RefetchStep::Gone,
        }
    }
}
