//! Limit of the writes to the store.
//!
//! # Design
//! A sector endures 10 000 erases (DocID022152, flash memory endurance), and a full sector is erased at the
//! next start. A host that writes and resets without end would wear it out within days. So at most [`BURST`]
//! blocks are written at once, and one every [`EVERY_MS`] in the long run. A sector holds 268 of the longest
//! blocks, so there are 33 erases a day at most, and the two sectors last 1.7 years even then.
//!
//! The number of blocks written lately must survive a reset, or a reset would circumvent the limit. Time that
//! passes during a reset is not counted.

/// Blocks that may be written at once.
pub const BURST: u32 = 16;
/// Time after which another block may be written, in ms.
pub const EVERY_MS: u64 = 10_000;

/// Counts the blocks that are written.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Blocks written lately: one fewer every [`EVERY_MS`].
    written: u32,
    /// Time up to which `written` has been reduced, in ms.
    until_ms: u64,
}

impl Pace {
    /// Continues at time 0 from the number that the last start left. A number that no start leaves counts as
    /// [`BURST`].
    pub const fn new(written: u32) -> Self {
        let written = if written > BURST { BURST } else { written };
        Self { written, until_ms: 0 }
    }

    /// Counts a block to be written at this time since the start, if it may be written. Returns the number to
    /// keep over a reset.
    ///
    /// # Errors
    /// The time in ms after which the block may be written.
    pub fn write(&mut self, now_ms: u64) -> Result<u32, u64> {
        let passed = now_ms.saturating_sub(self.until_ms) / EVERY_MS;
        self.written = self
            .written
            .saturating_sub(u32::try_from(passed).unwrap_or(u32::MAX));
        self.until_ms = match self.written {
            // Time without a debt is not saved up.
            0 => now_ms,
            _ => self.until_ms + passed * EVERY_MS,
        };
        if self.written >= BURST {
            return Err(self.until_ms + EVERY_MS - now_ms);
        }
        self.written += 1;
        Ok(self.written)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_burst_is_written_and_then_one_block_every_ten_seconds() {
        let mut pace = Pace::new(0);
        for n in 0..BURST {
            assert_eq!(pace.write(5_000), Ok(n + 1));
        }
        assert_eq!(pace.write(5_000), Err(EVERY_MS));
        assert_eq!(pace.write(14_999), Err(1));
        assert_eq!(pace.write(15_000), Ok(BURST));
        assert_eq!(pace.write(15_001), Err(9_999));
        assert_eq!(pace.write(1_000_000), Ok(1), "all is forgotten in time");
    }

    #[test]
    fn a_reset_is_no_way_around_it() {
        let mut pace = Pace::new(0);
        let mut kept = 0;
        let mut written = 0;
        // A reset every second for an hour, with as many writes as are let through.
        for _ in 0..3600 {
            while let Ok(keep) = pace.write(0) {
                (kept, written) = (keep, written + 1);
            }
            let _ = pace.write(1000).map(|keep| kept = keep);
            pace = Pace::new(kept);
        }
        assert_eq!(written, BURST);
        assert_eq!(Pace::new(u32::MAX).write(0), Err(EVERY_MS));
    }
}
