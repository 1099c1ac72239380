//! The result of a run of the image: its frames, strikes and faults, and the verdict on them.

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::{bail, ensure};
use bead_wire::{FaultCause, Message};
use serde::Serialize;
use serde_json::Value;

use crate::emulation::{Emulation, Ran};
use crate::fault_reports::{CheckedFaults, FaultLog, FaultOutcome, check_reports};
use crate::faults::{Planned, PlannedKind};
use crate::tables::Sensors;
use bead_compare::emulated::InstructionsPerSample;
use bead_compare::energy_uncertainties::EnergyUncertainties;
use bead_compare::front_end::{AnalogFrontEnd, SAMPLE_RATE_HZ};
use bead_compare::given::GivenEstimates;
use bead_compare::replay::{ReplayWord, replay};
use bead_compare::report::count;
use bead_compare::sensed::Truth;
use bead_compare::strike::StrikeConditions;
use bead_compare::values::StrikeValues;
use bead_recording::frames::Frame;
use bead_recording::statuses::LastStatuses;
use bead_recording::strikes::{RecordedStrike, assemble};

/// The result of a run, as in the JSON of `bead emulate`. SI units.
#[derive(Debug, Default, Serialize, schemars::JsonSchema)]
pub struct RunReport {
    /// Frames received, lost, corrupt, and dropped by the bead.
    pub frames: FrameCounts,
    /// ADC overruns, by the bead or by the converter: the greater count.
    pub overruns: u64,
    /// Resets after power-up.
    pub resets: usize,
    /// The strikes.
    pub strikes: Vec<MeasuredStrike>,
    /// Weaker waves that came after a strike's window and were measured as well: beads that parted meet
    /// again.
    pub echoes: Vec<MeasuredStrike>,
    /// Strikes that the bead found and did not measure, because their frames found no room on the line.
    pub strikes_passed_over: u64,
    /// Runs of scans that the bead lost: first index, and first index after. A strike in one was not seen.
    pub gaps: Vec<[u64; 2]>,
    /// Strikes that a fault of the force sensor hid.
    #[serde(skip)]
    pub hidden: usize,
    /// The faults of the fault file.
    pub provoked: Vec<ProvokedFault>,
    /// The faults that the bead reported.
    pub faults: Vec<ReportedFault>,
    /// Reports, resets and strikes that are wrong where faults were provoked, a line each.
    #[serde(skip)]
    pub wrong: Vec<String>,
    /// The last health frame.
    pub health: Option<Value>,
    /// Instructions for each sample.
    pub instructions_per_sample: InstructionsPerSample,
    /// Instructions that fit between two samples.
    pub instructions_available: f64,
    /// The first strike that left the range of a sensor, in words.
    #[serde(skip)]
    pub out_of_range: Option<String>,
    /// Scans beyond a rail: force, acceleration.
    pub saturated: [usize; 2],
    /// Registers that the image touched and no model knows.
    pub unknown_registers: Vec<String>,
    /// The recording that was left.
    pub recording: Option<PathBuf>,
    /// True if a waveform was played, which may hold any number of strikes.
    #[serde(skip)]
    pub played: bool,
}

/// A fault of the fault file, and its outcome.
#[derive(Debug, Serialize, schemars::JsonSchema)]
pub struct ProvokedFault {
    /// The fault.
    #[serde(flatten)]
    pub fault: Planned,
    /// The cause that the bead must report; none if it must not notice.
    #[schemars(with = "Option<NameOrNumber>")]
    pub cause: Option<FaultCause>,
    /// True if it was reported.
    pub reported: bool,
    /// True if no report is required because of other faults: the bead was starting, hung, or was reset
    /// before it could.
    pub excused: bool,
}

/// The JSON of a number of a list: its name, or the number where this version knows no name.
#[derive(schemars::JsonSchema)]
#[serde(untagged)]
#[expect(dead_code, reason = "its schema alone is used")]
enum NameOrNumber {
    Name(String),
    Number(u8),
}

