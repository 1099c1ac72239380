//! Listens to a port for as long as a recording lasts, and opens it again when it has gone away.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
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
    /// They give up when every port has been gone for so long.
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

    fn alive(&self) -> Instant {
        *self.alive.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn is_alive(&self) {
        *self.alive.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
    }
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
    /// Reads the port until it is told to stop, at least once. When the port goes away it is opened again; `tell`
    /// gets a line about each. An empty piece in the queue says that it came back.
    ///
    /// # Errors
    /// The port went away and did not come back.
    pub fn listen(&self, mut port: Port, tell: impl Fn(String)) -> io::Result<()> {
        let Self { address, shared, .. } = self;
        loop {
            let Err(reason) = self.read(&mut port) else {
                return Ok(());
            };
            // Another program could not open it either.
            drop(port);
            if shared.wait.is_zero() {
                return Err(reason);
            }
            tell(format!(
                "{address} went away ({reason}): the recording goes on when it is back"
            ));
            port = loop {
                thread::sleep(RETRY);
                if shared.is_over() {
                    return Ok(());
                }
                if let Ok(port) = address.open(self.baud) {
                    break port;
                }
                if shared.alive().elapsed() >= shared.wait {
                    return Err(reason);
                }
            };
            tell(format!("{address} is back"));
            if !shared.queue.push((self.source, Instant::now(), Vec::new())) {
                return Ok(());
            }
        }
    }

    fn read(&self, port: &mut Port) -> io::Result<()> {
        let Shared { queue, .. } = self.shared;
        let mut buffer = vec![0; 64 * 1024];
        loop {
            let length = port.read(&mut buffer)?;
            // The time is taken here and not at the writer, where the disk would delay it.
            let now = Instant::now();
            self.shared.is_alive();
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
