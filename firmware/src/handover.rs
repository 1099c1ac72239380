//! The way of the blocks between acquisition and estimation, and back.

use bead_app::{Block, Codes};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;

/// All blocks: two that the converter fills, and four on their way, 8 ms.
const BLOCKS: usize = 2 + 4;

static POOL: [Codes; BLOCKS] = [const { Codes::new() }; BLOCKS];
static FREE: Channel<CriticalSectionRawMutex, &'static Codes, BLOCKS> = Channel::new();
static FULL: Channel<CriticalSectionRawMutex, Block, BLOCKS> = Channel::new();

const ROOM: &str = "the way has room for all blocks";

/// Makes all blocks free. Called once.
pub(crate) fn begin() {
    POOL.iter().for_each(give_back);
}

/// A free block, if there is one.
pub(crate) fn free() -> Option<&'static Codes> {
    FREE.try_receive().ok()
}

/// Hands a block on to the estimators.
pub(crate) fn hand_on(block: Block) {
    FULL.try_send(block).ok().expect(ROOM);
}

/// The next block for the estimators; waits for it.
pub(crate) async fn next() -> Block {
    FULL.receive().await
}

/// Gives back a block whose scans were taken.
pub(crate) fn give_back(codes: &'static Codes) {
    FREE.try_send(codes).ok().expect(ROOM);
}
