//! Execution of instructions, one after the other, and of turns that repeat at once.

use super::bus::Bus;
use super::code::Code;
use super::processor::{HandBack, Processor, Step};
use super::registers::{LR, PC, Registers};
use super::trace::Trace;

/// Turns before the first trace, and from there to the second.
const FIRST_TRACE: [u32; 2] = [4, 16];
/// Most turns from a trace in vain to the next.
const LAST_TRACE: u32 = 1 << 14;
/// Most instructions in a traced turn.
const LONGEST_TURN: u64 = 64;
/// Turns that are executed one by one after others were counted.
const EXECUTED: u64 = 2;
/// Least number of turns whose counting saves more than the trace costs.
const WORTHWHILE: u64 = 8;

/// A processor in a loop.
pub(crate) struct Interpreter<'a, B> {
    processor: Processor<'a, B>,
    code: Code,
    /// Executed instructions.
    pub(crate) instructions: u64,
    /// True if the turns counted last would repeat without end.
    pub(crate) endless: bool,
    /// Instruction for QEMU at which the last run ended, if the interpreter may go on after it.
    pub(crate) hands_back: Option<HandBack>,
    /// Turns to the next trace, and from there to the following one if the next is in vain.
    turns_to_trace: [u32; 2],
}

impl<'a, B: Bus> Interpreter<'a, B> {
    /// Returns `true` if a handler was left and entered again.
    pub(crate) fn entered_again(&self) -> bool {
        self.processor.entered_again
    }

    /// Begins at `now`. `entered_with` is the link register if a handler is about to begin.
    pub(crate) fn new(
        registers: Registers,
        now: u64,
        instruction_ns: u64,
        entered_with: Option<u32>,
        bus: &'a mut B,
    ) -> Self {
        Self {
            processor: Processor::new(registers, now, instruction_ns, entered_with, bus),
            code: Code::new(),
            instructions: 0,
            endless: false,
            hands_back: None,
            turns_to_trace: FIRST_TRACE,
        }
    }

    /// The registers after the last instruction.
    pub(crate) fn registers(&self) -> Registers {
        self.processor.registers
    }

    /// The time after the last instruction, ns.
    pub(crate) fn now(&self) -> u64 {
        self.processor.now
    }

    /// Executes at most `most` instructions that begin before `until`, and returns their number. Repeated
    /// turns are counted at once and are not included.
    pub(crate) fn run(&mut self, until: u64, most: u64) -> u64 {
        let mut stepped = 0;
        self.processor.limit = until;
        self.hands_back = None;
        while self.processor.now < self.processor.limit && stepped < most {
            stepped += 1;
            let pc = self.processor.registers.r[PC];
            if self.code.at(pc).at != pc && self.fetch(pc).is_none() {
                break;
            }
            self.processor.refused = None;
            if !self.step(pc) {
                self.hands_back = self.processor.refused;
                break;
            }
            if self.processor.registers.r[PC] <= pc && !self.repeat() && self.is_trace_due() {
                self.leap(most - stepped);
            }
        }
        stepped
    }

    fn fetch(&mut self, pc: u32) -> Option<()> {
        self.code.fetch(pc, |address| self.processor.fetch(address))
    }

    /// Executes the instruction at an address, which was fetched. Returns `false` if it is for QEMU.
    #[inline(always)]
    fn step(&mut self, pc: u32) -> bool {
        let fetched = self.code.at(pc);
        let next = fetched.next;
        let Some(instruction) = &fetched.instruction else {
            return false;
        };
        let Some(step) = self.processor.execute(instruction, next, &self.code) else {
            return false;
        };
        self.code.count(pc);
        self.instructions += 1;
        self.processor.registers.r[PC] = match step {
            Step::Next => next,
            Step::Jump(to) => to,
            Step::Again(handler, link) => {
                self.processor.registers.r[LR] = link;
                self.processor.entered_again = true;
                handler
            }
        };
        true
    }

