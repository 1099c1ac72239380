//! Instructions as the interpreter executes them (ARMv7-M ARM, A5).

use super::alu::{self, Shift};

/// An operation on two operands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Operation {
    And,
    Bic,
    Orr,
    Orn,
    Eor,
    Add,
    Adc,
    Sbc,
    Sub,
    Rsb,
    /// The second operand.
    Mov,
    /// Its complement.
    Mvn,
}

/// A second operand.
#[derive(Debug, Clone, Copy)]
pub(super) enum Operand {
    /// A number, and the carry that its expansion leaves.
    Number(u32, Option<bool>),
    Register(u8, (Shift, u32)),
    /// A register that is shifted by the lowest byte of another.
    ShiftedBy(u8, Shift, u8),
}

/// Flags that an instruction sets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Flags {
    Kept,
    Set,
    /// Set outside of an IT block.
    SetOutside,
}

/// The data of a load or store.
#[derive(Debug, Clone, Copy)]
pub(super) struct Datum {
    pub(super) bytes: u32,
    pub(super) signed: bool,
    pub(super) store: bool,
}

/// Address of a load or store.
#[derive(Debug, Clone, Copy)]
pub(super) enum Place {
    /// A literal.
    Absolute(u32),
    /// Base and offset. `index`: the access is at their sum. `write_back`: the base becomes their sum.
    Offset {
        base: u8,
        offset: u32,
        index: bool,
        write_back: bool,
    },
    Sum(u8, u8, u8),
}

#[derive(Debug, Clone, Copy)]
pub(super) enum Instruction {
    /// Destination (none for a comparison), first operand, second operand.
    Data {
        operation: Operation,
        flags: Flags,
        to: Option<u8>,
        first: u8,
        second: Operand,
    },
    Memory {
        datum: Datum,
        register: u8,
        place: Place,
    },
    /// Two registers at an address.
    Pair {
        store: bool,
        registers: [u8; 2],
        place: Place,
    },
    /// Several registers: a bit for each. `down` as PUSH does.
    Several {
        store: bool,
        base: u8,
        registers: u16,
        down: bool,
        write_back: bool,
    },
    Branch {
        to: u32,
        condition: u8,
        link: bool,
    },
    BranchTo {
        register: u8,
        link: bool,
    },
    BranchIfZero {
        register: u8,
        not: bool,
        to: u32,
    },
    /// TBB and TBH: a table of distances from an address. The table begins there if its register is R15.
    BranchByTable {
        table: u8,
        index: u8,
        halves: bool,
        from: u32,
    },
    IfThen(u8),
    Nothing,
    /// The low byte or halfword, extended.
    Extend {
        to: u8,
        from: u8,
        rotation: u32,
        bits: u32,
        signed: bool,
    },
    Reverse {
        to: u8,
        from: u8,
        kind: u8,
    },
    Multiply {
        to: u8,
        a: u8,
        b: u8,
        add: Option<u8>,
        subtract: bool,
        flags: Flags,
    },
    MultiplyLong {
        to: [u8; 2],
        a: u8,
        b: u8,
        signed: bool,
        accumulate: bool,
    },
    Divide {
        to: u8,
        a: u8,
        b: u8,
        signed: bool,
    },
    BitField {
        to: u8,
        from: u8,
        low: u32,
        width: u32,
        signed: bool,
    },
    /// `from` is `None` for BFC.
    Insert {
        to: u8,
        from: Option<u8>,
        low: u32,
        width: u32,
    },
    /// MOVT.
    MoveTop {
        to: u8,
        number: u32,
    },
    LeadingZeros {
        to: u8,
        from: u8,
    },
    /// MSR of BASEPRI.
    SetBasePriority(u8),
}

use Instruction::{
    BitField, Branch, BranchByTable, BranchIfZero, BranchTo, Data, Divide, Extend, IfThen, Insert,
    LeadingZeros, Memory, MoveTop, Multiply, MultiplyLong, Nothing, Pair, Reverse, SetBasePriority, Several,
};

/// Condition of what is always executed.
pub(super) const ALWAYS: u8 = 14;
const SP: u8 = 13;
const PC: u8 = 15;

