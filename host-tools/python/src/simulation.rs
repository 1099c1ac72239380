//! One run with its observables in arrays.

use std::ops::ControlFlow;
use std::time::Instant;

use hertz_chain::{Accuracy, Model, Run, Snapshot, Snapshots, Summariser};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::failure::{ScenarioError, failed, guarded};
use crate::scenario::Scenario;

/// Steps times bodies between two looks for Ctrl-C: some milliseconds.
const STEPS: u64 = 1 << 16;
/// Most values in the arrays of a run: 16 GB.
const MOST: f64 = 2e9;

/// A quantity over time, for each of a number of bodies, contacts or intruders.
struct Observable {
    name: &'static str,
    /// Values at a time; `None` for one alone, which has no second axis.
    width: Option<usize>,
    append: fn(&Snapshot<'_>, &mut Vec<f64>),
    values: Vec<f64>,
}

/// The observables of these names, in the order of the names.
fn observables(names: &[String], model: &Model) -> PyResult<Vec<Observable>> {
    let (bodies, contacts, intruders) = (model.bodies(), model.contacts(), model.intruders().len());
    type Append = fn(&Snapshot<'_>, &mut Vec<f64>);
    let known: [(&'static str, Option<usize>, Append); 13] = [
        ("displacement", Some(bodies), |s, to| {
            to.extend((0..s.model().bodies()).map(|body| s.displacement(body)));
        }),
        ("velocity", Some(bodies), |s, to| {
            to.extend((0..s.model().bodies()).map(|body| s.velocity(body)));
        }),
        ("force", Some(contacts), |s, to| {
            to.extend((1..=s.model().contacts()).map(|contact| s.force(contact)));
        }),
        ("intruder_displacement", Some(intruders), |s, to| {
            each(s, to, |s, number| s.motion_of(number).displacement);
        }),
        ("intruder_velocity", Some(intruders), |s, to| {
            each(s, to, |s, number| s.motion_of(number).velocity);
        }),
        ("intruder_acceleration", Some(intruders), |s, to| {
            each(s, to, |s, number| s.motion_of(number).acceleration);
        }),
        ("intruder_dissipated", Some(intruders), |s, to| {
            each(s, to, |s, number| s.dissipated_by(number));
        }),
        ("striker_energy", None, |s, to| to.push(s.energies().striker)),
        ("chain_energy", None, |s, to| to.push(s.energies().chain)),
        ("intruders_energy", None, |s, to| to.push(s.energies().intruders)),
        ("dissipated_contacts", None, |s, to| {
            to.push(s.energies().dissipated_contacts);
        }),
        ("dissipated_intruders", None, |s, to| {
            to.push(s.energies().dissipated_intruders);
        }),
        ("dissipated_ground", None, |s, to| {
            to.push(s.energies().dissipated_ground);
        }),
    ];
    let find = |name: &String| {
        let found = known.iter().find(|(known, ..)| known == name);
        let (name, width, append) = found.ok_or_else(|| {
            let names: Vec<_> = known.iter().map(|(name, ..)| *name).collect();
            ScenarioError::new_err(format!(
                "{name:?} is no observable; give some of {}",
                names.join(", ")
            ))
        })?;
        Ok(Observable {
            name,
            width: *width,
            append: *append,
            values: Vec::new(),
        })
    };
    names.iter().map(find).collect()
}

/// A quantity of each intruder, in the order of the beads.
fn each(s: &Snapshot<'_>, to: &mut Vec<f64>, of: fn(&Snapshot<'_>, usize) -> f64) {
    to.extend((0..s.model().intruders().len()).map(|number| of(s, number)));
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
    let mut run = Run::new(scenario, accuracy).map_err(|error| failed(&error))?;
    run.check(end, longest_step).map_err(|error| failed(&error))?;
    let mut wanted = self::observables(&observables, run.model())?;
    let width: usize = wanted.iter().map(|one| one.width.unwrap_or(1)).sum();
    let rows = end * rate;
    if !(rate > 0.0 && rows >= 1.0 && rows * width.max(1) as f64 <= MOST) {
        return Err(ScenarioError::new_err(format!(
            "rate = {rate:?} gives {rows:?} times over {end} s, of {width} values each; give a rate in Hz, such as 1e6, \
             that makes one time at least and {MOST:e} values at most"
        )));
    }
    let hosts: Vec<usize> = run
        .model()
        .intruders()
        .iter()
        .map(|intruder| intruder.bead)
        .collect();
    let (bodies, contacts) = (run.model().bodies(), run.model().contacts());
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
                    (one.append)(snapshot, &mut one.values);
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
    let (ran, summary) = ran?.map_err(|error| failed(&error))?;
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
    let json = serde_json::to_string(&summary).map_err(|error| ScenarioError::new_err(error.to_string()))?;
    result.set_item("summary", json)?;
    Ok(result)
}
