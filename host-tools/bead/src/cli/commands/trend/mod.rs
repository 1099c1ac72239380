//! `bead trend`: quantities of beads over days, with control limits.

mod arguments;

pub(crate) use arguments::Arguments;

use crate::cli::commands::prelude::*;
use crate::cli::table_file::TableFile;
use bead_compare::report::{DASH, EnergyUnit, count, number};
use bead_logbook::control::{BASE_GOOD, BASE_LEAST, SIGMAS};
use bead_logbook::index::Logbook;
use bead_logbook::picture;
use bead_logbook::quantity::Quantity;
use bead_logbook::trend::{BeadTrend, PointBy, QuantityTrend, trends};
use bead_logbook::{date, recording::LoggedRecording};
use bead_tables::{Cell, CellKind, Column};

/// Points beyond the limits of a quantity that are named.
const BEYOND_MOST: usize = 10;

/// The result as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct TrendReport {
    /// The rule of the limits.
    rule: &'static str,
    /// The strikes of a point.
    by: PointBy,
    /// The beads, by address.
    beads: Vec<BeadTrend>,
    /// Number of points beyond their limits.
    out_of_control: usize,
}

const RULE: &str = "Shewhart's chart of individual values (ISO 7870-2): mean of the base ± 3 s, s = mean moving range / 1.128";

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    place::apart(arguments.out.as_deref(), arguments.picture.as_deref())?;
    let overwrite = arguments.overwrite;
    let out = TableFile::optional(overwrite, arguments.out.as_deref(), &[])?;
    let picture = overwrite.optional(arguments.picture.as_deref(), FileKind::Drawing, &[])?;
    let filter = arguments.folder.filter();
    let logbooks = arguments.folder.open()?;
    // Recordings of different folders may have one name.
    let several = logbooks.len() > 1;
    let named = |folder: &Path, mut one: LoggedRecording| {
        if several {
            one.file = folder.join(&one.file).display().to_string();
        }
        one
    };
    let all_of = |one: Logbook| {
        let folder = one.folder;
        one.recordings
            .into_iter()
            .map(move |recording| named(&folder, recording))
    };
    let recordings: Vec<LoggedRecording> = logbooks.into_iter().flat_map(all_of).collect();
    let quantities: Vec<Quantity> = match &arguments.quantity[..] {
        [] => Quantity::ALL.to_vec(),
        some => some.iter().map(|name| (*name).into()).collect(),
    };
    let base = arguments.base.map(|base| base as usize);
    let beads = trends(&recordings, &filter, arguments.by.into(), base, &quantities);
    if beads.is_empty() {
        bail!(
            Input,
            "the chosen recordings have no strikes, so there is no trend; `bead list` with the same options shows the recordings"
        );
    }
    let report = TrendReport {
        rule: RULE,
        by: arguments.by.into(),
        out_of_control: all(&beads).map(|(_, trend)| trend.out_of_control).sum(),
        beads,
    };
    if let Some(out) = out {
        write_table(&out, &report.beads)?;
    }
    if let Some(picture) = picture {
        picture.write_bytes(picture::chart(&report.beads).standalone_svg()?)?;
    }
    for line in report.beyond() {
        note!("{line}");
    }
    output::print(arguments.format, &report, || report.table())?;
    if arguments.check && report.out_of_control > 0 {
        bail!(
            Verdict,
            "{} beyond the control limits; check the bead, or leave them out with --since and --note",
            count(report.out_of_control as u64, "point")
        );
    }
    Ok(())
}

fn all(beads: &[BeadTrend]) -> impl Iterator<Item = (u8, &QuantityTrend)> {
    let of = |bead: &'_ BeadTrend| bead.bead;
    beads
        .iter()
        .flat_map(move |bead| bead.quantities.iter().map(move |trend| (of(bead), trend)))
}

/// Shows values of a quantity: the unit, and a value in it.
fn shown(trend: &QuantityTrend) -> (String, impl Fn(f64) -> String) {
    let values = trend.points.iter().map(|point| point.value);
    let (unit, scale, digits) = match trend.quantity() {
        Quantity::Measured | Quantity::Predicted => {
            let unit = EnergyUnit::of(values);
            (unit.symbol, unit.scale, 3)
        }
        Quantity::Ratio => ("", 1.0, 5),
        Quantity::PeakForce => ("N", 1.0, 5),
        Quantity::RingFrequency => ("Hz", 1.0, 2),
        Quantity::ForceGains | Quantity::AccelerationGains => ("%", 100.0, 4),
        Quantity::Clock => ("ppm", 1.0, 3),
    };
    (unit.to_owned(), move |value| number(value * scale, digits))
}

