//! Designs and the objective's value of each.

use std::cell::Cell;
use std::ops::ControlFlow;

use rayon::prelude::*;

use super::bounds::{Bounds, Properties, excess};
use super::design::{BeadRadius, Design, with_radii};
use super::error::OptimiseError;
use super::remaining::{Remaining, remaining, struck_at};
use super::search::{COARSE, Search};
use super::spread::deviating;
use crate::ensemble::{EnsembleOptions, Prefixes, ensemble_on};
use crate::oscillator::Oscillator;
use crate::scenario::{Intruder, Scenario};
use crate::simulate::{Accuracy, SimulateError};

/// Progress of a search.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct SearchProgress {
    /// Runs made, as [`Optimum::evaluations`](crate::Optimum::evaluations) counts them.
    pub evaluations: usize,
    /// The least value of the objective among them, as a part of that without intruders.
    pub best: Option<f64>,
    /// Exact gradients among them.
    pub gradients: usize,
    /// Descents begun.
    pub descents: usize,
}

/// Called often with the progress of a search, which ends with the best design so far if this returns
/// `Break`.
pub type SearchObserver<'a> = dyn Fn(SearchProgress) -> ControlFlow<()> + Sync + 'a;

/// A design and its value of the objective.
#[derive(Debug, Clone)]
pub(super) struct TriedDesign {
    pub(super) design: Design,
    pub(super) value: f64,
    /// Greatest overreach of its strokes; 0 if they keep their limits.
    pub(super) excess: f64,
    pub(super) settled: bool,
}

impl TriedDesign {
    /// A design that has not been tried.
    pub(super) fn untried(design: Design) -> Self {
        Self {
            design,
            value: f64::INFINITY,
            excess: f64::INFINITY,
            settled: false,
        }
    }

    /// Value that another design must beat; infinite if this one breaks a limit on strokes.
    pub(super) fn rival(&self) -> f64 {
        if self.excess == 0.0 {
            self.value
        } else {
            f64::INFINITY
        }
    }

    /// Compares two designs: limits on strokes go before the objective.
    pub(super) fn is_better_than(&self, other: &Self) -> bool {
        self.betters(other, 0.0)
    }

    /// Returns true if a change from `other` to this design is useful.
    pub(super) fn gains_on(&self, other: &Self) -> bool {
        self.betters(other, GAINED)
    }

    fn betters(&self, other: &Self, least: f64) -> bool {
        self.excess < other.excess || (self.excess == other.excess && self.value < other.value - least)
    }

    /// Replaces this design by a better one.
    pub(super) fn take(&mut self, found: Self) {
        if found.is_better_than(self) {
            *self = found;
        }
    }
}

/// Least useful gain, in the share.
pub(super) const GAINED: f64 = 1e-6;

/// Values of a design at every speed, for one corner of the spread after another.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct DesignValues {
    /// The objective as a part of that without intruders.
    pub(super) shares: Vec<f64>,
    /// The stroke of each host, m, if strokes have a limit.
    pub(super) strokes: Vec<f64>,
}

/// Stiffnesses of a ramp go from 1/RAMP at one end of the hosts to RAMP at the other.
const RAMP: f64 = 4.0;
/// Factors by which fresh starts differ from the best design, in turn.
const APART: [f64; 4] = [1.5, 2.0, 4.0, 3.0];
/// Bodies of the chains computed at once, between checks for a stop: 80 MB.
const TOGETHER: usize = 1 << 19;
/// Least designs computed at once, for any length of chain: enough to share the wave's way to the first host.
const LEAST_TOGETHER: usize = 16;

pub(super) struct Problem<'a> {
    pub(super) bare: Scenario,
    pub(super) hosts: Vec<usize>,
    pub(super) search: &'a Search,
    /// Bounds of every intruder.
    pub(super) bounds: Bounds,
    pub(super) speeds: Vec<f64>,
    /// The objective's value at each speed without intruders.
    pub(super) scales: Vec<f64>,
    /// Most evaluations.
    pub(super) most: Cell<usize>,
    pub(super) watch: Option<&'a SearchObserver<'a>>,
    /// Motion that designs have in common.
    pub(super) prefixes: Prefixes,
    /// Progress of the search.
    pub(super) sofar: Cell<SearchProgress>,
    /// True once the search was asked to stop.
    pub(super) stopped: Cell<bool>,
}

