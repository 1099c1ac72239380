//! Adds notes to a recording that is complete.
//!
//! # Design
//! The mcap crate writes files and does not extend them. A new file therefore gets the unchanged data section
//! of the old one, then the notes, then a new end ([`Tail`]). It replaces the old file once it is on disk:
//! after a power cut one of the two is there, and whole.
//!
//! The old file is locked meanwhile, so that two programs that add notes do not lose each other's.

use std::fs::{self, File, TryLockError};
use std::io::{self, Read, Seek, Write};
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use bead_tables::whole::Target;

use crate::file::error::RecordingError;
use crate::file::notes::{NOTES_MOST, Note};
use crate::file::read::Recording;
use crate::file::records::State;
use crate::file::tail::Tail;

/// Longest time to wait for another program that adds notes.
const PATIENCE: Duration = Duration::from_secs(5);

/// Adds notes to a recording, after those that it has. Its other data stays as it is.
///
/// # Errors
/// The file cannot be read or written, is not a recording, is not whole or is being written, or would have
/// more than [`NOTES_MOST`] notes. The file is then unchanged.
pub fn add_notes(path: &Path, notes: &[Note]) -> Result<(), RecordingError> {
    // A link stays, and its target gets the notes.
    let place = fs::canonicalize(path).map_err(RecordingError::refused("read", path))?;
    let file = locked(&place)?;
    let recording = Recording::open(&place)?;
    let shown = path.display();
    if recording.state != State::Whole {
        return Err(RecordingError::Unfit(format!(
            "{shown} is cut short or damaged, so it cannot get a note; recover it, which keeps its notes, and add the note \
             to the new recording: bead recover {shown}"
        )));
    }
    let has = recording.about.remarks.len();
    if has + notes.len() > NOTES_MOST {
        return Err(RecordingError::Unfit(format!(
            "{shown} has {has} notes and can have at most {NOTES_MOST}; put the rest in a file and note the file's name"
        )));
    }
    let tail = Tail::read(&file).map_err(|why| {
        RecordingError::Unfit(format!(
            "{shown} does not end as a recorder leaves it ({why}); rebuild it: bead recover {shown}"
        ))
    })?;
    let written = Target::new(&place).replacing(true).write(|out| {
        let mut old = &file;
        old.rewind()?;
        io::copy(&mut old.take(tail.data_end), out)?;
        out.write_all(&tail.with(notes))?;
        out.set_permissions(file.metadata()?.permissions())?;
        Ok(())
    });
    written.map_err(|error| RecordingError::Unfit(error.to_string()))
}

/// Opens a file and locks it. If another program replaces the file meanwhile, opens the new one.
fn locked(path: &Path) -> Result<File, RecordingError> {
    let failed = RecordingError::refused("read", path);
    let begun = Instant::now();
    loop {
        let file = File::open(path).map_err(&failed)?;
        match file.try_lock() {
            Ok(()) if is_at(&file, path) => return Ok(file),
            // A file system without locks leaves the order to chance.
            Err(TryLockError::Error(_)) => return Ok(file),
            Ok(()) | Err(TryLockError::WouldBlock) => {}
        }
        if begun.elapsed() > PATIENCE {
            return Err(RecordingError::Unfit(format!(
                "{} is being written by another program; add the note when that program has ended",
                path.display()
            )));
        }
        thread::sleep(Duration::from_millis(20));
    }
}

