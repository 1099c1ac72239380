//! Execution of an instruction.

use super::alu::{add, shift};
use super::bus::{Bus, Loaded, Stored};
use super::code::Code;
use super::decode::{ALWAYS, Datum, Flags, Instruction, Operand, Operation, Place};
use super::registers::{C, IT, LR, N, PC, Registers, V, Z, it_of, passes};
use super::turns::{Branch, Turn, Turns};

/// Branches to here and above are returns from exceptions.
const EXCEPTION_RETURN: u32 = 0xf000_0000;

/// The processor, with all that an instruction can change.
pub(super) struct Processor<'a, B> {
    pub(super) registers: Registers,
    pub(super) now: u64,
    /// Virtual time of an instruction, ns.
    instruction_ns: u64,
    bus: &'a mut B,
    pub(super) turns: Turns,
    /// The last load, and its time.
    pub(super) loaded: Option<(u64, Loaded)>,
    /// True if a counter was read since the last turn that was traced.
    pub(super) counted: bool,
    /// The time before which instructions have to begin.
    pub(super) limit: u64,
    /// The link register with which the handler was entered, if all of it was executed here.
    entered_with: Option<u32>,
    /// True if a handler was left and entered again.
    pub(super) entered_again: bool,
    /// Instruction that was refused last, if the interpreter may go on after it.
    pub(super) refused: Option<HandBack>,
}

/// Instruction for QEMU after which the interpreter may go on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum HandBack {
    /// The return from a handler that will be entered again.
    Return,
    /// A write of BASEPRI.
    BasePriority(u32),
}

/// Outcome of an instruction.
pub(super) enum Step {
    /// The next one follows.
    Next,
    Jump(u32),
    /// The return from a handler that is entered again: its address, and the link register.
    Again(u32, u32),
}

/// Registers that follow one another in memory.
struct Words {
    base: u8,
    registers: u16,
    down: bool,
    write_back: bool,
}

impl<'a, B: Bus> Processor<'a, B> {
    pub(super) fn new(
        registers: Registers,
        now: u64,
        instruction_ns: u64,
        entered_with: Option<u32>,
        bus: &'a mut B,
    ) -> Self {
        Self {
            registers,
            now,
            instruction_ns,
            bus,
            turns: Turns::default(),
            loaded: None,
            counted: false,
            limit: u64::MAX,
            entered_with,
            entered_again: false,
            refused: None,
        }
    }

    /// Notes a branch backwards after some instructions. Returns the turn that it ends, if that repeats.
    pub(super) fn branch(&mut self, instructions: u64) -> Option<Turn> {
        let (registers, now) = (&self.registers, self.now);
        let is_as_kept = || self.bus.is_as_kept();
        match self.turns.branch(registers, now, instructions, is_as_kept) {
            Branch::Repeats(turn) => return Some(turn),
            Branch::Earlier => self.bus.keep(),
            Branch::Other => {}
        }
        None
    }

    /// A halfword of code.
    pub(super) fn fetch(&mut self, address: u32) -> Option<u16> {
        self.bus.fetch(address)
    }

    /// Executes an instruction that is followed by the one at `next`. `None`, without an effect, if it is for
    /// QEMU.
    #[inline(always)]
    pub(super) fn execute(&mut self, instruction: &Instruction, next: u32, code: &Code) -> Option<Step> {
        let step = if self.registers.xpsr & IT == 0 {
            self.one(instruction, next, true, code)?
        } else {
            self.in_block(instruction, next, code)?
        };
        self.now += self.instruction_ns;
        Some(step)
    }

