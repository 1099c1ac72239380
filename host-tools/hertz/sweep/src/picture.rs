//! Charts of a sweep's table: curves and maps.

use std::path::Path;

use anyhow::Context;
use hertz_charts::{COLUMN, Chart, Ink, Map, Mark, Panel, Series, ends};

use crate::column::AxisColumn;
use crate::definition::Definition;
use crate::plan::Plan;
use crate::side::{Cells, ShownQuantity, Side};
use crate::view::{ChartForm, ChartLayout, ChosenPlace, MOST_POINTS, View};
use bead_tables::{Cell, Reader};

/// Greatest value that is drawn: differences of two stay finite.
const MOST_VALUE: f64 = 1e300;

/// Draws a table of a sweep.
///
/// # Errors
/// The file is no such table, or the view does not fit it.
pub fn chart(table: &Path, view: &View) -> anyhow::Result<Chart> {
    let reader = Reader::open(table)?;
    let sweep = reader.note("sweep").context("is not a table of bead sweep")?;
    let plan = Plan::new(Definition::from_toml(sweep, "its sweep")?)?;
    let (has, points) = (reader.rows(), plan.points());
    anyhow::ensure!(has == points, "has {has} rows, but its sweep has {points} points");
    let layout = view.layout(&plan).map_err(anyhow::Error::msg)?;
    let value = match &layout.form {
        ChartForm::Curves { y, .. } => y,
        ChartForm::Map { value, .. } => value,
    };
    let rows = values(&reader, &plan, &layout.at, value)?;
    let quantity = ShownQuantity::new(value, rows.iter().map(|row| row.1));
    match &layout.form {
        ChartForm::Curves { by, .. } => Ok(curves(&plan, &layout, by.as_ref(), &quantity, rows)),
        ChartForm::Map { y, .. } => map(&plan, &layout, y, &quantity, &rows),
    }
}

/// Reads the points at these places, and their values of a result.
fn values(reader: &Reader, plan: &Plan, at: &[ChosenPlace], result: &str) -> anyhow::Result<Vec<(u64, f64)>> {
    let column = |name: &str| {
        let column = reader.columns().iter().position(|column| column.name == name);
        column.with_context(|| format!("has no column {name}"))
    };
    let mut rows: Vec<(u64, f64)> = Vec::new();
    for batch in reader.batches(vec![column("point")?, column(result)?]) {
        for row in batch?.into_rows() {
            let point = match &row[0] {
                Cell::Whole(point) => u64::try_from(*point).ok(),
                _ => None,
            };
            let point = point.filter(|point| *point < plan.points());
            let point = point.context("has a row that belongs to no point of its sweep")?;
            if at.iter().all(|at| plan.place(point, at.axis) == at.place) {
                anyhow::ensure!(
                    rows.len() < MOST_POINTS,
                    "has some points twice, so others are missing"
                );
                let value = row[1].as_f64().filter(|value| value.abs() <= MOST_VALUE);
                rows.push((point, value.unwrap_or(f64::NAN)));
            }
        }
    }
    rows.sort_by_key(|row| row.0);
    if let Some(twice) = rows.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        anyhow::bail!("has point {} twice, so others are missing", twice[0].0);
    }
    anyhow::ensure!(
        rows.iter().any(|row| row.1.is_finite()),
        "has no point with a value of {result}; draw another result, or see why in the column `error`"
    );
    Ok(rows)
}

/// The text for readers who cannot see the chart, with the places that --at chose.
fn description(plan: &Plan, at: &[ChosenPlace], what: &str) -> String {
    let title = match plan.definition().title.as_str() {
        "" => String::new(),
        title => format!("{title}: "),
    };
    let at: String = at.iter().map(|place| format!(", at {}", place.label)).collect();
    format!("{title}{what}{at}")
}

