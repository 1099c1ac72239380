//! The table `spectra`: a row for each frequency of each strike, in SI units.

use bead_tables::{Cell, CellKind, Column};
use realfft::num_complex::Complex64;

use crate::plan::{Kind, Plan, StrikeSpectrum};
use crate::shock::{ResponseKind, VALUES};
use crate::strike::{Sensors, StrikeSignal};

/// The columns for a kind of spectrum, in their order.
pub fn columns(kind: Kind) -> Vec<Column> {
    let mut columns = vec![
        Column::new("id", CellKind::Whole),
        Column::new("recording", CellKind::Text),
        Column::new("address", CellKind::Whole),
        Column::new("uid", CellKind::Text),
        Column::new("strike", CellKind::Whole),
    ];
    let mut number = |name: &str| columns.push(Column::new(name, CellKind::Number));
    number("frequency_hz");
    match kind {
        Kind::Shock { .. } => {
            for (response, unit) in ResponseKind::ALL.into_iter().zip(["mps2", "mps", "m"]) {
                for value in VALUES {
                    number(&format!("{}_{value}_{unit}", response.name()));
                }
            }
        }
        Kind::Density { of, .. } => number(match of {
            Sensors::Force => "force_density_n2_per_hz",
            _ => "acceleration_density_m2_per_s4_hz",
        }),
        Kind::Fourier { of: Sensors::Force } => ["force_n_s", "phase_rad"].into_iter().for_each(number),
        Kind::Fourier { .. } => ["acceleration_mps", "phase_rad"].into_iter().for_each(number),
        Kind::Transfer => ["acceleration_of_force_per_kg", "phase_rad"]
            .into_iter()
            .for_each(number),
    }
    columns
}

/// The rows of a strike, a cell for each of the [`columns`]. `id` counts the strikes of the table.
pub fn rows(
    (id, address, uid): (u64, u8, Option<&str>),
    plan: &Plan,
    strike: &StrikeSignal,
    spectrum: &StrikeSpectrum,
) -> impl Iterator<Item = Vec<Cell>> {
    let (uid, recording) = (Cell::text(uid), Cell::Text(strike.recording.clone()));
    let number = strike.strike;
    plan.frequencies
        .iter()
        .enumerate()
        .map(move |(place, frequency)| {
            let mut row = vec![
                Cell::whole(id),
                recording.clone(),
                Cell::whole(address),
                uid.clone(),
                Cell::whole(number),
                Cell::Number(*frequency),
            ];
            // Null for what is no number: a transfer without force.
            let finite = |value: f64| Cell::number(Some(value).filter(|value| value.is_finite()));
            let polar = |value: Complex64| [value.norm(), value.arg()].map(finite);
            match spectrum {
                StrikeSpectrum::Shock(responses) => {
                    let values = ResponseKind::ALL.map(|of| responses[place].values(of));
                    row.extend(values.into_iter().flatten().map(Cell::Number));
                }
                StrikeSpectrum::Density(values) => row.push(Cell::Number(values[place])),
                StrikeSpectrum::Fourier(values) => row.extend(polar(values[place])),
                StrikeSpectrum::Transfer([force, acceleration]) => {
                    row.extend(polar(acceleration[place] / force[place]));
                }
            }
            row
        })
}
