//! The clock tree: 168 MHz from a crystal.
//!
//! # Design
//! | clock | MHz | for |
//! |---|---|---|
//! | HSE | 8, 12, 16, 25 | the sample clock: a crystal is exact to ppm, the RC oscillator to per cent |
//! | PLL input | 2, or 1 of 25 | the highest that divides it, for least jitter (RM0090 section 7.3.2) |
//! | SYSCLK, AHB | 168 | the fastest clock of the part |
//! | APB1 | 42 | its limit; its timers (TIM3, TIM5) run at twice that, 84 |
//! | APB2 | 84 | its limit; USART1, and the ADC's clock divided by 4: 21 MHz |
//!
//! # Which crystal
//! Boards have different crystals. Before any clock is derived from the crystal, TIM11 measures it against
//! the internal oscillator, which is 1 % off at 25 °C: the input of TIM11 can be the crystal, divided for
//! the RTC (RM0090 section 7.2.11).
//!
//! # A crystal that fails
//! The driver would wait for the crystal without end, so [`source`] waits first, and gives up. Without a
//! crystal, with an unknown one, or on another part, the clocks are derived from the internal oscillator:
//! good enough for the line but not for samples. If the crystal stops later, the clock security system puts
//! the core on the internal oscillator and raises an NMI ([`crate::trace`]): the bead resets, and starts
//! without a crystal. It starts anew when the crystal has oscillated for [`STEADY`] again.

use core::sync::atomic::{AtomicU8, Ordering};

use bead_wire::{Detail, FaultCause};
use cortex_m::peripheral::{DCB, DWT};
use embassy_stm32::Config;
use embassy_stm32::interrupt::Priority;
use embassy_stm32::pac::timer::vals::CcmrInputCcs;
use embassy_stm32::pac::{DBGMCU, FLASH, RCC, TIM11};
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllMul, PllPDiv, PllPreDiv, PllQDiv, PllSource, Sysclk,
};
use embassy_stm32::time::Hertz;
use embassy_time::Duration;

/// Crystals that boards have, MHz. They differ by more than the error of the internal oscillator.
const CRYSTALS_MHZ: [u32; 4] = [8, 12, 16, 25];
/// Reciprocal of the greatest relative error of a measured crystal, which is that of the internal oscillator
/// and of a count of 158 or more.
const OFF: u32 = 32;
/// The internal oscillator, which the core runs on after a reset.
pub(crate) const INTERNAL_HZ: u32 = 16_000_000;
/// Longest start of a crystal: 50 times the typical 2 ms (DocID022152, HSE oscillator characteristics).
const CRYSTAL_STARTS: u32 = INTERNAL_HZ / 10;
/// DEV_ID of the part, and the revision whose prefetch does not work: A (RM0090 section 38.6.1, ES0182 on the
/// ART accelerator).
const PART: u16 = 0x413;
const REVISION_A: u16 = 0x1000;

/// DEV_ID that silicon of revision A reports.
const PART_OF_REVISION_A: u16 = 0x411;
/// Greatest divider of the crystal for the RTC, and edges from capture to capture.
const DIVIDER: u8 = 31;
const EDGES: u32 = 8;

/// Clock of the timers of APB1: TIM2, TIM3 and TIM5.
pub(crate) const TIMER_HZ: u32 = 84_000_000;

/// A crystal that failed to start is tried again after it has oscillated for this long.
pub(crate) const STEADY: Duration = Duration::from_secs(2);

static CRYSTAL_MHZ: AtomicU8 = AtomicU8::new(0);

/// Reason why there is no clock for samples.
pub(crate) enum NoClock {
    /// No crystal oscillates.
    Silent,
    /// A crystal that boards do not have, kHz; 0 if it cannot be measured.
    Crystal(u32),
    /// Another part: its DEV_ID.
    Part(u16),
}

impl NoClock {
    /// The fault to report, and the line about it.
    pub(crate) fn fault(&self) -> (FaultCause, Detail) {
        match self {
            Self::Silent => (
                FaultCause::CrystalFailed,
                "the crystal does not start: the bead answers, and takes no samples".into(),
            ),
            Self::Crystal(khz) => (
                FaultCause::CrystalWrong,
                Detail::new(format_args!(
                    "the crystal has {khz} kHz, not 8, 12, 16 or 25 MHz: the bead answers, and takes no samples"
                )),
            ),
            Self::Part(id) => (
                FaultCause::PartWrong,
                Detail::new(format_args!(
                    "the part is {id:#x}, not 0x413 (STM32F405): the bead answers, and takes no samples"
                )),
            ),
        }
    }
}

/// Starts the crystal and returns its measured frequency, MHz. Called on the internal oscillator.
pub(crate) fn source() -> Result<u32, NoClock> {
    let part = DBGMCU.idcode().read().dev_id();
    if ![PART, PART_OF_REVISION_A].contains(&part) {
        return Err(NoClock::Part(part));
    }
    RCC.cr().modify(|w| w.set_hseon(true));
    let found = if within(CRYSTAL_STARTS, || RCC.cr().read().hserdy()) {
        let khz = crystal_khz();
        let near = |mhz: &u32| khz.abs_diff(mhz * 1000) < mhz * 1000 / OFF;
        CRYSTALS_MHZ.into_iter().find(near).ok_or(NoClock::Crystal(khz))
    } else {
        Err(NoClock::Silent)
    };
    match found {
        Ok(mhz) => CRYSTAL_MHZ.store(mhz as u8, Ordering::Relaxed),
        Err(_) => RCC.cr().modify(|w| w.set_hseon(false)),
    }
    found
}

