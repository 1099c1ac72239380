//! Which blocks of beads need no computation: those that the wave has not reached, and those that fly freely.
//!
//! # Design
//!
//! A block is asleep while no contact of it carries a force and no intruder in it moves. Its bodies keep their
//! velocities, so where they are follows from when it fell asleep, and so does when two of them will meet. A
//! bead ahead of a wave moves as the motion two beads before to the power 3/2 each, so a block that touches
//! wakes when the third bead before it has moved by [`STILL`] of the scale: what is left out then is far
//! below rounding.

use super::lanes::{BLOCK, Lanes, first};
use super::work::Work;

/// Motion, as a part of its scale, that nothing in f64 can notice.
const STILL: f64 = 1e-16;
/// Beads at the edge of a block that are watched.
const WATCHED: usize = 3;
/// Steps ahead of a collision at which a block wakes.
const AHEAD: f64 = 3.0;

#[derive(Debug)]
pub(super) struct Rest {
    /// Since when each block is asleep.
    asleep: Vec<Option<f64>>,
    /// When two bodies of a sleeping block, or of it and a sleeping neighbour, will meet.
    touch: Vec<f64>,
    next_touch: f64,
    steps: u64,
}

impl Rest {
    /// Blocks at rest sleep from the start.
    pub(super) fn new(lanes: &Lanes, work: &mut Work) -> Self {
        let moves = |block: usize| {
            let lanes = first(block)..first(block) + BLOCK;
            work.start.u[lanes.clone()]
                .iter()
                .chain(&work.start.v[lanes])
                .any(|value| *value != 0.0)
        };
        let asleep = (0..lanes.blocks)
            .map(|block| (!moves(block)).then_some(0.0))
            .collect();
        let mut rest = Self {
            asleep,
            touch: vec![f64::INFINITY; lanes.blocks],
            next_touch: f64::INFINITY,
            steps: 0,
        };
        rest.follow_guests(lanes, work, 0.0);
        rest.arrange(lanes, work);
        rest
    }

    pub(super) fn next_touch(&self) -> f64 {
        self.next_touch
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
    }

    /// Wakes the hosts of intruders that move.
    fn follow_guests(&mut self, lanes: &Lanes, work: &mut Work, time: f64) {
        for (guest, host) in lanes.guests.hosts.iter().enumerate() {
            let moves = work.start.x[guest] != 0.0 || work.start.w[guest] != 0.0;
            let block = host / BLOCK - 1;
            if moves && self.asleep[block].is_some() {
                self.wake(work, block, time);
            }
        }
    }

    /// Notes runs of blocks that move, and intruders in them.
    fn arrange(&mut self, lanes: &Lanes, work: &mut Work) {
        work.active.clear();
        for block in (0..lanes.blocks).filter(|&block| self.asleep[block].is_none()) {
            match work.active.last_mut() {
                Some(run) if run.end == block => run.end += 1,
                _ => work.active.push(block..block + 1),
            }
        }
        work.active_guests.clear();
        for run in &work.active {
            for block in run.clone() {
                for guest in lanes.guests.of_block[block].clone() {
                    if work.active_guests.last() != Some(&(guest / BLOCK)) {
                        work.active_guests.push(guest / BLOCK);
                    }
                }
            }
        }
        self.next_touch = self.touch.iter().copied().fold(f64::INFINITY, f64::min);
    }

    /// The sleeping blocks beside the runs, each with whether it is behind the run.
    fn neighbours(lanes: &Lanes, work: &Work) -> Vec<(usize, bool)> {
        let mut neighbours = Vec::with_capacity(2 * work.active.len());
        for run in &work.active {
            if run.start > 0 {
                neighbours.push((run.start - 1, false));
            }
            if run.end < lanes.blocks {
                neighbours.push((run.end, true));
            }
        }
        neighbours
    }

    fn all_move(lanes: &Lanes, work: &Work) -> bool {
        work.active.first() == Some(&(0..lanes.blocks))
    }

    /// Wakes what a step of about `h` could reach.
    pub(super) fn before_step(&mut self, lanes: &Lanes, work: &mut Work, time: f64, h: f64) {
        if Self::all_move(lanes, work) {
            return;
        }
        loop {
            let mut woken = false;
            if time + AHEAD * h >= self.next_touch {
                // With nothing else awake, no step is lost by waiting for the collision itself.
                let until = if work.active.is_empty() {
                    time
                } else {
                    time + AHEAD * h
                };
                for block in 0..lanes.blocks {
                    if self.touch[block] <= until {
                        self.wake(work, block, time);
                        woken = true;
                    }
                }
            }
            for (block, behind) in Self::neighbours(lanes, work) {
                if self.asleep[block].is_none() {
                    continue;
                }
                self.settle(work, block, time);
                // The contact between the block and the run, and the edge of the run.
                let (lane, edge) = if behind {
                    (first(block), first(block) - WATCHED..first(block))
                } else {
                    (
                        first(block) + BLOCK,
                        first(block) + BLOCK..first(block) + BLOCK + WATCHED,
                    )
                };
                let gap = work.start.u[lane] - work.start.u[lane - 1] - lanes.rest[lane];
                let approach = work.start.v[lane - 1] - work.start.v[lane];
                let reached = if lanes.stiffness[lane] == 0.0 {
                    false
                } else if gap > 0.0 {
                    gap < AHEAD * h * approach
                } else {
                    let moved = |lane: usize| {
                        work.start.u[lane].abs() > STILL * lanes.depth
                            || work.start.v[lane].abs() > STILL * lanes.speed
                    };
                    edge.into_iter().any(moved)
                };
                if reached {
                    self.wake(work, block, time);
                    woken = true;
                }
            }
            if !woken {
                return;
            }
            self.follow_guests(lanes, work, time);
            self.arrange(lanes, work);
        }
    }

