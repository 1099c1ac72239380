//! The table `samples`: a row for each sample of a strike's window. Both gains are merged into one signal in
//! SI units by the bead's own code ([`Signal`]); the codes stand beside it. A sample that was not received
//! has a row with neither, up to the last one that was. After a gap there are only codes, as the bead's code
//! needs the missing samples.

use std::sync::Arc;

use crate::signal::Signal;
use crate::strikes::RecordedStrike;
use bead_tables::{Cell, CellKind, Column};

/// The columns, in their order.
pub fn columns() -> Vec<Column> {
    [
        ("id", CellKind::Whole),
        ("recording", CellKind::Text),
        ("address", CellKind::Whole),
        ("boot_low_byte", CellKind::Whole),
        ("nth_boot", CellKind::Whole),
        ("strike", CellKind::Whole),
        ("sample", CellKind::Whole),
        ("sample_index", CellKind::Whole),
        ("time_s", CellKind::Number),
        ("time_from_trigger_s", CellKind::Number),
        ("force_n", CellKind::Number),
        ("acceleration_mps2", CellKind::Number),
        ("force_code", CellKind::Whole),
        ("acceleration_code", CellKind::Whole),
        ("force_wide_code", CellKind::Whole),
        ("acceleration_wide_code", CellKind::Whole),
    ]
    .map(|(name, kind)| Column::new(name, kind))
    .into()
}

/// The rows of a strike, a cell for each of the [`columns`]. `id` is that of the strike's row.
pub fn rows<'a>(
    id: u64,
    recording: &Arc<str>,
    strike: &'a RecordedStrike,
) -> impl Iterator<Item = Vec<Cell>> + 'a {
    let signal = strike.signal();
    let rate = strike.rate().map(f64::from);
    let (recording, said) = (Arc::clone(recording), &strike.said);
    (0u64..).zip(strike.samples()).map(move |(sample, scan)| {
        let index = said.first_index.saturating_add(sample);
        let from_trigger = index as f64 - said.trigger_index as f64;
        let value = |of: fn(&Signal) -> &[f64]| {
            let values = signal.as_ref().map(of);
            Cell::number(values.and_then(|values| values.get(sample as usize).copied()))
        };
        let codes =
            |codes: Option<[u16; 2]>| codes.map_or([Cell::Null, Cell::Null], |codes| codes.map(Cell::whole));
        let [force, acceleration] = codes(scan.map(|scan| scan.sensitive));
        let [wide_force, wide_acceleration] = codes(scan.and_then(|scan| scan.wide));
        vec![
            Cell::whole(id),
            Cell::Text(Arc::clone(&recording)),
            Cell::whole(strike.address),
            Cell::whole(strike.boot),
            strike.nth_boot.map_or(Cell::Null, Cell::whole),
            Cell::whole(said.strike),
            Cell::whole(sample),
            Cell::whole(index),
            Cell::number(rate.map(|rate| index as f64 / rate)),
            Cell::number(rate.map(|rate| from_trigger / rate)),
            value(|signal| &signal.force),
            value(|signal| &signal.acceleration),
            force,
            acceleration,
            wide_force,
            wide_acceleration,
        ]
    })
}
