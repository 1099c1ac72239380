//! Eight numbers, one of each chain of a group, in memory and in a vector register.

use std::ops::{Add, Div, Mul, Sub};

use pulp::{Simd, f64x8};

pub(super) const LANES: usize = 8;

/// One number of each lane, aligned to a cache line.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub(super) struct Eight(pub(super) [f64; LANES]);

impl Eight {
    pub(super) const ZERO: Self = Self([0.0; LANES]);

    #[inline(always)]
    pub(super) fn load<S: Wide>(&self, simd: S) -> Vector<S> {
        Vector(simd, pulp::cast(self.0))
    }
}

pub(super) trait Wide: Simd<f64s = f64x8> {}

impl<S: Simd<f64s = f64x8>> Wide for S {}

/// Eight lanes in registers. [`Vector::times_plus`] rounds a product and a following sum once, and the
/// operators twice, on every processor.
#[derive(Clone, Copy)]
pub(super) struct Vector<S: Wide>(S, f64x8);

/// A vector with this value in all lanes.
#[inline(always)]
pub(super) fn all<S: Wide>(simd: S, value: f64) -> Vector<S> {
    Vector(simd, simd.splat_f64s(value))
}

#[derive(Clone, Copy)]
pub(super) struct Mask<S: Wide>(S, S::m64s);

impl<S: Wide> Mask<S> {
    #[inline(always)]
    pub(super) fn select(self, yes: Vector<S>, no: Vector<S>) -> Vector<S> {
        let lanes = self.0.select_u64s(self.1, pulp::cast(yes.1), pulp::cast(no.1));
        Vector(self.0, pulp::cast(lanes))
    }

    /// Returns 1 for true, 0 for false.
    #[inline(always)]
    pub(super) fn number(self) -> Vector<S> {
        self.select(all(self.0, 1.0), all(self.0, 0.0))
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident, $of_simd:ident) => {
        impl<S: Wide> $trait for Vector<S> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(self.0, self.0.$of_simd(self.1, other.1))
            }
        }

        impl<S: Wide> $trait<f64> for Vector<S> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: f64) -> Self {
                self.$method(all(self.0, other))
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
    pub(super) fn store(self) -> Eight {
        Eight(pulp::cast(self.1))
    }

    #[inline(always)]
    pub(super) fn times_plus(self, factor: Self, term: Self) -> Self {
        Self(self.0, self.0.mul_add_f64s(self.1, factor.1, term.1))
    }

    #[inline(always)]
    pub(super) fn scaled_plus(self, factor: f64, term: Self) -> Self {
        self.times_plus(all(self.0, factor), term)
    }

    #[inline(always)]
    pub(super) fn sqrt(self) -> Self {
        Self(self.0, self.0.sqrt_f64s(self.1))
    }

    #[inline(always)]
    pub(super) fn abs(self) -> Self {
        Self(self.0, self.0.abs_f64s(self.1))
    }

    #[inline(always)]
    pub(super) fn max(self, other: Self) -> Self {
        Self(self.0, self.0.max_f64s(self.1, other.1))
    }

    #[inline(always)]
    pub(super) fn min(self, other: Self) -> Self {
        Self(self.0, self.0.min_f64s(self.1, other.1))
    }

    /// Returns the values, or zero where they are negative.
    #[inline(always)]
    pub(super) fn positive(self) -> Self {
        Self(self.0, self.0.max_f64s(self.0.splat_f64s(0.0), self.1))
    }

    #[inline(always)]
    pub(super) fn above(self, other: Self) -> Mask<S> {
        Mask(self.0, self.0.greater_than_f64s(self.1, other.1))
    }

    #[inline(always)]
    pub(super) fn at_most(self, other: Self) -> Mask<S> {
        Mask(self.0, self.0.less_than_or_equal_f64s(self.1, other.1))
    }

    #[inline(always)]
    pub(super) fn equals(self, other: Self) -> Mask<S> {
        Mask(self.0, self.0.equal_f64s(self.1, other.1))
    }

    /// Returns 1 where the value is above zero, otherwise 0.
    #[inline(always)]
    pub(super) fn is_positive(self) -> Self {
        self.above(all(self.0, 0.0)).number()
    }

    /// Returns true if any lane is above zero.
    #[inline(always)]
    pub(super) fn any_positive(self) -> bool {
        self.0.reduce_max_f64s(self.1) > 0.0
    }
}
