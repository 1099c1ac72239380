//! Beads left out of the computation of long chains, and beads that take longer steps, compared with runs
//! that move all bodies in every step.

use std::sync::Arc;

use super::{Lanes, Stepper};
use crate::model::Model;
use crate::oscillator::Oscillator;
use crate::scenario::{ContactForce, Intruder, Material, Scenario, Section, Start, Wall};

fn long(beads: usize, relaxation: f64) -> Scenario {
    let mut scenario = Scenario::paper();
    scenario.intruders.clear();
    scenario.chain.beads = beads;
    scenario.chain.relaxation = relaxation;
    scenario.duration = 0.235e-3 * beads as f64;
    scenario
}

/// The state at the end, and the mean numbers of bodies that a step computed, and that moved.
fn run(scenario: &Scenario, tolerance: f64, whole: bool) -> (Vec<f64>, f64, f64) {
    let model = Model::new(scenario);
    let lanes = Arc::new(Lanes::new(&model));
    let mut state = model.initial();
    let longest = model.shortest_contact() / 2.0;
    let mut stepper = Stepper::new(lanes, model.layout(), (0.0, &state), tolerance, longest);
    if whole {
        stepper.leave_nothing_out();
    }
    let (mut computed, mut moved) = (0, 0);
    while stepper.time < scenario.duration {
        stepper.advance(scenario.duration).expect("it goes on");
        computed += stepper.computed();
        moved += stepper.moving().map(|run| run.len()).sum::<usize>();
    }
    stepper.state(&mut state);
    let steps = stepper.steps as f64;
    (state, computed as f64 / steps, moved as f64 / steps)
}

/// Greatest difference of a velocity, as a part of the greatest.
fn apart(bodies: usize, one: &[f64], other: &[f64]) -> f64 {
    let velocities = bodies..2 * bodies;
    let greatest = other[velocities.clone()]
        .iter()
        .fold(0.0_f64, |a, b| a.max(b.abs()));
    let pairs = one[velocities.clone()].iter().zip(&other[velocities]);
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / greatest
}

#[test]
fn a_pulse_in_a_long_chain_is_that_of_a_run_that_leaves_nothing_out() {
    for tolerance in [1e-10, 1e-12] {
        let scenario = long(400, 0.0);
        let (windowed, moved, _) = run(&scenario, tolerance, false);
        let (whole, all, _) = run(&scenario, tolerance, true);
        let error = apart(401, &windowed, &whole);
        assert!(error < 10.0 * tolerance, "{error:e} at {tolerance:e}");
        assert!(moved < 32.0 && all >= 401.0, "{moved} of {all} bodies moved");
    }
}

#[test]
fn a_viscous_tail_and_ringing_intruders_are_those_of_a_run_that_leaves_nothing_out() {
    let mut scenario = long(96, 4.2e-6);
    let hosts = [3, 20, 21, 50, 77];
    scenario.intruders = vec![Intruder::new(hosts, Oscillator::PAPER)];
    for tolerance in [1e-6, 1e-10] {
        let error = apart(
            97,
            &run(&scenario, tolerance, false).0,
            &run(&scenario, tolerance, true).0,
        );
        assert!(error < 10.0 * tolerance, "{error:e} at {tolerance:e}");
    }
}

#[test]
fn no_step_moves_more_bodies_because_the_chain_is_longer() {
    let (_, moved, _) = run(&long(3000, 0.0), 1e-8, false);
    assert!(moved < 32.0, "{moved} bodies");
}

#[test]
fn a_viscous_tail_that_takes_longer_steps_is_that_of_a_run_that_does_not() {
    let scenario = long(800, 4.2e-6);
    for tolerance in [1e-8, 1e-10, 1e-12] {
        let (parted, few, all) = run(&scenario, tolerance, false);
        let (whole, _, _) = run(&scenario, tolerance, true);
        let error = apart(801, &parted, &whole);
        println!("{tolerance:e}: {error:.1e}, {few:.0} of {all:.0} bodies in a step");
        assert!(error < tolerance.max(1e-11), "{error:e} at {tolerance:e}");
        assert!(few < 0.7 * all, "{few} of {all} bodies in a step");
    }
}

/// Long chains with every feature of a scenario.
fn long_ones() -> Vec<Scenario> {
    let plain = |beads: usize, relaxation: f64, duration: f64| {
        let mut scenario = long(beads, relaxation);
        scenario.duration = duration;
        scenario
    };
    let mut scenarios: Vec<Scenario> = Vec::new();
    for relaxation in [2e-6, 4.2e-6, 2e-5] {
        let mut walled = plain(300, relaxation, 0.12);
        walled.wall = Some(Wall::flat(Material::STEEL));
        scenarios.push(walled);
        let mut clipped = plain(400, relaxation, 0.08);
        clipped.chain.contact_force = ContactForce::Clipped;
        clipped.intruders = vec![Intruder::new([3, 150], Oscillator::PAPER)];
        scenarios.push(clipped);
        let mut sections = plain(400, relaxation, 0.09);
        let mut other = Section::of(150..=160);
        other.relaxation = Some(0.5 * relaxation);
        sections.sections = vec![other];
        scenarios.push(sections);
        let mut fast = plain(300, relaxation, 0.08);
        fast.striker.velocity = 3.0;
        scenarios.push(fast);
        // Two waves that meet, and a gap that closes.
        let mut starts = plain(400, relaxation, 0.09);
        starts.starts = vec![Start::moving([400], -0.2), Start::apart([200], 1e-6)];
        scenarios.push(starts);
        let mut loaded = plain(300, relaxation, 0.05);
        loaded.chain.precompression = 0.5;
        scenarios.push(loaded);
    }
    scenarios
}

#[test]
fn long_viscous_chains_of_every_kind_move_as_if_all_took_the_same_steps() {
    let tolerance = 1e-10;
    let (mut worst, mut parted) = (0.0_f64, 0);
    for (number, scenario) in long_ones().into_iter().enumerate() {
        let (ours, few, all) = run(&scenario, tolerance, false);
        let (whole, ..) = run(&scenario, tolerance, true);
        let bodies = scenario.chain.beads + 1;
        let error = apart(bodies, &ours, &whole);
        println!("scenario {number}: {error:.1e}, {few:.0} of {all:.0} bodies in a step");
        assert!(
            error < 1e-9,
            "scenario {number}: {error:e}\n{}",
            scenario.to_toml()
        );
        worst = worst.max(error);
        parted += usize::from(few < 0.8 * all);
    }
    println!("worst: {worst:.1e}, {parted} of them parted");
    assert!(
        parted >= 8,
        "{parted} scenarios had blocks that took longer steps"
    );
}
