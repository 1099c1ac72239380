//! Why a drawing is not made.

use std::fmt::Display;

/// Why a chart is not drawn, such as for an axis without extent.
#[derive(Debug, thiserror::Error)]
#[error("cannot draw \"{chart}\"{form}: {reason}")]
pub struct Error {
    /// The chart's description.
    chart: String,
    /// The form of the picture, such as ` as pixels`; empty for SVG.
    form: &'static str,
    /// The reason, in words.
    reason: String,
}

impl Error {
    /// A chart of this description cannot be drawn in this form: ` as PNG`, or empty for SVG.
    pub fn new(chart: &str, form: &'static str, reason: impl Display) -> Self {
        Self {
            chart: chart.to_owned(),
            form,
            reason: reason.to_string(),
        }
    }
}
