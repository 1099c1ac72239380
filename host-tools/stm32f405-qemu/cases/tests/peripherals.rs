//! Cases that check the emulator's peripherals against the reference manual RM0090, by stm32-metapac's names.
//!
//! # Design
//!
//! The image begins on the internal oscillator of 16 MHz, as after a reset, and each case has the part to
//! itself: the runner starts it from power-up. Times are compared with the cycle counter or another timer;
//! their tolerance is some instructions of the loop that waits.
#![no_std]
#![no_main]

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::{DWT, NVIC};
use defmt_rtt as _;
use stm32_metapac as pac;

use pac::gpio::vals::{Idr, Moder, Pupdr};
use pac::rcc::vals::{Pllm, Plln, Pllp, Pllq, Pllsrc, Ppre, Sw};
use pac::{interrupt, *};

/// Number of interrupts by updates of TIM2.
static UPDATES: AtomicU32 = AtomicU32::new(0);

#[interrupt]
fn TIM2() {
    pac::TIM2.sr().modify(|w| w.set_uif(false));
    UPDATES.fetch_add(1, Ordering::Relaxed);
}

/// Starts the cycle counter.
fn count_cycles() {
    let mut core = cortex_m::Peripherals::take().expect("a case takes them once");
    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();
}

/// Measures the cycles until a condition holds.
fn cycles_until(holds: impl Fn() -> bool) -> u32 {
    let began = DWT::cycle_count();
    while !holds() {}
    DWT::cycle_count().wrapping_sub(began)
}

/// Interrupts every 100 us by TIM2, at 16 MHz.
#[allow(unsafe_code, reason = "an interrupt is let through")]
fn interrupt_every_100_us() {
    RCC.apb1enr().modify(|w| w.set_tim2en(true));
    pac::TIM2.arr().write_value(1600 - 1);
    pac::TIM2.dier().write(|w| w.set_uie(true));
    pac::TIM2.cr1().write(|w| w.set_cen(true));
    // SAFETY: no critical section depends on its mask.
    unsafe { NVIC::unmask(Interrupt::TIM2) }
}

#[embedded_test::tests(default_timeout = 10)]
mod clocks {
    use super::*;

    #[init]
    fn init() {
        count_cycles();
    }

    #[test]
    fn the_part_starts_on_the_internal_oscillator() {
        assert!(RCC.cfgr().read().sws() == Sw::HSI);
        let cr = RCC.cr().read();
        assert!(cr.hsirdy() && !cr.hserdy() && !cr.pllrdy());
    }

    /// 8 MHz / 8 * 336 / 2, and APB1 with a quarter of it: its timers have twice that (section 7.2).
    #[test]
    fn the_loop_makes_168_mhz_and_timers_of_apb1_count_half_of_it() {
        FLASH
            .acr()
            .modify(|w| w.set_latency(pac::flash::vals::Latency::WS5));
        RCC.cr().modify(|w| w.set_hseon(true));
        while !RCC.cr().read().hserdy() {}
        RCC.pllcfgr().write(|w| {
            w.set_pllsrc(Pllsrc::HSE);
            w.set_pllm(Pllm::DIV8);
            w.set_plln(Plln::MUL336);
            w.set_pllp(Pllp::DIV2);
            w.set_pllq(Pllq::DIV7);
        });
        RCC.cr().modify(|w| w.set_pllon(true));
        while !RCC.cr().read().pllrdy() {}
        RCC.cfgr().modify(|w| {
            w.set_ppre1(Ppre::DIV4);
            w.set_ppre2(Ppre::DIV2);
            w.set_sw(Sw::PLL1_P);
        });
        while RCC.cfgr().read().sws() != Sw::PLL1_P {}

        RCC.apb1enr().modify(|w| w.set_tim5en(true));
        TIM5.cr1().write(|w| w.set_cen(true));
        let cycles = cycles_until(|| TIM5.cnt().read() >= 84_000);
        assert!(cycles.abs_diff(168_000) < 100, "{} cycles in 1 ms", cycles);
    }

