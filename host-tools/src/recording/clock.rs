//! Bead time to host time, and several beads to one time base.
//!
//! # Design
//! **Against the host.** Each frame has the sample index at which it was made, and the host notes when it
//! received the frame. Blocks, queue, line, USB and the host's own scheduling lie between the two: delays
//! that only add. In a plot of host time over bead time the frames therefore lie on or above a straight line,
//! and its slope is the drift. [`Fit`] takes the line that lies below all frames and whose summed distance to
//! them is least: the edge of their lower convex hull that lies below their mean (Moon, Skelly and Towsley,
//! INFOCOM 1999). A least-squares line would follow the mean delay, which changes with the load.
//!
//! For its uncertainty the time is cut into spans (`BINS`). The distance of a span's lowest frame from the
//! line says how well that span fixes the line. With `m`, the median of those distances, the uncertainty is
//! `COVERAGE` · m · √(12 / bins) / time. Over simulated delays of several kinds this interval holds the true
//! drift in nineteen cases of twenty (`the_drift_is_found_…`).
//!
//! The line cannot tell the least delay itself. Host times from the line are late by that delay: about 0.2 ms
//! over UART and USB, and equal for beads on equal connections.
//!
//! **Against one another.** Edges on a line that all beads share ([`bead_wire::Sync`]) have no delay at all.
//! The fits against the host say which edges of two beads are the same. A straight line through the pairs, by
//! least squares, gives the [`Alignment`]. Residuals above the counters' step of 12 ns are what the crystals
//! did between edges.
//!
//! A restart of a bead begins a new [`Segment`]. A new epoch does not, as the sample index goes on. Beads that
//! share a line are told apart by their address: each has segments of its own.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use bead_wire::{Arrival, Message};
use serde::Serialize;

use crate::recording::file::{Recording, RecordingError};
use crate::recording::frames::{Frame, Item};
use crate::recording::json::hex;
use crate::recording::received::Received;

/// Samples in a bucket: a quarter of a second. Of the frames in a bucket only the one with the least delay is
/// kept.
const BUCKET: f64 = 25_000.0;
/// Number of spans that say how uncertain a line is.
const BINS: usize = 24;
/// See the module's text; found by simulation.
const COVERAGE: f64 = 3.0;
/// A drift is only given for at least this span, s, and at least `LEAST_BUCKETS` buckets.
const LEAST_SPAN: f64 = 1.0;
const LEAST_BUCKETS: usize = 4;
/// Two edges that are farther apart in host time are not the same, s.
const SAME_EDGE: f64 = 0.25;

/// A frame's place on both clocks.
#[derive(Debug, Clone, Copy)]
struct Point {
    /// Of the bead, in samples.
    bead: f64,
    /// Of the host, in ns since the segment's first.
    host_ns: f64,
}

/// An edge on the sync input, by the bead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edge {
    /// Its number since the reset.
    pub number: u32,
    /// Where it lies, in samples.
    pub position: f64,
}

/// When a strike's force was highest, by the bead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Struck {
    /// The strike's number since the reset.
    pub strike: u32,
    /// Where it lies, in samples.
    pub position: f64,
}

/// What a bead sent between two resets.
#[derive(Debug, Clone, Default)]
pub struct Segment {
    /// The address in the headers of its frames.
    pub address: u8,
    /// The low byte of its boot number.
    pub boot: u8,
    /// The bead's unique device id; none before its identity came.
    pub uid: Option<[u8; 12]>,
    /// Scans a second, in hertz; none before its identity came.
    pub sample_rate_hz: Option<u32>,
    /// Frames with a receive time.
    pub frames: u64,
    /// Edges on the sync input.
    pub edges: Vec<Edge>,
    /// How many edges the bead missed because they came too close.
    pub missed: u32,
    /// The strikes whose arrival the bead reported.
    pub struck: Vec<Struck>,
    origin_ns: Option<u64>,
    /// The frame with the least delay of each bucket.
    buckets: BTreeMap<u64, Point>,
}

/// Says to which segment a frame belongs, for frames in the order in which they were received.
#[derive(Debug, Clone, Default)]
pub struct Segments {
    /// The current segment of each address.
    current: BTreeMap<u8, usize>,
    count: usize,
}

