//! Identification of beads whose true parameters are drawn: coverage of its intervals, and its errors.
//!
//! # Design
//! k, c, Young's modulus, τ and the striker's speed of each bead are drawn. The f64 chain strikes it, by the
//! solver and not by the integration that identification uses; front end, noise and the bead's own code make
//! the recorded strike, with the settings of the paper's bead. Identification begins at the paper's values.
//! If its errors are right, 95 % of its intervals hold the truth, and the rank of the truth within the stated
//! normal distribution is uniform (Talts et al., arXiv:1804.06788).

use bead_compare::front_end::AnalogFrontEnd;
use bead_compare::sensed::{Timing, bead_of, simulate_with_ring_down};
use bead_identify::chain::ChainOfScenario;
use bead_identify::chain_runs::ChainRuns;
use bead_identify::chain_strike::ChainStrike;
use bead_identify::identified::{Candidate, Wanted, identify};
use bead_identify::noise::Noise;
use bead_identify::quantity::{COUNT, Quantity};
use bead_identify::series::{StrikeSeries, noises};
use bead_identify::spread::coverage_factor;
use bead_model::Settings;
use bead_model::design::{Capture, derive};
use hertz_chain::Scenario;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use schemars::JsonSchema;
use serde::Serialize;

use crate::coverage::rank_statistics;
use crate::error::BenchError;
use crate::model_bead::recorded;

/// Half width of the range that each parameter is drawn from, as a part.
const RANGE: f64 = 0.2;
/// Least and greatest part of the intervals of 95 % that may hold the truth.
const COVERED: [f64; 2] = [0.93, 0.97];
/// Least probability of the ranks, if they are uniform.
const LEAST_PROBABILITY: f64 = 0.01;
/// The drawn parameters, each with its greatest error as a part, if it has a goal.
const PARAMETERS: [(&str, Option<f64>); 5] = [
    ("k", Some(0.005)),
    ("c", Some(0.02)),
    ("Y", None),
    ("tau", None),
    ("V", None),
];
/// Place of the bead in the paper's chain.
const BEAD: usize = 8;
/// Quiet before the strike, s.
const LEAD_IN: f64 = 0.01;

/// The outcome of one drawn bead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DrawnIdentification {
    /// Relative error of k, c, Y, τ and V.
    pub errors: [f64; 5],
    /// The errors in standard errors.
    pub deviations: [f64; 5],
    /// True for each interval of 95 % that holds the truth.
    pub covered: [bool; 5],
    /// Probability of the residuals.
    pub probability: f64,
}

/// The paper's bead with its settings, around which beads are drawn.
pub struct Nominal {
    scenario: Scenario,
    front_end: AnalogFrontEnd,
    settings: Settings,
}

impl Nominal {
    /// The paper's strike at bead 8 behind the reference front end.
    ///
    /// # Errors
    /// None for the paper's bead.
    pub fn paper() -> Result<Self, BenchError> {
        let (scenario, front_end) = (Scenario::paper(), AnalogFrontEnd::default());
        let bead = bead_of(&simulate_with_ring_down(&scenario)?, BEAD)?;
        let front = front_end.calibration();
        let settings = derive(&bead, &front, &Capture::of(&bead, &front));
        let settings =
            settings.map_err(|error| BenchError::unfit("no settings fit the paper's bead", error))?;
        Ok(Self {
            scenario,
            front_end,
            settings,
        })
    }

