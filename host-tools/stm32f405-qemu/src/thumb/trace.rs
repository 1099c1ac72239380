//! Turns of a loop that differ in counters alone.
//!
//! # Design
//!
//! A loop that waits for a counter has different registers at each turn, but takes the same path until the
//! counter has come far enough. One turn is traced to find what depends on a counter, and how. A value may
//! rise or fall with the counter, by one at each tick. Flags may come from such a value and a constant one:
//! both determine for how many ticks a condition on these flags cannot change. If the turn reads nothing
//! that the turn before derived from a counter, later turns take the same path for that long.
//!
//! The trace gives up at everything else.

use super::alu::{Shift, shift};
use super::bus::Loaded;
use super::decode::{ALWAYS, Flags, Instruction, Operand, Operation, Place};
use super::registers::{C, IT, N, Registers, V, Z, it_of, passes};

const NS_PER_S: u64 = 1_000_000_000;
/// Flags in a set of registers and flags, above R0 to R15.
const FLAG_N: u32 = 1 << 16;
const FLAG_Z: u32 = 1 << 17;
const FLAG_C: u32 = 1 << 18;
const FLAG_V: u32 = 1 << 19;
const ALL_FLAGS: u32 = FLAG_N | FLAG_Z | FLAG_C | FLAG_V;
const SP: u8 = 13;
const LR: u8 = 14;
const PC: u8 = 15;

/// A value that rises or falls with a counter that ticks at `hz`, by 2^`shift` at each tick. It may be off
/// by `coarse`, as its lowest bits were cleared.
#[derive(Debug, Clone, Copy)]
struct Line {
    falls: bool,
    hz: u32,
    shift: u32,
    coarse: u32,
}

impl Line {
    fn mirrored(self) -> Self {
        let falls = !self.falls;
        Self { falls, ..self }
    }

    fn shifted_left(self, by: u32) -> Self {
        let (shift, coarse) = (self.shift + by, self.coarse << by);
        Self {
            shift,
            coarse,
            ..self
        }
    }

    /// Least number of ticks in which the value covers a distance.
    fn ticks(self, distance: u64) -> u64 {
        distance
            .saturating_sub(u64::from(self.coarse))
            .div_ceil(1 << self.shift)
    }
}

/// The operands of a subtraction, in any order: one on a line, one constant.
#[derive(Debug, Clone, Copy)]
struct Comparison {
    line: Line,
    value: u32,
    with: u32,
}

impl Comparison {
    /// Ticks until a condition on its flags may change.
    fn steady_ticks(&self) -> u64 {
        const HALF: u32 = 1 << 31;
        let with = self.with;
        let next = with.wrapping_add(1);
        // Where one of the operands, or the difference, is 0 or changes its sign.
        let edges = [
            0,
            HALF,
            with,
            next,
            with.wrapping_add(HALF),
            next.wrapping_add(HALF),
        ];
        let distance = |edge: u32| match (self.line.falls, edge.wrapping_sub(self.value)) {
            (true, _) => u64::from(self.value.wrapping_sub(edge)) + 1,
            (false, 0) => 1 << 32,
            (false, distance) => u64::from(distance),
        };
        let nearest = edges.map(distance).into_iter().min().unwrap_or(0);
        self.line.ticks(nearest)
    }
}

/// One turn of a loop, as far as it depends on counters.
#[derive(Debug, Default)]
pub(super) struct Trace {
    lines: [Option<Line>; 16],
    /// Flags that depend on a counter, and the comparison that set them, if that is known.
    uncertain: u32,
    comparison: Option<Comparison>,
    /// Registers and flags that were written in this turn, and those that were read before.
    written: u32,
    read_first: u32,
    /// Longest delay after which the turn still takes the same path, ns.
    shift: u64,
    /// Time up to which everything that is read, except the counters, keeps its value.
    holds_until: u64,
}

/// Limits of the turns that take the same path as a traced one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Reach {
    /// Longest delay of such a turn against the traced one, ns.
    pub(super) shift: u64,
    /// Time before which such a turn must end.
    pub(super) holds_until: u64,
}

impl Trace {
    pub(super) fn new() -> Self {
        Self {
            shift: u64::MAX,
            holds_until: u64::MAX,
            ..Self::default()
        }
    }

