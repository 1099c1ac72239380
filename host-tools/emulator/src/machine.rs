//! The peripherals put together: address decoding, clocks, requests, interrupt lines, and time.
//!
//! # Design
//!
//! [`Machine`] is driven from outside by two things: accesses of the processor ([`Machine::read`], [`Machine::write`]),
//! each at a time, and [`Machine::advance`] at the time that [`Machine::next_interrupt`] gave. Before either, everything
//! that happened since is played in order: triggers, conversions, transfers, bytes. So the outside is woken for
//! interrupts only, a DMA block at its half and its end, and never for a sample.
//!
//! What the machine needs of the outside is the trait [`Board`]: memory, interrupt lines, and somewhere to put bytes.

mod board;
mod crash;
mod levels;
mod map;
mod names;
mod stimulus;
mod wiring;

use std::collections::{BTreeMap, VecDeque};

pub use board::{Board, INTERRUPTS};
pub use stimulus::Stimulus;

use crate::given::{FaultKind, PinInput, UartInput};
pub use crate::memory::{FLASH, SRAM, WRITABLE};
use crate::outcome::{FlashOperation, Pin, Reset, ResetCause, UnknownRegister};
use crate::peripherals::adc::{Adc, TriggerSource};
use crate::peripherals::dbgmcu::Dbgmcu;
use crate::peripherals::dma::{Direction, Dma, STREAMS};
use crate::peripherals::dwt::Dwt;
use crate::peripherals::exti::Exti;
use crate::peripherals::flash::{self, Flash};
use crate::peripherals::gpio::Gpio;
use crate::peripherals::iwdg::Iwdg;
use crate::peripherals::pwr::Pwr;
use crate::peripherals::rcc::{Cause, Clocks, Rcc};
use crate::peripherals::signature::{self, Signature};
use crate::peripherals::syscfg::Syscfg;
use crate::peripherals::tim::Tim;
use crate::peripherals::usart::Usart;
use crate::peripherals::{NoRegister, Notes};
use crash::crash;
use levels::{Level, levels};
use map::{GATED, Unit, gate, locate};
use wiring::{ADC1_REQUEST, DMA2, REFERENCE, USART1_RX_REQUEST, USART1_TX_REQUEST, timer_input};

const FLASH_LINE: usize = 4;
const TIM_LINES: [usize; 4] = [28, 29, 30, 50];
const ADC_LINE: usize = 18;
const USART1_LINE: usize = 37;
const DMA_LINES: [[usize; STREAMS]; 2] = [[11, 12, 13, 14, 15, 16, 17, 47], [56, 57, 58, 59, 60, 68, 69, 70]];
/// EXTI lines, and the interrupt that they share.
const EXTI_LINES: [(u32, usize); 7] = [
    (1, 6),
    (1 << 1, 7),
    (1 << 2, 8),
    (1 << 3, 9),
    (1 << 4, 10),
    (0x03e0, 23),
    (0xfc00, 40),
];

#[derive(Debug, Clone, Copy, Default)]
struct Access {
    reads: u64,
    writes: u64,
    last_write: Option<u32>,
}

#[derive(Debug, Clone, Copy)]
enum Event {
    Converted,
    /// A timer that waits for another's trigger gets it.
    Started(usize),
    Level(Level),
    Triggered(usize),
    Sent,
    Received,
    WatchdogOut,
    Flash(flash::Event),
}

/// The ports, with every pin low that something is wired to.
fn wired(inputs: &[PinInput]) -> [Gpio; 9] {
    let mut ports = std::array::from_fn(Gpio::new);
    for (port, pin) in inputs.iter().filter_map(PinInput::place) {
        Gpio::drive(&mut ports[port], pin, false);
    }
    ports
}

