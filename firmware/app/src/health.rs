//! Health of the sensors and the supply.
//!
//! # Design
//! Every [`STEP`]th scan of a block is checked, which costs four instructions a sample. The codes of a
//! channel are combined by OR and by AND. If both results are the same, the code never moved. If all codes
//! are next to one rail, their high bits agree. A fault is found when it has held for the last [`SPANS`]
//! spans of [`SPAN`] blocks, 50 to 60 ms after it began, and ends with the first block in which it does not
//! hold. Its beginning and its end are reported, at most twenty times a second.
//!
//! The noise of a sensor moves its code. In the worst case the signal is midway between two steps of the
//! code: noise of a quarter of a code then changes about thirty of the 625 codes that are checked. A sensor
//! with less noise is reported as stuck. A sensor is stuck or railed if one of its two channels is.
//!
//! A sensor that stands still for less than 50 ms is found if a strike is measured meanwhile: see
//! [`Stillness`].

use core::sync::atomic::{AtomicU32, Ordering};

use bead_model::{Scan, quantity::Pair};
use bead_wire::{FaultCause, Health, Standing};

use crate::bead::BeadState;
use crate::block::{CHANNELS, ScanBlock};
use crate::device::Device;

const SENSORS: usize = CHANNELS / 2;
/// One of this many scans is checked.
const STEP: usize = 8;
/// Blocks from one verdict to the next: 10 ms.
const SPAN: u32 = 5;
/// Spans that a verdict looks back on: 50 ms. This is more than the longest window of a strike (1024
/// samples), so that no strike looks like a railed sensor.
const SPANS: usize = 5;
/// Bits in which all codes next to a rail agree: 0 to 15, or 4080 to 4095.
const HIGH: u16 = 0xFF0;
/// The supply is good again after this many blocks in which it was not low: 20 ms. A supply that flickers is
/// reported at most 50 times a second.
const SUPPLY_HOLD: u32 = 10;

/// Verdict of [`SPANS`] spans on a sensor.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum SensorVerdict {
    Good,
    Stuck,
    Railed,
}

/// The codes of a sensor, both channels in a word, combined by OR (`any`) and by AND (`all`).
#[derive(Clone, Copy)]
struct CodeBits {
    any: u32,
    all: u32,
}

impl CodeBits {
    const NONE: Self = Self {
        any: 0,
        all: u32::MAX,
    };

    /// Bits of codes that have moved.
    const MOVED: Self = Self {
        any: u32::MAX,
        all: 0,
    };

    fn and(self, other: Self) -> Self {
        Self {
            any: self.any | other.any,
            all: self.all & other.all,
        }
    }

    fn and_word(self, word: &AtomicU32) -> Self {
        let word = word.load(Ordering::Relaxed);
        self.and(Self { any: word, all: word })
    }

    /// The worse verdict of the two channels.
    fn verdict(self) -> SensorVerdict {
        let channel = |shift: u32| {
            let (any, all) = ((self.any >> shift) as u16, (self.all >> shift) as u16);
            if any & HIGH == 0 || all & HIGH == HIGH {
                SensorVerdict::Railed
            } else if any == all {
                SensorVerdict::Stuck
            } else {
                SensorVerdict::Good
            }
        };
        channel(0).max(channel(16))
    }
}

/// The health of one sensor.
struct SensorHealth {
    /// The newest span last. The one before it is complete.
    spans: [CodeBits; SPANS],
    verdict: SensorVerdict,
    stuck: WatchedCondition,
    railed: WatchedCondition,
}

impl SensorHealth {
    const fn new(stuck: WatchedCondition, railed: WatchedCondition) -> Self {
        Self {
            // Moved, since the codes before the first block are not known.
            spans: [CodeBits::MOVED; SPANS],
            verdict: SensorVerdict::Good,
            stuck,
            railed,
        }
    }