/// True if the path still names this file, as far as the system can tell.
fn is_at(file: &File, path: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        let same =
            |one: fs::Metadata, other: fs::Metadata| (one.dev(), one.ino()) == (other.dev(), other.ino());
        file.metadata()
            .is_ok_and(|one| fs::metadata(path).is_ok_and(|other| same(one, other)))
    }
    #[cfg(not(unix))]
    {
        let _ = (file, path);
        true
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use bead_testing::Speaker;
    use chrono::{DateTime, Utc};
    use tempfile::TempDir;

    use super::*;
    use crate::file::{About, RecordingWriter};
    use crate::recover::recover;

    fn note(text: &str) -> Note {
        let written = DateTime::<Utc>::from_timestamp(1_790_000_000, 0).unwrap();
        Note::parse(text).unwrap().signed(Some("Ana"), written)
    }

    /// A recording of some frames with one note.
    fn recorded() -> (TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.mcap");
        let about = About {
            remarks: vec![note("specimen=A1")],
            ..About::default()
        };
        let mut writer = RecordingWriter::create(&Target::new(&path), &about).unwrap();
        let mut bead = Speaker::at(3);
        (0..300).for_each(|n| {
            let identity = bead.identity();
            bead.say(1000 * n, identity);
        });
        for (n, bytes) in (1_000_000..).zip(bead.bytes.chunks(97)) {
            writer.write(bytes, Some(n), |_| {}).unwrap();
        }
        writer.finish().unwrap();
        (folder, path)
    }

    fn remarks(path: &Path) -> Vec<Note> {
        Recording::open(path).unwrap().about.remarks.clone()
    }

    #[test]
    fn notes_stand_behind_the_data_and_every_reader_finds_them() {
        let (_folder, path) = recorded();
        let before = fs::read(&path).unwrap();
        let data = Tail::read(&File::open(&path).unwrap()).unwrap().data_end as usize;
        let pieces = |path: &Path| {
            Recording::open(path)
                .unwrap()
                .pieces()
                .unwrap()
                .collect::<Vec<_>>()
        };
        let sent = pieces(&path);
        add_notes(&path, &[note("operator=Ana"), note("specimen=A2")]).unwrap();
        add_notes(&path, &[note("place=rig 2")]).unwrap();
        let after = fs::read(&path).unwrap();
        assert_eq!(after[..data], before[..data]);
        assert_eq!(pieces(&path), sent);
        let expected = ["specimen=A1", "operator=Ana", "specimen=A2", "place=rig 2"].map(note);
        assert_eq!(remarks(&path), expected);
        // By the index, as other programs read it, whose CRC the reader has checked.
        assert_eq!(Recording::open(&path).unwrap().state, State::Whole);
        let summary = mcap::Summary::read(&after).unwrap().unwrap();
        assert_eq!(summary.stats.unwrap().metadata_count, 5);
        let by_index = summary
            .metadata_indexes
            .iter()
            .map(|index| mcap::read::metadata(&after, index).unwrap());
        let keys: Vec<_> = by_index
            .filter_map(|one| one.metadata.get("key").cloned())
            .collect();
        assert_eq!(keys, ["specimen", "operator", "specimen", "place"]);
        assert_eq!(
            summary.chunk_indexes,
            mcap::Summary::read(&before).unwrap().unwrap().chunk_indexes
        );
        let tail = Tail::read(&File::open(&path).unwrap()).unwrap();
        assert!(tail.has_offsets && tail.data_crc != 0);
        // Records of one kind stand together, as the offsets of their groups require.
        let groups = tail.index.chunk_by(|(one, _), (other, _)| one == other);
        let mut kinds: Vec<u8> = groups.map(|group| group[0].0).collect();
        let count = kinds.len();
        kinds.sort_unstable();
        kinds.dedup();
        assert_eq!(kinds.len(), count);
    }

    #[test]
    fn a_recording_that_is_cut_gives_its_notes_gets_none_and_keeps_them_when_it_is_recovered() {
        let (folder, path) = recorded();
        add_notes(&path, &[note("operator=Ana")]).unwrap();
        let whole = fs::read(&path).unwrap();
        let data = Tail::read(&File::open(&path).unwrap()).unwrap().data_end as usize;
        let cut = folder.path().join("cut.mcap");
        for (length, found) in [(data - 1, 1), (data, 2), (data + 5, 2), (whole.len() - 1, 2)] {
            fs::write(&cut, &whole[..length]).unwrap();
            assert_eq!(remarks(&cut).len(), found, "{length} bytes");
            let refused = add_notes(&cut, &[note("x=1")]).unwrap_err().to_string();
            assert!(refused.contains("bead recover"), "{refused}");
            assert_eq!(fs::read(&cut).unwrap(), whole[..length]);
        }
        let new = folder.path().join("new.mcap");
        recover(&Recording::open(&cut).unwrap(), &Target::new(&new)).unwrap();
        assert_eq!(remarks(&new), ["specimen=A1", "operator=Ana"].map(note));
    }

    #[test]
    fn programs_that_note_at_once_lose_no_note_and_there_is_a_most() {
        let (_folder, path) = recorded();
        let old = File::open(&path).unwrap();
        thread::scope(|scope| {
            for n in 0..6 {
                let path = &path;
                scope.spawn(move || add_notes(path, &[note(&format!("n{n}=x"))]).unwrap());
            }
        });
        let mut keys: Vec<_> = remarks(&path).into_iter().map(|note| note.key).collect();
        keys.sort();
        assert_eq!(keys, ["n0", "n1", "n2", "n3", "n4", "n5", "specimen"]);
        // A lock on a file that was replaced meanwhile does not lock the recording.
        assert!(!is_at(&old, &path) && is_at(&File::open(&path).unwrap(), &path));
        let many = vec![note("x=1"); NOTES_MOST - 7];
        add_notes(&path, &many).unwrap();
        let refused = add_notes(&path, &[note("x=1")]).unwrap_err().to_string();
        assert!(refused.contains("at most 1000"), "{refused}");
    }
}
