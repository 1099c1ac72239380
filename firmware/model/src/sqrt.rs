//! Square root of an overlap, the one function of Hertz's law that fixed point has to make.
//!
//! `1/√v` by Newton's iteration from a table of 48 entries, then `√v = v·(1/√v)`: no division, no loop, the
//! same number of instructions for every argument.

use crate::quantity::Length;
use fixed::types::I12F20;

/// Square root of a [`Length`], √µm.
pub type SqrtLength = I12F20;

/// `2^14/√((i + 1/2)/64)` for i = 16..64: the start of the iteration, within 1.6 %.
const START: [u16; 48] = start_table();

const fn start_table() -> [u16; 48] {
    let mut table = [0; 48];
    let mut i = 0;
    while i < 48 {
        // 2^14/√((2i + 33)/128) = √(2^35/(2i + 33))
        table[i] = (1u64 << 35).div_euclid(2 * i as u64 + 33).isqrt() as u16;
        i += 1;
    }
    table
}

/// `√length` for `length > 0`; 0 for anything else. Relative error below 4e-7 plus one unit of 2^-20 √µm.
#[inline(always)]
pub fn sqrt(length: Length) -> SqrtLength {
    let bits = length.to_bits();
    if bits <= 0 {
        return SqrtLength::ZERO;
    }
    let bits = bits as u32;
    // Normalise by an even shift to v = m/2^32 in [1/4, 1).
    let shift = bits.leading_zeros() & !1;
    let m = bits << shift;
    // y in Q30 approaches 1/√v in (1, 2].
    let mut y = u32::from(START[(m >> 26) as usize - 16]) << 16;
    y = newton(m, y);
    y = newton(m, y);
    let root = high(m, y); // √v in Q30
    // length = v·2^(32-shift)·2^-20 µm, so its root is √v·2^(6 - shift/2) √µm.
    SqrtLength::from_bits((root >> (4 + shift / 2)) as i32)
}

/// One step of `y ← y·(3 - v·y²)/2`, y in Q30.
///
/// It never overshoots 1/√v, whatever y is (3y - vy³ is highest there), so it stays at or below 2.
#[inline(always)]
fn newton(m: u32, y: u32) -> u32 {
    let y_squared = high(y, y); // Q28
    let error = (3 << 28) - high(m, y_squared); // 3 - v·y², Q28
    ((u64::from(y) * u64::from(error)) >> 29) as u32
}

/// The upper half of a product of two unsigned 32-bit numbers.
#[inline(always)]
fn high(a: u32, b: u32) -> u32 {
    ((u64::from(a) * u64::from(b)) >> 32) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn square_root_is_within_its_stated_error_over_the_whole_range() {
        let mut worst = 0.0f64;
        let mut bits = 1i32;
        while bits < i32::MAX - (bits / 997 + 1) {
            let exact = Length::from_bits(bits).to_num::<f64>().sqrt();
            let error = (sqrt(Length::from_bits(bits)).to_num::<f64>() - exact).abs();
            let unit = 1.0 / f64::from(1 << 20);
            worst = worst.max((error - unit) / exact);
            bits += bits / 997 + 1;
        }
        println!("worst relative error beyond one unit: {worst:.2e}");
        assert!(worst < 4e-7, "{worst:e}");
    }

    #[test]
    fn nothing_and_less_has_the_root_zero() {
        assert_eq!(sqrt(Length::ZERO), SqrtLength::ZERO);
        assert_eq!(sqrt(Length::MIN), SqrtLength::ZERO);
    }
}