    /// Executes an instruction of an IT block, if its condition holds.
    fn in_block(&mut self, instruction: &Instruction, next: u32, code: &Code) -> Option<Step> {
        let it = self.it();
        let step = if self.passes(it >> 4) {
            self.one(instruction, next, false, code)?
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

    /// A branch to an address with its Thumb bit, or to the value that returns from an exception.
    fn jump(&mut self, to: u32) -> Option<Step> {
        if to < EXCEPTION_RETURN {
            return (to & 1 == 1).then_some(Step::Jump(to & !1));
        }
        let exception = self.registers.exception();
        if exception == 0 || self.registers.xpsr & IT != 0 {
            return None;
        }
        let handler = self.bus.enters_again(exception)?;
        if self.entered_with == Some(to) {
            Some(Step::Again(handler, to))
        } else {
            self.refused = Some(HandBack::Return);
            None
        }
    }

    /// A write of BASEPRI. Handlers may always write it.
    fn set_base_priority(&mut self, value: u32) -> Option<()> {
        if self.registers.exception() == 0 {
            return None;
        }
        let keeps = self.bus.keeps_base_priority(value);
        if !keeps {
            self.refused = Some(HandBack::BasePriority(value));
        }
        keeps.then_some(())
    }

    #[inline(always)]
    fn one(&mut self, instruction: &Instruction, next: u32, outside: bool, code: &Code) -> Option<Step> {
        match *instruction {
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
            } => self.memory(datum, register, place, code)?,
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
                let to = self.get(register);
                if link && to >= EXCEPTION_RETURN {
                    return None;
                }
                let step = self.jump(to)?;
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
            ref other => return self.rarer(other, outside, code),
        }
        Some(Step::Next)
    }

    fn rarer(&mut self, instruction: &Instruction, outside: bool, code: &Code) -> Option<Step> {
        match *instruction {
            Instruction::Pair {
                store,
                registers,
                place,
            } => self.pair(store, registers, place, code)?,
            Instruction::Several {
                store,
                base,
                registers,
                down,
                write_back,
            } => {
                let words = Words {
                    base,
                    registers,
                    down,
                    write_back,
                };
                return self.several(store, words, code);
            }
            Instruction::BranchByTable {
                table,
                index,
                halves,
                from,
            } => {
                let start = if usize::from(table) == PC {
                    from
                } else {
                    self.get(table)
                };
                let (shift, bytes) = if halves { (1, 2) } else { (0, 1) };
                let place = start.wrapping_add(self.get(index) << shift);
                let distance = self
                    .bus
                    .is_memory(place & !3)
                    .then(|| self.load(place, bytes))??;
                return Some(Step::Jump(from.wrapping_add(2 * distance)));
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
            Instruction::SetBasePriority(from) => self.set_base_priority(self.get(from))?,
            ref other => self.product(other, outside)?,
        }
        Some(Step::Next)
    }

    /// Multiplies or divides.
    fn product(&mut self, instruction: &Instruction, outside: bool) -> Option<()> {
        match *instruction {
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

    /// Reads memory or a register. An unaligned access may be a fault, and is refused.
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

    fn accepts(&self, address: u32, bytes: u32, code: &Code) -> Option<()> {
        // A store over a known instruction is for QEMU.
        let is_code = code.holds_near(address);
        let now = self.now + self.instruction_ns;
        (!is_code && address & (bytes - 1) == 0 && self.bus.accepts(address, bytes, now)).then_some(())
    }

    fn store(&mut self, address: u32, bytes: u32, value: u32) {
        let now = self.now + self.instruction_ns;
        let stored = self.bus.store(address, bytes, value, now);
        self.note_stored(stored);
    }

    fn note_stored(&mut self, stored: Stored) {
        if stored.changed {
            self.turns.changed_memory();
        }
        self.turns.read(stored.holds_until);
        self.limit = self.limit.min(stored.limit);
    }

    /// Stores one item, or writes one register.
    #[inline(always)]
    fn store_one(&mut self, address: u32, bytes: u32, value: u32, code: &Code) -> Option<()> {
        if self.accepts(address, bytes, code).is_some() {
            self.store(address, bytes, value);
            return Some(());
        }
        let now = self.now + self.instruction_ns;
        let exception = self.registers.exception();
        let stored = self.bus.write_register((address, bytes), value, now, exception)?;
        self.note_stored(stored);
        Some(())
    }

    #[inline(always)]
    fn memory(&mut self, datum: Datum, register: u8, place: Place, code: &Code) -> Option<()> {
        let (address, base) = self.address(place);
        let Datum { bytes, signed, store } = datum;
        if store {
            self.store_one(address, bytes, self.get(register), code)?;
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

    fn pair(&mut self, store: bool, registers: [u8; 2], place: Place, code: &Code) -> Option<()> {
        let (address, base) = self.address(place);
        let addresses = [address, address.wrapping_add(4)];
        if store {
            addresses
                .iter()
                .try_for_each(|address| self.accepts(*address, 4, code))?;
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

    /// Reads several words, if all are in memory: a register must not be read before it is known that all
    /// reads are allowed.
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

    fn several(&mut self, store: bool, words: Words, code: &Code) -> Option<Step> {
        let Words {
            base,
            registers: list,
            down,
            write_back,
        } = words;
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
                .try_for_each(|(_, address)| self.accepts(address, 4, code))?;
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
