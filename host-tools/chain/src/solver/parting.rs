//! Which blocks may take a longer step than a wave does, and how long.
//!
//! # Design
//!
//! The blocks that move are parted: *quick* ones take the steps that the wave needs, and *slow* ones one step
//! over the time of many of these ([`super::multirate`]). Each part computes [`SHARED`] blocks of the other
//! one beside its own, behind which it lets the beads fly freely, and forgets them in the end.
//!
//! A slow step is tried on blocks whose contacts are all *calm*, and that have no intruder: contacts that are
//! closed and change little in the step, or that are open and stay so. [`GUARD`] blocks beside others are
//! left out. Then the slow part is made of those that the step has moved without too great an error.
//!
//! # What that leaves out
//!
//! Let bead 0 be one that flies freely instead, K beads be computed and forgotten, and bead K the first that
//! is not. Let e(n, t) be the error of the displacement of bead n at the time t after the step began. A force
//! grows with the overlap and with its rate: a is the greatest slope by the overlap over a mass, g that by
//! the rate. So
//!
//! ```text
//! |e''(n)| ≤ a (|e(n-1)| + 2 |e(n)| + |e(n+1)|) + g (|e'(n-1)| + 2 |e'(n)| + |e'(n+1)|)
//! |e(0)| ≤ A t²/2   and   |e'(0)| ≤ A t                A the greatest acceleration of bead 0
//! ```
//!
//! (A/λ²) z⁻ⁿ exp(λt) makes an equation of the first if z + 2 + 1/z = λ²/(a + gλ), and it and its rate are
//! above the second. So it is above all errors, whatever λ > 0 is that gives z > 1. With λ = 2K/H, which is
//! near the best, the velocity of bead K is wrong after a step of H by at most
//!
//! ```text
//! A H/(2K) e^(2K) z^(-K)                               2.5e-9 A H for K = 8 and √a H = 2
//! ```
//!
//! A slow step is so short that this is at most the speed that a block at rest may have, [`FLOOR`] ×
//! tolerance × the striker's speed.
//!
//! Waves must not come through the guard meanwhile. A signal goes on by √(k/M) beads a second where contacts
//! have the stiffness k, and no contact is stiffer than one that has all the energy of the blocks that are
//! not calm.

use std::ops::Range;

use super::lanes::{BLOCK, Lanes, first};
use super::rest::AHEAD;
#[cfg(doc)]
use super::rest::FLOOR;
use super::work::{Motion, force};

/// Blocks beside its own that each part computes where both meet.
const SHARED: usize = 1;
/// Blocks between one that is not calm and those that the slow part computes.
const GUARD: usize = 2;
/// The fewest blocks in a row that are slow.
const FEWEST: usize = 4;
/// The part of a calm contact's overlap that a slow step may change.
const CALM: f64 = 0.25;
/// Longest slow step, over the time constant of the stiffest contact in it. The method is stable up to 3.
const STABLE: f64 = 2.5;

/// Both parts, in runs of blocks.
#[derive(Debug)]
pub(super) struct Parts {
    /// What the quick part computes.
    pub(super) quick: Vec<Range<usize>>,
    /// What the slow part gives the motion of. All else is the quick part's.
    pub(super) own: Vec<Range<usize>>,
}

/// Runs of the blocks that are marked.
fn runs(marks: &[bool]) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for block in (0..marks.len()).filter(|&block| marks[block]) {
        match runs.last_mut() {
            Some(run) if run.end == block => run.end += 1,
            _ => runs.push(block..block + 1),
        }
    }
    runs
}

pub(super) fn holds(runs: &[Range<usize>], block: usize) -> bool {
    runs.iter().any(|run| run.contains(&block))
}

/// How many blocks there are in runs.
pub(super) fn count(runs: &[Range<usize>]) -> usize {
    runs.iter().map(Range::len).sum()
}

/// Overlap of a contact and its rate.
fn overlap(lanes: &Lanes, motion: &Motion, lane: usize) -> (f64, f64) {
    (
        motion.u[lane - 1] - motion.u[lane] + lanes.rest[lane],
        motion.v[lane - 1] - motion.v[lane],
    )
}

