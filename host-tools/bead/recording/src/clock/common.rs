//! The common time of the beads of one recording.

use crate::clock::alignment::{Alignment, PlacedEdges};
use crate::clock::fit::Fit;
use crate::clock::segments::{Boots, Segment, Tracker};
use crate::file::{Recording, RecordingError};
use crate::strikes::RecordedStrike;

/// The common time of all beads of a recording that saw the same sync edges, and the host's time for each.
#[derive(Debug, Clone)]
pub struct CommonTime {
    places: Boots,
    /// By segment; `None` for a boot whose clock cannot be fitted.
    boots: Vec<Option<BootClock>>,
    /// Segment of the boot that defines the common time, `None` if no two boots have edges in common.
    reference: Option<usize>,
    /// True seconds in one of the reference, as far as known.
    pace: f64,
}

/// Greatest uncertainty with which the host's clock gives the pace of a crystal, ppm. Above it, the mean of
/// all crystals does, which is nearer the truth than one of them. The wave takes 2 ms along a row, of which
/// 100 ppm are 0.2 µs.
const SURE: f64 = 10.0;

/// Edges that two clocks must have in common.
const EDGES_LEAST: usize = 2;
/// The clock of a boot against others.
#[derive(Debug, Clone)]
struct BootClock {
    /// Scans a second, Hz.
    rate: f64,
    /// Against the host's.
    fit: Fit,
    edges: PlacedEdges,
    /// Against the reference's, by edges in common with it.
    alignment: Option<Alignment>,
}

impl BootClock {
    fn of(segment: &Segment) -> Option<Self> {
        let fit = segment.fit()?;
        Some(Self {
            rate: f64::from(segment.sample_rate_hz?),
            fit,
            edges: PlacedEdges::of(segment, &fit)?,
            alignment: None,
        })
    }
}

impl CommonTime {
    /// Derives the time from the edges in a recording. It is that of the boot that has edges in common with
    /// most others; of several such boots, the first.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn of(recording: &Recording) -> Result<Self, RecordingError> {
        Ok(Self::among(&Tracker::of(recording)?.segments))
    }

    pub(super) fn among(segments: &[Segment]) -> Self {
        let mut boots: Vec<_> = segments.iter().map(BootClock::of).collect();
        let fitted = boots.iter().enumerate();
        let fitted: Vec<_> = fitted
            .filter_map(|(at, boot)| Some((at, boot.as_ref()?)))
            .collect();
        let (mut reference, mut most) = (None, 0);
        for (at, base) in &fitted {
            let shares = |other: &BootClock| other.edges.in_common(&base.edges).len() >= EDGES_LEAST;
            let reached = fitted.iter().filter(|(other, boot)| other != at && shares(boot));
            let reached = reached.count();
            if reached > most {
                (reference, most) = (Some(*at), reached);
            }
            if most + 1 == fitted.len() {
                break;
            }
        }
        let base = reference.and_then(|at| boots[at].as_ref());
        let onto = |(at, own): (usize, &Option<BootClock>)| {
            let (own, base) = (own.as_ref()?, base.filter(|_| reference != Some(at))?);
            Alignment::through(own.edges.in_common(&base.edges))
        };
        let onto: Vec<_> = boots.iter().enumerate().map(onto).collect();
        let pace = base.map_or(1.0, |base| pace(&base.fit, &onto));
        for (boot, alignment) in boots.iter_mut().zip(onto) {
            if let Some(boot) = boot {
                boot.alignment = alignment;
            }
        }
        Self {
            places: Boots::of(segments),
            boots,
            reference,
            pace,
        }
    }

    /// The segment of a strike, and its clock.
    fn boot(&self, strike: &RecordedStrike) -> Option<(usize, &BootClock)> {
        let at = self.places.find(strike)?;
        Some((at, self.boots.get(at)?.as_ref()?))
    }

    /// Common time of a sample of the bead, in the boot of this strike, s. `None` if the boot saw fewer than
    /// two edges in common, or if no two boots did.
    pub fn common(&self, strike: &RecordedStrike, sample: f64) -> Option<f64> {
        let (at, own) = self.boot(strike)?;
        let time = sample / own.rate;
        if self.reference == Some(at) {
            return Some(time * self.pace);
        }
        Some(own.alignment.as_ref()?.reference(time) * self.pace)
    }

    /// True if there is a time that two beads have in common.
    pub fn is_shared(&self) -> bool {
        self.reference.is_some()
    }

    /// Host time of a sample of the bead, in the boot of this strike, s since 1970, late by the delay of the
    /// line. `None` if receive times are unknown.
    pub fn host(&self, strike: &RecordedStrike, sample: f64) -> Option<f64> {
        let (_, own) = self.boot(strike)?;
        Some(own.fit.host_ns(sample / own.rate) as f64 * 1e-9)
    }
}

/// True seconds in a second of the bead with this fit, by the host's clock, or by the clocks that are aligned
/// with it.
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

    /// A bead whose clock is fast by this much, ppm, over this many seconds of frames.
    fn fit(fast: f64, seconds: u32) -> Fit {
        let points: Vec<(f64, f64)> = (0..seconds * 4)
            .map(|n| f64::from(n) * 0.25)
            .map(|host| (host * (1.0 + fast * 1e-6), host + 1e-4))
            .collect();
        Fit::below(0, &points).unwrap()
    }

    /// Another bead whose clock is faster by this much than the reference.
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
