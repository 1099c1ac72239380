//! The samples of a strike, channel by channel, as they were converted.
//!
//! # Design
//! The front end's filter and delays stay in the samples and are part of the models: taking them out would
//! colour the noise. Each sample is that of the sensitive channel, or of the wide one while the sensitive
//! one is near a rail; both keep their quiet start, which determines their zeros.

use std::ops::Range;

use bead_model::converter::CONVERSION;
use bead_model::design::{Description, SensorScale};
use bead_model::layout::BASELINE;
use bead_recording::strikes::{RecordedStrike, ScanCodes};

use crate::noise::{Noise, QuietSums};

/// Codes closer than this to a rail are not used, as in the bead's own choice of channel.
const MARGIN: u16 = 64;
/// Codes of the converter.
const CODES: u16 = 4096;

/// A channel of the front end, in the order of the conversions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// Force at the high gain.
    Force,
    /// Force at the low gain.
    WideForce,
    /// Acceleration at the high gain.
    Acceleration,
    /// Acceleration at the low gain.
    WideAcceleration,
}

/// All channels.
pub const CHANNELS: [Channel; 4] = [
    Channel::Force,
    Channel::WideForce,
    Channel::Acceleration,
    Channel::WideAcceleration,
];

impl Channel {
    /// True for a channel of the force sensor.
    pub fn is_force(self) -> bool {
        matches!(self, Self::Force | Self::WideForce)
    }

    fn is_wide(self) -> bool {
        matches!(self, Self::WideForce | Self::WideAcceleration)
    }

    /// Place among [`CHANNELS`].
    pub fn place(self) -> usize {
        self as usize
    }

    fn scale(self, description: &Description) -> SensorScale {
        if self.is_force() {
            description.force
        } else {
            description.acceleration
        }
    }

    fn code(self, scan: &ScanCodes) -> Option<u16> {
        let sensor = usize::from(!self.is_force());
        if self.is_wide() {
            scan.wide.map(|codes| codes[sensor])
        } else {
            Some(scan.sensitive[sensor])
        }
    }
}

fn is_inside(code: u16) -> bool {
    (MARGIN..CODES - MARGIN).contains(&code)
}

/// A gapless stretch of samples.
#[derive(Debug, Clone, PartialEq)]
pub struct Stretch {
    /// Index of the first sample in the window.
    pub from: usize,
    /// Values, N or m/s², relative to the mean of the quiet start.
    pub values: Vec<f64>,
}

impl Stretch {
    /// The part in a range of samples of the window; `None` if empty.
    pub(crate) fn within(&self, range: Range<usize>) -> Option<Self> {
        let from = range.start.max(self.from);
        let to = range.end.min(self.from + self.values.len());
        (from < to).then(|| Self {
            from,
            values: self.values[from - self.from..to - self.from].to_vec(),
        })
    }
}

/// The used samples of a channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// The channel.
    pub channel: Channel,
    /// Pole of its filter, Hz; 0 for none.
    pub pole: f64,
    /// Delay of its samples behind those of the first channel, s.
    pub delay: f64,
    /// One code, N or m/s².
    pub step: f64,
    /// Its stretches, ascending. The first one is the quiet start.
    pub stretches: Vec<Stretch>,
}

impl Series {
    /// Number of samples.
    pub fn count(&self) -> usize {
        self.stretches.iter().map(|stretch| stretch.values.len()).sum()
    }

    /// The quiet start: `quiet` samples or fewer.
    fn quiet(&self, quiet: usize) -> &[f64] {
        let first = self.stretches.first().filter(|stretch| stretch.from == 0);
        first.map_or(&[], |first| &first.values[..quiet.min(first.values.len())])
    }

    /// Its noise among those of all channels.
    pub(crate) fn noise(&self, noises: &[Option<Noise>; 4]) -> Result<Noise, String> {
        let noise = &noises[self.channel.place()];
        noise
            .clone()
            .ok_or_else(|| "a channel has no quiet samples, so its noise is unknown".to_owned())
    }
}

/// The samples of a strike.
#[derive(Debug, Clone, PartialEq)]
pub struct StrikeSeries {
    /// Samples a second.
    pub rate: f64,
    /// Samples of the window.
    pub length: usize,
    /// The sample that triggered.
    pub trigger: usize,
    /// Number of quiet samples at the start.
    pub quiet: usize,
    /// The series of the channels that were used.
    pub series: Vec<Series>,
    /// The settings in force.
    pub description: Description,
}

