//! What comes out of the machine while it runs.

use std::fs::File;
use std::io::{BufWriter, Write};

use super::count::Counters;
use super::qemu::{self, Qemu};
use crate::machine::Board;
use crate::memory::{CCM, SRAM};
use crate::outcome::Block;

/// What comes out of the machine while it runs.
pub(super) struct Recorder {
    pub(super) uart: BufWriter<File>,
    pub(super) uart_times: BufWriter<File>,
    pub(super) rtt: File,
    pub(super) counters: Option<&'static Counters>,
    /// Instructions at the end of the last block.
    pub(super) block_began: Option<u64>,
    /// The labels whose functions make a block a working one.
    pub(super) work: Vec<usize>,
    /// Instructions in those functions at that time.
    pub(super) worked: u64,
    pub(super) worst_block: Option<Block>,
    /// All working blocks together.
    pub(super) working: Option<Block>,
    /// What stood in flash before it was overwritten.
    pub(super) flash_before: Vec<(u32, Vec<u8>)>,
    /// All others together.
    pub(super) idle: Option<Block>,
}

/// The machine's outside: QEMU, and the recorder.
pub(super) struct Outside<'a>(pub(super) &'a Qemu, pub(super) &'a mut Recorder);

impl Board for Outside<'_> {
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
        match stalled {
            true => self.0.halt(),
            false => self.0.go_on(),
        }
    }

    fn lose_memory(&mut self) {
        for ram in [SRAM, CCM] {
            self.0.write_memory(ram.start, &noise(ram.len()));
        }
    }

    fn set_interrupt(&mut self, number: usize, level: bool) {
        self.0.set_interrupt(number, level);
    }

    fn sent(&mut self, byte: u8, at: u64) {
        written(self.1.uart.write_all(&[byte]));
        written(self.1.uart_times.write_all(&at.to_le_bytes()));
    }

    fn acquired(&mut self, scans: u64) {
        let Some(counters) = self.1.counters else {
            return;
        };
        let now = counters.total();
        let worked = counters.labelled(&self.1.work);
        let working = std::mem::replace(&mut self.1.worked, worked) < worked;
        // The first block after a reset has the start-up in it.
        if let Some(began) = self.1.block_began.replace(now).filter(|_| scans > 0) {
            let block = Block {
                instructions: now - began,
                scans,
            };
            let worst = self.1.worst_block.get_or_insert(block);
            if block.instructions_per_scan() > worst.instructions_per_scan() {
                *worst = block;
            }
            let all = match working {
                true => self.1.working.get_or_insert_default(),
                false => self.1.idle.get_or_insert_default(),
            };
            all.instructions += block.instructions;
            all.scans += block.scans;
        }
    }

    fn reset_wanted(&mut self) {
        self.0.halt();
        self.0.request_reset();
    }
}

/// What RAM holds after power-up: on silicon nobody knows, here the same in every run.
fn noise(bytes: usize) -> Vec<u8> {
    // Xorshift (Marsaglia 2003), its first triple.
    let mut state = 0x2545_f491_u32;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 17;
        state ^= state << 5;
        state
    };
    (0..bytes).map(|_| (next() >> 16) as u8).collect()
}

/// A disk that is full ends the run: half a record would look like a whole one.
pub(super) fn written(result: std::io::Result<()>) {
    if let Err(e) = result {
        qemu::exit(1, &format!("cannot write the run's files: {e}"));
    }
}