/// A fault that the bead reported.
#[derive(Debug, Serialize, schemars::JsonSchema)]
#[expect(missing_docs, reason = "the fields are those of the frame and its header")]
pub struct ReportedFault {
    pub sample_index: u64,
    #[schemars(with = "NameOrNumber")]
    pub cause: FaultCause,
    pub boot: u32,
    pub detail: String,
}

/// Counts of frames.
#[derive(Debug, Default, Serialize, schemars::JsonSchema)]
pub struct FrameCounts {
    /// Frames received.
    pub received: u64,
    /// Frames that the sequence numbers miss.
    pub lost: u64,
    /// Runs of bytes that are no frame.
    pub corrupt: u64,
    /// Frames that the bead could not send, by cause.
    pub dropped_by_cause: BTreeMap<&'static str, u64>,
}

/// A strike as the bead measured it, beside the truth. SI units.
#[derive(Debug, Default, Serialize, schemars::JsonSchema)]
pub struct MeasuredStrike {
    /// Sample index of the trigger.
    pub sample_index: u64,
    /// By the bead.
    #[serde(flatten)]
    pub device: StrikeValues,
    /// Names of the flags that are set.
    pub flags: Vec<&'static str>,
    /// Supply and temperature; none if they were not measured yet.
    pub conditions: Option<StrikeConditions>,
    /// Standard uncertainties of its energies, if the settings state those of all inputs.
    pub uncertainty: Option<EnergyUncertainties>,
    /// By the full chain; none for an echo, and where a waveform was played.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub truth: Option<Truth>,
    /// By f64 estimates from the waveform that was played.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub given: Option<GivenEstimates>,
    /// True if replay gives every bit.
    pub replay_identical: bool,
    /// The result of the replay.
    #[serde(skip)]
    pub replay: ReplayWord,
    /// The fault that was found.
    #[serde(skip)]
    pub replay_failure: Option<String>,
}

impl MeasuredStrike {
    fn of(strike: &RecordedStrike, explained: [f64; 2]) -> Self {
        let replay = replay(strike);
        Self {
            sample_index: strike.said.trigger_index,
            device: StrikeValues::of(&strike.said),
            flags: strike.said.flags.names().collect(),
            conditions: StrikeConditions::of(strike),
            uncertainty: EnergyUncertainties::of(strike, explained),
            replay_identical: replay.identical(),
            replay: replay.word(),
            replay_failure: replay.failure(),
            ..Self::default()
        }
    }
}

