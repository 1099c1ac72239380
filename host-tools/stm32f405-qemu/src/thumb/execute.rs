//! Execution of instructions, one after the other.

use super::alu::{add, shift};
use super::bus::{Bus, Loaded};
use super::decode::{ALWAYS, Datum, Flags, Instruction, Operand, Operation, Place, is_wide, narrow, wide};
use super::registers::{C, IT, N, Registers, V, Z, it_of, passes};
use super::trace::Trace;
use super::turns::Turns;

/// An instruction in the cache.
#[derive(Debug, Clone, Copy)]
struct Cached {
    at: u32,
    next: u32,
    /// `None` if the interpreter does not know it.
    instruction: Option<Instruction>,
    executed: u64,
}

/// Number of instructions in the cache, by bits 1 to 9 of their addresses.
const CACHE: usize = 512;
/// An address of no instruction.
const NOWHERE: u32 = u32::MAX;
/// Branches to here and above are returns from exceptions.
const EXCEPTION_RETURN: u32 = 0xf000_0000;
const PC: usize = 15;
const LR: usize = 14;
/// Turns to the first that is traced, and from that to the second.
const FIRST_TRACE: [u32; 2] = [4, 16];
/// Most turns from one that is traced in vain to the next.
const LAST_TRACE: u32 = 1 << 14;
/// Most instructions of a turn that is traced.
const LONGEST_TURN: u64 = 64;
/// Turns that are executed one by one after others were counted.
const EXECUTED: u64 = 2;
/// Turns whose counting saves more than the trace costs.
const WORTHWHILE: u64 = 8;

/// The processor.
pub(crate) struct Interpreter<'a, B> {
    pub(crate) registers: Registers,
    pub(crate) now: u64,
    /// Executed instructions.
    pub(crate) instructions: u64,
    /// True if the last turns that were counted repeat without an end of themselves.
    pub(crate) endless: bool,
    /// Virtual time of an instruction, ns.
    instruction_ns: u64,
    bus: &'a mut B,
    cache: Box<[Cached; CACHE]>,
    turns: Turns,
    /// The last load, and its time.
    loaded: Option<(u64, Loaded)>,
    /// True if a counter was read since the last turn that was traced.
    counted: bool,
    /// Turns to the next one that is traced, and from that to the one after it if it gives nothing.
    turns_to_trace: [u32; 2],
}

/// Outcome of an instruction.
enum Step {
    /// The next one follows.
    Next,
    Jump(u32),
}

impl<'a, B: Bus> Interpreter<'a, B> {
    pub(crate) fn new(registers: Registers, now: u64, instruction_ns: u64, bus: &'a mut B) -> Self {
        let nothing = Cached {
            at: NOWHERE,
            next: 0,
            instruction: None,
            executed: 0,
        };
        Self {
            registers,
            now,
            instructions: 0,
            endless: false,
            instruction_ns,
            bus,
            cache: Box::new([nothing; CACHE]),
            turns: Turns::default(),
            loaded: None,
            counted: false,
            turns_to_trace: FIRST_TRACE,
        }
    }

    /// Executes instructions that begin before `until`, `most` at most; turns that repeat are counted at once
    /// and are not part of these. Gives how many those are.
    pub(crate) fn run(&mut self, until: u64, most: u64) -> u64 {
        let mut stepped = 0;
        while self.now < until && stepped < most {
            stepped += 1;
            let pc = self.registers.r[PC];
            let place = pc as usize >> 1 & (CACHE - 1);
            if self.cache[place].at != pc && !self.fetch(pc, place) {
                break;
            }
            let Cached {
                next,
                instruction: Some(instruction),
                ..
            } = self.cache[place]
            else {
                break;
            };
            let Some(step) = self.conditional(instruction, next) else {
                break;
            };
            self.cache[place].executed += 1;
            self.now += self.instruction_ns;
            self.instructions += 1;
            let to = match step {
                Step::Next => next,
                Step::Jump(to) => to,
            };
            self.registers.r[PC] = to;
            if to <= pc && !self.repeat(until) && self.is_trace_due() {
                self.leap(until, most - stepped);
            }
        }
        stepped
    }

    /// Addresses of executed instructions, with their counts.
    pub(crate) fn executed(&self) -> impl Iterator<Item = (u32, u64)> {
        let executed = self.cache.iter().filter(|cached| cached.executed > 0);
        executed.map(|cached| (cached.at, cached.executed))
    }

