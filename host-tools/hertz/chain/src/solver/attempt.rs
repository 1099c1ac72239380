//! Attempts of a step, and the search for kinks of clipped forces.

use super::kernel::{Task, dispatch};
use super::lanes::{Lanes, first};
use super::method::NODES;
use super::verner::MAIN;
use super::work::{Motion, Work, clear, give, overlap};

impl Work {
    /// Makes a step of `length` from the start, and stores its end. Returns its error; 1 is allowed.
    pub(super) fn attempt(&mut self, lanes: &Lanes, length: f64, tolerance: f64) -> f64 {
        if lanes.powers.is_some() {
            return self.attempt_by_powers(lanes, length, tolerance);
        }
        self.wall_impulse = 0.0;
        self.ground_lost = 0.0;
        let crossed = dispatch(self, lanes, Task::Step, length);
        self.crossings.clear();
        self.sooner = None;
        if crossed > 0.0 || lanes.clipped {
            dispatch(self, lanes, Task::Cross { tolerance }, length);
        }
        length * dispatch(self, lanes, Task::Error { tolerance }, length)
    }

    /// Prepares [`Work::interpolate`] for the step that [`Work::attempt`] made last.
    pub(super) fn prepare(&mut self, lanes: &Lanes, length: f64) {
        let crossings = std::mem::take(&mut self.crossings);
        for (stage, node) in NODES.into_iter().enumerate().skip(MAIN) {
            if let Some(added) = &mut self.added {
                for crossing in &crossings {
                    let change = crossing.integrals(node).over(length);
                    give(lanes, added, crossing.lane, change);
                }
            }
            dispatch(self, lanes, Task::Inner { stage }, length);
            if let Some(added) = &mut self.added {
                for crossing in &crossings {
                    clear(lanes, added, crossing.lane);
                }
            }
            for crossing in &crossings {
                let (force, power) = crossing.force(node);
                self.take(lanes, crossing.lane, stage, &[force], &[power]);
            }
        }
        self.crossings = crossings;
    }

    /// Computes displacements and velocities at the part `x` of the step, into [`Work::stage`].
    pub(super) fn interpolate(&mut self, lanes: &Lanes, length: f64, x: f64) {
        dispatch(self, lanes, Task::Interpolate { x }, length);
        for crossing in &self.crossings {
            let integrals = crossing.integrals(x);
            give(lanes, &mut self.stage, crossing.lane, integrals.over(length));
        }
    }

    /// Returns the part of the last step at which the force of a contact is first clipped at zero, or no
    /// longer clipped; `None` if that is at an end of the step. The force has a kink there, which the error
    /// estimate misses if it falls between two stages.
    pub(super) fn first_kink(&mut self, lanes: &Lanes, length: f64) -> Option<f64> {
        // True if a contact is closed, and true if its force, here without the factor κ √δ, is above zero.
        let of = |motion: &Motion, lane: usize| {
            let (overlap, approach) = overlap(lanes, motion, lane);
            (overlap > 0.0, overlap + lanes.viscosity[lane] * approach > 0.0)
        };
        let pushes = |motion: &Motion, lane: usize| of(motion, lane) == (true, true);
        let cut_off = |motion: &Motion, lane: usize| of(motion, lane) == (true, false);
        let turns = |&lane: &usize| {
            let (starts, ends) = (pushes(&self.start, lane), pushes(&self.end, lane));
            let (was_cut, is_cut) = (cut_off(&self.start, lane), cut_off(&self.end, lane));
            // An open contact has no kink where it closes, nor a clipped one where it opens.
            (starts && !ends) || (was_cut && ends) || (is_cut && !was_cut)
        };
        let turning: Vec<usize> = self
            .active
            .iter()
            .flat_map(|blocks| first(blocks.start) + 1..first(blocks.end))
            .filter(|&lane| lanes.stiffness[lane] > 0.0 && lanes.viscosity[lane] > 0.0)
            .filter(turns)
            .collect();
        if turning.is_empty() {
            return None;
        }
        self.prepare(lanes, length);
        let mut earliest = 1.0_f64;
        for lane in turning {
            // A contact that closes and is clipped in one step pushes in between.
            let by_cut = cut_off(&self.end, lane);
            let turned = |motion: &Motion| of(motion, lane) == (true, !by_cut);
            let before = turned(&self.start);
            let (mut low, mut high) = (0.0, 1.0);
            while high - low > 1e-12 {
                let middle = 0.5 * (low + high);
                self.interpolate(lanes, length, middle);
                if turned(&self.stage) == before {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            earliest = earliest.min(high);
        }
        // A kink at the very start is the end of the last step; at one at the very end, this step ends.
        (earliest > 1e-6 && earliest < 1.0 - 1e-6).then_some(earliest)
    }
}
