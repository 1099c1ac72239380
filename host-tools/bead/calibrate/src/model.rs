//! Measurement models: results as functions of inputs, and the law of propagation of uncertainty.
//!
//! # Design
//! A model is a function from inputs to results (JCGM 100, 4.1). Its sensitivities are central differences
//! of the function over ± one standard uncertainty (5.1.3, note 2): no derivative is written by hand.
//! [`Combined`] of bead-compare implements the law of propagation, the effective degrees of freedom and the
//! coverage factor. Results of one model share inputs, so they are correlated (JCGM 102, 6.2.1).

use bead_compare::budget::{Combined, Contribution, Correlated};
use schemars::JsonSchema;
use serde::Serialize;

/// An input of a measurement model.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ModelInput {
    /// Its name.
    pub name: String,
    /// Its unit; empty for a factor.
    pub unit: &'static str,
    /// Its estimate.
    pub value: f64,
    /// Its standard uncertainty.
    pub u: f64,
    /// `A` from a series of observations, `B` from elsewhere (JCGM 100, 4.2 and 4.3).
    pub evaluation: &'static str,
    /// Its distribution.
    pub distribution: &'static str,
    /// Degrees of freedom of `u`; none for infinitely many.
    pub degrees_of_freedom: Option<f64>,
}

impl ModelInput {
    /// An input of type B with a normal distribution.
    pub fn normal(name: impl Into<String>, unit: &'static str, value: f64, u: f64) -> Self {
        Self {
            name: name.into(),
            unit,
            value,
            u,
            evaluation: "B",
            distribution: "normal",
            degrees_of_freedom: None,
        }
    }

    /// An input of type B with a rectangular distribution of half width `half` (JCGM 100, 4.3.7).
    pub fn within(name: impl Into<String>, unit: &'static str, value: f64, half: f64) -> Self {
        Self {
            distribution: "rectangular",
            ..Self::normal(name, unit, value, half / 3.0_f64.sqrt())
        }
    }

    /// The mean of observations with this relative standard deviation, as a factor of 1 (JCGM 100, 4.2.3).
    pub fn repeatability(relative_scatter: f64, observations: usize, free: f64) -> Self {
        Self {
            evaluation: "A",
            distribution: "Student",
            degrees_of_freedom: Some(free),
            ..Self::normal(
                "repeatability",
                "",
                1.0,
                relative_scatter / (observations as f64).sqrt(),
            )
        }
    }
}

/// An input of a result with its part in the uncertainty.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct BudgetRow {
    /// The input.
    #[serde(flatten)]
    pub input: ModelInput,
    /// Change of the result for a change of the input by 1.
    pub sensitivity: f64,
    /// Part in the variance of the result, per cent.
    pub share_percent: f64,
}

/// A result of a calibration.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct CalibrationResult {
    /// Its name.
    pub name: &'static str,
    /// Setting that has its value; none where no setting has it.
    pub key: Option<&'static str>,
    /// Setting that has its relative standard uncertainty.
    pub uncertainty_key: Option<&'static str>,
    /// Its unit.
    pub unit: &'static str,
    /// Estimate, combined standard uncertainty, degrees of freedom, coverage factor, expanded uncertainty.
    #[serde(flatten)]
    pub combined: Combined,
    /// Relative standard uncertainty.
    pub relative_u: f64,
    /// The budget: every input that it depends on.
    pub inputs: Vec<BudgetRow>,
    /// Value of the setting before, in the same unit.
    pub before: Option<f64>,
}

/// Correlation of two results.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ResultCorrelation {
    /// Names of both.
    pub results: [&'static str; 2],
    /// Setting that has it; none where no setting has it.
    pub key: Option<&'static str>,
    /// From −1 to 1.
    pub correlation: f64,
}

/// Name, unit and settings of a result.
#[derive(Debug, Clone, Copy, Default)]
pub struct ResultName {
    /// Its name.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Setting that has its value.
    pub key: Option<&'static str>,
    /// Setting that has its relative standard uncertainty.
    pub uncertainty_key: Option<&'static str>,
}

