//! Motions that repeat with their drive, compared with another program, perturbed runs and long runs.

use std::f64::consts::TAU;
use std::ops::ControlFlow;

use crate::common::{numbers, says};
use hertz_chain::{
    Accuracy, Bifurcation, Branch, BranchEnd, BranchOptions, Complex64, ContactForce, Drive, DriveParameter,
    DriveQuantity, Intruder, Oscillator, PeriodicState, Run, Scenario, Start,
};
use nalgebra::DMatrix;

/// A chain of docs/scenarios/driven-trimer.toml with this number of beads.
fn trimer(beads: usize, amplitude: f64, frequency: f64) -> Scenario {
    let text = include_str!("../../../../../docs/scenarios/driven-trimer.toml");
    let mut scenario = Scenario::from_toml(text, "driven-trimer.toml").expect("it is a scenario");
    scenario.chain.beads = beads;
    scenario.sections[0].beads.retain(|bead| *bead <= beads);
    scenario.sections.retain(|section| !section.beads.is_empty());
    scenario.drive = Some(Drive::sine(DriveQuantity::Displacement, amplitude, frequency));
    scenario
}

/// A short one with an intruder on a spring that softens.
fn short() -> Scenario {
    let mut scenario = trimer(3, 3e-8, 5200.0);
    scenario.intruders = vec![Intruder::new([2], Oscillator::new(5e-3, 6e6, 0.2))];
    scenario.intruders[0].cubic_stiffness = -5e17;
    scenario
}

/// Amplitude, velocity of bead 1 when the drive begins its period, and the two greatest pairs of multipliers.
/// By scipy 1.17: DOP853 with rtol 1e-12, Newton's method with differences of whole periods.
const OTHER_PROGRAM: &str = "\
1e-8   2.0036785536e-3 0.87280151 0.48762871 0.52811212 0.84820472
2e-8   4.2466958127e-3 0.87282613 0.48746569 0.52812682 0.84808535
2.5e-8 5.6779349450e-3 0.87288204 0.48724617 0.52818353 0.84793904";

#[test]
fn a_driven_trimer_repeats_as_another_program_says() {
    let mut state = PeriodicState::of(&trimer(21, 1e-9, 6200.0)).unwrap();
    for row in OTHER_PROGRAM.lines() {
        let numbers = numbers(row);
        let [amplitude, velocity, multipliers @ ..] = &numbers[..] else {
            unreachable!()
        };
        state = state.near(&trimer(21, *amplitude, 6200.0)).unwrap();
        let seen = state.run().snapshot().velocity(1);
        assert!((seen / velocity - 1.0).abs() < 1e-9, "{row}: {seen:e}");
        for (pair, seen) in multipliers.chunks(2).zip(state.multipliers().chunks(2)) {
            let off = (seen[0].re - pair[0])
                .abs()
                .max((seen[0].im.abs() - pair[1]).abs());
            assert!(off < 3e-8, "{row}: {seen:?}");
        }
        assert!(state.is_stable() && state.multipliers().len() == 42);
    }
}

/// Displacement and velocity of each bead, and of the intruder in bead 2, after a period whose start has one
/// of these moved by `off`, m. Velocities are in units of displacements.
fn perturbed(state: &PeriodicState, direction: usize, off: f64) -> Vec<f64> {
    let (rate, mut scenario) = (TAU / state.period(), state.scenario().clone());
    scenario.starts = state.starts();
    let (beads, part) = (scenario.chain.beads, direction % 2);
    let (host, place) = if direction < 2 * beads {
        (direction / 2, part)
    } else {
        (1, 2 + part)
    };
    let start = &mut scenario.starts[host];
    let values = [
        &mut start.displacement,
        &mut start.velocity,
        &mut start.intruder_displacement,
        &mut start.intruder_velocity,
    ];
    let moved = values.into_iter().nth(place).expect("there are four");
    *moved += off * [1.0, rate][part];
    let mut run = Run::new(&scenario, Accuracy::REFERENCE).expect("it is in range");
    run.to(state.period()).expect("a period can be run");
    let end = run.snapshot();
    // A displacement counts from the start of its run.
    let of_bead = |(start, bead): (&Start, usize)| {
        [
            start.displacement + end.displacement(bead),
            end.velocity(bead) / rate,
        ]
    };
    let inner = end.intruder_displacement(2).zip(end.intruder_velocity(2));
    let inner = inner
        .into_iter()
        .flat_map(|(place, velocity)| [place, velocity / rate]);
    scenario
        .starts
        .iter()
        .zip(1..)
        .flat_map(of_bead)
        .chain(inner)
        .collect()
}

