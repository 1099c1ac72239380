//! The shape of a strike against the f64 chain: `cargo test -p bead-model shape -- --nocapture` prints
//! the errors.
#![allow(clippy::unwrap_used, reason = "in a test, an unwrap is an assertion")]

use crate::UNDELAYED;
use bead_model::design::{Bead, Capture, FrontEnd, derive};
use bead_model::{Scan, Settings, Shape, Window, WindowRecord};
use hertz_chain::{PulseSearch, Scenario, Solution, simulate};

const HOST: usize = 8;
const RATE: f64 = 100e3;
/// From the window's first sample to the strike, samples.
const LEAD: usize = 200;
const LENGTH: usize = 700;

fn chain(speed: f64, beads: usize, host: usize, stiffness: f64) -> Solution {
    let mut scenario = Scenario::paper();
    scenario.duration = 0.008;
    scenario.chain.beads = beads;
    scenario.striker.velocity = speed;
    scenario.intruders[0].beads = vec![host];
    scenario.intruders[0].stiffness = stiffness;
    simulate(&scenario).unwrap()
}

/// The codes that `host` samples: 12 bits over 16 N × `range` and ±250 m/s² × `range`, with noise of `noise`
/// codes rms. The wide channels are not wider.
fn sensed(solution: &Solution, host: usize, range: f64, noise: f64) -> (Settings, Vec<Scan>) {
    let mut front_end = FrontEnd::reference();
    for sensor in [&mut front_end.force, &mut front_end.acceleration] {
        sensor.per_code *= range;
        sensor.pole = 0.0;
        (sensor.wide_per_code, sensor.wide_pole) = (sensor.per_code, UNDELAYED);
    }
    let settings = derive(&Bead::paper(), &front_end, &Capture::default()).unwrap();
    let mut state = 1_u64;
    // Twelve uniform deviates make a normal one.
    let mut normal = || {
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    };
    let scans = (0..LENGTH)
        .map(|n| {
            let t = (n as f64 - LEAD as f64) / RATE;
            let (force, acceleration) = if t < 0.0 {
                (0.0, 0.0)
            } else {
                (
                    solution.at(t).force(host),
                    solution.at(t).intruder_acceleration(host).unwrap(),
                )
            };
            let mut code = |value: f64, per_code: f64, zero: f64| {
                (value / per_code + zero + noise * normal())
                    .round()
                    .clamp(0.0, 4095.0) as u16
            };
            let force = code(force, front_end.force.per_code, 128.3);
            let acceleration = code(acceleration, front_end.acceleration.per_code, 2048.2);
            Scan::new([force, force, acceleration, acceleration])
        })
        .collect();
    (settings, scans)
}

/// The shape of the window with these scans.
fn shape_of(settings: &Settings, scans: &[Scan]) -> Shape {
    let (mut window, mut record) = (Window::open(0, 0), WindowRecord::new());
    record.clear();
    window.process(settings, scans, &mut record);
    window.report(settings, &record).1
}

/// Errors of a shape: arrival in samples, width, impulse, frequency and decay in per cent.
fn errors(solution: &Solution, host: usize, stiffness: f64, shape: &Shape) -> [f64; 5] {
    let pulses = solution.pulses(host, &PulseSearch::default());
    let pulse = pulses
        .into_iter()
        .max_by(|a, b| a.force.total_cmp(&b.force))
        .unwrap();
    let impulse = solution
        .flow(host)
        .between(0.0, (LENGTH - 1 - LEAD) as f64 / RATE)
        .impulse;
    let host_mass = solution.model().mass(host);
    let reduced = 3.7e-3 * (host_mass - 3.7e-3) / host_mass;
    let decay = 0.5 * 12.0 / reduced;
    let frequency = (stiffness / reduced - decay * decay).sqrt() / std::f64::consts::TAU;
    let percent = |value: f64, truth: f64| 100.0 * (value / truth - 1.0);
    [
        shape.arrival.samples() - LEAD as f64 - pulse.time * RATE,
        percent(shape.width.samples(), pulse.fwhm.unwrap() * RATE),
        percent(shape.impulse.newton_samples() / RATE, impulse),
        percent(shape.ring_frequency.hertz(), frequency),
        percent(shape.ring_decay.per_second(), decay),
    ]
}

/// Prints the errors and checks each against its bound, which is about twice the error seen.
fn held(what: &str, [arrival, width, impulse, frequency, decay]: [f64; 5], bounds: [f64; 5]) {
    println!(
        "{what}: arrival {arrival:+.3} samples, width {width:+.3} %, impulse {impulse:+.3} %, frequency {frequency:+.3} %, \
         decay {decay:+.2} %"
    );
    for (error, bound) in [arrival, width, impulse, frequency, decay]
        .into_iter()
        .zip(bounds)
    {
        assert!(error.abs() < bound, "{what}: {error} is not below {bound}");
    }
}

#[test]
fn the_shape_of_the_papers_strike_is_that_of_the_chain() {
    let solution = chain(0.45, 16, HOST, 3.95e5);
    for noise in [0.0, 1.3] {
        let (settings, scans) = sensed(&solution, HOST, 1.0, noise);
        let shape = shape_of(&settings, &scans);
        held(
            &format!("0.45 m/s, {noise} codes rms"),
            errors(&solution, HOST, 3.95e5, &shape),
            [0.1, 0.25, 0.5, 0.6, 1.5],
        );
    }
}

#[test]
fn a_spring_that_has_changed_is_heard_in_the_ringing() {
    for stiffness in [3.6e5, 3.95e5, 4.3e5] {
        let solution = chain(0.45, 16, HOST, stiffness);
        let (settings, scans) = sensed(&solution, HOST, 1.0, 1.3);
        let shape = shape_of(&settings, &scans);
        held(
            &format!("k = {stiffness} N/m"),
            errors(&solution, HOST, stiffness, &shape),
            [0.1, 0.25, 0.5, 0.6, 2.5],
        );
    }
}

#[test]
fn the_shape_holds_for_weak_and_strong_strikes() {
    for (speed, range) in [(0.1, 0.25), (2.0, 6.0), (5.0, 16.0)] {
        let solution = chain(speed, 16, HOST, 3.95e5);
        let (settings, scans) = sensed(&solution, HOST, range, 1.3);
        let shape = shape_of(&settings, &scans);
        held(
            &format!("{speed} m/s"),
            errors(&solution, HOST, 3.95e5, &shape),
            [0.15, 0.3, 0.7, 2.0, 10.0],
        );
    }
}
