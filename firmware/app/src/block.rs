//! Blocks of consecutive scans, passed from the converter to the estimators without a copy.

use core::sync::atomic::AtomicU32;

use bead_model::{Scan, scans};

/// Scans a second. Every constant of the built-in settings is derived for it.
pub const SAMPLE_RATE_HZ: u32 = 100_000;
/// Codes in a scan: force at its high and its low gain, then acceleration.
pub const CHANNELS: usize = 4;
/// Scans in a block: 2 ms.
pub const SCANS_PER_BLOCK: usize = 200;
/// Time that a block takes to fill, in µs.
pub const BLOCK_US: u32 = SCANS_PER_BLOCK as u32 * 1_000_000 / SAMPLE_RATE_HZ;

/// Buffer for the codes of a block as the converter delivers them, scan after scan: a word for each sensor,
/// with the high gain in the lower half.
///
/// The DMA writes to it while the core reads it, so it consists of atomics: their values may change at any
/// time, and loading one is a plain load.
pub struct BlockCodes(pub [[AtomicU32; CHANNELS / 2]; SCANS_PER_BLOCK]);

impl BlockCodes {
    /// All zeros.
    pub const fn new() -> Self {
        Self([const { [const { AtomicU32::new(0) }; CHANNELS / 2] }; SCANS_PER_BLOCK])
    }
}

impl Default for BlockCodes {
    fn default() -> Self {
        Self::new()
    }
}

/// Consecutive scans.
pub struct ScanBlock {
    /// Differs from that of the block before if samples between the two are missing.
    pub epoch: u32,
    /// Index of the first scan.
    pub first_index: u64,
    /// Words of the scans, first to last.
    pub codes: &'static BlockCodes,
}

impl ScanBlock {
    /// The scans, first to last.
    pub(crate) fn scans(&self) -> impl ExactSizeIterator<Item = Scan> + '_ {
        scans(&self.codes.0)
    }
}
