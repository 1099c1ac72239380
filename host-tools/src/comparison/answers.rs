//! What a bead has to say of the faults of a run, and whether it said that, once, and nothing else.
//!
//! # Design
//! Faults meet one another: one comes while the bead starts after another, hangs, or sends nothing. So what
//! is asked for follows from the run. The emulator tells when the bead was reset. Between two resets the bead
//! surely takes notice, or it may, where a fault falls into its start or close to another one. A report is
//! answered for by a fault of its cause at its time; one that no fault answers for is made up, and one that
//! is surely due and did not come is missing. Times are in s after the first scan.

use bead_wire::{FaultCause, Message};
use stm32f405_qemu::{Reset, ResetCause};

use crate::bench::faults::{Kind, Planned, supply};
use crate::bench::front_end::{CODES, SAMPLE_RATE_HZ};
use crate::recording::frames::Frame;

/// A report of a fault, as it left the bead.
#[derive(Debug, Clone, PartialEq)]
pub struct Told {
    /// When its frame had left.
    pub at: f64,
    /// What it says.
    pub cause: FaultCause,
    /// Its text.
    pub detail: String,
}

/// What a bead said in a run that has faults in it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Heard {
    /// The faults that it reported, in the order in which they came.
    pub told: Vec<Told>,
    /// When the result of each strike had left.
    pub strikes: Vec<f64>,
}

impl Heard {
    /// From frames whose times are those of the run, in ns since the first scan.
    pub fn new(frames: &[Frame]) -> Self {
        let mut heard = Self::default();
        for frame in frames {
            let at = frame.received_ns.unwrap_or(0) as f64 * 1e-9;
            match &frame.message {
                Message::Fault(fault) => heard.told.push(Told {
                    at,
                    cause: fault.cause,
                    detail: fault.detail.as_str().to_owned(),
                }),
                Message::Strike(_) => heard.strikes.push(at),
                _ => {}
            }
        }
        heard
    }
}

/// When a bead was reset, and when the run ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Life {
    /// Each reset after power-up.
    pub resets: Vec<(f64, ResetCause)>,
    /// The end.
    pub end: f64,
}

impl Life {
    /// From what the emulator tells, in ns of virtual time.
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

/// What became of a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// The bead told of it.
    Told,
    /// It did not, and need not: another fault hid it, it was too short, or the run ended.
    Untold,
    /// It had to, and did not.
    Missing,
}

/// The outcome for all faults of a run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Answers {
    /// What became of each fault, in their order.
    pub fates: Vec<Fate>,
    /// What is wrong, a line each: reports that are missing or made up, and resets that did not come or that
    /// no fault explains.
    pub wrong: Vec<String>,
}

/// The watchdog resets a bead that hangs this long after it was last fed, s: 2 s.
const WATCHDOG: f64 = 2.05;
/// From what breaks the interrupt of the DMA to the reset: that interrupt comes with each block, and 12 ms
/// later if the converter has stopped meanwhile.
const CRASH: f64 = 0.03;
/// A port that is silent for so long is given up: at the earliest if nothing left for a second before, and at
/// the latest.
const GIVEN_UP: [f64; 2] = [0.5, 1.55];
/// A converter that is silent is set up anew after this time.
const SET_UP_ANEW: f64 = 0.015;
/// A sensor's code that stands still is found after 50 to 60 ms of samples: never before, and surely.
const FOUND: [f64; 2] = [0.048, 0.065];
/// What the bead has found leaves it within this time, behind the frames that wait.
const LEAVES: f64 = 0.1;
/// A low supply is noticed if it lasts for this time, and is over when it has been good for 20 ms.
const NOTICED: f64 = 0.005;
const OVER: [f64; 2] = [0.015, 0.025];
/// From a good supply to samples, and how long a supply has to be good for a start, and how long one waits
/// for it.
const START: f64 = 0.045;
const GOOD: f64 = 0.02;
const PATIENCE: f64 = 5.0;
/// The supply is low below this, and good again above that, V (`firmware/src/supply.rs`).
const LOW: [f64; 2] = [2.93, 3.03];
/// From a strike to its result, s, and from the first samples to a detector that is armed.
const MEASURED: f64 = 0.03;
const ARMED: f64 = 0.02;
/// A result leaves a line that is not behind within this time, s.
const RESULT_LEAVES: f64 = 0.02;
/// What takes no time, s: less than this, since times are rounded to ns.
const INSTANT: f64 = 1e-6;
/// Codes this near to an end of the range are at the rail (`firmware/src/health.rs`).
const RAIL: u16 = 16;

