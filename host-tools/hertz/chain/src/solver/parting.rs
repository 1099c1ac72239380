//! Division of the moving blocks into those that need quick steps and those that may take a longer one.
//!
//! # Design
//!
//! The moving blocks are divided: *quick* blocks take the steps that the wave needs, and *slow* blocks one
//! step over the time of many of these ([`super::multirate`]). Each part also computes [`SHARED`] blocks of
//! the other, behind which it lets the beads fly freely, and discards them in the end.
//!
//! A slow step is tried on *calm* blocks without intruders: those whose contacts are closed and change little
//! in the step, or stay open. [`GUARD`] blocks beside others are left out. The slow part then consists of the
//! blocks that this step has moved without too large an error.
//!
//! # The error
//!
//! Let bead 0 be one that flies freely instead, let K beads be computed and discarded, and let bead K be the
//! first that is kept. Let e(n, t) be the error of the displacement of bead n at the time t after the step
//! began. A force grows with the overlap and with its rate: a is the greatest slope with the overlap over a
//! mass, g that with the rate. Then
//!
//! ```text
//! |e''(n)| ≤ a (|e(n-1)| + 2 |e(n)| + |e(n+1)|) + g (|e'(n-1)| + 2 |e'(n)| + |e'(n+1)|)
//! |e(0)| ≤ A t²/2   and   |e'(0)| ≤ A t                A the greatest acceleration of bead 0
//! ```
//!
//! (A/λ²) z⁻ⁿ exp(λt) turns the first line into an equation if z + 2 + 1/z = λ²/(a + gλ), and it exceeds the
//! second line, as does its rate. It is therefore an upper bound of all errors, for any λ > 0 with z > 1.
//! With λ = 2K/H, which is near the best, the error of the velocity of bead K after a step of H is at most
//!
//! ```text
//! A H/(2K) e^(2K) z^(-K)                               2.5e-9 A H for K = 8 and √a H = 2
//! ```
//!
//! A slow step is short enough that this is at most the speed that a block at rest may have, [`FLOOR`] ×
//! tolerance × the striker's speed.
//!
//! Waves must not cross the guard meanwhile. A signal travels at √(k/M) beads a second where contacts have
//! the stiffness k, and no contact is stiffer than one that holds all the energy of the blocks that are not
//! calm.

use std::ops::Range;

use super::lanes::{BLOCK, Lanes, first};
use super::rest::AHEAD;
#[cfg(doc)]
use super::rest::FLOOR;
use super::work::{Motion, force, overlap};

/// Blocks of the other part that each part computes at their border.
const SHARED: usize = 1;
/// Blocks between one that is not calm and those of the slow part.
const GUARD: usize = 2;
/// Fewest slow blocks in a row.
const FEWEST: usize = 4;
/// Part of a calm contact's overlap that a slow step may change.
const CALM: f64 = 0.25;
/// Longest slow step, over the time constant of its stiffest contact. The method is stable up to 3.
const STABLE: f64 = 2.5;

/// The two parts, in runs of blocks.
#[derive(Debug)]
pub(super) struct BlockParts {
    /// Blocks that the quick part computes.
    pub(super) quick: Vec<Range<usize>>,
    /// Blocks whose motion the slow part gives. All others belong to the quick part.
    pub(super) own: Vec<Range<usize>>,
}

/// Returns the runs of marked blocks.
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

/// Number of blocks in runs.
pub(super) fn count(runs: &[Range<usize>]) -> usize {
    runs.iter().map(Range::len).sum()
}

/// Lanes of the contacts of some blocks.
fn contacts(run: &Range<usize>) -> impl Iterator<Item = usize> + use<> {
    first(run.start)..first(run.end) + 1
}

/// Returns true if a block has no intruder and all its contacts stay open, or closed with little change.
fn is_calm(lanes: &Lanes, motion: &Motion, block: usize, length: f64) -> bool {
    let calm = |lane: usize| {
        let (overlap, rate) = overlap(lanes, motion, lane);
        let closed = CALM * overlap >= rate.abs() * length.max(lanes.viscosity[lane]);
        let open = -overlap > AHEAD * length * rate;
        lanes.stiffness[lane] == 0.0 || if overlap > 0.0 { closed } else { open }
    };
    lanes.guests.of_block[block].is_empty() && contacts(&(block..block + 1)).all(calm)
}

/// Moving blocks, and the runs among them that a slow step may compute.
pub(super) struct Calm {
    moves: Vec<bool>,
    pub(super) runs: Vec<Range<usize>>,
}

