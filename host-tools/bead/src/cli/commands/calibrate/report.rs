//! The result of `bead calibrate`.

use bead_calibrate::calibration::Calibration;
use bead_calibrate::conformity::Conformity;
use bead_model::design::Day;
use bead_recording::physical::Change;

use crate::cli::commands::prelude::*;

/// The result as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct CalibrateReport {
    /// The calibration.
    #[serde(flatten)]
    pub(super) calibration: Calibration,
    /// Day of the calibration.
    pub(super) calibrated: Day,
    /// Number of the certificate, as the settings have it.
    pub(super) certificate: String,
    /// Statement of conformity, if one was asked for.
    pub(super) conformity: Option<Conformity>,
    /// Doubts that were overruled.
    pub(super) doubts: Vec<String>,
    /// Keys of the settings file that changed; empty without --update.
    pub(super) changes: Vec<Change>,
    /// The truth of a bead without hardware.
    pub(super) truth: Option<Vec<TrueValue>>,
}

/// The truth of a result.
#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct TrueValue {
    /// Name of the result.
    pub(super) result: &'static str,
    /// The true value, in its unit.
    pub(super) value: f64,
    /// Deviation of the result from it, in units of its expanded uncertainty.
    pub(super) deviation_over_expanded: f64,
}
