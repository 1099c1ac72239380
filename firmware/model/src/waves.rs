//! The waves in the force, and the windows that hold them.
//!
//! # Design
//!
//! The force *rises* at a scan if its code is higher by the threshold than `lookback` scans before. A
//! drifting offset does not matter, and a recorded window alone shows when the force rises. Every scan is
//! checked, also those in a window and after it. The time from one rise to the next is *quiet*.
//!
//! | a rise after a quiet of | outside of a window | in a window that has a wave |
//! |---|---|---|
//! | history and `lookback` or more | opens a window, perhaps over the one before | cuts it, if high enough |
//! | `lookback` or more | is missed and counted: there is no quiet for its zero | is a part of it |
//! | less | belongs to a train of waves | belongs to a train |
//!
//! A wave that is a part of a window is flagged ([`Window`](crate::Window)). One that cuts it is an eighth as
//! high as the highest before, and opens a window of its own.
//!
//! **Cut.** A window that is cut ends [`LEAD`] scans before the trigger of the next, so the foot of the wave
//! is not in it. What its intruder still holds then is in its energies
//! ([`RingDown`](crate::ring_down::RingDown)). An eighth of the force brings 3 % of the energy.
//!
//! **Overlap.** Overlapping windows have more scans to measure than arrive. A meter measures 3 for every 8
//! that arrive. A window that overlaps the one before is opened only if the meter, in calls of any length,
//! would not lag too far behind for it; otherwise the wave is a part of the window, or missed.

use core::ops::Range;

use crate::layout::{HISTORY_MAX, LEAD, WINDOW_MAX};
use crate::quantity::Scan;
use crate::settings::Settings;

/// Inverse of the least height of a separate wave, as a part of the highest force.
const PART: i32 = 8;

/// Scans that are kept besides a history, so that a window can be opened around an instant that has passed.
pub const REACH: usize = 816;

/// Scans measured over scans received: with this fraction the busiest block is as busy as estimate B with six
/// followers may make it.
pub(crate) const MEASURED: [usize; 2] = [3, 8];

/// Scans received while a window of `length` is measured.
const fn meanwhile(length: u64) -> u64 {
    length * MEASURED[1] as u64 / MEASURED[0] as u64
}

/// Lag of the meter, in scans, once it has measured a window that the force opened: the whole history waited
/// at first.
const fn lag(history: u64, length: u64) -> u64 {
    history + meanwhile(length) - length
}

/// Most scans by which the meter may lag behind after a call: two strikes have a window of 672 scans each,
/// with a history of 160, however soon one comes after the other. A window that was opened from outside waits
/// [`REACH`] longer than one that the force opened; the longest of these come near this limit.
pub(crate) const LAG_MAX: usize = REACH + 1952;
const _: () = assert!(LAG_MAX as u64 >= lag(HISTORY_MAX as u64, WINDOW_MAX as u64));

/// The cause of a window.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Origin {
    /// The force rose by the threshold.
    #[default]
    Force = 0,
    /// Another bead found a strike.
    Line,
    /// A host asked for it.
    Request,
}

/// A window that was asked for.
#[derive(Clone, Copy)]
pub(crate) struct Around {
    /// Sample index of the scan that is to count as the one that triggers.
    pub(crate) trigger: u64,
    /// The window is opened at this sample index, if the force has opened none before.
    pub(crate) at: u64,
    /// Origin of the request; the force if there is none.
    pub(crate) origin: Origin,
}

impl Around {
    pub(crate) const NOTHING: Self = Self {
        trigger: 0,
        at: 0,
        origin: Origin::Force,
    };
}

/// A window to be measured.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlannedWindow {
    /// Number of the strike.
    pub(crate) strike: u32,
    /// Sample index of the scan that triggers.
    pub(crate) trigger: u64,
    /// Sample index of the first scan, and of the one after the last.
    pub(crate) first: u64,
    pub(crate) end: u64,
    /// Sample index at which it was opened.
    opened: u64,
    pub(crate) origin: Origin,
}

impl PlannedWindow {
    pub(crate) const NONE: Self = Self {
        strike: 0,
        trigger: 0,
        first: 0,
        end: 0,
        opened: 0,
        origin: Origin::Force,
    };
}

