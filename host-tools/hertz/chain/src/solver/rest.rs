//! Blocks of beads that need no computation: those that the wave has not reached, and those that it has left.
//!
//! # Design
//!
//! A block sleeps while none of its contacts carries a force that matters and none of its intruders moves.
//! There are two such states of a contact. It is *open*: its bodies fly freely, so the time of their next
//! meeting is known. Or it is *quiet*: its speed and overlap are below the error that a single step may make
//! ([`FLOOR`] times the tolerance), and its bodies go on at their common speed, or stand still if that speed
//! too is quiet. A wave in an elastic chain leaves only such motion behind. The error of a body's velocity is
//! at most FLOOR × tolerance × the striker's speed, once for each wave that passes.
//!
//! Ahead of a wave, each bead moves as the motion of the bead before it to the power 3/2. A block in contact
//! therefore wakes when the third bead before it is no longer quiet: the neglected motion is then far below
//! rounding.
//!
//! A step looks only at awake blocks and their neighbours: a pulse costs the same in a chain of any length.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::ops::Range;

use super::lanes::{BLOCK, Lanes, first};
use super::work::Work;

/// Error that any step may make, as a part of the tolerance times the striker's speed.
pub(super) const FLOOR: f64 = 0.01;
/// Motion below the rounding of an `f64`, as a part of its scale.
const STILL: f64 = 1e-16;
/// Watched beads at the edge of a block.
const WATCHED: usize = 3;
/// Steps before a collision at which a block wakes.
pub(super) const AHEAD: f64 = 3.0;

/// Returns the least overlap, m, at which a contact has the energy of its lighter body at the speed `quiet`.
fn shallow(lanes: &Lanes, quiet: f64) -> f64 {
    let inverse = |lane: usize| lanes.inverse[lane - 1].max(lanes.inverse[lane]);
    let rates = (1..lanes.len()).map(|lane| lanes.stiffness[lane] * inverse(lane));
    (1.25 * quiet * quiet / rates.fold(0.0, f64::max)).powf(0.4)
}

/// The blocks beside runs of blocks of a chain, each with true if it is behind its run.
pub(super) fn beside(runs: &[Range<usize>], blocks: usize) -> impl Iterator<Item = (usize, bool)> {
    runs.iter().flat_map(move |run| {
        let before = run.start.checked_sub(1).map(|block| (block, false));
        let behind = (run.end < blocks).then_some((run.end, true));
        before.into_iter().chain(behind)
    })
}

/// The blocks that sleep, and those that are awake.
#[derive(Debug, Clone)]
pub(super) struct RestingBlocks {
    /// Time since which each block is asleep, s.
    asleep: Vec<Option<f64>>,
    /// Blocks that are awake, in order.
    pub(super) awake: Vec<usize>,
    /// Blocks that another step moves ([`super::multirate`]), in order.
    elsewhere: Vec<usize>,
    /// Time at which two bodies of a sleeping block, or of it and a sleeping neighbour, will meet, s.
    touch: Vec<f64>,
    /// Queue of these times, as bits, which have the same order, with their blocks. An entry that differs
    /// from `touch` is out of date.
    queue: BinaryHeap<Reverse<(u64, usize)>>,
    /// Speed, m/s, and overlap, m, of a contact that may be neglected.
    quiet: f64,
    shallow: f64,
    steps: u64,
    /// A block of bodies that also holds intruders, and the blocks of their hosts.
    home: Option<(usize, Vec<usize>)>,
    /// Steps from one search for blocks that may sleep to the next.
    patience: u64,
}

