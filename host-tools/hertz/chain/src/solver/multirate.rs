//! Longer steps for beads that a wave has left behind in contact.
//!
//! # Design
//!
//! Behind a wave in a viscous chain all beads stay in contact and creep at speeds far above the allowed
//! error, so they cannot sleep ([`super::rest`]). But their contacts hardly change while the wave takes a
//! dozen steps. The moving blocks are therefore divided into a slow and a quick part, again and again
//! ([`super::parting`]). The slow part makes its single step first. The quick part then goes on as if it were
//! alone, using its own beads only, until it reaches the end of the slow step, where both are joined.
//!
//! In the meantime, the slow step's dense output gives the motion of its beads.

use std::ops::Range;

use super::kernel::{Task, dispatch};
use super::lanes::{BLOCK, Lanes, first};
use super::parting::{Calm, count, holds};
use super::rest::{AHEAD, FLOOR, RestingBlocks, beside};
use super::step_log::{LoggedSlowStep, StepLog};
use super::work::{Motion, Work};

/// Fewest moving blocks that are divided.
const FEWEST: usize = 24;
/// Fewest quick steps that a slow one must replace.
const WORTH: f64 = 4.0;
/// Greatest computed part of the work of a step of all blocks for which dividing pays.
const PAYS: f64 = 0.75;
/// Steps to wait after dividing did not pay: least and most.
const PAUSE: [u64; 2] = [16, 1024];

/// A step of the slow part.
#[derive(Debug, Clone, Default)]
struct SlowStep {
    work: Work,
    /// Blocks whose motion this step gives.
    own: Vec<Range<usize>>,
    from: f64,
    length: f64,
    to: f64,
    prepared: bool,
    /// Motion at two requested times, and the energy dissipated in contacts by the second, J.
    ends: [Motion; 2],
    times: [f64; 2],
    lost: f64,
}

/// The blocks that take a longer step, and this step until the others have reached its end.
#[derive(Debug, Clone)]
pub(super) struct Multirate {
    /// The slow step, kept for its memory when none is under way.
    slow: Option<Box<SlowStep>>,
    /// True while a slow step is under way.
    parted: bool,
    /// Speed that may be neglected, m/s.
    quiet: f64,
    tolerance: f64,
    /// Wanted length of the next slow step, s.
    reach: f64,
    /// Number of the step at which to divide the blocks again, and steps to wait if that does not pay.
    next: u64,
    pause: u64,
}

/// Returns the length of the next slow step over that of the last, whose blocks had these errors: the
/// cheapest of a few, assuming that errors grow as the ninth power of the step.
fn better(calm: &Calm, errors: &[f64], length: f64, step: f64) -> f64 {
    let blocks = || calm.runs.iter().flat_map(Clone::clone);
    let cost = |part: f64| {
        let cube = part * part * part;
        let bad = blocks().filter(|&block| length * errors[block] * (cube * cube * cube) > 1.0);
        bad.count() as f64 + count(&calm.runs) as f64 * step / (part * length)
    };
    let parts = [1.0, 1.25, 0.8, 0.64].map(|part| (cost(part), part));
    let cheaper = |best: (f64, f64), part: (f64, f64)| if part.0 < best.0 { part } else { best };
    parts.into_iter().fold(parts[0], cheaper).1
}

impl Multirate {
    pub(super) fn new(lanes: &Lanes, tolerance: f64) -> Self {
        // A loaded chain is as stiff elsewhere as at the wave, and a driven one is not left behind.
        let acts = lanes.drive.is_some() || lanes.drag.is_some();
        let never = lanes.loaded || acts || lanes.powers.is_some() || lanes.blocks < FEWEST;
        Self {
            slow: None,
            parted: false,
            quiet: FLOOR * tolerance * lanes.speed,
            tolerance,
            reach: 0.0,
            next: if never { u64::MAX } else { 0 },
            pause: PAUSE[0],
        }
    }

    /// Turns division off.
    #[cfg(test)]
    pub(super) fn never(&mut self) {
        self.next = u64::MAX;
    }

    /// Returns true if step `number` should try to divide the blocks.
    pub(super) fn is_due(&self, rest: &RestingBlocks, number: u64) -> bool {
        number >= self.next && !self.parted && rest.awake.len() >= FEWEST
    }

    /// End of the slow step, s; `None` if none is under way.
    pub(super) fn end(&self) -> Option<f64> {
        self.under_way().map(|slow| slow.to)
    }

    fn under_way(&self) -> Option<&SlowStep> {
        self.slow.as_deref().filter(|_| self.parted)
    }

