//! The image in QEMU behind an address that programs connect to as to a bead's line.
//!
//! # Design
//! The image's virtual time stands still until the bridge lets some of it pass ([`stm32f405_qemu::Live`]).
//! The same bytes at the same virtual times yield the same answers in every run. Without a pace, the
//! image's time passes as fast as it can while a program is connected, and stands still otherwise. With a
//! pace, it follows the time of this computer.

use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::net::TcpListener;
use std::os::unix::fs::FileTypeExt;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use stm32f405_qemu::{Inputs, Live, Run, StretchWork, UartInput};

use crate::emulation::Emulation;
use crate::error::BenchError;
use crate::playback::Playback;
use bead_line::port::Address;

/// Time from power-up until the image samples and receives.
const START: Duration = Duration::from_millis(50);
/// Virtual time that passes after bytes arrive, enough for the image to answer most requests.
const ANSWER: Duration = Duration::from_millis(80);
/// Step of virtual time while a program only listens, and the longest step with a pace. No program is
/// served during a step.
const STEP: Duration = Duration::from_millis(250);
/// Time from a stop to the first byte received after it, ns.
const GAP_NS: u64 = 1_000_000;
/// Time that an answered program has to hang up or send more.
const PAUSE: Duration = Duration::from_millis(100);
/// With a pace: interval between two steps of time.
const BEAT: Duration = Duration::from_millis(10);
/// With a pace: greatest delay of the image's time. Any excess is dropped: a computer that is too slow or
/// was suspended could never catch up.
const BEHIND: Duration = Duration::from_secs(1);
/// Interval between two polls for a new connection, or for a request to stop.
const IDLE: Duration = Duration::from_millis(50);
/// Interval between two polls for bytes from programs, or for room to send them some.
const POLL: Duration = Duration::from_millis(1);
/// Time-out of a program that reads nothing while others are connected.
const PATIENCE: Duration = Duration::from_secs(2);
/// With a pace: bytes that a program may leave unread before it is disconnected.
const UNREAD: usize = 1 << 20;

/// An image whose time passes on demand.
pub struct Bridge {
    live: Live,
    codes: Playback,
    /// End of the codes that the image has, in ns since power-up; `None` before it samples.
    codes_until_ns: Option<u64>,
    row_ns: u64,
    /// Seconds by the bead's crystal per true second: rows follow the crystal.
    rate: f64,
    pace: Option<Pace>,
    /// Work of the emulator in the last step of time.
    pub work: StretchWork,
}

/// Relation of an image's time to this computer's. Images that share clones of a pace run in step: all wait
/// for the slowest.
#[derive(Debug, Clone)]
pub struct Pace {
    started: Arc<Mutex<Instant>>,
    /// Seconds of an image per second of this computer.
    factor: f64,
}

impl Pace {
    /// Starts a pace of `factor` seconds of an image per second of this computer.
    pub fn new(factor: f64) -> Self {
        let started = Arc::new(Mutex::new(Instant::now()));
        Self { started, factor }
    }

    fn started(&self) -> MutexGuard<'_, Instant> {
        // A thread that panicked cannot have left a broken `Instant`.
        self.started.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Delay at an instant of an image whose time is `now`.
    fn behind(&self, now: Duration, instant: Instant) -> Duration {
        self.since(*self.started(), now, instant)
    }

    fn since(&self, started: Instant, now: Duration, instant: Instant) -> Duration {
        let passed = instant.saturating_duration_since(started);
        passed.mul_f64(self.factor).saturating_sub(now)
    }

    /// Virtual time that should pass in the next step.
    fn due(&self, now: Duration, instant: Instant) -> Duration {
        let mut started = self.started();
        let behind = self.since(*started, now, instant);
        *started += behind.saturating_sub(BEHIND).div_f64(self.factor);
        behind.min(STEP)
    }

    /// Time to wait for bytes before time passes.
    fn pause(&self, now: Duration, instant: Instant) -> Duration {
        let is_behind = self.behind(now, instant) >= STEP;
        if is_behind { Duration::ZERO } else { BEAT }
    }
}

impl Bridge {
    /// The image at power-up. With a pace, its time follows this computer's.
    ///
    /// # Errors
    /// QEMU fails.
    pub fn new(emulation: &Emulation, pace: Option<Pace>) -> Result<Self, BenchError> {
        Self::with(emulation, pace, |_| {})
    }

