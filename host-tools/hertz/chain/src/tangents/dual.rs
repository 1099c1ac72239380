//! Numbers that carry their derivatives.

use std::ops::{Add, AddAssign, Mul, Neg, Sub, SubAssign};

/// A value and its derivatives with respect to P parameters (a dual number of P directions).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dual<const P: usize> {
    /// The value.
    pub value: f64,
    /// The derivatives.
    pub by: [f64; P],
}

impl<const P: usize> Dual<P> {
    /// A number that depends on no parameter.
    pub const fn constant(value: f64) -> Self {
        Self { value, by: [0.0; P] }
    }

    /// Adds a multiple of another number.
    #[inline(always)]
    pub fn add_scaled(&mut self, other: Self, factor: f64) {
        self.value += factor * other.value;
        for (by, other) in self.by.iter_mut().zip(other.by) {
            *by += factor * other;
        }
    }

    /// The function value `value` of this number, where `slope` is the function's derivative (chain rule).
    #[inline(always)]
    fn through(mut self, value: f64, slope: f64) -> Self {
        self.value = value;
        for by in &mut self.by {
            *by *= slope;
        }
        self
    }

    /// The square root of a number above zero.
    #[inline(always)]
    pub(super) fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        self.through(root, 0.5 / root)
    }

    /// 1 over this number.
    #[inline(always)]
    pub(super) fn inverse(self) -> Self {
        let inverse = 1.0 / self.value;
        self.through(inverse, -inverse * inverse)
    }
}

impl<const P: usize> Default for Dual<P> {
    fn default() -> Self {
        Self::constant(0.0)
    }
}

impl<const P: usize> Add for Dual<P> {
    type Output = Self;

    #[inline(always)]
    fn add(mut self, other: Self) -> Self {
        self += other;
        self
    }
}

impl<const P: usize> AddAssign for Dual<P> {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        self.value += other.value;
        for (by, other) in self.by.iter_mut().zip(other.by) {
            *by += other;
        }
    }
}

impl<const P: usize> Sub for Dual<P> {
    type Output = Self;

    #[inline(always)]
    fn sub(mut self, other: Self) -> Self {
        self -= other;
        self
    }
}

impl<const P: usize> SubAssign for Dual<P> {
    #[inline(always)]
    fn sub_assign(&mut self, other: Self) {
        self.value -= other.value;
        for (by, other) in self.by.iter_mut().zip(other.by) {
            *by -= other;
        }
    }
}

impl<const P: usize> Neg for Dual<P> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        self.through(-self.value, -1.0)
    }
}

impl<const P: usize> Mul for Dual<P> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let mut by = [0.0; P];
        for (by, (left, right)) in by.iter_mut().zip(self.by.iter().zip(other.by)) {
            *by = left * other.value + self.value * right;
        }
        Self {
            value: self.value * other.value,
            by,
        }
    }
}

impl<const P: usize> Mul<f64> for Dual<P> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: f64) -> Self {
        self.through(factor * self.value, factor)
    }
}
