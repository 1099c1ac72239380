//! A strike of a chain that a scenario describes, from striker to bead.
//!
//! # Design
//! The whole chain is simulated with its tangents ([`hertz_chain::tangents`]), front end included, and
//! compared with the codes of both sensors. The strike's own numbers are the striker's velocity, the moment
//! at which it touches the chain, and the zero of each channel.

use std::sync::Arc;

use hertz_chain::tangents::{Sensor, SensorPlace};

use crate::chain_runs::{ChainRuns, SpeedSignals};
use crate::model::{Evaluation, ExplainedChannels, HARDENING, StrikeModel};
use crate::noise::Noise;
use crate::quantity::{Quantity, Values};
use crate::series::{Channel, Series, Stretch, StrikeSeries};

/// Least peak of the force, in standard deviations of its noise.
const LEAST_PEAK: f64 = 10.0;

/// One strike.
#[derive(Debug)]
pub struct ChainStrike {
    runs: Arc<ChainRuns>,
    length: usize,
    channels: ExplainedChannels,
    sensors: Vec<Sensor>,
    start: [f64; 2],
    /// Time of the force's peak at the scenario's speed, s.
    arrival: f64,
    greatest: f64,
}

impl ChainStrike {
    /// The strike at the bead of a chain that is struck as in the scenario, except for the velocity.
    ///
    /// # Errors
    /// The strike is unusable: the reason, as the end of a sentence.
    pub fn new(
        runs: &Arc<ChainRuns>,
        strike: &StrikeSeries,
        noises: &[Option<Noise>; 4],
        values: &Values,
    ) -> Result<Self, String> {
        let channels = ExplainedChannels::of(strike, noises, |_| true)?;
        let force = strike.merged(true);
        let peak = force.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        let &(at, peak) = peak.ok_or("its force is at a rail throughout")?;
        let noise = strike.force()?.noise(noises)?.deviation();
        if peak < LEAST_PEAK * noise {
            return Err(format!(
                "its force is too quiet, {peak:.3} N with a noise of {noise:.4} N; strike harder"
            ));
        }
        let bead = runs.chain.bead;
        let sensors = channels.series.iter().map(|(series, _)| Sensor {
            place: if series.channel.is_force() {
                SensorPlace::Force(bead)
            } else {
                SensorPlace::Acceleration(bead)
            },
            pole: series.pole,
            front_mass: strike.description.bead.front_mass,
        });
        let acceleration = strike.merged(false);
        let one = Self {
            runs: Arc::clone(runs),
            length: strike.length,
            sensors: sensors.collect(),
            channels,
            start: [0.0; 2],
            arrival: 0.0,
            greatest: acceleration.iter().fold(0.0, |most, one| one.1.abs().max(most)),
        };
        one.begun(values, (at as f64, peak))
    }

    /// A strike from signals at places of a chain, such as those of a bench or a figure, each with its
    /// samples and its noise. All are sampled from the same moment; the first is a force.
    ///
    /// # Errors
    /// The strike cannot be computed: the reason, as the end of a sentence.
    pub fn of_signals(
        runs: &Arc<ChainRuns>,
        rate: f64,
        signals: Vec<(SensorPlace, Vec<f64>, Noise)>,
        values: &Values,
    ) -> Result<Self, String> {
        let lengths = signals.iter().map(|(_, samples, _)| samples.len());
        let length = lengths.max().unwrap_or(0);
        let sensors = signals.iter().map(|(place, ..)| Sensor {
            place: *place,
            pole: 0.0,
            front_mass: 0.0,
        });
        let sensors: Vec<Sensor> = sensors.collect();
        let series = signals.into_iter().map(|(place, values, noise)| {
            let series = Series {
                channel: match place {
                    SensorPlace::Force(_) => Channel::Force,
                    SensorPlace::Acceleration(_) => Channel::Acceleration,
                },
                pole: 0.0,
                delay: 0.0,
                step: 0.0,
                stretches: vec![Stretch { from: 0, values }],
            };
            (series, noise)
        });
        let channels = ExplainedChannels {
            rate,
            trigger: 0,
            series: series.collect(),
        };
        let first = channels.samples().filter(|(place, ..)| *place == 0);
        let peak = first.max_by(|a, b| a.2.total_cmp(&b.2));
        let (_, at, peak) = peak
            .filter(|(.., peak)| *peak > 0.0)
            .ok_or("its force has no peak")?;
        let one = Self {
            runs: Arc::clone(runs),
            length,
            channels,
            sensors,
            start: [0.0; 2],
            arrival: 0.0,
            greatest: 0.0,
        };
        one.begun(values, (at as f64, peak))
    }

