//! Longer steps for beads that a wave has left behind in touch.
//!
//! # Design
//!
//! Behind a wave in a viscous chain all beads stay in contact and creep, far above the error allowed, so they
//! cannot sleep ([`super::rest`]). But their contacts hardly change while the wave takes a dozen steps. So the
//! blocks that move are parted, time and again ([`super::parting`]). The slow part makes its one step first. The
//! quick one goes on as if it were alone, and looks nowhere but at its own beads; when it comes to the end of the
//! slow step, both are one again.
//!
//! Meanwhile the slow step's own dense output tells where its beads are.

use std::ops::Range;

use super::kernel::{Task, dispatch};
use super::lanes::{BLOCK, Lanes, first};
use super::parting::{Calm, Parts, count, holds};
use super::rest::{AHEAD, FLOOR, Rest};
use super::work::{Motion, Work};

/// The fewest blocks that are parted.
const FEWEST: usize = 24;
/// How many quick steps a slow one has to be worth.
const WORTH: f64 = 4.0;
/// Steps that go by after parting the blocks did not pay: the least and the most.
const PAUSE: [u64; 2] = [16, 1024];

/// One step of the slow part.
#[derive(Debug, Clone)]
struct Slow {
    work: Work,
    /// Blocks whose motion it gives.
    own: Vec<Range<usize>>,
    from: f64,
    to: f64,
    prepared: bool,
    /// The motion at two times that were asked for, and what contacts have dissipated by the second.
    ends: [Motion; 2],
    times: [f64; 2],
    lost: f64,
}

/// Which blocks take longer steps, and their step as long as others have not come to its end.
#[derive(Debug, Clone)]
pub(super) struct Multirate {
    /// Room for the slow step, and the step.
    slow: Option<Box<Slow>>,
    /// Whether that is under way.
    parted: bool,
    /// Speed that may be left out, m/s.
    quiet: f64,
    tolerance: f64,
    /// How long the next slow step should be, s.
    reach: f64,
    /// The number of the step at which to part blocks again, and steps to wait if that does not pay.
    next: u64,
    pause: u64,
    counts: [f64; 6],
}

impl Multirate {
    pub(super) fn new(lanes: &Lanes, tolerance: f64) -> Self {
        // A loaded chain is as stiff everywhere as where the wave is.
        let never = lanes.loaded || lanes.blocks < FEWEST;
        Self {
            slow: None,
            parted: false,
            quiet: FLOOR * tolerance * lanes.speed,
            tolerance,
            reach: 0.0,
            next: if never { u64::MAX } else { 0 },
            pause: PAUSE[0],
            counts: [0.0; 6],
        }
    }

    /// Parts no blocks from now on.
    #[cfg(test)]
    pub(super) fn never(&mut self) {
        self.next = u64::MAX;
    }

    pub(super) fn report(&self) -> String { format!("{:?}", self.counts) }

    /// Whether to try to part the blocks at step `number`.
    pub(super) fn is_due(&self, rest: &Rest, number: u64) -> bool {
        number >= self.next && !self.parted && rest.awake().len() >= FEWEST
    }

    /// When the slow step ends, if one is under way.
    pub(super) fn end(&self) -> Option<f64> {
        self.under_way().map(|slow| slow.to)
    }

    fn under_way(&self) -> Option<&Slow> {
        self.slow.as_deref().filter(|_| self.parted)
    }

