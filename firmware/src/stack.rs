//! Depth of the stack so far, and a fence at its end.
//!
//! # Design
//! The stack is at the start of the core-coupled memory: no DMA reaches it, variables are only above it, and
//! below it there is no memory at all. So a stack that grows too far destroys nothing, however large the
//! step.
//!
//! Start-up code fills this memory with a pattern (`cortex-m-rt`, feature `paint-stack`), and the stack grows
//! down into it. Bytes that still have the pattern were never used. All tasks and handlers share the one
//! stack, so one number covers them.
//!
//! The memory protection unit closes the lowest [`FENCE`] bytes: a stack that grows into them faults. The
//! unit is off while the handler of the fault runs, so that the handler has a stack and can report the fault.

use core::sync::atomic::{AtomicUsize, Ordering};

use cortex_m::peripheral::MPU;
use cortex_m_rt::STACK_PAINT_VALUE;

/// Bytes closed at the end of the stack: more than any frame of this image, so that no function steps over
/// them. A test reads the frames from the image. The unit needs a power of two as size, and a multiple of it
/// as address.
const FENCE: usize = 8192;

/// First address that the stack may not use, aligned for [`FENCE`].
fn fence() -> usize {
    bounds().0.addr().next_multiple_of(FENCE)
}

/// Closes the fence.
#[allow(unsafe_code, reason = "closing memory is unsafe if something uses it")]
pub(crate) fn close_fence(mpu: &mut MPU) {
    const ENABLE: u32 = 1;
    /// Memory outside the regions stays as it is.
    const PRIVDEFENA: u32 = 1 << 2;
    /// No execution; access permission 0, none, is the reset value.
    const XN: u32 = 1 << 28;
    let size = (FENCE.ilog2() - 1) << 1;
    // SAFETY: region 0 covers memory of the stack only. No Rust object lies there, and `never_used` reads
    // above it. PM0214 section 4.2.
    unsafe {
        mpu.rnr.write(0);
        mpu.rbar.write(fence() as u32);
        mpu.rasr.write(XN | size | ENABLE);
        mpu.ctrl.write(PRIVDEFENA | ENABLE);
    }
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}

/// Returns `true` if a fault at this address, or with this stack pointer, came from the stack.
pub(crate) fn overflown(address: usize) -> bool {
    (fence()..fence() + FENCE).contains(&address)
}

/// Bytes of stack that were never used, down to the fence.
///
/// Searches only below the deepest known use, and ends when [`FENCE`] bytes in a row have the pattern: no
/// frame is so large. Searching all of the free stack would take longer than any block of a strike.
#[allow(
    unsafe_code,
    reason = "the free stack is memory that no Rust object stands for"
)]
pub(crate) fn never_used() -> u32 {
    /// Lowest address that is known to have been used.
    static USED: AtomicUsize = AtomicUsize::new(usize::MAX);
    let (end, start) = bounds();
    let bottom = fence() + FENCE;
    let mut used = USED.load(Ordering::Relaxed).min(start.addr());
    let mut word = end.with_addr(used);
    while word.addr() > bottom.max(used - FENCE) {
        word = word.wrapping_sub(1);
        // SAFETY: the words from `bottom` up to `start` are RAM and aligned (asserted by `link.x`). Below the
        // stack pointer there is no Rust object. Above it are live frames, which change while they are read:
        // the reads are volatile and only compared with the pattern.
        if unsafe { word.read_volatile() } != STACK_PAINT_VALUE {
            used = word.addr();
        }
    }
    USED.store(used, Ordering::Relaxed);
    (used - bottom) as u32
}

/// The lowest word of the stack's memory and one past its highest: the region STACK of `memory.x`.
#[allow(unsafe_code, reason = "symbols of the linker script are foreign")]
fn bounds() -> (*const u32, *const u32) {
    unsafe extern "C" {
        static _stack_end: u32;
        static _stack_start: u32;
    }
    (&raw const _stack_end, &raw const _stack_start)
}
