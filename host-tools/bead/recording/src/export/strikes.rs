//! The table `strikes`: what a bead said of each strike, of its shape, and the settings that it measured
//! with.

use bead_model::Settings;
use bead_model::violation::SettingKey;
use bead_wire::{Body, FieldDoc, Fields, Shape, Strike};
use serde_json::Value;

use crate::fields::{Content, described, entries};
use crate::json::hex;
use crate::physical::{KEYS, KeyRow, pointer};
use crate::strikes::RecordedStrike;
use bead_tables::unit::Unit;
use bead_tables::{Cell, CellKind, Column};

/// The columns, in their order.
pub fn columns() -> Vec<Column> {
    cells(None).into_iter().map(|(column, _)| column).collect()
}

/// The row of a strike, a cell for each of the [`columns`]. `id` is its number in this table.
pub fn row(id: u64, recording: &str, strike: &RecordedStrike) -> Vec<Cell> {
    let cells = cells(Some((id, recording, strike)));
    cells.into_iter().map(|(_, cell)| cell).collect()
}

fn cells(row: Option<(u64, &str, &RecordedStrike)>) -> Vec<(Column, Cell)> {
    let strike = row.map(|(.., strike)| strike);
    let whole = |name, number: Option<u64>| {
        let cell = number.map_or(Cell::Null, Cell::whole);
        (Column::new(name, CellKind::Whole), cell)
    };
    let text = |name, text| (Column::new(name, CellKind::Text), Cell::text(text));
    let settings = strike.and_then(|strike| strike.settings);
    let description = settings.as_ref().map(Settings::description);
    let name = description.map(|description| description.name.as_str());
    let uid = strike.and_then(|strike| strike.uid).map(|uid| hex(&uid));
    let rate = strike.and_then(RecordedStrike::rate);
    let mut cells = vec![
        whole("id", row.map(|(id, ..)| id)),
        text("recording", row.map(|(_, recording, _)| recording)),
        text("bead_name", name.filter(|name| !name.is_empty())),
        text("uid", uid.as_deref()),
        whole("address", strike.map(|strike| strike.address.into())),
        whole("boot_low_byte", strike.map(|strike| strike.boot.into())),
        whole(
            "nth_boot",
            strike.and_then(|strike| strike.nth_boot).map(|nth| nth as u64),
        ),
        whole("received_unix_ns", strike.and_then(|strike| strike.received_ns)),
        whole("sample_rate_hz", rate.map(u64::from)),
        whole("samples_received", strike.map(|strike| strike.received() as u64)),
    ];
    let said = strike.map(|strike| &strike.said as &dyn Fields);
    walk(Strike::FIELDS, said, "", rate, &mut cells);
    let shape = strike.and_then(|strike| strike.shape.as_ref());
    let mut of_shape = Vec::new();
    let body = shape.map(|shape| shape as &dyn Fields);
    walk(Shape::FIELDS, body, "", rate, &mut of_shape);
    // Both frames begin with the number and the first index of the strike.
    of_shape.retain(|(column, _)| cells.iter().all(|(other, _)| column.name != other.name));
    cells.extend(of_shape);
    let arrival = shape.and_then(Shape::arrival_index).zip(rate);
    let arrival = arrival.map(|(index, rate)| index / f64::from(rate));
    cells.push((
        Column::new("arrival_time_s", CellKind::Number),
        Cell::number(arrival),
    ));
    // A struct of numbers and texts is always JSON.
    let values = description.map(|description| serde_json::to_value(description).unwrap_or_default());
    cells.extend(self::settings().map(|row| {
        let value = values
            .as_ref()
            .and_then(|values| values.pointer(&pointer(row.key)));
        let column = Column::new(settings_column(row), CellKind::Number);
        (column, Cell::number(value.and_then(Value::as_f64)))
    }));
    cells
}

/// The keys of settings that are numbers and describe a bead and its front end.
fn settings() -> impl Iterator<Item = &'static KeyRow> {
    use SettingKey::{Address, Calibrated, Calibration, Name, ValidUntil};
    KEYS.iter()
        .filter(|row| !matches!(row.key, Name | Address | Calibration | Calibrated | ValidUntil))
}

fn settings_column(row: &KeyRow) -> String {
    let name = row.path().replace('.', "_");
    match Unit::of_symbol(row.unit) {
        Some(unit) => format!("settings_{name}_{}", unit.ending),
        None => format!("settings_{name}"),
    }
}

/// Adds the columns of a body with these fields, and their values in it, under the keys of its JSON.
fn walk(
    fields: &'static [FieldDoc],
    body: Option<&dyn Fields>,
    prefix: &str,
    rate: Option<u32>,
    cells: &mut Vec<(Column, Cell)>,
) {
    let entries = body.map_or_else(|| described(fields), |body| entries(body, rate));
    for entry in entries {
        let key = format!("{prefix}{}", entry.key);
        let integer = |value: Option<i64>| (CellKind::Whole, value.map_or(Cell::Null, Cell::Whole));
        let (kind, cell) = match entry.content {
            Content::Bool(value) => integer(value.map(i64::from)),
            Content::Number(value) => (CellKind::Whole, value.map_or(Cell::Null, Cell::whole)),
            Content::Bits(value) => integer(value),
            Content::Real(value) => (CellKind::Number, Cell::number(value)),
            Content::Name(value) => (CellKind::Text, Cell::text(value.and_then(|(_, name)| name))),
            Content::Names(names) => {
                let names = names.map(|names| names.join(" "));
                (CellKind::Text, Cell::text(names.as_deref()))
            }
            Content::Text(text) => (CellKind::Text, Cell::text(text)),
            Content::Group(fields, body) => {
                walk(fields, body, &format!("{key}_"), rate, cells);
                continue;
            }
            // Strikes and shapes have neither.
            Content::Bytes(_) | Content::Scans(_) => continue,
        };
        cells.push((Column::new(key, kind), cell));
    }
}
