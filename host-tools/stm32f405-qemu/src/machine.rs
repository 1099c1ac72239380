//! The peripherals put together, driven by the processor and by time.
//!
//! # Design
//!
//! Two things drive a [`Machine`] from outside: accesses by the processor ([`Machine::read`],
//! [`Machine::write`], [`Machine::store`]), each with its time, and [`Machine::advance`] at the time that
//! [`Machine::next_interrupt`] returned. Each first plays everything that has happened since, in order:
//! triggers, conversions, transfers, bytes. The outside is therefore woken for interrupts only: at the half
//! and the end of a DMA buffer, and never for a sample.
//!
//! The trait [`Exterior`] is what the machine needs of the outside: memory, interrupt lines, and a place for
//! bytes.
//!
//! `table` lists the peripherals. `chip` is the device that they form, and `wiring` says how they are
//! connected. `events` says what happens next, and `forecast` says when the processor will be interrupted.

mod board;
mod buses;
mod chip;
mod crash;
mod events;
mod forecast;
mod frames;
mod levels;
mod lines;
mod pins;
mod polls;
mod ports;
mod quiet;
pub mod registers;
mod sampling;
mod sleep;
mod stimulus;
mod table;
mod transfers;
mod unknown;
mod wires;
mod wiring;

pub use board::{Exterior, INTERRUPTS, NMI, SYSTICK};
pub(crate) use registers::name_of;
pub use stimulus::StimulusPlayer;
pub(crate) use wiring::{I2CS, SPIS, USARTS, analog_pin, interrupt_name, pin};

use crate::given::{FaultKind, Inputs, Run};
pub use crate::memory::{FLASH, SRAM, WRITABLE};
use crate::outcome::{Outcome, Pin, Reset, ResetCause};
use crate::peripherals::Peripheral;
use crate::peripherals::dma::STREAMS;
use crate::peripherals::flash::FlashEvent;
use crate::peripherals::i2c::I2c;
use crate::peripherals::tim::Tim;
use crate::peripherals::usart::Usart;
use crate::ramp::Ramp;
use buses::Buses;
use chip::Chip;
use crash::crash;
use events::MachineEvent;
use levels::Levels;
use lines::InterruptLines;
use polls::Polls;
use quiet::{QuietTime, SteadyRead, SteadyWrite};
use sampling::Scans;
use table::{DMA2_LINES, TABLE, row_at};
use transfers::{Context, Transfers, part, serving};
use unknown::UnknownRegisters;
use wires::{AnalogLoop, Wires};
use wiring::{SERVERS, known_pin};

/// Offsets of a port's output register, and of the one that sets and resets its bits (section 8.4).
const ODR: u32 = 0x14;
const BSRR: u32 = 0x18;

/// A part without its processor and memory.
#[derive(Debug, Clone)]
pub struct Machine {
    chip: Chip,
    levels: Levels,
    transfers: Transfers,
    lines: InterruptLines,
    unknown: UnknownRegisters,
    polls: Polls,
    quiet: QuietTime,
    /// Address of the unmodelled register that the processor polls.
    stuck: Option<u32>,
    /// Cause of a requested reset that has not happened yet.
    reset_wanted: Option<ResetCause>,
    resets: Vec<Reset>,
    /// Address of the image's vector table.
    vectors: u32,
}

