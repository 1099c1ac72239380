//! The hardware behind the trigger line: TIM2 pulls PB10 and latches edges at PB11; the board joins them.
//!
//! # Design
//! TIM2 makes the edge itself, by a compare (RM0090 section 18.3.8), and latches the edges of others. It
//! counts the same clock as the samples ([`sync`](crate::sync)).

use bead_app::LineTimer;
use embassy_stm32::gpio::{OutputType, Pull};
use embassy_stm32::pac;
use embassy_stm32::pac::gpio::vals::Idr;
use embassy_stm32::pac::timer::vals::{CcmrInputCcs, Ocm};
use embassy_stm32::timer::input_capture::CapturePin;
use embassy_stm32::timer::simple_pwm::PwmPin;
use embassy_stm32::timer::{Ch3, Ch4};
use embassy_stm32::{Peri, peripherals};

/// The line, ready.
pub(crate) struct LinePins {
    _output: PwmPin<'static, peripherals::TIM2, Ch3>,
    _input: CapturePin<'static, peripherals::TIM2, Ch4>,
}

impl LinePins {
    /// Releases the line, and latches its edges. TIM2 must be on.
    pub(crate) fn new(
        output: Peri<'static, peripherals::PB10>,
        input: Peri<'static, peripherals::PB11>,
    ) -> Self {
        pac::TIM2
            .ccmr_input(1)
            .modify(|w| w.set_ccs(1, CcmrInputCcs::TI4));
        release();
        pac::TIM2.ccer().modify(|w| {
            w.set_cce(2, true);
            w.set_ccp(3, true);
            w.set_cce(3, true);
        });
        Self {
            _output: PwmPin::new(output, OutputType::OpenDrain),
            _input: CapturePin::new(input, Pull::Up),
        }
    }
}

impl LineTimer for LinePins {
    fn count(&self) -> u32 {
        pac::TIM2.cnt().read()
    }

    fn last_edge(&self) -> u32 {
        pac::TIM2.ccr(3).read()
    }

    fn is_low(&self) -> bool {
        pac::GPIOB.idr().read().idr(11) == Idr::LOW
    }

    fn pull_at(&mut self, count: u32) {
        pac::TIM2.ccr(2).write_value(count);
        pac::TIM2
            .ccmr_output(1)
            .modify(|w| w.set_ocm(0, Ocm::INACTIVE_ON_MATCH));
    }

    fn release(&mut self) {
        release();
    }
}

fn release() {
    pac::TIM2
        .ccmr_output(1)
        .modify(|w| w.set_ocm(0, Ocm::FORCE_ACTIVE));
}