/// A rise after quiet.
pub(crate) enum Wave {
    /// It opens a window. `cut` is the index of the scan after the last of the window that it cuts.
    Triggers { trigger: u64, cut: Option<u64> },
    /// No window can hold it.
    Missed,
}

/// State of the detector.
#[derive(Clone)]
pub(crate) struct Waves {
    /// Scans since the last rise. Those before the first scan count as `lookback`.
    quiet: u32,
    /// True if a rise now would open a window.
    pub(crate) is_armed: bool,
    /// True if a scan has been looked at.
    has_begun: bool,
    /// Number of scans still to come that have no earlier scan to be compared with.
    alone: u16,
    /// Index of the first scan that is in no window.
    since: u64,
    is_rising: bool,
    /// Height of the rise, and the highest in the window before, codes.
    height: i32,
    highest: i32,
    /// A rise in a window that may be too low to cut it.
    candidate: Option<u64>,
    /// True if the newest window has a wave.
    has_wave: bool,
    newest: PlannedWindow,
    /// Sample index by which the windows before the newest are measured.
    done: u64,
}

impl Waves {
    /// A detector that has seen no scan. It is armed after one history.
    pub(crate) const fn new() -> Self {
        Self {
            quiet: 0,
            is_armed: false,
            has_begun: false,
            alone: 0,
            since: 0,
            is_rising: false,
            height: 0,
            highest: 0,
            candidate: None,
            has_wave: false,
            newest: PlannedWindow::NONE,
            done: 0,
        }
    }

    /// Begins at the scan `index`, if it has not begun.
    pub(crate) fn begin(&mut self, settings: &Settings, index: u64) {
        if !self.has_begun {
            let lookback = settings.window.lookback;
            (self.has_begun, self.since, self.alone) = (true, index, lookback);
            self.quiet = lookback.into();
        }
    }

    /// Checks the scans `new`, the first with the sample index `index`, up to the next wave. With `may_cut`,
    /// a wave may cut the window that it comes in. Returns the wave and the number of scans passed.
    pub(crate) fn look(
        &mut self,
        settings: &Settings,
        scans: &[Scan],
        new: Range<usize>,
        index: u64,
        may_cut: bool,
    ) -> (Option<Wave>, usize) {
        if self.alone > 0 {
            let passed = new.len().min(self.alone.into());
            self.alone -= passed as u16;
            self.pass_quiet(settings, passed);
            return (None, passed);
        }
        if self.is_rising {
            return self.follow_rise(settings, scans, new, index);
        }
        let passed = before_rise(settings, scans, new.clone());
        self.pass_quiet(settings, passed);
        if passed == new.len() {
            return (None, passed);
        }
        let wave = self.rise(settings, index + passed as u64, may_cut);
        (self.is_rising, self.height) = (true, 0);
        (wave, passed)
    }

    /// Follows a rise through the scans `new` to its end, or to the scan at which it cuts a window. Takes and
    /// returns the same as [`look`](Self::look).
    fn follow_rise(
        &mut self,
        settings: &Settings,
        scans: &[Scan],
        new: Range<usize>,
        index: u64,
    ) -> (Option<Wave>, usize) {
        let (lookback, threshold) = (settings.window.lookback, i32::from(settings.window.threshold));
        let force = |scan: &Scan| i32::from(scan.force.sensitive().get());
        (self.quiet, self.is_armed) = (0, false);
        let before = &scans[new.start - usize::from(lookback)..];
        for (passed, (before, now)) in (0..).zip(before.iter().zip(&scans[new.clone()])) {
            let rise = force(now) - force(before);
            if rise < threshold {
                self.is_rising = false;
                self.highest = self.highest.max(self.height);
                self.candidate = None;
                self.pass_quiet(settings, 1);
                return (None, passed + 1);
            }
            self.height = self.height.max(rise);
            let Some(trigger) = self.candidate else { continue };
            let is_high = self.height * PART >= self.highest;
            if is_high || index + passed as u64 > trigger + u64::from(lookback) {
                self.candidate = None;
            }
            if is_high {
                let cut = Some(trigger + 1 - u64::from(LEAD));
                return (Some(Wave::Triggers { trigger, cut }), passed + 1);
            }
        }
        (None, new.len())
    }

