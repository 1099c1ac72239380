//! Recorder of the machine's output while it runs.

use std::fs::File;
use std::io::{BufReader, BufWriter, Write};
use std::os::unix::net::UnixStream;
use std::path::Path;

use super::blocks::Blocks;
use super::qemu::{self, Qemu};
use super::stops::Stops;
use crate::device::{BusAnswer, BusCall};
use crate::exchange::{self, Reached};
use crate::machine::{Exterior, USARTS};

/// Most bytes of the log that are kept for a run, or from stop to stop of a live run. An image that only
/// moves the offsets of its log produces gigabytes per second.
const MOST_LOG: usize = 64 << 20;

/// The room that is left for the log.
struct LogRoom {
    left: usize,
    /// Bytes that did not fit.
    lost: u64,
}

impl LogRoom {
    /// Returns the bytes that fit.
    fn take<'a>(&mut self, log: &'a [u8]) -> &'a [u8] {
        let (kept, lost) = log.split_at(log.len().min(self.left));
        self.left -= kept.len();
        self.lost += lost.len() as u64;
        kept
    }
}

/// Recorder of the machine's output while it runs.
pub(super) struct RunRecorder {
    sent: Vec<BufWriter<File>>,
    rtt: File,
    log_room: LogRoom,
    /// For a live run: output is kept here until the next stop instead of in files.
    pub(super) stops: Option<Stops>,
    /// `None` unless instructions are counted.
    pub(super) blocks: Option<Blocks>,
    /// The host's devices, if it has any.
    pub(super) devices: Option<UnixStream>,
    /// Original contents of overwritten flash.
    flash_before: Vec<(u32, Vec<u8>)>,
}

impl RunRecorder {
    /// Creates the files of the run.
    ///
    /// # Errors
    /// One line: which file cannot be created.
    pub(super) fn new(folder: &Path, blocks: Option<Blocks>, stops: Option<Stops>) -> Result<Self, String> {
        let create = |name: &str| {
            let odd = |e: std::io::Error| format!("run directory {}: {name}: {e}", folder.display());
            File::create(folder.join(name)).map_err(odd)
        };
        let sent = (0..USARTS.len()).map(|usart| Ok(BufWriter::new(create(&exchange::sent(usart))?)));
        Ok(Self {
            sent: sent.collect::<Result<_, String>>()?,
            rtt: create(exchange::RTT)?,
            log_room: LogRoom {
                left: MOST_LOG,
                lost: 0,
            },
            stops,
            blocks,
            devices: None,
            flash_before: Vec::new(),
        })
    }

    pub(super) fn called(&mut self) {
        if let Some(stops) = &mut self.stops {
            stops.calls += 1;
        }
    }

    /// Writes the output so far to the files. In a live run, keeps the log for the next stop instead.
    pub(super) fn flush(&mut self, log: &[u8]) {
        let log = self.log_room.take(log);
        if let Some(stops) = &mut self.stops {
            stops.log.extend(log);
            return;
        }
        written(self.rtt.write_all(log));
        for sent in &mut self.sent {
            written(sent.flush());
        }
    }

    /// In a live run, sends the host the output since the last stop.
    pub(super) fn tell(&mut self, reached: Reached) {
        if let Some(stops) = &mut self.stops {
            stops.tell(reached);
            self.log_room.left = MOST_LOG;
        }
    }

    /// Returns a line with the number of log bytes that were not kept, if any.
    pub(super) fn lost_log(&self) -> Option<String> {
        let LogRoom { lost, .. } = self.log_room;
        (lost > 0).then(|| format!("RTT the log is longer than {MOST_LOG} bytes: {lost} more are not kept"))
    }

    /// Restores the overwritten contents of flash.
    pub(super) fn restore_flash(&mut self, qemu: &Qemu) {
        while let Some((address, bytes)) = self.flash_before.pop() {
            qemu.poke(address, &bytes);
        }
    }
}

/// The machine's outside: QEMU and the recorder.
pub(super) struct Outside<'a>(pub(super) &'a Qemu, pub(super) &'a mut RunRecorder);

impl Exterior for Outside<'_> {
    fn read_memory(&mut self, address: u32, bytes: &mut [u8]) {
        self.0.read_memory(address, bytes);
    }

    fn write_memory(&mut self, address: u32, bytes: &[u8]) {
        self.0.write_memory(address, bytes);
    }

    fn overwrite_flash(&mut self, address: u32, bytes: &[u8]) {
        let mut before = vec![0; bytes.len()];
        self.0.read_memory(address, &mut before);
        self.1.flash_before.push((address, before));
        self.0.poke(address, bytes);
    }

    fn flash_changed(&mut self, address: u32, bytes: &[u8]) {
        self.0.poke(address, bytes);
    }

    fn stall(&mut self, stalled: bool) {
        self.0.stall(stalled);
    }

    fn lose_memory(&mut self) {
        for (start, bytes) in self.0.ram() {
            self.0.write_memory(start, &noise(bytes as usize));
        }
    }

    fn set_interrupt(&mut self, number: usize, level: bool) {
        self.0.set_interrupt(number, level);
    }

    fn sent(&mut self, usart: usize, data: u16, at: u64) {
        let (at, data) = (at.to_le_bytes(), data.to_le_bytes());
        let recorder = &mut *self.1;
        if let Some(stops) = &mut recorder.stops {
            stops.sent[usart].extend(at.into_iter().chain(data));
            return;
        }
        let file = &mut recorder.sent[usart];
        written(file.write_all(&at));
        written(file.write_all(&data));
    }

    fn ask(&mut self, call: BusCall) -> BusAnswer {
        let Some(devices) = &self.1.devices else {
            return BusAnswer::default();
        };
        let answer = exchange::write_message(&mut BufWriter::new(devices), &call, &[])
            .and_then(|()| exchange::read_message(&mut BufReader::new(devices)));
        match answer {
            Ok((answer, _)) => answer,
            Err(error) => qemu::exit(1, &format!("a device does not answer: {error}")),
        }
    }

    fn acquired(&mut self, scans: u64) {
        if let Some(blocks) = &mut self.1.blocks {
            blocks.end(scans);
        }
    }

    fn reset_wanted(&mut self) {
        self.0.stall(true);
        self.0.request_reset();
    }
}

/// Contents of RAM after power-up. On silicon they are unknown; here they are equal in every run.
fn noise(bytes: usize) -> Vec<u8> {
    // Xorshift (Marsaglia 2003), with its first triple.
    let mut state = 0x2545_f491_u32;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        state
    };
    (0..bytes).map(|_| (next() >> 16) as u8).collect()
}

/// Ends the run if a write failed: half a record would look like a whole one.
pub(super) fn written(result: std::io::Result<()>) {
    if let Err(e) = result {
        qemu::exit(1, &format!("cannot write the run's files: {e}"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_beyond_its_room_is_only_counted() {
        let mut room = LogRoom { left: 5, lost: 0 };
        let kept = [&b"abc"[..], b"def", b"ghi"].map(|log| room.take(log));
        assert_eq!(kept, [&b"abc"[..], b"de", b""]);
        assert_eq!((room.left, room.lost), (0, 4));
    }
}
