//! Scenarios from TOML, files and dictionaries.

use std::sync::OnceLock;

use hertz_chain::{Scenario as Described, TomlFile, read_table};
use pyo3::prelude::*;
use serde_json::Value as Json;
use toml::Table;

use crate::failure::refused;

/// A checked scenario, and its tables from the first use of them. It cannot be changed; `replaced` makes
/// another one.
#[pyclass(frozen, eq, module = "hertz_chain._hertz_chain")]
#[derive(Clone)]
pub(crate) struct Scenario(pub(crate) Described, OnceLock<Table>);

impl From<Described> for Scenario {
    fn from(described: Described) -> Self {
        Self(described, OnceLock::new())
    }
}

impl PartialEq for Scenario {
    fn eq(&self, other: &Self) -> bool {
        self.0 == other.0
    }
}

impl Scenario {
    fn tables(&self) -> PyResult<&Table> {
        if let Some(tables) = self.1.get() {
            return Ok(tables);
        }
        let text = self.0.to_toml();
        let file = TomlFile::parse(&text, "scenario").map_err(refused)?;
        let tables = file.read().map_err(refused)?;
        Ok(self.1.get_or_init(|| tables))
    }

    /// The scenario of a table, which must hold all of it.
    pub(crate) fn of(table: Table) -> PyResult<Self> {
        let scenario: Described = read_table(table).map_err(refused)?;
        scenario.check().map_err(refused)?;
        Ok(scenario.into())
    }
}

fn unreadable(error: serde_json::Error) -> PyErr {
    refused(format_args!("these tables cannot be read: {error}"))
}

/// The table in a JSON text.
pub(crate) fn table(json: &str) -> PyResult<Table> {
    serde_json::from_str(json).map_err(unreadable)
}

#[pymethods]
impl Scenario {
    #[staticmethod]
    fn paper() -> Self {
        Described::paper().into()
    }

    #[staticmethod]
    fn load(path: std::path::PathBuf) -> PyResult<Self> {
        Described::load(path).map(Self::from).map_err(refused)
    }

    #[staticmethod]
    fn from_toml(text: &str) -> PyResult<Self> {
        Described::from_toml(text, "scenario")
            .map(Self::from)
            .map_err(refused)
    }

    #[staticmethod]
    fn from_json(json: &str) -> PyResult<Self> {
        Self::of(table(json)?)
    }

    fn to_toml(&self) -> String {
        self.0.to_toml()
    }

    fn to_json(&self) -> PyResult<String> {
        serde_json::to_string(self.tables()?).map_err(refused)
    }

    /// This scenario with the values of a JSON object. An object in it changes the keys of the table of its
    /// name, null removes a key.
    fn replaced(&self, changes: &str) -> PyResult<Self> {
        let mut changes: Json = serde_json::from_str(changes).map_err(unreadable)?;
        let mut tables = self.tables()?.clone();
        if let Some(changes) = changes.as_object_mut() {
            changes.retain(|key, value| {
                if value.is_null() {
                    tables.remove(key);
                }
                !value.is_null()
            });
        }
        let changes: Table = serde_json::from_value(changes).map_err(unreadable)?;
        for (key, value) in changes {
            match (tables.get_mut(&key), value) {
                (Some(toml::Value::Table(table)), toml::Value::Table(changes)) => table.extend(changes),
                (_, value) => {
                    tables.insert(key, value);
                }
            }
        }
        Self::of(tables)
    }
}
