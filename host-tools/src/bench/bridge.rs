//! The image in QEMU behind an address: programs reach it as they reach a bead's line.
//!
//! # Design
//! The image stands still in its virtual time until the bridge lets some of it pass ([`stm32f405_qemu::Live`]). So a
//! request costs what its answer takes the image, however long the bead has run. Bead and strikes do exactly what they
//! do in any other run: the same bytes at the same virtual times give the same answers.
//!
//! Without a pace the image's time passes while a program is connected, as fast as it can, and stands still otherwise.
//! With a pace it follows the time of this computer.

use std::io::{self, Read, Write};
use std::net::TcpListener;
use std::os::unix::fs::FileTypeExt;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use stm32f405_qemu::{Inputs, Live, UartInput, Work};

use crate::bench::emulation::Emulation;
use crate::bench::error::BenchError;
use crate::line::port::Address;

/// After this time the image samples and hears.
const START: Duration = Duration::from_millis(50);
/// Time that passes after bytes came in. Most requests are answered within it.
const ANSWER: Duration = Duration::from_millis(80);
/// Time that passes at once while a program only listens.
const STEP: Duration = Duration::from_millis(250);
/// From a stop to the first byte that comes in after it.
const GAP_NS: u64 = 1_000_000;
/// A program that was answered hangs up within this time, or sends more.
const PAUSE: Duration = Duration::from_millis(100);
/// With a pace: how often time passes.
const BEAT: Duration = Duration::from_millis(10);
/// Between two looks for a new connection, or for a request to stop.
const LOOK: Duration = Duration::from_millis(50);

/// An image whose time passes on demand.
pub struct Bridge {
    live: Live,
    /// Codes at the converter. The first follows the last.
    rows: Vec<[u16; 4]>,
    next: usize,
    /// Up to when the image has codes, if it samples.
    codes_until_ns: Option<u64>,
    row_ns: u64,
    /// Seconds of the bead's crystal in a true one: rows follow the crystal.
    rate: f64,
    pace: Option<Pace>,
    /// What the last stretch of time has cost.
    pub work: Work,
}

/// The time of this computer that belongs to the image's.
struct Pace {
    started: Instant,
    /// Seconds of the image in one of this computer.
    factor: f64,
}

impl Bridge {
    /// The image at power-up. With a pace, it has so many seconds in one of this computer, from now on.
    ///
    /// # Errors
    /// QEMU fails.
    pub fn new(emulation: &Emulation, pace: Option<f64>) -> Result<Self, BenchError> {
        let mut machine = emulation.machine();
        machine.count_instructions = false;
        // From stop to stop.
        machine.timeout = Duration::from_secs(120);
        let rows = std::mem::take(&mut machine.stimulus);
        Ok(Self {
            rows,
            next: 0,
            codes_until_ns: None,
            row_ns: machine.sample_period_ns,
            rate: 1.0 + emulation.truth.clock_ppm * 1e-6,
            live: machine.start()?,
            pace: pace.map(|factor| Pace {
                started: Instant::now(),
                factor,
            }),
            work: Work::default(),
        })
    }

    /// Virtual time since power-up.
    pub fn now(&self) -> Duration {
        Duration::from_nanos(self.live.now_ns())
    }

    /// Sends `bytes`, lets time pass, and returns what the bead said.
    ///
    /// # Errors
    /// QEMU fails, or the image has come to its end.
    pub fn pass(&mut self, bytes: &[u8], time: Duration) -> Result<Vec<u8>, BenchError> {
        let mut said = Vec::new();
        if self.live.now_ns() < 1_000_000 && !bytes.is_empty() {
            // A bead that has not started does not hear.
            said = self.pass(&[], START)?;
        }
        let now_ns = self.live.now_ns();
        let to_ns = now_ns + time.as_nanos() as u64;
        let mut inputs = Inputs {
            codes: self.codes(to_ns),
            ..Inputs::default()
        };
        if !bytes.is_empty() {
            inputs.uart.push(UartInput::usart1(now_ns + GAP_NS, bytes));
        }
        let passed = self.live.advance(to_ns, inputs)?;
        if passed.ended {
            return Err(BenchError::Mute(format!(
                "the image came to its end after {:.3} s of its time",
                passed.now_ns as f64 * 1e-9
            )));
        }
        self.codes_until_ns = passed.codes_until_ns;
        self.work = passed.work;
        said.extend_from_slice(passed.usart1());
        Ok(said)
    }

    /// The codes that are needed up to a time. An image that does not sample yet may begin at once.
    fn codes(&mut self, to_ns: u64) -> Vec<[u16; 4]> {
        let from_ns = match self.codes_until_ns {
            Some(until) => until,
            None => self.live.now_ns() + self.next as u64 * self.row_ns,
        };
        let own_ns = to_ns.saturating_sub(from_ns) as f64 * self.rate;
        let count = own_ns as u64 / self.row_ns + 2;
        let rows = self.rows.iter().cycle().skip(self.next % self.rows.len());
        self.next += count as usize;
        rows.take(count as usize).copied().collect()
    }

    /// How long to wait for bytes from a program before time passes.
    fn pause(&self) -> Duration {
        match self.pace {
            Some(_) => BEAT,
            None => PAUSE,
        }
    }

