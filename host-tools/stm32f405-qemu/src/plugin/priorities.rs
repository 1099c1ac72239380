//! The order in which the processor takes exceptions, as its interrupt controller has it.

use super::qemu::Qemu;

const ICSR: u32 = 0xe000_ed04;
const AIRCR: u32 = 0xe000_ed0c;
/// Enabled and pending lines, a bit for each.
const NVIC_ISER: u32 = 0xe000_e100;
const NVIC_ISPR: u32 = 0xe000_e200;
/// Priorities, a byte for each line and for each exception from 4.
const NVIC_IPR: u32 = 0xe000_e400;
const SHPR: u32 = 0xe000_ed18;
/// The first exception that has a priority of its own, and the first of the lines (ARMv7-M ARM, B1.5.2).
const FIRST: u32 = 4;
pub(super) const FIRST_LINE: u32 = 16;

/// The enabled and pending exception with the highest priority. 0 is none.
pub(super) fn pending(qemu: &Qemu) -> u32 {
    (qemu.read_nvic(ICSR, 4) >> 12) as u32 & 0x1ff
}

/// The exception whose handler is executed (ICSR.VECTACTIVE). 0 is none.
pub(super) fn active(qemu: &Qemu) -> u32 {
    qemu.read_nvic(ICSR, 4) as u32 & 0x1ff
}

/// Returns `true` if an interrupt is pending, so that a sleep ends at once (ICSR.ISRPENDING and PENDSTSET,
/// PENDSVSET).
pub(super) fn is_any_pending(qemu: &Qemu) -> bool {
    qemu.read_nvic(ICSR, 4) & (1 << 22 | 1 << 26 | 1 << 28) != 0
}

/// Returns `true` if an exception may interrupt the handler of another, regardless of other masks. 0 is no
/// handler.
pub(super) fn may_preempt(exception: u32, handled: u32, qemu: &Qemu) -> bool {
    if handled < FIRST || exception < FIRST {
        return true;
    }
    let below = (qemu.read_nvic(AIRCR, 4) >> 8 & 7) + 1;
    let [group, of_handled] = [exception, handled].map(|n| priority(n, qemu) >> below);
    group < of_handled
}

/// Returns `true` if a line takes precedence over the pending exception, or none is pending.
pub(super) fn comes_first(exception: u32, qemu: &Qemu) -> bool {
    let other = pending(qemu);
    let order = |n: u32| (priority(n, qemu), n);
    other == 0 || (other >= FIRST && order(exception) < order(other))
}

pub(super) fn is_enabled(line: usize, qemu: &Qemu) -> bool {
    is_set(NVIC_ISER, line, qemu)
}

pub(super) fn is_pending(line: usize, qemu: &Qemu) -> bool {
    is_set(NVIC_ISPR, line, qemu)
}

fn is_set(registers: u32, line: usize, qemu: &Qemu) -> bool {
    qemu.read_nvic(registers + line as u32 / 32 * 4, 4) >> (line % 32) & 1 == 1
}

/// Priority of an exception: a lower value is taken first.
fn priority(exception: u32, qemu: &Qemu) -> u64 {
    let address = match exception.checked_sub(FIRST_LINE) {
        Some(line) => NVIC_IPR + line,
        None => SHPR + exception - FIRST,
    };
    qemu.read_nvic(address, 1)
}
