//! Noise of a channel as an autoregression, and the filter that makes it white.
//!
//! # Design
//! The quiet codes before a trigger are few, so the noise is described by few numbers: its variance and up to
//! [`MOST_LAGS`] coefficients, as many as Schwarz's criterion justifies (Box and Jenkins, *Time Series
//! Analysis*, 3.2). The autocovariances of all quiet stretches of a channel are pooled. Levinson's recursion
//! gives predictors of every shorter order too, so the first samples of a stretch are whitened as well as
//! the others, and nothing is lost.
//!
//! Rounding to codes is noise of variance 1/12 while a signal moves. In the quiet, with noise below a code,
//! that variance depends on where the zero is between two codes: codes may even stand still. So the fit
//! finds the variance before rounding that explains the variance of the codes at their means, and adds the
//! rounding of a moving signal.

use statrs::function::erf::erfc;

/// Most coefficients of an autoregression.
pub const MOST_LAGS: usize = 4;

/// Classes of the distance of a mean from the nearest code.
const OFFSETS: usize = 25;
/// Noise in codes above which rounding does not depend on the zero.
const MUCH: f64 = 1.0;

/// Autocovariances of quiet stretches.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct QuietSums {
    /// Sum of products at each lag, and their number.
    products: [f64; MOST_LAGS + 1],
    counts: [f64; MOST_LAGS + 1],
    /// Number of samples, less one for each mean.
    free: f64,
    /// Samples by the distance of their stretch's mean from the nearest code: from 0 to half a code.
    offsets: [f64; OFFSETS],
}

impl QuietSums {
    /// Adds a stretch of quiet samples with codes of size `step`. A stretch of at most two samples per lag
    /// adds nothing.
    pub fn add(&mut self, quiet: &[f64], step: f64) {
        if quiet.len() <= 2 * MOST_LAGS {
            return;
        }
        let count = quiet.len() as f64;
        let mean = quiet.iter().sum::<f64>() / count;
        for lag in 0..=MOST_LAGS {
            let pairs = quiet.iter().zip(&quiet[lag..]);
            self.products[lag] += pairs.map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>();
            self.counts[lag] += count - lag as f64;
        }
        self.free += count - 1.0;
        if step > 0.0 {
            // All samples are whole codes apart.
            let mean_in_codes = (mean - quiet[0]) / step;
            let offset = (mean_in_codes - mean_in_codes.round()).abs();
            let class = (offset * 2.0 * OFFSETS as f64) as usize;
            self.offsets[class.min(OFFSETS - 1)] += count;
        }
    }

    /// Adds the sums of another.
    pub fn merge(&mut self, other: &Self) {
        for lag in 0..=MOST_LAGS {
            self.products[lag] += other.products[lag];
            self.counts[lag] += other.counts[lag];
        }
        self.free += other.free;
        for (own, other) in self.offsets.iter_mut().zip(other.offsets) {
            *own += other;
        }
    }