impl Machine {
    /// Creates a machine as it is after power-up, with the crystal, identity and inputs of a run. Faults and
    /// pokes come from outside, through [`Self::fail`] and the board.
    ///
    /// # Panics
    /// One of the pins or USARTs does not exist.
    pub fn new(run: Run) -> Self {
        let hse_hz = off_by(run.hse_hz, run.hse_ppm);
        let stimulus = StimulusPlayer::new(&run, hse_hz);
        let mut chip = Chip::new(hse_hz, run.chip, run.uid, run.random_seed, stimulus);
        if let Some(dev_id) = run.dev_id {
            chip.units.dbgmcu.dev_id = dev_id;
        }
        for converter in &mut chip.units.adc.converters {
            converter.software_scan_under_trigger = run.software_scan_under_trigger;
        }
        for usart in &mut chip.units.usart {
            usart.dma_latency_ns = run.receive_dma_latency_ns;
        }
        chip.feed(&run.uart_input);
        for port in &mut chip.units.gpio {
            port.records = run.record_pins;
        }
        let wires = run
            .wires
            .iter()
            .map(|wire| [known_pin(&wire.0), known_pin(&wire.1)]);
        chip.wires = Wires::new(wires.collect());
        chip.analog_wires = run.analog_wires.iter().map(AnalogLoop::new).collect();
        chip.buses = Buses::new(&run.devices);
        chip.units.dac.misses = run.dac_misses;
        if let Some(hz) = run.lsi_hz {
            (chip.units.iwdg.lsi_hz, chip.units.rcc.lsi_hz) = (hz, hz);
        }
        Self {
            levels: Levels::new(&run.pin_inputs, &mut chip),
            chip,
            transfers: Transfers::default(),
            lines: InterruptLines::default(),
            unknown: UnknownRegisters::default(),
            polls: Polls::default(),
            quiet: QuietTime::default(),
            stuck: None,
            reset_wanted: None,
            resets: Vec::new(),
            vectors: FLASH.start,
        }
    }

    /// Part that is modelled.
    pub(crate) fn part(&self) -> crate::chip::Chip {
        self.chip.part
    }

    // The processor and time drive the machine.

    /// Resets every peripheral, after a reset of the processor. Inputs from outside continue.
    pub fn reset(&mut self, now: u64, board: &mut impl Exterior) {
        self.play(now, board);
        let cause = self.reset_wanted.take().unwrap_or(ResetCause::Software);
        // RAM from before STANDBY is lost, whatever ends it.
        if matches!(cause, ResetCause::PowerCut | ResetCause::Standby) || self.chip.is_in_standby() {
            board.lose_memory();
        }
        self.resets.push(Reset { at_ns: now, cause });
        self.chip.reset(cause, now);
        self.settle(board);
    }

    /// The processor reads 1, 2 or 4 bytes. A register that no model knows reads as zero and is recorded.
    pub fn read(&mut self, address: u32, bytes: u32, now: u64, board: &mut impl Exterior) -> u32 {
        self.play(now, board);
        let word = address & !3;
        let polled = self.polls.accessed(word);
        let value = self.chip.read(word, now).unwrap_or_else(|unanswered| {
            self.unknown.read(word, unanswered.clock_off);
            self.stuck = self.stuck.or(polled.filter(|polled| *polled == word));
            0
        });
        // The bytes of an I2C transfer begin with a read of SR2.
        if self.chip.units.i2c.iter().any(I2c::dma_transmit_request) {
            self.transfers
                .serve(&mut Context::new(&mut self.chip, now, board));
        }
        self.settle(board);
        part(value, address, bytes)
    }

    /// Returns `true` if all events up to `now` have been played.
    pub fn is_quiet(&mut self, now: u64) -> bool {
        now < self.next_event()
    }

    /// Time of the next event that needs no access, ns.
    fn next_event(&mut self) -> u64 {
        let (chip, levels) = (&self.chip, &self.levels);
        let next = || events::next(chip, levels).map_or(u64::MAX, |(at, _)| at);
        *self.quiet.until.get_or_insert_with(next)
    }

