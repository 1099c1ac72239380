//! Recordings of beads: tables of their strikes and samples, and the checks of the command line.

use std::path::PathBuf;
use std::sync::Arc;

use bead_compare::agreement::DECISION_RULE;
use bead_compare::bead::ComparedBead;
use bead_compare::budget::StrikeBudget;
use bead_compare::emulated::RunTruth;
use bead_compare::replay::replay;
use bead_compare::sensed::{only_host, simulate_with_ring_down};
use bead_compare::strike::FullChain;
use bead_compare::verdict::Echoes;
use bead_recording::clock;
use bead_recording::export::{samples, strikes};
use bead_recording::file::{Part, RecordedBead, Recording as File, RecordingError as FileError};
use bead_recording::strikes::RecordedStrike;
use bead_tables::{Cell, CellKind, Column};
use hertz_chain::Scenario as Described;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::failure::{RecordingError, guarded};
use crate::scenario::Scenario;
use crate::table::Columns;

/// An open recording.
#[pyclass(frozen, module = "hertz_chain._hertz_chain")]
pub(crate) struct Recording {
    file: File,
}

fn refused(error: &FileError) -> PyErr {
    RecordingError::new_err(error.to_string())
}

impl Recording {
    /// Calls `take` with the number and each strike, and looks for Ctrl-C between them.
    fn each(
        &self,
        py: Python<'_>,
        mut take: impl FnMut(u64, &RecordedStrike) -> PyResult<()>,
    ) -> PyResult<()> {
        let mut strikes = self.file.strikes().map_err(|error| refused(&error))?;
        let mut count = 0;
        for strike in strikes.by_ref() {
            take(count, &strike)?;
            count += 1;
            py.check_signals()?;
        }
        if count == 0 {
            return Err(refused(&self.file.no_strike(strikes.frames())));
        }
        Ok(())
    }
}

#[pymethods]
impl Recording {
    #[new]
    fn new(path: PathBuf) -> PyResult<Self> {
        let file = File::open_named(&path).map_err(|error| refused(&error))?;
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
            Some(strike) => Err(RecordingError::new_err(format!(
                "strike {strike} is not there: {count} strikes, counted from 0"
            ))),
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
        let budget = found.ok_or_else(|| {
            RecordingError::new_err(format!(
                "strike {strike} is not there: {count} strikes, counted from 0"
            ))
        })?;
        let budget = budget.map_err(|error| RecordingError::new_err(error.to_string()))?;
        serde_json::to_string(&budget).map_err(|error| RecordingError::new_err(error.to_string()))
    }

    /// The strikes of one bead beside a simulated chain, without a scenario that of the recording: JSON of
    /// the bead, its strikes and the verdict, as `bead compare` has them.
    #[pyo3(signature = (scenario, bead))]
    fn compare(&self, py: Python<'_>, scenario: Option<&Scenario>, bead: Option<usize>) -> PyResult<String> {
        let scenario = scenario.map(|scenario| scenario.0.clone());
        let compared = guarded(py, || self.compared(scenario, bead))?;
        compared.map_err(RecordingError::new_err)
    }

    /// Clocks of the beads beside the host's, as JSON.
    fn clocks(&self, py: Python<'_>) -> PyResult<String> {
        let path = self.file.path.clone();
        let compared = guarded(py, || clock::compare(&[path]))?.map_err(|error| refused(&error))?;
        serde_json::to_string(&compared).map_err(|error| RecordingError::new_err(error.to_string()))
    }
}

impl Recording {
    fn compared(&self, scenario: Option<Described>, asked: Option<usize>) -> Result<String, String> {
        let line = |error: &dyn std::fmt::Display| error.to_string();
        let (file, place) = self.of_one(asked)?;
        let scenario = match (scenario, file.parts.get(&Part::Scenario)) {
            (Some(scenario), _) => scenario,
            (None, Some(text)) => {
                Described::from_toml(&String::from_utf8_lossy(text), "the recording's scenario")
                    .map_err(|error| line(&error))?
            }
            (None, None) => {
                return Err(format!(
                    "{} carries no scenario; say what was struck: scenario=Scenario.load(…)",
                    self.name()
                ));
            }
        };
        let truth: Option<RunTruth> = file.json(Part::Truth).map_err(|error| line(&error))?;
        let bead = asked.or(truth.as_ref().map(|truth| truth.bead)).or(place);
        let bead = bead
            .map_or_else(|| only_host(&scenario), Ok)
            .map_err(|error| line(&error))?;
        let echoes = Echoes::of(&scenario, truth);
        let solution = Arc::new(simulate_with_ring_down(&scenario).map_err(|error| line(&error))?);
        let chain = FullChain::of(&scenario, &solution, bead).map_err(|error| line(&error))?;
        let compared = ComparedBead::read(&file, &chain, echoes, None, |_, _| ());
        let compared = compared.map_err(|error| line(&error))?;
        let result = serde_json::json!({
            "bead": bead,
            "strikes": compared.strikes,
            "pass": compared.failure.is_none(),
            "failure": compared.failure,
            "decision_rule": DECISION_RULE,
        });
        Ok(result.to_string())
    }

    /// The recording of one bead, and its place if the recording knows it.
    fn of_one(&self, asked: Option<usize>) -> Result<(File, Option<usize>), String> {
        let places: Vec<usize> = self.file.beads.iter().map(RecordedBead::place).collect();
        match (&places[..], asked) {
            ([], _) => Ok((self.file.clone(), None)),
            ([place], None) => Ok((self.file.of(&self.file.beads[0]), Some(*place))),
            (_, asked) => {
                let at = asked.and_then(|asked| places.iter().position(|place| *place == asked));
                let at = at.ok_or_else(|| {
                    format!("{} has the beads {places:?}; give bead= one of them", self.name())
                })?;
                Ok((self.file.of(&self.file.beads[at]), asked))
            }
        }
    }

    fn name(&self) -> String {
        self.file.path.display().to_string()
    }
}
