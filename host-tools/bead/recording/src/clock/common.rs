//! The time that the beads of one recording have in common.

use std::collections::HashMap;

use crate::clock::alignment::{Alignment, PlacedEdges};
use crate::clock::fit::Fit;
use crate::clock::segments::{Boots, Segment, Tracker};
use crate::file::{Recording, RecordingError};
use crate::strikes::RecordedStrike;

/// A time for all beads of a recording, as far as they saw the same sync edges; and the host's for each.
#[derive(Debug, Clone)]
pub struct CommonTime {
    places: Boots,
    /// By the place of their segment, those whose clock was fitted.
    boots: HashMap<usize, Boot>,
    /// True if two of them have edges in common.
    is_shared: bool,
    /// True seconds in one of the boot whose time it is, as far as known.
    pace: f64,
}

/// The host's clock says how fast a crystal is if it is as sure as this, ppm. Else the mean of all crystals
/// does, which is nearer the truth than one of them. The wave takes 2 ms along a row, of which 100 ppm are
/// 0.2 µs.
const SURE: f64 = 10.0;

/// Edges that two clocks must have in common.
const EDGES_LEAST: usize = 2;
/// Frames of a bead between two resets, on other clocks than its own.
#[derive(Debug, Clone)]
struct Boot {
    rate: f64,
    fit: Fit,
    on: On,
}

/// How a boot stands on the common time.
#[derive(Debug, Clone)]
enum On {
    /// It is the boot whose time it is.
    Own,
    /// By edges in common with that one.
    Edges(Alignment),
    /// There are none.
    Nothing,
}

/// A boot whose clock could be held against the host's.
struct Fitted {
    /// The place of its segment.
    place: usize,
    rate: f64,
    fit: Fit,
    edges: PlacedEdges,
}

impl Fitted {
    fn of(place: usize, segment: &Segment) -> Option<Self> {
        let rate = f64::from(segment.sample_rate_hz.filter(|rate| *rate > 0)?);
        let fit = segment.fit()?;
        let edges = PlacedEdges::of(segment, &fit)?;
        Some(Self {
            place,
            rate,
            fit,
            edges,
        })
    }
}

impl CommonTime {
    /// From the edges in a recording. The time is that of the boot that has edges in common with most others;
    /// of several, the first.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn of(recording: &Recording) -> Result<Self, RecordingError> {
        Ok(Self::among(&Tracker::of(recording)?.segments))
    }

    /// Finds the common time from the segments.
    pub(super) fn among(segments: &[Segment]) -> Self {
        let places = Boots::of(segments);
        let fitted: Vec<Fitted> = (0..)
            .zip(segments)
            .filter_map(|(place, segment)| Fitted::of(place, segment))
            .collect();
        let (mut reference, mut most) = (0, 0);
        for (at, base) in fitted.iter().enumerate() {
            let others = fitted.iter().enumerate().filter(|(other, _)| *other != at);
            let shares = |other: &Fitted| other.edges.in_common(&base.edges).len() >= EDGES_LEAST;
            let reached = others.filter(|(_, other)| shares(other)).count();
            if reached > most {
                (reference, most) = (at, reached);
            }
            if most + 1 == fitted.len() {
                break;
            }
        }
        let onto = |(at, own): (usize, &Fitted)| {
            if most > 0 && at != reference {
                Alignment::through(own.edges.in_common(&fitted[reference].edges))
            } else {
                None
            }
        };
        let onto: Vec<Option<Alignment>> = fitted.iter().enumerate().map(onto).collect();
        let pace = fitted.get(reference).map_or(1.0, |own| pace(&own.fit, &onto));
        let is_shared = most > 0;
        let boots = fitted.into_iter().zip(onto).enumerate();
        let boot = |(at, (own, alignment)): (usize, (Fitted, _))| {
            let Fitted { place, rate, fit, .. } = own;
            let on = match alignment {
                Some(alignment) => On::Edges(alignment),
                None if at == reference => On::Own,
                None => On::Nothing,
            };
            (place, Boot { rate, fit, on })
        };
        Self {
            places,
            boots: boots.map(boot).collect(),
            is_shared,
            pace,
        }
    }

    fn boot(&self, strike: &RecordedStrike) -> Option<&Boot> {
        self.boots.get(&self.places.find(strike)?)
    }

    /// When a sample of the bead was taken in the boot of this strike, on the time in common, s. `None` for a
    /// boot of a bead that saw fewer than two edges of it, or if no two did.
    pub fn common(&self, strike: &RecordedStrike, sample: f64) -> Option<f64> {
        let own = self.boot(strike)?;
        let time = sample / own.rate;
        match &own.on {
            On::Own => self.is_shared.then_some(time * self.pace),
            On::Edges(alignment) => Some(alignment.reference(time) * self.pace),
            On::Nothing => None,
        }
    }

    /// Returns `true` if there is a time that two beads have in common.
    pub fn is_shared(&self) -> bool {
        self.is_shared
    }

    /// When a sample of the bead was taken in the boot of this strike, on the host's time, s since 1970, give
    /// or take the delay of the line. `None` if the times of receipt are not known.
    pub fn host(&self, strike: &RecordedStrike, sample: f64) -> Option<f64> {
        let own = self.boot(strike)?;
        Some(own.fit.host_ns(sample / own.rate) as f64 * 1e-9)
    }
}

/// True seconds in a second of the bead with this fit, by the host's clock, or by those that are aligned with
/// it.
fn pace(fit: &Fit, onto: &[Option<Alignment>]) -> f64 {
    let fast = match fit.uncertainty_ppm {
        Some(within) if within < SURE => fit.drift_ppm,
        _ => {
            let others = onto.iter().flatten().map(|alignment| alignment.drift_ppm);
            -others.clone().sum::<f64>() / (others.count() + 1) as f64
        }
    };
    1.0 / (1.0 + fast * 1e-6)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bead whose clock is fast by this much, ppm, over so many seconds of frames.
    fn fit(fast: f64, seconds: u32) -> Fit {
        let points: Vec<(f64, f64)> = (0..seconds * 4)
            .map(|n| f64::from(n) * 0.25)
            .map(|host| (host * (1.0 + fast * 1e-6), host + 1e-4))
            .collect();
        Fit::below(0, &points).unwrap()
    }

    /// Another bead whose clock is faster by this much than the one whose time it is.
    fn faster(ppm: f64) -> Option<Alignment> {
        let pairs = (0..20).map(f64::from).map(|at| (at * (1.0 + ppm * 1e-6), at));
        Alignment::through(pairs.collect())
    }

    #[test]
    fn the_time_in_common_runs_as_the_host_s_where_that_is_sure_and_else_as_the_mean_crystal() {
        let others = [None, faster(60.0), faster(-30.0)];
        let ppm = |pace: f64| (pace - 1.0) * 1e6;
        let sure = pace(&fit(80.0, 60), &others);
        assert!((ppm(sure) + 80.0).abs() < 0.1, "{sure}");
        // Too short to tell: crystals at 0, 60 and -30 ppm of it have their mean at 10.
        let short = pace(&fit(80.0, 1), &others);
        assert!((ppm(short) - 10.0).abs() < 0.1, "{short}");
    }
}
