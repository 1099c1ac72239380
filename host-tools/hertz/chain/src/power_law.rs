//! Contacts whose force follows another power of the overlap than Hertz', with damping and friction.
//!
//! ```text
//! F = κ δⁿ (1 + f tanh(δ'/v₀)) + η δᵖ δ'        δ > 0
//! ```
//!
//! Hertz' law with a damping of p = 1/2 is the default ([`Contact`](crate::Contact)), and has a solver of its
//! own for contacts that open and close. With other powers a step ends where a contact opens or closes.

use std::f64::consts::PI;

/// A force κ δⁿ between two bodies: closed forms of their collision, and of the solitary wave in a chain.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct PowerLaw {
    /// Exponent n.
    pub exponent: f64,
    /// Stiffness κ, N/mⁿ.
    pub stiffness: f64,
}

impl PowerLaw {
    /// The law κ δⁿ with an exponent and a stiffness in N/mⁿ.
    pub const fn new(exponent: f64, stiffness: f64) -> Self {
        Self { exponent, stiffness }
    }

    /// Greatest overlap of bodies of this reduced mass, kg, that meet at `speed`, m/s:
    /// δ_m = ((n+1) μ V² / 2κ)^(1/(n+1)), m.
    pub fn greatest_overlap(&self, reduced_mass: f64, speed: f64) -> f64 {
        let above = self.exponent + 1.0;
        (0.5 * above * reduced_mass * speed * speed / self.stiffness).powf(1.0 / above)
    }

    /// Time of their contact, s: [2√π Γ(1/(n+1)) / ((n+1) Γ(1/(n+1) + 1/2))] δ_m/V, which is π √(μ/κ) for
    /// n = 1 and 2.943275184 δ_m/V for n = 3/2.
    pub fn contact_time(&self, reduced_mass: f64, speed: f64) -> f64 {
        let part = 1.0 / (self.exponent + 1.0);
        let factor = 2.0 * PI.sqrt() * part * libm::tgamma(part) / libm::tgamma(part + 0.5);
        factor * self.greatest_overlap(reduced_mass, speed) / speed
    }

    /// Greatest force of their contact, N, which goes as V^(2n/(n+1)).
    pub fn greatest_force(&self, reduced_mass: f64, speed: f64) -> f64 {
        self.stiffness * self.greatest_overlap(reduced_mass, speed).powf(self.exponent)
    }

    /// Width of the solitary wave in a chain of such contacts between its zeros, in distances from bead to
    /// bead: (π/(n-1)) √(n(n+1)/6). The overlap is a cosine to the power 2/(n-1) between these (Nesterenko,
    /// *Dynamics of Heterogeneous Materials*, 2001, section 1.4). It is a limit for long waves.
    pub fn wave_width(&self) -> f64 {
        let n = self.exponent;
        PI / (n - 1.0) * (n * (n + 1.0) / 6.0).sqrt()
    }
}

/// xᵉ for x > 0, and 0 otherwise, with the same bits on every computer. Whole and half exponents, the usual
/// ones, are products.
#[inline(never)]
pub(crate) fn power(x: f64, exponent: f64) -> f64 {
    if x <= 0.0 {
        return if exponent == 0.0 { 1.0 } else { 0.0 };
    }
    let halves = 2.0 * exponent;
    if halves.fract() != 0.0 || halves > 16.0 {
        return libm::pow(x, exponent);
    }
    let mut product = if exponent.fract() == 0.0 { 1.0 } else { x.sqrt() };
    for _ in 0..exponent.floor() as u32 {
        product *= x;
    }
    product
}

/// Powers, damping and friction of a contact that is not Hertz' with p = 1/2 and f = 0. Its functions are
/// kept out of the code for Hertz' contacts, which they would slow down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ContactPowers {
    /// Exponent n of the elastic force.
    pub(crate) elastic: f64,
    /// Exponent p and coefficient η, N·s/m^(p+1), of the damping force.
    pub(crate) damping: f64,
    pub(crate) coefficient: f64,
    /// Coefficient f of the friction, and v₀, m/s.
    pub(crate) friction: f64,
    pub(crate) friction_speed: f64,
}

impl ContactPowers {
    /// Damping force and friction, N, of a closed contact of stiffness κ, N/mⁿ, at an overlap, m, and its
    /// rate, m/s.
    #[cold]
    #[inline(never)]
    pub(crate) fn damping_force(&self, stiffness: f64, overlap: f64, rate: f64) -> f64 {
        let damping = self.coefficient * power(overlap, self.damping) * rate;
        if self.friction == 0.0 {
            return damping;
        }
        let elastic = stiffness * power(overlap, self.elastic);
        damping + self.friction * elastic * libm::tanh(rate / self.friction_speed)
    }

    /// Slope of the damping force with the rate of the overlap, at zero rate, N·s/m.
    pub(crate) fn damping_slope(&self, stiffness: f64, overlap: f64) -> f64 {
        let elastic = stiffness * power(overlap, self.elastic);
        self.coefficient * power(overlap, self.damping) + self.friction * elastic / self.friction_speed
    }

