//! The RTC in deep sleep, and the window watchdog, within the machine.

use stm32f405_qemu::ResetCause;

use super::bench::*;

const PWR: u32 = 0x4000_7000;
const RTC: u32 = 0x4000_2800;
const WWDG: u32 = 0x4000_2c00;
const SCR: u32 = 0xe000_ed10;
const WAKE_UP: u32 = 1 << 22;
const RTC_WKUP: usize = 3;
const WUTF: u32 = 1 << 10;

/// LSE, the domain open, and the wake-up timer with its interrupt on every second.
fn waking() -> MachineBench {
    let mut bench = MachineBench::new(ramp(1));
    bench.write(PWR, 1 << 14 | 1 << 8);
    bench.set(RCC, [(0x70, 1), (0x70, 1 << 15 | 1 << 8 | 1)]);
    bench.set(RTC, [(0x24, 0xca), (0x24, 0x53), (0x14, 0)]);
    bench.write(RTC + 0x08, 1 << 14 | 1 << 10 | 0b100);
    bench
}

#[test]
fn the_wake_up_timer_interrupts_through_exti_once_for_each_flag() {
    let mut bench = waking();
    bench.set(EXTI, [(0x08, WAKE_UP), (0x00, WAKE_UP)]);
    bench.run(3_500_000_000, |bench| {
        if bench.has_line(RTC_WKUP) {
            bench.write(RTC + 0x0c, !(WUTF | 1 << 7));
            bench.write(EXTI + 0x14, WAKE_UP);
        }
    });
    let seconds = [1, 2, 3].map(|n| n * 1_000_000_000);
    assert_eq!(bench.board.rises[&RTC_WKUP], seconds);
}

#[test]
fn the_wake_up_timer_ends_stop_and_standby_in_which_pins_float() {
    let high = |bench: &mut MachineBench| {
        bench.set(GPIOC, [(0x00, 1), (0x14, 1)]);
        assert_eq!(bench.outcome().pins[0].edges, 1);
    };
    let mut bench = waking();
    high(&mut bench);
    bench.set(EXTI, [(0x08, WAKE_UP), (0x00, WAKE_UP)]);
    bench.write(SCR, 1 << 2);
    bench.machine.sleep(bench.board.now, &mut bench.board);
    assert_eq!(bench.outcome().pins[0].edges, 1, "STOP keeps the pins' levels");
    assert!(bench.board.stalled);
    bench.pass(999_999_999);
    assert!(bench.board.stalled);
    bench.pass(1_000_000_000);
    assert!(!bench.board.stalled && bench.has_line(RTC_WKUP));

    let mut bench = waking();
    high(&mut bench);
    bench.write(PWR, 1 << 14 | 1 << 8 | 1 << 1);
    bench.write(SCR, 1 << 2);
    bench.machine.sleep(bench.board.now, &mut bench.board);
    assert_eq!(bench.outcome().pins[0].edges, 2);
    bench.pass(999_999_999);
    assert_eq!(bench.board.resets_wanted, 0);
    bench.pass(1_000_000_000);
    assert_ne!(bench.board.resets_wanted, 0);
    bench.machine.reset(bench.board.now, &mut bench.board);
    assert_eq!(bench.outcome().resets[0].cause, ResetCause::Standby);
    bench.write(RCC + 0x40, 1 << 28);
    assert_eq!(bench.read(PWR + 0x04) & 0b11, 0b11, "WUF and SBF");
}

#[test]
fn the_window_watchdog_resets_the_machine_when_it_is_fed_too_early() {
    let mut bench = MachineBench::new(ramp(1));
    bench.set(WWDG, [(0x04, 0x50), (0x00, 0x80 | 0x7f)]);
    bench.pass(100_000);
    assert_eq!(bench.board.resets_wanted, 0);
    bench.write(WWDG, 0x80 | 0x7f);
    assert_eq!(bench.board.resets_wanted, 1);
    bench.machine.reset(bench.board.now, &mut bench.board);
    assert_eq!(bench.outcome().resets[0].cause, ResetCause::WindowWatchdog);
}
