//! A machine with a board that records its output, stepped as QEMU steps it.

use std::collections::{BTreeMap, BTreeSet};

use stm32f405_qemu::machine::{Exterior, Machine};
use stm32f405_qemu::{BusAnswer, BusCall, Devices, Outcome, Run};

pub(crate) const GPIOA: u32 = 0x4002_0000;
pub(crate) const GPIOB: u32 = 0x4002_0400;
pub(crate) const GPIOC: u32 = 0x4002_0800;
pub(crate) const EXTI: u32 = 0x4001_3c00;
pub(crate) const RCC: u32 = 0x4002_3800;
pub(crate) const FLASH: u32 = 0x4002_3c00;
pub(crate) const TIM2: u32 = 0x4000_0000;
pub(crate) const TIM3: u32 = 0x4000_0400;
pub(crate) const IWDG: u32 = 0x4000_3000;
pub(crate) const USART1: u32 = 0x4001_1000;
pub(crate) const ADC1: u32 = 0x4001_2000;
pub(crate) const ADC2: u32 = 0x4001_2100;
pub(crate) const ADC3: u32 = 0x4001_2200;
pub(crate) const ADC_CCR: u32 = 0x4001_2304;
pub(crate) const DMA1: u32 = 0x4002_6000;
pub(crate) const DMA2: u32 = 0x4002_6400;
pub(crate) const STREAM0: u32 = stream(DMA2, 0);
pub(crate) const SRAM: u32 = 0x2000_0000;
pub(crate) const DMA2_STREAM0: usize = 56;
pub(crate) const ADON_DMA_BY_TIM3: u32 = 0b01 << 28 | 0b1000 << 24 | 1 << 10 | 1 << 9 | 1 << 8 | 1;

/// First register of a stream.
pub(crate) const fn stream(dma: u32, number: u32) -> u32 {
    dma + 0x10 + 0x18 * number
}

pub(crate) fn ramp(rows: u16) -> Vec<[u16; 4]> {
    (0..rows).map(|i| [i, 1000 + i, 0, 0]).collect()
}

/// Memory, and a record of all output.
#[derive(Default)]
pub(crate) struct TestBoard {
    pub(crate) sram: Vec<u8>,
    /// The interrupt lines that are up.
    pub(crate) lines: BTreeSet<usize>,
    pub(crate) rises: BTreeMap<usize, Vec<u64>>,
    pub(crate) now: u64,
    /// Frames that any USART sent.
    pub(crate) frames: Vec<(usize, u16)>,
    pub(crate) blocks: Vec<u64>,
    pub(crate) flash_writes: Vec<(u32, Vec<u8>)>,
    pub(crate) resets_wanted: usize,
    pub(crate) flash_changes: Vec<(u32, Vec<u8>)>,
    pub(crate) stalled: bool,
    pub(crate) devices: Devices,
}

impl TestBoard {
    pub(crate) fn new() -> Self {
        let mut board = Self::default();
        board.sram.resize(0x2_0000, 0);
        board
    }
}

impl Exterior for TestBoard {
    fn read_memory(&mut self, address: u32, bytes: &mut [u8]) {
        let at = (address - SRAM) as usize;
        bytes.copy_from_slice(&self.sram[at..at + bytes.len()]);
    }

    fn write_memory(&mut self, address: u32, bytes: &[u8]) {
        let at = (address - SRAM) as usize;
        self.sram[at..at + bytes.len()].copy_from_slice(bytes);
    }

    fn overwrite_flash(&mut self, address: u32, bytes: &[u8]) {
        self.flash_writes.push((address, bytes.to_vec()));
    }

    fn flash_changed(&mut self, address: u32, bytes: &[u8]) {
        self.flash_changes.push((address, bytes.to_vec()));
    }

    fn stall(&mut self, stalled: bool) {
        self.stalled = stalled;
    }

    fn lose_memory(&mut self) {}

    fn set_interrupt(&mut self, number: usize, level: bool) {
        if level {
            self.lines.insert(number);
            self.rises.entry(number).or_default().push(self.now);
        } else {
            self.lines.remove(&number);
        }
    }

    fn sent(&mut self, usart: usize, data: u16, _at: u64) {
        self.frames.push((usart, data));
    }

    fn ask(&mut self, call: BusCall) -> BusAnswer {
        self.devices.answer(call)
    }

    fn acquired(&mut self, scans: u64) {
        self.blocks.push(scans);
    }

    fn reset_wanted(&mut self) {
        self.resets_wanted += 1;
    }
}

/// A machine with its board and the time, stepped as QEMU steps it.
pub(crate) struct MachineBench {
    pub(crate) machine: Machine,
    pub(crate) board: TestBoard,
    pub(crate) wakes: usize,
}

impl MachineBench {
    pub(crate) fn new(rows: Vec<[u16; 4]>) -> Self {
        Self::with(|run| run.stimulus = rows)
    }

    pub(crate) fn with(change: impl FnOnce(&mut Run)) -> Self {
        let mut run = Run::new("none");
        change(&mut run);
        let devices = run.devices.clone();
        let mut bench = Self {
            machine: Machine::new(run),
            board: TestBoard {
                devices,
                ..TestBoard::new()
            },
            wakes: 0,
        };
        // HSE 8 MHz, PLL to 168 MHz, APB1 42 MHz, APB2 84 MHz, five wait states, caches; all clocks on.
        bench.write(FLASH, 0x705);
        bench.write(RCC, 1 << 16 | 0x83);
        bench.write(RCC + 0x04, 4 | 168 << 6 | 1 << 22 | 7 << 24);
        bench.write(RCC, 1 << 24 | 1 << 16 | 0x83);
        bench.write(RCC + 0x08, 2 | 0b101 << 10 | 0b100 << 13);
        bench.set(RCC, [0x30, 0x40, 0x44].map(|enable| (enable, u32::MAX)));
        // PB6 and PB7 are USART1's (AF7).
        bench.set(GPIOB, [(0x00, 0x0280 | 0b1010 << 12), (0x20, 0x77 << 24)]);
        bench
    }

