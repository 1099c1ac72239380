//! The time that the beads of one recording have in common.

use crate::recording::clock::alignment::{Alignment, common_edges};
use crate::recording::clock::fit::Fit;
use crate::recording::clock::segments::{Segment, Tracker};
use crate::recording::file::{Recording, RecordingError};

/// A time for all beads of a recording, as far as they saw the same sync edges; and the host's for each.
#[derive(Debug, Clone)]
pub struct CommonTime {
    boots: Vec<Boot>,
    /// True seconds in one of the boot whose time it is, as far as known.
    pace: f64,
}

/// The host's clock says how fast a crystal is if it is as sure as this, ppm. Else the mean of all crystals does, which is
/// nearer the truth than one of them. The wave takes 2 ms along a row, of which 100 ppm are 0.2 µs.
const SURE: f64 = 10.0;

/// What a bead sent between two resets, on other clocks than its own.
#[derive(Debug, Clone)]
struct Boot {
    address: u8,
    boot: u8,
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

impl CommonTime {
    /// From the edges in a recording. The time is that of the boot that has edges in common with most others; of several,
    /// the first.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn of(recording: &Recording) -> Result<Self, RecordingError> {
        let segments = Tracker::of(recording)?.segments;
        let fitted = |segment: Segment| {
            let rate = f64::from(segment.sample_rate_hz.filter(|rate| *rate > 0)?);
            Some((segment.fit()?, rate, segment))
        };
        let fitted: Vec<(Fit, f64, Segment)> = segments.into_iter().filter_map(fitted).collect();
        let mut best: Option<(usize, Vec<Option<Alignment>>)> = None;
        for (at, (_, _, base)) in fitted.iter().enumerate() {
            let onto = |(other, (_, _, segment)): (usize, &(Fit, f64, Segment))| match other == at {
                true => None,
                false => common_edges(segment, base).and_then(Alignment::through),
            };
            let onto: Vec<_> = fitted.iter().enumerate().map(onto).collect();
            let count = |onto: &[Option<Alignment>]| onto.iter().flatten().count();
            let reached = count(&onto);
            if best.as_ref().is_none_or(|(_, before)| reached > count(before)) {
                best = Some((at, onto));
            }
            if reached + 1 == fitted.len() {
                break;
            }
        }
        let (reference, onto) = best.unwrap_or_default();
        let pace = fitted.get(reference).map_or(1.0, |(fit, ..)| pace(fit, &onto));
        let boots = fitted.into_iter().zip(onto).enumerate();
        let boot = |(at, ((fit, rate, segment), alignment)): (usize, (_, Option<Alignment>))| {
            let (fit, rate, segment): (Fit, f64, Segment) = (fit, rate, segment);
            Boot {
                address: segment.address,
                boot: segment.boot,
                rate,
                fit,
                on: match alignment {
                    Some(alignment) => On::Edges(alignment),
                    None if at == reference => On::Own,
                    None => On::Nothing,
                },
            }
        };
        Ok(Self {
            boots: boots.map(boot).collect(),
            pace,
        })
    }

    fn boot(&self, address: u8, boot: u8) -> Option<&Boot> {
        let is_it = |one: &&Boot| (one.address, one.boot) == (address, boot);
        self.boots.iter().find(is_it)
    }

    /// When a bead's sample was taken, on the time in common, s. `None` for a boot of a bead that saw fewer than two edges
    /// of it, or if no two did.
    pub fn common(&self, address: u8, boot: u8, sample: f64) -> Option<f64> {
        let own = self.boot(address, boot)?;
        let time = sample / own.rate;
        match &own.on {
            On::Own => self.is_shared().then_some(time * self.pace),
            On::Edges(alignment) => Some(alignment.reference(time) * self.pace),
            On::Nothing => None,
        }
    }

    /// Whether there is a time that two beads have in common.
    pub fn is_shared(&self) -> bool {
        self.boots.iter().any(|boot| matches!(boot.on, On::Edges(_)))
    }

    /// When a bead's sample was taken, on the host's time, s since 1970, give or take the delay of the line. `None` if the
    /// times of receipt are not known.
    pub fn host(&self, address: u8, boot: u8, sample: f64) -> Option<f64> {
        let own = self.boot(address, boot)?;
        Some(own.fit.host_ns(sample / own.rate) as f64 * 1e-9)
    }
}

/// True seconds in a second of the bead with this fit, by the host's clock, or by those that are aligned with it.
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
