//! The peripherals as one device: registers behind clock gates, and what one peripheral does to another.

use std::collections::BTreeMap;
use std::mem::take;

use super::buses::Buses;
use super::stimulus::StimulusPlayer;
use super::table::{Gate, PeripheralRow, TABLE, Units, WrittenRows, offset_in, row_at};
use super::wires::{AnalogLoop, Wires};
use super::wiring::{self, ADCS};
use crate::chip::Chip as Part;
use crate::memory::APB;
use crate::outcome::ResetCause;
use crate::peripherals::NoRegister;
use crate::peripherals::clock::ClockTree;
use crate::peripherals::dma::STREAMS;
use crate::peripherals::rcc::BUSES;
use crate::peripherals::tim::Tim;

/// Deep sleep mode of the part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum DeepSleep {
    Stop,
    /// STOP has ended, and the processor is still to be woken.
    StopEnds,
    Standby,
    StandbyEnds,
}

/// All peripherals, and the analog inputs of the converter.
#[derive(Debug, Clone)]
pub(super) struct Chip {
    pub(super) units: Units,
    pub(super) stimulus: StimulusPlayer,
    /// The converter that a trigger from outside started first: the one that samples.
    pub(super) sampler: Option<usize>,
    /// Scans of that converter that were started.
    pub(super) scans: u64,
    pub(super) wires: Wires,
    pub(super) analog_wires: Vec<AnalogLoop>,
    pub(super) buses: Buses,
    /// True if a timer has requested DMA or may be restarted by another. Most images have no such timer.
    pub(super) linked_timers: bool,
    /// Timers that have had a channel on, a bit for each.
    pub(super) driving: u32,
    pub(super) clocks: ClockTree,
    /// Time that HCLK spent at each frequency up to its last change, and the time of that change, ns.
    hclk_ns: BTreeMap<u32, u64>,
    hclk_since_ns: u64,
    pub(super) deep_sleep: Option<DeepSleep>,
    /// The peripherals that RCC holds in reset, a bit for each row of the table.
    held: u64,
    /// The buses' reset registers from which `held` was computed.
    resets: [u32; BUSES],
    pub(super) written: WrittenRows,
    pub(super) part: Part,
    /// First addresses of the modelled peripherals that the part lacks.
    lacking: Vec<u32>,
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
    /// Creates a part after power-up, with a crystal of `hse_hz`, its factory identifier, and the seed of
    /// its random numbers.
    pub(super) fn new(hse_hz: u32, part: Part, uid: [u8; 12], seed: u64, stimulus: StimulusPlayer) -> Self {
        let mut units = Units::new(hse_hz, part.device_id(), uid, seed);
        units.signature.flash_kib = part.flash_kib();
        units.flash.set_end(part.flash().end);
        units.rcc.limits = part.clock_limits();
        units.rcc.selectable = part.clock_selections();
        units.pwr.has_overdrive = part.has_overdrive();
        for (dma, stream, channel) in wiring::foreign_requests(part) {
            units.dma[dma].foreign[stream] |= channel;
        }
        for ((port, pin), function) in wiring::foreign_functions(part) {
            units.gpio[port].foreign[pin] |= function;
        }
        let starts = TABLE.iter().map(|row| row.addresses.start);
        Self {
            units,
            part,
            lacking: starts.filter(|start| part.lacks(*start)).collect(),
            stimulus,
            sampler: None,
            scans: 0,
            wires: Wires::default(),
            analog_wires: Vec::new(),
            buses: Buses::default(),
            linked_timers: false,
            driving: 0,
            clocks: ClockTree::HSI,
            hclk_ns: BTreeMap::new(),
            hclk_since_ns: 0,
            deep_sleep: None,
            held: 0,
            resets: [0; BUSES],
            written: WrittenRows::default(),
        }
    }

    pub(super) fn reset(&mut self, cause: ResetCause, now: u64) {
        self.deep_sleep = None;
        for row in TABLE {
            (row.model_mut)(&mut self.units).reset(now);
        }
        self.units.rcc.set_reset_cause(cause);
        if cause == ResetCause::PowerCut {
            self.units.debug.demcr = 0;
            self.units.pwr.flags = 0;
            self.units.rtc.reset_backup_domain(now);
        }
        self.pass_on(now);
    }

    pub(super) fn read(&mut self, address: u32, now: u64) -> Result<u32, Unanswered> {
        let (row, offset) = self.clocked(address)?;
        let model = (TABLE[row].model_mut)(&mut self.units);
        Ok(model.read(offset, now)?)
    }

    /// Writes the register at the address of a word, with all that follows from it.
    pub(super) fn write(&mut self, address: u32, value: u32, now: u64) -> Result<(), Unanswered> {
        let (number, offset) = self.clocked(address)?;
        let row = &TABLE[number];
        (row.model_mut)(&mut self.units).write(offset, value, now)?;
        self.written.insert(number);
        self.pass_on(now);
        if row.name.starts_with("TIM") {
            self.linked_timers |= self.units.tim.iter().any(Tim::is_linked);
        }
        if row.name.starts_with("TIM") || row.name.starts_with("GPIO") {
            self.update_outputs(now);
            self.select_devices(now);
        }
        Ok(())
    }

    /// Widens a narrow write to a word. The bridges to APB1 and APB2 repeat its bytes over the whole word
    /// (section 2.1). Elsewhere the rest of the word keeps its value.
    pub(super) fn widen(&mut self, address: u32, bytes: u32, value: u32, now: u64) -> u32 {
        match bytes {
            4 => return value,
            2 if APB.contains(&address) => return (value & 0xffff) * 0x0001_0001,
            1 if APB.contains(&address) => return (value & 0xff) * 0x0101_0101,
            _ => {}
        }
        let rest = self.read(address & !3, now).unwrap_or(0);
        let shift = 8 * (address & 3);
        let mask = (u32::MAX >> (32 - 8 * bytes)) << shift;
        (rest & !mask) | ((value << shift) & mask)
    }

