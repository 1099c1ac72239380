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

use std::ops::Range;
use std::path::Path;

use bead_wire::FaultCause;
use serde::Serialize;
use stm32f405_qemu::{Fault, FaultKind, Run};
use toml::de::{DeTable, DeValue};

use crate::bench::front_end::{CODES, SAMPLE_RATE_HZ};
use crate::cli::failure::Failure;

/// What is provoked.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// The converter loses a conversion.
    AdcOverrun,
    /// The DMA stream of the converter meets a bus error.
    AdcDmaError,
    /// The force code stays what it is.
    ForceStuck,
    /// The acceleration code stays what it is.
    AccelerationStuck,
    /// The force code lies at its upper rail.
    ForceRailed,
    /// The acceleration code lies at its upper rail.
    AccelerationRailed,
    /// The supply has the voltage of `volts`.
    Supply,
    /// No byte leaves the bead's port.
    UartStall,
    /// An interrupt that has no handler: the image's own code panics.
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

const KINDS: [(&str, Kind); 13] = [
    ("adc_overrun", Kind::AdcOverrun),
    ("adc_dma_error", Kind::AdcDmaError),
    ("force_stuck", Kind::ForceStuck),
    ("acceleration_stuck", Kind::AccelerationStuck),
    ("force_railed", Kind::ForceRailed),
    ("acceleration_railed", Kind::AccelerationRailed),
    ("supply", Kind::Supply),
    ("uart_stall", Kind::UartStall),
    ("panic", Kind::Panic),
    ("hard_fault", Kind::HardFault),
    ("hang", Kind::Hang),
    ("stack_overflow", Kind::StackOverflow),
    ("power_cut", Kind::PowerCut),
];

/// Voltages between which a supply may be put: those between which the part works (DocID022152, general operating
/// conditions).
const VOLTS: std::ops::RangeInclusive<f64> = 1.8..=3.6;
/// A good supply, mV.
const GOOD_MV: u32 = 3300;
/// Below this the bead's detector finds the supply low, V (`firmware/src/health.rs`).
const LOW_VOLTS: f64 = 2.93;
/// A sensor that is stuck or railed for so long is always found, s: two windows of the bead.
const FOUND: f64 = 0.2;
/// A port that sends nothing for so long, s, is always ridden out.
const RIDDEN_OUT: f64 = 0.5;
/// A port that sends nothing for so long, s, always ends in a reset by the bead itself.
const GIVEN_UP: f64 = 1.5;

impl Kind {
    /// Its name in the file.
    pub fn name(self) -> &'static str {
        let found = KINDS.iter().find(|(_, kind)| *kind == self);
        found.map_or("", |(name, _)| name)
    }

    /// Whether it lasts.
    fn lasts(self) -> bool {
        self.columns().is_some() || matches!(self, Self::Supply | Self::UartStall)
    }

    /// The columns of the stimulus that it changes, if it is a sensor's: both of its gains.
    fn columns(self) -> Option<Range<usize>> {
        match self {
            Self::ForceStuck | Self::ForceRailed => Some(0..2),
            Self::AccelerationStuck | Self::AccelerationRailed => Some(2..4),
            _ => None,
        }
    }
}

/// A fault, when, and for how long.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Planned {
    /// What.
    pub kind: Kind,
    /// When, s after the first scan.
    pub at: f64,
    /// How long, s, if it lasts; none for the rest of the run.
    pub duration: Option<f64>,
    /// The supply, V.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volts: Option<f64>,
}

impl Planned {
    /// What the bead is to report, if it is to notice at all.
    pub fn cause(&self) -> Option<FaultCause> {
        match self.kind {
            Kind::AdcOverrun => Some(FaultCause::AdcOverrun),
            Kind::AdcDmaError => Some(FaultCause::DmaError),
            Kind::ForceStuck => self.found().then_some(FaultCause::ForceStuck),
            Kind::AccelerationStuck => self.found().then_some(FaultCause::AccelerationStuck),
            Kind::ForceRailed => self.found().then_some(FaultCause::ForceRailed),
            Kind::AccelerationRailed => self.found().then_some(FaultCause::AccelerationRailed),
            Kind::Supply => (self.volts? < LOW_VOLTS).then_some(FaultCause::SupplyLow),
            Kind::UartStall => (self.duration? >= GIVEN_UP).then_some(FaultCause::Panic),
            Kind::Panic => Some(FaultCause::Panic),
            Kind::HardFault => Some(FaultCause::HardFault),
            Kind::Hang => Some(FaultCause::Watchdog),
            Kind::StackOverflow => Some(FaultCause::StackOverflow),
            // Its identity says so: a power-on reset is no fault.
            Kind::PowerCut => None,
        }
    }

