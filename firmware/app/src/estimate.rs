//! The strike meter over blocks of scans; its results become frames.
//!
//! # Design
//! `bead-model` does the work. There are 2 ms for a block. Up to four blocks may be under way, so a burst of
//! work may take four times as long before a block is lost.

use bead_model::{Chunk, Meter, Origin, Settings, Sink};
use bead_wire::{Conditions, FaultCause, Gap, Packed, Shape, Standing, Strike, StrikeFlags, room_for_window};

use crate::bead::BeadState;
use crate::block::{SCANS_PER_BLOCK, ScanBlock};
use crate::conditions::ConditionsMeter;
use crate::device::Device;
use crate::health::{SensorWatch, Stillness};
use crate::trigger_line::TriggerLine;

/// The work of the bead on each block of scans.
pub struct Estimation<D: Device> {
    settings: Settings,
    meter: &'static mut Meter,
    watch: SensorWatch,
    conditions: ConditionsMeter,
    results: StrikeResults<D>,
    /// Scan around which a host has asked for a window, and which is still to come.
    wanted: Option<u64>,
    armed: bool,
    epoch: u32,
    next_index: u64,
    passed_over: u32,
    in_dead_time: u32,
    /// Bytes of the outbox that a window takes.
    room: usize,
}

impl<D: Device> Estimation<D> {
    /// Creates the estimation with a new `meter`. The `settings` apply until others are offered.
    pub fn new(
        bead: &'static BeadState<D>,
        settings: Settings,
        meter: &'static mut Meter,
        line: D::Line,
    ) -> Self {
        Self {
            meter,
            watch: SensorWatch::default(),
            conditions: ConditionsMeter::new(),
            results: StrikeResults {
                bead,
                history: settings.window.history,
                stillness: Stillness::NONE,
                packed: Packed::new(),
                line: TriggerLine::new(line),
                origin: Origin::Force,
                conditions: None,
            },
            wanted: None,
            armed: true,
            epoch: 0,
            next_index: 0,
            passed_over: 0,
            in_dead_time: 0,
            room: room_for_window(settings.window.length.into()),
            settings,
        }
    }

    /// Takes the next block.
    pub fn take(&mut self, block: &ScanBlock) {
        let bead = self.results.bead;
        if block.epoch != self.epoch {
            self.begin_epoch(block);
        }
        self.next_index = block.first_index + SCANS_PER_BLOCK as u64;
        self.open_window_if_asked();
        // A steady stream of strikes would starve settings and the owner's requests, and fill the line with
        // pieces of windows. So none is measured while settings are offered or the bead is disarmed, and no
        // window begins without room for it.
        let passing = bead.settings.is_offered() || !bead.is_armed() || !bead.outbox.has_room(self.room);
        self.meter.pass_over(passing);
        if !self.meter.is_measuring() {
            let before = self.armed;
            self.armed = bead.is_armed();
            if let Some(new) = bead.take_settings() {
                self.settings = new;
                self.results.history = new.window.history;
                self.room = room_for_window(new.window.length.into());
                self.meter.restart();
            } else if self.armed && !before {
                self.meter.restart();
            }
        }
        bead.count_load(|| {
            if self.armed {
                process_block(&self.settings, self.meter, block, &mut self.results);
            }
            self.watch.check(bead, block);
            if let Some(found) = self.conditions.take(&bead.device, self.meter.is_measuring()) {
                self.results.conditions = Some(found);
                // Volts have 12 bits behind the binary point.
                let millivolts = (u32::from(found.supply.bits()) * 1000 + 2048) >> 12;
                bead.update(|c| c.health.supply_mv = millivolts as u16);
            }
            bead.offer_raw(block, self.room);
        });
    }

    /// Counts the block that was taken as done. Called after the block is given back.
    pub fn count_block(&mut self) {
        let (bead, meter) = (self.results.bead, &self.meter);
        bead.update(|c| {
            c.blocks_estimated = c.blocks_estimated.wrapping_add(1);
            c.strikes = meter.strikes();
            c.armed = self.armed && meter.is_armed();
        });
        // Since the last call.
        let passed_over = meter.passed_over() - self.passed_over;
        let in_dead_time = meter.in_dead_time() - self.in_dead_time;
        if (passed_over, in_dead_time) != (0, 0) {
            bead.guard.update(|guard| {
                guard.strikes_passed_over += passed_over;
                guard.strikes_in_dead_time += in_dead_time;
            });
            self.passed_over += passed_over;
            self.in_dead_time += in_dead_time;
        }
    }

