//! The fit of transmission to data whose answer is known.

use crate::common::{Draw, close, near};
use hertz_chain::TransmissionFit;

#[test]
fn an_exponential_is_fitted_exactly_and_nothing_else_is() {
    let points: Vec<_> = (0..12).map(|n| (n, 3.2e-5 * 0.9693_f64.powi(n as i32))).collect();
    let fit = TransmissionFit::of(&points).expect("enough points");
    near(fit.transmission, 0.9693, 1e-14);
    near(fit.initial, 3.2e-5, 1e-13);
    assert!(fit.residual < 1e-14 && fit.uncertainty < 1e-15, "{fit:?}");
    assert_eq!(TransmissionFit::of(&[(0, 1.0), (1, 0.9)]), None);
    assert_eq!(TransmissionFit::of(&[(3, 1.0), (3, 0.9), (3, 0.8)]), None);
    assert_eq!(TransmissionFit::of(&[(0, 1.0), (1, 0.9), (2, 0.0)]), None);
    assert_eq!(TransmissionFit::of(&[(0, 1.0), (1, f64::NAN), (2, 0.5)]), None);
}

#[test]
fn the_uncertainty_of_a_fit_is_the_scatter_that_repeated_fits_have() {
    let (mut draw, repeats, noise) = (Draw(1), 2000, 0.01);
    let (mut pulls, mut residuals) = (0.0, 0.0);
    for _ in 0..repeats {
        let noisy = |n: usize| (n, 0.95_f64.powi(n as i32) * (noise * draw.normal()).exp());
        let points: Vec<_> = (0..21).map(noisy).collect();
        let fit = TransmissionFit::of(&points).expect("enough points");
        pulls += ((fit.transmission - 0.95) / fit.uncertainty).powi(2);
        residuals += fit.residual.powi(2);
    }
    // Student's t of 19 degrees of freedom has a variance of 19/17.
    close(pulls / f64::from(repeats) * 17.0 / 19.0, 1.0, 0.1);
    near((residuals / f64::from(repeats)).sqrt(), noise, 0.02);
}
