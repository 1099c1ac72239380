//! A bead's clock against the host's: the line below all frames in a plot of host time over bead time.

/// Number of spans that determine the uncertainty of a line.
const BINS: usize = 24;
/// See the module's text; found by simulation.
const COVERAGE: f64 = 3.0;
/// A drift is only given for at least this span, s, and at least `LEAST_BUCKETS` buckets.
const LEAST_SPAN: f64 = 1.0;
const LEAST_BUCKETS: usize = 4;

/// Distance from its frequency that no crystal reaches, ppm; good crystals are within 100.
pub const CRYSTAL_PPM: f64 = 1000.0;

/// A bead's clock against the host's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// Origin of the other host times, ns since 1970.
    origin_ns: u64,
    /// Host time at the bead's time 0, s after the origin.
    offset: f64,
    /// Host seconds in a second of the bead.
    rate: f64,
    /// Drift of the bead's clock against the host's, ppm, positive if it is fast; 0 where it is unknown.
    pub drift_ppm: f64,
    /// Half width of the interval that holds the true drift in 19 cases of 20, ppm. `None` where the drift is
    /// unknown.
    pub uncertainty_ppm: Option<f64>,
    /// Median distance of the least delay of a span from the line, s: a measure of the line's uncertainty.
    pub residual: f64,
    /// Median delay of a frame behind the line, s.
    pub delay: f64,
    /// Time from the first frame to the last, s of the bead.
    pub span: f64,
}

impl Fit {
    /// The line below points of bead and host time in s, the latter after an origin.
    pub(super) fn below(origin_ns: u64, points: &[(f64, f64)]) -> Option<Self> {
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

    /// Returns `true` if the frames came as fast as the bead's time passed. An emulated bead may run faster
    /// or slower, and a stream from a pipe comes at once: their times on the host say nothing about a
    /// crystal.
    pub fn in_real_time(&self) -> bool {
        self.uncertainty_ppm
            .is_none_or(|within| self.drift_ppm.abs() - within < CRYSTAL_PPM)
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

pub(super) fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}