    /// Divides the blocks at `time`, if that pays, and makes the slow part's step, which does not pass
    /// `stop`. `step` is the length of a quick step, `number` its number. Returns the steps tried.
    pub(super) fn part(
        &mut self,
        lanes: &Lanes,
        (rest, work): (&mut RestingBlocks, &mut Work),
        (time, stop): (f64, f64),
        (step, number): (f64, u64),
    ) -> u64 {
        let most = stop - time;
        if most < WORTH * step {
            return 0;
        }
        let wanted = self.reach.max(2.0 * WORTH * step).min(most);
        let calm = Calm::new(lanes, &rest.awake, &work.start, wanted);
        let length = calm.longest(lanes, &work.start, self.quiet, wanted);
        // A whole number of quick steps, so that the last is not cut short.
        let length = (step * (length / step * (1.0 + 1e-9)).floor()).min(most);
        let awake = rest.awake.len();
        let pays = |computed: usize| {
            let slow = count(&calm.runs) as f64 * step / length;
            computed as f64 + slow < PAYS * awake as f64
        };
        if length < WORTH * step
            || !pays(awake - count(&calm.runs))
            || rest.next_touch() <= time + AHEAD * length
            || beside(&calm.runs, lanes.blocks)
                .any(|(block, behind)| rest.meets(lanes, work, block, behind, (time, length)))
        {
            self.wait(number);
            return 0;
        }
        let stays_calm = self.attempt(lanes, rest, work, &calm, (time, length));
        let slow = self.slow.as_mut().expect("it was tried");
        let errors = &slow.work.errors;
        self.reach = length
            * if stays_calm {
                better(&calm, errors, length, step)
            } else {
                0.5
            };
        let parts = calm.parts(lanes, &work.start, (self.quiet, length), &slow.work.errors);
        match parts.filter(|parts| stays_calm && pays(count(&parts.quick))) {
            Some(parts) => {
                (self.parted, self.pause) = (true, PAUSE[0]);
                // The end of the run is reached exactly.
                slow.to = if length == most { stop } else { time + length };
                let all = |blocks: &[Range<usize>]| blocks.iter().flat_map(Clone::clone).collect::<Vec<_>>();
                work.shared = all(&parts.quick);
                work.shared.retain(|block| holds(&parts.own, *block));
                slow.work.shared = all(&calm.runs);
                slow.work.shared.retain(|block| !holds(&parts.own, *block));
                let mut elsewhere = rest.awake.clone();
                elsewhere.retain(|block| !holds(&parts.quick, *block));
                rest.leave(lanes, work, elsewhere);
                slow.own = parts.own;
            }
            None => self.wait(number),
        }
        1
    }

    /// Waits for `pause` steps, and doubles the pause.
    fn wait(&mut self, number: u64) {
        self.next = number + self.pause;
        self.pause = (2 * self.pause).min(PAUSE[1]);
    }

    /// Makes a slow step of `length` with all calm blocks. Returns true if they have stayed calm.
    fn attempt(
        &mut self,
        lanes: &Lanes,
        rest: &RestingBlocks,
        work: &Work,
        calm: &Calm,
        (time, length): (f64, f64),
    ) -> bool {
        let slow = self.slow.get_or_insert_with(|| {
            Box::new(SlowStep {
                work: Work::new(lanes),
                ends: [Motion::zeros(lanes), Motion::zeros(lanes)],
                ..SlowStep::default()
            })
        });
        (slow.from, slow.length) = (time, length);
        (slow.prepared, slow.times) = (false, [f64::NAN; 2]);
        slow.work.active.clone_from(&calm.runs);
        for run in &calm.runs {
            let lanes = first(run.start) - BLOCK..first(run.end) + BLOCK;
            slow.work.start.copy(lanes, &work.start);
        }
        let crossed = dispatch(&mut slow.work, lanes, Task::Step, length);
        let tolerance = self.tolerance;
        dispatch(&mut slow.work, lanes, Task::Errors { tolerance }, length);
        let work = &slow.work;
        let meets = |(block, behind)| rest.closes(lanes, work, block, behind, length);
        crossed == 0.0 && !beside(&calm.runs, lanes.blocks).any(meets)
    }

    /// Follows a quick step of `length` that ended at `time`. Beads beside the quick part fly on. At the end
    /// of the slow step both parts are joined; then returns the energy dissipated in the slow part's
    /// contacts, otherwise 0.
    pub(super) fn follow(
        &mut self,
        lanes: &Lanes,
        (rest, work): (&mut RestingBlocks, &mut Work),
        (time, length): (f64, f64),
    ) -> f64 {
        let Some(slow) = self.slow.as_deref().filter(|_| self.parted) else {
            return 0.0;
        };
        if time < slow.to {
            let Motion { u, v } = &mut work.start;
            let beside = beside(&work.active, lanes.blocks).map(|(block, _)| block);
            for block in beside.filter(|block| holds(&slow.own, *block)) {
                for lane in first(block)..first(block) + BLOCK {
                    u[lane] += length * v[lane];
                }
            }
            return 0.0;
        }
        for run in &slow.own {
            work.start.copy(first(run.start)..first(run.end), &slow.work.end);
        }
        work.shared.clear();
        rest.leave(lanes, work, Vec::new());
        self.parted = false;
        slow.work.lost_in_contacts(lanes)
    }

