//! Motions that repeat with their drive, and branches of them.

use hertz_chain::{
    Bifurcation, Branch, BranchOptions, BranchPoint, Complex64, DriveParameter, PeriodExtremes, PeriodicState,
};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::callback::Callback;
use crate::failure::{guarded, refused};
use crate::scenario::Scenario;

/// Finds a motion that repeats, and follows it along a parameter of the drive if there is one to follow.
/// Returns arrays with a row for each motion: `amplitude`, `frequency` (Hz), `stable`, `residual`,
/// `multipliers`, `force_min` and `force_max` (N), `speed_max` (m/s), `stroke_max` (m), and `bifurcation`, a
/// list; `end` says why a branch ends. `callback` is called with the parameter of each point; the branch ends
/// if it returns False.
#[pyfunction]
#[pyo3(signature = (scenario, along, to, back, points, callback))]
pub(crate) fn periodic<'py>(
    py: Python<'py>,
    scenario: &Scenario,
    along: Option<&str>,
    to: Option<f64>,
    back: Option<f64>,
    points: usize,
    callback: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let parameter = along.map(str::parse::<DriveParameter>).transpose();
    let parameter = parameter.map_err(|text| refused(format_args!("along: {text}")))?;
    if parameter.is_some() != to.is_some() {
        return Err(refused(
            "along: give it together with to=, the value to go to, or neither",
        ));
    }
    let start = guarded(py, || PeriodicState::of(&scenario.0))?.map_err(refused)?;
    let Some((parameter, to)) = parameter.zip(to) else {
        return rows(py, &[(&start, None)], None);
    };
    let mut options = BranchOptions::default();
    (options.points, options.back) = (points, back);
    let callback = Callback::new(callback);
    let watch = |point: &BranchPoint| callback.call((point.value,));
    let branch = guarded(py, || Branch::follow(start, parameter, to, &options, watch))?;
    callback.result()?;
    let branch = branch.map_err(refused)?;
    let points = branch.points.iter();
    let points: Vec<_> = points.map(|point| (&point.state, point.bifurcation)).collect();
    rows(py, &points, Some(branch.end.name()))
}

/// Arrays with a row for each motion.
fn rows<'py>(
    py: Python<'py>,
    motions: &[(&PeriodicState, Option<Bifurcation>)],
    end: Option<&str>,
) -> PyResult<Bound<'py, PyDict>> {
    let states = || motions.iter().map(|(state, _)| *state);
    let extremes = || {
        states()
            .map(PeriodicState::extremes)
            .collect::<Result<Vec<_>, _>>()
    };
    let extremes = guarded(py, extremes)?.map_err(refused)?;
    let count = motions.len();
    let result = PyDict::new(py);
    let table = |name: &str, of: fn(&PeriodExtremes) -> Vec<f64>| {
        let values: Vec<f64> = extremes.iter().flat_map(of).collect();
        let width = values.len() / count;
        result.set_item(name, PyArray1::from_vec(py, values).reshape([count, width])?)
    };
    table("force_min", |one| {
        one.forces.iter().map(|force| force[0]).collect()
    })?;
    table("force_max", |one| {
        one.forces.iter().map(|force| force[1]).collect()
    })?;
    table("speed_max", |one| one.speeds.clone())?;
    table("stroke_max", |one| one.strokes.clone())?;
    let column = |name: &str, of: &dyn Fn(&PeriodicState) -> f64| {
        result.set_item(name, PyArray1::from_vec(py, states().map(of).collect()))
    };
    let drive = |parameter: DriveParameter| {
        move |state: &PeriodicState| parameter.value(state.scenario()).unwrap_or(f64::NAN)
    };
    column("amplitude", &drive(DriveParameter::Amplitude))?;
    column("frequency", &drive(DriveParameter::Frequency))?;
    column("residual", &PeriodicState::residual)?;
    let multipliers: Vec<Complex64> = states().flat_map(|state| state.multipliers().to_vec()).collect();
    let width = multipliers.len() / count;
    let multipliers = PyArray1::from_vec(py, multipliers).reshape([count, width])?;
    result.set_item("multipliers", multipliers)?;
    let stable = states().map(PeriodicState::is_stable).collect();
    result.set_item("stable", PyArray1::from_vec(py, stable))?;
    let names = motions
        .iter()
        .map(|(_, bifurcation)| bifurcation.map(Bifurcation::name));
    result.set_item("bifurcation", PyList::new(py, names)?)?;
    result.set_item("end", end)?;
    Ok(result)
}
