//! Faults to provoke in a run of the image, from a TOML file.
//!
//! ```toml
//! [[fault]]
//! at = 0.012              # s after the first scan
//! kind = "adc_overrun"
//!
//! [[fault]]
//! at = 0.1
//! kind = "force_stuck"
//! duration = 0.25         # s; without it, to the end of the run
//! ```

use std::ops::{Range, RangeInclusive};
use std::path::Path;

use bead_wire::FaultCause;
use hertz_chain::{InputError, TomlFile, read_text};
use serde::{Deserialize, Serialize};
use stm32f405_qemu::{Fault, FaultKind, Run};

use crate::error::BenchError;
use bead_compare::front_end::{AnalogFrontEnd, CODES, REFERENCE_VOLTS, SAMPLE_RATE_HZ};

/// Kind of a planned fault.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PlannedKind {
    /// The converter loses a conversion.
    AdcOverrun,
    /// The DMA stream of the converter meets a bus error.
    AdcDmaError,
    /// The force code no longer changes.
    ForceStuck,
    /// The acceleration code no longer changes.
    AccelerationStuck,
    /// The force code lies at its upper rail.
    ForceRailed,
    /// The acceleration code lies at its upper rail.
    AccelerationRailed,
    /// The supply has the voltage of `volts`.
    Supply,
    /// No byte leaves the bead's port.
    UartStall,
    /// An interrupt without a handler: the image's own code panics.
    Panic,
    /// A jump out of memory.
    HardFault,
    /// The processor never leaves an interrupt's handler.
    Hang,
    /// A loop that pushes on the stack for ever.
    StackOverflow,
    /// The power goes, and comes back at once.
    PowerCut,
}

/// All kinds with their names in the file.
pub const KINDS: [(&str, PlannedKind); 13] = [
    ("adc_overrun", PlannedKind::AdcOverrun),
    ("adc_dma_error", PlannedKind::AdcDmaError),
    ("force_stuck", PlannedKind::ForceStuck),
    ("acceleration_stuck", PlannedKind::AccelerationStuck),
    ("force_railed", PlannedKind::ForceRailed),
    ("acceleration_railed", PlannedKind::AccelerationRailed),
    ("supply", PlannedKind::Supply),
    ("uart_stall", PlannedKind::UartStall),
    ("panic", PlannedKind::Panic),
    ("hard_fault", PlannedKind::HardFault),
    ("hang", PlannedKind::Hang),
    ("stack_overflow", PlannedKind::StackOverflow),
    ("power_cut", PlannedKind::PowerCut),
];

/// Supply voltages at which the part works, V (DocID022152, general operating conditions).
const VOLTS: RangeInclusive<f64> = 1.8..=3.6;
/// Threshold of the bead's detector of a low supply, V (`firmware/app/src/health.rs`).
const LOW_VOLTS: f64 = 2.93;
/// Time within which the bead finds a sensor that is stuck or railed, s (`firmware/app/src/health.rs`).
const FOUND: f64 = 0.065;
/// Longest stall of the port that the bead always rides out, s.
const RIDDEN_OUT: f64 = 0.5;
/// Shortest stall of the port after which the bead always resets itself, s.
const GIVEN_UP: f64 = 1.5;

/// Time-out of the watchdog, s.
const WATCHDOG: f64 = 2.0;

impl PlannedKind {
    /// Name in the file.
    pub fn name(self) -> &'static str {
        let found = KINDS.iter().find(|(_, kind)| *kind == self);
        found.map_or("", |(name, _)| name)
    }

    fn lasts(self) -> bool {
        self.sensor().is_some() || matches!(self, Self::Supply | Self::UartStall)
    }

    /// For the fault of a sensor: the columns of the stimulus that it changes, one for each gain, and the
    /// cause under which a bead reports it if it lasts long enough.
    fn sensor(self) -> Option<(Range<usize>, FaultCause)> {
        match self {
            Self::ForceStuck => Some((0..2, FaultCause::ForceStuck)),
            Self::ForceRailed => Some((0..2, FaultCause::ForceRailed)),
            Self::AccelerationStuck => Some((2..4, FaultCause::AccelerationStuck)),
            Self::AccelerationRailed => Some((2..4, FaultCause::AccelerationRailed)),
            _ => None,
        }
    }
}

/// A fault, when, and for how long.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Planned {
    /// Kind of the fault.
    pub kind: PlannedKind,
    /// Start, s after the first scan.
    pub at: f64,
    /// Duration, s, if the fault has one; `None` for the rest of the run.
    pub duration: Option<f64>,
    /// The supply, V.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volts: Option<f64>,
}

