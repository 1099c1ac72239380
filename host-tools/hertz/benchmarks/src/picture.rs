//! Time over error, a picture for each case.

use std::path::Path;

use hertz_charts::{Axis, Chart, Ink, Mark, Panel, Series, WIDTH};

use crate::report::{Comparison, ErrorAndTime, Foreign, Measurements, front};

const ERRORS: (f64, f64) = (1e-12, 1e-4);

fn panel(report: &Measurements, comparison: &Comparison) -> Panel {
    let own = comparison.rows.iter().map(|row| (&row.solver, &row.points));
    let is_of_case = |row: &&Foreign| row.case == comparison.name && !comparison.sampled;
    let others = report.peers.iter().filter(is_of_case);
    let others = others.map(|row| (&row.solver, &row.points));
    let shown = |(place, (solver, points)): (usize, (&String, &Vec<ErrorAndTime>))| {
        let front = front(points.clone()).into_iter();
        let points: Vec<_> = front.map(|(error, s)| (error, 1e3 * s)).collect();
        let inside = points
            .iter()
            .any(|(error, _)| (ERRORS.0..=ERRORS.1).contains(error));
        inside.then(|| Series::new(solver, Ink::Curve(place), Mark::Family(place), points))
    };
    let series = own.chain(others).enumerate().filter_map(shown).collect();
    let what = if comparison.sampled {
        "1000 samples"
    } else {
        "the end only"
    };
    Panel::new("time (ms)", series)
        .log()
        .height(if comparison.sampled { 240 } else { 360 })
        .note(what)
}

/// Writes the pictures into a folder.
pub(crate) fn draw(report: &Measurements, folder: &Path) -> Result<(), String> {
    for name in ["A", "B"] {
        let is_of_case = |comparison: &&Comparison| comparison.name == name;
        let of_case = report.comparisons.iter().filter(is_of_case);
        let panels = of_case.map(|comparison| panel(report, comparison)).collect();
        let x = Axis::log(
            "greatest error of a velocity, over the greatest velocity",
            ERRORS.0..ERRORS.1,
        );
        let chart = Chart {
            description: format!("Time that each solver takes on case {name}, over the error that it makes"),
            width: WIDTH,
            ..Chart::new(x, panels)
        };
        let svg = chart.standalone_svg().map_err(|error| error.to_string())?;
        let path = folder.join(format!("work-precision-{}.svg", name.to_lowercase()));
        std::fs::write(&path, svg).map_err(|error| format!("{}: {error}", path.display()))?;
    }
    Ok(())
}
