//! The facts of an emulated run that its recording carries: the truth, and the emulator's counts.

use serde::{Deserialize, Serialize};

use crate::front_end::{AnalogFrontEnd, SAMPLE_RATE_HZ};
use crate::sensed::Truth;

/// The truth of a run, as attached to its recording.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct RunTruth {
    /// The bead that senses.
    pub bead: usize,
    /// Peak force and absorbed energy of each strike by the full chain.
    pub truth: Truth,
    /// Start of each strike as a fractional sample index, in ascending order.
    pub starts: Vec<f64>,
    /// The front end of the sensors.
    pub front_end: AnalogFrontEnd,
    /// Seed of the noise; none without noise.
    pub seed: Option<u64>,
    /// Deviation of the bead's clock, ppm; negative if slow.
    #[serde(default)]
    pub clock_ppm: f64,
    /// Edges at the sync input: true time in s since the first triggered scan, which has the index 1.
    #[serde(default)]
    pub sync_edges: Vec<f64>,
    /// True time of the first triggered scan, in s on the time that all beads of the run share.
    #[serde(default)]
    pub began: f64,
    /// Intervals in which others held the trigger line low, in s as `sync_edges`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub line_low: Vec<[f64; 2]>,
    /// The waveform at the sensors, if it was not a strike of the chain. `truth` then has its highest force,
    /// and the energy that f64 estimates give around that, from the acceleration if the waveform has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stimulus: Option<StimulusFile>,
}

/// A file with the waveform at the sensors of a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct StimulusFile {
    /// Its name, without folders.
    pub name: String,
    /// Its SHA-256, in hexadecimal.
    pub sha256: String,
    /// True if the file has a force.
    pub force: bool,
    /// True if the file has an acceleration.
    pub acceleration: bool,
}

impl RunTruth {
    /// Fractional sample index at a true time in s since the first triggered scan.
    pub fn index_at(&self, time: f64) -> f64 {
        1.0 + time * (1.0 + self.clock_ppm * 1e-6) * f64::from(SAMPLE_RATE_HZ)
    }

    /// Number, from 0, of the last strike that began at this sample index or before; `None` before the first.
    pub fn begun(&self, sample_index: u64) -> Option<usize> {
        let begun = self.starts.partition_point(|&start| start <= sample_index as f64);
        begun.checked_sub(1)
    }
}

/// Counts of the emulator, as attached to the recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EmulatorReport {
    /// The file name of the image that was run, or `carried by bead`.
    pub image: String,
    /// The first line of `qemu-system-arm --version`, if that could be run.
    pub qemu: Option<String>,
    /// Instructions of each function, and of all.
    pub instructions_per_sample: InstructionsPerSample,
    /// Instructions that fit between two samples here. The core itself, at 168 MHz, has 1680 cycles.
    pub instructions_available: f64,
    /// ADC overruns that the emulated converter saw.
    pub overruns: u64,
    /// Resets after power-up.
    pub resets: usize,
    /// Scans that the timer triggered.
    pub scans: u64,
    /// Scans beyond a rail: force, acceleration.
    pub saturated: [usize; 2],
    /// Registers that the image touched and no model knows.
    pub unknown_registers: Vec<String>,
    /// Features that the image used and the emulator does not model.
    pub unmodelled: Vec<String>,
    /// Virtual time of the run, s.
    pub virtual_seconds: f64,
    /// The image's own log.
    pub log: Vec<String>,
}

/// Instructions executed for each sample.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct InstructionsPerSample {
    /// Estimate A, for each sample that it took; none if it took no sample.
    pub observer: Option<f64>,
    /// Estimate B and its square root, for each sample that it took; none if it took no sample.
    pub reduced_chain: Option<f64>,
    /// Calibration, peaks and the cut into chunks, for each sample of a window; none without a window.
    pub window: Option<f64>,
    /// The encoding of all frames, for each sample of a window; none without a window.
    pub framing: Option<f64>,
    /// The search for a strike, for each sample of the run; none if the image has no such function.
    pub trigger: Option<f64>,
    /// The whole image, for each sample of the blocks in which a strike was measured; none without a strike.
    pub total: Option<f64>,
    /// The whole image, for each sample of the busiest block; none if no block was taken.
    pub worst_block: Option<f64>,
    /// The whole image, for each sample of the blocks in which no strike was measured; none without such a
    /// block.
    pub idle: Option<f64>,
    /// The whole image, for each sample of the whole run, quiet and strikes.
    pub run: f64,
}

impl InstructionsPerSample {
    /// Each count with its name, as tables have them.
    pub fn rows(&self) -> [(&'static str, Option<f64>); 9] {
        [
            ("estimate A, observer", self.observer),
            ("estimate B, reduced chain", self.reduced_chain),
            ("calibration, peaks, chunks of a window", self.window),
            ("frames, by sample of a window", self.framing),
            ("trigger", self.trigger),
            ("all, while a strike is measured", self.total),
            ("all, in the busiest block", self.worst_block),
            ("all, while none is", self.idle),
            ("all, over the run", Some(self.run)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_strike_that_began_last_is_found_by_a_sample_index() {
        let begun = |starts: &[f64], index| {
            let truth = RunTruth {
                starts: starts.to_vec(),
                ..RunTruth::default()
            };
            truth.begun(index)
        };
        assert_eq!(begun(&[], u64::MAX), None);
        for (index, expected) in [(100, None), (101, Some(0)), (300, Some(1)), (u64::MAX, Some(2))] {
            assert_eq!(begun(&[100.25, 300.0, 500.75], index), expected, "{index}");
        }
        // A file may have them in any order; the answer is one of them.
        assert!(begun(&[500.0, f64::INFINITY, 100.0, -1.0], 200).is_none_or(|begun| begun < 4));
    }
}