/// Compares the multipliers with those of central differences of perturbed runs.
fn multipliers_are_those_of_runs(state: &PeriodicState) {
    let off = 1e-11;
    let count = 2 * state.scenario().chain.beads + 2;
    let mut derivative = DMatrix::zeros(count, count);
    for direction in 0..count {
        let [more, less] = [off, -off].map(|off| perturbed(state, direction, off));
        for (row, (more, less)) in more.iter().zip(&less).enumerate() {
            derivative[(row, direction)] = (more - less) / (2.0 * off);
        }
    }
    let expected = derivative.complex_eigenvalues();
    assert_eq!(state.multipliers().len(), expected.len());
    for multiplier in state.multipliers() {
        let distances = expected.iter().map(|other| (multiplier - other).norm());
        let nearest = distances.fold(f64::INFINITY, f64::min);
        assert!(nearest < 1e-6, "{multiplier}: {nearest:e} of {expected:?}");
    }
}

#[test]
fn multipliers_are_those_of_perturbed_runs_on_the_stable_and_the_unstable_side_of_a_fold() {
    let branch = followed(&trimer_with_fold(), 6e-8);
    let fold = branch.folds().next().unwrap().value;
    for is_stable in [true, false] {
        let mut points = branch.points.iter().filter(|point| point.value > 0.8 * fold);
        let side = points.find(|point| point.state.is_stable() == is_stable);
        multipliers_are_those_of_runs(&side.unwrap().state);
    }
}

/// Without losses in contacts, the volume of the phase space shrinks by exp(-T/τ) for each bead.
#[test]
fn multipliers_on_a_ground_that_drags_are_those_of_perturbed_runs_and_their_product_that_of_the_drag() {
    let mut scenario = short();
    (scenario.chain.relaxation, scenario.chain.drag_time) = (0.0, Some(1e-3));
    scenario.intruders[0].damping = 0.0;
    let state = PeriodicState::of(&scenario).expect("a weak drive has one");
    multipliers_are_those_of_runs(&state);
    let product: Complex64 = state.multipliers().iter().product();
    // The drag acts on the whole mass of a host, and slows its shell.
    let model = hertz_chain::Model::of(&scenario).unwrap();
    let host = model.mass(2) / (model.mass(2) - scenario.intruders[0].mass);
    let shrunk = (-(2.0 + host) * state.period() / 1e-3).exp();
    assert!((product / shrunk - 1.0).norm() < 1e-8, "{product} {shrunk}");
}

/// Three beads and an intruder, shaken a little below a resonance: contacts soften, so the branch folds.
fn trimer_with_fold() -> Scenario {
    let mut scenario = short();
    scenario.drive = Some(Drive::sine(DriveQuantity::Displacement, 1e-9, 7000.0));
    scenario
}

/// Follows the motion of a weak drive to a greater amplitude.
fn followed(scenario: &Scenario, to: f64) -> Branch {
    let start = PeriodicState::of(scenario).expect("a weak drive has one");
    let options = BranchOptions::default();
    let all = |_: &_| ControlFlow::Continue(());
    Branch::follow(start, DriveParameter::Amplitude, to, &options, all).expect("the range is right")
}

#[test]
fn a_branch_goes_around_its_folds_where_a_multiplier_is_one() {
    let branch = followed(&trimer_with_fold(), 6e-8);
    let folds: Vec<_> = branch.folds().collect();
    assert_eq!((folds.len(), branch.end), (2, BranchEnd::Range));
    // Steps of other lengths find them at the same amplitudes.
    let other = followed(&trimer_with_fold(), 1e-7);
    for (fold, other) in folds.into_iter().zip(other.folds()) {
        assert!((fold.value / other.value - 1.0).abs() < 1e-10);
        let nearest = fold.state.multipliers().iter().map(|one| (one - 1.0).norm());
        let nearest = nearest.fold(f64::INFINITY, f64::min);
        assert!(nearest < 1e-6, "{nearest:e}");
    }
    // It turns at each: the amplitude rises, falls and rises.
    let values: Vec<f64> = branch.points.iter().map(|point| point.value).collect();
    let turns = values.windows(3).filter(|w| (w[1] - w[0]) * (w[2] - w[1]) < 0.0);
    assert_eq!(turns.count(), 2);
}

