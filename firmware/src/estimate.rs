//! The strike meter over blocks of scans; its results become frames.
//!
//! # Design
//! `bead-model` does the work, at the middle priority: acquisition interrupts it, telemetry waits for it.
//! There are 2 ms for a block. The channel holds [`BLOCKS`], so a burst of work may take [`BLOCKS`] times as
//! long before a block is lost.

use core::sync::atomic::{AtomicBool, Ordering};

use bead_model::sensor::GainMatch;
use bead_model::{Chunk, Meter, Settings, Sink, StrikeReport};
use bead_wire::{FaultCause, Message, Strike};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::zerocopy_channel::Receiver;

use crate::block::Block;
use crate::counters;
use crate::health::Watch;
use crate::outbox::{self, Record};
use crate::{raw, report, settings};

/// Blocks between acquisition and estimation: 8 ms.
pub(crate) const BLOCKS: usize = 4;

/// Whether the meter is to look for strikes.
static ARMED: AtomicBool = AtomicBool::new(true);

/// Switches the search for strikes on or off, from the next block on. A strike that is being measured is
/// finished first.
pub(crate) fn arm(armed: bool) {
    ARMED.store(armed, Ordering::Relaxed);
}

/// Measures strikes for ever. `settings` hold until others are offered.
#[embassy_executor::task]
pub(crate) async fn estimate(
    mut settings: Settings,
    meter: &'static mut Meter,
    mut blocks: Receiver<'static, CriticalSectionRawMutex, Block>,
) -> ! {
    let mut epoch = 0;
    let mut watch = Watch::new();
    let mut armed = true;
    loop {
        let block = blocks.receive().await;
        if block.epoch != epoch {
            epoch = block.epoch;
            let cut = meter.is_measuring();
            meter.restart();
            if cut {
                counters::update(|c| c.health.strikes_cut += 1);
                report::fault(FaultCause::StrikeCut, "samples of its window were lost");
            }
        }
        if !meter.is_measuring() {
            let before = armed;
            armed = ARMED.load(Ordering::Relaxed);
            if let Some(new) = settings::take() {
                settings = new;
                meter.restart();
            } else if armed && !before {
                meter.restart();
            }
        }
        if armed {
            process_block(&settings, meter, block);
        }
        watch.look(block);
        raw::offer(block);
        blocks.receive_done();
        counters::update(|c| {
            c.blocks_estimated = c.blocks_estimated.wrapping_add(1);
            c.strikes = meter.strikes();
            c.armed = armed && meter.is_armed();
        });
    }
}

/// Runs the meter over a block. The deadline is 2 ms a block on average, which is 1680 core clocks a sample.
///
/// Never inlined, so that its instructions can be counted by its symbol.
#[inline(never)]
fn process_block(settings: &Settings, meter: &mut Meter, block: &Block) {
    meter.process(settings, block.first_index, block.scans(), &mut Telemetry);
}

/// Sends what the meter finds.
struct Telemetry;

impl Sink for Telemetry {
    fn chunk(&mut self, chunk: &Chunk) {
        outbox::push(Record::Waveform(chunk.clone()));
    }

    fn report(&mut self, report: &StrikeReport) {
        defmt::info!(
            "strike {=u32} at sample {=u64}: peak {=i32} mN, absorbed {=i64} nJ measured, {=i64} nJ predicted, flags {=u16:#06x}",
            report.strike,
            report.trigger_index,
            (report.peak_force * 1000).to_num(),
            report.absorbed_measured.to_num(),
            report.absorbed_predicted.to_num(),
            report.flags.bits(),
        );
        outbox::push(Record::Message(Message::Strike(Strike {
            strike: report.strike,
            first_index: report.first_index,
            trigger_index: report.trigger_index,
            samples: report.samples,
            peak_force: report.peak_force.to_bits(),
            peak_index: report.peak_index,
            acceleration_max: report.acceleration_max.to_bits(),
            acceleration_min: report.acceleration_min.to_bits(),
            absorbed_measured: report.absorbed_measured.to_bits(),
            absorbed_predicted: report.absorbed_predicted.to_bits(),
            incident_energy: report.incident_energy.to_bits(),
            absorbed_fraction: report.absorbed_fraction.to_bits(),
            noise_energy: report.noise_energy.to_bits(),
            force_noise: report.force_noise.to_bits(),
            flags: report.flags.bits()
                | match counters::snapshot().health.standing {
                    0 => 0,
                    _ => Strike::SENSOR_FAULT,
                },
        })));
        let shape = &report.shape;
        let gains = |gains: GainMatch| bead_wire::GainMatch {
            deviation: gains.deviation.to_bits(),
            uncertainty: gains.uncertainty.to_bits(),
        };
        outbox::push(Record::Message(Message::Shape(bead_wire::Shape {
            strike: report.strike,
            first_index: report.first_index,
            arrival: shape.arrival.to_bits(),
            width: shape.width.to_bits(),
            impulse: shape.impulse.to_bits(),
            ring_frequency: shape.ring_frequency.to_bits(),
            ring_decay: shape.ring_decay.to_bits(),
            force_gains: shape.force_gains.map(gains),
            acceleration_gains: shape.acceleration_gains.map(gains),
        })));
    }
}
