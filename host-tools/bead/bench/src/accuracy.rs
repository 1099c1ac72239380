//! Errors of the image's two estimates against the truth of a run.

use bead_wire::{Energy, Strike, StrikeFlags};
use schemars::JsonSchema;
use serde::Serialize;

use crate::emulation::Emulation;
use bead_recording::frames::Frame;
use bead_recording::strikes::assemble;

/// Greatest rms errors of estimates A and B that pass, as parts of the truth.
const GOALS: [f64; 2] = [5e-3, 1e-2];

/// Errors of the estimates of one run.
#[derive(Debug, Serialize, JsonSchema)]
pub struct EstimateErrors {
    /// Strikes that were measured.
    pub strikes: usize,
    /// Root mean square over the strikes, A and B, as a part of the truth. Without a strike, this and the
    /// worst are NaN: null in JSON.
    #[schemars(with = "[Option<f64>; 2]")]
    pub rms: [f64; 2],
    /// The greatest error, with its sign.
    #[schemars(with = "[Option<f64>; 2]")]
    pub worst: [f64; 2],
    /// Every flag that was set.
    pub flags: Vec<&'static str>,
}

impl EstimateErrors {
    /// True if every strike was measured within the sensors' range, and within the goals.
    pub fn pass(&self, struck: u32) -> bool {
        self.strikes == struck as usize
            && self.flags.iter().all(|flag| !flag.ends_with("railed"))
            && self.rms.iter().zip(GOALS).all(|(rms, goal)| *rms <= goal)
    }

    /// The errors of the first window after each strike. Later windows are echoes.
    pub fn of(run: &Emulation, frames: Vec<Frame>) -> Self {
        let (truth, mut begun, mut measured) = (&run.truth, None, Vec::new());
        for strike in assemble(frames, Some(run.settings)) {
            let before = std::mem::replace(&mut begun, truth.begun(strike.said.trigger_index));
            if begun.is_some() && begun != before {
                measured.push(strike.said);
            }
        }
        let absorbed = truth.truth.absorbed;
        let of = |energy: fn(&Strike) -> Energy| -> (f64, f64) {
            let error = |strike| energy(strike).joules() / absorbed - 1.0;
            let errors: Vec<f64> = measured.iter().map(error).collect();
            let squares: f64 = errors.iter().map(|error| error * error).sum();
            let worst = errors.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs()));
            ((squares / errors.len() as f64).sqrt(), worst.unwrap_or(f64::NAN))
        };
        let a = of(|strike| strike.absorbed_measured);
        let b = of(|strike| strike.absorbed_predicted);
        let flags = measured.iter().map(|strike| strike.flags);
        Self {
            strikes: measured.len(),
            rms: [a.0, b.0],
            worst: [a.1, b.1],
            flags: flags.fold(StrikeFlags::NONE, StrikeFlags::with).names().collect(),
        }
    }
}
