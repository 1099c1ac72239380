//! Who the bead is and how it fares: identity, settings, status and health, at boot and every second.

use bead_wire::{Fault, FaultCause, Identity, Message, Settings, SettingsSource, Status};
use embassy_time::{Duration, Instant, Ticker};

use crate::acquire::CHANNELS;
use crate::counters;
use crate::outbox::{self, Record};
use crate::sample_clock::SAMPLE_RATE_HZ;
use crate::settings::Loaded;
use crate::stack;
use crate::trace::{self, Boot};

/// A host that starts to listen knows within this time what it listens to.
const PERIOD: Duration = Duration::from_secs(1);

/// Reports for ever.
#[embassy_executor::task]
pub(crate) async fn report(boot: &'static Boot, loaded: &'static Loaded) -> ! {
    let mut period = Ticker::every(PERIOD);
    let identity = Identity {
        firmware: env!("CARGO_PKG_VERSION"),
        git: env!("BEAD_GIT"),
        uid: embassy_stm32::uid::uid(),
        boot: boot.number,
        reset_cause: boot.reset_cause,
        sample_rate_hz: SAMPLE_RATE_HZ,
        channels: CHANNELS as u8,
    };
    counters::update(|c| c.health.frames_lost_by_reset = boot.frames_lost);
    tell(Message::Identity(identity));
    tell(Message::Settings(Settings { block: loaded.block }));
    tell(Message::Status(status(loaded.source)));
    tell(Message::Health(counters::snapshot().health));
    if let Some(left) = &boot.left {
        tell(Message::Fault(Fault {
            cause: left.cause,
            boot: left.boot,
            pc: left.pc,
            detail: &left.detail,
        }));
    }
    if let Some(why) = loaded.refused {
        fault(FaultCause::SettingsRefused, why);
    }
    loop {
        period.next().await;
        tell(Message::Identity(identity));
        tell(Message::Settings(Settings { block: loaded.block }));
        tell(Message::Status(status(loaded.source)));
        tell(Message::Health(counters::snapshot().health));
    }
}

/// Tells of a fault that the bead survived.
pub(crate) fn fault(cause: FaultCause, detail: &'static str) {
    defmt::warn!("{=str}", detail);
    tell(Message::Fault(Fault {
        cause,
        boot: trace::boot(),
        pc: 0,
        detail,
    }));
}

fn tell(message: Message<'static>) {
    outbox::push(Record::Message(message));
}

fn status(settings_source: SettingsSource) -> Status {
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
        settings_source,
        armed: counters.armed,
    }
}
