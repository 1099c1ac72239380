//! The scans in which a bead on a bench plays to itself.

/// Range of scans whose windows are not measurements; `end` is not part of it.
#[derive(Clone, Copy, Default)]
pub(crate) struct PlayedScans {
    first: u64,
    end: u64,
}

impl PlayedScans {
    pub(crate) const fn new(first: u64, end: u64) -> Self {
        Self { first, end }
    }

    /// Returns `true` if a window contains one of the scans.
    pub(crate) fn is_in(self, first_index: u64, samples: u16) -> bool {
        first_index < self.end && first_index + u64::from(samples) > self.first
    }
}
