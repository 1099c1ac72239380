//! What is done about a bead that hangs.
//!
//! # Design
//! Four times a second, at the lowest priority, this task sees whether the others got on. The independent
//! watchdog is fed only if fresh samples were taken and a frame has left since it was last fed. A task above
//! that never yields starves this one, and the watchdog resets the bead; a task that waits for what never
//! comes is found here, and the panic says which.
//!
//! Status frames leave once a second, the first of them at boot, so the feeding pauses for 1.25 s at most. The
//! watchdog's oscillator is rough (17 to 47 kHz, DocID022152 table 42), so its 2 s are 1.4 to 3.8 s: what
//! starves for [`SILENCE`] is found before it.

use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{Peri, peripherals};
use embassy_time::{Duration, Timer};

use crate::counters::{self, Counters};

const TIMEOUT_US: u32 = 2_000_000;
const PERIOD: Duration = Duration::from_millis(250);
/// Looks without a fresh sample or without a frame that left, at which the bead is given up: 1.25 s.
const SILENCE: u32 = 5;

/// Watches for ever.
#[embassy_executor::task]
pub(crate) async fn watch(watchdog: Peri<'static, peripherals::IWDG>) -> ! {
    // A halted core is not a hung one.
    embassy_stm32::pac::DBGMCU.apb1fzr().modify(|w| w.set_iwdg(true));
    let mut watchdog = IndependentWatchdog::new(watchdog, TIMEOUT_US);
    watchdog.unleash();
    let mut before = counters::snapshot();
    let mut fed = before;
    let mut silent = 0;
    loop {
        Timer::after(PERIOD).await;
        let now = counters::snapshot();
        check(&before, &now);
        if now.samples != fed.samples && now.frames_sent != fed.frames_sent {
            watchdog.pet();
            fed = now;
            silent = 0;
        } else {
            silent += 1;
            if silent == SILENCE {
                match now.samples == fed.samples {
                    true => panic!("no samples arrive"),
                    false => panic!("transmission hangs"),
                }
            }
        }
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
