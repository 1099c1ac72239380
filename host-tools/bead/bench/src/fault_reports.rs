//! Checks that a bead reported each fault of a run exactly once.
//!
//! # Design
//! Faults interact: one may come while the bead starts after another, hangs, or sends nothing. The expected
//! reports therefore follow from the run, whose resets the emulator knows. Between two resets a report is
//! required, or only allowed where a fault falls into the bead's start or close to another fault. A report
//! that no fault explains is spurious; a required one that did not come is missing. Times are in s after
//! the first scan.

use bead_wire::{FaultCause, Message};
use stm32f405_qemu::ResetCause;

use crate::emulation::Ran;
use crate::faults::{Planned, PlannedKind, supply};
use crate::several::joined;
use bead_compare::front_end::{CODES, SAMPLE_RATE_HZ};
use bead_recording::frames::FrameReader;

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FaultReport {
    /// Time when the report's frame had left, s.
    pub(crate) at: f64,
    pub(crate) cause: FaultCause,
    pub(crate) detail: String,
}

/// The resets of a bead in a run with faults, and its reports.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FaultLog {
    /// Each reset after power-up: time, s, and cause.
    pub(crate) resets: Vec<(f64, ResetCause)>,
    /// The end of the run, s.
    pub(crate) end: f64,
    pub(crate) reports: Vec<FaultReport>,
    /// The times when the results of strikes had left, s.
    pub(crate) results: Vec<f64>,
}

