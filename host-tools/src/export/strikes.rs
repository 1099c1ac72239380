//! The table `strikes`: what a bead said of each strike, of its shape, and the settings that it measured
//! with.

use std::collections::HashMap;

use bead_model::Settings;
use bead_wire::{Body, Fields, Shape, Strike, Value as Field, named};

use crate::export::columns::{Cell, Column, Kind};
use crate::recording::json::hex;
use crate::recording::physical::{KEYS, Key, Physical};
use crate::recording::strikes::RecordedStrike;

/// The table's columns, and what the settings that were seen last give: they rarely change.
pub struct Strikes {
    columns: Vec<Column>,
    last: Option<(Settings, Told)>,
}

/// The cells of settings.
struct Told {
    name: Cell,
    /// A cell for each of the [`settings`].
    quantities: Vec<Cell>,
}

impl Told {
    fn of(settings: &Settings) -> Self {
        let physical = Physical::of(settings);
        let name = Some(physical.name.as_str()).filter(|name| !name.is_empty());
        Self {
            name: Cell::text(name),
            quantities: self::settings()
                .map(|key| Cell::number(physical.get(key).as_f64()))
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
            self.last = Some((settings, Told::of(&settings)));
        }
        let last = self.last.as_ref().filter(|_| strike.settings.is_some());
        row(&self.columns, id, recording, strike, last.map(|(_, told)| told))
    }
}

fn columns() -> Vec<Column> {
    let mut columns: Vec<Column> = [
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
    ]
    .map(|(name, kind)| Column::new(name, kind))
    .into();
    // Bodies with every optional part.
    let mut whole = || u64::MAX;
    let bodies: [&dyn Fields; 2] = [&Strike::draw(&mut whole), &Shape::draw(&mut whole)];
    for body in bodies {
        walk(body, "", Some(1), &mut |name, kind, _| {
            if columns.iter().all(|column| column.name != name) {
                columns.push(Column::new(name, kind));
            }
        });
    }
    columns.push(Column::new("arrival_time_s", Kind::Number));
    columns.extend(settings().map(|key| Column::new(settings_column(key), Kind::Number)));
    columns
}

fn row(
    columns: &[Column],
    id: u64,
    recording: &str,
    strike: &RecordedStrike,
    told: Option<&Told>,
) -> Vec<Cell> {
    let rate = strike.rate();
    let mut cells = HashMap::<String, Cell>::new();
    let mut put = |name: String, cell: Cell| cells.insert(name, cell);
    walk(&strike.said, "", rate, &mut |name, _, cell| drop(put(name, cell)));
    if let Some(shape) = &strike.shape {
        walk(shape, "", rate, &mut |name, _, cell| drop(put(name, cell)));
        let arrival = shape.first_index as f64 + shape.arrival.samples();
        let time = rate.map(|rate| arrival / f64::from(rate));
        put("arrival_time_s".to_owned(), Cell::number(time));
    }
    let uid = strike.uid.map(|uid| hex(&uid));
    for (name, cell) in [
        ("id", Cell::whole(id)),
        ("recording", Cell::text(Some(recording))),
        ("bead_name", told.map_or(Cell::Null, |told| told.name.clone())),
        ("uid", Cell::text(uid.as_deref())),
        ("address", Cell::whole(strike.address)),
        ("boot_low_byte", Cell::whole(strike.boot)),
        ("nth_boot", strike.nth_boot.map_or(Cell::Null, Cell::whole)),
        (
            "received_unix_ns",
            strike.received_ns.map_or(Cell::Null, Cell::whole),
        ),
        ("sample_rate_hz", rate.map_or(Cell::Null, Cell::whole)),
        ("samples_received", Cell::whole(strike.scans.len())),
    ] {
        put(name.to_owned(), cell);
    }
    // The columns of the settings are the last.
    let nothing = || settings().map(|_| Cell::Null).collect();
    let quantities = told.map_or_else(nothing, |told| told.quantities.clone());
    let (own, _) = columns.split_at(columns.len() - quantities.len());
    let mut row: Vec<Cell> = own
        .iter()
        .map(|column| cells.remove(&column.name).unwrap_or(Cell::Null))
        .collect();
    row.extend(quantities);
    row
}

/// The keys of settings that are numbers and describe a bead and its front end.
fn settings() -> impl Iterator<Item = &'static Key> {
    KEYS.iter().filter(|key| !matches!(key.path, "name" | "address"))
}

fn settings_column(key: &Key) -> String {
    let unit = match key.unit {
        "" => "",
        "kg" => "_kg",
        "s" => "_s",
        "N" => "_n",
        "Hz" => "_hz",
        "m/s²" => "_mps2",
        "N/m" => "_n_per_m",
        "N·s/m" => "_n_s_per_m",
        "N/m^1.5" => "_n_per_m1p5",
        other => unreachable!("{other} has no name for columns"),
    };
    format!("settings_{}{unit}", key.path.replace('.', "_"))
}

/// The columns that a body gives, with their values: as in its JSON.
fn walk(body: &dyn Fields, prefix: &str, rate: Option<u32>, see: &mut dyn FnMut(String, Kind, Cell)) {
    body.each(&mut |name, value| {
        let name = format!("{prefix}{name}");
        match value {
            Field::Number(number) => {
                see(name.clone(), Kind::Whole, Cell::whole(number));
                if let Some(stem) = name.strip_suffix("_index") {
                    let time = rate.map(|rate| number as f64 / f64::from(rate));
                    see(format!("{stem}_time_s"), Kind::Number, Cell::number(time));
                }
            }
            Field::Bool(yes) => see(name, Kind::Whole, Cell::whole(u8::from(yes))),
            Field::Quantity { bits, unit } => {
                see(
                    format!("{name}{}", unit.suffix),
                    Kind::Number,
                    Cell::number(unit.si(bits, rate)),
                );
                see(format!("{name}_raw"), Kind::Whole, Cell::Whole(bits));
            }
            Field::Set { bits, names } => {
                let names: Vec<&str> = named(bits, names).collect();
                see(name.clone(), Kind::Text, Cell::text(Some(&names.join(" "))));
                see(format!("{name}_raw"), Kind::Whole, Cell::whole(bits));
            }
            Field::Group(Some(group)) => walk(group, &format!("{name}_"), rate, see),
            // Strikes and shapes have none of these.
            Field::Group(None) | Field::Name { .. } | Field::Text(_) | Field::Bytes(_) | Field::Scans(_) => {}
        }
    });
}
