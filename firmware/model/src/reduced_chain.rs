//! Estimate B: the absorbed energy, predicted from the contact force alone.
//!
//! The measured force at the host's incoming contact drives a model of the host, its intruder and
//! [`FOLLOWERS`] beads behind it, of which the last is pushed back as if the chain went on (`far_end`). The
//! contacts obey the paper's Eq. 1 (Hertz and Kuwabara-Kono), the host Eq. 2 with M - m, the intruder Eq. 3.
//!
//! # Scheme
//!
//! The state is in *relative* coordinates: the overlaps, and the displacement of the intruder relative to its
//! host. So no range is left when the beads travel on. Each coordinate obeys ẍ = a(x, ẋ). It is integrated by
//! Störmer's explicit fourth-order formula, with one evaluation of the forces a sample:
//!
//! ```text
//! x[n+1] - 2x[n] + x[n-1] = dt² (14 a[n] - 5 a[n-1] + 4 a[n-2] - a[n-3])/12
//! ẋ[n] = (x[n] - x[n-1])/dt + dt (5 a[n-1] - 2 a[n-2])/6
//! ```
//!
//! (Hairer, Nørsett and Wanner, *Solving Ordinary Differential Equations I*, Sec. III.10. The second line is
//! the Taylor expansion, with a at n extrapolated from the two samples before.) It needs a quarter of the
//! force evaluations of RK4, and no force between samples.

pub use crate::company::FOLLOWERS;
use crate::company::{Company, Follower};
use crate::far_end::{FarEnd, Onward};
use crate::quantity::{EnergyScale, Length, SensedForce, SquareSum, Step, high, high_rounded, square};
use crate::scale::Scale;
use crate::sqrt::sqrt;
use bead_wire::Energy;
use fixed::types::{I0F32, I2F30, I8F24, I16F16};
use serde::{Deserialize, Serialize};

/// Number of samples in a row below the gate that still belong to a pulse.
pub const FOOT: u16 = 64;

/// Coefficients of estimate B. Accelerations are in twelfths of a µm/sample², the unit of Störmer's formula.
/// The powers of two follow from the formats of the products ([`crate::quantity`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReducedChain {
    /// 2^8/12 · κ dt²/M of the contacts between beads, µm^-0.5/sample².
    pub contact: I0F32,
    /// 3τ/(2 dt): 3/2 of the relaxation time of the contacts, in samples.
    pub relaxation: I2F30,
    /// 2^8/12 · dt²/M_h: acceleration of the host by the incoming force, µm/sample² per N.
    pub incoming: I0F32,
    /// 2^2/12 · k dt²/m of the intruder.
    pub stiffness: I0F32,
    /// 1/12 · c dt/m of the intruder.
    pub damping: I0F32,
    /// m/M_h: effect of the intruder's springs on the host. M_h is the mass of the host that the incoming
    /// force moves: M - m, less the mass in front of the sensor's crystal.
    pub intruder: I0F32,
    /// M/M_h - 1: how much more the contact behind the host accelerates it than another bead.
    pub host: I0F32,
    /// Forces below this are noise and count as zero, since the contacts would rectify them. Three standard
    /// deviations of the expected noise; a greater noise before the strike raises it.
    pub gate: SensedForce,
    /// c (1 µm/sample)² dt, nJ.
    pub energy: EnergyScale,
    /// Time that a solitary wave takes from contact to contact if its peak is one bit of acceleration,
    /// samples.
    pub delay: I16F16,
}

/// One coordinate with the state of its next step, as bits of their formats.
///
/// It keeps sums over past accelerations, not the accelerations. Each acceleration is added once, when it
/// comes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Coordinate {
    /// x[n], [`Length`].
    position: i32,
    /// ẋ[n], [`Step`].
    velocity: i32,
    /// x[n+1] - x[n], without the term 14 a[n], [`Step`].
    step: i32,
    /// The terms of a[n-1] and a[n-2] in the step after: 4 a[n-1] - a[n-2], [`Step`].
    after: i32,
    /// a[n-1] in twelfths, [`Step`].
    last: i32,
}

