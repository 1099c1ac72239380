//! Scenarios from TOML, files and dictionaries.

use std::fmt::Display;
use std::sync::OnceLock;

use hertz_chain::{Scenario as Described, TomlFile, read_table};
use pyo3::prelude::*;
use serde_json::{Map, Value as Json};
use toml::{Table, Value as Toml};

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

fn unreadable(error: impl Display) -> PyErr {
    refused(format_args!("these tables cannot be read: {error}"))
}

/// The table in a JSON text.
pub(crate) fn table(json: &str) -> PyResult<Table> {
    table_of(serde_json::from_str(json).map_err(unreadable)?)
}

fn table_of(object: Map<String, Json>) -> PyResult<Table> {
    let entries = object.into_iter();
    entries.map(|(key, value)| Ok((key, toml_of(value)?))).collect()
}

/// The value in TOML. By way of serde a number would arrive as a table, since `serde_json` has its feature
/// `arbitrary_precision` where the host tools are built.
fn toml_of(value: Json) -> PyResult<Toml> {
    Ok(match value {
        Json::Null => return Err(unreadable("TOML has no null")),
        Json::Bool(value) => value.into(),
        Json::Number(number) => match (number.as_i64(), number.as_f64()) {
            (Some(integer), _) => integer.into(),
            (None, Some(value)) => value.into(),
            (None, None) => return Err(unreadable(format_args!("{number} is out of range"))),
        },
        Json::String(text) => text.into(),
        Json::Array(values) => Toml::Array(values.into_iter().map(toml_of).collect::<PyResult<_>>()?),
        Json::Object(object) => Toml::Table(table_of(object)?),
    })
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
        let mut changes: Map<String, Json> = serde_json::from_str(changes).map_err(unreadable)?;
        let mut tables = self.tables()?.clone();
        changes.retain(|key, value| {
            if value.is_null() {
                tables.remove(key);
            }
            !value.is_null()
        });
        for (key, value) in table_of(changes)? {
            match (tables.get_mut(&key), value) {
                (Some(Toml::Table(table)), Toml::Table(changes)) => table.extend(changes),
                (_, value) => {
                    tables.insert(key, value);
                }
            }
        }
        Self::of(tables)
    }
}