impl RestingBlocks {
    /// Puts blocks at rest to sleep at `time`.
    pub(super) fn new(lanes: &Lanes, work: &mut Work, time: f64, tolerance: f64) -> Self {
        let moves = |block: usize| {
            let lanes = first(block)..first(block) + BLOCK;
            let mut motion = work.start.u[lanes.clone()].iter().chain(&work.start.v[lanes]);
            motion.any(|value| *value != 0.0)
        };
        let mut moves: Vec<bool> = (0..lanes.blocks).map(moves).collect();
        moves[0] |= lanes.drive.is_some();
        if lanes.powers.is_some() {
            moves.fill(true);
        }
        for (guest, host) in lanes.guests.hosts.iter().enumerate() {
            let lane = lanes.guests.lane(guest);
            moves[host / BLOCK - 1] |= work.start.u[lane] != 0.0 || work.start.v[lane] != 0.0;
        }
        let hosts = lanes.guests.hosts.iter().map(|host| host / BLOCK - 1);
        let home = lanes.guests.home.map(|home| (home, hosts.collect::<Vec<_>>()));
        if let Some((home, hosts)) = &home {
            moves[*home] |= hosts.iter().any(|&host| moves[host]);
        }
        let quiet = (FLOOR * tolerance).max(STILL) * lanes.speed;
        let mut rest = Self {
            home,
            asleep: moves.iter().map(|moves| (!moves).then_some(time)).collect(),
            awake: (0..lanes.blocks).filter(|&block| moves[block]).collect(),
            elsewhere: Vec::new(),
            touch: vec![f64::INFINITY; lanes.blocks],
            queue: BinaryHeap::new(),
            quiet,
            shallow: shallow(lanes, quiet),
            steps: 0,
            patience: 4,
        };
        rest.arrange(lanes, work);
        rest
    }

    /// Wakes all blocks and keeps them awake.
    #[cfg(test)]
    pub(super) fn keep_awake(&mut self, lanes: &Lanes, work: &mut Work, time: f64) {
        for block in 0..lanes.blocks {
            if self.asleep[block].is_some() {
                self.wake(work, block, time);
            }
        }
        self.patience = u64::MAX;
        self.arrange(lanes, work);
    }

    /// Time of the next collision in a sleeping block, s.
    pub(super) fn next_touch(&mut self) -> f64 {
        while let Some(Reverse((bits, block))) = self.queue.peek() {
            if self.touch[*block].to_bits() == *bits {
                return f64::from_bits(*bits);
            }
            self.queue.pop();
        }
        f64::INFINITY
    }

