//! Several strikes against the simulation: mean and scatter of the deviations, with their uncertainty.
//!
//! # Design
//! The mean says how far off the bead is, the root mean square how much noise adds. A goal is missed where
//! the whole interval that holds the true value in 19 cases of 20 lies beyond it. The interval of the mean is
//! Student's; the lower end of the scatter's comes from the chi-squared distribution. A single strike is held
//! to the goal of the mean; its interval is that of the noise before it, through the estimates.

use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::agreement::agrees;
use crate::goal::StrikeGoal;
use crate::report::{count, percent_within};
use crate::student::student;
use crate::values::StrikeValues;

/// Greatest root mean square of the deviations of A and of B, as parts of the full chain's value: what
/// docs/accuracy.md promises with the front end's noise.
const SCATTER: [f64; 2] = [5e-3, 1e-2];

/// The deviations of one estimate over several strikes, as parts of the full chain's value.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Spread {
    /// `A` or `B`.
    pub estimate: &'static str,
    /// Number of strikes.
    pub strikes: usize,
    /// Mean of the deviations.
    pub mean: f64,
    /// The true mean is within this distance of `mean` in 19 cases of 20: by the scatter, or, for a single
    /// strike, by the noise before it; none if neither is known.
    pub uncertainty: Option<f64>,
    /// Root mean square of the deviations about their mean; none for a single strike.
    pub scatter: Option<f64>,
    /// The true scatter is above this in 39 cases of 40.
    pub scatter_at_least: Option<f64>,
    /// Greatest mean, with what the chain explains; none if the estimate is not judged.
    pub goal: Option<f64>,
    /// Greatest scatter.
    pub scatter_goal: f64,
    /// True if neither is missed by more than chance explains.
    pub pass: bool,
}

/// Mean and sum of squares of values that come one after another (Welford, Technometrics 4, 419, 1962).
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct RunningMean {
    pub(crate) count: usize,
    pub(crate) mean: f64,
    squares: f64,
}

impl RunningMean {
    pub(crate) fn push(&mut self, value: f64) {
        self.count += 1;
        let off = value - self.mean;
        self.mean += off / self.count as f64;
        self.squares += off * (value - self.mean);
    }

    /// Standard deviation, by n - 1; `None` for fewer than two values.
    pub(crate) fn scatter(&self) -> Option<f64> {
        (self.count > 1).then(|| (self.squares / (self.count - 1) as f64).sqrt())
    }

    /// Standard error of the mean; `None` for fewer than two values.
    pub(crate) fn standard_error(&self) -> Option<f64> {
        let count = self.count as f64;
        (self.count > 1).then(|| (self.squares / (count * (count - 1.0))).sqrt())
    }
}

/// Running sums of the deviations of A and of B. No strike is kept.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Deviations {
    of: [RunningMean; 2],
    /// Uncertainty of the full chain's energy, as a part of it.
    truth: f64,
    goal: StrikeGoal,
}

impl Deviations {
    /// Deviations from a truth that is known only within this part of it, as with a fitted striker's
    /// velocity, and their goals.
    pub(crate) fn within(truth: f64, goal: StrikeGoal) -> Self {
        Self {
            truth,
            goal,
            ..Self::default()
        }
    }

    pub(crate) fn push(&mut self, deviation: &StrikeValues) {
        self.of[0].push(deviation.absorbed_measured);
        self.of[1].push(deviation.absorbed_predicted);
    }

    /// The spreads of A and B. For a single strike, `noise` is their expanded uncertainty by its own noise.
    pub(crate) fn spread(&self, noise: Option<[f64; 2]>) -> [Spread; 2] {
        let of = |place: usize| {
            let uncertainty = [
                Some(self.truth).filter(|truth| *truth > 0.0),
                noise.map(|noise| noise[place]),
            ];
            let goals = (self.goal.each()[place], SCATTER[place]);
            Spread::from(["A", "B"][place], &self.of[place], uncertainty, goals)
        };
        [of(0), of(1)]
    }
}

impl Spread {
    fn from(
        estimate: &'static str,
        deviations: &RunningMean,
        [truth, noise]: [Option<f64>; 2],
        (goal, scatter_goal): (Option<f64>, f64),
    ) -> Self {
        let scatter = deviations.scatter();
        let by_scatter = scatter.map(|scatter| mean_uncertainty(scatter, deviations.count));
        let parts = [by_scatter.or(noise), truth].into_iter().flatten();
        let uncertainty = parts.reduce(f64::hypot);
        let free = deviations.count.saturating_sub(1);
        let scatter_at_least = scatter.map(|scatter| scatter * (free as f64 / chi_squared(free)).sqrt());
        let mut spread = Self {
            estimate,
            strikes: deviations.count,
            mean: deviations.mean,
            uncertainty,
            scatter,
            scatter_at_least,
            goal,
            scatter_goal,
            pass: false,
        };
        spread.pass = spread.mean_met() && spread.scatter_met();
        spread
    }

    /// True if the mean is within its goal, or beyond it by no more than its uncertainty.
    pub fn mean_met(&self) -> bool {
        let within = self.uncertainty.unwrap_or(0.0);
        self.goal.is_none_or(|goal| agrees(self.mean, goal, within))
    }

    /// True if the scatter is within its goal, or beyond it by no more than chance explains.
    pub fn scatter_met(&self) -> bool {
        let least = self.scatter_at_least;
        least.is_none_or(|least| least <= self.scatter_goal)
    }