/// An STM32F405 without its processor and memory.
#[derive(Debug, Clone)]
pub struct Machine {
    rcc: Rcc,
    clocks: Clocks,
    pwr: Pwr,
    flash: Flash,
    gpio: [Gpio; 9],
    syscfg: Syscfg,
    exti: Exti,
    dbgmcu: Dbgmcu,
    signature: Signature,
    iwdg: Iwdg,
    dwt: Dwt,
    tim: [Tim; 4],
    adc: Adc,
    dma: [Dma; 2],
    usart1: Usart,
    stimulus: Stimulus,
    /// To come.
    levels: VecDeque<Level>,
    scans: u64,
    scans_at_last_block: u64,
    lines: [bool; INTERRUPTS],
    /// Bytes that the DMA wrote and the board has not got: neighbours go in one piece.
    written: Vec<u8>,
    written_at: u32,
    unknown: BTreeMap<(u32, bool), Access>,
    watchdog_ran_out: bool,
    power_gone: bool,
    resets: Vec<Reset>,
}

impl Machine {
    /// After power-up, with a crystal of `hse_hz`, its factory identifier, and what comes in.
    ///
    /// # Panics
    /// One of the pins does not exist.
    pub fn new(
        hse_hz: u32,
        uid: [u8; 12],
        stimulus: Stimulus,
        uart_input: &[UartInput],
        pin_inputs: &[PinInput],
    ) -> Self {
        let rcc = Rcc::new(hse_hz);
        let clocks = rcc.clocks();
        let mut usart1 = Usart::new(clocks.pclk2);
        for input in uart_input {
            usart1.feed(input.at_ns, &input.bytes);
        }
        Self {
            pwr: Pwr::default(),
            flash: Flash::default(),
            gpio: wired(pin_inputs),
            syscfg: Syscfg::default(),
            exti: Exti::default(),
            dbgmcu: Dbgmcu::default(),
            signature: Signature { uid },
            iwdg: Iwdg::default(),
            dwt: Dwt::new(clocks.hclk),
            tim: [32, 16, 16, 32].map(|bits| Tim::new(bits, clocks.timers1)),
            adc: Adc::new(clocks.pclk2),
            dma: [Dma::default(), Dma::default()],
            usart1,
            stimulus,
            levels: levels(pin_inputs),
            scans: 0,
            scans_at_last_block: 0,
            lines: [false; INTERRUPTS],
            written: Vec::new(),
            written_at: 0,
            unknown: BTreeMap::new(),
            watchdog_ran_out: false,
            power_gone: false,
            resets: Vec::new(),
            rcc,
            clocks,
        }
    }

    /// The processor was reset after power-up: every peripheral starts anew, while the world outside goes on.
    pub fn reset(&mut self, now: u64, board: &mut impl Board) {
        self.play(now, board);
        let watchdog = std::mem::take(&mut self.watchdog_ran_out);
        let (cause, flag) = if std::mem::take(&mut self.power_gone) {
            board.lose_memory();
            (ResetCause::PowerCut, Cause::PowerOn)
        } else if watchdog {
            (ResetCause::Watchdog, Cause::Watchdog)
        } else {
            (ResetCause::Software, Cause::Software)
        };
        self.resets.push(Reset { at_ns: now, cause });
        self.rcc.reset(flag);
        for unit in GATED {
            self.reset_unit(unit);
        }
        self.flash.reset(now);
        self.exti = Exti::default();
        self.dbgmcu = Dbgmcu::default();
        self.iwdg = Iwdg::default();
        self.dwt = Dwt::new(self.clocks.hclk);
        self.follow_clocks(now);
        self.settle(board);
    }

    /// The processor reads 1, 2 or 4 bytes. What no model knows reads as zero and is recorded.
    pub fn read(&mut self, address: u32, bytes: u32, now: u64, board: &mut impl Board) -> u32 {
        self.play(now, board);
        let word = address & !3;
        let value = match self.read_register(word, now) {
            Ok(value) => value,
            Err(clock_off) => {
                self.unknown.entry((word, clock_off)).or_default().reads += 1;
                0
            }
        };
        self.stall_if_busy(board);
        self.settle(board);
        (value >> (8 * (address & 3))) & (u32::MAX >> (32 - 8 * bytes))
    }

