//! Variables of a descent, between the bounds of a design.

use super::bounds::{Bounds, Properties};
use super::design::Design;
use super::search::Search;

/// Change of a variable to either side, for a difference quotient.
const STEP: f64 = 2e-3;

/// Variables of a descent, all of order one, for each entry of a design: the mass as a part of the total mass
/// for one host, and the logarithms of stiffness and damping. Values that are fixed or tied have none. The
/// logarithms of the radii that vary follow.
pub(super) struct Variables {
    /// Bounds of each entry.
    entries: Vec<Bounds>,
    /// The total mass divided by the number of hosts, kg.
    each: f64,
    /// Entry and property of each variable.
    free: Vec<(usize, usize)>,
    /// Least and greatest radius, m, of the beads whose sizes vary.
    radius: [f64; 2],
    /// Least and greatest value of each variable.
    pub(super) bounds: Vec<(f64, f64)>,
}

const MASS: usize = 0;
const DAMPING: usize = 2;

impl Variables {
    /// The variables of designs with this number of entries, within `bounds`: one for each entry or for all.
    pub(super) fn new(search: &Search, bounds: &[Bounds], entries: usize) -> Self {
        let entries: Vec<Bounds> = bounds.iter().copied().cycle().take(entries).collect();
        let each = search.total_mass / search.hosts.len() as f64;
        let (mut free, mut limits) = (Vec::new(), Vec::new());
        for (entry, bounds) in entries.iter().enumerate() {
            for (property, pair) in bounds.properties.into_iter().enumerate() {
                let tied = property == DAMPING && bounds.loss_factor.is_some();
                if tied || pair[0] == pair[1] {
                    continue;
                }
                let [low, high] = pair.map(|value| variable(each, property, value));
                free.push((entry, property));
                limits.push((low, high));
            }
        }
        let sizes = search.sizes.iter().flat_map(|sizes| {
            let [low, high] = sizes.radius.map(f64::ln);
            std::iter::repeat_n((low, high), sizes.beads.len())
        });
        limits.extend(sizes);
        Self {
            entries,
            each,
            free,
            radius: search.sizes.as_ref().map_or([0.0; 2], |sizes| sizes.radius),
            bounds: limits,
        }
    }

    /// Returns the variables of a design, clamped to the bounds.
    pub(super) fn of(&self, design: &Design) -> Vec<f64> {
        let of = |&(entry, property): &(usize, usize)| {
            variable(self.each, property, design.intruders[entry][property])
        };
        let values = self
            .free
            .iter()
            .map(of)
            .chain(design.radii.iter().map(|radius| radius.ln()));
        let clamped = values.zip(&self.bounds);
        clamped
            .map(|(value, &(low, high))| value.clamp(low, high))
            .collect()
    }

    /// Returns the design of these variables.
    pub(super) fn design(&self, x: &[f64]) -> Design {
        let fixed = |bounds: &Bounds| bounds.properties.map(|[low, _]| low);
        let mut design: Vec<Properties> = self.entries.iter().map(fixed).collect();
        for (&(entry, property), &x) in self.free.iter().zip(x) {
            design[entry][property] = if property == MASS { x * self.each } else { x.exp() };
        }
        let entries = design.into_iter().zip(&self.entries);
        Design {
            intruders: entries.map(|(entry, bounds)| bounds.tied(entry)).collect(),
            // The exponential of a logarithm may miss its bound by a bit.
            radii: x[self.free.len()..]
                .iter()
                .map(|x| x.exp().clamp(self.radius[0], self.radius[1]))
                .collect(),
        }
    }

    /// Returns the mass of a design's intruders above the bound, as a part of the bound; at most 0 within it.
    pub(super) fn overweight(&self, x: &[f64], gradient: Option<&mut [f64]>) -> f64 {
        let part = 1.0 / self.entries.len() as f64;
        let is_mass = |&(_, property): &(usize, usize)| property == MASS;
        if let Some(gradient) = gradient {
            for (entry, free) in gradient.iter_mut().zip(&self.free) {
                *entry = if is_mass(free) { part } else { 0.0 };
            }
        }
        let fixed = self.entries.iter().map(|bounds| bounds.properties[MASS]);
        let fixed = fixed
            .filter(|[low, high]| low == high)
            .map(|[mass, _]| mass / self.each);
        let masses = x.iter().zip(&self.free).filter(|(_, free)| is_mass(free));
        let total = masses.map(|(mass, _)| mass).sum::<f64>() + fixed.fold(0.0, |sum, mass| sum + mass);
        let excess = total * part - 1.0;
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

fn variable(each: f64, property: usize, value: f64) -> f64 {
    if property == MASS {
        value / each
    } else {
        value.ln()
    }
}
