//! Detects loops that wait, and executes them without QEMU.
//!
//! # Design
//!
//! The processor may be in such a loop if it reads registers many times and writes only those that just move
//! pins, if it branches for long without an access, or if it enters one handler again and again and no other
//! in between, as the handler's interrupt may stay up. Then, between two instructions, the interpreter of
//! [`thumb`](crate::thumb) takes over until an interrupt may come, and the processor stands still meanwhile.
//! The interpreter executes the same instructions at the same virtual times, so the moment at which it takes
//! over has no effect on the run. If a try executes few instructions, the next one comes later.
//!
//! A handler that is left and entered again is interpreted only from its entry, and past a write of BASEPRI
//! only if the register's value is known. QEMU does not provide that value. So the interpreter hands back
//! before the return or the write, and takes over right after it ([`Watch::follow`]), when the value is
//! known.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, AtomicUsize, Ordering::Relaxed};

use super::handlers;
use super::priorities::{self, FIRST_LINE};
use super::qemu::{Qemu, WAITS_AT};
use super::recorder::Outside;
use crate::machine::{INTERRUPTS, Machine};
use crate::memory::PERIPHERALS;
use crate::thumb::{Bus, HandBack, Interpreter, Loaded, Registers, Stored};

/// The event register of WFE (ARMv7-M ARM, B1.5.18).
pub(super) static EVENT: AtomicBool = AtomicBool::new(false);

/// Reads, branches without an access, and entries to one handler before a try: the first one, one after a
/// success, and the most.
const READS: [u32; 3] = [16, 2, 1 << 14];
const BLOCKS: [u32; 3] = [500, 64, 1 << 20];
const ENTRIES: [u32; 3] = [16, 2, 1 << 14];
/// Most tries in a row: before two writes of BASEPRI, a return, and an entry.
const FOLLOWED: u32 = 6;
/// Words of memory that are compared at the end of a turn.
const MOST_KEPT: usize = 64;
/// Instructions that make a try worthwhile.
const WORTHWHILE: u64 = 1000;
/// Most instructions that are executed one by one: of a loop that reads registers; of one that does not,
/// which QEMU executes faster unless its turns repeat; and of a handler.
const MOST_STEPS: [u64; 3] = [1 << 20, 2000, 1 << 20];

/// Reason of a try.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reason {
    Reads,
    Blocks,
    /// A handler that is entered again and again, or the code after an instruction that was handed back.
    Entries,
}

/// Detects when the processor may be waiting.
pub(super) struct Watch {
    reads: AtomicU32,
    reads_to_try: AtomicU32,
    blocks: AtomicU32,
    blocks_to_try: AtomicU32,
    entries: AtomicU32,
    entries_to_try: AtomicU32,
    /// The handler that was entered last, by the address of its count.
    handler: AtomicUsize,
    /// True if a try is due for a handler.
    in_handler: AtomicBool,
    /// True if a try is due after the next block.
    follows: AtomicBool,
    followed: AtomicU32,
    asked: AtomicBool,
}

pub(super) static WATCH: Watch = Watch {
    reads: AtomicU32::new(0),
    reads_to_try: AtomicU32::new(READS[0]),
    blocks: AtomicU32::new(0),
    blocks_to_try: AtomicU32::new(BLOCKS[0]),
    entries: AtomicU32::new(0),
    entries_to_try: AtomicU32::new(ENTRIES[0]),
    handler: AtomicUsize::new(0),
    in_handler: AtomicBool::new(false),
    follows: AtomicBool::new(false),
    followed: AtomicU32::new(0),
    asked: AtomicBool::new(false),
};

impl Watch {
    /// Increments a counter. Returns `true` if a try is due. Only the processor's thread may call this.
    fn count(&self, counter: &AtomicU32, to_try: &AtomicU32) -> bool {
        let n = counter.load(Relaxed).saturating_add(1);
        counter.store(n, Relaxed);
        n >= to_try.load(Relaxed) && !self.asked.swap(true, Relaxed)
    }

    /// Counts a read of a register, or a write that moves pins. Returns `true` if a try is due.
    pub(super) fn read(&self) -> bool {
        self.blocks.store(0, Relaxed);
        self.count(&self.reads, &self.reads_to_try)
    }

    pub(super) fn written(&self) {
        self.blocks.store(0, Relaxed);
        self.reads.store(0, Relaxed);
    }

