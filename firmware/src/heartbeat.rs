//! A light that says that the bead runs.
//!
//! One short flash a second: all is well. Two: the reset before this boot was a fault's. None: it hangs, as
//! this is the last task to get the core.

use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::{Peri, peripherals};
use embassy_time::{Duration, Ticker, Timer};

const FLASH: Duration = Duration::from_millis(20);
const PAUSE: Duration = Duration::from_millis(180);

/// Flashes for ever. The LED is between PC13 and ground.
#[embassy_executor::task]
pub(crate) async fn heartbeat(pin: Peri<'static, peripherals::PC13>, after_fault: bool) -> ! {
    let mut led = Output::new(pin, Level::Low, Speed::Low);
    let mut second = Ticker::every(Duration::from_secs(1));
    loop {
        for _ in 0..1 + u8::from(after_fault) {
            led.set_high();
            Timer::after(FLASH).await;
            led.set_low();
            Timer::after(PAUSE).await;
        }
        second.next().await;
    }
}