/// The lines above the axes: the sweep's title, the column of the curves, and the places that --at chose.
fn note(plan: &Plan, by: Option<&Side>, at: &[ChosenPlace]) -> String {
    let title = Some(plan.definition().title.clone()).filter(|title| !title.is_empty());
    let by = by.map(|by| format!("by {}", by.quantity.label()));
    let at = at.iter().map(|place| format!("at {}", place.label));
    let lines: Vec<_> = title.into_iter().chain(by).chain(at).collect();
    lines.join("\n")
}

fn curves(
    plan: &Plan,
    layout: &ChartLayout<'_>,
    by: Option<&AxisColumn<'_>>,
    y: &ShownQuantity,
    rows: Vec<(u64, f64)>,
) -> Chart {
    let x = &layout.x;
    let across = Side::new(x);
    let count = by.map_or(1, |by| by.of.count);
    let mut points: Vec<Vec<(f64, f64)>> = vec![Vec::new(); count as usize];
    for (point, value) in rows {
        let curve = by.map_or(0, |by| plan.place(point, by.axis) as usize);
        let at = across.values[plan.place(point, x.axis) as usize];
        points[curve].push((at, value / y.unit));
    }
    let by = by.map(Side::new);
    let names = by.as_ref().map_or_else(Vec::new, Side::legend);
    let series = points.into_iter().enumerate().map(|(curve, mut points)| {
        points.sort_by(|one, other| one.0.total_cmp(&other.0));
        let name = names.get(curve).cloned().unwrap_or_default();
        let mark = if across.is_drawn {
            Mark::Discs
        } else {
            Mark::Family(curve)
        };
        Series::new(name, Ink::Curve(curve), mark, points)
    });
    let panel = Panel::new(y.label(), series.collect()).note(note(plan, by.as_ref(), &layout.at));
    let (low, high) = ends(across.values.iter().copied());
    // Texts need room on both sides.
    let room = if across.texts.is_empty() { 0.0 } else { 0.5 };
    let axis = across.axis((low - room, high + room));
    let what = format!("{} over {}", y.label(), axis.label);
    Chart {
        description: description(plan, &layout.at, &what),
        ..Chart::new(axis, vec![panel.height(300)])
    }
}

