//! Spectra against the closed form of a Fourier transform.

use std::f64::consts::{PI, TAU};

use crate::common::near;
use hertz_chain::{Complex64, Signal, Spectrum};

/// A pulse 7 N high, of standard deviation 0.1 ms, at 1 ms.
#[test]
fn a_gaussian_pulse_has_its_transform_and_its_three_decibels() {
    const SPREAD: f64 = 1e-4;
    let impulse = 7.0 * SPREAD * TAU.sqrt();
    let value = |t: f64| 7.0 * (-0.5 * ((t - 1e-3) / SPREAD).powi(2)).exp();
    let spectrum = Spectrum::of(&Signal {
        start: 2e-4,
        interval: 1e-6,
        values: (0..1601).map(|i| value(2e-4 + 1e-6 * f64::from(i))).collect(),
    });
    let transform = |f: f64| {
        let size = impulse * (-2.0 * (PI * SPREAD * f).powi(2)).exp();
        Complex64::from_polar(size, -TAU * f * 1e-3)
    };
    let all = spectrum.values().iter().enumerate();
    let all = all.map(|(i, value)| (spectrum.step() * i as f64, *value));
    for (f, value) in all.chain([0.0, 123.4, 1777.7].map(|f| (f, spectrum.at(f)))) {
        // At eight standard deviations the stretch cuts off some 1e-14 of it.
        let error = (value - transform(f)).norm();
        assert!(error < 1e-13 * impulse, "{f} Hz: {value}");
    }
    let expected = (0.5 * 2.0_f64.ln()).sqrt() / (PI * SPREAD * 2.0_f64.sqrt());
    let found = spectrum.half_power_frequency().expect("it falls");
    near(found, expected, 1e-12);
}

#[test]
#[should_panic = "a spectrum takes two values at least, not 1"]
fn a_single_value_has_no_spectrum() {
    let (start, interval, values) = (0.0, 1.0, vec![1.0]);
    Spectrum::of(&Signal {
        start,
        interval,
        values,
    });
}
