//! The variable in the core-coupled memory: it is large, and no DMA has to reach it.

use core::mem::MaybeUninit;

use bead_model::Meter;
use static_cell::StaticCell;

/// A new meter. A second call panics.
#[allow(
    unsafe_code,
    reason = "start-up code does not zero this memory, so a safe static cannot lie there"
)]
pub(crate) fn meter() -> &'static mut Meter {
    #[unsafe(link_section = ".ccm")]
    static mut METER: MaybeUninit<Meter> = MaybeUninit::uninit();
    static ONCE: StaticCell<()> = StaticCell::new();
    ONCE.init(());
    let meter = &raw mut METER;
    // SAFETY: this is the only reference to it, since `ONCE` is given away once. Any contents are a
    // `MaybeUninit`. The value is a constant of zeros: nothing is built on the stack.
    unsafe { (*meter).write(const { Meter::new() }) }
}
