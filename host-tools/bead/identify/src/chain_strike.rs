//! A strike of a chain that a scenario describes, from striker to bead.
//!
//! # Design
//! The whole chain is simulated with its tangents ([`hertz_chain::tangents`]), front end included, and
//! compared with the codes of both sensors. The strike's own numbers are the striker's velocity, the moment
//! at which it touches the chain, and the zero of each channel.

use std::sync::Arc;

use hertz_chain::tangents::{Sensor, SensorPlace};

use crate::chain_runs::{ChainRuns, SpeedSignals};
use crate::model::{Evaluation, HARDENING, SignalSample, StrikeModel};
use crate::noise::Noise;
use crate::quantity::{Quantity, Values};
use crate::series::{Channel, Series, Stretch, StrikeSeries};

/// Least peak of the force, in standard deviations of its noise.
const LEAST_PEAK: f64 = 10.0;

/// One strike.
#[derive(Debug)]
pub struct ChainStrike {
    runs: Arc<ChainRuns>,
    rate: f64,
    length: usize,
    trigger: usize,
    series: Vec<(Series, Noise)>,
    sensors: Vec<Sensor>,
    start: [f64; 2],
    /// Time at which the wave comes at the scenario's speed, s.
    arrival: f64,
    greatest: f64,
}

impl ChainStrike {
    /// The strike at the bead of a chain, which is struck as the scenario says, but for the velocity.
    ///
    /// # Errors
    /// Why there is none, as the end of a sentence.
    pub fn new(
        runs: &Arc<ChainRuns>,
        strike: &StrikeSeries,
        noises: &[Option<Noise>; 4],
        values: &Values,
    ) -> Result<Self, String> {
        let series: Result<Vec<(Series, Noise)>, String> = strike
            .series
            .iter()
            .map(|series| {
                let noise = noises[series.channel.place()].clone();
                Ok((series.clone(), noise.ok_or("a channel has no quiet codes")?))
            })
            .collect();
        let series = series?;
        let force = strike.merged(true);
        let peak = force.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        let &(at, peak) = peak.ok_or("its force is at a rail throughout")?;
        let noise = series
            .iter()
            .find(|(series, _)| series.channel.is_force())
            .map_or(0.0, |(_, noise)| noise.deviation());
        if peak < LEAST_PEAK * noise {
            return Err(format!(
                "its force is too quiet, {peak:.3} N of {noise:.4} N noise; strike harder"
            ));
        }
        let bead = runs.chain().bead();
        let sensors = series
            .iter()
            .map(|(series, _)| Sensor {
                place: if series.channel.is_force() {
                    SensorPlace::Force(bead)
                } else {
                    SensorPlace::Acceleration(bead)
                },
                pole: series.pole,
                front_mass: strike.description.bead.front_mass,
            })
            .collect();
        let greatest = strike
            .merged(false)
            .iter()
            .fold(0.0_f64, |most, one| most.max(one.1.abs()));
        let mut one = Self {
            runs: Arc::clone(runs),
            rate: strike.rate,
            length: strike.length,
            trigger: strike.trigger,
            series,
            sensors,
            start: [0.0; 2],
            arrival: 0.0,
            greatest,
        };
        one.begin(values, at as f64, peak)?;
        Ok(one)
    }

    /// A strike by signals at places of a chain, of which the first is a force, sampled from the same moment
    /// on, as a bench has them or a figure shows them. Each has its samples and its noise.
    ///
    /// # Errors
    /// Why it cannot be computed, as the end of a sentence.
    pub fn of_signals(
        runs: &Arc<ChainRuns>,
        rate: f64,
        signals: Vec<(SensorPlace, Vec<f64>, Noise)>,
        values: &Values,
    ) -> Result<Self, String> {
        let length = signals
            .iter()
            .map(|(_, samples, _)| samples.len())
            .max()
            .unwrap_or(0);
        let sensors = signals.iter().map(|(place, ..)| Sensor {
            place: *place,
            pole: 0.0,
            front_mass: 0.0,
        });
        let sensors: Vec<Sensor> = sensors.collect();
        let series = signals.into_iter().map(|(place, values, noise)| {
            let channel = match place {
                SensorPlace::Force(_) => Channel::Force,
                SensorPlace::Acceleration(_) => Channel::Acceleration,
            };
            let stretches = vec![Stretch { from: 0, values }];
            let series = Series {
                channel,
                pole: 0.0,
                delay: 0.0,
                step: 0.0,
                stretches,
            };
            (series, noise)
        });
        let series: Vec<(Series, Noise)> = series.collect();
        let first = series.first().ok_or("it has no signal")?;
        let samples = first.0.stretches[0].values.iter().enumerate();
        let peak = samples
            .max_by(|a, b| a.1.total_cmp(b.1))
            .map(|(at, peak)| (at as f64, *peak));
        let (at, peak) = peak
            .filter(|(_, peak)| *peak > 0.0)
            .ok_or("its force has no peak")?;
        let mut one = Self {
            runs: Arc::clone(runs),
            rate,
            length,
            trigger: 0,
            series,
            sensors,
            start: [0.0; 2],
            arrival: 0.0,
            greatest: 0.0,
        };
        one.begin(values, at, peak)?;
        Ok(one)
    }

