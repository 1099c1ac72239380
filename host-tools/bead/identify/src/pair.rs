//! A tap at a free bead: the acceleration of its intruder follows from the force.
//!
//! # Design
//! Host and intruder are a linear system, so the acceleration is the convolution of the force with the
//! response to one sample of it, which is computed with its derivatives ([`hertz_chain::tangents`]). The
//! force is measured with noise, so the errors of its samples are unknowns of the strike, each with the
//! noise's distribution (errors in variables), and are eliminated like the strike's other own numbers. Force
//! and acceleration have one low-pass each. In a linear system the order of filters does not matter, so
//! equal ones drop out; of unlike ones, the difference of their delays remains.

use std::f64::consts::TAU;

use hertz_chain::tangents::{Dual, Parameter, Push, Sensor, SensorPlace, SignalTangents, tangents};
use hertz_chain::{Chain, Intruder, Oscillator, Scenario, Striker};

use crate::model::{Evaluation, ExplainedChannels, StrikeModel};
use crate::noise::Noise;
use crate::quantity::{Quantity, Values};
use crate::series::{Series, StrikeSeries};

/// Step of the integration, s.
const STEP: f64 = 2.5e-6;
/// Standard deviations of the force's noise above which it acts.
const FORCE_ACTS: f64 = 5.0;
/// Samples of the force that count before and after it acts.
const AROUND: usize = 8;
/// Most samples of a tap.
const LONGEST: usize = 256;
/// Least peaks, in standard deviations of the noise.
const LEAST_PEAK: f64 = 20.0;
/// Samples by which the response begins before its sample, from the cubic between samples.
const BEFORE: usize = 2;
/// Directions of the response.
const DIRECTIONS: usize = 4;

/// A tap.
#[derive(Debug)]
pub struct Tap {
    length: usize,
    /// Mass in front of the crystal, which the force does not accelerate, kg.
    front_mass: f64,
    /// First sample of the force, and its samples, N.
    from: usize,
    force: Vec<f64>,
    force_noise: Noise,
    /// Channels of the acceleration, and the delay of each behind the force, s.
    channels: ExplainedChannels,
    later: Vec<f64>,
}

impl Tap {
    /// The tap of a strike.
    ///
    /// # Errors
    /// The strike is no usable tap: the reason, as the end of a sentence.
    pub fn new(strike: &StrikeSeries, noises: &[Option<Noise>; 4]) -> Result<Self, String> {
        let of_force = strike.force()?;
        let force_noise = of_force.noise(noises)?;
        let merged = strike.merged(true);
        let limit = FORCE_ACTS * force_noise.deviation();
        let acts = || {
            merged
                .iter()
                .filter(|(at, value)| *at >= strike.quiet && value.abs() > limit)
        };
        let (first, last) = acts()
            .next()
            .zip(acts().next_back())
            .ok_or("its force does not rise above the noise; tap harder")?;
        let (from, to) = (
            first.0.saturating_sub(AROUND),
            (last.0 + 1 + AROUND).min(strike.length),
        );
        if to - from > LONGEST {
            return Err(format!(
                "its force acts for {:.1} ms; tap more briefly, so that the intruder still rings afterwards",
                1e3 * (to - from) as f64 / strike.rate
            ));
        }
        let force: Vec<f64> = merged
            .iter()
            .filter(|(at, _)| (from..to).contains(at))
            .map(|(_, value)| *value)
            .collect();
        if force.len() != to - from || acts().any(|(at, _)| *at + 1 == strike.length) {
            return Err(
                "its force is at a rail, or has not ended at the end of its window; tap more softly"
                    .to_owned(),
            );
        }
        let peak = force.iter().fold(0.0_f64, |most, value| value.abs().max(most));
        if peak < LEAST_PEAK * force_noise.deviation() {
            return Err(format!("its force is too quiet, {peak:.3} N; tap harder"));
        }
        let lag = |pole: f64| if pole > 0.0 { 1.0 / (TAU * pole) } else { 0.0 };
        let channels = ExplainedChannels::of(strike, noises, |channel| !channel.is_force())?;
        let later =
            |(one, _): &(Series, Noise)| one.delay - of_force.delay + lag(of_force.pole) - lag(one.pole);
        Ok(Self {
            length: strike.length,
            front_mass: strike.description.bead.front_mass,
            from,
            force,
            force_noise,
            later: channels.series.iter().map(later).collect(),
            channels,
        })
    }

