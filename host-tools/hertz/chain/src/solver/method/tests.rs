//! The conditions that coefficients of a method of order 9 meet, with a dense output of order 8.

use super::*;

/// Σ weights[s] c[s]^k, where c are the times of the stages.
fn moment(weights: impl Fn(usize) -> f64, k: i32) -> f64 {
    let parts = (0..STAGES).map(|stage| weights(stage) * NODES[stage].powi(k));
    parts.sum()
}

#[track_caller]
fn near(one: f64, other: f64, most: f64) {
    assert!((one - other).abs() < most, "{one:e}, {other:e} expected");
}

/// The digits printed are good for 1e-14 of coefficients up to 70.
const PRINTED: f64 = 3e-13;

/// Weights of all stages in velocities, at the part `x` of a step.
fn inside(x: f64) -> [f64; STAGES] {
    POWERS.map(|powers| {
        let terms = powers.iter().rev();
        x * terms.fold(0.0, |sum, weight| sum * (x - 0.5) + weight.velocity)
    })
}

#[test]
fn every_row_integrates_as_many_powers_as_its_stage_needs() {
    for (row, weights) in ROWS.iter().enumerate() {
        // To fourth order from the ninth stage on, to ninth at the end, and to eighth for the dense output.
        let powers = match row {
            0 => continue,
            1 => 1,
            2 | 3 => 2,
            4..=6 => 3,
            7..MAIN => 4,
            MAIN => 9,
            _ => 7,
        };
        for k in 0..powers {
            let expected = NODES[row].powi(k + 1) / f64::from(k + 1);
            near(moment(|stage| weights[stage].velocity, k), expected, PRINTED);
        }
        // The second integral loses one power.
        for k in 0..powers - 1 {
            let expected = NODES[row].powi(k + 2) / f64::from((k + 1) * (k + 2));
            let found = moment(|stage| weights[stage].displacement, k);
            near(found, expected, 3.0 * PRINTED);
        }
        let mut later = weights[row.min(MAIN)..].iter().skip(1);
        assert!(later.all(|weight| row > MAIN || weight.velocity == 0.0));
    }
}

#[test]
fn the_estimate_of_the_error_is_what_an_order_of_eight_leaves() {
    let moment = |k: i32| {
        let parts = ERROR.iter().map(|&(stage, weight)| weight * NODES[stage].powi(k));
        parts.sum::<f64>()
    };
    for k in 0..8 {
        near(moment(k), 0.0, PRINTED);
    }
    assert!(moment(8).abs() > 1e-6, "{:e}", moment(8));
}

#[test]
fn inside_a_step_powers_up_to_the_seventh_are_integrated_and_straight_lines_exactly() {
    for x in [0.0, 0.1, 0.5, 0.77, 1.0] {
        let weights = inside(x);
        let twice = |stage: usize| {
            let powers = (0..TERMS).map(|k| POWERS[stage][k].displacement * (x - 0.5).powi(k as i32));
            x * powers.sum::<f64>()
        };
        for k in 0..8 {
            let most = if k < 2 { 1e-15 } else { 2e-11 };
            let n = f64::from(k);
            let velocity = moment(|stage| weights[stage], k);
            near(velocity, x.powi(k + 1) / (n + 1.0), 20.0 * most);
            // The second integral loses one power.
            if k < 7 {
                let displacement = moment(twice, k);
                let expected = x.powi(k + 2) / ((n + 1.0) * (n + 2.0));
                near(displacement, expected, 20.0 * most.max(1e-13));
            }
        }
    }
    // It ends where the step does, and begins with the first stage alone.
    for (stage, weight) in inside(1.0).into_iter().enumerate() {
        near(weight, quadrature(stage), 1e-15);
    }
    for (stage, powers) in POWERS.iter().enumerate() {
        let slope = |k: usize| powers[k].velocity * (-0.5_f64).powi(k as i32);
        let slope: f64 = (0..TERMS).map(slope).sum();
        near(slope, if stage == 0 { 1.0 } else { 0.0 }, 1e-9);
    }
}
