//! Consecutive scans that go from acquisition to estimation as one.

use bead_model::Scan;

use crate::sample_clock::SAMPLE_RATE_HZ;

/// Codes in a scan: force at its high and its low gain, then acceleration.
pub(crate) const CHANNELS: usize = 4;
/// Scans in a block: 2 ms.
pub(crate) const SCANS_PER_BLOCK: usize = 200;
/// Codes in a block.
pub(crate) const CODES: usize = CHANNELS * SCANS_PER_BLOCK;
/// Time that a block takes to fill, in µs.
pub(crate) const BLOCK_US: u32 = SCANS_PER_BLOCK as u32 * 1_000_000 / SAMPLE_RATE_HZ;

/// Consecutive scans.
pub(crate) struct Block {
    /// Changes where samples are missing before this block.
    pub(crate) epoch: u32,
    /// Index of the first scan.
    pub(crate) first_index: u64,
    /// As the converter gave them, scan after scan.
    pub(crate) codes: [u16; CODES],
}

impl Block {
    pub(crate) const EMPTY: Self = Self {
        epoch: 0,
        first_index: 0,
        codes: [0; CODES],
    };

    /// The scans, first to last.
    pub(crate) fn scans(&self) -> impl ExactSizeIterator<Item = Scan> + '_ {
        self.codes.as_chunks().0.iter().map(|&codes| Scan::new(codes))
    }
}