impl FaultLog {
    pub(crate) fn of(ran: &Ran) -> Self {
        let seconds = |ns: f64| (ns - ran.first_scan_ns as f64) * 1e-9;
        let resets = ran.resets.iter();
        let mut log = Self {
            resets: resets
                .map(|reset| (seconds(reset.at_ns as f64), reset.cause))
                .collect(),
            end: seconds(ran.report.virtual_seconds * 1e9),
            reports: Vec::new(),
            results: Vec::new(),
        };
        let (mut reader, mut frames) = (FrameReader::default(), Vec::new());
        for (at_ns, piece) in ran.pieces(0) {
            reader.feed(piece, Some(at_ns), |item| frames.extend(item.frame()));
        }
        for frame in frames {
            let at = frame.received_ns.unwrap_or(0) as f64 * 1e-9;
            match frame.message {
                Message::Fault(fault) => log.reports.push(FaultReport {
                    at,
                    cause: fault.cause,
                    detail: fault.detail.as_str().to_owned(),
                }),
                Message::Strike(_) => log.results.push(at),
                _ => {}
            }
        }
        log
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FaultOutcome {
    Reported,
    /// No report, and none was required: another fault hid it, it was too short, or the run ended.
    Excused,
    /// No report, though one was required.
    Missing,
}

#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct CheckedFaults {
    pub(crate) outcomes: Vec<FaultOutcome>,
    /// Faults of the bead, a line each: reports that are missing or spurious, and resets that did not come or
    /// that no fault explains.
    pub(crate) wrong: Vec<String>,
}

/// Longest time from a hang to the watchdog's reset, s. Its period is 2 s.
const WATCHDOG: f64 = 2.05;
/// Longest time from a fault of the DMA's interrupt to the reset, s. The interrupt comes with each block, and
/// 12 ms later if the converter has stopped.
const CRASH: f64 = 0.03;
/// Time-out of a silent port, shortest and longest, s. It is short if nothing left for a second before.
const GIVEN_UP: [f64; 2] = [0.5, 1.55];
/// Time after which a silent converter is set up again, s.
const SET_UP_ANEW: f64 = 0.015;
/// Shortest and longest time to find a stuck code, s of samples.
const FOUND: [f64; 2] = [0.048, 0.065];
/// Longest time from a fault's discovery to the end of its frame, behind the frames that wait, s.
const LEAVES: f64 = 0.1;
/// Time after which a low supply is noticed, s.
const NOTICED: f64 = 0.005;
/// Shortest and longest time of good supply that ends a low one, s.
const OVER: [f64; 2] = [0.015, 0.025];
/// Time from a good supply to samples, s.
const START: f64 = 0.045;
/// Time that the supply has to be good before a start, s.
const GOOD: f64 = 0.02;
/// Longest wait for a good supply, s.
const PATIENCE: f64 = 5.0;
/// Thresholds of a low supply and of one that is good again, V (`firmware/src/supply.rs`).
const LOW: [f64; 2] = [2.93, 3.03];
/// Time from a strike to its result, s.
const MEASURED: f64 = 0.03;
/// Time from the first samples to an armed detector, s.
const ARMED: f64 = 0.02;
/// Longest time from a result to the end of its frame on an idle line, s.
const RESULT_LEAVES: f64 = 0.02;
/// Tolerance of equal times, s: times are rounded to ns.
const INSTANT: f64 = 1e-6;
/// Codes between the end of the range and the rail (`firmware/app/src/health.rs`).
const RAIL: u16 = 16;

/// Checks the reports against the faults and strikes of a run. `rows` are the codes of the sensors, with the
/// faults in them; `starts` are the times at which strikes began, s.
pub(crate) fn check_reports(
    faults: &[Planned],
    rows: &[[u16; 4]],
    starts: &[f64],
    log: &FaultLog,
) -> CheckedFaults {
    let run = FaultyRun::new(faults, log);
    let (mut due, mut wrong) = (Vec::new(), Vec::new());
    run.resets(&mut due, &mut wrong);
    run.missing_resets(&mut wrong);
    run.overruns(&mut due);
    run.supply(&mut due);
    run.sensors(rows, &mut due);
    let (came, spurious) = match_reports(&due, &log.reports);
    let mut outcomes = vec![FaultOutcome::Excused; faults.len()];
    for (due, came) in due.iter().zip(came) {
        for &fault in &due.faults {
            outcomes[fault] = match outcomes[fault] {
                FaultOutcome::Excused if came => FaultOutcome::Reported,
                _ if !came && due.required => FaultOutcome::Missing,
                outcome => outcome,
            };
        }
        if due.required && !came {
            wrong.push(format!("{due} was not reported"));
        }
    }
    for at in spurious {
        let FaultReport { at, cause, detail } = &log.reports[at];
        let cause = cause.name().unwrap_or("an unknown cause");
        wrong.push(format!(
            "{cause} ({detail}) was reported at {at:.4} s, but nothing provoked it"
        ));
    }
    wrong.extend(run.lost(starts, &log.results));
    CheckedFaults { outcomes, wrong }
}

#[derive(Debug)]
struct ExpectedReport {
    /// Causes, of which the report has one.
    causes: Vec<FaultCause>,
    /// Cause that is over, if this is the report of a recovery.
    over: Option<FaultCause>,
    from: f64,
    until: f64,
    required: bool,
    faults: Vec<usize>,
}

impl std::fmt::Display for ExpectedReport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let names: Vec<_> = self.causes.iter().filter_map(|cause| cause.name()).collect();
        write!(f, "{}", names.join(" or "))?;
        if let Some(over) = self.over.and_then(FaultCause::name) {
            write!(f, " of {over}")?;
        }
        write!(f, ", due between {:.4} and {:.4} s,", self.from, self.until)
    }
}

/// Returns true for each expected report that came, and the indices of the reports that nothing explains.
fn match_reports(due: &[ExpectedReport], reported: &[FaultReport]) -> (Vec<bool>, Vec<usize>) {
    let mut came = vec![false; due.len()];
    let mut spurious = Vec::new();
    for (number, reported) in reported.iter().enumerate() {
        // The fault that cut a strike explains the report of the cut.
        if reported.cause == FaultCause::StrikeCut {
            continue;
        }
        let fits = |due: &ExpectedReport| {
            due.causes.contains(&reported.cause)
                && (due.from..=due.until).contains(&reported.at)
                && due.over.is_none_or(|over| over.name() == Some(&reported.detail))
        };
        let open = (0..due.len()).filter(|&at| !came[at] && fits(&due[at]));
        // Required reports come first, the most urgent of them before the others.
        let first = open.min_by(|&a, &b| {
            let [a, b] = [&due[a], &due[b]];
            b.required.cmp(&a.required).then(a.until.total_cmp(&b.until))
        });
        match first {
            Some(at) => came[at] = true,
            None => spurious.push(number),
        }
    }
    (came, spurious)
}

