//! Variables of a descent.

use super::problem::Properties;
use super::search::Search;

/// Change of a variable to either side, for a difference quotient.
const STEP: f64 = 2e-3;

/// Variables of a descent, all of order one, for each entry of a design: the mass as a part of the total mass
/// for one host, and the logarithms of stiffness and, if it is free, damping.
pub(super) struct Variables<'a> {
    search: &'a Search,
    /// The total mass divided by the number of hosts, kg.
    each: f64,
    pub(super) bounds: Vec<(f64, f64)>,
}

impl<'a> Variables<'a> {
    pub(super) fn new(search: &'a Search, entries: usize) -> Self {
        let each = search.total_mass / search.hosts.len() as f64;
        let [stiffness, damping] = [search.stiffness, search.damping].map(|pair| pair.map(f64::ln));
        let bounds = [search.mass.map(|mass| mass / each), stiffness, damping];
        let bounds = bounds.map(|[low, high]| (low, high));
        let bounds = bounds[..Self::each_has(search)].repeat(entries);
        Self { search, each, bounds }
    }

    /// Number of variables of each entry.
    fn each_has(search: &Search) -> usize {
        if search.loss_factor.is_some() { 2 } else { 3 }
    }

    /// Returns the variables of a design, clamped to the bounds.
    pub(super) fn of(&self, design: &[Properties]) -> Vec<f64> {
        let count = Self::each_has(self.search);
        let of = |[mass, stiffness, damping]: &Properties| {
            let all = [mass / self.each, stiffness.ln(), damping.ln()];
            all.into_iter().take(count)
        };
        let free = design.iter().flat_map(of).zip(&self.bounds);
        free.map(|(value, (low, high))| value.clamp(*low, *high))
            .collect()
    }

    pub(super) fn design(&self, x: &[f64]) -> Vec<Properties> {
        let entry = |x: &[f64]| {
            let (mass, stiffness) = (x[0] * self.each, x[1].exp());
            let free = x.get(2).map_or(0.0, |damping| damping.exp());
            [mass, stiffness, self.search.damping_of([mass, stiffness, free])]
        };
        x.chunks_exact(Self::each_has(self.search)).map(entry).collect()
    }

    /// Returns the mass of a design's intruders above the bound, as a part of the bound; at most 0 within it.
    pub(super) fn overweight(&self, x: &[f64], gradient: Option<&mut [f64]>) -> f64 {
        let count = Self::each_has(self.search);
        let part = 1.0 / (x.len() / count) as f64;
        if let Some(gradient) = gradient {
            gradient.fill(0.0);
            gradient.iter_mut().step_by(count).for_each(|entry| *entry = part);
        }
        let excess = x.iter().step_by(count).sum::<f64>() * part - 1.0;
        // Rounding must not count, or the descent would not end.
        if excess.abs() < 1e-12 { 0.0 } else { excess }
    }

    /// Returns a pair of designs beside `x` for each variable, within the bounds, and their distance in it.
    pub(super) fn beside(&self, x: &[f64]) -> Vec<([Vec<f64>; 2], f64)> {
        let pair = |(index, (low, high)): (usize, &(f64, f64))| {
            let ends = [(x[index] - STEP).max(*low), (x[index] + STEP).min(*high)];
            let designs = ends.map(|end| {
                let mut beside = x.to_vec();
                beside[index] = end;
                beside
            });
            (designs, ends[1] - ends[0])
        };
        self.bounds.iter().enumerate().map(pair).collect()
    }
}
