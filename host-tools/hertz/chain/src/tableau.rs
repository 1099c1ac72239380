//! Tableaus of Runge-Kutta methods in the form for systems of second order, computed by the compiler.
//!
//! # Design
//!
//! Accelerations F are functions of displacements U and velocities V, and U' = V. The argument of stage s is
//! therefore
//!
//! ```text
//! V + h Σ a[s][k] F[k]     and     U + c[s] h V + h² Σ (a·a)[s][k] F[k]
//! ```
//!
//! This is the same method, but only accelerations need be kept, and each is read once for both sums.

/// Weights of N stages in the argument of each.
pub(crate) type Square<const N: usize> = [[f64; N]; N];

/// The rows of a tableau with their zeros, from pairs of a stage and its weight.
pub(crate) const fn spread<const N: usize>(rows: &[&[(usize, f64)]; N]) -> Square<N> {
    let mut square = [[0.0; N]; N];
    let mut row = 0;
    while row < N {
        let mut at = 0;
        while at < rows[row].len() {
            let (stage, weight) = rows[row][at];
            square[row][stage] = weight;
            at += 1;
        }
        row += 1;
    }
    square
}

/// Time of each stage, as a part of the step.
pub(crate) const fn nodes<const N: usize>(rows: &Square<N>) -> [f64; N] {
    let mut nodes = [0.0; N];
    let mut at = 0;
    while at < N * N {
        nodes[at / N] += rows[at / N][at % N];
        at += 1;
    }
    nodes
}

/// Weights of the stages in displacements where `weights` are those in velocities. Below `noise` they are
/// zero.
pub(crate) const fn twice<const N: usize>(rows: &Square<N>, weights: &[f64; N], noise: f64) -> [f64; N] {
    let mut sums = [0.0; N];
    let mut stage = 0;
    while stage < N {
        let (mut sum, mut j) = (0.0, 0);
        while j < N {
            sum += weights[j] * rows[j][stage];
            j += 1;
        }
        sums[stage] = if sum < noise && sum > -noise { 0.0 } else { sum };
        stage += 1;
    }
    sums
}
