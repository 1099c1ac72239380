//! All strikes of a recording together: mean, spread, distribution and history.

use hertz_charts::{Axis, Chart, Ink, Mark, Panel, Series};

use crate::pictures::wide;
use crate::quantities::{DEVICE, QUANTITIES, StrikeQuantity, energy_unit};
use crate::report::{Chapter, DASH, EnergyUnit, Grid, GridCell, percent_within};
use crate::spread::{RunningMean, Spread, mean_uncertainty};
use crate::strike::StrikeComparison;

const BINS: usize = 12;
/// Greatest number of strikes in the history; of more, it shows every second, third and so on.
const SHOWN: usize = 2000;

#[derive(Debug, Clone, Copy, PartialEq)]
struct Distribution {
    mean: f64,
    /// Standard deviation, by n - 1.
    deviation: f64,
    least: f64,
    greatest: f64,
}

impl Distribution {
    /// None for fewer than two values.
    fn of(values: &[f64]) -> Option<Self> {
        let mut running = RunningMean::default();
        values.iter().for_each(|value| running.push(*value));
        Some(Self {
            mean: running.mean,
            deviation: running.scatter()?,
            least: values.iter().copied().fold(f64::INFINITY, f64::min),
            greatest: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        })
    }

    /// The number of values in each of [`BINS`] parts between the least and the greatest.
    fn histogram(&self, values: &[f64]) -> Vec<usize> {
        let mut bins = vec![0; BINS];
        let width = (self.greatest - self.least) / BINS as f64;
        for value in values {
            // Equal values have no width, and are all in the first bin.
            let bin = ((value - self.least) / width).max(0.0);
            bins[(bin as usize).min(BINS - 1)] += 1;
        }
        bins
    }
}

/// The section about all strikes; `None` for one strike. `goals` are those of A and of B.
pub(super) fn section(strikes: &[StrikeComparison], goals: &[Spread; 2]) -> Option<Chapter> {
    let unit = energy_unit(strikes);
    let quantities = QUANTITIES
        .iter()
        .zip(goals.iter().map(Some).chain(std::iter::repeat(None)));
    let rows = quantities.filter_map(|(quantity, goal)| row(quantity, strikes, goal, unit));
    let text = "Values by the bead. The spread is a standard deviation. The column mean off by is the deviation of the mean \
                from the full chain; the true mean lies within the uncertainty in 19 cases of 20. Bars show how often each value \
                occurred, from the least to the greatest.";
    let count = strikes.len();
    let headings =
        format!("all {count} strikes | mean | spread | ~least | ~greatest | mean off by | #values");
    let table = Grid::new(&headings, rows);
    let section = Chapter::new(format!("All {count} strikes"))
        .text(text)
        .table(table);
    (count > 1).then(|| section.chart(history(strikes)))
}

fn row(
    quantity: &StrikeQuantity,
    strikes: &[StrikeComparison],
    goal: Option<&Spread>,
    unit: EnergyUnit,
) -> Option<Vec<GridCell>> {
    let values = strikes
        .iter()
        .filter_map(|strike| quantity.values(strike)[DEVICE]);
    let values: Vec<f64> = values.collect();
    let distribution = Distribution::of(&values)?;
    let offs: Vec<f64> = strikes.iter().filter_map(|strike| quantity.off(strike)).collect();
    let off = match goal {
        // Over all strikes of the recording, including those that are not kept.
        Some(goal) => percent_within(goal.mean, goal.uncertainty),
        None => Distribution::of(&offs).map_or(DASH.to_owned(), |off| {
            let by_scatter = mean_uncertainty(off.deviation, offs.len());
            percent_within(off.mean, Some(by_scatter + quantity.bias.unwrap_or(0.0)))
        }),
    };
    let (name, scale) = quantity.shown_in(unit);
    let digits = quantity.digits;
    let shown = |value: f64| format!("{:.digits$}", value * scale);
    Some(vec![
        name.into(),
        shown(distribution.mean).into(),
        GridCell::judged(shown(distribution.deviation), goal.map(Spread::scatter_met)),
        shown(distribution.least).into(),
        shown(distribution.greatest).into(),
        GridCell::judged(off, goal.map(Spread::mean_met)),
        GridCell::Histogram(distribution.histogram(&values)),
    ])
}

fn history(strikes: &[StrikeComparison]) -> Chart {
    let every = strikes.len().div_ceil(SHOWN);
    let series = |name: &str, ink, mark, of: fn(&StrikeComparison) -> f64| {
        let shown = (0..).zip(strikes).step_by(every);
        let points = shown.map(|(n, strike)| (f64::from(n), of(strike) * 100.0));
        Series::new(name, ink, mark, points)
    };
    let curves = vec![
        series("A, measured", Ink::Measured, Mark::Rings, |strike| {
            strike.deviation.absorbed_measured
        }),
        series("B, predicted", Ink::Predicted, Mark::Discs, |strike| {
            strike.deviation.absorbed_predicted
        }),
    ];
    let description = "Deviation of both estimates from the full chain, strike by strike";
    let x = Axis::count("strike, in the order of the recording", 0..=strikes.len() - 1);
    let panel = Panel::new("off the full chain (%)", curves).height(190);
    wide(description, x, vec![panel])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_spread_are_those_of_a_textbook() {
        let values = [2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0];
        let spread = Distribution::of(&values).unwrap();
        assert_eq!((spread.mean, spread.least, spread.greatest), (5.0, 2.0, 9.0));
        assert!((spread.deviation - (32.0_f64 / 7.0).sqrt()).abs() < 1e-15);
        let bins = spread.histogram(&values);
        assert_eq!(bins.iter().sum::<usize>(), values.len());
        assert_eq!((bins[0], bins[3], bins[5], bins[BINS - 1]), (1, 3, 2, 1));
        assert_eq!(Distribution::of(&[1.0]), None);
        assert_eq!(Distribution::of(&[3.0; 4]).unwrap().histogram(&[3.0; 4])[0], 4);
    }
}
