//! The table `strikes`: a bead's report of each strike and its shape, and the settings that it measured with.

use bead_model::Settings;
use bead_model::violation::SettingKey;
use bead_wire::{Body, FieldDoc, Fields, Shape, Strike};
use serde_json::Value;

use crate::fields::{Content, described, entries};
use crate::json::hex;
use crate::physical::{KEYS, KeyRow, pointer};
use crate::strikes::RecordedStrike;
use crate::uncertainties::{ENERGIES, GROUP, of_energies, of_force};
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
    for (beside, key, u) in uncertainties(strike) {
        let place = cells.iter().position(|(column, _)| column.name == beside);
        let at = place.map_or(cells.len(), |place| place + 1);
        let column = Column::new(format!("{GROUP}_{key}"), CellKind::Number);
        cells.insert(at, (column, Cell::number(u)));
    }
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

/// The column that a standard uncertainty follows, its key, and its value.
fn uncertainties(strike: Option<&RecordedStrike>) -> [(&'static str, &'static str, Option<f64>); 5] {
    let energies = strike.and_then(|strike| of_energies(strike.shape.as_ref()?, &strike.said));
    let forces = strike.and_then(|strike| {
        let description = strike.settings.as_ref()?.description();
        of_force(&strike.said, description.uncertainty.as_ref()?)
    });
    let energy = |place: usize| energies.and_then(|of| of[place]);
    let force = |place: usize| forces.map(|of| of[place]);
    let [measured, predicted, difference] = ENERGIES;
    [
        ("peak_force_raw", "peak_force_n", force(0)),
        ("absorbed_measured_raw", measured, energy(0)),
        ("absorbed_predicted_raw", difference, energy(2)),
        ("absorbed_predicted_raw", predicted, energy(1)),
        ("incident_energy_raw", "incident_energy_j", force(1)),
    ]
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

#[cfg(test)]
mod tests {
    use bead_model::design::{Relative, Uncertainty};
    use bead_testing::paper_settings;
    use bead_wire::{Energy, EnergyUncertainty, Force, Fraction};

    use super::*;

    #[test]
    fn an_uncertainty_stands_beside_its_value_in_the_same_unit() {
        let percent = |percent: i32| Fraction::from_bits(percent * 65_536 / 100);
        let parts = [1, 2, 3].map(percent);
        let said = Strike {
            peak_force: Force::from_bits(6 << 16),
            absorbed_measured: Energy::from_bits(400 << 24),
            absorbed_predicted: Energy::from_bits(500 << 24),
            incident_energy: Energy::from_bits(1000 << 24),
            ..Strike::draw(&mut || 0)
        };
        let mut strike = RecordedStrike::new(0, said);
        let [measured, predicted, difference] = parts;
        strike.shape = Some(Shape {
            uncertainty: Some(EnergyUncertainty {
                measured,
                predicted,
                difference,
            }),
            ..Shape::draw(&mut || 0)
        });
        let part = |part| Some(Relative::new(part));
        let stated = Uncertainty {
            force_gain: part(0.01),
            force_gain_ratio: part(0.01),
            force_flatness: part(0.01),
            supply: part(0.01),
            contact_stiffness: part(0.1),
            ..Uncertainty::default()
        };
        strike.settings = paper_settings()
            .with(|description| description.uncertainty = Some(stated))
            .ok();
        assert!(strike.settings.is_some());
        let names: Vec<_> = columns().into_iter().map(|column| column.name).collect();
        let row = row(0, "x", &strike);
        // Of the force four times 1 %. Of the incident energy 5/3 of that, and 2/3 of 10 %.
        let incident = 1e-6 * f64::hypot(10.0 / 3.0, 20.0 / 3.0) / 100.0;
        let peak = 0.02 * said.peak_force.newtons();
        let [one, two, three] = parts.map(Fraction::ratio);
        for (beside, name, u) in [
            ("peak_force_raw", "u_peak_force_n", peak),
            ("absorbed_measured_raw", "u_absorbed_measured_j", 400e-9 * one),
            ("absorbed_predicted_raw", "u_absorbed_predicted_j", 500e-9 * two),
            ("u_absorbed_predicted_j", "u_difference_j", 500e-9 * three),
            ("incident_energy_raw", "u_incident_energy_j", incident),
        ] {
            let at = names.iter().position(|one| one == beside).unwrap() + 1;
            let Cell::Number(found) = row[at] else {
                panic!("{name}: {:?}", row[at])
            };
            assert_eq!(names[at], name);
            assert!((found / u - 1.0).abs() < 1e-9, "{name}: {found} {u}");
        }
        strike.settings = Some(paper_settings());
        strike.shape = None;
        let unknown = super::row(0, "x", &strike);
        let of = names
            .iter()
            .zip(unknown)
            .filter(|(name, _)| name.starts_with("u_"));
        assert!(of.into_iter().all(|(_, cell)| matches!(cell, Cell::Null)));
    }
}
