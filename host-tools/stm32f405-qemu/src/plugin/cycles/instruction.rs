//! The properties of a Thumb instruction on which its time depends.
//!
//! Cycles are from the Cortex-M4 Technical Reference Manual (DDI0439B, tables 3-1 and 7-1), and encodings
//! from the ARMv7-M Architecture Reference Manual (DDI0403E, chapter A5).

/// The unit that an instruction keeps busy, and for how long.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Work {
    /// Cycles in the core only.
    Core(u8),
    /// UDIV and SDIV: 2 to 12 cycles, depending on the operands.
    Divide,
    /// DSB, DMB and ISB: one cycle, and the time that they wait.
    Barrier,
    /// A single load: 2 cycles, or 1 behind another one.
    Load,
    /// A single store: 1 cycle, since a buffer takes it.
    Store,
    /// A single store with its offset in a register: takes as long as a load.
    StoreAtOffset,
    /// A load or store of this many words: one cycle for each, and one more.
    Words(u8),
}

/// The properties of a Thumb instruction on which its time depends. Sets of registers have a bit for each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Instruction {
    pub(super) address: u32,
    /// Length of the instruction: 2 or 4.
    pub(super) bytes: u32,
    pub(super) work: Work,
    /// True if execution can continue elsewhere than at the next instruction.
    pub(super) branches: bool,
    /// Registers that a data processing instruction writes.
    written: u16,
    /// The register that a single load writes.
    loaded: u16,
    /// Registers that form the address of a load or a store.
    addressed_by: u16,
}

const SP: u16 = 1 << 13;
const PC: u16 = 1 << 15;

impl Instruction {
    /// Decodes an instruction. `word` is its halfword, or its two with the first in the low half.
    pub(super) fn decode(address: u32, word: u32) -> Self {
        let [first, second] = [word as u16, (word >> 16) as u16];
        let this = Self {
            address,
            bytes: if first >= 0xe800 { 4 } else { 2 },
            work: Work::Core(1),
            branches: false,
            written: 0,
            loaded: 0,
            addressed_by: 0,
        };
        match first {
            0xe800.. => this.wide(first, second),
            0x5000..=0x9fff | 0x4800..=0x4fff | 0xb400..=0xb5ff | 0xbc00..=0xbdff | 0xc000..=0xcfff => {
                this.narrow_access(first)
            }
            _ => this.narrow(first),
        }
    }

    fn narrow(self, first: u16) -> Self {
        let (low, upper) = (1 << (first & 7), 1 << (first >> 8 & 7));
        match first {
            // Compares.
            0x2800..=0x2fff | 0x4200..=0x423f | 0x4280..=0x42ff | 0x4500..=0x45ff => self,
            0x0000..=0x1fff | 0x4000..=0x43ff | 0xb200..=0xb2ff | 0xba00..=0xbaff => self.writes(low),
            0x2000..=0x3fff | 0xa000..=0xafff => self.writes(upper),
            0x4400..=0x46ff => self.writes(1 << (first >> 4 & 8 | first & 7)),
            0xb000..=0xb0ff => self.writes(SP),
            // CPS.
            0xb660..=0xb67f => self.takes(Work::Core(2)),
            // BX, BLX; B with a condition; B; CBZ, CBNZ.
            0x4700..=0x47ff | 0xd000..=0xddff | 0xe000..=0xe7ff => self.going_elsewhere(),
            _ if first & 0xf500 == 0xb100 => self.going_elsewhere(),
            _ => self,
        }
    }

    fn narrow_access(self, first: u16) -> Self {
        let [low, base, offset, upper] = [0, 3, 6, 8].map(|at| 1 << (first >> at & 7));
        let is_load = first & 0x800 != 0;
        match first {
            0x4800..=0x4fff => self.loads(upper, 0),
            0x5000..=0x55ff => self.takes(Work::StoreAtOffset).at(base | offset),
            0x5600..=0x5fff => self.loads(low, base | offset),
            0x6000..=0x8fff if is_load => self.loads(low, base),
            0x6000..=0x8fff => self.takes(Work::Store).at(base),
            0x9000..=0x9fff if is_load => self.loads(upper, SP),
            0x9000..=0x9fff => self.takes(Work::Store).at(SP),
            0xb400..=0xb5ff => self.words(first & 0x1ff).at(SP),
            0xbd00..=0xbdff => self.words(first & 0x1ff).at(SP).going_elsewhere(),
            0xbc00..=0xbcff => self.words(first & 0xff).at(SP),
            _ => self.words(first & 0xff).at(upper),
        }
    }

