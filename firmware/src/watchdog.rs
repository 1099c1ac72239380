//! The independent watchdog, from the first instructions on.

use embassy_stm32::pac::IWDG;
use embassy_stm32::pac::iwdg::vals::{Key, Pr};

/// Starts the watchdog with its longest timeout: 33 s, or 22 to 62 s with the tolerance of its oscillator. A
/// start takes less between two feedings: 5 s for the supply and 0.1 s for the crystal, then 8 s at most for
/// an erase of two sectors. The watchdog is fed before each erase.
pub(crate) fn begin() {
    IWDG.kr().write(|w| w.set_key(Key::START));
    IWDG.kr().write(|w| w.set_key(Key::ENABLE));
    // The reload value after a reset is the longest.
    IWDG.pr().write(|w| w.set_pr(Pr::DIVIDE_BY256));
}

/// Gives the start its long timeout once more.
pub(crate) fn feed() {
    IWDG.kr().write(|w| w.set_key(Key::RESET));
}
