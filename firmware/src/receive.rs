//! From the bytes that come in over the link to requests; each is answered before the next is read.
//!
//! # Design
//! This task has the lowest priority. It takes one piece of bytes and then lets the other tasks of its
//! priority run: garbage at full line rate costs idle time only. If a host sends more than the ring can hold
//! while a request is being done, bytes are let go until the line has been quiet for 2 ms; this is counted.
//! Bytes that are no request get no reply, so noise cannot fill the outbox.

use bead_wire::{Link, RequestCounters, RequestDecoder};
use embassy_futures::yield_now;

use crate::commands::Commands;
use crate::counters;
use crate::port::{Missing, Receiver};

/// Receives for ever.
#[embassy_executor::task]
pub(crate) async fn receive(mut port: Receiver, mut commands: Commands) -> ! {
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
                let counted = decoder.take_counters();
                counters::update_link(|link| add(link, &counted));
            }
            Err(missing) => {
                counters::update_link(|link| match missing {
                    Missing::Overrun => link.overruns += 1,
                    Missing::Line => link.line_errors += 1,
                });
                port.quiet().await;
            }
        }
        // While a host sends, the next bytes are there at once. The other tasks of this priority need the
        // core too.
        yield_now().await;
    }
}

fn add(link: &mut Link, counted: &RequestCounters) {
    let rejected = &counted.rejected;
    link.bytes += counted.bytes;
    link.requests += counted.requests as u32;
    link.rejected_too_long += rejected.too_long as u32;
    link.rejected_cobs += rejected.cobs as u32;
    link.rejected_too_short += rejected.too_short as u32;
    link.rejected_crc += rejected.crc as u32;
    link.rejected_version += rejected.version as u32;
    link.rejected_kind += rejected.kind as u32;
    link.rejected_body += rejected.body as u32;
    link.rejected_trailing += rejected.trailing as u32;
}
