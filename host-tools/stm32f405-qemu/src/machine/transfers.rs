//! DMA transfers: on request of a peripheral, and between memories.

use super::board::Exterior;
use super::chip::Chip;
use super::wiring::{ADCS, I2CS, SERVERS, SPIS, Server, USARTS};
use crate::peripherals::Peripheral;
use crate::peripherals::dac::CHANNELS;
use crate::peripherals::dma::{Beat, BeatProgress, Direction, STREAMS};

/// The only controller that copies between memories (section 10.3.6).
const DMA2: usize = 1;

#[derive(Debug, Clone, Copy)]
pub(super) struct DmaStream {
    pub(super) dma: usize,
    pub(super) stream: usize,
}

pub(super) fn serving(chip: &Chip, server: &Server) -> Option<DmaStream> {
    let dma = server.dma;
    let stream = chip.units.dma[dma].serving(&server.streams)?;
    Some(DmaStream { dma, stream })
}

/// The machine's models at a time, and its outside.
pub(super) struct Context<'a, B> {
    chip: &'a mut Chip,
    now: u64,
    board: &'a mut B,
}

impl<'a, B: Exterior> Context<'a, B> {
    pub(super) fn new(chip: &'a mut Chip, now: u64, board: &'a mut B) -> Self {
        Self { chip, now, board }
    }
}

#[derive(Debug, Clone, Default)]
pub(super) struct Transfers {
    /// Bytes that the DMA wrote and that the board has not got yet. Neighbours are passed on in one piece.
    written: Vec<u8>,
    written_at: u32,
    scans_at_last_block: u64,
}

impl Transfers {
    /// Serves the request of a converter, if one stands. Returns `true` if nothing but memory has changed by
    /// that. If not, the other requests are served too.
    pub(super) fn serve_converter(&mut self, adc: usize, at: &mut Context<'_, impl Exterior>) -> bool {
        if !at.chip.units.adc.converters[adc].request {
            return true;
        }
        let Some(stream) = serving(at.chip, &SERVERS.adc[adc]) else {
            return true;
        };
        let beat = at.chip.units.dma[stream.dma].beat(stream.stream);
        let to_memory =
            |beat: Beat| beat.direction == Direction::ToMemory && at.chip.part.is_sram(beat.memory);
        if beat.is_some_and(to_memory) {
            self.fetch_conversion(adc, stream, at);
            return true;
        }
        self.serve(at);
        false
    }

    pub(super) fn serve(&mut self, at: &mut Context<'_, impl Exterior>) {
        for adc in 0..ADCS.len() {
            if at.chip.units.adc.converters[adc].request
                && let Some(stream) = serving(at.chip, &SERVERS.adc[adc])
            {
                self.fetch_conversion(adc, stream, at);
            }
        }
        for channel in 0..CHANNELS {
            if at.chip.units.dac.request(channel)
                && let Some(stream) = serving(at.chip, &SERVERS.dac[channel])
            {
                at.chip.units.dac.served(channel);
                self.transfer(stream, at);
            }
        }
        for usart in 0..USARTS.len() {
            // The first byte moves on to the shift register at once, so two may be taken.
            for _ in 0..2 {
                if at.chip.units.usart[usart].dma_transmit_request() {
                    self.serve_by(&SERVERS.transmitters[usart], at);
                }
            }
            if at.chip.units.usart[usart].dma_receive_request() {
                self.serve_by(&SERVERS.receivers[usart], at);
            }
        }
        self.serve_buses(at);
        if at.chip.linked_timers {
            self.serve_timers(at);
        }
    }

    /// Returns `true` if a stream has something to move now.
    pub(super) fn are_due(chip: &Chip) -> bool {
        let units = &chip.units;
        let is_served = |server: &Server| serving(chip, server).is_some();
        let copies = |stream| {
            let beat = units.dma[DMA2].beat(stream);
            beat.is_some_and(|beat| beat.direction == Direction::MemoryToMemory)
        };
        let requests = |n: usize, flag: usize| units.tim[n].requests() >> flag & 1 == 1;
        (0..STREAMS).any(copies)
            || (0..ADCS.len()).any(|n| units.adc.converters[n].request && is_served(&SERVERS.adc[n]))
            || (0..CHANNELS).any(|n| units.dac.request(n) && is_served(&SERVERS.dac[n]))
            || (0..USARTS.len()).any(|n| {
                let usart = &units.usart[n];
                usart.dma_transmit_request() && is_served(&SERVERS.transmitters[n])
                    || usart.dma_receive_request() && is_served(&SERVERS.receivers[n])
            })
            || (0..I2CS.len()).any(|n| {
                let (i2c, servers) = (&units.i2c[n], &SERVERS.i2c[n]);
                i2c.dma_transmit_request() && is_served(&servers.transmitter)
                    || i2c.dma_receive_request() && is_served(&servers.receiver)
            })
            || (0..SPIS.len()).any(|n| {
                let (spi, servers) = (&units.spi[n], &SERVERS.spi[n]);
                spi.dma_transmit_request() && is_served(&servers.transmitter)
                    || spi.dma_receive_request() && is_served(&servers.receiver)
            })
            || (0..units.tim.len()).any(|n| {
                let mut servers = SERVERS.timers[n].iter().enumerate();
                servers.any(|(flag, server)| requests(n, flag) && is_served(server))
            })
    }

