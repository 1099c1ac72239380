//! The Runge-Kutta method in the form that a system of second order takes.
//!
//! # Design
//!
//! Accelerations F follow from displacements U and velocities V, and U' = V. So the argument of stage s is
//!
//! ```text
//! V + h Σ a[s][k] F[k]     and     U + c[s] h V + h² Σ (a·a)[s][k] F[k]
//! ```
//!
//! This is the same method, but only accelerations need be kept, and each is read once for both sums. All is
//! computed by the compiler, so the loops over a row have their numbers in place.

use super::verner::{A, EMBEDDED, INSIDE, MAIN, STAGES};

/// What one stage weighs in a sum: for velocities, over h, and for displacements, over h².
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

type Square = [[f64; STAGES]; STAGES];

const DENSE_ROWS: Square = {
    let mut square = [[0.0; STAGES]; STAGES];
    let mut row = 0;
    while row < STAGES {
        let mut at = 0;
        while at < A[row].len() {
            let (stage, weight) = A[row][at];
            square[row][stage] = weight;
            at += 1;
        }
        row += 1;
    }
    square
};

/// Σ weights[j] a[j][stage]. Less than 1e-15 is zero but for rounding.
const fn twice(weights: &[f64; STAGES], stage: usize) -> f64 {
    let (mut sum, mut j) = (0.0, 0);
    while j < STAGES {
        sum += weights[j] * DENSE_ROWS[j][stage];
        j += 1;
    }
    if sum < 1e-15 && sum > -1e-15 { 0.0 } else { sum }
}

/// Sums that give the arguments of the stages. That of stage [`MAIN`] is the end of the step.
pub(super) const ROWS: [[Weight; STAGES]; STAGES] = {
    let mut rows = [[Weight::ZERO; STAGES]; STAGES];
    let mut row = 0;
    while row < STAGES {
        let mut stage = 0;
        while stage < STAGES {
            rows[row][stage] = Weight {
                velocity: DENSE_ROWS[row][stage],
                displacement: twice(&DENSE_ROWS[row], stage),
            };
            stage += 1;
        }
        row += 1;
    }
    rows
};

/// The weights of a row that are not zero, with their stages.
#[derive(Debug)]
pub(super) struct Row {
    weights: [(usize, Weight); STAGES],
    count: usize,
}

impl Row {
    #[inline(always)]
    pub(super) fn weights(&self) -> &[(usize, Weight)] {
        &self.weights[..self.count]
    }
}

pub(super) static SPARSE: [Row; STAGES] = {
    let mut rows = [const {
        Row {
            weights: [(0, Weight::ZERO); STAGES],
            count: 0,
        }
    }; STAGES];
    let mut row = 0;
    while row < STAGES {
        let (mut stage, mut count) = (0, 0);
        while stage < STAGES {
            let weight = ROWS[row][stage];
            if weight.velocity != 0.0 || weight.displacement != 0.0 {
                rows[row].weights[count] = (stage, weight);
                count += 1;
            }
            stage += 1;
        }
        rows[row].count = count;
        row += 1;
    }
    rows
};

/// Where in the step each stage lies.
pub(super) const NODES: [f64; STAGES] = {
    let mut nodes = [0.0; STAGES];
    let mut row = 0;
    while row < STAGES {
        let mut stage = 0;
        while stage < STAGES {
            nodes[row] += DENSE_ROWS[row][stage];
            stage += 1;
        }
        row += 1;
    }
    nodes
};

/// What a stage weighs in an integral over the step.
pub(super) const fn quadrature(stage: usize) -> f64 {
    DENSE_ROWS[MAIN][stage]
}

/// The estimate of the error of velocities.
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

/// Powers of the dense output, stage by stage.
pub(super) static POWERS: [[Weight; 8]; STAGES] = {
    // The printed digits leave a trace of 1e-11. So that constant and linear rates are integrated exactly, it is
    // taken from the first stage and that at the end; and the last power makes the output end where the step
    // does.
    let mut velocities = INSIDE;
    let mut power = 0;
    while power < 7 {
        let (mut moment, mut sum, mut stage) = (0.0, 0.0, 0);
        while stage < STAGES {
            moment += NODES[stage] * INSIDE[stage][power];
            sum += INSIDE[stage][power];
            stage += 1;
        }
        let moment = moment - if power == 1 { 0.5 } else { 0.0 };
        let sum = sum - moment - if power == 0 { 1.0 } else { 0.0 };
        velocities[MAIN][power] -= moment;
        velocities[0][power] -= sum;
        power += 1;
    }
    let mut stage = 0;
    while stage < STAGES {
        let (mut sum, mut power) = (0.0, 0);
        while power < 7 {
            sum += velocities[stage][power];
            power += 1;
        }
        velocities[stage][7] = DENSE_ROWS[MAIN][stage] - sum;
        stage += 1;
    }
    let mut powers = [[Weight::ZERO; 8]; STAGES];
    let mut power = 0;
    while power < 8 {
        let mut weights = [0.0; STAGES];
        let mut stage = 0;
        while stage < STAGES {
            weights[stage] = velocities[stage][power];
            stage += 1;
        }
        stage = 0;
        while stage < STAGES {
            powers[stage][power] = Weight {
                velocity: weights[stage],
                displacement: twice(&weights, stage),
            };
            stage += 1;
        }
        power += 1;
    }
    powers
};

/// The weights of all stages at the part `x` of a step.
pub(super) fn inside(x: f64) -> [Weight; STAGES] {
    POWERS.map(|powers| {
        powers.iter().rev().fold(Weight::ZERO, |sum, weight| Weight {
            velocity: (sum.velocity + weight.velocity) * x,
            displacement: (sum.displacement + weight.displacement) * x,
        })
    })
}
