//! ADC3 and its DMA stream: scans at each trigger, straight into blocks. All three converters have the four
//! pins. Only ADC1 has the reference voltage and the temperature sensor, and is left to them: see
//! [`supply`](crate::supply).
//!
//! # Design
//! DMA2's stream 0 fills two blocks in turn (double-buffer mode, RM0090 section 10.3.9). While it fills one,
//! the core sets the address of the next one. So nothing is copied, and the core has the time of a block to
//! do so.
//!
//! Only the trigger starts scans. A software start while a trigger is selected is never used: the manual
//! leaves open what it does, and the sample index would depend on it.
//!
//! # Timing
//! A conversion takes [`SAMPLE_TIME`] plus 12 ADC clocks (RM0090 section 13.5), 27 clocks at 21 MHz. All four
//! take 5.14 µs of the period of 10 µs, and each is sampled [`CONVERSION_NS`] after the one before. A longer
//! sample time means more skew. 15 clocks settle to a quarter of a code through up to 11.8 kΩ (DocID022152,
//! equation 1: 14.5 / (21 MHz · 4 pF · ln 2^14) - 6 kΩ). The amplifiers that drive the pins, with their RC
//! filters, are well below 1 kΩ.

use core::future::poll_fn;
use core::sync::atomic::{AtomicU32, Ordering, fence};
use core::task::Poll;

use bead_app::{BlockCodes, CHANNELS, SAMPLE_RATE_HZ, SCANS_PER_BLOCK};
use bead_model::converter::{ADC_CLOCK_HZ, CONVERSION_CYCLES, SAMPLE_CYCLES};
use embassy_stm32::adc::{Adc, AdcChannel, AnyAdcChannel, SampleTime};
use embassy_stm32::pac::adc::vals::{Dds, Exten};
use embassy_stm32::pac::dma::vals::{Ct, Dir, Pl, Size};
use embassy_stm32::pac::{ADC3, DMA2};
use embassy_stm32::{Peri, peripherals};
use embassy_sync::waitqueue::AtomicWaker;

/// Codes in a block.
const CODES: usize = CHANNELS * SCANS_PER_BLOCK;
/// Time that a channel is connected to the sampling capacitor.
const SAMPLE_TIME: SampleTime = SampleTime::CYCLES15;
const _: () = assert!(SAMPLE_CYCLES == 15, "the settings reckon with the sample time");
/// One conversion, 1285 ns.
pub(crate) const CONVERSION_NS: u32 =
    ((SAMPLE_CYCLES + CONVERSION_CYCLES) as u64 * 1_000_000_000 / ADC_CLOCK_HZ as u64) as u32;
const _: () = assert!(
    (CHANNELS as u64) * (CONVERSION_NS as u64) < 600_000_000 / SAMPLE_RATE_HZ as u64,
    "a scan fits in six tenths of a period, as SampleClock counts on"
);

/// ADC3's stream, and its channel there (RM0090 table 43).
const STREAM: usize = 0;
const REQUEST: u8 = 2;
/// TIM3_TRGO as trigger of regular scans (RM0090 section 13.13.3, EXTSEL).
const TIM3_TRGO: u8 = 0b1000;
/// Least number of codes that the stream still has to take when the core gives it an address: two scans.
const MARGIN: u16 = 2 * CHANNELS as u16;

/// Blocks that the stream has filled since it was started.
static FILLED: AtomicU32 = AtomicU32::new(0);
static WAKER: AtomicWaker = AtomicWaker::new();

/// The converter, its pins and its DMA stream.
pub(crate) struct Converter {
    adc: Peri<'static, peripherals::ADC3>,
    _stream: Peri<'static, peripherals::DMA2_CH0>,
    /// In the order of their conversion.
    channels: Channels,
}

type Channels = [AnyAdcChannel<'static, peripherals::ADC3>; CHANNELS];

/// The core did not give the stream its next block in time.
pub(crate) struct Lost;

impl Converter {
    /// The converter at rest. The pins are those of force at the high and the low gain, then acceleration.
    pub(crate) fn new(
        adc: Peri<'static, peripherals::ADC3>,
        stream: Peri<'static, peripherals::DMA2_CH0>,
        force: Peri<'static, peripherals::PA0>,
        force_wide: Peri<'static, peripherals::PA1>,
        acceleration: Peri<'static, peripherals::PA2>,
        acceleration_wide: Peri<'static, peripherals::PA3>,
    ) -> Self {
        Self {
            adc,
            _stream: stream,
            channels: [
                force.degrade_adc(),
                force_wide.degrade_adc(),
                acceleration.degrade_adc(),
                acceleration_wide.degrade_adc(),
            ],
        }
    }

    /// The converter for the time of an epoch, and its channels.
    pub(crate) fn parts(&mut self) -> (Peri<'_, peripherals::ADC3>, &Channels) {
        (self.adc.reborrow(), &self.channels)
    }
}

/// Makes a scan at each trigger, until it is dropped.
pub(crate) struct Scanning<'a> {
    _adc: Adc<'a, peripherals::ADC3>,
    /// Blocks that were taken.
    taken: u32,
}

