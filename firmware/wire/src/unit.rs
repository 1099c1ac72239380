//! The unit of a quantity.

/// Unit of a quantity, and the size of one of its bits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// SI unit.
    pub symbol: &'static str,
    /// End of a key in JSON and tables, such as `_n` for newtons.
    pub suffix: &'static str,
    /// Bits behind the binary point.
    pub fraction_bits: u32,
    /// Worth of the number 1 in the SI unit: 1, or 10⁻⁹ for a quantity in nanojoules.
    pub scale: f64,
    /// True if time in the unit counts in sample periods. The SI value then needs the sample rate.
    pub per_sample: bool,
    /// True if 0 stands for a value that was not found.
    pub zero_is_unknown: bool,
}

impl Unit {
    pub(crate) const fn new(symbol: &'static str, suffix: &'static str, fraction_bits: u32) -> Self {
        Self {
            symbol,
            suffix,
            fraction_bits,
            scale: 1.0,
            per_sample: false,
            zero_is_unknown: false,
        }
    }

    /// Size of one bit in the SI unit or, if [`per_sample`](field@Self::per_sample), in the SI unit at a
    /// sample rate of 1 Hz.
    pub const fn resolution(&self) -> f64 {
        self.scale / (1_u64 << self.fraction_bits) as f64
    }

    /// Value of `bits` in the SI unit. `None` if it was not found, or if it needs the sample rate, in Hz, and
    /// none is given.
    pub fn si(&self, bits: i64, sample_rate_hz: Option<u32>) -> Option<f64> {
        let value = bits as f64 * self.resolution();
        if self.zero_is_unknown && bits == 0 {
            None
        } else if self.per_sample {
            sample_rate_hz.map(|rate| value / f64::from(rate))
        } else {
            Some(value)
        }
    }
}