    /// Reads a register as [`Self::read`] does, if only time and events change it. `None`, without an
    /// effect, if a read changes it or no model knows it.
    pub fn read_steady(
        &mut self,
        address: u32,
        bytes: u32,
        now: u64,
        board: &mut impl Exterior,
    ) -> Option<SteadyRead> {
        let word = address & !3;
        let (row, offset) = self.quiet.place(word)?;
        let model = (row.model)(&self.chip.units);
        let holds_until = model
            .holds_until(offset, now)
            .filter(|_| self.chip.is_clocked(row))?;
        let happened = self.play_steadily(now, board);
        let value = (row.model_mut)(&mut self.chip.units).read(offset, now).ok()?;
        let ramp = (row.model)(&self.chip.units).ramp(offset, now);
        let ramp = ramp.filter(|_| !happened && bytes == 4).map(|ramp| Ramp {
            until_ns: ramp.until_ns.min(self.next_event()),
            ..ramp
        });
        self.polls.accessed(word);
        // An event may have changed memory.
        let holds_until = if happened {
            now
        } else {
            holds_until.min(self.next_event())
        };
        Some(SteadyRead {
            value: part(value, address, bytes),
            holds_until,
            ramp,
        })
    }

    /// Plays the events up to `now`. Returns `true` if there were any.
    fn play_steadily(&mut self, now: u64, board: &mut impl Exterior) -> bool {
        let happened = now >= self.next_event();
        if happened {
            self.play(now, board);
            self.settle(board);
        }
        happened
    }

    /// Writes a word as [`Self::write`] does, to a register of a DMA controller. `None`, without an effect,
    /// for another register, or if the write would move data, leave a note or raise a line that `may_rise`
    /// refuses.
    pub fn write_steady(
        &mut self,
        address: u32,
        value: u32,
        now: u64,
        board: &mut impl Exterior,
        may_rise: impl FnMut(usize) -> bool,
    ) -> Option<SteadyWrite> {
        let (row, offset) = self.quiet.place(address & !3)?;
        let dma = ["DMA1", "DMA2"].iter().position(|name| *name == row.name)?;
        self.chip.is_clocked(row).then_some(())?;
        let happened = self.play_steadily(now, board);
        let before = self.chip.units.dma[dma].clone();
        let after = before.written(offset, value, now)?;
        let rises = |stream: &usize| after.interrupt(*stream) && !before.interrupt(*stream);
        let mut rising = (0..STREAMS).filter(rises).map(|stream| row.lines[stream]);
        if !rising.all(may_rise) {
            return None;
        }
        self.chip.units.dma[dma] = after;
        let moves = Transfers::are_due(&self.chip);
        self.chip.units.dma[dma] = before;
        if moves {
            return None;
        }
        let kept = &mut self.quiet.kept[dma];
        kept.get_or_insert_with(|| self.chip.units.dma[dma].clone());
        self.write(address, 4, value, now, board);
        Some(SteadyWrite {
            holds_until: if happened { now } else { self.next_event() },
            next_interrupt: self.next_interrupt(),
        })
    }

    /// Keeps the state of the registers that [`Self::write_steady`] writes, for
    /// [`Self::are_registers_as_kept`].
    pub fn keep_registers(&mut self) {
        self.quiet.kept = [None, None];
    }

    /// Returns `true` if these registers have not changed since the last [`Self::keep_registers`].
    pub fn are_registers_as_kept(&self) -> bool {
        let pairs = self.quiet.kept.iter().zip(&self.chip.units.dma);
        pairs
            .filter_map(|(kept, now)| Some((kept.as_ref()?, now)))
            .all(|(kept, now)| kept == now)
    }

    /// Returns `true` if the board knows an interrupt line to be up.
    pub(crate) fn is_line_up(&self, line: usize) -> bool {
        self.lines.is_up(line)
    }

    /// The processor writes 1, 2 or 4 bytes.
    pub fn write(&mut self, address: u32, bytes: u32, value: u32, now: u64, board: &mut impl Exterior) {
        self.play(now, board);
        let word = address & !3;
        self.polls.accessed(word);
        let wide = self.chip.widen(address, bytes, value, now);
        if let Err(unanswered) = self.chip.write(word, wide, now) {
            let stored = value & (u32::MAX >> (32 - 8 * bytes));
            self.unknown
                .written(word, unanswered.clock_off, stored << (8 * (address & 3)));
        }
        let mut moment = Context::new(&mut self.chip, now, board);
        self.transfers.copy_memory(&mut moment);
        self.transfers.serve(&mut moment);
        self.settle(board);
    }