const fn bits(word: u32, low: u32, count: u32) -> u32 {
    word >> low & ((1 << count) - 1)
}

const fn register(word: u32, low: u32) -> u8 {
    bits(word, low, 3) as u8
}

/// A register's number of four bits.
const fn any(word: u32, low: u32) -> u8 {
    bits(word, low, 4) as u8
}

const fn is_set(word: u32, bit: u32) -> bool {
    word >> bit & 1 == 1
}

fn extended(value: u32, bits: u32) -> u32 {
    ((value << (32 - bits)) as i32 >> (32 - bits)) as u32
}

const fn plain(number: u32) -> Operand {
    Operand::Number(number, None)
}

const fn of(register: u8) -> Operand {
    Operand::Register(register, (Shift::Lsl, 0))
}

/// Returns `true` if a second halfword follows.
pub(super) fn is_wide(first: u16) -> bool {
    first >> 11 >= 0b11101
}

/// Decodes a narrow instruction. `None` if the interpreter does not know it.
pub(super) fn narrow(half: u16, at: u32) -> Option<Instruction> {
    let w = u32::from(half);
    Some(match w >> 10 {
        0b00_0000..=0b00_0101 => {
            let second = Operand::Register(register(w, 3), alu::immediate(w >> 11, bits(w, 6, 5)));
            data(Operation::Mov, Some(register(w, 0)), 0, second)
        }
        0b00_0110 | 0b00_0111 => {
            let second = if is_set(w, 10) {
                plain(bits(w, 6, 3))
            } else {
                of(register(w, 6))
            };
            data(sum(w, 9), Some(register(w, 0)), register(w, 3), second)
        }
        0b00_1000..=0b00_1111 => {
            let (r, second) = (register(w, 8), plain(bits(w, 0, 8)));
            match bits(w, 11, 2) {
                0 => data(Operation::Mov, Some(r), 0, second),
                1 => compare(Operation::Sub, r, second),
                2 => data(Operation::Add, Some(r), r, second),
                _ => data(Operation::Sub, Some(r), r, second),
            }
        }
        0b01_0000 => processing(w),
        0b01_0001 => special(w)?,
        0b01_0010 | 0b01_0011 => {
            let place = Place::Absolute((at & !3) + 4 + 4 * bits(w, 0, 8));
            access(LOAD, register(w, 8), place)
        }
        0b01_0100..=0b10_0111 => memory(w),
        0b10_1000..=0b10_1011 => {
            let (to, number) = (register(w, 8), 4 * bits(w, 0, 8));
            if is_set(w, 11) {
                quiet(Operation::Add, to, SP, plain(number))
            } else {
                quiet(Operation::Mov, to, 0, plain((at & !3) + 4 + number))
            }
        }
        0b10_1100..=0b10_1111 => miscellaneous(w, at)?,
        0b11_0000..=0b11_0011 => {
            let (base, list, store) = (register(w, 8), bits(w, 0, 8) as u16, !is_set(w, 11));
            let write_back = store || list >> base & 1 == 0;
            Several {
                store,
                base,
                registers: list,
                down: false,
                write_back,
            }
        }
        0b11_0100..=0b11_0111 if bits(w, 8, 4) < 14 => {
            let to = (at + 4).wrapping_add(extended(bits(w, 0, 8) << 1, 9));
            jump(to, bits(w, 8, 4) as u8)
        }
        0b11_1000 | 0b11_1001 => {
            let to = (at + 4).wrapping_add(extended(bits(w, 0, 11) << 1, 12));
            jump(to, ALWAYS)
        }
        _ => return None,
    })
}

const LOAD: Datum = Datum {
    bytes: 4,
    signed: false,
    store: false,
};

fn data(operation: Operation, to: Option<u8>, first: u8, second: Operand) -> Instruction {
    Data {
        operation,
        flags: Flags::SetOutside,
        to,
        first,
        second,
    }
}

fn compare(operation: Operation, first: u8, second: Operand) -> Instruction {
    Data {
        operation,
        flags: Flags::Set,
        to: None,
        first,
        second,
    }
}

fn quiet(operation: Operation, to: u8, first: u8, second: Operand) -> Instruction {
    Data {
        operation,
        flags: Flags::Kept,
        to: Some(to),
        first,
        second,
    }
}

