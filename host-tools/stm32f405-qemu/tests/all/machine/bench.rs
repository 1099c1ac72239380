//! A machine with a board that records what comes out, stepped as QEMU steps it.

use std::collections::BTreeMap;

use stm32f405_qemu::machine::{Board, Machine, SYSTICK};
use stm32f405_qemu::{Outcome, PinInput, Run, UartInput};

pub(crate) const GPIOB: u32 = 0x4002_0400;
pub(crate) const GPIOA: u32 = 0x4002_0000;
pub(crate) const RCC: u32 = 0x4002_3800;
pub(crate) const FLASH: u32 = 0x4002_3c00;
pub(crate) const TIM2: u32 = 0x4000_0000;
pub(crate) const TIM3: u32 = 0x4000_0400;
pub(crate) const TIM5: u32 = 0x4000_0c00;
pub(crate) const IWDG: u32 = 0x4000_3000;
pub(crate) const USART1: u32 = 0x4001_1000;
pub(crate) const ADC1: u32 = 0x4001_2000;
pub(crate) const DMA2: u32 = 0x4002_6400;
pub(crate) const STREAM0: u32 = DMA2 + 0x10;
pub(crate) const STREAM7: u32 = DMA2 + 0x10 + 7 * 0x18;
pub(crate) const SRAM: u32 = 0x2000_0000;
pub(crate) const CCM: u32 = 0x1000_0000;
pub(crate) const DMA2_STREAM0: usize = 56;
pub(crate) const DMA2_STREAM7: usize = 70;

/// Memory, and a record of everything that came out.
pub(crate) struct TestBoard {
    pub(crate) sram: Vec<u8>,
    pub(crate) lines: [bool; SYSTICK + 1],
    pub(crate) rises: BTreeMap<usize, Vec<u64>>,
    pub(crate) now: u64,
    pub(crate) uart: Vec<u8>,
    /// Frames that any USART sent.
    pub(crate) frames: Vec<(usize, u16)>,
    pub(crate) blocks: Vec<u64>,
    pub(crate) flash_writes: Vec<(u32, Vec<u8>)>,
    pub(crate) resets_wanted: usize,
    pub(crate) flash_changes: Vec<(u32, Vec<u8>)>,
    pub(crate) stalled: bool,
    pub(crate) memory_lost: usize,
}

impl Board for TestBoard {
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

    fn lose_memory(&mut self) {
        self.memory_lost += 1;
    }

    fn set_interrupt(&mut self, number: usize, level: bool) {
        self.lines[number] = level;
        if level {
            self.rises.entry(number).or_default().push(self.now);
        }
    }

    fn sent(&mut self, usart: usize, data: u16, _at: u64) {
        self.frames.push((usart, data));
        if usart == 0 {
            self.uart.push(data as u8);
        }
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
        Self::with_inputs(rows, &[], &[])
    }

    pub(crate) fn with_uart_input(rows: Vec<[u16; 4]>, input: &[UartInput]) -> Self {
        Self::with_inputs(rows, input, &[])
    }

    pub(crate) fn with_inputs(rows: Vec<[u16; 4]>, uart: &[UartInput], pins: &[PinInput]) -> Self {
        let mut run = Run::new("none");
        run.stimulus = rows;
        run.uart_input = uart.to_vec();
        run.pin_inputs = pins.to_vec();
        Self::of(run)
    }

