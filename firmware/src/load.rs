//! Cost of the work on a block, by the core's cycle counter.

use core::cell::Cell;

use bead_wire::Load;
use cortex_m::peripheral::{DCB, DWT};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;

use crate::block::BLOCK_US;
use crate::clocks::TIMER_HZ;
use crate::outbox;

/// The core runs twice as fast as the timers.
const CORE_HZ: u32 = 2 * TIMER_HZ;

/// Cycles since they were last told.
#[derive(Clone, Copy)]
struct Spent {
    blocks: u32,
    worst: u32,
    total: u64,
}

const NOTHING: Spent = Spent {
    blocks: 0,
    worst: 0,
    total: 0,
};

static SPENT: Mutex<CriticalSectionRawMutex, Cell<Spent>> = Mutex::new(Cell::new(NOTHING));

/// Starts the counter.
pub(crate) fn begin(dcb: &mut DCB, dwt: &mut DWT) {
    dcb.enable_trace();
    dwt.enable_cycle_counter();
}

/// Does the work on a block, and counts its cycles. The counter wraps every 25 s; a block takes 2 ms.
pub(crate) fn count<T>(work: impl FnOnce() -> T) -> T {
    let before = DWT::cycle_count();
    let result = work();
    let cycles = DWT::cycle_count().wrapping_sub(before);
    SPENT.lock(|cell| {
        let spent = cell.get();
        cell.set(Spent {
            blocks: spent.blocks.wrapping_add(1),
            worst: spent.worst.max(cycles),
            total: spent.total + u64::from(cycles),
        });
    });
    result
}

/// Sends the cycles since this was last called.
pub(crate) fn tell() {
    let Spent { blocks, worst, total } = SPENT.lock(|cell| cell.replace(NOTHING));
    outbox::tell(Load {
        blocks,
        worst_cycles: worst,
        mean_cycles: (total / u64::from(blocks.max(1))) as u32,
        period_cycles: CORE_HZ / 1_000_000 * BLOCK_US,
    });
}
