//! Identity, settings, status, health and link of the bead, sent at boot and every second.

use bead_app::{RefusedSettings, ThisBoot};
use bead_wire::{Detail, FaultCause};
use embassy_time::{Duration, Ticker};

use crate::board::BEAD;

/// A host that starts to listen gets all of them within this time.
const PERIOD: Duration = Duration::from_secs(1);

/// Faults of the supply and of the clock that the start has found, each with a line about it.
pub(crate) type FoundFaults = [Option<(FaultCause, Detail)>; 2];

/// Reports for ever.
#[embassy_executor::task]
pub(crate) async fn report(
    boot: &'static ThisBoot,
    refused: Option<RefusedSettings>,
    found: FoundFaults,
) -> ! {
    let mut period = Ticker::every(PERIOD);
    BEAD.report_boot(boot, refused, found.into_iter().flatten());
    loop {
        period.next().await;
        BEAD.report(boot);
    }
}
