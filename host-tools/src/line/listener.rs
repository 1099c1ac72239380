//! Listens to a port for as long as a recording lasts, and opens it again when it has gone away.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use crate::line::port::{Address, Port};
use crate::line::queue::Queue;

/// Between two attempts to open a port that went away.
const RETRY: Duration = Duration::from_millis(200);

/// What all listeners of a recording share.
pub struct Shared<'a> {
    /// They end when it is true.
    pub stop: &'a AtomicBool,
    /// They end then.
    pub deadline: Option<Instant>,
    /// They give up when every port has been gone for so long. If it is 0, all end when one goes away.
    pub wait: Duration,
    /// When a port was last seen to be there.
    pub alive: Mutex<Instant>,
    /// Where the bytes go.
    pub queue: &'a Queue,
}

impl Shared<'_> {
    fn is_over(&self) -> bool {
        self.stop.load(Ordering::Relaxed) || self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }

    /// Whether every port has been gone for too long.
    fn is_given_up(&self) -> bool {
        let alive = *self.alive.lock().unwrap_or_else(PoisonError::into_inner);
        alive.elapsed() >= self.wait
    }

    fn is_alive(&self) {
        *self.alive.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
    }
}

/// How listening to a port ended.
#[derive(Debug)]
pub enum End {
    /// It was told to stop. All that came was read.
    Stopped,
    /// It was told to stop. The port had gone away for this reason, and nothing had come since.
    Away(io::Error),
    /// The port went away for this reason, and did not come back.
    Gone(io::Error),
}

/// One port.
pub struct Listener<'a> {
    /// Its number, which goes with its bytes.
    pub source: usize,
    /// What it is.
    pub address: &'a Address,
    /// Bits a second of a serial port.
    pub baud: u32,
    /// Bytes to send.
    pub asks: Receiver<Vec<u8>>,
    /// What it shares with the others.
    pub shared: &'a Shared<'a>,
}

impl Listener<'_> {
    /// Reads the port until it is told to stop, at least once. When the port goes away it is opened again;
    /// `tell` gets a line when it goes, and one when bytes come again. An empty piece in the queue stands
    /// before those.
    pub fn listen(&self, mut port: Port, tell: impl Fn(String)) -> End {
        let Self { address, shared, .. } = self;
        // Why the port went away, until bytes come again.
        let mut away = None;
        loop {
            let Err(reason) = self.read(&mut port, &mut away, &tell) else {
                return away.map_or(End::Stopped, End::Away);
            };
            // Another program could not open it either.
            drop(port);
            if shared.wait.is_zero() {
                shared.stop.store(true, Ordering::Relaxed);
                return End::Gone(reason);
            }
            if away.is_none() {
                tell(format!(
                    "{address} went away ({reason}): the recording goes on when it is back"
                ));
            } else if shared.is_given_up() {
                return End::Gone(reason);
            }
            let Some(reopened) = self.reopen() else {
                return match shared.is_over() {
                    true => End::Away(reason),
                    false => End::Gone(reason),
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
            // The bead does not hear what it is asked meanwhile.
            self.asks.try_iter().for_each(drop);
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

    /// Opens the port. That is done on a thread of its own: a name or a server may keep it waiting for much
    /// longer than a recording that is to end has.
    fn open(&self) -> Option<Port> {
        let (done, opened) = mpsc::channel();
        let (address, baud) = (self.address.clone(), self.baud);
        // Where nobody waits for it any more, it is closed.
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

    /// Reads until it is told to stop. With the first bytes the port is `away` no more.
    fn read(&self, port: &mut Port, away: &mut Option<io::Error>, tell: &impl Fn(String)) -> io::Result<()> {
        let Shared { queue, wait, .. } = self.shared;
        let opened = Instant::now();
        let mut buffer = vec![0; 64 * 1024];
        loop {
            let length = port.read(&mut buffer)?;
            // The time is taken here and not at the writer, where the disk would delay it.
            let now = Instant::now();
            if length > 0 && away.take().is_some() {
                tell(format!("{} is back", self.address));
                if !queue.push((self.source, now, Vec::new())) {
                    return Ok(());
                }
            }
            // A server may take every connection and soon close it without a byte: that is not to count.
            if away.is_none() || opened.elapsed() >= *wait {
                self.shared.is_alive();
            }
            let wanted = length == 0 || queue.push((self.source, now, buffer[..length].to_vec()));
            if !wanted || self.shared.is_over() {
                return Ok(());
            }
            for request in self.asks.try_iter() {
                // If the port has gone away, reading says so, when all that came is read.
                let _ = port.write(&request);
            }
        }
    }
}
