//! DMA transfers: on request of a peripheral, and between memories.

use super::board::Board;
use super::chip::Chip;
use super::wiring::{ADCS, SERVERS, Server, USARTS};
use crate::memory::{FLASH, SRAM};
use crate::peripherals::Peripheral;
use crate::peripherals::dma::{Beat, Direction, Progress, STREAMS};

/// The only controller that copies between memories (section 10.3.6).
const DMA2: usize = 1;

/// A stream of a controller.
#[derive(Debug, Clone, Copy)]
pub(super) struct DmaStream {
    pub(super) dma: usize,
    pub(super) stream: usize,
}

/// The stream that serves a request.
pub(super) fn serving(chip: &Chip, server: &Server) -> Option<DmaStream> {
    let stream = chip.units.dma[server.dma].serving(&server.streams)?;
    Some(DmaStream {
        dma: server.dma,
        stream,
    })
}

/// Transfers under way.
#[derive(Debug, Clone, Default)]
pub(super) struct Transfers {
    /// Bytes that the DMA wrote and that the board has not got yet. Neighbours are passed on in one piece.
    written: Vec<u8>,
    written_at: u32,
    scans_at_last_block: u64,
}

impl Transfers {
    /// Serves the request of a converter, if one stands. Gives whether nothing but memory has changed by
    /// that. If not, the other requests are served too.
    pub(super) fn serve_converter(
        &mut self,
        chip: &mut Chip,
        adc: usize,
        now: u64,
        board: &mut impl Board,
    ) -> bool {
        if !chip.units.adc.converters[adc].request {
            return true;
        }
        let Some(stream) = serving(chip, &SERVERS.adc[adc]) else {
            return true;
        };
        let beat = chip.units.dma[stream.dma].beat(stream.stream);
        let to_memory = |beat: Beat| beat.direction == Direction::ToMemory && SRAM.contains(&beat.memory);
        if beat.is_some_and(to_memory) {
            self.fetch_conversion(chip, adc, stream, now, board);
            return true;
        }
        self.serve(chip, now, board);
        false
    }

    /// Serves the requests that stand.
    pub(super) fn serve(&mut self, chip: &mut Chip, now: u64, board: &mut impl Board) {
        for adc in 0..ADCS.len() {
            if chip.units.adc.converters[adc].request
                && let Some(stream) = serving(chip, &SERVERS.adc[adc])
            {
                self.fetch_conversion(chip, adc, stream, now, board);
            }
        }
        for usart in 0..USARTS.len() {
            // The first byte moves on to the shift register at once, so two may be taken.
            for _ in 0..2 {
                if chip.units.usart[usart].dma_transmit_request()
                    && let Some(stream) = serving(chip, &SERVERS.transmitters[usart])
                {
                    self.transfer(chip, stream, now, board);
                }
            }
            if chip.units.usart[usart].dma_receive_request()
                && let Some(stream) = serving(chip, &SERVERS.receivers[usart])
            {
                self.transfer(chip, stream, now, board);
            }
        }
    }

    fn fetch_conversion(
        &mut self,
        chip: &mut Chip,
        adc: usize,
        stream: DmaStream,
        now: u64,
        board: &mut impl Board,
    ) {
        let unserved = chip.units.dma[stream.dma].interrupt(stream.stream);
        let progress = self.transfer(chip, stream, now, board);
        let converter = &mut chip.units.adc.converters[adc];
        // Even if the stream reads another register than DR, the request is answered.
        converter.take_data();
        if progress.ended {
            converter.dma_ended();
        }
        if progress.block && chip.sampler.is_none_or(|sampler| sampler == adc) {
            self.flush(board);
            // A processor that hangs is not woken for a block. What it executed belongs to no block.
            board.acquired(if unserved {
                0
            } else {
                chip.scans - self.scans_at_last_block
            });
            self.scans_at_last_block = chip.scans;
        }
    }

    /// Streams between memories need no request. They run when they are enabled, and here they end at once.
    pub(super) fn copy_memory(&mut self, chip: &mut Chip, now: u64, board: &mut impl Board) {
        for stream in 0..STREAMS {
            let place = DmaStream { dma: DMA2, stream };
            let copies = |beat: Beat| beat.direction == Direction::MemoryToMemory;
            while chip.units.dma[DMA2].beat(stream).is_some_and(copies) {
                if self.transfer(chip, place, now, board).ended {
                    break;
                }
            }
        }
    }

    /// Moves one beat.
    fn transfer(&mut self, chip: &mut Chip, place: DmaStream, now: u64, board: &mut impl Board) -> Progress {
        const STOPPED: Progress = Progress {
            block: false,
            ended: true,
        };
        let DmaStream { dma, stream } = place;
        let Some(beat) = chip.units.dma[dma].beat(stream) else {
            return STOPPED;
        };
        let (from, to) = match beat.direction {
            Direction::ToPeripheral => (beat.memory, beat.peripheral),
            Direction::ToMemory | Direction::MemoryToMemory => (beat.peripheral, beat.memory),
        };
        let value = self.read(chip, from, beat.bytes, now, board);
        match value.and_then(|value| self.write(chip, to, beat.bytes, value, now, board)) {
            Some(()) => chip.units.dma[dma].moved(stream),
            None => {
                chip.units.dma[dma].failed(stream);
                STOPPED
            }
        }
    }

    /// `None` is a bus error.
    fn read(
        &mut self,
        chip: &mut Chip,
        address: u32,
        bytes: u32,
        now: u64,
        board: &mut impl Board,
    ) -> Option<u32> {
        if FLASH.contains(&address) {
            chip.units.flash.fetched_by_dma();
        } else if !SRAM.contains(&address) {
            return Some(part(chip.read(address & !3, now).ok()?, address, bytes));
        }
        self.flush(board);
        let mut word = [0; 4];
        board.read_memory(address, &mut word[..bytes as usize]);
        Some(u32::from_le_bytes(word))
    }

    fn write(
        &mut self,
        chip: &mut Chip,
        address: u32,
        bytes: u32,
        value: u32,
        now: u64,
        board: &mut impl Board,
    ) -> Option<()> {
        if !SRAM.contains(&address) {
            let value = chip.widen(address, bytes, value, now);
            return chip.write(address & !3, value, now).ok();
        }
        if self.written_at.wrapping_add(self.written.len() as u32) != address {
            self.flush(board);
            self.written_at = address;
        }
        self.written
            .extend_from_slice(&value.to_le_bytes()[..bytes as usize]);
        Some(())
    }

    /// Passes on what was written.
    pub(super) fn flush(&mut self, board: &mut impl Board) {
        if !self.written.is_empty() {
            board.write_memory(self.written_at, &self.written);
            self.written_at = self.written_at.wrapping_add(self.written.len() as u32);
            self.written.clear();
        }
    }
}

/// The bytes of a word that a narrower read at this address gets.
pub(super) fn part(word: u32, address: u32, bytes: u32) -> u32 {
    (word >> (8 * (address & 3))) & (u32::MAX >> (32 - 8 * bytes))
}
