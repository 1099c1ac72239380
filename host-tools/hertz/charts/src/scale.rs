//! Scales of axes, and where their ticks stand.

use std::ops::Range;

/// The scale of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Scale {
    /// Equal steps have equal lengths.
    #[default]
    Linear,
    /// Linear, for counts: every tick is a whole number.
    Count,
    /// Equal factors have equal lengths; points that are not positive are left out.
    Log,
}

impl Scale {
    /// The place of a value on an axis of this scale, in the scale's own unit.
    pub fn place(self, value: f64) -> f64 {
        match self {
            Self::Linear | Self::Count => value,
            Self::Log => value.log10(),
        }
    }
}

/// The least and the greatest finite value; infinite, and the greater first, if there is none.
pub fn ends(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let wider = |(low, high): (f64, f64), value: f64| (low.min(value), high.max(value));
    let finite = values.filter(|value| value.is_finite());
    finite.fold((f64::INFINITY, f64::NEG_INFINITY), wider)
}

/// The ticks of an axis, as places on its scale.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Ticks {
    /// Ticks with a label.
    pub(super) major: Vec<(f64, String)>,
    /// Ticks between those, without a label.
    pub(super) minor: Vec<f64>,
}

/// The steps between decades that may have numbers, the densest first.
const DIGITS: [&[u8]; 5] = [
    &[1, 2, 3, 4, 5, 6, 7, 8, 9],
    &[1, 2, 3, 5],
    &[1, 2, 5],
    &[1, 3],
    &[1],
];
/// Over fewer decades than this, equal steps of the value read better than digits of a decade.
const SHORT: f64 = 0.6;
/// Over more decades than this, the steps between them have no ticks.
const DECADES: f64 = 7.0;

impl Ticks {
    /// The ticks of an axis from one place to another, at most about `most` of them with numbers.
    pub(super) fn new(scale: Scale, (low, high): (f64, f64), most: usize) -> Self {
        if !(low.is_finite() && high.is_finite()) {
            return Self::default();
        }
        let slack = 1e-9 * (high - low);
        let inside = |place: &f64| (low - slack..=high + slack).contains(place);
        match scale {
            Scale::Linear => Self::linear((low, high), most, false, inside),
            Scale::Count => Self::linear((low, high), most, true, inside),
            Scale::Log => Self::log((low, high), most, inside),
        }
    }

    /// Names at 0, 1, 2 and so on, in equal steps, `most` of them at most.
    pub(super) fn named(names: &[String], (low, high): (f64, f64), most: usize) -> Self {
        let step = names.len().div_ceil(most.max(1)).max(1);
        let places = names.iter().enumerate().step_by(step);
        let ticks = places.map(|(place, name)| (place as f64, name.clone()));
        Self {
            major: ticks.filter(|(place, _)| (low..=high).contains(place)).collect(),
            minor: Vec::new(),
        }
    }

    /// Steps of 1, 2 or 5 times a power of ten. If `whole`, all ticks are whole numbers. A range that f64
    /// cannot divide, of 1e-320 or of more than 1.8e308, has no ticks.
    fn linear((low, high): (f64, f64), most: usize, whole: bool, inside: impl Fn(&f64) -> bool) -> Self {
        let rough = (high - low) / most as f64;
        let rough = if whole { rough.max(1.0) } else { rough };
        let decade = 10_f64.powf(rough.log10().floor());
        // A step, and the parts into which minor ticks divide it.
        let steps = [(1.0, 5), (2.0, 4), (5.0, 5), (10.0, 5)];
        let fits = |(digit, _): &(f64, i64)| digit * decade >= rough * (1.0 - 1e-9);
        let (digit, parts) = steps.into_iter().find(fits).unwrap_or((10.0, 5));
        let step = digit * decade;
        let parts = if whole && step < 10.0 { step as i64 } else { parts };
        let fine = step / parts as f64;
        if !fine.is_normal() {
            return Self::default();
        }
        let all = ((low / fine).floor() as i64..=(high / fine).ceil() as i64).map(|n| (n, n as f64 * fine));
        let (major, minor): (Vec<_>, Vec<_>) = all
            .filter(|(_, place)| inside(place))
            .partition(|(n, _)| n % parts == 0);
        let places: Vec<f64> = major.into_iter().map(|(_, place)| place).collect();
        Self {
            major: places.iter().copied().zip(labels(&places, step)).collect(),
            minor: minor.into_iter().map(|(_, place)| place).collect(),
        }
    }