const fn access(datum: Datum, register: u8, place: Place) -> Instruction {
    Memory {
        datum,
        register,
        place,
    }
}

/// Subtraction if a bit is set, else addition.
const fn sum(word: u32, bit: u32) -> Operation {
    if is_set(word, bit) {
        Operation::Sub
    } else {
        Operation::Add
    }
}

/// A branch without a link.
const fn jump(to: u32, condition: u8) -> Instruction {
    let link = false;
    Branch { to, condition, link }
}

/// PUSH and POP.
const fn stack(store: bool, registers: u16) -> Instruction {
    Several {
        store,
        base: SP,
        registers,
        down: store,
        write_back: true,
    }
}

/// An offset that is added, or taken away.
const fn signed(offset: u32, up: bool) -> u32 {
    if up { offset } else { offset.wrapping_neg() }
}

fn processing(w: u32) -> Instruction {
    let (r, m) = (register(w, 0), register(w, 3));
    let by = |shift| data(Operation::Mov, Some(r), 0, Operand::ShiftedBy(r, shift, m));
    let with = |operation| data(operation, Some(r), r, of(m));
    match bits(w, 6, 4) {
        0 => with(Operation::And),
        1 => with(Operation::Eor),
        2 => by(Shift::Lsl),
        3 => by(Shift::Lsr),
        4 => by(Shift::Asr),
        5 => with(Operation::Adc),
        6 => with(Operation::Sbc),
        7 => by(Shift::Ror),
        8 => compare(Operation::And, r, of(m)),
        9 => data(Operation::Rsb, Some(r), m, plain(0)),
        10 => compare(Operation::Sub, r, of(m)),
        11 => compare(Operation::Add, r, of(m)),
        12 => with(Operation::Orr),
        13 => Multiply {
            to: r,
            a: r,
            b: m,
            add: None,
            subtract: false,
            flags: Flags::SetOutside,
        },
        14 => with(Operation::Bic),
        _ => with(Operation::Mvn),
    }
}

fn special(w: u32) -> Option<Instruction> {
    let (r, m) = (register(w, 0) | (bits(w, 7, 1) << 3) as u8, any(w, 3));
    let uses_pc = r == PC || m == PC;
    match bits(w, 8, 2) {
        0 if !uses_pc => Some(quiet(Operation::Add, r, r, of(m))),
        1 if !uses_pc => Some(compare(Operation::Sub, r, of(m))),
        2 if !uses_pc => Some(quiet(Operation::Mov, r, 0, of(m))),
        3 if m != PC && bits(w, 0, 3) == 0 => Some(BranchTo {
            register: m,
            link: is_set(w, 7),
        }),
        _ => None,
    }
}

fn memory(w: u32) -> Instruction {
    let datum = |bytes, signed, store| Datum { bytes, signed, store };
    let offset = |base, offset| Place::Offset {
        base,
        offset,
        index: true,
        write_back: false,
    };
    let (r, base) = (register(w, 0), register(w, 3));
    let number = bits(w, 6, 5);
    match w >> 12 {
        0b0101 => {
            const KINDS: [(u32, bool, bool); 8] = [
                (4, false, true),
                (2, false, true),
                (1, false, true),
                (1, true, false),
                (4, false, false),
                (2, false, false),
                (1, false, false),
                (2, true, false),
            ];
            let (bytes, signed, store) = KINDS[bits(w, 9, 3) as usize];
            let place = Place::Sum(base, register(w, 6), 0);
            access(datum(bytes, signed, store), r, place)
        }
        kind @ (0b0110..=0b1000) => {
            let bytes = [4, 1, 2][kind as usize - 0b0110];
            let place = offset(base, number * bytes);
            access(datum(bytes, false, !is_set(w, 11)), r, place)
        }
        _ => {
            let place = offset(SP, 4 * bits(w, 0, 8));
            access(datum(4, false, !is_set(w, 11)), register(w, 8), place)
        }
    }
}