#[derive(Debug, Clone, Copy)]
struct BootSpan {
    began: f64,
    /// The earliest time of its first sample, s.
    earliest: f64,
    /// The latest time of its first sample, s.
    latest: f64,
    /// The time of the first fault that may end it, s.
    fatal: f64,
    end: f64,
}

struct FaultyRun<'a> {
    faults: &'a [Planned],
    resets: &'a [(f64, ResetCause)],
    boots: Vec<BootSpan>,
    /// Intervals in which nothing leaves the port, s.
    stalls: Vec<[f64; 2]>,
    /// Intervals of a low supply, s.
    low: Vec<[f64; 2]>,
}

impl<'a> FaultyRun<'a> {
    fn new(faults: &'a [Planned], log: &'a FaultLog) -> Self {
        let mut run = Self {
            faults,
            resets: &log.resets,
            boots: Vec::new(),
            stalls: stalls(faults),
            low: low(faults),
        };
        for number in 0..=log.resets.len() {
            let began = number.checked_sub(1).map(|before| log.resets[before].0);
            let end = log.resets.get(number).map_or(log.end, |(at, _)| *at);
            // The first scan is at 0.
            let (earliest, latest) =
                began.map_or((0.0, 0.0), |began| (began + GOOD, run.good_since(began) + START));
            // A fault that did not end the boot came while the DMA was idle.
            let fatal = faults.iter().filter(|fault| {
                let within = reset_within(fault.kind).filter(|_| crashes(fault.kind));
                let took = end - fault.at;
                fault.at >= earliest && took >= 0.0 && within.is_some_and(|within| took <= within)
            });
            let fatal = fatal.map(|fault| fault.at).fold(end, f64::min);
            run.boots.push(BootSpan {
                began: began.unwrap_or(f64::NEG_INFINITY),
                earliest,
                latest,
                fatal,
                end,
            });
        }
        run
    }

    /// The faults of a kind, with their numbers.
    fn of_kind(&self, kind: PlannedKind) -> impl Iterator<Item = (usize, &Planned)> {
        let all = self.faults.iter().enumerate();
        all.filter(move |(_, fault)| fault.kind == kind)
    }

    /// Time at which a start has seen a good supply for long enough, or gives up waiting, s.
    fn good_since(&self, began: f64) -> f64 {
        let mut good = began;
        for [from, to] in &self.low {
            if *from < good + GOOD && *to > good {
                good = *to;
            }
        }
        good.min(began + PATIENCE) + GOOD
    }

    /// The boot in which a fault occurs. A fault that resets at once belongs to the boot that it ends.
    fn boot_at(&self, time: f64) -> &BootSpan {
        let number = self.boots.iter().rposition(|boot| boot.began < time - INSTANT);
        &self.boots[number.unwrap_or(0)]
    }

    /// Latest time by which a report made at `time` has left, s.
    fn leaves(&self, time: f64) -> f64 {
        let mut leaves = time + LEAVES;
        for [from, to] in &self.stalls {
            if *from < leaves && *to > time - LEAVES {
                leaves = leaves.max(to + LEAVES);
            }
        }
        leaves
    }

    /// True if a report made at `time` leaves before the boot ends.
    fn survives(&self, boot: &BootSpan, time: f64) -> bool {
        self.leaves(time) < boot.fatal.min(boot.end)
    }

    /// The report of a fault that begins at `from` and is found at `found`, s. The report is required if
    /// the fault is `sure` and the report can leave before the boot ends.
    fn expected(
        &self,
        boot: &BootSpan,
        cause: FaultCause,
        [from, found]: [f64; 2],
        sure: bool,
        faults: Vec<usize>,
    ) -> ExpectedReport {
        ExpectedReport {
            causes: vec![cause],
            over: None,
            from,
            until: self.leaves(found),
            required: sure && self.survives(boot, found),
            faults,
        }
    }

    /// The report that `cause` is over; as for [`expected`](Self::expected).
    fn recovery(&self, boot: &BootSpan, cause: FaultCause, times: [f64; 2], sure: bool) -> ExpectedReport {
        ExpectedReport {
            over: Some(cause),
            ..self.expected(boot, FaultCause::Recovered, times, sure, Vec::new())
        }
    }