    /// Parts the blocks at `time`, if that pays, and makes the slow part's step, which does not pass `stop`. Quick
    /// steps are about `step` long, and this one has a number. Gives how many tries of a step were made.
    pub(super) fn part(
        &mut self,
        lanes: &Lanes,
        (rest, work): (&mut Rest, &mut Work),
        (time, stop): (f64, f64),
        (step, number): (f64, u64),
    ) -> u64 {
        let most = stop - time;
        if most < WORTH * step {
            return 0;
        }
        let wanted = self.reach.max(2.0 * WORTH * step).min(most);
        let calm = Calm::new(lanes, rest.awake(), &work.start, wanted);
        let length = calm.longest(lanes, &work.start, self.quiet, wanted);
        // A whole number of quick steps: the last is not cut short.
        let length = (step * (length / step * (1.0 + 1e-9)).floor()).min(most);
        let meets = rest.next_touch() <= time + AHEAD * length
            || calm.runs.iter().any(|run| {
                (run.start > 0 && rest.meets(lanes, work, run.start - 1, false, (time, length)))
                    || (run.end < lanes.blocks && rest.meets(lanes, work, run.end, true, (time, length)))
            });
        let awake = rest.awake().len();
        let most_computed = awake - count(&calm.runs) + (count(&calm.runs) as f64 * step / length) as usize;
        if length < WORTH * step || meets || 4 * most_computed > 3 * awake {
            self.wait(number);
            return 0;
        }
        if !self.attempt(lanes, rest, work, &calm, (time, length)) {
            self.reach = 0.5 * length;
            self.wait(number);
            return 1;
        }
        let slow = self.slow.as_mut().expect("it was tried");
        let cheapest = |reach: f64| {
            let good = |block: &usize| {
                let ratio = reach / length;
                let power = ratio * ratio * ratio;
                length * slow.work.errors[*block] * power * power * power <= 1.0
            };
            let good = calm.runs.iter().flat_map(Clone::clone).filter(good).count();
            (awake - good) as f64 + count(&calm.runs) as f64 * step / reach
        };
        let reaches = [0.64, 0.8, 1.0, 1.25].map(|part| (cheapest(part * length), part * length));
        self.reach = reaches.into_iter().fold((f64::INFINITY, length), |best, this| if this.0 < best.0 { this } else { best }).1;
        let parts = calm.parts(lanes, &work.start, self.quiet, length, &slow.work.errors);
        self.counts[5] += 1.0;
        match parts {
            Some(parts) if 4 * (count(&parts.quick) + (count(&parts.slow) as f64 * step / length) as usize) < 3 * awake => {
                self.counts[0] += 1.0;
                self.counts[1] += length / step;
                self.counts[2] += count(&parts.quick) as f64;
                self.counts[3] += awake as f64;
                self.pause = PAUSE[0];
                self.parted = true;
                let among = |blocks: &[Range<usize>]| blocks.iter().flat_map(Clone::clone).collect::<Vec<_>>();
                work.shared = among(&parts.quick);
                work.shared.retain(|block| holds(&parts.own, *block));
                slow.work.shared = among(&parts.slow);
                slow.work.shared.retain(|block| !holds(&parts.own, *block));
                let elsewhere = rest.awake().iter().copied();
                let elsewhere = elsewhere.filter(|block| !holds(&parts.quick, *block)).collect();
                slow.own = parts.own;
                rest.leave(lanes, work, elsewhere);
            }
            _ => {
                self.counts[4] += 1.0;
                self.wait(number);
            }
        }
        1
    }

    /// Waits for some steps, and the next time for more.
    fn wait(&mut self, number: u64) {
        self.next = number + self.pause;
        self.pause = (2 * self.pause).min(PAUSE[1]);
    }

    /// Makes a slow step of `length` with all blocks that are calm. Gives whether they have stayed so.
    fn attempt(
        &mut self,
        lanes: &Lanes,
        rest: &Rest,
        work: &Work,
        calm: &Calm,
        (time, length): (f64, f64),
    ) -> bool {
        let slow = self.slow.get_or_insert_with(|| {
            let mut work = Work::new(lanes, true);
            work.keep_powers(lanes);
            Box::new(Slow {
                work,
                own: Vec::new(),
                from: 0.0,
                to: 0.0,
                prepared: false,
                ends: [Motion::zeros(lanes), Motion::zeros(lanes)],
                times: [f64::NAN; 2],
                lost: 0.0,
            })
        });
        (slow.from, slow.to) = (time, time + length);
        (slow.prepared, slow.times) = (false, [f64::NAN; 2]);
        slow.work.active.clone_from(&calm.runs);
        for run in &calm.runs {
            let lanes = first(run.start) - BLOCK..first(run.end) + BLOCK;
            slow.work.start.u[lanes.clone()].copy_from_slice(&work.start.u[lanes.clone()]);
            slow.work.start.v[lanes.clone()].copy_from_slice(&work.start.v[lanes]);
        }
        let crossed = dispatch(&mut slow.work, lanes, Task::Step, length);
        let tolerance = self.tolerance;
        dispatch(&mut slow.work, lanes, Task::Errors { tolerance }, length);
        let meets = calm.runs.iter().any(|run| {
            (run.start > 0 && rest.closes(lanes, &slow.work, run.start - 1, false, length))
                || (run.end < lanes.blocks && rest.closes(lanes, &slow.work, run.end, true, length))
        });
        crossed == 0.0 && !meets
    }