    pub(crate) fn read(&mut self, address: u32) -> u32 {
        self.machine.read(address, 4, self.board.now, &mut self.board)
    }

    pub(crate) fn write(&mut self, address: u32, value: u32) {
        self.write_narrow(address, 4, value);
    }

    pub(crate) fn write_narrow(&mut self, address: u32, bytes: u32, value: u32) {
        self.machine
            .write(address, bytes, value, self.board.now, &mut self.board);
    }

    /// Writes registers of a peripheral, in order.
    pub(crate) fn set<const N: usize>(&mut self, peripheral: u32, writes: [(u32, u32); N]) {
        for (offset, value) in writes {
            self.write(peripheral + offset, value);
        }
    }

    /// Advances to `until`, waking only for interrupts; `on_wake` is the firmware's handler.
    pub(crate) fn run(&mut self, until: u64, mut on_wake: impl FnMut(&mut Self)) {
        while let Some(at) = self.machine.next_interrupt().filter(|at| *at <= until) {
            assert!(at > self.board.now, "a wake that does not lie ahead");
            self.board.now = at;
            self.machine.advance(at, &mut self.board);
            self.wakes += 1;
            on_wake(self);
        }
        self.board.now = until;
        self.machine.advance(until, &mut self.board);
    }

    /// Advances to `until` without a handler.
    pub(crate) fn pass(&mut self, until: u64) {
        self.run(until, |_| {});
    }

    pub(crate) fn outcome(&self) -> Outcome {
        self.machine.outcome(self.board.now)
    }

    pub(crate) fn has_line(&self, number: usize) -> bool {
        self.board.lines.contains(&number)
    }

    /// Unlocks CR, and sets it to program words.
    pub(crate) fn open_flash(&mut self) {
        self.set(FLASH, [0x4567_0123, 0xcdef_89ab].map(|key| (0x04, key)));
        self.write(FLASH + 0x10, 0b10 << 8 | 1);
    }

    pub(crate) fn store(&mut self, address: u32, value: u32) {
        self.machine
            .store(address, 4, value, self.board.now, &mut self.board);
    }

    /// TIM3 at 100 kHz with its update as TRGO.
    pub(crate) fn start_tim3(&mut self) {
        self.set(TIM3, [(0x2c, 839), (0x04, 0b010 << 4), (0x00, 1)]);
    }

    /// Enables a stream for `items`, with these bits of CR.
    pub(crate) fn start_stream(&mut self, stream: u32, items: u32, peripheral: u32, memory: u32, cr: u32) {
        self.set(stream, [(0x08, peripheral), (0x0c, memory)]);
        self.set(stream, [(0x04, items), (0x00, cr), (0x00, cr | 1)]);
    }

    /// 1 Mbit/s, 8N1, with these bits of CR1 beside UE, TE and RE. USART1 and USART6 have 84 MHz, the others
    /// 42.
    pub(crate) fn start_usart(&mut self, usart: u32, cr1: u32) {
        let pclk = if usart < 0x4001_0000 { 42 } else { 84 };
        self.set(usart, [(0x08, pclk), (0x0c, 1 << 13 | 0b11 << 2 | cr1)]);
    }

    /// ADC1 over channels 0 and 1 by TIM3, 56 + 12 cycles each at 21 MHz, into a ring of `items` at `memory`.
    pub(crate) fn start_acquisition(&mut self, memory: u32, items: u32) {
        // Halfwords, memory increments, circular, half, complete and error interrupts.
        let cr = 1 << 13 | 1 << 11 | 1 << 10 | 1 << 8 | 0b111 << 2;
        self.start_stream(STREAM0, items, ADC1 + 0x4c, memory, cr);
        self.write(ADC1 + 0x04, 1 << 26 | 1 << 8 | 1 << 5);
        self.start_scans(ADC1);
    }

    /// Scans of channels 0 and 1 by TIM3.
    pub(crate) fn start_scans(&mut self, adc: u32) {
        self.write(ADC_CCR, 1 << 16);
        self.set(adc, [(0x10, 0b011_011), (0x2c, 1 << 20), (0x34, 1 << 5)]);
        self.write(adc + 0x08, ADON_DMA_BY_TIM3);
        self.start_tim3();
    }

    /// The code of one conversion by software.
    pub(crate) fn convert(&mut self, adc: u32, channel: u32) -> u32 {
        self.set(adc, [(0x34, channel), (0x08, 1), (0x08, 1 << 30 | 1)]);
        self.pass(self.board.now + 100_000);
        self.read(adc + 0x4c)
    }

    pub(crate) fn clear_stream0(bench: &mut Self) {
        let flags = bench.read(DMA2);
        bench.write(DMA2 + 0x08, flags);
    }

    pub(crate) fn halfwords(&self, address: u32, count: usize) -> Vec<u16> {
        let bytes = &self.board.sram[(address - SRAM) as usize..][..2 * count];
        bytes
            .as_chunks()
            .0
            .iter()
            .map(|bytes| u16::from_le_bytes(*bytes))
            .collect()
    }
}
