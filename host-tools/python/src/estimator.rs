//! The bead's own fixed-point arithmetic on a user's samples.

use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use bead_compare::front_end::AnalogFrontEnd;
use bead_compare::sensed::{Sensed, Timing};
use bead_instrument::{Trace, Waveform as Played};
use bead_model::design::{Bead, Capture, derive};
use bead_model::settings::Settings;
use bead_model::{Chunk, Meter, Scan, Sink};
use bead_recording::export::{samples, strikes};
use bead_recording::physical;
use bead_recording::strikes::RecordedStrike;
use bead_wire::{Shape, Strike, Waveform};
use hertz_chain::read_text;
use numpy::ndarray::ArrayView1;
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::failure::{ScenarioError, guarded, refused};
use crate::table::Columns;

/// Name of the recording in the tables.
const NAME: &str = "estimator";
/// Quiet before and after a signal that is digitised, s: the bead arms in it, and ends its window.
const LEAD_IN: f64 = 0.01;
const TAIL: f64 = 0.03;
/// Sample rate of the bead, Hz.
const RATE: f64 = 1e5;

/// A bead without hardware: its settings, and the state of its meter.
#[pyclass(frozen, module = "hertz_chain._hertz_chain")]
pub(crate) struct Estimator {
    settings: Settings,
    /// The meter and the index of the next scan; the first one has 1, as on the bead. Threads take turns.
    meter: Mutex<(Meter, u64)>,
}

/// Windows that were measured, as a recording would have them.
#[derive(Default)]
struct Windows {
    chunks: Vec<Chunk>,
    strikes: Vec<RecordedStrike>,
}

impl Sink for Windows {
    fn chunk(&mut self, chunk: &Chunk) {
        self.chunks.push(chunk.clone());
    }

    fn report(&mut self, strike: &Strike, shape: &Shape) {
        let mut recorded = RecordedStrike::new(0, *strike);
        recorded.shape = Some(*shape);
        // The pieces of the next window may have begun.
        let own = |chunk: &Chunk| chunk.strike == strike.strike;
        for chunk in self.chunks.iter().filter(|chunk| own(chunk)) {
            recorded.push(&Waveform::from(chunk));
        }
        self.chunks.retain(|chunk| !own(chunk));
        self.strikes.push(recorded);
    }
}

#[pymethods]
impl Estimator {
    /// A bead with the settings in a TOML file; without one, the paper's bead behind the reference front end.
    #[new]
    #[pyo3(signature = (settings=None))]
    fn new(settings: Option<&str>) -> PyResult<Self> {
        let settings = match settings {
            Some(path) => {
                let text = read_text(Path::new(path), "settings in TOML").map_err(refused)?;
                physical::parse(&text, path).map_err(refused)?
            }
            None => {
                let (bead, front) = (Bead::paper(), AnalogFrontEnd::default().calibration());
                let settings = derive(&bead, &front, &Capture::of(&bead, &front));
                settings.map_err(refused)?
            }
        };
        Ok(Self {
            settings,
            meter: Mutex::new((Meter::new(), 1)),
        })
    }

    /// Takes codes, uint16 of shape (n, 4): force, wide force, acceleration, wide acceleration of each scan.
    /// Returns the tables of the windows that ended in them, `strikes` and `samples`.
    fn process<'py>(
        &self,
        py: Python<'py>,
        codes: PyReadonlyArray2<'py, u16>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let &[_, 4] = codes.shape() else {
            return Err(ScenarioError::new_err(format!(
                "codes have the shape {:?}; give (n, 4): force, wide force, acceleration, wide acceleration",
                codes.shape()
            )));
        };
        let codes = codes.as_array();
        if let Some(code) = codes.iter().find(|code| **code > 4095) {
            return Err(ScenarioError::new_err(format!(
                "{code} is not a code of the bead's converter, which has 12 bits; give 0 to 4095"
            )));
        }
        let scan = |row: ArrayView1<'_, u16>| Scan::new([row[0], row[1], row[2], row[3]]);
        let scans: Vec<Scan> = codes.rows().into_iter().map(scan).collect();
        let mut windows = Windows::default();
        let count = scans.len() as u64;
        guarded(py, || {
            let mut meter = self.meter.lock().unwrap_or_else(PoisonError::into_inner);
            let (meter, next) = &mut *meter;
            meter.process(&self.settings, *next, scans, &mut windows);
            *next += count;
        })?;
        let name: Arc<str> = NAME.into();
        let (mut strike_table, mut sample_table) =
            (Columns::new(strikes::columns()), Columns::new(samples::columns()));
        for (id, mut strike) in (0..).zip(windows.strikes) {
            strike.settings = Some(self.settings);
            strike_table.push(strikes::row(id, &name, &strike));
            samples::rows(id, &name, &strike).for_each(|row| sample_table.push(row));
        }
        let result = PyDict::new(py);
        result.set_item("strikes", strike_table.into_dict(py)?)?;
        result.set_item("samples", sample_table.into_dict(py)?)?;
        Ok(result)
    }

    /// Digitises signals as the reference front end does: filtered, with noise of this seed or without. Quiet
    /// is put before and after them.
    #[staticmethod]
    #[pyo3(signature = (force, acceleration, rate, seed))]
    fn digitise<'py>(
        py: Python<'py>,
        force: Option<PyReadonlyArray1<'py, f64>>,
        acceleration: Option<PyReadonlyArray1<'py, f64>>,
        rate: f64,
        seed: Option<u64>,
    ) -> PyResult<Bound<'py, numpy::PyArray2<u16>>> {
        let trace = |name: &str, signal: Option<PyReadonlyArray1<'py, f64>>| {
            let Some(signal) = signal else { return Ok(None) };
            let values: Vec<f64> = signal.as_array().iter().copied().collect();
            if values.is_empty() || values.iter().any(|value| !value.is_finite()) {
                return Err(ScenarioError::new_err(format!(
                    "{name} is empty or has values that are not numbers; give finite samples in SI units"
                )));
            }
            Ok(Some(Trace::even(values, rate)))
        };
        if !(rate.is_finite() && rate > 0.0) {
            return Err(ScenarioError::new_err(format!(
                "rate = {rate}: give samples a second, such as 1e6"
            )));
        }
        let waveform = Played {
            force: trace("force", force)?,
            acceleration: trace("acceleration", acceleration)?,
            start: 0.0,
            remarks: Vec::new(),
        };
        let seconds = waveform.seconds() + LEAD_IN + TAIL;
        if seconds > 600.0 {
            return Err(ScenarioError::new_err(format!(
                "the signals last {seconds:.0} s; give only the strikes, at most 10 minutes"
            )));
        }
        let timing = Timing {
            lead_in: LEAD_IN,
            strikes: 1,
            interval: 1.0,
        };
        let scans = guarded(py, || {
            let sensed = Sensed::playing(&waveform, timing);
            AnalogFrontEnd::default()
                .digitise(&sensed, (seconds * RATE) as usize, seed)
                .scans
        })?;
        let count = scans.len();
        PyArray1::from_vec(py, scans.into_flattened()).reshape([count, 4])
    }
}
