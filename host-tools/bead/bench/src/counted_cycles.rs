//! Cycles of the image as counted by the emulator, for comparison with those that a bead measures.
//!
//! A test compares these numbers with the table in docs/budget.md.

/// Cycles of the same work by two models of the memory.
#[derive(Debug, Clone, Copy)]
pub struct CountedCycles {
    /// With instructions and data served from the flash caches where cached.
    pub cached: u32,
    /// With each instruction at its longest, and a wait for each line of flash.
    pub at_most: u32,
}

/// Scans of a block.
const SCANS: u32 = 200;

/// A block of 200 samples in the middle of the paper's strike: `worst_cycles` of the load frame.
pub const BUSIEST_BLOCK: CountedCycles = CountedCycles {
    cached: 620 * SCANS,
    at_most: 1105 * SCANS,
};

/// A block of 200 samples while the chain rests.
pub const IDLE_BLOCK: CountedCycles = CountedCycles {
    cached: 71 * SCANS,
    at_most: 126 * SCANS,
};

/// The longest stretch without interrupts: `masked_cycles` of the load frame.
pub const MASKED: CountedCycles = CountedCycles {
    cached: 1357,
    at_most: 2423,
};
