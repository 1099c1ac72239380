//! Why a figure is not drawn.

use hertz_chain::{FitError, InputError, OptimiseError, PeriodicError, SimulateError};

/// Why a figure is not drawn.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A name that no figure has.
    #[error("{name}: no such figure; the figures are {known}")]
    Unknown {
        /// The name asked for.
        name: String,
        /// The names that exist, in one line.
        known: String,
    },
    /// A scenario cannot be used.
    #[error(transparent)]
    Scenario(#[from] InputError),
    /// A simulation did not reach its end.
    #[error(transparent)]
    Simulation(#[from] SimulateError),
    /// A fit to a simulation found nothing.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// A search for intruders did not begin or ended early.
    #[error(transparent)]
    Search(#[from] OptimiseError),
    /// A motion that repeats was not found.
    #[error(transparent)]
    Periodic(#[from] PeriodicError),
    /// A simulation lacks what the figure shows.
    #[error("{0}")]
    Missing(String),
}
