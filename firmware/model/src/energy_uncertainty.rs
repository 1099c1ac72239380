//! Uncertainties of the energies of a strike, from those of the settings.
//!
//! # Design
//! The law of propagation (JCGM 100, 5.2) with sensitivities in closed form. Everything that does not depend
//! on the strike is computed once, in f64, when settings are taken. A strike then costs two polynomials and
//! three roots in f32, so that it follows from settings and codes alone.
//!
//! **A.** With the intruder ringing at ω behind the low-pass λ = k/c of [`observer`](crate::observer), A is
//! proportional to m²/c · ω²/(ω² + λ²) and to the square of the gain.
//!
//! **B** depends on the pulse too: on x, the phase by which the intruder rings while the force is above its
//! half. Its sensitivities to k, c, m, κ and τ are cubics in x whose coefficients are linear in the damping
//! cω/k and in m/M. They were fitted to those of 101 strikes of 3 to 10 mm strikers at 0.1 to 2.5 m/s on six
//! beads, by the differences of `bead budget`; u(B) is then within 8 % of its. Two more follow from
//! dimensions: a force in other units, or all masses, k, c and κ in other ones, give the same motion, so `s_F
//! = 2 + s_κ/2` and `s_k + s_c + s_m + s_M + 3/2 s_κ = -1`.
//!
//! **Wave form.** A frequency that is off by δω and a decay that is off by δγ change the ringing e^(-γt) cos
//! ωt by the parts δω/(√2 γ) and δγ/(2γ) of its root mean square, apart from its amplitude. The amplitudes
//! that the force and the accelerometer give differ as the roots of B and A do.
//!
//! **Noise** of A is that of the quiet within the resonance of the intruder, of B that of the force over the
//! width of the pulse.

use core::f64::consts::{PI, TAU};

use bead_wire::{Energy, EnergyUncertainty, Force, Fraction, Shape};
use fixed::types::I16F16;
use serde::Serialize;

use crate::description::Description;
use crate::relative::Relative;
use crate::uncertainty::Uncertainty;

/// Greatest errors of A and of B by the estimators themselves, as parts: the worst of 1000 strikes with right
/// settings (docs/accuracy.md). Rectangular.
pub const ESTIMATOR: [f64; 2] = [4e-4, 3.5e-3];
/// Range of x to which the sensitivities were fitted; beyond an end, those of the end are used.
const PHASES: [f32; 2] = [1.5, 7.0];
/// Noise of B over that of the force times the width of the pulse over its impulse, within 25 %.
const FORCE_NOISE: f32 = 1.13;

/// Sensitivity of the wave form to κ, apart from its amplitude: found with 300 drawn beads.
const WAVEFORM_CONTACT: f64 = 0.4;
/// Standard uncertainties up to which a difference is explained.
const EXPLAINED: f64 = 3.0;

/// A cubic in x, the constant first.
type Cubic = [f64; 4];
/// Sensitivity of A, and of B.
type Pair = (f64, Cubic);

/// Fitted sensitivities of B. Each row: the constant, x, x², x³, what the damping adds to the first two, and
/// what the ratio of masses adds to them.
const STIFFNESS: [f64; 8] = [0.9111, 0.8952, -0.6876, 0.0662, -3.3099, 1.1566, -2.146, 0.735];
const DAMPING: [f64; 8] = [1.4449, -1.1576, 0.2554, -0.0145, -1.1988, 0.2157, 1.6188, -0.1736];
const MASS: [f64; 8] = [-1.3764, 0.3771, 0.3841, -0.047, 4.4761, -1.3127, -1.7234, -0.6725];
const CONTACT: [f64; 8] = [-0.5647, -0.8231, 0.3894, -0.0355, 1.638, -0.4859, 0.2068, -0.4615];
const RELAXATION: [f64; 8] = [0.0781, -0.1255, 0.0289, -0.002, 0.004, 0.0093, 0.3256, -0.0337];

/// Squares of relative standard uncertainties, from which those of a strike's energies follow.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct UncertaintyTerms {
    /// Of A.
    measured: f32,
    /// Of B, a polynomial in x, the constant first.
    predicted: [f32; 7],
    /// Of A - B, likewise.
    difference: [f32; 7],
    /// x of a pulse that is one sample wide.
    phase: f32,
    /// Square of the noise of A, nJ, for a mean square of the quiet of 1 (m/s²)² and an energy of 1 nJ.
    noise: f32,
    /// Square of the part of the acceleration that the uncertainties of ringing and contact explain, apart
    /// from its amplitude.
    waveform: f32,
}

