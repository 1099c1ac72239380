//! Cycles that the processor would take, estimated from the instructions that it executes.
//!
//! # Design
//!
//! Four clocks run at once: memory that is always ready; flash with its accelerator, as the image runs; flash
//! without; and an upper bound, in which nothing overlaps. Each instruction takes what the core's manual
//! says ([`instruction`]), and waits for its words from flash ([`flash`]). The core fetches words of four
//! bytes, up to three ahead. A taken branch begins the fetch anew.
//!
//! These are bounds and an estimate, not a measurement: it is not documented which line of a cache is
//! evicted, how processor and DMA share a bus, and when the flash drops a fetch that a branch has made
//! useless. The upper bound leaves out such fetches and the DMA. Sleep takes no cycles here.

mod flash;
mod instruction;

use flash::{Flash, WAITS, line};
use instruction::{Instruction, Work};

use crate::memory::{FLASH, PERIPHERALS};
use crate::outcome::Cycles;

/// Cycles to enter an exception and to leave it, with the registers of the floating-point unit or without
/// (PM0214 section 2.3.7; DDI0439B section 3.9). Both are counted when it is entered.
const EXCEPTION: u64 = 12 + 10;
/// Upper bound: with those registers, an instruction of 12 cycles that is restarted, and the vector in flash.
const EXCEPTION_MOST: u64 = EXCEPTION + 2 * 17 + 12 + 1 + WAITS;
/// Wait cycles of an access to a peripheral: on AHB and a fast APB, and on a slow APB behind a DMA.
const PERIPHERAL: u64 = 3;
const PERIPHERAL_MOST: u64 = 8;
/// Most cycles to refill the pipeline after a branch.
const REFILL_MOST: u64 = 3;
/// Words that the core fetches ahead.
const AHEAD: u32 = 3;

/// Continuation of execution after an instruction.
#[derive(Clone, Copy)]
enum Flow {
    Next,
    Taken(u32),
    Interrupted(u32),
}

/// The data that an instruction accessed.
#[derive(Debug, Default)]
struct Accesses {
    count: u32,
    constants: Vec<u32>,
    peripherals: u64,
    unaligned: u64,
}

/// The core and one kind of memory.
#[derive(Debug, Default)]
struct Clock {
    /// `None` for memory that is always ready.
    flash: Option<Flash>,
    now: u64,
    /// Address of the next word to fetch, and the earliest time to request it.
    next: u32,
    from: u64,
    /// Arrival times of the last words, by the lowest bits of their number.
    came: [u64; 8],
}

impl Clock {
    fn new(flash: Option<Flash>) -> Self {
        Self {
            flash,
            next: FLASH.start,
            ..Self::default()
        }
    }

    /// Fetches the words below an address that are requested before a time.
    fn fetch(&mut self, end: u32, before: u64) {
        while self.next < end && self.from < before {
            let there = match &mut self.flash {
                Some(flash) => flash.fetch(self.next, self.from),
                None => self.from + 1,
            };
            self.came[Self::place(self.next)] = there;
            (self.next, self.from) = (self.next + 4, there);
        }
    }

    fn place(address: u32) -> usize {
        (address >> 2) as usize % 8
    }

    fn run(&mut self, it: &Instruction, cycles: u32, accesses: &Accesses, flow: Flow) {
        let end = it.address + it.bytes;
        let last = (end - 1) & !3;
        self.fetch(last + 4, u64::MAX);
        let begins = self.now.max(self.came[Self::place(last)]);
        let mut waits = PERIPHERAL * accesses.peripherals + accesses.unaligned;
        if let Some(flash) = &mut self.flash {
            for address in &accesses.constants {
                waits += flash.read(*address, begins + 1 + waits);
            }
        }
        self.now = begins + u64::from(cycles) + waits;
        self.fetch((end & !3) + 4 * AHEAD, self.now);
        let (target, refill) = match flow {
            Flow::Next => return,
            Flow::Taken(target) => (target, 1),
            Flow::Interrupted(target) => (target, EXCEPTION),
        };
        self.now += refill;
        (self.next, self.from) = (target & !3, self.now);
    }
}

