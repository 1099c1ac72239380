//! How deep the stack has been.
//!
//! # Design
//! Start-up code fills the free RAM with a pattern (`cortex-m-rt`, feature `paint-stack`); the stack grows
//! down into it. What still has the pattern, counted from the bottom, was never used. All tasks and handlers
//! share the one stack, so this one number covers them.

use cortex_m_rt::STACK_PAINT_VALUE;

/// Bytes of stack that were never used.
#[allow(unsafe_code, reason = "the free RAM is memory that no Rust object stands for")]
pub(crate) fn never_used() -> u32 {
    unsafe extern "C" {
        /// Lowest word that the stack may use: the end of the last section in RAM (`link.x`).
        static _stack_end: u32;
        /// One past the highest word of the stack: the end of the region RAM.
        static _stack_start: u32;
    }
    let (bottom, top) = (&raw const _stack_end, &raw const _stack_start);
    let mut word = bottom;
    // SAFETY: the words from `bottom` up to `top` are RAM, aligned (asserted by `link.x`), and hold no Rust
    // object below the stack pointer. Those above belong to live frames, which change while they are read;
    // the reads are volatile and only compared with the pattern.
    while word < top && unsafe { word.read_volatile() } == STACK_PAINT_VALUE {
        word = word.wrapping_add(1);
    }
    (word.addr() - bottom.addr()) as u32
}
