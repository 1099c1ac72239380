//! Exceptions: the one line that the command line prints, as Python's.

use hertz_chain::{InputError, SimulateError};
use pyo3::create_exception;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

create_exception!(
    hertz_chain,
    ScenarioError,
    PyValueError,
    "A scenario, a sweep or a search that cannot be used: what is wrong, and what would do."
);
create_exception!(
    hertz_chain,
    RecordingError,
    PyValueError,
    "A recording that cannot be read, or that lacks what was asked for."
);

/// The exception of an input that is refused.
pub(crate) fn refused(error: &InputError) -> PyErr {
    ScenarioError::new_err(error.to_string())
}

/// The exception of a run that cannot go on.
pub(crate) fn failed(error: &SimulateError) -> PyErr {
    ScenarioError::new_err(error.to_string())
}