    /// The processor writes 1, 2 or 4 bytes.
    pub fn write(&mut self, address: u32, bytes: u32, value: u32, now: u64, board: &mut impl Board) {
        self.play(now, board);
        let word = address & !3;
        let value = self.widen(address, bytes, value, now);
        if let Err(clock_off) = self.write_register(word, value, now) {
            let access = self.unknown.entry((word, clock_off)).or_default();
            access.writes += 1;
            access.last_write = Some(value);
        }
        if let Some((Unit::Dma(DMA2), _)) = locate(word) {
            self.run_memory_to_memory(now, board);
        }
        self.serve(now, board);
        self.stall_if_busy(board);
        self.settle(board);
    }

    /// The processor stores 1, 2 or 4 bytes to flash.
    pub fn store(&mut self, address: u32, bytes: u32, value: u32, now: u64, board: &mut impl Board) {
        self.play(now, board);
        self.flash.store(address, bytes, value, now);
        self.stall_if_busy(board);
        self.settle(board);
    }

    /// The next instruction is in flash, and so is the one after an interrupt that woke the processor nevertheless.
    fn stall_if_busy(&mut self, board: &mut impl Board) {
        if self.flash.busy() {
            board.stall(true);
        }
    }

    /// What stands in [`WRITABLE`].
    pub fn flash(&self) -> &[u8] {
        self.flash.contents()
    }

    /// Puts that there.
    ///
    /// # Panics
    /// With another number of bytes.
    pub fn set_flash(&mut self, contents: Vec<u8>) {
        self.flash.set_contents(contents);
    }

    /// Words programmed and sectors erased so far.
    pub fn flash_operations(&self) -> &[FlashOperation] {
        self.flash.operations()
    }

    /// Plays everything up to `now` and sets the interrupt lines.
    pub fn advance(&mut self, now: u64, board: &mut impl Board) {
        self.play(now, board);
        self.settle(board);
    }

    /// Something fails on demand.
    pub fn fail(&mut self, kind: FaultKind, now: u64, board: &mut impl Board) {
        self.play(now, board);
        match kind {
            FaultKind::AdcOverrun => self.adc.overrun(),
            FaultKind::AdcDmaError => {
                if let Some(stream) = self.dma[DMA2].serving(&ADC1_REQUEST) {
                    self.dma[DMA2].failed(stream);
                }
            }
            FaultKind::TransmitterStalled { for_ns } => self.usart1.stall(now.saturating_add(for_ns)),
            FaultKind::Supply { millivolts } => self.pwr.set_supply(millivolts),
            FaultKind::PowerCut => self.lose_power(board),
            FaultKind::PowerCutInFlash { after, percent } => self.flash.cut_power_in(after, percent),
            FaultKind::WildJump
            | FaultKind::UnhandledInterrupt
            | FaultKind::Hang
            | FaultKind::RunawayStack => {
                if let Some(stream) = self.dma[DMA2].serving(&ADC1_REQUEST) {
                    crash(kind, DMA_LINES[DMA2][stream], board);
                }
            }
        }
        self.settle(board);
    }

    /// When an interrupt line will rise by itself, or the first scan may come: call [`Self::advance`] then, not later.
    /// Earlier does no harm.
    pub fn next_interrupt(&self) -> Option<u64> {
        let flash = self.flash.next_event().map(|(at, _)| at);
        // Nobody serves an interrupt while the processor stands still.
        if flash.is_some() {
            return flash.into_iter().chain(self.iwdg.bites_at()).min();
        }
        let timers = self.tim.iter().filter_map(Tim::next_interrupt);
        let others = [
            self.next_acquisition(),
            self.next_transmission(),
            self.usart1.next_interrupt(),
            self.next_first_scan(),
            self.next_capture(),
        ];
        timers
            .chain(others.into_iter().flatten())
            .chain(self.iwdg.bites_at())
            .min()
    }

    /// The trigger of what may become the first scan, from which the outside counts its time.
    fn next_first_scan(&self) -> Option<u64> {
        match self.stimulus.sampling() {
            Some(_) => None,
            None => self.tim[self.trigger_timer()?].trigger(0),
        }
    }