    /// Returns true if the slow step gives the motion of a body.
    #[inline(always)]
    pub(super) fn moves(&self, lane: usize) -> bool {
        let block = (lane / BLOCK).wrapping_sub(1);
        self.parted && self.under_way().is_some_and(|slow| holds(&slow.own, block))
    }

    /// Lanes of the bodies whose motion the slow step gives.
    pub(super) fn lanes(&self) -> impl Iterator<Item = usize> + '_ {
        let runs = self.under_way().into_iter().flat_map(|slow| &slow.own);
        runs.flat_map(|run| first(run.start)..first(run.end))
    }

    fn inside(&mut self) -> Option<&mut SlowStep> {
        self.slow.as_deref_mut().filter(|_| self.parted)
    }

    /// Computes the motion of the slow part at time `t`, for [`Multirate::interpolated`].
    pub(super) fn interpolate(&mut self, lanes: &Lanes, t: f64) {
        if let Some(slow) = self.inside() {
            slow.interpolate(lanes, t);
        }
    }

    /// Computes the motion at two times, for [`Multirate::at_ends`], and the loss by the second.
    pub(super) fn interpolate_ends(&mut self, lanes: &Lanes, times: [f64; 2]) {
        let Some(slow) = self.inside() else { return };
        if slow.times == times {
            return;
        }
        // Usually the first is the second of the last step.
        if slow.times[1] == times[0] {
            slow.ends.swap(0, 1);
        } else {
            slow.interpolate(lanes, times[0]);
            std::mem::swap(&mut slow.ends[0], &mut slow.work.stage);
        }
        let x = slow.interpolate(lanes, times[1]);
        std::mem::swap(&mut slow.ends[1], &mut slow.work.stage);
        slow.lost = slow.work.lost_inside(lanes, slow.length, x, &mut []).contacts;
        slow.times = times;
    }

    /// Motion at the time of [`Multirate::interpolate`], for bodies that the slow step moves.
    pub(super) fn interpolated(&self) -> &Motion {
        &self.under_way().expect("a slow step is under way").work.stage
    }

    /// Motion at both times of [`Multirate::interpolate_ends`].
    pub(super) fn at_ends(&self) -> &[Motion; 2] {
        &self.under_way().expect("a slow step is under way").ends
    }

    /// Energy dissipated in the slow part's contacts by the second time of [`Multirate::interpolate_ends`],
    /// J.
    pub(super) fn lost(&self) -> f64 {
        self.under_way().map_or(0.0, |slow| slow.lost)
    }

    /// Copies the slow step that is under way to a log, once. Returns its number there.
    pub(super) fn record(&mut self, lanes: &Lanes, log: &mut StepLog) -> Option<usize> {
        let slow = self.inside()?;
        let last = log.slow.last().map(|last| last.step.from);
        if last != Some(slow.from) {
            let length = slow.prepare(lanes);
            let step = log.copy(lanes, Some(&mut slow.work), (slow.from, slow.to), length);
            let (start, own) = (slow.work.start.clone(), slow.own.clone());
            log.slow.push(LoggedSlowStep { step, start, own });
        }
        Some(log.slow.len() - 1)
    }

    /// The slow step with its start and length, s, if it holds the contact at `lane`.
    pub(super) fn step_of(&mut self, lanes: &Lanes, lane: usize) -> Option<(&Work, (f64, f64))> {
        if !self.moves(lane) {
            return None;
        }
        let slow = self.inside()?;
        let length = slow.prepare(lanes);
        Some((&slow.work, (slow.from, length)))
    }
}

impl SlowStep {
    fn prepare(&mut self, lanes: &Lanes) -> f64 {
        let length = self.length;
        if !self.prepared {
            // Made again for the dissipated power of the contacts of `own`, which was not known before.
            self.work.keep_inside(lanes);
            if self.work.powers.is_none() {
                self.work.keep_powers(lanes);
            }
            dispatch(&mut self.work, lanes, Task::Step, length);
            self.work.prepare(lanes, length);
            self.prepared = true;
        }
        length
    }

    fn interpolate(&mut self, lanes: &Lanes, t: f64) -> f64 {
        let length = self.prepare(lanes);
        let x = ((t - self.from) / length).clamp(0.0, 1.0);
        self.work.interpolate(lanes, length, x);
        x
    }
}

#[cfg(test)]
mod tests;
