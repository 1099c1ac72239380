//! Checks that a bead reported each fault of a run exactly once.
//!
//! # Design
//! Faults meet one another: one comes while the bead starts after another, hangs, or sends nothing. The
//! reports that are expected therefore follow from the run. The emulator says when the bead was reset.
//! Between two resets a report is required, or only allowed where a fault falls into the bead's start or
//! close to another fault. A report that no fault explains is spurious; a required one that did not come is
//! missing. Times are in s after the first scan.

use bead_wire::{FaultCause, Message};
use stm32f405_qemu::{Reset, ResetCause};

use crate::faults::{Kind, Planned, supply};
use bead_compare::front_end::{CODES, SAMPLE_RATE_HZ};
use bead_recording::frames::Frame;

/// A fault that the bead reported.
#[derive(Debug, Clone, PartialEq)]
pub struct FaultReport {
    /// The time when its frame had left, s.
    pub at: f64,
    /// Its cause.
    pub cause: FaultCause,
    /// Its text.
    pub detail: String,
}

/// The reports of a bead in a run with faults.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FaultReports {
    /// The faults, in the order of their frames.
    pub faults: Vec<FaultReport>,
    /// The times when the results of strikes had left, s.
    pub strikes: Vec<f64>,
}

impl FaultReports {
    /// From frames whose times are those of the run, in ns since the first scan.
    pub fn new(frames: &[Frame]) -> Self {
        let mut reports = Self::default();
        for frame in frames {
            let at = frame.received_ns.unwrap_or(0) as f64 * 1e-9;
            match &frame.message {
                Message::Fault(fault) => reports.faults.push(FaultReport {
                    at,
                    cause: fault.cause,
                    detail: fault.detail.as_str().to_owned(),
                }),
                Message::Strike(_) => reports.strikes.push(at),
                _ => {}
            }
        }
        reports
    }
}

/// The resets of a bead, and the end of the run.
#[derive(Debug, Clone, PartialEq)]
pub struct ResetLog {
    /// Each reset after power-up: time, s, and cause.
    pub resets: Vec<(f64, ResetCause)>,
    /// The end, s.
    pub end: f64,
}

impl ResetLog {
    /// From the emulator's resets, in ns of virtual time.
    pub fn new(resets: &[Reset], first_scan_ns: u64, end_ns: u64) -> Self {
        let seconds = |ns: u64| (ns as f64 - first_scan_ns as f64) * 1e-9;
        Self {
            resets: resets
                .iter()
                .map(|reset| (seconds(reset.at_ns), reset.cause))
                .collect(),
            end: seconds(end_ns),
        }
    }
}

/// Outcome of an injected fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// The bead reported it.
    Reported,
    /// No report, and none was required: another fault hid it, it was too short, or the run ended.
    Excused,
    /// No report, though one was required.
    Missing,
}

/// The result of the check.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CheckedFaults {
    /// The outcome of each fault, in their order.
    pub outcomes: Vec<Outcome>,
    /// Faults of the bead, a line each: reports that are missing or spurious, and resets that did not come or
    /// that no fault explains.
    pub wrong: Vec<String>,
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
/// Shortest and longest time of samples in which a stuck code is found, s.
const FOUND: [f64; 2] = [0.048, 0.065];
/// Longest time from a fault's discovery to the end of its frame, behind the frames that wait, s.
const LEAVES: f64 = 0.1;
/// Time after which a low supply is noticed, s.
const NOTICED: f64 = 0.005;
/// Shortest and longest time of a good supply after which a low one is over, s.
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
/// Greatest difference of two times that are the same, s: times are rounded to ns.
const INSTANT: f64 = 1e-6;
/// Codes between the end of the range and the rail (`firmware/src/health.rs`).
const RAIL: u16 = 16;

