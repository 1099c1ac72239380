//! The amplitude and the frequency of a tone in samples that may have gaps: the four-parameter sine fit of
//! IEEE Std 1057, 4.1.4.2.

use hertz_chain::{Signal, Spectrum};
use nalgebra::{Matrix4, Vector4};

/// Greatest number of samples for the search for the frequency.
const SEARCHED: usize = 1 << 14;
/// Greatest number of steps of a fit, and the relative change of the frequency that ends it.
const STEPS: usize = 40;
const SETTLED: f64 = 1e-13;
/// Periods of the first stretch that is fitted, and the factor by which it grows until it has all samples.
const FIRST_PERIODS: f64 = 20.0;
const GROWS: f64 = 4.0;
/// Least number of samples.
const FEWEST: usize = 32;

/// A tone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tone {
    /// Frequency, Hz.
    pub(crate) frequency: f64,
    /// Amplitude rms, in the unit of the samples.
    pub(crate) rms: f64,
    /// Rms of the samples without the tone.
    pub(crate) rest: f64,
}

/// Fits a tone to samples: times in s, ascending, and values. Without a start frequency, the fit begins at
/// the strongest line in the spectrum of the first gapless stretch.
///
/// # Errors
/// One line: too few samples, or no tone among them.
pub(crate) fn fit(samples: &[(f64, f64)], near: Option<f64>) -> Result<Tone, String> {
    if samples.len() < FEWEST {
        return Err(format!(
            "{} samples are too few for a tone; record at least {FEWEST}",
            samples.len()
        ));
    }
    let mut frequency = match near {
        Some(near) => near,
        None => strongest(samples)?,
    };
    let begin = samples[0].0;
    let mut stretch = FIRST_PERIODS / frequency;
    loop {
        let end = samples.partition_point(|(time, _)| time - begin <= stretch);
        let taken = &samples[..end];
        if taken.len() >= FEWEST {
            let tone = refine(taken, frequency)?;
            frequency = tone.frequency;
            if end == samples.len() {
                return Ok(tone);
            }
        }
        stretch *= GROWS;
    }
}

/// The strongest frequency above 0 of the samples up to the first gap.
fn strongest(samples: &[(f64, f64)]) -> Result<f64, String> {
    let interval = samples[1].0 - samples[0].0;
    let is_even = |pair: &&[(f64, f64)]| (pair[1].0 - pair[0].0 - interval).abs() < 0.01 * interval;
    let even = samples.windows(2).take_while(is_even).take(SEARCHED).count() + 1;
    if even < FEWEST || interval <= 0.0 {
        return Err("fewer than 32 samples are evenly spaced; give a record without gaps".to_owned());
    }
    let mean = samples[..even].iter().map(|(_, value)| value).sum::<f64>() / even as f64;
    let signal = Signal {
        start: 0.0,
        interval,
        values: samples[..even].iter().map(|(_, value)| value - mean).collect(),
    };
    let spectrum = Spectrum::of(&signal);
    let highest = spectrum.magnitudes().skip(1).max_by(|a, b| a.1.total_cmp(&b.1));
    let frequency = highest.map_or(0.0, |(frequency, _)| frequency);
    if frequency * interval * even as f64 > 2.0 {
        return Ok(frequency);
    }
    Err("there is no tone with more than two periods in the record".to_owned())
}

