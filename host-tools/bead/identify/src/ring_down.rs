//! The free ringing of the intruder, once nothing touches its host.
//!
//! # Design
//! With s = -β + iω the acceleration is Re (C exp st), where β = c/2μ, β² + ω² = k/μ, and μ = m (M - m)/M in
//! a host that flies freely or m in one that is held. Each channel shows it behind its low-pass and later by
//! its delay: a factor exp(s δ)/(1 + s/ω_p). C and the zeros are the strike's own numbers. Gains cancel.

use hertz_chain::Complex64;
use nalgebra::{Matrix2, Vector2};

use crate::model::{Evaluation, ExplainedChannels, HARDENING, StrikeModel};
use crate::noise::Noise;
use crate::quantity::{COUNT, Quantity, Values};
use crate::series::StrikeSeries;

/// Standard deviations of the force's noise above which it acts.
const FORCE_ACTS: f64 = 5.0;
/// Samples left out after the force has ended: the tails of filters and taps.
const SETTLE: usize = 10;
/// Least amplitude at the start of the ringing, in standard deviations of the noise.
const LEAST_AMPLITUDE: f64 = 10.0;
/// Least time that the ringing lasts above the noise, in periods.
const LEAST_PERIODS: f64 = 1.5;

/// Support of the host while its intruder rings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mounting {
    /// Nothing touches the host: it hangs on threads or rests on foam.
    Free,
    /// The host does not move.
    Held,
}

/// The ringing of one strike.
#[derive(Debug)]
pub struct RingDown {
    mounting: Mounting,
    /// The first sample of the ringing.
    from: usize,
    /// Quiet start and ringing of each channel of the acceleration.
    channels: ExplainedChannels,
    start: [f64; 2],
}

fn amplitude_of(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most, value| value.abs().max(most))
}

impl RingDown {
    /// The ringing after a tap.
    ///
    /// # Errors
    /// The strike has no usable ringing: the reason, as the end of a sentence.
    pub fn new(
        strike: &StrikeSeries,
        noises: &[Option<Noise>; 4],
        values: &Values,
        mounting: Mounting,
    ) -> Result<Self, String> {
        let deviation = strike.force()?.noise(noises)?.deviation();
        let (from, to) = longest_quiet(strike, FORCE_ACTS * deviation)?;
        let used: Vec<(usize, f64)> = strike
            .merged(false)
            .into_iter()
            .filter(|(at, _)| (from..to).contains(at))
            .collect();
        let mut channels = ExplainedChannels::of(strike, noises, |channel| !channel.is_force())?;
        for (series, _) in &mut channels.series {
            // The quiet before the tap, and the ringing after it.
            let parts = series.stretches.iter().flat_map(|stretch| {
                let parts = [0..strike.quiet, from..to].into_iter();
                parts.filter_map(|part| stretch.within(part))
            });
            series.stretches = parts.collect();
        }
        let (_, sensitive) = channels.series.first().ok_or("it has no acceleration")?;
        let noise = sensitive.deviation();
        let [beta, omega] =
            decay_of(values, mounting).ok_or("the settings have an intruder that does not ring")?;
        let period = std::f64::consts::TAU / omega * strike.rate;
        let all: Vec<f64> = used.iter().map(|(_, value)| *value).collect();
        let loudest = amplitude_of(&all[..all.len().min(period.ceil() as usize)]);
        if loudest < LEAST_AMPLITUDE * noise {
            return Err(format!(
                "its ringing after the tap is too quiet, {loudest:.2} m/s² with a noise of {noise:.3} m/s²; \
                 tap harder"
            ));
        }
        let audible = ((loudest / (2.0 * noise)).ln() / beta * strike.rate).min(all.len() as f64);
        if audible < LEAST_PERIODS * period {
            return Err(format!(
                "its ringing is too short, {:.2} ms with a period of {:.2} ms; tap more briefly, with a harder \
                 tip, and make sure that nothing touches the bead",
                1e3 * audible / strike.rate,
                1e3 * period / strike.rate
            ));
        }
        let mut ring = Self {
            mounting,
            from,
            channels,
            start: [0.0; 2],
        };
        ring.start = ring.guess(&used, [beta, omega]);
        Ok(ring)
    }

    /// C by linear least squares for this decay, ignoring filters.
    fn guess(&self, used: &[(usize, f64)], [beta, omega]: [f64; 2]) -> [f64; 2] {
        let (mut square, mut right) = (Matrix2::zeros(), Vector2::zeros());
        for (at, value) in used {
            let wave = (Complex64::new(-beta, omega) * self.since(*at, 0.0)).exp();
            let basis = Vector2::new(wave.re, -wave.im);
            square += basis * basis.transpose();
            right += basis * *value;
        }
        let solved = square.cholesky().map(|factor| factor.solve(&right));
        solved.map_or([1.0, 0.0], Into::into)
    }

    /// Time of a sample since the ringing began, s.
    fn since(&self, at: usize, delay: f64) -> f64 {
        (at as f64 - self.from as f64) / self.channels.rate + delay
    }
}

/// The longest stretch without force after its peak: first sample, and the one after the last.
fn longest_quiet(strike: &StrikeSeries, limit: f64) -> Result<(usize, usize), String> {
    let force = strike.merged(true);
    let peak = force
        .iter()
        .filter(|(at, _)| *at >= strike.quiet)
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(at, _)| *at)
        .ok_or("its force is at a rail throughout")?;
    let (mut longest, mut from) = ((peak, peak), peak);
    let mut end = peak;
    for (at, value) in force.iter().filter(|(at, _)| *at > peak) {
        if value.abs() > limit || *at > end + 1 {
            from = at + 1;
        }
        end = *at;
        if end + 1 - from.min(end + 1) > longest.1 - longest.0 {
            longest = (from, end + 1);
        }
    }
    let (from, to) = (longest.0 + SETTLE, longest.1);
    if from >= to {
        return Err(
            "the force does not end within its window, so the intruder never rings freely".to_owned(),
        );
    }
    Ok((from, to))
}

