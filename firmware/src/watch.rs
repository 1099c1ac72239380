//! Resets a bead that hangs.
//!
//! # Design
//! Four times a second, at the lowest priority, this task checks whether the others make progress. It feeds
//! the independent watchdog only if new samples have reached the estimators and a frame has left since it was
//! last fed. A task of higher priority that never yields starves this task, and the watchdog resets the bead.
//! A task that waits for ever is found here, and the panic names it.
//!
//! The watchdog runs from the first instructions, at first with all the time that a start may need
//! ([`watchdog::begin`]). So a start that hangs ends too.
//!
//! Status frames leave once a second, the first at boot, so two feedings are at most 1.25 s apart. The
//! watchdog's oscillator is rough (17 to 47 kHz, DocID022152 table 42): its 2 s are 1.4 to 3.8 s. So this
//! task finds a wait before the watchdog resets.

use bead_app::{BootRecord, Progress};
use bead_wire::UpdateStage;
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{Peri, peripherals};
use embassy_time::{Duration, Timer};

use crate::board::BEAD;
use crate::{trace, update, watchdog};

const TIMEOUT_US: u32 = 2_000_000;
/// Timeout while the bead waits for an image: a sector is erased in 2 s at most, and nothing is measured.
const RECEIVING_US: u32 = 16_000_000;
const PERIOD: Duration = Duration::from_millis(250);
/// Checks after which a boot has proven itself, its tasks of the lowest priority included: 1 s.
const PROVEN: u32 = 4;

/// Watches for ever. Without `sampling` there are no samples to wait for.
#[embassy_executor::task]
pub(crate) async fn watch(independent: Peri<'static, peripherals::IWDG>, sampling: bool) -> ! {
    // Fed first: the start has used up some of its long timeout, and a short one begins now.
    watchdog::feed();
    let receives = update::stage() == UpdateStage::Receiving;
    let timeout = if receives { RECEIVING_US } else { TIMEOUT_US };
    let mut independent = IndependentWatchdog::new(independent, timeout);
    independent.unleash();
    let mut progress = Progress::new(sampling, BEAD.snapshot());
    let mut checks = 0_u32;
    loop {
        Timer::after(PERIOD).await;
        checks = checks.saturating_add(1);
        if checks == PROVEN {
            trace::change(BootRecord::prove);
        }
        if progress.check(BEAD.snapshot()) {
            independent.pet();
        }
    }
}
