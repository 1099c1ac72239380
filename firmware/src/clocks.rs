//! The clock tree: 168 MHz from a crystal.
//!
//! # Design
//! | clock | MHz | for |
//! |---|---|---|
//! | HSE | 8 | a crystal is exact to ppm, the RC oscillator to per cent; the sample clock is as exact |
//! | PLL input | 2 | the highest allowed, for least jitter (RM0090 section 7.3.2) |
//! | SYSCLK, AHB | 168 | the fastest clock of the part |
//! | APB1 | 42 | its limit; its timers (TIM3, TIM5) run at twice that, 84 |
//! | APB2 | 84 | its limit; USART1, and the ADC's clock divided by 4: 21 MHz |
//!
//! # A crystal that fails
//! The driver would wait for the crystal without end. So [`start_crystal`] waits first, and gives up. Then
//! the clocks are made from the internal oscillator: off by 1 %, good enough for the line and not for
//! samples. If the crystal stops later, the clock security system puts the core on the internal oscillator
//! and raises an NMI ([`crate::trace`]): the bead resets, and starts without a crystal.

use cortex_m::peripheral::{DCB, DWT};
use embassy_stm32::Config;
use embassy_stm32::interrupt::Priority;
use embassy_stm32::pac::{DBGMCU, FLASH, RCC};
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllMul, PllPDiv, PllPreDiv, PllQDiv, PllSource, Sysclk,
};
use embassy_stm32::time::Hertz;

/// The crystal: a whole number of [`PLL_INPUT_HZ`], 4 to 26 MHz.
const CRYSTAL_HZ: u32 = 8_000_000;
/// The internal oscillator, which the core runs on after a reset.
pub(crate) const INTERNAL_HZ: u32 = 16_000_000;
const PLL_INPUT_HZ: u32 = 2_000_000;
/// Longest start of a crystal: 50 times the typical 2 ms (DocID022152, HSE oscillator characteristics).
const CRYSTAL_STARTS: u32 = INTERNAL_HZ / 10;
/// DEV_ID of the part, and the revision whose prefetch does not work: A (RM0090 section 38.6.1, ES0182 on the
/// ART accelerator).
const PART: u16 = 0x413;
const REVISION_A: u16 = 0x1000;

const _: () = assert!(CRYSTAL_HZ.is_multiple_of(PLL_INPUT_HZ));

/// Clock of the timers of APB1: TIM2, TIM3 and TIM5.
pub(crate) const TIMER_HZ: u32 = 84_000_000;

/// Starts the crystal, and waits for it. Returns whether it runs. Called on the internal oscillator.
pub(crate) fn start_crystal() -> bool {
    RCC.cr().modify(|w| w.set_hseon(true));
    let start = DWT::cycle_count();
    loop {
        if RCC.cr().read().hserdy() {
            return true;
        }
        if DWT::cycle_count().wrapping_sub(start) > CRYSTAL_STARTS {
            return false;
        }
    }
}

/// The configuration for `embassy_stm32::init`, from the crystal or from the internal oscillator.
pub(crate) fn config(crystal: bool) -> Config {
    let mut config = Config::default();
    config.rcc.hse = crystal.then_some(Hse {
        freq: Hertz(CRYSTAL_HZ),
        mode: HseMode::Oscillator,
    });
    let (source, hz) = if crystal {
        (PllSource::HSE, CRYSTAL_HZ)
    } else {
        (PllSource::HSI, INTERNAL_HZ)
    };
    config.rcc.pll_src = source;
    config.rcc.pll = Some(Pll {
        prediv: PllPreDiv::from_bits((hz / PLL_INPUT_HZ) as u8),
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
    // The clocks of a core that sleeps cost some mA, and only a debugger wants them.
    config.enable_debug_during_sleep = DCB::is_debugger_attached();
    config
}

/// From now on a crystal that stops raises an NMI (RM0090 section 7.2.7).
pub(crate) fn guard_crystal() {
    RCC.cr().modify(|w| w.set_csson(true));
}

/// Turns on the caches and the prefetch of the flash, which the driver's set-up leaves off: without them the
/// core waits 5 clocks at every branch (RM0090 section 3.5.2).
///
/// Called after flash was erased for the last time, as a cache keeps what was there before (section 3.5.2). A
/// word that is programmed is changed in the cache as well. The caches are emptied first, which works only
/// while they are off (section 3.9.1): flash may have changed since they were on, before the reset.
///
/// Silicon of revision A says that it is an STM32F2, whose revisions have other numbers (ES0182, MCU device
/// ID). So any other part than the expected one goes without the prefetch.
pub(crate) fn accelerate() {
    let id = DBGMCU.idcode().read();
    let prefetch = id.dev_id() == PART && id.rev_id() != REVISION_A;
    let empty = |now| {
        FLASH.acr().modify(|w| {
            w.set_icrst(now);
            w.set_dcrst(now);
        });
    };
    empty(true);
    empty(false);
    FLASH.acr().modify(|w| {
        w.set_icen(true);
        w.set_dcen(true);
        w.set_prften(prefetch);
    });
}

/// While a debugger halts the core, the timers and the watchdog stand still too (RM0090 section 38.16.4).
pub(crate) fn freeze_while_halted() {
    DBGMCU.apb1fzr().modify(|w| {
        w.set_tim2(true);
        w.set_tim3(true);
        w.set_tim5(true);
        w.set_iwdg(true);
    });
}