    /// Follows an executed instruction, with the registers before it, what it has loaded, and when. `None`
    /// if nothing is known of the turns to come.
    pub(super) fn follow(
        &mut self,
        instruction: Instruction,
        before: &Registers,
        loaded: Option<(u64, Loaded)>,
    ) -> Option<()> {
        let it = it_of(before.xpsr);
        if it != 0 {
            self.condition(it >> 4)?;
            if !passes(before.xpsr, it >> 4) {
                return Some(());
            }
        }
        match instruction {
            Instruction::Nothing | Instruction::IfThen(_) => {}
            Instruction::Branch { condition, link, .. } => {
                if condition != ALWAYS {
                    self.condition(condition)?;
                }
                if link {
                    self.write(LR, None)?;
                }
            }
            Instruction::BranchTo { register, link } => {
                self.read_certain(register)?;
                if link {
                    self.write(LR, None)?;
                }
            }
            Instruction::BranchIfZero { register, .. } => {
                if let Some(line) = self.read(register) {
                    let (value, with) = (before.r[usize::from(register)], 0);
                    self.limit(Comparison { line, value, with });
                }
            }
            Instruction::MoveTop { to, .. } => {
                self.read_certain(to)?;
                self.write(to, None)?;
            }
            Instruction::BitField {
                to,
                from,
                low,
                width,
                signed,
            } => self.low_bits(to, from, before, (low == 0 && !signed).then_some(width))?,
            Instruction::Extend {
                to,
                from,
                rotation,
                bits,
                signed,
            } => self.low_bits(to, from, before, (rotation == 0 && !signed).then_some(bits))?,
            Instruction::Memory {
                datum,
                register,
                place,
            } if !datum.store => {
                self.address(place)?;
                let line = self.loaded(loaded?)?;
                self.write(register, line)?;
            }
            Instruction::Data {
                operation,
                flags,
                to,
                first,
                second,
            } => {
                let sets = flags == Flags::Set || (it == 0 && flags == Flags::SetOutside);
                self.data(operation, sets, to, first, second, before)?;
            }
            _ => return None,
        }
        Some(())
    }

    /// Ends the turn. `None` if the next turn depends on a value that this one derived from a counter.
    pub(super) fn reach(&self, start: &Registers, end: &Registers) -> Option<Reach> {
        const BITS: [(u32, u32); 4] = [(N, FLAG_N), (Z, FLAG_Z), (C, FLAG_C), (V, FLAG_V)];
        let changed = start.xpsr ^ end.xpsr;
        if changed & !(N | Z | C | V) != 0 || end.xpsr & IT != 0 {
            return None;
        }
        let registers = (0..PC).filter(|n| {
            let n = usize::from(*n);
            start.r[n] != end.r[n] || self.lines[n].is_some()
        });
        let flags = BITS.iter().filter(|(bit, _)| changed & bit != 0);
        let differs = registers.fold(self.uncertain, |set, n| set | 1 << n);
        let differs = flags.fold(differs, |set, (_, flag)| set | flag);
        (differs & self.read_first == 0).then_some(Reach {
            shift: self.shift,
            holds_until: self.holds_until,
        })
    }

    fn reads(&mut self, set: u32) {
        self.read_first |= set & !self.written;
    }

    fn read(&mut self, register: u8) -> Option<Line> {
        self.reads(1 << register);
        self.lines[usize::from(register)]
    }

    fn read_certain(&mut self, register: u8) -> Option<()> {
        self.read(register).is_none().then_some(())
    }

    fn read_certain_flag(&mut self, flag: u32) -> Option<()> {
        self.reads(flag);
        (self.uncertain & flag == 0).then_some(())
    }

    fn write(&mut self, register: u8, line: Option<Line>) -> Option<()> {
        if register == PC || (register == SP && line.is_some()) {
            return None;
        }
        self.written |= 1 << register;
        self.lines[usize::from(register)] = line;
        Some(())
    }

    fn address(&mut self, place: Place) -> Option<()> {
        match place {
            Place::Absolute(_) => Some(()),
            Place::Offset { base, write_back, .. } => {
                self.read_certain(base)?;
                if write_back {
                    self.write(base, None)
                } else {
                    Some(())
                }
            }
            Place::Sum(base, other, _) => {
                self.read_certain(base)?;
                self.read_certain(other)
            }
        }
    }

