//! The recordings of a folder, from its table where that is as new as they are.
//!
//! # Design
//! The table [`TABLE`] is in the folder. A recording whose length and time of change are those in the table
//! is taken from there, and every other is read again; then the table is written anew. The table may
//! therefore be deleted, damaged or outdated at any time: nothing is lost, and no outdated row is used. A
//! file that was changed within `UNSETTLED` before it was read counts as changed next time, since a second
//! change could have the same time.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use bead_tables::printable::first_of;
use rayon::iter::{IntoParallelIterator, ParallelIterator};

use crate::recording::{FileStamp, LoggedRecording};
use crate::table;

/// Name of the table in its folder.
pub const TABLE: &str = "bead-logbook.parquet";
/// Coarsest resolution of a file system's times, that of FAT.
const UNSETTLED: Duration = Duration::from_secs(2);
/// Ends of the names of recordings, finished or not.
const ENDINGS: [&str; 2] = [".mcap", ".mcap.partial"];
/// Ends of the names of files that stand beside recordings.
const COMPANIONS: [&str; 12] = [
    "settings", "toml", "parquet", "csv", "html", "svg", "json", "xml", "key", "md", "uff", "png",
];
/// Greatest number of files of other kinds that a remark names.
const NAMED_MOST: usize = 5;

/// A folder cannot be read.
#[derive(Debug, thiserror::Error)]
#[error("cannot read the folder {folder}: {source}; give a folder with recordings")]
pub struct LogbookError {
    folder: PathBuf,
    source: io::Error,
}

/// The recordings of a folder.
#[derive(Debug)]
pub struct Logbook {
    /// The folder.
    pub folder: PathBuf,
    /// Its recordings by date, and files that only have the name of one.
    pub recordings: Vec<LoggedRecording>,
    /// Number of files that were read, since the table did not have them.
    pub files_read: usize,
    /// Lines about files that were passed over, and about the table.
    pub remarks: Vec<String>,
}

/// A file of the folder.
#[derive(Clone, Debug)]
struct FoundFile {
    name: String,
    path: PathBuf,
    size: u64,
    modified_ns: i64,
}

impl Logbook {
    /// Opens a folder, and brings its table up to date if `with_table`. `progress` gets the number of files
    /// that were read so far, and of those that are to be read.
    ///
    /// # Errors
    /// The folder cannot be read. A file that cannot be read, and a table that cannot be used or written,
    /// only add a remark.
    pub fn open(
        folder: &Path,
        with_table: bool,
        progress: impl Fn(usize, usize) + Sync,
    ) -> Result<Self, LogbookError> {
        let mut remarks = Vec::new();
        let files = found(folder, &mut remarks).map_err(|source| LogbookError {
            folder: folder.to_owned(),
            source,
        })?;
        let path = folder.join(TABLE);
        let mut known = BTreeMap::new();
        let mut may_write = with_table;
        if with_table && path.exists() {
            match table::read(&path) {
                Ok(recordings) => {
                    known.extend(recordings.into_iter().map(|one| (one.file.clone(), one)));
                }
                Err(_) if !table::is_ours(&path) && !is_damaged(&path) => {
                    may_write = false;
                    remarks.push(format!(
                        "{} is not a table of recordings and stays as it is, so every recording is read; give that file \
                         another name",
                        path.display()
                    ));
                }
                Err(why) => remarks.push(format!("{} {why}; it is made anew", path.display())),
            }
        }
        let gone = known.len();
        let (mut recordings, stale) = sorted_out(files, &mut known);
        let is_changed = !stale.is_empty() || gone != recordings.len();
        let (files_read, done) = (stale.len(), AtomicUsize::new(0));
        let read = stale.into_par_iter().map(|file| {
            let settled = SystemTime::now().duration_since(UNIX_EPOCH).ok().and_then(|now| {
                let age = i64::try_from(now.as_nanos())
                    .ok()?
                    .checked_sub(file.modified_ns)?;
                (u128::try_from(age).ok()? >= UNSETTLED.as_nanos()).then_some(file.modified_ns)
            });
            let stamp = FileStamp {
                size: file.size,
                modified_ns: settled,
            };
            let recording = LoggedRecording::read(&file.path, &file.name, stamp, file.modified_ns);
            progress(done.fetch_add(1, Ordering::Relaxed) + 1, files_read);
            recording
        });
        recordings.extend(read.collect::<Vec<_>>());
        recordings
            .sort_by(|one, other| (one.date.unix_ns, &one.file).cmp(&(other.date.unix_ns, &other.file)));
        if may_write
            && is_changed
            && let Err(why) = table::write(&path, &recordings)
        {
            remarks.push(format!("{why}; the next search reads these recordings again"));
        }
        Ok(Self {
            folder: folder.to_owned(),
            recordings,
            files_read,
            remarks,
        })
    }