/// β and ω of these values; `None` where nothing rings.
fn decay_of(values: &Values, mounting: Mounting) -> Option<[f64; 2]> {
    let [k, c] = [Quantity::Stiffness, Quantity::Damping].map(|one| values[one.place()]);
    let reduced = reduced_mass(values, mounting);
    let beta = 0.5 * c / reduced;
    let square = k / reduced - beta * beta;
    (square > 0.0).then(|| [beta, square.sqrt()])
}

fn reduced_mass(values: &Values, mounting: Mounting) -> f64 {
    let [m, bead] = [Quantity::IntruderMass, Quantity::BeadMass].map(|one| values[one.place()]);
    match mounting {
        Mounting::Free => m * (1.0 - m / bead),
        Mounting::Held => m,
    }
}

/// Derivatives of (β, ω) by the logarithm of each quantity.
fn decay_slopes(values: &Values, mounting: Mounting, [beta, omega]: [f64; 2]) -> [[f64; 2]; COUNT] {
    let mut slopes = [[0.0; 2]; COUNT];
    let square = beta * beta + omega * omega;
    slopes[Quantity::Stiffness.place()] = [0.0, 0.5 * square / omega];
    slopes[Quantity::Damping.place()] = [beta, -beta * beta / omega];
    let by_mass = [-beta, (beta * beta - 0.5 * square) / omega];
    let [m, bead] = [Quantity::IntruderMass, Quantity::BeadMass].map(|one| values[one.place()]);
    let [own, host] = match mounting {
        Mounting::Free => {
            let part = m / bead;
            [(1.0 - 2.0 * part) / (1.0 - part), part / (1.0 - part)]
        }
        Mounting::Held => [1.0, 0.0],
    };
    slopes[Quantity::IntruderMass.place()] = by_mass.map(|slope| slope * own);
    slopes[Quantity::BeadMass.place()] = by_mass.map(|slope| slope * host);
    slopes
}

impl StrikeModel for RingDown {
    fn channels(&self) -> &ExplainedChannels {
        &self.channels
    }

    fn own(&self) -> Vec<f64> {
        self.channels.with_zeros(&self.start)
    }

    fn evaluate(&self, values: &Values, own: &[f64], _with_shared: bool) -> Result<Evaluation, String> {
        let [beta, omega] = decay_of(values, self.mounting).ok_or("the intruder does not ring")?;
        let slopes = decay_slopes(values, self.mounting, [beta, omega]);
        let (s, scale) = (Complex64::new(-beta, omega), Complex64::new(own[0], own[1]));
        let [zero, one] = [0.0, 1.0].map(|real| Complex64::new(real, 0.0));
        let mut evaluation = Evaluation::new(own.len());
        // A spring k x + k₃ x³ raises the frequency by (3/8) k₃ X²/(μ ω); the amplitude X decays.
        let stroke = self.stroke(values, own);
        let reduced = reduced_mass(values, self.mounting);
        let hardening = 0.375 * stroke * stroke / (reduced * omega);
        // The low-pass of each channel at s, and the slope of its logarithm there.
        let filters = self.channels.series.iter().map(|(series, _)| {
            let pole = Complex64::new(std::f64::consts::TAU * series.pole, 0.0);
            let has_pole = series.pole > 0.0;
            if has_pole {
                [pole / (pole + s), -one / (pole + s)]
            } else {
                [one, zero]
            }
        });
        let filters: Vec<_> = filters.collect();
        for (place, at, measured) in self.channels.samples() {
            let [filter, by_s] = filters[place];
            let since = self.since(at, self.channels.series[place].0.delay);
            let rings = at >= self.from;
            let wave = if rings { filter * (s * since).exp() } else { zero };
            let value = scale * wave;
            evaluation.residuals.push(measured - value.re - own[2 + place]);
            // d/ds of the wave's logarithm: the time, and the slope of the filter's.
            let slope = value * (Complex64::new(since, 0.0) + by_s);
            for (column, [by_beta, by_omega]) in evaluation.shared.iter_mut().zip(slopes) {
                column.push(-slope.re * by_beta - slope.im * by_omega);
            }
            let grown = hardening * -(-2.0 * beta * since).exp_m1() / (2.0 * beta);
            evaluation.shared[HARDENING].push(-value.im * grown);
            for (column, derivative) in evaluation.own.iter_mut().zip([wave.re, -wave.im]) {
                column.push(derivative);
            }
            evaluation.push_unit(2..own.len(), 2 + place);
        }
        // C includes the gain, and the contacts have no influence.
        for absent in [
            Quantity::Young,
            Quantity::Relaxation,
            Quantity::ForceGain,
            Quantity::AccelerationGain,
        ] {
            evaluation.shared[absent.place()].clear();
        }
        if self.mounting == Mounting::Held {
            evaluation.shared[Quantity::BeadMass.place()].clear();
        }
        Ok(evaluation)
    }

    fn stroke(&self, values: &Values, own: &[f64]) -> f64 {
        // k x is about m a.
        let [k, m] = [Quantity::Stiffness, Quantity::IntruderMass].map(|one| values[one.place()]);
        own[0].hypot(own[1]) * m / k
    }
}