    /// Variance of a moving signal's codes, given that of quiet ones; both in squares of a code.
    fn while_moving(&self, quiet: f64) -> f64 {
        const ROUNDING: f64 = 1.0 / 12.0;
        if quiet > MUCH * MUCH {
            return quiet;
        }
        if quiet <= 0.0 {
            return ROUNDING;
        }
        let expected = |deviation: f64| {
            let (mut sum, mut counts) = (0.0, 0.0);
            for (class, count) in self.offsets.iter().enumerate().filter(|(_, count)| **count > 0.0) {
                let mean = (class as f64 + 0.5) / (2.0 * OFFSETS as f64);
                sum += count * rounded(mean, deviation);
                counts += count;
            }
            if counts > 0.0 { sum / counts } else { 0.0 }
        };
        let (mut low, mut high) = (1e-3, 1.5 * MUCH);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if expected(middle) < quiet {
                low = middle;
            } else {
                high = middle;
            }
        }
        low * low + ROUNDING
    }

    /// The autoregression. `step` is one code in the unit of the samples: the variance is at least that of
    /// rounding, step²/12. `None` without quiet samples.
    pub fn fit(&self, step: f64) -> Option<Noise> {
        let count = self.counts[0];
        if count < 2.0 {
            return None;
        }
        // A mean estimated from the same samples lowers each lag by about variance/n.
        let bias = self.products[0] / self.free / count * (count - self.free);
        let mut covariance = [0.0; MOST_LAGS + 1];
        for ((covariance, products), counts) in covariance.iter_mut().zip(self.products).zip(self.counts) {
            *covariance = products / counts + bias;
        }
        let rounding = step * step / 12.0;
        if step > 0.0 {
            covariance[0] = step * step * self.while_moving(covariance[0] / (step * step));
        }
        if covariance[0] <= rounding {
            return Some(Noise {
                predictors: vec![Vec::new()],
                variances: vec![rounding],
                free: self.free,
            });
        }
        let mut noise = Noise {
            predictors: vec![Vec::new()],
            variances: vec![covariance[0]],
            free: self.free,
        };
        let mut best = (count * covariance[0].ln(), 0);
        for order in 1..=MOST_LAGS {
            let (before, variance) = (&noise.predictors[order - 1], noise.variances[order - 1]);
            let known: f64 = (1..order)
                .map(|lag| before[lag - 1] * covariance[order - lag])
                .sum();
            let reflection = (covariance[order] - known) / variance;
            if reflection.is_nan() || reflection.abs() >= 0.999 {
                break;
            }
            let mut predictor: Vec<f64> = (1..order)
                .map(|lag| before[lag - 1] - reflection * before[order - lag - 1])
                .collect();
            predictor.push(reflection);
            let variance = variance * (1.0 - reflection * reflection);
            noise.predictors.push(predictor);
            noise.variances.push(variance);
            let criterion = count * variance.ln() + count.ln() * order as f64;
            if criterion < best.0 {
                best = (criterion, order);
            }
        }
        noise.predictors.truncate(best.1 + 1);
        noise.variances.truncate(best.1 + 1);
        Some(noise)
    }
}

/// Variance of codes whose mean is `mean`, of normal noise with this standard deviation; all in codes.
fn rounded(mean: f64, deviation: f64) -> f64 {
    let above = |edge: f64| 0.5 * erfc(edge / deviation / std::f64::consts::SQRT_2);
    let moments = |centre: f64| {
        let reach = (5.0 * deviation).ceil() as i32 + 1;
        let (mut first, mut second) = (0.0, 0.0);
        for code in -reach..=reach + 1 {
            let code = f64::from(code);
            let part = above(code - 0.5 - centre) - above(code + 0.5 - centre);
            first += code * part;
            second += code * code * part;
        }
        (first, second)
    };
    // Find the centre of the noise for which the mean of its codes is `mean`.
    let (mut low, mut high) = (mean - 0.5, mean + 0.5);
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        if moments(middle).0 < mean {
            low = middle;
        } else {
            high = middle;
        }
    }
    let (first, second) = moments(low);
    second - first * first
}

/// An autoregression of noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Noise {
    /// Coefficients of the best predictor of each order, from 0 lags. The coefficient of the preceding
    /// sample comes first.
    predictors: Vec<Vec<f64>>,
    /// Variance that each predictor leaves.
    variances: Vec<f64>,
    /// Degrees of freedom of the variance.
    free: f64,
}

impl Noise {
    /// White noise of a known standard deviation.
    pub fn white(deviation: f64) -> Self {
        Self {
            predictors: vec![Vec::new()],
            variances: vec![deviation * deviation],
            free: f64::INFINITY,
        }
    }

    /// Standard deviation of a sample.
    pub fn deviation(&self) -> f64 {
        self.variances[0].sqrt()
    }

    /// Number of lags.
    pub fn order(&self) -> usize {
        self.predictors.len() - 1
    }

    /// Degrees of freedom of the variance.
    pub fn free(&self) -> f64 {
        self.free
    }