    pub(super) fn first_scan_ns(&self) -> Option<u64> {
        self.stimulus.sampling().map(|sampling| sampling.first_ns)
    }

    /// Returns `true` if the processor executes no instruction: flash is being written, or its clock has
    /// stopped. Interrupts wait.
    pub(super) fn stands_still(&self) -> bool {
        self.units.flash.stalls() || self.clocks.hclk == 0
    }

    /// The number of the peripheral at an address, and the offset in it.
    fn clocked(&self, address: u32) -> Result<(usize, u32), Unanswered> {
        let number = row_at(address).ok_or(Unanswered { clock_off: false })?;
        let row = &TABLE[number];
        if self.lacks(row) {
            return Err(Unanswered { clock_off: false });
        }
        if !self.is_clocked(row) {
            return Err(Unanswered { clock_off: true });
        }
        Ok((number, offset_in(row, address)))
    }

    fn lacks(&self, row: &PeripheralRow) -> bool {
        self.lacking.contains(&row.addresses.start)
    }

    /// Returns `true` if the part has a peripheral, and its clock is on.
    pub(super) fn is_clocked(&self, row: &PeripheralRow) -> bool {
        let Gate { bus, enables, .. } = row.gate;
        !self.lacks(row) && (enables == 0 || self.units.rcc.enabled(bus, enables))
    }

    /// Passes on what a write to one peripheral does to others.
    pub(super) fn pass_on(&mut self, now: u64) {
        self.hold_in_reset(now);
        let clocks = self.units.rcc.clocks();
        if clocks != self.clocks {
            // A change of the clock may have moved what the DMA serves now into the past.
            let passed = now.saturating_sub(self.hclk_since_ns);
            *self.hclk_ns.entry(self.clocks.hclk).or_default() += passed;
            self.hclk_since_ns = now;
            self.clocks = clocks;
            for row in TABLE {
                (row.model_mut)(&mut self.units).set_clocks(&clocks, now);
            }
        }
        self.units.dwt.enable(self.units.debug.traces(), now);
        let open = self.units.pwr.backup_domain_open();
        (
            self.units.rcc.backup_domain_open,
            self.units.rtc.backup_domain_open,
        ) = (open, open);
        if take(&mut self.units.rcc.backup_domain_reset) {
            self.units.rtc.reset_backup_domain(now);
        }
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

    pub(super) fn hclk_ns(&self, now: u64) -> Vec<(u32, u64)> {
        let mut times = self.hclk_ns.clone();
        *times.entry(self.clocks.hclk).or_default() += now.saturating_sub(self.hclk_since_ns);
        times.into_iter().filter(|(_, ns)| *ns > 0).collect()
    }

    /// Notes the streams that were just enabled for a request that no model makes.
    fn note_streams(&mut self, dma: usize) {
        let started = take(&mut self.units.dma[dma].started);
        for stream in (0..STREAMS).filter(|stream| started >> stream & 1 == 1) {
            let Some(channel) = self.units.dma[dma].listens_to(stream) else {
                continue;
            };
            let of = match wiring::request(self.part, dma, stream, channel) {
                Some(request) if wiring::is_modelled(request) => continue,
                Some(request) => format!("{request}, a request that no model makes"),
                None => format!("channel {channel}, which has no request"),
            };
            self.units.dma[dma]
                .notes
                .note(format!("S{stream}CR: the stream waits for {of}"));
        }
    }

    /// Resets the peripherals that RCC has begun to hold in reset.
    fn hold_in_reset(&mut self, now: u64) {
        let resets = *self.units.rcc.resets();
        if resets == self.resets {
            return;
        }
        self.resets = resets;
        let mut held = 0;
        for (n, row) in TABLE.iter().enumerate() {
            let is_held = self.units.rcc.held_in_reset(row.gate.bus, row.gate.reset);
            held |= u64::from(is_held) << n;
            if is_held && self.held >> n & 1 == 0 {
                (row.model_mut)(&mut self.units).reset(now);
            }
        }
        self.held = held;
    }

    fn start_slaves(&mut self, master: usize, now: u64) {
        for slave in 0..self.units.tim.len() {
            let trigger = self.units.tim[slave].waits_for();
            if trigger.and_then(|itr| wiring::master(slave, itr)) == Some(master) {
                self.units.tim[slave].start(now);
            }
        }
    }

    /// Requests to modelled peripherals that their models do not carry out.
    pub(super) fn unmodelled(&self) -> Vec<String> {
        let notes = TABLE
            .iter()
            .flat_map(|row| (row.notes)(&self.units).iter().map(move |note| (row.name, note)));
        let notes = notes.map(|(name, note)| format!("{name} {note}"));
        let channels = self.stimulus.unmapped();
        let channels = channels.map(|(adc, channel)| {
            let pin = wiring::analog_pin(adc, channel).map(wiring::pin_name);
            let pin = pin.map_or_else(|| "no pin".to_owned(), |pin| format!("pin {pin}"));
            let adc = ADCS[adc];
            format!("{adc} channel {channel} ({pin}) has no stimulus: it reads 0")
        });
        let converts = self.units.adc.converters.iter().any(|adc| adc.has_been_on);
        let silent = (converts && self.stimulus.never_began()).then(|| {
            "ADC1 no triggered scan came: the rows of the stimulus were not played; give them since power-up".into()
        });
        notes.chain(channels).chain(silent).collect()
    }
}