impl Segments {
    /// The number of a frame's segment, from 0. A new number is the number of segments before it.
    pub fn place(&mut self, frame: &Frame) -> usize {
        let begins = matches!(frame.arrival, Arrival::First | Arrival::Restart { .. });
        let address = frame.header.address;
        match self.current.get(&address) {
            Some(&segment) if !begins => segment,
            _ => {
                self.current.insert(address, self.count);
                self.count += 1;
                self.count - 1
            }
        }
    }
}

/// Sorts what beads send into segments, frame by frame. It keeps four frames a second of each bead.
#[derive(Debug, Clone, Default)]
pub struct Tracker {
    /// The segments so far, in the order in which they began.
    pub segments: Vec<Segment>,
    places: Segments,
}

impl Tracker {
    /// Takes a frame.
    pub fn push(&mut self, frame: &Frame) {
        if frame.arrival == Arrival::Duplicate {
            return;
        }
        let place = self.places.place(frame);
        if place == self.segments.len() {
            self.segments.push(Segment {
                address: frame.header.address,
                boot: frame.header.boot,
                ..Segment::default()
            });
        }
        self.segments[place].push(frame);
    }

    /// The current segment of each bead, by address.
    pub fn current(&self) -> impl Iterator<Item = &Segment> {
        self.places.current.values().map(|&place| &self.segments[place])
    }

    /// All that is in a recording.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn of(recording: &Recording) -> Result<Self, RecordingError> {
        let mut tracker = Self::default();
        for frame in recording.frames()?.filter_map(Item::frame) {
            tracker.push(&frame);
        }
        Ok(tracker)
    }
}

impl Segment {
    fn push(&mut self, frame: &Frame) {
        let mut position = frame.header.sample_index as f64;
        match &frame.message {
            Message::Identity(identity) => {
                self.uid = Some(identity.uid);
                self.sample_rate_hz = Some(identity.sample_rate_hz);
            }
            Message::Sync(sync) => {
                // This is nearer to when the frame was made than the header's index, which moves by blocks.
                position = sync.position();
                self.missed = self.missed.max(sync.missed);
                let number = sync.edge;
                self.edges.push(Edge { number, position });
            }
            Message::Shape(shape) => self.struck.push(Struck {
                strike: shape.strike,
                position: shape.first_index as f64 + shape.arrival.samples(),
            }),
            _ => {}
        }
        let Some(received_ns) = frame.received_ns else {
            return;
        };
        self.frames += 1;
        // Such a frame was made before the first block of samples, perhaps before the sample clock ran. Its
        // index 0 is no time.
        if frame.header.sample_index == 0 {
            return;
        }
        let origin = *self.origin_ns.get_or_insert(received_ns);
        let point = Point {
            bead: position,
            // Exact below 104 days.
            host_ns: (received_ns as i64 - origin as i64) as f64,
        };
        let least = self.buckets.entry((position / BUCKET) as u64).or_insert(point);
        // Within a bucket the best crystal and the worst differ by 0.1 ms, so that the nominal rate will do.
        let late =
            |point: &Point| point.host_ns - point.bead * 1e9 / self.sample_rate_hz.map_or(1e5, f64::from);
        if late(&point) < late(least) {
            *least = point;
        }
    }

    /// The bead's clock against the host's. None without receive times or a sample rate.
    pub fn fit(&self) -> Option<Fit> {
        let rate = f64::from(self.sample_rate_hz.filter(|rate| *rate > 0)?);
        let points: Vec<(f64, f64)> = self
            .buckets
            .values()
            .map(|point| (point.bead / rate, point.host_ns * 1e-9))
            .collect();
        Fit::below(self.origin_ns?, &points)
    }

    fn seconds(&self, position: f64) -> Option<f64> {
        Some(position / f64::from(self.sample_rate_hz?))
    }

    /// The strikes of this segment, at `place`, on the time that `reference` makes of the bead's own.
    fn arrivals(&self, place: &Place, reference: impl Fn(f64) -> f64) -> Vec<StrikeArrival> {
        let arrival = |struck: &Struck| {
            Some(StrikeArrival {
                place: place.clone(),
                strike: struck.strike,
                arrival_s: reference(self.seconds(struck.position)?),
            })
        };
        self.struck.iter().filter_map(arrival).collect()
    }
}

