//! The judge of the wave form on beads that are not what their settings say:
//! `cargo test --release -p bead-model waveform -- --nocapture` prints the residuals.
//!
//! The chain of the wrong beads is a small one of its own, RK4 in f64, whose intruder may be held by
//! anything.

use std::array;
use std::f64::consts::TAU;

use crate::sensed::{HOST, felt, front_end, normal, scan};
use bead_model::converter::CONVERSION;
use bead_model::design::{
    Bead, Capture, Description, FrontEnd, Intruder, Neighbours, SensorScale, Surroundings, derive,
};
use bead_model::reduced_chain::FOLLOWERS;
use bead_model::{Energy, Scan, Settings, StrikeFlags};
use bead_testing::Collector;
use hertz_chain::{Scenario, simulate};

/// Beads before and behind [`HOST`], with the striker.
const BEADS: usize = 24;
/// Step, s: 35 of them in a sample, and nine in two conversions.
const STEP: f64 = 1e-5 / 35.0;
const SAMPLES: usize = 800;
/// Quiet before the strike, samples.
const LEAD: usize = 400;

/// Force on the intruder (N) by its displacement (m) and velocity (m/s) relative to the host, and by a state
/// of its own, with the derivative of that state.
type Hold<'a> = dyn Fn(f64, f64, f64) -> [f64; 2] + 'a;

/// Displacements and velocities of the beads and of the intruder, the state of its hold, and the energy that
/// the hold took, J.
type State = [f64; 2 * BEADS + 4];

/// Force (N) and acceleration (m/s²) of each sample in the paper's chain, whose bead [`HOST`] holds an
/// intruder by `hold`, and the energy that the hold took, J.
fn chain(bead: &Bead, hold: &Hold<'_>) -> (Vec<[f64; 2]>, f64) {
    const INTRUDER: usize = BEADS;
    const HELD: usize = 2 * BEADS + 2;
    let mass = |body: usize| match body {
        0 => 2.976e-3,
        HOST => bead.mass - bead.intruder_mass,
        INTRUDER => bead.intruder_mass,
        _ => bead.mass,
    };
    // Force and acceleration as sensed, and the slope of the state.
    let now = |state: &State| {
        let (x, v) = state.split_at(BEADS + 1);
        let mut slope = [0.0; 2 * BEADS + 4];
        slope[..=BEADS].copy_from_slice(&v[..=BEADS]);
        let mut push = |body: usize, force: f64| slope[BEADS + 1 + body] += force / mass(body);
        let mut incoming = 0.0;
        for body in 0..BEADS - 1 {
            let overlap = x[body] - x[body + 1];
            if overlap > 0.0 {
                let viscous = 1.5 * bead.relaxation * (v[body] - v[body + 1]);
                let force = bead.contact_stiffness * overlap.sqrt() * (overlap + viscous);
                push(body, -force);
                push(body + 1, force);
                if body + 1 == HOST {
                    incoming = force;
                }
            }
        }
        let velocity = v[INTRUDER] - v[HOST];
        let [held, change] = hold(x[INTRUDER] - x[HOST], velocity, state[HELD]);
        push(INTRUDER, held);
        push(HOST, -held);
        slope[HELD..].copy_from_slice(&[change, -held * velocity]);
        ([incoming, held / bead.intruder_mass], slope)
    };
    let mut state = [0.0; 2 * BEADS + 4];
    state[BEADS + 1] = 0.45;
    let mut sensed = Vec::new();
    for _ in 0..35 * SAMPLES + 10 {
        let along = |by: f64, slope: &State| array::from_fn(|at| state[at] + by * slope[at]);
        let (signals, first) = now(&state);
        let (_, second) = now(&along(0.5 * STEP, &first));
        let (_, third) = now(&along(0.5 * STEP, &second));
        let (_, fourth) = now(&along(STEP, &third));
        sensed.push(signals);
        state = array::from_fn(|at| {
            state[at] + STEP / 6.0 * (first[at] + 2.0 * second[at] + 2.0 * third[at] + fourth[at])
        });
    }
    let samples = (0..35 * SAMPLES).step_by(35);
    let samples = samples.map(|at| [sensed[at][0], sensed[at + 9][1]]);
    (samples.collect(), state[HELD + 1])
}

