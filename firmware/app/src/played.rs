//! A bead on a bench: its own outputs play to its inputs, over two wires (`docs/bench.md`).
//!
//! # Design
//! The outputs are on only while a request is carried out, at the lowest priority, and cost nothing
//! afterwards. Inputs jump when outputs are switched, so the detector is disarmed then, and armed only while
//! strikes are played. Every window with a scan of this time is flagged, so that no host takes it for a
//! measurement.

use bead_crc::RunningChecksum;
use bead_model::made_up::{PLAYED, REST, played};
use bead_wire::{Image, Played};

use crate::bead::BeadState;
use crate::block::SCANS_PER_BLOCK;
use crate::device::{Device, MS};
use crate::played_scans::PlayedScans;

/// Longest time of a request: the host waits a second for the reply.
const LONGEST_MS: u32 = 400;
/// Least interval of strikes, ms: a strike, and the time to begin the next.
const LEAST_MS: u32 = 5;
/// Wait after a change of level or of arming: an output settles in 6 µs, and arming takes effect with a
/// block.
const SETTLED: u64 = 3 * SCANS_PER_BLOCK as u64;
/// Quiet before the first strike: the detector looks back this far at most, and needs some quiet.
const QUIET: u64 = 20 * MS;
/// Scans within which a window is complete: the longest has 1024, and the meter lags by as many.
const COMPLETE: u64 = 20 * MS;

/// Bytes of flash that are read without a pause: 0.3 ms.
const PIECE: usize = 4096;

/// A task for the outputs.
pub(crate) enum Play {
    /// Codes, and the time to hold them, ms.
    Hold([u16; 2], u32),
    /// Number of strikes, and the time from one to the next, ms.
    Strikes(u32, u32),
}

impl Play {
    /// Returns `None` if a code or the time is out of range.
    pub(crate) fn hold(codes: [u16; 2], ms: u32) -> Option<Self> {
        let is_allowed = codes.iter().all(|code| *code < 4096) && ms <= LONGEST_MS;
        is_allowed.then_some(Self::Hold(codes, ms))
    }

    /// Returns `None` if a time is out of range.
    pub(crate) fn strikes(count: u32, interval_ms: u32) -> Option<Self> {
        let is_allowed = interval_ms >= LEAST_MS && count.saturating_mul(interval_ms) <= LONGEST_MS;
        is_allowed.then_some(Self::Strikes(count, interval_ms))
    }

    /// Carries the task out. Afterwards the bead is armed or disarmed as before, and the outputs are off.
    pub(crate) async fn carry_out<D: Device>(self, bead: &BeadState<D>) {
        let armed = bead.is_armed();
        let first = bead.snapshot().newest_index;
        // Open-ended until the playback is over.
        bead.played.set(PlayedScans::new(first, u64::MAX));
        bead.arm(false);
        bead.device.sleep(SETTLED).await;
        match self {
            Self::Hold(codes, ms) => hold(bead, codes, ms).await,
            Self::Strikes(count, interval_ms) => {
                bead.device.hold(Some(REST));
                bead.device.sleep(SETTLED).await;
                bead.arm(true);
                bead.device.sleep(QUIET).await;
                for _ in 0..count {
                    strike(bead, u64::from(interval_ms) * MS).await;
                }
                bead.device.sleep(COMPLETE).await;
                bead.arm(false);
                bead.device.sleep(SETTLED).await;
            }
        }
        bead.device.hold(None);
        bead.device.sleep(SETTLED).await;
        let end = bead.snapshot().newest_index + SCANS_PER_BLOCK as u64;
        bead.played.set(PlayedScans::new(first, end));
        bead.arm(armed);
    }
}

async fn hold<D: Device>(bead: &BeadState<D>, codes: [u16; 2], ms: u32) {
    bead.device.hold(Some(codes));
    bead.device.sleep(SETTLED).await;
    let first_index = bead.snapshot().newest_index + 1;
    bead.start_raw(ms);
    bead.device.sleep(u64::from(ms) * MS).await;
    // The stream ends with the block that is being filled.
    bead.device.sleep(SETTLED).await;
    let scans = bead.snapshot().newest_index + 1 - first_index;
    bead.send(Played {
        first_index,
        scans: scans as u32,
        complete: true,
    });
}

async fn strike<D: Device>(bead: &BeadState<D>, interval: u64) {
    let end = bead.device.now() + interval;
    let first_index = bead.device.play(played(), bead.snapshot().newest_index);
    bead.device.sleep(PLAYED as u64 + MS).await;
    let complete = bead.device.end_play();
    bead.send(Played {
        first_index,
        scans: PLAYED as u32,
        complete,
    });
    bead.device.sleep(end.saturating_sub(bead.device.now())).await;
}

/// Reads the image, and sends its checksum.
pub(crate) async fn send_image<D: Device>(bead: &BeadState<D>) {
    let image = bead.device.image();
    let mut checksum = RunningChecksum::new();
    for piece in image.chunks(PIECE) {
        checksum.update(piece);
        bead.device.sleep(1).await;
    }
    bead.send(Image {
        address: bead.device.image_address(),
        bytes: image.len() as u32,
        crc: checksum.finish(),
    });
}
