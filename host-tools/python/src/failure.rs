//! Exceptions: the one line that the command line prints, as Python's.

use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};

use pyo3::create_exception;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

use crate::forked;

create_exception!(
    hertz_chain,
    ScenarioError,
    PyValueError,
    "A scenario, a sweep or a search that cannot be used. The message says what is wrong and what to give instead."
);
create_exception!(
    hertz_chain,
    RecordingError,
    PyValueError,
    "A recording that cannot be read, or that lacks what was asked for."
);

/// The exception of a scenario, a sweep, a search or a run that is refused.
pub(crate) fn refused(error: impl Display) -> PyErr {
    ScenarioError::new_err(error.to_string())
}

/// Runs a function while other threads of Python run. A panic in it is a fault of this package, and becomes
/// an exception that a program can catch, with the place that the panic printed.
pub(crate) fn guarded<T: Send>(py: Python<'_>, run: impl FnOnce() -> T + Send) -> PyResult<T> {
    let ran = py.detach(|| catch_unwind(AssertUnwindSafe(|| forked::on_threads(run))));
    ran.map_err(|panic| {
        let text = panic.downcast_ref::<String>().cloned();
        let text = text.or_else(|| panic.downcast_ref::<&str>().map(|text| (*text).to_owned()));
        PyRuntimeError::new_err(format!(
            "hertz_chain has a fault: {}; please report it with the call that caused it",
            text.unwrap_or_default()
        ))
    })
}