/// A bead that is not what its settings say: what differs, as a factor, a part or a force (N).
#[derive(Clone, Copy)]
struct Wrong {
    stiffness: f64,
    damping: f64,
    /// Part by which the spring is harder at the peak stroke.
    hardening: f64,
    /// Dry friction of the intruder, N.
    friction: f64,
    /// Stiffness of a Maxwell arm of 30 µs, as a part of k.
    arm: f64,
    /// Gain of the accelerometer.
    gain: f64,
}

const RIGHT: Wrong = Wrong {
    stiffness: 1.0,
    damping: 1.0,
    hardening: 0.0,
    friction: 0.0,
    arm: 0.0,
    gain: 1.0,
};

#[test]
fn a_bead_that_is_not_what_its_settings_say_is_told_by_its_wave_form_though_both_estimates_agree() {
    const ARM_TIME: f64 = 30e-6;
    let paper = Bead::paper();
    let Bead {
        stiffness: k,
        damping: c,
        ..
    } = paper;
    // Highest acceleration of the right bead, m/s², over k/m.
    let peak = 190.0 * paper.intruder_mass / k;
    let front_end = front_end([16.0, 500.0]);
    let settings = derive(&paper, &front_end, &Capture::default()).unwrap();
    let told = StrikeFlags::MODEL_DIFFERS;
    #[rustfmt::skip]
    let cases = [
        ("right", RIGHT, [0.0, 0.1], StrikeFlags::NONE),
        ("k + 0.5 %", Wrong { stiffness: 1.005, ..RIGHT }, [0.7, 1.0], StrikeFlags::NONE),
        ("k + 3 %", Wrong { stiffness: 1.03, ..RIGHT }, [4.5, 5.3], told),
        ("k - 3 %", Wrong { stiffness: 0.97, ..RIGHT }, [4.5, 5.3], told),
        ("k + 10 %", Wrong { stiffness: 1.1, ..RIGHT }, [15.0, 17.0], told.with(StrikeFlags::INTRUDER_DRIFTED)),
        ("c + 20 %", Wrong { damping: 1.2, ..RIGHT }, [9.0, 10.0], told),
        ("hardening of 5 %", Wrong { hardening: 0.05, ..RIGHT }, [3.5, 5.0], told),
        ("hardening of 20 %", Wrong { hardening: 0.2, ..RIGHT }, [13.0, 16.0], told),
        ("softening of 20 %", Wrong { hardening: -0.2, ..RIGHT }, [22.0, 28.0], told),
        ("friction of 5 mN", Wrong { friction: 5e-3, ..RIGHT }, [2.5, 5.0], told),
        ("a Maxwell arm of k/10", Wrong { arm: 0.1, ..RIGHT }, [3.0, 8.0], told),
        ("10° askew", Wrong { gain: 0.984_807_75, ..RIGHT }, [1.45, 1.7], told),
    ];
    for (name, wrong, [least, most], flags) in cases {
        let hold = |x: f64, v: f64, arm: f64| {
            let stiffness = wrong.stiffness * k * (1.0 + wrong.hardening * (x / peak).powi(2));
            let rest = wrong.friction * (v / 1e-4).tanh() + wrong.arm * k * (x - arm);
            [
                -stiffness * x - wrong.damping * c * v - rest,
                (x - arm) / ARM_TIME,
            ]
        };
        let (sensed, absorbed) = chain(&paper, &hold);
        let scans: Vec<Scan> = std::iter::repeat_n([0.0; 2], LEAD)
            .chain(sensed)
            .map(|[force, acceleration]| scan(&front_end, [force, wrong.gain * acceleration]))
            .collect();
        let heard = Collector::measure(&settings, 0, &scans);
        let (strike, waveform) = (heard.reports[0], heard.shapes[0].waveform.unwrap());
        let off = |energy: Energy| 100.0 * (energy.joules() / absorbed - 1.0);
        let residual = 100.0 * waveform.residual.ratio();
        println!(
            "{name}: A {:+.2} %, B {:+.2} %, residual {residual:.2} %, {:?}",
            off(strike.absorbed_measured),
            off(strike.absorbed_predicted),
            strike.flags
        );
        assert!((least..most).contains(&residual), "{name}: {residual} %");
        assert_eq!(strike.flags, flags, "{name}");
    }
}

