//! The record of the end of a boot: its memory, and the handlers that write it.
//!
//! # Design
//! A panic or a hard fault writes its place and its cause into RAM that a reset does not change (region KEPT
//! of `memory.x`), and resets the bead. The next boot finds the record ([`BootRecord`]) and sends it to the
//! host. The last windows lie in such memory too (region WINDOWS).

use core::fmt;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use bead_app::{BootRecord, FramesWaiting, RING, ThisBoot};
use bead_store::{WindowMemory, Windows};
use bead_wire::{Detail, FaultCause};
use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use embassy_stm32::pac::RCC;

use crate::stack;

/// The number of this boot. It is kept apart from the record, which may be damaged when the boot ends.
static BOOT: AtomicU32 = AtomicU32::new(0);

const _: () = assert!(size_of::<WindowMemory<RING>>() <= 64 * 1024 - 256);

/// Takes over the last windows that the previous boot left. Called once, after [`begin`].
pub(crate) fn windows() -> Windows<'static, RING> {
    // Boots are counted from power-up, after which there is nothing to take over.
    Windows::new(region::windows(), BOOT.load(Ordering::Relaxed) > 0)
}

/// Counts the boot and takes over what the previous one left. Called once, first after the reset.
pub(crate) fn begin() -> ThisBoot {
    let flags = RCC.csr().read();
    RCC.csr().modify(|w| w.set_rmvf(true));
    let before = region::read().checked();
    let (boot, record) = BootRecord::begin(before, region::read_waiting(), (flags.0 >> 24) as u8);
    keep_frames_waiting(0);
    region::write(record);
    BOOT.store(boot.number, Ordering::Relaxed);
    boot
}

/// Changes the record. Called by tasks of the lowest priority only, so no two changes meet. The critical
/// section keeps interrupts, which may end the boot, from coming between two words of the write; the
/// checksums take 20 µs and are made before it.
pub(crate) fn change(change: impl FnOnce(&mut BootRecord)) {
    if let Some(mut record) = region::read().checked() {
        change(&mut record);
        let record = record.sealed();
        critical_section::with(|_| region::write(record));
    }
}

/// Keeps the number of waiting frames, so that the next boot can report how many were lost with this one.
pub(crate) fn keep_frames_waiting(frames: u32) {
    region::write_waiting(FramesWaiting::new(frames));
}

/// The contents of the region KEPT.
#[repr(C)]
struct Region {
    record: BootRecord,
    waiting: FramesWaiting,
    /// [`RECEIVE`] if the next start is to wait for an image.
    receive: u32,
}

/// A word that RAM is unlikely to hold after power-up.
const RECEIVE: u32 = u32::from_be_bytes(*b"imag");

/// Makes the next start wait for an image.
pub(crate) fn receive_after_reset() {
    region::write_receive(RECEIVE);
}

/// Returns `true` if this start is to wait for an image; once only. Called after [`begin`].
pub(crate) fn take_receive() -> bool {
    let receive = region::read_receive() == RECEIVE && BOOT.load(Ordering::Relaxed) > 0;
    region::write_receive(0);
    receive
}

const _: () = assert!(
    size_of::<Region>() <= 256,
    "it all fits the region KEPT of memory.x"
);

#[allow(
    unsafe_code,
    reason = "the region KEPT is memory that no other Rust object stands for"
)]
mod region {
    use bead_store::WindowMemory;
    use static_cell::StaticCell;

    use super::{BootRecord, FramesWaiting, RING, Region};

    unsafe extern "C" {
        /// Start of the region KEPT of `memory.x`.
        #[link_name = "_kept"]
        static mut REGION: Region;
        /// Start of the region WINDOWS of `memory.x`.
        #[link_name = "_windows"]
        static mut WINDOWS: WindowMemory<RING>;
    }

