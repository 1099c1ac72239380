//! The table `strikes`: what a bead said of each strike, of its shape, and the settings that it measured
//! with.

use bead_model::Settings;
use bead_model::violation::Key;
use bead_wire::{Body, FieldDoc, Fields, Shape, Strike};

use crate::fields::{Content, described, entries};
use crate::json::hex;
use crate::physical::{KEYS, KeyRow, value};
use crate::strikes::RecordedStrike;
use bead_tables::unit::Unit;
use bead_tables::{Cell, Column, Kind};

/// The table's columns, and the cells of the last settings, which rarely change.
pub struct Strikes {
    columns: Vec<Column>,
    last: Option<(Settings, SettingsCells)>,
}

/// The cells of a strike's settings.
struct SettingsCells {
    name: Cell,
    /// A cell for each of the [`settings`].
    quantities: Vec<Cell>,
}

impl SettingsCells {
    fn of(settings: &Settings) -> Self {
        let description = settings.description();
        let name = Some(description.name.as_str()).filter(|name| !name.is_empty());
        Self {
            name: Cell::text(name),
            quantities: self::settings()
                .map(|row| Cell::number(value(description, row.key).as_f64()))
                .collect(),
        }
    }
}

impl Default for Strikes {
    fn default() -> Self {
        Self {
            columns: columns(),
            last: None,
        }
    }
}

impl Strikes {
    /// The columns, in their order.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// The row of a strike. `id` is its number in this table.
    pub fn row(&mut self, id: u64, recording: &str, strike: &RecordedStrike) -> Vec<Cell> {
        if let Some(settings) = strike.settings
            && self.last.as_ref().is_none_or(|(last, _)| *last != settings)
        {
            self.last = Some((settings, SettingsCells::of(&settings)));
        }
        let last = self.last.as_ref().filter(|_| strike.settings.is_some());
        row(id, recording, strike, last.map(|(_, cells)| cells))
    }
}

/// The columns that say which strike of which bead it is.
const ORIGIN: [(&str, Kind); 10] = [
    ("id", Kind::Whole),
    ("recording", Kind::Text),
    ("bead_name", Kind::Text),
    ("uid", Kind::Text),
    ("address", Kind::Whole),
    ("boot_low_byte", Kind::Whole),
    ("nth_boot", Kind::Whole),
    ("received_unix_ns", Kind::Whole),
    ("sample_rate_hz", Kind::Whole),
    ("samples_received", Kind::Whole),
];

fn columns() -> Vec<Column> {
    let origin = ORIGIN.map(|(name, kind)| Column::new(name, kind));
    let results = results(None).into_iter().map(|(column, _)| column);
    let settings = settings().map(|key| Column::new(settings_column(key), Kind::Number));
    origin.into_iter().chain(results).chain(settings).collect()
}

fn row(
    id: u64,
    recording: &str,
    strike: &RecordedStrike,
    settings_cells: Option<&SettingsCells>,
) -> Vec<Cell> {
    let uid = strike.uid.map(|uid| hex(&uid));
    let origin: [Cell; ORIGIN.len()] = [
        Cell::whole(id),
        Cell::text(Some(recording)),
        settings_cells.map_or(Cell::Null, |cells| cells.name.clone()),
        Cell::text(uid.as_deref()),
        Cell::whole(strike.address),
        Cell::whole(strike.boot),
        strike.nth_boot.map_or(Cell::Null, Cell::whole),
        strike.received_ns.map_or(Cell::Null, Cell::whole),
        strike.rate().map_or(Cell::Null, Cell::whole),
        Cell::whole(strike.scans.len()),
    ];
    let results = results(Some(strike)).into_iter().map(|(_, cell)| cell);
    let mut row: Vec<Cell> = origin.into_iter().chain(results).collect();
    match settings_cells {
        Some(cells) => row.extend(cells.quantities.iter().cloned()),
        None => row.extend(settings().map(|_| Cell::Null)),
    }
    row
}

/// The columns of strike frame and shape frame, with their values in a strike.
fn results(strike: Option<&RecordedStrike>) -> Vec<(Column, Cell)> {
    let rate = strike.and_then(RecordedStrike::rate);
    let shape = strike.and_then(|strike| strike.shape.as_ref());
    let mut cells = Vec::new();
    let said = strike.map(|strike| &strike.said as &dyn Fields);
    walk(Strike::FIELDS, said, "", rate, &mut cells);
    let mut of_shape = Vec::new();
    let body = shape.map(|shape| shape as &dyn Fields);
    walk(Shape::FIELDS, body, "", rate, &mut of_shape);
    // Both frames begin with the number and the first index of the strike.
    of_shape.retain(|(column, _)| cells.iter().all(|(other, _)| column.name != other.name));
    cells.extend(of_shape);
    let arrival = shape.and_then(Shape::arrival_index).zip(rate);
    let arrival = arrival.map(|(index, rate)| index / f64::from(rate));
    cells.push((Column::new("arrival_time_s", Kind::Number), Cell::number(arrival)));
    cells
}

/// The keys of settings that are numbers and describe a bead and its front end.
fn settings() -> impl Iterator<Item = &'static KeyRow> {
    KEYS.iter()
        .filter(|row| !matches!(row.key, Key::Name | Key::Address))
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
        let integer = |value: Option<i64>| (Kind::Whole, value.map_or(Cell::Null, Cell::Whole));
        let (kind, cell) = match entry.content {
            Content::Bool(value) => integer(value.map(i64::from)),
            Content::Number(value) => (Kind::Whole, value.map_or(Cell::Null, Cell::whole)),
            Content::Bits(value) => integer(value),
            Content::Real(value) => (Kind::Number, Cell::number(value)),
            Content::Name(value) => (Kind::Text, Cell::text(value.and_then(|(_, name)| name))),
            Content::Names(names) => {
                let names = names.map(|names| names.join(" "));
                (Kind::Text, Cell::text(names.as_deref()))
            }
            Content::Text(text) => (Kind::Text, Cell::text(text)),
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
