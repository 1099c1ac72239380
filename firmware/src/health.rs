//! Whether sensors and supply can be believed.
//!
//! # Design
//! Every [`STEP`]th scan of a block is checked, which costs four instructions a sample. The codes of a
//! channel are combined by OR and by AND. If both results are the same, the code never moved. If all codes
//! are next to one rail, their high bits agree. A fault begins when it holds for [`WINDOW`] blocks, and ends
//! with the first block in which it does not hold. Its begin and its end are reported, at most ten times a
//! second.
//!
//! The noise of a sensor moves its code. In the worst case the signal lies in the middle between two steps of
//! the code: noise of a fifth of a code then changes about ten of the 1250 codes that are checked. A sensor
//! with less noise looks stuck, and is reported as stuck. A sensor is stuck or railed if one of its two
//! channels is.

use core::sync::atomic::Ordering;

use bead_wire::{FaultCause, Health, Standing};

use crate::block::{Block, CHANNELS};
use crate::{counters, report, supply};

/// Channels of a sensor.
const GAINS: usize = 2;
const SENSORS: usize = CHANNELS / GAINS;
/// One of this many scans is checked.
const STEP: usize = 8;
/// Blocks from one verdict to the next: 100 ms. This is more than the longest window of a strike (1024
/// samples), so that no strike looks like a railed sensor.
const WINDOW: u32 = 50;
/// Bits in which all codes next to a rail agree: 0 to 15, or 4080 to 4095.
const HIGH: u16 = 0xFF0;
/// The supply is good again after this many blocks in which it was not low: 20 ms. A supply that flickers is
/// reported at most 50 times a second.
const SUPPLY_HOLD: u32 = 10;

/// What [`WINDOW`] blocks say about a sensor.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Verdict {
    Good,
    Stuck,
    Railed,
}

/// The codes of a channel, combined by OR (`any`) and by AND (`all`).
#[derive(Clone, Copy)]
struct CodeBits {
    any: u16,
    all: u16,
}

impl CodeBits {
    const NONE: Self = Self {
        any: 0,
        all: u16::MAX,
    };

    fn add(&mut self, other: Self) {
        self.any |= other.any;
        self.all &= other.all;
    }

    fn verdict(self) -> Verdict {
        if self.any & HIGH == 0 || self.all & HIGH == HIGH {
            Verdict::Railed
        } else if self.any == self.all {
            Verdict::Stuck
        } else {
            Verdict::Good
        }
    }
}

/// The worse verdict of the two channels of a sensor.
fn verdict([sensitive, wide]: [CodeBits; GAINS]) -> Verdict {
    sensitive.verdict().max(wide.verdict())
}

/// The health of one sensor.
struct SensorHealth {
    window: [CodeBits; GAINS],
    verdict: Verdict,
    stuck: Condition,
    railed: Condition,
}

impl SensorHealth {
    const fn new(stuck: Condition, railed: Condition) -> Self {
        Self {
            window: [CodeBits::NONE; GAINS],
            verdict: Verdict::Good,
            stuck,
            railed,
        }
    }

    /// Takes the codes of a block.
    fn block(&mut self, codes: [CodeBits; GAINS]) {
        for (window, codes) in self.window.iter_mut().zip(codes) {
            window.add(codes);
        }
        if self.verdict != Verdict::Good && verdict(codes) == Verdict::Good {
            self.becomes(Verdict::Good);
        }
    }

    /// Judges the window, and begins the next.
    fn judge(&mut self) {
        let found = verdict(core::mem::replace(&mut self.window, [CodeBits::NONE; GAINS]));
        if found != Verdict::Good && found != self.verdict {
            self.becomes(found);
        }
    }

    fn becomes(&mut self, found: Verdict) {
        match self.verdict {
            Verdict::Good => {}
            Verdict::Stuck => self.stuck.ends(),
            Verdict::Railed => self.railed.ends(),
        }
        match found {
            Verdict::Good => {}
            Verdict::Stuck => self.stuck.begins(),
            Verdict::Railed => self.railed.begins(),
        }
        self.verdict = found;
    }
}