impl RunReport {
    /// The result of a run of `emulation`. Every strike is replayed.
    pub fn of(emulation: &Emulation, ran: Ran, recording: Option<PathBuf>) -> Self {
        let CheckedFaults { outcomes, wrong } = check_faults(emulation, &ran);
        let (frames, counters, measured) = (ran.frames, ran.counters, ran.report);
        let mut statuses = LastStatuses::default();
        frames.iter().for_each(|frame| statuses.push(frame));
        let queue_full = statuses.sum(|status| status.frames_dropped_queue_full);
        let too_long = statuses.sum(|status| status.frames_dropped_too_long);
        let truth = &emulation.truth;
        let mut report = Self {
            frames: FrameCounts {
                received: counters.frames,
                lost: counters.lost,
                corrupt: counters.rejected.total(),
                dropped_by_cause: BTreeMap::from([("queue_full", queue_full), ("too_long", too_long)]),
            },
            // The bead must notice every overrun of the converter; if not, the greater count shows it.
            overruns: measured.overruns.max(statuses.sum(|status| status.overruns)),
            resets: measured.resets,
            strikes_passed_over: passed_over(&frames),
            hidden: hidden(&emulation.faults, &truth.starts),
            provoked: provoked(&emulation.faults, &outcomes),
            wrong,
            instructions_per_sample: measured.instructions_per_sample,
            instructions_available: measured.instructions_available,
            saturated: measured.saturated,
            unknown_registers: measured.unknown_registers,
            recording,
            played: emulation.waveform.is_some(),
            ..Self::default()
        };
        for frame in &frames {
            match &frame.message {
                Message::Gap(gap) => report.gaps.push([gap.first_index, gap.end_index]),
                Message::Health(_) => report.health = Some(frame.body()),
                Message::Fault(fault) => report.faults.push(ReportedFault {
                    sample_index: frame.header.sample_index,
                    cause: fault.cause,
                    boot: fault.boot,
                    detail: fault.detail.as_str().to_owned(),
                }),
                _ => {}
            }
        }
        let mut begun = None;
        // After a reset the indices start again and no longer identify the strike.
        let is_known = measured.resets == 0;
        for strike in assemble(frames, Some(emulation.settings)) {
            let before = std::mem::replace(&mut begun, truth.begun(strike.said.trigger_index));
            let is_echo = is_known && begun.is_some() && begun == before;
            let mut measured = MeasuredStrike::of(&strike, emulation.explained);
            if let Some(waveform) = &emulation.waveform {
                measured.given = begun.filter(|_| is_known).map(|begun| {
                    let rate = f64::from(emulation.settings.sample_rate_hz);
                    let first = strike.said.first_index as f64 - truth.starts[begun];
                    let window = first / rate..(first + f64::from(strike.said.samples)) / rate;
                    GivenEstimates::of(waveform, &emulation.settings, window)
                });
                report.strikes.push(measured);
            } else if is_echo {
                report.echoes.push(measured);
            } else {
                measured.truth = Some(truth.truth);
                report.strikes.push(measured);
            }
        }
        report.out_of_range = out_of_range(&report, &truth.front_end);
        report
    }

    /// The strikes and their echoes.
    pub fn measured(&self) -> impl Iterator<Item = &MeasuredStrike> {
        self.strikes.iter().chain(&self.echoes)
    }

    /// Checks the run after `struck` strikes.
    ///
    /// # Errors
    /// The gravest check that failed, in one line.
    pub fn verdict(&self, struck: u32) -> anyhow::Result<()> {
        if let Some(what) = self.measured().find_map(|strike| strike.replay_failure.as_ref()) {
            bail!("{what}");
        }
        if !self.provoked.is_empty() {
            return self.verdict_on_faults(struck as usize);
        }
        let FrameCounts { lost, corrupt, .. } = self.frames;
        let (overruns, resets, seen) = (self.overruns, self.resets, self.strikes.len());
        if lost + corrupt > 0 {
            let lost = count(lost, "frame");
            bail!("{lost} lost and {corrupt} corrupt; see `bead decode` of the recording");
        }
        if overruns > 0 {
            let overruns = count(overruns, "overrun");
            bail!("{overruns}: the image is too slow for its sample rate");
        }
        if resets > 0 {
            let times = count(resets as u64, "time");
            bail!("the image reset {times}; its fault frames say why");
        }
        if self.played {
            ensure!(
                seen >= struck as usize,
                "only {} seen although the waveform was played {}; its force has to rise by the trigger's \
                 threshold (docs/front-end.md)",
                count(seen as u64, "strike"),
                count(u64::from(struck), "time")
            );
        } else if seen != struck as usize {
            let all = count(u64::from(struck), "strike");
            bail!(
                "{seen} of {all} seen; strikes closer together than a window, or below the trigger, are missed"
            );
        }
        if let Some(what) = &self.out_of_range {
            bail!("{what}");
        }
        Ok(())
    }

