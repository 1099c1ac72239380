//! Deliberate crashes of the processor.

use super::board::Exterior;
use crate::given::FaultKind;

/// Overwrites the vector of `line` in the table at `vectors`, so that its next interrupt makes the processor
/// crash. `flash_end` is where flash ends.
pub(super) fn crash(kind: FaultKind, vectors: u32, line: usize, flash_end: u32, board: &mut impl Exterior) {
    /// Thumb: `b .`
    const FOR_EVER: [u8; 2] = [0xfe, 0xe7];
    /// Thumb: `push {r0-r3}`, `b .-2`.
    const PUSH_FOR_EVER: [u8; 4] = [0x0f, 0xb4, 0xfd, 0xe7];
    let vector = |line: usize| vectors + 4 * (16 + line as u32);
    let unused = flash_end - 16;
    let mut handler = (unused | 1).to_le_bytes();
    match kind {
        FaultKind::Hang => board.overwrite_flash(unused, &FOR_EVER),
        FaultKind::RunawayStack => board.overwrite_flash(unused, &PUSH_FOR_EVER),
        FaultKind::UnhandledInterrupt => board.read_memory(vector(0), &mut handler),
        _ => handler = 0xefff_fff1_u32.to_le_bytes(),
    }
    board.overwrite_flash(vector(line), &handler);
}
