//! Whether sensors and supply can be believed.
//!
//! # Design
//! Looked at is every [`STEP`]th scan of every block, which costs two instructions a sample. All codes of a
//! channel are put together by OR and by AND: if both give the same, the code never moved; if all are next to
//! one rail, their high bits agree. A verdict falls every [`WINDOW`] blocks, so each condition is told at most
//! once in that time, when it begins and when it is over, however it flickers.
//!
//! A sensor with its noise moves the code: of the 1250 codes looked at, some ten differ from the rest if the
//! noise is a fifth of a code and lies as badly as it can, in the middle between two steps. A sensor that is
//! quieter looks stuck, and is reported as such.
//!
//! The supply is the reference of the ADC. Its internal reference voltage, on ADC1 alone, has to be sampled for
//! 10 µs at least (DocID022152, embedded reference voltage), more than the 7.4 µs between two scans: it cannot be
//! measured without losing scans. So the programmable voltage detector watches instead, which needs no ADC
//! (RM0090 section 5.2.3), and is looked at once a block.

use bead_wire::{FaultCause, Health};
use embassy_stm32::pac::PWR;

use crate::acquire::{Block, CHANNELS};
use crate::counters;
use crate::report;

/// Of so many scans one is looked at.
const STEP: usize = 8;
/// Blocks from verdict to verdict: 100 ms, more than the longest window of a strike (4096 samples), so that no
/// strike looks like a railed sensor.
const WINDOW: u32 = 50;
/// Bits in which all codes next to a rail agree: 0 to 15, or 4080 to 4095.
const HIGH: u16 = 0xFF0;
/// The detector's threshold, number 6 of PWR_CR.PLS: the supply is low below 2.93 V, and good again above 3.03 V
/// (DocID022152, table of the reset and power control block, typical values).
const THRESHOLD: u8 = 6;

/// Switches the supply's detector on.
pub(crate) fn watch_supply() {
    PWR.cr1().modify(|w| {
        w.set_pls(THRESHOLD.into());
        w.set_pvde(true);
    });
}

/// What a window found of one sensor.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Verdict {
    Good,
    Stuck,
    Railed,
}

/// One sensor.
struct Sensor {
    any: u16,
    all: u16,
    verdict: Verdict,
    stuck: Condition,
    railed: Condition,
}

impl Sensor {
    const fn new(stuck: Condition, railed: Condition) -> Self {
        Self {
            any: 0,
            all: u16::MAX,
            verdict: Verdict::Good,
            stuck,
            railed,
        }
    }

    /// Judges the window, and begins the next.
    fn judge(&mut self) {
        let found = if self.any & HIGH == 0 || self.all & HIGH == HIGH {
            Verdict::Railed
        } else if self.any == self.all {
            Verdict::Stuck
        } else {
            Verdict::Good
        };
        (self.any, self.all) = (0, u16::MAX);
        if found == self.verdict {
            return;
        }
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

/// One thing that can be wrong: how it is told and counted.
struct Condition {
    cause: FaultCause,
    detail: &'static str,
    bit: u8,
    count: fn(&mut Health) -> &mut u32,
}

impl Condition {
    fn begins(&self) {
        counters::update(|c| {
            *(self.count)(&mut c.health) += 1;
            c.health.standing |= self.bit;
        });
        report::fault(self.cause, self.detail);
    }

    fn ends(&self) {
        counters::update(|c| c.health.standing &= !self.bit);
        report::fault(FaultCause::Recovered, self.cause.name());
    }
}

/// Watches the blocks on their way to the meter.
pub(crate) struct Watch {
    blocks: u32,
    sensors: [Sensor; CHANNELS],
    supply: Condition,
    supply_is_low: bool,
    /// The supply was low in this window.
    supply_was_low: bool,
}

impl Watch {
    pub(crate) const fn new() -> Self {
        let force = Sensor::new(
            Condition {
                cause: FaultCause::ForceStuck,
                detail: "the force code has not moved for 100 ms",
                bit: Health::FORCE_STUCK,
                count: |health| &mut health.force_stuck,
            },
            Condition {
                cause: FaultCause::ForceRailed,
                detail: "the force has been at a rail for 100 ms",
                bit: Health::FORCE_RAILED,
                count: |health| &mut health.force_railed,
            },
        );
        let acceleration = Sensor::new(
            Condition {
                cause: FaultCause::AccelerationStuck,
                detail: "the acceleration code has not moved for 100 ms",
                bit: Health::ACCELERATION_STUCK,
                count: |health| &mut health.acceleration_stuck,
            },
            Condition {
                cause: FaultCause::AccelerationRailed,
                detail: "the acceleration has been at a rail for 100 ms",
                bit: Health::ACCELERATION_RAILED,
                count: |health| &mut health.acceleration_railed,
            },
        );
        Self {
            blocks: 0,
            sensors: [force, acceleration],
            supply: Condition {
                cause: FaultCause::SupplyLow,
                detail: "the supply is below 2.93 V",
                bit: Health::SUPPLY_LOW,
                count: |health| &mut health.supply_low,
            },
            supply_is_low: false,
            supply_was_low: false,
        }
    }

    /// Looks at a block, and at the supply.
    pub(crate) fn look(&mut self, block: &Block) {
        let scans: &[[u16; CHANNELS]] = block.codes.as_chunks().0;
        for scan in scans.iter().step_by(STEP) {
            for (sensor, &code) in self.sensors.iter_mut().zip(scan) {
                sensor.any |= code;
                sensor.all &= code;
            }
        }
        let low = PWR.csr1().read().pvdo();
        self.supply_was_low |= low;
        if low && !self.supply_is_low {
            self.supply_is_low = true;
            self.supply.begins();
        }
        self.blocks += 1;
        if self.blocks == WINDOW {
            self.blocks = 0;
            self.sensors.iter_mut().for_each(Sensor::judge);
            if self.supply_is_low && !self.supply_was_low {
                self.supply_is_low = false;
                self.supply.ends();
            }
            self.supply_was_low = false;
        }
    }
}