    /// Checks a run with faults: each is reported, no report is spurious, and all losses are counted.
    fn verdict_on_faults(&self, struck: usize) -> anyhow::Result<()> {
        if let Some(what) = self.wrong.first() {
            bail!("{what}");
        }
        let is_cut = |fault: &&ReportedFault| fault.cause == FaultCause::StrikeCut;
        let cut = self.faults.iter().filter(is_cut).count();
        let resets = self.resets;
        // A converter whose DMA stream stops also overruns.
        let overrun = [PlannedKind::AdcOverrun, PlannedKind::AdcDmaError];
        let overrun = |provoked: &&ProvokedFault| overrun.contains(&provoked.fault.kind);
        let overruns = self.provoked.iter().filter(overrun).count();
        let FrameCounts { lost, corrupt, .. } = self.frames;
        let dropped: u64 = self.frames.dropped_by_cause.values().sum();
        let unseen = self.strikes_passed_over as usize + self.gaps.len();
        let known = self.strikes.len() + cut + unseen + self.hidden;
        if self.overruns > overruns as u64 {
            let seen = count(self.overruns, "overrun");
            bail!("{seen}, but only {overruns} were provoked");
        }
        // A reset cuts the frame that is being sent, and discards those that wait.
        ensure!(
            lost == dropped && corrupt <= resets as u64,
            "{} lost and {corrupt} corrupt, but the bead dropped {dropped}, and {} cut at most one each",
            count(lost, "frame"),
            count(resets as u64, "reset")
        );
        if resets == 0 && known < struck {
            let all = count(struck as u64, "strike");
            bail!(
                "only {known} of {all} accounted for: measured, cut, passed over, in a reported gap, or hidden \
                 by a fault of the force sensor"
            );
        }
        Ok(())
    }
}

/// The first strike that left the range of a sensor of this front end: the estimate from it is then too low.
fn out_of_range(report: &RunReport, front_end: &AnalogFrontEnd) -> Option<String> {
    let strong = Sensors::Strong.front_end();
    let sensors = [
        (
            "force_railed",
            "force",
            "B",
            "N",
            [front_end, &strong].map(|end| end.force.wide.range().1),
        ),
        (
            "acceleration_railed",
            "acceleration",
            "A",
            "m/s²",
            [front_end, &strong].map(|end| end.acceleration.wide.range().1),
        ),
    ];
    sensors.into_iter().find_map(|(flag, name, estimate, unit, [reach, further])| {
        let strike = report.measured().find(|strike| strike.flags.contains(&flag))?;
        let remedy = if further > reach {
            format!("sensors = \"strong\" under [front_end] of the scenario reaches to {further:.0} {unit}")
        } else {
            "give a wider span under [front_end] of the scenario".to_owned()
        };
        Some(format!(
            "the strike at sample {} leaves the range of the {name}, which reaches to {reach:.0} {unit} at the low gain, so \
             {estimate} is too low; {remedy}",
            strike.sample_index
        ))
    })
}

/// Number of strikes that these faults hide from any bead. `starts` are the indices at which strikes begin.
fn hidden(faults: &[Planned], starts: &[f64]) -> usize {
    let is_hidden = |time: &f64| faults.iter().any(|fault| fault.hides(*time));
    times(starts).filter(is_hidden).count()
}

/// Times at these indices, in s since the first scan, whose index is 1.
fn times(indices: &[f64]) -> impl Iterator<Item = f64> {
    indices
        .iter()
        .map(|index| (index - 1.0) / f64::from(SAMPLE_RATE_HZ))
}

/// Strikes passed over in all boots. The count restarts at each boot, and only grows within one.
fn passed_over(frames: &[Frame]) -> u64 {
    let (mut before, mut last) = (0, (0, 0));
    for frame in frames {
        let Message::Guard(guard) = &frame.message else {
            continue;
        };
        let now = (frame.header.boot, u64::from(guard.strikes_passed_over));
        if now.0 != last.0 || now.1 < last.1 {
            before += last.1;
        }
        last = now;
    }
    before + last.1
}

