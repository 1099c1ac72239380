//! Spectra against closed forms of Fourier transforms.

use std::f64::consts::{FRAC_1_SQRT_2, PI, TAU};

use crate::common::{close, near};
use hertz_chain::{Complex64, Signal, Spectrum};

fn signal(start: f64, interval: f64, count: usize, value: impl Fn(f64) -> f64) -> Signal {
    let values = (0..count).map(|i| value(start + interval * i as f64));
    Signal {
        start,
        interval,
        values: values.collect(),
    }
}

/// 7 N high, of standard deviation 0.1 ms, at 1 ms.
const HEIGHT: f64 = 7.0;
const SPREAD: f64 = 1e-4;
const PLACE: f64 = 1e-3;

fn gaussian() -> Spectrum {
    let value = |t: f64| HEIGHT * (-0.5 * ((t - PLACE) / SPREAD).powi(2)).exp();
    Spectrum::of(&signal(2e-4, 1e-6, 1601, value))
}

fn gaussian_transform(f: f64) -> Complex64 {
    let size = HEIGHT * SPREAD * TAU.sqrt() * (-2.0 * (PI * SPREAD * f).powi(2)).exp();
    Complex64::from_polar(size, -TAU * f * PLACE)
}

#[test]
fn a_gaussian_pulse_has_its_transform_and_its_three_decibels() {
    let spectrum = gaussian();
    let impulse = HEIGHT * SPREAD * TAU.sqrt();
    let all = spectrum.values().iter().enumerate();
    let all = all.map(|(i, value)| (spectrum.step() * i as f64, *value));
    for (f, value) in all.chain([0.0, 123.4, 1777.7].map(|f| (f, spectrum.at(f)))) {
        // What the stretch cuts off at eight standard deviations is some 1e-14 of it.
        let error = (value - gaussian_transform(f)).norm();
        assert!(error < 1e-13 * impulse, "{f} Hz: {value}");
    }
    let expected = (0.5 * 2.0_f64.ln()).sqrt() / (PI * SPREAD * 2.0_f64.sqrt());
    let found = spectrum.half_power_frequency().expect("it falls");
    near(found, expected, 1e-12);
}

#[test]
fn a_half_sine_has_its_transform_and_its_three_decibels() {
    let length = 4e-4;
    let half_sine = signal(0.0, 2e-7, 2001, |t| 3.0 * (PI * t / length).sin());
    let spectrum = Spectrum::of(&half_sine);
    let transform = |f: f64| {
        let x = f * length;
        3.0 * 2.0 * length / PI * ((PI * x).cos() / (1.0 - 4.0 * x * x)).abs()
    };
    for f in [0.0, 700.0, 2100.0, 5000.0] {
        close(spectrum.at(f).norm(), transform(f), 3e-7 * transform(0.0));
    }
    let found = spectrum.half_power_frequency().expect("it falls");
    close(transform(found) / transform(0.0), FRAC_1_SQRT_2, 1e-6);
}

#[test]
#[should_panic = "a spectrum takes two values at least, not 1"]
fn a_single_value_has_no_spectrum() {
    Spectrum::of(&signal(0.0, 1.0, 1, |_| 1.0));
}
