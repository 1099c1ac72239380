//! Why a run of the image does not come about.

use hertz_chain::{InputError, SimulateError};
use stm32f405_qemu::RunError;

/// Why a run of the image does not come about. The message is one line: what, why, what next.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// The scenario cannot be read.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The scenario cannot be integrated.
    #[error(transparent)]
    Simulation(#[from] SimulateError),
    /// What was given does not make a run: the bead, the image, the faults, the address.
    #[error("{0}")]
    Unfit(String),
    /// The emulator refuses the image or its inputs, or fails.
    #[error(transparent)]
    Emulator(#[from] RunError),
    /// The image ran and did not do what a bead does.
    #[error("{0}")]
    Mute(String),
}

impl BenchError {
    /// `what`, and the error beneath it.
    pub(crate) fn unfit(what: &str, error: impl std::error::Error) -> Self {
        Self::Unfit(format!("{what}: {error}"))
    }
}
