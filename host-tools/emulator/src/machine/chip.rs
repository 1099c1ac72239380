//! The peripherals as one device: registers behind clock gates, and what one peripheral does to another.

use std::mem::take;

use super::stimulus::Stimulus;
use super::table::{Row, TABLE, Units, locate};
use super::wiring::REFERENCE;
use crate::outcome::ResetCause;
use crate::peripherals::clock::Clocks;
use crate::peripherals::{NoRegister, signature};

/// All peripherals, and the analog inputs of the converter.
#[derive(Debug, Clone)]
pub(super) struct Chip {
    pub(super) units: Units,
    pub(super) stimulus: Stimulus,
    /// Scans of the converter that were started.
    pub(super) scans: u64,
    clocks: Clocks,
    /// The peripherals that RCC holds in reset, a bit for each row of the table.
    held: u32,
}

/// There is no such register, or the clock of its peripheral is off.
#[derive(Debug, Clone, Copy)]
pub(super) struct Unanswered {
    pub(super) clock_off: bool,
}

impl From<NoRegister> for Unanswered {
    fn from(NoRegister: NoRegister) -> Self {
        Self { clock_off: false }
    }
}

impl Chip {
    /// After power-up, with a crystal of `hse_hz` and its factory identifier.
    pub(super) fn new(hse_hz: u32, uid: [u8; 12], stimulus: Stimulus) -> Self {
        Self {
            units: Units::new(hse_hz, uid),
            stimulus,
            scans: 0,
            clocks: Clocks::HSI,
            held: 0,
        }
    }

    /// Resets every peripheral. What comes from outside goes on.
    pub(super) fn reset(&mut self, cause: ResetCause, now: u64) {
        for row in TABLE {
            (row.model_mut)(&mut self.units).reset(now);
        }
        self.units.rcc.set_reset_cause(cause);
        self.pass_on(now);
    }

    /// Reads the register at the address of a word.
    pub(super) fn read(&mut self, address: u32, now: u64) -> Result<u32, Unanswered> {
        let (row, offset) = self.clocked(address)?;
        Ok((row.model_mut)(&mut self.units).read(offset, now)?)
    }

    /// Writes the register at the address of a word, with all that follows from it.
    pub(super) fn write(&mut self, address: u32, value: u32, now: u64) -> Result<(), Unanswered> {
        let (row, offset) = self.clocked(address)?;
        (row.model_mut)(&mut self.units).write(offset, value, now)?;
        self.pass_on(now);
        Ok(())
    }

    /// The word that a narrow write stands for. A data register takes the part as it is. Elsewhere the rest
    /// of the word stays.
    pub(super) fn widen(&mut self, address: u32, bytes: u32, value: u32, now: u64) -> u32 {
        if bytes == 4 {
            return value;
        }
        let is_data = locate(address).is_some_and(|(row, offset)| (row.model)(&self.units).is_data(offset));
        let rest = match is_data {
            true => 0,
            false => self.read(address & !3, now).unwrap_or(0),
        };
        let shift = 8 * (address & 3);
        let mask = (u32::MAX >> (32 - 8 * bytes)) << shift;
        (rest & !mask) | ((value << shift) & mask)
    }

    /// When the first externally triggered scan came.
    pub(super) fn first_scan_ns(&self) -> Option<u64> {
        self.stimulus.sampling().map(|sampling| sampling.first_ns)
    }

    /// Whether the processor gets no instruction: flash is being written, or its clock has stopped. Interrupts
    /// wait.
    pub(super) fn stands_still(&self) -> bool {
        self.units.flash.busy() || self.clocks.hclk == 0
    }

    fn clocked(&self, address: u32) -> Result<(&'static Row, u32), Unanswered> {
        let (row, offset) = locate(address).ok_or(Unanswered { clock_off: false })?;
        match row.gate {
            Some((bus, bit)) if !self.units.rcc.enabled(bus, bit) => Err(Unanswered { clock_off: true }),
            _ => Ok((row, offset)),
        }
    }

    /// Passes on what a write to one peripheral does to others.
    pub(super) fn pass_on(&mut self, now: u64) {
        self.hold_in_reset(now);
        let clocks = self.units.rcc.clocks();
        if clocks != self.clocks {
            self.clocks = clocks;
            for row in TABLE {
                (row.model_mut)(&mut self.units).set_clocks(&clocks, now);
            }
        }
        self.units.rcc.backup_domain_open = self.units.pwr.backup_domain_open();
        for master in 0..self.units.tim.len() {
            if take(&mut self.units.tim[master].trigger_now) {
                self.start_slaves(master, now);
                if self.units.adc.trigger_timer() == Some(master) {
                    self.trigger_converter(now);
                }
            }
        }
        self.note_scan(now, false);
    }

    /// Resets the peripherals that RCC has begun to hold in reset.
    fn hold_in_reset(&mut self, now: u64) {
        let mut held = 0;
        for (n, row) in TABLE.iter().enumerate() {
            let is_held = row
                .gate
                .is_some_and(|(bus, bit)| self.units.rcc.held_in_reset(bus, bit));
            held |= u32::from(is_held) << n;
            if is_held && self.held >> n & 1 == 0 {
                (row.model_mut)(&mut self.units).reset(now);
            }
        }
        self.held = held;
    }

    /// Starts the timers that wait for the trigger of this one.
    fn start_slaves(&mut self, master: usize, now: u64) {
        for slave in 0..self.units.tim.len() {
            if self.units.tim[slave].waits_for(slave) == Some(master) {
                self.units.tim[slave].start(now);
            }
        }
    }

    /// The converter's trigger comes.
    pub(super) fn trigger_converter(&mut self, at: u64) {
        self.units.adc.trigger(at);
        self.note_scan(at, true);
    }

    /// The conversion under way ends.
    pub(super) fn convert(&mut self, at: u64) {
        if let Some(channel) = self.units.adc.converting() {
            let code = match channel {
                REFERENCE if self.units.adc.reference_on() => self.reference(),
                _ => self.stimulus.code(channel),
            };
            self.units.adc.finish(code, at);
            self.note_scan(at, false);
        }
    }

    /// If a scan has just started, the inputs carry what belongs to it.
    fn note_scan(&mut self, at: u64, external: bool) {
        if take(&mut self.units.adc.scan_started) {
            self.scans += 1;
            self.stimulus.begin_scan(at, external);
        }
    }

    /// The code of the internal reference voltage. The converter compares it with the supply.
    fn reference(&self) -> u16 {
        (signature::REFERENCE_CODE * 3300 / self.units.pwr.supply().max(1)).min(4095) as u16
    }

    /// What was asked of modelled peripherals that the models do not do.
    pub(super) fn unmodelled(&self) -> Vec<String> {
        let notes = TABLE.iter().flat_map(|row| {
            let notes = (row.model)(&self.units).notes();
            notes.iter().map(|note| format!("{} {note}", row.name))
        });
        let channels = self.stimulus.unmapped();
        let channels = channels.map(|n| format!("ADC1 channel {n} has no stimulus: it reads 0"));
        let silent = self.stimulus.never_began().then(|| {
            "ADC1 no triggered scan came: the rows of the stimulus were not played, give them since power-up".into()
        });
        notes.chain(channels).chain(silent).collect()
    }
}