fn miscellaneous(w: u32, at: u32) -> Option<Instruction> {
    let (r, m) = (register(w, 0), register(w, 3));
    Some(match bits(w, 8, 4) {
        0b0000 => quiet(sum(w, 7), SP, SP, plain(4 * bits(w, 0, 7))),
        0b0001 | 0b0011 | 0b1001 | 0b1011 => {
            let to = at + 4 + (bits(w, 9, 1) << 6 | bits(w, 3, 5) << 1);
            BranchIfZero {
                register: r,
                not: is_set(w, 11),
                to,
            }
        }
        0b0010 => {
            let (width, signed) = (if is_set(w, 6) { 8 } else { 16 }, !is_set(w, 7));
            Extend {
                to: r,
                from: m,
                rotation: 0,
                bits: width,
                signed,
            }
        }
        0b0100 | 0b0101 => {
            let registers = bits(w, 0, 8) as u16 | (bits(w, 8, 1) << 14) as u16;
            stack(true, registers)
        }
        0b1100 | 0b1101 => {
            let registers = bits(w, 0, 8) as u16 | (bits(w, 8, 1) << 15) as u16;
            stack(false, registers)
        }
        0b1010 if bits(w, 6, 2) != 2 => Reverse {
            to: r,
            from: m,
            kind: bits(w, 6, 2) as u8,
        },
        0b1111 if bits(w, 0, 4) != 0 => IfThen(bits(w, 0, 8) as u8),
        // NOP and YIELD.
        0b1111 if bits(w, 4, 4) < 2 => Nothing,
        _ => return None,
    })
}

/// Decodes a wide instruction. `None` if the interpreter does not know it.
pub(super) fn wide(first: u16, second: u16, at: u32) -> Option<Instruction> {
    let (a, b) = (u32::from(first), u32::from(second));
    match (bits(a, 11, 2), bits(a, 4, 7)) {
        (1, op) if op & 0b110_0100 == 0 => multiple(a, b),
        (1, op) if op & 0b110_0100 == 0b100 => pair(a, b, at),
        (1, op) if op & 0b110_0000 == 0b010_0000 => {
            let shift = alu::immediate(b >> 4, bits(b, 12, 3) << 2 | bits(b, 6, 2));
            modified(a, b, Operand::Register(any(b, 0), shift))
        }
        (2, _) if is_set(b, 15) => branch(a, b, at),
        (2, op) if op & 0b10_0000 == 0 => {
            let (number, carry) = alu::expand(bits(a, 10, 1) << 11 | bits(b, 12, 3) << 8 | bits(b, 0, 8));
            modified(a, b, Operand::Number(number, carry))
        }
        (2, _) => binary(a, b, at),
        (3, op) if op & 0b110_0000 == 0 => single(a, b, at),
        (3, op) if op & 0b111_0000 == 0b010_0000 => registers(a, b),
        (3, op) if op & 0b111_0000 == 0b011_0000 => product(a, b),
        _ => None,
    }
}

/// Data processing that may set flags.
fn modified(a: u32, b: u32, second: Operand) -> Option<Instruction> {
    let (first, to, sets) = (any(a, 0), any(b, 8), is_set(a, 4));
    if let Operand::Register(SP | PC, _) = second {
        return None;
    }
    let operation = match (bits(a, 5, 4), first) {
        (0, _) => Operation::And,
        (1, _) => Operation::Bic,
        (2, PC) => Operation::Mov,
        (2, _) => Operation::Orr,
        (3, PC) => Operation::Mvn,
        (3, _) => Operation::Orn,
        (4, _) => Operation::Eor,
        (8, _) => Operation::Add,
        (10, _) => Operation::Adc,
        (11, _) => Operation::Sbc,
        (13, _) => Operation::Sub,
        (14, _) => Operation::Rsb,
        _ => return None,
    };
    let flags = if sets { Flags::Set } else { Flags::Kept };
    let unary = matches!(operation, Operation::Mov | Operation::Mvn);
    if to == PC {
        let compares = matches!(
            operation,
            Operation::And | Operation::Eor | Operation::Add | Operation::Sub
        );
        return (sets && compares && first != PC).then_some(compare(operation, first, second));
    }
    (unary || first != PC).then_some(Data {
        operation,
        flags,
        to: Some(to),
        first,
        second,
    })
}

