//! The facts that a logbook holds of a recording.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use bead_recording::clock::Tracker;
use bead_recording::export::strikes::{columns, row};
use bead_recording::file::{Recording, RecordingError};
use bead_recording::strikes::RecordedStrike;
use bead_tables::Cell;
use bead_tables::printable::{beginning, one_line};

use crate::date::{DateFacts, DateSource, RecordingDate};

/// Numbers of a strike that a logbook holds: columns of `strikes` in an export.
pub const NUMBERS: [&str; 15] = [
    "absorbed_measured_j",
    "u_absorbed_measured_j",
    "absorbed_predicted_j",
    "u_absorbed_predicted_j",
    "u_difference_j",
    "peak_force_n",
    "u_peak_force_n",
    "incident_energy_j",
    "u_incident_energy_j",
    "ring_frequency_hz",
    "ring_decay_per_s",
    "force_gains_deviation",
    "force_gains_uncertainty",
    "acceleration_gains_deviation",
    "acceleration_gains_uncertainty",
];
/// Characters of a reason at most.
const REASON_MOST: usize = 300;

/// A recording of a folder.
#[derive(Clone, Debug, PartialEq)]
pub struct LoggedRecording {
    /// Name of its file in the folder.
    pub file: String,
    /// State of the file when it was read.
    pub stamp: FileStamp,
    /// Why it is no recording of beads, in a line; `None` if it is one.
    pub problem: Option<String>,
    /// Its missing parts, in a line.
    pub incomplete: Option<String>,
    /// Its date.
    pub date: RecordingDate,
    /// The ports or the program that its bytes came from.
    pub source: String,
    /// Its notes that count, by key.
    pub notes: BTreeMap<String, String>,
    /// Addresses of its beads.
    pub beads: BTreeSet<u8>,
    /// Its strikes, in the order received.
    pub strikes: Vec<LoggedStrike>,
}

/// State of a file: if it is the same, so is its content.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileStamp {
    /// Length, bytes.
    pub size: u64,
    /// Time of its last change, ns since 1970. `None` where the file was read so soon after it that a later
    /// change may have the same time.
    pub modified_ns: Option<i64>,
}

/// A strike of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct LoggedStrike {
    /// Address of its bead.
    pub address: u8,
    /// Name that its owner gave the bead.
    pub bead_name: Option<String>,
    /// Its number since the bead's reset.
    pub strike: u32,
    /// Its time, ns since 1970.
    pub time_ns: i64,
    /// Names of its flags, with spaces between them.
    pub flags: String,
    /// The [`NUMBERS`], in SI units.
    pub numbers: [Option<f64>; NUMBERS.len()],
    /// Drift of the bead's clock against the host's in this recording, and its standard uncertainty, ppm.
    pub clock_ppm: Option<(f64, f64)>,
}

impl LoggedStrike {
    /// The number of this name; `None` if it is unknown, or not in [`NUMBERS`].
    pub fn number(&self, name: &str) -> Option<f64> {
        let place = NUMBERS.iter().position(|one| *one == name)?;
        self.numbers[place]
    }
}

impl LoggedRecording {
    /// Reads the facts of a file of this name and stamp, last changed at `file_ns`, ns since 1970. One that
    /// is no recording has a [`problem`](Self::problem).
    pub fn read(path: &Path, file: &str, stamp: FileStamp, file_ns: i64) -> Self {
        Self::of(path, file, stamp, file_ns).unwrap_or_else(|error| Self {
            problem: Some(one_line(&beginning(&error.to_string(), REASON_MOST)).into_owned()),
            ..Self::empty(file, stamp, file_ns)
        })
    }

    /// A recording without content, of the date of its file.
    pub(crate) fn empty(file: &str, stamp: FileStamp, file_ns: i64) -> Self {
        Self {
            file: file.to_owned(),
            stamp,
            problem: None,
            incomplete: None,
            date: RecordingDate {
                unix_ns: file_ns,
                source: DateSource::File,
            },
            source: String::new(),
            notes: BTreeMap::new(),
            beads: BTreeSet::new(),
            strikes: Vec::new(),
        }
    }