    /// Decades, with as many steps between them as there is room for.
    fn log((low, high): (f64, f64), most: usize, inside: impl Fn(&f64) -> bool) -> Self {
        let decades = || low.floor() as i32..=high.ceil() as i32;
        let at = |digits: &[u8]| -> Vec<f64> {
            let step = |decade: i32, digit: &u8| f64::from(decade) + f64::from(*digit).log10();
            let steps = |decade| digits.iter().map(move |digit| step(decade, digit));
            decades().flat_map(steps).filter(&inside).collect()
        };
        let mut major = DIGITS
            .iter()
            .map(|digits| at(digits))
            .find(|places| places.len() <= most)
            .unwrap_or_else(|| {
                let apart = ((high - low) / most as f64).ceil().max(1.0) as i32;
                let kept = decades().filter(|decade| decade % apart == 0).map(f64::from);
                kept.filter(&inside).collect()
            });
        let mut minor = at(if high - low < DECADES { DIGITS[0] } else { &[1] });
        if major.len() < 2 || high - low < SHORT {
            // A range this short has too few round numbers, so the ticks are equal steps of the value.
            let ends = (10_f64.powf(low), 10_f64.powf(high));
            let value = |place: &f64| (ends.0..=ends.1).contains(place);
            let linear = Self::linear(ends, most, false, value);
            major = linear.major.into_iter().map(|(value, _)| value.log10()).collect();
            minor = linear.minor.into_iter().map(f64::log10).collect();
        }
        minor.retain(|place| major.iter().all(|tick| (tick - place).abs() > 1e-9));
        let plain = major.iter().all(|place| (-3.01..4.01).contains(place));
        let label = |place: f64| {
            if plain {
                number(10_f64.powf(place))
            } else {
                power(place)
            }
        };
        Self {
            major: major.into_iter().map(|place| (place, label(place))).collect(),
            minor,
        }
    }
}

/// Range of plain numbers: ticks with shorter steps, or that reach further, are labelled with powers of ten.
const PLAIN: Range<f64> = 0.999e-6..1e7;

/// The labels of equal steps. Where [`number`] has too few decimals or too many digits, all labels of an
/// axis have the power of ten of the greatest, and the digits that the steps need.
fn labels(places: &[f64], step: f64) -> Vec<String> {
    let greatest = places.iter().fold(0.0, |most: f64, place| most.max(place.abs()));
    if step >= PLAIN.start && greatest < PLAIN.end {
        return places.iter().copied().map(number).collect();
    }
    let exponent = greatest.max(step).log10().floor();
    let decimals = (exponent - (step * (1.0 + 1e-9)).log10().floor()).clamp(0.0, 15.0) as usize;
    let label = |place: &f64| match place / step {
        steps if steps.abs() < 0.5 => "0".to_owned(),
        _ => {
            // In two parts, since a power of ten may be beyond what an f64 holds.
            let digits = place / 10_f64.powf(0.5 * exponent) / 10_f64.powf(0.5 * exponent);
            let digits = format!("{digits:.decimals$}").replace('-', "−");
            format!("{digits}·10^({})", number(exponent))
        }
    };
    places.iter().map(label).collect()
}

/// A number as a power of ten, with a raised exponent.
fn power(place: f64) -> String {
    let mut exponent = place.floor();
    let mut digit = 10_f64.powf(place - exponent);
    if digit > 9.999 {
        (digit, exponent) = (1.0, exponent + 1.0);
    }
    let raised = format!("10^({})", number(exponent));
    match number(digit).as_str() {
        "1" => raised,
        digit => format!("{digit}·{raised}"),
    }
}

