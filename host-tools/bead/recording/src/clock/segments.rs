//! Clock data of each bead between two resets.

use std::collections::BTreeMap;

use bead_wire::{Arrival, Message};

use crate::clock::fit::Fit;
use crate::file::{Recording, RecordingError};
use crate::frames::{Frame, Item};
use crate::strikes::RecordedStrike;

/// Initial number of samples in a bucket: a quarter of a second. A bucket keeps only its frame with the least
/// delay.
const BUCKET: f64 = 25_000.0;
/// Greatest number of buckets. Beyond it, after half an hour, pairs of buckets are merged.
const BUCKETS_MOST: usize = 8192;

/// A frame's place on both clocks.
#[derive(Debug, Clone, Copy)]
pub(super) struct ClockPoint {
    /// Place on the bead's clock, in samples.
    pub(super) bead: f64,
    /// Place on the host's clock, in ns since the segment's first frame.
    pub(super) host_ns: f64,
}

/// The time of a strike, by its bead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StrikePeak {
    /// The strike's number since the reset.
    pub strike: u32,
    /// Place of the highest force, in samples since the reset.
    pub position: f64,
    /// Place at which the force rose through half of its height, in samples, if its front was found.
    pub rise: Option<f64>,
}

/// Clock data of a bead between two resets.
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
    /// Its edges on the sync input, in samples since the reset.
    pub edges: Vec<f64>,
    /// Number of edges that the bead missed because they came too close.
    pub missed: u32,
    /// The strikes whose arrival the bead reported.
    pub struck: Vec<StrikePeak>,
    pub(super) origin_ns: Option<u64>,
    /// The frame with the least delay of each bucket.
    pub(super) buckets: BTreeMap<u64, ClockPoint>,
    /// Number of times that pairs of buckets were merged.
    pub(super) halved: u32,
    /// Length of a sample by the host's clock, as known at the last merge, ns.
    pub(super) pace: Option<f64>,
}

/// Finds the segments of frames that come in the order received.
#[derive(Debug, Clone, Default)]
pub struct Segments {
    current: BTreeMap<u8, usize>,
    count: usize,
}

impl Segments {
    /// The number of a frame's segment, from 0. A new number is the number of segments before it.
    pub fn place(&mut self, frame: &Frame) -> usize {
        let address = frame.header.address;
        match self.current.get(&address) {
            Some(&segment) if !begins(frame) => segment,
            _ => {
                self.current.insert(address, self.count);
                self.count += 1;
                self.count - 1
            }
        }
    }
}

/// Sorts the frames of beads into segments. For each it keeps some thousand frames, and all edges and
/// strikes.
#[derive(Debug, Clone, Default)]
pub struct Tracker {
    /// The segments, in the order in which they began.
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
            self.segments.push(Segment::begun_by(frame));
        }
        self.segments[place].push(frame);
    }

    /// The segments of a recording.
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

/// Finds the segments of strikes.
#[derive(Debug, Clone, Default)]
pub struct Boots {
    /// Address and low byte of the boot number of each segment.
    boots: Vec<(u8, u8)>,
}

impl Boots {
    /// The boots of all segments of a recording, as [`Tracker`] has them.
    pub fn of(segments: &[Segment]) -> Self {
        let boots = segments.iter().map(|segment| (segment.address, segment.boot));
        let boots = boots.collect();
        Self { boots }
    }

    /// The index of a strike's segment. For a fetched strike, that of the last boot with its low byte.
    pub fn find(&self, strike: &RecordedStrike) -> Option<usize> {
        let is_its = |(_, (address, _)): &(usize, &(u8, u8))| *address == strike.address;
        let mut its = self.boots.iter().enumerate().filter(is_its);
        let found = match strike.nth_boot {
            Some(nth) => its.nth(nth),
            None => its.rfind(|(_, (_, boot))| *boot == strike.boot),
        };
        found.map(|(at, _)| at)
    }
}

/// The current segment of each bead, by address, without edges and strikes: a recorder may run for months.
#[derive(Debug, Clone, Default)]
pub struct Live(BTreeMap<u8, Segment>);

impl Live {
    /// Takes a frame.
    pub fn push(&mut self, frame: &Frame) {
        if frame.arrival == Arrival::Duplicate {
            return;
        }
        let begun = || Segment::begun_by(frame);
        let segment = self.0.entry(frame.header.address).or_insert_with(begun);
        if begins(frame) {
            *segment = begun();
        }
        segment.push(frame);
        segment.edges.clear();
        segment.struck.clear();
    }

    /// The segments.
    pub fn segments(&self) -> impl Iterator<Item = &Segment> {
        self.0.values()
    }
}

/// Returns `true` if a frame is the first that was received of a boot.
fn begins(frame: &Frame) -> bool {
    matches!(frame.arrival, Arrival::First | Arrival::Restart { .. })
}

impl Segment {
    fn begun_by(frame: &Frame) -> Self {
        Self {
            address: frame.header.address,
            boot: frame.header.boot,
            ..Self::default()
        }
    }

    pub(super) fn push(&mut self, frame: &Frame) {
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
                self.edges.push(position);
            }
            Message::Shape(shape) => self.struck.push(StrikePeak {
                strike: shape.strike,
                position: shape.first_index as f64 + shape.arrival.samples(),
                rise: None,
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
        // Exact below 104 days.
        let host_ns = (i128::from(received_ns) - i128::from(origin)) as f64;
        self.keep(ClockPoint {
            bead: position,
            host_ns,
        });
        if self.buckets.len() > BUCKETS_MOST {
            self.halve();
        }
    }

    /// Delay of a frame, in ns, against a clock of the pace found so far. Within a first bucket crystals
    /// differ by less than 0.1 ms, so the nominal rate is sufficient.
    fn late(&self, point: &ClockPoint) -> f64 {
        let nominal = 1e9 / self.sample_rate_hz.map_or(1e5, f64::from);
        point.host_ns - point.bead * self.pace.unwrap_or(nominal)
    }

    fn keep(&mut self, point: ClockPoint) {
        let bucket = (point.bead / BUCKET) as u64 >> self.halved;
        let before = self.buckets.get(&bucket).copied();
        if before.is_none_or(|before| self.late(&point) < self.late(&before)) {
            self.buckets.insert(bucket, point);
        }
    }

    /// Merges pairs of buckets. These are long, so the drift found so far is needed to see which frame was
    /// late.
    fn halve(&mut self) {
        if let (Some(fit), Some(rate)) = (self.fit(), self.sample_rate_hz) {
            self.pace = Some(1e9 / (f64::from(rate) * (1.0 + fit.drift_ppm * 1e-6)));
        }
        self.halved += 1;
        for point in std::mem::take(&mut self.buckets).into_values() {
            self.keep(point);
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

    pub(super) fn seconds(&self, position: f64) -> Option<f64> {
        Some(position / f64::from(self.sample_rate_hz?))
    }
}
