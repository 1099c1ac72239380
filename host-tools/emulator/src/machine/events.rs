//! What happens next, by itself.

use super::chip::Chip;
use super::levels::Levels;
use super::wiring;
use crate::peripherals::{Peripheral, flash};

/// What can happen by itself.
#[derive(Debug, Clone, Copy)]
pub(super) enum Event {
    /// A conversion of a converter ends.
    Converted(usize),
    /// The trigger that a timer waits for comes.
    Started(usize),
    /// The level on a pin changes.
    Level,
    /// A timer triggers converters.
    Triggered(usize),
    /// A frame has left a USART.
    Sent(usize),
    /// A byte has reached a USART from outside, or its line is idle.
    Received(usize),
    /// The DMA is about to fetch a byte that a USART has received.
    Fetched(usize),
    /// The watchdog runs out.
    WatchdogOut,
    /// An operation of the flash ends, or is cut.
    Flash(flash::Event),
}

/// What happens next, and when. If several things happen at one time, a timer is started first, then a level
/// changes, a conversion ends, and a trigger comes.
pub(super) fn next(chip: &Chip, levels: &Levels) -> Option<(u64, Event)> {
    let units = &chip.units;
    let tim = &units.tim;
    let started = (0..tim.len()).filter_map(|n| {
        let master = wiring::master(n, tim[n].waits_for()?)?;
        Some((tim[master].trigger(0)?, Event::Started(n)))
    });
    let at = |time: Option<u64>, event: Event| time.map(|at| (at, event));
    let converters = units.adc.converters.iter().enumerate();
    let converted = converters
        .clone()
        .map(|(n, adc)| at(adc.next_conversion(), Event::Converted(n)));
    let triggered = converters.map(|(n, _)| {
        let tim_number = chip.converter_trigger(n)?;
        at(tim[tim_number].trigger(0), Event::Triggered(tim_number))
    });
    let usarts = units.usart.iter().enumerate();
    let sent = usarts
        .clone()
        .map(|(n, usart)| at(usart.next_sent(), Event::Sent(n)));
    // After what is sent: over a wire, a frame that ends keeps the line from being idle.
    let received = usarts.flat_map(|(n, usart)| {
        [
            at(usart.next_received(), Event::Received(n)),
            at(usart.next_fetch(), Event::Fetched(n)),
        ]
    });
    let others = [
        at(units.iwdg.next_interrupt(), Event::WatchdogOut),
        units
            .flash
            .next_event()
            .map(|(at, event)| (at, Event::Flash(event))),
    ];
    // The first of those at the same time.
    let in_order = started
        .map(Some)
        .chain([at(levels.next(chip), Event::Level)])
        .chain(converted)
        .chain(triggered)
        .chain(sent)
        .chain(received)
        .chain(others);
    in_order.flatten().min_by_key(|(at, _)| *at)
}
