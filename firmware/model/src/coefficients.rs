//! From the description of a bead to the coefficients of its estimators: the only place where they are
//! derived.
//!
//! # Design
//!
//! Bead and host derive the coefficients by these lines, in f64, once, when settings are taken. Logarithm,
//! exponential and root are those of `libm` on both, so all bits are the same.
//!
//! Sources: estimate A, exact solution of `c ẋ + k x = -m a` for a first-order hold
//! ([`observer`](crate::observer)); estimate B, Eqs. 1 to 3 of the paper in units of µm and samples
//! ([`reduced_chain`](crate::reduced_chain)).

use core::array;
use core::f64::consts::TAU;
use core::ops::Range;

use fixed::FixedI32;
use fixed::types::I16F16;
use fixed::types::extra::LeEqU32;

use crate::calibration::Channel;
use crate::company::{Company, FOLLOWERS, Follower};
use crate::converter::CONVERSION;
use crate::correction::{Correction, in_range, sin_cos};
use crate::description::Description;
use crate::front_end::SensorScale;
use crate::layout::WindowSettings;
use crate::observer::Observer;
use crate::physics::{Bead, Followers, SOLITARY_WAVE_DELAY, SOLITARY_WAVE_ENERGY, power};
use crate::quantity::{SensedForce, Step, nearest, two_to};
use crate::quiet::{CodeNoise, Quiet};
use crate::reduced_chain::ReducedChain;
use crate::ring_down::RingDown;
use crate::scale::{INCOMING_MAX, POWERS_MAX, SHIFT_MAX, Scale};
use crate::sensor::Sensor;
use crate::shape::{Fine, Ringing};
use crate::violation::{Bound, Coefficient, SettingKey as Key, Violation, require};
use crate::waveform::WaveformJudge;

/// Coefficients of both estimators in their formats.
pub(crate) struct Coefficients {
    pub(crate) observer: Observer,
    pub(crate) chain: ReducedChain,
    pub(crate) company: Company,
    pub(crate) scale: Scale,
    pub(crate) incident: I16F16,
    pub(crate) ringing: Ringing,
    pub(crate) waveform: WaveformJudge,
    /// Phase by which the intruder rings in a sample, rad.
    pub(crate) phase: f64,
    pub(crate) ring_down: RingDown,
    pub(crate) quiet: Quiet,
}

/// Coefficients before they are converted to their formats.
struct Exact {
    start: f64,
    end: f64,
    measured: f64,
    contact: f64,
    relaxation: f64,
    incoming: f64,
    stiffness: f64,
    damping: f64,
    intruder: f64,
    host: f64,
    predicted: f64,
    incident: f64,
    ring_frequency: f64,
    /// Phase by which the intruder rings in a sample, rad.
    ring_phase: f64,
    ring_decay: f64,
}

impl Exact {
    #[inline(never)]
    fn new(bead: &Bead, dt: f64) -> Self {
        let (um, nj) = (1e6, 1e9); // µm in a metre, nJ in a joule
        // The mass that the measured force moves.
        let host_mass = bead.mass - bead.intruder_mass - bead.front_mass;

        let phase = bead.stiffness / bead.damping * dt; // λ dt
        let lost = -libm::expm1(-phase); // 1 - φ
        let mean = lost / phase; // of exp(-λ t) over a sample

        // Accelerations are in twelfths, see `ReducedChain`.
        let twelfth = dt * dt / 12.0;
        let scale = 256.0;

        // Behind the wave the host flies free, so the reduced mass rings: k = μ (ω² + β²), c = 2 μ β.
        let reduced = bead.intruder_mass * (bead.mass - bead.intruder_mass) / bead.mass;
        let ring_decay = bead.damping / (2.0 * reduced);
        let ring = bead.stiffness / reduced - ring_decay * ring_decay;
        // An overdamped intruder does not ring.
        let ring_frequency = libm::sqrt(if ring > 0.0 { ring } else { 0.0 }) / TAU;
        let ring_phase = TAU * ring_frequency * dt;

        Self {
            start: mean - (1.0 - lost),
            end: 1.0 - mean,
            measured: bead.intruder_mass * bead.intruder_mass / bead.damping * dt * nj
                / hold_power(phase, ring_phase),
            contact: contact(bead.contact_stiffness, bead.mass, dt),
            relaxation: 1.5 * bead.relaxation / dt,
            incoming: scale / host_mass * twelfth * um,
            stiffness: 4.0 * bead.stiffness / bead.intruder_mass * twelfth,
            damping: bead.damping / bead.intruder_mass * twelfth / dt,
            intruder: bead.intruder_mass / host_mass,
            host: (bead.mass - host_mass) / host_mass,
            // c ẋ² dt of a velocity of 1 µm/sample.
            predicted: bead.damping / dt / (um * um) * nj,
            incident: SOLITARY_WAVE_ENERGY * nj / power(bead.contact_stiffness, 2.0 / 3.0),
            ring_frequency,
            ring_phase,
            ring_decay,
        }
    }
}

