//! The record that a boot ended by a fault leaves for the next boot, and the number of the boot.
//!
//! # Design
//! A panic or a hard fault writes its place and its cause into RAM that a reset does not change (region KEPT
//! of `memory.x`), and resets the bead. The next boot finds the record and sends it to the host. The number
//! of the boot is kept there too. A checksum tells a record from the random contents of RAM after power-up.
//! The reset flag of a power-up is looked at as well, since RAM may survive a short loss of power. The last
//! windows lie in such memory too (region WINDOWS).

use core::fmt;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use bead_crc::checksum_of;
use bead_store::{WindowMemory, Windows};
use bead_wire::{Detail, FaultCause, MAX_DETAIL};
use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use embassy_stm32::pac::RCC;

use crate::stack;

/// This boot, and what the one before left.
pub(crate) struct Boot {
    /// Resets since power-up.
    pub(crate) number: u32,
    /// Bits 31..24 of RCC_CSR.
    pub(crate) reset_cause: u8,
    /// The fault that ended the boot before, if one did.
    pub(crate) left: Option<Left>,
    /// The last fault that ended a boot since power-up, and how many boots ended in one.
    pub(crate) last: Option<Left>,
    pub(crate) faults: u32,
    /// Number of boots in a row, up to this one, that ended in a fault before they were [`proven`].
    pub(crate) failed: u32,
    /// Frames that the boot before had made and not completely sent.
    pub(crate) frames_lost: u32,
}

/// A fault that ended a boot.
#[derive(Clone)]
pub(crate) struct Left {
    pub(crate) cause: FaultCause,
    pub(crate) boot: u32,
    pub(crate) pc: u32,
    pub(crate) detail: Detail,
}

static BOOT: AtomicU32 = AtomicU32::new(0);

/// Bytes for windows in the region WINDOWS of `memory.x`.
pub(crate) const RING: usize = 62 * 1024;
const _: () = assert!(size_of::<WindowMemory<RING>>() <= 64 * 1024 - 256);

/// The last windows, as far as the boot before has left them. Called once, after [`begin`].
pub(crate) fn windows() -> Windows<'static, RING> {
    // Boots are counted from power-up, after which there is nothing to take up.
    Windows::new(region::windows(), boot() > 0)
}

/// The number of this boot.
pub(crate) fn boot() -> u32 {
    BOOT.load(Ordering::Relaxed)
}

/// Counts the boot and takes what the one before left. Called once, first after the reset.
pub(crate) fn begin() -> Boot {
    let flags = RCC.csr().read();
    RCC.csr().modify(|w| w.set_rmvf(true));
    let before = Kept::load().filter(|_| !flags.porrstf());
    let frames_lost = match before {
        Some(_) => region::read_waiting().number().unwrap_or(0),
        None => 0,
    };
    keep_waiting(0);
    let mut kept = match before {
        Some(mut kept) => {
            if kept.fault_boot != kept.boot && flags.wdgrstf() {
                kept.record(FaultCause::Watchdog, 0, "");
            }
            kept
        }
        None => Kept::new(),
    };
    let ended = kept.boot;
    let left = kept.last().filter(|last| before.is_some() && last.boot == ended);
    kept.boot = before.map_or(0, |kept| kept.boot.wrapping_add(1));
    kept.faults = kept.faults.saturating_add(left.is_some().into());
    kept.failed = match &left {
        Some(_) => kept.failed.saturating_add(1),
        None => 0,
    };
    kept.store();
    BOOT.store(kept.boot, Ordering::Relaxed);
    Boot {
        number: kept.boot,
        reset_cause: (flags.0 >> 24) as u8,
        left,
        last: kept.last(),
        faults: kept.faults,
        failed: kept.failed,
        frames_lost,
    }
}

/// This boot has run long enough: the boots that failed before it count no longer.
pub(crate) fn proven() {
    change(|kept| kept.failed = 0);
}

/// Settings that were written lately, as [`bead_store::Pace`] counts them.
pub(crate) fn written() -> u32 {
    Kept::load().map_or(0, |kept| kept.written)
}

/// Keeps the number of settings that were written lately.
pub(crate) fn keep_written(written: u32) {
    change(|kept| kept.written = written);
}

/// Changes the record. Called by tasks of the lowest priority only, so no two changes meet. What ends the
/// boot may come between the words of a write, but not of this one; the checksums take 20 µs and are made
/// before it.
fn change(change: impl FnOnce(&mut Kept)) {
    if let Some(mut kept) = Kept::load() {
        change(&mut kept);
        let kept = kept.sealed();
        critical_section::with(|_| region::write(kept));
    }
}

/// Keeps how many frames wait, so that the next boot can tell how many were lost with this one.
pub(crate) fn keep_waiting(frames: u32) {
    region::write_waiting(Waiting::new(frames));
}

/// Number of waiting frames. It is not part of the record, since it changes with every frame.
#[derive(Clone, Copy)]
#[repr(C)]
struct Waiting {
    frames: u32,
    /// `frames` inverted: after power-up RAM does not hold such a pair.
    inverted: u32,
}

impl Waiting {
    const fn new(frames: u32) -> Self {
        Self {
            frames,
            inverted: !frames,
        }
    }

    fn number(self) -> Option<u32> {
        (self.inverted == !self.frames).then_some(self.frames)
    }
}

/// The contents of the region KEPT.
#[repr(C)]
struct Region {
    kept: Kept,
    waiting: Waiting,
}

