//! Critical sections, and how long they keep interrupts waiting.
//!
//! # Design
//! These are the sections of `cortex-m` for a single core, with two readings of the cycle counter. The length
//! of the longest section goes into the [load](bead_wire::Load) frame. Inner sections are part of the
//! outermost.

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::interrupt;
use cortex_m::peripheral::DWT;
use cortex_m::register::primask;
use critical_section::{Impl, RawRestoreState, set_impl};

/// Count of the core's clocks when the outermost section began.
static BEGAN: AtomicU32 = AtomicU32::new(0);
/// Clocks of the longest.
static LONGEST: AtomicU32 = AtomicU32::new(0);

struct Masked;

set_impl!(Masked);

// SAFETY: this part has one core, so nothing else runs while PRIMASK is set; it is cleared again only by the
// section that set it.
#[allow(unsafe_code, reason = "the trait promises exclusion")]
unsafe impl Impl for Masked {
    // Not inlined: copies of both functions in every section would take 7 KB of flash.
    #[inline(never)]
    unsafe fn acquire() -> RawRestoreState {
        let outermost = primask::read().is_active();
        interrupt::disable();
        if outermost {
            BEGAN.store(DWT::cycle_count(), Ordering::Relaxed);
        }
        outermost
    }

    #[inline(never)]
    unsafe fn release(outermost: RawRestoreState) {
        if outermost {
            let clocks = DWT::cycle_count().wrapping_sub(BEGAN.load(Ordering::Relaxed));
            if clocks > LONGEST.load(Ordering::Relaxed) {
                LONGEST.store(clocks, Ordering::Relaxed);
            }
            // SAFETY: interrupts were enabled when this section began, and it is over.
            unsafe { interrupt::enable() }
        }
    }
}

/// Clocks of the longest stretch since this was last called.
pub(crate) fn take_longest() -> u32 {
    LONGEST.swap(0, Ordering::Relaxed)
}