/// Fraction of the power of an oscillation that estimate A captures, as it takes the acceleration to be
/// linear between samples: 0.9995 for an intruder of 5 kHz, 0.996 for one of 9 kHz. `ring` is the phase of
/// the oscillation in a sample, rad. With `decay` = λ dt and H the transfer from a to y, the fraction is
/// `|1 - H|²` of the samples over that of the signal.
fn hold_power(decay: f64, ring: f64) -> f64 {
    let ring = in_range(ring);
    let lost = -libm::expm1(-decay);
    let (kept, mean) = (1.0 - lost, lost / decay);
    let [_, cos] = sin_cos(ring);
    let step = 2.0 * (1.0 - cos);
    mean * mean * step * (decay * decay + ring * ring) / (ring * ring * (lost * lost + kept * step))
}

/// Force that accelerates a bead of this mass by one bit of a [`Step`], counted in twelfths, N.
fn unit_of_force(mass: f64, dt: f64) -> f64 {
    mass * 12.0 * two_to(-(Step::FRAC_NBITS as i32)) / 1e6 / (dt * dt)
}

/// [`ReducedChain::delay`], samples: from contact to contact of beads of a mass and contact stiffness, of a
/// solitary wave whose peak accelerates a host by one bit.
fn delay(host_mass: f64, [mass, stiffness]: [f64; 2], dt: f64) -> f64 {
    let force = unit_of_force(host_mass, dt);
    let root = power(stiffness, 1.0 / 3.0) * power(force, 1.0 / 6.0);
    SOLITARY_WAVE_DELAY * libm::sqrt(mass) / root / dt
}

/// Coefficients of [`Company`] before they are converted to their formats.
struct ExactCompany {
    stiffness: f64,
    damping: f64,
    /// For each follower.
    contacts: [f64; FOLLOWERS],
    relaxations: [f64; FOLLOWERS],
    overlaps: [f64; FOLLOWERS],
    lightness: [f64; FOLLOWERS],
    ratios: [f64; FOLLOWERS],
    load: f64,
    delay: f64,
}

impl ExactCompany {
    /// Coefficients for intruders at these `places`, in the followers of the description or, without any, in
    /// beads like the host.
    #[inline(never)]
    fn new(description: &Description, places: u8, dt: f64) -> Self {
        let bead = description.physics();
        let followers = description.followers.unwrap_or_else(|| Followers::like(&bead));
        let intruder = description.company.intruder();
        let [mut stiffness, mut damping] = [0.0; 2];
        let twelfth = dt * dt / 12.0;
        if places != 0 {
            stiffness = 4.0 * intruder.stiffness / intruder.mass * twelfth;
            damping = intruder.damping / intruder.mass * twelfth / dt;
        }
        let each = |value: fn(&Followers, usize) -> f64| array::from_fn(|n| value(&followers, n));
        let mass: [f64; FOLLOWERS] = each(|all, n| all.mass[n].into());
        let kappa: [f64; FOLLOWERS] = each(|all, n| all.stiffness[n].into());
        let load = f64::from(followers.load);
        let compressed = |kappa: f64| {
            if load > 0.0 && kappa > 0.0 {
                1e6 * power(load / kappa, 2.0 / 3.0)
            } else {
                0.0
            }
        };
        let last = FOLLOWERS - 1;
        let ratios = array::from_fn(|n| {
            let is_held = places >> n & 1 == 1;
            if is_held {
                intruder.mass / (mass[n] - intruder.mass)
            } else {
                0.0
            }
        });
        Self {
            stiffness,
            damping,
            contacts: kappa.map(|kappa| contact(kappa, bead.mass, dt)),
            relaxations: each(|all, n| all.relaxation[n].into()).map(|tau: f64| 1.5 * tau / dt),
            overlaps: kappa.map(compressed),
            lightness: array::from_fn(|n| {
                if followers.is_wall(n) {
                    0.0
                } else {
                    bead.mass / mass[n]
                }
            }),
            ratios,
            load: load / unit_of_force(bead.mass, dt),
            delay: if kappa[last] > 0.0 {
                delay(bead.mass, [mass[last], kappa[last]], dt)
            } else {
                0.0
            },
        }
    }