/// A bead's clock against the host's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// Host time in ns since 1970 that the others are counted from.
    origin_ns: u64,
    /// Host time at the bead's time 0, s after the origin.
    offset: f64,
    /// Host seconds in a second of the bead.
    rate: f64,
    /// How fast the bead's clock is against the host's, ppm; 0 where that cannot be told.
    pub drift_ppm: f64,
    /// The true drift lies within this many ppm in 19 cases of 20. None where the drift cannot be told.
    pub uncertainty_ppm: Option<f64>,
    /// How far the least delay of a span typically lies above the line, s: how sure the line is.
    pub residual: f64,
    /// How much later than the line a frame is typically received, s.
    pub delay: f64,
    /// From the first frame to the last, s of the bead.
    pub span: f64,
}

impl Fit {
    /// The line below points of bead and host time in s, the latter after an origin.
    fn below(origin_ns: u64, points: &[(f64, f64)]) -> Option<Self> {
        let (&(first, _), &(last, _)) = (points.first()?, points.last()?);
        let span = last - first;
        let told = points.len() >= LEAST_BUCKETS && span >= LEAST_SPAN;
        let slope = told.then(|| hull_edge(points)).flatten().unwrap_or(0.0);
        // Computed with host minus bead time, so that no digit is lost.
        let above = |&(bead, host): &(f64, f64)| host - bead - slope * bead;
        let offset = points.iter().map(above).fold(f64::INFINITY, f64::min);
        let mut delays: Vec<f64> = points.iter().map(|point| above(point) - offset).collect();
        let mut least = [f64::INFINITY; BINS];
        for (&(bead, _), delay) in points.iter().zip(&delays) {
            let bin = ((bead - first) / span * BINS as f64) as usize;
            let bin = &mut least[bin.min(BINS - 1)];
            *bin = bin.min(*delay);
        }
        let mut least: Vec<f64> = least.into_iter().filter(|delay| delay.is_finite()).collect();
        let bins = least.len();
        let residual = median(&mut least);
        let uncertainty = COVERAGE * residual * (12.0 / bins as f64).sqrt() / span;
        Some(Self {
            origin_ns,
            offset,
            rate: 1.0 + slope,
            drift_ppm: (1.0 / (1.0 + slope) - 1.0) * 1e6,
            uncertainty_ppm: told.then_some(uncertainty * 1e6),
            residual,
            delay: median(&mut delays),
            span,
        })
    }

    /// Host time, in ns since 1970, of a time of the bead, in s since its reset.
    pub fn host_ns(&self, bead: f64) -> i64 {
        let after = (self.offset + self.rate * bead) * 1e9;
        (self.origin_ns as i64).saturating_add(after.round() as i64)
    }
}

/// The slope, less one, of the edge of the lower convex hull at the mean of the first coordinates, which must
/// rise.
fn hull_edge(points: &[(f64, f64)]) -> Option<f64> {
    let relative = |&(bead, host): &(f64, f64)| (bead, host - bead);
    let mut hull: Vec<(f64, f64)> = Vec::new();
    for point in points.iter().map(relative) {
        while let [.., a, b] = hull[..]
            && (b.0 - a.0) * (point.1 - a.1) <= (b.1 - a.1) * (point.0 - a.0)
        {
            hull.pop();
        }
        hull.push(point);
    }
    let mean = points.iter().map(|(bead, _)| bead).sum::<f64>() / points.len() as f64;
    let edge = hull.windows(2).find(|edge| mean <= edge[1].0)?;
    let run = edge[1].0 - edge[0].0;
    (run > 0.0).then(|| (edge[1].1 - edge[0].1) / run)
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// One bead's clock against another's, by edges that both saw.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Alignment {
    /// Own and reference time of each edge in common, in s.
    #[serde(skip)]
    pairs: Vec<(f64, f64)>,
    #[serde(skip)]
    mean: (f64, f64),
    /// Reference seconds in an own second, less one.
    #[serde(skip)]
    slope: f64,
    /// How fast the own clock is against the reference's, ppm.
    pub drift_ppm: f64,
    /// Two standard errors of the drift, from the residuals of the edges; none for two edges, which have no
    /// residual.
    pub drift_uncertainty_ppm: Option<f64>,
    /// Root mean square of the residuals of the edges, s.
    pub residual_rms_s: f64,
    /// Greatest residual of an edge, s.
    pub residual_max_s: f64,
}

