//! Steps of contacts with other powers than Hertz'. Each is open or closed for all of a step, and a step ends
//! where one opens or closes.
//!
//! # Design
//!
//! Forces that are held in one state are smooth, whatever they do where bodies meet: a dashpot's jumps there.
//! A step that passes such a place is made again up to it, which the dense output finds, and once or twice
//! more until the overlap vanishes to rounding. A contact that only touches at the start of a step counts as
//! closed unless it parts. If the step shows that this was wrong, it is made again with the other state.

use super::kernel::{Task, dispatch};
use super::lanes::{BLOCK, Lanes};
use super::work::{Work, overlap};
use crate::bisection::bisect;

/// Overlap of a contact that only touches, as a part of the scale of displacements.
const TOUCHES: f64 = 1e-12;

fn contacts(lanes: &Lanes) -> impl Iterator<Item = usize> + use<'_> {
    (BLOCK + 1..BLOCK + lanes.bodies + 1).filter(|&lane| lanes.stiffness[lane] > 0.0)
}

impl Work {
    /// [`Work::attempt`] with these contacts.
    pub(super) fn attempt_by_powers(&mut self, lanes: &Lanes, length: f64, tolerance: f64) -> f64 {
        self.close(lanes);
        self.crossings.clear();
        self.sooner = None;
        loop {
            self.wall_impulse = 0.0;
            self.ground_lost = 0.0;
            if let Some(driven) = &mut self.driven {
                driven.work = 0.0;
            }
            dispatch(self, lanes, Task::Step, length);
            if !self.turn_touching(lanes) {
                return length * dispatch(self, lanes, Task::Error { tolerance }, length);
            }
        }
    }

    /// Decides from the start of the step which contacts are closed.
    fn close(&mut self, lanes: &Lanes) {
        let least = TOUCHES * lanes.depth;
        self.touching.clear();
        for lane in contacts(lanes) {
            let (overlap, rate) = overlap(lanes, &self.start, lane);
            let touches = overlap.abs() <= least;
            let is_closed = if touches {
                rate >= -TOUCHES * lanes.speed
            } else {
                overlap > 0.0
            };
            self.closed[lane] = f64::from(u8::from(is_closed));
            if touches {
                self.touching.push(lane);
            }
        }
    }

    /// Opens contacts that touched at the start of the step and have parted, and closes those that have
    /// approached. Each turns once. Returns true if any has.
    fn turn_touching(&mut self, lanes: &Lanes) -> bool {
        let least = TOUCHES * lanes.depth;
        let (end, closed) = (&self.end, &mut self.closed);
        let before = self.touching.len();
        self.touching.retain(|&lane| {
            let (overlap, _) = overlap(lanes, end, lane);
            let wrong = if closed[lane] > 0.0 {
                overlap < -least
            } else {
                overlap > least
            };
            if wrong {
                closed[lane] = 1.0 - closed[lane];
            }
            !wrong
        });
        self.touching.len() < before
    }

    /// The contact that opens or closes first in the step, and the part of the step at which it does.
    pub(super) fn first_turn(&mut self, lanes: &Lanes, length: f64) -> Option<(usize, f64)> {
        let least = TOUCHES * lanes.depth;
        let turns = |lane: &usize| {
            let (from, _) = overlap(lanes, &self.start, *lane);
            let (to, _) = overlap(lanes, &self.end, *lane);
            let is_closed = self.closed[*lane] > 0.0;
            from.abs() > least && if is_closed { to < -least } else { to > least }
        };
        let turning: Vec<usize> = contacts(lanes).filter(turns).collect();
        if turning.is_empty() {
            return None;
        }
        self.prepare(lanes, length);
        let place = |lane: usize| {
            let glimpse = self.glimpse_contact(lanes, lane, (0.0, length), (0.0, length));
            let rest = lanes.rest[lane];
            (
                lane,
                bisect(0.0, length, |t| rest + glimpse.at(t)[0] > 0.0) / length,
            )
        };
        turning.into_iter().map(place).min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Correction of a step that ends near the place where a contact turns, s; `None` if it ends there.
    pub(super) fn way_to_turn(&self, lanes: &Lanes, lane: usize) -> Option<f64> {
        let (overlap, rate) = overlap(lanes, &self.end, lane);
        let far = overlap.abs() > 0.1 * TOUCHES * lanes.depth;
        (far && rate != 0.0).then(|| -overlap / rate)
    }
}