    /// True if a fault explains the reset that ended a boot at `at`, s.
    fn explains(&self, fault: &Planned, boot: &BootSpan, at: f64, cause: ResetCause) -> bool {
        let within = reset_within(fault.kind).unwrap_or(0.0);
        let in_time = fault.at >= boot.began && (fault.at..=fault.at + within).contains(&at);
        match fault.kind {
            PlannedKind::PowerCut => cause == ResetCause::PowerCut && (fault.at - at).abs() < within,
            PlannedKind::Hang => cause == ResetCause::Watchdog && in_time,
            PlannedKind::UartStall => {
                let silent = |[from, to]: &[f64; 2]| to.min(at) - from.max(boot.began) >= GIVEN_UP[0];
                let meets = fault.at < at && fault.end() > boot.began;
                cause == ResetCause::Software && meets && self.stalls.iter().any(silent)
            }
            kind => crashes(kind) && cause == ResetCause::Software && in_time,
        }
    }

    /// Faults that end in a reset, and the reports of the next boot.
    fn resets(&self, due: &mut Vec<ExpectedReport>, wrong: &mut Vec<String>) {
        for (number, &(at, cause)) in self.resets.iter().enumerate() {
            let boot = &self.boots[number];
            let all = 0..self.faults.len();
            let faults = all.filter(|&fault| self.explains(&self.faults[fault], boot, at, cause));
            let faults: Vec<usize> = faults.collect();
            if faults.is_empty() {
                wrong.push(format!(
                    "the bead was reset at {at:.4} s ({cause:?}), and nothing explains it"
                ));
                continue;
            }
            if cause == ResetCause::PowerCut {
                continue;
            }
            // Consecutive short stalls end in a panic, too.
            let causes = faults.iter().filter_map(|&fault| match &self.faults[fault] {
                stall if stall.kind == PlannedKind::UartStall => Some(FaultCause::Panic),
                fault => fault.cause(),
            });
            let next = &self.boots[number + 1];
            // The reset is reported after the start, and again with the frames of every second if the line
            // was busy.
            let until = self.leaves(next.latest);
            due.push(ExpectedReport {
                causes: causes.collect(),
                over: None,
                from: at,
                until,
                required: until + LEAVES < next.fatal.min(next.end),
                faults,
            });
        }
    }

    fn missing_resets(&self, wrong: &mut Vec<String>) {
        for fault in self.faults {
            let Some(within) = reset_within(fault.kind) else {
                continue;
            };
            let (boot, is_cut) = (self.boot_at(fault.at), fault.kind == PlannedKind::PowerCut);
            // A converter that is being set up anew has no DMA stream to fail.
            let sampling = boot.latest <= fault.at && !self.set_up_anew(fault.at);
            if (is_cut || sampling && boot.fatal >= fault.at) && boot.end > fault.at + within {
                let (kind, at) = (fault.kind.name(), fault.at);
                wrong.push(format!("{kind} at {at} s caused no reset within {within} s"));
            }
        }
        // A port that is silent for too long ends in a reset.
        for boot in &self.boots {
            for [from, to] in &self.stalls {
                let from = from.max(boot.latest);
                let silent = to.min(boot.fatal) - from;
                if silent > GIVEN_UP[1] {
                    wrong.push(format!(
                        "a port that was silent from {from:.4} s on for {silent:.4} s caused no reset"
                    ));
                }
            }
        }
    }

    /// True if the converter may have no DMA stream at a time.
    fn set_up_anew(&self, time: f64) -> bool {
        let mut overruns = self.of_kind(PlannedKind::AdcOverrun);
        overruns.any(|(_, fault)| (fault.at..fault.at + SET_UP_ANEW).contains(&time))
    }

    /// Expects a report of each overrun; two that are close may share one.
    fn overruns(&self, due: &mut Vec<ExpectedReport>) {
        let stops = [PlannedKind::AdcOverrun, PlannedKind::AdcDmaError];
        for (index, fault) in self.of_kind(PlannedKind::AdcOverrun) {
            let boot = self.boot_at(fault.at);
            let near = self.faults.iter().filter(|other| {
                stops.contains(&other.kind) && (other.at - fault.at).abs() < 2.0 * SET_UP_ANEW
            });
            // The count includes the overrun itself.
            let sure = near.count() == 1 && boot.latest <= fault.at;
            let found = (fault.at + SET_UP_ANEW).max(boot.latest);
            due.push(self.expected(boot, FaultCause::AdcOverrun, [fault.at, found], sure, vec![index]));
        }
    }

