//! Converts the count that a 32-bit timer latched to a position on the sample clock.

use crate::message::sync::Sync;

/// The number nearest to `about` whose low 32 bits are `count`. It turns a count that wraps after 2³² into
/// one that does not, if `about` is off by less than 2³¹.
///
/// ```
/// # use bead_wire::unwrapped;
/// assert_eq!(unwrapped(5, 0xffff_fff0), 0x1_0000_0005);
/// ```
pub const fn unwrapped(count: u32, about: u64) -> u64 {
    let ahead = count.wrapping_sub(about as u32) as i32;
    // There are no numbers below 0: a count that seems to lie just before 0 lies one wrap ahead.
    match about.checked_add_signed(ahead as i64) {
        Some(number) => number,
        None => count as u64,
    }
}

impl Sync {
    /// The edge that comes `clocks` clocks after sample index 0. A sample period has `clocks_per_sample`
    /// clocks.
    ///
    /// # Panics
    /// `clocks_per_sample` is 0.
    #[must_use]
    pub const fn at(edge: u32, clocks: u64, clocks_per_sample: u16, missed: u32) -> Self {
        assert!(clocks_per_sample > 0, "a sample period has clocks");
        Self {
            edge,
            index: clocks / clocks_per_sample as u64,
            clocks: (clocks % clocks_per_sample as u64) as u16,
            clocks_per_sample,
            missed,
        }
    }

    /// Sample index with its fraction. Divided by the sample rate it is the bead's time in s. Its relative
    /// error is below 2⁻⁵².
    #[must_use]
    pub fn position(&self) -> f64 {
        self.index as f64 + f64::from(self.clocks) / f64::from(self.clocks_per_sample.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_count_goes_on_over_its_wraps_while_the_guess_is_off_by_less_than_half_of_them() {
        const HALF: u64 = 1 << 31;
        const WRAP: u64 = 1 << 32;
        for number in [HALF, WRAP - 1, WRAP, WRAP + 1, 51 * WRAP, u64::MAX / 2] {
            for off in [0, 1, 1000, HALF - 1] {
                assert_eq!(unwrapped(number as u32, number + off), number, "{off} late");
                assert_eq!(unwrapped(number as u32, number - off), number, "{off} early");
            }
            assert_ne!(unwrapped(number as u32, number + HALF + 1), number);
        }
        assert_eq!(unwrapped(u32::MAX, 0), u32::MAX.into());
    }

    #[test]
    fn clocks_are_split_into_an_index_and_the_rest_and_put_together_again() {
        // 84 MHz at 100 kHz, an hour and 839 clocks after index 0.
        let clocks = 3600 * 84_000_000 + 839;
        let sync = Sync::at(7, clocks, 840, 3);
        assert_eq!((sync.index, sync.clocks), (360_000_000, 839));
        assert_eq!((sync.edge, sync.missed), (7, 3));
        assert!((sync.position() * 840.0 - clocks as f64).abs() < 1e-3);
    }
}
