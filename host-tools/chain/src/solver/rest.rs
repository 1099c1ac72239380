//! Which blocks of beads need no computation: those that the wave has not reached, and those that it has left.
//!
//! # Design
//!
//! A block sleeps while no contact of it carries a force that matters and no intruder in it moves. There are two
//! kinds. One *flies*: its contacts are open, its bodies keep their velocities, so where they are follows from
//! when it fell asleep, and so does when two of them will meet. The other is *quiet*: whatever its bodies and
//! contacts have of motion is less than the error that a single step may make ([`FLOOR`] of the tolerance), so
//! it is stopped. What a wave leaves behind in an elastic chain is such dust. A body of mass M is stopped from
//! a speed of at most FLOOR × tolerance × the striker's speed, once after each wave that passes it, and that
//! bounds what is left out: of its velocity, and by M of momentum.
//!
//! A bead ahead of a wave moves as the motion two beads before to the power 3/2 each. So a block that touches
//! wakes when the third bead before it is no longer quiet: what is left out then is far below rounding.
//!
//! No step looks at more blocks than are awake and their neighbours: a pulse costs the same in a chain of any
//! length.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::lanes::{BLOCK, Lanes, first};
use super::work::Work;

/// The part of the tolerance, of the striker's speed, that any step may err by.
pub(super) const FLOOR: f64 = 0.01;
/// Motion, as a part of its scale, that nothing in f64 can notice.
const STILL: f64 = 1e-16;
/// Beads at the edge of a block that are watched.
const WATCHED: usize = 3;
/// Steps ahead of a collision at which a block wakes.
const AHEAD: f64 = 3.0;
/// Steps between looks for blocks that may sleep.
const PATIENCE: u64 = 4;

#[derive(Debug, Clone)]
pub(super) struct Rest {
    /// Since when each block is asleep.
    asleep: Vec<Option<f64>>,
    /// The others, in order.
    awake: Vec<usize>,
    /// When two bodies of a sleeping block, or of it and a sleeping neighbour, will meet.
    touch: Vec<f64>,
    /// The same as a queue: bits of the time, which order as it does, and the block. What does not agree with
    /// `touch` is out of date.
    queue: BinaryHeap<Reverse<(u64, usize)>>,
    /// Speed below which a body may be stopped, m/s.
    quiet: f64,
    steps: u64,
}

impl Rest {
    /// Blocks at rest sleep from the start, at `time`.
    pub(super) fn new(lanes: &Lanes, work: &mut Work, time: f64, tolerance: f64) -> Self {
        let mut moves: Vec<bool> = (0..lanes.blocks)
            .map(|block| {
                let lanes = first(block)..first(block) + BLOCK;
                let motion = work.start.u[lanes.clone()].iter().chain(&work.start.v[lanes]);
                motion.clone().any(|value| *value != 0.0)
            })
            .collect();
        for (guest, host) in lanes.guests.hosts.iter().enumerate() {
            moves[host / BLOCK - 1] |= work.start.x[guest] != 0.0 || work.start.w[guest] != 0.0;
        }
        let mut rest = Self {
            asleep: moves.iter().map(|moves| (!moves).then_some(time)).collect(),
            awake: (0..lanes.blocks).filter(|&block| moves[block]).collect(),
            touch: vec![f64::INFINITY; lanes.blocks],
            queue: BinaryHeap::new(),
            quiet: (FLOOR * tolerance).max(STILL) * lanes.speed,
            steps: 0,
        };
        rest.arrange(lanes, work);
        rest
    }

    /// When a sleeping block will have a collision.
    pub(super) fn next_touch(&mut self) -> f64 {
        while let Some(Reverse((bits, block))) = self.queue.peek() {
            if self.touch[*block].to_bits() == *bits {
                return f64::from_bits(*bits);
            }
            self.queue.pop();
        }
        f64::INFINITY
    }

    /// Brings a sleeping block up to `time`.
    fn settle(&mut self, work: &mut Work, block: usize, time: f64) {
        let Some(since) = &mut self.asleep[block] else {
            return;
        };
        for lane in first(block)..first(block) + BLOCK {
            work.start.u[lane] += work.start.v[lane] * (time - *since);
        }
        *since = time;
    }

    fn wake(&mut self, work: &mut Work, block: usize, time: f64) {
        self.settle(work, block, time);
        self.asleep[block] = None;
        self.touch[block] = f64::INFINITY;
        let at = self.awake.partition_point(|&other| other < block);
        self.awake.insert(at, block);
    }

