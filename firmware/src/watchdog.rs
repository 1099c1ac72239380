//! What is done about a bead that hangs.
//!
//! # Design
//! Twice a second, at the lowest priority, this task sees whether the others got on, and feeds the
//! independent watchdog. A task above that never yields starves it, and the watchdog resets the bead; a task
//! that waits for what never comes is found here, and the panic says which.
//!
//! The watchdog's oscillator is rough (17 to 47 kHz, DocID022152 table 42), so its 2 s are 1.4 to 3.8 s.

use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{Peri, peripherals};
use embassy_time::{Duration, Timer};

use crate::counters::{self, Counters};

const TIMEOUT_US: u32 = 2_000_000;
const PERIOD: Duration = Duration::from_millis(500);

/// Watches for ever.
#[embassy_executor::task]
pub(crate) async fn watch(watchdog: Peri<'static, peripherals::IWDG>) -> ! {
    // A halted core is not a hung one.
    embassy_stm32::pac::DBGMCU.apb1fzr().modify(|w| w.set_iwdg(true));
    let mut watchdog = IndependentWatchdog::new(watchdog, TIMEOUT_US);
    watchdog.unleash();
    let mut before = counters::snapshot();
    loop {
        Timer::after(PERIOD).await;
        let now = counters::snapshot();
        check(&before, &now);
        watchdog.pet();
        before = now;
    }
}

fn check(before: &Counters, now: &Counters) {
    // Without samples, overruns are counted: acquisition always gets on.
    if (now.samples, now.overruns) == (before.samples, before.overruns) {
        panic!("acquisition hangs");
    }
    if now.blocks_estimated == before.blocks_estimated && now.blocks_estimated != now.blocks_handed_on {
        panic!("estimation hangs");
    }
}