impl UncertaintyTerms {
    /// `None` unless every uncertainty that matters is stated. The intruder rings at `ring_hz`.
    pub(crate) fn new(description: &Description, ring_hz: f64) -> Option<Self> {
        let stated = description.uncertainty.as_ref()?;
        let dt = 1.0 / f64::from(description.capture.sample_rate_hz);
        let (bead, intruder) = (&description.bead, &description.intruder);
        let ring = TAU * ring_hz;
        let low_pass = intruder.stiffness / intruder.damping;
        let passed = ring * ring / (ring * ring + low_pass * low_pass);

        let terms = terms(description, stated, ring / low_pass, passed)?;
        // Noise in a sample has all frequencies, of which the low-pass takes a part; the ringing has one.
        let turn = low_pass * dt / PI;
        let passed_of_noise = 1.0 - turn * libm::atan(1.0 / turn);
        let energy = intruder.mass * intruder.mass / intruder.damping * dt * 1e9;
        let front = bead.front_mass > 0.0;
        (front <= stated.front_mass.is_some()).then_some(Self {
            phase: (ring * dt) as f32,
            noise: (4.0 * energy * passed / passed_of_noise) as f32,
            waveform: waveform(description, stated, ring)? as f32,
            ..terms
        })
    }

    /// Square of the part of the acceleration by which its wave form may differ from the predicted one within
    /// the uncertainties, if the energies agree within theirs.
    #[inline(never)]
    pub(crate) fn of_waveform(&self, [measured, predicted]: [Energy; 2]) -> f32 {
        let amplitude = 1.0 - libm::sqrtf(predicted.bits() as f32 / measured.bits() as f32);
        self.waveform + amplitude * amplitude
    }

    /// The uncertainties of a strike's energies A and B. The quiet has the mean square `noise`, (m/s²)², and
    /// the force the noise `force`. `None` where an energy or the width of the pulse was not found.
    pub(crate) fn of(
        &self,
        shape: &Shape,
        [measured, predicted]: [Energy; 2],
        noise: f32,
        force: Force,
    ) -> Option<EnergyUncertainty> {
        const NANOJOULE: f32 = 1.0 / (1 << Energy::UNIT.fraction_bits) as f32;
        let (width, impulse) = (shape.width.bits(), shape.impulse.bits());
        if width == 0 || impulse <= 0 || measured.bits() <= 0 || predicted.bits() <= 0 {
            return None;
        }
        let width = width as f32 / (1 << 16) as f32;
        let x = (self.phase * width).clamp(PHASES[0], PHASES[1]);
        let square = |terms: &[f32; 7]| terms.iter().rev().fold(0.0, |sum, term| sum * x + term);
        let of_measured = self.noise * noise / (measured.bits() as f32 * NANOJOULE);
        // Force and impulse have the same last bit.
        let of_predicted = FORCE_NOISE * force.bits() as f32 * width / impulse as f32;
        let of_predicted = of_predicted * of_predicted;
        let part = |square: f32| {
            let root = libm::sqrtf(if square > 0.0 { square } else { 0.0 });
            Fraction::from_bits(I16F16::saturating_from_num(root).to_bits())
        };
        Some(EnergyUncertainty {
            measured: part(self.measured + of_measured),
            predicted: part(square(&self.predicted) + of_predicted),
            difference: part(square(&self.difference) + of_measured + of_predicted),
        })
    }
}

/// Square of the part of the acceleration that the uncertainties of k, c, m and κ explain, apart from its
/// amplitude, of an intruder that rings at `ring` rad/s. `None` if one is unknown.
fn waveform(description: &Description, stated: &Uncertainty, ring: f64) -> Option<f64> {
    let (bead, intruder) = (&description.bead, &description.intruder);
    let [k, c, m, contact] = [
        stated.stiffness?,
        stated.damping?,
        stated.intruder_mass?,
        stated.contact_stiffness?,
    ]
    .map(Relative::part);
    let [_, k_m, c_m] = stated.correlations();
    let decay = 0.5 * intruder.damping * (1.0 / intruder.mass + 1.0 / (bead.mass - intruder.mass));
    let frequency = 0.25 * (k * k + m * m - 2.0 * k_m * k * m);
    let decays = c * c + m * m - 2.0 * c_m * c * m;
    let square = 0.5 * (ring / decay) * (ring / decay) * frequency + 0.25 * decays;
    let contact = WAVEFORM_CONTACT * contact;
    Some(EXPLAINED * EXPLAINED * (square + contact * contact))
}

/// A fitted row for a bead with this damping and ratio of masses.
fn cubic(row: &[f64; 8], damping: f64, masses: f64) -> Cubic {
    [
        row[0] + row[4] * damping + row[6] * masses,
        row[1] + row[5] * damping + row[7] * masses,
        row[2],
        row[3],
    ]
}

/// `a + scale b`.
fn plus(a: Cubic, scale: f64, b: Cubic) -> Cubic {
    core::array::from_fn(|power| a[power] + scale * b[power])
}