impl Alignment {
    /// A line through two pairs of times or more, in s and in order.
    fn through(pairs: Vec<(f64, f64)>) -> Option<Self> {
        if pairs.len() < 2 {
            return None;
        }
        let count = pairs.len() as f64;
        let mean = |part: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(part).sum::<f64>() / count;
        let mean = (mean(&|pair| pair.0), mean(&|pair| pair.1));
        let centred = pairs
            .iter()
            .map(|(own, reference)| (own - mean.0, reference - mean.1));
        let square: f64 = centred.clone().map(|(own, _)| own * own).sum();
        // Computed with the difference, which is small, so that no digit is lost.
        let slope = centred
            .clone()
            .map(|(own, reference)| own * (reference - own))
            .sum::<f64>()
            / square;
        let left: Vec<f64> = centred
            .map(|(own, reference)| reference - own - slope * own)
            .collect();
        let squares: f64 = left.iter().map(|left| left * left).sum();
        let error = (pairs.len() > 2).then(|| (squares / (count - 2.0) / square).sqrt());
        Some(Self {
            drift_ppm: (1.0 / (1.0 + slope) - 1.0) * 1e6,
            drift_uncertainty_ppm: error.map(|error| 2.0 * error * 1e6),
            residual_rms_s: (squares / count).sqrt(),
            residual_max_s: left.iter().map(|left| left.abs()).fold(0.0, f64::max),
            pairs,
            mean,
            slope,
        })
    }

    /// Reference time of an own time, in s: straight between the edges on both sides of it, and on the line
    /// beyond the edges.
    pub fn reference(&self, own: f64) -> f64 {
        let after = self.pairs.partition_point(|pair| pair.0 <= own);
        match (
            after.checked_sub(1).map(|at| self.pairs[at]),
            self.pairs.get(after),
        ) {
            (Some(before), Some(after)) => {
                let share = (own - before.0) / (after.0 - before.0);
                before.1 + share * (after.1 - before.1)
            }
            _ => self.mean.1 + (own - self.mean.0) * (1.0 + self.slope),
        }
    }
}

/// Edges that both segments saw, as times of each in s. Two edges are the same if their host times are.
fn common_edges(own: &Segment, reference: &Segment) -> Option<Vec<(f64, f64)>> {
    let placed = |segment: &Segment| -> Option<Vec<(f64, i64)>> {
        let fit = segment.fit()?;
        let time = |edge: &Edge| segment.seconds(edge.position).map(|at| (at, fit.host_ns(at)));
        segment.edges.iter().map(time).collect()
    };
    let (own, reference) = (placed(own)?, placed(reference)?);
    let closest = |edges: &[(f64, i64)]| {
        let gaps = edges.windows(2).map(|pair| (pair[1].1 - pair[0].1) as f64 * 1e-9);
        gaps.fold(4.0 * SAME_EDGE, f64::min)
    };
    let within = (closest(&own).min(closest(&reference)) / 4.0).min(SAME_EDGE);
    let mut pairs = Vec::new();
    let mut rest = &reference[..];
    for (time, host) in own {
        let near = |edge: &(f64, i64)| ((edge.1 - host) as f64 * 1e-9).abs() <= within;
        if let Some(at) = rest.iter().position(near) {
            pairs.push((time, rest[at].0));
            rest = &rest[at + 1..];
        }
    }
    Some(pairs)
}

/// What `bead clock` finds: each recording against the host, and against the first.
#[derive(Debug, Clone, Serialize)]
pub struct ClockComparison {
    /// One for each recording, bead and boot.
    pub clocks: Vec<ClockReport>,
    /// Where [`AlignmentReport`]s and [`StrikeArrival`]s count their time from, if there are any: of the first
    /// bead in the first recording, the boot with most edges.
    pub reference: Option<Place>,
    /// One for each boot of another bead that has two edges or more in common with the reference.
    pub alignments: Vec<AlignmentReport>,
    /// Strikes on the reference's time, in the order of their arrival.
    pub strikes: Vec<StrikeArrival>,
}

/// A recording, a bead in it and one of its boots.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Place {
    /// The recording.
    pub recording: PathBuf,
    /// The bead's address.
    pub address: u8,
    /// Which of the bead's boots in the recording, from 0.
    pub boot: usize,
}

