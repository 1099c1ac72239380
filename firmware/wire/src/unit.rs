//! What the bits of a quantity are worth.

/// What one bit of a quantity is worth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// SI unit.
    pub symbol: &'static str,
    /// End of a field's name in JSON, such as `_n` for newtons.
    pub suffix: &'static str,
    /// Size of one bit in the SI unit, or, if [`per_sample`](Self::per_sample), in the SI unit over a sample
    /// period.
    pub resolution: f64,
    /// Whether the time in the unit is counted in sample periods: then the value in SI needs the sample rate.
    pub per_sample: bool,
}

impl Unit {
    /// The value of `bits` in the SI unit; `None` if it needs the sample rate, in Hz, and none is given.
    pub fn si(&self, bits: i64, sample_rate_hz: Option<u32>) -> Option<f64> {
        let value = bits as f64 * self.resolution;
        match self.per_sample {
            false => Some(value),
            true => sample_rate_hz.map(|rate| value / f64::from(rate)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_become_a_value_in_the_si_unit_by_way_of_the_sample_rate_where_it_counts() {
        let unit = |per_sample| Unit {
            symbol: "",
            suffix: "",
            resolution: 0.25,
            per_sample,
        };
        assert_eq!(unit(false).si(-6, None), Some(-1.5));
        assert_eq!(unit(false).si(-6, Some(10)), Some(-1.5));
        assert_eq!(unit(true).si(8, Some(10)), Some(0.2));
        assert_eq!(unit(true).si(8, None), None);
    }
}
