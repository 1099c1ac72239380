//! The overlap of a contact inside a step.
//!
//! # Design
//!
//! Smooth motion is close to a polynomial through both ends of the step. A contact that opens or closes adds
//! the effect of its own force on its overlap, which no polynomial describes: with y the part of the step
//! from the root δ = 0 into the closed side, the force goes as y^(3/2), and as y^(1/2) with viscosity, so δ
//! has terms y^(7/2) and y^(5/2). Their factors follow from the slope at the root. Without them, a contact
//! that closes just before the end of a step would have a wrong force which no stage sees.

/// Overlap, m, its rate, m/s, and its acceleration, m/s².
pub(super) type Ends = [f64; 3];

/// δ as a function of the part x of the step: a polynomial of fifth order, and the effect of its own force.
#[derive(Debug, Clone, Copy)]
pub(super) struct StepOverlap {
    smooth: [f64; 6],
    own: Own,
}

/// Effect of a contact's own force on its overlap: half y^(5/2) + whole y^(7/2).
#[derive(Debug, Clone, Copy, Default)]
struct Own {
    root: f64,
    /// True if the contact is closed after the root.
    closes: bool,
    half: f64,
    whole: f64,
}

impl Own {
    /// The effect, its slope and its second derivative at the part x of the step.
    #[inline(always)]
    fn at(&self, x: f64) -> (f64, f64, f64) {
        let sign = if self.closes { 1.0 } else { -1.0 };
        let y = sign * (x - self.root);
        // Without a branch, many parts are computed at once.
        let y = if y > 0.0 { y } else { 0.0 };
        let root = y.sqrt();
        let bend = root * (3.75 * self.half + 8.75 * self.whole * y);
        let slope = y * root * (2.5 * self.half + 3.5 * self.whole * y);
        let value = y * y * root * (self.half + self.whole * y);
        (value, sign * slope, bend)
    }
}

impl StepOverlap {
    /// The polynomial for a step of this length.
    #[inline(always)]
    pub(super) fn between(length: f64, start: Ends, end: Ends) -> Self {
        let h = length;
        let (p0, p1, p2) = (start[0], start[1] * h, 0.5 * start[2] * h * h);
        let (place, rate) = (end[0] - p0 - p1 - p2, end[1] * h - p1 - 2.0 * p2);
        let bend = end[2] * h * h - 2.0 * p2;
        Self {
            smooth: [
                p0,
                p1,
                p2,
                10.0 * place - 4.0 * rate + 0.5 * bend,
                -15.0 * place + 7.0 * rate - bend,
                6.0 * place - 3.0 * rate + 0.5 * bend,
            ],
            own: Own::default(),
        }
    }

    /// The overlap of a contact that crosses zero once in a step of this length, and the part of the step at
    /// which it does. `stiffness` is κ (1/M + 1/M') for the masses of both bodies, `viscosity` is (3/2) τ.
    #[inline(always)]
    pub(super) fn crossing(
        length: f64,
        start: Ends,
        end: Ends,
        stiffness: f64,
        viscosity: f64,
    ) -> (Self, f64) {
        let closes = end[0] > 0.0;
        let sign = if closes { 1.0 } else { -1.0 };
        let viscosity = viscosity / length;
        let mut overlap = Self::between(length, start, end);
        let ends = (start[0], end[0]);
        let mut root = overlap.root(closes, ends.0 / (ends.0 - ends.1));
        // Effects far from the root change the slope there only a little.
        for _ in 0..2 {
            let (_, slope, bend) = overlap.smooth_at(root);
            let slope = slope.abs();
            let pull = -length * length * stiffness * slope.sqrt();
            let own = Own {
                root,
                closes,
                half: 4.0 / 15.0 * pull * sign * viscosity * slope,
                whole: 4.0 / 35.0 * pull * (slope + sign * 1.25 * bend * viscosity),
            };
            // The remainder for the polynomial. The force acts at one end of the step only.
            let rest = |ends: Ends, x: f64| {
                let (value, slope, bend) = own.at(x);
                [
                    ends[0] - value,
                    ends[1] - slope / length,
                    ends[2] - bend / (length * length),
                ]
            };
            overlap = Self {
                own,
                ..Self::between(length, rest(start, 0.0), rest(end, 1.0))
            };
            root = overlap.root(closes, root);
        }
        overlap.own.root = root;
        (overlap, root)
    }

    /// Root of the polynomial, by Newton's method from `near`, kept between bounds.
    #[inline(always)]
    fn root(&self, closes: bool, near: f64) -> f64 {
        let (mut low, mut high) = (0.0, 1.0);
        let mut x = near.clamp(0.0, 1.0);
        for _ in 0..60 {
            let (value, slope, _) = self.smooth_at(x);
            if (value > 0.0) == closes {
                high = x;
            } else {
                low = x;
            }
            let newton = x - value / slope;
            let next = if newton > low && newton < high {
                newton
            } else {
                0.5 * (low + high)
            };
            // The error is proportional to the square of the last change.
            if (next - x).abs() < 1e-9 {
                return next;
            }
            x = next;
        }
        x
    }

    /// δ and its slope dδ/dx.
    #[inline(always)]
    pub(super) fn at(&self, x: f64) -> (f64, f64) {
        let ((smooth, slope, _), own) = (self.smooth_at(x), self.own.at(x));
        (smooth + own.0, slope + own.1)
    }

    /// Displacement by the contact's own force at the end of the step, m.
    pub(super) fn own_at_end(&self) -> f64 {
        self.own.at(1.0).0.abs()
    }

    /// The polynomial, its slope and its second derivative.
    #[inline(always)]
    fn smooth_at(&self, x: f64) -> (f64, f64, f64) {
        let p = &self.smooth;
        let value = ((((p[5] * x + p[4]) * x + p[3]) * x + p[2]) * x + p[1]) * x + p[0];
        let slope = (((5.0 * p[5] * x + 4.0 * p[4]) * x + 3.0 * p[3]) * x + 2.0 * p[2]) * x + p[1];
        let bend = ((20.0 * p[5] * x + 12.0 * p[4]) * x + 6.0 * p[3]) * x + 2.0 * p[2];
        (value, slope, bend)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A contact that closes, with the effect of its own force: δ = y - 0.1 y^(7/2), with y = x - 0.9.
    #[test]
    fn what_the_contact_adds_by_itself_is_no_polynomial_and_is_found() {
        let (root, length) = (0.9, 2.0);
        let of = |x: f64| {
            let y = (x - root).max(0.0);
            [
                (x - root) - 0.1 * y.powf(3.5),
                (1.0 - 0.35 * y.powf(2.5)) / length,
                -0.875 * y.powf(1.5) / (length * length),
            ]
        };
        let stiffness = 0.1 * 35.0 / 4.0 / (length * length);
        let (overlap, found) = StepOverlap::crossing(length, of(0.0), of(1.0), stiffness, 0.0);
        assert!((found - root).abs() < 1e-9, "{found}");
        for x in [0.3, 0.91, 0.95, 0.99] {
            assert!((overlap.at(x).0 - of(x)[0]).abs() < 1e-9, "at {x}");
            assert!((overlap.at(x).1 - of(x)[1] * length).abs() < 1e-7, "rate at {x}");
        }
        let polynomial = StepOverlap::between(length, of(0.0), of(1.0));
        assert!((polynomial.at(0.95).0 - of(0.95)[0]).abs() > 1e-6);
    }
}