/// Checks the reports against the faults and strikes of a run. `rows` are the codes of the sensors, with the
/// faults in them; `starts` are the times at which strikes began, s.
pub fn check_reports(
    faults: &[Planned],
    rows: &[[u16; 4]],
    starts: &[f64],
    log: &ResetLog,
    reports: &FaultReports,
) -> CheckedFaults {
    let reported = &reports.faults;
    let run = FaultyRun::new(faults, log);
    let mut due = Vec::new();
    let mut wrong = Vec::new();
    run.resets(&mut due, &mut wrong);
    run.overruns(&mut due);
    run.supply(&mut due);
    run.sensors(rows, &mut due);
    let (came, spurious) = match_reports(&due, reported);
    let mut outcomes = vec![Outcome::Excused; faults.len()];
    for (due, came) in due.iter().zip(came) {
        for &fault in &due.faults {
            outcomes[fault] = match outcomes[fault] {
                Outcome::Excused if came => Outcome::Reported,
                Outcome::Excused | Outcome::Reported if !came && due.required => Outcome::Missing,
                outcome => outcome,
            };
        }
        if due.required && !came {
            wrong.push(format!("{due} was not reported"));
        }
    }
    for at in spurious {
        let FaultReport { at, cause, detail } = &reported[at];
        let cause = cause.name().unwrap_or("a cause without a name");
        wrong.push(format!(
            "{cause} ({detail}) was reported at {at:.4} s, and nothing provoked it"
        ));
    }
    wrong.extend(run.lost(starts, &reports.strikes));
    CheckedFaults { outcomes, wrong }
}