/// Holds what was said against the faults and strikes of a run. `rows` are the codes that the sensors gave,
/// with the faults in them; `starts` are when the strikes began.
pub fn answers(faults: &[Planned], rows: &[[u16; 4]], starts: &[f64], life: &Life, heard: &Heard) -> Answers {
    let told = &heard.told;
    let run = Faulty::new(faults, life);
    let mut due = Vec::new();
    let mut wrong = Vec::new();
    run.resets(&mut due, &mut wrong);
    run.overruns(&mut due);
    run.supply(&mut due);
    run.sensors(rows, &mut due);
    let (told_of, made_up) = matched(&due, told);
    let mut fates = vec![Fate::Untold; faults.len()];
    for (due, told) in due.iter().zip(told_of) {
        for &fault in &due.faults {
            fates[fault] = match fates[fault] {
                Fate::Untold if told => Fate::Told,
                Fate::Untold | Fate::Told if !told && due.surely => Fate::Missing,
                fate => fate,
            };
        }
        if due.surely && !told {
            wrong.push(format!("{due} was not reported"));
        }
    }
    for at in made_up {
        let Told { at, cause, detail } = &told[at];
        let cause = cause.name().unwrap_or("a cause without a name");
        wrong.push(format!(
            "{cause} ({detail}) was reported at {at:.4} s, and nothing provoked it"
        ));
    }
    wrong.extend(run.lost(starts, &heard.strikes));
    Answers { fates, wrong }
}

/// A report that is due, or may be.
#[derive(Debug)]
struct Due {
    /// One of these.
    causes: Vec<FaultCause>,
    /// What is over, of a recovery.
    over: Option<FaultCause>,
    from: f64,
    until: f64,
    surely: bool,
    /// The faults that it is of.
    faults: Vec<usize>,
}

impl std::fmt::Display for Due {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let names: Vec<_> = self.causes.iter().filter_map(|cause| cause.name()).collect();
        write!(f, "{}", names.join(" or "))?;
        if let Some(over) = self.over.and_then(FaultCause::name) {
            write!(f, " of {over}")?;
        }
        write!(f, ", due between {:.4} and {:.4} s,", self.from, self.until)
    }
}

/// Which of the reports that are due came, and the reports that nothing answers for.
fn matched(due: &[Due], told: &[Told]) -> (Vec<bool>, Vec<usize>) {
    let mut came = vec![false; due.len()];
    let mut made_up = Vec::new();
    for (number, told) in told.iter().enumerate() {
        // A strike that a fault cut follows from that fault.
        if told.cause == FaultCause::StrikeCut {
            continue;
        }
        let fits = |due: &Due| {
            due.causes.contains(&told.cause)
                && (due.from..=due.until).contains(&told.at)
                && due.over.is_none_or(|over| over.name() == Some(&told.detail))
        };
        let open = (0..due.len()).filter(|&at| !came[at] && fits(&due[at]));
        // What is surely due comes first, and of that what is due soonest.
        let first = open.min_by(|&a, &b| {
            let [a, b] = [&due[a], &due[b]];
            b.surely.cmp(&a.surely).then(a.until.total_cmp(&b.until))
        });
        match first {
            Some(at) => came[at] = true,
            None => made_up.push(number),
        }
    }
    (came, made_up)
}

/// A boot: when it began, from when on it may take samples and surely does, and when the bead stops or is
/// reset.
#[derive(Debug, Clone, Copy)]
struct Boot {
    began: f64,
    may: f64,
    surely: f64,
    /// The first fault of it that ends in a reset, if that may work.
    dying: f64,
    end: f64,
}

/// A run with its faults.
struct Faulty<'a> {
    faults: &'a [Planned],
    life: &'a Life,
    boots: Vec<Boot>,
    /// From when to when nothing leaves the port.
    stalls: Vec<[f64; 2]>,
    /// From when to when the supply is low.
    low: Vec<[f64; 2]>,
}