    /// Whether it ends in a reset.
    pub fn resets(&self) -> bool {
        let reported = matches!(
            self.cause(),
            Some(
                FaultCause::DmaError
                    | FaultCause::Panic
                    | FaultCause::HardFault
                    | FaultCause::Watchdog
                    | FaultCause::StackOverflow
            )
        );
        reported || self.kind == Kind::PowerCut
    }

    fn found(&self) -> bool {
        self.duration.is_none_or(|duration| duration >= FOUND)
    }

    /// Makes it happen in a run.
    pub fn provoke(&self, run: &mut Run) {
        let ns = |seconds: f64| (seconds * 1e9) as u64;
        let mut fail = |at: f64, kind: FaultKind| run.faults.push(Fault { at_ns: ns(at), kind });
        match self.kind {
            Kind::AdcOverrun => fail(self.at, FaultKind::AdcOverrun),
            Kind::AdcDmaError => fail(self.at, FaultKind::AdcDmaError),
            Kind::Panic => fail(self.at, FaultKind::UnhandledInterrupt),
            Kind::HardFault => fail(self.at, FaultKind::WildJump),
            Kind::Hang => fail(self.at, FaultKind::Hang),
            Kind::StackOverflow => fail(self.at, FaultKind::RunawayStack),
            Kind::PowerCut => fail(self.at, FaultKind::PowerCut),
            Kind::UartStall => {
                let for_ns = self.duration.map_or(u64::MAX, ns);
                fail(self.at, FaultKind::TransmitterStalled { for_ns });
            }
            Kind::Supply => {
                let millivolts = self.volts.map_or(GOOD_MV, |volts| (volts * 1e3).round() as u32);
                fail(self.at, FaultKind::Supply { millivolts });
                if let Some(duration) = self.duration {
                    fail(self.at + duration, FaultKind::Supply { millivolts: GOOD_MV });
                }
            }
            Kind::ForceStuck | Kind::AccelerationStuck | Kind::ForceRailed | Kind::AccelerationRailed => {
                let rows = |seconds: f64| (seconds * f64::from(SAMPLE_RATE_HZ)).round() as usize;
                let from = rows(self.at);
                let many = self.duration.map_or(usize::MAX, rows);
                let Some(columns) = self.kind.columns() else {
                    return;
                };
                let Some(&stuck) = run.stimulus.get(from) else {
                    return;
                };
                let codes = match self.kind {
                    Kind::ForceRailed | Kind::AccelerationRailed => [CODES - 1; 4],
                    _ => stuck,
                };
                for row in run.stimulus.iter_mut().skip(from).take(many) {
                    row[columns.clone()].copy_from_slice(&codes[columns.clone()]);
                }
            }
        }
    }
}

/// Reads a file of faults.
///
/// # Errors
/// One line with file, line, key, what is wrong and what would do.
pub fn load(path: &Path) -> Result<Vec<Planned>, Failure> {
    let file = path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(|error| {
        Failure::input(format!(
            "{file}: cannot be read ({error}); name a file of faults in TOML"
        ))
    })?;
    parse(&text, &file)
}

/// Reads the text of a file of faults; `file` is what messages call it.
///
/// # Errors
/// As [`load`].
pub fn parse(text: &str, file: &str) -> Result<Vec<Planned>, Failure> {
    let fail = |at: usize, what: String| {
        let line = text[..at.min(text.len())].matches('\n').count() + 1;
        Failure::input(format!("{file}:{line}: {what}"))
    };
    let table = DeTable::parse(text).map_err(|error| {
        let at = error.span().map_or(0, |span| span.start);
        let message = error.message().split_whitespace().collect::<Vec<_>>().join(" ");
        fail(at, format!("not TOML ({message}); mend the line"))
    })?;
    let table = table.into_inner();
    if let Some((key, _)) = table.iter().find(|(key, _)| key.get_ref() != "fault") {
        let what = format!("{}: unknown key; faults are tables [[fault]]", key.get_ref());
        return Err(fail(key.span().start, what));
    }
    let Some(entries) = table.get("fault") else {
        return Err(fail(
            0,
            "no fault; add a table [[fault]] with at and kind".to_owned(),
        ));
    };
    let DeValue::Array(entries) = entries.get_ref() else {
        let what = "fault: not an array of tables; write [[fault]]".to_owned();
        return Err(fail(entries.span().start, what));
    };
    let mut planned = Vec::new();
    for (number, entry) in (1..).zip(entries.iter()) {
        let DeValue::Table(entry_table) = entry.get_ref() else {
            let what = format!("fault[{number}]: not a table; write [[fault]]");
            return Err(fail(entry.span().start, what));
        };
        let fault = one(entry_table, number, entry.span().start);
        planned.push(fault.map_err(|(at, what)| fail(at, what))?);
    }
    Ok(planned)
}

