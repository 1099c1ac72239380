//! `bead note`: notes of people in recordings.

use crate::cli::commands::prelude::*;
use crate::cli::note_options::{Author, note};
use crate::cli::recordings::{check_notable, open_all};
use bead_recording::file::add_notes;

const AFTER_HELP: &str = "\
A note has a key, a text, its author and its time. The last note of a key counts; those before it stay in the file \
as its history, and an empty note (specimen=) withdraws the key. An argument with = is a note, unless there is a \
file of that name. You choose the keys; `bead list` takes `date` as the day of the recording.

Nothing that was recorded changes: a copy of the file with the notes at its end replaces the old file as soon as it \
is on disk. A recording that is cut has to be made whole first, by `bead recover`, which keeps its notes. \
`bead record --note` and `bead emulate --note` add notes when they record.

Examples:
  bead note run/bead-8.mcap
  bead note run/bead-8.mcap operator=Ana specimen=A12
  bead note monday/*.mcap place=\"rig 2\" --by \"Ana Lima\"
  bead note run/bead-8.mcap specimen=";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// Recordings, and the notes that each of them gets: KEY=VALUE. Without a note, the existing notes are
    /// printed.
    #[arg(value_name = "F.mcap|KEY=VALUE", required = true)]
    arguments: Vec<PathBuf>,
    #[command(flatten)]
    author: Author,
    /// Format of the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// The result as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct NotesReport {
    /// The recordings, in the order in which they were named.
    recordings: Vec<NotedRecording>,
}

#[derive(Serialize, JsonSchema)]
struct NotedRecording {
    /// The file.
    recording: PathBuf,
    /// Its notes, in the order in which they were written.
    notes: Vec<WrittenNote>,
}

#[derive(Serialize, JsonSchema)]
struct WrittenNote {
    key: String,
    value: String,
    /// The person who wrote it.
    author: Option<String>,
    /// The time of UTC at which it was written, RFC 3339.
    written: Option<String>,
    /// False for a note that a later one of its key replaces or withdraws.
    counts: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let (mut paths, mut notes) = (Vec::new(), Vec::new());
    for argument in &arguments.arguments {
        match argument.to_str() {
            Some(text) if text.contains('=') && !argument.exists() => {
                notes.push(note(text).map_err(Failure::input)?);
            }
            _ => paths.push(argument.clone()),
        }
    }
    if paths.is_empty() {
        bail!(
            Input,
            "no recording is named; give one before its notes: bead note F.mcap operator=Ana"
        );
    }
    let mut recordings = open_all(&paths)?;
    if !notes.is_empty() {
        check_notable(&recordings)?;
        let notes = arguments.author.sign(notes);
        for path in &paths {
            add_notes(path, &notes)?;
        }
        recordings = open_all(&paths)?;
    }
    let report = NotesReport {
        recordings: recordings.iter().map(NotedRecording::of).collect(),
    };
    output::print(arguments.format, &report, || report.table())
}

impl NotedRecording {
    fn of(recording: &Recording) -> Self {
        let last = recording.about.last_remarks();
        let notes = recording.about.remarks.iter().map(|note| WrittenNote {
            key: note.key.clone(),
            value: note.value.clone(),
            author: note.author.clone(),
            written: note.written_text(),
            counts: last
                .get(note.key.as_str())
                .is_some_and(|last| std::ptr::eq(*last, note)),
        });
        Self {
            recording: recording.path.clone(),
            notes: notes.collect(),
        }
    }
}

impl NotesReport {
    fn table(&self) -> String {
        let several = self.recordings.len() > 1;
        let parts = self.recordings.iter().map(|recording| {
            let rows = recording.notes.iter().map(|note| {
                let [author, written] =
                    [&note.author, &note.written].map(|text| text.clone().unwrap_or_default());
                [
                    note.key.clone(),
                    note.value.clone(),
                    author,
                    written,
                    output::either(note.counts, "", "replaced"),
                ]
            });
            let table = match recording.notes[..] {
                [] => "no notes".to_owned(),
                _ => output::table("note | text | by | written |", rows),
            };
            if several {
                format!("{}\n{table}", recording.recording.display())
            } else {
                table
            }
        });
        parts.collect::<Vec<_>>().join("\n\n")
    }
}
