//! Listens to a port for as long as a recording lasts, and opens it again when it has gone away.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use crate::port::{Address, Port};

/// Time between two attempts to open a port that went away.
const RETRY: Duration = Duration::from_millis(200);
/// Greatest number of bytes that are read at a time.
const BLOCK: usize = 4096;
/// Greatest number of pieces of bytes that wait for the disk: 15 s of a serial line, at most 64 MB.
pub(crate) const QUEUE: usize = 1 << 14;

/// Bytes of a port on their way to the recorder.
pub(crate) struct PortBytes {
    pub(crate) source: usize,
    /// Receive time of the last of the bytes.
    pub(crate) received: Instant,
    /// Received bytes; empty when a port that was away is back.
    pub(crate) bytes: Vec<u8>,
}

/// State that all listeners of a recording share.
pub(crate) struct Shared<'a> {
    /// True to end the listeners.
    pub(crate) stop: &'a AtomicBool,
    /// Time at which the listeners end.
    pub(crate) deadline: Option<Instant>,
    /// Time for which every port may be away before the listeners give up. With 0, all end when one port
    /// goes away.
    pub(crate) wait: Duration,
    /// Time when a port was last there.
    pub(crate) alive: Mutex<Instant>,
}

impl Shared<'_> {
    fn is_over(&self) -> bool {
        self.stop.load(Ordering::Relaxed) || self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }

    fn is_given_up(&self) -> bool {
        let alive = *self.alive.lock().unwrap_or_else(PoisonError::into_inner);
        alive.elapsed() >= self.wait
    }

    fn note_alive(&self) {
        *self.alive.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
    }
}

/// End of listening to a port.
#[derive(Debug)]
pub enum End {
    /// The listener was stopped, after it had read everything.
    Stopped,
    /// The listener was stopped. The port had gone away for this reason, without bytes since.
    Away(io::Error),
    /// The port went away for this reason, and did not come back.
    Gone(io::Error),
}

pub(crate) struct Listener<'a> {
    /// Index of the port, which goes with its bytes.
    pub(crate) source: usize,
    pub(crate) address: &'a Address,
    /// Bits a second of a serial port.
    pub(crate) baud: u32,
    /// Queue of the bytes. While it is full, the listener waits: then the sender at the other end of a
    /// socket waits, too; a serial line loses bytes, which shows in its frames.
    pub(crate) bytes: SyncSender<PortBytes>,
    pub(crate) requests: Receiver<Vec<u8>>,
    pub(crate) shared: &'a Shared<'a>,
}

impl Listener<'_> {
    /// Reads the port until it is stopped, at least once. A port that goes away is opened again. `note`
    /// takes a line when the port goes away, and another when bytes come again; an empty piece in the queue
    /// precedes these.
    pub(crate) fn listen(&self, mut port: Port, note: impl Fn(String)) -> End {
        let Self { address, shared, .. } = self;
        // Reason why the port went away, until bytes come again.
        let mut away = None;
        loop {
            let Err(reason) = self.read(&mut port, &mut away, &note) else {
                return away.map_or(End::Stopped, End::Away);
            };
            // An open port would stay locked, even against a new attempt to open it.
            drop(port);
            if shared.wait.is_zero() {
                shared.stop.store(true, Ordering::Relaxed);
                return End::Gone(reason);
            }
            if away.is_none() {
                note(format!(
                    "{address} went away ({reason}): the recording goes on when it is back"
                ));
            } else if shared.is_given_up() {
                return End::Gone(reason);
            }
            let Some(reopened) = self.reopen() else {
                return if shared.is_over() {
                    End::Away(reason)
                } else {
                    End::Gone(reason)
                };
            };
            (port, away) = (reopened, Some(reason));
        }
    }

    /// Opens the port as soon as that works. `None` when the recording is over, or every port was gone for
    /// too long.
    fn reopen(&self) -> Option<Port> {
        loop {
            thread::sleep(RETRY);
            // Discard requests while the port is away.
            self.requests.try_iter().for_each(drop);
            let opened = self.open();
            if self.shared.is_over() {
                return None;
            }
            if opened.is_some() {
                return opened;
            }
            if self.shared.is_given_up() {
                return None;
            }
        }
    }

    /// Opens the port on a separate thread: a name or a server may take long, and a recording must be able
    /// to end.
    fn open(&self) -> Option<Port> {
        let (done, opened) = mpsc::channel();
        let (address, baud) = (self.address.clone(), self.baud);
        // If nobody waits any longer, this closes the port.
        let open = move || drop(done.send(address.open(baud)));
        thread::Builder::new().spawn(open).ok()?;
        loop {
            match opened.recv_timeout(RETRY) {
                Ok(opened) => return opened.ok(),
                Err(RecvTimeoutError::Disconnected) => return None,
                Err(RecvTimeoutError::Timeout) if self.shared.is_over() || self.shared.is_given_up() => {
                    return None;
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }

    /// Reads until the listener is stopped. The first bytes clear `away`.
    fn read(&self, port: &mut Port, away: &mut Option<io::Error>, note: &impl Fn(String)) -> io::Result<()> {
        let opened = Instant::now();
        let mut buffer = vec![0; BLOCK];
        loop {
            let length = port.read(&mut buffer)?;
            // Take the time here: at the writer, the disk would delay it.
            let received = Instant::now();
            let hand_on = |bytes: &[u8]| {
                let (source, bytes) = (self.source, bytes.to_vec());
                let piece = PortBytes {
                    source,
                    received,
                    bytes,
                };
                self.bytes.send(piece).is_ok()
            };
            if length > 0 && away.take().is_some() {
                note(format!("{} is back", self.address));
                if !hand_on(&[]) {
                    return Ok(());
                }
            }
            // A server may accept every connection and soon close it without a byte. That does not count as
            // alive.
            if away.is_none() || opened.elapsed() >= self.shared.wait {
                self.shared.note_alive();
            }
            let is_wanted = length == 0 || hand_on(&buffer[..length]);
            if !is_wanted || self.shared.is_over() {
                return Ok(());
            }
            for request in self.requests.try_iter() {
                // If the port has gone away, a read reports it after all bytes.
                let _ = port.write(&request);
            }
        }
    }
}
