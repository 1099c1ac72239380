//! The strikes of one bead against the simulation, and the verdict on them.

use bead_model::Settings;
use bead_wire::{Counters, Identity, Status};

use crate::budget::expanded_noise;
use crate::emulated::{EmulatorReport, RunTruth};
use crate::replay::replay;
use crate::report::count;
use crate::spread::{Deviations, Spread};
use crate::strike::{FullChain, StrikeComparison};
use crate::velocity::FittedVelocity;
use crate::verdict::{Echoes, Soundness, failure};
use bead_recording::file::{Part, Recording, RecordingError};
use bead_recording::strikes::RecordedStrike;

/// Greatest number of strikes that are kept. Means and verdicts cover all.
pub(crate) const STRIKES_MOST: usize = 10_000;

/// The strikes of a bead beside the simulation.
#[derive(Debug, Default)]
pub struct ComparedBead {
    /// The first 10 000 strikes. Only the first that was received whole has curves.
    pub strikes: Vec<StrikeComparison>,
    /// Number of strikes, including those that are not kept.
    pub count: usize,
    /// Number of echoes.
    pub echoes: usize,
    /// Mean and scatter of A and of B against their goals.
    pub spread: [Spread; 2],
    /// The checks of the run as a whole.
    pub soundness: Soundness,
    /// The first difference of a replay, echoes included.
    pub first_difference: Option<String>,
    /// The first reason why a strike or an echo could not be replayed to its end.
    pub replay_incomplete: Option<String>,
    /// The first check that failed, gravest first.
    pub failure: Option<String>,
    /// True if a strike left the range of a sensor.
    pub is_railed: bool,
    /// The settings of the first strike that has any.
    pub settings: Option<Settings>,
    /// Counts of the bead's frames.
    pub counters: Counters,
    /// The bead's last identity.
    pub identity: Option<Identity>,
    /// The bead's last status.
    pub status: Option<Status>,
    /// The emulator's measurements, of an emulated run.
    pub emulator: Option<EmulatorReport>,
}

impl ComparedBead {
    /// Compares each strike of a bead with the chain; echoes are only replayed. `fitted` is the striker's
    /// velocity in the chain, if it was fitted. `each` takes every strike that is not an echo.
    ///
    /// # Errors
    /// The recording cannot be read.
    pub fn read(
        received: &Recording,
        chain: &FullChain,
        mut echoes: Echoes,
        fitted: Option<&FittedVelocity>,
        mut each: impl FnMut(&RecordedStrike, &mut StrikeComparison),
    ) -> Result<Self, RecordingError> {
        let mut compared = Self {
            emulator: received.json(Part::EmulatorReport)?,
            ..Self::default()
        };
        let truth = fitted.map_or(0.0, FittedVelocity::energy_uncertainty);
        let mut deviations = Deviations::within(truth, chain.goal);
        let mut first = None;
        let (mut drawn, mut shapeless) = (false, 0);
        let mut recorded = received.strikes()?;
        for strike in recorded.by_ref() {
            shapeless += u64::from(strike.shape.is_none());
            if echoes.has(&strike) {
                compared.echoes += 1;
                let replay = replay(&strike);
                compared.note_replay(replay.first_difference, replay.incomplete);
                continue;
            }
            compared.count += 1;
            compared.settings = compared.settings.or(strike.settings);
            let mut comparison = chain.compare(&strike);
            if compared.count == 1 && comparison.replay_identical {
                first = Some(strike.clone());
            }
            compared.is_railed |= comparison.flags.iter().any(|flag| flag.ends_with("_railed"));
            deviations.push(&comparison.deviation);
            compared.note_replay(
                comparison.first_difference.clone(),
                comparison.replay_incomplete.clone(),
            );
            each(&strike, &mut comparison);
            if compared.strikes.len() < STRIKES_MOST {
                // The curves of all strikes would fill the memory.
                comparison.traces = comparison.traces.filter(|_| !drawn);
                drawn |= comparison.traces.is_some();
                compared.strikes.push(comparison);
            }
        }
        if compared.strikes.len() > 1 || fitted.is_some() {
            let strikes = compared.strikes.iter_mut();
            strikes.for_each(StrikeComparison::join_others);
        }
        let unfinished = recorded.unfinished();
        let unfinished = unfinished
            .iter()
            .filter(|window| !echoes.has_window(window))
            .count() as u64;
        let frames = recorded.frames();
        let noise = first.filter(|_| compared.count == 1);
        let noise = noise.and_then(|strike| expanded_noise(&strike));
        compared.spread =
            deviations.spread(noise.map(|noise| noise.map(|joules| joules / chain.truth.absorbed)));
        if let [strike] = &mut compared.strikes[..]
            && strike.alone
        {
            strike.judge(&compared.spread);
        }
        compared.soundness = Soundness::of(frames, compared.emulator.as_ref());
        let of_run = |truth: RunTruth| unstruck(&truth, frames.sample_index);
        let truth = received
            .json::<RunTruth>(Part::Truth)?
            .filter(|_| compared.count > 0);
        compared.soundness.incomplete = received
            .incomplete()
            .or(compared.replay_incomplete.clone())
            .or_else(|| lacks("shape", shapeless))
            .or_else(|| lacks("result", unfinished))
            .or_else(|| truth.and_then(of_run));
        let is_struck = compared.count > 0;
        let spread = if is_struck { &compared.spread[..] } else { &[] };
        compared.failure = failure(
            compared.first_difference.as_deref(),
            &compared.soundness,
            spread,
            compared.is_railed,
        );
        compared.counters = *frames.counters();
        (compared.identity, compared.status) = (frames.identity.clone(), frames.status);
        Ok(compared)
    }

    fn note_replay(&mut self, differs: Option<String>, incomplete: Option<String>) {
        self.first_difference = self.first_difference.take().or(differs);
        self.replay_incomplete = self.replay_incomplete.take().or(incomplete);
    }
}

/// A line if this frame never came for some strikes.
fn lacks(frame: &str, strikes: u64) -> Option<String> {
    (strikes > 0).then(|| format!("the {frame} of {} was not received", count(strikes, "strike")))
}

/// A line if the recording ends before the emulated striker hit for the last time.
fn unstruck(truth: &RunTruth, last_index: u64) -> Option<String> {
    let missed = truth
        .starts
        .iter()
        .filter(|start| **start > last_index as f64)
        .count() as u64;
    (missed > 0).then(|| {
        format!(
            "the last frame is of sample index {last_index}, and {} came after it",
            count(missed, "strike")
        )
    })
}
