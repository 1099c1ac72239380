//! One run with its observables in arrays.

use std::ops::ControlFlow;
use std::time::Instant;

use hertz_chain::{Accuracy, Model, Run, Snapshot, Snapshots, Summariser};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::failure::{ScenarioError, guarded, refused};
use crate::scenario::Scenario;

/// Steps times bodies between two looks for Ctrl-C: some milliseconds.
const STEPS: u64 = 1 << 16;
/// Most values in the arrays of a run: 16 GB.
const MOST: f64 = 2e9;

type ValueAt = fn(&Snapshot<'_>, usize) -> f64;

/// A quantity over time, for each of a number of bodies, contacts or intruders.
struct Observable {
    name: &'static str,
    /// Values at a time; `None` for a single one, which has no second axis.
    width: Option<usize>,
    /// Its value for one of them, counted from 0.
    of: ValueAt,
    values: Vec<f64>,
}

/// The observables of these names, in the order of the names.
fn observables(names: &[String], model: &Model) -> PyResult<Vec<Observable>> {
    let (bodies, contacts, intruders) = (model.bodies(), model.contacts(), model.intruders().len());
    let known: [(&'static str, Option<usize>, ValueAt); 13] = [
        ("displacement", Some(bodies), |s, body| s.displacement(body)),
        ("velocity", Some(bodies), |s, body| s.velocity(body)),
        ("force", Some(contacts), |s, before| s.force(before + 1)),
        ("intruder_displacement", Some(intruders), |s, n| {
            s.motion_of(n).displacement
        }),
        ("intruder_velocity", Some(intruders), |s, n| {
            s.motion_of(n).velocity
        }),
        ("intruder_acceleration", Some(intruders), |s, n| {
            s.motion_of(n).acceleration
        }),
        ("intruder_dissipated", Some(intruders), |s, n| s.dissipated_by(n)),
        ("striker_energy", None, |s, _| s.energies().striker),
        ("chain_energy", None, |s, _| s.energies().chain),
        ("intruders_energy", None, |s, _| s.energies().intruders),
        ("dissipated_contacts", None, |s, _| {
            s.energies().dissipated_contacts
        }),
        ("dissipated_intruders", None, |s, _| {
            s.energies().dissipated_intruders
        }),
        ("dissipated_ground", None, |s, _| s.energies().dissipated_ground),
    ];
    let find = |name: &String| {
        let found = known.iter().find(|(known, ..)| known == name);
        let &(name, width, of) = found.ok_or_else(|| {
            let names: Vec<_> = known.iter().map(|(name, ..)| *name).collect();
            ScenarioError::new_err(format!(
                "{name:?} is not an observable; give some of {}",
                names.join(", ")
            ))
        })?;
        Ok(Observable {
            name,
            width,
            of,
            values: Vec::new(),
        })
    };
    names.iter().map(find).collect()
}

/// Runs a scenario. Returns `time`, the observables by name, `bodies`, `contacts` and `intruders` (the
/// beads), `seconds` that the integration took, and `summary`, a JSON text.
#[pyfunction]
#[pyo3(signature = (scenario, rate, observables, tolerance, longest_step))]
pub(crate) fn simulate<'py>(
    py: Python<'py>,
    scenario: &Scenario,
    rate: f64,
    observables: Vec<String>,
    tolerance: f64,
    longest_step: f64,
) -> PyResult<Bound<'py, PyDict>> {
    let accuracy = Accuracy::new(tolerance, longest_step);
    let (scenario, end) = (&scenario.0, scenario.0.duration);
    let mut run = Run::new(scenario, accuracy).map_err(refused)?;
    run.check(end, longest_step).map_err(refused)?;
    let mut wanted = self::observables(&observables, run.model())?;
    let width: usize = wanted.iter().map(|one| one.width.unwrap_or(1)).sum();
    let rows = end * rate;
    if !(rate > 0.0 && rows >= 1.0 && rows * width.max(1) as f64 <= MOST) {
        return Err(ScenarioError::new_err(format!(
            "rate = {rate:?} gives {rows:?} times over {end} s, of {width} values each; give a rate in Hz, such as 1e6, \
             that makes at least one time and at most {MOST:e} values"
        )));
    }
    let model = run.model();
    let hosts: Vec<usize> = model.intruders().iter().map(|intruder| intruder.bead).collect();
    let (bodies, contacts) = (model.bodies(), model.contacts());
    // A run that is too large for the memory is refused here, and not by an abort in its middle.
    let room = |width: usize| {
        let mut values: Vec<f64> = Vec::new();
        let enough = values.try_reserve_exact((rows as usize + 2) * width);
        enough.map(|()| values).map_err(|_| {
            PyMemoryError::new_err(format!(
                "{rows:.0} times of {width} values do not fit into memory; lower the rate"
            ))
        })
    };
    let mut times = room(1)?;
    for one in &mut wanted {
        one.values = room(one.width.unwrap_or(1))?;
    }
    let look_after = (STEPS / (bodies as u64 + 1)).max(1);
    let started = Instant::now();
    let ran = guarded(py, || {
        let mut summariser = Summariser::new(&mut run);
        let mut snapshots = Snapshots::new(&mut run, rate, end);
        let ran = run.watch_while(end, |step| {
            summariser.observe(step);
            snapshots.observe(step, |snapshot| {
                times.push(snapshot.time());
                for one in &mut wanted {
                    let values = (0..one.width.unwrap_or(1)).map(|place| (one.of)(snapshot, place));
                    one.values.extend(values);
                }
            });
            if step.number().is_multiple_of(look_after)
                && let Err(interrupted) = Python::attach(|py| py.check_signals())
            {
                return ControlFlow::Break(interrupted);
            }
            ControlFlow::Continue(())
        });
        ran.map(|ran| (ran, summariser.summary(&mut run)))
    });
    let seconds = started.elapsed().as_secs_f64();
    let (ran, summary) = ran?.map_err(refused)?;
    if let ControlFlow::Break(interrupted) = ran {
        return Err(interrupted);
    }
    let result = PyDict::new(py);
    let count = times.len();
    result.set_item("time", PyArray1::from_vec(py, times))?;
    let arrays = PyDict::new(py);
    for one in wanted {
        let array = PyArray1::from_vec(py, one.values);
        match one.width {
            Some(width) => arrays.set_item(one.name, array.reshape([count, width])?)?,
            None => arrays.set_item(one.name, array)?,
        }
    }
    result.set_item("observables", arrays)?;
    result.set_item("seconds", seconds)?;
    result.set_item("bodies", bodies)?;
    result.set_item("contacts", contacts)?;
    result.set_item("intruders", hosts)?;
    let json = serde_json::to_string(&summary).map_err(refused)?;
    result.set_item("summary", json)?;
    Ok(result)
}
