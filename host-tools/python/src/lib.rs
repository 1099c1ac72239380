#![doc = include_str!("../README.md")]

mod callback;
mod compare;
mod estimator;
mod failure;
mod forked;
mod identify;
mod many;
mod optimise;
mod periodic;
mod recording;
mod scenario;
mod simulation;
mod table;

use pyo3::prelude::*;

/// The compiled part of the package. Its public face is `python/hertz_chain`.
#[pymodule]
fn _hertz_chain(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    forked::note_process();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("ScenarioError", py.get_type::<failure::ScenarioError>())?;
    module.add("RecordingError", py.get_type::<failure::RecordingError>())?;
    module.add_class::<scenario::Scenario>()?;
    module.add_class::<recording::Recording>()?;
    module.add_class::<estimator::Estimator>()?;
    module.add_function(wrap_pyfunction!(simulation::simulate, module)?)?;
    module.add_function(wrap_pyfunction!(many::ensemble, module)?)?;
    module.add_function(wrap_pyfunction!(many::sweep, module)?)?;
    module.add_function(wrap_pyfunction!(optimise::optimise, module)?)?;
    module.add_function(wrap_pyfunction!(periodic::periodic, module)?)?;
    Ok(())
}