impl<'a> Scanning<'a> {
    /// Sets up stream and converter. The scans go to `first`, then to `second`.
    pub(crate) fn begin(
        adc: Adc<'a, peripherals::ADC3>,
        channels: &Channels,
        first: &'static BlockCodes,
        second: &'static BlockCodes,
    ) -> Self {
        let stream = DMA2.st(STREAM);
        stop_stream();
        FILLED.store(0, Ordering::Relaxed);
        stream.par().write_value(ADC3.dr().as_ptr() as u32);
        stream.m0ar().write_value(address(first));
        stream.m1ar().write_value(address(second));
        stream.ndtr().write(|w| w.set_ndt(CODES as u16));
        // Direct mode: no FIFO.
        stream.fcr().write(|_| {});
        stream.cr().write(|w| {
            w.set_chsel(REQUEST);
            w.set_dir(Dir::PERIPHERAL_TO_MEMORY);
            w.set_psize(Size::BITS16);
            w.set_msize(Size::BITS16);
            w.set_minc(true);
            w.set_circ(true);
            w.set_dbm(true);
            w.set_ct(Ct::MEMORY0);
            w.set_pl(Pl::VERY_HIGH);
            w.set_tcie(true);
            w.set_teie(true);
        });
        // The core's reads from these blocks end before the stream writes to them.
        fence(Ordering::SeqCst);
        stream.cr().modify(|w| w.set_en(true));

        for (rank, channel) in channels.iter().enumerate() {
            let number = channel.get_hw_channel();
            ADC3.sqr3().modify(|w| w.set_sq(rank, number));
            ADC3.smpr2().modify(|w| w.set_smp(number.into(), SAMPLE_TIME));
        }
        ADC3.sqr1().modify(|w| w.set_l(CHANNELS as u8 - 1));
        ADC3.sr().write(|_| {});
        ADC3.cr1().modify(|w| w.set_scan(true));
        ADC3.cr2().modify(|w| {
            w.set_dma(true);
            w.set_dds(Dds::CONTINUOUS);
            w.set_extsel(TIM3_TRGO);
            w.set_exten(Exten::RISING_EDGE);
        });
        Self { _adc: adc, taken: 0 }
    }

    /// Waits for the next block to be full.
    pub(crate) async fn filled(&self) -> Result<(), Lost> {
        poll_fn(|cx| {
            WAKER.register(cx.waker());
            match FILLED.load(Ordering::Acquire).wrapping_sub(self.taken) {
                0 => Poll::Pending,
                1 => Poll::Ready(Ok(())),
                _ => Poll::Ready(Err(Lost)),
            }
        })
        .await
    }

    /// Takes the block that is full. The stream goes on to `next` when the one that it fills now is full.
    /// Without `next`, the block that is full is filled again.
    pub(crate) fn take(&mut self, next: Option<&'static BlockCodes>) -> Result<(), Lost> {
        let Some(next) = next else {
            self.taken += 1;
            return Ok(());
        };
        fence(Ordering::SeqCst);
        let stream = DMA2.st(STREAM);
        critical_section::with(|_| {
            // An address may change only while the stream uses the other (RM0090 section 10.3.9). A block
            // that ended just now is not counted, since its interrupt waits, but the stream has gone on to
            // the other address. The stream's flag shows this, and is read last. If no block has ended by
            // then, there is MARGIN left.
            let left = stream.ndtr().read().ndt();
            let used = stream.cr().read().ct();
            let ended = DMA2.isr(STREAM / 4).read().tcif(STREAM % 4);
            if left < MARGIN || ended || FILLED.load(Ordering::Relaxed) != self.taken + 1 {
                return Err(Lost);
            }
            match used {
                Ct::MEMORY0 => stream.m1ar().write_value(address(next)),
                Ct::MEMORY1 => stream.m0ar().write_value(address(next)),
            }
            self.taken += 1;
            Ok(())
        })
    }

    /// Number of scans since the end of the last block that was taken. Called between two scans.
    pub(crate) fn waiting(&self) -> u64 {
        let left = u32::from(DMA2.st(STREAM).ndtr().read().ndt());
        let blocks = FILLED.load(Ordering::Relaxed).wrapping_sub(self.taken) + 1;
        ((blocks * CODES as u32 - left) / CHANNELS as u32).into()
    }

    /// Returns `true` if the converter has lost a conversion (RM0090 section 13.8.1).
    pub(crate) fn overran(&self) -> bool {
        ADC3.sr().read().ovr()
    }
}

impl Drop for Scanning<'_> {
    /// Stops the stream. The driver stops the converter.
    fn drop(&mut self) {
        stop_stream();
    }
}

/// Address at which the DMA writes the codes of a block.
fn address(codes: &'static BlockCodes) -> u32 {
    codes.0.as_ptr().expose_provenance() as u32
}

/// Stops the stream, and clears its flags (RM0090 sections 10.3.14 and 10.3.17).
fn stop_stream() {
    let stream = DMA2.st(STREAM);
    stream.cr().modify(|w| w.set_en(false));
    // A transfer that has begun is finished: some clocks.
    while stream.cr().read().en() {}
    DMA2.ifcr(STREAM / 4).write(|w| {
        w.set_feif(STREAM % 4, true);
        w.set_dmeif(STREAM % 4, true);
        w.set_teif(STREAM % 4, true);
        w.set_htif(STREAM % 4, true);
        w.set_tcif(STREAM % 4, true);
    });
}

/// The stream's interrupt: a block is full, or the bus failed.
pub(crate) fn on_interrupt() {
    let flags = DMA2.isr(STREAM / 4).read();
    assert!(!flags.teif(STREAM % 4), "DMA: error on the converter's stream");
    if flags.tcif(STREAM % 4) {
        DMA2.ifcr(STREAM / 4).write(|w| w.set_tcif(STREAM % 4, true));
        // The only writer while the stream runs.
        FILLED.store(FILLED.load(Ordering::Relaxed).wrapping_add(1), Ordering::Release);
        WAKER.wake();
    }
}
