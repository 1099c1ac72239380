//! When the processor will next be interrupted.

use super::chip::Chip;
use super::levels::Levels;
use super::transfers::serving;
use super::wiring::{self, ADCS, SERVERS, USARTS};
use crate::peripherals::Peripheral;
use crate::peripherals::dac::CHANNELS;
use crate::peripherals::tim::Tim;

/// When an interrupt line will rise, the machine will be reset, or the first scan may come, if no register is
/// accessed. This time may be too early, but never too late.
pub(super) fn next_interrupt(chip: &Chip, levels: &Levels) -> Option<u64> {
    let units = &chip.units;
    // While the processor stands still, interrupts wait.
    if chip.stands_still() {
        let flash = units.flash.next_interrupt();
        let wake_up = levels.next_capture(chip).filter(|_| chip.sleeps());
        return flash
            .into_iter()
            .chain(units.iwdg.next_interrupt())
            .chain(units.wwdg.runs_out())
            .chain(units.rtc.next_flag().filter(|_| chip.sleeps()))
            .chain(wake_up)
            .min();
    }
    let alone = chip
        .written
        .iter()
        .filter_map(|row| (row.model)(units).next_interrupt());
    let converters = (0..ADCS.len()).filter_map(|adc| acquisition(chip, adc));
    let transmitters = (0..USARTS.len()).filter_map(|usart| transmission(chip, usart));
    let players = (0..CHANNELS).filter_map(|channel| playing(chip, channel));
    // A stream may interrupt at a timer's request.
    let served = |tim: &usize| {
        SERVERS.timers[*tim]
            .iter()
            .any(|server| serving(chip, server).is_some())
    };
    let linked = if chip.linked_timers { units.tim.len() } else { 0 };
    let requests = (0..linked).filter_map(|tim| {
        let at = units.tim[tim].next_request()?;
        served(&tim).then_some(at)
    });
    let moved = (0..linked).filter(|tim| units.tim[*tim].internal_trigger_interrupts());
    let moved =
        moved.filter_map(|tim| units.tim[wiring::master(tim, units.tim[tim].moved_by()?)?].trigger(0));
    let captures = levels.next_capture(chip);
    // Over a wire, an output may reach an input that interrupts.
    let outputs = units.tim.iter().filter(|_| !chip.wires.is_empty());
    let outputs = outputs.filter_map(Tim::next_output);
    alone
        .chain(converters)
        .chain(transmitters)
        .chain(players)
        .chain(first_scan(chip))
        .chain(captures)
        .chain(outputs)
        .chain(requests)
        .chain(moved)
        .min()
}

/// The trigger that may start the first scan. The outside counts its time from that scan.
fn first_scan(chip: &Chip) -> Option<u64> {
    if chip.stimulus.sampling().is_some() {
        return None;
    }
    let triggers = (0..ADCS.len()).filter_map(|adc| chip.units.tim[chip.converter_trigger(adc)?].trigger(0));
    triggers.min()
}

/// When a converter will next raise a line: its own, or the line of the DMA stream that serves it.
fn acquisition(chip: &Chip, number: usize) -> Option<u64> {
    let adc = &chip.units.adc.converters[number];
    if !adc.is_in_use() || adc.blocked() {
        return None;
    }
    let server = &SERVERS.adc[number];
    let dma = &chip.units.dma[server.dma];
    let trigger = |n: u64| chip.units.tim[chip.converter_trigger(number)?].trigger(n);
    let beats = match dma.serving(&server.streams).filter(|_| adc.requests_dma()) {
        Some(stream) => u64::from(dma.beats_to_interrupt(stream)?),
        None if adc.interrupts_on_conversion() => 1,
        None => return None,
    };
    // If the trigger's period is about to change, only its next pulse is known: look again at that time.
    adc.conversion(beats, trigger).or_else(|| trigger(0))
}

/// When the DMA stream that feeds an output, or the DAC if it has no stream, will raise its line.
fn playing(chip: &Chip, channel: usize) -> Option<u64> {
    let (dac, server) = (&chip.units.dac, &SERVERS.dac[channel]);
    if !dac.requests_dma(channel) {
        return None;
    }
    let timer = &chip.units.tim[chip.output_trigger(channel)?];
    let dma = &chip.units.dma[server.dma];
    let beats = match dma.serving(&server.streams) {
        Some(stream) => u64::from(dma.beats_to_interrupt(stream)?),
        None if dac.may_interrupt(channel) => 1,
        None => return None,
    };
    timer.trigger(beats - 1).or_else(|| timer.trigger(0))
}

/// When the DMA stream that feeds a transmitter will raise its line.
fn transmission(chip: &Chip, number: usize) -> Option<u64> {
    let usart = &chip.units.usart[number];
    usart.next_sent()?;
    let server = &SERVERS.usart[number].transmitter;
    let dma = &chip.units.dma[server.dma];
    let beats = dma.beats_to_interrupt(dma.serving(&server.streams)?)?;
    usart.transmit_request(u64::from(beats))
}
