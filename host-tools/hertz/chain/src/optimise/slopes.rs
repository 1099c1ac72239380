//! Exact derivatives of a design's values.

use super::design::Design;
use super::problem::{DesignValues, Problem};
use super::remaining::struck_at;
use super::search::Search;
use super::spread::deviating;
use crate::ensemble::{Prefixes, slopes_on};
use crate::model::Model;
use crate::scenario::Scenario;

/// Most beads of a chain whose steps are kept: a gigabyte if all of them move.
const MOST_BEADS: usize = 1000;

impl Problem<'_> {
    /// Tries a design, and returns its values and, to first order, those of the designs beside it. `None` if
    /// no derivatives can be had, or the search was stopped.
    pub(super) fn try_around(
        &self,
        here: &Design,
        beside: &[[Design; 2]],
    ) -> Option<(DesignValues, Vec<[DesignValues; 2]>)> {
        let (search, corners) = (self.search, self.search.spread.corners());
        // Radii change the motion that designs share, and the energy of beads that move at first.
        let (prefixes, sized) = (&Prefixes::default(), search.sizes.is_some());
        let prefixes = if sized { prefixes } else { &self.prefixes };
        let long = self.bare.chain.beads > MOST_BEADS;
        if self.stopped.get() || long || (sized && !self.bare.starts.is_empty()) {
            return None;
        }
        let of_corner = |design: &Design, corner| {
            let mut scenario = self.sized(design);
            scenario.intruders = deviating(&self.intruders(design), corner);
            scenario
        };
        let runs = corners.iter().flat_map(|&corner| {
            let scenario = of_corner(here, corner);
            let speeds = self.speeds.iter();
            speeds.map(move |&speed| struck_at(&scenario, speed))
        });
        let runs: Vec<Scenario> = runs.collect();
        let ends = |outcome: &_| search.objective.slopes(outcome);
        let found = slopes_on(&runs, &search.objective.peaks(), prefixes, &ends)?;
        let strikes = runs.iter().zip(self.scales.iter().cycle());
        let shares = found
            .iter()
            .zip(strikes)
            .map(|((outcome, _), (struck, scale))| Some(search.objective.of(struck, outcome).ok()? / scale));
        let values = DesignValues {
            shares: shares.collect::<Option<Vec<f64>>>()?,
            strokes: Vec::new(),
        };
        let at = |design: &Design| {
            let mut values = values.clone();
            let each = values.shares.chunks_mut(self.speeds.len());
            let of_runs = found.chunks(self.speeds.len());
            for ((shares, runs), &corner) in each.zip(of_runs).zip(&corners) {
                let to = Model::of(&of_corner(design, corner)).ok()?;
                for ((share, (outcome, slopes)), scale) in shares.iter_mut().zip(runs).zip(&self.scales) {
                    let change = slopes.change(outcome.model(), &to);
                    let direct = search
                        .objective
                        .change(&self.bare, outcome, [outcome.model(), &to]);
                    *share += (change + direct.ok()?) / scale;
                }
            }
            Some(values)
        };
        let beside = beside.iter().map(|[low, high]| Some([at(low)?, at(high)?]));
        let beside = beside.collect::<Option<Vec<_>>>()?;
        let mut sofar = self.sofar.get();
        sofar.evaluations += Search::GRADIENT_RUNS;
        sofar.gradients += 1;
        self.tell(sofar);
        Some((values, beside))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimise::variables::Variables;
    use crate::optimise::{Objective, Sizes, Spread};

    /// Half the distance of differences. A share is smooth to some 1e-7, which is 3e-5 of a derivative then,
    /// and bends by a few 1e-4.
    const STEP: f64 = 2e-3;

    /// With contacts that lose energy: without, a share bends too sharply where beads touch again.
    #[test]
    fn exact_derivatives_are_those_of_differences() {
        for objective in [
            Objective::Remaining,
            Objective::Force(11),
            Objective::EnergyBehind(10),
            Objective::Impulse(11),
        ] {
            let mut scenario = Scenario::paper();
            (scenario.chain.beads, scenario.chain.relaxation, scenario.duration) = (20, 4.2e-6, 0.004);
            let mut search = Search::new(&scenario, vec![7, 8, 11], 0.015).unwrap();
            let (beads, radius) = (vec![9, 10], [0.015, 0.022]);
            search.vary_sizes(&scenario, Sizes { beads, radius }).unwrap();
            (search.objective, search.speeds) = (objective, vec![0.3, 0.45]);
            search.spread = Spread::new(0.1, 0.0);
            let problem = Problem::new(&scenario, &search, None).unwrap();
            let variables = Variables::new(&search, &[problem.bounds], 3);
            let here = Design {
                intruders: vec![[0.004, 1e5, 4.0], [0.005, 2e5, 8.0], [0.0045, 3e5, 3.0]],
                radii: vec![0.017, 0.018],
            };
            let x = variables.of(&here);
            let beside = |at: usize, by: f64| {
                let mut x = x.clone();
                x[at] += by;
                variables.design(&x)
            };
            let pairs: Vec<[Design; 2]> = (0..x.len())
                .map(|at| [-STEP, STEP].map(|by| beside(at, by)))
                .collect();
            let (_, exact) = problem.try_around(&here, &pairs).unwrap();
            let tried = problem.try_designs(&pairs.concat(), false).unwrap();
            for (at, (exact, tried)) in exact.iter().zip(tried.chunks(2)).enumerate() {
                for run in 0..4 {
                    let slope =
                        |pair: &[DesignValues]| (pair[1].shares[run] - pair[0].shares[run]) / (2.0 * STEP);
                    let (exact, tried) = (slope(exact), slope(tried));
                    let off = (exact - tried).abs();
                    assert!(off < 5e-4, "{objective}, {at}, {run}: {exact} {tried}");
                }
            }
        }
    }
}
