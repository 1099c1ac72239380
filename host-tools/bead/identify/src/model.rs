//! A strike as a least-squares problem.

use std::ops::Range;

use crate::noise::Noise;
use crate::quantity::{COUNT, Values};
use crate::series::{Channel, Series, StrikeSeries};

/// Place of the tangent along k₃, N/m³, of a spring that hardens: after those of the quantities.
pub const HARDENING: usize = COUNT;
/// Number of tangents that are common to all strikes.
pub const SHARED: usize = COUNT + 1;

/// Residuals of a strike and their derivatives: a row for each sample of its channels.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    /// Measured less computed.
    pub residuals: Vec<f64>,
    /// Derivatives of the *computed* values with respect to the logarithm of each quantity, and along k₃;
    /// empty for a quantity without influence.
    pub shared: [Vec<f64>; SHARED],
    /// Derivatives with respect to this strike's own numbers.
    pub own: Vec<Vec<f64>>,
}

impl Evaluation {
    /// An evaluation without rows, of a strike with this many own numbers.
    pub(crate) fn new(own: usize) -> Self {
        Self {
            residuals: Vec::new(),
            shared: Default::default(),
            own: vec![Vec::new(); own],
        }
    }

    /// Adds the derivatives by `numbers` of a row that depends only on number `one`, with slope 1.
    pub(crate) fn push_unit(&mut self, numbers: Range<usize>, one: usize) {
        for number in numbers {
            self.own[number].push(f64::from(u8::from(number == one)));
        }
    }

    /// The residuals and all derivatives that are not empty.
    pub(crate) fn columns(&mut self) -> impl Iterator<Item = &mut Vec<f64>> {
        let derivatives = self.shared.iter_mut().chain(&mut self.own);
        let columns = std::iter::once(&mut self.residuals).chain(derivatives);
        columns.filter(|column| !column.is_empty())
    }
}

/// The channels of a strike that a model explains, each with its noise.
#[derive(Debug)]
pub struct ExplainedChannels {
    /// Samples a second.
    pub(crate) rate: f64,
    /// The sample that triggered.
    pub(crate) trigger: usize,
    pub(crate) series: Vec<(Series, Noise)>,
}

impl ExplainedChannels {
    /// The `wanted` channels, as far as the strike has them.
    ///
    /// # Errors
    /// The noise of a channel is unknown: the reason, as the end of a sentence.
    pub(crate) fn of(
        strike: &StrikeSeries,
        noises: &[Option<Noise>; 4],
        wanted: fn(Channel) -> bool,
    ) -> Result<Self, String> {
        let series = strike.series.iter().filter(|one| wanted(one.channel));
        let series = series.map(|one| Ok((one.clone(), one.noise(noises)?)));
        Ok(Self {
            rate: strike.rate,
            trigger: strike.trigger,
            series: series.collect::<Result<_, String>>()?,
        })
    }

    /// All samples: the place of the channel, the sample of the window, and its value.
    pub(crate) fn samples(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        let channels = self.series.iter().enumerate();
        channels.flat_map(|(place, (series, _))| {
            let stretches = series.stretches.iter();
            let samples = stretches.flat_map(|stretch| (stretch.from..).zip(&stretch.values));
            samples.map(move |(at, value)| (place, at, *value))
        })
    }

    /// Appends a zero for each channel to these numbers of a strike.
    pub(crate) fn with_zeros(&self, start: &[f64]) -> Vec<f64> {
        [start, &vec![0.0; self.series.len()]].concat()
    }

    /// Whitens the rows of the samples, stretch by stretch, and returns the rows after them.
    pub(crate) fn whiten<'c>(&self, mut column: &'c mut [f64]) -> &'c mut [f64] {
        for (series, noise) in &self.series {
            for stretch in &series.stretches {
                let (rows, behind) = column.split_at_mut(stretch.values.len());
                noise.whiten(rows);
                column = behind;
            }
        }
        column
    }
}

/// A strike whose signals can be computed from the quantities and its own numbers: its speed, its moment,
/// its zeros.
pub trait StrikeModel: Sync {
    /// The channels whose samples it computes.
    fn channels(&self) -> &ExplainedChannels;

    /// The strike's own numbers at the start of a fit.
    fn own(&self) -> Vec<f64>;

    /// Computes residuals and derivatives. Without `with_shared`, derivatives along the shared directions
    /// may be empty.
    ///
    /// # Errors
    /// The strike cannot be computed at these values: the reason, as the end of a sentence.
    fn evaluate(&self, values: &Values, own: &[f64], with_shared: bool) -> Result<Evaluation, String>;

    /// Makes the noise of a column of an evaluation white, of variance 1.
    fn whiten(&self, column: &mut [f64]) {
        self.channels().whiten(column);
    }

    /// Greatest stroke of the intruder, m.
    fn stroke(&self, values: &Values, own: &[f64]) -> f64;

    /// The samples used, measured and computed, channel by channel.
    ///
    /// # Errors
    /// As of [`StrikeModel::evaluate`].
    fn samples(&self, values: &Values, own: &[f64]) -> Result<Vec<SignalSample>, String> {
        let channels = self.channels();
        let residuals = self.evaluate(values, own, false)?.residuals;
        let sample = |((place, at, measured), residual): ((usize, usize, f64), f64)| {
            let (series, noise) = &channels.series[place];
            SignalSample {
                channel: series.channel,
                time: (at as f64 - channels.trigger as f64) / channels.rate,
                measured,
                computed: measured - residual,
                deviation: noise.deviation(),
            }
        };
        Ok(channels.samples().zip(residuals).map(sample).collect())
    }
}

/// A sample of a strike, N or m/s².
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SignalSample {
    /// Its channel.
    pub channel: Channel,
    /// Time from the trigger, s.
    pub time: f64,
    /// Measured.
    pub measured: f64,
    /// Computed.
    pub computed: f64,
    /// Standard deviation of the noise.
    pub deviation: f64,
}