/// The terms of all inputs together; `None` if one is unknown.
#[inline(never)]
fn terms(
    description: &Description,
    stated: &Uncertainty,
    damping: f64,
    passed: f64,
) -> Option<UncertaintyTerms> {
    let masses = description.intruder.mass / description.bead.mass;
    let fitted = |row| cubic(row, damping, masses);
    let [k, c, m, contact, relaxation] = [&STIFFNESS, &DAMPING, &MASS, &CONTACT, &RELAXATION].map(fitted);
    let force = plus([2.0, 0.0, 0.0, 0.0], 0.5, contact);
    let none = [0.0; 4];
    let ring = plus(plus(k, 1.0, c), 1.0, m);
    let bead = plus(plus([-1.0, 0.0, 0.0, 0.0], -1.0, ring), -1.5, contact);
    let front = plus(none, -description.bead.front_mass / description.bead.mass, bead);
    let of_low_pass = -2.0 * (1.0 - passed);

    let known = |part: Option<Relative>| part.map(Relative::part);
    // The last three are correlated.
    let inputs: [(f64, Pair); 14] = [
        (known(stated.force_gain)?, (0.0, force)),
        (known(stated.force_gain_ratio)?, (0.0, force)),
        (known(stated.force_flatness)?, (0.0, force)),
        (known(stated.acceleration_gain)?, (2.0, none)),
        (known(stated.acceleration_gain_ratio)?, (2.0, none)),
        (known(stated.acceleration_flatness)?, (2.0, none)),
        (known(stated.supply)?, (2.0, force)),
        (known(stated.bead_mass)?, (0.0, bead)),
        (known(stated.front_mass).unwrap_or(0.0), (0.0, front)),
        (known(stated.contact_stiffness)?, (0.0, contact)),
        (known(stated.relaxation)?, (0.0, relaxation)),
        (known(stated.stiffness)?, (of_low_pass, k)),
        (known(stated.damping)?, (-1.0 - of_low_pass, c)),
        (known(stated.intruder_mass)?, (2.0, m)),
    ];
    let [a, b] = ESTIMATOR.map(|most| most * most / 3.0);
    let (mut measured, mut predicted, mut difference) = (a, [0.0; 7], [0.0; 7]);
    predicted[0] = b;
    difference[0] = a + b;
    let mut add = |weight: f64, one: &Pair, other: &Pair| {
        measured += weight * one.0 * other.0;
        let apart = |pair: &Pair| plus([pair.0, 0.0, 0.0, 0.0], -1.0, pair.1);
        multiply(&mut predicted, weight, one.1, other.1);
        multiply(&mut difference, weight, apart(one), apart(other));
    };
    for (u, pair) in &inputs {
        add(u * u, pair, pair);
    }
    let [.., k, c, m] = &inputs;
    for (r, (one, other)) in stated.correlations().into_iter().zip([(k, c), (k, m), (c, m)]) {
        add(2.0 * r * one.0 * other.0, &one.1, &other.1);
    }
    Some(UncertaintyTerms {
        measured: measured as f32,
        predicted: predicted.map(|term| term as f32),
        difference: difference.map(|term| term as f32),
        phase: 0.0,
        noise: 0.0,
        waveform: 0.0,
    })
}

/// Adds `weight` times the product of two cubics.
fn multiply(sum: &mut [f64; 7], weight: f64, one: Cubic, other: Cubic) {
    for (i, a) in one.into_iter().enumerate() {
        for (j, b) in other.into_iter().enumerate() {
            sum[i + j] += weight * a * b;
        }
    }
}

#[cfg(test)]
mod tests {
    use bead_wire::{Impulse, Samples};

    use super::*;
    use crate::capture::Capture;
    use crate::design::{FrontEnd, Surroundings};
    use crate::physics::Bead;

    /// Rows of another program, which adds up the squares of one input after the other: uncertainties in the
    /// order of [`described`]; correlations of k with c, k with m, c with m; frequency, Hz, energies A and B,
    /// nJ, mean square of the quiet, (m/s²)², and noise of the force, N; u(A), u(B), u(A - B) of pulses that
    /// are 7, 30.5 and 80 samples wide; and the square of the wave form.
    const ROWS: &str = "\
0.128 0.151 0.161 0.189 0.151 0.185 0.016 0.098 0.189 0.133 0.181 0.032 0.099 0.057 | 0.5 -0.25 0.375 | 1644 800 900 0 0 | 0.63288 0.43019 0.75840 0.63288 0.48650 0.77502 0.63288 0.54494 0.79614 | 0.2525759
0.113 0.119 0.012 0.051 0.063 0.184 0.155 0.04 0.161 0.036 0.127 0.034 0.01 0.176 | 0.5 -0.25 0.375 | 1707.55 1200 900 0.5 0.02 | 0.63088 0.37657 0.56698 0.63088 0.55759 0.50322 0.63088 0.57016 0.51321 | 1.574559
0.05 0.051 0.197 0.176 0.065 0.193 0.112 0.139 0.049 0.189 0.141 0.194 0.18 0.067 | 0.5 -0.25 0.375 | 1644 800 900 0 0 | 0.70061 0.42818 0.78678 0.70061 0.52526 0.70408 0.70061 0.66766 0.71047 | 2.026943";

