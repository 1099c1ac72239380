//! Identity, settings, status, health and link of the bead, told at boot and every second.

use bead_wire::{Detail, Fault, FaultCause, Identity, LastFault, ResetCauses, Status};
use embassy_time::{Duration, Instant, Ticker};

use crate::block::CHANNELS;
use crate::sample_clock::SAMPLE_RATE_HZ;
use crate::settings::Refused;
use crate::trace::{self, Boot};
use crate::{counters, outbox, settings, stack};

/// A host that starts to listen gets all of them within this time.
const PERIOD: Duration = Duration::from_secs(1);

/// Faults found at start-up: each cause with a line about it.
pub(crate) type Found = heapless::Vec<(FaultCause, &'static str), 2>;

/// Reports for ever.
#[embassy_executor::task]
pub(crate) async fn report(boot: &'static Boot, refused: Option<Refused>, found: Found) -> ! {
    let mut period = Ticker::every(PERIOD);
    counters::update(|c| c.health.frames_lost_by_reset = boot.frames_lost);
    counters::update_guard(|guard| guard.boots_failed = boot.failed);
    tell_all(boot);
    if let Some(left) = &boot.left {
        outbox::tell(Fault {
            cause: left.cause,
            boot: left.boot,
            pc: left.pc,
            detail: left.detail.clone(),
        });
    }
    if let Some(refused) = refused {
        fault_with(FaultCause::SettingsRefused, refused.detail());
    }
    for (cause, detail) in found {
        fault(cause, detail);
    }
    loop {
        period.next().await;
        tell_all(boot);
    }
}

fn tell_all(boot: &'static Boot) {
    tell_identity(boot);
    if let Some(last) = &boot.last {
        outbox::tell(LastFault {
            faults: boot.faults,
            cause: last.cause,
            boot: last.boot,
            pc: last.pc,
            detail: last.detail.clone(),
        });
    }
    settings::tell();
    tell_status();
}

/// Sends the identity.
pub(crate) fn tell_identity(boot: &'static Boot) {
    outbox::tell(Identity {
        firmware: env!("CARGO_PKG_VERSION").into(),
        git: env!("BEAD_GIT").into(),
        uid: embassy_stm32::uid::uid(),
        boot: boot.number,
        reset_cause: ResetCauses::from_bits(boot.reset_cause),
        sample_rate_hz: SAMPLE_RATE_HZ,
        channels: CHANNELS as u8,
    });
}

/// Sends status, health, link and guard.
pub(crate) fn tell_status() {
    outbox::tell(status());
    outbox::tell(counters::snapshot().health);
    tell_link();
    outbox::tell(counters::guard());
}

/// Sends the counts of the link.
pub(crate) fn tell_link() {
    outbox::tell(counters::link());
}

/// Logs and sends a fault that the bead survived.
#[inline(never)]
pub(crate) fn fault(cause: FaultCause, detail: &'static str) {
    fault_with(cause, detail.into());
}

/// [`fault`] with a detail that was put together.
fn fault_with(cause: FaultCause, detail: Detail) {
    defmt::warn!("{=str}", detail.as_str());
    outbox::tell(Fault {
        cause,
        boot: trace::boot(),
        pc: 0,
        detail,
    });
}

fn status() -> Status {
    let counters = counters::snapshot();
    Status {
        uptime_ms: Instant::now().as_millis(),
        epoch: counters.epoch,
        samples: counters.samples,
        strikes: counters.strikes,
        overruns: counters.overruns,
        blocks_dropped: counters.blocks_dropped,
        frames_dropped_queue_full: counters.frames_dropped_queue_full,
        frames_dropped_too_long: counters.frames_dropped_too_long,
        stack_free_min: stack::never_used(),
        settings_source: settings::source(),
        armed: counters.armed,
    }
}