    /// The goal that is missed, in words; `None` if both are met.
    pub fn failure(&self) -> Option<String> {
        let (estimate, strikes) = (self.estimate, count(self.strikes as u64, "strike"));
        if let Some(goal) = self.goal.filter(|_| !self.mean_met()) {
            let over = self.scatter.map(|_| format!(" in the mean of {strikes}"));
            return Some(format!(
                "{estimate} is {} off the full chain{}, more than its goal of {:.1} %; see docs/accuracy.md",
                percent_within(self.mean, self.uncertainty),
                over.unwrap_or_default(),
                goal * 100.0
            ));
        }
        let scatter = self.scatter.filter(|_| !self.scatter_met())? * 100.0;
        let goal = self.scatter_goal * 100.0;
        Some(format!(
            "{estimate} scatters by {scatter:.2} % rms over {strikes}, more than the {goal:.1} % that noise explains; see \
             docs/accuracy.md"
        ))
    }
}

/// Half the width of the interval that holds the true mean of `count` values in 19 cases of 20, for two or
/// more values with the standard deviation `scatter`.
pub(crate) fn mean_uncertainty(scatter: f64, count: usize) -> f64 {
    student((count - 1) as f64) * scatter / (count as f64).sqrt()
}

/// The 97.5 % quantile of chi-squared with this many degrees of freedom, 1 or more.
fn chi_squared(free: usize) -> f64 {
    ChiSquared::new(free as f64)
        .expect("a degree of freedom at least")
        .inverse_cdf(0.975)
}

#[cfg(test)]
mod tests {
    use hertz_chain::Scenario;

    use super::*;
    use crate::budget::expanded_noise;
    use crate::strike::FullChain;
    use crate::testing::recorded;

    fn spread(deviations: &[f64], truth: f64) -> Spread {
        let mut running = RunningMean::default();
        deviations.iter().for_each(|one| running.push(*one));
        Spread::from("A", &running, [Some(truth), None], (Some(2e-3), 5e-3))
    }

    fn passes(deviations: &[f64]) -> bool {
        spread(deviations, 0.0).pass
    }

    /// Five noisy strikes at a speed, by a bead whose spring is `stiffer` than its settings say: true if both
    /// estimates pass.
    fn strikes_pass(speed: f64, stiffer: f64) -> bool {
        let mut believed = Scenario::paper();
        believed.striker.velocity = speed;
        let mut real = believed.clone();
        real.intruders[0].stiffness *= stiffer;
        let chain = FullChain::run(&believed, 8).unwrap();
        let mut deviations = Deviations::default();
        for seed in 1..=5 {
            deviations.push(&chain.compare(&recorded(&real, &believed, seed)).deviation);
        }
        println!("{speed} m/s, {stiffer}: {deviations:?}");
        deviations.spread(None).iter().all(|estimate| estimate.pass)
    }

    #[test]
    fn five_noisy_strikes_pass_at_every_speed_unless_the_spring_is_off_by_a_tenth() {
        for speed in [0.45, 0.55, 0.6, 0.7] {
            assert!(strikes_pass(speed, 1.0), "{speed} m/s");
        }
        for stiffer in [0.9, 1.1] {
            assert!(!strikes_pass(0.55, stiffer), "{stiffer}");
        }
    }

    #[test]
    fn a_strike_alone_is_excused_by_its_own_noise_and_by_no_more() {
        let mut believed = Scenario::paper();
        believed.striker.velocity = 0.8;
        let chain = FullChain::run(&believed, 8).unwrap();
        let judged = |stiffer: f64, seed: u64| {
            let mut real = believed.clone();
            real.intruders[0].stiffness *= stiffer;
            let strike = recorded(&real, &believed, seed);
            let mut deviations = Deviations::default();
            deviations.push(&chain.compare(&strike).deviation);
            let noise =
                expanded_noise(&strike).map(|noise| noise.map(|joules| joules / chain.truth.absorbed));
            let said = [None, noise].map(|noise| deviations.spread(noise));
            println!(
                "{stiffer} {seed}: {:?}",
                said[1].map(|spread| (spread.mean, spread.uncertainty))
            );
            said.map(|said| said.iter().all(|estimate| estimate.pass))
        };
        let healthy: Vec<_> = (1..=12).map(|seed| judged(1.0, seed)).collect();
        assert!(healthy.iter().all(|[_, with_noise]| *with_noise), "{healthy:?}");
        assert!(healthy.iter().any(|[without, _]| !without), "{healthy:?}");
        assert!((1..4).all(|seed| !judged(1.05, seed)[1]));
    }

    #[test]
    fn a_truth_that_is_not_known_well_excuses_as_much_and_no_more() {
        assert!(!passes(&[0.0025]) && spread(&[0.0025], 6e-4).pass && !spread(&[0.0025], 4e-4).pass);
    }

    #[test]
    fn the_quantile_of_chi_squared_is_that_of_the_tables() {
        // Abramowitz and Stegun, table 26.8.
        for (free, table) in [(1, 5.02389), (10, 20.4831), (100, 129.561)] {
            let chi = chi_squared(free);
            assert!((chi / table - 1.0).abs() < 1e-5, "{free}: {chi}");
        }
    }

    #[test]
    fn noise_about_the_truth_passes_and_a_bead_that_is_off_does_not() {
        assert!(passes(&[0.0019]) && !passes(&[0.0021]));
        // Strikes beyond the goal, whose mean is not.
        assert!(passes(&[0.004, -0.003, 0.002, -0.002, 0.0035]));
        assert!(!passes(&[0.014, 0.007, 0.012, 0.008, 0.0135]));
        // A mean that is right does not excuse any scatter.
        let said = spread(&[0.03, -0.03, 0.025, -0.028, 0.01], 0.0);
        let failure = said.failure().unwrap();
        assert!(!said.pass && failure.contains("A scatters by"), "{said:?}");
    }
}