    /// Takes a word that was loaded at a time.
    fn loaded(&mut self, (at, loaded): (u64, Loaded)) -> Option<Option<Line>> {
        let Some(ramp) = loaded.ramp else {
            self.holds_until = self.holds_until.min(loaded.holds_until);
            return Some(None);
        };
        self.shift = self.shift.min(ramp.until_ns.checked_sub(at + 1)?);
        Some(Some(Line {
            falls: ramp.falls,
            hz: ramp.hz,
            shift: 0,
            coarse: 0,
        }))
    }

    /// Takes a condition that was tested.
    fn condition(&mut self, condition: u8) -> Option<()> {
        let flags = match condition >> 1 {
            0 => FLAG_Z,
            1 => FLAG_C,
            2 => FLAG_N,
            3 => FLAG_V,
            4 => FLAG_C | FLAG_Z,
            5 => FLAG_N | FLAG_V,
            6 => FLAG_N | FLAG_V | FLAG_Z,
            _ => 0,
        };
        self.reads(flags);
        match flags & self.uncertain {
            0 => {}
            uncertain if uncertain == flags => {
                let comparison = self.comparison?;
                self.limit(comparison);
            }
            _ => return None,
        }
        Some(())
    }

    fn limit(&mut self, comparison: Comparison) {
        self.limit_ticks(comparison.line, comparison.steady_ticks());
    }

    /// Limits the delay to the tick from which something may differ. One tick may be about to come.
    fn limit_ticks(&mut self, line: Line, ticks: u64) {
        let ns = ticks.saturating_sub(2).saturating_mul(NS_PER_S) / u64::from(line.hz.max(1));
        self.shift = self.shift.min(ns);
    }

    /// Takes the lowest `bits` of a register or, if `bits` is `None`, another part of it.
    fn low_bits(&mut self, to: u8, from: u8, before: &Registers, bits: Option<u32>) -> Option<()> {
        let line = self.read(from);
        if let Some(line) = line {
            self.limit_to_bits(line, before.r[usize::from(from)], u32::MAX >> (32 - bits?));
        }
        self.write(to, line)
    }

    /// Limits the delay: a value's bits under a mask of lowest bits are on the line until they overflow.
    fn limit_to_bits(&mut self, line: Line, value: u32, mask: u32) {
        let low = u64::from(value & mask);
        let distance = if line.falls {
            low + 1
        } else {
            u64::from(mask) + 1 - low
        };
        self.limit_ticks(line, line.ticks(distance));
    }

    fn data(
        &mut self,
        operation: Operation,
        sets: bool,
        to: Option<u8>,
        first: u8,
        second: Operand,
        before: &Registers,
    ) -> Option<()> {
        use Operation::{Adc, Add, And, Bic, Mov, Mvn, Rsb, Sbc, Sub};
        let is_unary = matches!(operation, Mov | Mvn);
        let a = if is_unary { None } else { self.read(first) };
        let value_a = before.r[usize::from(first)];
        let (b, value_b, carries) = self.operand(second, before)?;
        if matches!(operation, Adc | Sbc) {
            self.read_certain_flag(FLAG_C)?;
        }
        let mut comparison = None;
        let line = match (operation, a, b) {
            (_, None, None) => None,
            (Add, Some(line), None) | (Add | Mov, None, Some(line)) => Some(line),
            (Mvn, None, Some(line)) => Some(line.mirrored()),
            (Sub | Rsb, Some(line), None) => {
                let (value, with) = (value_a, value_b);
                comparison = Some(Comparison { line, value, with });
                Some(if operation == Sub { line } else { line.mirrored() })
            }
            (Sub | Rsb, None, Some(line)) => {
                let (value, with) = (value_b, value_a);
                comparison = Some(Comparison { line, value, with });
                Some(if operation == Rsb { line } else { line.mirrored() })
            }
            (And | Bic, Some(line), None) => {
                let mask = if operation == And { value_b } else { !value_b };
                self.mask(line, value_a, mask)?
            }
            (And, None, Some(line)) => self.mask(line, value_b, value_a)?,
            _ => return None,
        };
        if sets {
            let is_sum = matches!(operation, Add | Adc | Sub | Sbc | Rsb);
            let set = match (is_sum, carries) {
                (true, _) => ALL_FLAGS,
                (false, true) => FLAG_N | FLAG_Z | FLAG_C,
                (false, false) => FLAG_N | FLAG_Z,
            };
            self.written |= set;
            if line.is_some() {
                self.uncertain |= set;
                self.comparison = comparison;
            } else {
                self.uncertain &= !set;
            }
        }
        to.map_or(Some(()), |to| self.write(to, line))
    }

