//! From the physics of the bead to the coefficients of its estimators: the only place where they are derived.
//!
//! # Design
//!
//! The host derives the coefficients in f64 and converts them to their fixed-point formats (`design`). The
//! bead gets the physics and the coefficients. It derives the coefficients again, in f32 and by these same
//! lines, and refuses settings whose coefficients do not belong to their physics
//! ([`Settings::validate`](crate::Settings::validate)).
//!
//! Sources: estimate A, exact solution of `c ẋ + k x = -m a` for a first-order hold
//! ([`observer`](crate::observer)); estimate B, Eqs. 1 to 3 of the paper in units of µm and samples
//! ([`reduced_chain`](crate::reduced_chain)).

use num_traits::Float;
use serde::{Deserialize, Serialize};

/// Energy of the solitary wave of an elastic chain: `E = 1.0465162 κ^{-2/3} F_m^{5/3}`, for beads of any
/// mass. Found from the pulse at contact 70 of a chain with κ = M = 1, integrated to 1e-12. The number of
/// beads around the pulse that are counted changes it by less than 1e-15.
pub const SOLITARY_WAVE_ENERGY: f64 = 1.046_516_203;

/// The bead with its intruder and the chain that it stands in, SI units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bead<T = f64> {
    /// M, mass of the host with its intruder, and of each bead behind it, kg.
    pub mass: T,
    /// m, mass of the intruder, kg.
    pub intruder_mass: T,
    /// Mass in front of the crystal of the force sensor, kg. It is a part of M that the measured force does
    /// not move.
    pub front_mass: T,
    /// k, stiffness of the intruder's springs, N/m.
    pub stiffness: T,
    /// c, damping of the intruder, N·s/m.
    pub damping: T,
    /// κ, stiffness of the contacts between beads, N/m^1.5.
    pub contact_stiffness: T,
    /// τ, the relaxation time of those contacts, s.
    pub relaxation: T,
}

/// An intruder, SI units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Intruder<T = f64> {
    /// m, its mass, kg.
    pub mass: T,
    /// k, stiffness of its springs, N/m.
    pub stiffness: T,
    /// c, its damping, N·s/m.
    pub damping: T,
}

impl<T: Float> Intruder<T> {
    /// Coefficients of this intruder in a follower of mass `bead_mass`: [`Company::stiffness`], `damping` and
    /// `ratio`. All are zero for an intruder of zeros, which is none.
    ///
    /// [`Company::stiffness`]: crate::company::Company::stiffness
    pub fn coefficients(&self, bead_mass: T, sample_rate_hz: T) -> [T; 3] {
        if self.mass <= T::zero() {
            return [T::zero(); 3];
        }
        let number = |value: f64| T::from(value).expect("a float is made of any f64");
        let dt = sample_rate_hz.recip();
        let twelfth = dt * dt / number(12.0);
        [
            number(4.0) * self.stiffness / self.mass * twelfth,
            self.damping / self.mass * twelfth / dt,
            self.mass / (bead_mass - self.mass),
        ]
    }
}

/// The coefficients before they are converted to their formats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coefficients<T> {
    /// Of estimate A: [`Observer::start`](crate::observer::Observer::start).
    pub start: T,
    /// [`Observer::end`](crate::observer::Observer::end).
    pub end: T,
    /// [`Observer::energy`](crate::observer::Observer::energy).
    pub measured: T,
    /// Of estimate B: [`ReducedChain::contact`](crate::reduced_chain::ReducedChain::contact).
    pub contact: T,
    /// [`ReducedChain::relaxation`](crate::reduced_chain::ReducedChain::relaxation).
    pub relaxation: T,
    /// [`ReducedChain::incoming`](crate::reduced_chain::ReducedChain::incoming).
    pub incoming: T,
    /// [`ReducedChain::stiffness`](crate::reduced_chain::ReducedChain::stiffness).
    pub stiffness: T,
    /// [`ReducedChain::damping`](crate::reduced_chain::ReducedChain::damping).
    pub damping: T,
    /// [`ReducedChain::intruder`](crate::reduced_chain::ReducedChain::intruder).
    pub intruder: T,
    /// [`ReducedChain::host`](crate::reduced_chain::ReducedChain::host).
    pub host: T,
    /// [`ReducedChain::energy`](crate::reduced_chain::ReducedChain::energy).
    pub predicted: T,
    /// [`Settings::incident`](crate::Settings::incident).
    pub incident: T,
    /// [`Ringing::frequency`](crate::shape::Ringing::frequency); 0 if the intruder does not ring.
    pub ring_frequency: T,
    /// [`Ringing::decay`](crate::shape::Ringing::decay).
    pub ring_decay: T,
}

/// The coefficients of a bead that samples at `sample_rate_hz`.
pub fn coefficients<T: Float>(bead: &Bead<T>, sample_rate_hz: T) -> Coefficients<T> {
    let number = |value: f64| T::from(value).expect("a float is made of any f64");
    let (um, nj) = (number(1e6), number(1e9)); // µm in a metre, nJ in a joule
    let dt = sample_rate_hz.recip();
    // The mass that the measured force moves.
    let host_mass = bead.mass - bead.intruder_mass - bead.front_mass;

    let phase = bead.stiffness / bead.damping * dt; // λ dt
    let lost = -(-phase).exp_m1(); // 1 - φ
    let mean = lost / phase; // of exp(-λ t) over a sample

    // Accelerations are in twelfths, see `ReducedChain`.
    let twelfth = dt * dt / number(12.0);
    let scale = number(256.0);

    // Behind the wave the host flies free, so the reduced mass rings: k = μ (ω² + β²), c = 2 μ β.
    let reduced = bead.intruder_mass * (bead.mass - bead.intruder_mass) / bead.mass;
    let ring_decay = bead.damping / (number(2.0) * reduced);
    let ring = bead.stiffness / reduced - ring_decay * ring_decay;

    // Its power 2/3. The cube root of `libm` for f32 reckons in f64, which takes 3 KB of flash; these two do
    // not.
    let root_squared = (bead.contact_stiffness.ln() * number(2.0 / 3.0)).exp_m1() + T::one();

    Coefficients {
        start: mean - (T::one() - lost),
        end: T::one() - mean,
        measured: bead.intruder_mass * bead.intruder_mass / bead.damping * dt * nj,
        contact: scale * bead.contact_stiffness / um.sqrt() / bead.mass * twelfth,
        relaxation: number(1.5) * bead.relaxation / dt,
        incoming: scale / host_mass * twelfth * um,
        stiffness: number(4.0) * bead.stiffness / bead.intruder_mass * twelfth,
        damping: bead.damping / bead.intruder_mass * twelfth / dt,
        intruder: bead.intruder_mass / host_mass,
        host: (bead.mass - host_mass) / host_mass,
        // c ẋ² dt of a velocity of 1 µm/sample.
        predicted: bead.damping / dt / (um * um) * nj,
        incident: number(SOLITARY_WAVE_ENERGY) * nj / root_squared,
        ring_frequency: ring.max(T::zero()).sqrt() / number(core::f64::consts::TAU),
        ring_decay,
    }
}