    /// Notes runs of blocks that move, and intruders in them.
    fn arrange(&mut self, lanes: &Lanes, work: &mut Work) {
        work.active.clear();
        work.active_guests.clear();
        for &block in &self.awake {
            match work.active.last_mut() {
                Some(run) if run.end == block => run.end += 1,
                _ => work.active.push(block..block + 1),
            }
            for guest in lanes.guests.of_block[block].clone() {
                if work.active_guests.last() != Some(&(guest / BLOCK)) {
                    work.active_guests.push(guest / BLOCK);
                }
            }
        }
    }

    /// Calls for each sleeping block beside a run: the block, and whether it is behind the run.
    fn for_neighbours(&mut self, lanes: &Lanes, work: &mut Work, mut call: impl FnMut(&mut Self, &mut Work, usize, bool)) {
        for run in 0..work.active.len() {
            let run = work.active[run].clone();
            if run.start > 0 {
                call(self, work, run.start - 1, false);
            }
            if run.end < lanes.blocks {
                call(self, work, run.end, true);
            }
        }
    }

    fn all_move(&self, lanes: &Lanes) -> bool {
        self.awake.len() == lanes.blocks
    }

    /// Wakes what a step of about `h` could reach.
    pub(super) fn before_step(&mut self, lanes: &Lanes, work: &mut Work, time: f64, h: f64) {
        if self.all_move(lanes) {
            return;
        }
        loop {
            let before = self.awake.len();
            // With nothing else awake, no step is lost by waiting for the collision itself.
            let until = if work.active.is_empty() { time } else { time + AHEAD * h };
            while self.next_touch() <= until {
                let Some(Reverse((_, block))) = self.queue.pop() else { break };
                self.wake(work, block, time);
            }
            self.for_neighbours(lanes, work, |rest, work, block, behind| {
                if rest.asleep[block].is_some() {
                    rest.settle(work, block, time);
                    if rest.reaches(lanes, work, block, behind, h) {
                        rest.wake(work, block, time);
                    }
                }
            });
            if self.awake.len() == before {
                return;
            }
            self.arrange(lanes, work);
        }
    }

    /// Whether a run soon moves the sleeping block beside it.
    fn reaches(&self, lanes: &Lanes, work: &Work, block: usize, behind: bool, h: f64) -> bool {
        // The contact between the block and the run, and the edge of the run.
        let (lane, edge) = if behind {
            (first(block), first(block) - WATCHED..first(block))
        } else {
            let edge = first(block) + BLOCK;
            (edge, edge..edge + WATCHED)
        };
        if lanes.stiffness[lane] == 0.0 {
            return false;
        }
        let (u, v) = (&work.start.u, &work.start.v);
        let gap = u[lane] - u[lane - 1] - lanes.rest[lane];
        let approach = v[lane - 1] - v[lane];
        if gap > 0.0 {
            return approach > self.quiet && gap < AHEAD * h * approach;
        }
        if lanes.loaded {
            // A loaded chain is linear: what is weak goes on.
            return edge.into_iter().any(|lane| {
                u[lane].abs() > STILL * lanes.depth || v[lane].abs() > STILL * lanes.speed
            });
        }
        edge.into_iter().any(|lane| v[lane].abs() > self.quiet) || !self.presses_little(lanes, work, lane, 16.0)
    }

    /// Whether the elastic energy of a contact is at most `times` that of a quiet body.
    fn presses_little(&self, lanes: &Lanes, work: &Work, lane: usize, times: f64) -> bool {
        let overlap = work.start.u[lane - 1] - work.start.u[lane];
        let lightest = lanes.inverse[lane - 1].max(lanes.inverse[lane]);
        let energy = 0.8 * lanes.stiffness[lane] * overlap * overlap * overlap.max(0.0).sqrt();
        lanes.stiffness[lane] == 0.0 || energy * lightest <= times * self.quiet * self.quiet
    }

    /// Whether a step of length `h` has closed a contact with a sleeping block. The block is woken.
    pub(super) fn touched(&mut self, lanes: &Lanes, work: &mut Work, time: f64, h: f64) -> bool {
        if self.all_move(lanes) {
            return false;
        }
        let before = self.awake.len();
        self.for_neighbours(lanes, work, |rest, work, block, behind| {
            let lane = if behind { first(block) } else { first(block) + BLOCK };
            let gap = |near: f64, far: f64| far - near - lanes.rest[lane];
            let start = gap(work.start.u[lane - 1], work.start.u[lane]);
            let there = |lane: usize, sleeps: bool| {
                if sleeps {
                    work.start.u[lane] + h * work.start.v[lane]
                } else {
                    work.end.u[lane]
                }
            };
            let end = gap(there(lane - 1, !behind), there(lane, behind));
            let closes = start > 0.0 && end <= 0.0 && start - end > h * rest.quiet;
            if closes && lanes.stiffness[lane] > 0.0 && rest.asleep[block].is_some() {
                rest.wake(work, block, time);
            }
        });
        let woken = self.awake.len() > before;
        if woken {
            self.arrange(lanes, work);
        }
        woken
    }