    fn begin_epoch(&mut self, block: &ScanBlock) {
        let bead = self.results.bead;
        self.epoch = block.epoch;
        bead.send(Gap {
            epoch: self.epoch,
            first_index: self.next_index,
            end_index: block.first_index,
        });
        let cut = self.meter.is_measuring();
        self.meter.restart();
        self.results.stillness = Stillness::NONE;
        if cut {
            bead.abandon_window();
            bead.update(|c| c.health.strikes_cut += 1);
            bead.fault(FaultCause::StrikeCut, "samples of its window were lost");
        }
    }

    fn open_window_if_asked(&mut self) {
        let (bead, next_index) = (self.results.bead, self.next_index);
        self.wanted = bead.wanted_scan.try_take().or(self.wanted);
        let edge = self.results.line.check(next_index);
        if self.results.line.is_found_held() {
            bead.fault(
                FaultCause::TriggerLineLow,
                "the trigger line is held low: a short circuit, or an unpowered bead on the line",
            );
        }
        if let Some(edge) = edge {
            self.meter.keep_around(edge.trigger, edge.at, Origin::Line);
        } else if let Some(index) = self.wanted.take_if(|index| *index < next_index) {
            self.meter.keep_around(index, index, Origin::Request);
        }
    }
}

/// Runs the meter over a block. The deadline is 2 ms a block on average, which is 1680 core clocks a sample.
///
/// Never inlined, so that its instructions can be counted by its symbol.
#[inline(never)]
fn process_block(settings: &Settings, meter: &mut Meter, block: &ScanBlock, sink: &mut dyn Sink) {
    meter.process_words(settings, block.first_index, &block.codes.0, sink);
}

/// Sends the results of the meter, and keeps them.
struct StrikeResults<D: Device> {
    bead: &'static BeadState<D>,
    /// Scans of a window up to the trigger.
    history: u16,
    /// Of the sensors, in the window that is being measured.
    stillness: Stillness,
    /// Room for a frame.
    packed: Packed,
    line: TriggerLine<D::Line>,
    /// Of the window that is being measured.
    origin: Origin,
    /// Supply and temperature, when last measured.
    conditions: Option<Conditions>,
}

impl<D: Device> Sink for StrikeResults<D> {
    fn found(&mut self, trigger_index: u64) {
        // The bead plays this strike to itself: its neighbours feel none.
        if !self.bead.played.get().is_in(trigger_index, 1) {
            self.line.pull(trigger_index);
        }
    }

    fn opened(&mut self, _: u64, origin: Origin) {
        self.origin = origin;
    }

    fn chunk(&mut self, chunk: &Chunk) {
        self.bead.push_piece(&mut self.packed, chunk);
        self.bead.keep_frame(&self.packed, chunk.strike);
        self.stillness.take(&chunk.scans, self.history);
    }

    fn report(&mut self, strike: &Strike, shape: &Shape) {
        let bead = self.bead;
        // Interrupts wait while a line is logged, so it holds only the essentials.
        #[cfg(feature = "defmt")]
        defmt::info!(
            "strike {=u32} at sample {=u64}, flags {=u32:#08x}",
            strike.strike,
            strike.trigger_index,
            strike.flags.bits(),
        );
        let still = core::mem::replace(&mut self.stillness, Stillness::NONE).found();
        if still {
            bead.guard.update(|guard| guard.strikes_still += 1);
        }
        let is_off = bead.settings.is_supply_off(self.conditions.as_ref());
        let is_played = bead.played.get().is_in(strike.first_index, strike.samples);
        let has_fault = bead.snapshot().health.standing != Standing::NONE;
        let flags = strike
            .flags
            .with_if(still, StrikeFlags::SENSOR_STILL)
            .with_if(bead.settings.are_not_owners(), StrikeFlags::SETTINGS_NOT_OWNERS)
            .with_if(self.origin == Origin::Line, StrikeFlags::TRIGGERED_BY_LINE)
            .with_if(self.origin == Origin::Request, StrikeFlags::TRIGGERED_ON_REQUEST)
            .with_if(is_off, StrikeFlags::SUPPLY_OFF)
            .with_if(is_played, StrikeFlags::PLAYED)
            .with_if(has_fault, StrikeFlags::SENSOR_FAULT);
        bead.push_packed(&mut self.packed, Strike { flags, ..*strike });
        bead.keep_frame(&self.packed, strike.strike);
        let shape = Shape {
            conditions: self.conditions,
            ..*shape
        };
        bead.push_packed(&mut self.packed, shape);
        bead.keep_frame(&self.packed, strike.strike);
        bead.close_window();
    }
}