    /// Converts the coefficients to their formats, with the powers of two in `scale` taken out.
    fn company(&self, description: &Description, places: u8, scale: &Scale) -> Result<Company, Violation> {
        use Coefficient as C;
        let [contact, masses] = [scale.contact, scale.masses].map(|powers| two_to(-i32::from(powers)));
        let follower = |n: usize| {
            Ok(Follower {
                contact: signed(Key::FollowersStiffness, C::Contact, self.contacts[n] * contact)?,
                relaxation: signed(Key::FollowersRelaxation, C::Relaxation, self.relaxations[n])?,
                overlap: nearest(self.overlaps[n]),
                load: if self.overlaps[n] > 0.0 {
                    libm::rint(self.load) as i32
                } else {
                    0
                },
                lightness: nearest(self.lightness[n]),
                ratio: signed(Key::CompanyMass, C::CompanyRatio, self.ratios[n] * masses)?,
            })
        };
        let mut followers = [Follower::default(); FOLLOWERS];
        for (n, one) in followers.iter_mut().enumerate() {
            *one = follower(n)?;
        }
        Ok(Company {
            behind: places,
            elsewhere: description.company.elsewhere == 1,
            unlike: description.followers.is_some(),
            stiffness: signed(Key::CompanyStiffness, C::CompanyStiffness, self.stiffness)?,
            damping: signed(Key::CompanyDamping, C::CompanyDamping, self.damping)?,
            followers,
        })
    }
}

/// [`ReducedChain::contact`] of a contact stiffness, between hosts of this mass.
fn contact(stiffness: f64, mass: f64, dt: f64) -> f64 {
    // 1e3 is the root of the µm in a metre.
    256.0 * stiffness / 1e3 / mass * (dt * dt / 12.0)
}

/// A fixed-point format of 32 bits.
#[derive(Clone, Copy)]
struct FixedFormat {
    /// Bits of the fraction.
    fraction: u32,
    /// Least and greatest number, in units of the last bit.
    bits: [f64; 2],
}

impl FixedFormat {
    const U16F16: Self = Self {
        fraction: 16,
        bits: [0.0, u32::MAX as f64],
    };

    const fn signed(fraction: u32) -> Self {
        Self {
            fraction,
            bits: [i32::MIN as f64, i32::MAX as f64],
        }
    }

    /// Bits of `value`. `None` if the format does not hold it, or loses more than 1e-4 of it.
    #[inline(never)]
    fn exact(self, value: f64) -> Option<i64> {
        let scaled = value * two_to(self.fraction as i32);
        let rounded = libm::rint(scaled);
        let [least, most] = self.bits;
        let exact = (rounded - scaled).abs() <= 1e-4 * scaled.abs();
        (exact && (least..=most).contains(&rounded)).then_some(rounded as i64)
    }

    /// The least and the greatest number above 0 that the format holds to 1e-4 of itself.
    fn range(self) -> [f64; 2] {
        let last = two_to(-(self.fraction as i32));
        [last * 5e3, last * self.bits[1]]
    }
}

/// Bits of a coefficient. If its format does not hold it, the error names the setting `key`. Never inlined:
/// there would be seventeen copies.
#[inline(never)]
fn hold(format: FixedFormat, key: Key, coefficient: Coefficient, value: f64) -> Result<i64, Violation> {
    format.exact(value).ok_or(Violation {
        key,
        bound: Bound::Format {
            coefficient,
            value,
            range: format.range(),
        },
    })
}

/// A coefficient in the signed format of its type.
fn signed<F: LeEqU32>(key: Key, coefficient: Coefficient, value: f64) -> Result<FixedI32<F>, Violation> {
    hold(FixedFormat::signed(F::U32), key, coefficient, value).map(|bits| FixedI32::from_bits(bits as i32))
}

/// A coefficient that is a rate.
fn rate(key: Key, coefficient: Coefficient, value: f64) -> Result<Fine, Violation> {
    hold(FixedFormat::U16F16, key, coefficient, value).map(|bits| Fine::from_bits(bits as u32))
}