    /// A contiguous range of bits of a value on a line is on it too, until the bits overflow.
    fn mask(&mut self, line: Line, value: u32, mask: u32) -> Option<Option<Line>> {
        if mask == 0 {
            return Some(None);
        }
        let cleared = (1 << mask.trailing_zeros()) - 1;
        let lowest = mask | cleared;
        if lowest & lowest.wrapping_add(1) != 0 {
            return None;
        }
        self.limit_to_bits(line, value, lowest);
        let coarse = line.coarse.max(cleared);
        Some(Some(Line { coarse, ..line }))
    }

    /// A second operand: its line, its value, and `true` if it sets the carry.
    fn operand(&mut self, operand: Operand, before: &Registers) -> Option<(Option<Line>, u32, bool)> {
        let of = |register: u8| before.r[usize::from(register)];
        let carry = before.xpsr & C != 0;
        match operand {
            Operand::Number(number, carry) => Some((None, number, carry.is_some())),
            Operand::Register(register, (_, 0)) => Some((self.read(register), of(register), false)),
            Operand::Register(register, (Shift::Lsl, by)) if by < 16 => {
                let line = self.read(register).map(|line| line.shifted_left(by));
                Some((line, of(register) << by, true))
            }
            Operand::Register(register, by) => {
                self.read_certain(register)?;
                if by.0 == Shift::Rrx {
                    self.read_certain_flag(FLAG_C)?;
                }
                Some((None, shift(of(register), by, carry).0, true))
            }
            Operand::ShiftedBy(register, kind, by) => {
                self.read_certain(register)?;
                self.read_certain(by)?;
                self.read_certain_flag(FLAG_C)?;
                let value = shift(of(register), (kind, of(by) & 0xff), carry).0;
                Some((None, value, true))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::alu::add;
    use super::*;

    #[test]
    fn no_condition_changes_within_the_steady_ticks() {
        let mut random = 1u64;
        let mut next = || {
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            (random >> 20) as u32
        };
        let flags = |a: u32, b: u32| {
            let (sum, carry, overflow) = add(a, !b, true);
            let zero = u32::from(sum == 0) << 30;
            sum & N | zero | u32::from(carry) << 29 | u32::from(overflow) << 28
        };
        let mut reached = 0;
        for _ in 0..20_000 {
            let with = [0, 1 << 31, u32::MAX, next()][next() as usize % 4].wrapping_add(next() % 3);
            let edge = [0, 1 << 31, with, with ^ 1 << 31][next() as usize % 4];
            let value = edge.wrapping_add(next() % 64).wrapping_sub(32);
            let falls = next() % 2 == 1;
            let shift = [0, 0, 3, 8][next() as usize % 4];
            let coarse = [0, 0, 7][next() as usize % 3];
            let line = Line {
                falls,
                hz: 1,
                shift,
                coarse,
            };
            let exact = value;
            let value = exact & !coarse;
            let ticks = Comparison { line, value, with }.steady_ticks();
            let moved = |tick: u64| {
                let by = (tick as u32) << shift;
                if falls {
                    value.wrapping_sub(by)
                } else {
                    value.wrapping_add(by)
                }
            };
            for swapped in [false, true] {
                let of = |value| {
                    if swapped {
                        flags(with, value)
                    } else {
                        flags(value, with)
                    }
                };
                let steady = |tick| conditions(of(moved(tick))) == conditions(of(value));
                assert!(
                    (0..ticks.min(200)).all(steady),
                    "{value:#x} {with:#x} {line:?} {ticks}"
                );
                reached += u32::from(ticks < 200 && !steady(ticks));
            }
        }
        assert!(reached > 5000, "{reached} reached an edge");
    }

    fn conditions(xpsr: u32) -> Vec<bool> {
        (0..14).map(|condition| passes(xpsr, condition)).collect()
    }
}
