//! Writes recordings.

use std::fs::{self, File, TryLockError};
use std::io::{self, BufWriter};
use std::mem;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use bead_wire::Counters;
use mcap::records::Metadata;
use mcap::{Attachment, WriteOptions};

use crate::file::about::{About, Part, RecordingOrigin};
use crate::file::error::RecordingError;
use crate::file::layout::{CHUNK, FLUSH_EVERY, METADATA, Mcap, name_of};
use crate::file::notes::{NOTES_MOST, Note};
use crate::file::stream::Stream;
use crate::frames::Item;
use bead_tables::whole::{Target, Unfinished, with_stem_end};

/// A recording that is being written.
///
/// Dropped before [`finish`](Self::finish), it leaves a readable file under its temporary name.
pub struct RecordingWriter {
    target: Target,
    partial: PathBuf,
    mcap: Mcap,
    /// One for each bead, or one for all.
    pub(super) streams: Vec<Stream>,
    about: About,
    begun: Instant,
    flushed: Instant,
    flushes: u64,
}

/// Index of a bead in a recording that is being written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BeadIndex(usize);

impl RecordingWriter {
    /// Begins a recording of one line, which will have the name of `target`.
    ///
    /// # Errors
    /// The directory cannot be written to, or another program is recording under that name.
    pub fn create(target: &Target, about: &About) -> Result<Self, RecordingError> {
        let mut writer = Self::create_for_several(target, about)?;
        writer.begin_stream(None)?;
        Ok(writer)
    }

    /// Begins a recording of several beads, without any yet: see [`join`](Self::join).
    ///
    /// # Errors
    /// The directory cannot be written to, or another program is recording under that name.
    pub fn create_for_several(target: &Target, about: &About) -> Result<Self, RecordingError> {
        let (mcap, partial) = begin_file(target, about, None)?;
        Ok(Self {
            target: target.clone(),
            partial,
            mcap,
            streams: Vec::new(),
            about: about.clone(),
            begun: Instant::now(),
            flushed: Instant::now(),
            flushes: 0,
        })
    }

    /// Adds a bead to a recording of several.
    ///
    /// # Errors
    /// A bead with this address is in it already, or the file cannot be written.
    pub fn join(&mut self, origin: &RecordingOrigin) -> Result<BeadIndex, RecordingError> {
        let taken = |stream: &Stream| stream.bead() == Some(origin.address);
        if self.streams.iter().any(taken) {
            return Err(RecordingError::SameAddress(origin.address));
        }
        self.begin_stream(Some(origin))
    }

    fn begin_stream(&mut self, origin: Option<&RecordingOrigin>) -> Result<BeadIndex, RecordingError> {
        let begun = Stream::begin(&mut self.mcap, origin, self.about.sample_rate_hz);
        let stream = begun.and_then(|stream| self.mcap.flush().map(|()| stream));
        let stream = stream.map_err(RecordingError::unwritten(&self.partial))?;
        self.streams.push(stream);
        Ok(BeadIndex(self.streams.len() - 1))
    }