/// The record in the region KEPT. It has plain words and bytes only, so that any memory contents are a valid
/// value.
#[derive(Clone, Copy)]
#[repr(C)]
struct Kept {
    magic: u32,
    boot: u32,
    /// Boots that ended in a fault, and how many of the last ones in a row did so early.
    faults: u32,
    failed: u32,
    written: u32,
    /// Cause of the last boot that ended in a fault: [`NONE`], or a number of [`CAUSES`].
    cause: u32,
    fault_boot: u32,
    pc: u32,
    detail_length: u32,
    detail: [u8; MAX_DETAIL],
    /// CRC-32 of all fields before it.
    crc: u32,
}

/// "BEAD" and the version of the layout.
const MAGIC: u32 = u32::from_le_bytes(*b"BEA\x02");
const NONE: u32 = 0;
const CAUSES: [(u32, FaultCause); 6] = [
    (1, FaultCause::Panic),
    (2, FaultCause::HardFault),
    (3, FaultCause::DmaError),
    (4, FaultCause::StackOverflow),
    (5, FaultCause::Watchdog),
    (6, FaultCause::CrystalFailed),
];
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

    use super::{Kept, RING, Region, Waiting};

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
        // this; any contents are a `WindowMemory`. This is the only reference to it, since `ONCE` is given away
        // once.
        unsafe { &mut *memory }
    }

    pub(super) fn read() -> Kept {
        // SAFETY: the symbol is the start of 256 bytes of RAM, aligned to 256, that are reserved for this;
        // any contents are a `Kept`. Volatile, since a boot before this one wrote them.
        unsafe { (&raw const REGION.kept).read_volatile() }
    }

    pub(super) fn write(kept: Kept) {
        // SAFETY: as for `read`. Written by `begin`, before there are tasks, and by handlers that never
        // return; nobody holds a reference. Volatile, since a boot after this one reads it.
        unsafe { (&raw mut REGION.kept).write_volatile(kept) }
    }

    pub(super) fn read_waiting() -> Waiting {
        // SAFETY: as for `read`; any contents are a `Waiting`.
        unsafe { (&raw const REGION.waiting).read_volatile() }
    }

    pub(super) fn write_waiting(waiting: Waiting) {
        // SAFETY: as for `read`. Written by `begin`, and within the lock of the counters; nobody holds a
        // reference. Volatile, since a boot after this one reads it.
        unsafe { (&raw mut REGION.waiting).write_volatile(waiting) }
    }
}

impl Kept {
    const fn new() -> Self {
        Self {
            magic: MAGIC,
            boot: 0,
            faults: 0,
            failed: 0,
            written: 0,
            cause: NONE,
            fault_boot: u32::MAX,
            pc: 0,
            detail_length: 0,
            detail: [0; MAX_DETAIL],
            crc: 0,
        }
    }

    fn load() -> Option<Self> {
        let kept = region::read();
        (kept.magic == MAGIC && kept.crc == kept.checksum()).then_some(kept)
    }

    fn store(self) {
        region::write(self.sealed());
    }

    fn sealed(mut self) -> Self {
        self.crc = self.checksum();
        self
    }

    fn checksum(&self) -> u32 {
        let words = [
            self.magic,
            self.boot,
            self.faults,
            self.failed,
            self.written,
            self.cause,
            self.fault_boot,
            self.pc,
            self.detail_length,
        ];
        let words = words.map(u32::to_le_bytes);
        checksum_of([words.as_flattened(), &self.detail])
    }

    /// Notes what ends this boot.
    fn record(&mut self, cause: FaultCause, pc: u32, detail: &str) {
        self.cause = CAUSES
            .into_iter()
            .find_map(|(number, known)| (known == cause).then_some(number))
            .unwrap_or(NONE);
        self.fault_boot = self.boot;
        self.pc = pc;
        self.detail_length = detail.len() as u32;
        self.detail = [0; MAX_DETAIL];
        self.detail[..detail.len()].copy_from_slice(detail.as_bytes());
    }

    fn last(&self) -> Option<Left> {
        let (_, cause) = CAUSES.into_iter().find(|&(number, _)| number == self.cause)?;
        let text = self.detail.get(..self.detail_length as usize)?;
        let text = core::str::from_utf8(text).ok()?;
        Some(Left {
            cause,
            boot: self.fault_boot,
            pc: self.pc,
            detail: Detail::new(format_args!("{text}")),
        })
    }
}

/// True once this boot is ending.
static ENDING: AtomicBool = AtomicBool::new(false);

/// Writes the record of this boot's end and resets.
///
/// The log comes last, when the record is whole: what ends the boot may have happened inside a log statement,
/// and then the logger panics. Whatever goes wrong here comes back here, and resets at once.
fn end(cause: FaultCause, pc: u32, detail: fmt::Arguments<'_>) -> ! {
    cortex_m::interrupt::disable();
    if ENDING.swap(true, Ordering::Relaxed) {
        SCB::sys_reset();
    }
    record(cause, pc, "");
    let text = Detail::new(detail);
    record(cause, pc, text.as_str());
    defmt::error!(
        "boot {=u32} ends at {=u32:#010x}: {=str}",
        boot(),
        pc,
        text.as_str()
    );
    SCB::sys_reset()
}

fn record(cause: FaultCause, pc: u32, text: &str) {
    let mut kept = Kept::load().unwrap_or(const { Kept::new() });
    kept.boot = boot();
    kept.record(cause, pc, text);
    kept.store();
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
            // The file's name alone: its folder is one of the machine that built the image.
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