impl<'a> Problem<'a> {
    /// The problem of this search, and the objective's values without intruders.
    pub(super) fn new(
        scenario: &Scenario,
        search: &'a Search,
        watch: Option<&'a SearchObserver<'a>>,
    ) -> Result<Self, OptimiseError> {
        let mut hosts = search.hosts.clone();
        hosts.sort_unstable();
        let mut bare = scenario.clone();
        bare.intruders.clear();
        let speeds = search.strikes(scenario);
        let scales = speeds.iter().map(|&speed| search.objective.scale(&bare, speed));
        let scales = scales.collect::<Result<Vec<_>, _>>()?;
        Ok(Self {
            bare,
            hosts,
            search,
            bounds: search.bounds(),
            most: Cell::new(search.evaluations),
            speeds,
            scales,
            watch,
            prefixes: Prefixes::default(),
            sofar: Cell::default(),
            stopped: Cell::new(false),
        })
    }

    /// The problem of another search of the same strikes, which takes over the progress of this one.
    pub(super) fn on<'b>(&'b self, search: &'b Search) -> Problem<'b> {
        Problem {
            bare: self.bare.clone(),
            hosts: search.hosts.clone(),
            search,
            bounds: self.bounds,
            speeds: self.speeds.clone(),
            scales: self.scales.clone(),
            most: self.most.clone(),
            watch: self.watch,
            prefixes: Prefixes::default(),
            sofar: self.sofar.clone(),
            stopped: self.stopped.clone(),
        }
    }
}