    /// Addresses of executed instructions, with their counts.
    pub(crate) fn executed(&self) -> impl Iterator<Item = (u32, u64)> {
        self.code.executed()
    }

    /// Counts the turns that repeat after a branch backwards. Returns `true` if this one does.
    fn repeat(&mut self) -> bool {
        let Some(turn) = self.processor.branch(self.instructions) else {
            return false;
        };
        let end = turn.holds_until.min(self.processor.limit);
        let turns = (end - 1).saturating_sub(self.processor.now) / turn.ns;
        self.processor.turns.restart();
        // Re-entries of a handler do not end either, but a run is not stopped for them.
        self.endless = turn.holds_until == u64::MAX && !self.processor.entered_again;
        if turns == 0 {
            return true;
        }
        // One turn is executed here, to find how often each instruction occurs in a turn.
        let before = self.code.counts();
        let instructions = self.instructions;
        while self.instructions < instructions + turn.instructions {
            let done = self.instructions;
            self.run_one();
            if self.instructions == done {
                // The bus refuses an access that it allowed a turn before.
                return true;
            }
        }
        // The turn may have written a register, so that an interrupt may come earlier.
        let end = end.min(self.processor.limit);
        let left = (end - 1).saturating_sub(self.processor.now) / turn.ns;
        self.code.count_again(&before, left);
        self.processor.now += left * turn.ns;
        self.instructions += left * turn.instructions;
        true
    }

    /// Counts a branch backwards at which nothing repeats. Returns `true` if it is time to trace a turn.
    fn is_trace_due(&mut self) -> bool {
        if !self.processor.counted {
            return false;
        }
        self.turns_to_trace[0] -= 1;
        self.turns_to_trace[0] == 0
    }

    /// Traces a turn, and counts the turns after it that differ only in counters, if `most` instructions
    /// suffice to execute the last of them.
    fn leap(&mut self, most: u64) {
        let again = self.turns_to_trace[1];
        self.turns_to_trace = match self.trace(most) {
            Some(()) => FIRST_TRACE,
            None => [again, (2 * again).min(LAST_TRACE)],
        };
        self.processor.counted = false;
    }

    fn trace(&mut self, most: u64) -> Option<()> {
        if self.processor.entered_again {
            return None;
        }
        let until = self.processor.limit;
        let (start, before) = (self.processor.registers, self.code.counts());
        let (began, instructions) = (self.processor.now, self.instructions);
        let head = start.r[PC];
        let mut trace = Trace::new();
        loop {
            let (registers, done) = (self.processor.registers, self.instructions);
            let pc = registers.r[PC];
            let instruction = self.code.at(pc).instruction;
            self.processor.loaded = None;
            self.run_one();
            if self.instructions == done || self.processor.now >= until || done - instructions > LONGEST_TURN
            {
                return None;
            }
            if self.processor.entered_again {
                return None;
            }
            trace.follow(instruction?, &registers, self.processor.loaded)?;
            if self.processor.registers.r[PC] == head && pc >= head {
                break;
            }
        }
        let reach = trace.reach(&start, &self.processor.registers)?;
        let (ns, length) = (self.processor.now - began, self.instructions - instructions);
        let left = (reach.holds_until.min(until) - 1).saturating_sub(self.processor.now);
        // The last turns are left to be executed, so that all registers are right after them.
        let turns = (left.min(reach.shift) / ns).saturating_sub(EXECUTED);
        if turns < WORTHWHILE || length * (EXECUTED + 1) > most {
            return None;
        }
        self.code.count_again(&before, turns);
        self.processor.now += turns * ns;
        self.instructions += turns * length;
        self.processor.turns.restart();
        self.endless = false;
        Some(())
    }

    fn run_one(&mut self) {
        let pc = self.processor.registers.r[PC];
        if self.code.at(pc).at == pc {
            self.step(pc);
        }
    }
}
