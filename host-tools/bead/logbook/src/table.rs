//! The table of a folder: a row for each strike, and one for each recording without a strike.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use bead_tables::whole::Target;
use bead_tables::{Cell, CellKind, Column, Reader, Writer};

use crate::date::{DateSource, RecordingDate};
use crate::recording::{FileStamp, LoggedRecording, LoggedStrike, NUMBERS};

/// Key of the table's own note of its version, and the version.
const VERSION_KEY: &str = "bead_logbook";
const VERSION: &str = "1";

/// Columns of the recording, in each of its rows.
const OF_RECORDING: [(&str, CellKind); 10] = [
    ("recording", CellKind::Text),
    ("size_bytes", CellKind::Whole),
    ("modified_unix_ns", CellKind::Whole),
    ("problem", CellKind::Text),
    ("incomplete", CellKind::Text),
    ("date_unix_ns", CellKind::Whole),
    ("date_from", CellKind::Text),
    ("source", CellKind::Text),
    ("notes", CellKind::Text),
    ("beads", CellKind::Text),
];
/// Columns of the strike before its numbers, and behind them.
const OF_STRIKE: [(&str, CellKind); 5] = [
    ("address", CellKind::Whole),
    ("bead_name", CellKind::Text),
    ("strike", CellKind::Whole),
    ("time_unix_ns", CellKind::Whole),
    ("flags", CellKind::Text),
];
const OF_CLOCK: [&str; 2] = ["clock_ppm", "u_clock_ppm"];

fn columns() -> Vec<Column> {
    let named = OF_RECORDING.iter().chain(&OF_STRIKE);
    let named = named.map(|(name, kind)| Column::new(*name, *kind));
    let numbers = NUMBERS.iter().chain(&OF_CLOCK);
    named
        .chain(numbers.map(|name| Column::new(*name, CellKind::Number)))
        .collect()
}

/// Reads a table as [`write`] leaves it.
///
/// # Errors
/// The file cannot be read, or is another table: why, as the end of a sentence that begins with its name.
pub(crate) fn read(path: &Path) -> Result<Vec<LoggedRecording>, String> {
    let reader = Reader::open(path).map_err(|error| error.to_string())?;
    if reader.note(VERSION_KEY) != Some(VERSION) || reader.columns() != columns() {
        return Err("was made by another version".to_owned());
    }
    let mut recordings: Vec<LoggedRecording> = Vec::new();
    for batch in reader.all_batches() {
        let batch = batch.map_err(|error| error.to_string())?;
        for row in batch.into_rows() {
            let cells = Row(row.into_iter());
            let damaged = || "has a damaged row".to_owned();
            let (mut of_recording, rest) = cells.recording().ok_or_else(damaged)?;
            let is_next = recordings
                .last()
                .is_none_or(|last| last.file != of_recording.file);
            let strike = rest.strike();
            if is_next {
                of_recording.strikes.extend(strike);
                recordings.push(of_recording);
            } else if let Some(last) = recordings.last_mut() {
                last.strikes.extend(strike);
            }
        }
    }
    Ok(recordings)
}

/// True if a file is a table of this kind, of any version.
pub(crate) fn is_ours(path: &Path) -> bool {
    Reader::open(path).is_ok_and(|reader| reader.note(VERSION_KEY).is_some())
}

/// Writes the table, whole or not at all, in place of one of its name.
///
/// # Errors
/// The file cannot be written.
pub(crate) fn write(path: &Path, recordings: &[LoggedRecording]) -> Result<(), String> {
    let written = Target::new(path).replacing(true).write(|file| {
        let notes = [
            (VERSION_KEY, VERSION),
            ("made_by", concat!("bead ", env!("CARGO_PKG_VERSION"))),
        ];
        let mut writer = Writer::parquet(file, "logbook", &columns(), &notes)?;
        for recording in recordings {
            let shared = recording_cells(recording);
            let strikes = recording.strikes.iter().map(Some);
            let none = recording.strikes.is_empty().then_some(None);
            for strike in strikes.chain(none) {
                let mut row = shared.clone();
                row.extend(strike_cells(strike));
                writer.push(row)?;
            }
        }
        writer.finish()
    });
    written.map_err(|error| error.to_string())
}

