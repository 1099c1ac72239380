//! Frames out of the port, by DMA.
//!
//! # Design
//! The frames of a strike leave in about 15 ms. There is no flow control, and the bead never waits: a host
//! that cannot keep up sees gaps in the sequence numbers.

use bead_wire::{MAX_FRAME, Packed};
use embassy_stm32::mode::Async;
use embassy_stm32::usart::UartTx;

use crate::board::BEAD;

/// Sends the frames of the outbox, for ever.
#[embassy_executor::task]
pub(crate) async fn transmit(mut port: UartTx<'static, Async>, buffer: &'static mut [u8; MAX_FRAME]) -> ! {
    let mut packed = Packed::new();
    loop {
        BEAD.next_frame(&mut packed).await;
        match packed.seal(buffer) {
            Ok(frame) => match port.write(frame).await {
                Ok(()) => BEAD.update(|c| c.frames_sent = c.frames_sent.wrapping_add(1)),
                Err(error) => defmt::error!("a frame was not sent: {}", defmt::Debug2Format(&error)),
            },
            Err(_) => BEAD.update(|c| c.frames_dropped_too_long += 1),
        }
        BEAD.count_frame_done();
    }
}
