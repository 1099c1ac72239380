//! The uncertainty budget of one strike.

use bead_model::design::Uncertainty;
use bead_model::energy_uncertainty::ESTIMATOR;
use bead_model::violation::SettingKey;
use bead_recording::strikes::RecordedStrike;
use serde::Serialize;

use crate::agreement::agrees;
use crate::budget::combined::{Combined, Contribution, Correlated, crossed};
use crate::budget::input::{estimate, named};
use crate::budget::monte_carlo::{MonteCarlo, draw};
use crate::budget::noise::noise;
use crate::budget::run::Rerun;
use crate::error::CompareError;

/// An input of a budget. A sensitivity is the change of A or of B, J, for a change of the input by 1.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct BudgetInput {
    /// Its name.
    pub name: &'static str,
    /// Its unit; empty for a factor.
    pub unit: &'static str,
    /// Its estimate.
    pub value: f64,
    /// Its standard uncertainty, in its unit.
    pub u: f64,
    /// `A` from a series of observations, `B` from elsewhere (JCGM 100, 4.2 and 4.3).
    pub evaluation: &'static str,
    /// Its distribution.
    pub distribution: &'static str,
    /// Degrees of freedom of `u`; none for infinitely many.
    pub degrees_of_freedom: Option<f64>,
    /// Sensitivity of A.
    pub sensitivity_measured: f64,
    /// Sensitivity of B.
    pub sensitivity_predicted: f64,
    /// Numerical error of the worse of both, as a part of it; none for one that is exact.
    pub sensitivity_error: Option<f64>,
    /// Part in the variance of A, per cent.
    pub share_measured_percent: f64,
    /// Part in the variance of B, per cent.
    pub share_predicted_percent: f64,
    /// Part in the variance of A − B, per cent.
    pub share_difference_percent: f64,
    /// The setting with the uncertainty, if one states it.
    #[serde(skip)]
    pub(super) key: Option<SettingKey>,
}

/// A correlation of two inputs, with what it adds to the variances.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct InputCorrelation {
    /// Places of both among the inputs.
    pub inputs: [usize; 2],
    /// From −1 to 1.
    pub correlation: f64,
    /// Part in the variance of A, per cent; below 0 if it takes away.
    pub share_measured_percent: f64,
    /// Part in the variance of B, per cent.
    pub share_predicted_percent: f64,
    /// Part in the variance of A − B, per cent.
    pub share_difference_percent: f64,
}

/// The budget of one strike. Results are in J.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
pub struct StrikeBudget {
    /// Address of the bead.
    pub bead: u8,
    /// Number of the strike.
    pub strike: u32,
    /// Sample index of its trigger.
    pub sample_index: u64,
    /// Certificate or record of the calibration, if the settings name one.
    pub calibration: Option<String>,
    /// The inputs whose uncertainty is known.
    pub inputs: Vec<BudgetInput>,
    /// Correlations that are not 0.
    pub correlations: Vec<InputCorrelation>,
    /// A.
    pub measured: Combined,
    /// B.
    pub predicted: Combined,
    /// A − B.
    pub difference: Combined,
    /// Inputs whose uncertainty is unknown: those of the results lack their part.
    pub unknown: Vec<&'static str>,
    /// Uncertainties found by draws through the bead's code.
    pub monte_carlo: Option<MonteCarlo>,
    /// The stated uncertainties.
    #[serde(skip)]
    pub(super) stated: Uncertainty,
}

/// The three results of a budget, from those of A and B.
fn results([a, b]: [f64; 2]) -> [f64; 3] {
    [a, b, a - b]
}

impl BudgetInput {
    /// Contribution to each of the three results.
    pub(super) fn contributions(&self) -> [Contribution; 3] {
        let sensitivities = results([self.sensitivity_measured, self.sensitivity_predicted]);
        sensitivities.map(|sensitivity| Contribution {
            amount: sensitivity * self.u,
            free: self.degrees_of_freedom,
        })
    }

    /// An error of A or B itself, J.
    fn of_estimate(name: &'static str, place: usize, u: f64) -> Self {
        Self {
            name,
            unit: "J",
            value: 0.0,
            u,
            evaluation: "B",
            distribution: "rectangular",
            degrees_of_freedom: None,
            sensitivity_measured: [1.0, 0.0][place],
            sensitivity_predicted: [0.0, 1.0][place],
            sensitivity_error: None,
            share_measured_percent: 0.0,
            share_predicted_percent: 0.0,
            share_difference_percent: 0.0,
            key: None,
        }
    }
}