    fn supply(&self, due: &mut Vec<ExpectedReport>) {
        for boot in &self.boots {
            let end = boot.fatal.min(boot.end);
            let within = self
                .low
                .iter()
                .map(|[from, to]| [from.max(boot.earliest), to.min(end)]);
            let within: Vec<_> = within.filter(|[from, to]| from < to).collect();
            for (number, &[from, to]) in within.iter().enumerate() {
                let before = number.checked_sub(1).map(|before| within[before][1]);
                let since = before.map_or(f64::INFINITY, |before| from - before);
                let until_next = within.get(number + 1).map_or(f64::INFINITY, |next| next[0] - to);
                let noticed = from.max(boot.latest);
                let lasts = to - noticed >= NOTICED;
                if since > OVER[0] {
                    let meets =
                        |fault: &Planned| fault.at < to && fault.end() > from && fault.cause().is_some();
                    let faults = self
                        .of_kind(PlannedKind::Supply)
                        .filter(|(_, fault)| meets(fault));
                    let faults = faults.map(|(index, _)| index).collect();
                    let (times, sure) = ([from, noticed + NOTICED], lasts && since > OVER[1]);
                    due.push(self.expected(boot, FaultCause::SupplyLow, times, sure, faults));
                }
                if until_next > OVER[0] && to < boot.end {
                    let times = [to, to.max(boot.latest) + OVER[1]];
                    let sure = lasts && until_next > OVER[1];
                    due.push(self.recovery(boot, FaultCause::SupplyLow, times, sure));
                }
            }
        }
    }

    /// Expects reports of sensors whose codes stand still or are at a rail for long enough.
    fn sensors(&self, rows: &[[u16; 4]], due: &mut Vec<ExpectedReport>) {
        let causes = [
            [FaultCause::ForceStuck, FaultCause::ForceRailed],
            [FaultCause::AccelerationStuck, FaultCause::AccelerationRailed],
        ];
        for (sensor, causes) in causes.into_iter().enumerate() {
            for (railed, [from, to]) in standing(rows, sensor) {
                let cause = causes[usize::from(railed)];
                let of = self.faults.iter().enumerate().filter(|(_, fault)| {
                    fault.sensor_cause() == Some(cause) && fault.at < to && fault.end() > from
                });
                let of: Vec<usize> = of.map(|(index, _)| index).collect();
                for boot in &self.boots {
                    let end = boot.fatal.min(boot.end);
                    let (earliest, latest) = (from.max(boot.earliest), from.max(boot.latest));
                    if to.min(boot.end) - earliest < FOUND[0] {
                        continue;
                    }
                    let lasts = to.min(end) - latest - self.gaps(latest, to.min(end)) >= FOUND[1];
                    let found = latest + FOUND[1] + self.gaps(latest, latest + 2.0 * FOUND[1]);
                    due.push(self.expected(boot, cause, [earliest + FOUND[0], found], lasts, of.clone()));
                    if to < boot.end {
                        let anew = if self.set_up_anew(to) { SET_UP_ANEW } else { 0.0 };
                        due.push(self.recovery(boot, cause, [to, to + anew + NOTICED], lasts));
                    }
                }
            }
        }
    }

    /// Strikes without a result, though no fault was near.
    fn lost(&self, starts: &[f64], results: &[f64]) -> Vec<String> {
        let mut results = results.to_vec();
        let mut lost = Vec::new();
        for &start in starts.iter().filter(|start| self.is_undisturbed(**start)) {
            let until = start + MEASURED + RESULT_LEAVES;
            match results.iter().position(|at| (start..=until).contains(at)) {
                Some(at) => drop(results.remove(at)),
                None => lost.push(format!(
                    "the strike at {start:.4} s has no result, although no fault was near"
                )),
            }
        }
        lost
    }