    /// Handles a rise of the force at the scan `index`.
    fn rise(&mut self, settings: &Settings, index: u64, may_cut: bool) -> Option<Wave> {
        let is_new = self.quiet >= u32::from(settings.window.lookback);
        if index >= self.newest.end {
            if self.is_armed && self.is_in_time(settings, index, self.newest.end) {
                return Some(Wave::Triggers {
                    trigger: index,
                    cut: None,
                });
            }
            return is_new.then_some(Wave::Missed);
        }
        let cut = index + 1 - u64::from(LEAD);
        let cuts = self.has_wave && self.is_armed && may_cut && self.is_in_time(settings, index, cut);
        self.candidate = cuts.then_some(index);
        self.has_wave = true;
        None
    }

    fn pass_quiet(&mut self, settings: &Settings, scans: usize) {
        let window = &settings.window;
        self.quiet = self.quiet.saturating_add(scans as u32);
        self.is_armed = self.quiet >= u32::from(window.history) + u32::from(window.lookback);
    }

    /// Sample index by which the newest window is measured if it ends at `end`.
    fn done(&self, end: u64) -> u64 {
        self.done.max(self.newest.opened) + meanwhile(end.saturating_sub(self.newest.first))
    }

    /// True if the lag of the meter would stay within its limit with a window that the scan `trigger` opens,
    /// while the newest ends at `end`.
    fn is_in_time(&self, settings: &Settings, trigger: u64, end: u64) -> bool {
        let window = &settings.window;
        let [history, length] = [window.history, window.length].map(u64::from);
        let first = (trigger + 1).saturating_sub(history);
        first >= self.newest.end || self.done(end) + lag(history, length) <= first + LAG_MAX as u64
    }

    /// Plans the window around a scan, opened at the scan `opened`. It becomes the newest.
    pub(crate) fn plan(
        &mut self,
        settings: &Settings,
        trigger: u64,
        opened: u64,
        origin: Origin,
    ) -> PlannedWindow {
        let [history, length] = [settings.window.history, settings.window.length].map(u64::from);
        let first = trigger + 1 - history;
        // The newest may be cut by this one.
        self.done = self.done(self.newest.end.min(trigger + 1 - u64::from(LEAD)));
        self.newest = PlannedWindow {
            trigger,
            first,
            end: first + length,
            opened,
            origin,
            ..PlannedWindow::NONE
        };
        self.since = self.newest.end;
        (self.has_wave, self.highest, self.candidate) = (origin == Origin::Force, 0, None);
        self.newest
    }

    /// Plans the requested window, if it can be opened at the scan `index`: the detector is armed, and all
    /// scans of the window are still kept (from `kept`) and in no other window.
    pub(crate) fn asked(
        &mut self,
        settings: &Settings,
        around: Around,
        index: u64,
        kept: u64,
    ) -> Option<PlannedWindow> {
        let Around { trigger, origin, .. } = around;
        let first = (trigger + 1).checked_sub(settings.window.history.into())?;
        let is_free = self.is_armed && index >= self.newest.end && first >= self.since && first >= kept;
        is_free.then(|| self.plan(settings, trigger, index, origin))
    }

    /// Index of the scan before which no wave can cut the window that ends at `end`, if the scans before
    /// `looked` were checked.
    pub(crate) fn known_until(&self, looked: u64, end: u64) -> u64 {
        match self.candidate {
            None if looked >= end => end,
            candidate => end.min(candidate.unwrap_or(looked).saturating_sub(LEAD.into())),
        }
    }
}

/// The trigger. Returns how many of the scans `new` come before a rise.
///
/// Never inlined, so that its instructions can be counted by its symbol.
#[inline(never)]
fn before_rise(settings: &Settings, scans: &[Scan], new: Range<usize>) -> usize {
    let lookback = usize::from(settings.window.lookback);
    let threshold = u32::from(settings.window.threshold);
    let force = |scan: &Scan| u32::from(scan.force.sensitive().get());
    scans[new.start - lookback..]
        .iter()
        .zip(&scans[new])
        .take_while(|(before, now)| force(now) < force(before) + threshold)
        .count()
}
