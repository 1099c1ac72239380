//! Codes of an endless run: the same strikes again and again, each time with different noise.

use std::sync::Arc;

/// Digitises the same signal with the noise of another seed.
pub(super) type WithOtherNoise = Arc<dyn Fn(u64) -> Vec<[u16; 4]> + Send + Sync>;

/// Codes at the converter, without end.
pub(super) struct Playback {
    rows: Vec<[u16; 4]>,
    /// Number of rows of codes that were taken.
    pub(super) taken: u64,
    /// Seed of the noise, and a function that digitises with another seed; `None` without noise.
    noise: Option<(u64, WithOtherNoise)>,
}

impl Playback {
    /// Begins with these codes, which must not be empty.
    pub(super) fn new(rows: Vec<[u16; 4]>, noise: Option<(u64, WithOtherNoise)>) -> Self {
        Self {
            rows,
            taken: 0,
            noise,
        }
    }

    pub(super) fn take(&mut self, count: u64) -> Vec<[u16; 4]> {
        let length = self.rows.len() as u64;
        let mut taken = Vec::with_capacity(count as usize);
        while (taken.len() as u64) < count {
            let at = self.taken % length;
            if let (0, Some((seed, again))) = (at, &mut self.noise)
                && self.taken > 0
            {
                *seed = seed.wrapping_add(1);
                self.rows = again(*seed);
            }
            let piece = (count - taken.len() as u64).min(length - at);
            taken.extend_from_slice(&self.rows[at as usize..(at + piece) as usize]);
            self.taken += piece;
        }
        taken
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_round_has_other_noise_and_without_noise_all_are_alike() {
        let rows = |seed: u64| (0..3).map(|row| [seed as u16, row, 0, 0]).collect::<Vec<_>>();
        let mut noisy = Playback::new(rows(7), Some((7, Arc::new(rows))));
        let mut quiet = Playback::new(rows(7), None);
        let expected: Vec<_> = [rows(7), rows(8), rows(9)].concat();
        let mut taken = Vec::new();
        for count in [1, 0, 4, 4] {
            taken.extend(noisy.take(count));
        }
        assert_eq!(taken, expected);
        assert_eq!(noisy.taken, 9);
        assert_eq!(quiet.take(9), rows(7).repeat(3));
    }
}