impl Coordinate {
    /// Advances by one sample; `a` is the acceleration at this sample, in twelfths.
    #[inline(always)]
    fn advance(&mut self, a: i32, watch: &mut Watch) {
        let step = self.step.saturating_add(14 * a);
        watch.state(step);
        // Rounding down costs a quarter of a picometre a sample.
        self.position = self.position.saturating_add(step >> STEP_TO_LENGTH);
        self.velocity = step.saturating_add(2 * (5 * a - 2 * self.last));
        self.step = step.saturating_add(self.after - 5 * a);
        self.after = 4 * a - self.last;
        self.last = a;
    }
}

/// Number of fraction bits by which a step exceeds a position.
const STEP_TO_LENGTH: u32 = Step::FRAC_NBITS - Length::FRAC_NBITS;

/// Limit of the accelerations, in twelfths: ±6 µm/sample² (60 km/s² at 100 kHz). The core saturates to this
/// range in one instruction, and the weighted sum of four samples stays inside 32 bits.
const LIMIT: i32 = 1 << 23;

/// Remembers whether a value has left its range. It collects the bits of all magnitudes by OR; states are
/// scaled so that [`LIMIT`] is half of their format. Two instructions collect the bits; a comparison would
/// take four.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Watch(i32);

impl Watch {
    /// Adds a state.
    #[inline(always)]
    fn state(&mut self, value: i32) {
        self.0 |= magnitude(value) >> 7;
    }

    /// Adds an acceleration in twelfths, and limits it.
    #[inline(always)]
    fn limited(&mut self, twelfths: i32) -> i32 {
        self.0 |= magnitude(twelfths);
        twelfths.clamp(-LIMIT, LIMIT - 1)
    }
}

/// `|value|`; one less if `value` is negative.
#[inline(always)]
fn magnitude(value: i32) -> i32 {
    value ^ (value >> 31)
}

/// State of estimate B. The beads start at rest and just touch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReducedChainState {
    /// The overlaps behind the host.
    overlaps: [Coordinate; FOLLOWERS],
    /// The intruder's displacement relative to its host.
    intruder: Coordinate,
    /// Displacements of the followers' intruders relative to their hosts, where they hold one.
    behind: [Coordinate; FOLLOWERS],
    /// The chain behind the last follower.
    end: FarEnd,
    squares: SquareSum<{ 2 * Length::FRAC_NBITS }>,
    watch: Watch,
    /// Samples since the force was above the gate, or since the start.
    silent: u16,
    /// Gate by the noise before the strike: forces below it count as zero.
    gate: SensedForce,
}

impl ReducedChainState {
    /// Sets the gate from the noise before the strike: `squares` is Σ F² over `samples`, in bits of
    /// [`SensedForce`].
    pub(crate) fn gate_noise(&mut self, squares: u64, samples: u16) {
        let rms = (squares / u64::from(samples.max(1))).isqrt();
        self.gate = SensedForce::from_bits(i32::try_from(3 * rms).unwrap_or(i32::MAX));
    }

    /// Three standard deviations of the force's noise before the strike.
    pub fn gate(&self) -> SensedForce {
        self.gate
    }

    /// Displacement of the intruder relative to its host after the newest sample, µm, and its change over a
    /// sample, µm.
    pub(crate) fn intruder(&self) -> [f32; 2] {
        let Coordinate {
            position, velocity, ..
        } = self.intruder;
        const POSITION: f32 = 1.0 / (1_u32 << Length::FRAC_NBITS) as f32;
        const VELOCITY: f32 = 1.0 / (1_u32 << Step::FRAC_NBITS) as f32;
        [POSITION * position as f32, VELOCITY * velocity as f32]
    }

    /// Returns `true` once an echo from behind the last follower may have reached the host.
    pub(crate) fn echoes(&self) -> bool {
        self.end.echoes()
    }

    /// Returns `true` if a state left half the range of its format since the window opened.
    pub fn saturated(&self) -> bool {
        self.watch.0 >= LIMIT
    }
}

