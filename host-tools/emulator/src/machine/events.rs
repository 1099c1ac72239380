//! What happens next, by itself.

use super::chip::Chip;
use super::levels::Levels;
use crate::peripherals::{Peripheral, flash};

/// What can happen by itself.
#[derive(Debug, Clone, Copy)]
pub(super) enum Event {
    /// A conversion ends.
    Converted,
    /// The trigger that a timer waits for comes.
    Started(usize),
    /// The level on a pin changes.
    Level,
    /// A timer triggers the converter.
    Triggered(usize),
    /// A byte has left USART1.
    Sent,
    /// A byte has reached USART1, or its line is idle.
    Received,
    /// The DMA is about to fetch a byte that USART1 has received.
    Fetched,
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
        let master = tim[n].waits_for(n)?;
        Some((tim[master].trigger(0)?, Event::Started(n)))
    });
    let at = |time: Option<u64>, event: Event| time.map(|at| (at, event));
    let events = [
        started.min_by_key(|(at, _)| *at),
        at(levels.next(chip), Event::Level),
        at(units.adc.next_conversion(), Event::Converted),
        units
            .adc
            .trigger_timer()
            .and_then(|t| at(tim[t].trigger(0), Event::Triggered(t))),
        at(units.usart1.next_sent(), Event::Sent),
        at(units.usart1.next_received(), Event::Received),
        at(units.usart1.next_fetch(), Event::Fetched),
        at(units.iwdg.next_interrupt(), Event::WatchdogOut),
        units
            .flash
            .next_event()
            .map(|(at, event)| (at, Event::Flash(event))),
    ];
    events.into_iter().flatten().min_by_key(|(at, _)| *at)
}
