//! From the converter to blocks of scans with an index.
//!
//! # Design
//! Each trigger of the [`SampleClock`] makes ADC1 convert four channels: each sensor at its high and at its
//! low gain. DMA2 puts the codes into a ring of two blocks. The core is interrupted once a block, never once
//! a sample. It has to take a block before the next is full: within [`SCANS_PER_BLOCK`] sample periods, 2 ms.
//! So this task has the highest priority, and only copies a block out of the ring, by the driver.
//!
//! # Timing
//! A conversion takes [`SAMPLE_TIME`] plus 12 ADC clocks (RM0090 section 13.5), 27 clocks at 21 MHz. All four
//! take 5.14 µs of the period of 10 µs, and each is sampled [`CONVERSION_NS`] after the one before. A longer
//! sample time means more skew. 15 clocks settle to a quarter of a code through up to 11.8 kΩ (DocID022152,
//! equation 1: 14.5 / (21 MHz · 4 pF · ln 2^14) - 6 kΩ). The amplifiers that drive the pins, with their RC
//! filters, are well below 1 kΩ.
//!
//! # Errors
//! When the ADC overruns, it stops its DMA requests, and the driver's `read` never returns: a deadline finds
//! this. ADC and DMA are then set up anew, as RM0090 section 13.8.1 asks, by the same code as at start-up.
//! Each start begins a new epoch, and so does each run of blocks that estimation had no room for. The indices
//! of an epoch are consecutive.

use embassy_stm32::adc::{Adc, AdcChannel, SampleTime};
use embassy_stm32::pac::{ADC1, adc::vals::Exten};
use embassy_stm32::triggers::TIM3_TRGO;
use embassy_stm32::{Peri, bind_interrupts, dma, peripherals};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::zerocopy_channel::Sender;
use embassy_time::{Duration, with_timeout};

use bead_wire::FaultCause;

use crate::block::{BLOCK_US, Block, CHANNELS, CODES, SCANS_PER_BLOCK};
use crate::clocks::ADC_HZ;
use crate::counters;
use crate::report;
use crate::sample_clock::{SAMPLE_RATE_HZ, SampleClock};
use crate::supply;

bind_interrupts!(struct Irqs {
    DMA2_STREAM0 => dma::InterruptHandler<peripherals::DMA2_CH0>;
});

/// How long a channel is connected to the sampling capacitor.
const SAMPLE_TIME: SampleTime = SampleTime::CYCLES15;
/// One conversion, 1285 ns.
pub(crate) const CONVERSION_NS: u32 = ((15 + 12) * 1_000_000_000u64 / ADC_HZ as u64) as u32;
const _: () = assert!(
    (CHANNELS as u64) * (CONVERSION_NS as u64) < 600_000_000 / SAMPLE_RATE_HZ as u64,
    "a scan fits in six tenths of a period, as SampleClock::open counts on"
);

/// Five blocks: much more than any delay of a running acquisition, and few samples lost if it has stopped.
const DEADLINE: Duration = Duration::from_micros(5 * BLOCK_US as u64);

/// The memory that the DMA fills round and round: two blocks.
pub(crate) type Ring = [u16; 2 * CODES];

/// The converter, its pins and its DMA stream.
pub(crate) struct Inputs {
    pub(crate) adc: Peri<'static, peripherals::ADC1>,
    pub(crate) dma: Peri<'static, peripherals::DMA2_CH0>,
    pub(crate) force: Peri<'static, peripherals::PA0>,
    pub(crate) force_wide: Peri<'static, peripherals::PA1>,
    pub(crate) acceleration: Peri<'static, peripherals::PA2>,
    pub(crate) acceleration_wide: Peri<'static, peripherals::PA3>,
}