    /// Attaches a part of the whole recording. Parts that are known beforehand should be attached first, so
    /// that they survive a crash.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn attach(&mut self, part: Part, data: &[u8]) -> Result<(), RecordingError> {
        let log_time = self.streams.first().map_or(0, |stream| stream.clock.log);
        self.put_attachment(None, log_time, part, data)
    }

    /// Attaches a part of one bead among several.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn attach_to(&mut self, bead: BeadIndex, part: Part, data: &[u8]) -> Result<(), RecordingError> {
        let stream = &self.streams[bead.0];
        self.put_attachment(stream.bead(), stream.clock.log, part, data)
    }

    fn put_attachment(
        &mut self,
        bead: Option<u8>,
        log_time: u64,
        part: Part,
        data: &[u8],
    ) -> Result<(), RecordingError> {
        let attachment = Attachment {
            log_time,
            create_time: 0,
            name: name_of(bead, part.name()).into_owned(),
            media_type: part.media_type().into(),
            data: data.into(),
        };
        self.mcap
            .attach(&attachment)
            .map_err(RecordingError::unwritten(&self.partial))
    }

    /// Adds the note of a person, in this file and in those that follow it.
    ///
    /// # Errors
    /// The file cannot be written, or has [`NOTES_MOST`] notes.
    pub fn note(&mut self, note: &Note) -> Result<(), RecordingError> {
        if self.about.remarks.len() >= NOTES_MOST {
            return Err(RecordingError::Unfit(format!(
                "the recording has {NOTES_MOST} notes and cannot have more"
            )));
        }
        self.about.remarks.push(note.clone());
        let written = self.mcap.write_metadata(&note.to_record());
        written.map_err(RecordingError::unwritten(&self.partial))
    }

    /// Records bytes as received, the last of them at `received_ns`, the host's time in ns since 1970, if it
    /// is known. Hands the frames and the rejects in them to `sink`.
    ///
    /// # Errors
    /// The file cannot be written.
    ///
    /// # Panics
    /// The recording is one of several beads: see [`write_of`](Self::write_of).
    pub fn write(
        &mut self,
        bytes: &[u8],
        received_ns: Option<u64>,
        sink: impl FnMut(Item),
    ) -> Result<(), RecordingError> {
        assert!(
            self.streams.iter().all(|stream| stream.bead().is_none()),
            "bytes of no bead"
        );
        self.write_of(BeadIndex(0), bytes, received_ns, sink)
    }

    /// Records bytes of one bead among several.
    ///
    /// # Errors
    /// The file cannot be written.
    ///
    /// # Panics
    /// The index is that of another recording.
    pub fn write_of(
        &mut self,
        bead: BeadIndex,
        bytes: &[u8],
        received_ns: Option<u64>,
        sink: impl FnMut(Item),
    ) -> Result<(), RecordingError> {
        self.streams[bead.0]
            .write(&mut self.mcap, bytes, received_ns, sink)
            .map_err(RecordingError::unwritten(&self.partial))?;
        self.flush_in_time()
    }

    /// Passes bytes that have waited for a second to the system. Must be called even while nothing comes.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn flush_in_time(&mut self) -> Result<(), RecordingError> {
        if self.flushed.elapsed() >= FLUSH_EVERY {
            self.flush()?;
        }
        Ok(())
    }

    /// Passes all whole messages to the system. After that a crash of this program cannot lose them.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        self.flushed = Instant::now();
        self.flushes += 1;
        self.mcap
            .flush()
            .map_err(RecordingError::unwritten(&self.partial))
    }

    /// Counts of what was received so far, and of what was lost, of all beads.
    pub fn counters(&self) -> Counters {
        let all = self.streams.iter().map(|stream| stream.reader.counters());
        all.fold(Counters::default(), |sum, one| sum.and(one))
    }

    /// Counts of one bead among several.
    ///
    /// # Panics
    /// The index is that of another recording.
    pub fn counters_of(&self, bead: BeadIndex) -> &Counters {
        self.streams[bead.0].reader.counters()
    }

    /// The name until the recording is finished.
    pub fn partial_path(&self) -> &Path {
        &self.partial
    }

    /// Greatest size of the file's index, in bytes: a record for each chunk, with a place for each channel in
    /// it.
    fn index(&self) -> u64 {
        let bytes: u64 = self.streams.iter().map(|stream| stream.bytes).sum();
        let chunks = self.flushes + bytes / CHUNK;
        chunks * (256 + 192 * self.streams.len() as u64)
    }

    /// Completes the file when it is older than `after`, or when its index, which is in memory until the file
    /// is complete, takes 64 MB. The recording continues in another file, which will have the next free name:
    /// `NAME-2.mcap` and so on. Each byte is in one of them; counters continue. The split waits for a moment
    /// when no bead is sending a strike, but not once the file is ten seconds older than `after`. Attached
    /// parts stay where they are.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn split(&mut self, after: Duration) -> Result<Option<PathBuf>, RecordingError> {
        let age = self.begun.elapsed();
        if age < after && self.index() < LONGEST_INDEX {
            return Ok(None);
        }
        if !self.streams.iter().all(Stream::is_idle) && age < after.saturating_add(PATIENCE) {
            return Ok(None);
        }
        let target = self.target.clone().replacing(false);
        let (mut mcap, partial) = begin_file(&target, &self.about, Some(&self.partial))?;
        for stream in &mut self.streams {
            let ended = stream.end_noise(&mut self.mcap);
            ended.map_err(RecordingError::unwritten(&self.partial))?;
            let begun = stream.go_on(&mut mcap);
            begun.map_err(RecordingError::unwritten(&partial))?;
        }
        mcap.flush().map_err(RecordingError::unwritten(&partial))?;
        let mcap = mem::replace(&mut self.mcap, mcap);
        let partial = mem::replace(&mut self.partial, partial);
        let target = mem::replace(&mut self.target, target);
        (self.begun, self.flushes) = (Instant::now(), 0);
        let path = end_file(mcap, &partial, &target)?;
        Ok(Some(path))
    }

    /// Fills the recording and completes it. If that fails, its file is removed, as the source still exists.
    ///
    /// # Errors
    /// As [`finish`](Self::finish), or what `fill` reports.
    pub fn fill(
        mut self,
        fill: impl FnOnce(&mut Self) -> Result<(), RecordingError>,
    ) -> Result<Finished, RecordingError> {
        let partial = self.partial.clone();
        let _listed = Unfinished::list(&partial);
        let finished = fill(&mut self).and_then(|()| self.finish());
        if finished.is_err() {
            // The file may not exist.
            let _ = fs::remove_file(&partial);
        }
        finished
    }

    /// Completes the file and gives it its name. If a file of that name appeared meanwhile and must not be
    /// replaced, the recording takes the next free name, `NAME-2.mcap` and so on.
    ///
    /// # Errors
    /// The file cannot be written or renamed; what was written stays under its temporary name.
    pub fn finish(mut self) -> Result<Finished, RecordingError> {
        let counters = self.counters();
        for stream in &mut self.streams {
            let ended = stream.end(&mut self.mcap);
            ended.map_err(RecordingError::unwritten(&self.partial))?;
        }
        let path = end_file(self.mcap, &self.partial, &self.target)?;
        Ok(Finished { path, counters })
    }
}

