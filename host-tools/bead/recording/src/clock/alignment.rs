//! One bead's clock against another's, by edges on a line that both share.

use serde::Serialize;

use crate::clock::fit::Fit;
use crate::clock::segments::Segment;

/// Greatest difference in host time of two records of one edge, s.
const SAME_EDGE: f64 = 0.25;

/// One bead's clock against another's, by edges that both saw.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Alignment {
    /// Own and reference time of each edge in common, in s.
    #[serde(skip)]
    pub(super) pairs: Vec<(f64, f64)>,
    #[serde(skip)]
    mean: (f64, f64),
    /// Reference seconds in an own second, less one.
    #[serde(skip)]
    slope: f64,
    /// Drift of the own clock against the reference's, ppm; positive if it is fast.
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
    pub(super) fn through(pairs: Vec<(f64, f64)>) -> Option<Self> {
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

/// The edges of a segment, each at its own time, in s, and at the host's, in ns; in the order of the latter.
#[derive(Debug, Clone)]
pub(super) struct PlacedEdges {
    edges: Vec<(f64, i64)>,
    /// Host time between the two closest edges, s.
    closest: f64,
}

impl PlacedEdges {
    /// `fit` is the segment's. None without a sample rate.
    pub(super) fn of(segment: &Segment, fit: &Fit) -> Option<Self> {
        let time = |edge: &f64| segment.seconds(*edge).map(|at| (at, fit.host_ns(at)));
        let mut edges: Vec<(f64, i64)> = segment.edges.iter().map(time).collect::<Option<_>>()?;
        edges.sort_by_key(|(_, host)| *host);
        let gaps = edges
            .windows(2)
            .map(|pair| pair[1].1.saturating_sub(pair[0].1) as f64 * 1e-9);
        Some(Self {
            closest: gaps.fold(4.0 * SAME_EDGE, f64::min),
            edges,
        })
    }

    /// The edges that both segments saw, as times of each in s. Two edges are the same if their host times
    /// are.
    pub(super) fn in_common(&self, reference: &Self) -> Vec<(f64, f64)> {
        let within = (self.closest.min(reference.closest) / 4.0).min(SAME_EDGE);
        let mut pairs = Vec::new();
        let mut rest = &reference.edges[..];
        for &(time, host) in &self.edges {
            // Edges before this one are also before all that follow.
            let after = |edge: &(f64, i64)| edge.1.saturating_sub(host) as f64 * 1e-9;
            rest = &rest[rest.partition_point(|edge| after(edge) < -within)..];
            if let Some(edge) = rest.first().filter(|edge| after(edge) <= within) {
                pairs.push((time, edge.0));
                rest = &rest[1..];
            }
        }
        pairs
    }
}
