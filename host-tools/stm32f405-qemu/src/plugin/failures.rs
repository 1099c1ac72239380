//! Failure of the image: faults and panics, and whether the image can still go on after them.
//!
//! # Design
//!
//! The callbacks for instructions notice that a handler or the panic's function is entered. QEMU cannot
//! report the time there, so they leave a [`Sighting`] and wake the overlay, which runs at the end of that
//! block.
//!
//! After a fault or a panic most images stay in an endless loop, and continuing the run would show nothing.
//! But firmware may also report what happened and reset itself, or leave that to the watchdog. So it gets
//! [`GRACE_NS`], and more if the watchdog runs.

use super::priorities;
use super::qemu::Qemu;
use crate::ending::{Exception, RunEnd};
use crate::machine::name_of;
use crate::memory::is_ram;

/// Time in which a failed image may still reset itself, ns.
const GRACE_NS: u64 = 50_000_000;
/// Most exceptions that are kept.
const MOST: usize = 16;
/// BKPT with this number is a call to the host.
const SEMIHOSTING: u8 = 0xab;

/// The exceptions of faults: HardFault to UsageFault.
const FAULTS: std::ops::RangeInclusive<u32> = 3..=6;

/// A fault or panic that a callback noticed.
#[derive(Debug)]
pub(super) enum Sighting {
    /// The handler of a fault was entered.
    Exception(Exception),
    /// The panic's function was entered.
    Panic,
    /// The processor enters deep sleep.
    DeepSleep,
}

#[derive(Debug, Default)]
pub(super) struct Failures {
    /// Failures that have no time yet.
    pub(super) sightings: Vec<Sighting>,
    pub(super) exceptions: Vec<Exception>,
    pub(super) panics: Vec<u64>,
    /// Time and kind of the run's end, unless a reset comes first.
    pending_end: Option<(u64, RunEnd)>,
}

impl Failures {
    /// Records the exception of a fault. Returns the end of the run if the exception ends it.
    pub(super) fn fault(&mut self, exception: Exception) -> Option<RunEnd> {
        let panicked = matches!(self.pending_end, Some((_, RunEnd::Panicked)));
        let pc = exception.pc.clone().unwrap_or_default();
        let end = match exception.breakpoint {
            Some(SEMIHOSTING) => Some(RunEnd::Faulted),
            Some(_) if panicked => Some(RunEnd::Panicked),
            Some(_) => Some(RunEnd::Breakpoint(pc)),
            None => None,
        };
        self.pending_end
            .get_or_insert((exception.at_ns.saturating_add(GRACE_NS), RunEnd::Faulted));
        if self.exceptions.len() < MOST {
            self.exceptions.push(exception);
        }
        end
    }

    pub(super) fn panic(&mut self, now: u64) {
        self.panics.push(now);
        if !matches!(self.pending_end, Some((_, RunEnd::Panicked))) {
            self.pending_end = Some((now.saturating_add(GRACE_NS), RunEnd::Panicked));
        }
    }

    pub(super) fn reset(&mut self) {
        self.pending_end = None;
    }

    /// Time at which to check for the end of the run.
    pub(super) fn end_at(&self) -> Option<u64> {
        Some(self.pending_end.as_ref()?.0)
    }

    /// Returns the end of the run once its time has come. `None` if the image goes on: a watchdog will reset
    /// it, or it has left the fault's handler.
    pub(super) fn due_end(&mut self, watchdog: bool, qemu: &Qemu) -> Option<RunEnd> {
        let (_, end) = self.pending_end.take()?;
        let gone_on = end == RunEnd::Faulted && !FAULTS.contains(&priorities::active(qemu));
        (!watchdog && !gone_on).then_some(end)
    }
}

/// The exception whose handler begins, from the processor's registers as QEMU prints them. `None` if this is
/// not the entry of a fault's handler.
pub(super) fn exception(dump: &str, qemu: &Qemu) -> Option<Exception> {
    let register = |name: &str| {
        let (_, value) = dump.split_once(name)?;
        u32::from_str_radix(value.get(..8)?, 16).ok()
    };
    let (sp, lr, status) = (register("R13=")?, register("R14=")?, register("XPSR=")?);
    let number = status & 0x1ff;
    // EXC_RETURN: the handler has just been entered.
    if !FAULTS.contains(&number) || lr < 0xffff_ffe0 {
        return None;
    }
    let private = |address: u32| qemu.read_nvic(address, 4) as u32;
    let [cfsr, hfsr, of_mpu, of_bus] = [0xe000_ed28, 0xe000_ed2c, 0xe000_ed34, 0xe000_ed38].map(private);
    // EXC_RETURN bit 2: the frame is on the process stack. MSTKERR, MLSPERR, STKERR, LSPERR: there is none.
    let framed = lr & 4 == 0 && cfsr & 0x3030 == 0 && is_ram(sp, 32);
    let word = |address: u32| {
        let mut bytes = [0; 4];
        qemu.read_memory(address, &mut bytes);
        u32::from_le_bytes(bytes)
    };
    let [pc, lr] = [24, 20].map(|offset| framed.then(|| word(sp + offset)));
    let instruction = pc.map(|pc| word(pc & !1)).filter(|word| word >> 8 & 0xff == 0xbe);
    let by_bus = (cfsr >> 15 & 1 == 1).then_some(of_bus);
    let address = if cfsr >> 7 & 1 == 1 { Some(of_mpu) } else { by_bus };
    Some(Exception {
        at_ns: 0,
        number: number as u8,
        pc: pc.map(Into::into),
        // The link register has the Thumb bit.
        lr: lr.map(|lr| (lr & !1).into()),
        cfsr,
        hfsr,
        address,
        register: address.and_then(name_of),
        breakpoint: instruction.map(|word| word as u8),
    })
}
