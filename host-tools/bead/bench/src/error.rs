//! Errors of runs of the image.

use stm32f405_qemu::RunError;

use bead_compare::error::CompareError;

/// Error of a run of the image. The message is one line: what, why, what next.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// The scenario cannot be read or integrated, or does not fit the bead.
    #[error(transparent)]
    Compare(#[from] CompareError),
    /// Bead, image, faults or address do not fit together.
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
    /// An error with the message `what` and its cause.
    pub(crate) fn unfit(what: &str, error: impl std::error::Error) -> Self {
        Self::Unfit(format!("{what}: {error}"))
    }
}
