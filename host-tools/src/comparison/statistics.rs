//! All strikes of a recording together: mean, spread, where they lie, and how they change.

use hertz_charts::Error;
use hertz_charts::{Axis, COLUMN, Chart, Ink, Mark, Panel, Series, WIDTH};

use crate::comparison::spread;
use crate::comparison::strike::{ShapeValues, StrikeComparison, percent};

/// Bars of a histogram.
const BINS: usize = 12;
/// Strikes that the history shows; of more, every second, third and so on.
const SHOWN: usize = 2000;

/// A quantity of every strike: its name with its unit, the unit's scale, digits, and how to find it by the
/// bead and by the full chain.
struct Quantity {
    name: &'static str,
    scale: f64,
    digits: usize,
    device: fn(&StrikeComparison) -> Option<f64>,
    truth: fn(&StrikeComparison) -> Option<f64>,
}

macro_rules! shape {
    ($name:literal, $field:ident, $scale:literal, $digits:literal) => {
        Quantity {
            name: $name,
            scale: $scale,
            digits: $digits,
            device: |strike| {
                strike
                    .shape
                    .map(|shape| found(shape.device, |shape| shape.$field))?
            },
            truth: |strike| strike.shape.map(|shape| shape.f64_chain.$field),
        }
    };
}

/// A value that could not be found is 0.
fn found(shape: ShapeValues, of: fn(ShapeValues) -> f64) -> Option<f64> {
    Some(of(shape)).filter(|value| *value != 0.0)
}

const QUANTITIES: [Quantity; 9] = [
    Quantity {
        name: "A, measured (nJ)",
        scale: 1e9,
        digits: 3,
        device: |strike| Some(strike.device.absorbed_measured),
        truth: |strike| Some(strike.f64_chain.absorbed_measured),
    },
    Quantity {
        name: "B, predicted (nJ)",
        scale: 1e9,
        digits: 3,
        device: |strike| Some(strike.device.absorbed_predicted),
        truth: |strike| Some(strike.f64_chain.absorbed_predicted),
    },
    Quantity {
        name: "peak force (N)",
        scale: 1.0,
        digits: 5,
        device: |strike| Some(strike.device.peak_force),
        truth: |strike| Some(strike.f64_chain.peak_force),
    },
    shape!("width at half height (µs)", width, 1e6, 2),
    shape!("impulse (mN·s)", impulse, 1e3, 4),
    shape!("ringing (Hz)", ring_frequency, 1.0, 1),
    shape!("its decay (1/s)", ring_decay, 1.0, 1),
    shape!("so k is (kN/m)", stiffness, 1e-3, 1),
    shape!("and c (N·s/m)", damping, 1.0, 2),
];

/// Mean and spread of some values.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Spread {
    mean: f64,
    /// Standard deviation, from the values themselves: n - 1.
    deviation: f64,
    least: f64,
    greatest: f64,
}

impl Spread {
    /// None for fewer than two values.
    fn of(values: &[f64]) -> Option<Self> {
        if values.len() < 2 {
            return None;
        }
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        Some(Self {
            mean,
            deviation: (squares / (count - 1.0)).sqrt(),
            least: values.iter().copied().fold(f64::INFINITY, f64::min),
            greatest: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        })
    }

    /// How many of the values lie in each of [`BINS`] parts between the least and the greatest.
    fn histogram(&self, values: &[f64]) -> [usize; BINS] {
        let mut bins = [0; BINS];
        let width = (self.greatest - self.least) / BINS as f64;
        for value in values {
            let bin = if width > 0.0 {
                (value - self.least) / width
            } else {
                0.0
            };
            bins[(bin as usize).min(BINS - 1)] += 1;
        }
        bins
    }
}

/// The part of the page about all strikes; nothing for one strike.
///
/// # Errors
/// The chart cannot be drawn.
pub(super) fn section(strikes: &[StrikeComparison], goals: &[spread::Spread; 2]) -> Result<String, Error> {
    let rows: String = QUANTITIES
        .iter()
        .enumerate()
        .filter_map(|(number, quantity)| row(quantity, strikes, goals.get(number)))
        .collect();
    if rows.is_empty() {
        return Ok(String::new());
    }
    Ok(format!(
        "<section><h2>All {} strikes</h2><p>By the bead. The spread is a standard deviation; the mean is off the full chain \
         by what stands beside it, give or take two standard errors. Bars show how often each value came, from the least \
         to the greatest. Goals: {}.</p><div class=\"scroll\"><table><thead><tr><th></th><th>mean</th><th>spread</th>\
         <th class=\"more\">least</th><th class=\"more\">greatest</th><th>mean off by</th><th>values</th></tr></thead>\
         <tbody>{rows}</tbody></table></div>{}</section>",
        strikes.len(),
        goals.each_ref().map(goal).join("; "),
        picture(&history(strikes))?
    ))
}