    /// The image at power-up, in a machine that `change` has altered.
    ///
    /// # Errors
    /// QEMU fails.
    pub fn with(
        emulation: &Emulation,
        pace: Option<Pace>,
        change: impl FnOnce(&mut Run),
    ) -> Result<Self, BenchError> {
        let mut machine = emulation.machine();
        change(&mut machine);
        machine.count_instructions = false;
        // Recorded edges would take ever more memory.
        machine.record_pins = false;
        // From stop to stop.
        machine.timeout = Duration::from_secs(120);
        machine.stimulus.clear();
        Ok(Self {
            codes: emulation.playback(),
            codes_until_ns: None,
            row_ns: machine.sample_period_ns,
            rate: 1.0 + emulation.truth.clock_ppm * 1e-6,
            live: machine.start()?,
            pace,
            work: StretchWork::default(),
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
            // A bead that has not started does not receive.
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
            let seconds = passed.now_ns as f64 * 1e-9;
            let why = format!("the image ended after {seconds:.3} s of its own time");
            return Err(BenchError::Mute(why));
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
            None => self.live.now_ns() + self.codes.taken * self.row_ns,
        };
        let own_ns = to_ns.saturating_sub(from_ns) as f64 * self.rate;
        self.codes.take(own_ns as u64 / self.row_ns + 2)
    }

    /// Time to wait for bytes from a program before time passes.
    fn pause(&self) -> Duration {
        match &self.pace {
            Some(pace) => pace.pause(self.now(), Instant::now()),
            None => PAUSE,
        }
    }

    /// Time that should pass now. `received` is true if bytes came in.
    fn due(&self, received: bool) -> Duration {
        let now = self.now();
        match &self.pace {
            Some(pace) => pace.due(now, Instant::now()),
            None if received => ANSWER,
            None => STEP,
        }
    }
}

/// An address that programs connect to.
pub enum Door {
    /// A TCP port.
    Tcp(TcpListener),
    /// A Unix socket. Dropping the door removes its path.
    Unix(UnixListener, PathBuf),
}

impl Door {
    /// Listens at an address. Programs that connect wait until they are served.
    ///
    /// # Errors
    /// Listening at the address fails.
    pub fn open(address: &Address) -> Result<Self, BenchError> {
        let cannot = |error: io::Error| {
            let advice = advice(address, &error);
            BenchError::Unfit(format!("cannot listen at {address}: {error}; {advice}"))
        };
        match address {
            Address::Serial(path) => {
                let why = format!("cannot listen at {path}; give unix:PATH or tcp:HOST:PORT");
                Err(BenchError::Unfit(why))
            }
            Address::Tcp(server) => {
                let listener = TcpListener::bind(server.as_str()).map_err(cannot)?;
                listener.set_nonblocking(true).map_err(cannot)?;
                Ok(Self::Tcp(listener))
            }
            Address::Unix(path) => {
                let listener = UnixListener::bind(path).map_err(cannot)?;
                listener.set_nonblocking(true).map_err(cannot)?;
                Ok(Self::Unix(listener, path.clone()))
            }
        }
    }

