//! The length of the next slow step.

use super::*;
use crate::model::Model;
use crate::scenario::Scenario;

/// Result of [`better`] for a step over 20 blocks worth `worth` quick ones, with these errors; 1 is allowed.
fn part(error: impl Fn(usize) -> f64, worth: f64) -> f64 {
    let mut scenario = Scenario::paper();
    scenario.chain.beads = 239;
    let lanes = Lanes::new(&Model::new(&scenario));
    let awake: Vec<usize> = (0..lanes.blocks).collect();
    // All are pressed together, and at rest.
    let mut motion = Motion::zeros(&lanes);
    for body in 0..lanes.bodies {
        motion.u[BLOCK + body] = -1e-7 * body as f64;
    }
    let calm = Calm::new(&lanes, &awake, &motion, 1e-4);
    let blocks = count(&calm.runs);
    assert!(blocks >= 20, "{:?}", calm.runs);
    let step = 1e-6;
    let length = worth * step;
    let errors: Vec<f64> = (0..lanes.blocks).map(|block| error(block) / length).collect();
    better(&calm, &errors, length, step)
}

#[test]
fn a_slow_step_grows_where_no_block_minds_and_shrinks_until_none_does() {
    for worth in [5.0, 20.0, 300.0] {
        // Errors go as the ninth power: 1.25 makes 7.5 times as much, 0.8 a seventh, 0.64 a fiftieth.
        assert_eq!(part(|_| 0.0, worth), 1.25);
        assert_eq!(part(|_| 0.12, worth), 1.25);
        assert_eq!(part(|_| 0.15, worth), 1.0);
        assert_eq!(part(|_| 0.99, worth), 1.0);
        assert_eq!(part(|_| 1.01, worth), 0.8);
        assert_eq!(part(|_| 7.4, worth), 0.8);
        assert_eq!(part(|_| 7.5, worth), 0.64);
    }
}

#[test]
fn a_block_is_left_to_quick_steps_where_that_costs_less_than_shorter_ones_of_all() {
    // Twenty blocks and more cost 20/5 = 4 quick blocks a step, with a step longer by a quarter 0.8 less.
    let one = |block: usize| if block == 12 { 0.5 } else { 0.0 };
    assert_eq!(part(one, 4.0), 1.25);
    assert_eq!(part(one, 40.0), 1.0);
    // One that is too bad for any of them is left out, and the others go on.
    let bad = |block: usize| if block == 12 { 1e9 } else { 0.1 };
    assert_eq!(part(bad, 40.0), 1.25);
}