impl Coefficients {
    /// The coefficients of a bead whose description was checked. The bits of `places` mark the followers that
    /// hold an intruder.
    ///
    /// # Errors
    /// A coefficient that its format does not hold.
    pub(crate) fn new(description: &Description, places: u8) -> Result<Self, Violation> {
        let capture = &description.capture;
        let dt = 1.0 / f64::from(capture.sample_rate_hz);
        let bead = description.physics();
        let exact = Exact::new(&bead, dt);
        let noise = |sensor: &SensorScale| CodeNoise {
            per_code: sensor.per_code,
            noise: sensor.noise,
            correction: Correction::new(lag(sensor.pole) / dt, 0.0, exact.ring_phase),
        };
        let company = ExactCompany::new(description, places, dt);
        let greatest = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
        let scale = Scale {
            contact: shift(&[exact.contact, greatest(&company.contacts)], SHIFT_MAX),
            incoming: shift(&[exact.incoming], INCOMING_MAX),
            masses: shift(
                &[exact.intruder, exact.host, greatest(&company.ratios)],
                SHIFT_MAX,
            ),
            observer: shift(&[exact.end], 1),
            measured: shift_into(exact.measured, 1.0 / 65536.0..1.0),
            predicted: shift_into(exact.predicted, 0.1..16384.0),
        };
        let without = |value: f64, powers: u8| value * two_to(-i32::from(powers));
        let measured = exact.measured * two_to(-i32::from(scale.measured));
        let predicted = exact.predicted * two_to(-i32::from(scale.predicted));
        use Coefficient as C;
        Ok(Self {
            observer: Observer {
                start: signed(Key::IntruderDamping, C::OldAcceleration, exact.start)?,
                end: signed(
                    Key::IntruderDamping,
                    C::NewAcceleration,
                    without(exact.end, scale.observer),
                )?,
                energy: signed(Key::IntruderMass, C::EnergyByAcceleration, measured)?,
            },
            chain: ReducedChain {
                contact: signed(
                    Key::ContactStiffness,
                    C::Contact,
                    without(exact.contact, scale.contact),
                )?,
                relaxation: signed(Key::ContactRelaxation, C::Relaxation, exact.relaxation)?,
                incoming: signed(
                    Key::BeadMass,
                    C::Incoming,
                    without(exact.incoming, scale.incoming),
                )?,
                stiffness: signed(Key::IntruderStiffness, C::Stiffness, exact.stiffness)?,
                damping: signed(Key::IntruderDamping, C::Damping, exact.damping)?,
                intruder: signed(
                    Key::IntruderMass,
                    C::Intruder,
                    without(exact.intruder, scale.masses),
                )?,
                host: signed(Key::BeadMass, C::Host, without(exact.host, scale.masses))?,
                gate: gate(&description.force),
                energy: signed(Key::IntruderDamping, C::EnergyByVelocity, predicted)?,
                // A delay too long for its format is longer than the line at every force.
                delay: nearest(company.delay),
            },
            incident: signed(Key::ContactStiffness, C::Incident, exact.incident)?,
            ringing: Ringing {
                frequency: rate(Key::IntruderStiffness, C::RingFrequency, exact.ring_frequency)?,
                frequency_tolerance: nearest(capture.ring_frequency_tolerance),
                decay: rate(Key::IntruderDamping, C::RingDecay, exact.ring_decay)?,
                decay_tolerance: nearest(capture.ring_decay_tolerance),
            },
            ring_down: RingDown::new(&bead, dt),
            quiet: Quiet::new(
                &noise(&description.force),
                &noise(&description.acceleration),
                [exact.start, exact.end],
            ),
            company: company.company(description, places, &scale)?,
            waveform: WaveformJudge::new(
                &description.physics(),
                description.acceleration.per_code,
                dt,
                exact.ring_phase,
            ),
            phase: exact.ring_phase,
            scale,
        })
    }
}

/// Three standard deviations of the force's noise and rounding.
fn gate(force: &SensorScale) -> SensedForce {
    let rounding = force.per_code * force.per_code / 12.0;
    nearest(3.0 * libm::sqrt(force.noise * force.noise + rounding))
}

/// Time by which a filter with a pole at this frequency, Hz, lags, s; 0 for no filter.
fn lag(pole: f64) -> f64 {
    if pole > 0.0 { 1.0 / (TAU * pole) } else { 0.0 }
}

