//! A waveform.

use crate::trace::Trace;

/// Force, acceleration or both over time, by one instrument.
#[derive(Debug, Clone)]
pub struct Waveform {
    /// Force, N.
    pub force: Option<Trace>,
    /// Acceleration, m/s².
    pub acceleration: Option<Trace>,
    /// Time of the first row in the file, s. The traces count from there.
    pub start: f64,
    /// Assumptions about the file and changes to the values, a sentence each.
    pub remarks: Vec<String>,
}

impl Waveform {
    /// Duration from the first value to the last, s.
    pub fn seconds(&self) -> f64 {
        let ends = [&self.force, &self.acceleration].map(|trace| trace.as_ref().map_or(0.0, Trace::end));
        f64::max(ends[0], ends[1])
    }
}