impl<'a> Faulty<'a> {
    fn new(faults: &'a [Planned], life: &'a Life) -> Self {
        let mut run = Self {
            faults,
            life,
            boots: Vec::new(),
            stalls: stalls(faults),
            low: low(faults),
        };
        for number in 0..=life.resets.len() {
            let began = number.checked_sub(1).map(|before| life.resets[before].0);
            let end = life.resets.get(number).map_or(life.end, |(at, _)| *at);
            let (may, surely) = match began {
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
                crashes(fault.kind) && fault.at >= may && (0.0..=within).contains(&took)
            });
            let dying = fatal.map(|fault| fault.at).fold(end, f64::min);
            let began = began.unwrap_or(f64::NEG_INFINITY);
            run.boots.push(Boot {
                began,
                may,
                surely,
                dying,
                end,
            });
        }
        run
    }

    /// When a start that began at a time finds that the supply has been good for long enough, or waits no
    /// more.
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

    /// When a report that is made at a time has left at the latest.
    fn leaves(&self, time: f64) -> f64 {
        let mut leaves = time + LEAVES;
        for [from, to] in &self.stalls {
            if *from < leaves && *to > time - LEAVES {
                leaves = leaves.max(to + LEAVES);
            }
        }
        leaves
    }

    /// Whether a report that is made in a boot at a time leaves before the bead is reset.
    fn survives(&self, boot: &Boot, time: f64) -> bool {
        self.leaves(time) < boot.dying.min(boot.end)
    }

    fn stalled(&self, from: f64, to: f64) -> f64 {
        let within = self
            .stalls
            .iter()
            .map(|[begins, ends]| ends.min(to) - begins.max(from));
        within.fold(0.0, f64::max)
    }

    /// Faults that end in a reset, and what the next boot tells of them.
    fn resets(&self, due: &mut Vec<Due>, wrong: &mut Vec<String>) {
        for (number, &(at, cause)) in self.life.resets.iter().enumerate() {
            let boot = self.boots[number];
            let (mut of, mut causes) = (Vec::new(), Vec::new());
            for (index, fault) in self.faults.iter().enumerate() {
                let within = |[soonest, latest]: [f64; 2]| {
                    fault.at >= boot.began && (fault.at + soonest..=fault.at + latest).contains(&at)
                };
                let (told, did) = match fault.kind {
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
                    causes.extend(told);
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
            // It is told when the start is done, and again with what is told every second if the line was
            // busy.
            let until = self.leaves(next.surely);
            due.push(Due {
                causes,
                over: None,
                from: at,
                until,
                surely: until + LEAVES < next.dying.min(next.end),
                faults: of,
            });
        }
        for fault in self.faults {
            let boot = self.boot_at(fault.at);
            // A converter that is being set up anew has no DMA stream to fail.
            let sampling = boot.surely <= fault.at && !self.set_up_anew(fault.at);
            let within = match fault.kind {
                Kind::PowerCut => 1e-3,
                Kind::Hang if sampling => WATCHDOG + CRASH,
                kind if crashes(kind) && sampling => CRASH,
                _ => continue,
            };
            if boot.end > fault.at + within && (boot.dying >= fault.at || fault.kind == Kind::PowerCut) {
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
                let from = from.max(boot.surely);
                let silent = to.min(boot.dying) - from;
                if silent > GIVEN_UP[1] {
                    wrong.push(format!(
                        "a port that was silent from {from:.4} s on for {silent:.4} s was not given up"
                    ));
                }
            }
        }
    }

    /// Whether the converter may be without a DMA stream at a time.
    fn set_up_anew(&self, time: f64) -> bool {
        let overruns = self.faults.iter().filter(|fault| fault.kind == Kind::AdcOverrun);
        overruns
            .into_iter()
            .any(|fault| (fault.at..fault.at + SET_UP_ANEW).contains(&time))
    }

    /// Overruns: each is told, but of two that are close one may be the other's.
    fn overruns(&self, due: &mut Vec<Due>) {
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
            due.push(Due {
                causes: vec![FaultCause::AdcOverrun],
                over: None,
                from: fault.at,
                until: self.leaves(made).max(self.leaves(boot.surely)),
                surely: alone && boot.surely <= fault.at && self.survives(boot, made),
                faults: vec![index],
            });
        }
    }

    fn supply(&self, due: &mut Vec<Due>) {
        let faults: Vec<usize> = (0..self.faults.len())
            .filter(|&at| self.faults[at].kind == Kind::Supply)
            .collect();
        for boot in &self.boots {
            let within = self
                .low
                .iter()
                .map(|[from, to]| [from.max(boot.may), to.min(boot.dying.min(boot.end))]);
            let within: Vec<_> = within.filter(|[from, to]| from < to).collect();
            for (number, [from, to]) in within.iter().enumerate() {
                let since = number
                    .checked_sub(1)
                    .map_or(f64::INFINITY, |before| from - within[before][1]);
                let until_next = within.get(number + 1).map_or(f64::INFINITY, |next| next[0] - to);
                let noticed = from.max(boot.surely);
                let causes = faults.iter().copied().filter(|&at| {
                    let fault = &self.faults[at];
                    let ends = fault.at + fault.duration.unwrap_or(f64::INFINITY);
                    fault.at < *to && ends > *from && fault.cause().is_some()
                });
                let causes: Vec<usize> = causes.collect();
                let lasts = to - noticed >= NOTICED;
                let told = since > OVER[0];
                if told {
                    due.push(Due {
                        causes: vec![FaultCause::SupplyLow],
                        over: None,
                        from: *from,
                        until: self.leaves(noticed + NOTICED),
                        surely: lasts && since > OVER[1] && self.survives(boot, noticed + NOTICED),
                        faults: causes,
                    });
                }
                if until_next > OVER[0] && *to < boot.end {
                    let over = to.max(boot.surely) + OVER[1];
                    due.push(Due {
                        causes: vec![FaultCause::Recovered],
                        over: Some(FaultCause::SupplyLow),
                        from: *to,
                        until: self.leaves(over),
                        surely: lasts && until_next > OVER[1] && self.survives(boot, over),
                        faults: Vec::new(),
                    });
                }
            }
        }
    }

    /// What the codes tell: a sensor that stands still, or lies at a rail, for long enough.
    fn sensors(&self, rows: &[[u16; 4]], due: &mut Vec<Due>) {
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
                    let end = boot.dying.min(boot.end);
                    let sampled = |from: f64| to.min(end) - from - self.gaps(from, to.min(end));
                    let (may, surely) = (from.max(boot.may), from.max(boot.surely));
                    if to.min(boot.end) - may < FOUND[0] {
                        continue;
                    }
                    let found = surely + FOUND[1] + self.gaps(surely, surely + 2.0 * FOUND[1]);
                    let lasts = sampled(surely) >= FOUND[1];
                    due.push(Due {
                        causes: vec![cause],
                        over: None,
                        from: may + FOUND[0],
                        until: self.leaves(found),
                        surely: lasts && self.survives(boot, found),
                        faults: of.clone(),
                    });
                    if to < boot.end {
                        let over = to + SET_UP_ANEW * f64::from(u8::from(self.set_up_anew(to))) + NOTICED;
                        due.push(Due {
                            causes: vec![FaultCause::Recovered],
                            over: Some(cause),
                            from: to,
                            until: self.leaves(over),
                            surely: lasts && self.survives(boot, over),
                            faults: Vec::new(),
                        });
                    }
                }
            }
        }
    }

    /// Strikes that no fault was near, and of which no result came.
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

    /// Whether a bead surely sees and tells a strike that begins at a time.
    fn is_undisturbed(&self, start: f64) -> bool {
        let boot = self.boot_at(start);
        let runs = boot.surely + ARMED <= start && self.survives(boot, start + MEASURED);
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

    /// How long no samples were taken between two times because of overruns, at most.
    fn gaps(&self, from: f64, to: f64) -> f64 {
        let overruns = self.faults.iter().filter(|fault| fault.kind == Kind::AdcOverrun);
        let within = overruns.filter(|fault| (from - SET_UP_ANEW..to).contains(&fault.at));
        within.count() as f64 * SET_UP_ANEW
    }
}

