//! Beads left out of the computation of long chains, and beads that take longer steps, compared with runs
//! that move all bodies in every step.

use super::testing::{hosting, plain, start};
use crate::model::Model;
use crate::scenario::{ContactForce, Material, Scenario, Section, Start, Wall};

/// A wave that runs through all of a long chain.
fn long(beads: usize, relaxation: f64) -> Scenario {
    plain(beads, relaxation, 0.235e-3 * beads as f64)
}

/// The velocities at the end, and the mean numbers of bodies that a step computed, and that moved.
fn run(scenario: &Scenario, tolerance: f64, whole: bool) -> (Vec<f64>, f64, f64) {
    let model = Model::new(scenario);
    let mut stepper = start(&model, (0.0, &model.initial()), tolerance, 0.5);
    if whole {
        stepper.leave_nothing_out();
    }
    let [computed, moved] = stepper.run_to(scenario.duration).map(|sum| sum as f64);
    let velocities = stepper.present(&model)[model.bodies()..2 * model.bodies()].to_vec();
    let steps = stepper.steps as f64;
    (velocities, computed / steps, moved / steps)
}

/// The greatest error of a velocity over the greatest velocity, and numbers of bodies as above.
fn compared(scenario: &Scenario, tolerance: f64) -> (f64, f64, f64) {
    let (ours, few, all) = run(scenario, tolerance, false);
    let (whole, computed, _) = run(scenario, tolerance, true);
    assert!(computed > scenario.chain.beads as f64, "{computed} bodies");
    let greatest = whole.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
    let errors = ours.iter().zip(&whole).map(|(a, b)| (a - b).abs() / greatest);
    let error = errors.fold(0.0, f64::max);
    println!("{tolerance:e}: {error:.1e}, {few:.0} of {all:.0} bodies in a step");
    (error, few, all)
}

#[test]
fn a_pulse_in_a_long_chain_is_that_of_a_run_that_leaves_nothing_out() {
    for tolerance in [1e-10, 1e-12] {
        let (error, moved, _) = compared(&long(400, 0.0), tolerance);
        assert!(error < 10.0 * tolerance, "{error:e} at {tolerance:e}");
        assert!(moved < 32.0, "{moved} bodies moved");
    }
    // No step moves more bodies because the chain is longer.
    let (_, moved, _) = run(&long(3000, 0.0), 1e-8, false);
    assert!(moved < 32.0, "{moved} bodies");
}

#[test]
fn a_viscous_tail_and_ringing_intruders_are_those_of_a_run_that_leaves_nothing_out() {
    let scenario = hosting(long(96, 4.2e-6), [3, 20, 21, 50, 77]);
    for tolerance in [1e-6, 1e-10] {
        let (error, ..) = compared(&scenario, tolerance);
        assert!(error < 10.0 * tolerance, "{error:e} at {tolerance:e}");
    }
}

#[test]
fn a_viscous_tail_that_takes_longer_steps_is_that_of_a_run_that_does_not() {
    for tolerance in [1e-8, 1e-10, 1e-12] {
        let (error, few, all) = compared(&long(800, 4.2e-6), tolerance);
        assert!(error < tolerance.max(1e-11), "{error:e} at {tolerance:e}");
        assert!(few < 0.7 * all, "{few} of {all} bodies in a step");
    }
}

/// Long chains with every feature of a scenario.
fn long_ones() -> Vec<Scenario> {
    let mut scenarios: Vec<Scenario> = Vec::new();
    for relaxation in [2e-6, 4.2e-6, 2e-5] {
        let mut walled = plain(300, relaxation, 0.12);
        walled.wall = Some(Wall::flat(Material::STEEL));
        let mut clipped = hosting(plain(400, relaxation, 0.08), [3, 150]);
        clipped.chain.contact_force = ContactForce::Clipped;
        let mut sections = plain(400, relaxation, 0.09);
        sections.sections = vec![Section::of(150..=160)];
        sections.sections[0].relaxation = Some(0.5 * relaxation);
        let mut fast = plain(300, relaxation, 0.08);
        fast.striker.velocity = 3.0;
        // Two waves that meet, and a gap that closes.
        let mut starts = plain(400, relaxation, 0.09);
        starts.starts = vec![Start::moving([400], -0.2), Start::apart([200], 1e-6)];
        let mut loaded = plain(300, relaxation, 0.05);
        loaded.chain.precompression = 0.5;
        scenarios.extend([walled, clipped, sections, fast, starts, loaded]);
    }
    scenarios
}

#[test]
fn long_viscous_chains_of_every_kind_move_as_if_all_took_the_same_steps() {
    let mut parted = 0;
    for scenario in long_ones() {
        let (error, few, all) = compared(&scenario, 1e-10);
        assert!(error < 1e-9, "{error:e}\n{}", scenario.to_toml());
        parted += usize::from(few < 0.8 * all);
    }
    assert!(
        parted >= 8,
        "{parted} scenarios had blocks that took longer steps"
    );
}