    /// Replaces the samples of a gapless stretch by their prediction errors over their standard deviations.
    /// Noise of this kind becomes white noise of variance 1.
    pub fn whiten(&self, samples: &mut [f64]) {
        for at in (0..samples.len()).rev() {
            let order = at.min(self.order());
            let predicted: f64 = self.predictors[order]
                .iter()
                .enumerate()
                .map(|(lag, weight)| weight * samples[at - 1 - lag])
                .sum();
            samples[at] = (samples[at] - predicted) / self.variances[order].sqrt();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// White noise, and what it becomes behind y[n] = 0.6 y[n-1] - 0.3 y[n-2] + e[n].
    fn noises(count: usize, seed: u64) -> [Vec<f64>; 2] {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = || -> f64 { StandardNormal.sample(&mut random) };
        let white: Vec<f64> = (0..count + 50).map(|_| draw()).collect();
        let mut coloured = vec![0.0; count + 50];
        for n in 2..coloured.len() {
            coloured[n] = 0.6 * coloured[n - 1] - 0.3 * coloured[n - 2] + white[n];
        }
        [white[50..].to_vec(), coloured[50..].to_vec()]
    }

    fn fitted(of: usize) -> Noise {
        let mut sums = QuietSums::default();
        for seed in 0..40 {
            sums.add(&noises(128, seed)[of], 0.0);
        }
        sums.fit(0.0).unwrap()
    }

    #[test]
    fn coloured_noise_becomes_white_of_variance_one_and_white_noise_stays() {
        let (white, coloured) = (fitted(0), fitted(1));
        assert!((white.deviation() - 1.0).abs() < 0.03, "{white:?}");
        assert!(coloured.order() >= 2, "{coloured:?}");
        let [first, second] = coloured.predictors[2][..] else {
            panic!("{coloured:?}")
        };
        // Each coefficient is known to 1/√5000.
        assert!(
            (first - 0.6).abs() < 0.05 && (second + 0.3).abs() < 0.05,
            "{coloured:?}"
        );
        // After the filter, neighbours are uncorrelated: within 4/√20 000 for 20 000 samples.
        let mut samples = noises(20_000, 99)[1].clone();
        coloured.whiten(&mut samples);
        let products = |lag: usize| {
            let pairs = samples.iter().zip(&samples[lag..]);
            pairs.map(|(a, b)| a * b).sum::<f64>() / 20_000.0
        };
        assert!((products(0) - 1.0).abs() < 0.05, "{}", products(0));
        for lag in 1..6 {
            assert!(products(lag).abs() < 0.035, "{lag}: {}", products(lag));
        }
    }

    #[test]
    fn the_first_samples_of_short_stretches_have_variance_one_too() {
        let noise = fitted(1);
        let (mut squares, mut count) = ([0.0; 3], 0.0);
        let all = noises(60_000, 5)[1].clone();
        for stretch in all.chunks_exact(20) {
            let mut three = stretch[..3].to_vec();
            noise.whiten(&mut three);
            for (sum, value) in squares.iter_mut().zip(three) {
                *sum += value * value;
            }
            count += 1.0;
        }
        for square in squares {
            assert!((square / count - 1.0).abs() < 0.1, "{}", square / count);
        }
    }

    #[test]
    fn noise_is_that_of_a_moving_signal_wherever_the_zero_lies_between_codes() {
        for (deviation, zero) in [(0.41, 0.0), (0.41, 0.5), (0.3, 0.25), (0.6, 0.1), (1.3, 0.5)] {
            let (mut sums, mut squares) = (QuietSums::default(), 0.0);
            for seed in 0..200 {
                let white = &noises(128, seed)[0];
                let codes: Vec<f64> = white
                    .iter()
                    .map(|one| 2.0 * (deviation * one + zero).round())
                    .collect();
                sums.add(&codes, 2.0);
                // A ramp over many codes.
                let ramp = white.iter().enumerate().map(|(n, one)| {
                    let exact = 0.377 * n as f64;
                    (2.0 * ((exact + deviation * one).round() - exact)).powi(2)
                });
                squares += ramp.sum::<f64>();
            }
            let moving = (squares / 200.0 / 128.0).sqrt();
            let noise = sums.fit(2.0).unwrap();
            println!("{deviation} codes at {zero}: {} and {moving}", noise.deviation());
            // 25 600 samples know it to half a per cent, and a class of offsets is a fiftieth of a code.
            assert!(
                (noise.deviation() / moving - 1.0).abs() < 0.02,
                "{deviation} {zero}"
            );
            assert_eq!(noise.order(), 0);
        }
    }

    #[test]
    fn codes_that_stand_still_have_the_noise_of_their_rounding() {
        let mut sums = QuietSums::default();
        sums.add(&[3.0; 64], 0.5);
        let noise = sums.fit(0.5).unwrap();
        assert!((noise.deviation() - 0.5 / 12_f64.sqrt()).abs() < 1e-12);
        assert_eq!(QuietSums::default().fit(0.5), None);
    }
}