/// One table; an error is where it is and what.
fn one(table: &DeTable<'_>, number: usize, start: usize) -> Result<Planned, (usize, String)> {
    let known: Vec<&str> = KINDS.iter().map(|(name, _)| *name).collect();
    let key = |name: &str| format!("fault[{number}].{name}");
    let missing = |name: &str, advice: &str| Err((start, format!("{}: missing; {advice}", key(name))));
    let Some(kind_value) = table.get("kind") else {
        return missing("kind", &format!("give one of: {}", known.join(", ")));
    };
    let kind_at = kind_value.span().start;
    let named = match kind_value.get_ref() {
        DeValue::String(name) => KINDS.iter().find(|(known, _)| *known == name.as_ref()),
        _ => None,
    };
    let Some(&(kind_name, kind)) = named else {
        let what = format!("{}: unknown kind; give one of: {}", key("kind"), known.join(", "));
        return Err((kind_at, what));
    };
    for (name, _) in table.iter() {
        let fits = match name.get_ref().as_ref() {
            "at" | "kind" => true,
            "duration" => kind.lasts(),
            "volts" => kind == Kind::Supply,
            _ => false,
        };
        if !fits {
            let keys = match (kind, kind.lasts()) {
                (Kind::Supply, _) => "at, kind, volts, duration",
                (_, true) => "at, kind, duration",
                _ => "at, kind",
            };
            let what = format!(
                "{}: {kind_name} has no such key; it has {keys}",
                key(name.get_ref())
            );
            return Err((name.span().start, what));
        }
    }
    let number_of = |name: &str, advice: &str, fits: &dyn Fn(f64) -> bool| match table.get(name) {
        None => Ok(None),
        Some(value) => {
            let found = match value.get_ref() {
                DeValue::Float(float) => float.as_str().replace('_', "").parse::<f64>().ok(),
                DeValue::Integer(integer) => i64::from_str_radix(integer.as_str(), integer.radix())
                    .ok()
                    .map(|whole| whole as f64),
                _ => None,
            };
            match found.filter(|found| found.is_finite() && fits(*found)) {
                Some(found) => Ok(Some(found)),
                None => Err((value.span().start, format!("{}: {advice}", key(name)))),
            }
        }
    };
    let at_advice = "not a time; give s after the first scan, such as 0.012";
    let Some(at) = number_of("at", at_advice, &|at| (0.0..1e6).contains(&at))? else {
        return missing("at", "give s after the first scan, such as 0.012");
    };
    let duration = if kind == Kind::UartStall {
        let advice = "not a time that can be foretold; give up to 0.5 s, which the bead rides out, or at least 1.5 s, which it does not";
        let fits = |s: f64| s > 0.0 && (s <= RIDDEN_OUT || (GIVEN_UP..1e6).contains(&s));
        let found = number_of("duration", advice, &fits)?;
        if found.is_none() {
            return missing("duration", "give s, such as 0.2");
        }
        found
    } else {
        let advice = "not a time above zero; give s, such as 0.25";
        number_of("duration", advice, &|s| s > 0.0 && s < 1e6)?
    };
    let volts = number_of(
        "volts",
        "not a voltage that the part works at; give 1.8 to 3.6",
        &|v| VOLTS.contains(&v),
    )?;
    if kind == Kind::Supply && volts.is_none() {
        return missing("volts", "give 1.8 to 3.6, such as 2.7");
    }
    Ok(Planned {
        kind,
        at,
        duration,
        volts,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(text: &str) -> String {
        let failure = parse(text, "f.toml").unwrap_err();
        assert_eq!(failure.exit_status(), 2);
        failure.to_string()
    }

    #[test]
    fn every_kind_is_read_by_its_name() {
        for (name, kind) in KINDS {
            let more = match kind {
                Kind::Supply => "volts = 2.5",
                Kind::UartStall => "duration = 0.5",
                _ => "",
            };
            let text = format!("[[fault]]\nat = 1\nkind = \"{name}\"\n{more}\n");
            let planned = parse(&text, "f.toml").unwrap();
            assert_eq!((planned[0].kind, planned[0].at), (kind, 1.0), "{name}");
            assert_eq!(serde_json::to_value(kind).unwrap(), name);
        }
    }

    #[test]
    fn what_is_wrong_is_said_with_file_line_key_and_what_would_do() {
        let cases = [
            ("", "f.toml:1: no fault; add"),
            (
                "fault = 3",
                "f.toml:1: fault: not an array of tables; write [[fault]]",
            ),
            ("x = 1\n", "f.toml:1: x: unknown key; faults are"),
            ("[[fault]\n", "f.toml:1: not TOML ("),
            (
                "\n[[fault]]\nat = 1.0\n",
                "f.toml:2: fault[1].kind: missing; give one of: adc_overrun, ",
            ),
            (
                "[[fault]]\nkind = \"panic\"\n",
                "f.toml:1: fault[1].at: missing; give s",
            ),
            (
                "[[fault]]\nat = 1.0\nkind = \"panik\"\n",
                "f.toml:3: fault[1].kind: unknown kind; give one of: adc_overrun, adc_dma_error, force_stuck",
            ),
            (
                "[[fault]]\nat = -1.0\nkind = \"panic\"\n",
                "f.toml:2: fault[1].at: not a time; give s",
            ),
            (
                "[[fault]]\nat = nan\nkind = \"panic\"\n",
                "f.toml:2: fault[1].at: not a time; give s",
            ),
            (
                "[[fault]]\nat = 1.0\nkind = \"panic\"\n[[fault]]\nat = 1.0\nkind = \"hang\"\nduration = 1.0\n",
                "f.toml:7: fault[2].duration: hang has no such key; it has at, kind",
            ),
            (
                "[[fault]]\nat = 1.0\nkind = \"force_stuck\"\nduration = 0\n",
                "f.toml:4: fault[1].duration: not a time above zero; give s",
            ),
            (
                "[[fault]]\nat = 1.0\nkind = \"uart_stall\"\nduration = 1.0\n",
                "f.toml:4: fault[1].duration: not a time that can be foretold; give up to 0.5 s",
            ),
            (
                "[[fault]]\nat = 1.0\nkind = \"uart_stall\"\n",
                "f.toml:1: fault[1].duration: missing; give s",
            ),
            (
                "[[fault]]\nat = 1.0\nkind = \"supply\"\n",
                "f.toml:1: fault[1].volts: missing; give 1.8 to 3.6",
            ),
            (
                "[[fault]]\nat = 1.0\nkind = \"supply\"\nvolts = 5.0\n",
                "f.toml:4: fault[1].volts: not a voltage that the part works at; give 1.8 to 3.6",
            ),
        ];
        for (text, expected) in cases {
            let said = refused(text);
            assert!(said.starts_with(expected), "{text:?}: {said}");
        }
    }

    #[test]
    fn a_sensor_is_stuck_or_railed_in_its_own_columns_for_its_own_time() {
        let mut run = Run::new("none");
        run.stimulus = (0..100)
            .map(|row| [row, 1000 + row, 2000 + row, 3000 + row])
            .collect();
        let before = run.stimulus.clone();
        let text = "[[fault]]\nat = 0.0001\nkind = \"force_stuck\"\nduration = 0.0002\n\
                    [[fault]]\nat = 0.0005\nkind = \"acceleration_railed\"\n";
        for fault in parse(text, "f.toml").unwrap() {
            fault.provoke(&mut run);
        }
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
    fn a_supply_that_dips_comes_back() {
        let mut run = Run::new("none");
        let text = "[[fault]]\nat = 0.1\nkind = \"supply\"\nvolts = 2.7\nduration = 0.05\n";
        parse(text, "f.toml").unwrap()[0].provoke(&mut run);
        let expected = [(100_000_000, 2700), (150_000_000, 3300)];
        let expected = expected.map(|(at_ns, millivolts)| Fault {
            at_ns,
            kind: FaultKind::Supply { millivolts },
        });
        assert_eq!(run.faults, expected);
    }
}