    /// Finds velocity and moment by the peak of the force: F ~ V^(6/5), t ~ V^(-1/5).
    fn begin(&mut self, values: &Values, at: f64, peak: f64) -> Result<(), String> {
        let scenario = self.runs.chain().scenario();
        let duration = scenario.duration.min(self.length as f64 / self.rate);
        let (arrival, highest) = self.runs.highest(values, &self.sensors, duration)?;
        if highest <= 0.0 {
            return Err("no force reaches the bead of the scenario in its duration".to_owned());
        }
        let faster = (peak / highest).powf(5.0 / 6.0);
        self.start = [faster.ln(), at - arrival * faster.powf(-0.2) * self.rate];
        self.arrival = arrival;
        Ok(())
    }

    /// The time of a sample of a series since the striker touched the chain, s.
    fn time(&self, series: &Series, at: usize, own: &[f64]) -> f64 {
        (at as f64 - own[1]) / self.rate + series.delay
    }

    fn signals(&self, values: &Values, own: &[f64]) -> Result<SpeedSignals, String> {
        let speed = own[0];
        if !speed.is_finite() || speed.abs() > 5.0 {
            return Err("no striker is as fast as its force asks for".to_owned());
        }
        let late = self
            .series
            .iter()
            .fold(0.0_f64, |most, (series, _)| most.max(series.delay));
        let duration = (self.length as f64 - own[1]) / self.rate + late + 4.0 * self.runs.chain().step();
        if !(0.0..1.0).contains(&duration) {
            return Err("its wave would begin outside its window".to_owned());
        }
        let span = (speed, self.arrival, duration);
        self.runs.signals(values, &self.sensors, span)
    }

    /// Gain of a series: what is computed, over it, is what the codes show.
    fn gain(series: &Series, values: &Values) -> (Quantity, f64) {
        let quantity = if series.channel.is_force() {
            Quantity::ForceGain
        } else {
            Quantity::AccelerationGain
        };
        (quantity, values[quantity.place()])
    }

    /// Residuals and derivatives; see [`StrikeModel::evaluate`].
    fn evaluated(&self, values: &Values, own: &[f64], with_shared: bool) -> Result<Evaluation, String> {
        let signals = self.signals(values, own)?;
        let mut evaluation = Evaluation {
            residuals: Vec::new(),
            shared: std::array::from_fn(|_| Vec::new()),
            own: vec![Vec::new(); own.len()],
        };
        // The place of each shared direction, and the factor that makes its derivative that of a logarithm.
        let of = |quantity: Quantity| (quantity.place(), values[quantity.place()]);
        let directions = [
            of(Quantity::Stiffness),
            of(Quantity::Damping),
            of(Quantity::IntruderMass),
            (
                Quantity::BeadMass.place(),
                self.runs.chain().with(values, 1.0).chain.density,
            ),
            of(Quantity::Young),
            of(Quantity::Relaxation),
            (HARDENING, 1.0),
        ];
        for (place, (series, noise)) in self.series.iter().enumerate() {
            let (gain_of, gain) = Self::gain(series, values);
            let other_gain = if gain_of == Quantity::ForceGain {
                Quantity::AccelerationGain
            } else {
                Quantity::ForceGain
            };
            for stretch in &series.stretches {
                let begin = evaluation.residuals.len();
                for (n, measured) in stretch.values.iter().enumerate() {
                    let (signal, slope) = signals.at(place, self.time(series, stretch.from + n, own));
                    let computed = signal.value / gain;
                    evaluation.residuals.push(measured - computed - own[2 + place]);
                    if with_shared {
                        for ((column, factor), by) in directions.iter().zip(&signal.by[1..]) {
                            evaluation.shared[*column].push(factor * by / gain);
                        }
                        evaluation.shared[gain_of.place()].push(-computed);
                        evaluation.shared[other_gain.place()].push(0.0);
                    }
                    evaluation.own[0].push(signal.by[0] / gain);
                    evaluation.own[1].push(-slope / self.rate / gain);
                    for (other, column) in evaluation.own[2..].iter_mut().enumerate() {
                        column.push(f64::from(u8::from(other == place)));
                    }
                }
                let mut whiten = |column: &mut Vec<f64>| {
                    if !column.is_empty() {
                        noise.whiten(&mut column[begin..]);
                    }
                };
                whiten(&mut evaluation.residuals);
                evaluation.shared.iter_mut().for_each(&mut whiten);
                evaluation.own.iter_mut().for_each(&mut whiten);
            }
        }
        Ok(evaluation)
    }
}

impl StrikeModel for ChainStrike {
    fn own(&self) -> Vec<f64> {
        let mut own = self.start.to_vec();
        own.resize(2 + self.series.len(), 0.0);
        own
    }

    fn evaluate(&self, values: &Values, own: &[f64], with_shared: bool) -> Result<Evaluation, String> {
        self.evaluated(values, own, with_shared)
    }

    fn stroke(&self, values: &Values, _: &[f64]) -> f64 {
        // k x is about m a.
        self.greatest * values[Quantity::IntruderMass.place()] / values[Quantity::Stiffness.place()]
    }

    fn samples(&self, values: &Values, own: &[f64]) -> Result<Vec<SignalSample>, String> {
        let signals = self.signals(values, own)?;
        let mut points = Vec::new();
        for (place, (series, noise)) in self.series.iter().enumerate() {
            let (_, gain) = Self::gain(series, values);
            for stretch in &series.stretches {
                for (n, measured) in stretch.values.iter().enumerate() {
                    let at = stretch.from + n;
                    let (signal, _) = signals.at(place, self.time(series, at, own));
                    points.push(SignalSample {
                        channel: series.channel,
                        time: (at as f64 - self.trigger as f64) / self.rate,
                        measured: *measured,
                        computed: signal.value / gain + own[2 + place],
                        deviation: noise.deviation(),
                    });
                }
            }
        }
        Ok(points)
    }
}
