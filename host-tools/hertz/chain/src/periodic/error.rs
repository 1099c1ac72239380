//! Reasons why no motion that repeats was found.

use crate::options::SimulateError;
use crate::scenario::InputError;

/// Reason why there is no [`PeriodicState`](crate::PeriodicState).
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PeriodicError {
    /// A period of the motion cannot be simulated.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    /// Newton's method found no motion that repeats near its start.
    #[error(
        "no motion that repeats was found nearby: after {iterations} steps of Newton's method a period misses its start by {residual:.1e} of the motion; start from a state at a similar drive, or follow a branch to this one"
    )]
    NoState {
        /// Steps made.
        iterations: usize,
        /// Greatest distance between start and end of a period, as a part of the motion.
        residual: f64,
    },
}

impl From<InputError> for PeriodicError {
    fn from(error: InputError) -> Self {
        Self::Simulate(error.into())
    }
}
