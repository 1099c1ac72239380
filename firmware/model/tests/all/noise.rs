//! The effect of noise on both estimates, with and without their measures against it.
//!
//! `cargo test --release -p bead-model noise -- --nocapture` prints the table of `docs/estimators.md`.

use crate::replayed;
use crate::sensed::{HOST, felt, front_end, normal, scan};
use bead_model::design::{Bead, Capture, derive};
use bead_model::layout::PIECE;
use bead_model::observer::ObserverState;
use bead_model::quantity::SensedAcceleration;
use bead_model::{Scan, Settings, StrikeFlags};
use bead_testing::Collector;
use hertz_chain::{Options, Scenario, Solution, simulate_with};

const STRIKES: u64 = 40;
/// Quiet before the strike, samples.
const LEAD: f64 = 500.0;

/// The paper's strike at a speed in m/s, and the energy that its intruder absorbs, nJ.
fn strike(speed: f64) -> (Solution, f64) {
    let mut scenario = Scenario::paper();
    scenario.striker.velocity = speed;
    let options = Options::default().with_duration(0.012);
    let solution = simulate_with(&scenario, &options).unwrap();
    let absorbed = solution.at(scenario.duration).intruder_dissipated(HOST).unwrap() * 1e9;
    (solution, absorbed)
}

/// Mean and standard deviation of the errors of each estimate: A, A without the noise subtracted, B, B with a
/// gate for single samples.
fn errors(solution: &Solution, absorbed: f64, noise: [f64; 2]) -> [(f64, f64); 4] {
    let mut front_end = front_end([16.0, 500.0]);
    [front_end.force.noise, front_end.acceleration.noise] = noise;
    let capture = Capture::of(&Bead::paper(), &front_end);
    let settings = derive(&Bead::paper(), &front_end, &capture).unwrap();
    let runs: Vec<[f64; 4]> = (0..STRIKES)
        .map(|seed| {
            let mut normal = normal(seed);
            let phase = seed as f64 / STRIKES as f64;
            let sensed = (0..1600).map(|sample| {
                let time = (f64::from(sample) - LEAD + phase) / 100e3;
                let [force, acceleration] = felt(solution, HOST, time);
                let force = force + noise[0] * normal();
                scan(&front_end, [force, acceleration + noise[1] * normal()])
            });
            let scans: Vec<Scan> = sensed.collect();
            let report = Collector::measure(&settings, 0, &scans).reports[0];
            assert!(!report.flags.has(StrikeFlags::NOT_AT_REST), "noise {noise:?}");
            let window = &scans[report.first_index as usize..][..usize::from(report.samples)];
            let per_code = front_end.force.per_code;
            let gate = (3.0 * noise[0].hypot(per_code / 12f64.sqrt()) / per_code) as u16;
            let gated: Vec<Scan> = window
                .iter()
                .map(|scan| {
                    let [force, _, acceleration, _] = scan.codes();
                    let force = if force.abs_diff(128) < gate { 128 } else { force };
                    Scan::new([force, force, acceleration, acceleration])
                })
                .collect();
            [
                1e9 * report.absorbed_measured.joules(),
                with_noise(&settings, window),
                1e9 * report.absorbed_predicted.joules(),
                predicted(&settings, &gated),
            ]
            .map(|energy| 100.0 * (energy / absorbed - 1.0))
        })
        .collect();
    [0, 1, 2, 3].map(|estimate| {
        let count = runs.len() as f64;
        let mean = runs.iter().map(|run| run[estimate]).sum::<f64>() / count;
        let squares: f64 = runs.iter().map(|run| (run[estimate] - mean).powi(2)).sum();
        (mean, (squares / count).sqrt())
    })
}

/// Estimate A of a window as a plain sum to its end, with the noise.
fn with_noise(settings: &Settings, scans: &[Scan]) -> f64 {
    let (_, record) = replayed(settings, 0, scans);
    let accelerations: Vec<SensedAcceleration> = record.samples().map(|(_, a)| a).collect();
    let mut state = ObserverState::default();
    for piece in accelerations.chunks(PIECE) {
        settings.observer.process(0, &mut state, piece);
    }
    1e9 * settings.observer.absorbed(0, &state).joules()
}

/// Estimate B of a window.
fn predicted(settings: &Settings, scans: &[Scan]) -> f64 {
    let (window, _) = replayed(settings, 0, scans);
    1e9 * window.absorbed_predicted(settings).joules()
}

#[test]
fn noise_is_taken_off_a_and_does_not_cut_into_b() {
    println!("| strike | noise | A, plain | A | noise | B, every sample gated | B |");
    println!("|---|---|---|---|---|---|---|");
    for (speed, accelerations, forces) in [
        (0.1, [0.05, 0.2, 0.5, 1.0], [5e-3, 10e-3, 20e-3, 45e-3]),
        (0.45, [0.5, 1.0, 2.0, 4.0], [5e-3, 20e-3, 50e-3, 150e-3]),
    ] {
        let (solution, absorbed) = strike(speed);
        for (acceleration, force) in accelerations.into_iter().zip(forces) {
            let [a, plain, b, gated] = errors(&solution, absorbed, [force, acceleration]);
            let shown = |(mean, deviation): (f64, f64)| format!("{mean:+.2} ± {deviation:.2} %");
            println!(
                "| {speed} m/s | {acceleration} m/s² | {} | {} | {:.0} mN | {} | {} |",
                shown(plain),
                shown(a),
                force * 1e3,
                shown(gated),
                shown(b)
            );
            // The bias that is left is within what 64 samples say about the noise; the bias of B is within
            // its scatter.
            let bias = plain.0 - a.0;
            let unsure = |scatter: f64| 3.0 * scatter / (STRIKES as f64).sqrt();
            assert!(bias > 0.0, "{bias}");
            assert!(a.0.abs() < 0.05 + 0.05 * bias + unsure(a.1), "{a:?}");
            assert!(b.0.abs() < 0.1 + unsure(b.1), "{b:?}");
            assert!(b.0.abs() < gated.0.abs() + unsure(b.1), "{b:?} {gated:?}");
        }
    }
}
