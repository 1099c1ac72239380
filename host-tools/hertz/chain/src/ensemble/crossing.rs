//! Exact integration of contacts that open or close inside a step, eight at a time, from any of the chains.
//!
//! # Design
//!
//! As in the solver of single chains, the overlap is the polynomial of fifth order through overlap, rate and
//! acceleration at both ends of the step. Its force is taken out of the stages and integrated exactly. Only
//! the change at the end of the step is computed here.

use super::eight::{Eight, Vector, Wide, all};
use super::method::{DISPLACEMENT, END, ERROR, NODES, STAGES, VELOCITY};

/// Gauss' rule for ∫ √y g(y) dy over 0 to 1: abscissae, and weights over √y.
pub(super) const RULE: [(f64, f64); 5] = [
    (0.9569313076182352, 0.1089131754219363),
    (0.786880055907332, 0.22279529803475262),
    (0.5331219512438066, 0.2720403422553957),
    (0.26946079135749507, 0.24209996110973328),
    (0.07265351292075016, 0.14167433265182075),
];
/// Iterations of the search for the root. An error of 1e-6 of the step is 1e-9 of the integral.
pub(super) const SEARCH: usize = 9;

/// Up to eight contacts. Lanes without one are filled with [`ContactBatch::NONE`].
#[derive(Debug, Clone, Copy)]
pub(super) struct ContactBatch {
    /// Overlap, its rate and its acceleration at the start and at the end.
    pub(super) start: [Eight; 3],
    pub(super) end: [Eight; 3],
    /// κ, N/m^(3/2), and (3/2) τ, s.
    pub(super) stiffness: Eight,
    pub(super) viscosity: Eight,
    /// Length of the step, s.
    pub(super) length: Eight,
}

/// Changes at the end of a step by the exact integral, times the mass of a body.
#[derive(Debug, Clone, Copy)]
pub(super) struct Changes {
    pub(super) displacement: Eight,
    pub(super) velocity: Eight,
    /// Change of the estimated error of the velocity, over the length of the step.
    pub(super) error: Eight,
}

impl ContactBatch {
    /// Contacts that close without a force.
    pub(super) const NONE: Self = Self {
        start: [Eight([-1.0; 8]), Eight([2.0; 8]), Eight::ZERO],
        end: [Eight([1.0; 8]), Eight([2.0; 8]), Eight::ZERO],
        stiffness: Eight::ZERO,
        viscosity: Eight::ZERO,
        length: Eight([1.0; 8]),
    };

    #[inline(always)]
    pub(super) fn changes<S: Wide>(&self, simd: S) -> Changes {
        let h = self.length.load(simd);
        let square = h * h;
        let start = self.start.map(|of| of.load(simd));
        let overlap = WideOverlap::through(h, start, self.end.map(|of| of.load(simd)));
        // The part of the step with a closed contact, from the root to one of its ends.
        let closes = self.end[0].load(simd).is_positive();
        let root = overlap.root(self.end[0].load(simd), closes);
        let way = closes - root;

        let stiffness = self.stiffness.load(simd);
        let viscosity = self.viscosity.load(simd) / h;
        let (mut once, mut twice) = (all(simd, 0.0), all(simd, 0.0));
        for (place, weight) in RULE {
            let x = way.scaled_plus(place, root);
            let part = way.abs() * weight * overlap.force(x, stiffness, viscosity);
            once = once + part;
            twice = part.times_plus(all(simd, 1.0) - x, twice);
        }
        let mut error = all(simd, 0.0);
        for stage in 0..STAGES {
            let weights = (VELOCITY[END][stage], DISPLACEMENT[END][stage], ERROR[stage]);
            if weights != (0.0, 0.0, 0.0) {
                let force = overlap.force(all(simd, NODES[stage]), stiffness, viscosity);
                once = force.scaled_plus(-weights.0, once);
                twice = force.scaled_plus(-weights.1, twice);
                error = force.scaled_plus(weights.2, error);
            }
        }
        Changes {
            displacement: (square * twice).store(),
            velocity: (h * once).store(),
            error: error.store(),
        }
    }
}

/// An overlap as a polynomial of the part x of the step.
#[derive(Clone, Copy)]
struct WideOverlap<S: Wide>([Vector<S>; 6]);

impl<S: Wide> WideOverlap<S> {
    /// The polynomial with this value, rate and acceleration at either end of a step of length `h`.
    #[inline(always)]
    fn through(h: Vector<S>, start: [Vector<S>; 3], end: [Vector<S>; 3]) -> Self {
        let square = h * h;
        let (p0, p1, p2) = (start[0], start[1] * h, start[2] * square * 0.5);
        let place = end[0] - p0 - p1 - p2;
        let rate = end[1] * h - p1 - p2 * 2.0;
        let bend = end[2] * square - p2 * 2.0;
        Self([
            p0,
            p1,
            p2,
            place * 10.0 - rate * 4.0 + bend * 0.5,
            rate * 7.0 - place * 15.0 - bend,
            place * 6.0 - rate * 3.0 + bend * 0.5,
        ])
    }

    /// The overlap and its slope.
    #[inline(always)]
    fn at(&self, x: Vector<S>) -> (Vector<S>, Vector<S>) {
        let p = &self.0;
        let (mut value, mut slope) = (p[5], p[5]);
        value = value.times_plus(x, p[4]);
        slope = slope.times_plus(x, value);
        value = value.times_plus(x, p[3]);
        slope = slope.times_plus(x, value);
        value = value.times_plus(x, p[2]);
        slope = slope.times_plus(x, value);
        value = value.times_plus(x, p[1]);
        slope = slope.times_plus(x, value);
        (value.times_plus(x, p[0]), slope)
    }

    /// Root by Newton's method between bounds. `last` is the value at the end, `closes` 1 where it is
    /// positive.
    #[inline(always)]
    fn root(&self, last: Vector<S>, closes: Vector<S>) -> Vector<S> {
        let first = self.0[0];
        let (mut low, mut high) = (closes * 0.0, closes * 0.0 + 1.0);
        let mut x = (first / (first - last)).positive().min(high);
        for _ in 0..SEARCH {
            let (value, slope) = self.at(x);
            let beyond = value.is_positive().equals(closes);
            high = beyond.select(x, high);
            low = beyond.select(low, x);
            let newton = x - value / slope;
            let middle = (low + high) * 0.5;
            x = newton.above(low).select(newton, middle);
            x = high.above(newton).select(x, middle);
        }
        x
    }

    /// Force of the contact; `viscosity` is (3/2) τ over the length of the step.
    #[inline(always)]
    fn force(&self, x: Vector<S>, stiffness: Vector<S>, viscosity: Vector<S>) -> Vector<S> {
        let (value, slope) = self.at(x);
        let overlap = value.positive();
        stiffness * overlap.sqrt() * viscosity.times_plus(slope, overlap)
    }
}