    /// The files that have the name of a recording without being one, each with the reason.
    pub fn problems(&self) -> impl Iterator<Item = (&str, &str)> {
        let problem = |one: &'_ LoggedRecording| one.problem.is_some();
        let foreign = self.recordings.iter().filter(move |one| problem(one));
        foreign.filter_map(|one| Some((one.file.as_str(), one.problem.as_deref()?)))
    }
}

/// True if a file is empty, or begins as a Parquet file without ending as one: the remains of a table.
fn is_damaged(path: &Path) -> bool {
    let head = fs::read(path).unwrap_or_default();
    head.is_empty() || (head.starts_with(b"PAR1") && !head.ends_with(b"PAR1"))
}

/// The recordings that are unchanged since the table, and the files that are to be read.
fn sorted_out(
    files: Vec<FoundFile>,
    known: &mut BTreeMap<String, LoggedRecording>,
) -> (Vec<LoggedRecording>, Vec<FoundFile>) {
    let (mut same, mut stale) = (Vec::new(), Vec::new());
    for file in files {
        let stamp = FileStamp {
            size: file.size,
            modified_ns: Some(file.modified_ns),
        };
        match known.remove(&file.name).filter(|known| known.stamp == stamp) {
            Some(known) => same.push(known),
            None => stale.push(file),
        }
    }
    (same, stale)
}

/// The files of a folder that have the name of a recording. A remark names files of kinds that no command
/// of this program writes.
fn found(folder: &Path, remarks: &mut Vec<String>) -> io::Result<Vec<FoundFile>> {
    let (mut files, mut others) = (Vec::new(), BTreeSet::new());
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let (name, path) = (entry.file_name().to_string_lossy().into_owned(), entry.path());
        if name.starts_with('.') {
            continue;
        }
        let metadata = match fs::metadata(&path) {
            Ok(metadata) => metadata,
            Err(error) => {
                remarks.push(format!(
                    "{} cannot be read: {error}; it is skipped",
                    path.display()
                ));
                continue;
            }
        };
        let lower = name.to_lowercase();
        if !metadata.is_file() || !ENDINGS.iter().any(|end| lower.ends_with(end)) {
            let ending = Path::new(&lower).extension().and_then(|end| end.to_str());
            let is_companion = ending.is_some_and(|ending| COMPANIONS.contains(&ending));
            if !(metadata.is_dir() || is_companion) {
                others.insert(name);
            }
            continue;
        }
        let modified = metadata.modified().ok().and_then(|time| {
            let since = time.duration_since(UNIX_EPOCH).ok()?;
            i64::try_from(since.as_nanos()).ok()
        });
        files.push(FoundFile {
            name,
            path,
            size: metadata.len(),
            modified_ns: modified.unwrap_or(0),
        });
    }
    if !others.is_empty() {
        remarks.push(format!(
            "{}: skipped, as only files with names that end with .mcap are recordings: {}",
            folder.display(),
            first_of(others, NAMED_MOST)
        ));
    }
    files.sort_by(|one, other| one.name.cmp(&other.name));
    Ok(files)
}
