//! The search for the best intruders: designs a second, and its gradients beside plain runs.

use std::time::Instant;

use hertz_chain::{Chain, EnsembleOptions, Material, Scenario, Search, Striker, ensemble, optimise};

use crate::ensemble::ALONE;
use crate::report::{Aim, Measurements};

/// Designs a second and core by single runs at draft accuracy, without the ensemble.
const BEFORE: f64 = 190.0;
/// Designs of a gradient by differences to both sides of thirty variables.
const BY_DIFFERENCES: f64 = 61.0;

/// A strike on 60 elastic beads, as in `docs/scenarios/ten-intruders.toml`.
fn scenario() -> Scenario {
    let chain = Chain::new(60, 0.019, Material::BAKELITE);
    Scenario::new(0.011, chain, Striker::PAPER)
}

pub(crate) fn measure(report: &mut Measurements, quick: bool) {
    let scenario = scenario();
    let mut search = Search::new(&scenario, (7..=16).collect(), 0.037).expect("the search is sound");
    search.evaluations = if quick { 500 } else { 40_000 };
    let alone = &*ALONE;
    let clock = Instant::now();
    let found = alone
        .install(|| optimise(&scenario, &search, None))
        .expect("it runs");
    let seconds = clock.elapsed().as_secs_f64();
    let gradients = found.gradients as f64;
    let designs = (found.evaluations - Search::GRADIENT_RUNS * found.gradients) as f64;
    let rate = (designs + BY_DIFFERENCES * gradients) / seconds;
    let name = "optimise, ten intruders in 60 beads: designs a second and core, 61 for a gradient";
    report.goal(name, Some(rate), Aim::AtLeast(20.0 * BEFORE), "designs/s");

    let best = found.scenario(&scenario);
    let runs = if quick { 20 } else { 200 };
    let clock = Instant::now();
    for _ in 0..runs {
        let run = ensemble(std::slice::from_ref(&best), &EnsembleOptions::default());
        run[0].as_ref().expect("it runs");
    }
    let run = clock.elapsed().as_secs_f64() / f64::from(runs);
    let gradient = (seconds - designs * run) / gradients / run;
    let name = "its gradient by thirty variables, over a plain run by itself";
    report.goal(name, Some(gradient), Aim::AtMost(BY_DIFFERENCES / 5.0), "");
}
