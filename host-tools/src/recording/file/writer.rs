//! Writes recordings.

use std::collections::BTreeMap;
use std::fs::{self, File, TryLockError};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::time::Instant;

use bead_wire::{Counters, Message};
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, WriteOptions};

use crate::recording::file::about::{About, Part};
use crate::recording::file::channels::{Channels, Said};
use crate::recording::file::error::RecordingError;
use crate::recording::file::layout::{
    CHUNK, ENCODING, FLUSH_EVERY, LONGEST_RUN, METADATA, RECEIVED, RECEIVED_ENCODING, TOPIC,
};
use crate::recording::file::times::Clock;
use crate::recording::frames::{Item, Reader};
use crate::recording::whole::Target;

/// Writes a recording while it comes.
///
/// Dropped before [`finish`](Self::finish), it leaves a readable file under its temporary name.
pub struct Writer {
    target: Target,
    partial: PathBuf,
    mcap: mcap::Writer<BufWriter<File>>,
    channel: u16,
    received: u16,
    channels: Channels,
    run: Vec<u8>,
    /// Runs that are no frames, each with a delimiter.
    noise: Vec<u8>,
    reader: Reader,
    clock: Clock,
    pub(super) written: u32,
    flushed: Instant,
}

impl Writer {
    /// Begins a recording that will be called as `target` says.
    ///
    /// # Errors
    /// The directory cannot be written to, or another program is recording under that name.
    pub fn create(target: &Target, about: &About) -> Result<Self, RecordingError> {
        let (file, partial) = create_partial(target.path())?;
        let named = partial.clone();
        let failed = |error| {
            // Nothing was received yet. If it cannot be removed either, the message names it.
            let _ = std::fs::remove_file(&named);
            RecordingError::unwritten(&named)(error)
        };
        let mut mcap = WriteOptions::new()
            .compression(None)
            .chunk_size(Some(CHUNK))
            // A chunk is written in one go: seeking back to complete it would leave half ones after a crash.
            .disable_seeking(true)
            .library(concat!("bead ", env!("CARGO_PKG_VERSION")))
            .create(BufWriter::new(file))
            .map_err(&failed)?;
        let mut begin = || {
            mcap.write_metadata(&Metadata {
                name: METADATA.into(),
                metadata: about.to_map(),
            })?;
            let layout = BTreeMap::from([("version".into(), bead_wire::VERSION.to_string())]);
            let channel = mcap.add_channel(0, TOPIC, ENCODING, &layout)?;
            let received = mcap.add_channel(0, RECEIVED, RECEIVED_ENCODING, &BTreeMap::new())?;
            let channels = Channels::begin(&mut mcap)?;
            mcap.flush()?;
            Ok((channel, received, channels))
        };
        let (channel, received, channels) = begin().map_err(&failed)?;
        Ok(Self {
            target: target.clone(),
            partial,
            mcap,
            channel,
            received,
            channels,
            run: Vec::new(),
            noise: Vec::new(),
            reader: Reader::default(),
            clock: Clock {
                sample_rate_hz: about.sample_rate_hz,
                ..Clock::default()
            },
            written: 0,
            flushed: Instant::now(),
        })
    }

