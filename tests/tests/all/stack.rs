//! The stack, read from the image: where it is, and that no function steps over its fence.

use std::fs;

use bead_tests::image;
use object::{Object, ObjectSection, ObjectSymbol, SymbolKind};

/// Bytes closed below the stack: `FENCE` of the image's `stack.rs`.
const FENCE: u32 = 8192;
/// Bytes that an interrupt pushes by itself, with the registers of the floating-point unit (PM0214 section
/// 2.3.7).
const EXCEPTION_FRAME: u32 = 104;

/// Bytes by which an instruction lowers the stack pointer, and its length in halfwords (ARMv7-M ARM, sections
/// A7.7.101 PUSH, A7.7.176 SUB, A7.7.249 VPUSH; A5.3.2 for constants).
fn lowers([first, second]: [u16; 2]) -> (u32, usize) {
    let words = |count: u32| 4 * count;
    let destination_is_sp = second >> 8 & 0xF == 13 && second & 0x8000 == 0;
    let imm12 =
        u32::from(first >> 10 & 1) << 11 | u32::from(second >> 12 & 7) << 8 | u32::from(second & 0xFF);
    match first {
        0xB400..=0xB5FF => (words((first & 0x1FF).count_ones()), 1),
        0xB080..=0xB0FF => (words(u32::from(first & 0x7F)), 1),
        0xE92D => (words(second.count_ones()), 2),
        0xF84D if second & 0xFFF == 0xD04 => (4, 2),
        0xED2D | 0xED6D => (words(u32::from(second & 0xFF)), 2),
        0xF2AD | 0xF6AD if destination_is_sp => (imm12, 2),
        0xF1AD | 0xF5AD if destination_is_sp => (constant(imm12), 2),
        0xEBAD if second & 0x8F00 == 0x0D00 => panic!("a frame whose size is in a register"),
        // Long instructions start with 0b11101, 0b11110 or 0b11111.
        _ => (0, 1 + usize::from(first >= 0xE800)),
    }
}

/// A modified immediate constant of Thumb.
fn constant(imm12: u32) -> u32 {
    let byte = imm12 & 0xFF;
    match imm12 >> 8 {
        0 => byte,
        1 => byte << 16 | byte,
        2 => byte << 24 | byte << 8,
        3 => byte * 0x0101_0101,
        _ => (0x80 | imm12 & 0x7F).rotate_right(imm12 >> 7),
    }
}

#[test]
fn what_lowers_the_stack_pointer_is_read_right() {
    // As objdump writes them.
    let cases = [
        ([0xB5F0, 0], 20),        // push {r4, r5, r6, r7, lr}
        ([0xE92D, 0x0F00], 16),   // push.w {r8, r9, sl, fp}
        ([0xF84D, 0x8D04], 4),    // str.w r8, [sp, #-4]!
        ([0xED2D, 0x8B10], 64),   // vpush {d8-d15}
        ([0xB08E, 0], 56),        // sub sp, #56
        ([0xF6AD, 0x0D48], 2120), // subw sp, sp, #2120
        ([0xF5AD, 0x7D1C], 624),  // sub.w sp, sp, #624
        ([0xF5AD, 0x5D80], 4096), // sub.w sp, sp, #4096
        ([0xF2AD, 0x4D14], 1044), // subw sp, sp, #1044
        ([0xB00E, 0], 0),         // add sp, #56
        ([0xF000, 0xF800], 0),    // bl
    ];
    for (instruction, bytes) in cases {
        assert_eq!(lowers(instruction).0, bytes, "{instruction:04x?}");
    }
}

#[test]
fn no_function_of_the_image_steps_over_the_fence_below_the_stack() {
    let elf = fs::read(image()).unwrap();
    let elf = object::File::parse(&*elf).unwrap();
    let text = elf.section_by_name(".text").unwrap();
    let (start, text) = (text.address(), text.data().unwrap());
    let halfword = |address: u64| {
        let at = (address - start) as usize;
        text.get(at..at + 2)
            .map_or(0, |bytes| u16::from_le_bytes([bytes[0], bytes[1]]))
    };
    // `$d` begins data between instructions, and `$t` ends it.
    let mut marks: Vec<(u64, bool)> = elf
        .symbols()
        .filter_map(|symbol| match symbol.name().ok()?.get(..2)? {
            "$d" => Some((symbol.address(), true)),
            "$t" => Some((symbol.address(), false)),
            _ => None,
        })
        .collect();
    marks.sort_unstable();
    let is_data = |address: u64| {
        let before = marks.partition_point(|(mark, _)| *mark <= address);
        before > 0 && marks[before - 1].1
    };

    let mut frames = Vec::new();
    for function in elf
        .symbols()
        .filter(|s| s.kind() == SymbolKind::Text && s.size() > 0)
    {
        let first = function.address() & !1;
        let (mut at, mut frame) = (first, 0);
        while at < first + function.size() {
            let (lower, length) = if is_data(at) {
                (0, 1)
            } else {
                lowers([halfword(at), halfword(at + 2)])
            };
            frame += lower;
            at += 2 * length as u64;
        }
        frames.push((frame, function.name().unwrap().to_owned()));
    }
    frames.sort_unstable();
    for (frame, name) in frames.iter().rev().take(5) {
        println!("{frame} bytes: {name}");
    }
    let (largest, name) = frames.last().unwrap();
    assert!(*largest > 500, "the frames are not found");
    assert!(largest + EXCEPTION_FRAME < FENCE, "{largest} bytes: {name}");
}

#[test]
fn the_stack_is_at_the_start_of_a_memory_below_which_there_is_none_and_variables_are_above_it() {
    let elf = fs::read(image()).unwrap();
    let elf = object::File::parse(&*elf).unwrap();
    let symbol = |name: &str| {
        let symbol = elf.symbols().find(|symbol| symbol.name() == Ok(name));
        symbol.expect("the linker script defines it").address()
    };
    // The core-coupled memory, RM0090 section 2.3.
    let (end, start) = (symbol("_stack_end"), symbol("_stack_start"));
    assert_eq!(end, 0x1000_0000);
    let within = |section: &object::Section<'_, '_>| (end..0x1001_0000).contains(&section.address());
    let sections = elf.sections().filter(|s| s.size() > 0 && within(s));
    let above: Vec<_> = sections
        .map(|s| (s.name().unwrap().to_owned(), s.address() >= start))
        .collect();
    assert_eq!(above, [(".ccm".to_owned(), true)]);
}
