//! Frames out of the port, by DMA.
//!
//! # Design
//! The frames of a strike leave in about 15 ms. There is no flow control, and the bead never waits: a host
//! that cannot keep up sees gaps in the sequence numbers.

use bead_model::Chunk;
use bead_model::meter::CHUNK;
use bead_wire::{Codes, EncodeError, Header, MAX_FRAME, Message, Raw, Reply, Settings, Waveform, encode};
use embassy_stm32::mode::Async;
use embassy_stm32::usart::UartTx;

use crate::outbox::{self, Queued, Record};
use crate::{counters, settings, trace};

/// Sends the records of the outbox, for ever.
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
        if let Record::Settings(slot) = queued.record {
            settings::told(slot);
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
        Record::Settings(slot) => {
            let block = settings::block(*slot);
            encode(&header, &Message::Settings(Settings { block: &block }), buffer)
        }
        Record::Reply {
            request,
            outcome,
            detail,
        } => {
            let reply = Reply {
                request: *request,
                outcome: *outcome,
                detail: detail.as_str(),
            };
            encode(&header, &Message::Reply(reply), buffer)
        }
        Record::Raw { first_index, scans } => {
            let mut packed = [0; 3 * CHUNK];
            let raw = Raw {
                first_index: *first_index,
                codes: pack(scans.iter().map(|scan| scan.sensitive()), &mut packed),
            };
            encode(&header, &Message::Raw(raw), buffer)
        }
    }
}

/// Bytes of the packed codes of a chunk at both gains, with the two wide scans before it.
const PACKED: usize = 3 * (CHUNK + 2 + CHUNK);

fn waveform<'p>(chunk: &Chunk, packed: &'p mut [u8; PACKED]) -> Waveform<'p> {
    let (sensitive, wide) = packed.split_at_mut(3 * CHUNK);
    let wides = chunk.before.iter().chain(&chunk.scans).map(|scan| scan.wide());
    Waveform {
        strike: chunk.strike,
        first_index: chunk.first_index,
        codes: pack(chunk.scans.iter().map(|scan| scan.sensitive()), sensitive),
        wide: match chunk.loud {
            true => pack(wides, wide),
            false => Codes::default(),
        },
        absorbed_measured: chunk.absorbed_measured.to_bits(),
        absorbed_predicted: chunk.absorbed_predicted.to_bits(),
    }
}

fn pack(scans: impl Iterator<Item = [u16; 2]>, packed: &mut [u8]) -> Codes<'_> {
    Codes::pack(scans, packed).expect("a piece has at most CHUNK scans of codes of 12 bits")
}
