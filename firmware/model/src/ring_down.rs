//! The energy that the intruder still holds at the end of a window, and that its damper takes up after it.
//!
//! # Design
//!
//! Behind the wave the host flies free, and the intruder rings against it with the reduced mass μ = m(M -
//! m)/M. Its energy ½μẋ² + ½kx² is then absorbed in any case, unless another wave comes. Both estimates are
//! sums over the samples of a window; the energy left makes them whole.
//!
//! Estimate B holds x and ẋ. Estimate A holds the acceleration; where the damping is light, a velocity would
//! be a small difference of accelerations. So two oscillations are fitted to the last samples by least
//! squares: that of an intruder released at the end of the window, with an acceleration of 1 m/s² there, and
//! one that passes its rest position there with a speed of the same energy. Before the end they follow from
//! the recursion of a free oscillation, backwards:
//!
//! ```text
//! a[n-2] = e^(2βdt) (2 e^(-βdt) cos(ωdt) a[n-1] - a[n])        β = c/2μ, ω² = k/μ - β²
//! ```
//!
//! With amplitudes A and B of both, the energy is (m²/2k)(A² + B²).

use crate::physics::Bead;
use crate::quantity::SensedAcceleration;
use crate::reduced_chain::ReducedChainState;
use bead_wire::{Energy, LeftEnergy};
use fixed::types::I40F24;
use serde::Serialize;

/// Samples at the end of a window that the oscillations are fitted to. More samples would contain more of the
/// pushes that a host still gets from the contact behind it: with 64, 0.4 % of the energy left is lost, with
/// 32 a thousandth.
const FITTED: f64 = 32.0;
/// Least number of samples fitted.
const FITTED_LEAST: f64 = 4.0;
/// Greatest βdt for which there is a fit, and greatest square of ωdt, of either sign: the range of the
/// series.
const DECAY_MOST: f64 = 0.5;
const SQUARE_MOST: f64 = 10.0;
/// Terms of the series of a cosine, for squares of up to [`SQUARE_MOST`] to 1e-10.
const TERMS: u32 = 12;

/// Coefficients of the energy left. They are in f32: they are used once a strike.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct RingDown {
    /// Samples that are fitted; 0 for an intruder whose ring-down is too fast to be sampled.
    samples: u8,
    /// Weights of a[n-1] and -a[n] in a[n-2].
    back: [f32; 2],
    /// The last two accelerations of both oscillations, the newest first.
    newest: [[f32; 2]; 2],
    /// Energy of each at an amplitude of 1 m/s², nJ.
    measured: [f32; 2],
    /// ½k and ½μ/dt², nJ/µm² and nJ/(µm/sample)².
    predicted: [f32; 2],
}

impl RingDown {
    /// Coefficients of a bead that is sampled every `dt` seconds.
    #[inline(never)]
    pub(crate) fn new(bead: &Bead, dt: f64) -> Self {
        let nj = 1e9;
        let (m, k, c) = (bead.intruder_mass, bead.stiffness, bead.damping);
        let reduced = m * (bead.mass - m) / bead.mass;
        let decay = 0.5 * c / reduced * dt;
        let square = k / reduced * dt * dt - decay * decay;
        if decay > DECAY_MOST || square.abs() > SQUARE_MOST {
            return Self::default();
        }
        let growth = 1.0 / (1.0 + libm::expm1(-decay));
        let [cos, sin] = cosine_and_sine(square);
        // x and ẋ dt a sample ago, of those now.
        let before = |[x, v]: [f64; 2]| {
            [
                growth * ((cos - decay * sin) * x - sin * v),
                growth * ((cos + decay * sin) * v + k / reduced * dt * dt * sin * x),
            ]
        };
        let acceleration = |[x, v]: [f64; 2]| -(k * x + c / dt * v) / m;
        let last_two = |state: [f64; 2]| [state, before(state)].map(|state| acceleration(state) as f32);
        let amplitude = -m / k;
        let speed = amplitude * libm::sqrt(k / reduced) * dt;
        // The sums count the sample at the end of the window in full, and half of it belongs after the end:
        // it is taken off A, whose newest sample is counted, and added to B, whose newest is not.
        let half = c * dt / reduced;
        let energy = 0.5 * m * amplitude.abs() * nj;
        let um = 1e-6;
        Self {
            samples: (1.0 / decay).clamp(FITTED_LEAST, FITTED) as u8,
            back: [2.0 * growth * cos, growth * growth].map(|weight| weight as f32),
            newest: [last_two([amplitude, 0.0]), last_two([0.0, speed])],
            measured: [energy, energy * (1.0 - half)].map(|energy| energy as f32),
            predicted: [
                (0.5 * k * um * um * nj) as f32,
                (0.5 * reduced * (1.0 + half) / (dt * dt) * um * um * nj) as f32,
            ],
        }
    }

    /// The energy left in both estimates; that of A is 0 unless the intruder still `rings`. `None` if it
    /// cannot be determined.
    pub(crate) fn left(
        &self,
        rings: bool,
        accelerations: &[SensedAcceleration],
        chain: &ReducedChainState,
    ) -> Option<LeftEnergy> {
        if self.samples == 0 {
            return None;
        }
        let measured = if rings { self.fit(accelerations) } else { 0.0 };
        let [x, v] = chain.intruder();
        let [potential, kinetic] = self.predicted;
        Some(LeftEnergy {
            measured: nanojoules(measured),
            predicted: nanojoules(potential * x * x + kinetic * v * v),
        })
    }

    /// Energy of the oscillation that fits the last accelerations best, nJ.
    fn fit(&self, accelerations: &[SensedAcceleration]) -> f32 {
        let [mut cosine, mut sine] = self.newest;
        let [mut cc, mut cs, mut ss, mut ac, mut a_s] = [0.0_f32; 5];
        for acceleration in accelerations.iter().rev().take(self.samples.into()) {
            let a = acceleration.to_bits() as f32;
            let ([c, s], [one, other]) = ([cosine[0], sine[0]], self.back);
            cc += c * c;
            cs += c * s;
            ss += s * s;
            ac += a * c;
            a_s += a * s;
            for oscillation in [&mut cosine, &mut sine] {
                let [now, before] = *oscillation;
                *oscillation = [before, one * before - other * now];
            }
        }
        let determinant = cc * ss - cs * cs;
        if determinant <= 0.0 {
            return 0.0;
        }
        const UNIT: f32 = 1.0 / (1_u32 << SensedAcceleration::FRAC_NBITS) as f32;
        let amplitudes = [ac * ss - a_s * cs, a_s * cc - ac * cs].map(|sum| UNIT * sum / determinant);
        let energies = amplitudes.iter().zip(self.measured);
        energies
            .map(|(amplitude, energy)| energy * amplitude * amplitude)
            .sum()
    }
}

/// cos √`square` and sin √`square` / √`square`; those of the hyperbola if it is negative.
fn cosine_and_sine(square: f64) -> [f64; 2] {
    let (mut cos, mut sin) = (1.0, 1.0);
    for n in (1..=TERMS).rev().map(f64::from) {
        cos = 1.0 - square / (2.0 * n * (2.0 * n - 1.0)) * cos;
        sin = 1.0 - square / (2.0 * n * (2.0 * n + 1.0)) * sin;
    }
    [cos, sin]
}

/// An energy in the format of the result; saturates.
fn nanojoules(energy: f32) -> Energy {
    Energy::from_bits(I40F24::saturating_from_num(energy).to_bits())
}