#[test]
fn a_run_settles_on_the_state() {
    let mut scenario = short();
    scenario.chain.relaxation = 5e-6;
    scenario.drive.as_mut().unwrap().ramp = 1e-3;
    let state = PeriodicState::of(&scenario).unwrap();
    let mut run = Run::new(&scenario, Accuracy::REFERENCE).unwrap();
    run.to(400.0 * state.period()).unwrap();
    let (late, mut own) = (run.snapshot(), state.run());
    let first = own.snapshot();
    for bead in 1..=3 {
        let off = late.velocity(bead) / first.velocity(bead) - 1.0;
        assert!(off.abs() < 1e-8, "bead {bead}: {off:e}");
    }
}

#[test]
fn a_run_with_its_starts_is_in_the_motion() {
    let mut scenario = short();
    let state = PeriodicState::of(&scenario).unwrap();
    scenario.starts = state.starts();
    let mut run = Run::new(&scenario, Accuracy::REFERENCE).unwrap();
    let forces = |run: &mut Run| [1, 2, 3, 4].map(|contact| run.snapshot().force(contact));
    let start = forces(&mut run);
    run.to(state.period()).unwrap();
    for (start, end) in start.into_iter().zip(forces(&mut run)) {
        assert!((end / start - 1.0).abs() < 1e-11, "{start} {end}");
    }
}

#[test]
fn without_losses_no_disturbance_grows_or_dies() {
    let mut scenario = trimer(21, 2e-8, 5000.0);
    scenario.chain.relaxation = 0.0;
    let state = PeriodicState::of(&scenario).unwrap();
    assert!(state.is_stable());
    for multiplier in state.multipliers() {
        assert!((multiplier.norm() - 1.0).abs() < 1e-9, "{multiplier}");
    }
}

#[test]
fn a_period_doubles_where_a_multiplier_passes_minus_one() {
    // One bead between piston and wall, shaken at nearly twice its own frequency, 5542 Hz.
    let mut scenario = trimer(1, 1e-8, 10950.0);
    scenario.chain.relaxation = 5e-8;
    let branch = followed(&scenario, 1e-6);
    let mut found = branch.points.iter().filter_map(|point| point.bifurcation);
    assert_eq!(found.next(), Some(Bifurcation::PeriodDoubling));
}

#[test]
fn what_has_no_period_is_refused() {
    let drive = |quantity| Some(Drive::sine(quantity, 1e-8, 5000.0));
    let mut chirp = short();
    chirp.drive.as_mut().unwrap().frequency_end = Some(6000.0);
    chirp.drive.as_mut().unwrap().sweep = Some(0.1);
    let mut clipped = short();
    clipped.chain.contact_force = ContactForce::Clipped;
    let mut record = short();
    record.drive = Some(Drive::record(
        DriveQuantity::Displacement,
        vec![[0.0, 0.0], [1e-3, 1e-8]],
    ));
    let mut strike = Scenario::paper();
    strike.drive = None;
    let mut adrift = short();
    (adrift.drive, adrift.wall) = (drive(DriveQuantity::Force), None);
    let mut touching = short();
    touching.chain.precompression = 0.0;
    let endless = trimer(2001, 1e-8, 5000.0);
    for (scenario, words) in [
        (chirp, "drive.frequency_end: a chirp has no period"),
        (clipped, "chain.contact_force: clipped forces"),
        (record, "drive.samples: a record has no period"),
        (strike, "drive: a chain without a drive has no period"),
        (adrift, "wall: a chain that nothing holds in its place drifts"),
        (touching, "chain.precompression: beads that just touch"),
        (endless, "chain.beads: 2001 beads and 0 intruders have too many"),
    ] {
        says(&PeriodicState::of(&scenario).unwrap_err().to_string(), words, "");
    }
    let mut forced = short();
    forced.drive = drive(DriveQuantity::Force);
    let state = PeriodicState::of(&forced).unwrap();
    assert_eq!(state.multipliers().len(), 10);
    let options = BranchOptions::default();
    let follow = |to: f64| {
        let stop = |_: &_| ControlFlow::Break(());
        Branch::follow(state.clone(), DriveParameter::Amplitude, to, &options, stop)
    };
    for to in [-1.0, 1e-8, f64::NAN] {
        let words = "no branch goes from 0.00000001 to ";
        says(&follow(to).unwrap_err().to_string(), words, "");
    }
    let stopped = follow(1.0).unwrap();
    assert_eq!((stopped.end, stopped.points.len()), (BranchEnd::Stopped, 2));
}
