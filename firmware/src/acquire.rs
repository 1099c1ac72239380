//! From the converter to blocks of scans with an index.
//!
//! # Design
//! The [`Converter`] makes a scan at each trigger of the [`SampleClock`] and puts the codes into blocks. The
//! core is interrupted once a block, never once a sample. It has to give the converter another block before
//! the next is full: within [`SCANS_PER_BLOCK`] sample periods, 2 ms. So this task has the highest priority,
//! and only passes blocks on. The estimators give each back when they have taken its scans.
//!
//! # The index
//! The index of a scan is the number of its trigger. It is not assumed but counted: whenever a block is full,
//! the scans since the start are compared with the triggers since then. At the first block of an epoch a
//! difference is corrected and reported. A later difference ends the epoch.
//!
//! # Errors
//! When the ADC overruns, it stops its DMA requests, and no block comes any more: a deadline finds this. ADC
//! and DMA are then set up anew, as RM0090 section 13.8.1 asks, by the same code as at start-up. Each start
//! begins a new epoch, and so does each run of blocks that estimation had no room for. The indices of an
//! epoch are consecutive.

use embassy_stm32::adc::Adc;
use embassy_time::{Duration, with_timeout};

use bead_app::{BLOCK_US, BlockCodes, SCANS_PER_BLOCK, ScanBlock};
use bead_wire::FaultCause;

use crate::board::BEAD;
use crate::converter::{Converter, Lost, Scanning};
use crate::handover;
use crate::sample_clock::SampleClock;

/// Five blocks: much more than any delay of a running acquisition, and few samples lost if it has stopped.
const DEADLINE: Duration = Duration::from_micros(5 * BLOCK_US as u64);

/// Acquires for ever, epoch after epoch.
#[embassy_executor::task]
pub(crate) async fn acquire(mut converter: Converter, mut clock: SampleClock) -> ! {
    const TWO: &str = "there are blocks for the converter alone";
    let mut outlet = Outlet {
        filling: handover::free().expect(TWO),
        next: handover::free().expect(TWO),
        epoch: 0,
        losing: false,
    };
    loop {
        let lost = epoch(&mut converter, &mut clock, &mut outlet).await;
        outlet.epoch += 1;
        BEAD.update(|c| {
            c.overruns += 1;
            c.epoch = outlet.epoch;
        });
        BEAD.fault(FaultCause::AdcOverrun, lost);
    }
}

/// Acquires until samples are lost. Returns why.
async fn epoch(converter: &mut Converter, clock: &mut SampleClock, outlet: &mut Outlet) -> &'static str {
    let (adc, channels) = converter.parts();
    let mut scanning = Scanning::begin(Adc::new(adc), channels, outlet.filling, outlet.next);
    let lost = scan(&mut scanning, clock, outlet).await;
    // Closed before the converter is turned off, so that no trigger finds it half taken down.
    clock.close();
    lost
}

/// Passes on the blocks of an epoch until samples are lost. Returns why.
async fn scan(scanning: &mut Scanning<'_>, clock: &mut SampleClock, outlet: &mut Outlet) -> &'static str {
    const LATE: &str = "a block was not taken in time";
    let mut index = clock.open() + 1;
    defmt::info!("acquiring from sample {=u64}, epoch {=u32}", index, outlet.epoch);

    let mut first = true;
    loop {
        match with_timeout(DEADLINE, scanning.filled()).await {
            Ok(Ok(())) => {}
            Ok(Err(Lost)) => return LATE,
            Err(_) if scanning.overran() => return "the ADC overran",
            Err(_) => return "the ADC fell silent",
        }
        // Index of the first scan of this block, from the numbers of triggers and scans so far.
        let count = || clock.between_scans(|triggers| (triggers + 1).saturating_sub(scanning.waiting()));
        let mut counted = count();
        while first && counted.is_none() {
            counted = count();
        }
        if let Some(counted) = counted.filter(|&counted| counted != index) {
            if !first {
                return "there were more or fewer scans than triggers";
            }
            index = counted;
            BEAD.fault(
                FaultCause::IndexCorrected,
                "the start made more or fewer scans than there were triggers",
            );
        }
        first = false;
        let next = handover::free();
        if scanning.take(next).is_err() {
            // The stream did not take the block.
            next.into_iter().for_each(handover::give_back);
            return LATE;
        }
        outlet.pass_on(index, next);
        index += SCANS_PER_BLOCK as u64;
    }
}

/// Passes blocks to the estimators. Acquisition never waits for them.
struct Outlet {
    /// The block that the converter fills.
    filling: &'static BlockCodes,
    /// The block that it fills after that.
    next: &'static BlockCodes,
    epoch: u32,
    /// True if the block before this one was lost.
    losing: bool,
}

impl Outlet {
    /// Hands on the full block, whose first scan has this index. The converter goes on with `next`. If the
    /// estimators have given back no block, the converter fills this one once more: its scans are lost, and
    /// counted.
    fn pass_on(&mut self, first_index: u64, next: Option<&'static BlockCodes>) {
        let full = core::mem::replace(&mut self.filling, self.next);
        self.next = next.unwrap_or(full);
        let taken = next.is_some();
        if taken {
            handover::hand_on(ScanBlock {
                epoch: self.epoch,
                first_index,
                codes: full,
            });
        } else {
            self.epoch += u32::from(!self.losing);
        }
        BEAD.update(|c| {
            c.newest_index = first_index + SCANS_PER_BLOCK as u64 - 1;
            c.samples += SCANS_PER_BLOCK as u64;
            c.blocks_handed_on = c.blocks_handed_on.wrapping_add(u32::from(taken));
            c.blocks_dropped += u32::from(!taken);
            c.epoch = self.epoch;
        });
        if !taken && !self.losing {
            BEAD.fault(FaultCause::BlockLost, "the estimators fell behind");
        }
        self.losing = !taken;
    }
}