/// One thing that can be wrong: how it is reported and counted.
struct Condition {
    cause: FaultCause,
    detail: &'static str,
    bit: Standing,
    count: fn(&mut Health) -> &mut u32,
}

impl Condition {
    fn begins(&self) {
        counters::update(|c| {
            *(self.count)(&mut c.health) += 1;
            c.health.standing = c.health.standing.with(self.bit);
        });
        report::fault(self.cause, self.detail);
    }

    fn ends(&self) {
        counters::update(|c| c.health.standing = c.health.standing.without(self.bit));
        report::fault(FaultCause::Recovered, self.cause.name().unwrap_or_default());
    }
}

/// Checks the blocks that the meter has taken.
pub(crate) struct Watch {
    blocks: u32,
    sensors: [SensorHealth; SENSORS],
    supply: Condition,
    /// Blocks for which the supply still counts as low.
    supply_low_blocks: u32,
}

impl Watch {
    pub(crate) const fn new() -> Self {
        let force = SensorHealth::new(
            Condition {
                cause: FaultCause::ForceStuck,
                detail: "the force code has not moved for 100 ms",
                bit: Standing::FORCE_STUCK,
                count: |health| &mut health.force_stuck,
            },
            Condition {
                cause: FaultCause::ForceRailed,
                detail: "the force has been at a rail for 100 ms",
                bit: Standing::FORCE_RAILED,
                count: |health| &mut health.force_railed,
            },
        );
        let acceleration = SensorHealth::new(
            Condition {
                cause: FaultCause::AccelerationStuck,
                detail: "the acceleration code has not moved for 100 ms",
                bit: Standing::ACCELERATION_STUCK,
                count: |health| &mut health.acceleration_stuck,
            },
            Condition {
                cause: FaultCause::AccelerationRailed,
                detail: "the acceleration has been at a rail for 100 ms",
                bit: Standing::ACCELERATION_RAILED,
                count: |health| &mut health.acceleration_railed,
            },
        );
        Self {
            blocks: 0,
            sensors: [force, acceleration],
            supply: Condition {
                cause: FaultCause::SupplyLow,
                detail: "the supply is below 2.93 V",
                bit: Standing::SUPPLY_LOW,
                count: |health| &mut health.supply_low,
            },
            supply_low_blocks: 0,
        }
    }

    /// Checks a block, and the supply.
    pub(crate) fn look(&mut self, block: &Block) {
        // A word holds both channels of a sensor.
        let mut any = [0u32; SENSORS];
        let mut all = [u32::MAX; SENSORS];
        for scan in block.codes.words().iter().step_by(STEP) {
            for ((any, all), word) in any.iter_mut().zip(&mut all).zip(scan) {
                let word = word.load(Ordering::Relaxed);
                *any |= word;
                *all &= word;
            }
        }
        for ((sensor, any), all) in self.sensors.iter_mut().zip(any).zip(all) {
            let codes = |shift: u32| CodeBits {
                any: (any >> shift) as u16,
                all: (all >> shift) as u16,
            };
            sensor.block([codes(0), codes(16)]);
        }
        self.blocks += 1;
        if self.blocks == WINDOW {
            self.blocks = 0;
            self.sensors.iter_mut().for_each(SensorHealth::judge);
        }
        self.look_at_supply();
    }

    /// Checks the supply. Called once in the time of a block.
    pub(crate) fn look_at_supply(&mut self) {
        let was_low = self.supply_low_blocks > 0;
        if supply::is_low() {
            self.supply_low_blocks = SUPPLY_HOLD;
            if !was_low {
                self.supply.begins();
            }
        } else if was_low {
            self.supply_low_blocks -= 1;
            if self.supply_low_blocks == 0 {
                self.supply.ends();
            }
        }
    }
}
