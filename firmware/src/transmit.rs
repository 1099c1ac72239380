//! Frames out of USART1, by DMA.
//!
//! # Design
//! 2 Mbaud is 84 MHz / 42 exactly, and what USB serial bridges of today do. A window of a strike, some 30
//! frames and 4 kB, leaves in 20 ms. There is no flow control: who cannot keep up sees gaps in the sequence
//! numbers, and the bead never waits.

use bead_model::Chunk;
use bead_model::meter::CHUNK;
use bead_wire::{Codes, EncodeError, Header, MAX_FRAME, Message, Waveform, encode};
use embassy_stm32::mode::Async;
use embassy_stm32::usart::{Config, UartTx};
use embassy_stm32::{Peri, bind_interrupts, dma, peripherals};

use crate::counters;
use crate::outbox::{self, Queued, Record};
use crate::trace;

bind_interrupts!(struct Irqs {
    DMA2_STREAM7 => dma::InterruptHandler<peripherals::DMA2_CH7>;
});

const BAUD: u32 = 2_000_000;

/// Sets up the port: 8 data bits, no parity, 1 stop bit.
pub(crate) fn port(
    usart: Peri<'static, peripherals::USART1>,
    pin: Peri<'static, peripherals::PA9>,
    dma: Peri<'static, peripherals::DMA2_CH7>,
) -> UartTx<'static, Async> {
    let mut config = Config::default();
    config.baudrate = BAUD;
    UartTx::new(usart, pin, dma, Irqs, config).expect("2 Mbaud divide 84 MHz")
}

/// Sends what is in the outbox, for ever.
#[embassy_executor::task]
pub(crate) async fn transmit(mut port: UartTx<'static, Async>, buffer: &'static mut [u8; MAX_FRAME]) -> ! {
    loop {
        let queued = outbox::next().await;
        match frame(&queued, buffer) {
            Ok(frame) => match port.write(frame).await {
                Ok(()) => counters::update(|c| c.frames_sent = c.frames_sent.wrapping_add(1)),
                Err(error) => defmt::error!(
                    "frame {=u32} was not sent: {}",
                    queued.sequence,
                    defmt::Debug2Format(&error)
                ),
            },
            Err(_) => counters::update(|c| c.frames_dropped_too_long += 1),
        }
        counters::update(|c| {
            c.frames_waiting -= 1;
            trace::keep_waiting(c.frames_waiting);
        });
    }
}

fn frame<'b>(queued: &Queued, buffer: &'b mut [u8; MAX_FRAME]) -> Result<&'b [u8], EncodeError> {
    let header = Header {
        boot: trace::boot() as u8,
        sequence: queued.sequence,
        sample_index: queued.sample_index,
    };
    match &queued.record {
        Record::Message(message) => encode(&header, message, buffer),
        Record::Waveform(chunk) => {
            let mut packed = [0; PACKED];
            encode(&header, &Message::Waveform(waveform(chunk, &mut packed)), buffer)
        }
    }
}

/// Bytes of a chunk's codes at both gains, with the two scans before.
const PACKED: usize = 3 * (CHUNK + 2 + CHUNK);

fn waveform<'p>(chunk: &Chunk, packed: &'p mut [u8; PACKED]) -> Waveform<'p> {
    const ROOM: &str = "a chunk has at most CHUNK scans of codes of 12 bits";
    let (sensitive, wide) = packed.split_at_mut(3 * CHUNK);
    let scans = chunk.scans.iter().map(|scan| scan.sensitive());
    let wides = chunk.before.iter().chain(&chunk.scans).map(|scan| scan.wide());
    Waveform {
        strike: chunk.strike,
        first_index: chunk.first_index,
        codes: Codes::pack(scans, sensitive).expect(ROOM),
        wide: match chunk.loud {
            true => Codes::pack(wides, wide).expect(ROOM),
            false => Codes::default(),
        },
        absorbed_measured: chunk.absorbed_measured.to_bits(),
        absorbed_predicted: chunk.absorbed_predicted.to_bits(),
    }
}