    /// The region WINDOWS. A second call panics.
    pub(super) fn windows() -> &'static mut WindowMemory<RING> {
        static ONCE: StaticCell<()> = StaticCell::new();
        ONCE.init(());
        let memory = &raw mut WINDOWS;
        // SAFETY: the symbol is the start of 64 KiB - 256 B of RAM, aligned to 64 KiB, that are reserved for
        // this; any contents are a `WindowMemory`. This is the only reference to it, since `ONCE` is given
        // away once.
        unsafe { &mut *memory }
    }

    // Not inlined, to save flash: it is compiled to a load for each word, and `write` to a store for each.
    #[inline(never)]
    pub(super) fn read() -> BootRecord {
        // SAFETY: the symbol is the start of 256 bytes of RAM, aligned to 256, that are reserved for this;
        // any contents are a `BootRecord`. Volatile, since a boot before this one wrote them.
        unsafe { (&raw const REGION.record).read_volatile() }
    }

    #[inline(never)]
    pub(super) fn write(record: BootRecord) {
        // SAFETY: as for `read`. Written by `begin`, before there are tasks, by `change`, within a critical
        // section, and by handlers that never return; nobody holds a reference. Volatile, since a boot after
        // this one reads it.
        unsafe { (&raw mut REGION.record).write_volatile(record) }
    }

    pub(super) fn read_waiting() -> FramesWaiting {
        // SAFETY: as for `read`; any contents are a `FramesWaiting`.
        unsafe { (&raw const REGION.waiting).read_volatile() }
    }

    pub(super) fn read_receive() -> u32 {
        // SAFETY: as for `read`; any contents are a number.
        unsafe { (&raw const REGION.receive).read_volatile() }
    }

    pub(super) fn write_receive(receive: u32) {
        // SAFETY: as for `read`. Written by the start, and by one task; nobody holds a reference. Volatile,
        // since a boot after this one reads it.
        unsafe { (&raw mut REGION.receive).write_volatile(receive) }
    }

    pub(super) fn write_waiting(waiting: FramesWaiting) {
        // SAFETY: as for `read`. Written by `begin`, and within the lock of the counters; nobody holds a
        // reference. Volatile, since a boot after this one reads it.
        unsafe { (&raw mut REGION.waiting).write_volatile(waiting) }
    }
}

/// True once this boot is ending.
static ENDING: AtomicBool = AtomicBool::new(false);

/// Writes the record of this boot's end and resets. It logs nothing, since the boot may end inside the
/// logger: the next one logs the record. A fault in here calls this function again, which then resets at
/// once.
fn end(cause: FaultCause, pc: u32, detail: fmt::Arguments<'_>) -> ! {
    cortex_m::interrupt::disable();
    if ENDING.swap(true, Ordering::Relaxed) {
        SCB::sys_reset();
    }
    record(cause, pc, "");
    let text = Detail::new(detail);
    record(cause, pc, text.as_str());
    SCB::sys_reset()
}

fn record(cause: FaultCause, pc: u32, text: &str) {
    let mut record = region::read().checked().unwrap_or(const { BootRecord::new() });
    record.end(BOOT.load(Ordering::Relaxed), cause, pc, text);
    region::write(record.sealed());
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    // The DMA driver panics when a stream reports a transfer error. That is a fault of the bus, not of the
    // code, so it has a cause of its own.
    let message = info.message();
    let text = Detail::new(format_args!("{message}"));
    let cause = if text.as_str().starts_with("DMA: error") {
        FaultCause::DmaError
    } else {
        FaultCause::Panic
    };
    match info.location() {
        Some(at) => {
            // Only the file's name: its folder is one of the machine that built the image.
            let file = at.file().rsplit('/').next().unwrap_or_default();
            end(cause, 0, format_args!("{message} ({file}:{})", at.line()))
        }
        None => end(cause, 0, format_args!("{message}")),
    }
}

/// The crystal stopped, and the clock security system has put the core on the internal oscillator (RM0090
/// section 7.2.7).
#[exception]
#[allow(unsafe_code, reason = "cortex-m-rt asks for it")]
unsafe fn NonMaskableInt() -> ! {
    RCC.cir().modify(|w| w.set_cssc(true));
    end(FaultCause::CrystalFailed, 0, format_args!("the crystal stopped"))
}

/// Bit of CFSR: MMFAR holds the address of the fault (PM0214 section 4.4.13).
const MMARVALID: u32 = 1 << 7;

#[exception]
#[allow(unsafe_code, reason = "cortex-m-rt asks for it")]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    // SAFETY: reading the fault status registers of the core has no side effect.
    let scb = unsafe { &*SCB::PTR };
    let (cfsr, hfsr) = (scb.cfsr.read(), scb.hfsr.read());
    let (mmfar, bfar) = (scb.mmfar.read(), scb.bfar.read());
    // The frame lies where the stack ended. If that is in the fence, the core could not write it: PC and LR
    // are lost.
    let at = (frame as *const ExceptionFrame).addr();
    if stack::overflown(at) || cfsr & MMARVALID != 0 && stack::overflown(mmfar as usize) {
        end(
            FaultCause::StackOverflow,
            0,
            format_args!("the stack reached {at:#010x}"),
        )
    }
    end(
        FaultCause::HardFault,
        frame.pc(),
        format_args!(
            "CFSR {cfsr:#010x} HFSR {hfsr:#010x} MMFAR {mmfar:#010x} BFAR {bfar:#010x} LR {:#010x}",
            frame.lr()
        ),
    )
}

#[exception]
#[allow(unsafe_code, reason = "cortex-m-rt asks for it")]
unsafe fn DefaultHandler(interrupt: i16) {
    panic!("interrupt {interrupt} has no handler");
}
