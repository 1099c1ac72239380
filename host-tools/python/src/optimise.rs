//! Searches for the best intruders.

use std::path::PathBuf;

use hertz_chain::{Aim, Catalogue, Objective, Search, SearchProgress, Sizes, Spread, optimise as search_for};
use pyo3::prelude::*;

use crate::callback::Callback;
use crate::failure::{guarded, refused};
use crate::scenario::Scenario;

/// Searches, and returns the optimum as JSON with the scenario that has it. `callback` is called with the
/// number of designs tried, the least share so far or None, and the number of descents; the search ends if it
/// returns False.
#[pyfunction]
#[pyo3(signature = (scenario, hosts, total_mass, objective, loss_factor, stroke, catalogue, hosts_at_most, radii, spread, speeds, worst, alike, evaluations, callback))]
#[expect(
    clippy::too_many_arguments,
    reason = "the Python function in front of it names them"
)]
pub(crate) fn optimise(
    py: Python<'_>,
    scenario: &Scenario,
    hosts: Vec<usize>,
    total_mass: f64,
    objective: &str,
    loss_factor: Option<f64>,
    stroke: Option<f64>,
    catalogue: Option<PathBuf>,
    hosts_at_most: Option<usize>,
    radii: Option<(Vec<usize>, [f64; 2])>,
    spread: Option<&str>,
    speeds: Vec<f64>,
    worst: bool,
    alike: bool,
    evaluations: Option<usize>,
    callback: Option<Py<PyAny>>,
) -> PyResult<(String, Scenario)> {
    let mut search = Search::new(&scenario.0, hosts, total_mass).map_err(refused)?;
    search.objective = objective.parse::<Objective>().map_err(refused)?;
    search.loss_factor = loss_factor;
    search.stroke = stroke;
    search.catalogue = catalogue.map(Catalogue::load).transpose().map_err(refused)?;
    search.hosts_at_most = hosts_at_most;
    if let Some((beads, radius)) = radii {
        let sizes = Sizes { beads, radius };
        search.vary_sizes(&scenario.0, sizes).map_err(refused)?;
    }
    if let Some(spread) = spread {
        search.spread = spread.parse::<Spread>().map_err(refused)?;
    }
    search.speeds = speeds;
    search.alike = alike;
    if worst {
        search.aim = Aim::Worst;
    }
    if let Some(evaluations) = evaluations {
        search.evaluations = evaluations;
    }
    let callback = Callback::new(callback);
    let watch =
        |progress: SearchProgress| callback.call((progress.evaluations, progress.best, progress.descents));
    let found = guarded(py, || search_for(&scenario.0, &search, Some(&watch)))?;
    callback.result()?;
    let optimum = found.map_err(refused)?;
    let json = serde_json::to_string(&optimum).map_err(refused)?;
    Ok((json, optimum.scenario(&scenario.0).into()))
}
