//! The Runge-Kutta method with its dense output, as constants: loops over a row have the coefficients in
//! place.

use std::ops::Range;

use super::verner::{A, EMBEDDED, INSIDE, INSIDE_STAGES, MAIN, STAGES};
use crate::tableau::{Square, nodes, spread, twice};

/// Weights of a stage in a sum: for velocities, over h, and for displacements, over h².
#[derive(Debug, Clone, Copy)]
pub(super) struct Weight {
    pub(super) velocity: f64,
    pub(super) displacement: f64,
}

impl Weight {
    pub(super) const ZERO: Self = Self {
        velocity: 0.0,
        displacement: 0.0,
    };
}

const DENSE_ROWS: Square<STAGES> = spread(&A);
/// Displacements below this are zeros with rounding.
const NOISE: f64 = 1e-15;

/// Weights of the arguments of the stages. The argument of stage [`MAIN`] is the end of the step.
pub(super) static ROWS: [[Weight; STAGES]; STAGES] = {
    let mut rows = [[Weight::ZERO; STAGES]; STAGES];
    let mut row = 0;
    while row < STAGES {
        let displacements = twice(&DENSE_ROWS, &DENSE_ROWS[row], NOISE);
        let mut stage = 0;
        while stage < STAGES {
            rows[row][stage].velocity = DENSE_ROWS[row][stage];
            rows[row][stage].displacement = displacements[stage];
            stage += 1;
        }
        row += 1;
    }
    rows
};

/// Time of each stage, as a part of the step.
pub(super) const NODES: [f64; STAGES] = nodes(&DENSE_ROWS);

/// Makes one step of length `h` from time `t` and state `y` of a system of first order, y' = f(t, y).
pub(crate) fn step<const N: usize>(
    rate: impl Fn(f64, [f64; N]) -> [f64; N],
    t: f64,
    y: [f64; N],
    h: f64,
) -> [f64; N] {
    let mut rates = [[0.0; N]; MAIN];
    let argument = |stage: usize, rates: &[[f64; N]; MAIN]| {
        let mut sum = y;
        for &(before, weight) in A[stage] {
            for (component, rate) in sum.iter_mut().zip(rates[before]) {
                *component += h * weight * rate;
            }
        }
        sum
    };
    for stage in 0..MAIN {
        rates[stage] = rate(t + NODES[stage] * h, argument(stage, &rates));
    }
    argument(MAIN, &rates)
}

/// Weight of a stage in an integral over the step.
pub(super) const fn quadrature(stage: usize) -> f64 {
    DENSE_ROWS[MAIN][stage]
}

/// Weights of the estimated error of velocities.
pub(super) static ERROR: &[(usize, f64)] = &{
    // The first stage, and those from the seventh on.
    let mut error = [(0, 0.0); 10];
    let mut at = 0;
    while at < error.len() {
        let stage = if at == 0 { 0 } else { at + 6 };
        error[at] = (stage, DENSE_ROWS[MAIN][stage]);
        at += 1;
    }
    let mut from = 0;
    while from < EMBEDDED.len() {
        let (stage, weight) = EMBEDDED[from];
        error[if stage == 0 { 0 } else { stage - 6 }].1 -= weight;
        from += 1;
    }
    error
};

/// Number of coefficients of a weight of the dense output.
pub(super) const TERMS: usize = 8;

/// Weights of the dense output, stage by stage. At the part x of the step a weight is x Σ POWERS[k] s^k with
/// s = x - 1/2. In powers of x itself the terms would be ten thousand times the sum, and so would their
/// rounding.
pub(super) const POWERS: [[Weight; TERMS]; STAGES] = {
    let mut velocities = [[0.0; TERMS]; STAGES];
    let mut stage = 0;
    while stage < INSIDE.len() {
        velocities[INSIDE_STAGES[stage]] = about_the_middle(&INSIDE[stage]);
        stage += 1;
    }
    // The published digits leave an error of 1e-11. It is removed by the first stage and that at the end, so
    // that constant and linear rates are integrated exactly.
    let mut power = 1;
    while power < TERMS {
        let (mut moment, mut sum, mut stage) = (0.0, 0.0, 0);
        while stage < STAGES {
            moment += NODES[stage] * velocities[stage][power];
            sum += velocities[stage][power];
            stage += 1;
        }
        let moment = moment - if power == 1 { 0.5 } else { 0.0 };
        velocities[MAIN][power] -= moment;
        velocities[0][power] -= sum - moment;
        power += 1;
    }
    // The output ends where the step does.
    stage = 0;
    while stage < STAGES {
        let (mut rest, mut power) = (0.0, TERMS - 1);
        while power > 0 {
            rest = 0.5 * (rest + velocities[stage][power]);
            power -= 1;
        }
        velocities[stage][0] = DENSE_ROWS[MAIN][stage] - rest;
        stage += 1;
    }
    let mut powers = [[Weight::ZERO; TERMS]; STAGES];
    let mut power = 0;
    while power < TERMS {
        let mut weights = [0.0; STAGES];
        let mut stage = 0;
        while stage < STAGES {
            weights[stage] = velocities[stage][power];
            stage += 1;
        }
        let displacements = twice(&DENSE_ROWS, &weights, NOISE);
        stage = 0;
        while stage < STAGES {
            powers[stage][power].velocity = weights[stage];
            powers[stage][power].displacement = displacements[stage];
            stage += 1;
        }
        power += 1;
    }
    powers
};

/// Stages after the first with a weight inside a step.
pub(super) const LATE_STAGES: Range<usize> = {
    let mut from = 1;
    while POWERS[from][TERMS - 1].displacement == 0.0 {
        from += 1;
    }
    from..STAGES
};

/// Converts a polynomial Σ c[k] x^(k+1) to powers of x - 1/2, but for the term without x.
const fn about_the_middle(coefficients: &[f64; TERMS - 1]) -> [f64; TERMS] {
    let (mut shifted, mut from) = ([0.0; TERMS], 1);
    while from < TERMS {
        shifted[from] = coefficients[from - 1];
        from += 1;
    }
    from = 0;
    while from < TERMS {
        let mut at = TERMS - 1;
        while at > from {
            shifted[at - 1] += 0.5 * shifted[at];
            at -= 1;
        }
        from += 1;
    }
    shifted
}

#[cfg(test)]
mod tests;