fn map(
    plan: &Plan,
    layout: &ChartLayout<'_>,
    y: &AxisColumn<'_>,
    value: &ShownQuantity,
    rows: &[(u64, f64)],
) -> anyhow::Result<Chart> {
    let x = &layout.x;
    let across = Cells::new(x).map_err(anyhow::Error::msg)?;
    let up = Cells::new(y).map_err(anyhow::Error::msg)?;
    let [x_range, y_range] = [&across, &up].map(|cells| ends(cells.edges.iter().copied()));
    let columns = across.edges.len() - 1;
    let mut values = vec![f64::NAN; columns * (up.edges.len() - 1)];
    for (point, found) in rows {
        let cell = |cells: &Cells, of: &AxisColumn<'_>| cells.of_places[plan.place(*point, of.axis) as usize];
        let (column, row) = (cell(&across, x), cell(&up, y));
        values[row * columns + column] = found / value.unit;
    }
    let (y_label, y_names) = up.side.names();
    let panel = Panel {
        y_scale: up.side.scale,
        y_names,
        ..Panel::new(y_label, Vec::new())
    };
    let axis = across.side.axis(x_range);
    let cells = Map {
        label: value.label(),
        x_edges: across.edges,
        y_edges: up.edges,
        values,
    };
    let panel = panel.range(y_range.0, y_range.1).height(360).map(cells);
    let what = format!("{} over {} and {}", value.label(), axis.label, panel.y_label);
    Ok(Chart {
        description: description(plan, &layout.at, &what),
        width: COLUMN,
        ..Chart::new(axis, vec![panel.note(note(plan, None, &layout.at))])
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::plan;
    use bead_tables::Writer;

    const BEADS: &str = "[[axis]]\nkey = \"intruder.1.beads\"\nvalues = [8, 12, [3, 4], 5]\n";
    const MASSES: &str = "[[axis]]\nzip = [\
        { key = \"intruder.1.mass\", values = [1e-3, 1e-3, 2e-3] },\
        { key = \"intruder.1.stiffness\", values = [1e5, 4e5, 4e5] }]\n";
    fn speeds(count: u64) -> String {
        format!("[[axis]]\nkey = \"striker.velocity\"\nlinspace = [0.2, 1.2, {count}]\n")
    }

    /// A view from words such as `x=COLUMN`.
    fn view(words: &str) -> View {
        let mut view = View::default();
        for word in words.split_whitespace() {
            let (option, value) = word.split_once('=').unwrap();
            let value = value.to_owned();
            match option {
                "x" => view.x = Some(value),
                "y" => view.y = Some(value),
                "map" => view.map = Some(value),
                "by" => view.by = Some(value),
                _ => view.at.push(value),
            }
        }
        view
    }

    fn checked(axes: &str, words: &str) -> Result<(), String> {
        view(words).check(&plan(axes))
    }

    /// Draws a table of these points with this result, as a sweep over these axes would leave it.
    fn drawn_over(
        points: impl IntoIterator<Item = i64>,
        result: &Cell,
        axes: &str,
        words: &str,
    ) -> Result<Chart, String> {
        let plan = plan(axes);
        let path = tempfile::NamedTempFile::new().unwrap();
        let mut file = path.reopen().unwrap();
        let sweep = plan.definition().to_toml();
        let mut table = Writer::parquet(&mut file, "sweep", &plan.columns(), &[("sweep", &sweep)]).unwrap();
        let first = plan.columns().len() - 1 - plan.definition().outputs.columns().len();
        for point in points {
            let mut row = plan.row(0, &Err("it was not run".to_owned()));
            row[0] = Cell::Whole(point);
            row[first] = result.clone();
            table.push(row).unwrap();
        }
        table.finish().unwrap();
        chart(path.path(), &view(words)).map_err(|error| error.to_string())
    }

    /// A whole sweep with a result at each point, as a picture.
    fn svg(axes: &str, words: &str) -> String {
        let points = 0..plan(axes).points() as i64;
        let chart = drawn_over(points, &Cell::Number(1e-6), axes, words);
        chart.unwrap().standalone_svg().unwrap()
    }

    #[test]
    fn values_that_cannot_be_told_apart_have_no_map_and_have_a_curve() {
        // Their logarithms are equal.
        let near = "[[axis]]\nkey = \"chain.young\"\nlogspace = [5e9, 5000000000.000001, 2]\n";
        for axes in [[&speeds(2), near], [near, &speeds(2)]] {
            let why = checked(&axes.concat(), "").unwrap_err();
            assert!(why.contains("cannot be told apart; draw a curve"), "{why}");
        }
        svg(near, "");
        let axes = [MASSES, &speeds(2)].concat();
        let why = checked(&axes, "map=absorbed_j y=intruder_1_mass_kg").unwrap_err();
        let expected =
            "some values of intruder_1_mass_kg cannot be told apart; draw a map over zip, or a curve";
        assert_eq!(why, expected);
        // The cells of the 3 × 2 points have one colour, so those of a row are one rectangle.
        let map = svg(&axes, "map=absorbed_j y=zip");
        assert_eq!(map.matches("crispEdges").count(), 128 + 3);
    }

    #[test]
    fn texts_stand_at_their_places_and_have_no_numbers() {
        let axes = [BEADS, &speeds(2)].concat();
        for words in ["x=intruder_1_beads by=striker_velocity_mps", "y=intruder_1_beads"] {
            let svg = svg(&axes, words);
            for name in [">8<", ">12<", ">3 4<", ">5<", ">intruder 1 beads<"] {
                assert!(svg.contains(name), "{name}: {svg}");
            }
            assert!(!svg.contains(">3<"), "{svg}");
        }
        let long = "[[axis]]\nkey = \"intruder.1.beads\"\nvalues = [8, [1, 2, 3, 4, 5, 6, 7]]\n";
        let svg = svg(long, "");
        let label = ">intruder 1 beads, by its place in the list<";
        assert!(
            svg.contains(label) && svg.contains(">1<") && svg.contains(">2<"),
            "{svg}"
        );
    }

    #[test]
    fn the_place_that_at_took_is_told() {
        let axes = [&speeds(3), MASSES].concat();
        let curve = svg(&axes, "x=zip at=striker_velocity_mps=5");
        let told = curve.matches("at striker velocity = 1.2 m/s").count();
        assert_eq!(told, 2, "note and description");
        let curve = svg(&axes, "by=striker_velocity_mps x=intruder_1_stiffness_n_per_m");
        assert!(!curve.contains("at striker"));
        let curve = svg(&axes, "x=striker_velocity_mps at=intruder_1_mass_kg=0");
        assert!(curve.contains(">at intruder 1 mass = 1 g (zip 0)<"), "{curve}");
        let axes = [BEADS, MASSES, &speeds(2)].concat();
        let curve = svg(&axes, "at=intruder_1_beads=12 at=zip=2");
        for note in [">at intruder 1 beads = 12<", ">at zip = 2<"] {
            assert!(curve.contains(note), "{curve}");
        }
    }

    /// Words for a sweep over speeds and masses, and the refusal.
    const REFUSALS_OF_TWO: &str = "\
at=zip=1 at=intruder_1_mass_kg=1 => another --at already chooses
x=zip at=intruder_1_mass_kg=1 => --x names an axis that --at fixes at one place
y=zip at=zip=1 => --y names an axis that --at fixes at one place
by=zip at=zip=1 => --by names an axis that --at fixes at one place
at=zip=nan => the value must be a finite number
at=zip=-inf => the value must be a finite number
at=zip=1 at=striker_velocity_mps=1 => there is no axis left for --x; leave out an --at";

    #[test]
    fn what_does_not_fit_the_axes_is_refused_before_the_work() {
        let two = [&speeds(3), MASSES].concat();
        let one = "[[axis]]\nkey = \"duration\"\nvalues = [1e-3]\n";
        let long = speeds(500_001) + "[[axis]]\nkey = \"chain.young\"\nlinspace = [1e9, 2e9, 2]\n";
        for (axes, rows) in [
            (&*two, REFUSALS_OF_TWO),
            (&speeds(3), "map=absorbed_j => a map needs two axes of the sweep"),
            (
                one,
                " => each axis of this sweep has one value; name the column of one with --x",
            ),
            (&speeds(1_000_001), " => 1000001 points are too many for curves"),
            (
                &long,
                "x=striker_velocity_mps by=chain_young_pa => 1000002 points are too many for curves",
            ),
        ] {
            for (words, why) in rows.lines().map(|row| row.split_once("=> ").unwrap()) {
                let found = checked(axes, words).unwrap_err();
                assert!(found.contains(why), "{words}: {found}");
            }
        }
        assert_eq!(checked(&speeds(1_000_000), ""), Ok(()));
        assert_eq!(checked(one, "x=duration_s"), Ok(()));
    }

    #[test]
    fn a_table_has_the_points_of_its_sweep() {
        let drawn = |points: &[i64], axes: &str| {
            drawn_over(points.iter().copied(), &Cell::Number(1e-6), axes, "").err()
        };
        assert_eq!(drawn(&[0, 1, 2], &speeds(3)), None);
        for (points, why) in [
            (&[0, 1][..], "has 2 rows, but its sweep has 3 points"),
            (&[0, 1, 3], "has a row that belongs to no point of its sweep"),
            (&[0, 1, -1], "has a row that belongs to no point of its sweep"),
            (&[1, 0, 1], "has point 1 twice, so others are missing"),
        ] {
            assert_eq!(drawn(points, &speeds(3)).as_deref(), Some(why));
        }
        let again = std::iter::repeat_n(0, MOST_POINTS + 2);
        let times = speeds(MOST_POINTS as u64 / 2 + 1).replace("striker.velocity", "duration");
        let axes = speeds(2) + &times;
        let why = drawn_over(again, &Cell::Number(1e-6), &axes, "at=striker_velocity_mps=0");
        let expected = "has some points twice, so others are missing";
        assert_eq!(why.err().as_deref(), Some(expected));
    }
}