    /// Fills a place of the cache. An instruction that has counts stays: then there is no room.
    fn fetch(&mut self, pc: u32, place: usize) -> bool {
        if self.cache[place].executed > 0 || pc & 1 == 1 {
            return false;
        }
        let Some(first) = self.bus.fetch(pc) else {
            return false;
        };
        let (instruction, next) = if is_wide(first) {
            let Some(second) = self.bus.fetch(pc.wrapping_add(2)) else {
                return false;
            };
            (wide(first, second, pc), pc.wrapping_add(4))
        } else {
            (narrow(first, pc), pc.wrapping_add(2))
        };
        self.cache[place] = Cached {
            at: pc,
            next,
            instruction,
            executed: 0,
        };
        true
    }

    /// A branch backwards: counts the turns that repeat. Gives whether this one does.
    fn repeat(&mut self, until: u64) -> bool {
        let Some(turn) = self.turns.branch(&self.registers, self.now, self.instructions) else {
            return false;
        };
        let end = turn.holds_until.min(until);
        let turns = (end - 1).saturating_sub(self.now) / turn.ns;
        self.turns.restart();
        self.endless = turn.holds_until == u64::MAX;
        if turns == 0 {
            return true;
        }
        // One of them is executed here, so that each instruction is counted as often as it comes in a turn.
        let before = self.counts();
        let (now, instructions) = (self.now, self.instructions);
        while self.instructions < instructions + turn.instructions {
            let done = self.instructions;
            self.run_one();
            if self.instructions == done {
                // The bus has refused what it gave a turn before.
                return true;
            }
        }
        self.count_again(&before, turns - 1);
        self.now = now + turns * turn.ns;
        self.instructions = instructions + turns * turn.instructions;
        true
    }

    fn counts(&self) -> Vec<u64> {
        self.cache.iter().map(|cached| cached.executed).collect()
    }

    /// Counts what was executed since these counts for a number of further times.
    fn count_again(&mut self, before: &[u64], times: u64) {
        for (cached, before) in self.cache.iter_mut().zip(before) {
            cached.executed += (cached.executed - before) * times;
        }
    }

    /// A branch backwards, after which nothing repeats. Returns `true` if it is time to trace a turn.
    fn is_trace_due(&mut self) -> bool {
        if !self.counted {
            return false;
        }
        self.turns_to_trace[0] -= 1;
        self.turns_to_trace[0] == 0
    }

    /// Traces a turn, and counts those that follow it and differ in counters alone, if another `most`
    /// instructions can be executed after them.
    fn leap(&mut self, until: u64, most: u64) {
        let again = self.turns_to_trace[1];
        self.turns_to_trace = match self.trace(until, most) {
            Some(()) => FIRST_TRACE,
            None => [again, (2 * again).min(LAST_TRACE)],
        };
        self.counted = false;
    }

    fn trace(&mut self, until: u64, most: u64) -> Option<()> {
        let (start, before) = (self.registers, self.counts());
        let (began, instructions) = (self.now, self.instructions);
        let head = start.r[PC];
        let mut trace = Trace::new();
        loop {
            let (registers, done) = (self.registers, self.instructions);
            let pc = registers.r[PC];
            let cached = self.cache[pc as usize >> 1 & (CACHE - 1)];
            self.loaded = None;
            self.run_one();
            if self.instructions == done || self.now >= until || done - instructions > LONGEST_TURN {
                return None;
            }
            trace.follow(cached.instruction?, &registers, self.loaded)?;
            if self.registers.r[PC] == head && pc >= head {
                break;
            }
        }
        let reach = trace.reach(&start, &self.registers)?;
        let (ns, length) = (self.now - began, self.instructions - instructions);
        let left = (reach.holds_until.min(until) - 1).saturating_sub(self.now);
        // The last of them are executed here, so that all registers are as after them.
        let turns = (left.min(reach.shift) / ns).saturating_sub(EXECUTED);
        if turns < WORTHWHILE || length * (EXECUTED + 1) > most {
            return None;
        }
        self.count_again(&before, turns);
        self.now += turns * ns;
        self.instructions += turns * length;
        self.turns.restart();
        self.endless = false;
        Some(())
    }

    fn run_one(&mut self) {
        let pc = self.registers.r[PC];
        let place = pc as usize >> 1 & (CACHE - 1);
        let Cached {
            at,
            next,
            instruction: Some(instruction),
            ..
        } = self.cache[place]
        else {
            return;
        };
        if at != pc {
            return;
        }
        let Some(step) = self.conditional(instruction, next) else {
            return;
        };
        self.cache[place].executed += 1;
        self.now += self.instruction_ns;
        self.instructions += 1;
        self.registers.r[PC] = match step {
            Step::Next => next,
            Step::Jump(to) => to,
        };
    }

