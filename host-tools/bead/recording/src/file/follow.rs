//! Reads a recording while another program writes it.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use crate::file::contents::Contents;
use crate::file::error::RecordingError;
use crate::file::layout::RECORD_MOST;
use crate::frames::Piece;

/// Greatest number of records that are read at a time.
const AT_A_TIME: usize = 4096;

/// A recording that may still grow. The file keeps its identity when its recorder renames it at the end.
pub struct Follower {
    path: PathBuf,
    file: File,
    reader: LinearReader,
    contents: Contents,
    is_ended: bool,
}

impl Follower {
    /// Opens a recording, finished or not: `NAME.mcap.partial` while it is being written.
    ///
    /// # Errors
    /// The file cannot be opened.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let file = File::open(path).map_err(RecordingError::refused("read", path))?;
        let options = LinearReaderOptions::default()
            .with_record_length_limit(RECORD_MOST)
            .with_prevalidate_chunk_crcs(true);
        Ok(Self {
            path: path.to_owned(),
            file,
            reader: LinearReader::new_with_options(options),
            contents: Contents::default(),
            is_ended: false,
        })
    }

    /// True if the end of the recording was read: its recorder has finished the file.
    pub fn is_ended(&self) -> bool {
        self.is_ended
    }

    /// The next pieces of bytes with their receive times; empty if nothing new is in the file.
    ///
    /// # Errors
    /// The file cannot be read, is damaged or is not a recording: it cannot be followed further.
    pub fn pieces(&mut self) -> Result<Vec<Piece>, RecordingError> {
        for _ in 0..AT_A_TIME {
            let failed = |why: String| {
                let shown = self.path.display();
                RecordingError::Unfit(format!(
                    "{shown} cannot be followed further ({why}); give a recording (.mcap.partial while it is being \
                     written), or recover its undamaged part: bead recover {shown}"
                ))
            };
            match self.reader.next_event() {
                None => {
                    self.is_ended = true;
                    self.contents.end();
                    break;
                }
                Some(Err(why)) => return Err(failed(why.to_string())),
                Some(Ok(LinearReadEvent::ReadRequest(wanted))) => {
                    let read = self.file.read(self.reader.insert(wanted));
                    let read = read.map_err(RecordingError::refused("read", &self.path))?;
                    if read == 0 {
                        // Reporting this to the reader would end it, and more may come.
                        break;
                    }
                    self.reader.notify_read(read);
                }
                Some(Ok(LinearReadEvent::Record { opcode, data })) => {
                    if self.contents.push(opcode, data).is_none() {
                        return Err(failed("a record is damaged".to_owned()));
                    }
                }
            }
        }
        Ok(self.contents.ready.drain(..).collect())
    }
}

#[cfg(test)]
mod tests {
    use bead_tables::whole::Target;
    use bead_testing::Speaker;

    use super::*;
    use crate::file::{About, Note, Recording, RecordingWriter};

    #[test]
    fn a_recording_is_followed_from_its_first_byte_to_its_end_and_over_its_renaming() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.mcap");
        let mut writer = RecordingWriter::create(&Target::new(&path), &About::default()).unwrap();
        let mut follower = Follower::open(writer.partial_path()).unwrap();
        let mut bead = Speaker::at(3);
        let mut followed = Vec::new();
        for round in 0..5 {
            for n in 0..300 {
                let identity = bead.identity();
                bead.say(1000 * (300 * round + n), identity);
            }
            let bytes = std::mem::take(&mut bead.bytes);
            writer.write(&bytes, Some(1_000 + round), |_| {}).unwrap();
            writer.flush().unwrap();
            let new = follower.pieces().unwrap();
            // An empty run between two delimiters is not recorded.
            let read: Vec<u8> = new.iter().flat_map(|piece| piece.bytes.to_vec()).collect();
            let frames = |bytes: &[u8]| crate::frames::decode(bytes).0.len();
            assert_eq!(frames(&read), frames(&bytes), "round {round}");
            assert_eq!(frames(&read), 300);
            followed.extend(new);
            assert!(!follower.is_ended());
        }
        writer.note(&Note::parse("operator=Ana").unwrap()).unwrap();
        writer.finish().unwrap();
        assert_eq!(follower.pieces().unwrap(), []);
        assert!(follower.is_ended());
        let recording = Recording::open(&path).unwrap();
        assert_eq!(recording.pieces().unwrap().collect::<Vec<_>>(), followed);
        assert_eq!(recording.about.remarks.len(), 1);
    }

    #[test]
    fn what_is_no_recording_or_damaged_is_refused_in_one_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.mcap");
        std::fs::write(&path, "no recording at all").unwrap();
        let refused = Follower::open(&path).unwrap().pieces().unwrap_err().to_string();
        assert!(refused.contains("cannot be followed further"), "{refused}");
        assert_eq!(refused.lines().count(), 1);
    }
}
