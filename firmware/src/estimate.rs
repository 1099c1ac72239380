//! The strike meter over blocks of scans; its results become frames.
//!
//! # Design
//! `bead-model` does the work, at the middle priority: acquisition interrupts it, telemetry waits for it.
//! There are 2 ms for a block. Four blocks may be on their way, so a burst of work may take four times as
//! long before a block is lost.

use core::sync::atomic::{AtomicBool, Ordering};

use bead_model::{Chunk, Meter, Origin, Settings, Sink};
use bead_wire::{FaultCause, Gap, Packed, Shape, Standing, Strike, StrikeFlags, room_for_window};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Instant, Timer};

use crate::block::{BLOCK_US, Block, SCANS_PER_BLOCK};
use crate::counters;
use crate::health::{Stillness, Watch};
use crate::line::{Told, TriggerLine};
use crate::{handover, keep, load, outbox, raw, report, settings};

/// True while the detector is armed.
static ARMED: AtomicBool = AtomicBool::new(true);

/// Switches the search for strikes on or off, from the next block on. A strike that is being measured is
/// finished first.
pub(crate) fn arm(armed: bool) {
    ARMED.store(armed, Ordering::Relaxed);
}

/// The scan around which a host wants the window kept.
static WANTED: Signal<CriticalSectionRawMutex, u64> = Signal::new();

/// Keeps the window around the scan with this index, which has to come yet.
pub(crate) fn keep_around(index: u64) {
    WANTED.signal(index);
}

/// Measures strikes for ever. `settings` hold until others are offered.
#[embassy_executor::task]
pub(crate) async fn estimate(mut settings: Settings, meter: &'static mut Meter, line: TriggerLine) -> ! {
    let mut epoch = 0;
    let mut watch = Watch::new();
    let mut telemetry = Telemetry {
        history: settings.window.history,
        stillness: Stillness::NONE,
        packed: Packed::new(),
        line,
        origin: Origin::Force,
    };
    let mut wanted = None;
    let mut armed = true;
    let mut next_index = 0;
    let mut passed_over = 0;
    let mut room = room_for_window(settings.window.length.into());
    loop {
        let block = handover::next().await;
        if block.epoch != epoch {
            epoch = block.epoch;
            outbox::tell(Gap {
                epoch,
                first_index: next_index,
                end_index: block.first_index,
            });
            let cut = meter.is_measuring();
            meter.restart();
            telemetry.stillness = Stillness::NONE;
            if cut {
                keep::abandon();
                counters::update(|c| c.health.strikes_cut += 1);
                report::fault(FaultCause::StrikeCut, "samples of its window were lost");
            }
        }
        next_index = block.first_index + SCANS_PER_BLOCK as u64;
        wanted = WANTED.try_take().or(wanted);
        if let Some(Told { trigger, at }) = telemetry.line.look(next_index) {
            meter.keep_around(trigger, at, Origin::Line);
        } else if let Some(index) = wanted.take_if(|index| *index < next_index) {
            meter.keep_around(index, index, Origin::Request);
        }
        // Strikes without end would keep settings and the owner's word out, and fill the line with pieces of
        // windows. So there is a time at which none is measured, and no window begins that finds no room.
        meter.pass_over(settings::is_offered() || !ARMED.load(Ordering::Relaxed) || !outbox::has_room(room));
        if !meter.is_measuring() {
            let before = armed;
            armed = ARMED.load(Ordering::Relaxed);
            if let Some(new) = settings::take() {
                settings = new;
                telemetry.history = settings.window.history;
                room = room_for_window(settings.window.length.into());
                meter.restart();
            } else if armed && !before {
                meter.restart();
            }
        }
        load::count(|| {
            if armed {
                process_block(&settings, meter, &block, &mut telemetry);
            }
            watch.look(&block);
            raw::offer(&block, room);
        });
        handover::give_back(block.codes);
        counters::update(|c| {
            c.blocks_estimated = c.blocks_estimated.wrapping_add(1);
            c.strikes = meter.strikes();
            c.armed = armed && meter.is_armed();
        });
        if meter.passed_over() != passed_over {
            counters::update_guard(|guard| guard.strikes_passed_over += meter.passed_over() - passed_over);
            passed_over = meter.passed_over();
        }
    }
}

/// In place of [`estimate`] while there are no samples: takes settings, and watches the supply. The index
/// goes on with the time, which is what a signed request holds until.
#[embassy_executor::task]
pub(crate) async fn idle() -> ! {
    let mut watch = Watch::new();
    loop {
        Timer::after(Duration::from_micros(BLOCK_US.into())).await;
        let _ = settings::take();
        watch.look_at_supply();
        // A tick is a sample period.
        counters::update(|c| c.newest_index = Instant::now().as_ticks());
    }
}

/// Runs the meter over a block. The deadline is 2 ms a block on average, which is 1680 core clocks a sample.
///
/// Never inlined, so that its instructions can be counted by its symbol.
#[inline(never)]
fn process_block(settings: &Settings, meter: &mut Meter, block: &Block, telemetry: &mut Telemetry) {
    meter.process_words(settings, block.first_index, block.codes.words(), telemetry);
}

/// Sends what the meter finds, and keeps it.
struct Telemetry {
    /// Scans of a window up to the trigger.
    history: u16,
    /// Of the sensors in the window that is being measured.
    stillness: Stillness,
    /// Room for a frame.
    packed: Packed,
    line: TriggerLine,
    /// Of the window that is being measured.
    origin: Origin,
}

impl Sink for Telemetry {
    fn opened(&mut self, trigger_index: u64, origin: Origin) {
        self.origin = origin;
        if origin == Origin::Force {
            self.line.pull(trigger_index);
        }
    }

    fn chunk(&mut self, chunk: &Chunk) {
        outbox::push_piece(&mut self.packed, chunk);
        self.keep(chunk.strike);
        self.stillness.look(&chunk.scans, self.history);
    }

    fn report(&mut self, strike: &Strike, shape: &Shape) {
        // Interrupts wait while a line is logged, so it has no more than the frames cannot do without.
        defmt::info!(
            "strike {=u32} at sample {=u64}, flags {=u16:#06x}",
            strike.strike,
            strike.trigger_index,
            strike.flags.bits(),
        );
        let still = core::mem::replace(&mut self.stillness, Stillness::NONE).found();
        if still {
            counters::update_guard(|guard| guard.strikes_still += 1);
        }
        let doubts = [
            (still, StrikeFlags::SENSOR_STILL),
            (settings::are_not_owners(), StrikeFlags::SETTINGS_NOT_OWNERS),
            (self.origin == Origin::Line, StrikeFlags::TRIGGERED_BY_LINE),
            (self.origin == Origin::Request, StrikeFlags::TRIGGERED_ON_REQUEST),
            (
                counters::snapshot().health.standing != Standing::NONE,
                StrikeFlags::SENSOR_FAULT,
            ),
        ];
        let doubts = doubts
            .into_iter()
            .filter(|(doubt, _)| *doubt)
            .fold(StrikeFlags::NONE, |flags, (_, flag)| flags.with(flag));
        let flags = strike.flags.with(doubts);
        outbox::push_packed(&mut self.packed, Strike { flags, ..*strike });
        self.keep(strike.strike);
        outbox::push_packed(&mut self.packed, *shape);
        self.keep(strike.strike);
        keep::close();
    }
}

impl Telemetry {
    /// Keeps the frame that was just packed.
    fn keep(&self, strike: u32) {
        keep::add(&self.packed, strike);
    }
}