/// What is asked of the mean and the scatter of an estimate, and whether it is met.
fn goal(spread: &spread::Spread) -> String {
    format!(
        "{}, mean ±{:.1} %, scatter {:.1} %, {}",
        spread.estimate,
        spread.goal * 100.0,
        spread.scatter_goal * 100.0,
        if spread.pass { "met" } else { "missed" }
    )
}

fn row(quantity: &Quantity, strikes: &[StrikeComparison], goal: Option<&spread::Spread>) -> Option<String> {
    let Quantity {
        name,
        scale,
        digits,
        device,
        truth,
    } = quantity;
    let values: Vec<f64> = strikes.iter().filter_map(device).collect();
    let spread = Spread::of(&values)?;
    let offs = strikes
        .iter()
        .filter_map(|strike| Some(device(strike)? / truth(strike)? - 1.0));
    let offs = Spread::of(&offs.collect::<Vec<_>>());
    let off = offs.map_or_else(
        || "–".to_owned(),
        |off| {
            let error = 2.0 * off.deviation / (values.len() as f64).sqrt();
            format!(
                "{} ± {:.3}",
                percent(off.mean).trim_end_matches(" %"),
                error * 100.0
            ) + " %"
        },
    );
    let shown = |value: f64| format!("{:.digits$}", value * scale);
    let bins = spread.histogram(&values);
    let most = bins.iter().copied().max().unwrap_or(1).max(1);
    let bars = bins.map(|count| {
        format!(
            "<i style=\"height:{:.0}%\"></i>",
            100.0 * count as f64 / most as f64
        )
    });
    let class = goal.map_or("", |goal| if goal.pass { "pass" } else { "fail" });
    Some(format!(
        "<tr><td>{name}</td><td>{}</td><td>{}</td><td class=\"more\">{}</td><td class=\"more\">{}</td>\
         <td class=\"{class}\">{off}</td><td><span class=\"bins\">{}</span></td></tr>",
        shown(spread.mean),
        shown(spread.deviation),
        shown(spread.least),
        shown(spread.greatest),
        bars.concat()
    ))
}

/// How far both estimates are off, strike by strike.
fn history(strikes: &[StrikeComparison]) -> Chart {
    let every = strikes.len().div_ceil(SHOWN);
    let series = |name: &str, ink, mark, of: fn(&StrikeComparison) -> f64| Series {
        name: name.to_owned(),
        ink,
        mark,
        points: (0..)
            .zip(strikes)
            .step_by(every)
            .map(|(n, strike)| (f64::from(n), of(strike) * 100.0))
            .collect(),
    };
    let curves = vec![
        series("A, measured", Ink::Measured, Mark::Rings, |strike| {
            strike.deviation.absorbed_measured
        }),
        series("B, predicted", Ink::Predicted, Mark::Discs, |strike| {
            strike.deviation.absorbed_predicted
        }),
    ];
    Chart {
        description: "How far both estimates are off the full chain, strike by strike".to_owned(),
        width: WIDTH,
        ..Chart::new(
            Axis::count("strike, in the order of the recording", 0..=strikes.len() - 1),
            vec![Panel::new("off the full chain (%)", curves).height(190)],
        )
    }
}

/// A chart for a page: drawn for a wide window, and once more for a narrow one.
///
/// # Errors
/// It cannot be drawn.
pub(super) fn picture(chart: &Chart) -> Result<String, Error> {
    let narrow = Chart {
        width: COLUMN,
        ..chart.clone()
    };
    Ok(format!(
        "<div class=\"wide\">{}</div><div class=\"narrow\">{}</div>",
        chart.inline_svg()?,
        narrow.inline_svg()?
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_spread_are_those_of_a_textbook() {
        let values = [2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0];
        let spread = Spread::of(&values).unwrap();
        assert_eq!((spread.mean, spread.least, spread.greatest), (5.0, 2.0, 9.0));
        assert!((spread.deviation - (32.0_f64 / 7.0).sqrt()).abs() < 1e-15);
        let bins = spread.histogram(&values);
        assert_eq!(bins.iter().sum::<usize>(), values.len());
        assert_eq!((bins[0], bins[3], bins[5], bins[BINS - 1]), (1, 3, 2, 1));
        assert_eq!(Spread::of(&[1.0]), None);
        assert_eq!(Spread::of(&[3.0; 4]).unwrap().histogram(&[3.0; 4])[0], 4);
    }
}
