//! What is left out of the computation of long chains, against runs that leave nothing out.

use std::sync::Arc;

use super::{Lanes, Stepper};
use crate::model::Model;
use crate::oscillator::Oscillator;
use crate::scenario::{Intruder, Scenario};

fn long(beads: usize, relaxation: f64) -> Scenario {
    let mut scenario = Scenario::paper();
    scenario.intruders.clear();
    scenario.chain.beads = beads;
    scenario.chain.relaxation = relaxation;
    scenario.duration = 0.235e-3 * beads as f64;
    scenario
}

/// The state at the end, and the mean number of bodies that a step moved.
fn run(scenario: &Scenario, tolerance: f64, whole: bool) -> (Vec<f64>, f64) {
    let model = Model::new(scenario);
    let lanes = Arc::new(Lanes::new(&model));
    let mut state = model.initial();
    let longest = model.shortest_contact() / 2.0;
    let mut stepper = Stepper::new(lanes, model.layout(), (0.0, &state), tolerance, longest);
    if whole {
        stepper.leave_nothing_out();
    }
    let mut moved = 0;
    while stepper.time < scenario.duration {
        stepper.advance(scenario.duration).expect("it goes on");
        moved += stepper.moving().map(|run| run.len()).sum::<usize>();
    }
    stepper.state(&mut state);
    (state, moved as f64 / stepper.steps as f64)
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
        let (windowed, moved) = run(&scenario, tolerance, false);
        let (whole, all) = run(&scenario, tolerance, true);
        let error = apart(401, &windowed, &whole);
        assert!(error < 10.0 * tolerance, "{error:e} at {tolerance:e}");
        assert!(moved < 32.0 && all == 401.0, "{moved} of {all} bodies moved");
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
    let (_, moved) = run(&long(3000, 0.0), 1e-8, false);
    assert!(moved < 32.0, "{moved} bodies");
}

#[test]
#[ignore]
fn probe() {
    for beads in [256, 1024, 4096usize] {
        let scenario = long(beads, 4.2e-6);
        for rate in [1.0] {
        let model = Model::new(&scenario);
        let lanes = Arc::new(Lanes::new(&model));
        let state = model.initial();
        let longest = model.shortest_contact() / rate;
        let clock = std::time::Instant::now();
        let mut stepper = Stepper::new(lanes.clone(), model.layout(), (0.0, &state), 1e-10, longest);
        while stepper.time < scenario.duration {
            stepper.advance(scenario.duration).expect("it goes on");
        }
        println!("beads {beads} longest/{rate} steps {} wall {:.4} {}", stepper.steps, clock.elapsed().as_secs_f64(), stepper.report());
        let mut ours = state.clone();
        stepper.state(&mut ours);
        if beads < 2000 {
            let (whole, _) = run(&scenario, 1e-10, true);
            println!("  error {:e}", apart(beads + 1, &ours, &whole));
            let (finest, _) = run(&scenario, 1e-12, true);
            println!("  error against 1e-12: {:e}, whole's {:e}", apart(beads + 1, &ours, &finest), apart(beads + 1, &whole, &finest));
        }
        }
    }
}
