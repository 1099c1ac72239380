//! Fits stiffness and damping of an oscillator to a swept response or to a ring-down.

use std::f64::consts::TAU;

use realfft::num_complex::Complex64;

use crate::fit::{FitError, least_squares};
use crate::oscillator::Oscillator;
use crate::signal::Signal;
use crate::spectrum::Spectrum;

/// A fitted oscillator, with standard errors from the scatter of the points.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct OscillatorFit {
    /// Stiffness k, N/m.
    pub stiffness: f64,
    /// Standard error of k, N/m.
    pub stiffness_error: f64,
    /// Damping c, N·s/m.
    pub damping: f64,
    /// Standard error of c, N·s/m.
    pub damping_error: f64,
    /// Correlation of both errors, from -1 to 1.
    pub correlation: f64,
    /// Root mean square distance of the points from the fit, in their unit.
    pub residual: f64,
}

fn positive(what: &str, value: f64) -> Result<(), FitError> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(FitError::Value {
        what: format!("{what} {value}"),
        advice: "a positive number",
    })
}

/// Fits k and c of a mass in kg to points (frequency in Hz, |h|) of a swept response. All points have the
/// same weight. They should include the peak.
///
/// # Errors
/// [`FitError`]: there are fewer than three points, a point or the mass is not a positive number, or the
/// points have no resonance.
pub fn fit_response(points: &[(f64, f64)], mass: f64) -> Result<OscillatorFit, FitError> {
    positive("the mass", mass)?;
    for (frequency, magnitude) in points {
        positive("the frequency", *frequency)?;
        positive("the magnitude", *magnitude)?;
    }
    let Some(peak) = points.iter().max_by(|a, b| a.1.total_cmp(&b.1)) else {
        return Err(FitError::TooFew { got: 0, need: 3 });
    };
    // At the peak of a light damper: h² = 1 + 1/4ζ².
    let omega = TAU * peak.0;
    let ratio = 0.5 / (peak.1 * peak.1 - 1.0).max(0.1).sqrt();
    let guess = [(mass * omega * omega).ln(), (2.0 * ratio * mass * omega).ln()];
    // Logarithms keep both positive.
    let found = least_squares(points.len(), guess, |parameters, i| {
        let (frequency, measured) = points[i];
        let oscillator = Oscillator::new(mass, parameters[0].exp(), parameters[1].exp());
        let omega = TAU * frequency;
        let inertia = mass * omega * omega;
        let h = oscillator.transmissibility(frequency);
        let lower = Complex64::new(oscillator.stiffness - inertia, omega * oscillator.damping);
        let by_coupling = -inertia / (lower * lower);
        let along = |change: Complex64| (h.conj() * change).re / h.norm();
        let derivatives = [
            along(by_coupling * oscillator.stiffness),
            along(by_coupling * Complex64::new(0.0, omega * oscillator.damping)),
        ];
        (h.norm() - measured, derivatives)
    })?;
    let (stiffness, damping) = (found.parameters[0].exp(), found.parameters[1].exp());
    Ok(OscillatorFit {
        stiffness,
        stiffness_error: stiffness * found.covariance[0][0].sqrt(),
        damping,
        damping_error: damping * found.covariance[1][1].sqrt(),
        correlation: correlation(
            found.covariance[0][1],
            found.covariance[0][0],
            found.covariance[1][1],
        ),
        residual: found.residual,
    })
}

/// A correlation from a covariance and both variances; 0 where one of these is 0.
fn correlation(covariance: f64, one: f64, other: f64) -> f64 {
    let size = (one * other).sqrt();
    if size > 0.0 {
        (covariance / size).clamp(-1.0, 1.0)
    } else {
        0.0
    }
}