/// Lanes of all contacts of some blocks.
fn contacts(run: &Range<usize>) -> impl Iterator<Item = usize> + use<> {
    first(run.start)..first(run.end) + 1
}

/// Whether all contacts of a block stay closed, or open, for `length`, and change little.
fn is_calm(lanes: &Lanes, motion: &Motion, block: usize, length: f64) -> bool {
    let calm = |lane: usize| {
        let (overlap, rate) = overlap(lanes, motion, lane);
        let closed = CALM * overlap >= rate.abs() * length.max(lanes.viscosity[lane]);
        let open = -overlap > AHEAD * length * rate;
        lanes.stiffness[lane] == 0.0 || if overlap > 0.0 { closed } else { open }
    };
    lanes.guests.of_block[block].is_empty() && contacts(&(block..block + 1)).all(calm)
}

/// What moves, and what of it may be computed in a slow step.
pub(super) struct Calm {
    moves: Vec<bool>,
    pub(super) runs: Vec<Range<usize>>,
}

impl Calm {
    /// Of the blocks that are awake, those that are calm for `length`.
    pub(super) fn new(lanes: &Lanes, awake: &[usize], motion: &Motion, length: f64) -> Self {
        let mut moves = vec![false; lanes.blocks];
        let mut calm = moves.clone();
        for &block in awake {
            (moves[block], calm[block]) = (true, true);
        }
        for &block in awake {
            // The clock goes on with the quick part, so the last block is always of it.
            if Some(&block) == awake.last() || !is_calm(lanes, motion, block, length) {
                calm[block.saturating_sub(GUARD)..(block + GUARD + 1).min(lanes.blocks)].fill(false);
            }
        }
        let mut runs = runs(&calm);
        runs.retain(|run| run.len() >= FEWEST);
        Self { moves, runs }
    }

    /// The longest step of up to `wanted` that is stable, ends before waves come through the guard, and
    /// leaves out no velocity above `quiet` where the calm blocks end.
    pub(super) fn longest(&self, lanes: &Lanes, motion: &Motion, quiet: f64, wanted: f64) -> f64 {
        let slopes = Slopes::of(lanes, motion, &self.runs);
        let stable = STABLE / (slopes.overlap.sqrt() + slopes.rate);
        let way = (GUARD * BLOCK) as f64;
        let mut length = wanted.min(stable).min(way / self.fastest(lanes, motion));
        while slopes.left_out(lanes, motion, &self.edges(&self.runs), length) > quiet {
            length *= 0.9;
        }
        length
    }

    /// Beads a second that no signal from blocks that are not calm surpasses.
    fn fastest(&self, lanes: &Lanes, motion: &Motion) -> f64 {
        let (mut energy, mut stiffest) = (0.0, 0.0_f64);
        let others = (0..self.moves.len()).filter(|&block| self.moves[block] && !holds(&self.runs, block));
        for lane in others.flat_map(|block| contacts(&(block..block + 1))) {
            let (u, v) = (&motion.u, &motion.v);
            let deep = overlap(lanes, motion, lane).0.max(0.0);
            energy += 0.4 * lanes.stiffness[lane] * deep * deep * deep.sqrt();
            if lanes.inverse[lane] > 0.0 {
                energy += 0.5 * v[lane] * v[lane] / lanes.inverse[lane];
            }
            if let Some(guest) = lanes.guests.of(lane) {
                let (seat, at) = (lanes.guests.seat(guest), lanes.guests.lane(guest));
                let speed = v[lane] + v[at];
                energy += 0.5 * speed * speed / lanes.guests.inverse[seat];
                energy += 0.5 * lanes.guests.stiffness[seat] * u[at] * u[at];
            }
            let inverse = lanes.inverse[lane - 1].max(lanes.inverse[lane]);
            // (2/5) κ δ^(5/2) is the energy, (3/2) κ √δ the stiffness: it goes as κ^(4/5).
            stiffest = stiffest.max(lanes.stiffness[lane].powf(0.8) * inverse);
        }
        (1.5 * stiffest * (2.5 * energy).powf(0.2)).sqrt()
    }