    /// The paper's bead with 2 g in front of the crystal and these uncertainties.
    fn described(parts: &[f64], correlations: &[f64]) -> Description {
        let bead = Bead {
            front_mass: 2e-3,
            ..Bead::paper()
        };
        let of = |place: usize| Some(Relative::new(parts[place]));
        let mut description = Description::new(
            &bead,
            &Surroundings::default(),
            &FrontEnd::reference(),
            &Capture::default(),
        );
        description.uncertainty = Some(Uncertainty {
            force_gain: of(0),
            force_gain_ratio: of(1),
            force_flatness: of(2),
            acceleration_gain: of(3),
            acceleration_gain_ratio: of(4),
            acceleration_flatness: of(5),
            supply: of(6),
            bead_mass: of(7),
            front_mass: of(8),
            contact_stiffness: of(9),
            relaxation: of(10),
            stiffness: of(11),
            damping: of(12),
            intruder_mass: of(13),
            stiffness_with_damping: Relative::new(correlations[0]),
            stiffness_with_mass: Relative::new(correlations[1]),
            damping_with_mass: Relative::new(correlations[2]),
            ..Uncertainty::default()
        });
        description
    }

    fn shape(width: f64) -> Shape {
        Shape {
            width: Samples::from_bits((width * 65_536.0) as u32),
            impulse: Impulse::from_bits(250 << 16),
            ..Shape::default()
        }
    }

    #[test]
    fn uncertainties_are_those_of_another_program() {
        for row in ROWS.lines() {
            let numbers = |part: &str| -> Vec<f64> {
                part.split_whitespace()
                    .map(|number| number.parse().unwrap())
                    .collect()
            };
            let parts: Vec<_> = row.split('|').map(numbers).collect();
            let [inputs, correlations, strike, expected, waveform] = &parts[..] else {
                panic!("{row}");
            };
            let &[hz, a, b, noise, force] = &strike[..] else {
                panic!("{row}");
            };
            let terms = UncertaintyTerms::new(&described(inputs, correlations), hz).unwrap();
            let scale = f64::from(1 << Energy::UNIT.fraction_bits);
            let energies = [a, b].map(|energy| Energy::from_bits((energy * scale) as i64));
            let force = Force::from_bits((force * 65_536.0) as i32);
            for (width, expected) in [7.0, 30.5, 80.0].into_iter().zip(expected.chunks(3)) {
                let seen = terms.of(&shape(width), energies, noise as f32, force).unwrap();
                let seen = [seen.measured, seen.predicted, seen.difference].map(|one| one.bits());
                for (seen, expected) in seen.into_iter().zip(expected) {
                    let off = f64::from(seen) / 65_536.0 - expected;
                    assert!(
                        off.abs() < 8e-5 + 1e-4 * expected,
                        "{width}: {off:e} of {expected} in {row}"
                    );
                }
            }
            let seen = f64::from(terms.of_waveform(energies));
            assert!((seen / waveform[0] - 1.0).abs() < 1e-5, "{seen} in {row}");
        }
    }

    #[test]
    fn without_an_energy_a_pulse_or_a_statement_there_is_no_uncertainty() {
        let (inputs, correlations) = ([0.01; 14], [0.0; 3]);
        let terms = UncertaintyTerms::new(&described(&inputs, &correlations), 1700.0).unwrap();
        let (one, none, noise) = (
            Energy::from_bits(1 << 30),
            Energy::from_bits(0),
            Force::from_bits(0),
        );
        let of = |shape: &Shape, energies| terms.of(shape, energies, 0.0, noise);
        assert!(of(&shape(30.0), [one, one]).is_some());
        assert!(of(&shape(0.0), [one, one]).is_none());
        assert!(of(&shape(30.0), [none, one]).is_none() && of(&shape(30.0), [one, none]).is_none());
        let mut flat = shape(30.0);
        flat.impulse = Impulse::from_bits(0);
        assert!(of(&flat, [one, one]).is_none());
        // A front mass without a stated uncertainty matters, but only where there is one.
        let mut description = described(&inputs, &correlations);
        if let Some(stated) = &mut description.uncertainty {
            stated.front_mass = None;
        }
        assert!(UncertaintyTerms::new(&description, 1700.0).is_none());
        description.bead.front_mass = 0.0;
        assert!(UncertaintyTerms::new(&description, 1700.0).is_some());
    }
}