impl StrikeBudget {
    /// The budget of a strike with all its samples; `stated` replaces the uncertainties in its settings. Each
    /// of the `draws` is a run of the bead's code.
    ///
    /// # Errors
    /// Samples or settings are missing, or no bead can have an input a little greater or less.
    pub fn of(
        strike: &RecordedStrike,
        stated: Option<Uncertainty>,
        draws: Option<u32>,
    ) -> Result<Self, CompareError> {
        let settings = strike.settings.as_ref().ok_or_else(|| {
            let number = strike.said.strike;
            CompareError::Unfit(format!(
                "strike {number}: no settings were received, so it cannot be measured again; record the settings too"
            ))
        })?;
        let mut description = *settings.description();
        description.uncertainty = stated.or(description.uncertainty);
        let rerun = Rerun::new(strike, description)?;
        let stated = description.uncertainty.unwrap_or_default();
        let energies = rerun.energies(&rerun.settings, &rerun.scans);
        let (mut inputs, unknown) = settings_inputs(&rerun, &stated)?;
        let channels = noise(&rerun);
        for channel in channels.iter().filter(|channel| channel.amounts != [0.0; 2]) {
            let place = usize::from(channel.amounts[1] > channel.amounts[0]);
            let of = BudgetInput::of_estimate(channel.name, place, channel.amounts[place]);
            inputs.push(BudgetInput {
                evaluation: "A",
                distribution: "normal",
                degrees_of_freedom: Some(channel.free),
                ..of
            });
        }
        let names = ["estimator of A", "estimator of B"];
        for (place, name) in names.into_iter().enumerate() {
            let u = ESTIMATOR[place] * energies[place].abs() / 3.0_f64.sqrt();
            inputs.push(BudgetInput::of_estimate(name, place, u));
        }
        let correlated = correlated(&stated, &inputs);
        let monte_carlo = draws
            .map(|draws| draw(&rerun, &stated, &channels, draws))
            .transpose()?;
        let mut budget = Self::combined(inputs, &correlated, energies);
        budget.bead = strike.address;
        budget.strike = strike.said.strike;
        budget.sample_index = strike.said.trigger_index;
        let calibration = stated.calibration.as_str();
        budget.calibration = (!calibration.is_empty()).then(|| calibration.to_owned());
        budget.unknown = unknown;
        budget.stated = stated;
        budget.monte_carlo =
            monte_carlo.map(|drawn| drawn.judged([&budget.measured, &budget.predicted, &budget.difference]));
        Ok(budget)
    }

    /// Combines inputs, and gives each its share.
    fn combined(mut inputs: Vec<BudgetInput>, correlated: &[Correlated], energies: [f64; 2]) -> Self {
        let contributions: Vec<[Contribution; 3]> = inputs.iter().map(BudgetInput::contributions).collect();
        let of = |result: usize| -> Vec<Contribution> {
            contributions.iter().map(|of_input| of_input[result]).collect()
        };
        let (each, values) = ([0, 1, 2].map(of), results(energies));
        let combined = [0, 1, 2].map(|result| Combined::of(values[result], &each[result], correlated));
        for (input, contribution) in inputs.iter_mut().zip(&contributions) {
            let share = |result: usize| combined[result].share_percent(contribution[result].amount.powi(2));
            input.share_measured_percent = share(0);
            input.share_predicted_percent = share(1);
            input.share_difference_percent = share(2);
        }
        let correlation = |one: &Correlated| {
            let share = |result: usize| combined[result].share_percent(crossed(&each[result], *one));
            InputCorrelation {
                inputs: [one.0, one.1],
                correlation: one.2,
                share_measured_percent: share(0),
                share_predicted_percent: share(1),
                share_difference_percent: share(2),
            }
        };
        let correlations = correlated.iter().map(correlation).collect();
        let [measured, predicted, difference] = combined;
        Self {
            bead: 0,
            strike: 0,
            sample_index: 0,
            calibration: None,
            inputs,
            correlations,
            measured,
            predicted,
            difference,
            unknown: Vec::new(),
            monte_carlo: None,
            stated: Uncertainty::default(),
        }
    }

    /// True if A and B differ by no more than the expanded uncertainty of their difference.
    pub fn agrees(&self) -> bool {
        agrees(self.difference.value, 0.0, self.difference.expanded)
    }
}

