//! Reasons why a comparison cannot be made.

use bead_recording::file::RecordingError;
use hertz_chain::{InputError, SimulateError};

/// A comparison cannot be made. The message is one line: what, why, what next.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
    /// The scenario cannot be read.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The scenario cannot be integrated.
    #[error(transparent)]
    Simulation(#[from] SimulateError),
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// Scenario, bead and recording do not fit each other.
    #[error("{0}")]
    Unfit(String),
}
