//! What comes in over the link: bytes to requests, each answered before the next.
//!
//! # Design
//! At the lowest priority, and no more than a piece at a time before the other tasks there: garbage at full line
//! rate costs idle time. What the ring cannot take while a request is being done is lost and counted, and the decoder is
//! in step again at the next delimiter. No reply is made to what is no request, so nobody can fill the outbox with
//! noise.

use core::cell::Cell;

use bead_wire::{Link, RequestCounters, RequestDecoder};
use embassy_futures::yield_now;
use embassy_stm32::usart::{Error, RingBufferedUartRx};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;

use crate::commands::Commands;

static LINK: Mutex<CriticalSectionRawMutex, Cell<Option<Link>>> = Mutex::new(Cell::new(None));

/// What came in, as it stands.
pub(crate) fn link() -> Link {
    LINK.lock(Cell::get).unwrap_or_default()
}

/// Changes some of its counts. They are apart from the others, which change with every block.
pub(crate) fn count(change: impl FnOnce(&mut Link)) {
    LINK.lock(|cell| {
        let mut link = cell.get().unwrap_or_default();
        change(&mut link);
        cell.set(Some(link));
    });
}

/// Receives for ever.
#[embassy_executor::task]
pub(crate) async fn receive(mut port: RingBufferedUartRx<'static>, mut commands: Commands) -> ! {
    let mut decoder = RequestDecoder::new();
    let mut bytes = [0; 64];
    loop {
        match port.read(&mut bytes).await {
            Ok(length) => {
                for &byte in &bytes[..length] {
                    if let Some(heard) = decoder.push(byte) {
                        commands.answer(heard).await;
                    }
                }
                let counted = decoder.take_counters();
                count(|link| add(link, &counted));
            }
            Err(Error::Overrun | Error::BufferTooLong) => count(|link| link.overruns += 1),
            Err(_) => count(|link| link.line_errors += 1),
        }
        // There may be bytes at once, for as long as somebody sends; the others here want the core as well.
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
