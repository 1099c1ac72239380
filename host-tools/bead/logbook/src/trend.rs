//! Quantities of beads over days, with control limits.
//!
//! # Design
//! A point is the mean over the strikes of a recording, over those of a day, or a single strike. Its
//! uncertainty is the mean of theirs: the calibration is nearly all of it, and does not average out. The
//! limits follow only from the scatter of the points ([`ControlLimits`]), so they show a change that is
//! much smaller than the uncertainty.

use std::collections::{BTreeMap, BTreeSet};

use schemars::JsonSchema;
use serde::Serialize;

use crate::control::ControlLimits;
use crate::date;
use crate::filter::Filter;
use crate::quantity::Quantity;
use crate::recording::{LoggedRecording, LoggedStrike};

/// The strikes of a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PointBy {
    /// Those of a recording.
    Recording,
    /// Those of a day, UTC.
    Day,
    /// One.
    Strike,
}

/// The trend of a bead.
#[derive(Debug, Serialize, JsonSchema)]
pub struct BeadTrend {
    /// Address of the bead.
    pub bead: u8,
    /// Name that its owner gave it last.
    pub name: Option<String>,
    /// Number of its strikes.
    pub strikes: usize,
    /// Its quantities, of which one point at least is known.
    pub quantities: Vec<QuantityTrend>,
}

/// A quantity of a bead over time.
#[derive(Debug, Serialize, JsonSchema)]
pub struct QuantityTrend {
    /// The quantity's name.
    pub quantity: &'static str,
    /// Its unit; empty for a ratio.
    pub unit: &'static str,
    /// Its limits; none where the base has too few points.
    pub limits: Option<ControlLimits>,
    /// Number of points beyond them.
    pub out_of_control: usize,
    /// The points, in the order of their times.
    pub points: Vec<TrendPoint>,
    #[serde(skip)]
    pub(crate) of: Quantity,
}

/// A value of a quantity at a time.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct TrendPoint {
    /// Its time, UTC, RFC 3339: of the first of its strikes.
    pub time: String,
    /// That time in ns since 1970.
    pub time_unix_ns: i64,
    /// The recording of the first of its strikes.
    pub recording: String,
    /// Number of its strikes.
    pub strikes: usize,
    /// Their mean.
    pub value: f64,
    /// Standard uncertainty, null where that of a strike is unknown.
    pub u: Option<f64>,
    /// True if it is beyond a control limit; null without limits.
    pub out_of_control: Option<bool>,
}

/// Sums over the strikes of a point.
struct Sums {
    time_ns: i64,
    recording: String,
    strikes: usize,
    value: f64,
    /// `None` once the uncertainty of a strike is unknown.
    u: Option<f64>,
}

impl QuantityTrend {
    /// The quantity.
    pub fn quantity(&self) -> Quantity {
        self.of
    }
}

/// The trends of the beads in recordings that the filter takes, by address. The base of the limits is the
/// first `base` points, or all.
pub fn trends(
    recordings: &[LoggedRecording],
    filter: &Filter,
    by: PointBy,
    base: Option<usize>,
    quantities: &[Quantity],
) -> Vec<BeadTrend> {
    let wanted: Vec<&LoggedRecording> = recordings.iter().filter(|one| filter.takes(one)).collect();
    let strikes = || {
        let all = wanted.iter();
        all.flat_map(|one| filter.strikes(one).map(|strike| (*one, strike)))
    };
    let beads: BTreeSet<u8> = strikes().map(|(_, strike)| strike.address).collect();
    let trend = |bead: u8| {
        let own: Vec<_> = strikes().filter(|(_, strike)| strike.address == bead).collect();
        let trends = quantities
            .iter()
            .map(|quantity| of_quantity(*quantity, &own, by, base));
        BeadTrend {
            bead,
            name: own.iter().rev().find_map(|(_, strike)| strike.bead_name.clone()),
            strikes: own.len(),
            quantities: trends.filter(|trend| !trend.points.is_empty()).collect(),
        }
    };
    beads.into_iter().map(trend).collect()
}

fn of_quantity(
    quantity: Quantity,
    strikes: &[(&LoggedRecording, &LoggedStrike)],
    by: PointBy,
    base: Option<usize>,
) -> QuantityTrend {
    let mut groups = BTreeMap::<(i64, &str, usize), Sums>::new();
    for (place, (recording, strike)) in strikes.iter().enumerate() {
        let Some((value, u)) = quantity.of(strike) else {
            continue;
        };
        let key = match by {
            PointBy::Recording => (recording.date.unix_ns, recording.file.as_str(), 0),
            PointBy::Day => (date::day(strike.time_ns), "", 0),
            PointBy::Strike => (strike.time_ns, recording.file.as_str(), place),
        };
        let sums = groups.entry(key).or_insert_with(|| Sums {
            time_ns: strike.time_ns,
            recording: recording.file.clone(),
            strikes: 0,
            value: 0.0,
            u: Some(0.0),
        });
        sums.time_ns = sums.time_ns.min(strike.time_ns);
        sums.strikes += 1;
        sums.value += value;
        sums.u = sums.u.zip(u).map(|(sum, u)| sum + u);
    }
    let mut points: Vec<TrendPoint> = groups.into_values().map(Sums::point).collect();
    points.sort_by_key(|point| point.time_unix_ns);
    let values: Vec<f64> = points.iter().map(|point| point.value).collect();
    let limits = ControlLimits::of(&values, base);
    for point in &mut points {
        point.out_of_control = limits.map(|limits| limits.is_beyond(point.value));
    }
    QuantityTrend {
        quantity: quantity.name(),
        unit: quantity.unit(),
        limits,
        out_of_control: points
            .iter()
            .filter(|point| point.out_of_control == Some(true))
            .count(),
        points,
        of: quantity,
    }
}

impl Sums {
    fn point(self) -> TrendPoint {
        let count = self.strikes as f64;
        TrendPoint {
            time: date::text(self.time_ns),
            time_unix_ns: self.time_ns,
            recording: self.recording,
            strikes: self.strikes,
            value: self.value / count,
            u: self.u.map(|sum| sum / count),
            out_of_control: None,
        }
    }
}