impl ReducedChain {
    /// Takes the forces at the host's incoming contact at the next samples, at most
    /// [`PIECE`](crate::layout::PIECE), and writes the acceleration of the intruder at each into `predicted`,
    /// in twelfths. Never inlined, so that its instructions can be counted by its symbol.
    #[inline(never)]
    pub fn process(
        &self,
        scale: &Scale,
        company: &Company,
        state: &mut ReducedChainState,
        forces: &[SensedForce],
        predicted: &mut [i32],
    ) {
        let scaled = [scale.contact, scale.incoming, scale.masses] != [0; 3];
        let powers = &Powers::new(scale);
        match (scaled, company.is_uniform()) {
            (false, true) => self.run::<false, false>(powers, company, state, forces, predicted),
            (true, true) => self.run::<true, false>(powers, company, state, forces, predicted),
            (false, false) => self.run::<false, true>(powers, company, state, forces, predicted),
            (true, false) => self.run::<true, true>(powers, company, state, forces, predicted),
        }
    }

    /// [`ReducedChain::process`]. Unless `SCALED`, all `powers` count as zero; unless `UNLIKE`, the followers
    /// in `company` count as like the host.
    #[inline(always)]
    fn run<const SCALED: bool, const UNLIKE: bool>(
        &self,
        powers: &Powers,
        company: &Company,
        state: &mut ReducedChainState,
        forces: &[SensedForce],
        predicted: &mut [i32],
    ) {
        let gate = self.gate.max(state.gate).to_bits();
        let mut silent = state.silent;
        let ReducedChainState {
            mut overlaps,
            mut intruder,
            behind: mut intruders,
            mut watch,
            ..
        } = *state;
        let end = &mut state.end;
        let onward = &self.onward(company);
        let force = |follower: usize, overlaps: &[Coordinate; FOLLOWERS], watch: &mut Watch| {
            let Coordinate {
                position, velocity, ..
            } = overlaps[follower];
            if UNLIKE {
                let Follower {
                    contact,
                    relaxation,
                    overlap,
                    load,
                    ..
                } = company.followers[follower];
                let position = position.saturating_add(overlap.to_bits());
                contact_force::<SCALED>(
                    [contact.to_bits(), relaxation.to_bits()],
                    powers,
                    position,
                    velocity,
                    watch,
                ) - load
            } else {
                let coefficients = [self.contact.to_bits(), self.relaxation.to_bits()];
                contact_force::<SCALED>(coefficients, powers, position, velocity, watch)
            }
        };
        let mut squares = 0;
        for (&measured, predicted) in forces.iter().zip(predicted) {
            // From the end to the host: this order needs the fewest values at a time.
            let mut contact = force(FOLLOWERS - 1, &overlaps, &mut watch);
            // Acceleration of the bead behind the contact.
            let mut behind = contact - end.push(contact, onward);
            if UNLIKE {
                behind = company.follow::<SCALED>(FOLLOWERS - 1, behind, powers, &mut intruders, &mut watch);
            }
            for i in (1..FOLLOWERS).rev() {
                let ahead = force(i - 1, &overlaps, &mut watch);
                let mut bead = ahead - contact;
                if UNLIKE {
                    bead = company.follow::<SCALED>(i - 1, bead, powers, &mut intruders, &mut watch);
                }
                overlaps[i].advance(bead - behind, &mut watch);
                (behind, contact) = (bead, ahead);
            }

            let velocity = intruder.velocity;
            squares += square(velocity >> STEP_TO_LENGTH);
            // (k x + c ẋ)/m
            let springs = watch.limited(
                high_rounded(self.stiffness.to_bits(), intruder.position)
                    + high_rounded(self.damping.to_bits(), velocity),
            );
            *predicted = -springs;
            let measured = gated(gate, &mut silent, measured);
            // The bounds of settings leave room for these powers.
            let [measured, pushed, pulled] = if SCALED {
                [
                    measured << powers.incoming,
                    springs << powers.masses,
                    contact << powers.masses,
                ]
            } else {
                [measured, springs, contact]
            };
            let incoming = watch.limited(high_rounded(self.incoming.to_bits(), measured));
            let host = incoming - contact + high_rounded(self.intruder.to_bits(), pushed)
                - high_rounded(self.host.to_bits(), pulled);
            // Unscaled, the ratios of the masses are below a half, and the sum has room.
            let host = if SCALED { watch.limited(host) } else { host };
            overlaps[0].advance(host - behind, &mut watch);
            intruder.advance(-springs - host, &mut watch);
            watch.state(intruder.position);
        }
        (state.overlaps, state.intruder, state.watch) = (overlaps, intruder, watch);
        if UNLIKE {
            state.behind = intruders;
        }
        state.silent = silent;
        state.squares.add(squares);
    }