/// Data processing with a plain number.
fn binary(a: u32, b: u32, at: u32) -> Option<Instruction> {
    let (from, to) = (any(a, 0), any(b, 8));
    let number = bits(a, 10, 1) << 11 | bits(b, 12, 3) << 8 | bits(b, 0, 8);
    let (low, last) = (bits(b, 12, 3) << 2 | bits(b, 6, 2), bits(b, 0, 5));
    if to == PC {
        return None;
    }
    Some(match (bits(a, 4, 5), from) {
        (0b00000, PC) => quiet(Operation::Mov, to, 0, plain((at & !3) + 4 + number)),
        (0b01010, PC) => quiet(Operation::Mov, to, 0, plain(((at & !3) + 4).wrapping_sub(number))),
        (0b00000, _) => quiet(Operation::Add, to, from, plain(number)),
        (0b01010, _) => quiet(Operation::Sub, to, from, plain(number)),
        (0b00100, _) => quiet(Operation::Mov, to, 0, plain(u32::from(from) << 12 | number)),
        (0b01100, _) => MoveTop {
            to,
            number: u32::from(from) << 12 | number,
        },
        (kind @ (0b10100 | 0b11100), _) if low + last < 32 => BitField {
            to,
            from,
            low,
            width: last + 1,
            signed: kind == 0b10100,
        },
        (0b10110, _) if last >= low => Insert {
            to,
            from: (from != PC).then_some(from),
            low,
            width: last + 1 - low,
        },
        _ => return None,
    })
}

fn branch(a: u32, b: u32, at: u32) -> Option<Instruction> {
    let s = bits(a, 10, 1);
    let (j1, j2) = (bits(b, 13, 1), bits(b, 11, 1));
    if !is_set(b, 12) && !is_set(b, 14) {
        let condition = bits(a, 6, 4) as u8;
        if condition >= 14 {
            if bits(a, 4, 12) == 0xf38 && b == 0x8811 {
                return Some(SetBasePriority(any(a, 0)));
            }
            // NOP and YIELD; DSB, DMB and ISB.
            let hint = a == 0xf3af && matches!(b, 0x8000 | 0x8001);
            let barrier = a == 0xf3bf && matches!(b & 0xfff0, 0x8f40 | 0x8f50 | 0x8f60);
            return (hint || barrier).then_some(Nothing);
        }
        let offset = s << 20 | j2 << 19 | j1 << 18 | bits(a, 0, 6) << 12 | bits(b, 0, 11) << 1;
        let to = (at + 4).wrapping_add(extended(offset, 21));
        return Some(jump(to, condition));
    }
    // BL, and B with the longer offset.
    if !is_set(b, 12) {
        return None;
    }
    let (i1, i2) = (1 ^ j1 ^ s, 1 ^ j2 ^ s);
    let offset = s << 24 | i1 << 23 | i2 << 22 | bits(a, 0, 10) << 12 | bits(b, 0, 11) << 1;
    let to = (at + 4).wrapping_add(extended(offset, 25));
    Some(Branch {
        to,
        condition: ALWAYS,
        link: is_set(b, 14),
    })
}

fn multiple(a: u32, b: u32) -> Option<Instruction> {
    let (base, store) = (any(a, 0), !is_set(a, 4));
    let down = match bits(a, 7, 2) {
        1 => false,
        2 => true,
        _ => return None,
    };
    let registers = b as u16;
    let odd = registers >> SP & 1 == 1 || base == PC || (store && registers >> PC & 1 == 1);
    (!odd).then_some(Several {
        store,
        base,
        registers,
        down,
        write_back: is_set(a, 5),
    })
}

fn pair(a: u32, b: u32, at: u32) -> Option<Instruction> {
    let (index, up, write_back) = (is_set(a, 8), is_set(a, 7), is_set(a, 5));
    if !index && !write_back {
        if bits(a, 4, 12) == 0xe8d && bits(b, 5, 11) == 0xf000 >> 5 && any(b, 0) != PC {
            return Some(BranchByTable {
                table: any(a, 0),
                index: any(b, 0),
                halves: is_set(b, 4),
                from: at + 4,
            });
        }
        // Exclusive accesses.
        return None;
    }
    let (base, offset) = (any(a, 0), signed(4 * bits(b, 0, 8), up));
    let place = if base == PC {
        Place::Absolute(((at & !3) + 4).wrapping_add(offset))
    } else {
        Place::Offset {
            base,
            offset,
            index,
            write_back,
        }
    };
    let registers = [any(b, 12), any(b, 8)];
    let plain = registers.iter().all(|r| *r < SP);
    plain.then_some(Pair {
        store: !is_set(a, 4),
        registers,
        place,
    })
}

