//! Counts since the reset: made where things happen, sent with the frames of status, health and link.

use bead_wire::Health;

/// Counts since the reset. Each has one writer. A field without a comment has the meaning of the field of the
/// same name in [`bead_wire::Status`].
#[derive(Clone, Copy, Default)]
#[expect(missing_docs, reason = "see above")]
pub struct BeadCounters {
    /// Index of the newest scan; while none are made, the sample periods since the start.
    pub newest_index: u64,
    /// Number of the run of samples without a gap. No window spans two of them.
    pub epoch: u32,
    pub samples: u64,
    pub strikes: u32,
    pub overruns: u32,
    pub blocks_dropped: u32,
    /// Blocks that acquisition handed to estimation.
    pub blocks_handed_on: u32,
    /// Blocks that estimation has finished.
    pub blocks_estimated: u32,
    /// Frames made, sent or not: the sequence number of the next one; wraps.
    pub frames: u32,
    pub frames_dropped_queue_full: u32,
    pub frames_dropped_too_long: u32,
    /// Frames that the transmitter has sent; wraps.
    pub frames_sent: u32,
    /// Frames that wait or are being sent. The next boot reads this number after a reset.
    pub frames_waiting: u32,
    pub armed: bool,
    /// Counts of the health frame.
    pub health: Health,
}

/// Core clocks spent on blocks since the last load frame.
#[derive(Clone, Copy, Default)]
pub(crate) struct LoadCounter {
    pub(crate) blocks: u32,
    pub(crate) worst: u32,
    pub(crate) total: u64,
}
