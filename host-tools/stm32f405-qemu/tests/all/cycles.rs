//! Loops in real QEMU whose cycles were counted by hand.

#![expect(clippy::unwrap_used, reason = "in helpers of tests")]

use super::qemu::{elf, outcome, vectors};

/// Sets the number of turns (r0) and the addresses of SRAM (r2), of flash (r4) and of a peripheral (r5); a
/// line of flash long.
const fn start(turns: u8) -> [u16; 8] {
    [
        0x2000 | turns as u16,
        0x2220,
        0x0612,
        0x2408,
        0x0624,
        0x2501,
        0x07ad,
        0xbf00,
    ]
}

/// wfi, and a branch back to it.
const END: [u16; 2] = [0xbf30, 0xe7fd];

/// Cycles of one turn of a loop at the beginning of a line of flash, after its first turn: with ideal memory,
/// with caches, without, and the upper bound.
fn turn(code: &[u16]) -> [u64; 4] {
    let cycles = |turns| {
        // Two words fill the line that the vectors end in.
        let mut bytes: Vec<u8> = vectors().into_iter().flat_map(u32::to_le_bytes).collect();
        bytes.resize(bytes.len().next_multiple_of(16), 0);
        let at = 0x0800_0000 + bytes.len() as u32;
        bytes[4..8].copy_from_slice(&(at | 1).to_le_bytes());
        let words = [&start(turns), code, &END].concat();
        bytes.extend(words.into_iter().flat_map(u16::to_le_bytes));
        let image = elf(&bytes, &[("turns", (at + 16) | 1, 2 * code.len() as u32, 2)]);
        let outcome = outcome(&image, |run| {
            run.count_cycles = true;
            run.functions = vec![("turns".into(), "turns".into())];
        });
        let counted = outcome.instructions.unwrap();
        let [function] = &counted.functions[..] else {
            panic!("{counted:?}")
        };
        let cycles = function.cycles.unwrap();
        [cycles.ideal, cycles.cached, cycles.uncached, cycles.most]
    };
    let [few, many] = [10, 20].map(cycles);
    std::array::from_fn(|n| {
        assert!((many[n] - few[n]).is_multiple_of(10), "{few:?}, {many:?}");
        (many[n] - few[n]) / 10
    })
}

#[test]
fn a_loop_takes_as_many_cycles_as_were_counted_by_hand() {
    // subs r0, #1; bne. The branch takes one, and two to fill the pipeline, at most three. The line is there.
    assert_eq!(turn(&[0x3801, 0xd1fd]), [4, 4, 4, 5]);

    // ldr r1, [r2]; ldr r3, [r2, #4]; str r3, [r2, #8]; ldr r1, [r4]; ldr r3, [r5]; subs r0, #1; bne.
    // Ideal: 2 + 1 behind a load + 1 + 2 behind a store + 1 and 3 for the bus + 1 + 3.
    // Without caches the constant waits 5. Meanwhile the core requests the line after the loop, which the
    // flash reads from 11 to 17. The branch ends at 18, and the loop's line arrives at 24.
    // At most: 2 + 2 + 1 + (2 + 5) + (2 + 8) + 1 + (1 + 3), and 5 to read the line again after the constant.
    let accesses = [0x6811, 0x6853, 0x6093, 0x6821, 0x682b, 0x3801, 0xd1f8];
    assert_eq!(turn(&accesses), [14, 14, 24, 32]);

    // Eight times nop in the first line; udiv r1, r0, r2; subs r0, #1; bne in the second.
    // Ideal: 8 + 7 + 1 + 3.
    // Without caches the second line is requested at 3, when the fourth nop frees room for its first word,
    // and arrives at 9: a cycle late. The line after it is read from 12 to 18, the branch ends at 19, and the
    // first line arrives at 25.
    // At most: 8 + 12 + 1 + (1 + 3), and 5 for each line.
    let lines = [[0xbf00; 8].as_slice(), &[0xfbb0, 0xf1f2, 0x3801, 0xd1f3]].concat();
    assert_eq!(turn(&lines), [19, 19, 25, 35]);
}
