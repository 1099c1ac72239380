//! The scans in which a bead on a bench plays to itself.

/// Scans whose windows are no measurement: from the first up to, and without, the end.
#[derive(Clone, Copy, Default)]
pub(crate) struct PlayedScans {
    first: u64,
    end: u64,
}

impl PlayedScans {
    pub(crate) const fn new(first: u64, end: u64) -> Self {
        Self { first, end }
    }

    /// Returns `true` if a window has one of them.
    pub(crate) fn is_in(self, first_index: u64, samples: u16) -> bool {
        first_index < self.end && first_index + u64::from(samples) > self.first
    }
}
