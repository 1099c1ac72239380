//! The table `samples`: a row for each sample of each strike, measured and computed.

use std::sync::Arc;

use bead_tables::{Cell, CellKind, Column};

use crate::model::SignalSample;
use crate::series::Channel;

/// The columns, in their order.
pub fn columns() -> Vec<Column> {
    let mut columns = vec![
        Column::new("id", CellKind::Whole),
        Column::new("recording", CellKind::Text),
        Column::new("address", CellKind::Whole),
        Column::new("uid", CellKind::Text),
        Column::new("strike", CellKind::Whole),
        Column::new("channel", CellKind::Text),
        Column::new("unit", CellKind::Text),
    ];
    let numbers = ["time_from_trigger_s", "measured", "computed", "noise"];
    columns.extend(numbers.map(|name| Column::new(name, CellKind::Number)));
    columns
}

/// Name of a channel in tables and JSON.
pub fn channel_name(channel: Channel) -> &'static str {
    ["force", "wide_force", "acceleration", "wide_acceleration"][channel.place()]
}

/// The rows of a strike, a cell for each of the [`columns`]. `id` counts the strikes of the table.
pub fn rows(
    (id, address, uid): (u64, u8, Option<&str>),
    (recording, strike): (&str, u32),
    samples: Vec<SignalSample>,
) -> impl Iterator<Item = Vec<Cell>> {
    let (uid, recording): (_, Arc<str>) = (Cell::text(uid), recording.into());
    samples.into_iter().map(move |sample| {
        let unit = if sample.channel.is_force() { "N" } else { "m/s²" };
        vec![
            Cell::whole(id),
            Cell::Text(Arc::clone(&recording)),
            Cell::whole(address),
            uid.clone(),
            Cell::whole(strike),
            Cell::text(Some(channel_name(sample.channel))),
            Cell::text(Some(unit)),
            Cell::number(Some(sample.time)),
            Cell::number(Some(sample.measured)),
            Cell::number(Some(sample.computed)),
            Cell::number(Some(sample.deviation)),
        ]
    })
}