    fn moves(&self, block: usize) -> bool {
        self.moves.get(block) == Some(&true)
    }

    /// Beads beside runs that begin or end where more moves: a part lets them fly freely.
    fn edges(&self, runs: &[Range<usize>]) -> Vec<usize> {
        let mut lanes = Vec::new();
        for run in runs {
            if self.moves(run.start.wrapping_sub(1)) {
                lanes.push(first(run.start) - 1);
            }
            if self.moves(run.end) {
                lanes.push(first(run.end));
            }
        }
        lanes
    }

    /// The blocks of a run without those at ends where more moves.
    fn inner(&self, run: &Range<usize>) -> Range<usize> {
        let shared = |block: usize| if self.moves(block) { SHARED } else { 0 };
        run.start + shared(run.start.wrapping_sub(1))..run.end - shared(run.end)
    }

    /// The parts, after a slow step of `length` with these errors of its blocks. None if the quick part would
    /// leave out a velocity above `quiet`.
    pub(super) fn parts(
        &self,
        lanes: &Lanes,
        motion: &Motion,
        (quiet, length): (f64, f64),
        errors: &[f64],
    ) -> Option<Parts> {
        let mut good = vec![false; self.moves.len()];
        for block in self.runs.iter().flat_map(|run| self.inner(run)) {
            good[block] = length * errors[block] <= 1.0;
        }
        let mut own = runs(&good);
        own.retain(|run| run.len() >= FEWEST);
        let mut quick = self.moves.clone();
        for run in &own {
            quick[self.inner(run)].fill(false);
        }
        let quick = runs(&quick);
        let slopes = Slopes::of(lanes, motion, &self.runs);
        let left_out = slopes.left_out(lanes, motion, &self.edges(&quick), length);
        (left_out <= quiet).then_some(Parts { quick, own })
    }
}

/// How contacts answer: slopes of a force by the overlap and by its rate over a mass, 1/s² and 1/s.
#[derive(Debug, Clone, Copy)]
struct Slopes {
    overlap: f64,
    rate: f64,
}

impl Slopes {
    /// The greatest of calm blocks.
    fn of(lanes: &Lanes, motion: &Motion, runs: &[Range<usize>]) -> Self {
        // Compared as squares: a root for each takes longer than all else.
        let (mut overlaps, mut rates) = (0.0_f64, 0.0_f64);
        for lane in runs.iter().flat_map(contacts) {
            let inverse = lanes.inverse[lane - 1].max(lanes.inverse[lane]);
            let stiff = lanes.stiffness[lane] * inverse;
            let square = stiff * stiff * overlap(lanes, motion, lane).0.max(0.0);
            overlaps = overlaps.max(square);
            rates = rates.max(square * lanes.viscosity[lane] * lanes.viscosity[lane]);
        }
        // A calm contact may become deeper by a quarter, and by its rate stiffer by an eighth.
        Self {
            overlap: 1.26 * 1.5 * overlaps.sqrt(),
            rate: 1.12 * rates.sqrt(),
        }
    }

    /// The velocity that a step leaves out if it lets these beads fly freely.
    fn left_out(self, lanes: &Lanes, motion: &Motion, beads: &[usize], length: f64) -> f64 {
        const BEADS: usize = SHARED * BLOCK;
        const E: f64 = std::f64::consts::E;
        let rate = 2.0 * BEADS as f64 / length;
        let sum = rate * rate / (self.overlap + self.rate * rate) - 2.0;
        if sum <= 2.0 {
            return f64::INFINITY;
        }
        let z = 0.5 * (sum + (sum * sum - 4.0).sqrt());
        let acceleration = |&lane: &usize| {
            let push = force(lanes, lane, motion) - force(lanes, lane + 1, motion);
            let rates = overlap(lanes, motion, lane).1.abs() + overlap(lanes, motion, lane + 1).1.abs();
            // Now, and what rates of up to twice these make of it.
            push.abs() * lanes.inverse[lane] + 2.0 * self.overlap * rates * length
        };
        let most = beads.iter().map(acceleration).fold(0.0, f64::max);
        most / rate * (E * E / z).powi(BEADS as i32)
    }
}

#[cfg(test)]
mod tests;
