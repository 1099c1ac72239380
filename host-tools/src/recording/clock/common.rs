//! The time that the beads of one recording have in common.

use crate::recording::clock::alignment::{Alignment, common_edges};
use crate::recording::clock::fit::Fit;
use crate::recording::clock::segments::{Segment, Tracker};
use crate::recording::file::{Recording, RecordingError};

/// A time for all beads of a recording, as far as they saw the same sync edges; and the host's for each.
#[derive(Debug, Clone)]
pub struct CommonTime {
    boots: Vec<Boot>,
}

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
            On::Own => self.is_shared().then_some(time),
            On::Edges(alignment) => Some(alignment.reference(time)),
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
