//! A case: a real chain, its difference from what the settings state, and the image's verdict.

use std::path::Path;

use bead_instrument::Waveform;
use bead_instrument::trace::Trace;
use bead_model::design::Description;
use bead_wire::{Message, StrikeFlags};
use hertz_chain::{Scenario, Solution};
use schemars::JsonSchema;
use serde::Serialize;

use crate::emulation::{Emulation, Placed, block_of};
use crate::error::BenchError;
use crate::faults::Planned;
use bead_compare::drift::Drift;
use bead_compare::front_end::{AnalogFrontEnd, SAMPLE_RATE_HZ};
use bead_compare::sensed::{RING_DOWN, Timing, Truth, simulate_with_ring_down};
use bead_recording::strikes::assemble;

use super::law::{LawChain, STEP, SpringLaw};

/// Part of the energy by which an estimate may be off without a flag.
pub const SILENT: f64 = 0.03;
/// Quiet before the first strike, s.
const LEAD_IN: f64 = 0.02;
/// Force that marks the arrival of a wave, N.
const FOOT: f64 = 0.05;
/// Time before a wave's arrival from which a trigger counts as that of the wave, s.
const EARLIER: f64 = 0.2e-3;
/// Time from strike to strike, s.
const INTERVAL: f64 = 0.06;

/// The signal at the sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Signal {
    /// One strike of the chain.
    Chain,
    /// Two equal strikes, the second one this many seconds after the first.
    Twice(f64),
    /// Springs that follow this law.
    Law(SpringLaw),
    /// Sensors that clip at this force, N, and acceleration, m/s².
    Clipped([f64; 2]),
}

/// A strike for which the bead would be wrong, and the flags that name the cause.
pub struct SilentCase {
    /// Group of cases with one cause.
    pub group: &'static str,
    /// The cause.
    pub cause: String,
    /// Flags, any of which names the cause.
    pub named_by: StrikeFlags,
    pub(super) scenario: Scenario,
    pub(super) bead: usize,
    pub(super) front_end: AnalogFrontEnd,
    pub(super) signal: Signal,
    pub(super) strikes: u32,
    pub(super) faults: Vec<Planned>,
    pub(super) state: Box<dyn Fn(&mut Description) + Send + Sync>,
}

/// The image's verdict on a case.
#[derive(Debug, Serialize, JsonSchema)]
pub struct SilentOutcome {
    /// Group of cases with one cause.
    pub group: &'static str,
    /// The cause.
    pub cause: String,
    /// Waves that struck the bead.
    pub waves: usize,
    /// Strikes that were reported, and those that were counted without a result.
    pub reported: [usize; 2],
    /// Greatest error of estimates A and B among the strikes that no flag of the cause explains, as parts of
    /// the truth; of all strikes where every one is explained. `null` without a strike.
    #[schemars(with = "[Option<f64>; 2]")]
    pub errors: [f64; 2],
    /// Every flag that was set.
    pub flags: Vec<&'static str>,
    /// True if no strike is off by more than [`SILENT`] without a flag that names the cause, and no wave is
    /// lost without a number.
    pub told: bool,
}

