//! Compares the clocks of recordings: with the host's, and with the first one's.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::arrival::rise;
use crate::clock::alignment::{Alignment, PlacedEdges};
use crate::clock::fit::Fit;
use crate::clock::segments::{Boots, Segment, StrikePeak, Tracker};
use crate::file::{Recording, RecordingError};
use crate::json::hex;
use crate::strikes::RecordedStrike;

/// Result of `bead clock`: each recording against the host, and against the first.
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
pub struct ClockComparison {
    /// One for each recording, bead and boot.
    pub clocks: Vec<ClockReport>,
    /// Origin of the times of [`AlignmentReport`]s and [`StrikeArrival`]s, if there are any: of the first
    /// bead in the first recording, the boot with most edges.
    pub reference: Option<RecordedBoot>,
    /// One for each boot of another bead that has two edges or more in common with the reference.
    pub alignments: Vec<AlignmentReport>,
    /// Strikes on the reference's time, in the order of their arrival: at most 100 000.
    pub strikes: Vec<StrikeArrival>,
    /// Strikes that are not shown, in words; empty if all are.
    pub left_out: Vec<String>,
}

/// Greatest number of strikes that are shown.
const STRIKES_MOST: usize = 100_000;

/// A recording, a bead in it and one of its boots.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, schemars::JsonSchema)]
pub struct RecordedBoot {
    /// The recording.
    pub recording: PathBuf,
    /// The bead's address.
    pub address: u8,
    /// Which of the bead's boots in the recording, from 0.
    pub boot: usize,
}

/// A bead's clock against the host's.
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
#[expect(
    missing_docs,
    reason = "the fields are those of `Fit` and `Segment`, units in their names"
)]
pub struct ClockReport {
    #[serde(flatten)]
    pub place: RecordedBoot,
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
    /// True if the frames came as fast as the bead's time passed ([`Fit::in_real_time`]).
    pub in_real_time: bool,
}

/// A bead's clock against the reference's.
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
pub struct AlignmentReport {
    /// The recording of the bead.
    #[serde(flatten)]
    pub place: RecordedBoot,
    /// Number of edges that both saw.
    pub edges_in_common: usize,
    /// Reference time of the bead's sample index 0.
    pub offset_s: f64,
    /// Its clock against the reference's.
    #[serde(flatten)]
    pub alignment: Alignment,
}

/// A strike on the reference's time.
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
pub struct StrikeArrival {
    /// The recording of the strike.
    #[serde(flatten)]
    pub place: RecordedBoot,
    /// Its number there.
    pub strike: u32,
    /// Time of its highest force, s of the reference since its reset.
    pub arrival_s: f64,
    /// Time at which its force rose through half of that, if its samples were received: the front is steep,
    /// so this is some times as exact.
    pub rise_s: Option<f64>,
}

/// A boot of a bead, and its clock against the host's.
type Fitted = (RecordedBoot, Fit, Segment);

/// Reads recordings and compares their clocks.
///
/// # Errors
/// A recording cannot be read, has no receive times, or shares no edges with the first.
pub fn compare(paths: &[PathBuf]) -> Result<ClockComparison, RecordingError> {
    let mut recordings = Vec::<Vec<Vec<Fitted>>>::new();
    for path in paths {
        let beads = fitted(path)?;
        if beads.is_empty() {
            return Err(RecordingError::Unfit(format!(
                "{}: no frame in it has a receive time; record again with `bead record` of this version",
                path.display()
            )));
        }
        if let Some(why) = recordings
            .iter()
            .find_map(|before| recorded_twice(before, &beads))
        {
            return Err(RecordingError::Unfit(why));
        }
        recordings.push(beads);
    }
    let mut report = ClockComparison {
        clocks: recordings.iter().flatten().flatten().map(clock_report).collect(),
        reference: None,
        alignments: Vec::new(),
        strikes: Vec::new(),
        left_out: Vec::new(),
    };
    let Some(([first, neighbours @ ..], others)) =
        recordings.split_first().map(|(own, rest)| (&own[..], rest))
    else {
        return Ok(report);
    };
    let most_edges = first.iter().max_by_key(|(_, _, segment)| segment.edges.len());
    let alone = neighbours.is_empty() && others.is_empty();
    let Some((reference, fit, base)) = most_edges.filter(|_| !alone) else {
        return Ok(report);
    };
    report.reference = Some(reference.clone());
    report.strikes = arrivals(base, reference, |own| own);
    let edges = PlacedEdges::of(base, fit);
    // Beads that share a line may well have no sync input.
    report.align(neighbours, edges.as_ref());
    for recording in others {
        if report.align(recording, edges.as_ref()) == 0 {
            return Err(RecordingError::Unfit(nothing_in_common(
                base, reference, recording,
            )));
        }
    }
    report.strikes.sort_by(|a, b| a.arrival_s.total_cmp(&b.arrival_s));
    let more = report.strikes.len().saturating_sub(STRIKES_MOST);
    if more > 0 {
        report.strikes.truncate(STRIKES_MOST);
        let left_out = format!("{more} strikes after the first {STRIKES_MOST}");
        report.left_out.push(left_out);
    }
    Ok(report)
}

