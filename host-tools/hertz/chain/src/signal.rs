//! Signals: values at equal intervals of time.

use crate::solution::{Snapshot, Solution};

/// Values at equal intervals.
#[derive(Debug, Clone, PartialEq)]
pub struct Signal {
    /// Time of the first value, s.
    pub start: f64,
    /// Time from one value to the next, s.
    pub interval: f64,
    /// The values.
    pub values: Vec<f64>,
}

impl Signal {
    /// Time of value `index`, s.
    pub fn time(&self, index: usize) -> f64 {
        self.start + self.interval * index as f64
    }
}

impl Solution {
    /// Samples `value` of the motion from `from` to `to` every `interval`, all in s.
    ///
    /// # Panics
    /// If the stretch is not within 0 to [`Solution::end`] or `interval` is not above zero.
    pub fn signal(
        &self,
        from: f64,
        to: f64,
        interval: f64,
        mut value: impl FnMut(&Snapshot<'_>) -> f64,
    ) -> Signal {
        assert!(
            interval > 0.0,
            "samples need an interval above zero, not {interval} s"
        );
        let mut sampler = self.sampler();
        // Rounding can make an interval of n samples come out just short of n.
        let intervals = ((to - from) / interval * (1.0 + 1e-12)) as usize;
        Signal {
            start: from,
            interval,
            values: (0..=intervals)
                .map(|i| value(&sampler.at((from + interval * i as f64).min(to))))
                .collect(),
        }
    }
}