    /// Returns `true` if a write to this word only moves output pins that nothing listens to: the word is
    /// BSRR of a port, and there are no wires, edges that EXTI watches, or devices with select pins.
    pub fn only_moves_pins(&self, address: u32) -> bool {
        if matches!(self.quiet.outputs, Some((port, _)) if port == address) {
            return true;
        }
        let chip = &self.chip;
        let is_clocked = |row: usize| {
            let row = &TABLE[row];
            row.name.starts_with("GPIO") && chip.is_clocked(row)
        };
        address & 0x3ff == BSRR
            && chip.wires.is_empty()
            && chip.units.exti.watched() == 0
            && chip.buses.spi.is_empty()
            && row_at(address).is_some_and(is_clocked)
    }

    /// Writes a word that [`Self::only_moves_pins`] allows, as [`Self::write`] does. Returns `true` if
    /// anything may have changed.
    pub fn move_pins(&mut self, address: u32, value: u32, now: u64, board: &mut impl Exterior) -> bool {
        let outputs = self.quiet.outputs.filter(|(port, _)| *port == address);
        let levels = outputs.map(|(_, levels)| levels);
        let levels = levels.or_else(|| self.chip.read(address - BSRR + ODR, now).ok());
        self.quiet.outputs = levels.map(|levels| (address, levels));
        let kept = levels.is_some_and(|levels| (levels & !(value >> 16) | value & 0xffff) == levels);
        if kept && now < self.next_event() {
            self.polls.accessed(address);
            return false;
        }
        self.write(address, 4, value, now, board);
        true
    }

    /// The processor stores 1, 2 or 4 bytes to flash.
    pub fn store(&mut self, address: u32, bytes: u32, value: u32, now: u64, board: &mut impl Exterior) {
        self.play(now, board);
        self.chip.units.flash.store(address, bytes, value, now);
        self.settle(board);
    }

    /// Plays everything up to `now` and sets the interrupt lines.
    pub fn advance(&mut self, now: u64, board: &mut impl Exterior) {
        let slept = self.chip.sleeps();
        self.play(now, board);
        if slept {
            self.settle(board)
        } else {
            self.deliver(board)
        }
    }

    /// Adds inputs that are still to come.
    ///
    /// # Panics
    /// One of the pins or USARTs does not exist.
    pub fn feed(&mut self, inputs: Inputs, now: u64) {
        self.chip.feed(&inputs.uart);
        for level in &inputs.levels {
            self.levels.add(known_pin(&level.pin), level.at_ns, level.high);
        }
        self.chip.stimulus.append(inputs.codes, now);
        self.quiet.end();
    }

    /// Number of inputs and rows that are kept for later.
    pub fn held(&self) -> usize {
        let usarts = self.chip.units.usart.iter();
        let bytes: usize = usarts.map(|usart| usart.input.len()).sum();
        bytes + self.levels.count() + self.chip.stimulus.held()
    }