impl ClockComparison {
    /// Puts beads on the time of the boot with the edges `base`. Returns the number of boots for which that
    /// was possible.
    fn align(&mut self, beads: &[Vec<Fitted>], base: Option<&PlacedEdges>) -> usize {
        let before = self.alignments.len();
        for (place, fit, segment) in beads.iter().flatten() {
            let edges = PlacedEdges::of(segment, fit).zip(base);
            let pairs = edges.map(|(own, base)| own.in_common(base));
            let Some(alignment) = pairs.and_then(Alignment::through) else {
                continue;
            };
            let arrivals = arrivals(segment, place, |own| alignment.reference(own));
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

/// A line that names a bead whose boot is in both recordings; `None` if they have none in common.
fn recorded_twice(one: &[Vec<Fitted>], other: &[Vec<Fitted>]) -> Option<String> {
    let boot = |(place, fit, segment): &Fitted| (place.address, segment.uid, fit.host_ns(0.0));
    let (place, ..) = one.iter().flatten().find(|fitted| {
        let mut others = other.iter().flatten();
        others.any(|other| boot(other) == boot(fitted))
    })?;
    Some(format!(
        "{} and {} are of the same run of bead {}; give recordings of different beads, or only one of these",
        place.recording.display(),
        other.first()?.first()?.0.recording.display(),
        place.address
    ))
}

/// A line that says why no bead of a recording could be put on the time of `base`.
fn nothing_in_common(base: &Segment, reference: &RecordedBoot, recording: &[Vec<Fitted>]) -> String {
    let mut segments = recording.iter().flatten().map(|(.., segment)| segment);
    let same = base
        .uid
        .filter(|uid| segments.any(|segment| segment.uid == Some(*uid)));
    let files = format!(
        "{} and {}",
        reference.recording.display(),
        recording[0][0].0.recording.display()
    );
    match same {
        Some(uid) => format!(
            "{files} are both of the bead with UID {}; give recordings of different beads, or only one of these",
            hex(&uid)
        ),
        None => format!(
            "{files} have fewer than two sync edges in common; wire both beads' PA15 to one source, and record them at \
             the same time"
        ),
    }
}

/// The boots of each bead in a recording, without those that have no receive times.
fn fitted(path: &Path) -> Result<Vec<Vec<Fitted>>, RecordingError> {
    let received = Recording::open_named(path)?;
    let mut tracker = Tracker::of(&received)?;
    find_fronts(&mut tracker.segments, received.strikes()?);
    let mut beads = BTreeMap::<u8, Vec<Segment>>::new();
    for segment in tracker.segments {
        beads.entry(segment.address).or_default().push(segment);
    }
    let boots = |(address, segments): (u8, Vec<Segment>)| -> Vec<Fitted> {
        let place = |boot| RecordedBoot {
            recording: path.to_owned(),
            address,
            boot,
        };
        let segments = segments.into_iter().enumerate();
        let fitted = segments.filter_map(|(boot, segment)| Some((place(boot), segment.fit()?, segment)));
        fitted.collect()
    };
    let beads = beads.into_iter().map(boots);
    Ok(beads.filter(|boots| !boots.is_empty()).collect())
}

/// Finds the front of each strike whose samples were received.
fn find_fronts(segments: &mut [Segment], strikes: impl Iterator<Item = RecordedStrike>) {
    let boots = Boots::of(segments);
    // Of several strikes with one number, the first counts.
    let mut numbers = HashMap::<(usize, u32), usize>::new();
    for (boot, segment) in segments.iter().enumerate() {
        for (at, struck) in segment.struck.iter().enumerate() {
            numbers.entry((boot, struck.strike)).or_insert(at);
        }
    }
    for strike in strikes {
        let Some(boot) = boots.find(&strike) else {
            continue;
        };
        let found = numbers.get(&(boot, strike.said.strike));
        let found = found.and_then(|at| segments[boot].struck.get_mut(*at));
        let signal = strike.signal().filter(|_| strike.missing() == 0);
        if let Some(struck) = found {
            let rise = signal.as_ref().and_then(rise);
            struck.rise = rise.map(|rise| strike.said.first_index as f64 + rise);
        }
    }
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
        in_real_time: fit.in_real_time(),
    }
}

/// The strikes of a segment, at `place`, on the time that `reference` derives from the bead's own.
fn arrivals(segment: &Segment, place: &RecordedBoot, reference: impl Fn(f64) -> f64) -> Vec<StrikeArrival> {
    let arrival = |struck: &StrikePeak| {
        Some(StrikeArrival {
            place: place.clone(),
            strike: struck.strike,
            arrival_s: reference(segment.seconds(struck.position)?),
            rise_s: struck.rise.and_then(|rise| segment.seconds(rise)).map(&reference),
        })
    };
    segment.struck.iter().filter_map(arrival).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strikes::ScanCodes;
    use bead_testing::paper_settings;
    use bead_wire::{Body, Strike};

    #[test]
    fn the_front_of_a_strike_is_of_its_own_boot_also_after_a_power_cycle() {
        let strike = Strike::draw(&mut || 0);
        let said = Strike { strike: 7, ..strike };
        let scan = |sample: u16| {
            let force = 6.0 * (-((f64::from(sample) - 300.0) / 20.0).powi(2)).exp();
            ScanCodes {
                sensitive: [(128.0 + force * 4096.0 / 16.0) as u16, 2048],
                wide: None,
            }
        };
        let settings = paper_settings();
        let strike = |nth_boot| RecordedStrike {
            nth_boot,
            scans: (0..672).map(scan).collect(),
            settings: Some(settings),
            ..RecordedStrike::new(0, said)
        };
        let boot = || Segment {
            struck: vec![StrikePeak {
                strike: 7,
                position: 0.0,
                rise: None,
            }],
            ..Segment::default()
        };
        // The low bytes are all 0. A fetched strike has nothing else, so it is of the last boot.
        for (nth_boot, place) in [(Some(0), 0), (Some(1), 1), (Some(2), 2), (None, 2)] {
            let mut boots = [boot(), boot(), boot()];
            find_fronts(&mut boots, [strike(nth_boot)].into_iter());
            let found: Vec<_> = boots.iter().map(|boot| boot.struck[0].rise.is_some()).collect();
            let expected: Vec<_> = (0..3).map(|at| at == place).collect();
            assert_eq!(found, expected, "{nth_boot:?}");
        }
    }

    /// A boot of bead 7 that began at this time of the host, s.
    fn fitted(recording: &str, began: f64, uid: Option<[u8; 12]>) -> Vec<Fitted> {
        let place = RecordedBoot {
            recording: recording.into(),
            address: 7,
            boot: 0,
        };
        let segment = Segment {
            uid,
            ..Segment::default()
        };
        let fit = Fit::below(0, &[(0.0, began), (1.0, began + 1.0)]).unwrap();
        vec![(place, fit, segment)]
    }

    #[test]
    fn a_boot_that_two_recordings_have_is_told_and_another_of_its_bead_is_not() {
        let of = |recording, began: [f64; 2]| began.map(|began| fitted(recording, began, None));
        let row = of("a.mcap", [1.0, 2.0]);
        let why = recorded_twice(&row, &of("b.mcap", [3.0, 2.0])).unwrap();
        let wanted = "a.mcap and b.mcap are of the same run of bead 7";
        assert!(why.starts_with(wanted), "{why}");
        assert_eq!(recorded_twice(&row, &of("b.mcap", [3.0, 4.0])), None);
    }

    #[test]
    fn beads_without_edges_in_common_are_told_from_one_bead_that_was_recorded_twice() {
        let told = |own, other| {
            let (place, _, segment) = fitted("a.mcap", 0.0, own).remove(0);
            nothing_in_common(&segment, &place, &[fitted("b.mcap", 0.0, other)])
        };
        let (one, two) = (Some([1; 12]), Some([2; 12]));
        assert!(told(one, one).starts_with("a.mcap and b.mcap are both of the bead with UID 010101"));
        for (own, other) in [(one, two), (None, one), (one, None), (None, None)] {
            let why = told(own, other);
            let wanted = "fewer than two sync edges";
            assert!(why.contains(wanted), "{own:?} {other:?}: {why}");
        }
    }
}
