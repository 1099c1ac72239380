//! Why a figure is not drawn.

use std::fmt::Display;

use hertz_chain::{FitError, SimulateError};

/// Why a figure is not drawn.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A name that no figure has.
    #[error("{name}: no such figure; there are {known}")]
    Unknown {
        /// The name asked for.
        name: String,
        /// The names that exist, in one line.
        known: String,
    },
    /// A simulation did not reach its end.
    #[error(transparent)]
    Simulation(#[from] SimulateError),
    /// A fit to a simulation found nothing.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// A simulation lacks what the figure shows.
    #[error("{0}")]
    Missing(String),
    /// The chart cannot be drawn or written, such as an axis without extent.
    #[error("cannot draw \"{what}\"{form}: {reason}")]
    Drawing {
        /// The chart's description.
        what: String,
        /// The form of the picture, such as ` as pixels`; empty for SVG.
        form: &'static str,
        /// What the drawing crate says.
        reason: String,
    },
}

impl Error {
    /// A chart of this description cannot be drawn in this form.
    pub fn drawing(what: &str, form: &'static str, reason: impl Display) -> Self {
        Self::Drawing {
            what: what.to_owned(),
            form,
            reason: reason.to_string(),
        }
    }
}