    /// Accepts the programs that wait for a connection.
    fn let_in(&self, programs: &mut Vec<Program>) {
        let accept = || -> io::Result<Box<dyn ProgramStream>> {
            match self {
                Self::Tcp(listener) => {
                    let (stream, _) = listener.accept()?;
                    stream.set_nonblocking(true)?;
                    Ok(Box::new(stream))
                }
                Self::Unix(listener, _) => {
                    let (stream, _) = listener.accept()?;
                    stream.set_nonblocking(true)?;
                    Ok(Box::new(stream))
                }
            }
        };
        // A program that hung up at once needs no service.
        while let Ok(stream) = accept() {
            programs.push(Program {
                stream,
                unread: VecDeque::new(),
                read: Instant::now(),
            });
        }
    }
}

impl Drop for Door {
    fn drop(&mut self) {
        if let Self::Unix(_, path) = self {
            // The file may be gone already.
            let _ = std::fs::remove_file(path);
        }
    }
}

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

/// Serves the programs that connect, until `stop`. They share the bead's line: each receives all that the
/// bead sends, and the bead receives from each.
///
/// # Errors
/// QEMU fails.
pub fn serve(bridge: &mut Bridge, door: &Door, stop: &AtomicBool) -> Result<(), BenchError> {
    let mut programs = Vec::new();
    while !stop.load(Ordering::Relaxed) {
        door.let_in(&mut programs);
        let received = receive(&mut programs, bridge.pause());
        if programs.is_empty() {
            // Nobody connects, or the last one hung up: without a pace time stands still.
            if bridge.pace.is_none() {
                thread::sleep(IDLE);
                continue;
            }
            thread::sleep(bridge.pause());
        }
        // Without a program, frames are lost as on any line.
        let time = bridge.due(!received.is_empty());
        let said = bridge.pass(&received, time)?;
        for program in &mut programs {
            program.unread.extend(&said);
        }
        send(&mut programs);
        if bridge.pace.is_some() {
            programs.retain(|program| program.unread.len() <= UNREAD);
            continue;
        }
        wait_for_readers(&mut programs, |programs| door.let_in(programs), stop);
    }
    Ok(())
}

struct Program {
    stream: Box<dyn ProgramStream>,
    unread: VecDeque<u8>,
    /// Instant at which the program last read something.
    read: Instant,
}

trait ProgramStream: Read + Write + Send {}

impl<S: Read + Write + Send> ProgramStream for S {}

/// Receives bytes from the programs: waits up to `longest` for some, or until no program is left.
fn receive(programs: &mut Vec<Program>, longest: Duration) -> Vec<u8> {
    let began = Instant::now();
    let mut received = Vec::new();
    let mut buffer = [0; 4096];
    loop {
        programs.retain_mut(|program| match program.stream.read(&mut buffer) {
            Ok(length) => {
                received.extend_from_slice(&buffer[..length]);
                length > 0
            }
            Err(error) => is_passing(&error),
        });
        if !received.is_empty() || programs.is_empty() || began.elapsed() >= longest {
            return received;
        }
        thread::sleep(POLL);
    }
}

/// Sends to each program as much as it takes now.
fn send(programs: &mut Vec<Program>) {
    programs.retain_mut(|program| {
        loop {
            let (unread, _) = program.unread.as_slices();
            if unread.is_empty() {
                program.read = Instant::now();
                return true;
            }
            match program.stream.write(unread) {
                Ok(0) => return false,
                Ok(length) => {
                    program.unread.drain(..length);
                    program.read = Instant::now();
                }
                Err(error) => return is_passing(&error),
            }
        }
    });
}

/// Waits until each program has read its bytes, so that a slow one loses nothing. A program that reads
/// nothing at all is disconnected, so that it does not hold up the others.
fn wait_for_readers(
    programs: &mut Vec<Program>,
    mut let_in: impl FnMut(&mut Vec<Program>),
    stop: &AtomicBool,
) {
    while programs.iter().any(|program| !program.unread.is_empty()) && !stop.load(Ordering::Relaxed) {
        thread::sleep(POLL);
        let_in(programs);
        send(programs);
        if programs.len() > 1 {
            programs.retain(|program| program.unread.is_empty() || program.read.elapsed() < PATIENCE);
        }
    }
}

/// True for an error after which the connection goes on.
fn is_passing(error: &io::Error) -> bool {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), Interrupted | TimedOut | WouldBlock)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn program(stream: UnixStream, unread: usize) -> Program {
        stream.set_nonblocking(true).unwrap();
        Program {
            stream: Box::new(stream),
            unread: vec![7; unread].into(),
            read: Instant::now(),
        }
    }

    #[test]
    fn a_pace_that_this_computer_cannot_keep_up_with_loses_time_and_not_patience() {
        let began = Instant::now();
        let ms = Duration::from_millis;
        let at = |after: u64| began + ms(after);
        let seconds = Duration::from_secs;
        let pace = Pace {
            started: Arc::new(Mutex::new(began)),
            factor: 100.0,
        };
        // A pace that the computer keeps up with loses nothing, even after a hiccup.
        assert_eq!(pace.due(seconds(0), at(1)), ms(100));
        assert_eq!(pace.due(ms(100), at(10)), STEP);
        assert_eq!(pace.pause(ms(350), at(10)), Duration::ZERO);
        assert_eq!(pace.due(ms(850), at(10)), ms(150));
        assert_eq!(pace.pause(ms(1000), at(10)), BEAT);
        assert_eq!(*pace.started(), began);
        // The image made no progress for a minute.
        assert_eq!(pace.due(seconds(1), at(60_000)), STEP);
        assert_eq!(pace.behind(seconds(1), at(60_000)), BEHIND);
        assert_eq!(pace.due(seconds(1) + BEHIND, at(60_000)), Duration::ZERO);
        assert_eq!(pace.due(seconds(1) + BEHIND, at(60_002)), ms(200));
        // A faster image waits for this one.
        assert_eq!(pace.clone().due(seconds(3), at(60_002)), Duration::ZERO);
    }

    #[test]
    fn a_slow_reader_gets_everything_and_one_that_never_reads_holds_nobody_up() {
        const BYTES: usize = 1 << 20;
        let stop = AtomicBool::new(false);
        let (stuck, _other_end) = UnixStream::pair().unwrap();
        let (slow, mut reader) = UnixStream::pair().unwrap();
        let reads = thread::spawn(move || {
            let mut piece = [0; 65_536];
            let mut total = 0;
            while total < BYTES {
                thread::sleep(Duration::from_millis(20));
                total += reader.read(&mut piece).unwrap();
            }
            (total, reader)
        });
        let mut programs = vec![program(stuck, BYTES), program(slow, BYTES)];
        let began = Instant::now();
        wait_for_readers(&mut programs, |_| {}, &stop);
        assert!(began.elapsed() >= PATIENCE);
        assert_eq!(programs.len(), 1);
        let (total, mut reader) = reads.join().unwrap();
        assert_eq!(total, BYTES);
        // The last bytes of a program arrive before it is found to have hung up.
        reader.write_all(b"last words").unwrap();
        drop(reader);
        assert_eq!(receive(&mut programs, PAUSE), b"last words");
        assert!(receive(&mut programs, PAUSE).is_empty() && programs.is_empty());
        // A single program that does not read is waited for until the end.
        let (alone, _other_end) = UnixStream::pair().unwrap();
        let mut programs = vec![program(alone, BYTES)];
        let ended = thread::scope(|scope| {
            let waits = scope.spawn(|| wait_for_readers(&mut programs, |_| {}, &stop));
            thread::sleep(PATIENCE + Duration::from_millis(300));
            let waited = !waits.is_finished();
            stop.store(true, Ordering::Relaxed);
            waited
        });
        assert!(ended);
    }
}