/// The inputs whose uncertainty the settings state, and the names of the others.
fn settings_inputs(
    rerun: &Rerun<'_>,
    stated: &Uncertainty,
) -> Result<(Vec<BudgetInput>, Vec<&'static str>), CompareError> {
    let (mut inputs, mut unknown) = (Vec::new(), Vec::new());
    for (key, relative) in stated.stated() {
        let (name, unit) = named(key);
        let value = estimate(&rerun.description, key);
        // Nothing depends on a part of the bead that it does not have.
        if value == 0.0 {
            continue;
        }
        let Some(relative) = relative else {
            unknown.push(name);
            continue;
        };
        let sensitivity = rerun.sensitivity(key)?;
        let [measured, predicted] = sensitivity.of.map(|of| of / value);
        let error = [0, 1].map(|i| sensitivity.error[i] / sensitivity.of[i].abs().max(f64::MIN_POSITIVE));
        let worse = usize::from(sensitivity.of[1].abs() > sensitivity.of[0].abs());
        inputs.push(BudgetInput {
            name,
            unit,
            value,
            u: relative.part() * value,
            distribution: "normal",
            sensitivity_measured: measured,
            sensitivity_predicted: predicted,
            sensitivity_error: Some(error[worse]),
            key: Some(key),
            ..BudgetInput::of_estimate(name, 0, 0.0)
        });
    }
    Ok((inputs, unknown))
}

/// The correlations of k, c and m, by the places of the inputs. Those with an unknown input are left out.
pub(super) fn correlated(stated: &Uncertainty, inputs: &[BudgetInput]) -> Vec<Correlated> {
    use SettingKey::{UDamping, UIntruderMass, UStiffness};
    let pairs = [
        (UStiffness, UDamping),
        (UStiffness, UIntruderMass),
        (UDamping, UIntruderMass),
    ];
    let place = |key| inputs.iter().position(|input| input.key == Some(key));
    let placed = pairs.into_iter().zip(stated.correlations());
    let placed = placed.filter_map(|((one, other), r)| Some((place(one)?, place(other)?, r)));
    placed.filter(|(.., r)| *r != 0.0).collect()
}

#[cfg(test)]
mod tests {
    use bead_model::StrikeFlags;
    use bead_model::design::Relative;
    use hertz_chain::Scenario;

    use super::*;
    use crate::budget::input::scale;
    use crate::budget::run::measured_again;
    use crate::spread::RunningMean;
    use crate::testing::{recorded, recorded_strike};

    /// This relative uncertainty for each input but the front mass, and no correlation.
    fn every(part: f64) -> Uncertainty {
        let part = Some(Relative::new(part));
        Uncertainty {
            force_gain: part,
            force_gain_ratio: part,
            force_flatness: part,
            acceleration_gain: part,
            acceleration_gain_ratio: part,
            acceleration_flatness: part,
            supply: part,
            bead_mass: part,
            intruder_mass: part,
            stiffness: part,
            damping: part,
            contact_stiffness: part,
            relaxation: part,
            ..Uncertainty::default()
        }
    }

    #[test]
    fn the_noise_of_a_budget_is_the_scatter_of_strikes_that_differ_in_their_noise_alone() {
        let scenario = Scenario::paper();
        let mut scatter = [RunningMean::default(); 2];
        for seed in 0..40 {
            let said = recorded(&scenario, &scenario, seed).said;
            let energies = [said.absorbed_measured, said.absorbed_predicted];
            scatter
                .iter_mut()
                .zip(energies)
                .for_each(|(of, energy)| of.push(energy.joules()));
        }
        let budget = StrikeBudget::of(&recorded_strike(), None, None).unwrap();
        for (name, scatter) in ["acceleration noise", "force noise"].into_iter().zip(scatter) {
            let u = budget.inputs.iter().find(|input| input.name == name).unwrap().u;
            let ratio = u / scatter.scatter().unwrap();
            println!("{name}: {u:e} J, {ratio} of the scatter");
            // A standard deviation of 40 is within 22 % in 19 cases of 20, that of the quiet within 13 %.
            assert!((0.7..1.3).contains(&ratio), "{name}: {ratio}");
        }
    }

    #[test]
    fn sensitivities_of_a_are_those_of_its_closed_form_and_what_cannot_matter_has_none() {
        let strike = recorded_strike();
        let budget = StrikeBudget::of(&strike, Some(every(0.01)), None).unwrap();
        let shape = strike.shape.unwrap();
        let bead = strike.settings.unwrap().description().physics();
        // E = (m²/c) ∫ (a - y)² dt, where y is a behind a low-pass with λ = k/c: at the ring's frequency a -
        // y has ω²/(ω² + λ²) of the square of a.
        let (lambda, ring) = (
            bead.stiffness / bead.damping,
            std::f64::consts::TAU * shape.ring_frequency.hertz(),
        );
        let of_lambda = -2.0 * lambda * lambda / (lambda * lambda + ring * ring);
        for (name, expected) in [
            ("acceleration gain", 2.0),
            ("acceleration flatness", 2.0),
            ("supply", 2.0),
            ("m", 2.0),
            ("k", of_lambda),
            ("c", -1.0 - of_lambda),
            ("force gain", 0.0),
            ("force gain ratio", 0.0),
            ("M", 0.0),
            ("kappa", 0.0),
            ("tau", 0.0),
        ] {
            let input = budget.inputs.iter().find(|input| input.name == name).unwrap();
            let found = input.sensitivity_measured * input.value / budget.measured.value;
            // Not all is absorbed while it rings.
            assert!((found - expected).abs() < 0.06, "{name}: {found}, {expected}");
        }
        let [a, b] = [&budget.measured, &budget.predicted].map(|result| result.u / result.value);
        assert!(a > 0.03 && b > 0.03, "{a} {b}");
        // Both include the supply, so their difference is less uncertain than if they were independent.
        let apart = budget.measured.u.hypot(budget.predicted.u);
        assert!(
            budget.difference.u < 0.9 * apart,
            "{} {apart}",
            budget.difference.u
        );
    }

