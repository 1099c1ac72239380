//! What is read of a file.

use crate::waveform::trace::Trace;

/// Force, acceleration or both over time, by one instrument.
#[derive(Debug, Clone)]
pub struct Waveform {
    /// Force, N.
    pub force: Option<Trace>,
    /// Acceleration, m/s².
    pub acceleration: Option<Trace>,
    /// The time of the first row as the file has it, s. The traces count from there.
    pub start: f64,
    /// What was taken for granted, or done to the values: a sentence each.
    pub remarks: Vec<String>,
}

impl Waveform {
    /// From the first of its values to the last, s.
    pub fn seconds(&self) -> f64 {
        let ends = [&self.force, &self.acceleration].map(|trace| trace.as_ref().map_or(0.0, Trace::end));
        f64::max(ends[0], ends[1])
    }
}