impl Calm {
    /// Finds the blocks among those awake that are calm for `length`.
    pub(super) fn new(lanes: &Lanes, awake: &[usize], motion: &Motion, length: f64) -> Self {
        let mut moves = vec![false; lanes.blocks];
        let mut calm = moves.clone();
        for &block in awake {
            (moves[block], calm[block]) = (true, true);
        }
        for &block in awake {
            // The quick part advances the clock, so the last block always belongs to it.
            if Some(&block) == awake.last() || !is_calm(lanes, motion, block, length) {
                calm[block.saturating_sub(GUARD)..(block + GUARD + 1).min(lanes.blocks)].fill(false);
            }
        }
        let mut runs = runs(&calm);
        runs.retain(|run| run.len() >= FEWEST);
        Self { moves, runs }
    }

    /// Returns the longest step of up to `wanted` that is stable, ends before waves cross the guard, and
    /// causes no error of a velocity above `quiet` at the ends of the calm blocks.
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

    /// Upper bound of the speed of signals from blocks that are not calm, beads/s.
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
            for guest in lanes.guests.in_body(lane) {
                let (seat, at) = (lanes.guests.seat(guest), lanes.guests.lane(guest));
                let mut speed = v[lane] + v[at];
                let mut inner = guest;
                while let Some(carrier) = lanes.guests.carriers[inner] {
                    speed += v[lanes.guests.lane(carrier)];
                    inner = carrier;
                }
                energy += 0.5 * speed * speed / lanes.guests.inverse[seat];
                let stiffness = lanes.guests.stiffness[seat] + 0.5 * lanes.guests.cubic(seat) * u[at] * u[at];
                energy += 0.5 * stiffness * u[at] * u[at];
            }
            let inverse = lanes.inverse[lane - 1].max(lanes.inverse[lane]);
            // With the energy (2/5) κ δ^(5/2) and the stiffness (3/2) κ √δ, the stiffness goes as κ^(4/5).
            stiffest = stiffest.max(lanes.stiffness[lane].powf(0.8) * inverse);
        }
        (1.5 * stiffest * (2.5 * energy).powf(0.2)).sqrt()
    }

    fn moves(&self, block: usize) -> bool {
        self.moves.get(block) == Some(&true)
    }

    /// Returns the beads beside runs, on sides where more blocks move: a part lets them fly freely.
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

    /// Returns the blocks of a run without the shared ones at ends where more blocks move.
    fn inner(&self, run: &Range<usize>) -> Range<usize> {
        let shared = |block: usize| if self.moves(block) { SHARED } else { 0 };
        run.start + shared(run.start.wrapping_sub(1))..run.end - shared(run.end)
    }

    /// Divides the blocks after a slow step of `length` with these errors. `None` if the quick part would
    /// have an error of a velocity above `quiet`.
    pub(super) fn parts(
        &self,
        lanes: &Lanes,
        motion: &Motion,
        (quiet, length): (f64, f64),
        errors: &[f64],
    ) -> Option<BlockParts> {
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
        (left_out <= quiet).then_some(BlockParts { quick, own })
    }
}

/// Slopes of a contact force with the overlap, 1/s², and with its rate, 1/s, both over a mass.
#[derive(Debug, Clone, Copy)]
struct Slopes {
    overlap: f64,
    rate: f64,
}

impl Slopes {
    /// Returns the greatest slopes in calm blocks.
    fn of(lanes: &Lanes, motion: &Motion, runs: &[Range<usize>]) -> Self {
        // Compared as squares, because a root for each would take longer than all else.
        let (mut overlaps, mut rates) = (0.0_f64, 0.0_f64);
        for lane in runs.iter().flat_map(contacts) {
            let inverse = lanes.inverse[lane - 1].max(lanes.inverse[lane]);
            let stiff = lanes.stiffness[lane] * inverse;
            let square = stiff * stiff * overlap(lanes, motion, lane).0.max(0.0);
            overlaps = overlaps.max(square);
            rates = rates.max(square * lanes.viscosity[lane] * lanes.viscosity[lane]);
        }
        // A calm contact may become deeper by a quarter, and thereby stiffer by an eighth.
        Self {
            overlap: 1.26 * 1.5 * overlaps.sqrt(),
            rate: 1.12 * rates.sqrt(),
        }
    }

    /// Returns the error of a velocity if a step lets these beads fly freely, m/s.
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
            // The present acceleration, and its change by rates of up to twice the present ones.
            push.abs() * lanes.inverse[lane] + 2.0 * self.overlap * rates * length
        };
        let most = beads.iter().map(acceleration).fold(0.0, f64::max);
        most / rate * (E * E / z).powi(BEADS as i32)
    }
}

#[cfg(test)]
mod tests;
