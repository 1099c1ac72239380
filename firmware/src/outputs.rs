//! The two digital-to-analog converters, by which a bead on a bench plays to its own inputs.
//!
//! # Design
//! TIM6 runs at the sample rate. At each of its updates, DMA1's stream 5 fetches a word with the codes of
//! both outputs (RM0090 section 14.4). The outputs change when the four conversions of a scan are over, and
//! have the rest of the period, 4.5 µs, to settle. That takes 3 µs as a rule (DocID022152, DAC
//! characteristics), and a strike moves by a twentieth of the range at most.
//!
//! The buffers are on: they drive a wire and a divider, and reach from 0.2 V to 0.2 V below the supply.
//! Without them an output has 15 kΩ, and an input would not settle in its sample time.
//!
//! All of it is off, clocks included, except during a request.

use core::sync::atomic::{AtomicU32, Ordering, fence};

use bead_app::CLOCKS_PER_SAMPLE;
use bead_model::made_up::PLAYED;
use bead_wire::unwrapped;
use embassy_stm32::pac::dma::vals::{Dir, Size};
use embassy_stm32::pac::gpio::vals::Moder;
use embassy_stm32::pac::timer::vals::Mms;
use embassy_stm32::pac::{DAC1, DMA1, GPIOA, RCC, TIM2, TIM3, TIM6};
use embassy_stm32::{Peri, peripherals};

/// The stream of channel 1's requests, and its channel there (RM0090 table 42).
const STREAM: usize = 5;
const REQUEST: u8 = 7;
/// TIM6_TRGO as trigger (RM0090 section 14.5.1, TSEL).
const TIM6_TRGO: u8 = 0b000;

const PERIOD: u32 = CLOCKS_PER_SAMPLE as u32;
/// Count of TIM3 at which the outputs change: 5.5 µs after the trigger of a scan, which takes 5.14 µs.
const PHASE: u32 = PERIOD * 55 / 100;
/// Counts at which TIM6 may be started: its first update comes in the same period.
const CALM: core::ops::RangeInclusive<u32> = PERIOD / 10..=PERIOD * 4 / 10;

/// The codes to play. In SRAM: the DMA does not reach the core-coupled memory.
static WORDS: [AtomicU32; PLAYED] = [const { AtomicU32::new(0) }; PLAYED];

/// Takes the pins and peripherals, so that nothing else has them.
pub(crate) fn claim(
    _outputs: Peri<'static, peripherals::DAC1>,
    _timer: Peri<'static, peripherals::TIM6>,
    _stream: Peri<'static, peripherals::DMA1_CH5>,
    _force: Peri<'static, peripherals::PA4>,
    _acceleration: Peri<'static, peripherals::PA5>,
) {
}

/// Both codes as a word of DHR12RD.
fn word([force, acceleration]: [u16; 2]) -> u32 {
    u32::from(force) | u32::from(acceleration) << 16
}

fn write(word: u32) {
    DAC1.dhr12rd()
        .write_value(embassy_stm32::pac::dac::regs::Dhr12rd(word));
}

/// Puts these codes on the outputs, or switches them off.
pub(crate) fn hold(codes: Option<[u16; 2]>) {
    let clocks = |on: bool| {
        critical_section::with(|_| {
            RCC.apb1enr().modify(|w| {
                w.set_dacen(on);
                w.set_tim6en(on);
            });
            // As in `supply::wait`.
            let _ = RCC.apb1enr().read();
        });
    };
    let Some(codes) = codes else {
        let reset = |now: bool| {
            critical_section::with(|_| {
                RCC.apb1rstr().modify(|w| {
                    w.set_dacrst(now);
                    w.set_tim6rst(now);
                });
            });
        };
        reset(true);
        reset(false);
        clocks(false);
        return;
    };
    clocks(true);
    critical_section::with(|_| {
        RCC.ahb1enr().modify(|w| w.set_dma1en(true));
        GPIOA.moder().modify(|w| {
            w.set_moder(4, Moder::ANALOG);
            w.set_moder(5, Moder::ANALOG);
        });
    });
    write(word(codes));
    DAC1.cr().write(|w| {
        w.set_en(0, true);
        w.set_en(1, true);
    });
}

/// Starts playing codes within the next scans. Returns the index of the first scan that samples the first
/// pair; `about` is the index of a scan within the last seconds.
pub(crate) fn play(codes: impl Iterator<Item = [u16; 2]>, about: u64) -> u64 {
    let mut count = 0;
    for (place, codes) in WORDS.iter().zip(codes) {
        place.store(word(codes), Ordering::Relaxed);
        count += 1;
    }
    let stream = DMA1.st(STREAM);
    clear_flags();
    stream.par().write_value(DAC1.dhr12rd().as_ptr() as u32);
    stream
        .m0ar()
        .write_value(WORDS.as_ptr().expose_provenance() as u32);
    stream.ndtr().write(|w| w.set_ndt(count));
    stream.fcr().write(|_| {});
    stream.cr().write(|w| {
        w.set_chsel(REQUEST);
        w.set_dir(Dir::MEMORY_TO_PERIPHERAL);
        w.set_psize(Size::BITS32);
        w.set_msize(Size::BITS32);
        w.set_minc(true);
    });
    fence(Ordering::SeqCst);
    stream.cr().modify(|w| w.set_en(true));
    DAC1.cr().write(|w| {
        for channel in 0..2 {
            w.set_en(channel, true);
            w.set_ten(channel, true);
            w.set_tsel(channel, TIM6_TRGO);
        }
        w.set_dmaen(0, true);
    });
    TIM6.arr().write(|w| w.set_arr(PERIOD as u16 - 1));
    TIM6.cr2().write(|w| w.set_mms(Mms::UPDATE));
    loop {
        let started = critical_section::with(|_| {
            let phase = u32::from(TIM3.cnt().read().cnt());
            if !CALM.contains(&phase) {
                return None;
            }
            TIM6.cnt().write(|w| w.set_cnt((PERIOD + phase - PHASE) as u16));
            TIM6.cr1().write(|w| w.set_cen(true));
            Some(TIM2.cnt().read())
        });
        if let Some(count) = started {
            // TIM2 counts from the trigger of index 1. The first update converts the held codes and fetches
            // the first word, the second puts that word on the outputs, and the scan after it samples the
            // word.
            let clocks = unwrapped(count, about * u64::from(PERIOD));
            return clocks / u64::from(PERIOD) + 1 + 2;
        }
    }
}

/// Stops playing, and returns `true` if all was played. The last codes stay on the outputs.
pub(crate) fn end_play() -> bool {
    TIM6.cr1().write(|_| {});
    let flags = DMA1.isr(STREAM / 4).read();
    let complete = flags.tcif(STREAM % 4) && !flags.teif(STREAM % 4);
    let stream = DMA1.st(STREAM);
    stream.cr().modify(|w| w.set_en(false));
    while stream.cr().read().en() {}
    clear_flags();
    // The converter's request after the last word was not served, which set a flag. Writing a one clears it
    // (RM0090 sections 14.3.7 and 14.5.14).
    DAC1.cr().modify(|w| w.set_dmaen(0, false));
    DAC1.sr().modify(|_| {});
    complete
}

fn clear_flags() {
    DMA1.ifcr(STREAM / 4).write(|w| {
        w.set_feif(STREAM % 4, true);
        w.set_dmeif(STREAM % 4, true);
        w.set_teif(STREAM % 4, true);
        w.set_htif(STREAM % 4, true);
        w.set_tcif(STREAM % 4, true);
    });
}
