//! Whether a recording agrees with the simulation: what must hold of its strikes, and of the run as a whole.

use bead_wire::{Counters, Status};

use crate::bench::emulation::EmulatorReport;
use crate::comparison::spread::Spread;

/// Part of the core that work on a strike may take.
const BUSY_MOST: f64 = 0.75;

/// What must hold of the run as a whole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Soundness {
    /// Frames lost.
    pub lost: u64,
    /// Runs of bytes that are no frame.
    pub corrupt: u64,
    /// ADC overruns, by the bead or by the emulated converter.
    pub overruns: u64,
    /// Of an emulated run: instructions a sample while a strike was measured, and how many fit.
    pub instructions: Option<(f64, f64)>,
}

impl Soundness {
    /// From the counts of a recording, the last status in it, and the emulator's report if it has one.
    pub fn of(counters: &Counters, status: Option<&Status>, emulator: Option<&EmulatorReport>) -> Self {
        let told = status.map_or(0, |status| status.overruns.into());
        Self {
            lost: counters.lost,
            corrupt: counters.rejected.total(),
            overruns: emulator.map_or(told, |emulator| emulator.overruns.max(told)),
            instructions: emulator.and_then(|emulator| {
                let total = emulator.instructions_per_sample.total?;
                Some((total, emulator.instructions_available))
            }),
        }
    }

    /// What is checked, its value, its goal, and whether that is met.
    pub fn rows(&self) -> Vec<(&'static str, String, String, bool)> {
        let counts = [
            ("frames lost", self.lost),
            ("frames corrupt", self.corrupt),
            ("overruns", self.overruns),
        ];
        let counts = counts.map(|(name, count)| (name, count.to_string(), "0".to_owned(), count == 0));
        let cost = self.instructions.map(|(total, available)| {
            let most = BUSY_MOST * available;
            let name = "instructions a sample";
            (name, format!("{total:.1}"), format!("{most:.1}"), total <= most)
        });
        counts.into_iter().chain(cost).collect()
    }
}

/// The first check that said no, gravest first. `differs` is where a replay differs first, if one does.
pub fn failure(differs: Option<&str>, soundness: &Soundness, spread: &[Spread]) -> Option<String> {
    if let Some(what) = differs {
        return Some(format!("replay differs: {what}"));
    }
    let (lost, corrupt, overruns) = (soundness.lost, soundness.corrupt, soundness.overruns);
    if lost + corrupt > 0 {
        return Some(format!("{lost} frames were lost and {corrupt} corrupt"));
    }
    if overruns > 0 {
        return Some(format!("{overruns} overruns: samples are missing"));
    }
    let busy = |(total, available): &(f64, f64)| *total > BUSY_MOST * available;
    if let Some((total, available)) = soundness.instructions.filter(busy) {
        return Some(format!(
            "a sample of a strike costs {total:.0} instructions, more than {:.0} % of the {available:.0} that fit",
            BUSY_MOST * 100.0
        ));
    }
    spread.iter().find_map(Spread::failure)
}
