//! From the bytes that come in over the link to requests; each is answered before the next is read.
//!
//! # Design
//! This task has the lowest priority. It takes one piece of bytes and then lets the other tasks of its
//! priority run: garbage at full line rate costs idle time only. If a host sends more than the ring can hold
//! while a request is being done, bytes are let go until the line has been quiet for 2 ms; this is counted.
//! Bytes that are no request get no reply, so noise cannot fill the outbox.

use bead_app::Commands;
use bead_wire::RequestDecoder;
use embassy_futures::yield_now;

use crate::board::{BEAD, Stm32Board};
use crate::port::{Missing, Receiver};

/// Receives for ever.
#[embassy_executor::task]
pub(crate) async fn receive(mut port: Receiver, commands: &'static mut Commands<Stm32Board>) -> ! {
    let mut decoder = RequestDecoder::new();
    let mut bytes = [0; 64];
    loop {
        match port.read(&mut bytes).await {
            Ok(length) => {
                for &byte in &bytes[..length] {
                    if let Some(Ok(heard)) = decoder.push(byte) {
                        commands.answer(heard).await;
                    }
                }
                BEAD.count_received(&decoder.take_counters());
            }
            Err(missing) => {
                BEAD.update_link(|link| match missing {
                    Missing::Overrun => link.overruns += 1,
                    Missing::LinePins => link.line_errors += 1,
                });
                port.quiet().await;
            }
        }
        // While a host sends, the next bytes are there at once. The other tasks of this priority need the
        // core too.
        yield_now().await;
    }
}