impl Planned {
    /// End of the fault, s after the first scan; infinite for one without a duration.
    pub fn end(&self) -> f64 {
        self.at + self.duration.unwrap_or(f64::INFINITY)
    }

    /// Cause that the bead must report; `None` if it must not notice the fault.
    pub fn cause(&self) -> Option<FaultCause> {
        match self.kind {
            PlannedKind::AdcOverrun => Some(FaultCause::AdcOverrun),
            PlannedKind::AdcDmaError => Some(FaultCause::DmaError),
            PlannedKind::Supply => (self.volts? < LOW_VOLTS).then_some(FaultCause::SupplyLow),
            PlannedKind::UartStall => (self.duration? >= GIVEN_UP).then_some(FaultCause::Panic),
            PlannedKind::Panic => Some(FaultCause::Panic),
            PlannedKind::HardFault => Some(FaultCause::HardFault),
            PlannedKind::Hang => Some(FaultCause::Watchdog),
            PlannedKind::StackOverflow => Some(FaultCause::StackOverflow),
            // A power-on reset is no fault; the bead's identity shows it.
            PlannedKind::PowerCut => None,
            _ => {
                let is_found = self.duration.is_none_or(|duration| duration >= FOUND);
                self.sensor_cause().filter(|_| is_found)
            }
        }
    }

    /// Cause under which a bead reports the fault of a sensor that lasts long enough.
    pub fn sensor_cause(&self) -> Option<FaultCause> {
        self.kind.sensor().map(|(_, cause)| cause)
    }

    /// Longest time to the bead's report, s, including a restart if the fault ends in a reset.
    pub fn reported_within(&self) -> f64 {
        const FRAME: f64 = 0.05;
        const START: f64 = 0.5;
        match self.kind {
            PlannedKind::AdcOverrun => FRAME,
            PlannedKind::Supply => FOUND + FRAME,
            PlannedKind::Hang => WATCHDOG + START,
            PlannedKind::UartStall => self.duration.unwrap_or(0.0) + START,
            kind if kind.sensor().is_some() => FOUND + FRAME,
            _ => START,
        }
    }

    /// True if the fault hides from the force sensor a strike that begins at `time`, s after the first
    /// scan.
    pub fn hides(&self, time: f64) -> bool {
        /// Time from the start of a strike to the end of its rise, s.
        const PULSE: f64 = 0.01;
        let blind = matches!(self.kind, PlannedKind::ForceStuck | PlannedKind::ForceRailed);
        blind && (self.at - PULSE..self.end()).contains(&time)
    }

    /// The fault of the emulated machine; `None` for a fault of a sensor or of the supply.
    fn injected(&self) -> Option<FaultKind> {
        Some(match self.kind {
            PlannedKind::AdcOverrun => FaultKind::AdcOverrun,
            PlannedKind::AdcDmaError => FaultKind::AdcDmaError,
            PlannedKind::Panic => FaultKind::UnhandledInterrupt,
            PlannedKind::HardFault => FaultKind::WildJump,
            PlannedKind::Hang => FaultKind::Hang,
            PlannedKind::StackOverflow => FaultKind::RunawayStack,
            PlannedKind::PowerCut => FaultKind::PowerCut,
            PlannedKind::UartStall => FaultKind::TransmitterStalled {
                for_ns: self.duration.map_or(u64::MAX, ns),
            },
            _ => return None,
        })
    }

    fn change(&self, columns: Range<usize>, stimulus: &mut [[u16; 4]]) {
        let affected = stimulus.iter_mut().skip(rows(self.at));
        let railed = [PlannedKind::ForceRailed, PlannedKind::AccelerationRailed];
        let mut codes = railed.contains(&self.kind).then_some([CODES - 1; 4]);
        for row in affected.take(self.duration.map_or(usize::MAX, rows)) {
            let codes = codes.get_or_insert(*row);
            row[columns.clone()].copy_from_slice(&codes[columns.clone()]);
        }
    }
}

/// Injects faults into a run whose codes come from this front end. Of overlapping faults of one sensor, the
/// last one counts.
pub fn provoke(faults: &[Planned], front_end: &AnalogFrontEnd, run: &mut Run) {
    let supply = supply(faults);
    let ends = supply.iter().skip(1).map(|(at, _)| *at).chain([f64::INFINITY]);
    for (&(at, volts), end) in supply.iter().zip(ends) {
        let since = rows(at);
        for row in run.stimulus.iter_mut().take(rows(end)).skip(since) {
            *row = front_end.at_supply(*row, volts);
        }
    }
    for fault in faults {
        if let Some((columns, _)) = fault.kind.sensor() {
            fault.change(columns, &mut run.stimulus);
        }
        let inject = |kind| Fault::after_first_scan(ns(fault.at), kind);
        run.faults.extend(fault.injected().map(inject));
    }
    run.faults.extend(supply.into_iter().map(|(at, volts)| {
        let millivolts = (volts * 1e3).round() as u32;
        Fault::after_first_scan(ns(at), FaultKind::Supply { millivolts })
    }));
}

