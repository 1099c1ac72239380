//! Options of commands that write people's notes.

use std::env;

use clap::Args;

use crate::cli::provenance::now;
use bead_logbook::date;
use bead_recording::file::Note;

/// `--note` and `--by` of a command that makes a recording.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct NoteOptions {
    /// A note in the recording, such as operator=Ana specimen=A12; repeat for more.
    #[arg(long, value_name = "KEY=VALUE", num_args = 1.., value_parser = note)]
    note: Vec<Note>,
    #[command(flatten)]
    author: Author,
}

/// Parses a note. `date` has a meaning for `bead list`, so its text must be a date.
pub(crate) fn note(text: &str) -> Result<Note, String> {
    let note = Note::parse(text)?;
    if note.key == "date" && !note.value.is_empty() && date::parse(&note.value).is_none() {
        return Err(format!(
            "{:?} is not a date; give UTC as 2026-11-28, 2026-11-28T09:30 or 2026-11-28T10:30+01:00",
            note.value
        ));
    }
    Ok(note)
}

/// `--by`.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct Author {
    /// Author of the notes [default: the user of this computer].
    #[arg(long, value_name = "NAME")]
    by: Option<String>,
}

impl NoteOptions {
    /// The author of these notes, and of those that follow.
    pub(crate) fn author(&self) -> &Author {
        &self.author
    }

    /// The notes as written now.
    pub(crate) fn signed(&self) -> Vec<Note> {
        self.author.sign(self.note.clone())
    }
}

impl Author {
    /// The notes as written by this author now.
    pub(crate) fn sign(&self, notes: Vec<Note>) -> Vec<Note> {
        let user = || {
            ["USER", "LOGNAME", "USERNAME"]
                .iter()
                .find_map(|name| env::var(name).ok())
        };
        let (author, now) = (self.by.clone().or_else(user), now());
        let sign = |note: Note| note.signed(author.as_deref(), now);
        notes.into_iter().map(sign).collect()
    }
}