    /// Whether a step of length `h` has closed a contact with a sleeping block. The block is woken.
    pub(super) fn touched(&mut self, lanes: &Lanes, work: &mut Work, time: f64, h: f64) -> bool {
        if Self::all_move(lanes, work) {
            return false;
        }
        let mut woken = false;
        for (block, behind) in Self::neighbours(lanes, work) {
            let lane = if behind {
                first(block)
            } else {
                first(block) + BLOCK
            };
            let gap = |near: f64, far: f64| far - near - lanes.rest[lane];
            let open = gap(work.start.u[lane - 1], work.start.u[lane]) > 0.0;
            let there = |lane: usize, sleeps: bool| {
                if sleeps {
                    work.start.u[lane] + h * work.start.v[lane]
                } else {
                    work.end.u[lane]
                }
            };
            let end = gap(there(lane - 1, !behind), there(lane, behind));
            if open && end <= 0.0 && lanes.stiffness[lane] > 0.0 {
                self.wake(work, block, time);
                woken = true;
            }
        }
        if woken {
            self.follow_guests(lanes, work, time);
            self.arrange(lanes, work);
        }
        woken
    }

    /// Lets blocks fall asleep that fly freely.
    pub(super) fn after_step(&mut self, lanes: &Lanes, work: &mut Work, time: f64, h: f64) {
        self.steps += 1;
        if lanes.loaded || !self.steps.is_multiple_of(4) {
            return;
        }
        let awake = work.active.iter().flat_map(|run| run.clone());
        let free: Vec<usize> = awake
            .filter(|&block| Self::flies(lanes, work, block, h))
            .collect();
        if free.is_empty() {
            return;
        }
        for &block in &free {
            self.asleep[block] = Some(time);
            for guest in lanes.guests.of_block[block].clone() {
                (work.start.x[guest], work.start.w[guest]) = (0.0, 0.0);
            }
            work.still(block);
        }
        for block in free {
            if self.asleep[block].is_some() {
                self.touch[block] = self.meeting(lanes, work, block, time);
            }
        }
        self.arrange(lanes, work);
    }

    /// Whether no contact of a block is closed or will be soon, and no intruder in it moves.
    fn flies(lanes: &Lanes, work: &Work, block: usize, h: f64) -> bool {
        let contacts = first(block)..first(block) + BLOCK + 1;
        let open = contacts.clone().all(|lane| {
            let gap = work.start.u[lane] - work.start.u[lane - 1];
            let approach = work.start.v[lane - 1] - work.start.v[lane];
            lanes.stiffness[lane] == 0.0 || (gap > 0.0 && gap > 4.0 * AHEAD * h * approach)
        });
        let still = |guest: usize| {
            work.start.x[guest].abs() <= STILL * lanes.depth
                && work.start.w[guest].abs() <= STILL * lanes.speed
        };
        open && lanes.guests.of_block[block].clone().all(still)
    }

    /// When two bodies will meet in a sleeping block, or between it and a sleeping neighbour.
    fn meeting(&mut self, lanes: &Lanes, work: &mut Work, block: usize, time: f64) -> f64 {
        let sleeps = |rest: &Self, block: Option<usize>| {
            block.is_some_and(|block| rest.asleep.get(block).is_some_and(Option::is_some))
        };
        let (before, behind) = (block.checked_sub(1), Some(block + 1));
        for neighbour in [before, behind]
            .into_iter()
            .flatten()
            .filter(|&block| block < lanes.blocks)
        {
            self.settle(work, neighbour, time);
        }
        let mut from = first(block) + 1;
        let mut to = first(block) + BLOCK;
        if sleeps(self, before) {
            from -= 1;
        }
        if sleeps(self, behind) {
            to += 1;
        }
        (from..to)
            .filter(|&lane| lanes.stiffness[lane] > 0.0)
            .map(|lane| {
                let gap = work.start.u[lane] - work.start.u[lane - 1];
                let approach = work.start.v[lane - 1] - work.start.v[lane];
                if approach > 0.0 {
                    time + gap.max(0.0) / approach
                } else {
                    f64::INFINITY
                }
            })
            .fold(f64::INFINITY, f64::min)
    }

    /// Moves the bodies of sleeping blocks on to `time`.
    pub(super) fn fly(&self, lanes: &Lanes, time: f64, displacements: &mut [f64], v: &[f64]) {
        for (block, since) in self.asleep.iter().enumerate() {
            let Some(since) = since else { continue };
            for body in block * BLOCK..((block + 1) * BLOCK).min(lanes.bodies) {
                displacements[body] += v[BLOCK + body] * (time - since);
            }
        }
    }
}