/// Both channels of a sensor that is sampled every `dt` seconds; the intruder rings with `phase` rad in this
/// time. The keys are those of the units per code and of the poles.
///
/// # Errors
/// A unit that its format does not hold, or a pole below `f_s/4π`.
pub(crate) fn sensor<F: LeEqU32>(
    scale: &SensorScale,
    [dt, phase]: [f64; 2],
    units: [Key; 2],
    poles: [Key; 2],
) -> Result<Sensor<F>, Violation> {
    let channel = |number: usize, per_code: f64, pole: f64, delay: f64| {
        let lag = lag(pole);
        let Correction { slope, curve } = Correction::new(lag / dt, delay / dt, phase);
        let [slope, curve] = [slope, curve].map(|weight| per_code * weight);
        let format = FixedFormat::signed(F::U32);
        let per_code = format.exact(per_code).ok_or(Violation {
            key: units[number],
            bound: Bound::Unit {
                range: format.range(),
            },
        })?;
        require((lag - delay).abs() < 2.0 * dt, poles[number], Bound::Pole)?;
        Ok(Channel {
            per_code: FixedI32::from_bits(per_code as i32),
            // Their error counts beside the unit, however small they are.
            slope: nearest(slope),
            curve: nearest(curve),
        })
    };
    Ok(Sensor {
        sensitive: channel(0, scale.per_code, scale.pole, 0.0)?,
        // Converted after the sensitive channel.
        wide: channel(1, scale.wide_per_code, scale.wide_pole, CONVERSION)?,
    })
}

/// The least powers of two, up to `most`, that bring all coefficients below a half. A coefficient that is
/// still too large does not fit its format.
fn shift(values: &[f64], most: u8) -> u8 {
    let fits = |powers: &u8| {
        let power = two_to(-i32::from(*powers));
        values.iter().all(|value| value * power < 0.499_999)
    };
    (0..most).find(fits).unwrap_or(most)
}

/// The powers of two that bring a coefficient of an energy into a range in which its format is exact enough;
/// 0 if it is already in range. At most [`POWERS_MAX`] to either side.
fn shift_into(value: f64, range: Range<f64>) -> i8 {
    let powers = if value >= range.end {
        libm::ilogb(value / range.end).saturating_add(1)
    } else if value < range.start {
        libm::ilogb(value / range.start)
    } else {
        0
    };
    powers.clamp(-i32::from(POWERS_MAX), POWERS_MAX.into()) as i8
}

/// Trigger and window in codes and samples.
pub(crate) fn window(description: &Description, dt: f64) -> WindowSettings {
    let capture = &description.capture;
    // A cast saturates.
    let whole = |number: f64| libm::round(number) as u16;
    WindowSettings {
        history: whole(capture.history / dt),
        length: whole(capture.length / dt),
        threshold: whole(capture.threshold / description.force.per_code),
        lookback: whole(capture.lookback / dt),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_of_two_bring_a_coefficient_into_its_range() {
        for (value, powers) in [
            (0.0, 0),
            (0.49, 0),
            (0.499_999, 1),
            (0.5, 1),
            (0.99, 1),
            (1.0, 2),
            (3.9, 3),
            (1e9, 6),
        ] {
            assert_eq!(shift(&[0.1, value], 6), powers, "{value}");
        }
        const LEAST: f64 = 1.0 / 65536.0;
        for (value, powers) in [
            (0.5, 0),
            (LEAST, 0),
            (1.0, 1),
            (1.99, 1),
            (2.0, 2),
            (100.0, 7),
            (1e60, 24),
            (f64::INFINITY, 24),
            (0.99 * LEAST, -1),
            (0.49 * LEAST, -2),
            (0.0, -24),
        ] {
            assert_eq!(shift_into(value, LEAST..1.0), powers, "{value}");
        }
    }

    #[test]
    fn a_number_that_loses_more_than_a_ten_thousandth_in_its_format_is_refused() {
        for (value, bits) in [
            (0.25, Some(16_384)),
            (-0.25, Some(-16_384)),
            (0.0, Some(0)),
            (5000.4 / 65536.0, Some(5000)),
            (5000.6 / 65536.0, Some(5001)),
            (20_000.5 / 65536.0, Some(20_000)),
            (20_001.5 / 65536.0, Some(20_002)),
            (4000.45 / 65536.0, None),
            (-32_768.0, Some(i32::MIN.into())),
            (32_768.0, None),
            (40_000.0, None),
            (f64::INFINITY, None),
            (f64::NAN, None),
        ] {
            assert_eq!(FixedFormat::signed(16).exact(value), bits, "{value}");
        }
        let unsigned = [-1.0, 65_535.0, 65_536.0].map(|value| FixedFormat::U16F16.exact(value));
        assert_eq!(unsigned, [None, Some(0xFFFF_0000), None]);
        let found = hold(FixedFormat::signed(16), Key::BeadMass, Coefficient::Host, 4e4);
        let expected = Violation {
            key: Key::BeadMass,
            bound: Bound::Format {
                coefficient: Coefficient::Host,
                value: 4e4,
                range: [5e3 / 65536.0, 32_768.0 - 1.0 / 65536.0],
            },
        };
        assert_eq!(found, Err(expected));
    }
}