    fn wide(self, first: u16, second: u16) -> Self {
        let base = 1 << (first & 0xf);
        let [low, middle, upper] = [0, 8, 12].map(|at| 1 << (second >> at & 0xf));
        let is_load = first & 0x10 != 0;
        match first {
            // Many words. Bit 15 is the PC.
            _ if first & 0xfe40 == 0xe800 => {
                let this = self.words(second).at(base);
                if is_load && second & 0x8000 != 0 {
                    this.going_elsewhere()
                } else {
                    this
                }
            }
            // TBB and TBH read an offset and add it.
            0xe8d0..=0xe8df if second & 0xffe0 == 0xf000 => {
                self.takes(Work::Core(2)).at(base | low).going_elsewhere()
            }
            // Exclusive loads and stores.
            0xe850..=0xe85f | 0xe8d0..=0xe8df => self.loads(upper, base),
            0xe840..=0xe84f | 0xe8c0..=0xe8cf => self.takes(Work::StoreAtOffset).at(base),
            _ if first & 0xfe40 == 0xe840 => self.takes(Work::Words(2)).at(base),
            0xea00..=0xebff | 0xfa00..=0xfaff => self.writes(middle),
            0xec00..=0xefff | 0xfc00.. => self.floating_point(first, second),
            0xf000..=0xf7ff if second & 0x8000 == 0 => self.writes(middle),
            0xf000..=0xf7ff => self.branch_or_control(first, second),
            0xf800..=0xf9ff => self.single(first, second),
            // SDIV and UDIV; long products; others.
            0xfb90..=0xfb9f | 0xfbb0..=0xfbbf => self.takes(Work::Divide).writes(middle),
            0xfb80..=0xfbff => self.writes(middle | upper),
            _ => self.writes(middle),
        }
    }

    fn single(self, first: u16, second: u16) -> Self {
        let [base, offset, register] = [first & 0xf, second & 0xf, second >> 12].map(|number| 1 << number);
        let by_register = base != PC && first & 0x80 == 0 && second & 0xfc0 == 0;
        let address = if by_register { base | offset } else { base };
        match (first & 0x10 != 0, register) {
            (true, PC) if first & 0x60 == 0x40 => self.loads(PC, address).going_elsewhere(),
            // Preloads.
            (true, PC) => self,
            (true, _) => self.loads(register, address),
            (false, _) if by_register => self.takes(Work::StoreAtOffset).at(address),
            (false, _) => self.takes(Work::Store).at(address),
        }
    }

    fn branch_or_control(self, first: u16, second: u16) -> Self {
        let is_conditional = second & 0x5000 == 0;
        match (first, second >> 4 & 0xf) {
            _ if !is_conditional || first & 0x380 != 0x380 => self.going_elsewhere(),
            // DSB, DMB, ISB.
            (0xf3bf, 4..=6) => self.takes(Work::Barrier),
            // MSR, MRS.
            (0xf380..=0xf39f | 0xf3e0..=0xf3ff, _) => self.takes(Work::Core(2)),
            _ => self,
        }
    }

    fn floating_point(self, first: u16, second: u16) -> Self {
        let base = 1 << (first & 0xf);
        let is_double = second & 0x100 != 0;
        match first {
            // Transfers of two registers.
            0xec40..=0xec5f => self.takes(Work::Core(2)),
            _ if first & 0xff20 == 0xed00 => self.takes(Work::Words(1 + u8::from(is_double))).at(base),
            0xec00..=0xedff => self.takes(Work::Words(second as u8)).at(base),
            // VSQRT; VDIV; the products with a sum.
            _ if first & 0xffbf == 0xeeb1 && second & 0xd0 == 0xc0 => self.takes(Work::Core(14)),
            _ if first & 0xffb0 == 0xee80 && second & 0x50 == 0 => self.takes(Work::Core(14)),
            _ if matches!(first & 0xffb0, 0xee00 | 0xee10 | 0xee90 | 0xeea0) && second & 0x10 == 0 => {
                self.takes(Work::Core(3))
            }
            _ => self,
        }
    }

