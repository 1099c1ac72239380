//! Propagation of distributions: draws of all inputs through the bead's code (JCGM 101).

use bead_model::Scan;
use bead_model::design::Uncertainty;
use bead_model::energy_uncertainty::ESTIMATOR;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal, Uniform};
use rayon::prelude::*;
use serde::Serialize;

use crate::budget::combined::Combined;
use crate::budget::draw::drawn_settings;
use crate::budget::noise::{ChannelNoise, codes, scan};
use crate::budget::run::{Rerun, derived};
use crate::error::CompareError;
use crate::front_end::CODES;
use crate::spread::RunningMean;

/// The draws are the same in every run.
const SEED: u64 = 1;
/// Part of the draws below the coverage interval, and above it.
const TAIL: f64 = 0.025;

/// A result by draws.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Drawn {
    /// Mean of the draws, J.
    pub mean: f64,
    /// Their standard deviation, J.
    pub u: f64,
    /// Lower end of the coverage interval of 95 % that is symmetric in probability, J.
    pub low: f64,
    /// Upper end, J.
    pub high: f64,
    /// Significant digits of u, 2 or 1, to which the ends of the linear budget's interval are those of the
    /// draws (JCGM 101, 7.9.2 and 8.1); none if they are not to one.
    pub agrees_to_digits: Option<u8>,
}

/// The results by draws.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct MonteCarlo {
    /// Number of draws.
    pub draws: u32,
    /// A.
    pub measured: Drawn,
    /// B.
    pub predicted: Drawn,
    /// A − B.
    pub difference: Drawn,
}

impl MonteCarlo {
    /// Judges the linear budget of A, B and A − B by the draws.
    pub(super) fn judged(mut self, linear: [&Combined; 3]) -> Self {
        let drawn = [&mut self.measured, &mut self.predicted, &mut self.difference];
        for (drawn, linear) in drawn.into_iter().zip(linear) {
            let [low, high] = [linear.value - linear.expanded, linear.value + linear.expanded];
            let off = (low - drawn.low).abs().max((high - drawn.high).abs());
            drawn.agrees_to_digits = [2, 1]
                .into_iter()
                .find(|digits| off <= tolerance(linear.u, *digits));
        }
        self
    }
}

/// Numerical tolerance of a standard uncertainty: half of its last significant digit (JCGM 101, 7.9.2).
fn tolerance(u: f64, digits: u8) -> f64 {
    0.5 * 10_f64.powf(u.log10().floor() + 1.0 - f64::from(digits))
}

/// Draws the inputs `draws` times. The draws are the same on every machine.
///
/// # Errors
/// Fewer than 1000 draws, or one that no bead can have.
pub(super) fn draw(
    rerun: &Rerun<'_>,
    stated: &Uncertainty,
    channels: &[ChannelNoise],
    draws: u32,
) -> Result<MonteCarlo, CompareError> {
    let codes = codes(rerun);
    let one = |number: u32| -> Result<[f64; 3], CompareError> {
        let mut random = ChaCha8Rng::seed_from_u64(SEED);
        random.set_stream(number.into());
        let description = drawn_settings(&rerun.description, stated, &mut random);
        let scans: Vec<Scan> = codes
            .iter()
            .map(|codes| noisy(*codes, channels, &mut random))
            .collect();
        let [a, b] = rerun.energies(&derived(&description)?, &scans);
        let within = Uniform::new(-1.0, 1.0).expect("a range");
        let mut estimator = |energy: f64, most: f64| energy * (1.0 + most * within.sample(&mut random));
        let (a, b) = (estimator(a, ESTIMATOR[0]), estimator(b, ESTIMATOR[1]));
        Ok([a, b, a - b])
    };
    let drawn: Vec<[f64; 3]> = (0..draws).into_par_iter().map(one).collect::<Result<_, _>>()?;
    let of = |result: usize| {
        let mut values: Vec<f64> = drawn.iter().map(|results| results[result]).collect();
        values.sort_by(f64::total_cmp);
        let mut running = RunningMean::default();
        values.iter().for_each(|value| running.push(*value));
        let at = |part: f64| values[(part * (values.len() - 1) as f64).round() as usize];
        Drawn {
            mean: running.mean,
            u: running.scatter().unwrap_or(0.0),
            low: at(TAIL),
            high: at(1.0 - TAIL),
            agrees_to_digits: None,
        }
    };
    Ok(MonteCarlo {
        draws,
        measured: of(0),
        predicted: of(1),
        difference: of(2),
    })
}

/// A scan with additional noise on top of its own, in whole codes of the same variance.
fn noisy(mut codes: [Option<u16>; 4], channels: &[ChannelNoise], random: &mut ChaCha8Rng) -> Scan {
    for channel in channels {
        let Some(code) = &mut codes[channel.place] else {
            continue;
        };
        let variance = channel.codes * channel.codes;
        let normal: f64 = StandardNormal.sample(random);
        let step = if variance > 1.0 / 3.0 {
            // Rounding adds a twelfth.
            ((variance - 1.0 / 12.0).sqrt() * normal).round() as i32
        } else {
            // One up or down, each with half the variance as its probability.
            let part: f64 = Uniform::new(0.0, 1.0).expect("a range").sample(random);
            i32::from(part < variance / 2.0) - i32::from(part > 1.0 - variance / 2.0)
        };
        *code = (i32::from(*code) + step).clamp(0, i32::from(CODES) - 1) as u16;
    }
    scan(codes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tolerance_is_half_of_the_last_digit_of_an_uncertainty() {
        // The example of JCGM 101, 7.9.2: 0.035 g is 35 · 10^-3, and 7 V to one digit.
        for (u, digits, expected) in [(0.035, 2, 5e-4), (7.0, 1, 0.5), (0.000_35, 1, 5e-5)] {
            assert!((tolerance(u, digits) / expected - 1.0).abs() < 1e-12, "{u}");
        }
    }
}
