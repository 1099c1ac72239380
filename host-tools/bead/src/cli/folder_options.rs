//! Options of commands that search folders for recordings.

use std::path::PathBuf;

use bead_logbook::date;
use bead_logbook::filter::{Filter, NotePattern};
use bead_logbook::index::Logbook;
use bead_wire::StrikeFlags;
use clap::Args;

use bead_console::beads::BeadNumbers;
use bead_console::failure::Failure;
use bead_console::output;

/// Folders, and which of their recordings are wanted.
#[derive(Debug, Args)]
pub(crate) struct FolderOptions {
    /// Folders with recordings.
    #[arg(value_name = "FOLDER", default_value = ".")]
    folders: Vec<PathBuf>,
    /// Only recordings with this note: KEY, or KEY=TEXT, where * matches any text; repeat for more.
    #[arg(long, value_name = "KEY=TEXT")]
    note: Vec<NotePattern>,
    /// Only recordings of this day and later ones, UTC: 2026-11-28, or a time such as 2026-11-28T09:30.
    #[arg(long, value_name = "DATE", value_parser = since)]
    since: Option<i64>,
    /// Only recordings up to and including this day, UTC, or before this time.
    #[arg(long, value_name = "DATE", value_parser = before)]
    until: Option<i64>,
    /// Only recordings of beads with these addresses: 7, 7-16 or 7,9,12.
    #[arg(long, value_name = "N")]
    bead: Option<BeadNumbers>,
    /// Only recordings with a strike that has this flag, such as wave_train; repeat for more.
    #[arg(long, value_name = "FLAG", value_parser = flag)]
    flag: Vec<String>,
    /// Only recordings whose last verdict, as noted by `bead judge --note`, is pass, fail or undecided;
    /// `none` selects recordings without a verdict.
    #[arg(long, value_name = "VERDICT", value_parser = ["pass", "fail", "undecided", "none"])]
    verdict: Option<String>,
    /// Read every recording, and neither read nor write the folder's table.
    #[arg(long)]
    no_index: bool,
}

fn since(text: &str) -> Result<i64, String> {
    date::parse(text)
        .ok_or_else(|| "give a date, such as 2026-11-28, or a time in UTC: 2026-11-28T09:30".to_owned())
}

fn before(text: &str) -> Result<i64, String> {
    let time = since(text)?;
    // A date alone has ten characters and stands for the whole day.
    let is_day = text.len() == 10;
    Ok(if is_day {
        time.saturating_add(date::DAY_NS)
    } else {
        time
    })
}

fn flag(text: &str) -> Result<String, String> {
    let known: Vec<&str> = StrikeFlags::LIST.iter().map(|row| row.1).collect();
    if known.contains(&text) {
        return Ok(text.to_owned());
    }
    Err(format!(
        "there is no such flag; the flags are {}",
        known.join(", ")
    ))
}

impl FolderOptions {
    /// The recordings that are wanted.
    pub(crate) fn filter(&self) -> Filter {
        let beads = match &self.bead {
            None | Some(BeadNumbers::All) => None,
            Some(BeadNumbers::One(bead)) => Some([*bead].into()),
            Some(BeadNumbers::Several(beads)) => Some(beads.iter().copied().collect()),
        };
        Filter {
            notes: self.note.clone(),
            since_ns: self.since,
            before_ns: self.until,
            beads,
            flags: self.flag.clone(),
            verdict: self.verdict.clone(),
        }
    }

    /// The folders with their recordings. Files that only have the name of a recording are named on
    /// standard error.
    pub(crate) fn open(&self) -> Result<Vec<Logbook>, Failure> {
        let mut logbooks = Vec::new();
        for folder in &self.folders {
            let bar = output::progress(0);
            bar.set_message("reading recordings");
            let progress = |done: usize, of: usize| {
                bar.set_length(of as u64);
                bar.set_position(done as u64);
            };
            let logbook = Logbook::open(folder, !self.no_index, progress);
            bar.finish_and_clear();
            let logbook = logbook.map_err(Failure::input)?;
            for remark in &logbook.remarks {
                note!("{remark}");
            }
            for (_, why) in logbook.problems() {
                note!("{why}");
            }
            logbooks.push(logbook);
        }
        Ok(logbooks)
    }
}