    /// The next change of a level that a timer captures and interrupts on.
    fn next_capture(&self) -> Option<u64> {
        let began = self.stimulus.sampling()?.first_ns;
        // Without this, every wake would look through a storm that nobody listens to.
        if !self.tim.iter().any(Tim::captures_interrupt) {
            return None;
        }
        let interrupts = |level: &&Level| {
            self.captured_by(level)
                .is_some_and(|(tim, input)| self.tim[tim].edge_interrupts(input, level.high))
        };
        let next = self.levels.iter().find(interrupts)?;
        Some(began.saturating_add(next.at_ns))
    }

    /// The timer and the input of it that a pin leads to, as it is set.
    fn captured_by(&self, level: &Level) -> Option<(usize, usize)> {
        let function = self.gpio[level.port].alternate(level.pin)?;
        timer_input(level.port, level.pin, function)
    }

    /// What the analog inputs carry, and how far it is read.
    pub fn stimulus(&self) -> &Stimulus {
        &self.stimulus
    }

    /// How often the ADC lost a conversion.
    pub fn overruns(&self) -> u64 {
        self.adc.overruns
    }

    /// Triggers of the ADC that started nothing.
    pub fn triggers_ignored(&self) -> u64 {
        self.adc.triggers_ignored
    }

    /// Resets after power-up.
    pub fn resets(&self) -> &[Reset] {
        &self.resets
    }

    /// Registers touched that no model knows, or whose clock was off, by address.
    pub fn unknown_registers(&self) -> Vec<UnknownRegister> {
        let named = |((address, clock_off), access): (&(u32, bool), &Access)| UnknownRegister {
            name: names::name(*address) + if *clock_off { " (clock off)" } else { "" },
            address: *address,
            reads: access.reads,
            writes: access.writes,
            last_write: access.last_write,
        };
        self.unknown.iter().map(named).collect()
    }

    /// What was asked of modelled peripherals that the models do not do.
    pub fn unmodelled(&self) -> Vec<String> {
        let tims = ["TIM2", "TIM3", "TIM4", "TIM5"]
            .into_iter()
            .zip(self.tim.iter().map(|t| &t.notes));
        let dmas = ["DMA1", "DMA2"]
            .into_iter()
            .zip(self.dma.iter().map(|d| &d.notes));
        let others: [(&str, &Notes); 6] = [
            ("ADC1", &self.adc.notes),
            ("DWT", &self.dwt.notes),
            ("FLASH", &self.flash.notes),
            ("PWR", &self.pwr.notes),
            ("RCC", &self.rcc.notes),
            ("USART1", &self.usart1.notes),
        ];
        let channels = self.stimulus.unmapped();
        let channels = channels.map(|n| format!("ADC1 channel {n} has no stimulus: it reads 0"));
        let notes = tims.chain(dmas).chain(others);
        notes
            .flat_map(|(unit, notes)| notes.iter().map(move |n| format!("{unit} {n}")))
            .chain(channels)
            .collect()
    }

    /// Output pins that moved.
    pub fn pins(&self) -> Vec<Pin> {
        let mut pins = Vec::new();
        for (port, letter) in self.gpio.iter().zip('A'..='I') {
            for (number, edges) in port.edges.iter().enumerate().filter(|(_, edges)| **edges > 0) {
                pins.push(Pin {
                    name: format!("P{letter}{number}"),
                    edges: *edges,
                });
            }
        }
        pins
    }

    // Time.