    /// Injects a fault.
    pub fn fail(&mut self, kind: FaultKind, now: u64, board: &mut impl Exterior) {
        self.play(now, board);
        // Before the first scan it is not known which converter will sample.
        let (sampler, adc) = (self.chip.sampler, self.chip.sampler.unwrap_or(0));
        let serving_adc = serving(&self.chip, &SERVERS.adc[adc]);
        let units = &mut self.chip.units;
        match kind {
            FaultKind::AdcOverrun => units.adc.converters[adc].overrun(),
            FaultKind::ExtraScan | FaultKind::MissedTrigger => {
                for adc in sampler.map_or(0..units.adc.converters.len(), |adc| adc..adc + 1) {
                    let converter = &mut self.chip.units.adc.converters[adc];
                    if kind == FaultKind::MissedTrigger {
                        converter.misses = true;
                    } else {
                        converter.start_extra(now);
                        self.chip.note_scan(adc, now, false);
                    }
                }
            }
            FaultKind::AdcDmaError => {
                if let Some(place) = serving_adc {
                    units.dma[place.dma].failed(place.stream);
                }
            }
            FaultKind::TransmitterStalled { for_ns } => units.usart[0].stall(now.saturating_add(for_ns)),
            FaultKind::Supply { millivolts } => {
                units.pwr.set_supply(millivolts);
                self.chip.sense_lines(now);
            }
            FaultKind::CrystalStops | FaultKind::CrystalStarts => {
                units.rcc.set_crystal(kind == FaultKind::CrystalStarts);
                let stood_still = self.chip.stands_still();
                self.chip.pass_on(now);
                if stood_still && !self.chip.stands_still() {
                    board.stall(false);
                }
            }
            FaultKind::PowerCut => self.lose_power(board),
            FaultKind::PowerCutInFlash { after, percent } => units.flash.cut_power_in(after, percent),
            FaultKind::WildJump
            | FaultKind::UnhandledInterrupt
            | FaultKind::Hang
            | FaultKind::RunawayStack => {
                // Every converter is served by DMA2.
                if let Some(place) = serving_adc {
                    let flash_end = self.chip.part.flash_space().end;
                    crash(kind, self.vectors, DMA2_LINES[place.stream], flash_end, board);
                }
            }
        }
        self.settle(board);
    }

    /// Puts the part into deep sleep, with the processor.
    pub fn sleep(&mut self, now: u64, board: &mut impl Exterior) {
        self.play(now, board);
        self.chip.sleep(now);
        self.settle(board);
    }

    /// Returns `true` if no event is to come and no input from outside would interrupt.
    pub fn is_at_rest(&self) -> bool {
        let units = &self.chip.units;
        let listens = units.exti.listens_to_pins()
            || units.usart.iter().any(Usart::reception_interrupts)
            || units.tim.iter().any(Tim::captures_interrupt);
        !listens && self.next_interrupt().is_none() && events::next(&self.chip, &self.levels).is_none()
    }

    /// Returns `true` if the processor executes no instruction.
    pub(crate) fn stands_still(&self) -> bool {
        self.chip.stands_still() || self.chip.sleeps()
    }

    /// The processor's clock, Hz. 0 if it has none.
    pub(crate) fn hclk(&self) -> u32 {
        self.chip.clocks.hclk
    }

    /// Returns `true` if a sleep now is STOP or STANDBY.
    pub fn sleeps_deep(&self) -> bool {
        self.chip.units.scr.sleeps_deep()
    }

    /// When an interrupt line will rise, or the first scan may come, if no register is accessed. Call
    /// [`Self::advance`] at this time or earlier, not later.
    pub fn next_interrupt(&self) -> Option<u64> {
        forecast::next_interrupt(&self.chip, &self.levels)
    }

    // Its state.

    /// The analog inputs, and how far they were read.
    pub fn stimulus(&self) -> &StimulusPlayer {
        &self.chip.stimulus
    }

    /// Name of the unmodelled register that the processor polls.
    pub fn stuck(&self) -> Option<String> {
        self.stuck.map(registers::name)
    }

    /// Returns `true` if a watchdog runs, which resets an image that hangs.
    pub fn watchdog_runs(&self) -> bool {
        let units = &self.chip.units;
        units.iwdg.next_interrupt().is_some() || units.wwdg.runs_out().is_some()
    }

    /// Contents of flash from the start of [`WRITABLE`].
    pub fn flash(&self) -> &[u8] {
        &self.chip.units.flash.contents
    }

    /// Sets the vector table's address. It is not the start of flash if another program starts first.
    pub fn set_vectors(&mut self, address: u32) {
        self.vectors = address;
    }

    /// Replaces the contents of flash from the start of [`WRITABLE`].
    ///
    /// # Panics
    /// The number of bytes differs from that of [`Self::flash`].
    pub fn set_flash(&mut self, contents: Vec<u8>) {
        let wanted = self.chip.units.flash.contents.len();
        assert_eq!(contents.len(), wanted, "all bytes that can be written");
        self.chip.units.flash.contents = contents;
    }