/// A report that is required, or allowed.
#[derive(Debug)]
struct ExpectedReport {
    /// The causes, one of which it has.
    causes: Vec<FaultCause>,
    /// The cause that is over, of a recovery.
    over: Option<FaultCause>,
    from: f64,
    until: f64,
    required: bool,
    /// The faults that it is about.
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

/// True for each expected report that came; and the places of the reports that nothing explains.
fn match_reports(due: &[ExpectedReport], reported: &[FaultReport]) -> (Vec<bool>, Vec<usize>) {
    let mut came = vec![false; due.len()];
    let mut spurious = Vec::new();
    for (number, reported) in reported.iter().enumerate() {
        // A strike that a fault cut follows from that fault.
        if reported.cause == FaultCause::StrikeCut {
            continue;
        }
        let fits = |due: &ExpectedReport| {
            due.causes.contains(&reported.cause)
                && (due.from..=due.until).contains(&reported.at)
                && due.over.is_none_or(|over| over.name() == Some(&reported.detail))
        };
        let open = (0..due.len()).filter(|&at| !came[at] && fits(&due[at]));
        // A required report first, and the most urgent of these.
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

/// A boot.
#[derive(Debug, Clone, Copy)]
struct Boot {
    began: f64,
    /// The earliest time of its first sample, s.
    earliest: f64,
    /// The latest time of its first sample, s.
    latest: f64,
    /// The time of the first fault that may end it, s.
    fatal: f64,
    end: f64,
}

/// A run with its faults.
struct FaultyRun<'a> {
    faults: &'a [Planned],
    log: &'a ResetLog,
    boots: Vec<Boot>,
    /// Intervals in which nothing leaves the port, s.
    stalls: Vec<[f64; 2]>,
    /// Intervals of a low supply, s.
    low: Vec<[f64; 2]>,
}

impl<'a> FaultyRun<'a> {
    fn new(faults: &'a [Planned], log: &'a ResetLog) -> Self {
        let mut run = Self {
            faults,
            log,
            boots: Vec::new(),
            stalls: stalls(faults),
            low: low(faults),
        };
        for number in 0..=log.resets.len() {
            let began = number.checked_sub(1).map(|before| log.resets[before].0);
            let end = log.resets.get(number).map_or(log.end, |(at, _)| *at);
            let (earliest, latest) = match began {
                // The first scan is at 0.
                None => (0.0, 0.0),
                Some(began) => (began + GOOD, run.good_since(began) + START),
            };
            // One that did not end the boot came when the DMA was not at work.
            let fatal = faults.iter().filter(|fault| {
                let took = end - fault.at;
                let within = if fault.kind == Kind::Hang {
                    WATCHDOG + CRASH
                } else {
                    CRASH
                };
                crashes(fault.kind) && fault.at >= earliest && (0.0..=within).contains(&took)
            });
            let fatal = fatal.map(|fault| fault.at).fold(end, f64::min);
            let began = began.unwrap_or(f64::NEG_INFINITY);
            run.boots.push(Boot {
                began,
                earliest,
                latest,
                fatal,
                end,
            });
        }
        run
    }

    /// The time at which a start has seen a good supply for long enough, or waits no more, s.
    fn good_since(&self, began: f64) -> f64 {
        let mut good = began;
        for [from, to] in &self.low {
            if *from < good + GOOD && *to > good {
                good = *to;
            }
        }
        good.min(began + PATIENCE) + GOOD
    }

    /// The boot that a fault meets. One that resets at once is not of the boot that it begins.
    fn boot_at(&self, time: f64) -> &Boot {
        let number = self.boots.iter().rposition(|boot| boot.began < time - INSTANT);
        &self.boots[number.unwrap_or(0)]
    }

    /// The latest time at which a report of `time` has left, s.
    fn leaves(&self, time: f64) -> f64 {
        let mut leaves = time + LEAVES;
        for [from, to] in &self.stalls {
            if *from < leaves && *to > time - LEAVES {
                leaves = leaves.max(to + LEAVES);
            }
        }
        leaves
    }

    /// True if a report of `time` leaves before the boot ends.
    fn survives(&self, boot: &Boot, time: f64) -> bool {
        self.leaves(time) < boot.fatal.min(boot.end)
    }

    fn stalled(&self, from: f64, to: f64) -> f64 {
        let within = self
            .stalls
            .iter()
            .map(|[begins, ends]| ends.min(to) - begins.max(from));
        within.fold(0.0, f64::max)
    }

    /// Faults that end in a reset, and the reports of the next boot.
    fn resets(&self, due: &mut Vec<ExpectedReport>, wrong: &mut Vec<String>) {
        for (number, &(at, cause)) in self.log.resets.iter().enumerate() {
            let boot = self.boots[number];
            let (mut of, mut causes) = (Vec::new(), Vec::new());
            for (index, fault) in self.faults.iter().enumerate() {
                let within = |[soonest, latest]: [f64; 2]| {
                    fault.at >= boot.began && (fault.at + soonest..=fault.at + latest).contains(&at)
                };
                let (reported, did) = match fault.kind {
                    Kind::PowerCut => (
                        None,
                        cause == ResetCause::PowerCut && (fault.at - at).abs() < 1e-3,
                    ),
                    Kind::Hang => {
                        let did = cause == ResetCause::Watchdog && within([0.0, WATCHDOG + CRASH]);
                        (Some(FaultCause::Watchdog), did)
                    }
                    Kind::UartStall => {
                        let silent = self.stalled(boot.began, at) >= GIVEN_UP[0];
                        let ours =
                            fault.at < at && fault.at + fault.duration.unwrap_or(f64::INFINITY) > boot.began;
                        (
                            Some(FaultCause::Panic),
                            cause == ResetCause::Software && silent && ours,
                        )
                    }
                    kind if crashes(kind) => (
                        fault.cause(),
                        cause == ResetCause::Software && within([0.0, CRASH]),
                    ),
                    _ => continue,
                };
                if did {
                    of.push(index);
                    causes.extend(reported);
                }
            }
            if of.is_empty() {
                wrong.push(format!(
                    "the bead was reset at {at:.4} s ({cause:?}), and nothing explains it"
                ));
                continue;
            }
            if cause == ResetCause::PowerCut {
                continue;
            }
            let next = self.boots[number + 1];
            // It is reported when the start is done, and again with the frames of every second if the line
            // was busy.
            let until = self.leaves(next.latest);
            due.push(ExpectedReport {
                causes,
                over: None,
                from: at,
                until,
                required: until + LEAVES < next.fatal.min(next.end),
                faults: of,
            });
        }
        for fault in self.faults {
            let boot = self.boot_at(fault.at);
            // A converter that is being set up anew has no DMA stream to fail.
            let sampling = boot.latest <= fault.at && !self.set_up_anew(fault.at);
            let within = match fault.kind {
                Kind::PowerCut => 1e-3,
                Kind::Hang if sampling => WATCHDOG + CRASH,
                kind if crashes(kind) && sampling => CRASH,
                _ => continue,
            };
            if boot.end > fault.at + within && (boot.fatal >= fault.at || fault.kind == Kind::PowerCut) {
                let kind = fault.kind.name();
                wrong.push(format!(
                    "{kind} at {} s ended in no reset within {within} s",
                    fault.at
                ));
            }
        }
        self.silences(wrong);
    }

    /// A port that is silent for too long ends in a reset.
    fn silences(&self, wrong: &mut Vec<String>) {
        for boot in &self.boots {
            for [from, to] in &self.stalls {
                let from = from.max(boot.latest);
                let silent = to.min(boot.fatal) - from;
                if silent > GIVEN_UP[1] {
                    wrong.push(format!(
                        "a port that was silent from {from:.4} s on for {silent:.4} s was not given up"
                    ));
                }
            }
        }
    }

    /// True if the converter may have no DMA stream at a time.
    fn set_up_anew(&self, time: f64) -> bool {
        let overruns = self.faults.iter().filter(|fault| fault.kind == Kind::AdcOverrun);
        overruns
            .into_iter()
            .any(|fault| (fault.at..fault.at + SET_UP_ANEW).contains(&time))
    }

    /// Overruns: each is reported, but two that are close may have one report.
    fn overruns(&self, due: &mut Vec<ExpectedReport>) {
        for (index, fault) in self.faults.iter().enumerate() {
            if fault.kind != Kind::AdcOverrun {
                continue;
            }
            let boot = self.boot_at(fault.at);
            let others = self.faults.iter().enumerate();
            let alone = !others.into_iter().any(|(other, fault_of_other)| {
                other != index
                    && matches!(fault_of_other.kind, Kind::AdcOverrun | Kind::AdcDmaError)
                    && (fault_of_other.at - fault.at).abs() < 2.0 * SET_UP_ANEW
            });
            let made = fault.at + SET_UP_ANEW;
            due.push(ExpectedReport {
                causes: vec![FaultCause::AdcOverrun],
                over: None,
                from: fault.at,
                until: self.leaves(made).max(self.leaves(boot.latest)),
                required: alone && boot.latest <= fault.at && self.survives(boot, made),
                faults: vec![index],
            });
        }
    }

    fn supply(&self, due: &mut Vec<ExpectedReport>) {
        let faults: Vec<usize> = (0..self.faults.len())
            .filter(|&at| self.faults[at].kind == Kind::Supply)
            .collect();
        for boot in &self.boots {
            let within = self
                .low
                .iter()
                .map(|[from, to]| [from.max(boot.earliest), to.min(boot.fatal.min(boot.end))]);
            let within: Vec<_> = within.filter(|[from, to]| from < to).collect();
            for (number, [from, to]) in within.iter().enumerate() {
                let since = number
                    .checked_sub(1)
                    .map_or(f64::INFINITY, |before| from - within[before][1]);
                let until_next = within.get(number + 1).map_or(f64::INFINITY, |next| next[0] - to);
                let noticed = from.max(boot.latest);
                let causes = faults.iter().copied().filter(|&at| {
                    let fault = &self.faults[at];
                    let ends = fault.at + fault.duration.unwrap_or(f64::INFINITY);
                    fault.at < *to && ends > *from && fault.cause().is_some()
                });
                let causes: Vec<usize> = causes.collect();
                let lasts = to - noticed >= NOTICED;
                if since > OVER[0] {
                    due.push(ExpectedReport {
                        causes: vec![FaultCause::SupplyLow],
                        over: None,
                        from: *from,
                        until: self.leaves(noticed + NOTICED),
                        required: lasts && since > OVER[1] && self.survives(boot, noticed + NOTICED),
                        faults: causes,
                    });
                }
                if until_next > OVER[0] && *to < boot.end {
                    let over = to.max(boot.latest) + OVER[1];
                    due.push(ExpectedReport {
                        causes: vec![FaultCause::Recovered],
                        over: Some(FaultCause::SupplyLow),
                        from: *to,
                        until: self.leaves(over),
                        required: lasts && until_next > OVER[1] && self.survives(boot, over),
                        faults: Vec::new(),
                    });
                }
            }
        }
    }

    /// Sensors whose codes stand still or lie at a rail for long enough.
    fn sensors(&self, rows: &[[u16; 4]], due: &mut Vec<ExpectedReport>) {
        let causes = [
            [FaultCause::ForceStuck, FaultCause::ForceRailed],
            [FaultCause::AccelerationStuck, FaultCause::AccelerationRailed],
        ];
        for (sensor, causes) in causes.into_iter().enumerate() {
            for (railed, [from, to]) in standing(rows, sensor) {
                let cause = causes[usize::from(railed)];
                let of = self.faults.iter().enumerate().filter(|(_, fault)| {
                    let ends = fault.at + fault.duration.unwrap_or(f64::INFINITY);
                    fault.sensor_cause() == Some(cause) && fault.at < to && ends > from
                });
                let of: Vec<usize> = of.map(|(index, _)| index).collect();
                for boot in &self.boots {
                    let end = boot.fatal.min(boot.end);
                    let sampled = |from: f64| to.min(end) - from - self.gaps(from, to.min(end));
                    let (earliest, latest) = (from.max(boot.earliest), from.max(boot.latest));
                    if to.min(boot.end) - earliest < FOUND[0] {
                        continue;
                    }
                    let found = latest + FOUND[1] + self.gaps(latest, latest + 2.0 * FOUND[1]);
                    let lasts = sampled(latest) >= FOUND[1];
                    due.push(ExpectedReport {
                        causes: vec![cause],
                        over: None,
                        from: earliest + FOUND[0],
                        until: self.leaves(found),
                        required: lasts && self.survives(boot, found),
                        faults: of.clone(),
                    });
                    if to < boot.end {
                        let over = to + SET_UP_ANEW * f64::from(u8::from(self.set_up_anew(to))) + NOTICED;
                        due.push(ExpectedReport {
                            causes: vec![FaultCause::Recovered],
                            over: Some(cause),
                            from: to,
                            until: self.leaves(over),
                            required: lasts && self.survives(boot, over),
                            faults: Vec::new(),
                        });
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
                    "the strike at {start:.4} s has no result, and no fault was near"
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
            let ends = fault.at + fault.duration.unwrap_or(f64::INFINITY);
            match fault.kind {
                Kind::AdcOverrun | Kind::AdcDmaError => {
                    (fault.at - MEASURED..fault.at + SET_UP_ANEW + ARMED).contains(&start)
                }
                Kind::ForceStuck | Kind::ForceRailed => (fault.at - MEASURED..ends + ARMED).contains(&start),
                Kind::UartStall => (fault.at - LEAVES..ends + 2.0 * LEAVES).contains(&start),
                _ => false,
            }
        };
        runs && !self.faults.iter().any(near)
    }

    /// Longest time without samples between two times because of overruns, s.
    fn gaps(&self, from: f64, to: f64) -> f64 {
        let overruns = self.faults.iter().filter(|fault| fault.kind == Kind::AdcOverrun);
        let within = overruns.filter(|fault| (from - SET_UP_ANEW..to).contains(&fault.at));
        within.count() as f64 * SET_UP_ANEW
    }
}

/// True for the kinds that break the interrupt or the stream of the samples.
fn crashes(kind: Kind) -> bool {
    use Kind::{AdcDmaError, Hang, HardFault, Panic, StackOverflow};
    matches!(kind, AdcDmaError | Panic | HardFault | Hang | StackOverflow)
}

/// Intervals in which nothing leaves the port: a later stall may only make one longer.
fn stalls(faults: &[Planned]) -> Vec<[f64; 2]> {
    let stalls = faults.iter().filter(|fault| fault.kind == Kind::UartStall);
    merged(stalls.map(|fault| [fault.at, fault.at + fault.duration.unwrap_or(f64::INFINITY)]))
}

fn merged(times: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
    let mut times: Vec<_> = times.collect();
    times.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut all: Vec<[f64; 2]> = Vec::new();
    for [from, to] in times {
        match all.last_mut() {
            Some(last) if from <= last[1] => last[1] = last[1].max(to),
            _ => all.push([from, to]),
        }
    }
    all
}

/// Intervals in which the emulator's supply is low.
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

/// Intervals, s, in which the codes of a sensor stand still or lie at a rail for long enough to be found; and
/// true for those at a rail.
fn standing(rows: &[[u16; 4]], sensor: usize) -> Vec<(bool, [f64; 2])> {
    let rail = |code: u16| match code {
        code if code < RAIL => Some(0),
        code if code >= CODES - RAIL => Some(1),
        _ => None,
    };
    let seconds = |row: usize| row as f64 / f64::from(SAMPLE_RATE_HZ);
    let least = (FOUND[0] * f64::from(SAMPLE_RATE_HZ)) as usize;
    let mut found = Vec::new();
    // Both gains of a sensor fail together here: the first tells.
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
            let ends = if from + many == codes.len() {
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
    use super::*;
    use crate::faults::{parse, provoke};

    /// Checks a run of 2 s with these faults, resets and reports, and 19 strikes that were all
    /// measured.
    fn wrong(
        faults: &str,
        resets: &[(f64, ResetCause)],
        reported: &[(f64, FaultCause, &str)],
    ) -> Vec<String> {
        let strikes = (1..20).map(|strike| 0.1 * f64::from(strike));
        run(
            faults,
            resets,
            reported,
            strikes.map(|start| start + 0.02).collect(),
        )
        .wrong
    }

    fn run(
        faults: &str,
        resets: &[(f64, ResetCause)],
        reported: &[(f64, FaultCause, &str)],
        strikes: Vec<f64>,
    ) -> CheckedFaults {
        let text: String = faults
            .split(';')
            .map(|fault| {
                let mut words = fault.split_whitespace();
                let (kind, at) = (words.next().unwrap(), words.next().unwrap());
                let more: Vec<_> = words.map(|word| word.replace('=', " = ")).collect();
                format!("[[fault]]\nkind = \"{kind}\"\nat = {at}\n{}\n", more.join("\n"))
            })
            .collect();
        let faults = parse(&text, "f.toml").unwrap();
        let mut stimulus = stm32f405_qemu::Run::new("none");
        stimulus.stimulus = (0..200_000u32).map(|row| [1000 + (row % 7) as u16; 4]).collect();
        provoke(&faults, &mut stimulus);
        let log = ResetLog {
            resets: resets.to_vec(),
            end: 2.0,
        };
        let reported = reported.iter().map(|(at, cause, detail)| FaultReport {
            at: *at,
            cause: *cause,
            detail: (*detail).to_owned(),
        });
        let reports = FaultReports {
            faults: reported.collect(),
            strikes,
        };
        let starts: Vec<f64> = (1..20).map(|strike| 0.1 * f64::from(strike)).collect();
        check_reports(&faults, &stimulus.stimulus, &starts, &log, &reports)
    }

    /// The only line.
    fn only(wrong: &[String]) -> &str {
        match wrong {
            [line] => line,
            _ => panic!("{wrong:?}"),
        }
    }

    use FaultCause::{AdcOverrun, ForceRailed, ForceStuck, HardFault, Panic, Recovered, SupplyLow, Watchdog};
    use ResetCause::{PowerCut, Software};

    #[test]
    fn a_fault_is_reported_once_in_its_time() {
        let overrun = "adc_overrun 0.5";
        assert_eq!(wrong(overrun, &[], &[(0.513, AdcOverrun, "")]), [""; 0]);
        let missing = wrong(overrun, &[], &[]);
        assert!(
            only(&missing).starts_with("adc_overrun, due between 0.5000 and"),
            "{missing:?}"
        );
        let twice = wrong(overrun, &[], &[(0.513, AdcOverrun, ""), (0.514, AdcOverrun, "")]);
        assert!(
            only(&twice).ends_with("was reported at 0.5140 s, and nothing provoked it"),
            "{twice:?}"
        );
        let late = wrong(overrun, &[], &[(0.8, AdcOverrun, "")]);
        assert_eq!(late.len(), 2, "{late:?}");
        let another = wrong(overrun, &[], &[(0.513, AdcOverrun, ""), (0.513, Panic, "")]);
        assert!(only(&another).starts_with("panic"), "{another:?}");
    }

    #[test]
    fn a_reset_needs_its_fault_and_a_fault_its_reset() {
        let reported = [(0.56, HardFault, "CFSR")];
        let fault = "hard_fault 0.5";
        assert_eq!(wrong(fault, &[(0.502, Software)], &reported), [""; 0]);
        let none = wrong(fault, &[], &[]);
        assert!(
            only(&none).starts_with("hard_fault at 0.5 s ended in no reset"),
            "{none:?}"
        );
        let two = wrong(fault, &[(0.502, Software), (1.0, Software)], &reported);
        assert!(only(&two).contains("reset at 1.0000 s"), "{two:?}");
        let other = wrong(fault, &[(0.502, ResetCause::Watchdog)], &reported);
        assert!(
            other.iter().any(|line| line.contains("nothing explains it")),
            "{other:?}"
        );
        let late = wrong("power_cut 0.5", &[(0.6, PowerCut)], &[]);
        assert_eq!(late.len(), 2, "{late:?}");
    }

    #[test]
    fn a_hang_ends_in_two_seconds_unless_the_run_does() {
        assert_eq!(wrong("hang 0.5", &[], &[]), [""; 0]);
        let hang = "hang 0.01";
        let late = run(
            hang,
            &[(1.9, ResetCause::Watchdog)],
            &[(1.96, Watchdog, "")],
            Vec::new(),
        );
        assert_eq!(
            (&late.wrong[..], &late.outcomes[..]),
            (&[][..], &[Outcome::Reported][..])
        );
    }

    #[test]
    fn what_another_fault_hides_need_not_be_reported_and_may_be() {
        // While the bead starts again after the panic, nothing overruns.
        let faults = "panic 0.5; adc_overrun 0.51";
        let resets = [(0.502, Software)];
        for reported in [
            &[(0.56, Panic, "")][..],
            &[(0.56, Panic, ""), (0.57, AdcOverrun, "")],
        ] {
            assert_eq!(wrong(faults, &resets, reported), [""; 0]);
        }
        let outcomes = run(faults, &resets, &[(0.56, Panic, "")], Vec::new()).outcomes;
        assert_eq!(outcomes, [Outcome::Reported, Outcome::Excused]);
        // Of two that end one boot, one is reported.
        let faults = "panic 0.5; hard_fault 0.501";
        assert_eq!(wrong(faults, &resets, &[(0.56, HardFault, "")]), [""; 0]);
        assert_eq!(wrong(faults, &resets, &[]).len(), 1);
        let both = [(0.56, HardFault, ""), (0.57, Panic, "")];
        assert!(only(&wrong(faults, &resets, &both)).starts_with("panic"));
    }

    #[test]
    fn a_stuck_sensor_is_reported_and_so_is_its_recovery() {
        let reported = |recovered: &'static str| [(0.56, ForceStuck, ""), (0.7, Recovered, recovered)];
        let long = "force_stuck 0.5 duration=0.2";
        assert_eq!(wrong(long, &[], &reported("force_stuck")), [""; 0]);
        assert_eq!(wrong(long, &[], &reported("force_railed")).len(), 2);
        assert_eq!(wrong(long, &[], &reported("force_stuck")[..1]).len(), 1);
        assert_eq!(wrong("force_stuck 0.5 duration=0.04", &[], &[]), [""; 0]);
        let short = wrong("force_stuck 0.5 duration=0.04", &[], &[(0.54, ForceStuck, "")]);
        assert!(only(&short).contains("nothing provoked it"), "{short:?}");
        // At a rail for a while in between, it is another fault.
        let within = "force_stuck 0.3 duration=0.5; force_railed 0.4 duration=0.3";
        let reported = [
            (0.36, ForceStuck, ""),
            (0.4, Recovered, "force_stuck"),
            (0.46, ForceRailed, ""),
            (0.7, Recovered, "force_railed"),
            (0.76, ForceStuck, ""),
            (0.8, Recovered, "force_stuck"),
        ];
        assert_eq!(wrong(within, &[], &reported), [""; 0]);
        assert_eq!(wrong(within, &[], &reported[..5]).len(), 1);
    }

    #[test]
    fn a_supply_that_dips_again_at_once_is_one_fault() {
        let dips = "supply 0.5 volts=2.7 duration=0.01; supply 0.515 volts=2.5 duration=0.01";
        let reported = [(0.502, SupplyLow, ""), (0.546, Recovered, "supply_low")];
        assert_eq!(wrong(dips, &[], &reported), [""; 0]);
        assert!(wrong(dips, &[], &reported[..1]).len() == 1);
        assert_eq!(wrong("supply 0.5 volts=3.0 duration=0.01", &[], &[]), [""; 0]);
    }

    #[test]
    fn a_strike_that_no_fault_is_near_has_a_result() {
        let results: Vec<f64> = (1..20).map(|strike| 0.1 * f64::from(strike) + 0.02).collect();
        for lost in 0..results.len() {
            let mut results = results.clone();
            results.remove(lost);
            let wrong = run("adc_overrun 0.5", &[], &[(0.513, AdcOverrun, "")], results).wrong;
            // The overrun cuts the strike at 0.5 s, and the run may end before the last result leaves.
            assert_eq!(
                wrong.len(),
                usize::from(lost != 4 && lost != 18),
                "{lost}: {wrong:?}"
            );
        }
    }

    #[test]
    fn a_silent_port_is_given_up_after_a_second_and_a_half_and_reported_when_it_speaks() {
        let stall = "uart_stall 0.1 duration=1.6";
        let reported = [(1.75, Panic, "transmission hangs")];
        let reset = [(1.4, Software)];
        assert_eq!(
            run(stall, &reset, &reported, Vec::new()).outcomes,
            [Outcome::Reported]
        );
        let none = run(stall, &[], &[], Vec::new()).wrong;
        assert!(
            none.iter().any(|line| line.contains("was not given up")),
            "{none:?}"
        );
        let short = wrong("uart_stall 0.5 duration=0.2", &[(0.8, Software)], &[]);
        assert!(
            short.iter().any(|line| line.contains("nothing explains it")),
            "{short:?}"
        );
    }
}
