//! Records the beads at several ports in one file, and fetches the strikes that are lost on the way.
//!
//! # Design
//! One thread for each port only reads it. A slow disk therefore costs memory, up to `QUEUE` pieces of bytes,
//! before it costs a byte. The threads end at a deadline, at a signal, or when all ports have gone away for
//! good. In each case all that they read is recorded.
//!
//! A bead is asked for strikes that did not come whole ([`Gaps`]), through the thread of its port.

use std::collections::{BTreeMap, VecDeque};
use std::panic;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::thread::{self, ScopedJoinHandle};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use bead_wire::{Arrival, Counters, Message};

use crate::gaps::Gaps;
use crate::listener::{End, Listener, PortBytes, QUEUE, Shared};
use crate::port::{Address, Port};
use bead_recording::assembly::Assembled;
use bead_recording::clock::Live;
use bead_recording::file::{About, BeadIndex, Note, RecordingError, RecordingOrigin, RecordingWriter};
use bead_recording::frames::{Frame, FrameReader, Item};
use bead_tables::whole::Target;

/// Interval of the search for strikes to ask a bead for.
const ASK_EVERY: Duration = Duration::from_millis(50);
/// Greatest number of bytes kept from a port without a frame yet.
const UNKNOWN_MOST: usize = 64 << 10;

/// Options of a recording.
#[derive(Clone, Copy, Debug)]
pub struct RecorderOptions {
    /// Bits a second of serial ports.
    pub baud: u32,
    /// Time after which the recording ends.
    pub duration: Option<Duration>,
    /// Time after which the recording goes on in another file.
    pub split: Duration,
    /// Time for which all ports may be away. With 0, the recording ends when one goes away.
    pub wait: Duration,
    /// True if beads are asked for lost strikes.
    pub fetch: bool,
}

/// An order to a running recording.
#[derive(Clone, Debug)]
pub enum RecorderOrder {
    /// Write this note into the recording.
    Note(Note),
    /// Send these bytes, a request, to the port of the bead with this address.
    Send {
        /// Address of the bead.
        bead: u8,
        /// The encoded request.
        bytes: Vec<u8>,
    },
}

/// Observes a running recording. Its methods must not block: the recording would wait.
pub trait RecorderObserver {
    /// Takes every frame and every reject, with the index of its port.
    fn item(&mut self, _source: usize, _item: &Item) {}

    /// Takes the name under which the recording is being written, at its beginning and when it goes on in
    /// another file.
    fn file(&mut self, _partial: &Path) {}

    /// Takes a strike or a fault of a bead. A fetched strike has the header of a strike frame of its boot.
    fn message(&mut self, frame: &Frame, received_ns: u64, is_fetched: bool);

    /// Takes the counts of frames and strikes after each piece of bytes.
    fn progress(&mut self, counters: &Counters, strikes: u64);
}

/// One port of a recording, when it has ended.
#[derive(Debug)]
pub struct RecordedPort {
    /// The port.
    pub address: Address,
    /// Address of its bead, `None` if no frame came.
    pub bead: Option<u8>,
    /// Number of strikes.
    pub strikes: u64,
    /// Counts of frames. `None` if the port was not recorded because another bead has the same address.
    pub counters: Option<Counters>,
    /// End of listening to it.
    pub end: End,
}

/// A recording that is complete.
#[derive(Debug)]
pub struct Recorded {
    /// Its files, in order.
    pub files: Vec<PathBuf>,
    /// Counts of frames, of all beads.
    pub counters: Counters,
    /// Number of strikes, with fetched ones.
    pub strikes: u64,
    /// Number of strikes that were fetched.
    pub fetched: u64,
    /// Number of strikes that were lost and could not be fetched.
    pub gone: u64,
    /// Length of the recording.
    pub duration: Duration,
    /// Its ports.
    pub ports: Vec<RecordedPort>,
    /// Clocks of the beads.
    pub clocks: Live,
    /// A line about a bead of a later version of the protocol ([`Frame::from_the_future`]).
    pub from_the_future: Option<String>,
}