    /// Attaches a part. Parts that are known beforehand should be attached first, so that they survive a
    /// crash.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn attach(&mut self, part: Part, data: &[u8]) -> Result<(), RecordingError> {
        let attachment = Attachment {
            log_time: self.clock.log,
            create_time: 0,
            name: part.name().into(),
            media_type: part.media_type().into(),
            data: data.into(),
        };
        self.mcap
            .attach(&attachment)
            .map_err(RecordingError::unwritten(&self.partial))
    }

    /// Records bytes as received, the last of them at `received_ns`, the host's time in ns since 1970, if it
    /// is known. Hands on the frames and the rejects in them.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(
        &mut self,
        bytes: &[u8],
        received_ns: Option<u64>,
        mut sink: impl FnMut(Item),
    ) -> Result<(), RecordingError> {
        let before = self.written;
        if let Some(received_ns) = received_ns {
            self.clock.receive(received_ns);
        }
        let mut said = Vec::new();
        for byte in bytes {
            let Self {
                reader,
                clock,
                channels,
                ..
            } = self;
            let mut is_frame = false;
            reader.feed(std::slice::from_ref(byte), received_ns, |item| {
                if let Item::Frame(frame) = &item {
                    is_frame = true;
                    if let Message::Identity(identity) = &frame.message {
                        clock.sample_rate_hz = identity.sample_rate_hz;
                    }
                    clock.tick(frame.header.sample_index, frame.arrival);
                    said.extend(channels.take(frame));
                }
                sink(item);
            });
            if *byte != 0 {
                self.run.push(*byte);
            }
            match *byte {
                0 if self.run.is_empty() => {}
                // What is no frame stands together: each message costs some 50 bytes.
                0 if !is_frame && self.noise.len() + self.run.len() < LONGEST_RUN => {
                    self.noise.append(&mut self.run);
                    self.noise.push(0);
                }
                0 => self.end_run()?,
                _ if self.run.len() == LONGEST_RUN => self.end_run()?,
                _ => {}
            }
            for Said { channel, data } in said.drain(..) {
                self.message(channel, self.written.wrapping_sub(1), &data)?;
            }
        }
        self.end_noise()?;
        if let Some(received_ns) = received_ns.filter(|_| self.written != before) {
            self.write_time(received_ns)?;
        }
        if self.flushed.elapsed() >= FLUSH_EVERY {
            self.flush()?;
        }
        Ok(())
    }

    /// Records when the piece with the end of the last run was received.
    fn write_time(&mut self, received_ns: u64) -> Result<(), RecordingError> {
        let last = self.written.wrapping_sub(1);
        let data = [&last.to_le_bytes()[..], &received_ns.to_le_bytes()].concat();
        self.message(self.received, last, &data)
    }

    fn end_noise(&mut self) -> Result<(), RecordingError> {
        // The reader puts a delimiter behind each message.
        self.noise.pop();
        let noise = std::mem::take(&mut self.noise);
        self.put(noise)
    }

    fn end_run(&mut self) -> Result<(), RecordingError> {
        self.end_noise()?;
        let run = std::mem::take(&mut self.run);
        self.put(run)
    }

    /// Writes a run, or several with delimiters between them.
    fn put(&mut self, run: Vec<u8>) -> Result<(), RecordingError> {
        if run.is_empty() {
            return Ok(());
        }
        let number = self.written;
        self.written = number.wrapping_add(1);
        self.message(self.channel, number, &run)
    }

    fn message(&mut self, channel_id: u16, sequence: u32, data: &[u8]) -> Result<(), RecordingError> {
        let header = MessageHeader {
            channel_id,
            sequence,
            log_time: self.clock.log,
            publish_time: self.clock.bead,
        };
        self.mcap
            .write_to_known_channel(&header, data)
            .map_err(RecordingError::unwritten(&self.partial))
    }

    /// Gives all whole messages to the system. After that a crash of this program cannot lose them.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        self.flushed = Instant::now();
        self.mcap
            .flush()
            .map_err(RecordingError::unwritten(&self.partial))
    }

    /// Counts of what was received so far, and of what was lost.
    pub fn counters(&self) -> &Counters {
        self.reader.counters()
    }

    /// The name until the recording is finished.
    pub fn partial_path(&self) -> &Path {
        &self.partial
    }

    /// Completes the file and gives it its name. A file of that name that is not to be replaced came meanwhile:
    /// then the recording takes the next free name, `NAME-2.mcap` and so on.
    ///
    /// # Errors
    /// The file cannot be written or renamed; what is there stays under its temporary name.
    pub fn finish(mut self) -> Result<Finished, RecordingError> {
        self.end_run()?;
        let finished = self.mcap.finish();
        finished.map_err(RecordingError::unwritten(&self.partial))?;
        let file = self.mcap.into_inner().into_inner();
        // The file must be on disk before it has its name: after a power cut no name may stand for an empty
        // file.
        let file = file
            .map_err(|error| error.into_error())
            .and_then(|file| file.sync_all().map(|()| file))
            .map_err(RecordingError::refused("write", &self.partial))?;
        let path = take_name(&self.partial, &self.target).map_err(RecordingError::refused(
            "rename the recording to",
            self.target.path(),
        ))?;
        // Its lock is held until it has its name.
        drop(file);
        Ok(Finished {
            path,
            counters: *self.reader.counters(),
        })
    }
}

/// A recording that is complete.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finished {
    /// Where it is.
    pub path: PathBuf,
    /// What was received, refused and lost.
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
    if number == 1 {
        return path.to_owned();
    }
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(format!("-{number}"));
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

/// Creates `path` with `.partial`, or `.2.partial` and so on, and locks it. A file that an earlier crash left is
/// not touched. One that is locked is being written by another program.
fn create_partial(path: &Path) -> Result<(File, PathBuf), RecordingError> {
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
                // Somebody may look at this moment whether it is locked; that does not take long. A file system
                // without locks leaves the last word to `take_name`.
                let _ = file.lock();
                return Ok((file, partial));
            }
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                let other = File::open(&partial).map(|other| other.try_lock());
                if let Ok(Err(TryLockError::WouldBlock)) = other {
                    return Err(RecordingError::Busy(path.to_owned()));
                }
                attempt += 1;
            }
            Err(error) => return Err(RecordingError::refused("create", &partial)(error)),
        }
    }
}