impl Problem<'_> {
    /// Returns the radii of a design with the beads that have them.
    pub(super) fn radii(&self, design: &Design) -> Vec<BeadRadius> {
        let beads = self.search.sizes.iter().flat_map(|sizes| &sizes.beads);
        let radii = beads.zip(&design.radii);
        radii
            .map(|(&bead, &radius)| BeadRadius { bead, radius })
            .collect()
    }

    /// Returns the chain of a design without its intruders.
    pub(super) fn sized(&self, design: &Design) -> Scenario {
        with_radii(&self.bare, self.radii(design))
    }

    /// Returns the intruders of a design, all alike if it has one entry.
    pub(super) fn intruders(&self, design: &Design) -> Vec<Intruder> {
        let intruder = |(&bead, &[mass, stiffness, damping]): (&usize, &Properties)| {
            Intruder::new([bead], Oscillator::new(mass, stiffness, damping))
        };
        let hosts = self.hosts.iter().zip(design.intruders.iter().cycle());
        hosts.map(intruder).collect()
    }

    pub(super) fn strikes(
        &self,
        scenario: &Scenario,
        accuracy: Accuracy,
    ) -> Result<Vec<Remaining>, SimulateError> {
        let strikes = self.speeds.par_iter();
        strikes
            .map(|&speed| remaining(scenario, speed, accuracy))
            .collect()
    }

    /// Returns the objective's value for a scenario at each speed, at the reference accuracy, in its own
    /// unit.
    pub(super) fn values(&self, scenario: &Scenario) -> Result<Vec<f64>, SimulateError> {
        let objective = self.search.objective;
        let strikes = self.speeds.par_iter();
        strikes
            .map(|&speed| objective.at(scenario, speed, Accuracy::REFERENCE))
            .collect()
    }

    /// Tries designs, and finds their strokes if wanted. Returns the values of those tried before the search
    /// was asked to stop.
    pub(super) fn try_designs(
        &self,
        designs: &[Design],
        strokes: bool,
    ) -> Result<Vec<DesignValues>, SimulateError> {
        let objective = self.search.objective;
        let peaks = objective.peaks();
        let mut options = EnsembleOptions::default().with_peaks(&peaks);
        options.strokes = strokes;
        let corners = self.search.spread.corners();
        let runs = corners.len() * self.speeds.len();
        let bodies = runs * (self.bare.chain.beads + 1);
        let mut found = Vec::with_capacity(designs.len());
        for designs in designs.chunks((TOGETHER / bodies).max(LEAST_TOGETHER)) {
            if self.stopped.get() {
                break;
            }
            let mut scenarios = Vec::new();
            for design in designs {
                let (intruders, sized) = (self.intruders(design), self.sized(design));
                for &corner in &corners {
                    for &speed in &self.speeds {
                        let mut scenario = struck_at(&sized, speed);
                        scenario.intruders = deviating(&intruders, corner);
                        scenarios.push(scenario);
                    }
                }
            }
            let outcomes = ensemble_on(&scenarios, &options, &self.prefixes);
            let strikes = scenarios.iter().zip(self.scales.iter().cycle());
            let ends = outcomes
                .into_iter()
                .zip(strikes)
                .map(|(outcome, (struck, scale))| {
                    let outcome = outcome?;
                    let value = objective.of(struck, &outcome)?;
                    Ok((value / scale, outcome.strokes().to_vec()))
                });
            let ends = ends.collect::<Result<Vec<(f64, Vec<f64>)>, SimulateError>>()?;
            found.extend(ends.chunks(runs).map(|ends| DesignValues {
                shares: ends.iter().map(|(share, _)| *share).collect(),
                strokes: ends.iter().flat_map(|(_, strokes)| strokes).copied().collect(),
            }));
            let mut sofar = self.sofar.get();
            sofar.evaluations += designs.len();
            self.tell(sofar);
        }
        Ok(found)
    }

    /// Number of evaluations left.
    pub(super) fn left(&self) -> usize {
        let made = self.sofar.get().evaluations;
        self.most.get().saturating_sub(made)
    }

    /// Allows as many evaluations again as the search has.
    pub(super) fn renew(&self) {
        self.most
            .set(self.sofar.get().evaluations + self.search.evaluations);
    }

    /// Tries designs within the bounds of every intruder; those left out came after a request to stop.
    pub(super) fn tried(&self, designs: Vec<Design>) -> Result<Vec<TriedDesign>, SimulateError> {
        let values = self.try_designs(&designs, self.bounds.stroke.is_finite())?;
        let tried = values.iter().zip(designs);
        let tried = tried.map(|(values, design)| self.judged(design, values, &[self.bounds]));
        Ok(tried.collect())
    }

    /// Returns a design with these values; `bounds` has an entry for each host, or one for all.
    pub(super) fn judged(&self, design: Design, values: &DesignValues, bounds: &[Bounds]) -> TriedDesign {
        TriedDesign {
            design,
            value: self.search.value(&values.shares),
            excess: excess(&values.strokes, bounds),
            settled: false,
        }
    }

    /// Reports the progress of the search, and notes a request to stop.
    pub(super) fn tell(&self, sofar: SearchProgress) {
        self.sofar.set(sofar);
        if let Some(watch) = self.watch
            && watch(sofar).is_break()
        {
            self.stopped.set(true);
        }
    }

    /// Notes the share of a design if it is the best so far of those that keep their limits.
    pub(super) fn note(&self, share: f64, excess: f64) {
        let mut sofar = self.sofar.get();
        if excess == 0.0 && sofar.best.is_none_or(|best| share < best) {
            sofar.best = Some(share);
            self.sofar.set(sofar);
        }
    }

    /// Returns the best of a grid of designs with alike intruders, or of the part tried before a stop. If its
    /// strokes are what makes it the best, the one of least value follows.
    pub(super) fn coarse(&self) -> Result<Vec<TriedDesign>, SimulateError> {
        let search = self.search;
        let [masses, stiffnesses, dampings] = COARSE;
        let dampings = if search.loss_factor.is_some() { 1 } else { dampings };
        let heaviest = search.mass[1].min(search.total_mass / self.hosts.len() as f64);
        // Points between the bounds, without the ends.
        let inside = |[low, high]: [f64; 2], index: usize, count: usize| {
            low * (high / low).powf((index as f64 + 0.5) / count as f64)
        };
        let point = |index: usize| {
            let (i, rest) = (index / (stiffnesses * dampings), index % (stiffnesses * dampings));
            let mass = (heaviest * 0.5f64.powi(i as i32)).max(search.mass[0]);
            let stiffness = inside(search.stiffness, rest / dampings, stiffnesses);
            let damping = inside(search.damping, rest % dampings, dampings);
            Design {
                intruders: vec![self.bounds.tied([mass, stiffness, damping])],
                radii: search.own_radii(&self.bare),
            }
        };
        let tried = self.tried((0..masses * stiffnesses * dampings).map(point).collect())?;
        let least = |of: fn(&TriedDesign) -> (f64, f64)| {
            let compare = |a: &&TriedDesign, b: &&TriedDesign| {
                let (a, b) = (of(a), of(b));
                a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1))
            };
            let least = tried.iter().min_by(compare);
            least.expect("the first designs are tried before anybody can stop the search")
        };
        let best = least(|one| (one.excess, one.value));
        self.note(best.value, best.excess);
        let lowest = least(|one| (one.value, one.excess));
        let starts = [Some(best), (lowest.value < best.value).then_some(lowest)];
        Ok(starts.into_iter().flatten().cloned().collect())
    }

    /// Returns the design of these intruders and radii.
    pub(super) fn design_of(&self, intruders: &[Intruder], radii: &[BeadRadius]) -> Design {
        let entries = if self.search.alike { 1 } else { intruders.len() };
        let of = |intruder: &Intruder| [intruder.mass, intruder.stiffness, intruder.damping];
        Design {
            intruders: intruders[..entries].iter().map(of).collect(),
            radii: radii.iter().map(|one| one.radius).collect(),
        }
    }

    /// Returns the designs from which each intruder varies by itself.
    pub(super) fn starts(&self, alike: &TriedDesign) -> Vec<TriedDesign> {
        let middle = (self.hosts.len() - 1) as f64 / 2.0;
        let [low, high] = self.search.stiffness;
        let [mass, stiffness, damping] = alike.design.intruders[0];
        let start = |slope: f64| {
            let ramp = |index: usize| RAMP.powf(slope * (index as f64 - middle) / middle);
            let of_host = |index| [mass, (stiffness * ramp(index)).clamp(low, high), damping];
            let mut start = TriedDesign::untried(Design {
                intruders: (0..self.hosts.len()).map(of_host).collect(),
                radii: alike.design.radii.clone(),
            });
            if slope == 0.0 {
                (start.value, start.excess) = (alike.value, alike.excess);
            }
            start
        };
        [0.0, 1.0, -1.0].map(start).into()
    }

    /// Returns a design near the best by factors of up to one of [`APART`] that depend on `number` alone.
    pub(super) fn restart(&self, best: &TriedDesign, number: usize) -> TriedDesign {
        let apart = APART[number % APART.len()];
        let mut state = 0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(number as u64 + 1);
        let mut factor = || {
            // Xorshift.
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            let part = (state >> 11) as f64 / (1_u64 << 53) as f64;
            apart.powf(2.0 * part - 1.0)
        };
        let mut design = best.design.clone();
        let intruders = &mut design.intruders;
        intruders
            .iter_mut()
            .flatten()
            .for_each(|value| *value *= factor());
        let each = if intruders.len() == 1 { self.hosts.len() } else { 1 };
        let total = each as f64 * intruders.iter().map(|[mass, ..]| mass).sum::<f64>();
        let most = (self.search.total_mass / total).min(1.0);
        intruders.iter_mut().for_each(|[mass, ..]| *mass *= most);
        // A bead's mass goes as the cube of its radius.
        design
            .radii
            .iter_mut()
            .for_each(|radius| *radius *= factor().cbrt());
        TriedDesign::untried(design)
    }
}
