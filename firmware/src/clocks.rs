//! The clock tree: 168 MHz from a crystal of 8 MHz.
//!
//! # Design
//! | clock | MHz | for |
//! |---|---|---|
//! | HSE | 8 | a crystal is exact to ppm, the RC oscillator to per cent; the sample clock is as exact |
//! | PLL input | 2 | the highest allowed, for least jitter (RM0090 section 7.3.2) |
//! | SYSCLK, AHB | 168 | the fastest clock of the part |
//! | APB1 | 42 | its limit; its timers (TIM3, TIM5) run at twice that, 84 |
//! | APB2 | 84 | its limit; USART1, and the ADC's clock divided by 4: 21 MHz |

use embassy_stm32::Config;
use embassy_stm32::interrupt::Priority;
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllMul, PllPDiv, PllPreDiv, PllQDiv, PllSource, Sysclk,
};
use embassy_stm32::time::Hertz;

/// Clock of the timers of APB1: TIM2, TIM3 and TIM5.
pub(crate) const TIMER_HZ: u32 = 84_000_000;

/// Clock of the ADC. The driver takes the smallest even divider of APB2 that stays within the allowed 36 MHz
/// (DocID022152 table 67): 84 MHz / 4.
pub(crate) const ADC_HZ: u32 = 21_000_000;

/// The configuration for `embassy_stm32::init`.
pub(crate) fn config() -> Config {
    let mut config = Config::default();
    config.rcc.hse = Some(Hse {
        freq: Hertz(8_000_000),
        mode: HseMode::Oscillator,
    });
    config.rcc.pll_src = PllSource::HSE;
    config.rcc.pll = Some(Pll {
        prediv: PllPreDiv::DIV4,
        mul: PllMul::MUL168,
        divp: Some(PllPDiv::DIV2),
        divq: Some(PllQDiv::DIV7),
        divr: None,
    });
    config.rcc.sys = Sysclk::PLL1_P;
    config.rcc.ahb_pre = AHBPrescaler::DIV1;
    config.rcc.apb1_pre = APBPrescaler::DIV4;
    config.rcc.apb2_pre = APBPrescaler::DIV2;
    // Above every executor: the handlers only note what happened and wake a task.
    config.dma_interrupt_priority = Priority::P0;
    config
}