    #[inline(always)]
    fn conditional(&mut self, instruction: Instruction, next: u32) -> Option<Step> {
        if self.registers.xpsr & IT == 0 {
            return self.execute(instruction, next, true);
        }
        self.in_block(instruction, next)
    }

    /// Executes an instruction of an IT block, unless that leaves it out.
    fn in_block(&mut self, instruction: Instruction, next: u32) -> Option<Step> {
        let it = self.it();
        let step = if self.passes(it >> 4) {
            self.execute(instruction, next, false)?
        } else {
            Step::Next
        };
        let rest = it & 0x1f;
        self.set_it(if it & 7 == 0 {
            0
        } else {
            it & 0xe0 | rest << 1 & 0x1f
        });
        Some(step)
    }

    fn it(&self) -> u8 {
        it_of(self.registers.xpsr)
    }

    fn set_it(&mut self, it: u8) {
        let it = u32::from(it);
        self.registers.xpsr = self.registers.xpsr & !IT | (it & 3) << 25 | (it & 0xfc) << 8;
    }

    fn has(&self, flag: u32) -> bool {
        self.registers.xpsr & flag != 0
    }

    #[inline(always)]
    fn passes(&self, condition: u8) -> bool {
        passes(self.registers.xpsr, condition)
    }

    #[inline(always)]
    fn get(&self, register: u8) -> u32 {
        self.registers.r[usize::from(register & 15)]
    }

    #[inline(always)]
    fn set(&mut self, register: u8, value: u32) {
        // The low bits of SP are always clear.
        let value = if register == 13 { value & !3 } else { value };
        self.registers.r[usize::from(register & 15)] = value;
    }

    /// A branch to an address with its Thumb bit.
    fn jump(&self, to: u32) -> Option<Step> {
        (to & 1 == 1 && to < EXCEPTION_RETURN).then_some(Step::Jump(to & !1))
    }

    #[inline(always)]
    fn execute(&mut self, instruction: Instruction, next: u32, outside: bool) -> Option<Step> {
        match instruction {
            Instruction::Data {
                operation,
                flags,
                to,
                first,
                second,
            } => {
                let sets = flags == Flags::Set || (outside && flags == Flags::SetOutside);
                self.data(operation, sets, to, first, second);
            }
            Instruction::Memory {
                datum,
                register,
                place,
            } => self.memory(datum, register, place)?,
            Instruction::Branch { to, condition, link } => {
                if condition != ALWAYS && !self.passes(condition) {
                    return Some(Step::Next);
                }
                if link {
                    self.registers.r[LR] = next | 1;
                }
                return Some(Step::Jump(to));
            }
            Instruction::BranchTo { register, link } => {
                let step = self.jump(self.get(register))?;
                if link {
                    self.registers.r[LR] = next | 1;
                }
                return Some(step);
            }
            Instruction::BranchIfZero { register, not, to } => {
                let jumps = (self.get(register) == 0) != not;
                return Some(if jumps { Step::Jump(to) } else { Step::Next });
            }
            Instruction::IfThen(it) => self.set_it(it),
            Instruction::Nothing => {}
            other => return self.rarer(other, outside),
        }
        Some(Step::Next)
    }

    fn rarer(&mut self, instruction: Instruction, outside: bool) -> Option<Step> {
        match instruction {
            Instruction::Pair {
                store,
                registers,
                place,
            } => self.pair(store, registers, place)?,
            Instruction::Several {
                store,
                base,
                registers,
                down,
                write_back,
            } => {
                return self.several(store, base, registers, down, write_back);
            }
            Instruction::Extend {
                to,
                from,
                rotation,
                bits,
                signed,
            } => {
                let value = self.get(from).rotate_right(rotation);
                self.set(to, extended(value, bits, signed));
            }
            Instruction::Reverse { to, from, kind } => {
                let value = self.get(from);
                let halves = value.swap_bytes().rotate_right(16);
                let reversed = match kind {
                    0 => value.swap_bytes(),
                    1 => halves,
                    _ => extended(halves, 16, true),
                };
                self.set(to, reversed);
            }
            Instruction::BitField {
                to,
                from,
                low,
                width,
                signed,
            } => {
                self.set(to, extended(self.get(from) >> low, width, signed));
            }
            Instruction::Insert { to, from, low, width } => {
                let mask = (u32::MAX >> (32 - width)) << low;
                let bits = from.map_or(0, |from| self.get(from) << low);
                self.set(to, self.get(to) & !mask | bits & mask);
            }
            Instruction::MoveTop { to, number } => {
                self.set(to, self.get(to) & 0xffff | number << 16);
            }
            Instruction::LeadingZeros { to, from } => self.set(to, self.get(from).leading_zeros()),
            other => self.product(other, outside)?,
        }
        Some(Step::Next)
    }