    /// Lets blocks fall asleep that fly freely or hardly move.
    pub(super) fn after_step(&mut self, lanes: &Lanes, work: &mut Work, time: f64, h: f64) {
        self.steps += 1;
        if lanes.loaded || !self.steps.is_multiple_of(PATIENCE) {
            return;
        }
        let before = self.awake.len();
        let mut awake = std::mem::take(&mut self.awake);
        let mut fallen = Vec::new();
        awake.retain(|&block| {
            let quiet = self.is_quiet(lanes, work, block);
            if !quiet && !self.flies(lanes, work, block, h) {
                return true;
            }
            if quiet {
                work.start.v[first(block)..first(block + 1)].fill(0.0);
            }
            for guest in lanes.guests.of_block[block].clone() {
                (work.start.x[guest], work.start.w[guest]) = (0.0, 0.0);
            }
            work.still(block);
            self.asleep[block] = Some(time);
            fallen.push(block);
            false
        });
        self.awake = awake;
        if self.awake.len() == before {
            return;
        }
        for block in fallen {
            let touch = self.meeting(lanes, work, block, time);
            self.touch[block] = touch;
            if touch < f64::INFINITY {
                self.queue.push(Reverse((touch.to_bits(), block)));
            }
        }
        self.arrange(lanes, work);
    }

    /// Whether all that a block has of motion is less than a step may err by.
    fn is_quiet(&self, lanes: &Lanes, work: &Work, block: usize) -> bool {
        let bodies = first(block)..first(block + 1);
        bodies.clone().all(|lane| work.start.v[lane].abs() <= self.quiet)
            && (bodies.start..=bodies.end).all(|lane| self.presses_little(lanes, work, lane, 1.0))
            && self.guests_are_quiet(lanes, work, block)
    }

    fn guests_are_quiet(&self, lanes: &Lanes, work: &Work, block: usize) -> bool {
        lanes.guests.of_block[block].clone().all(|guest| {
            let (x, w) = (work.start.x[guest], work.start.w[guest]);
            let elastic = lanes.guests.stiffness[guest] * lanes.guests.inverse[guest] * x * x;
            w.abs() <= self.quiet && elastic <= self.quiet * self.quiet
        })
    }

    /// Whether no contact of a block is closed or will be soon, and no intruder in it moves.
    fn flies(&self, lanes: &Lanes, work: &Work, block: usize, h: f64) -> bool {
        let open = (first(block)..=first(block + 1)).all(|lane| {
            let gap = work.start.u[lane] - work.start.u[lane - 1];
            let approach = work.start.v[lane - 1] - work.start.v[lane];
            lanes.stiffness[lane] == 0.0 || (gap > 0.0 && gap > 4.0 * AHEAD * h * approach)
        });
        open && self.guests_are_quiet(lanes, work, block)
    }

    /// When two bodies will meet in a sleeping block, or between it and a sleeping neighbour.
    fn meeting(&mut self, lanes: &Lanes, work: &mut Work, block: usize, time: f64) -> f64 {
        let (mut from, mut to) = (first(block) + 1, first(block + 1));
        if block > 0 && self.asleep[block - 1].is_some() {
            self.settle(work, block - 1, time);
            from -= 1;
        }
        if block + 1 < lanes.blocks && self.asleep[block + 1].is_some() {
            self.settle(work, block + 1, time);
            to += 1;
        }
        let meet = |lane: usize| {
            let gap = work.start.u[lane] - work.start.u[lane - 1];
            let approach = work.start.v[lane - 1] - work.start.v[lane];
            if lanes.stiffness[lane] > 0.0 && approach > self.quiet {
                time + gap.max(0.0) / approach
            } else {
                f64::INFINITY
            }
        };
        (from..to).map(meet).fold(f64::INFINITY, f64::min)
    }

    /// Whether a body is in a block that moves.
    pub(super) fn moves(&self, lane: usize) -> bool {
        self.asleep[lane / BLOCK - 1].is_none()
    }

    /// Where a sleeping body is at `time`.
    pub(super) fn place(&self, work: &Work, lane: usize, time: f64) -> f64 {
        let since = self.asleep[lane / BLOCK - 1].unwrap_or(time);
        work.start.u[lane] + work.start.v[lane] * (time - since)
    }
}
