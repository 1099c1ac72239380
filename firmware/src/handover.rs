//! Passes blocks from acquisition to estimation, and back.

use bead_app::{BlockCodes, ScanBlock};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;

/// All blocks: two that the converter fills, and four on their way, 8 ms.
const BLOCKS: usize = 2 + 4;

static POOL: [BlockCodes; BLOCKS] = [const { BlockCodes::new() }; BLOCKS];
static FREE: Channel<CriticalSectionRawMutex, &'static BlockCodes, BLOCKS> = Channel::new();
static FULL: Channel<CriticalSectionRawMutex, ScanBlock, BLOCKS> = Channel::new();

const ROOM: &str = "the way has room for all blocks";

/// Makes all blocks free. Called once.
pub(crate) fn begin() {
    POOL.iter().for_each(give_back);
}

/// A free block, if there is one.
pub(crate) fn free() -> Option<&'static BlockCodes> {
    FREE.try_receive().ok()
}

/// Hands a block on to the estimators.
pub(crate) fn hand_on(block: ScanBlock) {
    FULL.try_send(block).ok().expect(ROOM);
}

/// The next block for the estimators; waits for it.
pub(crate) async fn next() -> ScanBlock {
    FULL.receive().await
}

/// Gives back a block whose scans were taken.
pub(crate) fn give_back(codes: &'static BlockCodes) {
    FREE.try_send(codes).ok().expect(ROOM);
}