/// A recording that failed.
#[derive(Debug, thiserror::Error)]
#[error("{source}; the recording up to then is kept in {}, for `bead recover`", partial.display())]
pub struct RecorderError {
    source: RecordingError,
    partial: PathBuf,
}

struct RecordedSource {
    address: Address,
    /// Writes its bytes; `None` in a recording of one port, and before its bead is known.
    writer: Option<BeadIndex>,
    /// Bytes that came before its bead was known, each piece with its receive time.
    before: VecDeque<(u64, Vec<u8>)>,
    before_bytes: usize,
    /// Looks for a frame in the bytes.
    reader: FrameReader,
    /// True if another bead has the same address.
    is_refused: bool,
    bead: Option<u8>,
    strikes: u64,
}

impl RecordedSource {
    fn new(address: &Address) -> Self {
        Self {
            address: address.clone(),
            writer: None,
            before: VecDeque::new(),
            before_bytes: 0,
            reader: FrameReader::default(),
            is_refused: false,
            bead: None,
            strikes: 0,
        }
    }

    /// Keeps bytes of a bead that is not known yet, and searches them for its address.
    fn keep(&mut self, bytes: Vec<u8>, received_ns: u64) {
        let bead = &mut self.bead;
        self.reader.feed(&bytes, None, |item| {
            *bead = bead.or(item.frame().map(|frame| frame.header.address));
        });
        self.before_bytes += bytes.len();
        self.before.push_back((received_ns, bytes));
        while self.before_bytes > UNKNOWN_MOST
            && let Some((_, oldest)) = self.before.pop_front()
        {
            self.before_bytes -= oldest.len();
        }
    }
}

/// A recording that runs.
pub struct Recorder<'a> {
    options: RecorderOptions,
    writer: RecordingWriter,
    files: Vec<PathBuf>,
    sources: Vec<RecordedSource>,
    clocks: Live,
    opened: Instant,
    /// The time of `opened` in ns since 1970.
    opened_ns: u64,
    strikes: u64,
    /// Lost strikes by port and address.
    gaps: BTreeMap<(usize, u8), Gaps>,
    from_the_future: Option<String>,
    orders: Option<Receiver<RecorderOrder>>,
    observer: &'a mut dyn RecorderObserver,
    /// Takes lines for people, also from the threads of the ports.
    note: &'a (dyn Fn(String) + Sync),
}

impl<'a> Recorder<'a> {
    /// Begins a recording of ports that were opened just now. Its source is their names.
    ///
    /// # Errors
    /// The file cannot be written, or another program is recording under its name.
    pub fn new(
        target: &Target,
        addresses: &[Address],
        options: RecorderOptions,
        about: About,
        observer: &'a mut dyn RecorderObserver,
        note: &'a (dyn Fn(String) + Sync),
    ) -> Result<Self, RecordingError> {
        let opened = Instant::now();
        // From here on only the monotonic clock counts, so that a step of the host's time does not look like
        // drift of the bead.
        let opened_ns = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_or(0, |since| since.as_nanos() as u64);
        let names: Vec<_> = addresses.iter().map(Address::to_string).collect();
        let about = About {
            source: names.join(", "),
            ..about
        };
        let create = match addresses {
            [_] => RecordingWriter::create,
            _ => RecordingWriter::create_for_several,
        };
        let writer = create(target, &about)?;
        observer.file(writer.partial_path());
        Ok(Self {
            options,
            writer,
            files: Vec::new(),
            sources: addresses.iter().map(RecordedSource::new).collect(),
            clocks: Live::default(),
            opened,
            opened_ns,
            strikes: 0,
            gaps: BTreeMap::new(),
            from_the_future: None,
            orders: None,
            observer,
            note,
        })
    }

    /// Takes orders while the recording runs.
    #[must_use]
    pub fn with_orders(self, orders: Receiver<RecorderOrder>) -> Self {
        Self {
            orders: Some(orders),
            ..self
        }
    }