    /// True if the bead has to measure and report a strike that begins at a time.
    fn is_undisturbed(&self, start: f64) -> bool {
        let boot = self.boot_at(start);
        let runs = boot.latest + ARMED <= start && self.survives(boot, start + MEASURED);
        let near = |fault: &Planned| {
            let disturbed = match fault.kind {
                PlannedKind::AdcOverrun | PlannedKind::AdcDmaError => {
                    fault.at - MEASURED..fault.at + SET_UP_ANEW + ARMED
                }
                PlannedKind::ForceStuck | PlannedKind::ForceRailed => {
                    fault.at - MEASURED..fault.end() + ARMED
                }
                PlannedKind::UartStall => fault.at - LEAVES..fault.end() + 2.0 * LEAVES,
                _ => return false,
            };
            disturbed.contains(&start)
        };
        runs && !self.faults.iter().any(near)
    }

    /// Longest total time without samples because of overruns between two times, s.
    fn gaps(&self, from: f64, to: f64) -> f64 {
        let overruns = self.of_kind(PlannedKind::AdcOverrun);
        let within = overruns.filter(|(_, fault)| (from - SET_UP_ANEW..to).contains(&fault.at));
        within.count() as f64 * SET_UP_ANEW
    }
}

/// True for the kinds that break the interrupt or the stream of the samples.
fn crashes(kind: PlannedKind) -> bool {
    use PlannedKind::{AdcDmaError, Hang, HardFault, Panic, StackOverflow};
    matches!(kind, AdcDmaError | Panic | HardFault | Hang | StackOverflow)
}

/// Longest time from a fault to the reset that it causes, s; `None` if it causes none by itself.
fn reset_within(kind: PlannedKind) -> Option<f64> {
    match kind {
        PlannedKind::PowerCut => Some(1e-3),
        PlannedKind::Hang => Some(WATCHDOG + CRASH),
        kind => crashes(kind).then_some(CRASH),
    }
}

/// Intervals in which nothing leaves the port: a later stall may only make one longer.
fn stalls(faults: &[Planned]) -> Vec<[f64; 2]> {
    let stalls = faults.iter().filter(|fault| fault.kind == PlannedKind::UartStall);
    joined(stalls.map(|fault| [fault.at, fault.end()]).collect())
}

fn low(faults: &[Planned]) -> Vec<[f64; 2]> {
    let (mut low, mut since) = (Vec::new(), None);
    for (at, volts) in supply(faults) {
        match since {
            None if volts < LOW[0] => since = Some(at),
            Some(from) if volts > LOW[1] => {
                low.push([from, at]);
                since = None;
            }
            _ => {}
        }
    }
    low.extend(since.map(|from| [from, f64::INFINITY]));
    low
}

/// Intervals, s, in which the codes of a sensor stand still or are at a rail for long enough to be found,
/// each with true if at a rail.
fn standing(rows: &[[u16; 4]], sensor: usize) -> Vec<(bool, [f64; 2])> {
    let rail = |code: u16| match code {
        code if code < RAIL => Some(0),
        code if code >= CODES - RAIL => Some(1),
        _ => None,
    };
    let seconds = |row: usize| row as f64 / f64::from(SAMPLE_RATE_HZ);
    let least = (FOUND[0] * f64::from(SAMPLE_RATE_HZ)) as usize;
    let mut found = Vec::new();
    // Both gains of a sensor fail together here, so the first suffices.
    let codes: Vec<u16> = rows.iter().map(|row| row[2 * sensor]).collect();
    let mut from = 0;
    while from < codes.len() {
        let railed = rail(codes[from]);
        let stays = |code: &&u16| match railed {
            Some(_) => rail(**code) == railed,
            None => **code == codes[from],
        };
        let many = codes[from..].iter().take_while(stays).count();
        if many >= least {
            let is_last = from + many == codes.len();
            let ends = if is_last {
                f64::INFINITY
            } else {
                seconds(from + many)
            };
            found.push((railed.is_some(), [seconds(from), ends]));
        }
        from += many;
    }
    found
}

#[cfg(test)]
mod tests {
    use FaultCause::{AdcOverrun, ForceRailed, ForceStuck, HardFault, Panic, Recovered, SupplyLow, Watchdog};
    use ResetCause::{PowerCut, Software};

