//! The next event of the machine that needs no instruction.

use super::chip::Chip;
use super::levels::Levels;
use super::sampling::Scans;
use super::wiring;
use crate::peripherals::Peripheral;
use crate::peripherals::dac::CHANNELS;
use crate::peripherals::flash::FlashEvent;

/// An event that needs no instruction, with the number of its converter, timer or USART.
#[derive(Debug, Clone, Copy)]
pub(super) enum MachineEvent {
    ConversionEnds(usize),
    /// The trigger that a timer waits for comes.
    TimerStarts(usize),
    LevelChanges,
    /// A compare output of a timer moves.
    OutputMoves(usize),
    ConvertersTriggered(usize),
    /// A timer asks the DMA.
    TimerRequests(usize),
    FrameSent(usize),
    /// A byte has come from outside, or the line is idle.
    FrameReceived(usize),
    /// The DMA is about to fetch a byte that was received.
    DmaFetches(usize),
    /// A phase of an I2C bus ends.
    I2cSteps(usize),
    /// A frame of an SPI bus ends.
    SpiExchanges(usize),
    WatchdogOut,
    WindowWatchdogOut,
    /// A flag of the RTC is set.
    ClockFlag,
    Flash(FlashEvent),
}

/// Returns the next event and its time, ns. Of several events at one time, a timer is started first, then a
/// level changes, a conversion ends, and a trigger comes.
pub(super) fn next(chip: &Chip, levels: &Levels) -> Option<(u64, MachineEvent)> {
    next_but(chip, levels, None)
}

/// Returns the next event other than those of the given converter and its trigger.
pub(super) fn next_but(chip: &Chip, levels: &Levels, scans: Option<Scans>) -> Option<(u64, MachineEvent)> {
    let units = &chip.units;
    let tim = &units.tim;
    let mut next = None;
    // Of events at the same time, the one offered first is next.
    let mut offer = |at: Option<u64>, event: MachineEvent| {
        if let Some(at) = at
            && next.is_none_or(|(soonest, _)| at < soonest)
        {
            next = Some((at, event));
        }
    };
    for (n, slave) in tim.iter().enumerate() {
        if let Some(master) = slave.waits_for().and_then(|itr| wiring::master(n, itr)) {
            offer(tim[master].trigger(0), MachineEvent::TimerStarts(n));
        }
    }
    offer(levels.next(chip), MachineEvent::LevelChanges);
    for (n, timer) in tim.iter().enumerate() {
        offer(timer.next_output(), MachineEvent::OutputMoves(n));
    }
    for (n, timer) in tim.iter().enumerate().filter(|_| chip.linked_timers) {
        offer(timer.next_request(), MachineEvent::TimerRequests(n));
        if let Some(master) = timer.moved_by().and_then(|itr| wiring::master(n, itr)) {
            offer(tim[master].trigger(0), MachineEvent::ConvertersTriggered(master));
        }
    }
    let but = |adc| scans.is_some_and(|scans| scans.adc == adc);
    for (n, converter) in units.adc.converters.iter().enumerate().filter(|(n, _)| !but(*n)) {
        offer(converter.next_conversion(), MachineEvent::ConversionEnds(n));
    }
    for n in (0..units.adc.converters.len()).filter(|n| !but(*n)) {
        if let Some(master) = chip.converter_trigger(n) {
            offer(tim[master].trigger(0), MachineEvent::ConvertersTriggered(master));
        }
    }
    for n in 0..CHANNELS {
        if let Some(master) = chip.output_trigger(n) {
            offer(tim[master].trigger(0), MachineEvent::ConvertersTriggered(master));
        }
    }
    for (n, usart) in units.usart.iter().enumerate() {
        offer(usart.next_sent(), MachineEvent::FrameSent(n));
    }
    // Offered after sent frames: over a wire, a frame that ends keeps the line from being idle.
    for (n, usart) in units.usart.iter().enumerate() {
        offer(usart.next_received(), MachineEvent::FrameReceived(n));
        offer(usart.next_fetch(), MachineEvent::DmaFetches(n));
    }
    for (n, i2c) in units.i2c.iter().enumerate() {
        offer(i2c.next_step(), MachineEvent::I2cSteps(n));
    }
    for (n, spi) in units.spi.iter().enumerate() {
        offer(spi.next_frame(), MachineEvent::SpiExchanges(n));
    }
    offer(units.iwdg.next_interrupt(), MachineEvent::WatchdogOut);
    offer(units.wwdg.runs_out(), MachineEvent::WindowWatchdogOut);
    offer(units.rtc.next_flag(), MachineEvent::ClockFlag);
    if let Some((at, event)) = units.flash.next_event() {
        offer(Some(at), MachineEvent::Flash(event));
    }
    next
}
