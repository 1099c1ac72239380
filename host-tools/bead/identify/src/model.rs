//! A strike as a least-squares problem.

use crate::quantity::{COUNT, Values};
use crate::series::Channel;

/// A place of the tangent of a spring that hardens, after those of the quantities: along k₃, N/m³.
pub const HARDENING: usize = COUNT;
/// Number of tangents that are common to all strikes.
pub const SHARED: usize = COUNT + 1;

/// Residuals of a strike, whitened, and their derivatives.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    /// Measured less computed, in standard deviations of the noise.
    pub residuals: Vec<f64>,
    /// Derivatives of the *computed* values with respect to the logarithm of each quantity, and along k₃; a
    /// quantity that has no part is empty.
    pub shared: [Vec<f64>; SHARED],
    /// Derivatives with respect to what this strike has of its own.
    pub own: Vec<Vec<f64>>,
}

/// A strike whose signals can be computed from the quantities and what it has of its own: its speed, its
/// moment, its zeros.
pub trait StrikeModel: Sync {
    /// The strike's own numbers at the start of a fit.
    fn own(&self) -> Vec<f64>;

    /// Computes residuals and derivatives; those of the shared directions may be left out, and are empty
    /// then.
    ///
    /// # Errors
    /// Why it has none at these values, as the end of a sentence.
    fn evaluate(&self, values: &Values, own: &[f64], with_shared: bool) -> Result<Evaluation, String>;

    /// Stroke of the intruder at its greatest, m.
    fn stroke(&self, values: &Values, own: &[f64]) -> f64;

    /// The samples that have a part, measured and computed, channel by channel.
    ///
    /// # Errors
    /// As of [`StrikeModel::evaluate`].
    fn samples(&self, values: &Values, own: &[f64]) -> Result<Vec<SignalSample>, String>;
}

/// A sample of a strike, N or m/s².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SignalSample {
    /// Its channel.
    pub channel: Channel,
    /// Time from the trigger, s.
    pub time: f64,
    /// Measured.
    pub measured: f64,
    /// Computed.
    pub computed: f64,
    /// Standard deviation of the noise.
    pub deviation: f64,
}