    /// Draws bead number `number`, strikes it `strikes` times, and identifies it.
    ///
    /// # Errors
    /// Its chain cannot be simulated, it finds no strike, or the fit does not converge.
    pub fn draw(&self, seed: u64, number: u32, strikes: u32) -> Result<DrawnIdentification, BenchError> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(number.into());
        let factors: [f64; 5] = std::array::from_fn(|_| 1.0 + random.random_range(-RANGE..RANGE));
        let [k, c, young, relaxation, velocity] = factors;
        let mut real = self.scenario.clone();
        real.intruders[0].stiffness *= k;
        real.intruders[0].damping *= c;
        real.chain.young *= young;
        real.chain.relaxation *= relaxation;
        real.striker.velocity *= velocity;
        let solution = simulate_with_ring_down(&real)?;
        let mut all = Vec::new();
        for _ in 0..strikes {
            let timing = Timing::once(LEAD_IN + random.random_range(0.0..1e-5));
            let noise = random.random();
            let recorded = recorded(&self.settings, &self.front_end, (&solution, BEAD), timing, noise);
            all.push(recorded.ok_or_else(|| BenchError::Unfit("a drawn bead finds no strike".to_owned()))?);
        }
        let unfit = |why: String| BenchError::Unfit(format!("drawn bead {number}: {why}"));
        let series: Result<Vec<StrikeSeries>, String> = all.iter().map(StrikeSeries::of).collect();
        let series = series.map_err(unfit)?;
        let noises = noises(&series);
        let chain = ChainOfScenario::new(&self.scenario, BEAD).map_err(unfit)?;
        let start = chain.values();
        let runs = ChainRuns::new(chain);
        let candidate = |(number, one): (u32, &StrikeSeries)| {
            let model = Box::new(ChainStrike::new(&runs, one, &noises, &start)?);
            Ok(Candidate {
                recording: 0,
                number,
                model,
            })
        };
        let candidates = (0..).zip(&series).map(candidate);
        let candidates: Vec<_> = candidates.collect::<Result<_, _>>().map_err(unfit)?;
        let fitted = [
            Quantity::Stiffness,
            Quantity::Damping,
            Quantity::Young,
            Quantity::Relaxation,
        ];
        let wanted = Wanted {
            start,
            free: fitted.to_vec(),
            stated: [None; COUNT],
            noise_free: noises.iter().flatten().map(Noise::free).sum(),
            recordings: vec![String::new()],
        };
        let found = identify(&candidates, &wanted).map_err(|error| unfit(error.to_string()))?;
        let mut outcome = DrawnIdentification {
            errors: [0.0; 5],
            deviations: [0.0; 5],
            covered: [false; 5],
            probability: found.goodness.probability,
        };
        for (at, quantity) in fitted.into_iter().enumerate() {
            let place = found.best.free.iter().position(|one| *one == quantity);
            let place = place.ok_or_else(|| unfit(format!("{} was not fitted", quantity.symbol())))?;
            let (value, truth) = (
                found.best.values[quantity.place()],
                start[quantity.place()] * factors[at],
            );
            outcome.errors[at] = value / truth - 1.0;
            outcome.deviations[at] = (truth / value).ln() / found.covariance[(place, place)].sqrt();
            let ([low, high], _) = found.intervals[place];
            outcome.covered[at] = (low..=high).contains(&truth);
        }
        // The speed is the first of the strike's own numbers.
        let strike = &found.best.strikes[0];
        let (log, error) = (
            strike.own[0],
            found.scale * strike.own_error(0, &found.best.free, &found.unscaled),
        );
        outcome.errors[4] = log.exp() / velocity - 1.0;
        outcome.deviations[4] = (velocity.ln() - log) / error;
        outcome.covered[4] = outcome.deviations[4].abs() <= coverage_factor(wanted.noise_free);
        Ok(outcome)
    }
}

/// Coverage and errors of one parameter over the drawn beads.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct IdentificationCoverage {
    /// `k`, `c`, `Y`, `tau` or `V`.
    pub parameter: &'static str,
    /// Number of beads.
    pub beads: usize,
    /// Part of the intervals of 95 % that hold the truth.
    pub covered: f64,
    /// Mean of (truth − value) in standard errors.
    pub mean: f64,
    /// Standard deviation of (truth − value) in standard errors.
    pub scatter: f64,
    /// Probability of ranks that are this uneven or more, if they are uniform (chi-squared).
    pub probability: f64,
    /// Root mean square of the relative error.
    pub error_rms: f64,
    /// Greatest relative error.
    pub error_most: f64,
    /// Greatest relative error that is allowed; null for none.
    pub goal: Option<f64>,
    /// True if coverage, ranks and errors are as they have to be.
    pub holds: bool,
}

impl IdentificationCoverage {
    /// The coverage of each parameter.
    pub fn of(beads: &[DrawnIdentification]) -> Vec<Self> {
        let of = |(at, (parameter, goal)): (usize, (&'static str, Option<f64>))| {
            let deviations: Vec<f64> = beads.iter().map(|bead| bead.deviations[at]).collect();
            let [mean, scatter, probability] = rank_statistics(&deviations);
            let count = beads.len() as f64;
            let covered = beads.iter().filter(|bead| bead.covered[at]).count() as f64 / count;
            let errors = || beads.iter().map(|bead| bead.errors[at]);
            let error_most = errors().fold(0.0, |most: f64, error| most.max(error.abs()));
            Self {
                parameter,
                beads: beads.len(),
                covered,
                mean,
                scatter,
                probability,
                error_rms: (errors().map(|error| error * error).sum::<f64>() / count).sqrt(),
                error_most,
                goal,
                holds: (COVERED[0]..=COVERED[1]).contains(&covered)
                    && probability > LEAST_PROBABILITY
                    && goal.is_none_or(|goal| error_most <= goal),
            }
        };
        PARAMETERS.into_iter().enumerate().map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;

    /// `bead proof identify` judges coverage and ranks, which take hundreds of beads.
    #[test]
    fn drawn_beads_are_found_within_the_goals_and_near_their_intervals() {
        let nominal = Nominal::paper().unwrap();
        let beads: Vec<_> = (0..6_u32)
            .into_par_iter()
            .map(|number| nominal.draw(3, number, 1).unwrap())
            .collect();
        for of in IdentificationCoverage::of(&beads) {
            println!("{of:?}");
            assert!(of.goal.is_none_or(|goal| of.error_most <= goal), "{of:?}");
        }
        for bead in &beads {
            assert!(bead.deviations.iter().all(|off| off.abs() < 5.0), "{bead:?}");
            assert!(bead.probability > 1e-6, "{bead:?}");
        }
    }
}
