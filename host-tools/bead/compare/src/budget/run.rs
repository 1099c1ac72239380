//! A recorded strike through the bead's estimators, with other settings or other codes.

use bead_model::design::Description;
use bead_model::violation::SettingKey;
use bead_model::{Scan, Settings, Shape, Strike, Window, WindowRecord};
use bead_recording::physical::refusal;
use bead_recording::strikes::{RecordedStrike, ScanCodes};

use crate::budget::input::scale;
use crate::error::CompareError;

/// Relative step of an input in the difference quotient of a sensitivity. For the paper's strike, steps of
/// 0.5 to 8 % agree within 1 % for gains, masses and k: smaller steps show B's rounding, larger ones the
/// curvature of A over k. The sensitivities to κ and τ and B's to c, which are small, agree within 6 %.
const STEP: f64 = 0.02;

/// A strike that can be measured again.
pub(super) struct Rerun<'a> {
    pub(super) strike: &'a RecordedStrike,
    pub(super) description: Description,
    pub(super) settings: Settings,
    pub(super) scans: Vec<Scan>,
}

/// Change of both energies, J, for a relative change of an input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sensitivity {
    pub(super) of: [f64; 2],
    /// Difference from the change over a step twice as long.
    pub(super) error: [f64; 2],
}

impl<'a> Rerun<'a> {
    /// `description` has the settings that the strike was measured with, and their uncertainties.
    ///
    /// # Errors
    /// Samples are missing.
    pub(super) fn new(strike: &'a RecordedStrike, description: Description) -> Result<Self, CompareError> {
        if strike.missing() > 0 || strike.scans.is_empty() {
            return Err(CompareError::Unfit(format!(
                "strike {}: {} of its {} samples were not received, so it cannot be measured again; take another with --strike",
                strike.said.strike,
                strike.missing(),
                strike.said.samples
            )));
        }
        Ok(Self {
            strike,
            description,
            settings: derived(&description)?,
            scans: strike.scans.iter().map(ScanCodes::scan).collect(),
        })
    }

    /// A and B in J, with these settings and codes.
    pub(super) fn energies(&self, settings: &Settings, scans: &[Scan]) -> [f64; 2] {
        let (strike, _) = measured_again(&self.strike.said, settings, scans);
        [strike.absorbed_measured, strike.absorbed_predicted].map(|energy| energy.joules())
    }

    /// A and B in J, with an input moved by a part of itself.
    fn moved(&self, key: SettingKey, part: f64) -> Result<[f64; 2], CompareError> {
        let mut description = self.description;
        scale(&mut description, key, 1.0 + part);
        Ok(self.energies(&derived(&description)?, &self.scans))
    }

    /// The sensitivities to an input, by central differences.
    ///
    /// # Errors
    /// A bead cannot have the input a little greater or less.
    pub(super) fn sensitivity(&self, key: SettingKey) -> Result<Sensitivity, CompareError> {
        let slope = |step: f64| -> Result<[f64; 2], CompareError> {
            let (more, less) = (self.moved(key, step)?, self.moved(key, -step)?);
            Ok([0, 1].map(|i| (more[i] - less[i]) / (2.0 * step)))
        };
        let (of, coarse) = (slope(STEP)?, slope(2.0 * STEP)?);
        let error = [0, 1].map(|i| (coarse[i] - of[i]).abs());
        Ok(Sensitivity { of, error })
    }
}

/// The bead's result for the window of a strike, with these settings and codes.
pub(crate) fn measured_again(said: &Strike, settings: &Settings, scans: &[Scan]) -> (Strike, Shape) {
    let mut window = Window::open(said.strike, said.first_index);
    let mut record = WindowRecord::new();
    record.clear();
    window.process(settings, scans, &mut record);
    window.report(settings, &record)
}

/// The settings of a description.
///
/// # Errors
/// No bead can have them.
pub(super) fn derived(description: &Description) -> Result<Settings, CompareError> {
    Ok(Settings::new(description).map_err(|violation| refusal(description, violation))?)
}