impl StrikeSeries {
    /// The series of a strike.
    ///
    /// # Errors
    /// The strike has no usable samples: the reason, as the end of a sentence.
    pub fn of(strike: &RecordedStrike) -> Result<Self, String> {
        let said = &strike.said;
        if strike.missing() > 0 {
            let all = said.samples;
            return Err(format!(
                "{} of its {all} samples were not received",
                strike.missing()
            ));
        }
        let (Some(settings), Some(rate)) = (&strike.settings, strike.rate()) else {
            return Err("it came without settings, so its samples have no units".to_owned());
        };
        let scans = &strike.scans;
        if scans.len() <= usize::from(BASELINE) {
            return Err(format!(
                "its window has only {} samples, but its zero alone needs {BASELINE}",
                scans.len()
            ));
        }
        let description = *settings.description();
        let quiet = usize::from(settings.window.noise_end()).min(scans.len());
        let series = CHANNELS
            .into_iter()
            .filter_map(|channel| series(channel, scans, &description, quiet))
            .collect();
        let trigger = usize::try_from(said.trigger_index.saturating_sub(said.first_index)).unwrap_or(0);
        Ok(Self {
            rate: rate.into(),
            length: scans.len(),
            trigger: trigger.min(scans.len() - 1),
            quiet,
            series,
            description,
        })
    }

    /// The force at the highest gain available.
    pub(crate) fn force(&self) -> Result<&Series, String> {
        let force = self.series.iter().find(|series| series.channel.is_force());
        force.ok_or_else(|| "it has no force".to_owned())
    }

    /// The samples of a sensor in their order, merged from its channels: window sample and value.
    pub fn merged(&self, force: bool) -> Vec<(usize, f64)> {
        let of_sensor = self
            .series
            .iter()
            .filter(|series| series.channel.is_force() == force);
        let mut merged: Vec<(usize, f64, bool)> = of_sensor
            .flat_map(|series| {
                let wide = series.channel.is_wide();
                series.stretches.iter().flat_map(move |stretch| {
                    let values = stretch.values.iter().enumerate();
                    values.map(move |(n, value)| (stretch.from + n, *value, wide))
                })
            })
            .collect();
        // Both channels have samples of the quiet start; those of the sensitive one come first.
        merged.sort_by_key(|(at, _, wide)| (*at, *wide));
        merged.dedup_by_key(|(at, ..)| *at);
        merged.into_iter().map(|(at, value, _)| (at, value)).collect()
    }
}

/// The noise of each channel over the quiet of all strikes; `None` for an unused channel.
pub fn noises<'a>(strikes: impl IntoIterator<Item = &'a StrikeSeries>) -> [Option<Noise>; 4] {
    let mut sums: [QuietSums; 4] = Default::default();
    let mut steps = [None; 4];
    for strike in strikes {
        for series in &strike.series {
            sums[series.channel.place()].add(series.quiet(strike.quiet), series.step);
            steps[series.channel.place()] = Some(series.step);
        }
    }
    std::array::from_fn(|place| sums[place].fit(steps[place]?))
}

fn series(channel: Channel, scans: &[ScanCodes], description: &Description, quiet: usize) -> Option<Series> {
    let scale = channel.scale(description);
    let (step, pole) = if channel.is_wide() {
        (scale.wide_per_code, scale.wide_pole)
    } else {
        (scale.per_code, scale.pole)
    };
    let baseline = &scans[..usize::from(BASELINE)];
    let codes: Option<Vec<f64>> = baseline
        .iter()
        .map(|scan| channel.code(scan).map(f64::from))
        .collect();
    let zero = codes?.iter().sum::<f64>() / f64::from(BASELINE);
    let sensitive = if channel.is_force() {
        Channel::Force
    } else {
        Channel::Acceleration
    };
    let is_used = |at: usize, scan: &ScanCodes| {
        let is_free = sensitive.code(scan).is_some_and(is_inside);
        let own = channel.code(scan).is_some_and(is_inside);
        // The wide channel takes over where the sensitive one is near a rail.
        own && (!channel.is_wide() || at < quiet || !is_free)
    };
    let mut stretches: Vec<Stretch> = Vec::new();
    for (at, scan) in scans.iter().enumerate() {
        let Some(code) = channel.code(scan).filter(|_| is_used(at, scan)) else {
            continue;
        };
        let value = step * (f64::from(code) - zero);
        match stretches.last_mut() {
            Some(last) if last.from + last.values.len() == at => last.values.push(value),
            _ => stretches.push(Stretch {
                from: at,
                values: vec![value],
            }),
        }
    }
    let has_use = !channel.is_wide()
        || stretches
            .last()
            .is_some_and(|last| last.from + last.values.len() > quiet);
    (has_use && !stretches.is_empty()).then_some(Series {
        channel,
        pole,
        delay: CONVERSION * channel.place() as f64,
        step,
        stretches,
    })
}
