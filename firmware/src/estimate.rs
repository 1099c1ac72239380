//! The work on each block of scans.
//!
//! # Design
//! [`Estimation`] does it, at the middle priority: acquisition interrupts it, telemetry waits for it.

use bead_app::{BLOCK_US, Device as _, Estimation, SensorWatch};
use bead_wire::FaultCause;
use embassy_time::{Duration, Instant, Timer};

use crate::board::{BEAD, Stm32Board};
use crate::{clocks, handover};

/// Measures strikes for ever.
#[embassy_executor::task]
pub(crate) async fn estimate(estimation: &'static mut Estimation<Stm32Board>) -> ! {
    loop {
        let block = handover::next().await;
        estimation.take(&block);
        handover::give_back(block.codes);
        estimation.count_block();
    }
}

/// Replaces [`estimate`] while there are no samples: takes settings, and watches the supply. The sample index
/// follows the time, since signed requests expire by it. A bead whose crystal was `silent` starts anew when
/// the crystal oscillates.
#[embassy_executor::task]
pub(crate) async fn idle(silent: bool) -> ! {
    let mut watch = SensorWatch::default();
    let mut still = Instant::now();
    loop {
        Timer::after(Duration::from_micros(BLOCK_US.into())).await;
        let _ = BEAD.take_settings();
        watch.check_supply(&BEAD);
        // A tick is a sample period.
        BEAD.update(|c| c.newest_index = Instant::now().as_ticks());
        if !silent || !clocks::crystal_swings() {
            still = Instant::now();
        } else if still.elapsed() > clocks::STEADY {
            BEAD.fault(
                FaultCause::CrystalFailed,
                "the crystal swings again: the bead starts anew",
            );
            Timer::after(Duration::from_millis(100)).await;
            BEAD.device().reset()
        }
    }
}

/// Makes the checksums of the strikes that are kept, for ever.
#[embassy_executor::task]
pub(crate) async fn seal() -> ! {
    BEAD.seal_windows().await
}
