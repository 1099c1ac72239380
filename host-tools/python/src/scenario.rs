//! Scenarios from TOML, files and dictionaries.

use hertz_chain::{Scenario as Described, TomlFile, read_table};
use pyo3::prelude::*;

use crate::failure::{ScenarioError, refused};

/// A checked scenario. It cannot be changed; `replace` makes another one.
#[pyclass(frozen, eq, module = "hertz_chain._hertz_chain")]
#[derive(Clone, PartialEq)]
pub(crate) struct Scenario(pub(crate) Described);

impl Scenario {
    /// The scenario of a table, which must hold all of it.
    pub(crate) fn of(table: toml::Table) -> PyResult<Self> {
        let scenario: Described = read_table(table).map_err(|error| refused(&error))?;
        scenario.check().map_err(|error| refused(&error))?;
        Ok(Self(scenario))
    }
}

/// The table in a JSON text.
pub(crate) fn table(json: &str) -> PyResult<toml::Table> {
    let refused = |why: String| ScenarioError::new_err(format!("these tables cannot be read: {why}"));
    let value: toml::Value = serde_json::from_str(json).map_err(|error| refused(error.to_string()))?;
    match value {
        toml::Value::Table(table) => Ok(table),
        _ => Err(refused("give a dictionary".to_owned())),
    }
}

#[pymethods]
impl Scenario {
    #[staticmethod]
    fn paper() -> Self {
        Self(Described::paper())
    }

    #[staticmethod]
    fn load(path: std::path::PathBuf) -> PyResult<Self> {
        Described::load(path).map(Self).map_err(|error| refused(&error))
    }

    #[staticmethod]
    fn from_toml(text: &str) -> PyResult<Self> {
        let scenario = Described::from_toml(text, "scenario");
        scenario.map(Self).map_err(|error| refused(&error))
    }

    #[staticmethod]
    fn from_json(json: &str) -> PyResult<Self> {
        Self::of(table(json)?)
    }

    fn to_toml(&self) -> String {
        self.0.to_toml()
    }

    fn to_json(&self) -> PyResult<String> {
        let text = self.0.to_toml();
        let file = TomlFile::parse(&text, "scenario").map_err(|error| refused(&error))?;
        let table: toml::Table = file.read().map_err(|error| refused(&error))?;
        serde_json::to_string(&table).map_err(|error| ScenarioError::new_err(error.to_string()))
    }
}
