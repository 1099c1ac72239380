//! Loops that wait: how they are noticed, and how they are executed without QEMU.
//!
//! # Design
//!
//! The processor may be in such a loop if it reads registers many times and writes none but those that move
//! pins alone, or if it branches for long without an access. Then, between two instructions, the interpreter
//! of [`thumb`](crate::thumb) takes over up to the next time at which an interrupt may come, and the
//! processor stands still for as long. It executes the same instructions at the same virtual times, so when
//! it takes over has no effect on the run. If it does not come far, the next try comes later.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

use super::handlers;
use super::qemu::Qemu;
use super::recorder::Outside;
use crate::machine::Machine;
use crate::memory::PERIPHERALS;
use crate::thumb::{Bus, Interpreter, Loaded, Registers};

/// The event register of WFE (ARMv7-M ARM, B1.5.18).
pub(super) static EVENT: AtomicBool = AtomicBool::new(false);

/// Reads, and branches without an access, up to a try: at first, after a good one, and at most.
const READS: [u32; 3] = [16, 2, 1 << 14];
const BLOCKS: [u32; 3] = [500, 64, 1 << 20];
/// Instructions with which a try was worth its time.
const WORTHWHILE: u64 = 1000;
/// Most instructions that are executed one by one: of a loop that reads registers, and of one that does not,
/// which QEMU executes faster unless its turns repeat.
const MOST_STEPS: [u64; 2] = [1 << 20, 2000];

/// Tells when the processor may be waiting.
pub(super) struct Watch {
    reads: AtomicU32,
    reads_to_try: AtomicU32,
    blocks: AtomicU32,
    blocks_to_try: AtomicU32,
    asked: AtomicBool,
}

pub(super) static WATCH: Watch = Watch {
    reads: AtomicU32::new(0),
    reads_to_try: AtomicU32::new(READS[0]),
    blocks: AtomicU32::new(0),
    blocks_to_try: AtomicU32::new(BLOCKS[0]),
    asked: AtomicBool::new(false),
};

impl Watch {
    /// Counts. Only the processor's thread does so.
    fn count(&self, counter: &AtomicU32, to_try: &AtomicU32) -> bool {
        let n = counter.load(Relaxed).saturating_add(1);
        counter.store(n, Relaxed);
        n >= to_try.load(Relaxed) && !self.asked.swap(true, Relaxed)
    }

    /// The processor reads a register, or moves pins. Gives whether it is time for a try.
    pub(super) fn read(&self) -> bool {
        self.blocks.store(0, Relaxed);
        self.count(&self.reads, &self.reads_to_try)
    }

    pub(super) fn written(&self) {
        self.blocks.store(0, Relaxed);
        self.reads.store(0, Relaxed);
    }

    /// A block of instructions begins.
    pub(super) fn block(&self) -> bool {
        self.count(&self.blocks, &self.blocks_to_try)
    }

    /// A try begins. Gives whether it is for reads.
    pub(super) fn take(&self) -> bool {
        self.asked.store(false, Relaxed);
        self.blocks.store(0, Relaxed);
        self.reads.swap(0, Relaxed) >= self.reads_to_try.load(Relaxed)
    }

    /// A try for reads, or for blocks, has executed instructions, so many of them one by one.
    pub(super) fn result(&self, polled: bool, instructions: u64, stepped: u64) {
        let (to_try, [first, again, most], good) = if polled {
            (&self.reads_to_try, READS, instructions >= WORTHWHILE)
        } else {
            (&self.blocks_to_try, BLOCKS, instructions > 4 * stepped)
        };
        let next = if good {
            again
        } else {
            (2 * to_try.load(Relaxed)).clamp(first, most)
        };
        to_try.store(next, Relaxed);
    }
}

