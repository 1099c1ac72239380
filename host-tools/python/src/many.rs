//! Many chains at once, on all cores: ensembles and sweeps.

use hertz_chain::{EnsembleOptions, EnsembleOutcome, ensemble as run_all};
use hertz_sweep::compute::compute;
use hertz_sweep::definition::Definition;
use hertz_sweep::plan::Plan;
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::failure::{ScenarioError, guarded, refused};
use crate::scenario::{Scenario, table};
use crate::table::Columns;

/// Bodies of the chains that run between two looks for Ctrl-C: a fraction of a second.
const BODIES: usize = 1 << 17;
/// Most points of a sweep in memory; `bead sweep` writes more to a file.
const MOST_POINTS: u64 = 50_000_000;

/// Chains in a chunk that holds about `BODIES` bodies.
fn together(beads: usize) -> usize {
    (BODIES / (beads + 1)).clamp(64, 8192)
}

/// Runs all scenarios, each over its duration, and returns arrays in their order: `absorbed`, `injected`,
/// `striker_energy` (J), with `peaks` `peak_force` (N) and `peak_time` (s) of each contact, and `error`, a
/// text or None.
#[pyfunction]
#[pyo3(signature = (scenarios, peaks, progress))]
pub(crate) fn ensemble<'py>(
    py: Python<'py>,
    scenarios: Vec<Bound<'py, Scenario>>,
    peaks: Vec<usize>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let all: Vec<_> = scenarios.iter().map(|one| one.get().0.clone()).collect();
    let most = all.iter().map(|one| one.chain.beads).max().unwrap_or(1);
    let contacts = all
        .iter()
        .map(|one| one.chain.beads + usize::from(one.wall.is_some()));
    let contacts = contacts.max().unwrap_or(0);
    if let Some(contact) = peaks.iter().find(|contact| !(1..=contacts).contains(*contact)) {
        return Err(ScenarioError::new_err(format!(
            "peaks: no scenario has a contact {contact}; the contacts are 1 to {contacts}"
        )));
    }
    let options = EnsembleOptions::default().with_peaks(&peaks);
    let count = all.len();
    let mut numbers: [Vec<f64>; 3] = Default::default();
    let [mut forces, mut times] = [0, 1].map(|_| vec![f64::NAN; count * peaks.len()]);
    let mut errors = Vec::with_capacity(count);
    for (chunk, scenarios) in all.chunks(together(most)).enumerate() {
        let outcomes = guarded(py, || run_all(scenarios, &options))?;
        for outcome in outcomes {
            let place = errors.len() * peaks.len();
            let mut values = [f64::NAN; 3];
            if let Ok(outcome) = &outcome {
                let striker = outcome.model().striker_energy();
                values = [outcome.absorbed(), outcome.injected(), striker];
                peaks_of(outcome, &peaks, &mut forces[place..], &mut times[place..]);
            }
            for (to, value) in numbers.iter_mut().zip(values) {
                to.push(value);
            }
            errors.push(outcome.err().map(|error| error.to_string()));
        }
        py.check_signals()?;
        if let Some(progress) = &progress {
            let done = ((chunk + 1) * together(most)).min(count);
            progress.call1((done as f64 / count as f64,))?;
        }
    }
    let result = PyDict::new(py);
    for (name, values) in ["absorbed", "injected", "striker_energy"]
        .into_iter()
        .zip(numbers)
    {
        result.set_item(name, PyArray1::from_vec(py, values))?;
    }
    for (name, values) in [("peak_force", forces), ("peak_time", times)] {
        let array = PyArray1::from_vec(py, values).reshape([count, peaks.len()])?;
        result.set_item(name, array)?;
    }
    result.set_item("error", PyList::new(py, errors)?)?;
    Ok(result)
}

/// The greatest force of each of these contacts, and when, for one chain.
fn peaks_of(outcome: &EnsembleOutcome, contacts: &[usize], forces: &mut [f64], times: &mut [f64]) {
    for (at, contact) in contacts.iter().enumerate() {
        if let Some(peak) = outcome.peaks().iter().find(|peak| peak.contact == *contact) {
            (forces[at], times[at]) = (peak.force, peak.time);
        }
    }
}

/// Runs the points of a sweep, which is a file (`path`), or tables in JSON. Returns `columns` and, axis by
/// axis, `axes`: the name of its index and its columns.
#[pyfunction]
#[pyo3(signature = (path, json, progress))]
pub(crate) fn sweep<'py>(
    py: Python<'py>,
    path: Option<std::path::PathBuf>,
    json: Option<&str>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let definition = match (path, json) {
        (Some(path), _) => Definition::load(&path),
        (None, json) => Definition::from_toml(&table(json.unwrap_or("{}"))?.to_string(), "sweep"),
    };
    let plan = definition.and_then(Plan::new).map_err(refused)?;
    let points = plan.points();
    if points > MOST_POINTS {
        return Err(ScenarioError::new_err(format!(
            "{points} points do not fit into memory, only {MOST_POINTS} do; use `bead sweep`, which writes to a file"
        )));
    }
    // Along an axis chains may become longer.
    let beads = |point: u64| plan.scenario(point).map_or(1, |scenario| scenario.chain.beads);
    let beads = beads(0).max(beads(points - 1));
    let mut columns = Columns::new(plan.columns());
    let mut from = 0;
    while from < points {
        let to = points.min(from + together(beads) as u64);
        let computed = guarded(py, || {
            compute(&plan, from..to, &|_| (), |row| {
                columns.push(row);
                Ok(())
            })
        });
        computed?.map_err(refused)?;
        from = to;
        py.check_signals()?;
        if let Some(progress) = &progress {
            progress.call1((from as f64 / points as f64,))?;
        }
    }
    let axes = plan.axes().iter().map(|axis| {
        let along = axis.along.iter().map(|along| along.key.column());
        (axis.index(), along.collect::<Vec<_>>(), axis.count)
    });
    let result = PyDict::new(py);
    result.set_item("axes", PyList::new(py, axes.collect::<Vec<_>>())?)?;
    result.set_item("columns", columns.into_dict(py)?)?;
    Ok(result)
}
