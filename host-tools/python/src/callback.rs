//! Functions of Python that watch long work, and may end it.

use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};

use pyo3::call::PyCallArgs;
use pyo3::prelude::*;
use pyo3::types::PyBool;

/// A function that is called during work on another thread. The work ends if it returns False or fails, or at
/// Ctrl-C.
pub(crate) struct Callback {
    function: Option<Py<PyAny>>,
    failure: Mutex<Option<PyErr>>,
}

impl Callback {
    pub(crate) fn new(function: Option<Py<PyAny>>) -> Self {
        let failure = Mutex::new(None);
        Self { function, failure }
    }

    /// Calls the function, if there is one.
    pub(crate) fn call(&self, arguments: impl for<'py> PyCallArgs<'py>) -> ControlFlow<()> {
        let goes_on = Python::attach(|py| {
            py.check_signals()?;
            let Some(function) = &self.function else {
                return Ok(true);
            };
            let answer = function.call1(py, arguments)?;
            Ok(!answer.bind(py).is(PyBool::new(py, false)))
        });
        match goes_on {
            Ok(true) => ControlFlow::Continue(()),
            Ok(false) => ControlFlow::Break(()),
            Err(error) => {
                *self.failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                ControlFlow::Break(())
            }
        }
    }

    /// # Errors
    /// The exception of the function, or that of Ctrl-C.
    pub(crate) fn result(self) -> PyResult<()> {
        let failure = self.failure.into_inner().unwrap_or_else(PoisonError::into_inner);
        failure.map_or(Ok(()), Err)
    }
}