/// The crystal that the clocks are derived from, MHz; 0 for the internal oscillator.
pub(crate) fn crystal_mhz() -> u8 {
    CRYSTAL_MHZ.load(Ordering::Relaxed)
}

/// Waits until a condition is true, for at most this many clocks. Returns `true` if it is.
fn within(clocks: u32, mut is_true: impl FnMut() -> bool) -> bool {
    let start = DWT::cycle_count();
    while !is_true() {
        if DWT::cycle_count().wrapping_sub(start) > clocks {
            return false;
        }
    }
    true
}

/// The crystal's frequency, kHz, measured with the internal oscillator: TIM11 counts the oscillator's clocks
/// from one capture to the next. Returns 0 if no capture comes.
fn crystal_khz() -> u32 {
    /// TIM11_OR: the crystal, divided for the RTC (RM0090 section 19.5.11).
    const BY_CRYSTAL: u32 = 0b10;
    /// Four times the longest wait, of a crystal of 4 MHz.
    const LONGEST: u32 = 4 * EDGES * DIVIDER as u32 * (INTERNAL_HZ / 4_000_000);
    RCC.cfgr().modify(|w| w.set_rtcpre(DIVIDER));
    RCC.apb2enr().modify(|w| w.set_tim11en(true));
    // As in `supply::wait`.
    let _ = RCC.apb2enr().read();
    TIM11.or().write_value(BY_CRYSTAL);
    TIM11.ccmr_input(0).modify(|w| {
        w.set_ccs(0, CcmrInputCcs::TI4);
        w.set_icpsc(0, EDGES.ilog2() as u8);
    });
    TIM11.ccer().modify(|w| w.set_cce(0, true));
    TIM11.cr1().modify(|w| w.set_cen(true));
    let captured = || within(LONGEST, || TIM11.sr().read().ccif(0)).then(|| TIM11.ccr(0).read().ccr());
    // The first capture comes after an incomplete interval.
    let times = [(); 3].map(|()| captured());
    RCC.apb2rstr().modify(|w| w.set_tim11rst(true));
    RCC.apb2rstr().modify(|w| w.set_tim11rst(false));
    RCC.apb2enr().modify(|w| w.set_tim11en(false));
    RCC.cfgr().modify(|w| w.set_rtcpre(0));
    let [_, Some(from), Some(to)] = times else {
        return 0;
    };
    let clocks = u32::from(to.wrapping_sub(from)).max(1);
    EDGES * u32::from(DIVIDER) * (INTERNAL_HZ / 1000) / clocks
}

/// The configuration for `embassy_stm32::init`, from a crystal of this many MHz or from the internal
/// oscillator.
pub(crate) fn config(crystal: Option<u32>) -> Config {
    let mut config = Config::default();
    config.rcc.hse = crystal.map(|mhz| Hse {
        freq: Hertz(mhz * 1_000_000),
        mode: HseMode::Oscillator,
    });
    let (source, mhz) = match crystal {
        Some(mhz) => (PllSource::HSE, mhz),
        None => (PllSource::HSI, INTERNAL_HZ / 1_000_000),
    };
    let (prediv, mul) = if mhz.is_multiple_of(2) {
        (mhz / 2, PllMul::MUL168)
    } else {
        (mhz, PllMul::MUL336)
    };
    config.rcc.pll_src = source;
    config.rcc.pll = Some(Pll {
        prediv: PllPreDiv::from_bits(prediv as u8),
        mul,
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

/// Makes a crystal that stops raise an NMI (RM0090 section 7.2.7).
pub(crate) fn guard_crystal() {
    RCC.cr().modify(|w| w.set_csson(true));
}

/// Turns on the caches and the prefetch of the flash, which the driver's set-up leaves off: without them the
/// core waits 5 clocks at every branch (RM0090 section 3.5.2).
///
/// Called after the last erase, as a cache keeps the old contents (section 3.5.2). Programming a word changes
/// it in the cache as well. The caches are emptied first, which works only while they are off (section
/// 3.9.1): flash may have changed since they were on, before the reset.
///
/// Silicon of revision A reports itself as an STM32F2, whose revisions have other numbers (ES0182, MCU device
/// ID). So the prefetch stays off on any part but the expected one.
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

/// Empties the data cache, which works only while it is off (RM0090 section 3.9.1).
pub(crate) fn forget_data() {
    let on = FLASH.acr().read().dcen();
    FLASH.acr().modify(|w| w.set_dcen(false));
    FLASH.acr().modify(|w| w.set_dcrst(true));
    FLASH.acr().modify(|w| w.set_dcrst(false));
    FLASH.acr().modify(|w| w.set_dcen(on));
}

/// Turns the crystal on. Returns `true` if it oscillates.
pub(crate) fn crystal_swings() -> bool {
    RCC.cr().modify(|w| w.set_hseon(true));
    RCC.cr().read().hserdy()
}

/// Stops the timers and the watchdog while a debugger halts the core (RM0090 section 38.16.4).
pub(crate) fn freeze_while_halted() {
    DBGMCU.apb1fzr().modify(|w| {
        w.set_tim2(true);
        w.set_tim3(true);
        w.set_tim5(true);
        w.set_iwdg(true);
    });
}
