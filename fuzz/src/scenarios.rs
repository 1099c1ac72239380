//! Scenarios in TOML, and the models of those that are accepted.

use hertz_chain::{Model, Scenario};

use crate::text;

/// Beads of the longest chain whose model is made.
const BEADS_MOST: usize = 300;

/// Reads the bytes as a scenario.
///
/// # Panics
/// A scenario that was accepted is not written as it was read, or has no model of finite masses.
pub fn check(bytes: &[u8]) {
    let Some(text) = text::of(bytes) else { return };
    let scenario = match Scenario::from_toml(text, "a.toml") {
        Ok(scenario) => scenario,
        Err(error) => return text::one_line(&error),
    };
    let written = scenario.to_toml();
    let again = Scenario::from_toml(&written, "b.toml").expect("what was written is a scenario");
    assert_eq!(again, scenario);
    if scenario.chain.beads > BEADS_MOST {
        return;
    }
    match Model::of(&scenario) {
        Ok(model) => {
            for body in 0..model.bodies() {
                let mass = model.mass(body);
                assert!(mass.is_finite() && mass > 0.0, "body {body}: {mass} kg");
            }
        }
        Err(error) => text::one_line(&error),
    }
}
