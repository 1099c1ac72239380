//! Eight numbers, one of each chain of a group, in memory and in a vector register.

use std::ops::{Add, Div, Mul, Sub};

use pulp::{Simd, f64x8};

/// Lanes of a group.
pub(super) const LANES: usize = 8;

/// One number of each lane, aligned to a cache line.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub(super) struct Eight(pub(super) [f64; LANES]);

impl Eight {
    pub(super) const ZERO: Self = Self([0.0; LANES]);

    #[inline(always)]
    pub(super) fn load<S: Wide>(&self, simd: S) -> Vector<S> {
        Vector {
            simd,
            lanes: pulp::cast(self.0),
        }
    }
}

/// Vectors of eight.
pub(super) trait Wide: Simd<f64s = f64x8> {}

impl<S: Simd<f64s = f64x8>> Wide for S {}

/// Eight lanes in registers. [`Vector::times_plus`] rounds a product and a following sum once, and the
/// operators twice, on every processor.
#[derive(Clone, Copy)]
pub(super) struct Vector<S: Wide> {
    simd: S,
    lanes: f64x8,
}

/// A vector with this value in all lanes.
#[inline(always)]
pub(super) fn all<S: Wide>(simd: S, value: f64) -> Vector<S> {
    Vector {
        simd,
        lanes: simd.splat_f64s(value),
    }
}

/// A truth value in each lane.
#[derive(Clone, Copy)]
pub(super) struct Mask<S: Wide> {
    simd: S,
    lanes: S::m64s,
}

impl<S: Wide> Mask<S> {
    #[inline(always)]
    pub(super) fn select(self, yes: Vector<S>, no: Vector<S>) -> Vector<S> {
        let lanes = self
            .simd
            .select_u64s(self.lanes, pulp::cast(yes.lanes), pulp::cast(no.lanes));
        yes.with(pulp::cast(lanes))
    }

    #[inline(always)]
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            simd: self.simd,
            lanes: self.simd.and_m64s(self.lanes, other.lanes),
        }
    }

    /// Returns 1 for true, 0 for false.
    #[inline(always)]
    pub(super) fn number(self) -> Vector<S> {
        self.select(all(self.simd, 1.0), all(self.simd, 0.0))
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, $of_simd:ident) => {
        impl<S: Wide> $trait for Vector<S> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.with(self.simd.$of_simd(self.lanes, other.lanes))
            }
        }

        impl<S: Wide> $trait<f64> for Vector<S> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: f64) -> Self {
                self.with(self.simd.$of_simd(self.lanes, self.simd.splat_f64s(other)))
            }
        }
    };
}

operator!(Add, add, add_f64s);
operator!(Sub, sub, sub_f64s);
operator!(Mul, mul, mul_f64s);
operator!(Div, div, div_f64s);

impl<S: Wide> Vector<S> {
    #[inline(always)]
    fn with(self, lanes: f64x8) -> Self {
        Self {
            simd: self.simd,
            lanes,
        }
    }

    #[inline(always)]
    fn mask(self, lanes: S::m64s) -> Mask<S> {
        Mask {
            simd: self.simd,
            lanes,
        }
    }

    #[inline(always)]
    pub(super) fn store(self) -> Eight {
        Eight(pulp::cast(self.lanes))
    }

    #[inline(always)]
    pub(super) fn times_plus(self, factor: Self, term: Self) -> Self {
        self.with(self.simd.mul_add_f64s(self.lanes, factor.lanes, term.lanes))
    }

    #[inline(always)]
    pub(super) fn scaled_plus(self, factor: f64, term: Self) -> Self {
        self.times_plus(all(self.simd, factor), term)
    }

    #[inline(always)]
    pub(super) fn sqrt(self) -> Self {
        self.with(self.simd.sqrt_f64s(self.lanes))
    }

    #[inline(always)]
    pub(super) fn abs(self) -> Self {
        self.with(self.simd.abs_f64s(self.lanes))
    }

    #[inline(always)]
    pub(super) fn max(self, other: Self) -> Self {
        self.with(self.simd.max_f64s(self.lanes, other.lanes))
    }

    #[inline(always)]
    pub(super) fn min(self, other: Self) -> Self {
        self.with(self.simd.min_f64s(self.lanes, other.lanes))
    }

    /// Returns the values, or zero where they are negative.
    #[inline(always)]
    pub(super) fn positive(self) -> Self {
        self.with(self.simd.max_f64s(self.simd.splat_f64s(0.0), self.lanes))
    }

    #[inline(always)]
    pub(super) fn above(self, other: Self) -> Mask<S> {
        self.mask(self.simd.greater_than_f64s(self.lanes, other.lanes))
    }

    #[inline(always)]
    pub(super) fn at_most(self, other: Self) -> Mask<S> {
        self.mask(self.simd.less_than_or_equal_f64s(self.lanes, other.lanes))
    }

    #[inline(always)]
    pub(super) fn equals(self, other: Self) -> Mask<S> {
        self.mask(self.simd.equal_f64s(self.lanes, other.lanes))
    }

    /// Returns 1 where the value is above zero, otherwise 0.
    #[inline(always)]
    pub(super) fn is_positive(self) -> Self {
        self.above(all(self.simd, 0.0)).number()
    }

    /// Returns true if any lane is above zero.
    #[inline(always)]
    pub(super) fn any_positive(self) -> bool {
        self.simd.reduce_max_f64s(self.lanes) > 0.0
    }
}
