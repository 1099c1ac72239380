//! Recordings of beads: tables of their strikes and samples, and the checks of the command line.

use std::fmt::Display;
use std::path::PathBuf;
use std::sync::Arc;

use bead_compare::budget::StrikeBudget;
use bead_compare::replay::replay;
use bead_recording::clock;
use bead_recording::export::{samples, strikes};
use bead_recording::file::Recording as File;
use bead_recording::strikes::RecordedStrike;
use bead_tables::{Cell, CellKind, Column};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::compare::compared;
use crate::failure::{RecordingError, guarded};
use crate::identify::{Arguments, Asked};
use crate::scenario::Scenario;
use crate::table::Columns;

/// An open recording.
#[pyclass(frozen, module = "hertz_chain._hertz_chain")]
pub(crate) struct Recording {
    file: File,
}

fn refused(error: impl Display) -> PyErr {
    RecordingError::new_err(error.to_string())
}

/// The exception of a strike that is not among the first `count`.
fn no_such_strike(strike: u64, count: u64) -> PyErr {
    refused(format_args!(
        "there is no strike {strike}: the recording has {count} strikes, counted from 0"
    ))
}

impl Recording {
    fn name(&self) -> String {
        self.file.path.display().to_string()
    }

    /// Calls `take` with the number and each strike, and looks for Ctrl-C between them.
    fn each(
        &self,
        py: Python<'_>,
        mut take: impl FnMut(u64, &RecordedStrike) -> PyResult<()>,
    ) -> PyResult<()> {
        let mut strikes = self.file.strikes().map_err(refused)?;
        let mut count = 0;
        for strike in strikes.by_ref() {
            take(count, &strike)?;
            count += 1;
            py.check_signals()?;
        }
        if count == 0 {
            return Err(refused(self.file.no_strike(strikes.frames())));
        }
        Ok(())
    }
}

#[pymethods]
impl Recording {
    #[new]
    fn new(path: PathBuf) -> PyResult<Self> {
        let file = File::open_named(&path).map_err(refused)?;
        Ok(Self { file })
    }

    /// Text about a file that is cut short or damaged, or None.
    fn warning(&self) -> Option<String> {
        self.file.warning()
    }

    /// The columns of `strikes.parquet` of `bead export`.
    fn strikes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (name, mut columns) = (self.name(), Columns::new(strikes::columns()));
        self.each(py, |number, strike| {
            columns.push(strikes::row(number, &name, strike));
            Ok(())
        })?;
        columns.into_dict(py)
    }

    /// The columns of `samples.parquet` of `bead export`, of one strike or of all.
    #[pyo3(signature = (strike=None))]
    fn samples<'py>(&self, py: Python<'py>, strike: Option<u64>) -> PyResult<Bound<'py, PyDict>> {
        let (name, mut columns) = (Arc::from(&*self.name()), Columns::new(samples::columns()));
        let mut count = 0;
        self.each(py, |number, one| {
            count = number + 1;
            if strike.is_none_or(|strike| strike == number) {
                samples::rows(number, &name, one).for_each(|row| columns.push(row));
            }
            Ok(())
        })?;
        match strike.filter(|strike| *strike >= count) {
            Some(strike) => Err(no_such_strike(strike, count)),
            None => columns.into_dict(py),
        }
    }

    /// Each strike through the bead's own code: `id`, `bead`, `strike`, `replay` and `why`, a text where a
    /// result came out otherwise or is incomplete.
    fn replay<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let mut columns = Columns::new(vec![
            Column::new("id", CellKind::Whole),
            Column::new("bead", CellKind::Whole),
            Column::new("strike", CellKind::Whole),
            Column::new("replay", CellKind::Text),
            Column::new("why", CellKind::Text),
        ]);
        self.each(py, |number, strike| {
            let replayed = guarded(py, || replay(strike))?;
            columns.push(vec![
                Cell::whole(number),
                Cell::whole(strike.address),
                Cell::whole(strike.said.strike),
                Cell::Text(replayed.word().name().into()),
                Cell::text(replayed.failure().as_deref()),
            ]);
            Ok(())
        })?;
        columns.into_dict(py)
    }

    /// The uncertainty budget of a strike, as JSON.
    fn budget(&self, py: Python<'_>, strike: u64) -> PyResult<String> {
        let mut found = None;
        let mut count = 0;
        self.each(py, |number, one| {
            count = number + 1;
            if number == strike {
                found = Some(guarded(py, || StrikeBudget::of(one, None, None))?);
            }
            Ok(())
        })?;
        let budget = found.ok_or_else(|| no_such_strike(strike, count))?;
        serde_json::to_string(&budget.map_err(refused)?).map_err(refused)
    }

    /// The strikes of one bead or of a row beside a simulated chain, without a scenario that of the
    /// recording, as JSON.
    fn compare(&self, py: Python<'_>, scenario: Option<&Scenario>, bead: Option<usize>) -> PyResult<String> {
        let scenario = scenario.map(|scenario| scenario.0.clone());
        let compared = guarded(py, || compared(&self.file, scenario, bead))?;
        compared.map_err(refused)
    }

    /// Quantities of the beads from their strikes, as JSON.
    fn identify(&self, py: Python<'_>, arguments: Arguments) -> PyResult<String> {
        let asked = Asked::of(arguments)?;
        let mut beads = Vec::new();
        let name = self.name();
        self.each(py, |_, strike| {
            asked.take(&mut beads, &name, strike);
            Ok(())
        })?;
        let identified = guarded(py, || asked.identified(&beads, &name))?;
        identified.map_err(refused)
    }

    /// Clocks of the beads beside the host's, as JSON.
    fn clocks(&self, py: Python<'_>) -> PyResult<String> {
        let path = self.file.path.clone();
        let compared = guarded(py, || clock::compare(&[path]))?.map_err(refused)?;
        serde_json::to_string(&compared).map_err(refused)
    }
}
