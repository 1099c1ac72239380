//! The choice of springs from a catalogue.
//!
//! # Design
//!
//! The springs nearest to the optimum with free stiffnesses are exchanged, one host at a time for one of the
//! two next softer or stiffer, and at neighbouring hosts both for the next. After each exchange, masses and
//! dampings are improved again, as far as the catalogue leaves them free. The choice is final when no
//! exchange gains.

use std::collections::HashSet;

use serde::Serialize;

use super::bounds::Bounds;
use super::catalogue::CatalogueSpring;
use super::error::OptimiseError;
use super::problem::{Problem, TriedDesign};
use crate::scenario::{InputError, Intruder};
use crate::simulate::SimulateError;

/// The springs that a search chose from a catalogue.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
#[non_exhaustive]
pub struct SpringChoice {
    /// The spring of each intruder, in the order of the beads.
    pub springs: Vec<CatalogueSpring>,
    /// The intruders that are best if every stiffness can be had.
    pub free: Vec<Intruder>,
    /// Their share as the search found it, to be compared with
    /// [`Optimum::share_searched`](crate::Optimum::share_searched).
    pub free_share: f64,
    /// Choices of springs tried.
    pub tried: usize,
}

/// The end of the search for springs.
pub(super) struct ChosenSprings {
    pub(super) best: TriedDesign,
    /// The spring of each host.
    pub(super) springs: Vec<CatalogueSpring>,
    /// Choices tried.
    pub(super) tried: usize,
    /// True if no exchange gains.
    pub(super) settled: bool,
}

/// Springs of the entries of a design, as places in the list of those that may be used.
type Choice = Vec<usize>;

/// Farthest spring, in the order of stiffness, for which one host's is exchanged.
const FARTHEST: isize = 2;

impl Problem<'_> {
    /// Chooses springs, beginning at the optimum with free stiffnesses.
    pub(super) fn choose_springs(
        &self,
        springs: &[&CatalogueSpring],
        free: &TriedDesign,
    ) -> Result<ChosenSprings, OptimiseError> {
        let distance = |spring: &CatalogueSpring, stiffness: f64| (spring.stiffness / stiffness).ln().abs();
        let nearest = |&[_, stiffness, _]: &[f64; 3]| {
            let places = 0..springs.len();
            let nearest = places
                .min_by(|&a, &b| distance(springs[a], stiffness).total_cmp(&distance(springs[b], stiffness)));
            nearest.expect("a catalogue without usable springs was refused")
        };
        let mut choice: Choice = free.design.intruders.iter().map(nearest).collect();
        let mut tried = HashSet::from([choice.clone()]);
        let mut best = self.with_springs(springs, &choice, free)?;
        let mut settled = true;
        'exchanges: loop {
            for other in exchanges(&choice, springs.len()) {
                if self.left() == 0 || self.stopped.get() {
                    settled = false;
                    break 'exchanges;
                }
                if !tried.insert(other.clone()) {
                    continue;
                }
                let start = if best.value.is_finite() { &best } else { free };
                let found = self.with_springs(springs, &other, start)?;
                if found.gains_on(&best) {
                    (best, choice) = (found, other);
                    continue 'exchanges;
                }
            }
            break;
        }
        if best.excess > 0.0 {
            let what = "no choice of its springs was found that keeps to the total mass and all strokes";
            let advice = "allow more mass or a longer stroke, or name another catalogue";
            return Err(OptimiseError::Search(InputError::at("catalogue", what, advice)));
        }
        let chosen = choice.iter().map(|&spring| springs[spring].clone());
        Ok(ChosenSprings {
            springs: chosen.cycle().take(self.hosts.len()).collect(),
            settled: settled && best.settled,
            tried: tried.len(),
            best,
        })
    }

    /// Improves what these springs leave free, from the masses and dampings of another design.
    fn with_springs(
        &self,
        springs: &[&CatalogueSpring],
        choice: &[usize],
        start: &TriedDesign,
    ) -> Result<TriedDesign, SimulateError> {
        let bounds: Vec<Bounds> = choice
            .iter()
            .map(|&spring| self.bounds.with(springs[spring]))
            .collect();
        let start = TriedDesign::untried(start.design.clone());
        self.descend(start, &bounds, self.left(), f64::INFINITY)
    }
}

/// All exchanges of a choice: of one spring, then of the next at two neighbouring hosts.
fn exchanges(choice: &[usize], springs: usize) -> Vec<Choice> {
    let moved = |moves: &[(usize, isize)]| -> Option<Choice> {
        let mut other = choice.to_vec();
        for &(host, by) in moves {
            other[host] = other[host]
                .checked_add_signed(by)
                .filter(|&place| place < springs)?;
        }
        Some(other)
    };
    let mut found = Vec::new();
    for by in (1..=FARTHEST).flat_map(|by| [by, -by]) {
        found.extend((0..choice.len()).filter_map(|host| moved(&[(host, by)])));
    }
    for (one, other) in [(1, -1), (-1, 1), (1, 1), (-1, -1)] {
        let pairs = 1..choice.len();
        found.extend(pairs.filter_map(|host| moved(&[(host - 1, one), (host, other)])));
    }
    found
}