    /// Returns the machine's part of the outcome, up to `now`. Bytes and instructions are recorded by the
    /// board, and are not in it.
    pub fn outcome(&self, now: u64) -> Outcome {
        let units = &self.chip.units;
        Outcome {
            sampling: self.chip.stimulus.sampling(),
            overruns: units.adc.converters.iter().map(|adc| adc.overruns).sum(),
            triggers_ignored: units.adc.converters.iter().map(|adc| adc.triggers_ignored).sum(),
            resets: self.resets.clone(),
            unknown_registers: self.unknown.list(self.chip.part),
            unmodelled: self.chip.unmodelled(),
            busy_with: self.polls.busy_with().map(registers::name),
            never_came: self.never_came(),
            hclk_ns: self.chip.hclk_ns(now),
            crystal_started: units.rcc.crystal_started,
            pins: self.pins(),
            flash_operations: units.flash.operations.clone(),
            virtual_ns: now,
            ..Outcome::default()
        }
    }

    /// Describes the inputs that have not come.
    fn never_came(&self) -> Vec<String> {
        let levels = self.levels.left(&self.chip);
        let ports = USARTS.iter().zip(&self.chip.units.usart);
        let bytes = ports
            .filter(|(_, usart)| !usart.input.is_empty())
            .map(|(name, usart)| format!("{} bytes for the receiver of {name}", usart.input.len()));
        levels.into_iter().chain(bytes).collect()
    }

    fn pins(&self) -> Vec<Pin> {
        let gpio = &self.chip.units.gpio;
        let pins = (0..gpio.len()).flat_map(|port| (0..16).map(move |number| (port, number)));
        let moved = pins.filter(|(port, number)| gpio[*port].edges[*number] > 0);
        let pin = |(port, number): (usize, usize)| Pin {
            name: wiring::pin_name((port, number)),
            edges: gpio[port].edges[number],
            changes: gpio[port].changes[number].clone(),
        };
        moved.map(pin).collect()
    }

    // Time.

    /// Plays triggers, conversions, transfers and bytes up to `now`, in order.
    fn play(&mut self, now: u64, board: &mut impl Exterior) {
        if now >= self.next_event() {
            while let Some((at, event)) = events::next(&self.chip, &self.levels).filter(|(at, _)| *at <= now)
            {
                self.happen(event, at, board);
                self.transfers.serve(&mut Context::new(&mut self.chip, at, board));
                self.scan(now, board);
            }
            self.quiet.end();
        }
        for tim in &mut self.chip.units.tim {
            tim.advance(now);
        }
        let units = &mut self.chip.units;
        units.systick.advance(now);
        units.wwdg.advance(now);
        units.rng.advance(now);
    }

    /// Plays the events of a converter and its trigger up to `now`, or until anything else happens.
    /// [`Self::play`] would do the same, but examine every peripheral for every conversion.
    fn scan(&mut self, now: u64, board: &mut impl Exterior) {
        let Some(scans) = self.chip.scans() else { return };
        let Scans { adc, tim } = scans;
        let next = events::next_but(&self.chip, &self.levels, Some(scans));
        let until = next.map_or(now, |(at, _)| now.min(at.saturating_sub(1)));
        loop {
            let trigger = self.chip.units.tim[tim].trigger(0);
            while let Some(at) = self.chip.units.adc.converters[adc].next_conversion()
                && at <= until
                && trigger.is_none_or(|trigger| at <= trigger)
            {
                self.happen(MachineEvent::ConversionEnds(adc), at, board);
                let mut moment = Context::new(&mut self.chip, at, board);
                if !self.transfers.serve_converter(adc, &mut moment) {
                    return;
                }
            }
            match trigger.filter(|at| *at <= until) {
                Some(at) => self.happen(MachineEvent::ConvertersTriggered(tim), at, board),
                None => return,
            }
        }
    }