    #[test]
    fn a_reset_by_rcc_takes_a_timer_back_to_its_first_values() {
        RCC.apb1enr().modify(|w| w.set_tim3en(true));
        TIM3.psc().write_value(7);
        TIM3.arr().write(|w| w.set_arr(99));
        RCC.apb1rstr().write(|w| w.set_tim3rst(true));
        RCC.apb1rstr().write(|w| w.set_tim3rst(false));
        assert_eq!((TIM3.psc().read(), TIM3.arr().read().arr()), (0, 0xffff));
    }
}

#[embedded_test::tests(default_timeout = 10)]
mod timers {
    use super::*;

    #[init]
    fn init() {
        count_cycles();
        RCC.apb1enr().modify(|w| w.set_tim3en(true));
        RCC.ahb1enr().modify(|w| w.set_gpioaen(true));
    }

    #[test]
    fn a_prescaler_of_15_counts_microseconds() {
        TIM3.psc().write_value(15);
        TIM3.egr().write(|w| w.set_ug(true));
        TIM3.cr1().write(|w| w.set_cen(true));
        let cycles = cycles_until(|| TIM3.cnt().read().cnt() >= 1000);
        assert!(cycles.abs_diff(16_000) < 30, "{} cycles in 1 ms", cycles);
    }

    #[test]
    fn one_pulse_ends_with_an_update_and_a_stop() {
        TIM3.arr().write(|w| w.set_arr(1000 - 1));
        TIM3.cr1().write(|w| {
            w.set_opm(true);
            w.set_cen(true);
        });
        let cycles = cycles_until(|| TIM3.sr().read().uif());
        assert!(cycles.abs_diff(1000) < 30, "{} cycles", cycles);
        assert!(!TIM3.cr1().read().cen());
        assert_eq!(TIM3.cnt().read().cnt(), 0);
    }

    #[test]
    fn an_update_interrupts_a_sleeping_core() {
        RCC.apb1enr().modify(|w| w.set_tim5en(true));
        interrupt_every_100_us();
        TIM5.cr1().write(|w| w.set_cen(true));
        while UPDATES.load(Ordering::Relaxed) < 10 {
            cortex_m::asm::wfi();
        }
        let ticks = TIM5.cnt().read();
        assert!(ticks.abs_diff(16_000) < 100, "{} ticks of 16 MHz", ticks);
    }

    /// PWM mode 1: high while the count is below the compare value (section 18.3.9).
    #[test]
    fn a_compare_output_moves_its_pin() {
        GPIOA.afr(0).modify(|w| w.set_afr(6, 2));
        GPIOA.moder().modify(|w| w.set_moder(6, Moder::ALTERNATE));
        TIM3.psc().write_value(159);
        TIM3.arr().write(|w| w.set_arr(999));
        TIM3.ccr(0).write(|w| w.set_ccr(250));
        TIM3.ccmr_output(0)
            .write(|w| w.set_ocm(0, pac::timer::vals::Ocm::PWM_MODE1));
        TIM3.ccer().write(|w| w.set_cce(0, true));
        TIM3.egr().write(|w| w.set_ug(true));
        TIM3.cr1().write(|w| w.set_cen(true));
        for (count, level) in [
            (100, Idr::HIGH),
            (249, Idr::HIGH),
            (251, Idr::LOW),
            (900, Idr::LOW),
        ] {
            while TIM3.cnt().read().cnt() < count {}
            assert!(GPIOA.idr().read().idr(6) == level, "at {}", count);
        }
    }
}

#[embedded_test::tests(default_timeout = 10)]
mod pins {
    use super::*;

    #[init]
    fn init() {
        RCC.ahb1enr().modify(|w| {
            w.set_gpioben(true);
            w.set_gpiocen(true);
        });
    }

    #[test]
    fn a_pull_up_and_a_pull_down_say_the_level_of_an_open_pin() {
        for (pull, level) in [(Pupdr::PULL_UP, Idr::HIGH), (Pupdr::PULL_DOWN, Idr::LOW)] {
            GPIOB.pupdr().modify(|w| w.set_pupdr(5, pull));
            assert!(GPIOB.idr().read().idr(5) == level);
        }
    }