    /// Plays triggers, conversions, transfers and bytes up to `now`, in order.
    fn play(&mut self, now: u64, board: &mut impl Board) {
        while let Some((at, event)) = self.next_event().filter(|(at, _)| *at <= now) {
            match event {
                Event::Converted => {
                    if let Some(channel) = self.adc.converting() {
                        let code = match channel {
                            REFERENCE if self.adc.reference_on() => self.reference(),
                            _ => self.stimulus.code(channel),
                        };
                        self.adc.finish(code, at);
                        self.note_scan(at, false);
                    }
                }
                Event::Started(tim) => self.tim[tim].start(at),
                Event::Level(level) => {
                    self.levels.pop_front();
                    self.gpio[level.port].drive(level.pin, level.high);
                    if let Some((tim, input)) = self.captured_by(&level) {
                        self.tim[tim].edge(input, level.high, at);
                    }
                }
                Event::Triggered(tim) => {
                    self.tim[tim].advance(at);
                    self.trigger_adc(at);
                }
                Event::Sent => {
                    if let Some(byte) = self.usart1.sent() {
                        board.sent(byte, at);
                    }
                }
                Event::Received => self.usart1.receive(at),
                Event::WatchdogOut => {
                    self.iwdg = Iwdg::default();
                    self.watchdog_ran_out = true;
                    board.reset_wanted();
                }
                Event::Flash(flash::Event::Finished) => {
                    let changed = self.flash.finish();
                    let offset = (changed.start - WRITABLE.start) as usize;
                    let bytes = &self.flash.contents()[offset..][..changed.len()];
                    board.flash_changed(changed.start, bytes);
                    board.stall(false);
                }
                Event::Flash(flash::Event::PowerGone) => {
                    self.flash.reset(at);
                    self.lose_power(board);
                }
            }
            self.serve(at, board);
        }
        for tim in &mut self.tim {
            tim.advance(now);
        }
    }

    /// The code of the internal reference voltage: the converter's own reference is the supply.
    fn reference(&self) -> u16 {
        (signature::REFERENCE_CODE * 3300 / self.pwr.supply().max(1)).min(4095) as u16
    }

    /// What happens next; of things at one time, a timer is started by a trigger before that trigger is over, and a
    /// conversion ends before a trigger comes.
    fn next_event(&self) -> Option<(u64, Event)> {
        let trigger = self.trigger_timer();
        let started = (0..self.tim.len()).filter_map(|n| {
            let master = self.tim[n].waits_for(n)?;
            Some((self.tim[master].trigger(0)?, Event::Started(n)))
        });
        let level = self.stimulus.sampling().zip(self.levels.front());
        let events = [
            started.min_by_key(|(at, _)| *at),
            level.map(|(sampling, level)| {
                (
                    sampling.first_ns.saturating_add(level.at_ns),
                    Event::Level(*level),
                )
            }),
            self.adc.next_conversion().map(|at| (at, Event::Converted)),
            trigger.and_then(|t| Some((self.tim[t].trigger(0)?, Event::Triggered(t)))),
            self.usart1.next_sent().map(|at| (at, Event::Sent)),
            self.usart1.next_received().map(|at| (at, Event::Received)),
            self.iwdg.bites_at().map(|at| (at, Event::WatchdogOut)),
            self.flash
                .next_event()
                .map(|(at, event)| (at, Event::Flash(event))),
        ];
        events.into_iter().flatten().min_by_key(|(at, _)| *at)
    }

    fn lose_power(&mut self, board: &mut impl Board) {
        self.power_gone = true;
        board.reset_wanted();
    }

    /// Which timer starts scans.
    fn trigger_timer(&self) -> Option<usize> {
        match self.adc.trigger_source()? {
            TriggerSource::Tim2 => Some(0),
            TriggerSource::Tim3 => Some(1),
        }
    }

    fn trigger_adc(&mut self, at: u64) {
        self.adc.trigger(at);
        self.note_scan(at, true);
    }

    /// The inputs carry what belongs to the scan that just started, if one did.
    fn note_scan(&mut self, at: u64, external: bool) {
        if self.adc.take_scan_started() {
            self.scans += 1;
            self.stimulus.begin_scan(at, external);
        }
    }

    // Requests.

