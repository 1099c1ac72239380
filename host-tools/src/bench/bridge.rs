//! The image in QEMU behind an address, where programs find it as they find a bead's line.
//!
//! # Design
//! A run of the image is the same each time, byte for byte, and so is its beginning if more is asked of it later. So
//! time is made to pass by running the image anew from power-up, with all that it was sent before and a little longer than
//! the last time; what it says beyond the last time is new. The image's time passes while somebody listens, and stands
//! still otherwise. What bead and strikes do is exactly what they do in any other run.
//!
//! A run costs more the longer it is: this is for asking a bead, not for recording hours.

use std::io::{self, Read, Write};
use std::net::TcpListener;
use std::os::unix::net::UnixListener;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use stm32f405_qemu::{Run, UartInput};

use crate::bench::emulation::{Emulation, blame};
use crate::bench::front_end::SAMPLE_RATE_HZ;
use crate::cli::failure::{Blame, Failure};
use crate::line::port::Address;

/// Time in which the image has started to sample, and to hear.
const START: Duration = Duration::from_millis(50);
/// Time that passes when something came in: most is answered within it.
const ANSWER: Duration = Duration::from_millis(80);
/// Time that passes at once while somebody only listens.
const STEP: Duration = Duration::from_millis(250);
/// From the end of one run to what comes in the next.
const GAP_NS: u64 = 1_000_000;
/// Who is answered hangs up within this time, or wants more.
const PAUSE: Duration = Duration::from_millis(100);
/// How often it is looked whether somebody connects, or the end is asked for.
const LOOK: Duration = Duration::from_millis(50);

/// An image whose time passes on demand.
pub struct Bridge {
    machine: Run,
    /// Codes at the converter; they begin again where they end.
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
        // A store that is made room in takes four seconds at most.
        machine.sampling_deadline_ns = 10_000_000_000;
        Self {
            rows: std::mem::take(&mut machine.stimulus),
            machine,
            scans: 0,
            ended_ns: 0,
            said: 0,
        }
    }

    /// Lets time pass, at whose beginning `bytes` come in; gives what the bead said.
    ///
    /// # Errors
    /// QEMU fails.
    pub fn pass(&mut self, bytes: &[u8], time: Duration) -> Result<Vec<u8>, Failure> {
        if self.ended_ns == 0 && !bytes.is_empty() {
            // A bead that has not started does not hear.
            let mut said = self.pass(&[], START)?;
            said.extend(self.pass(bytes, time)?);
            return Ok(said);
        }
        if !bytes.is_empty() {
            self.machine.uart_input.push(UartInput {
                at_ns: self.ended_ns + GAP_NS,
                bytes: bytes.to_vec(),
            });
        }
        self.scans += (time.as_secs_f64() * f64::from(SAMPLE_RATE_HZ)).ceil() as usize;
        self.machine.stimulus = self.rows.iter().copied().cycle().take(self.scans).collect();
        let outcome = self.machine.execute().map_err(blame)?;
        self.ended_ns = outcome.virtual_ns;
        let new = outcome.uart.get(self.said..).unwrap_or_default().to_vec();
        self.said += new.len();
        Ok(new)
    }
}

/// Serves whoever connects to the address, one after the other, until `stop`.
///
/// # Errors
/// The address cannot be listened at, or QEMU fails.
pub fn serve(bridge: &mut Bridge, address: &Address, stop: &AtomicBool) -> Result<(), Failure> {
    let cannot = || format!("cannot listen at {address}; is something else there?");
    match address {
        Address::Serial(path) => Err(Failure::input(format!(
            "cannot listen at {path}; give unix:PATH or tcp:HOST:PORT"
        ))),
        Address::Tcp(server) => {
            let listener = TcpListener::bind(server.as_str()).or_input(cannot)?;
            listener.set_nonblocking(true).or_input(cannot)?;
            accept(bridge, stop, || {
                let (stream, _) = listener.accept()?;
                stream.set_nonblocking(false)?;
                stream.set_read_timeout(Some(PAUSE))?;
                Ok(stream)
            })
        }
        Address::Unix(path) => {
            let listener = UnixListener::bind(path).or_input(cannot)?;
            let _removed = Removed(path.clone());
            listener.set_nonblocking(true).or_input(cannot)?;
            accept(bridge, stop, || {
                let (stream, _) = listener.accept()?;
                stream.set_nonblocking(false)?;
                stream.set_read_timeout(Some(PAUSE))?;
                Ok(stream)
            })
        }
    }
}

/// A socket's path, which is there no longer than its listener.
struct Removed(PathBuf);

impl Drop for Removed {
    fn drop(&mut self) {
        // One that is gone already is gone.
        let _ = std::fs::remove_file(&self.0);
    }
}

fn accept<S: Read + Write>(
    bridge: &mut Bridge,
    stop: &AtomicBool,
    mut next: impl FnMut() -> io::Result<S>,
) -> Result<(), Failure> {
    while !stop.load(Ordering::Relaxed) {
        match next() {
            Ok(stream) => talk(bridge, stream, stop)?,
            // Nobody there, or gone again at once.
            Err(_) => thread::sleep(LOOK),
        }
    }
    Ok(())
}

/// Passes bytes both ways until the other end hangs up.
fn talk<S: Read + Write>(bridge: &mut Bridge, mut stream: S, stop: &AtomicBool) -> Result<(), Failure> {
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