    /// The key is written as 1, 0, 1 and then read (section 8.4.8).
    #[test]
    fn a_locked_pin_keeps_its_mode() {
        for key in [true, false, true] {
            GPIOC.lckr().write(|w| {
                w.set_lck(2, true);
                w.set_lckk(key);
            });
        }
        GPIOC.lckr().read();
        assert!(GPIOC.lckr().read().lckk());
        GPIOC.moder().modify(|w| {
            w.set_moder(2, Moder::OUTPUT);
            w.set_moder(3, Moder::OUTPUT);
        });
        let modes = GPIOC.moder().read();
        assert!(modes.moder(2) == Moder::INPUT && modes.moder(3) == Moder::OUTPUT);
    }

    #[test]
    fn software_raises_a_line_until_it_is_cleared() {
        EXTI.imr(0).write(|w| w.set_line(3, true));
        EXTI.swier(0).write(|w| w.set_line(3, true));
        assert!(EXTI.pr(0).read().line(3) && NVIC::is_pending(Interrupt::EXTI3));
        EXTI.pr(0).write(|w| w.set_line(3, true));
        assert!(!EXTI.pr(0).read().line(3) && !EXTI.swier(0).read().line(3));
    }
}

#[embedded_test::tests(default_timeout = 10)]
mod memories {
    use super::*;
    use pac::dma::vals::{Dir, Dmdis, Size};

    #[init]
    fn init() {
        RCC.ahb1enr().modify(|w| {
            w.set_dma2en(true);
            w.set_crcen(true);
        });
    }

    #[test]
    fn the_dma_copies_words_from_flash_to_memory() {
        // The stack is in core-coupled memory, which the DMA does not reach (memory.x).
        static FROM: [u32; 4] = [1, 2, 0x8000_0000, 0xffff_ffff];
        static TO: [AtomicU32; 4] = [const { AtomicU32::new(0) }; 4];
        let stream = DMA2.st(0);
        stream.par().write_value(FROM.as_ptr().expose_provenance() as u32);
        stream.m0ar().write_value(TO.as_ptr().expose_provenance() as u32);
        stream.ndtr().write(|w| w.set_ndt(4));
        stream.fcr().write(|w| w.set_dmdis(Dmdis::DISABLED));
        stream.cr().write(|w| {
            w.set_dir(Dir::MEMORY_TO_MEMORY);
            w.set_pinc(true);
            w.set_minc(true);
            w.set_psize(Size::BITS32);
            w.set_msize(Size::BITS32);
            w.set_en(true);
        });
        while !DMA2.isr(0).read().tcif(0) {}
        let copied = TO.each_ref().map(|word| word.load(Ordering::Relaxed));
        assert_eq!((copied, stream.ndtr().read().ndt()), (FROM, 0));
    }

    /// The polynomial 0x04C1_1DB7 from all ones, without reflection (section 4.2).
    #[test]
    fn the_checksum_unit_agrees_with_a_division_by_hand() {
        let words = [0x1234_5678_u32, 0, 0xdead_beef];
        CRC.cr().write(|w| w.set_reset(true));
        let mut remainder = u32::MAX;
        for word in words {
            CRC.dr().write_value(word);
            remainder ^= word;
            for _ in 0..32 {
                let carry = remainder >> 31;
                remainder = (remainder << 1) ^ (carry * 0x04c1_1db7);
            }
        }
        assert_eq!(CRC.dr().read(), remainder);
        CRC.idr().write_value(0xa5);
        CRC.cr().write(|w| w.set_reset(true));
        assert_eq!((CRC.dr().read(), CRC.idr().read()), (u32::MAX, 0xa5));
    }

    #[test]
    fn flash_takes_words_that_clear_bits_and_an_erase_sets_them() {
        open_flash();
        program(SECTOR_11, 0x1234_5678);
        program(SECTOR_11, 0xffff_0000);
        assert_eq!(word(SECTOR_11), 0x1234_0000);
        FLASH.cr().modify(|w| {
            w.set_pg(false);
            w.set_ser(true);
            w.set_snb(11);
            w.set_strt(true);
        });
        while FLASH.sr().read().bsy() {}
        assert_eq!(word(SECTOR_11), 0xffff_ffff);
    }
}

/// The last sector of flash, which no program uses.
const SECTOR_11: usize = 0x080e_0000;

