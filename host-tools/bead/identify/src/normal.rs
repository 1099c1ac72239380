//! Normal equations of strikes, with each strike's own numbers eliminated.
//!
//! # Design
//! All strikes share the quantities, and each has some numbers of its own, so the normal equations are an
//! arrow. The own numbers are eliminated strike by strike (a Schur complement), which leaves a matrix of the
//! size of the shared ones, however many strikes there are: a thousand strikes need no matrix of two
//! thousand columns.

use nalgebra::{DMatrix, DVector, SMatrix, SVector};

use crate::model::{Evaluation, SHARED};
use crate::quantity::Quantity;

/// A square matrix of the shared directions.
pub type SharedMatrix = SMatrix<f64, SHARED, SHARED>;
/// A vector of them.
pub type SharedVector = SVector<f64, SHARED>;

/// The normal equations of one strike, or the sum of many.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Normal {
    /// Information of the shared directions.
    pub information: SharedMatrix,
    /// Right side: information times the step that fits best.
    pub right: SharedVector,
    /// Sum of squared residuals.
    pub squares: f64,
    /// Residuals less own numbers.
    pub free: f64,
}

impl Normal {
    /// Adds another's equations.
    pub fn add(&mut self, other: &Self) {
        self.information += other.information;
        self.right += other.right;
        self.squares += other.squares;
        self.free += other.free;
    }
}

/// Normal equations of one strike with the step of its own numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct StrikeNormal {
    /// Those of the shared directions.
    pub shared: Normal,
    /// Inverse of the own numbers' information.
    own_inverse: DMatrix<f64>,
    own_right: DVector<f64>,
    /// Information between own and shared.
    mixed: DMatrix<f64>,
}

impl StrikeNormal {
    /// The equations of a whitened evaluation; `damping` (Marquardt's λ) applies to its own numbers. `None`
    /// if the own numbers cannot be told apart.
    pub fn new(evaluation: &Evaluation, damping: f64) -> Option<Self> {
        let residuals = &evaluation.residuals;
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let (own, shared) = (&evaluation.own, &evaluation.shared);
        let count = own.len();
        let mut own_information = DMatrix::zeros(count, count);
        for a in 0..count {
            for b in 0..=a {
                own_information[(a, b)] = dot(&own[a], &own[b]);
                own_information[(b, a)] = own_information[(a, b)];
            }
            own_information[(a, a)] *= 1.0 + damping;
        }
        let own_inverse = own_information.cholesky()?.inverse();
        let own_right = DVector::from_fn(count, |a, _| dot(&own[a], residuals));
        let mixed = DMatrix::from_fn(count, SHARED, |a, b| dot(&own[a], &shared[b]));
        let information = SharedMatrix::from_fn(|a, b| dot(&shared[a], &shared[b]));
        let right = SharedVector::from_fn(|a, _| dot(&shared[a], residuals));
        let carried = mixed.transpose() * &own_inverse;
        let shared = Normal {
            information: information - &carried * &mixed,
            right: right - &carried * &own_right,
            squares: dot(residuals, residuals),
            free: residuals.len() as f64 - count as f64,
        };
        let is_finite =
            shared.squares.is_finite() && shared.information.iter().all(|value| value.is_finite());
        is_finite.then_some(Self {
            shared,
            own_inverse,
            own_right,
            mixed,
        })
    }

    /// The step of the own numbers that goes with a step of the shared ones.
    pub fn own_step(&self, shared: &SharedVector) -> Vec<f64> {
        let step = &self.own_inverse * (&self.own_right - &self.mixed * shared);
        step.iter().copied().collect()
    }

    /// Variance of an own number, from the strike's data and from the variance of the shared quantities.
    pub fn own_variance(&self, number: usize, free: &[Quantity], covariance: &DMatrix<f64>) -> f64 {
        let carried = self.own_inverse.row(number) * &self.mixed;
        let slopes = DVector::from_fn(free.len(), |at, _| carried[free[at].place()]);
        self.own_inverse[(number, number)] + (slopes.transpose() * covariance * &slopes)[0]
    }

    /// Sum of squares after the best step of only the own numbers, if the model were linear.
    pub fn squares_without_own(&self) -> f64 {
        self.shared.squares - (self.own_right.transpose() * &self.own_inverse * &self.own_right)[0]
    }
}