impl TrendReport {
    /// A line for each point beyond its limits.
    fn beyond(&self) -> impl Iterator<Item = String> {
        all(&self.beads).flat_map(|(bead, trend)| {
            let (unit, shown) = shown(trend);
            let points = trend
                .points
                .iter()
                .filter(|point| point.out_of_control == Some(true));
            let lines = points.filter_map(|point| {
                let limits = trend.limits?;
                let (side, limit) = if point.value > limits.upper {
                    ("above the upper", limits.upper)
                } else {
                    ("below the lower", limits.lower)
                };
                Some(format!(
                    "bead {bead}: {} of {} ({}) is {} {unit}, {side} control limit, {} {unit}",
                    trend.quantity().title(),
                    date::short(point.time_unix_ns),
                    point.recording,
                    shown(point.value),
                    shown(limit)
                ))
            });
            let mut lines: Vec<String> = lines.take(BEYOND_MOST).collect();
            let more = trend.out_of_control - lines.len();
            if more > 0 {
                let quantity = trend.quantity().title();
                lines.push(format!(
                    "bead {bead}: {quantity}: {more} more beyond the limits; --format json has all"
                ));
            }
            lines
        })
    }

    fn table(&self) -> String {
        let rows = all(&self.beads).map(|(bead, trend)| {
            let (unit, shown) = shown(trend);
            let known = |value: Option<f64>| value.map_or_else(|| DASH.to_owned(), &shown);
            let last = trend.points.last();
            let unit = if unit.is_empty() {
                String::new()
            } else {
                format!(" ({unit})")
            };
            [
                format!("bead {bead}, {}{unit}", trend.quantity().title()),
                trend.points.len().to_string(),
                known(trend.limits.map(|limits| limits.centre)),
                known(trend.limits.map(|limits| limits.lower)),
                known(trend.limits.map(|limits| limits.upper)),
                known(last.map(|last| last.value)),
                known(last.and_then(|last| last.u)),
                trend.out_of_control.to_string(),
            ]
        });
        let table = output::table(
            "| points | mean | lower limit | upper limit | last | u | beyond",
            rows,
        );
        let mut lines = vec![format!("limits: {RULE}")];
        let bases = || all(&self.beads).map(|(_, trend)| trend.limits.map_or(0, |limits| limits.base));
        if bases().any(|base| base == 0) {
            lines.push(format!(
                "no limits where there are fewer than {BASE_LEAST} points"
            ));
        } else if bases().any(|base| base < BASE_GOOD) {
            lines.push(format!(
                "limits from fewer than {BASE_GOOD} points are a guide: more than 0.27 % of good points are beyond ± {SIGMAS} s"
            ));
        }
        format!("{table}\n\n{}", lines.join("\n"))
    }
}

fn write_table(out: &TableFile, beads: &[BeadTrend]) -> Result<(), Failure> {
    let columns = [
        ("bead", CellKind::Whole),
        ("quantity", CellKind::Text),
        ("unit", CellKind::Text),
        ("time_unix_ns", CellKind::Whole),
        ("recording", CellKind::Text),
        ("strikes", CellKind::Whole),
        ("value", CellKind::Number),
        ("u", CellKind::Number),
        ("centre", CellKind::Number),
        ("lower", CellKind::Number),
        ("upper", CellKind::Number),
        ("out_of_control", CellKind::Whole),
    ];
    let columns = columns.map(|(name, kind)| Column::new(name, kind));
    out.write("trend", &columns, |table| {
        for (bead, trend) in all(beads) {
            for point in &trend.points {
                let limit = |of: fn(&bead_logbook::control::ControlLimits) -> f64| {
                    Cell::number(trend.limits.as_ref().map(of))
                };
                table.push(vec![
                    Cell::whole(bead),
                    Cell::text(Some(trend.quantity)),
                    Cell::text(Some(trend.unit)),
                    Cell::Whole(point.time_unix_ns),
                    Cell::text(Some(&point.recording)),
                    Cell::whole(point.strikes as u64),
                    Cell::Number(point.value),
                    Cell::number(point.u),
                    limit(|limits| limits.centre),
                    limit(|limits| limits.lower),
                    limit(|limits| limits.upper),
                    point
                        .out_of_control
                        .map_or(Cell::Null, |out| Cell::whole(u8::from(out))),
                ])?;
            }
        }
        Ok(())
    })?;
    Ok(())
}
