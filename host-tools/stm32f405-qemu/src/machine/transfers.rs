//! DMA transfers: on request of a peripheral, and between memories.

use super::board::Exterior;
use super::chip::Chip;
use super::wiring::{ADCS, I2CS, SERVERS, SPIS, Server, TIMER_REQUESTS, USARTS};
use crate::peripherals::Peripheral;
use crate::peripherals::dac::CHANNELS;
use crate::peripherals::dma::{Beat, BeatProgress, Direction, Dma, STREAMS};

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

/// The machine's models, the time, and the board.
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

/// A peripheral that asks for transfers, with the number of its model.
#[derive(Debug, Clone, Copy)]
enum Asker {
    Converter(usize),
    Dac(usize),
    Transmitter(usize),
    Receiver(usize),
    I2cTransmitter(usize),
    I2cReceiver(usize),
    SpiTransmitter(usize),
    SpiReceiver(usize),
    /// With the number of the flag in SR.
    Timer(usize, usize),
}

/// All askers, in the order in which they are served.
fn askers(with_timers: bool) -> impl Iterator<Item = Asker> {
    use Asker::{Converter, Dac, I2cReceiver, I2cTransmitter, Receiver, SpiReceiver, SpiTransmitter};
    use Asker::{Timer, Transmitter};
    let timers = if with_timers { SERVERS.timers.len() } else { 0 };
    let converters = (0..ADCS.len()).map(Converter).chain((0..CHANNELS).map(Dac));
    converters
        .chain((0..USARTS.len()).flat_map(|n| [Transmitter(n), Receiver(n)]))
        .chain((0..I2CS.len()).flat_map(|n| [I2cTransmitter(n), I2cReceiver(n)]))
        .chain((0..SPIS.len()).flat_map(|n| [SpiTransmitter(n), SpiReceiver(n)]))
        .chain((0..timers).flat_map(|n| (0..TIMER_REQUESTS.len()).map(move |flag| Timer(n, flag))))
}

impl Asker {
    fn asks(self, chip: &Chip) -> bool {
        let units = &chip.units;
        match self {
            Self::Converter(n) => units.adc.converters[n].request,
            Self::Dac(channel) => units.dac.request(channel),
            Self::Transmitter(n) => units.usart[n].dma_transmit_request(),
            Self::Receiver(n) => units.usart[n].dma_receive_request(),
            Self::I2cTransmitter(n) => units.i2c[n].dma_transmit_request(),
            Self::I2cReceiver(n) => units.i2c[n].dma_receive_request(),
            Self::SpiTransmitter(n) => units.spi[n].dma_transmit_request(),
            Self::SpiReceiver(n) => units.spi[n].dma_receive_request(),
            Self::Timer(n, flag) => units.tim[n].requests() >> flag & 1 == 1,
        }
    }

    fn server(self) -> &'static Server {
        match self {
            Self::Converter(n) => &SERVERS.adc[n],
            Self::Dac(channel) => &SERVERS.dac[channel],
            Self::Transmitter(n) => &SERVERS.usart[n].transmitter,
            Self::Receiver(n) => &SERVERS.usart[n].receiver,
            Self::I2cTransmitter(n) => &SERVERS.i2c[n].transmitter,
            Self::I2cReceiver(n) => &SERVERS.i2c[n].receiver,
            Self::SpiTransmitter(n) => &SERVERS.spi[n].transmitter,
            Self::SpiReceiver(n) => &SERVERS.spi[n].receiver,
            Self::Timer(n, flag) => &SERVERS.timers[n][flag],
        }
    }

    /// Two for a transmitter: its first byte moves on to the shift register at once.
    const fn most_at_once(self) -> u32 {
        let is_transmitter = matches!(
            self,
            Self::Transmitter(_) | Self::I2cTransmitter(_) | Self::SpiTransmitter(_)
        );
        if is_transmitter { 2 } else { 1 }
    }
}

#[derive(Debug, Clone, Default)]
pub(super) struct Transfers {
    /// Bytes that the DMA wrote, not yet passed to the board. Adjacent bytes are passed in one piece.
    written: Vec<u8>,
    written_at: u32,
    scans_at_last_block: u64,
}

impl Transfers {
    /// Serves a pending request of a converter. Returns `true` if this changed nothing but memory. Otherwise
    /// the other requests are served too.
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
        if !at.chip.units.dma.iter().any(Dma::runs) {
            return;
        }
        for asker in askers(at.chip.linked_timers) {
            for _ in 0..asker.most_at_once() {
                if asker.asks(at.chip)
                    && let Some(stream) = serving(at.chip, asker.server())
                {
                    self.serve_by(stream, asker, at);
                }
            }
        }
    }

    /// Returns `true` if a stream has something to move now.
    pub(super) fn are_due(chip: &Chip) -> bool {
        let copies = |stream| {
            let beat = chip.units.dma[DMA2].beat(stream);
            beat.is_some_and(|beat| beat.direction == Direction::MemoryToMemory)
        };
        let mut askers = askers(chip.linked_timers);
        (0..STREAMS).any(copies)
            || askers.any(|asker| asker.asks(chip) && serving(chip, asker.server()).is_some())
    }

    fn serve_by(&mut self, stream: DmaStream, asker: Asker, at: &mut Context<'_, impl Exterior>) {
        match asker {
            Asker::Converter(n) => return self.fetch_conversion(n, stream, at),
            Asker::Dac(channel) => at.chip.units.dac.served(channel),
            Asker::Timer(n, flag) => at.chip.units.tim[n].served(1 << flag),
            _ => {}
        }
        self.transfer(stream, at);
        if let Asker::I2cReceiver(n) = asker {
            let left = at.chip.units.dma[stream.dma].items_left(stream.stream);
            at.chip.units.i2c[n].fetched(left);
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