    /// Serves the DMA requests that stand.
    fn serve(&mut self, now: u64, board: &mut impl Board) {
        if self.adc.dma_request()
            && let Some(stream) = self.dma[DMA2].serving(&ADC1_REQUEST)
        {
            let unserved = self.dma[DMA2].interrupt(stream);
            let (block, ended) = self.transfer(DMA2, stream, now, board);
            // Also where the stream reads another register than DR: the request is answered once.
            self.adc.take_data();
            if ended {
                self.adc.dma_ended();
            }
            if block {
                self.flush(board);
                // A processor that hangs is not woken for a block, and what it executed is no block's.
                board.acquired(match unserved {
                    true => 0,
                    false => self.scans - self.scans_at_last_block,
                });
                self.scans_at_last_block = self.scans;
            }
        }
        // The first byte passes on to the shift register at once, so two may be taken.
        for _ in 0..2 {
            if self.usart1.dma_transmit_request()
                && let Some(stream) = self.dma[DMA2].serving(&USART1_TX_REQUEST)
            {
                self.transfer(DMA2, stream, now, board);
            }
        }
        if self.usart1.dma_receive_request()
            && let Some(stream) = self.dma[DMA2].serving(&USART1_RX_REQUEST)
        {
            self.transfer(DMA2, stream, now, board);
        }
    }

    /// Moves one beat. Says whether it completed half or all of the buffer, and whether the stream has stopped.
    fn transfer(&mut self, dma: usize, stream: usize, now: u64, board: &mut impl Board) -> (bool, bool) {
        let Some(beat) = self.dma[dma].beat(stream) else {
            return (false, true);
        };
        let (from, to) = match beat.direction {
            Direction::ToPeripheral => (beat.memory, beat.peripheral),
            Direction::ToMemory | Direction::MemoryToMemory => (beat.peripheral, beat.memory),
        };
        let value = self.dma_read(from, beat.bytes, now, board);
        match value.and_then(|value| self.dma_write(to, beat.bytes, value, now, board)) {
            Some(()) => {
                let progress = self.dma[dma].moved(stream);
                (progress.block, progress.ended)
            }
            None => {
                self.dma[dma].failed(stream);
                (false, true)
            }
        }
    }

    /// `None` is a bus error.
    fn dma_read(&mut self, address: u32, bytes: u32, now: u64, board: &mut impl Board) -> Option<u32> {
        if SRAM.contains(&address) || FLASH.contains(&address) {
            self.flash.notes.note_if(
                FLASH.contains(&address) && self.flash.busy(),
                "a DMA stream read flash while BSY: silicon holds it up, here it does not wait",
            );
            self.flush(board);
            let mut word = [0; 4];
            board.read_memory(address, &mut word[..bytes as usize]);
            return Some(u32::from_le_bytes(word));
        }
        let value = self.read_register(address & !3, now).ok()?;
        Some((value >> (8 * (address & 3))) & (u32::MAX >> (32 - 8 * bytes)))
    }

    fn dma_write(
        &mut self,
        address: u32,
        bytes: u32,
        value: u32,
        now: u64,
        board: &mut impl Board,
    ) -> Option<()> {
        if !SRAM.contains(&address) {
            let value = self.widen(address, bytes, value, now);
            return self.write_register(address & !3, value, now).ok();
        }
        if self.written_at.wrapping_add(self.written.len() as u32) != address {
            self.flush(board);
            self.written_at = address;
        }
        self.written
            .extend_from_slice(&value.to_le_bytes()[..bytes as usize]);
        Some(())
    }

    fn flush(&mut self, board: &mut impl Board) {
        if !self.written.is_empty() {
            board.write_memory(self.written_at, &self.written);
            self.written_at = self.written_at.wrapping_add(self.written.len() as u32);
            self.written.clear();
        }
    }

    /// Streams between memories need no request: they run when enabled, here at once.
    fn run_memory_to_memory(&mut self, now: u64, board: &mut impl Board) {
        for stream in 0..STREAMS {
            let is_one = |d: &Dma| {
                d.beat(stream)
                    .is_some_and(|b| b.direction == Direction::MemoryToMemory)
            };
            while is_one(&self.dma[DMA2]) {
                if self.transfer(DMA2, stream, now, board).1 {
                    break;
                }
            }
        }
    }

    // Interrupts.

