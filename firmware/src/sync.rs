//! Times of the edges on the sync input, by the sample clock.
//!
//! # Design
//! TIM2 counts the same clock of 84 MHz as TIM3, which makes the samples. A rising edge on PA15 latches its
//! count (RM0090 section 18.3.5). TIM3's first update, which is the trigger of sample index 1, starts TIM2
//! (slave mode *trigger*, section 18.3.15). So the sample index follows from the count for good: nothing is
//! measured and nothing drifts. Silicon takes a clock or two to pass on a trigger and an edge, 12 to 48 ns,
//! the same at every edge and in every bead.
//!
//! The count wraps after 51 s. The number of wraps follows from the time driver, whose ticks are sample
//! periods.
//!
//! # A pin that floats
//! The timer latches every edge. The core is interrupted for one edge and then for none during [`HOLD_OFF`].
//! Edges in that time are counted as one, as the timer does not count them. So a storm of edges costs a
//! hundred short interrupts and frames a second, at the lowest priority, and no sample.

use bead_app::CLOCKS_PER_SAMPLE;
use bead_wire::{Sync, unwrapped};
use embassy_stm32::gpio::Pull;
use embassy_stm32::pac;
use embassy_stm32::pac::timer::regs::SrGp16;
use embassy_stm32::pac::timer::vals::{Sms, Ts};
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::input_capture::{CapturePin, InputCapture};
use embassy_stm32::timer::low_level::CountingMode;
use embassy_stm32::timer::{CaptureCompareInterruptHandler, Channel};
use embassy_stm32::{Peri, bind_interrupts, peripherals};
use embassy_time::{Duration, Instant, Timer};

use crate::board::BEAD;
use crate::clocks::TIMER_HZ;

bind_interrupts!(struct Irqs {
    TIM2 => CaptureCompareInterruptHandler<peripherals::TIM2>;
});

/// Edges closer than this are not reported one by one. A sync source gives one pulse a second.
const HOLD_OFF: Duration = Duration::from_millis(10);
/// Interval of the checks whether TIM3 has started the timer.
const START: Duration = Duration::from_millis(1);

/// The sync input, ready.
pub(crate) struct SyncInput(InputCapture<'static, peripherals::TIM2>);

impl SyncInput {
    /// Sets up the timer so that TIM3 starts it. Must be called before TIM3 runs.
    pub(crate) fn new(
        timer: Peri<'static, peripherals::TIM2>,
        pin: Peri<'static, peripherals::PA15>,
    ) -> Self {
        // Pulled down, so that an open pin gives no edges.
        let pin = CapturePin::new(pin, Pull::Down);
        let capture = InputCapture::new(
            timer,
            Some(pin),
            None,
            None,
            None,
            Irqs,
            Hertz(TIMER_HZ),
            CountingMode::EdgeAlignedUp,
        );
        // The driver has started the timer. Stop it at zero, so that TIM3 (ITR2, RM0090 table 93) can start
        // it.
        pac::TIM2.cr1().modify(|w| w.set_cen(false));
        pac::TIM2.cnt().write_value(0);
        pac::TIM2.smcr().modify(|w| {
            w.set_ts(Ts::ITR2);
            w.set_sms(Sms::TRIGGER_MODE);
        });
        Self(capture)
    }
}

/// Reports edges for ever.
#[embassy_executor::task]
pub(crate) async fn sync(input: SyncInput) -> ! {
    let SyncInput(mut capture) = input;
    while !pac::TIM2.cr1().read().cen() {
        Timer::after(START).await;
    }
    let clocks_now = || Instant::now().as_ticks() * u64::from(CLOCKS_PER_SAMPLE);
    // Accurate to a tick, which is enough to choose the wrap.
    let started = clocks_now() - u64::from(pac::TIM2.cnt().read());
    let (mut edge, mut missed) = (0, 0);
    loop {
        let flags = pac::TIM2.sr().read();
        missed += u32::from(flags.ccif(0));
        // Only flags that were seen are cleared: ones change nothing (RM0090 section 18.4.5), so an edge that
        // comes in between is still reported.
        pac::TIM2.sr().write_value(SrGp16(!flags.0));
        capture.wait_for_rising_edge(Channel::Ch1).await;
        // The driver returns only the low 16 bits.
        let count = pac::TIM2.ccr(0).read();
        missed += u32::from(pac::TIM2.sr().read().ccof(0));
        // The timer was started by the trigger of index 1.
        let clocks = unwrapped(count, clocks_now() - started) + u64::from(CLOCKS_PER_SAMPLE);
        BEAD.push(Sync::at(edge, clocks, CLOCKS_PER_SAMPLE, missed));
        edge += 1;
        Timer::after(HOLD_OFF).await;
    }
}
