//! The converters at work: triggers, conversions, and the codes that they find.

use std::mem::take;

use super::chip::Chip;
use super::wiring::{self, ADCS, BATTERY, OUTPUTS, REFERENCE};
use crate::peripherals::dac::CHANNELS;
use crate::peripherals::signature;

/// A converter that samples, and the timer that triggers it and no other converter.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scans {
    pub(super) adc: usize,
    pub(super) tim: usize,
}

impl Chip {
    /// Returns the converter that samples and its timer, if the timer triggers nothing else.
    pub(super) fn scans(&self) -> Option<Scans> {
        let adc = self.sampler?;
        let tim = self.converter_trigger(adc)?;
        let triggered = (0..ADCS.len()).filter(|adc| self.converter_trigger(*adc) == Some(tim));
        let outputs = (0..CHANNELS).any(|channel| self.output_trigger(channel) == Some(tim));
        let slaves = self.linked_timers && (0..self.units.tim.len()).any(|slave| self.is_moved(slave, tim));
        (triggered.count() == 1 && !outputs && !slaves).then_some(Scans { adc, tim })
    }

    /// Returns `true` if the trigger output of a timer restarts another, or is its clock.
    fn is_moved(&self, slave: usize, master: usize) -> bool {
        let trigger = self.units.tim[slave].moved_by();
        trigger.and_then(|itr| wiring::master(slave, itr)) == Some(master)
    }

    /// The timer whose TRGO starts the scans of a converter.
    pub(super) fn converter_trigger(&self, adc: usize) -> Option<usize> {
        wiring::converter_trigger(self.units.adc.converters[adc].external_trigger()?)
    }

    /// The timer whose TRGO a channel of the DAC waits for.
    pub(super) fn output_trigger(&self, channel: usize) -> Option<usize> {
        wiring::output_trigger(self.units.dac.external_trigger(channel)?)
    }

    /// The trigger output of a timer pulses: converters that listen to it start, outputs change, and timers
    /// start again.
    pub(super) fn trigger_converters(&mut self, tim: usize, at: u64) {
        for channel in 0..CHANNELS {
            if self.output_trigger(channel) == Some(tim) {
                self.units.dac.trigger(channel, at);
            }
        }
        let slaves = if self.linked_timers {
            self.units.tim.len()
        } else {
            0
        };
        for slave in 0..slaves {
            if self.is_moved(slave, tim) {
                self.units.tim[slave].take_internal_trigger(at);
            }
        }
        for adc in 0..ADCS.len() {
            if self.converter_trigger(adc) == Some(tim) {
                self.units.adc.converters[adc].trigger(at);
                self.note_scan(adc, at, true);
            }
        }
    }

    pub(super) fn convert(&mut self, adc: usize, at: u64) {
        if let Some(channel) = self.units.adc.converters[adc].converting() {
            let code = self.code(adc, channel, at);
            self.units.adc.converters[adc].finish(code, at);
            self.note_scan(adc, at, false);
        }
    }

    /// The code of a channel: of an internal input, which only ADC1 has, or of a pin.
    pub(super) fn code(&mut self, adc: usize, channel: u32, at: u64) -> u16 {
        /// At 25 °C, in mV: typical, DocID022152 table of the temperature sensor.
        const TEMPERATURE_MV: u32 = 760;
        let supply = self.units.pwr.supply_mv.max(1);
        // To the nearest code.
        let of_supply = |millivolts: u32| ((4095 * millivolts + supply / 2) / supply).min(4095) as u16;
        let (sensors, battery) = (self.units.adc.sensors_on(), self.units.adc.battery_on());
        match (adc, channel) {
            // The converter compares the reference with the supply.
            (0, REFERENCE) if sensors => {
                ((signature::REFERENCE_CODE * 3300 + supply / 2) / supply).min(4095) as u16
            }
            // VBAT is taken to come from the same supply.
            (0, BATTERY) if battery => of_supply(supply / self.part.battery_divider()),
            (0, _) if sensors && channel == self.part.temperature_channel() => of_supply(TEMPERATURE_MV),
            _ => match self.by_output(adc, channel, at) {
                Some(code) => code,
                None => self.stimulus.code(adc, channel, at),
            },
        }
    }

    /// The code of an input that the DAC drives: over a wire, or at an output's own pin.
    fn by_output(&mut self, adc: usize, channel: u32, at: u64) -> Option<u16> {
        // The common case, once for every sample.
        if self.analog_wires.is_empty() && !self.units.dac.is_on() {
            return None;
        }
        let pin = wiring::analog_pin(adc, channel)?;
        if let Some(output) = OUTPUTS.iter().position(|output| *output == pin)
            && let Some(level) = self.units.dac.level_at_pin(output, self.units.pwr.supply_mv, at)
        {
            return Some(level as u16);
        }
        let wire = self.analog_wires.iter_mut().find(|wire| wire.to == pin)?;
        let (supply, dac) = (self.units.pwr.supply_mv, &self.units.dac);
        let code = wire.code(|output, at| dac.level(output, supply, at), at)?;
        self.units.dac.converted(wire.output, at);
        Some(code)
    }

    /// Counts a scan that has just started, and moves the inputs to its time.
    pub(super) fn note_scan(&mut self, adc: usize, at: u64, external: bool) {
        if take(&mut self.units.adc.converters[adc].scan_started) {
            if external {
                self.sampler.get_or_insert(adc);
            }
            let samples = self.sampler.is_none_or(|sampler| sampler == adc);
            self.scans += u64::from(samples);
            self.stimulus.begin_scan(adc, at, external && samples);
        }
    }
}