    /// Response of the intruder's acceleration to one sample of force, 1 N, which is [`BEFORE`] samples after
    /// the start of the run; along k, c, m and M.
    fn response(&self, values: &Values) -> Result<SignalTangents<DIRECTIONS>, String> {
        let of = |quantity: Quantity| values[quantity.place()];
        let mut chain = Chain::PAPER;
        chain.beads = 1;
        chain.density *= (of(Quantity::BeadMass) - self.front_mass) / mass_of(&chain);
        let mut scenario = Scenario::new(1.0, chain, Striker::PAPER);
        let oscillator = Oscillator {
            mass: of(Quantity::IntruderMass),
            stiffness: of(Quantity::Stiffness),
            damping: of(Quantity::Damping),
        };
        scenario.intruders = vec![Intruder::new([1], oscillator)];
        let mut force = vec![0.0; 2 * BEFORE + 1];
        force[BEFORE] = 1.0;
        let push = Push {
            bead: 1,
            start: 0.0,
            rate: self.channels.rate,
            force,
        };
        let sensor = Sensor {
            place: SensorPlace::Acceleration(1),
            pole: 0.0,
            front_mass: 0.0,
        };
        let parameters = [
            Parameter::Stiffness(0),
            Parameter::Damping(0),
            Parameter::IntruderMass(0),
            Parameter::Density,
        ];
        let duration = (self.length - self.from + 4 * BEFORE) as f64 / self.channels.rate;
        let mut run =
            tangents::<DIRECTIONS>(&scenario, &parameters, &[sensor], Some(&push), (duration, STEP))
                .map_err(|error| error.to_string())?;
        // Derivatives by the logarithms. The part of M in front of the crystal does not follow the density.
        let bead = of(Quantity::BeadMass);
        run.scale([
            oscillator.stiffness,
            oscillator.damping,
            oscillator.mass,
            scenario.chain.density * bead / (bead - self.front_mass),
        ]);
        Ok(run)
    }

    /// The response at whole numbers of samples after a sample of force, from -[`BEFORE`].
    fn table(&self, run: &SignalTangents<DIRECTIONS>, later: f64) -> Vec<Dual<DIRECTIONS>> {
        let count = self.length - self.from + BEFORE;
        (0..count)
            .map(|n| run.at(0, n as f64 / self.channels.rate + later).0)
            .collect()
    }
}

/// Mass of the spheres of a chain, kg.
fn mass_of(chain: &Chain) -> f64 {
    4.0 / 3.0 * std::f64::consts::PI * chain.radius.powi(3) * chain.density
}

/// Names of the shared directions of the response.
const ALONG: [Quantity; DIRECTIONS] = [
    Quantity::Stiffness,
    Quantity::Damping,
    Quantity::IntruderMass,
    Quantity::BeadMass,
];

impl StrikeModel for Tap {
    fn channels(&self) -> &ExplainedChannels {
        &self.channels
    }

    fn own(&self) -> Vec<f64> {
        // Zeros of the channels, then the errors of the force.
        vec![0.0; self.later.len() + self.force.len()]
    }

    fn evaluate(&self, values: &Values, own: &[f64], _with_shared: bool) -> Result<Evaluation, String> {
        let run = self.response(values)?;
        let [force_gain, gain] =
            [Quantity::ForceGain, Quantity::AccelerationGain].map(|one| values[one.place()]);
        let scale = force_gain / gain;
        let (zeros, errors) = own.split_at(self.later.len());
        let force = self.force.iter().zip(errors);
        let force: Vec<f64> = force.map(|(force, error)| force - error).collect();
        let tables = self.later.iter().map(|later| self.table(&run, *later));
        let tables: Vec<_> = tables.collect();
        let mut evaluation = Evaluation::new(own.len());
        for (place, at, measured) in self.channels.samples() {
            let mut sum = Dual::<DIRECTIONS>::default();
            for (j, force) in force.iter().enumerate() {
                let since = (at + BEFORE).checked_sub(self.from + j);
                let response = since.and_then(|since| tables[place].get(since));
                let response = response.copied().unwrap_or_default();
                sum.add_scaled(response, force * scale);
                evaluation.own[zeros.len() + j].push(-response.value * scale);
            }
            evaluation.residuals.push(measured - sum.value - zeros[place]);
            for (quantity, by) in ALONG.into_iter().zip(sum.by) {
                evaluation.shared[quantity.place()].push(by);
            }
            evaluation.shared[Quantity::ForceGain.place()].push(sum.value);
            evaluation.shared[Quantity::AccelerationGain.place()].push(-sum.value);
            evaluation.push_unit(0..zeros.len(), place);
        }
        // The errors of the force have the distribution of its noise.
        for (j, error) in errors.iter().enumerate() {
            evaluation.residuals.push(-error);
            for column in evaluation.shared.iter_mut().filter(|column| !column.is_empty()) {
                column.push(0.0);
            }
            evaluation.push_unit(0..own.len(), zeros.len() + j);
        }
        Ok(evaluation)
    }

    fn whiten(&self, column: &mut [f64]) {
        let of_force = self.channels.whiten(column);
        self.force_noise.whiten(of_force);
    }

    fn stroke(&self, values: &Values, _: &[f64]) -> f64 {
        let samples = self.channels.samples();
        let greatest = samples.fold(0.0_f64, |most, (.., value)| value.abs().max(most));
        greatest * values[Quantity::IntruderMass.place()] / values[Quantity::Stiffness.place()]
    }
}
