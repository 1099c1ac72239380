//! Search for the greatest force of chosen contacts, and for the strokes of intruders, while a group runs.

use super::eight::LANES;
use crate::model::Contact;

/// Greatest force so far, N, and its time, s, of one contact in each lane.
#[derive(Debug, Clone)]
pub(super) struct ForcePeaks {
    pub(super) contact: usize,
    pub(super) greatest: [(f64, f64); LANES],
}

/// Overlap of a contact or displacement of an intruder, m, its rate, m/s, and its acceleration, m/s².
pub(super) type PlaceState = [f64; 3];

impl ForcePeaks {
    /// Searches a step of one lane that begins at `time`. The overlap is the polynomial of fifth order
    /// between its ends.
    pub(super) fn search(
        &mut self,
        lane: usize,
        contact: &Contact,
        (time, length): (f64, f64),
        (start, end): (PlaceState, PlaceState),
    ) {
        let known = self.greatest[lane].0;
        let force = |[overlap, rate, _]: PlaceState| {
            contact.elastic_force(overlap) + contact.viscous_force(overlap, rate)
        };
        let (first, last) = (force(start), force(end));
        if first.max(last) > known {
            let (force, part) = if last > first { (last, 1.0) } else { (first, 0.0) };
            self.greatest[lane] = (force, time + part * length);
        }
        // A top worth a search lies between ends that are not far below it.
        if !(start[0] > 0.0 && end[0] > 0.0 && 2.0 * first.max(last) > known) {
            return;
        }
        if !(force_rate(contact, start) > 0.0 && force_rate(contact, end) < 0.0) {
            return;
        }
        let overlap = polynomial(length, start, end);
        let inside = |x: f64| {
            let (value, slope) = at(&overlap, x);
            force([value, slope / length, 0.0])
        };
        let (part, force) = top(inside);
        if force > self.greatest[lane].0 {
            self.greatest[lane] = (force, time + part * length);
        }
    }
}

/// Returns the greatest |x| of an intruder in a step of this length, or `known` if that is greater.
pub(super) fn farthest(known: f64, length: f64, (start, end): (PlaceState, PlaceState)) -> f64 {
    let ends = start[0].abs().max(end[0].abs());
    let turns = start[1] * end[1] < 0.0;
    // A turn worth a search lies between ends that are not far below the known value.
    if !turns || 2.0 * ends < known {
        return known.max(ends);
    }
    let place = polynomial(length, start, end);
    let outwards = start[1].signum();
    let (_, turn) = top(|x| outwards * at(&place, x).0);
    known.max(ends).max(turn)
}

fn force_rate(contact: &Contact, [overlap, rate, bend]: PlaceState) -> f64 {
    let root = overlap.sqrt();
    root * rate + contact.relaxation * (0.5 * rate * rate / root + root * bend)
}

/// Coefficients of the polynomial of the part of a step with these values at its ends.
pub(super) fn polynomial(length: f64, start: PlaceState, end: PlaceState) -> [f64; 6] {
    let (h, square) = (length, length * length);
    let (p0, p1, p2) = (start[0], start[1] * h, 0.5 * start[2] * square);
    let (place, rate) = (end[0] - p0 - p1 - p2, end[1] * h - p1 - 2.0 * p2);
    let bend = end[2] * square - 2.0 * p2;
    [
        p0,
        p1,
        p2,
        10.0 * place - 4.0 * rate + 0.5 * bend,
        -15.0 * place + 7.0 * rate - bend,
        6.0 * place - 3.0 * rate + 0.5 * bend,
    ]
}

/// Value and slope of a polynomial of the part of a step.
pub(super) fn at(polynomial: &[f64; 6], x: f64) -> (f64, f64) {
    let (mut value, mut slope) = (0.0, 0.0);
    for coefficient in polynomial.iter().rev() {
        slope = slope * x + value;
        value = value * x + coefficient;
    }
    (value, slope)
}

/// Returns the greatest value of a function with one top between 0 and 1 and its place, by golden sections.
fn top(value: impl Fn(f64) -> f64) -> (f64, f64) {
    const GOLDEN: f64 = 0.618_033_988_749_894_8;
    let (mut low, mut high) = (0.0, 1.0);
    let (mut left, mut right) = (1.0 - GOLDEN, GOLDEN);
    let (mut of_left, mut of_right) = (value(left), value(right));
    // Within this distance the value does not change.
    while high - low > 1e-7 {
        if of_left > of_right {
            (high, right, of_right) = (right, left, of_left);
            left = high - GOLDEN * (high - low);
            of_left = value(left);
        } else {
            (low, left, of_left) = (left, right, of_right);
            right = low + GOLDEN * (high - low);
            of_right = value(right);
        }
    }
    let middle = 0.5 * (low + high);
    (middle, value(middle))
}