    /// When the ADC will next raise a line: its own, or that of the DMA stream which serves it.
    fn next_acquisition(&self) -> Option<u64> {
        let trigger = |n: u64| self.trigger_timer().and_then(|t| self.tim[t].trigger(n));
        if self.adc.blocked() {
            return None;
        }
        let stream = self.dma[DMA2]
            .serving(&ADC1_REQUEST)
            .filter(|_| self.adc.requests_dma());
        let beats = match stream {
            Some(stream) => u64::from(self.dma[DMA2].beats_to_interrupt(stream)?),
            None if self.adc.interrupts_on_conversion() => 1,
            None => return None,
        };
        // Where the trigger's period is about to change only its next pulse is known: look again there.
        self.adc.conversion(beats, trigger).or_else(|| trigger(0))
    }

    /// When the DMA stream that feeds USART1 will raise its line.
    fn next_transmission(&self) -> Option<u64> {
        let stream = self.dma[DMA2].serving(&USART1_TX_REQUEST)?;
        let beats = self.dma[DMA2].beats_to_interrupt(stream)?;
        self.usart1.transmit_request(u64::from(beats))
    }

    /// Brings memory and interrupt lines up to the state of the models.
    fn settle(&mut self, board: &mut impl Board) {
        self.flush(board);
        // The vectors are in flash: what rises now is served when it can be read again.
        if self.flash.busy() {
            return;
        }
        let level = self.flash.interrupt();
        self.set_line(FLASH_LINE, level, board);
        for (n, line) in TIM_LINES.into_iter().enumerate() {
            let level = self.tim[n].interrupt();
            self.set_line(line, level, board);
        }
        let level = self.adc.interrupt();
        self.set_line(ADC_LINE, level, board);
        let level = self.usart1.interrupt();
        self.set_line(USART1_LINE, level, board);
        for (n, lines) in DMA_LINES.iter().enumerate() {
            for (stream, line) in lines.iter().enumerate() {
                let level = self.dma[n].interrupt(stream);
                self.set_line(*line, level, board);
            }
        }
        for (mask, line) in EXTI_LINES {
            let level = self.exti.pending(mask);
            self.set_line(line, level, board);
        }
    }

    fn set_line(&mut self, line: usize, level: bool, board: &mut impl Board) {
        if self.lines[line] != level {
            self.lines[line] = level;
            board.set_interrupt(line, level);
        }
    }

    // Registers.

    /// A word for a write of part of one. The data registers take it as it is; elsewhere the rest of the word stays.
    fn widen(&mut self, address: u32, bytes: u32, value: u32, now: u64) -> u32 {
        if bytes == 4 {
            return value;
        }
        let is_data = matches!(locate(address), Some((Unit::Usart1, 0x04) | (Unit::Adc, 0x4c)));
        let rest = if is_data {
            0
        } else {
            self.read_register(address & !3, now).unwrap_or(0)
        };
        let shift = 8 * (address & 3);
        let mask = (u32::MAX >> (32 - 8 * bytes)) << shift;
        (rest & !mask) | ((value << shift) & mask)
    }

    /// The error says whether the peripheral is known and its clock is off.
    fn unit_at(&self, address: u32) -> Result<(Unit, u32), bool> {
        let (unit, offset) = locate(address).ok_or(false)?;
        match gate(unit) {
            Some((bus, bit)) if !self.rcc.enabled(bus, bit) => Err(true),
            _ => Ok((unit, offset)),
        }
    }

    fn read_register(&mut self, address: u32, now: u64) -> Result<u32, bool> {
        let (unit, offset) = self.unit_at(address)?;
        let value = match unit {
            Unit::Tim(n) => self.tim[n].read(offset, now),
            Unit::Iwdg => self.iwdg.read(offset),
            Unit::Pwr => self.pwr.read(offset),
            Unit::Usart1 => self.usart1.read(offset),
            Unit::Adc => self.adc.read(offset),
            Unit::Syscfg => self.syscfg.read(offset),
            Unit::Exti => self.exti.read(offset),
            Unit::Gpio(n) => self.gpio[n].read(offset),
            Unit::Rcc => self.rcc.read(offset),
            Unit::Flash => self.flash.read(offset),
            Unit::Dma(n) => self.dma[n].read(offset),
            Unit::Signature => self.signature.read(offset),
            Unit::Dwt => self.dwt.read(offset, now),
            Unit::Dbgmcu => self.dbgmcu.read(offset),
        };
        value.map_err(|NoRegister| false)
    }

