//! Reasons why no optimum was found.

use crate::scenario::InputError;
use crate::simulate::SimulateError;

/// Reason why no optimum was found.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OptimiseError {
    /// A scenario could not be run.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    /// A value of the [`Search`](crate::Search) cannot be used; the key is its field.
    #[error(transparent)]
    Search(InputError),
}

impl From<InputError> for OptimiseError {
    fn from(error: InputError) -> Self {
        Self::Simulate(error.into())
    }
}
