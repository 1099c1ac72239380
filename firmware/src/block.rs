//! Consecutive scans that go from the converter to the estimators as one, without a copy.

use core::sync::atomic::AtomicU32;

use bead_model::{Scan, scans};

use crate::sample_clock::SAMPLE_RATE_HZ;

/// Codes in a scan: force at its high and its low gain, then acceleration.
pub(crate) const CHANNELS: usize = 4;
/// Scans in a block: 2 ms.
pub(crate) const SCANS_PER_BLOCK: usize = 200;
/// Codes in a block.
pub(crate) const CODES: usize = CHANNELS * SCANS_PER_BLOCK;
/// Time that a block takes to fill, in µs.
pub(crate) const BLOCK_US: u32 = SCANS_PER_BLOCK as u32 * 1_000_000 / SAMPLE_RATE_HZ;

/// Room for the codes of a block, as the converter gives them, scan after scan: a word for each sensor, the
/// high gain in the lower half.
///
/// The DMA writes to it and the core reads it. So it is made of atomics: what they hold may change at any
/// time, and a plain load reads one.
pub(crate) struct Codes([[AtomicU32; CHANNELS / 2]; SCANS_PER_BLOCK]);

impl Codes {
    /// All zeros.
    pub(crate) const fn new() -> Self {
        Self([const { [const { AtomicU32::new(0) }; CHANNELS / 2] }; SCANS_PER_BLOCK])
    }

    /// Where the DMA has to write.
    pub(crate) fn address(&'static self) -> u32 {
        self.0.as_ptr().expose_provenance() as u32
    }

    /// The words of the scans, first to last.
    pub(crate) fn words(&self) -> &[[AtomicU32; CHANNELS / 2]] {
        &self.0
    }
}

/// Consecutive scans.
pub(crate) struct Block {
    /// Changes where samples are missing before this block.
    pub(crate) epoch: u32,
    /// Index of the first scan.
    pub(crate) first_index: u64,
    pub(crate) codes: &'static Codes,
}

impl Block {
    /// The scans, first to last.
    pub(crate) fn scans(&self) -> impl ExactSizeIterator<Item = Scan> + '_ {
        scans(self.codes.words())
    }
}