    fn serve_timers(&mut self, at: &mut Context<'_, impl Exterior>) {
        for n in 0..at.chip.units.tim.len() {
            let requests = at.chip.units.tim[n].requests();
            if requests == 0 {
                continue;
            }
            for (flag, server) in SERVERS.timers[n].iter().enumerate() {
                if requests >> flag & 1 == 1
                    && let Some(stream) = serving(at.chip, server)
                {
                    at.chip.units.tim[n].served(1 << flag);
                    self.transfer(stream, at);
                }
            }
        }
    }

    fn serve_buses(&mut self, at: &mut Context<'_, impl Exterior>) {
        for n in 0..I2CS.len() {
            // The first byte moves on to the shift register at once, so two may be taken.
            for _ in 0..2 {
                if at.chip.units.i2c[n].dma_transmit_request() {
                    self.serve_by(&SERVERS.i2c[n].transmitter, at);
                }
            }
            if at.chip.units.i2c[n].dma_receive_request()
                && let Some(stream) = serving(at.chip, &SERVERS.i2c[n].receiver)
            {
                self.transfer(stream, at);
                let left = at.chip.units.dma[stream.dma].items_left(stream.stream);
                at.chip.units.i2c[n].fetched(left);
            }
        }
        for n in 0..SPIS.len() {
            for _ in 0..2 {
                if at.chip.units.spi[n].dma_transmit_request() {
                    self.serve_by(&SERVERS.spi[n].transmitter, at);
                }
            }
            if at.chip.units.spi[n].dma_receive_request() {
                self.serve_by(&SERVERS.spi[n].receiver, at);
            }
        }
    }

    fn serve_by(&mut self, server: &Server, at: &mut Context<'_, impl Exterior>) {
        if let Some(stream) = serving(at.chip, server) {
            self.transfer(stream, at);
        }
    }

    fn fetch_conversion(&mut self, adc: usize, stream: DmaStream, at: &mut Context<'_, impl Exterior>) {
        let unserved = at.chip.units.dma[stream.dma].interrupt(stream.stream);
        let progress = self.transfer(stream, at);
        let converter = &mut at.chip.units.adc.converters[adc];
        // Even if the stream reads another register than DR, the request is answered.
        converter.take_data();
        if progress.ended {
            converter.dma_ended();
        }
        if progress.block && at.chip.sampler.is_none_or(|sampler| sampler == adc) {
            self.flush(at.board);
            // A processor that hangs is not woken for a block. What it executed belongs to no block.
            let scans = at.chip.scans - self.scans_at_last_block;
            at.board.acquired(if unserved { 0 } else { scans });
            self.scans_at_last_block = at.chip.scans;
        }
    }

    /// Streams between memories need no request. They run when they are enabled, and here they end at once.
    pub(super) fn copy_memory(&mut self, at: &mut Context<'_, impl Exterior>) {
        for stream in 0..STREAMS {
            let place = DmaStream { dma: DMA2, stream };
            let copies = |beat: Beat| beat.direction == Direction::MemoryToMemory;
            while at.chip.units.dma[DMA2].beat(stream).is_some_and(copies) {
                if self.transfer(place, at).ended {
                    break;
                }
            }
        }
    }

    fn transfer(&mut self, place: DmaStream, at: &mut Context<'_, impl Exterior>) -> BeatProgress {
        let DmaStream { dma, stream } = place;
        let Some(beat) = at.chip.units.dma[dma].beat(stream) else {
            return BeatProgress::STOPPED;
        };
        let (from, to) = match beat.direction {
            Direction::ToPeripheral => (beat.memory, beat.peripheral),
            Direction::ToMemory | Direction::MemoryToMemory => (beat.peripheral, beat.memory),
        };
        let value = self.read(from, beat.bytes, at);
        let moved = value.and_then(|value| self.write(to, beat.bytes, value, at));
        let dma = &mut at.chip.units.dma[dma];
        if moved.is_some() {
            return dma.moved(stream);
        }
        dma.failed(stream);
        BeatProgress::STOPPED
    }

    /// `None` is a bus error.
    fn read(&mut self, address: u32, bytes: u32, at: &mut Context<'_, impl Exterior>) -> Option<u32> {
        if at.chip.part.flash_space().contains(&address) {
            at.chip.units.flash.fetched_by_dma();
        } else if !at.chip.part.is_sram(address) {
            let word = at.chip.read(address & !3, at.now).ok()?;
            return Some(part(word, address, bytes));
        }
        self.flush(at.board);
        let mut word = [0; 4];
        at.board.read_memory(address, &mut word[..bytes as usize]);
        Some(u32::from_le_bytes(word))
    }

    /// `None` is a bus error.
    fn write(
        &mut self,
        address: u32,
        bytes: u32,
        value: u32,
        at: &mut Context<'_, impl Exterior>,
    ) -> Option<()> {
        if !at.chip.part.is_sram(address) {
            let value = at.chip.widen(address, bytes, value, at.now);
            return at.chip.write(address & !3, value, at.now).ok();
        }
        if self.written_at.wrapping_add(self.written.len() as u32) != address {
            self.flush(at.board);
            self.written_at = address;
        }
        self.written.extend(&value.to_le_bytes()[..bytes as usize]);
        Some(())
    }

    pub(super) fn flush(&mut self, board: &mut impl Exterior) {
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
