//! The peripherals as one device: registers behind clock gates, and what one peripheral does to another.

use std::collections::BTreeMap;
use std::mem::take;

use super::stimulus::Stimulus;
use super::table::{Row, TABLE, Units, locate};
use super::wires::Wires;
use super::wiring::{self, ADCS, BATTERY, Pin, REFERENCE, TEMPERATURE, USARTS};
use crate::outcome::ResetCause;
use crate::peripherals::clock::Clocks;
use crate::peripherals::dma::STREAMS;
use crate::peripherals::{NoRegister, signature};

/// How deep the part sleeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum DeepSleep {
    Stop,
    /// STOP is over, and the processor does not know yet.
    StopEnds,
    Standby,
    StandbyEnds,
}

/// All peripherals, and the analog inputs of the converter.
#[derive(Debug, Clone)]
pub(super) struct Chip {
    pub(super) units: Units,
    pub(super) stimulus: Stimulus,
    /// The converter that a trigger from outside started first: the one that samples.
    pub(super) sampler: Option<usize>,
    /// Scans of that converter that were started.
    pub(super) scans: u64,
    pub(super) wires: Wires,
    pub(super) clocks: Clocks,
    /// How long HCLK had each frequency, up to its last change, and when that was.
    hclk_ns: BTreeMap<u32, u64>,
    hclk_since_ns: u64,
    pub(super) deep_sleep: Option<DeepSleep>,
    /// The peripherals that RCC holds in reset, a bit for each row of the table.
    held: u64,
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
            sampler: None,
            scans: 0,
            wires: Wires::default(),
            clocks: Clocks::HSI,
            hclk_ns: BTreeMap::new(),
            hclk_since_ns: 0,
            deep_sleep: None,
            held: 0,
        }
    }

    /// Resets every peripheral. What comes from outside goes on.
    pub(super) fn reset(&mut self, cause: ResetCause, now: u64) {
        self.deep_sleep = None;
        for row in TABLE {
            (row.model_mut)(&mut self.units).reset(now);
        }
        self.units.rcc.set_reset_cause(cause);
        if cause == ResetCause::PowerCut {
            self.units.debug.power_up();
            self.units.pwr.power_up();
        }
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
            Some(gate) if !self.units.rcc.enabled(gate.bus, gate.enables) => {
                Err(Unanswered { clock_off: true })
            }
            _ => Ok((row, offset)),
        }
    }

    /// Passes on what a write to one peripheral does to others.
    pub(super) fn pass_on(&mut self, now: u64) {
        self.hold_in_reset(now);
        let clocks = self.units.rcc.clocks();
        if clocks != self.clocks {
            *self.hclk_ns.entry(self.clocks.hclk).or_default() += now - self.hclk_since_ns;
            self.hclk_since_ns = now;
            self.clocks = clocks;
            for row in TABLE {
                (row.model_mut)(&mut self.units).set_clocks(&clocks, now);
            }
        }
        self.units.dwt.enable(self.units.debug.traces(), now);
        self.units.rcc.backup_domain_open = self.units.pwr.backup_domain_open();
        for master in 0..self.units.tim.len() {
            if take(&mut self.units.tim[master].trigger_now) {
                self.start_slaves(master, now);
                self.trigger_converters(master, now);
            }
        }
        for adc in 0..ADCS.len() {
            self.note_scan(adc, now, false);
        }
        if !self.wires.is_empty() {
            self.drive_wires(now);
        }
        self.sense_lines(now);
        for dma in 0..self.units.dma.len() {
            if self.units.dma[dma].started != 0 {
                self.note_streams(dma);
            }
        }
    }

    /// Puts the levels that outputs drive on the pins at the other ends of wires.
    fn drive_wires(&mut self, now: u64) {
        let driven = |(from, to): (Pin, Pin)| (to, self.units.gpio[from.0].driven(from.1));
        let levels: Vec<_> = self.wires.ends().map(driven).collect();
        for (pin, level) in levels {
            if let Some(high) = self.units.gpio[pin.0].drive_by_wire(pin.1, level) {
                self.level_changed(pin, high, now);
            }
        }
    }

    /// The level on a pin has changed, from outside or by a wire.
    pub(super) fn level_changed(&mut self, pin: Pin, high: bool, at: u64) {
        if let Some((tim, input)) = self.timer_input(pin) {
            self.units.tim[tim].edge(input, high, at);
        }
        self.sense_lines(at);
        self.sense_wake_up_pin(pin, high);
    }

    /// Passes the levels on pins, and the voltage detector's, on to EXTI.
    pub(super) fn sense_lines(&mut self, now: u64) {
        /// The line of the voltage detector.
        const DETECTOR: usize = 16;
        let units = &mut self.units;
        let watched = units.exti.watched();
        let level = |line: usize| match line {
            0..DETECTOR => units
                .gpio
                .get(units.syscfg.port(line))
                .map_or(0, |port| port.input() >> line & 1),
            _ => u32::from(units.pwr.supply_low()),
        };
        let levels = (watched != 0).then(|| {
            let lines = (0..=DETECTOR).filter(|line| watched >> line & 1 == 1);
            lines.fold(0, |levels, line| levels | level(line) << line)
        });
        units.exti.input(levels);
        if take(&mut units.exti.edge_came) {
            self.wake_from_stop(now);
        }
    }

    /// Whether a change of the level on a pin would come through EXTI, or wake the part.
    pub(super) fn listens_to(&self, pin: Pin, high: bool) -> bool {
        let units = &self.units;
        (units.syscfg.port(pin.1) == pin.0 && units.exti.listens(pin.1, high)) || self.waits_for(pin, high)
    }

    /// How long HCLK had each frequency.
    pub(super) fn hclk_ns(&self, now: u64) -> Vec<(u32, u64)> {
        let mut times = self.hclk_ns.clone();
        *times.entry(self.clocks.hclk).or_default() += now.saturating_sub(self.hclk_since_ns);
        times.into_iter().filter(|(_, ns)| *ns > 0).collect()
    }

    /// The timer and its input that a pin leads to, as the pin is set.
    pub(super) fn timer_input(&self, pin: Pin) -> Option<(usize, usize)> {
        let function = self.units.gpio[pin.0].alternate(pin.1)?;
        wiring::timer_input(pin, function)
    }

    /// Notes the streams that were just enabled for a request that no model makes.
    fn note_streams(&mut self, dma: usize) {
        let started = take(&mut self.units.dma[dma].started);
        for stream in (0..STREAMS).filter(|stream| started >> stream & 1 == 1) {
            let Some(channel) = self.units.dma[dma].listens_to(stream) else {
                continue;
            };
            let of = match wiring::request(dma, stream, channel) {
                Some(request) if wiring::is_modelled(request) => continue,
                Some(request) => format!("{request}, which no model requests"),
                None => format!("channel {channel}, which has no request"),
            };
            self.units.dma[dma].note(format!("S{stream}CR: the stream waits for {of}"));
        }
    }

    /// Resets the peripherals that RCC has begun to hold in reset.
    fn hold_in_reset(&mut self, now: u64) {
        let mut held = 0;
        for (n, row) in TABLE.iter().enumerate() {
            let is_held = row
                .gate
                .is_some_and(|gate| self.units.rcc.held_in_reset(gate.bus, gate.reset));
            held |= u64::from(is_held) << n;
            if is_held && self.held >> n & 1 == 0 {
                (row.model_mut)(&mut self.units).reset(now);
            }
        }
        self.held = held;
    }

    /// Starts the timers that wait for the trigger of this one.
    fn start_slaves(&mut self, master: usize, now: u64) {
        for slave in 0..self.units.tim.len() {
            let trigger = self.units.tim[slave].waits_for();
            if trigger.and_then(|itr| wiring::master(slave, itr)) == Some(master) {
                self.units.tim[slave].start(now);
            }
        }
    }

    /// The timer whose TRGO starts the scans of a converter.
    pub(super) fn converter_trigger(&self, adc: usize) -> Option<usize> {
        wiring::converter_trigger(self.units.adc.converters[adc].external_trigger()?)
    }

    /// The trigger output of a timer pulses: converters that listen to it start.
    pub(super) fn trigger_converters(&mut self, tim: usize, at: u64) {
        for adc in 0..ADCS.len() {
            if self.converter_trigger(adc) == Some(tim) {
                self.units.adc.converters[adc].trigger(at);
                self.note_scan(adc, at, true);
            }
        }
    }

    /// The conversion under way ends.
    pub(super) fn convert(&mut self, adc: usize, at: u64) {
        if let Some(channel) = self.units.adc.converters[adc].converting() {
            let code = self.code(adc, channel, at);
            self.units.adc.converters[adc].finish(code, at);
            self.note_scan(adc, at, false);
        }
    }

    /// The code of a channel: of an input of the part's own, which only ADC1 has, or of a pin.
    fn code(&mut self, adc: usize, channel: u32, at: u64) -> u16 {
        /// At 25 °C, in mV: typical, DocID022152 table of the temperature sensor.
        const TEMPERATURE_MV: u32 = 760;
        let supply = self.units.pwr.supply().max(1);
        let of_supply = |millivolts: u32| (4095 * millivolts / supply).min(4095) as u16;
        let (sensors, battery) = (self.units.adc.sensors_on(), self.units.adc.battery_on());
        match (adc, channel) {
            (0, TEMPERATURE) if sensors => of_supply(TEMPERATURE_MV),
            // The converter compares the reference with the supply.
            (0, REFERENCE) if sensors => (signature::REFERENCE_CODE * 3300 / supply).min(4095) as u16,
            // VBAT is taken to come from the same supply; half of it is measured.
            (0, BATTERY) if battery => of_supply(supply / 2),
            _ => self.stimulus.code(adc, channel, at),
        }
    }

    /// If a scan has just started, the inputs carry what belongs to it.
    fn note_scan(&mut self, adc: usize, at: u64, external: bool) {
        if take(&mut self.units.adc.converters[adc].scan_started) {
            if external {
                self.sampler.get_or_insert(adc);
            }
            let samples = self.sampler.is_none_or(|sampler| sampler == adc);
            self.scans += u64::from(samples);
            self.stimulus.begin_scan(adc, at, external && samples);
        }
    }

    /// The pin of these that a USART is connected to, as the pins are set.
    fn connected(&self, pins: &[(Pin, u32)]) -> Option<Pin> {
        let is_set =
            |(pin, function): &&(Pin, u32)| self.units.gpio[pin.0].alternate(pin.1) == Some(*function);
        pins.iter().find(is_set).map(|(pin, _)| *pin)
    }

    /// A frame has left a transmitter. Returns its data if it also left the part, by a pin. Wires carry it to
    /// receivers.
    pub(super) fn sent(&mut self, usart: usize, at: u64) -> Option<u16> {
        let frame = self.units.usart[usart].sent()?;
        let Some(pin) = self.connected(wiring::transmitters(usart)) else {
            self.units.usart[usart]
                .note("CR1.TE: it sends, and no pin is its transmitter: nothing leaves the part");
            return None;
        };
        let others: Vec<Pin> = self.wires.from(pin).collect();
        for to in 0..USARTS.len() {
            let at_wire = self
                .connected(wiring::receivers(to))
                .is_some_and(|pin| others.contains(&pin));
            if at_wire {
                self.units.usart[to].arrive(frame, at);
            }
        }
        Some(frame.data)
    }

    /// A byte from outside has come to a receiver, or its line is idle.
    pub(super) fn received(&mut self, usart: usize, at: u64) {
        let pin = self.connected(wiring::receivers(usart));
        // Another frame may be on its way over a wire.
        let busy = pin.is_some_and(|pin| {
            let mut senders = (0..USARTS.len()).filter(|from| self.units.usart[*from].is_sending());
            senders.any(|from| {
                let from = self.connected(wiring::transmitters(from));
                from.is_some_and(|from| self.wires.from(from).any(|to| to == pin))
            })
        });
        self.units.usart[usart].receive(at, pin.is_some(), busy);
    }

    /// What was asked of modelled peripherals that the models do not do.
    pub(super) fn unmodelled(&self) -> Vec<String> {
        let notes = TABLE.iter().flat_map(|row| {
            let notes = (row.model)(&self.units).notes();
            notes.iter().map(|note| format!("{} {note}", row.name))
        });
        let channels = self.stimulus.unmapped();
        let channels = channels.map(|(adc, channel)| {
            let pin = wiring::analog_pin(adc, channel).map(wiring::pin_name);
            let pin = pin.map_or_else(|| "no pin".to_owned(), |pin| format!("pin {pin}"));
            format!(
                "{} channel {channel} ({pin}) has no stimulus: it reads 0",
                ADCS[adc]
            )
        });
        let silent = self.stimulus.never_began().then(|| {
            "ADC1 no triggered scan came: the rows of the stimulus were not played, give them since power-up".into()
        });
        notes.chain(channels).chain(silent).collect()
    }
}
