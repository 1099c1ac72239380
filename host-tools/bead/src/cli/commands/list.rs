//! `bead list`: the recordings of folders, by note, date, bead, flag and verdict.

use std::collections::BTreeMap;

use crate::cli::commands::prelude::*;
use crate::cli::folder_options::FolderOptions;
use bead_compare::report::count;
use bead_logbook::date::{self, DateSource};
use bead_logbook::recording::LoggedRecording;
use bead_tables::printable::beginning;

const AFTER_HELP: &str = "\
Recordings are files whose names end with .mcap, finished or not. A file with such a name that is not a recording of \
beads is reported in one line. The date of a recording is that of its note `date`, else the time at which its first frame was \
received, else that of its file.

The first search reads each recording, and writes a table to FOLDER/bead-logbook.parquet, one row for each strike. \
Later searches read only files whose length or time has changed. The table may be deleted at any time.

Examples:
  bead list
  bead list monday tuesday --note specimen=A12 --note operator=An*
  bead list archive --since 2026-11-01 --until 2026-11-28 --bead 7-9
  bead list archive --verdict fail --format json
  bead list archive --flag estimates_differ";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    #[command(flatten)]
    folder: FolderOptions,
    /// Format of the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// The result as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct ListReport {
    /// The recordings that were wanted, by date.
    recordings: Vec<ListedRecording>,
    /// Number of recordings in the folders.
    of: usize,
    /// Number of files that were read, since no table had them as they are.
    files_read: usize,
    /// Files that have the name of a recording, and are none.
    foreign: Vec<ForeignFile>,
}

#[derive(Serialize, JsonSchema)]
struct ListedRecording {
    /// The file.
    recording: PathBuf,
    /// Its date, UTC, RFC 3339.
    date: String,
    /// Where the date is from.
    date_from: DateSource,
    /// The ports or the program that its bytes came from.
    source: String,
    /// Addresses of its beads.
    beads: Vec<u8>,
    /// Number of its strikes.
    strikes: usize,
    /// The verdict that was noted last.
    verdict: Option<String>,
    /// Flags that one of its strikes has.
    flags: Vec<String>,
    /// Its missing parts.
    incomplete: Option<String>,
    /// Its notes that count.
    notes: BTreeMap<String, String>,
}

#[derive(Serialize, JsonSchema)]
struct ForeignFile {
    file: PathBuf,
    /// Kind of the file, and advice.
    problem: String,
}

/// Characters of the notes of a row of the table.
const NOTES_SHOWN: usize = 100;

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let filter = arguments.folder.filter();
    let logbooks = arguments.folder.open()?;
    let all = logbooks.iter().flat_map(|logbook| {
        let all = logbook.recordings.iter().filter(|one| one.problem.is_none());
        all.map(move |one| (&logbook.folder, one))
    });
    let mut wanted: Vec<_> = all.clone().filter(|(_, one)| filter.takes(one)).collect();
    wanted.sort_by_key(|(_, one)| one.date.unix_ns);
    let wanted = wanted
        .into_iter()
        .map(|(folder, one)| ListedRecording::of(folder, one));
    let foreign = logbooks.iter().flat_map(|logbook| {
        logbook.problems().map(move |(file, problem)| ForeignFile {
            file: logbook.folder.join(file),
            problem: problem.to_owned(),
        })
    });
    let report = ListReport {
        recordings: wanted.collect(),
        of: all.count(),
        files_read: logbooks.iter().map(|logbook| logbook.files_read).sum(),
        foreign: foreign.collect(),
    };
    output::print(arguments.format, &report, || report.table())
}

impl ListedRecording {
    fn of(folder: &Path, one: &LoggedRecording) -> Self {
        Self {
            recording: folder.join(&one.file),
            date: date::text(one.date.unix_ns),
            date_from: one.date.source,
            source: one.source.clone(),
            beads: one.beads.iter().copied().collect(),
            strikes: one.strikes.len(),
            verdict: one.verdict().map(str::to_owned),
            flags: one.flags().into_iter().map(str::to_owned).collect(),
            incomplete: one.incomplete.clone(),
            notes: one.notes.clone(),
        }
    }

    fn row(&self) -> [String; 6] {
        let beads: Vec<String> = self.beads.iter().map(u8::to_string).collect();
        // Notes that have their own column, or only say how the verdict came about.
        let own = ["verdict", "date", "limits"];
        let notes = self.notes.iter().filter(|(key, _)| !own.contains(&key.as_str()));
        let notes: Vec<String> = notes.map(|(key, text)| format!("{key}={text}")).collect();
        let notes = beginning(&notes.join("  "), NOTES_SHOWN).into_owned();
        let incomplete = if self.incomplete.is_some() {
            " (incomplete)"
        } else {
            ""
        };
        [
            format!("{}{incomplete}", self.recording.display()),
            self.date.get(..16).unwrap_or(&self.date).replace('T', " "),
            beads.join(" "),
            self.strikes.to_string(),
            self.verdict.clone().unwrap_or_default(),
            notes,
        ]
    }
}

impl ListReport {
    fn table(&self) -> String {
        let found = format!(
            "{} of {}",
            self.recordings.len(),
            count(self.of as u64, "recording")
        );
        if self.recordings.is_empty() {
            return found;
        }
        let rows = self.recordings.iter().map(ListedRecording::row);
        let table = output::table("recording | date, UTC | beads | strikes | verdict | notes", rows);
        format!("{table}\n\n{found}")
    }
}