/// The supply under these faults: times of its changes, s after the first scan, and the voltage from then,
/// V. Of overlapping faults, the last to begin counts until its end, then one that still lasts; without a
/// fault the supply is good.
pub fn supply(faults: &[Planned]) -> Vec<(f64, f64)> {
    let mut faults = Vec::from_iter(faults.iter().filter(|fault| fault.kind == PlannedKind::Supply));
    faults.sort_by(|a, b| a.at.total_cmp(&b.at));
    let mut times: Vec<_> = faults.iter().flat_map(|fault| [fault.at, fault.end()]).collect();
    times.retain(|time| time.is_finite());
    times.sort_by(f64::total_cmp);
    times.dedup();
    let at = |time: f64| {
        let lasts = faults
            .iter()
            .rfind(|fault| (fault.at..fault.end()).contains(&time));
        (
            time,
            lasts.and_then(|fault| fault.volts).unwrap_or(REFERENCE_VOLTS),
        )
    };
    times.into_iter().map(at).collect()
}

/// Scans in this time; an infinite time returns `usize::MAX`.
fn rows(seconds: f64) -> usize {
    (seconds * f64::from(SAMPLE_RATE_HZ)).round() as usize
}

fn ns(seconds: f64) -> u64 {
    (seconds * 1e9) as u64
}

/// Reads a file of faults.
///
/// # Errors
/// One line with file, line, key, what is wrong and what would do.
pub fn load(path: &Path) -> Result<Vec<Planned>, InputError> {
    let text = read_text(path, "a file of faults in TOML")?;
    parse(&text, &path.display().to_string())
}

/// Reads the text of a file of faults; `name` is what messages call it.
///
/// # Errors
/// As [`load`].
pub fn parse(text: &str, name: &str) -> Result<Vec<Planned>, InputError> {
    let file = TomlFile::parse(text, name)?;
    let mut planned = Vec::new();
    for (number, table) in (1..).zip(entries(&file)?) {
        planned.push(table.planned(number).map_err(|error| file.locate(error))?);
    }
    Ok(planned)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FaultFile {
    #[serde(default)]
    fault: Vec<FaultTable>,
}

/// A table `[[fault]]` as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FaultTable {
    at: Option<f64>,
    kind: Option<String>,
    duration: Option<f64>,
    volts: Option<f64>,
}

fn entries(file: &TomlFile<'_>) -> Result<Vec<FaultTable>, InputError> {
    let faults: FaultFile = file.read().map_err(|error| {
        let (what, advice) = match error.key.as_str() {
            "fault" => ("not an array of tables", "write [[fault]]"),
            key if key.starts_with("fault[") => return error,
            _ => (error.what.as_str(), "faults are tables [[fault]]"),
        };
        let (what, advice) = (what.to_owned(), advice.to_owned());
        InputError {
            what,
            advice,
            ..error
        }
    })?;
    if faults.fault.is_empty() {
        let advice = "add a table [[fault]] with at and kind";
        return Err(file.locate(InputError::at("", "no fault", advice)));
    }
    Ok(faults.fault)
}