    /// How much time should pass now, after bytes came in or none did.
    fn due(&self, heard: bool) -> Duration {
        match &self.pace {
            Some(pace) => pace
                .started
                .elapsed()
                .mul_f64(pace.factor)
                .saturating_sub(self.now()),
            None if heard => ANSWER,
            None => STEP,
        }
    }
}

/// Where programs connect.
pub struct Door {
    listener: Listener,
    #[expect(dead_code, reason = "a socket's path is removed when this is dropped")]
    removed: Option<Removed>,
}

enum Listener {
    Tcp(TcpListener),
    Unix(UnixListener),
}

impl Door {
    /// Listens at an address. Programs that connect wait until they are served.
    ///
    /// # Errors
    /// The address cannot be listened at.
    pub fn open(address: &Address) -> Result<Self, BenchError> {
        let cannot = |error: io::Error| {
            BenchError::Unfit(format!(
                "cannot listen at {address}: {error}; {}",
                advice(address, &error)
            ))
        };
        let (listener, removed) = match address {
            Address::Serial(path) => {
                return Err(BenchError::Unfit(format!(
                    "cannot listen at {path}; give unix:PATH or tcp:HOST:PORT"
                )));
            }
            Address::Tcp(server) => {
                let listener = TcpListener::bind(server.as_str()).map_err(cannot)?;
                listener.set_nonblocking(true).map_err(cannot)?;
                (Listener::Tcp(listener), None)
            }
            Address::Unix(path) => {
                let listener = UnixListener::bind(path).map_err(cannot)?;
                let removed = Removed(path.clone());
                listener.set_nonblocking(true).map_err(cannot)?;
                (Listener::Unix(listener), Some(removed))
            }
        };
        Ok(Self { listener, removed })
    }
}

/// What to do where an address cannot be listened at.
fn advice(address: &Address, error: &io::Error) -> String {
    match (address, error.kind()) {
        (Address::Unix(path), io::ErrorKind::AddrInUse) => {
            let is_socket = path.metadata().is_ok_and(|found| found.file_type().is_socket());
            let shown = path.display();
            match UnixStream::connect(path) {
                Ok(_) => "another program listens there; give another path".to_owned(),
                Err(_) if is_socket => {
                    format!("the program that listened there is gone; remove its socket: rm {shown}")
                }
                Err(_) => "a file is there; give another path".to_owned(),
            }
        }
        (Address::Unix(_), io::ErrorKind::NotFound) => "make its directory, or give another path".to_owned(),
        (Address::Unix(_), _) => "give another path".to_owned(),
        (_, io::ErrorKind::AddrInUse) => "another program listens there; give another port".to_owned(),
        (_, io::ErrorKind::AddrNotAvailable) => {
            "this computer has no such address; give tcp:127.0.0.1:PORT".to_owned()
        }
        (_, io::ErrorKind::PermissionDenied) => "give a port above 1023".to_owned(),
        _ => "give an address of this computer, such as tcp:127.0.0.1:4000".to_owned(),
    }
}

/// Serves the programs that connect, one after another, until `stop`.
///
/// # Errors
/// QEMU fails.
pub fn serve(bridge: &mut Bridge, door: &Door, stop: &AtomicBool) -> Result<(), BenchError> {
    let pause = bridge.pause();
    match &door.listener {
        Listener::Tcp(listener) => accept(bridge, stop, || {
            let (stream, _) = listener.accept()?;
            stream.set_nonblocking(false)?;
            stream.set_read_timeout(Some(pause))?;
            Ok(stream)
        }),
        Listener::Unix(listener) => accept(bridge, stop, || {
            let (stream, _) = listener.accept()?;
            stream.set_nonblocking(false)?;
            stream.set_read_timeout(Some(pause))?;
            Ok(stream)
        }),
    }
}

/// The path of a socket. It is removed with its listener.
struct Removed(PathBuf);

impl Drop for Removed {
    fn drop(&mut self) {
        // The file may be gone already.
        let _ = std::fs::remove_file(&self.0);
    }
}

fn accept<S: Read + Write>(
    bridge: &mut Bridge,
    stop: &AtomicBool,
    mut next: impl FnMut() -> io::Result<S>,
) -> Result<(), BenchError> {
    while !stop.load(Ordering::Relaxed) {
        match next() {
            Ok(stream) => talk(bridge, stream, stop)?,
            // No program connects, or it hung up at once. What a bead says then is lost, as on any line.
            Err(_) if bridge.pace.is_some() => {
                bridge.pass(&[], bridge.due(false))?;
                thread::sleep(BEAT);
            }
            Err(_) => thread::sleep(LOOK),
        }
    }
    Ok(())
}

/// Passes bytes both ways until the other end hangs up.
fn talk<S: Read + Write>(bridge: &mut Bridge, mut stream: S, stop: &AtomicBool) -> Result<(), BenchError> {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    let mut buffer = [0; 4096];
    while !stop.load(Ordering::Relaxed) {
        let length = match stream.read(&mut buffer) {
            Ok(0) => return Ok(()),
            Ok(length) => length,
            Err(error) if matches!(error.kind(), Interrupted | TimedOut | WouldBlock) => 0,
            Err(_) => return Ok(()),
        };
        let said = bridge.pass(&buffer[..length], bridge.due(length > 0))?;
        if stream.write_all(&said).is_err() {
            return Ok(());
        }
    }
    Ok(())
}