/// Propagates the uncertainties of `inputs`, some of them `correlated`, through a model.
///
/// # Panics
/// The model returns a number of results other than that of `names`, or a correlation names no input.
pub fn propagate(
    names: &[ResultName],
    inputs: &[ModelInput],
    correlated: &[Correlated],
    model: impl Fn(&[f64]) -> Vec<f64>,
) -> (Vec<CalibrationResult>, Vec<ResultCorrelation>) {
    let estimates: Vec<f64> = inputs.iter().map(|input| input.value).collect();
    let values = model(&estimates);
    assert_eq!(values.len(), names.len(), "a model gives a value for each name");
    let sensitivities: Vec<Vec<f64>> = inputs
        .iter()
        .enumerate()
        .map(|(place, input)| {
            if input.u == 0.0 {
                return vec![0.0; names.len()];
            }
            let moved = |by: f64| {
                let mut moved = estimates.clone();
                moved[place] += by;
                model(&moved)
            };
            let (above, below) = (moved(input.u), moved(-input.u));
            let differences = above.iter().zip(&below);
            differences
                .map(|(above, below)| (above - below) / (2.0 * input.u))
                .collect()
        })
        .collect();
    let result = |(result, name): (usize, &ResultName)| {
        let contribution = |(input, sensitivity): (&ModelInput, &Vec<f64>)| Contribution {
            amount: sensitivity[result] * input.u,
            free: input.degrees_of_freedom,
        };
        let contributions: Vec<_> = inputs.iter().zip(&sensitivities).map(contribution).collect();
        let combined = Combined::of(values[result], &contributions, correlated);
        let row = |((input, sensitivity), part): ((&ModelInput, &Vec<f64>), &Contribution)| BudgetRow {
            input: input.clone(),
            sensitivity: sensitivity[result],
            share_percent: combined.share_percent(part.amount * part.amount),
        };
        let rows = inputs.iter().zip(&sensitivities).zip(&contributions);
        let rows = rows
            .filter(|((_, sensitivity), _)| sensitivity[result] != 0.0)
            .map(row);
        CalibrationResult {
            name: name.name,
            key: name.key,
            uncertainty_key: name.uncertainty_key,
            unit: name.unit,
            relative_u: combined.u / combined.value.abs(),
            combined,
            inputs: rows.collect(),
            before: None,
        }
    };
    let results: Vec<CalibrationResult> = names.iter().enumerate().map(result).collect();
    let correlation = |one: usize, other: usize| {
        let amount = |place: usize, result: usize| sensitivities[place][result] * inputs[place].u;
        let shared: f64 = (0..inputs.len())
            .map(|place| amount(place, one) * amount(place, other))
            .sum();
        let crossed: f64 = correlated
            .iter()
            .map(|&(a, b, r)| r * (amount(a, one) * amount(b, other) + amount(b, one) * amount(a, other)))
            .sum();
        let size = results[one].combined.u * results[other].combined.u;
        let correlation = if size > 0.0 {
            (shared + crossed) / size
        } else {
            0.0
        };
        ResultCorrelation {
            results: [names[one].name, names[other].name],
            key: None,
            correlation: correlation.clamp(-1.0, 1.0),
        }
    };
    let count = names.len();
    let pairs = (0..count).flat_map(|one| (one + 1..count).map(move |other| (one, other)));
    let correlations = pairs.map(|(one, other)| correlation(one, other)).collect();
    (results, correlations)
}

/// Mean and standard deviation of values; the latter 0 for fewer than two.
pub fn mean_and_scatter(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (squares / (count - 1.0).max(1.0)).sqrt())
}

/// Median of values; `None` without values.
pub fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    let upper = *sorted.get(middle)?;
    Some(match sorted.len() % 2 {
        1 => upper,
        _ => 0.5 * (upper + sorted.get(middle - 1)?),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(name: &'static str) -> ResultName {
        ResultName {
            name,
            ..ResultName::default()
        }
    }

    #[test]
    fn simultaneous_resistance_and_reactance_of_the_gum_are_found() {
        // JCGM 100, H.2, table H.2 and H.4: means, standard uncertainties and correlations of V, I and φ.
        let inputs = [
            ModelInput::normal("V", "V", 4.9990, 0.0032),
            ModelInput::normal("I", "A", 19.661e-3, 0.0095e-3),
            ModelInput::normal("φ", "rad", 1.044_46, 0.000_75),
        ];
        let correlated = [(0, 1, -0.36), (0, 2, 0.86), (1, 2, -0.65)];
        let (results, correlations) =
            propagate(&[name("R"), name("X"), name("Z")], &inputs, &correlated, |v| {
                let z = v[0] / v[1];
                vec![z * v[2].cos(), z * v[2].sin(), z]
            });
        for (result, (value, u)) in results
            .iter()
            .zip([(127.732, 0.071), (219.847, 0.295), (254.260, 0.236)])
        {
            assert!((result.combined.value - value).abs() < 2e-3, "{result:?}");
            assert!((result.combined.u - u).abs() < 1.5e-3, "{result:?}");
        }
        let found: Vec<f64> = correlations.iter().map(|one| one.correlation).collect();
        for (found, expected) in found.iter().zip([-0.588, -0.485, 0.993]) {
            // The inputs' correlations are printed with two digits.
            assert!((found - expected).abs() < 8e-3, "{correlations:?}");
        }
    }

    #[test]
    fn a_mean_of_few_observations_has_few_degrees_of_freedom() {
        let inputs = [
            ModelInput::repeatability(0.02, 4, 3.0),
            ModelInput::within("scale", "", 1.0, 0.01),
        ];
        let (results, _) = propagate(&[name("mean")], &inputs, &[], |v| vec![10.0 * v[0] * v[1]]);
        let result = &results[0];
        let (a, b) = (0.1, 0.1 / 3.0_f64.sqrt());
        assert!((result.combined.u - f64::hypot(a, b)).abs() < 1e-9);
        let free = f64::hypot(a, b).powi(4) / (a.powi(4) / 3.0);
        assert!((result.combined.degrees_of_freedom.unwrap() - free).abs() < 1e-6);
        assert_eq!(median(&[3.0, 1.0, 2.0, 10.0]), Some(2.5));
    }
}