    /// Rate of the damping force, N/s, at an overlap, m, its rate, m/s, and its acceleration, m/s².
    #[cold]
    #[inline(never)]
    pub(crate) fn damping_force_rate(&self, stiffness: f64, [overlap, rate, acceleration]: [f64; 3]) -> f64 {
        let part = libm::tanh(rate / self.friction_speed);
        let growth = self.elastic * power(overlap, self.elastic - 1.0) * rate * part;
        let turn = power(overlap, self.elastic) * (1.0 - part * part) * acceleration / self.friction_speed;
        let friction = self.friction * stiffness * (growth + turn);
        let bend = if self.damping == 0.0 {
            0.0
        } else {
            self.damping * power(overlap, self.damping) / overlap * rate * rate
        };
        friction + self.coefficient * (bend + power(overlap, self.damping) * acceleration)
    }

    /// Elastic force beyond `load`, N, at a change of the overlap from `rest`, m, which is the overlap under
    /// `load`: F₀ ((1 + e)ⁿ - 1) with e = change/rest, without cancellation.
    #[cold]
    #[inline(never)]
    pub(crate) fn force_beyond(&self, (load, rest): (f64, f64), stiffness: f64, change: f64) -> f64 {
        let overlap = rest + change;
        if load == 0.0 {
            // A linear spring goes on below zero, so that a step to its opening sees no kink.
            let kept = if self.elastic == 1.0 {
                overlap
            } else {
                overlap.max(0.0)
            };
            return stiffness
                * if self.elastic == 1.0 {
                    kept
                } else {
                    power(kept, self.elastic)
                };
        }
        if overlap <= 0.0 {
            return -load;
        }
        load * libm::expm1(self.elastic * libm::log1p(change / rest))
    }

    /// Elastic energy since rest, less the work of the load, J:
    /// F₀ δ₀ [((1 + e)^(n+1) - 1)/(n+1) - e], for small e as a series.
    #[cold]
    #[inline(never)]
    pub(crate) fn energy_beyond(&self, (load, rest): (f64, f64), stiffness: f64, change: f64) -> f64 {
        let (above, overlap) = (self.elastic + 1.0, rest + change);
        if load == 0.0 {
            return stiffness * power(overlap.max(0.0), above) / above;
        }
        if overlap <= 0.0 {
            return -load * (change + rest / above);
        }
        let e = change / rest;
        if e.abs() > 0.1 {
            return load * rest * (libm::expm1(above * libm::log1p(e)) / above - e);
        }
        // Σ n (n-1) … (n-k+2) / k! e^k from k = 2 on.
        let (mut term, mut sum, mut k) = (0.5 * self.elastic * e * e, 0.0, 2.0);
        while k < 40.0 && term.abs() > 1e-20 * sum {
            sum += term;
            term *= (self.elastic - k + 1.0) / (k + 1.0) * e;
            k += 1.0;
        }
        load * rest * sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_are_those_of_the_library() {
        for exponent in [0.0, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 2.7] {
            for x in [1e-9, 3e-6, 0.7, 12.0_f64] {
                assert!((power(x, exponent) / x.powf(exponent) - 1.0).abs() < 1e-14);
            }
            assert_eq!(power(-1.0, exponent), f64::from(u8::from(exponent == 0.0)));
        }
    }

    #[test]
    fn the_known_factors_of_the_contact_time_come_out() {
        let of = |exponent: f64| {
            let law = PowerLaw::new(exponent, 3e9);
            law.contact_time(0.02, 0.5) * 0.5 / law.greatest_overlap(0.02, 0.5)
        };
        assert!((of(1.0) / PI - 1.0).abs() < 1e-14);
        assert!((of(1.5) / 2.943_275_184 - 1.0).abs() < 1e-9);
        assert!((PowerLaw::new(1.5, 1.0).wave_width() / 4.967_294_1 - 1.0).abs() < 1e-7);
        // A contact of n = 3: 2 K(-1), with the lemniscate's constant.
        assert!((of(3.0) / 2.622_057_554_292_119 - 1.0).abs() < 1e-14);
    }

    /// Energies are the integrals of forces, small and large, on either side of rest.
    #[test]
    fn the_energy_is_the_integral_of_the_force_beyond_the_load() {
        for elastic in [1.0, 1.5, 2.2, 3.0] {
            let powers = ContactPowers {
                elastic,
                damping: 0.5,
                coefficient: 0.0,
                friction: 0.0,
                friction_speed: 1.0,
            };
            for (load, stiffness) in [(0.0, 1e9_f64), (3.0_f64, 1e9)] {
                let rest = (load / stiffness).powf(1.0 / elastic);
                let scale = (1.0 / stiffness).powf(1.0 / elastic);
                for part in [-0.09, -1e-4, 1e-6, 0.05, 0.2, 2.0] {
                    let end = part * scale;
                    // Simpson's rule in many parts.
                    let force = |change: f64| powers.force_beyond((load, rest), stiffness, change);
                    let n = 2000;
                    let h = end / f64::from(n);
                    let sum: f64 = (0..n)
                        .map(|k| {
                            let at = h * f64::from(k);
                            h / 6.0 * (force(at) + 4.0 * force(at + 0.5 * h) + force(at + h))
                        })
                        .sum();
                    if load == 0.0 && part < 0.0 {
                        continue;
                    }
                    let energy = powers.energy_beyond((load, rest), stiffness, end);
                    let error = energy - sum;
                    assert!(
                        error.abs() <= 1e-7 * sum.abs(),
                        "{elastic} {load} {part}: {energy} {sum}"
                    );
                }
            }
        }
    }
}