    fn takes(self, work: Work) -> Self {
        Self { work, ..self }
    }

    fn words(self, registers: u16) -> Self {
        self.takes(Work::Words(registers.count_ones() as u8))
    }

    fn loads(self, loaded: u16, addressed_by: u16) -> Self {
        Self {
            loaded,
            ..self.takes(Work::Load).at(addressed_by)
        }
    }

    fn at(self, addressed_by: u16) -> Self {
        Self { addressed_by, ..self }
    }

    fn writes(self, written: u16) -> Self {
        Self {
            written: written & !PC,
            branches: written & PC != 0 && self.bytes == 2,
            ..self
        }
    }

    fn going_elsewhere(self) -> Self {
        Self {
            branches: true,
            ..self
        }
    }

    /// Probable and greatest number of cycles in the core after another instruction, without a branch and
    /// with memory that is always ready. `skipped`: the condition did not hold, so nothing was accessed.
    pub(super) fn cycles(&self, before: Option<&Self>, skipped: bool) -> [u32; 2] {
        if skipped {
            return [1, 1];
        }
        let waits = |of: fn(&Self) -> u16| before.is_some_and(|before| of(before) & self.addressed_by != 0);
        // Section 3.3.2: an access takes a cycle more if the instruction before computes its address. A
        // single access after a load is a cycle shorter, unless that load provides its address.
        let late = u32::from(waits(|before| before.written));
        let behind_load = before.is_some_and(|before| before.work == Work::Load);
        let single = 2 - u32::from(behind_load && !waits(|before| before.loaded));
        let [probable, most] = match self.work {
            Work::Core(cycles) => [u32::from(cycles); 2],
            Work::Divide => [7, 12],
            Work::Barrier => [4, 6],
            Work::Load | Work::StoreAtOffset => [single, 2],
            Work::Store => [1, 1],
            Work::Words(words) => [1 + u32::from(words); 2],
        };
        [probable + late, most + late]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_instruction_is_what_its_encoding_says() {
        let registers = |set: u16| (0..16).filter(|n| set >> n & 1 != 0).collect::<Vec<_>>();
        // Disassembly by llvm-mc.
        let cases: [(u32, Work, bool, [&[u8]; 3]); 37] = [
            (0x3801, Work::Core(1), false, [&[0], &[], &[]]), // subs r0, #1
            (0x2801, Work::Core(1), false, [&[], &[], &[]]),  // cmp r0, #1
            (0x428a, Work::Core(1), false, [&[], &[], &[]]),  // cmp r2, r1
            (0x4351, Work::Core(1), false, [&[1], &[], &[]]), // muls r1, r2, r1
            (0x46a1, Work::Core(1), false, [&[9], &[], &[]]), // mov r9, r4
            (0x46a7, Work::Core(1), true, [&[], &[], &[]]),   // mov pc, r4
            (0x4770, Work::Core(1), true, [&[], &[], &[]]),   // bx lr
            (0xd1fd, Work::Core(1), true, [&[], &[], &[]]),   // bne
            (0xb118, Work::Core(1), true, [&[], &[], &[]]),   // cbz r0
            (0xb662, Work::Core(2), false, [&[], &[], &[]]),  // cpsie i
            (0xbf08, Work::Core(1), false, [&[], &[], &[]]),  // it eq
            (0xb082, Work::Core(1), false, [&[13], &[], &[]]), // sub sp, #8
            (0x4a03, Work::Load, false, [&[], &[2], &[]]),    // ldr r2, [pc, #12]
            (0x5a88, Work::Load, false, [&[], &[0], &[1, 2]]), // ldrh r0, [r1, r2]
            (0x5088, Work::StoreAtOffset, false, [&[], &[], &[1, 2]]), // str r0, [r1, r2]
            (0x6848, Work::Load, false, [&[], &[0], &[1]]),   // ldr r0, [r1, #4]
            (0x9a01, Work::Load, false, [&[], &[2], &[13]]),  // ldr r2, [sp, #4]
            (0x7048, Work::Store, false, [&[], &[], &[1]]),   // strb r0, [r1, #1]
            (0xb5f0, Work::Words(5), false, [&[], &[], &[13]]), // push {r4-r7, lr}
            (0xbdf0, Work::Words(5), true, [&[], &[], &[13]]), // pop {r4-r7, pc}
            (0xca03, Work::Words(2), false, [&[], &[], &[2]]), // ldm r2!, {r0, r1}
            (0x8ff0_e8bd, Work::Words(9), true, [&[], &[], &[13]]), // pop.w {r4-r11, pc}
            (0x2300_e9d1, Work::Words(2), false, [&[], &[], &[1]]), // ldrd r2, r3, [r1]
            (0xf001_e8df, Work::Core(2), true, [&[], &[], &[1, 15]]), // tbb [pc, r1]
            (0x2f00_e851, Work::Load, false, [&[], &[2], &[1]]), // ldrex r2, [r1]
            (0x0987_ea87, Work::Core(1), false, [&[9], &[], &[]]), // eor.w r9, r7, r7, lsl #2
            (0x78a3_fba3, Work::Core(1), false, [&[8, 7], &[], &[]]), // umull r7, r8, r3, r3
            (0x1105_fb50, Work::Core(1), false, [&[1], &[], &[]]), // smmla r1, r0, r5, r1
            (0xfaf5_fbb9, Work::Divide, false, [&[10], &[], &[]]), // udiv r10, r9, r5
            (0x8002_f3af, Work::Core(1), false, [&[], &[], &[]]), // wfe.w
            (0x8f4f_f3bf, Work::Barrier, false, [&[], &[], &[]]), // dsb sy
            (0x8810_f380, Work::Core(2), false, [&[], &[], &[]]), // msr primask, r0
            (0xf802_f000, Work::Core(1), true, [&[], &[], &[]]), // bl
            (0x0021_f851, Work::Load, false, [&[], &[0], &[1]]), // ldr.w r0, [r1, r1, lsl #2]
            (0xf004_f85d, Work::Load, true, [&[], &[15], &[13, 4]]), // ldr.w pc, [sp, r4]
            (0x0a81_ee20, Work::Core(1), false, [&[], &[], &[]]), // vmul.f32
            (0x8b10_ed2d, Work::Words(16), false, [&[], &[], &[13]]), // vpush {d8-d15}
        ];
        for (word, work, branches, expected) in cases {
            let decoded = Instruction::decode(0, word);
            let told = (decoded.work, decoded.branches, decoded.bytes);
            let wide = if word > 0xffff { 4 } else { 2 };
            assert_eq!(told, (work, branches, wide), "{word:#x}");
            let sets = [decoded.written, decoded.loaded, decoded.addressed_by].map(registers);
            let expected = expected.map(|set| {
                let mut set = set.to_vec();
                set.sort_unstable();
                set
            });
            assert_eq!(sets, expected, "{word:#x}");
        }
        let takes = |word| Instruction::decode(0, word).work;
        // vmla.f32, vfms.f32, vdiv.f32, vsqrt.f32; vmov s0, s1; vldr d0; vmov r0, r1, d0
        let words = [
            0x0a81_ee00,
            0x0ac1_eea0,
            0x0a81_ee80,
            0x0ac0_eeb1,
            0x0a60_eeb0,
            0x0b00_ed91,
            0x0b10_ec51,
        ];
        let expected = [3, 3, 14, 14, 1].map(Work::Core);
        assert_eq!(words.map(takes)[..5], expected);
        assert_eq!(words.map(takes)[5..], [Work::Words(2), Work::Core(2)]);
    }
}
