//! Edges on the sync input, by the sample clock.
//!
//! # Design
//! TIM2 counts the very clock that TIM3 makes the samples from, 84 MHz, and latches its count at a rising edge on
//! PA15 (RM0090 section 18.3.5). It is started by TIM3's first update (slave mode *trigger*, section 18.3.15), which
//! is the trigger of sample index 1, so that one count follows from the other for good: nothing is measured and
//! nothing drifts. What remains is the clock or two that silicon takes to pass on a trigger and an edge, 12 to 48 ns,
//! the same at every edge and in every bead.
//!
//! The count wraps after 51 s. Which wrap it is, the time driver says, whose ticks are sample periods.
//!
//! # A pin that floats
//! An edge is latched by the timer; the core is interrupted for one and then for none during [`HOLD_OFF`]. What comes
//! meanwhile is counted once, as the timer does not say how often it came. So a storm costs a hundred short
//! interrupts and frames a second, at the lowest priority, and no sample.

use bead_wire::{Sync, unwrapped};
use embassy_stm32::gpio::Pull;
use embassy_stm32::pac;
use embassy_stm32::pac::timer::vals::{Sms, Ts};
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::input_capture::{CapturePin, InputCapture};
use embassy_stm32::timer::low_level::CountingMode;
use embassy_stm32::timer::{CaptureCompareInterruptHandler, Channel};
use embassy_stm32::{Peri, bind_interrupts, peripherals};
use embassy_time::{Duration, Instant, Timer};

use crate::clocks::TIMER_HZ;
use crate::outbox;
use crate::sample_clock::SAMPLE_RATE_HZ;

bind_interrupts!(struct Irqs {
    TIM2 => CaptureCompareInterruptHandler<peripherals::TIM2>;
});

/// Timer clocks in a sample period.
const CLOCKS_PER_SAMPLE: u16 = (TIMER_HZ / SAMPLE_RATE_HZ) as u16;
/// Edges closer than this are not told one by one. A pulse a second is what a sync source gives.
const HOLD_OFF: Duration = Duration::from_millis(10);
/// Interval at which the timer is looked at until TIM3 has started it.
const START: Duration = Duration::from_millis(1);

/// The sync input, armed.
pub(crate) struct SyncInput(InputCapture<'static, peripherals::TIM2>);

impl SyncInput {
    /// Sets up the timer to be started by TIM3: to be called before that runs.
    pub(crate) fn new(
        timer: Peri<'static, peripherals::TIM2>,
        pin: Peri<'static, peripherals::PA15>,
    ) -> Self {
        // Pulled down: with nothing connected there are no edges.
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
        // The driver starts the timer: back to zero, for TIM3 (ITR2, RM0090 table 93) to start it.
        pac::TIM2.cr1().modify(|w| w.set_cen(false));
        pac::TIM2.cnt().write_value(0);
        pac::TIM2.smcr().modify(|w| {
            w.set_ts(Ts::ITR2);
            w.set_sms(Sms::TRIGGER_MODE);
        });
        Self(capture)
    }
}

/// Tells edges for ever.
#[embassy_executor::task]
pub(crate) async fn sync(input: SyncInput) -> ! {
    let SyncInput(mut capture) = input;
    while !pac::TIM2.cr1().read().cen() {
        Timer::after(START).await;
    }
    let clocks_now = || Instant::now().as_ticks() * u64::from(CLOCKS_PER_SAMPLE);
    // Within a tick, which is all that choosing the wrap needs.
    let started = clocks_now() - u64::from(pac::TIM2.cnt().read());
    let (mut edge, mut missed) = (0, 0);
    loop {
        missed += u32::from(pac::TIM2.sr().read().ccif(0));
        pac::TIM2.sr().modify(|w| {
            w.set_ccif(0, false);
            w.set_ccof(0, false);
        });
        capture.wait_for_rising_edge(Channel::Ch1).await;
        // The driver gives the low 16 bits of it only.
        let count = pac::TIM2.ccr(0).read();
        missed += u32::from(pac::TIM2.sr().read().ccof(0));
        // The timer was started by the trigger of index 1.
        let clocks = unwrapped(count, clocks_now() - started) + u64::from(CLOCKS_PER_SAMPLE);
        outbox::push(Sync::at(edge, clocks, CLOCKS_PER_SAMPLE, missed));
        edge += 1;
        Timer::after(HOLD_OFF).await;
    }
}