    /// Records the ports, in the order of their addresses, until `stop` is true, the time is over, or no port
    /// is left.
    ///
    /// # Errors
    /// A file cannot be written. The bytes that came before stay under its temporary name.
    pub fn run(mut self, ports: Vec<Port>, stop: &AtomicBool) -> Result<Recorded, RecorderError> {
        let shared = Shared {
            stop,
            deadline: self
                .options
                .duration
                .and_then(|duration| self.opened.checked_add(duration)),
            wait: self.options.wait,
            alive: Mutex::new(Instant::now()),
        };
        let addresses: Vec<Address> = self.sources.iter().map(|source| source.address.clone()).collect();
        let (note, baud) = (self.note, self.options.baud);
        let (bytes, received) = mpsc::sync_channel(QUEUE);
        let (ends, recorded) = thread::scope(|scope| {
            let (mut requests, mut threads) = (Vec::new(), Vec::new());
            for ((source, address), port) in addresses.iter().enumerate().zip(ports) {
                let (request, to_send) = mpsc::channel();
                requests.push(request);
                let listener = Listener {
                    source,
                    address,
                    baud,
                    bytes: bytes.clone(),
                    requests: to_send,
                    shared: &shared,
                };
                threads.push(scope.spawn(move || listener.listen(port, note)));
            }
            drop(bytes);
            let recorded = {
                let _stop = StopAtEnd(stop);
                self.record(received, &requests)
            };
            let join = |thread: ScopedJoinHandle<'_, End>| {
                thread.join().unwrap_or_else(|cause| panic::resume_unwind(cause))
            };
            (threads.into_iter().map(join).collect::<Vec<_>>(), recorded)
        });
        let partial = self.writer.partial_path().to_owned();
        let recorded = recorded.and_then(|()| self.finish(ends));
        recorded.map_err(|source| RecorderError { source, partial })
    }

    fn finish(mut self, ends: Vec<End>) -> Result<Recorded, RecordingError> {
        let duration = self.opened.elapsed();
        let is_of_several = self.sources.len() > 1;
        let port = |(source, end): (&RecordedSource, End)| RecordedPort {
            address: source.address.clone(),
            bead: source.bead,
            strikes: source.strikes,
            counters: match source.writer {
                Some(writer) => Some(*self.writer.counters_of(writer)),
                None => (!is_of_several).then(|| self.writer.counters()),
            },
            end,
        };
        let ports = self.sources.iter().zip(ends).map(port).collect();
        let finished = self.writer.finish()?;
        self.files.push(finished.path);
        Ok(Recorded {
            files: self.files,
            counters: finished.counters,
            strikes: self.strikes,
            fetched: self.gaps.values().map(|gaps| gaps.fetched).sum(),
            gone: self.gaps.values().map(|gaps| gaps.lost).sum(),
            duration,
            ports,
            clocks: self.clocks,
            from_the_future: self.from_the_future,
        })
    }

    /// Records what comes until no listener is left, and asks for what is missing.
    fn record(
        &mut self,
        received: Receiver<PortBytes>,
        requests: &[Sender<Vec<u8>>],
    ) -> Result<(), RecordingError> {
        loop {
            if let Some(path) = self.writer.split(self.options.split)? {
                (self.note)(format!("{} is complete; the recording goes on", path.display()));
                self.files.push(path);
                self.observer.file(self.writer.partial_path());
            }
            self.obey(requests)?;
            match received.recv_timeout(ASK_EVERY) {
                Ok(PortBytes { source, bytes, .. }) if bytes.is_empty() => {
                    let of_port = self.gaps.iter_mut().filter(|((port, _), _)| *port == source);
                    of_port.for_each(|(_, gaps)| gaps.reconnect());
                }
                Ok(piece) => {
                    let since = piece.received.duration_since(self.opened);
                    let received_ns = self.opened_ns + since.as_nanos() as u64;
                    self.push(piece.source, piece.bytes, received_ns)?;
                }
                Err(RecvTimeoutError::Timeout) => self.writer.flush_in_time()?,
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            }
            if self.options.fetch {
                let now = Instant::now();
                for ((source, _), gaps) in &mut self.gaps {
                    if let Some(request) = gaps.next(now) {
                        // A port that has gone away for good takes nothing.
                        let _ = requests[*source].send(request);
                    }
                }
            }
        }
    }

    /// Carries out the orders since the last call.
    fn obey(&mut self, requests: &[Sender<Vec<u8>>]) -> Result<(), RecordingError> {
        for order in self.orders.iter().flat_map(Receiver::try_iter) {
            match order {
                RecorderOrder::Note(note) => match self.writer.note(&note) {
                    Err(RecordingError::Unfit(why)) => (self.note)(why),
                    written => written?,
                },
                RecorderOrder::Send { bead, bytes } => {
                    let known = self.gaps.keys().find(|(_, address)| *address == bead);
                    if let Some((source, _)) = known {
                        // A port that has gone away for good takes nothing.
                        let _ = requests[*source].send(bytes);
                    }
                }
            }
        }
        Ok(())
    }

    /// Takes bytes from a port, and writes them when their bead is known.
    fn push(&mut self, source: usize, bytes: Vec<u8>, received_ns: u64) -> Result<(), RecordingError> {
        let is_of_several = self.sources.len() > 1;
        let from = &mut self.sources[source];
        if !is_of_several || from.writer.is_some() {
            return self.write(source, &bytes, received_ns);
        }
        if from.is_refused {
            return Ok(());
        }
        from.keep(bytes, received_ns);
        let Some(address) = from.bead else { return Ok(()) };
        let before = std::mem::take(&mut from.before);
        let origin = RecordingOrigin {
            address,
            port: Some(from.address.to_string()),
            clock: Some("host".to_owned()),
            ..RecordingOrigin::default()
        };
        match self.writer.join(&origin) {
            Ok(writer) => from.writer = Some(writer),
            Err(error @ RecordingError::SameAddress(_)) => {
                from.is_refused = true;
                (self.note)(format!(
                    "{}: {error}; this port is not recorded, but the others are",
                    from.address
                ));
                return Ok(());
            }
            Err(error) => return Err(error),
        }
        let mut pieces = before.into_iter();
        pieces.try_for_each(|(received_ns, bytes)| self.write(source, &bytes, received_ns))
    }

    /// Writes bytes of a known bead, and hands on the strikes and faults in them.
    fn write(&mut self, source: usize, bytes: &[u8], received_ns: u64) -> Result<(), RecordingError> {
        let Self {
            writer,
            sources,
            clocks,
            strikes,
            gaps,
            from_the_future,
            observer,
            ..
        } = self;
        let from = &mut sources[source];
        let now = Instant::now();
        let push = |item: Item| {
            observer.item(source, &item);
            let Item::Frame(frame) = item else { return };
            clocks.push(&frame);
            *from_the_future = frame.from_the_future().or(from_the_future.take());
            if frame.arrival == Arrival::Duplicate {
                return;
            }
            let address = frame.header.address;
            from.bead.get_or_insert(address);
            let gaps = gaps
                .entry((source, address))
                .or_insert_with(|| Gaps::new(address));
            let fetched = gaps.push(&frame, now);
            let is_new = |strike: &Assembled| strike.fetched.is_some_and(|copy| !copy.before.result);
            let fetched = fetched.filter(is_new);
            let is_strike = matches!(frame.message, Message::Strike(_)) || fetched.is_some();
            if is_strike {
                *strikes += 1;
                from.strikes += 1;
            }
            if let Some(fetched) = fetched {
                observer.message(&as_measured(&frame, &fetched), received_ns, true);
            } else if is_strike || matches!(frame.message, Message::Fault(_)) {
                observer.message(&frame, received_ns, false);
            }
        };
        match from.writer {
            Some(bead) => writer.write_of(bead, bytes, Some(received_ns), push)?,
            None => writer.write(bytes, Some(received_ns), push)?,
        }
        observer.progress(&writer.counters(), *strikes);
        Ok(())
    }
}

/// The strike frame of a fetched strike.
fn as_measured(frame: &Frame, fetched: &Assembled) -> Frame {
    Frame {
        header: fetched.header,
        message: fetched.strike.said.into(),
        ..frame.clone()
    }
}

/// Stops the listeners at the end of a block, even if the block panics: the scope waits for their threads.
struct StopAtEnd<'a>(&'a AtomicBool);

impl Drop for StopAtEnd<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}
