//! Figure A1: the intruder on a shaker, and its stiffness and damping fitted to the response.

use hertz_chain::{FrequencySweep, Oscillator, OscillatorFit, PulseSearch, fit_response, fit_ring_down};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

use crate::check::checks;
use crate::curve::{discs, line, over_time, time_axis};
use crate::error::Error;
use crate::lab::Lab;
use crate::plan::{Figure, plans};
use crate::setting::{DAMPING, MASS, STIFFNESS, VISCOUS, intruder, strike, with};
use hertz_charts::{Axis, Panel};

plans! {
    "A1": "transmissibility of the intruder, and its ring-down after a strike";
        "m 3.7 g, k 3.95e5 N/m, c 12 N·s/m; host shaken from 80 to 2800 Hz in 0.5 s, points with 2 % noise; below: one free \
              host bead, struck"
        => response,
}

const INTRUDER: Oscillator = Oscillator::PAPER;
const SWEEP: FrequencySweep = FrequencySweep {
    from: 80.0,
    to: 2800.0,
    duration: 0.5,
    amplitude: 1e-6,
};
/// Scatter of |h| in the points that stand for a measurement.
const NOISE: f64 = 0.02;
const SEED: u64 = 1;
/// A fitted value may be off by this many standard errors; one value in 16 000 is off by more.
const SIGMAS: f64 = 4.0;

fn response(lab: &Lab) -> Result<Figure, Error> {
    let frequencies: Vec<f64> = (0..=96).map(|n| 100.0 + 25.0 * f64::from(n)).collect();
    let swept = INTRUDER.shake(&SWEEP).response(&frequencies);
    let farthest = swept
        .iter()
        .map(|(frequency, h)| (h - INTRUDER.transmissibility(*frequency)).norm())
        .fold(0.0, f64::max);
    let noise = Normal::new(0.0, NOISE).expect("the noise is finite and not negative");
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let measured: Vec<(f64, f64)> = swept
        .iter()
        .map(|(frequency, h)| (*frequency, h.norm() + noise.sample(&mut random)))
        .collect();
    let fit = fit_response(&measured, MASS)?;
    let fitted = Oscillator {
        stiffness: fit.stiffness,
        damping: fit.damping,
        ..INTRUDER
    };
    let curve = (0..=480)
        .map(|n| 100.0 + 5.0 * f64::from(n))
        .map(|frequency| (frequency, fitted.transmissibility(frequency).norm()))
        .collect();
    let (frequency, height) = INTRUDER.transmissibility_peak();

    let (ring, rung) = ring_down(lab)?;
    let [stiffness_error, damping_error] =
        [fit.stiffness_error, fit.damping_error].map(|error| SIGMAS * error);
    let checks = checks![
        "highest |h|": height => close(3.374, 1e-3);
        "frequency of the highest |h|", "Hz": frequency => close(1607.0, 1e-3),
            paper "f_res = √(k/m)/2π, which is 1644 Hz, not the frequency of the peak";
        "swept simulation from eq. (A1), farthest": farthest => at_most(2e-10);
        "k fitted to swept, 2 % noise, ± {SIGMAS} standard errors", "N/m":
            fit.stiffness => near(STIFFNESS, stiffness_error);
        "c fitted to swept, 2 % noise, ± {SIGMAS} standard errors", "N·s/m":
            fit.damping => near(DAMPING, damping_error);
        // Without noise the errors are those of the integration.
        "k from the ring-down", "N/m": rung.stiffness => close(STIFFNESS, 1e-9);
        "c from the ring-down", "N·s/m": rung.damping => close(DAMPING, 1e-9);
    ];
    let axis = Axis::new("frequency (Hz)", 100.0..2500.0);
    let curves = vec![discs("swept, 2 % noise", 0, measured), line("fit", 1, curve)];
    let panel = Panel::new("|h| = |û/Û|", curves).over(axis.clone());
    Ok(Figure::over(axis, vec![panel, ring], checks))
}

/// A single bead is struck: it flies free, and its intruder rings in it.
fn ring_down(lab: &Lab) -> Result<(Panel, OscillatorFit), Error> {
    let intruder = intruder([1], MASS, STIFFNESS, DAMPING);
    let run = lab.run(&with(strike(1, VISCOUS, 0.02), intruder))?;
    let solution = &run.solution;
    let pulses = solution.pulses(1, &PulseSearch::default());
    let free = pulses.last().map_or(0.0, |pulse| pulse.to) + 1e-4;
    let acceleration = |at: &hertz_chain::Snapshot<'_>| at.intruder_acceleration(1).unwrap_or(f64::NAN);
    let signal = solution.signal(free, free + 0.01, 1e-5, acceleration);
    let host = solution.model().mass(1);
    let fit = fit_ring_down(&signal, MASS * (host - MASS) / host)?;
    let span = 0.0..5e-3;
    let rung = over_time(solution, span.clone(), acceleration);
    let curve = line("acceleration after a strike", 2, rung);
    let panel = Panel::new("intruder (m/s²)", vec![curve]).over(time_axis(span));
    Ok((panel, fit))
}