/// Fits k and c to the ring-down of an underdamped mass. The model exp(-βt) (A cos ωt + B sin ωt) is fitted
/// to a signal of the mass's acceleration or of its motion in the host; then k = μ (ω² + β²) and c = 2 μ β.
///
/// `mass` is the reduced mass μ, kg: m (M - m) / M in a host that is free, m in one that is held. The signal
/// should last a few times longer than the ringing, and nothing else should act on the host meanwhile.
///
/// # Errors
/// [`FitError`]: there are fewer than five values, a value or the mass is not a number, or the
/// signal does not ring.
pub fn fit_ring_down(signal: &Signal, mass: f64) -> Result<OscillatorFit, FitError> {
    positive("the mass", mass)?;
    positive("the interval", signal.interval)?;
    let values = &signal.values;
    let got = values.len();
    if got < 5 {
        return Err(FitError::TooFew { got, need: 5 });
    }
    if let Some(value) = values.iter().find(|value| !value.is_finite()) {
        return Err(FitError::Value {
            what: format!("the value {value}"),
            advice: "finite numbers",
        });
    }
    let time = |i: usize| signal.interval * i as f64;
    let energy: f64 = values.iter().map(|value| value * value).sum();
    let timed = values.iter().enumerate();
    let moment: f64 = timed.map(|(i, value)| time(i) * value * value).sum();
    if moment == 0.0 {
        return Err(FitError::NoEnd);
    }
    // An energy that falls as exp(-2βt) has its mean time at 1/2β.
    let beta = 0.5 * energy / moment;
    let (frequency, _) = Spectrum::of(signal)
        .magnitudes()
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .ok_or(FitError::NoEnd)?;
    let omega = TAU * frequency;
    positive("the strongest frequency", omega)?;
    let waves = |omega: f64, beta: f64, t: f64| {
        let (sin, cos) = (omega * t).sin_cos();
        [cos, sin].map(|wave| wave * (-beta * t).exp())
    };
    // A and B for this ω and β: they are linear, and follow from two normal equations.
    let (mut cos_cos, mut cos_sin, mut sin_sin) = (0.0, 0.0, 0.0);
    let (mut right_cos, mut right_sin) = (0.0, 0.0);
    for (i, value) in values.iter().enumerate() {
        let [cos, sin] = waves(omega, beta, time(i));
        cos_cos += cos * cos;
        cos_sin += cos * sin;
        sin_sin += sin * sin;
        right_cos += cos * value;
        right_sin += sin * value;
    }
    let determinant = cos_cos * sin_sin - cos_sin * cos_sin;
    if determinant <= 0.0 {
        return Err(FitError::NoEnd);
    }
    let start = [
        (right_cos * sin_sin - right_sin * cos_sin) / determinant,
        (right_sin * cos_cos - right_cos * cos_sin) / determinant,
    ];

    let guess = [omega.ln(), beta.ln(), start[0], start[1]];
    let found = least_squares(values.len(), guess, |parameters, i| {
        let (omega, beta, t) = (parameters[0].exp(), parameters[1].exp(), time(i));
        let wave = waves(omega, beta, t);
        let value = parameters[2] * wave[0] + parameters[3] * wave[1];
        let turned = parameters[3] * wave[0] - parameters[2] * wave[1];
        let derivatives = [omega * t * turned, -beta * t * value, wave[0], wave[1]];
        (value - values[i], derivatives)
    })?;
    let (omega, beta) = (found.parameters[0].exp(), found.parameters[1].exp());
    let (by_omega, by_beta) = (2.0 * mass * omega * omega, 2.0 * mass * beta * beta);
    let covariance = found.covariance;
    let variance = by_omega * by_omega * covariance[0][0]
        + 2.0 * by_omega * by_beta * covariance[0][1]
        + by_beta * by_beta * covariance[1][1];
    let damping = 2.0 * mass * beta;
    Ok(OscillatorFit {
        stiffness: mass * (omega * omega + beta * beta),
        stiffness_error: variance.sqrt(),
        damping,
        damping_error: damping * covariance[1][1].sqrt(),
        correlation: correlation(
            damping * (by_omega * covariance[0][1] + by_beta * covariance[1][1]),
            variance,
            damping * damping * covariance[1][1],
        ),
        residual: found.residual,
    })
}
