//! A light that shows that the bead runs.
//!
//! One short flash a second: all is well. Two: the boot before ended in a fault. Three: a sensor or the
//! supply cannot be believed. None: the bead hangs, since this task is among the last to get the core.

use bead_wire::Standing;
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::{Peri, peripherals};
use embassy_time::{Duration, Ticker, Timer};

use crate::board::BEAD;

const FLASH: Duration = Duration::from_millis(20);
const PAUSE: Duration = Duration::from_millis(180);

/// Flashes for ever. The LED is between VDD and PC13. The pin may sink 3 mA but must not be a source
/// (DocID022152, table 7, note on PC13).
#[embassy_executor::task]
pub(crate) async fn heartbeat(pin: Peri<'static, peripherals::PC13>, after_fault: bool) -> ! {
    let mut led = Output::new(pin, Level::High, Speed::Low);
    let mut second = Ticker::every(Duration::from_secs(1));
    loop {
        let flashes = match (BEAD.snapshot().health.standing, after_fault) {
            (Standing::NONE, false) => 1,
            (Standing::NONE, true) => 2,
            _ => 3,
        };
        for _ in 0..flashes {
            led.set_low();
            Timer::after(FLASH).await;
            led.set_high();
            Timer::after(PAUSE).await;
        }
        second.next().await;
    }
}