fn single(a: u32, b: u32, at: u32) -> Option<Instruction> {
    let (base, r, store) = (any(a, 0), any(b, 12), !is_set(a, 4));
    let bytes = match bits(a, 5, 2) {
        0 => 1,
        1 => 2,
        2 => 4,
        _ => return None,
    };
    // A load to PC is a jump if it loads a word, else a hint.
    if r == PC {
        return None;
    }
    let datum = Datum {
        bytes,
        signed: is_set(a, 8),
        store,
    };
    let place = if base == PC && !store {
        let offset = signed(bits(b, 0, 12), is_set(a, 7));
        Place::Absolute(((at & !3) + 4).wrapping_add(offset))
    } else if is_set(a, 7) {
        Place::Offset {
            base,
            offset: bits(b, 0, 12),
            index: true,
            write_back: false,
        }
    } else if is_set(b, 11) {
        let (index, up, write_back) = (is_set(b, 10), is_set(b, 9), is_set(b, 8));
        if index && up && !write_back {
            return None;
        }
        Place::Offset {
            base,
            offset: signed(bits(b, 0, 8), up),
            index,
            write_back,
        }
    } else if bits(b, 6, 5) == 0 {
        Place::Sum(base, any(b, 0), bits(b, 4, 2) as u8)
    } else {
        return None;
    };
    Some(access(datum, r, place))
}

/// Shifts by a register, and extensions.
fn registers(a: u32, b: u32) -> Option<Instruction> {
    if bits(b, 12, 4) != 15 {
        return None;
    }
    let (first, to, m) = (any(a, 0), any(b, 8), any(b, 0));
    match (bits(a, 4, 4), bits(b, 4, 4)) {
        (kind @ 0..=7, 0) => {
            let shift = [Shift::Lsl, Shift::Lsr, Shift::Asr, Shift::Ror][kind as usize >> 1];
            let flags = if kind & 1 == 1 { Flags::Set } else { Flags::Kept };
            Some(Data {
                operation: Operation::Mov,
                flags,
                to: Some(to),
                first: 0,
                second: Operand::ShiftedBy(first, shift, m),
            })
        }
        (kind @ (0 | 1 | 4 | 5), 8..) if first == PC => {
            let width = if kind < 4 { 16 } else { 8 };
            let rotation = 8 * bits(b, 4, 2);
            Some(Extend {
                to,
                from: m,
                rotation,
                bits: width,
                signed: kind & 1 == 0,
            })
        }
        (9, kind @ (8 | 9 | 11)) => Some(Reverse {
            to,
            from: m,
            kind: (kind & 3) as u8,
        }),
        (11, 8) => Some(LeadingZeros { to, from: m }),
        _ => None,
    }
}

fn product(a: u32, b: u32) -> Option<Instruction> {
    let (n, d, m, ra) = (any(a, 0), any(b, 8), any(b, 0), any(b, 12));
    let long = |signed, accumulate| MultiplyLong {
        to: [ra, d],
        a: n,
        b: m,
        signed,
        accumulate,
    };
    match (bits(a, 4, 4), bits(b, 4, 4)) {
        (0, kind @ (0 | 1)) => {
            let add = (ra != PC).then_some(ra);
            Some(Multiply {
                to: d,
                a: n,
                b: m,
                add,
                subtract: kind == 1,
                flags: Flags::Kept,
            })
        }
        (8, 0) => Some(long(true, false)),
        (10, 0) => Some(long(false, false)),
        (12, 0) => Some(long(true, true)),
        (14, 0) => Some(long(false, true)),
        (kind @ (9 | 11), 15) => Some(Divide {
            to: d,
            a: n,
            b: m,
            signed: kind == 9,
        }),
        _ => None,
    }
}