fn check_faults(emulation: &Emulation, ran: &Ran) -> CheckedFaults {
    if emulation.faults.is_empty() {
        return CheckedFaults::default();
    }
    // A waveform that is played may hold no strike.
    let is_played = emulation.waveform.is_some();
    let starts: Vec<f64> = times(&emulation.truth.starts).filter(|_| !is_played).collect();
    let rows = emulation.machine().stimulus;
    check_reports(&emulation.faults, &rows, &starts, &FaultLog::of(ran))
}

/// The faults of the fault file with their outcomes, in time.
fn provoked(planned: &[Planned], outcomes: &[FaultOutcome]) -> Vec<ProvokedFault> {
    let mut in_time: Vec<_> = planned.iter().zip(outcomes).collect();
    in_time.sort_by(|(a, _), (b, _)| a.at.total_cmp(&b.at));
    let provoked = |(fault, outcome): (&Planned, &FaultOutcome)| ProvokedFault {
        fault: *fault,
        cause: fault.cause(),
        reported: *outcome == FaultOutcome::Reported,
        excused: *outcome == FaultOutcome::Excused,
    };
    in_time.into_iter().map(provoked).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faults::tests::planned;

    #[test]
    fn strikes_under_a_force_sensor_that_stands_still_are_hidden_and_others_are_not() {
        let faults = planned("force_stuck 0.5 duration=0.25; acceleration_stuck 1.2 duration=0.25");
        // There is a strike every 0.1 s. At 0.5, 0.6 and 0.7 s the sensor stands still.
        let starts: Vec<f64> = (0..20).map(|strike| 1.0 + 1e4 * f64::from(strike)).collect();
        assert_eq!(hidden(&faults, &starts), 3);
        assert_eq!(hidden(&[], &starts), 0);
    }

    #[test]
    fn what_a_check_says_no_to_is_the_gravest() {
        let strike = |failure: Option<&str>| MeasuredStrike {
            replay_failure: failure.map(str::to_owned),
            ..MeasuredStrike::default()
        };
        let says = |lost, overruns, resets, strikes| {
            let mut report = RunReport {
                overruns,
                resets,
                strikes,
                ..RunReport::default()
            };
            report.frames.lost = lost;
            let passed = |()| "passed".to_owned();
            report.verdict(1).map_or_else(|why| why.to_string(), passed)
        };
        assert_eq!(says(0, 0, 0, vec![strike(None)]), "passed");
        assert!(says(1, 2, 3, vec![strike(Some("replay differs"))]).starts_with("replay differs"));
        assert!(says(1, 2, 3, vec![strike(None)]).starts_with("1 frame lost"));
        assert!(says(0, 2, 3, vec![strike(None)]).starts_with("2 overruns"));
        assert!(says(0, 0, 3, vec![strike(None)]).starts_with("the image reset 3 times"));
        assert!(says(0, 0, 0, Vec::new()).starts_with("0 of 1 strike seen"));
    }

    #[test]
    fn a_strike_beyond_a_sensor_is_no_pass_and_names_the_sensors_that_reach_further() {
        let [weak, strong] = [Sensors::Weak, Sensors::Strong].map(Sensors::front_end);
        let further = "sensors = \"strong\" under [front_end] of the scenario reaches to 1488 N";
        let [force, acceleration] = ["force_railed", "acceleration_railed"];
        for (flag, front_end, parts) in [
            (force, weak, ["reaches to 248 N", further]),
            (acceleration, weak, ["A is too low", "reaches to 23988 m/s²"]),
            (force, strong, ["B is too low", "give a wider span"]),
        ] {
            let mut report = RunReport {
                strikes: vec![MeasuredStrike::default()],
                ..RunReport::default()
            };
            report.strikes[0].flags.push(flag);
            report.out_of_range = out_of_range(&report, &front_end);
            let why = report.verdict(1).unwrap_err().to_string();
            assert!(parts.iter().all(|part| why.contains(part)), "{why}");
        }
    }
}