    use super::*;
    use crate::faults::provoke;
    use crate::faults::tests::planned;
    use bead_compare::front_end::AnalogFrontEnd;

    type Resets<'a> = &'a [(f64, ResetCause)];
    type Reports<'a> = &'a [(f64, FaultCause, &'a str)];

    /// The strikes of a run of 2 s, each with the time of its result, s.
    const STRIKES: std::ops::Range<u32> = 1..20;

    fn results() -> Vec<f64> {
        STRIKES.map(|strike| 0.1 * f64::from(strike) + 0.02).collect()
    }

    /// Checks a run of 2 s with these faults, as `kind at key=value; ...`.
    fn run(faults: &str, resets: Resets<'_>, reported: Reports<'_>, results: Vec<f64>) -> CheckedFaults {
        let faults = planned(faults);
        let mut run = stm32f405_qemu::Run::new("none");
        run.stimulus = (0..200_000u32).map(|row| [1000 + (row % 7) as u16; 4]).collect();
        provoke(&faults, &AnalogFrontEnd::default(), &mut run);
        let reports = reported.iter().map(|&(at, cause, detail)| FaultReport {
            at,
            cause,
            detail: detail.to_owned(),
        });
        let log = FaultLog {
            resets: resets.to_vec(),
            end: 2.0,
            reports: reports.collect(),
            results,
        };
        let starts: Vec<f64> = STRIKES.map(|strike| 0.1 * f64::from(strike)).collect();
        check_reports(&faults, &run.stimulus, &starts, &log)
    }

    /// Asserts that a run in which all strikes were measured has these faults of the bead, each given by a
    /// part of its line.
    #[track_caller]
    fn assert_wrong(faults: &str, resets: Resets<'_>, reported: Reports<'_>, parts: &[&str]) {
        let wrong = run(faults, resets, reported, results()).wrong;
        assert_eq!(wrong.len(), parts.len(), "{wrong:?}");
        for (line, part) in wrong.iter().zip(parts) {
            assert!(line.contains(part), "{part}: {line}");
        }
    }

    const SPURIOUS: &str = "but nothing provoked it";
    const MISSING: &str = "was not reported";

    #[test]
    fn a_fault_is_reported_once_in_its_time() {
        let fault = "adc_overrun 0.5";
        let [good, twice, late] = [0.513, 0.514, 0.8].map(|at| (at, AdcOverrun, ""));
        assert_wrong(fault, &[], &[good], &[]);
        assert_wrong(fault, &[], &[], &["adc_overrun, due between 0.5000 and"]);
        let part = "was reported at 0.5140 s, but nothing provoked it";
        assert_wrong(fault, &[], &[good, twice], &[part]);
        assert_wrong(fault, &[], &[late], &[MISSING, SPURIOUS]);
        assert_wrong(fault, &[], &[good, (0.513, Panic, "")], &["panic"]);
    }

    #[test]
    fn a_reset_needs_its_fault_and_a_fault_its_reset() {
        let reported = [(0.56, HardFault, "CFSR")];
        let fault = "hard_fault 0.5";
        assert_wrong(fault, &[(0.502, Software)], &reported, &[]);
        assert_wrong(fault, &[], &[], &["hard_fault at 0.5 s caused no reset"]);
        let two = [(0.502, Software), (1.0, Software)];
        assert_wrong(fault, &two, &reported, &["reset at 1.0000 s"]);
        let other = [(0.502, ResetCause::Watchdog)];
        assert_wrong(fault, &other, &reported, &["nothing explains it", SPURIOUS]);
        let parts = ["nothing explains it", "power_cut at 0.5 s caused no reset"];
        assert_wrong("power_cut 0.5", &[(0.6, PowerCut)], &[], &parts);
    }

    #[test]
    fn a_hang_ends_in_two_seconds_unless_the_run_does() {
        assert_wrong("hang 0.5", &[], &[], &[]);
        let (reset, reported) = ((1.9, ResetCause::Watchdog), (1.96, Watchdog, ""));
        let CheckedFaults { outcomes, wrong } = run("hang 0.01", &[reset], &[reported], Vec::new());
        assert!(
            wrong.is_empty() && outcomes == [FaultOutcome::Reported],
            "{wrong:?} {outcomes:?}"
        );
    }

    #[test]
    fn what_another_fault_hides_need_not_be_reported_and_may_be() {
        // While the bead starts again after the panic, nothing overruns.
        let faults = "panic 0.5; adc_overrun 0.51";
        let (resets, panic) = ([(0.502, Software)], (0.56, Panic, ""));
        assert_wrong(faults, &resets, &[panic], &[]);
        assert_wrong(faults, &resets, &[panic, (0.57, AdcOverrun, "")], &[]);
        let outcomes = run(faults, &resets, &[panic], Vec::new()).outcomes;
        assert_eq!(outcomes, [FaultOutcome::Reported, FaultOutcome::Excused]);
        // Of two faults that end one boot, one is reported.
        let (faults, hard_fault) = ("panic 0.5; hard_fault 0.501", (0.56, HardFault, ""));
        assert_wrong(faults, &resets, &[hard_fault], &[]);
        assert_wrong(faults, &resets, &[], &[MISSING]);
        assert_wrong(faults, &resets, &[hard_fault, (0.57, Panic, "")], &["panic"]);
    }

    #[test]
    fn a_stuck_sensor_is_reported_and_so_is_its_recovery() {
        let reported = |recovered: &'static str| [(0.56, ForceStuck, ""), (0.7, Recovered, recovered)];
        let long = "force_stuck 0.5 duration=0.2";
        assert_wrong(long, &[], &reported("force_stuck"), &[]);
        assert_wrong(long, &[], &reported("force_railed"), &[MISSING, SPURIOUS]);
        assert_wrong(long, &[], &reported("force_stuck")[..1], &[MISSING]);
        let short = "force_stuck 0.5 duration=0.04";
        assert_wrong(short, &[], &[], &[]);
        assert_wrong(short, &[], &[(0.54, ForceStuck, "")], &[SPURIOUS]);
        // A spell at a rail in between is another fault.
        let within = "force_stuck 0.3 duration=0.5; force_railed 0.4 duration=0.3";
        let reported = [
            (0.36, ForceStuck, ""),
            (0.4, Recovered, "force_stuck"),
            (0.46, ForceRailed, ""),
            (0.7, Recovered, "force_railed"),
            (0.76, ForceStuck, ""),
            (0.8, Recovered, "force_stuck"),
        ];
        assert_wrong(within, &[], &reported, &[]);
        assert_wrong(within, &[], &reported[..5], &[MISSING]);
    }

    #[test]
    fn a_supply_that_dips_again_at_once_is_one_fault() {
        let dips = "supply 0.5 volts=2.7 duration=0.01; supply 0.515 volts=2.5 duration=0.01";
        let reported = [(0.502, SupplyLow, ""), (0.546, Recovered, "supply_low")];
        assert_wrong(dips, &[], &reported, &[]);
        assert_wrong(dips, &[], &reported[..1], &[MISSING]);
        assert_wrong("supply 0.5 volts=3.0 duration=0.01", &[], &[], &[]);
    }

    #[test]
    fn a_strike_that_no_fault_is_near_has_a_result() {
        for lost in 0..results().len() {
            let mut results = results();
            results.remove(lost);
            let wrong = run("adc_overrun 0.5", &[], &[(0.513, AdcOverrun, "")], results).wrong;
            // The overrun cuts the strike at 0.5 s, and the run may end before the last result leaves.
            let expected = usize::from(lost != 4 && lost != 18);
            assert_eq!(wrong.len(), expected, "{lost}: {wrong:?}");
        }
    }

    #[test]
    fn a_silent_port_is_given_up_after_a_second_and_a_half_and_reported_when_it_speaks() {
        let stall = "uart_stall 0.1 duration=1.6";
        let (reset, reported) = ((1.4, Software), (1.75, Panic, "transmission hangs"));
        let outcomes = run(stall, &[reset], &[reported], Vec::new()).outcomes;
        assert_eq!(outcomes, [FaultOutcome::Reported]);
        assert_wrong(stall, &[], &[], &["s caused no reset"]);
        let short = "uart_stall 0.5 duration=0.2";
        assert_wrong(short, &[(0.8, Software)], &[], &["nothing explains it"]);
    }
}