    /// Continuation of the wave behind the last follower.
    fn onward(&self, company: &Company) -> Onward {
        let Follower { relaxation, load, .. } = company.followers[FOLLOWERS - 1];
        Onward::new(self.delay, relaxation, load)
    }

    /// The energy absorbed so far. The coefficient `energy` is its bits times 2^`powers`.
    pub fn absorbed(&self, powers: i8, state: &ReducedChainState) -> Energy {
        state.squares.energy(self.energy, powers)
    }
}

/// Eq. 1: `κ √δ (δ + (3/2) τ δ̇)` for δ > 0, in twelfths of the acceleration of a host; from the bits of
/// κ and τ ([`ReducedChain`]), of an overlap and of its change.
#[inline(always)]
fn contact_force<const SCALED: bool>(
    [contact, relaxation]: [i32; 2],
    powers: &Powers,
    overlap: i32,
    velocity: i32,
    watch: &mut Watch,
) -> i32 {
    if overlap <= 0 {
        // Beads that have parted may drift until the overlap saturates. The contact stays open.
        return 0;
    }
    watch.state(overlap);
    let root = |overlap| sqrt(Length::from_bits(overlap)).to_bits();
    let stiffness = if SCALED {
        let overlap = overlap.min(powers.most);
        watch.state(overlap << powers.watch);
        high(contact, root(overlap)) << powers.contact
    } else {
        high(contact, root(overlap))
    };
    let viscous = high_rounded(relaxation, velocity);
    watch.limited(high_rounded(stiffness, overlap.saturating_add(viscous)))
}

impl Company {
    /// Acceleration of a follower, in twelfths, by a push of its contacts that would accelerate a host by
    /// `pushed`. Advances its intruder, if it holds one.
    #[inline(always)]
    fn follow<const SCALED: bool>(
        &self,
        follower: usize,
        pushed: i32,
        powers: &Powers,
        intruders: &mut [Coordinate; FOLLOWERS],
        watch: &mut Watch,
    ) -> i32 {
        let Follower { lightness, ratio, .. } = self.followers[follower];
        let pushed = if self.unlike {
            let scaled = i64::from(pushed) * i64::from(lightness.to_bits());
            // Forces are below 2^24 and a bead is at most 64 times as light: there is room.
            watch.limited((scaled >> I8F24::FRAC_NBITS) as i32)
        } else {
            pushed
        };
        if !self.holds(follower) {
            return pushed;
        }
        let intruder = &mut intruders[follower];
        // (k x + c ẋ)/m
        let springs = watch.limited(
            high_rounded(self.stiffness.to_bits(), intruder.position)
                + high_rounded(self.damping.to_bits(), intruder.velocity),
        );
        // M/(M - m) = 1 + m/(M - m). Both terms are limited, so there is room for the powers.
        let drawn = (pushed + springs) << if SCALED { powers.masses } else { 0 };
        let bead = watch.limited(pushed + high_rounded(ratio.to_bits(), drawn));
        intruder.advance(-springs - bead, watch);
        watch.state(intruder.position);
        bead
    }
}

/// [`Scale`] as the loop needs it.
#[derive(Clone, Copy, Debug, Default)]
struct Powers {
    contact: u8,
    incoming: u8,
    masses: u8,
    /// Bits of the greatest overlap for which the stiffness has room: a little less than 4^(6 - contact) µm.
    most: i32,
    /// Brings half of `most` to half of its format.
    watch: u8,
}