/// Fits amplitude, phase, offset and frequency. The start frequency must be right within a quarter of a
/// period over the samples.
fn refine(samples: &[(f64, f64)], mut frequency: f64) -> Result<Tone, String> {
    let middle = 0.5 * (samples[0].0 + samples[samples.len() - 1].0);
    let lost = || "the fit of a tone does not converge; is it one steady tone?".to_owned();
    let mut amplitudes = [0.0; 2];
    for step in 0..STEPS {
        let omega = std::f64::consts::TAU * frequency;
        let (mut information, mut right) = (Matrix4::zeros(), Vector4::zeros());
        for (time, value) in samples {
            let since = time - middle;
            let (sin, cos) = (omega * since).sin_cos();
            let slope = since * (amplitudes[1] * cos - amplitudes[0] * sin);
            let row = Vector4::new(cos, sin, 1.0, slope);
            information += row * row.transpose();
            right += row * *value;
        }
        // In the first step the amplitude is still unknown, so the frequency cannot be fitted.
        if step == 0 {
            information[(3, 3)] = 1.0;
        }
        let solved = information.cholesky().ok_or_else(lost)?.solve(&right);
        amplitudes = [solved[0], solved[1]];
        let change = solved[3] / std::f64::consts::TAU;
        frequency += change;
        if !(frequency.is_finite() && frequency > 0.0) {
            return Err(lost());
        }
        if step > 0 && change.abs() <= SETTLED * frequency {
            break;
        }
    }
    let omega = std::f64::consts::TAU * frequency;
    let left = |offset: f64, (time, value): &(f64, f64)| {
        let (sin, cos) = (omega * (time - middle)).sin_cos();
        value - offset - amplitudes[0] * cos - amplitudes[1] * sin
    };
    let count = samples.len() as f64;
    let offset = samples.iter().map(|sample| left(0.0, sample)).sum::<f64>() / count;
    let squares: f64 = samples.iter().map(|sample| left(offset, sample).powi(2)).sum();
    Ok(Tone {
        frequency,
        rms: amplitudes[0].hypot(amplitudes[1]) * std::f64::consts::FRAC_1_SQRT_2,
        rest: (squares / (count - 4.0)).sqrt(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tone_is_found_in_noise_with_gaps_and_its_uncertainty_is_its_scatter() {
        let (mut pull, repeats) = (0.0, 200);
        let mut state = 1_u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        for repeat in 0..repeats {
            let (frequency, phase) = (1234.5 * (1.0 + 4e-5 * uniform()), f64::from(repeat));
            let sample = |at: u32, noise: f64| {
                let time = f64::from(at) * 1e-5;
                let wave = 3.0 * (std::f64::consts::TAU * frequency * time + phase).sin();
                (time, 7.0 + wave + noise)
            };
            // Every second run of 100 samples is lost.
            let kept = (0..40_000).filter(|at| at / 100 % 2 == 0);
            let mut noise = || (0..12).map(|_| uniform() - 0.5).sum::<f64>();
            let samples: Vec<_> = kept.map(|at| sample(at, noise())).collect();
            let found = fit(&samples, Some(1234.5)).unwrap();
            // Five times √6 σ/(π T A √N) (Rife and Boorstyn 1974).
            assert!((found.frequency - frequency).abs() < 0.025, "{found:?}");
            assert!((found.rest - 1.0).abs() < 0.02, "{found:?}");
            // The amplitude is known to σ √(2/N), the rms to 1/√2 of that.
            let rms_u = found.rest / (samples.len() as f64).sqrt();
            pull += ((found.rms - 3.0 / 2.0_f64.sqrt()) / rms_u).powi(2);
        }
        let pull = pull / f64::from(repeats);
        // The variance of 200 squares is 2/200.
        assert!((pull - 1.0).abs() < 4.0 * 0.1, "{pull}");
    }

    #[test]
    fn the_frequency_of_a_record_without_gaps_is_searched_and_a_record_without_a_tone_is_refused() {
        let samples: Vec<_> = (0..100_000)
            .map(|at| f64::from(at) * 2e-5)
            .map(|time| (time, (std::f64::consts::TAU * 4001.3 * time).cos() - 0.5))
            .collect();
        let found = fit(&samples, None).unwrap();
        assert!(
            (found.frequency - 4001.3).abs() < 1e-6 && (found.rms - 0.5_f64.sqrt()).abs() < 1e-9,
            "{found:?}"
        );
        let flat: Vec<_> = samples.iter().map(|(time, _)| (*time, 1.0)).collect();
        assert!(fit(&flat, None).is_err());
        assert!(fit(&samples[..20], None).unwrap_err().contains("too few"));
    }
}