    fn happen(&mut self, event: MachineEvent, at: u64, board: &mut impl Exterior) {
        let units = &mut self.chip.units;
        match event {
            MachineEvent::ConversionEnds(adc) => self.chip.convert(adc, at),
            MachineEvent::TimerStarts(tim) => units.tim[tim].start(at),
            MachineEvent::LevelChanges => self.levels.change(at, &mut self.chip),
            MachineEvent::OutputMoves(tim) => {
                units.tim[tim].advance(at);
                self.chip.move_outputs(tim, at);
            }
            MachineEvent::TimerRequests(tim) => units.tim[tim].advance(at),
            MachineEvent::ConvertersTriggered(tim) => {
                units.tim[tim].advance(at);
                self.chip.trigger_converters(tim, at);
            }
            MachineEvent::FrameSent(usart) => {
                if let Some(data) = self.chip.sent(usart, at) {
                    board.sent(usart, data, at);
                }
            }
            MachineEvent::FrameReceived(usart) => self.chip.received(usart, at),
            // The DMA is served after every event.
            MachineEvent::DmaFetches(usart) => units.usart[usart].fetch_at = None,
            MachineEvent::WatchdogOut => {
                units.iwdg.reset(at);
                self.want_reset(ResetCause::Watchdog, board);
            }
            MachineEvent::I2cSteps(n) => self.chip.step_i2c(n, at, &mut self.levels, board),
            MachineEvent::SpiExchanges(n) => self.chip.exchange_spi(n, at, &mut self.levels, board),
            MachineEvent::WindowWatchdogOut => {
                units.wwdg.reset(at);
                self.want_reset(ResetCause::WindowWatchdog, board);
            }
            MachineEvent::ClockFlag => self.chip.clock_flag(at),
            MachineEvent::Flash(FlashEvent::Finished) => {
                let changed = units.flash.finish();
                let offset = (changed.start - WRITABLE.start) as usize;
                let bytes = &units.flash.contents[offset..][..changed.len()];
                board.flash_changed(changed.start, bytes);
                board.stall(false);
            }
            MachineEvent::Flash(FlashEvent::PowerGone) => {
                units.flash.reset(at);
                self.lose_power(board);
            }
        }
    }

    /// Requests a reset. The first of several causes counts, unless one is a power cut.
    fn want_reset(&mut self, cause: ResetCause, board: &mut impl Exterior) {
        self.reset_wanted.get_or_insert(cause);
        board.reset_wanted();
    }

    fn lose_power(&mut self, board: &mut impl Exterior) {
        self.reset_wanted = None;
        self.want_reset(ResetCause::PowerCut, board);
    }

    /// Brings memory, the processor and its interrupt lines up to the state of the models.
    fn settle(&mut self, board: &mut impl Exterior) {
        if self.chip.woken_from_stop() {
            board.stall(false);
        }
        if self.chip.woken_from_standby() {
            self.want_reset(ResetCause::Standby, board);
        }
        if std::mem::take(&mut self.chip.units.wwdg.bites) {
            self.want_reset(ResetCause::WindowWatchdog, board);
        }
        // The next instruction is in flash. So is the one after an interrupt that wakes the processor in
        // spite of the stall.
        if self.chip.stands_still() {
            board.stall(true);
        }
        self.deliver(board);
    }

    /// Brings memory and the interrupt lines up to the state of the models.
    fn deliver(&mut self, board: &mut impl Exterior) {
        self.quiet.end();
        self.chip.tell_selections(&mut self.levels, board);
        self.transfers.flush(board);
        self.lines.settle(&mut self.chip, board);
    }
}

/// The frequency of a crystal that is off by `ppm`, in whole Hz. At 8 MHz that is an eighth of a ppm.
fn off_by(hz: u32, ppm: f64) -> u32 {
    (f64::from(hz) * (1.0 + ppm * 1e-6)).round() as u32
}