impl Powers {
    fn new(scale: &Scale) -> Self {
        // The stiffness stays below 2^31 if √(overlap in µm) < 2^(6 - contact), that is, if the overlap is
        // below 2^(12 - 2·contact) µm. A thousandth less leaves room for the error of the root.
        let room = (1_i64 << (Length::FRAC_NBITS + 12 - 2 * u32::from(scale.contact))) / 1024 * 1023;
        Self {
            contact: scale.contact,
            incoming: scale.incoming,
            masses: scale.masses,
            most: i32::try_from(room).unwrap_or(i32::MAX),
            watch: (2 * scale.contact).saturating_sub(3),
        }
    }
}

/// The bits of a force, or 0 if it is noise.
///
/// A gate for single samples would cut off the foot of each pulse, which costs more than the noise. So the
/// gate closes when more than [`FOOT`] samples in a row were below it. At the start of a strike it is open.
#[inline(always)]
fn gated(gate: i32, silent: &mut u16, force: SensedForce) -> i32 {
    let force = force.to_bits();
    *silent = if force.abs() < gate { *silent + 1 } else { 0 };
    if *silent > FOOT { 0 } else { force }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_or_an_acceleration_that_leaves_its_range_is_remembered_and_the_acceleration_limited() {
        // States are in units of which 2^7 are one of an acceleration.
        for (value, limited, left) in [
            (0, 0, false),
            (-1, -1, false),
            (LIMIT - 1, LIMIT - 1, false),
            (LIMIT, LIMIT - 1, true),
            (-LIMIT, -LIMIT, false),
            (-LIMIT - 1, -LIMIT, true),
        ] {
            let mut watch = Watch::default();
            assert_eq!(watch.limited(value), limited);
            // The states after it are small.
            watch.state(1);
            assert_eq!(watch.0 >= LIMIT, left, "{value}");
            for state in [value << 7, (value << 7) + 0x7F] {
                let mut watch = Watch::default();
                watch.state(state);
                watch.limited(-1);
                assert_eq!(watch.0 >= LIMIT, left, "{state}");
            }
        }
        assert_eq!(
            [i32::MIN, i32::MAX].map(|a| Watch::default().limited(a)),
            [-LIMIT, LIMIT - 1]
        );
    }

    #[test]
    fn an_overlap_beyond_half_of_what_its_powers_leave_room_for_is_remembered() {
        let left = |contact: u8, position: i32| {
            let powers = Powers::new(&Scale {
                contact,
                ..Scale::default()
            });
            // No stiffness, so nothing but the overlap is watched.
            let mut watch = Watch::default();
            contact_force::<true>([0; 2], &powers, position, 0, &mut watch);
            watch.0 >= LIMIT
        };
        // 256 µm of the paper's bead; 4^(6 - contact)/2 µm if there is less room.
        for (contact, half) in [(0, 256.0), (1, 256.0), (2, 128.0), (3, 32.0), (6, 0.5)] {
            let half = Length::from_num(half).to_bits();
            assert!(!left(contact, half - 1), "{contact}");
            assert!(left(contact, half), "{contact}");
            // Beads that have parted may drift.
            assert!(!left(contact, -half), "{contact}");
        }
    }

    #[test]
    fn the_gate_closes_after_its_foot_and_a_force_at_it_opens_it() {
        let gate = SensedForce::ONE;
        let [below, at] = [gate - SensedForce::DELTA, gate].map(|force| [force, -force]);
        let mut silent = 0;
        let mut gated = |force: SensedForce| gated(gate.to_bits(), &mut silent, force);
        for _ in 0..2 {
            for n in 0..FOOT {
                let force = below[usize::from(n % 2)];
                assert_eq!(gated(force), force.to_bits(), "{n}");
            }
            assert_eq!(below.map(&mut gated), [0; 2]);
            // Each of these alone.
            for force in at {
                assert_eq!(gated(force), force.to_bits());
            }
        }
    }
}