    /// Multiplies or divides.
    fn product(&mut self, instruction: Instruction, outside: bool) -> Option<()> {
        match instruction {
            Instruction::Multiply {
                to,
                a,
                b,
                add,
                subtract,
                flags,
            } => {
                let product = self.get(a).wrapping_mul(self.get(b));
                let sum = add.map_or(0, |register| self.get(register));
                let value = if subtract {
                    sum.wrapping_sub(product)
                } else {
                    sum.wrapping_add(product)
                };
                self.set(to, value);
                if outside && flags == Flags::SetOutside {
                    self.set_nz(value);
                }
            }
            Instruction::MultiplyLong {
                to: [low, high],
                a,
                b,
                signed,
                accumulate,
            } => {
                let (a, b) = (self.get(a), self.get(b));
                let product = if signed {
                    (i64::from(a as i32) * i64::from(b as i32)) as u64
                } else {
                    u64::from(a) * u64::from(b)
                };
                let before = u64::from(self.get(high)) << 32 | u64::from(self.get(low));
                let value = product.wrapping_add(if accumulate { before } else { 0 });
                self.set(low, value as u32);
                self.set(high, (value >> 32) as u32);
            }
            Instruction::Divide { to, a, b, signed } => {
                let (a, b) = (self.get(a), self.get(b));
                // A division by zero may be a fault.
                let value = if signed {
                    (a as i32).wrapping_div(Some(b as i32).filter(|b| *b != 0)?) as u32
                } else {
                    a.checked_div(b)?
                };
                self.set(to, value);
            }
            _ => return None,
        }
        Some(())
    }

    #[inline(always)]
    fn data(&mut self, operation: Operation, sets: bool, to: Option<u8>, first: u8, second: Operand) {
        let carry = self.has(C);
        let (b, shifted_carry) = match second {
            Operand::Number(number, out) => (number, out.unwrap_or(carry)),
            Operand::Register(register, by) => shift(self.get(register), by, carry),
            Operand::ShiftedBy(register, kind, by) => {
                shift(self.get(register), (kind, self.get(by) & 0xff), carry)
            }
        };
        let a = self.get(first);
        let logical = |value| (value, shifted_carry, None);
        let sum = |(value, carry, overflow)| (value, carry, Some(overflow));
        let (value, carry, overflow) = match operation {
            Operation::And => logical(a & b),
            Operation::Bic => logical(a & !b),
            Operation::Orr => logical(a | b),
            Operation::Orn => logical(a | !b),
            Operation::Eor => logical(a ^ b),
            Operation::Mov => logical(b),
            Operation::Mvn => logical(!b),
            Operation::Add => sum(add(a, b, false)),
            Operation::Adc => sum(add(a, b, carry)),
            Operation::Sub => sum(add(a, !b, true)),
            Operation::Sbc => sum(add(a, !b, carry)),
            Operation::Rsb => sum(add(!a, b, true)),
        };
        if let Some(to) = to {
            self.set(to, value);
        }
        if sets {
            let zero = u32::from(value == 0) << 30;
            let overflow = overflow.map_or(self.registers.xpsr & V, |overflow| u32::from(overflow) << 28);
            let flags = value & N | zero | u32::from(carry) << 29 | overflow;
            self.registers.xpsr = self.registers.xpsr & !(N | Z | C | V) | flags;
        }
    }

    fn set_nz(&mut self, value: u32) {
        let zero = if value == 0 { Z } else { 0 };
        self.registers.xpsr = self.registers.xpsr & !(N | Z) | value & N | zero;
    }

    /// Address of an access, and the new value of its base.
    #[inline(always)]
    fn address(&self, place: Place) -> (u32, Option<(u8, u32)>) {
        match place {
            Place::Absolute(address) => (address, None),
            Place::Offset {
                base,
                offset,
                index,
                write_back,
            } => {
                let (before, after) = (self.get(base), self.get(base).wrapping_add(offset));
                (
                    if index { after } else { before },
                    write_back.then_some((base, after)),
                )
            }
            Place::Sum(base, other, by) => (self.get(base).wrapping_add(self.get(other) << by), None),
        }
    }