/// Whether a fault of this kind breaks the interrupt or the stream that samples come by.
fn crashes(kind: Kind) -> bool {
    use Kind::{AdcDmaError, Hang, HardFault, Panic, StackOverflow};
    matches!(kind, AdcDmaError | Panic | HardFault | Hang | StackOverflow)
}

/// From when to when nothing leaves the port: a later stall may only make one longer.
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

/// From when to when the supply is low, as the emulator puts it.
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

/// Where the codes of a sensor, at one gain or both, stand still or lie at a rail for long enough to be
/// found: whether at a rail, and from when to when.
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
            let ends = match from + many == codes.len() {
                true => f64::INFINITY,
                false => seconds(from + many),
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
    use crate::bench::faults::{parse, provoke};

    /// What is wrong with a run of 2 s with these faults, resets and reports, and 19 strikes that were all
    /// measured.
    fn wrong(faults: &str, resets: &[(f64, ResetCause)], told: &[(f64, FaultCause, &str)]) -> Vec<String> {
        let strikes = (1..20).map(|strike| 0.1 * f64::from(strike));
        run(faults, resets, told, strikes.map(|start| start + 0.02).collect()).wrong
    }

    fn run(
        faults: &str,
        resets: &[(f64, ResetCause)],
        told: &[(f64, FaultCause, &str)],
        strikes: Vec<f64>,
    ) -> Answers {
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
        let life = Life {
            resets: resets.to_vec(),
            end: 2.0,
        };
        let told = told.iter().map(|(at, cause, detail)| Told {
            at: *at,
            cause: *cause,
            detail: (*detail).to_owned(),
        });
        let heard = Heard {
            told: told.collect(),
            strikes,
        };
        let starts: Vec<f64> = (1..20).map(|strike| 0.1 * f64::from(strike)).collect();
        answers(&faults, &stimulus.stimulus, &starts, &life, &heard)
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
    fn a_fault_is_told_once_in_its_time() {
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
        let told = [(0.56, HardFault, "CFSR")];
        let fault = "hard_fault 0.5";
        assert_eq!(wrong(fault, &[(0.502, Software)], &told), [""; 0]);
        let none = wrong(fault, &[], &[]);
        assert!(
            only(&none).starts_with("hard_fault at 0.5 s ended in no reset"),
            "{none:?}"
        );
        let two = wrong(fault, &[(0.502, Software), (1.0, Software)], &told);
        assert!(only(&two).contains("reset at 1.0000 s"), "{two:?}");
        let other = wrong(fault, &[(0.502, ResetCause::Watchdog)], &told);
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
        assert_eq!((&late.wrong[..], &late.fates[..]), (&[][..], &[Fate::Told][..]));
    }

    #[test]
    fn what_another_fault_hides_need_not_be_told_and_may_be() {
        // While the bead starts again after the panic, nothing overruns.
        let faults = "panic 0.5; adc_overrun 0.51";
        let resets = [(0.502, Software)];
        for told in [
            &[(0.56, Panic, "")][..],
            &[(0.56, Panic, ""), (0.57, AdcOverrun, "")],
        ] {
            assert_eq!(wrong(faults, &resets, told), [""; 0]);
        }
        let fates = run(faults, &resets, &[(0.56, Panic, "")], Vec::new()).fates;
        assert_eq!(fates, [Fate::Told, Fate::Untold]);
        // Of two that end one boot, one is told.
        let faults = "panic 0.5; hard_fault 0.501";
        assert_eq!(wrong(faults, &resets, &[(0.56, HardFault, "")]), [""; 0]);
        assert_eq!(wrong(faults, &resets, &[]).len(), 1);
        let both = [(0.56, HardFault, ""), (0.57, Panic, "")];
        assert!(only(&wrong(faults, &resets, &both)).starts_with("panic"));
    }

    #[test]
    fn a_sensor_is_told_of_by_how_long_it_stood_still_and_when_it_is_over() {
        let told = |recovered: &'static str| [(0.56, ForceStuck, ""), (0.7, Recovered, recovered)];
        let long = "force_stuck 0.5 duration=0.2";
        assert_eq!(wrong(long, &[], &told("force_stuck")), [""; 0]);
        assert_eq!(wrong(long, &[], &told("force_railed")).len(), 2);
        assert_eq!(wrong(long, &[], &told("force_stuck")[..1]).len(), 1);
        assert_eq!(wrong("force_stuck 0.5 duration=0.04", &[], &[]), [""; 0]);
        let short = wrong("force_stuck 0.5 duration=0.04", &[], &[(0.54, ForceStuck, "")]);
        assert!(only(&short).contains("nothing provoked it"), "{short:?}");
        // At a rail for a while in between, it is another fault.
        let within = "force_stuck 0.3 duration=0.5; force_railed 0.4 duration=0.3";
        let told = [
            (0.36, ForceStuck, ""),
            (0.4, Recovered, "force_stuck"),
            (0.46, ForceRailed, ""),
            (0.7, Recovered, "force_railed"),
            (0.76, ForceStuck, ""),
            (0.8, Recovered, "force_stuck"),
        ];
        assert_eq!(wrong(within, &[], &told), [""; 0]);
        assert_eq!(wrong(within, &[], &told[..5]).len(), 1);
    }

    #[test]
    fn a_supply_that_dips_again_at_once_is_one_fault() {
        let dips = "supply 0.5 volts=2.7 duration=0.01; supply 0.515 volts=2.5 duration=0.01";
        let told = [(0.502, SupplyLow, ""), (0.546, Recovered, "supply_low")];
        assert_eq!(wrong(dips, &[], &told), [""; 0]);
        assert!(wrong(dips, &[], &told[..1]).len() == 1);
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
    fn a_silent_port_is_given_up_after_a_second_and_a_half_and_told_of_when_it_speaks() {
        let stall = "uart_stall 0.1 duration=1.6";
        let told = [(1.75, Panic, "transmission hangs")];
        let reset = [(1.4, Software)];
        assert_eq!(run(stall, &reset, &told, Vec::new()).fates, [Fate::Told]);
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