    /// Takes the codes of a block.
    fn take<D: Device>(&mut self, bead: &BeadState<D>, codes: CodeBits) {
        self.spans[SPANS - 1] = self.spans[SPANS - 1].and(codes);
        if self.verdict != SensorVerdict::Good && codes.verdict() == SensorVerdict::Good {
            self.becomes(bead, SensorVerdict::Good);
        }
    }

    /// Judges the spans, and begins the next.
    fn judge<D: Device>(&mut self, bead: &BeadState<D>) {
        let found = self
            .spans
            .into_iter()
            .fold(CodeBits::NONE, CodeBits::and)
            .verdict();
        self.spans.rotate_left(1);
        self.spans[SPANS - 1] = CodeBits::NONE;
        if found != SensorVerdict::Good && found != self.verdict {
            self.becomes(bead, found);
        }
    }

    fn becomes<D: Device>(&mut self, bead: &BeadState<D>, found: SensorVerdict) {
        self.verdict = found;
        // The end of a fault is reported before the beginning of another.
        if found != SensorVerdict::Railed {
            self.railed.set(bead, false);
        }
        self.stuck.set(bead, found == SensorVerdict::Stuck);
        self.railed.set(bead, found == SensorVerdict::Railed);
    }
}

/// One thing that can be wrong: how it is reported and counted.
struct WatchedCondition {
    cause: FaultCause,
    detail: &'static str,
    bit: Standing,
    count: fn(&mut Health) -> &mut u32,
    holds: bool,
}

impl WatchedCondition {
    /// Reports the beginning or the end of the condition.
    fn set<D: Device>(&mut self, bead: &BeadState<D>, holds: bool) {
        if holds == self.holds {
            return;
        }
        self.holds = holds;
        bead.update(|c| {
            *(self.count)(&mut c.health) += u32::from(holds);
            c.health.standing = c.health.standing.without(self.bit).with_if(holds, self.bit);
        });
        if holds {
            bead.fault(self.cause, self.detail);
        } else {
            bead.fault(FaultCause::Recovered, self.cause.name().unwrap_or_default());
        }
    }
}

/// Checks the blocks that the meter has taken.
pub struct SensorWatch {
    blocks: u32,
    sensors: [SensorHealth; SENSORS],
    supply: WatchedCondition,
    /// Blocks for which the supply still counts as low.
    supply_low_blocks: u32,
}

impl Default for SensorWatch {
    fn default() -> Self {
        let force = SensorHealth::new(
            WatchedCondition {
                cause: FaultCause::ForceStuck,
                detail: "the force code has not moved for 50 ms",
                bit: Standing::FORCE_STUCK,
                count: |health| &mut health.force_stuck,
                holds: false,
            },
            WatchedCondition {
                cause: FaultCause::ForceRailed,
                detail: "the force has been at a rail for 50 ms",
                bit: Standing::FORCE_RAILED,
                count: |health| &mut health.force_railed,
                holds: false,
            },
        );
        let acceleration = SensorHealth::new(
            WatchedCondition {
                cause: FaultCause::AccelerationStuck,
                detail: "the acceleration code has not moved for 50 ms",
                bit: Standing::ACCELERATION_STUCK,
                count: |health| &mut health.acceleration_stuck,
                holds: false,
            },
            WatchedCondition {
                cause: FaultCause::AccelerationRailed,
                detail: "the acceleration has been at a rail for 50 ms",
                bit: Standing::ACCELERATION_RAILED,
                count: |health| &mut health.acceleration_railed,
                holds: false,
            },
        );
        Self {
            blocks: 0,
            sensors: [force, acceleration],
            supply: WatchedCondition {
                cause: FaultCause::SupplyLow,
                detail: "the supply is below 2.93 V",
                bit: Standing::SUPPLY_LOW,
                count: |health| &mut health.supply_low,
                holds: false,
            },
            supply_low_blocks: 0,
        }
    }
}