    /// After a quick step of `length` to `time`: beads beside the quick part fly on. At the end of the slow step
    /// both are one again; gives what contacts of the slow part have dissipated by then, once.
    pub(super) fn follow(
        &mut self,
        lanes: &Lanes,
        (rest, work): (&mut Rest, &mut Work),
        (time, length): (f64, f64),
    ) -> f64 {
        let Some(slow) = self.slow.as_deref().filter(|_| self.parted) else {
            return 0.0;
        };
        if time < slow.to {
            for run in 0..work.active.len() {
                let run = work.active[run].clone();
                for block in [run.start.wrapping_sub(1), run.end] {
                    if !holds(&slow.own, block) {
                        continue;
                    }
                    for lane in first(block)..first(block) + BLOCK {
                        work.start.u[lane] += length * work.start.v[lane];
                    }
                }
            }
            return 0.0;
        }
        for run in &slow.own {
            let lanes = first(run.start)..first(run.end);
            work.start.u[lanes.clone()].copy_from_slice(&slow.work.end.u[lanes.clone()]);
            work.start.v[lanes.clone()].copy_from_slice(&slow.work.end.v[lanes]);
        }
        work.shared.clear();
        rest.leave(lanes, work, Vec::new());
        self.parted = false;
        slow.work.lost_in_contacts(lanes)
    }

    /// Whether the slow step gives the motion of a body.
    pub(super) fn moves(&self, lane: usize) -> bool {
        let block = (lane / BLOCK).wrapping_sub(1);
        self.under_way().is_some_and(|slow| holds(&slow.own, block))
    }

    /// Lanes of the bodies whose motion the slow step gives.
    pub(super) fn lanes(&self) -> impl Iterator<Item = usize> + '_ {
        let runs = self.under_way().into_iter().flat_map(|slow| &slow.own);
        runs.flat_map(|run| first(run.start)..first(run.end))
    }
}

impl Slow {
    fn prepare(&mut self, lanes: &Lanes) -> f64 {
        let length = self.to - self.from;
        if !self.prepared {
            self.work.prepare(lanes, length);
            self.prepared = true;
        }
        length
    }

    fn look(&mut self, lanes: &Lanes, t: f64) -> f64 {
        let length = self.prepare(lanes);
        let x = ((t - self.from) / length).clamp(0.0, 1.0);
        self.work.look(lanes, length, x);
        x
    }
}

/// Inside the slow step.
impl Multirate {
    fn inside(&mut self) -> Option<&mut Slow> {
        self.slow.as_deref_mut().filter(|_| self.parted)
    }

    /// Finds the motion of the slow part at `t`, for [`Multirate::body`].
    pub(super) fn look(&mut self, lanes: &Lanes, t: f64) {
        if let Some(slow) = self.inside() {
            slow.look(lanes, t);
        }
    }

    /// Finds the motion at two times, for [`Multirate::at_ends`], and the loss by the second.
    pub(super) fn look_at_ends(&mut self, lanes: &Lanes, times: [f64; 2]) {
        let Some(slow) = self.inside() else { return };
        if slow.times == times {
            return;
        }
        // As a rule the first is the second of the last step.
        if slow.times[1] == times[0] {
            slow.ends.swap(0, 1);
        } else {
            slow.look(lanes, times[0]);
            std::mem::swap(&mut slow.ends[0], &mut slow.work.stage);
        }
        let x = slow.look(lanes, times[1]);
        std::mem::swap(&mut slow.ends[1], &mut slow.work.stage);
        slow.lost = slow.work.lost_inside(lanes, slow.to - slow.from, x).contacts;
        slow.times = times;
    }

    /// Displacement and velocity of a body of the slow part where [`Multirate::look`] has looked.
    pub(super) fn body(&self, lane: usize) -> Option<(f64, f64)> {
        let stage = &self.under_way().filter(|_| self.moves(lane))?.work.stage;
        Some((stage.u[lane], stage.v[lane]))
    }

    /// The same at both times of [`Multirate::look_at_ends`].
    pub(super) fn at_ends(&self, lane: usize) -> Option<[(f64, f64); 2]> {
        let slow = self.under_way().filter(|_| self.moves(lane))?;
        Some([0, 1].map(|end: usize| (slow.ends[end].u[lane], slow.ends[end].v[lane])))
    }

    /// What contacts of the slow part have dissipated by the second time of [`Multirate::look_at_ends`].
    pub(super) fn lost(&self) -> f64 {
        self.under_way().map_or(0.0, |slow| slow.lost)
    }

    /// The slow step, its start and its length, where it has the contact at `lane`.
    pub(super) fn step_of(&mut self, lanes: &Lanes, lane: usize) -> Option<(&Work, (f64, f64))> {
        if !self.moves(lane) {
            return None;
        }
        let slow = self.inside()?;
        let length = slow.prepare(lanes);
        Some((&slow.work, (slow.from, length)))
    }
}