impl SilentCase {
    /// Plays the case through the image.
    ///
    /// # Errors
    /// The chain cannot be simulated, no settings fit it, or the image fails.
    pub fn play(&self, image: &Path) -> Result<SilentOutcome, BenchError> {
        let solution = simulate_with_ring_down(&self.scenario)?;
        let truth = Truth::of(&self.scenario, &solution, self.bead)?;
        let (waveform, absorbed, waves) = self.waveform(&solution, truth.absorbed)?;
        let felt = waveform.force.iter().flat_map(Trace::points);
        let travel = felt
            .into_iter()
            .find(|(_, force)| *force > FOOT)
            .map_or(0.0, |(time, _)| time);
        let timing = Timing {
            lead_in: LEAD_IN,
            strikes: self.strikes,
            interval: INTERVAL,
        };
        let placed = Placed::alone(self.bead, Some(1));
        let truth = Truth { absorbed, ..truth };
        let mut run = Emulation::play(&solution, placed, &self.front_end, timing, image, waveform, truth)?;
        let stated = run.settings.with(|description| (self.state)(description));
        run.settings = stated.map_err(|error| BenchError::unfit("no settings state this case", error))?;
        run.block = block_of(&run.settings)?;
        run.faults.clone_from(&self.faults);
        let frames = run.run()?.whole()?.frames;
        let counted = frames.iter().rev().find_map(|frame| match &frame.message {
            Message::Guard(guard) => Some((guard.strikes_passed_over + guard.strikes_in_dead_time) as usize),
            _ => None,
        });
        // Later windows of a wave are its echoes.
        let (arrivals, mut begun) = (self.arrivals(&run.truth.starts, travel), 0);
        let recorded = assemble(frames, Some(run.settings));
        let mut drift = Drift::default();
        recorded.iter().for_each(|strike| drift.add(strike));
        let drifting = drift.means().iter().any(|mean| mean.drifting);
        let of_recording = StrikeFlags::NONE.with_if(drifting, StrikeFlags::DRIFTING);
        let strikes = recorded.into_iter().map(|strike| {
            let mut said = strike.said;
            said.flags = said.flags.with(of_recording);
            said
        });
        let strikes = strikes.filter(|said| {
            let before = begun;
            begun = arrivals.partition_point(|arrival| *arrival <= said.trigger_index as f64);
            begun > before
        });
        let strikes: Vec<_> = strikes.collect();
        let errors = |named: bool| {
            let judged = strikes
                .iter()
                .filter(|said| said.flags.has(self.named_by) == named);
            let off = judged.map(|said| {
                [said.absorbed_measured, said.absorbed_predicted]
                    .map(|energy| energy.joules() / absorbed - 1.0)
            });
            let further = |one: f64, other: f64| if other.abs() > one.abs() { other } else { one };
            off.reduce(|most, off| [0, 1].map(|at| further(most[at], off[at])))
        };
        let unexplained = errors(false);
        let reported = [strikes.len(), counted.unwrap_or(0)];
        let waves = waves * self.strikes as usize;
        let flags = strikes.iter().map(|said| said.flags);
        let flags = flags.fold(StrikeFlags::NONE, StrikeFlags::with);
        let is_lost = reported[0] + reported[1] < waves && !flags.has(self.named_by);
        Ok(SilentOutcome {
            group: self.group,
            cause: self.cause.clone(),
            waves,
            reported,
            errors: unexplained.or_else(|| errors(true)).unwrap_or([f64::NAN; 2]),
            flags: flags.names().collect(),
            told: !strikes.is_empty()
                && !is_lost
                && unexplained.is_none_or(|off| off.iter().all(|off| off.abs() <= SILENT)),
        })
    }

    /// Sample index shortly before each wave of the strikes that begin at `starts` arrives. A wave takes
    /// `travel` s to the bead.
    fn arrivals(&self, starts: &[f64], travel: f64) -> Vec<f64> {
        let later: &[f64] = match self.signal {
            Signal::Twice(gap) => &[0.0, gap],
            _ => &[0.0],
        };
        let index = |start: f64, later: f64| start + (travel + later - EARLIER) * f64::from(SAMPLE_RATE_HZ);
        let each = starts
            .iter()
            .flat_map(|start| later.iter().map(|later| index(*start, *later)));
        each.collect()
    }

    /// Signals at the sensors, the energy that one wave leaves in the intruder, J, and the number of waves.
    fn waveform(&self, solution: &Solution, absorbed: f64) -> Result<(Waveform, f64, usize), BenchError> {
        let rows = (solution.end() / STEP) as usize;
        let signals = || {
            let times = (0..rows).map(|row| row as f64 * STEP);
            let mut force = solution.force_beyond_curve(self.bead);
            let mut acceleration = solution.acceleration_curve(self.bead);
            let force = times.clone().map(|time| force.at(time)).collect();
            let accelerations = times.map(|time| acceleration.as_mut().map_or(0.0, |curve| curve.at(time)));
            [force, accelerations.collect()]
        };
        let ([force, acceleration], absorbed, waves): ([Vec<f64>; 2], f64, usize) = match self.signal {
            Signal::Chain => (signals(), absorbed, 1),
            Signal::Twice(gap) => {
                let later = (gap / STEP) as usize;
                let both = signals().map(|one| {
                    let at = |row: usize| one.get(row).copied().unwrap_or(0.0);
                    let sum = |row: usize| at(row) + row.checked_sub(later).map_or(0.0, at);
                    (0..rows + later).map(sum).collect()
                });
                (both, absorbed, 2)
            }
            Signal::Law(law) => {
                let chain = LawChain::new(solution.model(), self.bead, law);
                let strike = chain.map(|chain| chain.strike(self.scenario.duration + RING_DOWN));
                let strike = strike.unwrap_or_default();
                ([strike.force, strike.acceleration], strike.absorbed, 1)
            }
            Signal::Clipped(ends) => {
                let mut clipped = signals();
                for (values, end) in clipped.iter_mut().zip(ends) {
                    values
                        .iter_mut()
                        .for_each(|value| *value = value.clamp(-end, end));
                }
                (clipped, absorbed, 1)
            }
        };
        let trace = |values| Some(Trace::even(values, 1.0 / STEP));
        Ok((
            Waveform {
                force: trace(force),
                acceleration: trace(acceleration),
                start: 0.0,
                remarks: Vec::new(),
            },
            absorbed,
            waves,
        ))
    }
}