    /// Counts a block of instructions. Returns `true` if a try is due.
    pub(super) fn block(&self, start: u32) -> bool {
        if self.follows.load(Relaxed) && start != WAITS_AT {
            self.follows.store(false, Relaxed);
            BASE_PRIORITY.block(start);
            self.in_handler.store(true, Relaxed);
            return !self.asked.swap(true, Relaxed);
        }
        self.count(&self.blocks, &self.blocks_to_try)
    }

    /// Counts an entry to a handler, given by the address of its count. Returns `true` if a try is due.
    pub(super) fn entry(&self, handler: usize) -> bool {
        if self.handler.swap(handler, Relaxed) != handler {
            self.entries.store(0, Relaxed);
        }
        let due = self.count(&self.entries, &self.entries_to_try);
        if due {
            self.in_handler.store(true, Relaxed);
        }
        due
    }

    /// Requests a try after the next block. Returns `false` if there were too many in a row.
    fn follow(&self) -> bool {
        let n = self.followed.load(Relaxed) + 1;
        self.followed.store(n, Relaxed);
        let follows = n <= FOLLOWED;
        self.follows.store(follows, Relaxed);
        follows
    }

    /// Begins a try. Returns its reason.
    pub(super) fn take(&self) -> Reason {
        self.asked.store(false, Relaxed);
        self.follows.store(false, Relaxed);
        self.blocks.store(0, Relaxed);
        self.entries.store(0, Relaxed);
        let polled = self.reads.swap(0, Relaxed) >= self.reads_to_try.load(Relaxed);
        match (self.in_handler.swap(false, Relaxed), polled) {
            (true, _) => Reason::Entries,
            (false, true) => Reason::Reads,
            (false, false) => Reason::Blocks,
        }
    }

    /// Ends a try that could not be made.
    pub(super) fn in_vain(&self, reason: Reason) {
        self.result(reason, false);
    }

    /// Ends a try that has executed instructions.
    pub(super) fn executed(&self, reason: Reason, executed: &Executed) {
        let follows = match executed.hands_back {
            Some(HandBack::BasePriority(value)) => {
                BASE_PRIORITY.expect(executed.registers.r[15], value);
                self.follow()
            }
            Some(HandBack::Return) => self.follow(),
            None => executed.refused_begun && reason == Reason::Entries && self.follow(),
        };
        let worthwhile = executed.instructions >= WORTHWHILE;
        if !follows || worthwhile {
            let good = match reason {
                Reason::Reads => worthwhile,
                Reason::Blocks => executed.instructions > 4 * executed.stepped,
                // QEMU may execute a long handler faster.
                Reason::Entries => worthwhile && executed.entered_again,
            };
            self.result(reason, good);
        }
    }

    /// Sets the count at which the next try is due.
    fn result(&self, reason: Reason, good: bool) {
        let (to_try, [first, again, most]) = match reason {
            Reason::Reads => (&self.reads_to_try, READS),
            Reason::Blocks => (&self.blocks_to_try, BLOCKS),
            Reason::Entries => (&self.entries_to_try, ENTRIES),
        };
        self.followed.store(0, Relaxed);
        let next = if good {
            again
        } else {
            (2 * to_try.load(Relaxed)).clamp(first, most)
        };
        to_try.store(next, Relaxed);
    }
}

/// Value of BASEPRI, if known. Only the processor's thread uses it.
pub(super) struct BasePriority {
    known: AtomicU64,
    /// Address of the next instruction and the value that it writes.
    expected: AtomicU64,
}

pub(super) static BASE_PRIORITY: BasePriority = BasePriority {
    known: AtomicU64::new(UNKNOWN),
    expected: AtomicU64::new(UNKNOWN),
};

/// Marks an unknown value of BASEPRI, and the absence of an expected write.
const UNKNOWN: u64 = u64::MAX;

impl BasePriority {
    /// Expects QEMU to execute a write of this value next. Expects none where a handler begins, since an
    /// instruction there may be executed for another reason.
    fn expect(&self, address: u32, value: u32) {
        if !handlers::begins_at(address) {
            let expected = u64::from(address) << 32 | u64::from(value & 0xff);
            self.expected.store(expected, Relaxed);
        }
    }

    /// Drops the expected write unless the block begins with it: only then is it executed with that value.
    fn block(&self, start: u32) {
        if self.expected.load(Relaxed) >> 32 != u64::from(start) {
            self.expected.store(UNKNOWN, Relaxed);
        }
    }

    /// Records a write of BASEPRI by QEMU: its value is known if the write was expected.
    pub(super) fn written(&self, address: u32) {
        let expected = self.expected.swap(UNKNOWN, Relaxed);
        let is_expected = expected >> 32 == u64::from(address);
        let known = if is_expected { expected & 0xff } else { UNKNOWN };
        self.known.store(known, Relaxed);
    }