    #[test]
    fn the_uncertainties_that_a_bead_sends_are_those_of_the_budget_within_a_tenth() {
        let part = |part| Some(Relative::new(part));
        // All that a laboratory would state, and only k, c and m.
        let usual = Uncertainty {
            force_gain: part(0.0105),
            force_gain_ratio: part(1e-5),
            acceleration_gain: part(0.005),
            acceleration_gain_ratio: part(1e-5),
            supply: part(0.002),
            bead_mass: part(2e-4),
            intruder_mass: part(0.003),
            stiffness: part(0.005),
            damping: part(0.02),
            contact_stiffness: part(0.03),
            relaxation: part(0.2),
            stiffness_with_damping: Relative::new(0.2),
            stiffness_with_mass: Relative::new(0.6),
            damping_with_mass: Relative::new(0.15),
            ..every(0.01)
        };
        for (radius, velocity) in [(0.003, 0.6), (0.0045, 0.3), (0.007, 0.3), (0.01, 0.3)] {
            for (stiffer, more_damped, heavier) in
                [(1.0, 1.0, 1.0), (2.0, 1.0, 1.0), (1.0, 2.0, 1.0), (1.0, 1.0, 2.0)]
            {
                let mut scenario = Scenario::paper();
                (scenario.striker.radius, scenario.striker.velocity) = (radius, velocity);
                let intruder = &mut scenario.intruders[0];
                intruder.stiffness *= stiffer;
                intruder.damping *= more_damped;
                intruder.mass *= heavier;
                let mut strike = recorded(&scenario, &scenario, 1);
                let before = strike.settings.unwrap();
                assert_eq!(strike.shape.unwrap().uncertainty, None);
                strike.settings = before
                    .with(|description| description.uncertainty = Some(usual))
                    .ok();
                let rerun = Rerun::new(&strike, *strike.settings.unwrap().description()).unwrap();
                let (_, shape) = measured_again(&strike.said, &rerun.settings, &rerun.scans);
                let sent = shape.uncertainty.unwrap();
                let budget = StrikeBudget::of(&strike, None, None).unwrap();
                let greater = budget.measured.value.max(budget.predicted.value);
                for (name, sent, expected) in [
                    ("A", sent.measured, budget.measured.u / budget.measured.value),
                    ("B", sent.predicted, budget.predicted.u / budget.predicted.value),
                    ("A - B", sent.difference, budget.difference.u / greater),
                ] {
                    let ratio = sent.ratio() / expected;
                    println!("{radius} m, {velocity} m/s, {name}: {expected:.5}, sent {ratio:.3} of it");
                    assert!(
                        (ratio - 1.0).abs() < 0.1,
                        "{radius} {velocity} {stiffer} {more_damped} {heavier} {name}: {ratio}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_difference_is_judged_by_its_uncertainty_where_that_is_known() {
        let strike = recorded_strike();
        // B reads 1.9 % more.
        let off = strike.settings.unwrap().with(|description| {
            scale(description, SettingKey::UForceGain, 1.01);
            description.capture.disagreement = 0.01;
        });
        let (percent, exact) = (every(0.01), every(1e-6));
        // One unknown input makes all unknown.
        let partly = Uncertainty {
            damping: None,
            ..percent
        };
        for (stated, disagreement, differs) in [
            (None, 0.01, true),
            (None, 0.03, false),
            (Some(percent), 0.01, false),
            (Some(exact), 0.03, true),
            (Some(partly), 0.01, true),
        ] {
            let settings = off.unwrap().with(|description| {
                description.uncertainty = stated;
                description.capture.disagreement = disagreement;
            });
            let rerun = Rerun::new(&strike, *settings.unwrap().description()).unwrap();
            let (said, shape) = measured_again(&strike.said, &rerun.settings, &rerun.scans);
            assert_eq!(
                said.flags.has(StrikeFlags::ESTIMATES_DIFFER),
                differs,
                "{stated:?}, {:?}",
                said.flags
            );
            assert_eq!(
                shape.uncertainty.is_some(),
                [Some(percent), Some(exact)].contains(&stated)
            );
        }
    }
}