impl SensorWatch {
    /// Checks a block, and the supply.
    pub(crate) fn check<D: Device>(&mut self, bead: &BeadState<D>, block: &ScanBlock) {
        let [mut force, mut acceleration] = [CodeBits::NONE; SENSORS];
        for words in block.codes.0.iter().step_by(STEP) {
            force = force.and_word(&words[0]);
            acceleration = acceleration.and_word(&words[1]);
        }
        self.sensors[0].take(bead, force);
        self.sensors[1].take(bead, acceleration);
        self.blocks += 1;
        if self.blocks == SPAN {
            self.blocks = 0;
            self.sensors.iter_mut().for_each(|sensor| sensor.judge(bead));
        }
        self.check_supply(bead);
    }

    /// Checks the supply. Called once in the time of a block.
    pub fn check_supply<D: Device>(&mut self, bead: &BeadState<D>) {
        self.supply_low_blocks = if bead.device.supply_is_low() {
            SUPPLY_HOLD
        } else {
            self.supply_low_blocks.saturating_sub(1)
        };
        self.supply.set(bead, self.supply_low_blocks > 0);
    }
}

/// Detector of a sensor whose codes stand still in the window of a strike.
///
/// # Design
/// Noise moves the code, and the scans before the trigger show how long it may rest. A rest after the trigger
/// that is [`TIMES`] as long, and at least [`LEAST`], is not noise: a wire has come off, or an amplifier
/// hangs. Such a strike is flagged, since its estimates may be off by per cents and look sound. A sensor
/// without noise rests before the trigger too, and is never found here. Rests are measured in groups of
/// [`GROUP`] scans, which costs a few instructions a sample of a window. Codes at a rail do not count: a loud
/// strike drives the high gain there.
pub(crate) struct Stillness {
    /// Scans of the window so far.
    seen: u16,
    sensors: [RestingCode; SENSORS],
}

/// Groups in which a code did not move.
#[derive(Clone, Copy)]
struct RestingCode {
    code: u16,
    groups: u16,
    /// Longest run of such groups before the trigger, and after it.
    most: [u16; 2],
}

const GROUP: usize = 32;
/// Least rest that is reported, in groups: 1.28 ms.
const LEAST: u16 = 4;
/// Ratio of a suspicious rest to the longest one before the trigger.
const TIMES: u16 = 6;

impl Stillness {
    pub(crate) const NONE: Self = Self {
        seen: 0,
        sensors: [RestingCode {
            code: 0,
            groups: 0,
            most: [0; 2],
        }; SENSORS],
    };

    /// Takes the next piece of a window. Its first `history` scans are those up to the trigger.
    pub(crate) fn take(&mut self, scans: &[Scan], history: u16) {
        let part = usize::from(self.seen >= history);
        let [force, acceleration] = &mut self.sensors;
        for group in scans.as_chunks::<GROUP>().0 {
            force.add(resting(group, |scan| scan.force), part);
            acceleration.add(resting(group, |scan| scan.acceleration), part);
        }
        self.seen += scans.len() as u16;
    }

    /// Returns `true` if a sensor stood still in the window.
    pub(crate) fn found(&self) -> bool {
        let still = |rest: &RestingCode| rest.most[1] >= LEAST.max(TIMES * rest.most[0]);
        self.sensors.iter().any(still)
    }
}

/// The code at the high gain, if it is the same in all of these scans and not at a rail. As a rule the first
/// two scans already differ.
fn resting(group: &[Scan; GROUP], sensor: impl Fn(&Scan) -> Pair) -> Option<u16> {
    let code = |scan| sensor(scan).sensitive().get();
    let [first, rest @ ..] = group;
    let first = code(first);
    let rests = rest.iter().all(|scan| code(scan) == first);
    (rests && first & HIGH != 0 && first & HIGH != HIGH).then_some(first)
}

impl RestingCode {
    fn add(&mut self, resting: Option<u16>, part: usize) {
        let Some(code) = resting else {
            self.groups = 0;
            return;
        };
        if code != self.code {
            self.code = code;
            self.groups = 0;
        }
        self.groups += 1;
        self.most[part] = self.most[part].max(self.groups);
    }
}