/// Unlocks flash for words of 32 bits (section 3.5.1).
fn open_flash() {
    FLASH.keyr().write_value(0x4567_0123);
    FLASH.keyr().write_value(0xcdef_89ab);
    FLASH
        .cr()
        .modify(|w| w.set_psize(pac::flash::vals::Psize::PSIZE32));
}

#[allow(unsafe_code, reason = "a word of flash by its address")]
fn word(address: usize) -> u32 {
    // SAFETY: flash of the part, aligned.
    unsafe { core::ptr::with_exposed_provenance::<u32>(address).read_volatile() }
}

#[allow(unsafe_code, reason = "as above")]
fn program(address: usize, value: u32) {
    FLASH.cr().modify(|w| w.set_pg(true));
    // SAFETY: as above, and no program is in that sector.
    unsafe { core::ptr::with_exposed_provenance_mut::<u32>(address).write_volatile(value) }
    while FLASH.sr().read().bsy() {}
}

#[embedded_test::tests(default_timeout = 10)]
mod converters {
    use super::*;

    #[init]
    fn init() {
        RCC.apb2enr().modify(|w| w.set_adc1en(true));
        RCC.apb1enr().modify(|w| w.set_dacen(true));
        ADC1.cr2().modify(|w| w.set_adon(true));
    }

    /// The code that the factory noted at 3.3 V (VREFIN_CAL) comes back at 3.3 V.
    #[test]
    fn the_internal_reference_has_the_code_of_its_calibration() {
        ADC123_COMMON.ccr().modify(|w| w.set_tsvrefe(true));
        ADC1.sqr3().write(|w| w.set_sq(0, 17));
        ADC1.cr2().modify(|w| w.set_swstart(true));
        while !ADC1.sr().read().eoc() {}
        let (code, calibrated) = (ADC1.dr().read().data(), (word(0x1fff_7a28) >> 16) as u16);
        assert!(code.abs_diff(calibrated) <= 2, "{} and {}", code, calibrated);
        assert!((1450..1560).contains(&code), "1.18 to 1.24 V are {}", code);
    }

    #[test]
    fn a_code_that_nobody_reads_is_an_overrun() {
        ADC1.sqr3().write(|w| w.set_sq(0, 17));
        ADC1.cr2().modify(|w| {
            w.set_eocs(pac::adc::vals::Eocs::EACH_CONVERSION);
            w.set_cont(true);
            w.set_swstart(true);
        });
        while !ADC1.sr().read().ovr() {}
        ADC1.sr().modify(|w| w.set_ovr(false));
        assert!(!ADC1.sr().read().ovr());
    }

    #[test]
    fn an_output_of_the_dac_waits_for_its_trigger() {
        DAC1.cr().modify(|w| {
            w.set_tsel(0, 7);
            w.set_ten(0, true);
            w.set_en(0, true);
        });
        DAC1.dhr12r(0).write(|w| w.set_dhr(1000));
        assert_eq!(DAC1.dor(0).read().dor(), 0);
        DAC1.swtrigr().write(|w| w.set_swtrig(0, true));
        while DAC1.dor(0).read().dor() != 1000 {}
    }
}

#[embedded_test::tests(default_timeout = 10)]
mod ports {
    use super::*;

    #[init]
    fn init() {
        count_cycles();
        RCC.ahb1enr().modify(|w| {
            w.set_gpioaen(true);
            w.set_gpioben(true);
        });
        RCC.apb2enr().modify(|w| w.set_usart1en(true));
        RCC.apb1enr().modify(|w| w.set_i2c1en(true));
    }

    /// 139 clocks of 16 MHz for each of its bits, from start to stop.
    #[test]
    fn a_byte_at_115200_baud_takes_ten_bits() {
        GPIOA.afr(1).modify(|w| w.set_afr(1, 7));
        GPIOA.moder().modify(|w| w.set_moder(9, Moder::ALTERNATE));
        USART1.brr().write(|w| w.set_brr(139));
        USART1.cr1().write(|w| {
            w.set_te(true);
            w.set_ue(true);
        });
        USART1.dr().write(|w| w.set_dr(0x55));
        let cycles = cycles_until(|| USART1.sr().read().tc());
        assert!(cycles.abs_diff(1390) < 30, "{} cycles", cycles);
    }