/// A number with as many decimals as it needs, a true minus, no negative zero.
fn number(value: f64) -> String {
    let rounded = (value * 1e6).round() / 1e6;
    if rounded == 0.0 {
        return "0".to_owned();
    }
    format!("{rounded}").replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Scale, ends and number of an axis, and its labels.
    const LABELS: &str = "\
Linear 0 1 5: 0 0.2 0.4 0.6 0.8 1
Linear -3 8 6: −2 0 2 4 6 8
Linear 0 4e-6 5: 0 0.000001 0.000002 0.000003 0.000004
Linear 0 8e-7 5: 0 2·10^(−7) 4·10^(−7) 6·10^(−7) 8·10^(−7)
Linear -3e-20 1e-20 5: −3·10^(−20) −2·10^(−20) −1·10^(−20) 0 1·10^(−20)
Linear 0 2e7 5: 0 0.5·10^(7) 1.0·10^(7) 1.5·10^(7) 2.0·10^(7)
Linear 3.681e16 3.684e16 5: 3.681·10^(16) 3.682·10^(16) 3.683·10^(16) 3.684·10^(16)
Linear -1e300 1e300 5: −1.0·10^(300) −0.5·10^(300) 0 0.5·10^(300) 1.0·10^(300)
Linear 0 4e-300 5: 0 1·10^(−300) 2·10^(−300) 3·10^(−300) 4·10^(−300)
Count -0.5 4.5 9: 0 1 2 3 4
Count -0.5 0.5 9: 0
Count -0.5 19.5 9: 0 5 10 15
Log 27 105 9: 30 40 50 60 70 80 90 100
Log 0.08 0.21 8: 0.08 0.1 0.12 0.14 0.16 0.18 0.2
Log 0.3 300 8: 0.3 1 3 10 30 100 300
Log 1e-16 1e-3 6: 10^(−15) 10^(−12) 10^(−9) 10^(−6) 10^(−3)
Log 101 149 5: 110 120 130 140
Log 1e3 1e7 5: 10^(3) 10^(4) 10^(5) 10^(6) 10^(7)";

    #[test]
    fn an_axis_has_round_numbers_with_the_digits_that_its_steps_need() {
        for (axis, expected) in LABELS.lines().map(|row| row.split_once(": ").unwrap()) {
            let (name, numbers) = axis.split_once(' ').unwrap();
            let scales = [Scale::Linear, Scale::Count, Scale::Log];
            let scale = scales
                .into_iter()
                .find(|scale| format!("{scale:?}") == name)
                .unwrap();
            let numbers: Vec<f64> = numbers.split(' ').map(|number| number.parse().unwrap()).collect();
            let ends = (scale.place(numbers[0]), scale.place(numbers[1]));
            let ticks = Ticks::new(scale, ends, numbers[2] as usize);
            let labels: Vec<String> = ticks.major.into_iter().map(|(_, label)| label).collect();
            assert_eq!(labels.join(" "), expected, "{axis}");
        }
    }

    #[test]
    fn finer_ticks_stand_between_the_numbers_and_are_whole_for_a_count() {
        assert_eq!(Ticks::new(Scale::Linear, (0.0, 2.0), 2).minor.len(), 8);
        for high in [4.5, 19.5, 199.5] {
            let ticks = Ticks::new(Scale::Count, (-0.5, high), 9);
            assert!(ticks.minor.iter().all(|place| place.fract() == 0.0), "{ticks:?}");
        }
    }

    #[test]
    fn a_range_that_cannot_be_divided_has_no_ticks() {
        for (low, high) in [(0.0, 5e-324), (-1e-310, 2e-310), (-1.7e308, 1.7e308)] {
            assert_eq!(Ticks::new(Scale::Linear, (low, high), 6), Ticks::default());
        }
        for scale in [Scale::Linear, Scale::Count, Scale::Log] {
            for ends in [(f64::NEG_INFINITY, 0.0), (0.0, f64::NAN)] {
                assert_eq!(Ticks::new(scale, ends, 6), Ticks::default());
            }
        }
        // The shortest ranges at a place far away, and near 0.
        let far = 1e30_f64.next_up();
        for (low, high) in [(1e30, far), (0.0, 1e-300), (-1e300, 1e300)] {
            let ticks = Ticks::new(Scale::Linear, (low, high), 6);
            let count = ticks.major.len() + ticks.minor.len();
            assert!((1..=60).contains(&count), "{ticks:?}");
        }
    }

    #[test]
    fn names_stand_at_their_places_and_are_thinned_out_where_they_are_many() {
        let names = ["8", "3 4", "12", "5", "6"].map(str::to_owned);
        for (most, expected) in [(9, "0: 8, 1: 3 4, 2: 12, 3: 5"), (3, "0: 8, 2: 12"), (0, "0: 8")] {
            let ticks = Ticks::named(&names, (-0.5, 3.5), most).major;
            let shown = ticks.iter().map(|(place, name)| format!("{place}: {name}"));
            assert_eq!(shown.collect::<Vec<_>>().join(", "), expected);
        }
    }
}