/// A bead's clock against the host's.
#[derive(Debug, Clone, Serialize)]
#[expect(
    missing_docs,
    reason = "the fields are those of `Fit` and `Segment`, units in their names"
)]
pub struct ClockReport {
    #[serde(flatten)]
    pub place: Place,
    pub uid: Option<String>,
    /// Host time, in ns since 1970, of the bead's sample index 0.
    pub started_unix_ns: i64,
    pub span_s: f64,
    pub frames: u64,
    pub drift_ppm: Option<f64>,
    pub drift_uncertainty_ppm: Option<f64>,
    pub residual_s: f64,
    pub delay_s: f64,
    pub edges: usize,
    pub edges_missed: u32,
}

/// A bead's clock against the reference's.
#[derive(Debug, Clone, Serialize)]
pub struct AlignmentReport {
    /// Where the bead was recorded.
    #[serde(flatten)]
    pub place: Place,
    /// Number of edges that both saw.
    pub edges_in_common: usize,
    /// Reference time of the bead's sample index 0.
    pub offset_s: f64,
    /// How its clock runs.
    #[serde(flatten)]
    pub alignment: Alignment,
}

/// A strike on the reference's time.
#[derive(Debug, Clone, Serialize)]
pub struct StrikeArrival {
    /// Where it was felt.
    #[serde(flatten)]
    pub place: Place,
    /// Its number there.
    pub strike: u32,
    /// When its force was highest, in s of the reference since its reset.
    pub arrival_s: f64,
}

/// A boot of a bead, and its clock against the host's.
type Fitted = (Place, Fit, Segment);

/// Reads recordings and finds how their clocks run.
///
/// # Errors
/// A recording cannot be read, has no receive times, or shares no edges with the first.
pub fn compare(paths: &[PathBuf]) -> Result<ClockComparison, RecordingError> {
    let mut recordings = Vec::new();
    for path in paths {
        let beads = fitted(path)?;
        if beads.is_empty() {
            return Err(RecordingError::Clock(format!(
                "{}: no frame in it has a receive time; record again with `bead record` of this version",
                path.display()
            )));
        }
        recordings.push(beads);
    }
    let mut report = ClockComparison {
        clocks: recordings.iter().flatten().flatten().map(clock_report).collect(),
        reference: None,
        alignments: Vec::new(),
        strikes: Vec::new(),
    };
    let Some(([first, neighbours @ ..], others)) =
        recordings.split_first().map(|(own, rest)| (&own[..], rest))
    else {
        return Ok(report);
    };
    let most_edges = first.iter().max_by_key(|(_, _, segment)| segment.edges.len());
    let alone = neighbours.is_empty() && others.is_empty();
    let Some((reference, _, base)) = most_edges.filter(|_| !alone) else {
        return Ok(report);
    };
    report.reference = Some(reference.clone());
    report.strikes = base.arrivals(reference, |own| own);
    // Beads that share a line may well have no sync input.
    report.align(neighbours, base);
    for recording in others {
        if report.align(recording, base) == 0 {
            return Err(RecordingError::Clock(format!(
                "{} and {} have fewer than two sync edges in common; wire both beads' PA15 to one source, and record them at the same time",
                reference.recording.display(),
                recording[0][0].0.recording.display()
            )));
        }
    }
    report.strikes.sort_by(|a, b| a.arrival_s.total_cmp(&b.arrival_s));
    Ok(report)
}

impl ClockComparison {
    /// Puts beads on the time of `base`; gives the number of boots for which that was possible.
    fn align(&mut self, beads: &[Vec<Fitted>], base: &Segment) -> usize {
        let before = self.alignments.len();
        for (place, _, segment) in beads.iter().flatten() {
            let Some(alignment) = common_edges(segment, base).and_then(Alignment::through) else {
                continue;
            };
            let arrivals = segment.arrivals(place, |own| alignment.reference(own));
            self.strikes.extend(arrivals);
            self.alignments.push(AlignmentReport {
                place: place.clone(),
                edges_in_common: alignment.pairs.len(),
                offset_s: alignment.reference(0.0),
                alignment,
            });
        }
        self.alignments.len() - before
    }
}

/// The boots of each bead in a recording, without those that have no receive times.
fn fitted(path: &Path) -> Result<Vec<Vec<Fitted>>, RecordingError> {
    let received = Received::open(path)?;
    let mut beads = BTreeMap::<u8, Vec<Segment>>::new();
    for segment in Tracker::of(&received.recording)?.segments {
        beads.entry(segment.address).or_default().push(segment);
    }
    let boots = |(address, segments): (u8, Vec<Segment>)| -> Vec<Fitted> {
        let place = |boot| Place {
            recording: path.to_owned(),
            address,
            boot,
        };
        let segments = segments.into_iter().enumerate();
        segments
            .filter_map(|(boot, segment)| Some((place(boot), segment.fit()?, segment)))
            .collect()
    };
    Ok(beads
        .into_iter()
        .map(boots)
        .filter(|boots| !boots.is_empty())
        .collect())
}