    fn of(path: &Path, file: &str, stamp: FileStamp, file_ns: i64) -> Result<Self, RecordingError> {
        let recording = Recording::open(path)?;
        let about = &recording.about;
        let notes: BTreeMap<String, String> = about
            .last_remarks()
            .into_iter()
            .map(|(key, note)| (key.to_owned(), note.value.clone()))
            .collect();
        let first_received_ns = recording.pieces()?.find_map(|piece| piece.received_ns);
        let facts = DateFacts {
            note: notes.get("date").map(String::as_str),
            first_received_ns,
            started: about.notes.get("started").map(String::as_str),
            file_ns,
        };
        let date = facts.date();
        let tracker = Tracker::of(&recording)?;
        let mut beads: BTreeSet<u8> = recording.beads.iter().map(|bead| bead.origin.address).collect();
        beads.extend(tracker.segments.iter().map(|segment| segment.address));
        let clocks = clocks(&tracker);
        let names: Vec<String> = columns().into_iter().map(|column| column.name).collect();
        let places = NUMBERS.map(|name| names.iter().position(|one| one == name));
        let flags_at = names.iter().position(|one| one == "flags");
        let logged = |strike: RecordedStrike| {
            let row = row(0, "", &strike);
            let cell = |place: Option<usize>| place.and_then(|place| row.get(place));
            let numbers =
                places.map(|place| cell(place).and_then(Cell::as_f64).filter(|one| one.is_finite()));
            let flags = match cell(flags_at) {
                Some(Cell::Text(text)) => text.to_string(),
                _ => String::new(),
            };
            LoggedStrike {
                address: strike.address,
                bead_name: bead_name(&strike),
                strike: strike.said.strike,
                time_ns: date.unix_ns.saturating_add(after_ns(&strike, first_received_ns)),
                flags,
                numbers,
                clock_ppm: clocks.get(&strike.address).copied(),
            }
        };
        let strikes: Vec<LoggedStrike> = recording.strikes()?.map(logged).collect();
        beads.extend(strikes.iter().map(|strike| strike.address));
        Ok(Self {
            file: file.to_owned(),
            stamp,
            problem: None,
            incomplete: recording.incomplete().map(|what| one_line(&what).into_owned()),
            date,
            source: one_line(&beginning(&about.source, REASON_MOST)).into_owned(),
            notes,
            beads,
            strikes,
        })
    }

    /// The verdict that was noted last: `pass`, `fail` or `undecided`.
    pub fn verdict(&self) -> Option<&str> {
        self.notes.get("verdict").map(String::as_str)
    }

    /// Names of the flags of its strikes.
    pub fn flags(&self) -> BTreeSet<&str> {
        let flags = self
            .strikes
            .iter()
            .flat_map(|strike| strike.flags.split_whitespace());
        flags.collect()
    }
}

fn bead_name(strike: &RecordedStrike) -> Option<String> {
    let name = strike.settings.as_ref()?.description().name;
    let name = one_line(name.as_str()).into_owned();
    Some(name).filter(|name| !name.is_empty())
}

/// The time of a strike after the first frame of its recording, ns: as the host received both, else by the
/// bead's own count.
fn after_ns(strike: &RecordedStrike, first_received_ns: Option<u64>) -> i64 {
    let by_host = strike.received_ns.zip(first_received_ns);
    let by_host = by_host.and_then(|(received, first)| i64::try_from(received.checked_sub(first)?).ok());
    by_host.unwrap_or_else(|| {
        let rate = strike.rate().map_or(f64::INFINITY, f64::from);
        (strike.said.trigger_index as f64 / rate * 1e9) as i64
    })
}

/// The drift of each bead's clock by its longest boot, and its standard uncertainty, ppm. A bead whose frames
/// did not come as fast as its time passed has none.
fn clocks(tracker: &Tracker) -> BTreeMap<u8, (f64, f64)> {
    let mut longest = BTreeMap::<u8, (f64, (f64, f64))>::new();
    for segment in &tracker.segments {
        let Some(fit) = segment.fit().filter(|fit| fit.in_real_time()) else {
            continue;
        };
        let Some(within) = fit.uncertainty_ppm.filter(|within| within.is_finite()) else {
            continue;
        };
        let before = longest.entry(segment.address).or_default();
        if fit.span > before.0 {
            // The interval holds the drift in 19 cases of 20: two standard uncertainties to either side.
            *before = (fit.span, (fit.drift_ppm, within / 2.0));
        }
    }
    longest
        .into_iter()
        .map(|(address, (_, clock))| (address, clock))
        .collect()
}
