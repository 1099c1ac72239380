//! Square root of an overlap, for Hertz's law.
//!
//! The root is a straight line in each of 192 segments. There is no division and no loop, and every argument
//! takes the same number of instructions.

use crate::quantity::Length;
use fixed::types::I6F26;

/// Square root of a [`Length`], √µm.
pub type SqrtLength = I6F26;

/// `2^15 √m` as `offset + slope·m/2^32`.
#[derive(Clone, Copy)]
struct RootSegment {
    offset: u32,
    slope: u32,
}

/// RootSegment `i` is for `m >> 24 == i`. An even shift brings every argument to 2^30 or above, so the first
/// quarter is never used; with it, eight bits are an index.
static SEGMENTS: [RootSegment; 256] = segments();

const fn segments() -> [RootSegment; 256] {
    let mut segments = [RootSegment { offset: 0, slope: 0 }; 256];
    let mut i = 64;
    while i < 256 {
        let [start, middle, end] = [scaled_root(2 * i), scaled_root(2 * i + 1), scaled_root(2 * i + 2)];
        // The root lies above its chord, farthest in the middle. Half of that distance puts the line between
        // them.
        let bulge = middle - (start + end) / 2;
        segments[i as usize] = RootSegment {
            offset: (start + bulge / 2 - i * (end - start)) as u32,
            slope: ((end - start) << 8) as u32,
        };
        i += 1;
    }
    segments
}

/// `2^15 √m` for `m = 2^23 i`.
const fn scaled_root(i: u64) -> u64 {
    (i << 53).isqrt()
}

/// `√length` for `length > 0`. Relative error below 4e-6 plus two units of 2^-26 √µm.
#[inline(always)]
pub(crate) fn sqrt(length: Length) -> SqrtLength {
    let bits = length.to_bits() as u32;
    // √bits = √m·2^(-shift/2), and √(bits·2^-22) = √bits·2^15·2^-26.
    let shift = bits.leading_zeros() & !1;
    let m = bits.wrapping_shl(shift);
    let RootSegment { offset, slope } = SEGMENTS[(m >> 24) as usize];
    let root = offset + ((u64::from(slope) * u64::from(m)) >> 32) as u32;
    SqrtLength::from_bits((root >> (shift / 2)) as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative error of the root of `bits`, beyond two units.
    fn off(bits: i32) -> f64 {
        let exact = Length::from_bits(bits).to_num::<f64>().sqrt();
        let error = (sqrt(Length::from_bits(bits)).to_num::<f64>() - exact).abs();
        let unit = 1.0 / f64::from(1 << 26);
        (error - 2.0 * unit) / exact
    }

    /// A straight line is farthest from the root at its ends and near its middle.
    #[test]
    fn square_root_is_within_its_stated_error_where_each_segment_begins_turns_and_ends() {
        for segment in (64..256_u32).step_by(if cfg!(miri) { 7 } else { 1 }) {
            for shift in (0..=24).step_by(2) {
                for place in [0, 1, 0x7F_FFFF, 0x80_0000, 0x80_0001, 0xFF_FFFE, 0xFF_FFFF] {
                    let bits = ((segment << 24) + place) >> shift;
                    if let Ok(bits @ 1..) = i32::try_from(bits) {
                        assert!(off(bits) < 4e-6, "{bits}: {:e}", off(bits));
                    }
                }
            }
        }
    }

    #[test]
    #[ignore = "half a minute: cargo test --release -p bead-model --lib -- --ignored"]
    fn square_root_is_within_its_stated_error_for_every_length_there_is() {
        let worst = (1..=i32::MAX).fold(0.0, |worst, bits| f64::max(worst, off(bits)));
        println!("worst relative error beyond two units: {worst:.3e}");
        assert!(worst < 4e-6, "{worst:e}");
    }
}