    /// Moves the bodies of a sleeping block on to `time`.
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
        if let Some((home, hosts)) = &self.home {
            let home = *home;
            if self.asleep[home].is_some() && hosts.contains(&block) {
                self.wake(work, home, time);
            }
        }
    }

    /// Writes the runs of moving blocks and the blocks of moving intruders to `work`.
    fn arrange(&mut self, lanes: &Lanes, work: &mut Work) {
        work.active.clear();
        work.active_guests.clear();
        let mut elsewhere = self.elsewhere.iter().peekable();
        for &block in &self.awake {
            if elsewhere.next_if_eq(&&block).is_some() {
                continue;
            }
            match work.active.last_mut() {
                Some(run) if run.end == block => run.end += 1,
                _ => work.active.push(block..block + 1),
            }
            for guest in lanes.guests.of_block[block].clone() {
                let within = lanes.guests.lane(guest) / BLOCK;
                if work.active_guests.last() != Some(&within) {
                    work.active_guests.push(within);
                }
            }
        }
    }

    /// Assigns the blocks of `elsewhere` to another step, and all others that are awake to this one.
    pub(super) fn leave(&mut self, lanes: &Lanes, work: &mut Work, elsewhere: Vec<usize>) {
        self.elsewhere = elsewhere;
        self.arrange(lanes, work);
    }

    /// Returns true if a block sleeps and the run beside it soon moves it. Brings a sleeping block to `time`.
    pub(super) fn meets(
        &mut self,
        lanes: &Lanes,
        work: &mut Work,
        block: usize,
        behind: bool,
        (time, h): (f64, f64),
    ) -> bool {
        self.settle(work, block, time);
        self.asleep[block].is_some() && self.reaches(lanes, work, block, behind, h)
    }

    fn all_move(&self, lanes: &Lanes) -> bool {
        self.awake.len() == lanes.blocks
    }

    /// Wakes the blocks that a step of about `h` could reach.
    pub(super) fn before_step(&mut self, lanes: &Lanes, work: &mut Work, time: f64, h: f64) {
        if self.all_move(lanes) {
            return;
        }
        loop {
            let before = self.awake.len();
            // With nothing else awake, the next step may end at the collision itself.
            let alone = work.active.is_empty();
            let until = if alone { time } else { time + AHEAD * h };
            while self.next_touch() <= until
                && let Some(Reverse((_, block))) = self.queue.pop()
            {
                self.wake(work, block, time);
            }
            let active = std::mem::take(&mut work.active);
            for (block, behind) in beside(&active, lanes.blocks) {
                if self.meets(lanes, work, block, behind, (time, h)) {
                    self.wake(work, block, time);
                }
            }
            work.active = active;
            if self.awake.len() == before {
                return;
            }
            self.arrange(lanes, work);
        }
    }

    /// Returns true if a run soon moves the sleeping block beside it.
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
        if lanes.loaded {
            // A loaded chain is linear, so weak motion propagates too.
            let (far, fast) = (STILL * lanes.depth, STILL * lanes.speed);
            return edge
                .into_iter()
                .any(|lane| u[lane].abs() > far || v[lane].abs() > fast);
        }
        let gap = u[lane] - u[lane - 1];
        let approach = v[lane - 1] - v[lane];
        if gap > 0.0 {
            return approach > self.quiet && gap < AHEAD * h * approach;
        }
        let of_block = if behind { lane } else { lane - 1 };
        let quick = |lane: usize| (v[lane] - v[of_block]).abs() > 2.0 * self.quiet;
        gap < -4.0 * self.shallow || edge.into_iter().any(quick)
    }

    /// Returns true if a step of length `h` has closed the contact of a sleeping block with the run beside
    /// it.
    pub(super) fn closes(&self, lanes: &Lanes, work: &Work, block: usize, behind: bool, h: f64) -> bool {
        let lane = first(block) + if behind { 0 } else { BLOCK };
        let gap = |near: f64, far: f64| far - near - lanes.rest[lane];
        let start = gap(work.start.u[lane - 1], work.start.u[lane]);
        let there = |lane: usize, sleeps: bool| {
            let flown = work.start.u[lane] + h * work.start.v[lane];
            if sleeps { flown } else { work.end.u[lane] }
        };
        let end = gap(there(lane - 1, !behind), there(lane, behind));
        let closes = start > 0.0 && end <= 0.0 && start - end > h * self.quiet;
        closes && lanes.stiffness[lane] > 0.0 && self.asleep[block].is_some()
    }

    /// Wakes the blocks with which a step of length `h` has closed a contact, and returns true if there are
    /// any.
    pub(super) fn touched(&mut self, lanes: &Lanes, work: &mut Work, time: f64, h: f64) -> bool {
        if self.all_move(lanes) {
            return false;
        }
        let before = self.awake.len();
        let active = std::mem::take(&mut work.active);
        for (block, behind) in beside(&active, lanes.blocks) {
            if self.closes(lanes, work, block, behind, h) {
                self.wake(work, block, time);
            }
        }
        work.active = active;
        let woken = self.awake.len() > before;
        if woken {
            self.arrange(lanes, work);
        }
        woken
    }

    /// Puts blocks to sleep that fly freely or hardly move.
    pub(super) fn after_step(&mut self, lanes: &Lanes, work: &mut Work, time: f64, h: f64) {
        self.steps += 1;
        if lanes.loaded
            || lanes.drive.is_some()
            || lanes.drag.is_some()
            || lanes.powers.is_some()
            || !self.steps.is_multiple_of(self.patience)
        {
            return;
        }
        let before = self.awake.len();
        let mut awake = std::mem::take(&mut self.awake);
        let mut fallen = Vec::new();
        awake.retain(|&block| {
            if !self.may_sleep(lanes, work, block, h) {
                return true;
            }
            self.join(lanes, work, block);
            for guest in lanes.guests.of_block[block].clone() {
                let lane = lanes.guests.lane(guest);
                (work.start.u[lane], work.start.v[lane]) = (0.0, 0.0);
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

    fn guests_are_quiet(&self, lanes: &Lanes, work: &Work, block: usize) -> bool {
        lanes.guests.of_block[block].clone().all(|guest| {
            let (lane, seat) = (lanes.guests.lane(guest), lanes.guests.seat(guest));
            let (x, w) = (work.start.u[lane], work.start.v[lane]);
            let stiffness = lanes.guests.stiffness[seat] + 0.5 * lanes.guests.cubic(seat) * x * x;
            let elastic = stiffness * lanes.guests.inverse[seat] * x * x;
            w.abs() <= self.quiet && elastic <= self.quiet * self.quiet
        })
    }

    /// Returns true if every contact of a block is quiet or stays open, and its intruders are quiet.
    fn may_sleep(&self, lanes: &Lanes, work: &Work, block: usize, h: f64) -> bool {
        let may = |lane: usize| {
            let gap = work.start.u[lane] - work.start.u[lane - 1];
            let approach = work.start.v[lane - 1] - work.start.v[lane];
            let open = gap > 0.0 && gap > 4.0 * AHEAD * h * approach;
            let quiet = gap >= -self.shallow && approach.abs() <= self.quiet;
            lanes.stiffness[lane] == 0.0 || open || quiet
        };
        let holds = |(home, hosts): &(usize, Vec<usize>)| {
            let awake = |host: &usize| *host != block && self.asleep[*host].is_none();
            *home == block && hosts.iter().any(awake)
        };
        !self.home.as_ref().is_some_and(holds)
            && (first(block)..=first(block + 1)).all(may)
            && self.guests_are_quiet(lanes, work, block)
    }

    /// Gives bodies of a block in quiet contact their common velocity, and stops those that hardly move.
    fn join(&self, lanes: &Lanes, work: &mut Work, block: usize) {
        let (u, v) = (&work.start.u, &mut work.start.v);
        let mut from = first(block);
        for lane in from + 1..=first(block + 1) {
            let joined = lane < first(block + 1)
                && lanes.stiffness[lane] > 0.0
                && lanes.inverse[lane] > 0.0
                && u[lane] <= u[lane - 1]
                && (v[lane - 1] - v[lane]).abs() <= self.quiet;
            if joined {
                continue;
            }
            if lanes.inverse[from] > 0.0 {
                let momentum: f64 = (from..lane).map(|lane| v[lane] / lanes.inverse[lane]).sum();
                let mass: f64 = (from..lane).map(|lane| 1.0 / lanes.inverse[lane]).sum();
                let alone = lane == from + 1;
                let speed = if alone { v[from] } else { momentum / mass };
                v[from..lane].fill(if speed.abs() <= self.quiet { 0.0 } else { speed });
            }
            from = lane;
        }
    }

    /// Time at which two bodies will meet in a sleeping block, or between it and a sleeping neighbour, s.
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
            if lanes.stiffness[lane] == 0.0 || approach <= 0.0 {
                f64::INFINITY
            } else if approach > self.quiet {
                time + gap.max(0.0) / approach
            } else {
                // It may be neglected until the overlap matters.
                time + (gap + 4.0 * self.shallow).max(0.0) / approach
            }
        };
        (from..to).map(meet).fold(f64::INFINITY, f64::min)
    }

    /// Returns true if a body is in a moving block.
    pub(super) fn moves(&self, lane: usize) -> bool {
        self.asleep[lane / BLOCK - 1].is_none()
    }

    /// Displacement of a sleeping body at `time`, m.
    pub(super) fn place(&self, work: &Work, lane: usize, time: f64) -> f64 {
        let since = self.asleep[lane / BLOCK - 1].unwrap_or(time);
        work.start.u[lane] + work.start.v[lane] * (time - since)
    }
}

#[cfg(test)]
mod tests;
