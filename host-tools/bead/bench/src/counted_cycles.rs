//! Cycles of the image as the emulator counts them, to stand beside those that a bead measures.
//!
//! A test of the budget holds these numbers to its table, docs/budget.md.

/// Cycles of the same work by two models of the memory.
#[derive(Debug, Clone, Copy)]
pub struct CountedCycles {
    /// With instructions and data from the flash's caches wherever they are still held.
    pub cached: u32,
    /// With each instruction at its longest, and each line of flash waited for.
    pub at_most: u32,
}

/// Scans of a block.
const SCANS: u32 = 200;

/// A block of 200 samples in the middle of the paper's strike: `worst_cycles` of the load frame.
pub const BUSIEST_BLOCK: CountedCycles = CountedCycles {
    cached: 620 * SCANS,
    at_most: 1097 * SCANS,
};

/// A block of 200 samples while the chain rests.
pub const IDLE_BLOCK: CountedCycles = CountedCycles {
    cached: 73 * SCANS,
    at_most: 127 * SCANS,
};

/// The longest stretch without interrupts: `masked_cycles` of the load frame.
pub const MASKED: CountedCycles = CountedCycles {
    cached: 1344,
    at_most: 2703,
};
