//! Frames out of the port, by DMA.
//!
//! # Design
//! The frames of a strike leave in about 15 ms. There is no flow control, and the bead never waits: a host
//! that cannot keep up sees gaps in the sequence numbers.

use bead_wire::{Header, MAX_FRAME, encode};
use embassy_stm32::mode::Async;
use embassy_stm32::usart::UartTx;

use crate::{counters, outbox, settings, trace};

/// Sends the messages of the outbox, for ever.
#[embassy_executor::task]
pub(crate) async fn transmit(mut port: UartTx<'static, Async>, buffer: &'static mut [u8; MAX_FRAME]) -> ! {
    loop {
        let queued = outbox::next().await;
        let header = Header {
            address: settings::address(),
            boot: trace::boot() as u8,
            sequence: queued.sequence,
            sample_index: queued.sample_index,
        };
        match encode(&header, &queued.message, buffer) {
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
