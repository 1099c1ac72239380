//! The intruder by itself: its response, and its stiffness and damping found back.

use crate::common::{Draw, close, near, run};
use hertz_chain::{
    FitError, FrequencySweep, Oscillator, PulseSearch, Scenario, Signal, fit_response, fit_ring_down,
};

const PAPER: Oscillator = Oscillator::PAPER;
const SWEEP: FrequencySweep = FrequencySweep {
    from: 80.0,
    to: 2800.0,
    duration: 0.5,
    amplitude: 1e-6,
};

fn frequencies() -> Vec<f64> {
    (0..=120).map(|i| 100.0 + 20.0 * f64::from(i)).collect()
}

#[test]
fn the_papers_intruder_amplifies_most_at_1607_hz() {
    let (frequency, height) = PAPER.transmissibility_peak();
    close(frequency, 1607.0, 0.5);
    close(height, 3.374, 5e-4);
    for beside in [0.999, 1.001] {
        assert!(PAPER.transmissibility(beside * frequency).norm() < height);
    }
    close(PAPER.natural_frequency(), 1644.4, 0.05);
    close(PAPER.damping_ratio(), 0.15695, 1e-5);
    // With any damping it follows slow motion, and at √2 of its frequency it moves as much as its host.
    assert_eq!(PAPER.transmissibility(0.0).norm(), 1.0);
    let level = PAPER.transmissibility(2.0_f64.sqrt() * PAPER.natural_frequency());
    close(level.norm(), 1.0, 1e-14);
}

#[test]
fn a_swept_simulation_follows_the_closed_form_and_gives_back_stiffness_and_damping() {
    for damping in [1.0, 12.0, 60.0] {
        let oscillator = Oscillator { damping, ..PAPER };
        let response = oscillator.shake(&SWEEP).response(&frequencies());
        for (frequency, h) in &response {
            let error = (h - oscillator.transmissibility(*frequency)).norm();
            assert!(
                error < 2e-10 * 12.0 / damping.min(12.0),
                "{damping}, {frequency} Hz: {error:e}"
            );
        }
        let points: Vec<_> = response
            .iter()
            .map(|(frequency, h)| (*frequency, h.norm()))
            .collect();
        let fit = fit_response(&points, PAPER.mass).expect("there is a peak");
        near(fit.stiffness, PAPER.stiffness, 1e-10);
        near(fit.damping, damping, 1e-10);
    }
}

#[test]
fn a_struck_bead_rings_down_and_gives_back_stiffness_and_damping() {
    let mut scenario = Scenario::paper();
    scenario.chain.beads = 1;
    scenario.intruders[0].beads = vec![1];
    scenario.duration = 0.02;
    let solution = run(&scenario);
    let pulses = solution.pulses(1, &PulseSearch::default());
    let free = pulses[pulses.len() - 1].to + 1e-4;
    assert!(solution.at(0.02).overlap(1) < 0.0);
    let signal = solution.signal(free, free + 0.01, 1e-5, |at| {
        at.intruder_acceleration(1).expect("a host")
    });
    let host = solution.model().mass(1);
    let fit = fit_ring_down(&signal, PAPER.mass * (host - PAPER.mass) / host).expect("it rings");
    near(fit.stiffness, PAPER.stiffness, 1e-12);
    near(fit.damping, PAPER.damping, 1e-12);
}

#[test]
fn the_uncertainties_of_both_fits_are_the_scatter_that_repeated_fits_have() {
    let (mut draw, repeats) = (Draw(7), 400);
    let (mut pulls, mut together, mut expected) = ([0.0; 4], [0.0; 2], [0.0; 2]);
    let (beta, omega) = (900.0, 9000.0);
    let (stiffness, damping) = (3e-3 * (omega * omega + beta * beta), 2.0 * 3e-3 * beta);
    for _ in 0..repeats {
        let mut noisy = |f: f64| (f, PAPER.transmissibility(f).norm() + 0.02 * draw.normal());
        let points: Vec<_> = frequencies().into_iter().map(&mut noisy).collect();
        let fit = fit_response(&points, PAPER.mass).expect("there is a peak");
        pulls[0] += ((fit.stiffness - PAPER.stiffness) / fit.stiffness_error).powi(2);
        pulls[1] += ((fit.damping - PAPER.damping) / fit.damping_error).powi(2);
        together[0] += (fit.stiffness - PAPER.stiffness) / fit.stiffness_error
            * (fit.damping - PAPER.damping)
            / fit.damping_error;
        expected[0] += fit.correlation;

        let values = (0..400)
            .map(|i| 1e-5 * f64::from(i))
            .map(|t| 50.0 * (-beta * t).exp() * (omega * t + 0.4).sin() + 0.5 * draw.normal())
            .collect();
        let signal = Signal {
            start: 0.3,
            interval: 1e-5,
            values,
        };
        let fit = fit_ring_down(&signal, 3e-3).expect("it rings");
        pulls[2] += ((fit.stiffness - stiffness) / fit.stiffness_error).powi(2);
        pulls[3] += ((fit.damping - damping) / fit.damping_error).powi(2);
        together[1] +=
            (fit.stiffness - stiffness) / fit.stiffness_error * (fit.damping - damping) / fit.damping_error;
        expected[1] += fit.correlation;
        near(fit.residual, 0.5, 0.2);
    }
    for pull in pulls {
        // The variance of 400 squares is 2/400.
        close(pull / f64::from(repeats), 1.0, 4.0 * (2.0_f64 / 400.0).sqrt());
    }
    for (together, expected) in together.into_iter().zip(expected) {
        // The variance of 400 products is at most 2/400.
        close(
            (together - expected) / f64::from(repeats),
            0.0,
            4.0 * (2.0_f64 / 400.0).sqrt(),
        );
    }
    println!("correlations {:?}", expected.map(|sum| sum / f64::from(repeats)));
}

#[test]
fn what_cannot_be_fitted_is_said() {
    let say = |points: &[(f64, f64)], mass: f64, said: &str| {
        let error = fit_response(points, mass).expect_err(said).to_string();
        assert!(error.starts_with(said), "{error}");
    };
    let few = "the fit has 2 points and needs 3; measure more points";
    say(&[(100.0, 1.0), (200.0, 1.1)], 3.7e-3, few);
    let none = "a fit cannot use the magnitude NaN; give a positive number";
    say(&[(100.0, f64::NAN); 5], 3.7e-3, none);
    say(&[(100.0, 1.0); 5], 0.0, "a fit cannot use the mass 0;");
    let silent = Signal {
        start: 0.0,
        interval: 1e-5,
        values: vec![0.0; 100],
    };
    assert_eq!(fit_ring_down(&silent, 3.7e-3), Err(FitError::NoEnd));
}
