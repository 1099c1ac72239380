//! A light that shows that the bead runs.
//!
//! One short flash a second: all is well. Two: the boot before ended in a fault. Three: a sensor or the
//! supply cannot be believed. None: the bead hangs, since this task is among the last to get the core.

use bead_wire::Standing;
use embassy_stm32::Peri;
use embassy_stm32::gpio::{AnyPin, Flex, Level, Speed};
use embassy_time::{Duration, Ticker, Timer};

use crate::board::BEAD;
use crate::wiring::LIT_HIGH;

const FLASH: Duration = Duration::from_millis(20);
const PAUSE: Duration = Duration::from_millis(180);

/// Flashes for ever. A light that is lit when low is between VDD and its pin, which only sinks: PC13 must not
/// be a source (DocID022152, table 7, note on PC13), and a button may lead to VDD.
#[embassy_executor::task]
pub(crate) async fn heartbeat(pin: Peri<'static, AnyPin>, after_fault: bool) -> ! {
    let mut light = Flex::new(pin);
    let level = |lit: bool| Level::from(lit == LIT_HIGH);
    light.set_level(level(false));
    if LIT_HIGH {
        light.set_as_output(Speed::Low);
    } else {
        light.set_as_input_output(Speed::Low);
    }
    let mut second = Ticker::every(Duration::from_secs(1));
    loop {
        let flashes = match (BEAD.snapshot().health.standing, after_fault) {
            (Standing::NONE, false) => 1,
            (Standing::NONE, true) => 2,
            _ => 3,
        };
        for _ in 0..flashes {
            light.set_level(level(true));
            Timer::after(FLASH).await;
            light.set_level(level(false));
            Timer::after(PAUSE).await;
        }
        second.next().await;
    }
}