fn clock_report((place, fit, segment): &Fitted) -> ClockReport {
    ClockReport {
        place: place.clone(),
        uid: segment.uid.map(|uid| hex(&uid)),
        started_unix_ns: fit.host_ns(0.0),
        span_s: fit.span,
        frames: segment.frames,
        drift_ppm: fit.uncertainty_ppm.map(|_| fit.drift_ppm),
        drift_uncertainty_ppm: fit.uncertainty_ppm,
        residual_s: fit.residual,
        delay_s: fit.delay,
        edges: segment.edges.len(),
        edges_missed: segment.missed,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// How frames are held up on their way.
    #[derive(Debug, Clone, Copy)]
    enum Delays {
        /// A queue: exponential, 1 ms in the mean.
        Queue,
        /// A host that asks every millisecond.
        Polled,
        /// A fifth of the frames waits for up to 50 ms more.
        Stalls,
        /// The queue grows to twentyfold over the time.
        Growing,
    }

    fn exponential(rng: &mut ChaCha8Rng, mean: f64) -> f64 {
        -mean * (1.0 - rng.random::<f64>()).ln()
    }

    /// Frames of a bead that is fast by `ppm`, so many a second for `seconds`, as a segment holds them.
    fn heard(ppm: f64, seconds: f64, rate: f64, delays: Delays, seed: u64) -> Segment {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut segment = Segment {
            sample_rate_hz: Some(100_000),
            ..Segment::default()
        };
        let mut time = 0.0;
        while time < seconds {
            time += if rate > 4.0 {
                exponential(&mut rng, 1.0 / rate)
            } else {
                1.0 / rate
            };
            let late = match delays {
                Delays::Queue => exponential(&mut rng, 1e-3),
                Delays::Polled => (time * 1e3).ceil() / 1e3 - time + exponential(&mut rng, 2e-4),
                Delays::Stalls if rng.random_bool(0.2) => 0.05 * rng.random::<f64>(),
                Delays::Stalls => exponential(&mut rng, 5e-4),
                Delays::Growing => exponential(&mut rng, 5e-4) * (1.0 + 20.0 * time / seconds),
            };
            // By the bead's own clock; the index moves by blocks of 200 samples.
            let index = (time * 500.0).floor() * 200.0;
            let after = time / (1.0 + ppm * 1e-6) + late + 2e-4;
            let received = 1_700_000_000_000_000_000 + (after * 1e9) as u64;
            let status = Frame {
                version: bead_wire::VERSION,
                header: bead_wire::Header {
                    address: 0,
                    boot: 0,
                    sequence: 0,
                    sample_index: index as u64,
                },
                arrival: Arrival::Next { lost: 0 },
                sample_rate_hz: Some(100_000),
                received_ns: Some(received),
                message: bead_wire::Health::default().into(),
            };
            segment.push(&status);
        }
        segment
    }

    #[test]
    fn the_drift_is_found_within_its_uncertainty_whatever_holds_frames_up() {
        for delays in [Delays::Queue, Delays::Polled, Delays::Stalls, Delays::Growing] {
            for (seconds, rate, most) in [(60.0, 4.0, 12.0), (60.0, 50.0, 10.0), (600.0, 4.0, 0.15)] {
                let errors: Vec<(f64, f64)> = (0..100)
                    .map(|seed| {
                        let ppm = seed as f64 - 50.0;
                        let fit = heard(ppm, seconds, rate, delays, seed).fit().unwrap();
                        (fit.drift_ppm - ppm, fit.uncertainty_ppm.unwrap())
                    })
                    .collect();
                let held = errors.iter().filter(|(error, within)| error.abs() <= *within);
                let held = held.count();
                let typical = median(&mut errors.iter().map(|(_, within)| *within).collect::<Vec<_>>());
                let rms = (errors.iter().map(|(error, _)| error * error).sum::<f64>() / 100.0).sqrt();
                println!(
                    "{delays:?} {seconds} s, {rate}/s: rms {rms:.3} ppm, said ±{typical:.3}, held {held} %"
                );
                assert!(held >= 90, "{delays:?} {seconds} s: {held} of 100");
                assert!(typical < most, "{delays:?} {seconds} s: ±{typical} ppm");
            }
        }
    }

    #[test]
    fn a_load_that_grows_misleads_a_least_squares_line_and_not_this_one() {
        let segment = heard(20.0, 600.0, 4.0, Delays::Growing, 1);
        let fit = segment.fit().unwrap();
        let points = segment.buckets.values();
        let pairs = points
            .map(|point| (point.bead / 1e5, point.host_ns * 1e-9))
            .collect();
        let naive = Alignment::through(pairs).unwrap();
        assert!((fit.drift_ppm - 20.0).abs() < 2.0, "{}", fit.drift_ppm);
        assert!((naive.drift_ppm - 20.0).abs() > 10.0, "{}", naive.drift_ppm);
    }

    #[test]
    fn host_times_are_late_by_the_least_delay_and_no_more_than_the_residual() {
        let fit = heard(35.0, 600.0, 50.0, Delays::Queue, 3).fit().unwrap();
        for true_seconds in [0.0, 300.0, 600.0] {
            let host = fit.host_ns(true_seconds * (1.0 + 35e-6));
            let late = (host - 1_700_000_000_000_000_000) as f64 * 1e-9 - true_seconds;
            // 0.2 ms is the least delay put in; the least of the index's blocks and of the queue come on top,
            // and what the slope leaves over half of the time.
            let slope = fit.uncertainty_ppm.unwrap() * 1e-6 * 300.0;
            assert!(
                (2e-4 - slope..2e-4 + 3e-4).contains(&late),
                "{late} s at {true_seconds} s"
            );
        }
    }

    #[test]
    fn frames_made_before_the_sample_clock_ran_do_not_count() {
        let late = heard(35.0, 60.0, 4.0, Delays::Queue, 3);
        let mut with_start = Segment {
            sample_rate_hz: Some(100_000),
            ..Segment::default()
        };
        let mut identity = Frame {
            version: bead_wire::VERSION,
            header: bead_wire::Header {
                address: 0,
                boot: 0,
                sequence: 0,
                sample_index: 0,
            },
            arrival: Arrival::First,
            sample_rate_hz: Some(100_000),
            // Two milliseconds before index 0.
            received_ns: Some(1_699_999_999_998_000_000),
            message: bead_wire::Health::default().into(),
        };
        with_start.push(&identity);
        assert_eq!((with_start.frames, with_start.fit()), (1, None));
        identity.header.sample_index = 200;
        identity.received_ns = Some(1_700_000_000_003_000_000);
        with_start.push(&identity);
        assert!(with_start.fit().is_some());
        assert!(late.fit().unwrap().host_ns(0.0) > 1_700_000_000_000_000_000);
    }

    #[test]
    fn a_moment_says_nothing_of_the_drift() {
        let fit = heard(35.0, 0.9, 4.0, Delays::Queue, 3).fit().unwrap();
        assert_eq!((fit.drift_ppm, fit.uncertainty_ppm), (0.0, None));
        let untimed = Segment {
            sample_rate_hz: Some(100_000),
            ..Segment::default()
        };
        assert_eq!(untimed.fit(), None);
    }

    /// Edges of a clock with a rate and an offset, in steps of an 84 MHz counter, one every `period` s.
    fn edges(rate: f64, offset: f64, period: f64, count: u32) -> Vec<f64> {
        let step = |time: f64| (time * 84e6).floor() / 84e6;
        (0..count)
            .map(|n| step((f64::from(n) * period + offset) * rate))
            .collect()
    }

    #[test]
    fn two_clocks_that_share_edges_agree_to_the_step_of_their_counters() {
        let own = edges(1.0 + 30.37e-6, 0.7, 1.0, 60);
        let reference = edges(1.0 - 12.11e-6, 0.2, 1.0, 60);
        let alignment = Alignment::through(own.into_iter().zip(reference).collect()).unwrap();
        let expected = ((1.0 + 30.37e-6) / (1.0 - 12.11e-6) - 1.0) * 1e6;
        let uncertainty = alignment.drift_uncertainty_ppm.unwrap();
        assert!(
            (alignment.drift_ppm - expected).abs() < uncertainty,
            "{alignment:?}"
        );
        assert!(uncertainty < 2e-4, "{uncertainty}");
        // Two counters of 11.9 ns steps: √(2/12) of one, rms.
        assert!(
            (3e-9..7e-9).contains(&alignment.residual_rms_s),
            "{}",
            alignment.residual_rms_s
        );
        for true_time in [0.01, 17.3, 58.99] {
            let mapped = alignment.reference((true_time + 0.7) * (1.0 + 30.37e-6));
            let off = mapped - (true_time + 0.2) * (1.0 - 12.11e-6);
            assert!(off.abs() < 25e-9, "{off} s at {true_time} s");
        }
    }

    #[test]
    fn a_crystal_that_wanders_is_followed_between_the_edges() {
        // 0.5 ppm to and fro in 20 s: 1.6 us.
        let wander = |time: f64| time + 1.6e-6 * (time * std::f64::consts::TAU / 20.0).sin();
        let pairs: Vec<(f64, f64)> = (0..60).map(|n| (wander(f64::from(n)), f64::from(n))).collect();
        let alignment = Alignment::through(pairs).unwrap();
        assert!(alignment.residual_max_s > 1e-6, "the line does not follow");
        let off = alignment.reference(wander(30.4)) - 30.4;
        assert!(off.abs() < 25e-9, "{off}");
    }

    #[test]
    fn an_edge_that_one_bead_missed_shifts_no_other() {
        let segment = |skip: usize, ppm: f64| {
            let mut segment = heard(ppm, 60.0, 50.0, Delays::Queue, 5);
            let rate = 1.0 + ppm * 1e-6;
            let edges = (1..59).map(|n| Edge {
                number: n,
                position: f64::from(n) * 1e5 * rate,
            });
            segment.edges = edges.collect();
            segment.edges.remove(skip);
            segment
        };
        let pairs = common_edges(&segment(10, 25.0), &segment(40, -25.0)).unwrap();
        assert_eq!(pairs.len(), 56);
        for (own, reference) in pairs {
            assert!((own / (1.0 + 25e-6) - reference / (1.0 - 25e-6)).abs() < 1e-9);
        }
    }

    #[test]
    fn two_beads_on_one_line_have_segments_of_their_own() {
        let rate = |address| if address == 3 { 1.0 + 40e-6 } else { 1.0 - 25e-6 };
        let mut tracker = Tracker::default();
        let mut places = Segments::default();
        let mut boots = [0u8; 2];
        for n in 0..400u64 {
            for (bead, address) in [3u8, 9].into_iter().enumerate() {
                // The second bead restarts in the middle, and the first one does not notice.
                let restart = n == 0 || address == 9 && n == 200;
                boots[bead] += u8::from(restart && n > 0);
                let after = if address == 9 && n >= 200 { n - 200 } else { n };
                let index = ((after + 1) as f64 * 25_000.0 * rate(address)) as u64;
                let frame = Frame {
                    version: bead_wire::VERSION,
                    header: bead_wire::Header {
                        address,
                        boot: boots[bead],
                        sequence: n as u32,
                        sample_index: index,
                    },
                    arrival: match (restart, n) {
                        (true, 0) => Arrival::First,
                        (true, _) => Arrival::Restart { lost: 0 },
                        _ => Arrival::Next { lost: 0 },
                    },
                    sample_rate_hz: Some(100_000),
                    received_ns: Some(1_700_000_000_000_000_000 + n * 250_000_000 + u64::from(address)),
                    message: bead_wire::Health::default().into(),
                };
                let place = places.place(&frame);
                tracker.push(&frame);
                assert_eq!(tracker.segments[place].address, address);
                tracker.segments[place].sample_rate_hz = Some(100_000);
            }
        }
        let found: Vec<_> = tracker
            .segments
            .iter()
            .map(|segment| (segment.address, segment.boot, segment.frames))
            .collect();
        assert_eq!(found, [(3, 0, 400), (9, 0, 200), (9, 1, 200)]);
        for segment in &tracker.segments {
            let fit = segment.fit().unwrap();
            let off = fit.drift_ppm - (rate(segment.address) - 1.0) * 1e6;
            assert!(off.abs() < 0.5, "address {}: off by {off} ppm", segment.address);
        }
        let current: Vec<_> = tracker
            .current()
            .map(|segment| (segment.address, segment.boot))
            .collect();
        assert_eq!(current, [(3, 0), (9, 1)]);
    }
}