/// Acquires for ever, epoch after epoch.
#[embassy_executor::task]
pub(crate) async fn acquire(
    mut inputs: Inputs,
    mut clock: SampleClock,
    ring: &'static mut Ring,
    spill: &'static mut [u16; CODES],
    blocks: Sender<'static, CriticalSectionRawMutex, Block>,
) -> ! {
    let mut outlet = Outlet {
        blocks,
        spill,
        spilling: false,
        epoch: 0,
        losing: false,
    };
    loop {
        let lost = epoch(&mut inputs, &mut clock, ring, &mut outlet).await;
        clock.close();
        outlet.epoch += 1;
        counters::update(|c| {
            c.overruns += 1;
            c.epoch = outlet.epoch;
        });
        report::fault(FaultCause::AdcOverrun, lost);
    }
}

/// Acquires until samples are lost. Returns why.
async fn epoch(
    inputs: &mut Inputs,
    clock: &mut SampleClock,
    ring: &mut Ring,
    outlet: &mut Outlet,
) -> &'static str {
    let mut adc = Adc::new(inputs.adc.reborrow());
    supply::measure(&mut adc);
    let mut adc = adc.into_ring_buffered(
        inputs.dma.reborrow(),
        ring,
        Irqs,
        [
            inputs.force.reborrow().degrade_adc(),
            inputs.force_wide.reborrow().degrade_adc(),
            inputs.acceleration.reborrow().degrade_adc(),
            inputs.acceleration_wide.reborrow().degrade_adc(),
        ]
        .map(|pin| (pin, SAMPLE_TIME))
        .into_iter(),
        TIM3_TRGO,
        Exten::RISING_EDGE,
    );
    // `start` also starts a scan by software, and does not wait for the ADC to stabilise. This first scan of
    // an epoch gets the index of the trigger before it, and is over when the next trigger comes. Only a meter
    // that is not armed sees it.
    adc.start();
    let mut first_index = clock.open();
    defmt::info!(
        "acquiring from sample {=u64}, epoch {=u32}",
        first_index,
        outlet.epoch
    );

    loop {
        match with_timeout(DEADLINE, adc.read(outlet.room())).await {
            Ok(Ok(_)) => {
                outlet.hand_on(first_index);
                first_index += SCANS_PER_BLOCK as u64;
            }
            Ok(Err(_)) => return "the ring was not emptied in time",
            Err(_) if ADC1.sr().read().ovr() => return "the ADC overran",
            Err(_) => return "the ADC fell silent",
        }
    }
}

/// The way of the blocks to the estimators. Acquisition never waits for them.
struct Outlet {
    blocks: Sender<'static, CriticalSectionRawMutex, Block>,
    /// Room for a block that the estimators have no room for: its codes are lost.
    spill: &'static mut [u16; CODES],
    /// Whether the block that is being filled goes to `spill`.
    spilling: bool,
    epoch: u32,
    /// Whether the block before this one was lost.
    losing: bool,
}

impl Outlet {
    /// Room for the codes of a block: in the next block, or in `spill` if the estimators have fallen behind.
    fn room(&mut self) -> &mut [u16; CODES] {
        self.spilling = self.blocks.try_send().is_none();
        match self.blocks.try_send() {
            Some(block) => &mut block.codes,
            None => self.spill,
        }
    }

    /// Hands on the block whose codes are in [`room`](Self::room), or counts it as lost.
    fn hand_on(&mut self, first_index: u64) {
        let taken = match self.blocks.try_send() {
            Some(block) if !self.spilling => {
                block.epoch = self.epoch;
                block.first_index = first_index;
                self.blocks.send_done();
                true
            }
            _ => {
                self.epoch += u32::from(!self.losing);
                false
            }
        };
        counters::update(|c| {
            c.newest_index = first_index + SCANS_PER_BLOCK as u64 - 1;
            c.samples += SCANS_PER_BLOCK as u64;
            c.blocks_handed_on = c.blocks_handed_on.wrapping_add(u32::from(taken));
            c.blocks_dropped += u32::from(!taken);
            c.epoch = self.epoch;
        });
        if !taken && !self.losing {
            report::fault(FaultCause::BlockLost, "the estimators fell behind");
        }
        self.losing = !taken;
    }
}