impl FaultTable {
    /// Checks the table, number `number` of its file, counted from 1.
    fn planned(self, number: usize) -> Result<Planned, InputError> {
        let error = |key: &str, what: &str, advice: &str| {
            InputError::at(format!("fault[{number}].{key}"), what, advice)
        };
        let ensure = |holds: bool, key: &str, what: &str, advice: &str| {
            holds.then_some(()).ok_or_else(|| error(key, what, advice))
        };
        let (duration, volts) = (self.duration, self.volts);

        let kinds = format!("give one of: {}", KINDS.map(|(name, _)| name).join(", "));
        let name = self.kind.ok_or_else(|| error("kind", "missing", &kinds))?;
        let found = KINDS.iter().find(|(known, _)| *known == name);
        let &(_, kind) = found.ok_or_else(|| error("kind", "unknown kind", &kinds))?;
        let keys = match (kind, kind.lasts()) {
            (PlannedKind::Supply, _) => "at, kind, volts, duration",
            (_, true) => "at, kind, duration",
            _ => "at, kind",
        };
        for (key, value) in [("duration", duration), ("volts", volts)] {
            let (what, advice) = (format!("{name} has no such key"), format!("it has {keys}"));
            ensure(value.is_none() || keys.contains(key), key, &what, &advice)?;
        }

        let advice = "give seconds after the first scan, such as 0.012";
        let at = self.at.ok_or_else(|| error("at", "missing", advice))?;
        ensure((0.0..1e6).contains(&at), "at", "not a time", advice)?;
        if kind == PlannedKind::UartStall {
            let duration =
                duration.ok_or_else(|| error("duration", "missing", "give seconds, such as 0.2"))?;
            let foretold = duration > 0.0 && duration <= RIDDEN_OUT || (GIVEN_UP..1e6).contains(&duration);
            let what = "not a time with a certain outcome";
            let advice = "give up to 0.5 s, which the bead rides out, or at least 1.5 s, which it does not";
            ensure(foretold, "duration", what, advice)?;
        }
        let lasts = duration.is_none_or(|s| s > 0.0 && s < 1e6);
        ensure(
            lasts,
            "duration",
            "not a time above zero",
            "give seconds, such as 0.25",
        )?;
        let advice = "give 1.8 to 3.6, such as 2.7";
        let given = volts.is_some() || kind != PlannedKind::Supply;
        ensure(given, "volts", "missing", advice)?;
        let works = volts.is_none_or(|v| VOLTS.contains(&v));
        ensure(works, "volts", "not a voltage that the part works at", advice)?;
        Ok(Planned {
            kind,
            at,
            duration,
            volts,
        })
    }
}