    pub(crate) fn of(run: Run) -> Self {
        let mut bench = Self {
            machine: Machine::new(run),
            board: TestBoard {
                sram: vec![0; 0x2_0000],
                lines: [false; SYSTICK + 1],
                rises: BTreeMap::new(),
                now: 0,
                uart: Vec::new(),
                frames: Vec::new(),
                blocks: Vec::new(),
                flash_writes: Vec::new(),
                resets_wanted: 0,
                flash_changes: Vec::new(),
                stalled: false,
                memory_lost: 0,
            },
            wakes: 0,
        };
        // HSE 8 MHz, PLL to 168 MHz, APB1 42 MHz, APB2 84 MHz, five wait states, caches; clocks of all that
        // is used.
        bench.write(0x4002_3c00, 0x705);
        bench.write(RCC, 1 << 16 | 0x83);
        bench.write(RCC + 0x04, 4 | 168 << 6 | 1 << 22 | 7 << 24);
        bench.write(RCC, 1 << 24 | 1 << 16 | 0x83);
        bench.write(RCC + 0x08, 2 | 0b101 << 10 | 0b100 << 13);
        bench.write(RCC + 0x30, 1 << 22 | 0b111);
        bench.write(RCC + 0x40, 0b1111);
        bench.write(RCC + 0x44, 1 << 4 | 1 << 8);
        // PB6 and PB7 are USART1's (AF7).
        bench.write(GPIOB, 0x0280 | 0b1010 << 12);
        bench.write(GPIOB + 0x20, 0x77 << 24);
        bench
    }

    pub(crate) fn read(&mut self, address: u32) -> u32 {
        self.machine.read(address, 4, self.board.now, &mut self.board)
    }

    pub(crate) fn write(&mut self, address: u32, value: u32) {
        self.machine
            .write(address, 4, value, self.board.now, &mut self.board);
    }

    /// Goes on to `until`, waking for interrupts only; `on_wake` is the firmware's handler.
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

    pub(crate) fn outcome(&self) -> Outcome {
        self.machine.outcome(self.board.now)
    }

    /// CR open, to program by words.
    pub(crate) fn open_flash(&mut self) {
        self.write(FLASH + 0x04, 0x4567_0123);
        self.write(FLASH + 0x04, 0xcdef_89ab);
        self.write(FLASH + 0x10, 0b10 << 8 | 1);
    }

    pub(crate) fn store(&mut self, address: u32, value: u32) {
        self.machine
            .store(address, 4, value, self.board.now, &mut self.board);
    }

    /// TIM3 at 100 kHz with its update as TRGO.
    pub(crate) fn start_tim3(&mut self) {
        self.write(TIM3 + 0x2c, 839);
        self.write(TIM3 + 0x04, 0b010 << 4);
        self.write(TIM3, 1);
    }

    /// ADC1 over channels 0 and 1 by TIM3, 56 + 12 cycles each at 21 MHz, into a ring of `items` at `memory`.
    pub(crate) fn start_acquisition(&mut self, memory: u32, items: u32) {
        self.write(STREAM0 + 0x04, items);
        self.write(STREAM0 + 0x08, ADC1 + 0x4c);
        self.write(STREAM0 + 0x0c, memory);
        // Halfwords, memory increments, circular, half, complete and error interrupts.
        let cr = 1 << 13 | 1 << 11 | 1 << 10 | 1 << 8 | 0b111 << 2;
        self.write(STREAM0, cr);
        self.write(STREAM0, cr | 1);
        self.write(ADC1 + 0x304, 1 << 16);
        self.write(ADC1 + 0x04, 1 << 26 | 1 << 8 | 1 << 5);
        self.write(ADC1 + 0x10, 0b011_011);
        self.write(ADC1 + 0x2c, 1 << 20);
        self.write(ADC1 + 0x34, 1 << 5);
        self.write(ADC1 + 0x08, ADON_DMA_BY_TIM3);
        self.start_tim3();
    }

    pub(crate) fn clear_stream0(bench: &mut Self) {
        let flags = bench.read(DMA2);
        bench.write(DMA2 + 0x08, flags);
    }

    pub(crate) fn halfwords(&self, address: u32, count: usize) -> Vec<u16> {
        let at = (address - SRAM) as usize;
        let bytes = &self.board.sram[at..at + 2 * count];
        bytes
            .chunks_exact(2)
            .map(|c| u16::from_le_bytes([c[0], c[1]]))
            .collect()
    }
}

pub(crate) const ADON_DMA_BY_TIM3: u32 = 0b01 << 28 | 0b1000 << 24 | 1 << 10 | 1 << 9 | 1 << 8 | 1;

pub(crate) fn ramp(rows: u16) -> Vec<[u16; 4]> {
    (0..rows).map(|i| [i, 1000 + i, 0, 0]).collect()
}