    fn write_register(&mut self, address: u32, value: u32, now: u64) -> Result<(), bool> {
        let (unit, offset) = self.unit_at(address)?;
        let done = match unit {
            Unit::Tim(n) => self.tim[n].write(offset, value, now),
            Unit::Iwdg => self.iwdg.write(offset, value, now),
            Unit::Pwr => self.pwr.write(offset, value),
            Unit::Usart1 => self.usart1.write(offset, value, now),
            Unit::Adc => self.adc.write(offset, value, now),
            Unit::Syscfg => self.syscfg.write(offset, value),
            Unit::Exti => self.exti.write(offset, value),
            Unit::Gpio(n) => self.gpio[n].write(offset, value),
            Unit::Rcc => self.write_rcc(offset, value, now),
            Unit::Flash => self.flash.write(offset, value, now),
            Unit::Dma(n) => self.dma[n].write(offset, value),
            Unit::Signature => Ok(()),
            Unit::Dwt => self.dwt.write(offset, value, now),
            Unit::Dbgmcu => self.dbgmcu.write(offset, value),
        };
        done.map_err(|NoRegister| false)?;
        self.after_write(unit, now);
        Ok(())
    }

    /// What a write to one peripheral does to others.
    fn after_write(&mut self, unit: Unit, now: u64) {
        match unit {
            Unit::Tim(n) if self.tim[n].take_trigger_now() => {
                for slave in 0..self.tim.len() {
                    if self.tim[slave].waits_for(slave) == Some(n) {
                        self.tim[slave].start(now);
                    }
                }
                if self.trigger_timer() == Some(n) {
                    self.trigger_adc(now);
                }
            }
            Unit::Adc => self.note_scan(now, false),
            Unit::Pwr => self.rcc.backup_domain_open = self.pwr.backup_domain_open(),
            Unit::Flash => self.flash.check_latency(self.clocks.hclk),
            _ => {}
        }
    }

    fn write_rcc(&mut self, offset: u32, value: u32, now: u64) -> Result<(), NoRegister> {
        let held = |rcc: &Rcc, unit| gate(unit).is_some_and(|(bus, bit)| rcc.held_in_reset(bus, bit));
        let before = GATED.map(|unit| held(&self.rcc, unit));
        self.rcc.write(offset, value)?;
        for (unit, before) in GATED.into_iter().zip(before) {
            if !before && held(&self.rcc, unit) {
                self.reset_unit(unit);
            }
        }
        self.follow_clocks(now);
        Ok(())
    }

    fn reset_unit(&mut self, unit: Unit) {
        match unit {
            Unit::Tim(n) => self.tim[n].reset(),
            Unit::Pwr => {
                self.pwr.reset();
                self.rcc.backup_domain_open = false;
            }
            Unit::Usart1 => self.usart1.reset(),
            Unit::Adc => self.adc.reset(),
            Unit::Syscfg => self.syscfg = Syscfg::default(),
            Unit::Gpio(n) => self.gpio[n].reset(n),
            Unit::Dma(n) => self.dma[n].reset(),
            _ => {}
        }
    }

    fn follow_clocks(&mut self, now: u64) {
        let clocks = self.rcc.clocks();
        if clocks == self.clocks {
            return;
        }
        self.clocks = clocks;
        for tim in &mut self.tim {
            tim.set_clock(clocks.timers1, now);
        }
        self.adc.set_clock(clocks.pclk2);
        self.usart1.set_clock(clocks.pclk2);
        self.dwt.set_clock(clocks.hclk, now);
        self.flash.check_latency(clocks.hclk);
    }
}