/// The upper bound: caches off, and nothing overlaps.
#[derive(Debug, Default)]
struct UpperBound {
    now: u64,
    /// The line in use by instructions. A read of a constant evicts it.
    line: Option<u32>,
}

impl UpperBound {
    fn run(&mut self, it: &Instruction, cycles: u32, accesses: &Accesses, flow: Flow) {
        for address in [it.address, it.address + it.bytes - 1] {
            if self.line.replace(line(address)) != Some(line(address)) {
                self.now += WAITS;
            }
        }
        if !accesses.constants.is_empty() {
            self.line = None;
        }
        self.now += u64::from(cycles)
            + WAITS * accesses.constants.len() as u64
            + PERIPHERAL_MOST * accesses.peripherals
            + accesses.unaligned
            + match flow {
                Flow::Next => 0,
                Flow::Taken(_) => REFILL_MOST,
                Flow::Interrupted(_) => EXCEPTION_MOST,
            };
    }
}

/// An instruction, and whether an exception begins there.
#[derive(Debug)]
pub(super) struct Timed {
    instruction: Instruction,
    begins_handler: bool,
}

impl Timed {
    /// The instruction at an address. `word` is its halfword, or its two with the first in the low half.
    pub(super) fn new(address: u32, word: u32, begins_handler: bool) -> Self {
        Self {
            instruction: Instruction::decode(address, word),
            begins_handler,
        }
    }
}

/// The four clocks.
#[derive(Debug)]
pub(super) struct CycleCount {
    clocks: [Clock; 3],
    upper: UpperBound,
    /// The current instruction, and the one before.
    current: Option<Instruction>,
    before: Option<Instruction>,
    accesses: Accesses,
}

impl CycleCount {
    pub(super) fn new() -> Self {
        let memories = [None, Some(Flash::new(true)), Some(Flash::new(false))];
        Self {
            clocks: memories.map(Clock::new),
            upper: UpperBound::default(),
            current: None,
            before: None,
            accesses: Accesses::default(),
        }
    }

    /// Time of the completed instructions.
    pub(super) fn now(&self) -> Cycles {
        let [ideal, cached, uncached] = [0, 1, 2].map(|n: usize| self.clocks[n].now);
        Cycles {
            ideal,
            cached,
            uncached,
            most: self.upper.now,
        }
    }

    /// Completes the current instruction, and begins the next. Returns the time of the completed one.
    pub(super) fn executes(&mut self, next: &Timed) -> Cycles {
        let (began, address) = (self.now(), next.instruction.address);
        let Some(it) = self.current.replace(next.instruction) else {
            self.clocks.iter_mut().for_each(|clock| clock.next = address & !3);
            return Cycles::default();
        };
        let is_next = address == it.address + it.bytes;
        let flow = match (is_next, it.branches) {
            _ if next.begins_handler => Flow::Interrupted(address),
            (true, _) => Flow::Next,
            (false, true) => Flow::Taken(address),
            // An exception, or what follows a reset.
            (false, false) => Flow::Interrupted(address),
        };
        let accesses = std::mem::take(&mut self.accesses);
        let skipped = accesses.count == 0 && !matches!(it.work, Work::Core(_) | Work::Divide | Work::Barrier);
        let [probable, most] = it.cycles(self.before.as_ref(), skipped);
        for clock in &mut self.clocks {
            clock.run(&it, probable, &accesses, flow);
        }
        self.upper.run(&it, most, &accesses, flow);
        self.before = matches!(flow, Flow::Next).then_some(it);
        self.now() - began
    }