    /// Finds velocity and moment from the peak of the force: F ~ V^(6/5), t ~ V^(-1/5).
    fn begun(mut self, values: &Values, (at, peak): (f64, f64)) -> Result<Self, String> {
        let (scenario, rate) = (&self.runs.chain.scenario, self.channels.rate);
        let duration = scenario.duration.min(self.length as f64 / rate);
        let (arrival, highest) = self.runs.highest(values, &self.sensors, duration)?;
        if highest <= 0.0 {
            return Err("no force reaches the bead within the duration of the scenario".to_owned());
        }
        let faster = (peak / highest).powf(5.0 / 6.0);
        self.start = [faster.ln(), at - arrival * faster.powf(-0.2) * rate];
        self.arrival = arrival;
        Ok(self)
    }

    fn signals(&self, values: &Values, own: &[f64]) -> Result<SpeedSignals, String> {
        let speed = own[0];
        if !speed.is_finite() || speed.abs() > 5.0 {
            return Err("its force would need an impossible velocity of the striker".to_owned());
        }
        let delays = self.channels.series.iter().map(|(series, _)| series.delay);
        let late = delays.fold(0.0, f64::max);
        let duration = (self.length as f64 - own[1]) / self.channels.rate + late + 4.0 * self.runs.chain.step;
        if !(0.0..1.0).contains(&duration) {
            return Err("its wave would begin outside its window".to_owned());
        }
        let span = (speed, self.arrival, duration);
        self.runs.signals(values, &self.sensors, span)
    }
}

impl StrikeModel for ChainStrike {
    fn channels(&self) -> &ExplainedChannels {
        &self.channels
    }

    fn own(&self) -> Vec<f64> {
        self.channels.with_zeros(&self.start)
    }

    fn evaluate(&self, values: &Values, own: &[f64], with_shared: bool) -> Result<Evaluation, String> {
        let (signals, rate) = (self.signals(values, own)?, self.channels.rate);
        let mut evaluation = Evaluation::new(own.len());
        // The place of each shared direction, and the factor that turns its derivative into one by the
        // logarithm.
        let of = |quantity: Quantity| (quantity.place(), values[quantity.place()]);
        let directions = [
            of(Quantity::Stiffness),
            of(Quantity::Damping),
            of(Quantity::IntruderMass),
            (
                Quantity::BeadMass.place(),
                self.runs.chain.with(values, 1.0).chain.density,
            ),
            of(Quantity::Young),
            of(Quantity::Relaxation),
            (HARDENING, 1.0),
        ];
        for (place, at, measured) in self.channels.samples() {
            let (series, _) = &self.channels.series[place];
            let mut gains = [Quantity::ForceGain, Quantity::AccelerationGain].map(Quantity::place);
            if !series.channel.is_force() {
                gains.reverse();
            }
            // The samples are the computed signal divided by the gain.
            let [own_gain, other_gain] = gains;
            let gain = values[own_gain];
            let since = (at as f64 - own[1]) / rate + series.delay;
            let (signal, slope) = signals.at(place, since);
            let computed = signal.value / gain;
            evaluation.residuals.push(measured - computed - own[2 + place]);
            if with_shared {
                for ((column, factor), by) in directions.iter().zip(&signal.by[1..]) {
                    evaluation.shared[*column].push(factor * by / gain);
                }
                evaluation.shared[own_gain].push(-computed);
                evaluation.shared[other_gain].push(0.0);
            }
            evaluation.own[0].push(signal.by[0] / gain);
            evaluation.own[1].push(-slope / rate / gain);
            evaluation.push_unit(2..own.len(), 2 + place);
        }
        Ok(evaluation)
    }

    fn stroke(&self, values: &Values, _: &[f64]) -> f64 {
        // k x is about m a.
        self.greatest * values[Quantity::IntruderMass.place()] / values[Quantity::Stiffness.place()]
    }
}
