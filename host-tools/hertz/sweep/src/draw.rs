//! Points of a cube, drawn at random or spread evenly.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A method to draw points. A point depends only on its number and the seed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Independent points.
    Random,
    /// Low discrepancy: the R sequence, xᵢ = (s + i a) mod 1 with aⱼ = φ^-(j+1) and φ the positive root of
    /// φ^(d+1) = φ + 1 (M. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018). Its
    /// error falls about as 1/n, and any number of points will do.
    Quasirandom,
}

/// A coordinate of a point, 0 to 1, in a cube of `dimensions`.
pub fn coordinate(method: Method, seed: u64, point: u64, dimension: usize, dimensions: usize) -> f64 {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let bits = match method {
        Method::Random => {
            // Two words for each coordinate.
            let place = u128::from(point) * dimensions as u128 + dimension as u128;
            random.set_word_pos(2 * place);
            random.next_u64()
        }
        Method::Quasirandom => {
            random.set_word_pos(2 * dimension as u128);
            // Seed 0 starts in the middle, as Roberts does; others elsewhere.
            let start = if seed == 0 { 1 << 63 } else { random.next_u64() };
            let a = ratio(dimensions).powi(-(dimension as i32 + 1));
            // In units of 2^-64, where nothing is lost by wrapping.
            let step = (a * 2.0_f64.powi(64)) as u64;
            step.wrapping_mul(point).wrapping_add(start)
        }
    };
    (bits >> 11) as f64 * 2.0_f64.powi(-53)
}

/// φ of a number of dimensions.
fn ratio(dimensions: usize) -> f64 {
    let mut x = 2.0_f64;
    for _ in 0..64 {
        x = (1.0 + x).powf(1.0 / (dimensions as f64 + 1.0));
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ratios_are_those_of_the_source() {
        for (dimensions, value) in [
            (1, 1.618_033_988_75),
            (2, 1.324_717_957_24),
            (3, 1.220_744_084_61),
        ] {
            assert!((ratio(dimensions) - value).abs() < 1e-10);
        }
    }

    #[test]
    fn quasirandom_points_integrate_better_than_random_ones() {
        // The mean of x y over the unit square is 1/4.
        let error = |method| {
            let product = |i| coordinate(method, 5, i, 0, 2) * coordinate(method, 5, i, 1, 2);
            ((0..4096).map(product).sum::<f64>() / 4096.0 - 0.25).abs()
        };
        let (random, even) = (error(Method::Random), error(Method::Quasirandom));
        assert!(random < 0.01 && even < 5e-4, "{random:e} {even:e}");
    }

    #[test]
    fn a_seed_gives_other_points_and_the_same_again() {
        for method in [Method::Random, Method::Quasirandom] {
            let of = |seed| [0, 1, 2, 1000].map(|i| coordinate(method, seed, i, 1, 3));
            assert_eq!(of(1), of(1));
            assert!(of(1).iter().zip(of(2)).all(|(one, other)| *one != other));
            assert!(of(1).iter().all(|x| (0.0..1.0).contains(x)));
        }
    }
}