fn end_file(mut mcap: Mcap, partial: &Path, target: &Target) -> Result<PathBuf, RecordingError> {
    mcap.finish().map_err(RecordingError::unwritten(partial))?;
    let file = mcap.into_inner().into_inner();
    // The file must be on disk before it has its name: a power cut must not leave a name with an empty file.
    let file = file
        .map_err(|error| error.into_error())
        .and_then(|file| file.sync_all().map(|()| file))
        .map_err(RecordingError::refused("write", partial))?;
    let path = take_name(partial, target)
        .map_err(RecordingError::refused("rename the recording to", target.path()))?;
    // Its lock is held until it has its name.
    drop(file);
    Ok(path)
}

/// Greatest size of an index, in bytes. The library copies it when a file is completed.
const LONGEST_INDEX: u64 = 64 << 20;
/// Longest time for which a file that is due is kept open because a strike is on its way.
const PATIENCE: Duration = Duration::from_secs(10);

/// Begins a file under a temporary name, with the recording's description; `before` is the preceding file.
fn begin_file(
    target: &Target,
    about: &About,
    before: Option<&Path>,
) -> Result<(Mcap, PathBuf), RecordingError> {
    let (file, partial) = create_partial(target.path(), before)?;
    let begin = || {
        let mut mcap = WriteOptions::new()
            .compression(None)
            .chunk_size(Some(CHUNK))
            // A chunk is written in one go: seeking back to complete it would leave half ones after a crash.
            .disable_seeking(true)
            .library(concat!("bead ", env!("CARGO_PKG_VERSION")))
            .create(BufWriter::new(file))?;
        mcap.write_metadata(&Metadata {
            name: METADATA.into(),
            metadata: about.to_map(),
        })?;
        for remark in &about.remarks {
            mcap.write_metadata(&remark.to_record())?;
        }
        mcap.flush()?;
        Ok(mcap)
    };
    match begin() {
        Ok(mcap) => Ok((mcap, partial)),
        Err(error) => {
            // Nothing is in it yet. If it cannot be removed either, the message names it.
            let _ = fs::remove_file(&partial);
            Err(RecordingError::unwritten(&partial)(error))
        }
    }
}

/// A recording that is complete.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finished {
    /// Path of the last file.
    pub path: PathBuf,
    /// Counts of frames received, refused and lost, of all beads.
    pub counters: Counters,
}

/// Gives a finished recording its name, or one like it.
fn take_name(partial: &Path, target: &Target) -> io::Result<PathBuf> {
    if target.replaces() {
        fs::rename(partial, target.path())?;
        return Ok(target.path().to_owned());
    }
    for number in 1.. {
        let path = numbered(target.path(), number);
        // Unlike a renaming, a link never takes another file's place.
        match fs::hard_link(partial, &path) {
            Ok(()) => {
                fs::remove_file(partial)?;
                return Ok(path);
            }
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            // Not every file system has links.
            Err(_) if !path.exists() => {
                fs::rename(partial, &path)?;
                return Ok(path);
            }
            Err(_) => {}
        }
    }
    unreachable!("the numbers do not end");
}

/// `NAME.mcap`, then `NAME-2.mcap` and so on.
fn numbered(path: &Path, number: u32) -> PathBuf {
    match number {
        1 => path.to_owned(),
        _ => with_stem_end(path, &format!("-{number}")),
    }
}

/// Creates `path` with `.partial`, or `.2.partial` and so on, and locks it. A file that an earlier crash left
/// is not touched. A locked one is being written by another program, unless it is `own`.
fn create_partial(path: &Path, own: Option<&Path>) -> Result<(File, PathBuf), RecordingError> {
    let mut attempt = 1u32;
    loop {
        let mut partial = path.as_os_str().to_owned();
        match attempt {
            1 => partial.push(".partial"),
            _ => partial.push(format!(".{attempt}.partial")),
        }
        let partial = PathBuf::from(partial);
        match File::create_new(&partial) {
            Ok(file) => {
                // Another program may try the lock at this moment; that does not take long. A file
                // system without locks leaves the last word to `take_name`.
                let _ = file.lock();
                return Ok((file, partial));
            }
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                let other = File::open(&partial).map(|other| other.try_lock());
                if let Ok(Err(TryLockError::WouldBlock)) = other
                    && own != Some(&partial)
                {
                    return Err(RecordingError::Busy(path.to_owned()));
                }
                attempt += 1;
            }
            Err(error) => return Err(RecordingError::refused("create", &partial)(error)),
        }
    }
}
