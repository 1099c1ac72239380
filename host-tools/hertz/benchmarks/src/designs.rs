//! The search for the best intruders: designs a second.

use std::time::Instant;

use hertz_chain::{Chain, Material, Scenario, Search, Striker, optimise};

use crate::report::Measurements;

/// Designs a second and core by single runs at draft accuracy, without the ensemble.
const BEFORE: f64 = 190.0;

/// A strike on 60 elastic beads, as in `docs/scenarios/ten-intruders.toml`.
fn scenario() -> Scenario {
    let chain = Chain::new(60, 0.019, Material::BAKELITE);
    Scenario::new(0.011, chain, Striker::PAPER)
}

pub(crate) fn measure(report: &mut Measurements, quick: bool) {
    let scenario = scenario();
    let mut search = Search::new(&scenario, (7..=16).collect(), 0.037).expect("the search is sound");
    search.evaluations = if quick { 5_000 } else { 40_000 };
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let alone = alone.expect("a thread can be had");
    let once = |_| {
        let clock = Instant::now();
        let found = alone
            .install(|| optimise(&scenario, &search, None))
            .expect("it runs");
        found.evaluations as f64 / clock.elapsed().as_secs_f64()
    };
    let rate = (0..if quick { 1 } else { 3 }).map(once).fold(0.0, f64::max);
    let name = "optimise, ten intruders in 60 beads: designs a second and core";
    report.at_least(name, Some(rate), 20.0 * BEFORE, "designs/s");
}
