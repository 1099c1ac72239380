//! Turns bytes from the link into requests; each is answered before the next is read.
//!
//! # Design
//! This task has the lowest priority. It takes one piece of bytes and then lets the other tasks of its
//! priority run: garbage at full line rate costs idle time only. If a host sends more than the ring can hold
//! while a request is carried out, bytes are dropped until the line has been quiet for 2 ms; this is counted.
//! Bytes that are not a request get no reply, so noise cannot fill the outbox.

use bead_app::Commands;
use bead_wire::{RequestDecoder, UpdateStage};
use embassy_futures::yield_now;
use embassy_time::{Duration, with_timeout};

use crate::board::{BEAD, Stm32Board};
use crate::port::{Missing, Receiver};
use crate::update;

/// Receives for ever.
#[embassy_executor::task]
pub(crate) async fn receive(mut port: Receiver, commands: &'static mut Commands<Stm32Board>) -> ! {
    let mut decoder = RequestDecoder::new();
    let mut bytes = [0; 64];
    commands.end_trial().await;
    loop {
        commands.end_idle_update().await;
        let came = port.read(&mut bytes);
        let came = if update::stage() == UpdateStage::Receiving {
            // Otherwise an update whose line is cut would never end.
            with_timeout(Duration::from_secs(1), came).await.unwrap_or(Ok(0))
        } else {
            came.await
        };
        match came {
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
                    Missing::Broken | Missing::Noise => link.line_errors += 1,
                });
                if !matches!(missing, Missing::Noise) {
                    port.quiet().await;
                }
            }
        }
        // While a host sends, the next bytes are there at once. The other tasks of this priority need the
        // core too.
        yield_now().await;
    }
}