    /// Forgets the value after a reset of the processor.
    pub(super) fn forget(&self) {
        self.known.store(UNKNOWN, Relaxed);
        self.expected.store(UNKNOWN, Relaxed);
    }

    fn is(&self, value: u32) -> bool {
        self.known.load(Relaxed) == u64::from(value & 0xff)
    }
}

/// Memory, registers and limits around the processor while the interpreter takes its place.
pub(super) struct Surroundings<'a, 'b> {
    pub(super) machine: &'a mut Machine,
    pub(super) outside: &'a mut Outside<'b>,
    pub(super) qemu: &'a Qemu,
    /// Address of the log's write offset: a write there is left to QEMU, which then takes the log.
    pub(super) log: Option<u32>,
    /// Time of an access by the first instruction of a try that follows a block without an access: QEMU may
    /// have begun that access, counted it, and been about to begin it anew.
    pub(super) repeats_at: Option<u64>,
    /// True if an access at that time was refused.
    pub(super) refused_begun: bool,
    /// Addresses at which faults and panics are noticed.
    pub(super) watched: [&'a [u32]; 2],
    /// Addresses at which an access may fault.
    pub(super) fences: Vec<Range<u64>>,
    /// Address of the table of vectors.
    pub(super) vectors: u32,
    /// True if a handler is about to begin.
    pub(super) at_entry: bool,
    /// Time before an interrupt that is left to QEMU, ns.
    pub(super) margin_ns: u64,
    pub(super) kept: KeptWords,
}

/// Words of memory with their contents before the first change.
#[derive(Debug, Default)]
pub(super) struct KeptWords {
    words: Vec<(u32, u32)>,
    /// True if the words did not fit, or if something other than words has changed.
    incomplete: bool,
}

impl KeptWords {
    /// Keeps a word that is about to change. Returns `false` if that is not possible.
    fn keep(&mut self, address: u32, value: u32) -> bool {
        if self.incomplete || self.words.iter().any(|(kept, _)| *kept == address) {
            return !self.incomplete;
        }
        self.incomplete = self.words.len() == MOST_KEPT;
        if !self.incomplete {
            self.words.push((address, value));
        }
        !self.incomplete
    }
}

impl Surroundings<'_, '_> {
    /// First address of the handler of an exception.
    fn handler(&self, exception: u32) -> Option<u32> {
        let vector = self.vectors.checked_add(4 * exception)?;
        let handler = self.qemu.peek(vector, 4)?;
        (handler & 1 == 1).then_some(handler & !1)
    }

    /// The link register if a handler is about to begin.
    pub(super) fn entered_with(&self, registers: &Registers) -> Option<u32> {
        let link = registers.r[14];
        let begins = self.at_entry
            && registers.exception() >= FIRST_LINE
            && link >= LOWEST_RETURN
            && self.handler(registers.exception()) == Some(registers.r[15]);
        begins.then_some(link)
    }

    /// Returns `true` if QEMU may have begun an access at this time.
    fn is_begun(&mut self, now: u64) -> bool {
        let is_begun = self.repeats_at == Some(now);
        self.refused_begun |= is_begun;
        is_begun
    }

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
        // QEMU counts entries where a handler begins. Those that the interpreter makes are known.
        let begins =
            handlers::begins_at(address) && !(self.at_entry && handlers::count_at(address).is_some());
        if watched || begins || self.is_fenced(address, 2) {
            return None;
        }
        self.qemu.peek(address, 2).map(|half| half as u16)
    }

