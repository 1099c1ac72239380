//! When the processor will next be interrupted.

use super::chip::Chip;
use super::levels::Levels;
use super::table::TABLE;
use super::wiring::{ADC1_REQUEST, DMA2, USART1_TX_REQUEST};
use crate::peripherals::Peripheral;

/// When an interrupt line will rise, the machine will be reset, or the first scan may come, if no register is
/// accessed. This time may be too early, but never too late.
pub(super) fn next_interrupt(chip: &Chip, levels: &Levels) -> Option<u64> {
    let units = &chip.units;
    // While the processor stands still, interrupts wait.
    if chip.stands_still() {
        let flash = units.flash.next_interrupt();
        return flash.into_iter().chain(units.iwdg.next_interrupt()).min();
    }
    let alone = TABLE.iter().filter_map(|row| (row.model)(units).next_interrupt());
    let together = [
        acquisition(chip),
        transmission(chip),
        first_scan(chip),
        levels.next_capture(chip),
    ];
    alone.chain(together.into_iter().flatten()).min()
}

/// The trigger that may start the first scan. The outside counts its time from that scan.
fn first_scan(chip: &Chip) -> Option<u64> {
    match chip.stimulus.sampling() {
        Some(_) => None,
        None => chip.units.tim[chip.units.adc.trigger_timer()?].trigger(0),
    }
}

/// When the ADC will next raise a line: its own, or the line of the DMA stream that serves it.
fn acquisition(chip: &Chip) -> Option<u64> {
    let (adc, dma) = (&chip.units.adc, &chip.units.dma[DMA2]);
    let trigger = |n: u64| adc.trigger_timer().and_then(|t| chip.units.tim[t].trigger(n));
    if adc.blocked() {
        return None;
    }
    let beats = match dma.serving(&ADC1_REQUEST).filter(|_| adc.requests_dma()) {
        Some(stream) => u64::from(dma.beats_to_interrupt(stream)?),
        None if adc.interrupts_on_conversion() => 1,
        None => return None,
    };
    // If the trigger's period is about to change, only its next pulse is known: look again at that time.
    adc.conversion(beats, trigger).or_else(|| trigger(0))
}

/// When the DMA stream that feeds USART1 will raise its line.
fn transmission(chip: &Chip) -> Option<u64> {
    let dma = &chip.units.dma[DMA2];
    let beats = dma.beats_to_interrupt(dma.serving(&USART1_TX_REQUEST)?)?;
    chip.units.usart1.transmit_request(u64::from(beats))
}
