//! Scenarios in TOML, and the models of those that are accepted.

use hertz_chain::{Accuracy, Model, Run, Scenario, SimulateError};

use crate::text;

/// Beads of the longest chain whose model is made.
const BEADS_MOST: usize = 300;

/// Beads of the longest chain that is struck, and steps that it goes.
const STRUCK_MOST: usize = 40;
const STEPS: usize = 8;

/// Reads the bytes as a scenario.
///
/// # Panics
/// A scenario that was accepted is not written as it was read, has no model of finite masses,
/// stiffnesses and energy, or is struck and nothing finite moves.
pub fn check(bytes: &[u8]) {
    let Some(scenario) = text::read(bytes, |text| Scenario::from_toml(text, "a.toml")) else {
        return;
    };
    let written = scenario.to_toml();
    let again = Scenario::from_toml(&written, "b.toml").expect("what was written is a scenario");
    assert_eq!(again, scenario);
    if scenario.chain.beads > BEADS_MOST {
        return;
    }
    let Some(model) = text::accepted(Model::of(&scenario)) else {
        return;
    };
    for body in 0..model.bodies() {
        let mass = model.mass(body);
        assert!(mass.is_finite() && mass > 0.0, "body {body}: {mass} kg");
    }
    for contact in (1..=model.contacts()).map(|number| model.contact(number)) {
        let (stiffness, overlap) = (contact.stiffness, contact.static_overlap);
        assert!(stiffness.is_finite() && stiffness > 0.0, "{contact:?}");
        assert!(
            overlap.is_finite() && (overlap > 0.0) == (contact.load > 0.0),
            "{contact:?}"
        );
    }
    let energy = model.initial_energy();
    assert!(energy.is_finite() && energy > 0.0, "{energy} J");
    if scenario.chain.beads <= STRUCK_MOST {
        let mut run = Run::new(&scenario, Accuracy::DRAFT).expect("it has been checked");
        strike(&mut run, scenario.duration);
    }
}

/// Checks that time passes in each step, and that all velocities are finite.
fn strike(run: &mut Run, end: f64) {
    let bodies = run.model().bodies();
    for _ in 0..STEPS {
        let from = run.time();
        match run.step(end) {
            Ok(_) => {}
            Err(SimulateError::Stuck { time }) => return assert!((from..end).contains(&time), "{time} s"),
            Err(error) => panic!("{error}"),
        }
        assert!(
            run.time() > from && run.time() <= end,
            "{from} s to {} s",
            run.time()
        );
        let now = run.snapshot();
        for body in 0..bodies {
            assert!(now.velocity(body).is_finite(), "body {body} at {} s", now.time());
        }
        if run.time() == end {
            return;
        }
    }
}