    fn load(&mut self, address: u32, bytes: u32, now: u64) -> Option<Loaded> {
        if self.is_fenced(address, bytes) {
            return None;
        }
        if PERIPHERALS.contains(&address) || address >= PPB {
            if self.is_begun(now) {
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

    fn accepts(&self, address: u32, bytes: u32, now: u64) -> bool {
        if PERIPHERALS.contains(&address) {
            let is_begun = self.repeats_at == Some(now);
            return bytes == 4
                && !is_begun
                && self.machine.only_moves_pins(address)
                && !self.is_fenced(address, bytes);
        }
        let is_ram = self.machine.part().is_ram(address, bytes as usize);
        is_ram && self.log != Some(address & !3) && !self.is_fenced(address, bytes)
    }

    fn store(&mut self, address: u32, bytes: u32, value: u32, now: u64) -> Stored {
        if PERIPHERALS.contains(&address) {
            let changed = self.machine.move_pins(address, value, now, self.outside);
            return Stored {
                changed,
                ..Stored::QUIETLY
            };
        }
        let mask = u32::MAX >> (32 - 8 * bytes);
        if self.qemu.peek(address, bytes) == Some(value & mask) {
            return Stored::QUIETLY;
        }
        let word = address & !3;
        let before = self.qemu.peek(word, 4);
        let is_kept = before.is_some_and(|before| self.kept.keep(word, before));
        self.qemu
            .write_memory(address, &value.to_le_bytes()[..bytes as usize]);
        Stored {
            changed: !is_kept,
            ..Stored::QUIETLY
        }
    }

    fn write_register(
        &mut self,
        (address, bytes): (u32, u32),
        value: u32,
        now: u64,
        exception: u32,
    ) -> Option<Stored> {
        let is_register = PERIPHERALS.contains(&address) && bytes == 4 && address & 3 == 0;
        if !is_register || self.is_begun(now) || self.is_fenced(address, bytes) {
            return None;
        }
        let (qemu, mut pends) = (self.qemu, false);
        // A line that rises now has no effect while it waits for this handler to end.
        let may_rise = |line: usize| {
            pends |= !priorities::is_pending(line, qemu);
            let number = line as u32 + FIRST_LINE;
            !priorities::is_enabled(line, qemu) || !priorities::may_preempt(number, exception, qemu)
        };
        let written = self
            .machine
            .write_steady(address, value, now, self.outside, may_rise)?;
        self.kept.incomplete |= pends;
        let limit = written.next_interrupt.map(|at| at.saturating_sub(self.margin_ns));
        Some(Stored {
            changed: false,
            holds_until: written.holds_until,
            limit: limit.unwrap_or(u64::MAX),
        })
    }

    fn keep(&mut self) {
        self.kept = KeptWords::default();
        self.machine.keep_registers();
    }

    fn is_as_kept(&self) -> bool {
        let is_as_before = |(address, value): &(u32, u32)| self.qemu.peek(*address, 4) == Some(*value);
        let words = &self.kept;
        !words.incomplete && words.words.iter().all(is_as_before) && self.machine.are_registers_as_kept()
    }

    fn enters_again(&self, exception: u32) -> Option<u32> {
        let line = exception.checked_sub(FIRST_LINE)? as usize;
        let comes_again = line < INTERRUPTS && self.machine.is_line_up(line);
        if !comes_again || !priorities::comes_first(exception, self.qemu) {
            return None;
        }
        self.handler(exception)
    }

    fn keeps_base_priority(&self, value: u32) -> bool {
        BASE_PRIORITY.is(value)
    }
}

/// The lowest EXC_RETURN (B1.5.8).
const LOWEST_RETURN: u32 = 0xffff_ffe1;

/// First address of the processor's own peripherals.
const PPB: u32 = 0xe000_0000;

/// Instructions that the interpreter has executed, and the state after them.
pub(super) struct Executed {
    pub(super) registers: Registers,
    pub(super) now: u64,
    pub(super) instructions: u64,
    /// True if the loop cannot end by itself.
    pub(super) endless: bool,
    /// Instruction handed back to QEMU, if the interpreter may continue after it.
    pub(super) hands_back: Option<HandBack>,
    /// True if a handler was left and entered again.
    entered_again: bool,
    /// True if execution ended at an access that QEMU may have begun.
    pub(super) refused_begun: bool,
    /// Instructions that were executed one by one.
    pub(super) stepped: u64,
    /// Addresses of instructions, with their counts.
    pub(super) counts: Vec<(u32, u64)>,
}

/// Executes instructions that begin in a stretch of virtual time.
pub(super) fn execute(
    registers: Registers,
    time: Range<u64>,
    instruction_ns: u64,
    reason: Reason,
    mut around: Surroundings<'_, '_>,
) -> Executed {
    let entered_with = around.entered_with(&registers);
    around.at_entry = entered_with.is_some();
    let mut interpreter = Interpreter::new(registers, time.start, instruction_ns, entered_with, &mut around);
    let stepped = interpreter.run(time.end, MOST_STEPS[reason as usize]);
    let mut executed = Executed {
        registers: interpreter.registers(),
        now: interpreter.now(),
        instructions: interpreter.instructions,
        endless: interpreter.endless,
        hands_back: interpreter.hands_back,
        entered_again: interpreter.entered_again(),
        stepped,
        refused_begun: false,
        counts: interpreter.executed().collect(),
    };
    executed.refused_begun = around.refused_begun;
    executed
}