/// Memory, registers and limits around the processor while the interpreter takes its place.
pub(super) struct Surroundings<'a, 'b> {
    pub(super) machine: &'a mut Machine,
    pub(super) outside: &'a mut Outside<'b>,
    pub(super) qemu: &'a Qemu,
    /// Where the image says how far it has logged: a write there is for QEMU, which then takes the log.
    pub(super) log: Option<u32>,
    /// After a block without an access, time of an access by the first instruction: QEMU may have begun that,
    /// counted it, and been about to begin it anew.
    pub(super) repeats_at: Option<u64>,
    /// Addresses at which faults and panics are noticed.
    pub(super) watched: [&'a [u32]; 2],
    /// Addresses at which an access may fault.
    pub(super) fences: Vec<Range<u64>>,
}

impl Surroundings<'_, '_> {
    fn is_fenced(&self, address: u32, bytes: u32) -> bool {
        let (first, end) = (u64::from(address), u64::from(address) + u64::from(bytes));
        self.fences
            .iter()
            .any(|fence| fence.start < end && first < fence.end)
    }
}

impl Bus for Surroundings<'_, '_> {
    fn fetch(&mut self, address: u32) -> Option<u16> {
        let watched = self.watched.iter().any(|addresses| addresses.contains(&address));
        if watched || handlers::begins_at(address) || self.is_fenced(address, 2) {
            return None;
        }
        self.qemu.peek(address, 2).map(|half| half as u16)
    }

    fn load(&mut self, address: u32, bytes: u32, now: u64) -> Option<Loaded> {
        if self.is_fenced(address, bytes) {
            return None;
        }
        if PERIPHERALS.contains(&address) || address >= PPB {
            if self.repeats_at == Some(now) {
                return None;
            }
            let read = self.machine.read_steady(address, bytes, now, self.outside)?;
            return Some(Loaded {
                value: read.value,
                holds_until: read.holds_until,
                ramp: read.ramp,
            });
        }
        let value = self.qemu.peek(address, bytes)?;
        Some(Loaded {
            value,
            holds_until: u64::MAX,
            ramp: None,
        })
    }

    fn is_memory(&self, address: u32) -> bool {
        let part = self.machine.part();
        let is_memory = part.is_ram(address, 4) || part.flash_space().contains(&address);
        is_memory && !self.is_fenced(address, 4)
    }

    fn accepts(&self, address: u32, bytes: u32) -> bool {
        if PERIPHERALS.contains(&address) {
            return bytes == 4 && self.machine.only_moves_pins(address) && !self.is_fenced(address, bytes);
        }
        let is_ram = self.machine.part().is_ram(address, bytes as usize);
        is_ram && self.log != Some(address & !3) && !self.is_fenced(address, bytes)
    }

    fn store(&mut self, address: u32, bytes: u32, value: u32, now: u64) -> bool {
        if PERIPHERALS.contains(&address) {
            return self.machine.move_pins(address, value, now, self.outside);
        }
        let mask = u32::MAX >> (32 - 8 * bytes);
        if self.qemu.peek(address, bytes) == Some(value & mask) {
            return false;
        }
        self.qemu
            .write_memory(address, &value.to_le_bytes()[..bytes as usize]);
        true
    }
}

/// First address of the processor's own peripherals.
const PPB: u32 = 0xe000_0000;

/// Instructions that the interpreter has executed, and the state after them.
pub(super) struct Executed {
    pub(super) registers: Registers,
    pub(super) now: u64,
    pub(super) instructions: u64,
    /// True if the loop has no end of itself.
    pub(super) endless: bool,
    /// Those that were executed one by one.
    pub(super) stepped: u64,
    /// Addresses of instructions, with their counts.
    pub(super) counts: Vec<(u32, u64)>,
}

/// Executes instructions that begin in a stretch of virtual time. `None` if there were none.
pub(super) fn execute(
    registers: Registers,
    time: Range<u64>,
    instruction_ns: u64,
    polled: bool,
    mut around: Surroundings<'_, '_>,
) -> Option<Executed> {
    let mut interpreter = Interpreter::new(registers, time.start, instruction_ns, &mut around);
    let stepped = interpreter.run(time.end, MOST_STEPS[usize::from(!polled)]);
    (interpreter.instructions > 0).then(|| Executed {
        registers: interpreter.registers(),
        now: interpreter.now(),
        instructions: interpreter.instructions,
        endless: interpreter.endless,
        stepped,
        counts: interpreter.executed().collect(),
    })
}
