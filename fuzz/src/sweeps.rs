//! Sweeps in TOML, and the points of those that are accepted.

use hertz_sweep::definition::Definition;
use hertz_sweep::plan::Plan;

use crate::text;

/// Reads the bytes as a sweep.
///
/// # Panics
/// A plan is not the same after it was written, or a point of it has a row of another width.
pub fn check(bytes: &[u8]) {
    let read = |text: &str| Definition::from_toml(text, "a.toml").and_then(Plan::new);
    let Some(plan) = text::read(bytes, read) else {
        return;
    };
    let written = plan.definition().to_toml();
    let again = Definition::from_toml(&written, "b.toml").expect("what was written is a sweep");
    let again = Plan::new(again).expect("what was written is a sweep");
    assert_eq!((again.hash(), again.points()), (plan.hash(), plan.points()));
    let width = plan.columns().len();
    let points = plan.points();
    for point in [0, points / 2, points.saturating_sub(1)] {
        assert_eq!(plan.places(point).len(), plan.axes().len());
        if let Ok(scenario) = plan.scenario(point) {
            let _ = scenario.check();
        }
        assert_eq!(plan.row(point, &Err("a failure".to_owned())).len(), width);
    }
}