/// Refuses faults that come too late for a run of this length, s.
///
/// # Errors
/// The message names the fault, and what would do.
pub fn check(faults: &[Planned], seconds: f64) -> Result<(), BenchError> {
    for fault in faults {
        let (name, at, within) = (fault.kind.name(), fault.at, fault.reported_within());
        let why = if at >= seconds {
            format!(
                "{name} at {at} s comes after the end of the run at {seconds} s; make it earlier, or strike more often"
            )
        } else if fault.cause().is_some() && at + within > seconds {
            format!(
                "the run ends at {seconds} s, before the bead can report {name} at {at} s, which takes up to \
                 {within} s; give more --strikes or a longer time between them"
            )
        } else {
            continue;
        };
        return Err(BenchError::Unfit(format!("--faults: {why}")));
    }
    Ok(())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Faults, written as `kind at key=value; ...`.
    pub(crate) fn planned(faults: &str) -> Vec<Planned> {
        let table = |fault: &str| {
            let mut words = fault.split_whitespace();
            let (kind, at) = (words.next().unwrap(), words.next().unwrap());
            let more: Vec<_> = words.map(|word| word.replace('=', " = ")).collect();
            format!("[[fault]]\nkind = \"{kind}\"\nat = {at}\n{}\n", more.join("\n"))
        };
        parse(&faults.split(';').map(table).collect::<String>(), "f.toml").unwrap()
    }

    fn refused(text: &str) -> String {
        parse(text, "f.toml").unwrap_err().to_string()
    }

    #[test]
    fn every_kind_is_read_by_its_name() {
        for (name, kind) in KINDS {
            let more = match kind {
                PlannedKind::Supply => "volts = 2.5",
                PlannedKind::UartStall => "duration = 0.5",
                _ => "",
            };
            let text = format!("[[fault]]\nat = 1\nkind = \"{name}\"\n{more}\n");
            let planned = parse(&text, "f.toml").unwrap();
            assert_eq!((planned[0].kind, planned[0].at), (kind, 1.0), "{name}");
            assert_eq!(serde_json::to_value(kind).unwrap(), name);
            let page = include_str!("../../../../docs/how-to.md");
            assert!(
                page.contains(&format!("`{name}`")),
                "{name} is not in docs/how-to.md"
            );
        }
    }

    #[test]
    fn what_is_wrong_is_said_with_file_line_key_and_what_would_do() {
        const TABLES: &str = "\
kind = 'panic' | 1: fault[1].at: missing; give seconds
at = 1.0 | 1: fault[1].kind: missing; give one of: adc_overrun,
at = 1.0, kind = 'panik' | 3: fault[1].kind: unknown kind; give one of: adc_overrun, adc_dma_error, force_stuck
at = -1.0, kind = 'panic' | 2: fault[1].at: not a time; give seconds
at = nan, kind = 'panic' | 2: fault[1].at: not a time; give seconds
at = 1.0, kind = 'panic', [[fault]], kind = 'hang', duration = 1.0 | 6: fault[2].duration: hang has no such key; it has at, kind
at = 1.0, kind = 'force_stuck', duration = 0 | 4: fault[1].duration: not a time above zero; give seconds
at = 1.0, kind = 'uart_stall', duration = 1.0 | 4: fault[1].duration: not a time with a certain outcome; give up to 0.5 s
at = 1.0, kind = 'uart_stall' | 1: fault[1].duration: missing; give seconds
at = 1.0, kind = 'supply' | 1: fault[1].volts: missing; give 1.8 to 3.6
at = 1.0, kind = 'supply', volts = 5.0 | 4: fault[1].volts: not a voltage that the part works at; give 1.8 to 3.6";
        let table = |line: &'static str| {
            let (table, said) = line.split_once(" | ").unwrap();
            (format!("[[fault]]\n{}\n", table.replace(", ", "\n")), said)
        };
        let files = [
            ("", "1: no fault; add"),
            ("fault = 3", "1: fault: not an array of tables; write [[fault]]"),
            ("x = 1\n", "1: x: unknown key; faults are"),
            ("[[fault]\n", "1: not TOML ("),
        ];
        let files = files.map(|(file, said)| (file.to_owned(), said));
        for (text, expected) in TABLES.lines().map(table).chain(files) {
            let (said, expected) = (refused(&text), format!("f.toml:{expected}"));
            assert!(said.starts_with(&expected), "{text:?}: {said}");
        }
    }

    #[test]
    fn a_sensor_is_stuck_or_railed_in_its_own_columns_for_its_own_time() {
        let mut run = Run::new("none");
        let rows = (0..100).map(|row| [row, 1000 + row, 2000 + row, 3000 + row]);
        run.stimulus = rows.collect();
        let before = run.stimulus.clone();
        let faults = planned("force_stuck 0.0001 duration=0.0002; acceleration_railed 0.0005");
        provoke(&faults, &AnalogFrontEnd::default(), &mut run);
        for (row, (before, after)) in before.iter().zip(&run.stimulus).enumerate() {
            let mut expected = *before;
            if (10..30).contains(&row) {
                expected[..2].copy_from_slice(&[10, 1010]);
            }
            if row >= 50 {
                expected[2..].fill(4095);
            }
            assert_eq!(*after, expected, "row {row}");
        }
    }

    #[test]
    fn codes_follow_the_supply_while_it_is_off_and_a_sensor_that_is_stuck_then_stays_so() {
        let mut run = Run::new("none");
        run.stimulus = vec![[1128, 228, 3048, 2148]; 100];
        let faults = planned("supply 0.0001 volts=3.0 duration=0.0003; acceleration_stuck 0.0002");
        provoke(&faults, &AnalogFrontEnd::default(), &mut run);
        for (row, codes) in run.stimulus.iter().enumerate() {
            let force = if (10..40).contains(&row) {
                [1228, 238]
            } else {
                [1128, 228]
            };
            let acceleration = if row >= 10 { [3148, 2158] } else { [3048, 2148] };
            assert_eq!(*codes, [force, acceleration].concat()[..], "row {row}");
        }
    }

    #[test]
    fn a_supply_that_dips_comes_back_and_a_short_dip_does_not_end_a_longer_one() {
        let supply = |faults: &str| {
            let mut run = Run::new("none");
            provoke(&planned(faults), &AnalogFrontEnd::default(), &mut run);
            let levels = run.faults.iter().map(|fault| match fault.kind {
                FaultKind::Supply { millivolts } => (fault.at_ns / 1_000_000, millivolts),
                kind => panic!("{kind:?}"),
            });
            levels.collect::<Vec<_>>()
        };
        let long = "supply 0.05 volts=2.5 duration=0.3";
        assert_eq!(supply(long), [(50, 2500), (350, 3300)]);
        let short = "supply 0.1 volts=2.6 duration=0.125";
        let expected = [(50, 2500), (100, 2600), (225, 2500), (350, 3300)];
        assert_eq!(supply(&format!("{long};{short}")), expected);
        assert_eq!(supply(&format!("{short};{long}")), expected);
        // A fault that lasts to the end of the run is back after a shorter one.
        let expected = [(50, 2800), (100, 2600), (225, 2800)];
        assert_eq!(supply(&format!("supply 0.05 volts=2.8;{short}")), expected);
        // The first fault ends before the second.
        let expected = [(50, 2500), (100, 2600), (150, 2600), (225, 3300)];
        let over = "supply 0.05 volts=2.5 duration=0.1";
        assert_eq!(supply(&format!("{over};{short}")), expected);
    }
}