    /// Reads. What is not aligned may be a fault, and is refused.
    #[inline(always)]
    fn load(&mut self, address: u32, bytes: u32) -> Option<u32> {
        if address & (bytes - 1) != 0 {
            return None;
        }
        // QEMU counts the instruction before its access.
        let now = self.now + self.instruction_ns;
        let loaded = self.bus.load(address, bytes, now)?;
        self.turns.read(loaded.holds_until);
        self.counted |= loaded.ramp.is_some();
        self.loaded = Some((now, loaded));
        Some(loaded.value)
    }

    fn accepts(&self, address: u32, bytes: u32) -> Option<()> {
        // A store over an instruction in the cache is for QEMU.
        let first = (address & !1).wrapping_sub(2);
        let mut halves = (0..4).map(|n| first.wrapping_add(2 * n));
        if halves.any(|at| self.cache[at as usize >> 1 & (CACHE - 1)].at == at) {
            return None;
        }
        (address & (bytes - 1) == 0 && self.bus.accepts(address, bytes)).then_some(())
    }

    fn store(&mut self, address: u32, bytes: u32, value: u32) {
        let now = self.now + self.instruction_ns;
        if self.bus.store(address, bytes, value, now) {
            self.turns.changed_memory();
        }
    }

    #[inline(always)]
    fn memory(&mut self, datum: Datum, register: u8, place: Place) -> Option<()> {
        let (address, base) = self.address(place);
        let Datum { bytes, signed, store } = datum;
        if store {
            self.accepts(address, bytes)?;
            self.store(address, bytes, self.get(register));
            if let Some((base, value)) = base {
                self.set(base, value);
            }
        } else {
            let value = self.load(address, bytes)?;
            if let Some((base, value)) = base {
                self.set(base, value);
            }
            self.set(
                register,
                if signed {
                    extended(value, 8 * bytes, true)
                } else {
                    value
                },
            );
        }
        Some(())
    }

    fn pair(&mut self, store: bool, registers: [u8; 2], place: Place) -> Option<()> {
        let (address, base) = self.address(place);
        let addresses = [address, address.wrapping_add(4)];
        if store {
            addresses
                .iter()
                .try_for_each(|address| self.accepts(*address, 4))?;
            for (address, register) in addresses.into_iter().zip(registers) {
                self.store(address, 4, self.get(register));
            }
        } else {
            let values = self.load_from_memory(addresses.into_iter())?;
            registers
                .into_iter()
                .zip(values)
                .for_each(|(register, value)| self.set(register, value));
        }
        if let Some((base, value)) = base {
            self.set(base, value);
        }
        Some(())
    }

    /// Reads several words, all of them from memory: a register is not read before it is clear that all can
    /// be.
    fn load_from_memory(&mut self, addresses: impl Iterator<Item = u32>) -> Option<Vec<u32>> {
        addresses
            .map(|address| {
                self.bus
                    .is_memory(address)
                    .then(|| self.load(address, 4))
                    .flatten()
            })
            .collect()
    }

    fn several(&mut self, store: bool, base: u8, list: u16, down: bool, write_back: bool) -> Option<Step> {
        let bytes = 4 * list.count_ones();
        let from = self.get(base);
        let after = if down {
            from.wrapping_sub(bytes)
        } else {
            from.wrapping_add(bytes)
        };
        let start = if down { after } else { from };
        let registers = (0..16u8).filter(|register| list >> register & 1 == 1);
        let places = registers.zip((0..).map(|n| start.wrapping_add(4 * n)));
        if store {
            places
                .clone()
                .try_for_each(|(_, address)| self.accepts(address, 4))?;
            for (register, address) in places {
                self.store(address, 4, self.get(register));
            }
            if write_back {
                self.set(base, after);
            }
            return Some(Step::Next);
        }
        let values = self.load_from_memory(places.clone().map(|(_, address)| address))?;
        let to = values.last().copied().filter(|_| list >> PC & 1 == 1);
        let step = to.map_or(Some(Step::Next), |to| self.jump(to))?;
        if write_back {
            self.set(base, after);
        }
        for ((register, _), value) in places.zip(values) {
            if usize::from(register) != PC {
                self.set(register, value);
            }
        }
        Some(step)
    }
}

/// The lowest bits of a value, extended to a word.
fn extended(value: u32, bits: u32, signed: bool) -> u32 {
    let above = 32 - bits;
    if signed {
        ((value << above) as i32 >> above) as u32
    } else {
        value << above >> above
    }
}