    /// Records a data access of the current instruction.
    pub(super) fn accesses(&mut self, address: u32, bytes: u32) {
        self.accesses.count += 1;
        self.accesses.unaligned += u64::from(!address.is_multiple_of(bytes));
        if FLASH.contains(&address) {
            self.accesses.constants.push(address);
        } else if PERIPHERALS.contains(&address) {
            self.accesses.peripherals += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Time of instructions in sequence, each with its word and the addresses that it accesses.
    fn straight(words: &[(u32, &[u32])]) -> Cycles {
        let (mut count, mut address) = (CycleCount::new(), FLASH.start);
        for (word, accesses) in words.iter().chain(&[(0xbf00, &[][..])]) {
            let next = Timed::new(address, *word, false);
            count.executes(&next);
            accesses.iter().for_each(|address| count.accesses(*address, 4));
            address += next.instruction.bytes;
        }
        count.now()
    }

    /// Cycles of an instruction between two that take one cycle each.
    fn alone(word: u32, accesses: &[u32]) -> [u64; 2] {
        const MOVE: (u32, &[u32]) = (0x4611, &[]);
        let [with, without] = [&[MOVE, (word, accesses), MOVE][..], &[MOVE, MOVE]].map(straight);
        [with.ideal - without.ideal, with.most - without.most]
    }

    #[test]
    fn an_access_takes_what_the_place_it_goes_to_takes() {
        let load = 0x6823; // ldr r3, [r4]
        let of = |address| alone(load, &[address]);
        assert_eq!(of(0x2000_0000), [2, 2]);
        assert_eq!(of(0x2000_0002), [3, 3], "two accesses of the bus");
        assert_eq!(of(0x4000_0000), [2 + 3, 2 + 8]);
        // Five wait states, and as many for the line of the next instruction.
        assert_eq!(of(0x0800_4000), [2, 2 + 5 + 5]);
        assert_eq!(alone(load, &[]), [1, 1], "its condition does not hold");
        // The instruction before computes the address, in r1.
        assert_eq!(alone(0x680b, &[0x2000_0000]), [3, 3]);
    }

    #[test]
    fn an_exception_takes_its_way_in_and_out_and_a_branch_to_a_handler_is_one() {
        let at = |address, word, begins_handler| Timed::new(FLASH.start + address, word, begins_handler);
        let after = |first: Timed, second: Timed| {
            let mut count = CycleCount::new();
            [first, second, at(0x82, 0xbf00, false)].iter().for_each(|next| {
                count.executes(next);
            });
            count.now().ideal
        };
        let straight = after(at(0x7e, 0xbf00, false), at(0x80, 0xbf00, false));
        let branch = after(at(0x40, 0xe01e, false), at(0x80, 0xbf00, false));
        let interrupted = after(at(0x40, 0xbf00, false), at(0x80, 0xbf00, false));
        let chained = after(at(0x40, 0x4770, false), at(0x80, 0xbf00, true));
        // The first word of a branch's target arrives a cycle after its request.
        assert_eq!(
            [branch, interrupted, chained].map(|cycles| cycles - straight),
            [2, 23, 23]
        );
    }

    /// Instructions that depend on each other by data only, which both models cover. llvm-mca
    /// -mtriple=thumbv7em-none-eabihf -mcpu=cortex-m4 counts 10 cycles a turn.
    #[test]
    fn straight_code_takes_as_long_as_llvm_says() {
        const SRAM: &[u32] = &[0x2000_0000];
        let turn: [(u32, &[u32]); 8] = [
            (0x6820, SRAM),     // ldr r0, [r4]
            (0x1941, &[]),      // adds r1, r0, r5
            (0xf205_fb01, &[]), // mul r2, r1, r5
            (0x0300_ea82, &[]), // eor.w r3, r2, r0
            (0x88a6, SRAM),     // ldrh r6, [r4, #4]
            (0x00f6, &[]),      // lsls r6, r6, #3
            (0x0703_eba6, &[]), // sub.w r7, r6, r3
            (0x60a7, SRAM),     // str r7, [r4, #8]
        ];
        let cycles = straight(&[turn; 3].concat()).ideal - straight(&[turn; 2].concat()).ideal;
        assert_eq!(cycles, 10, "two loads of two cycles and six of one");
    }
}
