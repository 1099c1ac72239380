//! The image in QEMU behind an address: programs reach it as they reach a bead's line.
//!
//! # Design
//! Every run of the image is the same, byte for byte, and a longer run begins as a shorter one does. To let
//! time pass, the bridge therefore runs the image again from power-up, sends it all that it was sent before,
//! and stops a little later than last time. What the image says after the end of the last run is new. The
//! image's time passes while a program is connected and stands still otherwise. Bead and strikes do exactly
//! what they do in any other run.
//!
//! A longer run costs more: the bridge is for requests to a bead, not for hours of recording.

use std::io::{self, Read, Write};
use std::net::TcpListener;
use std::os::unix::net::UnixListener;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use stm32f405_qemu::{Run, UartInput};

use crate::bench::emulation::Emulation;
use crate::bench::error::BenchError;
use crate::bench::front_end::SAMPLE_RATE_HZ;
use crate::line::port::Address;

/// After this time the image samples and hears.
const START: Duration = Duration::from_millis(50);
/// Time that passes after bytes came in. Most requests are answered within it.
const ANSWER: Duration = Duration::from_millis(80);
/// Time that passes in one run while a program only listens.
const STEP: Duration = Duration::from_millis(250);
/// From the end of one run to the first byte that comes in after it.
const GAP_NS: u64 = 1_000_000;
/// A program that was answered hangs up within this time, or sends more.
const PAUSE: Duration = Duration::from_millis(100);
/// Between two looks for a new connection, or for a request to stop.
const LOOK: Duration = Duration::from_millis(50);

/// An image whose time passes on demand.
pub struct Bridge {
    machine: Run,
    /// Codes at the converter. The first follows the last.
    rows: Vec<[u16; 4]>,
    scans: usize,
    ended_ns: u64,
    said: usize,
}

impl Bridge {
    /// The image at power-up.
    pub fn new(emulation: &Emulation) -> Self {
        let mut machine = emulation.machine();
        machine.count_instructions = false;
        // Making room in the store takes four seconds at most.
        machine.sampling_deadline_ns = 10_000_000_000;
        Self {
            rows: std::mem::take(&mut machine.stimulus),
            machine,
            scans: 0,
            ended_ns: 0,
            said: 0,
        }
    }

    /// Sends `bytes`, lets time pass, and returns what the bead said.
    ///
    /// # Errors
    /// QEMU fails.
    pub fn pass(&mut self, bytes: &[u8], time: Duration) -> Result<Vec<u8>, BenchError> {
        if self.ended_ns == 0 && !bytes.is_empty() {
            // A bead that has not started does not hear.
            let mut said = self.pass(&[], START)?;
            said.extend(self.pass(bytes, time)?);
            return Ok(said);
        }
        if !bytes.is_empty() {
            self.machine
                .uart_input
                .push(UartInput::usart1(self.ended_ns + GAP_NS, bytes));
        }
        self.scans += (time.as_secs_f64() * f64::from(SAMPLE_RATE_HZ)).ceil() as usize;
        self.machine.stimulus = self.rows.iter().copied().cycle().take(self.scans).collect();
        let outcome = self.machine.execute()?;
        self.ended_ns = outcome.virtual_ns;
        let new = outcome.uart.get(self.said..).unwrap_or_default().to_vec();
        self.said += new.len();
        Ok(new)
    }
}

/// Serves the programs that connect to the address, one after another, until `stop`. Calls `ready` when they
/// can.
///
/// # Errors
/// The address cannot be listened at, or QEMU fails.
pub fn serve(
    bridge: &mut Bridge,
    address: &Address,
    ready: impl FnOnce(),
    stop: &AtomicBool,
) -> Result<(), BenchError> {
    let cannot = |error| {
        let what = format!("cannot listen at {address}; is something else there?");
        BenchError::unfit(&what, error)
    };
    match address {
        Address::Serial(path) => Err(BenchError::Unfit(format!(
            "cannot listen at {path}; give unix:PATH or tcp:HOST:PORT"
        ))),
        Address::Tcp(server) => {
            let listener = TcpListener::bind(server.as_str()).map_err(cannot)?;
            listener.set_nonblocking(true).map_err(cannot)?;
            ready();
            accept(bridge, stop, || {
                let (stream, _) = listener.accept()?;
                stream.set_nonblocking(false)?;
                stream.set_read_timeout(Some(PAUSE))?;
                Ok(stream)
            })
        }
        Address::Unix(path) => {
            let listener = UnixListener::bind(path).map_err(cannot)?;
            let _removed = Removed(path.clone());
            listener.set_nonblocking(true).map_err(cannot)?;
            ready();
            accept(bridge, stop, || {
                let (stream, _) = listener.accept()?;
                stream.set_nonblocking(false)?;
                stream.set_read_timeout(Some(PAUSE))?;
                Ok(stream)
            })
        }
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
            // No program connects, or it hung up at once.
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
        let time = if length > 0 { ANSWER } else { STEP };
        let said = bridge.pass(&buffer[..length], time)?;
        if stream.write_all(&said).is_err() {
            return Ok(());
        }
    }
    Ok(())
}