fn recording_cells(recording: &LoggedRecording) -> Vec<Cell> {
    let text = |text: &str| Cell::Text(text.into());
    let known = |text: &Option<String>| Cell::text(text.as_deref());
    let beads: Vec<String> = recording.beads.iter().map(u8::to_string).collect();
    vec![
        text(&recording.file),
        Cell::whole(recording.stamp.size),
        recording.stamp.modified_ns.map_or(Cell::Null, Cell::Whole),
        known(&recording.problem),
        known(&recording.incomplete),
        Cell::Whole(recording.date.unix_ns),
        text(recording.date.source.name()),
        text(&recording.source),
        // A map of texts is always JSON.
        text(&serde_json::to_string(&recording.notes).unwrap_or_default()),
        text(&beads.join(" ")),
    ]
}

fn strike_cells(strike: Option<&LoggedStrike>) -> Vec<Cell> {
    let Some(strike) = strike else {
        return vec![Cell::Null; OF_STRIKE.len() + NUMBERS.len() + OF_CLOCK.len()];
    };
    let mut cells = vec![
        Cell::whole(strike.address),
        Cell::text(strike.bead_name.as_deref()),
        Cell::whole(strike.strike),
        Cell::Whole(strike.time_ns),
        Cell::Text(strike.flags.as_str().into()),
    ];
    cells.extend(strike.numbers.map(Cell::number));
    let clock = strike.clock_ppm;
    cells.extend([clock.map(|clock| clock.0), clock.map(|clock| clock.1)].map(Cell::number));
    cells
}

/// The cells of a row that are still to be read.
struct Row(std::vec::IntoIter<Cell>);

impl Row {
    fn text(&mut self) -> Option<Arc<str>> {
        match self.0.next() {
            Some(Cell::Text(text)) => Some(text),
            _ => None,
        }
    }

    fn known(&mut self) -> Option<String> {
        self.text().map(|text| text.to_string())
    }

    fn whole(&mut self) -> Option<i64> {
        match self.0.next() {
            Some(Cell::Whole(number)) => Some(number),
            _ => None,
        }
    }

    /// The facts of the recording without strikes, and the rest of the row.
    fn recording(mut self) -> Option<(LoggedRecording, Self)> {
        let file = self.known()?;
        let stamp = FileStamp {
            size: u64::try_from(self.whole()?).ok()?,
            modified_ns: self.whole(),
        };
        let (problem, incomplete) = (self.known(), self.known());
        let (unix_ns, source) = (self.whole()?, self.text()?);
        let source: DateSource = serde_json::from_value((&*source).into()).ok()?;
        let (from, notes, beads) = (self.known()?, self.text()?, self.text()?);
        let notes: BTreeMap<String, String> = serde_json::from_str(&notes).ok()?;
        let beads = beads.split_whitespace().map(str::parse);
        let recording = LoggedRecording {
            file,
            stamp,
            problem,
            incomplete,
            date: RecordingDate { unix_ns, source },
            source: from,
            notes,
            beads: beads.collect::<Result<_, _>>().ok()?,
            strikes: Vec::new(),
        };
        Some((recording, self))
    }

    /// The strike in the rest of the row, if it has one.
    fn strike(mut self) -> Option<LoggedStrike> {
        let address = u8::try_from(self.whole()?).ok()?;
        let bead_name = self.known();
        let strike = u32::try_from(self.whole()?).ok()?;
        let (time_ns, flags) = (self.whole()?, self.known()?);
        let mut number = || self.0.next().as_ref().and_then(Cell::as_f64);
        let numbers = NUMBERS.map(|_| number());
        let (ppm, u) = (number(), number());
        Some(LoggedStrike {
            address,
            bead_name,
            strike,
            time_ns,
            flags,
            numbers,
            clock_ppm: ppm.zip(u),
        })
    }
}