    #[test]
    fn an_address_without_a_device_is_not_acknowledged() {
        for pin in [8, 9] {
            GPIOB.afr(1).modify(|w| w.set_afr(pin - 8, 4));
            GPIOB
                .otyper()
                .modify(|w| w.set_ot(pin, pac::gpio::vals::Ot::OPEN_DRAIN));
            GPIOB.pupdr().modify(|w| w.set_pupdr(pin, Pupdr::PULL_UP));
            GPIOB.moder().modify(|w| w.set_moder(pin, Moder::ALTERNATE));
        }
        I2C1.cr2().write(|w| w.set_freq(16));
        I2C1.ccr().write(|w| w.set_ccr(80));
        I2C1.trise().write(|w| w.set_trise(17));
        I2C1.cr1().write(|w| w.set_pe(true));
        I2C1.cr1().modify(|w| w.set_start(true));
        while !I2C1.sr1().read().start() {}
        I2C1.dr().write(|w| w.set_dr(0x42 << 1));
        while !I2C1.sr1().read().af() {}
        assert!(!I2C1.sr1().read().addr());
    }
}

#[embedded_test::tests(default_timeout = 10)]
mod resets {
    use super::*;
    use pac::iwdg::vals::Key;

    #[init]
    fn init() {
        RCC.apb1enr().modify(|w| w.set_pwren(true));
        PWR.cr1().modify(|w| w.set_dbp(true));
    }

    /// A backup register and flash survive a reset, but not the runner's restart between two cases.
    fn find_no_mark_and_leave_one() {
        assert!(RCC.csr().read().porrstf());
        assert_eq!((RTC.bkpr(3).read().bkp(), word(SECTOR_11)), (0, u32::MAX));
        RTC.bkpr(3).write(|w| w.set_bkp(0x600d));
        open_flash();
        program(SECTOR_11, 0x600d);
        assert_eq!((RTC.bkpr(3).read().bkp(), word(SECTOR_11)), (0x600d, 0x600d));
    }

    #[test]
    fn a_case_leaves_nothing_to_another() {
        find_no_mark_and_leave_one();
    }

    #[test]
    fn a_case_leaves_nothing_to_another_in_either_order() {
        find_no_mark_and_leave_one();
    }

    #[test]
    fn the_watchdog_resets_the_part_and_the_case_begins_anew() {
        if RCC.csr().read().wdgrstf() {
            assert_eq!(RTC.bkpr(0).read().bkp(), 1);
            return;
        }
        RTC.bkpr(0).write(|w| w.set_bkp(1));
        IWDG.kr().write(|w| w.set_key(Key::ENABLE));
        IWDG.rlr().write(|w| w.set_rl(100));
        IWDG.kr().write(|w| w.set_key(Key::START));
        loop {
            cortex_m::asm::nop();
        }
    }
}

#[embedded_test::tests(default_timeout = 10)]
mod ends {
    use super::*;

    #[test]
    #[should_panic]
    fn a_division_by_a_prescaler_of_zero_panics() {
        RCC.apb1enr().modify(|w| w.set_tim3en(true));
        let divided = 1000 / TIM3.psc().read();
        defmt::info!("divided {}", divided);
    }

    #[test]
    fn a_result_without_an_error_passes() -> Result<(), u32> {
        RCC.apb1enr().modify(|w| w.set_tim3en(true));
        let top = TIM3.arr().read().0;
        (top == 0xffff).then_some(()).ok_or(top)
    }

    /// Runs only on request: shows that a failure is reported.
    #[test]
    #[ignore]
    fn a_wrong_claim_fails() {
        RCC.apb1enr().modify(|w| w.set_tim3en(true));
        assert_eq!(TIM3.arr().read().arr(), 0xfffe, "the timer counts to 65534");
    }

    /// Runs only on request: it never ends, and no hang is found, since interrupts continue.
    #[test]
    #[ignore]
    #[timeout(1)]
    fn a_case_that_goes_on_meets_its_limit() {
        interrupt_every_100_us();
        loop {
            cortex_m::asm::wfi();
        }
    }
}