/// Codes of both gains of the reference front end, without filters, with noise of its size, at a `phase` of
/// the sample clock, and the energy that the intruder of `host` absorbs in the simulation, J.
fn codes(scenario: &Scenario, host: usize, phase: u32) -> (FrontEnd, Vec<Scan>) {
    let solution = simulate(scenario).unwrap();
    let mut front_end = FrontEnd::reference();
    for sensor in [&mut front_end.force, &mut front_end.acceleration] {
        // The lag of this pole is the delay of the channel at the low gain, whose codes are taken without it.
        (sensor.pole, sensor.wide_pole) = (0.0, 1.0 / (TAU * CONVERSION));
    }
    let mut normal = normal(phase.into());
    let samples = LEAD + (solution.end() * 1e5) as usize;
    let scans = (0..samples).map(|sample| {
        let time = (sample as f64 - LEAD as f64 + f64::from(phase) / 8.0) * 1e-5;
        let [force, acceleration] = felt(&solution, host, time);
        let mut codes = |value: f64, sensor: &SensorScale, zero: f64| {
            [sensor.per_code, sensor.wide_per_code].map(|per_code| {
                let code = (value + sensor.noise * normal()) / per_code + zero;
                code.round().clamp(0.0, 4095.0) as u16
            })
        };
        let [force, force_wide] = codes(force, &front_end.force, 128.3);
        let [acceleration, acceleration_wide] = codes(acceleration, &front_end.acceleration, 2048.2);
        Scan::new([force, force_wide, acceleration, acceleration_wide])
    });
    (front_end, scans.collect())
}

#[test]
fn the_wave_form_of_a_good_bead_raises_no_doubt_be_it_soft_or_hard_alone_or_in_a_row() {
    let mut cases = Vec::new();
    // Of steel, 4.5 mm: single waves from near the threshold to the low gain. Of 10 and 19 mm: trains.
    for (diameter, speed) in [
        (9.0, 0.03),
        (9.0, 0.1),
        (9.0, 0.45),
        (9.0, 1.0),
        (9.0, 4.0),
        (10.0, 1.0),
        (19.0, 0.2),
        (19.0, 1.0),
    ] {
        cases.push((Bead::paper(), diameter, speed, None));
    }
    for (mass, stiffness, damping) in [
        (3.7e-3, 3.95e5, 12.0),
        (3.7e-3, 3.95e5, 5.0),
        (3.7e-3, 3.95e5, 40.0),
        (12e-3, 3.95e5, 12.0),
        (12e-3, 1.2e6, 30.0),
        (1e-3, 1e5, 5.0),
        (4.7e-3, 2e5, 10.0),
        (2.7e-3, 3e5, 8.0),
    ] {
        let bead = Bead {
            intruder_mass: mass,
            stiffness,
            damping,
            ..Bead::paper()
        };
        cases.extend([None, Some(4), Some(8)].map(|in_row| (bead, 9.0, 0.45, in_row)));
    }
    for (bead, diameter, speed, in_row) in cases {
        let Intruder {
            mass,
            stiffness,
            damping,
        } = bead.intruder();
        let mut scenario = Scenario::paper();
        scenario.duration = 0.012;
        (scenario.striker.radius, scenario.striker.velocity) = (5e-4 * diameter, speed);
        let intruder = &mut scenario.intruders[0];
        (intruder.mass, intruder.stiffness, intruder.damping) = (mass, stiffness, damping);
        let mut around = Surroundings::default();
        if in_row.is_some() {
            intruder.beads = (4..=13).collect();
            around = Neighbours::new([true; FOLLOWERS], true, bead.intruder()).into();
        }
        for phase in 0..3 {
            let host = in_row.unwrap_or(HOST);
            let (front_end, scans) = codes(&scenario, host, phase);
            let capture = Capture::of(&bead, &front_end);
            let described = Description::new(&bead, &around, &front_end, &capture);
            let settings = Settings::new(&described).unwrap();
            let heard = Collector::measure(&settings, 0, &scans);
            let waveform = heard.shapes[0].waveform.unwrap();
            let [residual, noise] = [waveform.residual, waveform.noise].map(|part| 100.0 * part.ratio());
            let what = format!(
                "{:?}, {diameter} mm, {speed} m/s, row {in_row:?}",
                bead.intruder()
            );
            println!("{what}: residual {residual:.2} %, noise {noise:.2} %");
            // How it rings depends on its neighbours, and a well damped one hardly rings.
            let doubts = heard.reports[0].flags.without(StrikeFlags::INTRUDER_DRIFTED);
            assert_eq!(doubts, StrikeFlags::NONE, "{what}: {residual} %, {noise} %");
        }
    }
}
