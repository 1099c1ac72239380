//! The striker's velocity, from the forces that a bead recorded.
//!
//! # Design
//! The force of the first wave goes as v^(6/5) for elastic spheres, and nearly so with losses. The recorded
//! force is compared with the full chain's over the whole pulse by least squares, since its highest sample
//! lies below the peak and noise lifts it. Where it is r times the simulated force, the chain is run again at
//! v r^(5/6), until r is 1.
//!
//! Only the force is used, so A, which comes from the acceleration, and B, whose energy goes as v², can be
//! judged at that velocity. A force calibration that is off by 1 % goes unnoticed: it changes the velocity by
//! 0.8 %, and the energy by 1.7 %.

use hertz_chain::Scenario;
use serde::Serialize;

use crate::error::CompareError;
use crate::spread::{RunningMean, mean_uncertainty};
use crate::strike::FullChain;
use crate::verdict::Echoes;
use bead_recording::strikes::RecordedStrike;

/// Greatest number of strikes that are used. More would cost time and memory, and add little.
pub const STRIKES_MOST: usize = 64;

/// The velocity as a power of the force.
const EXPONENT: f64 = 5.0 / 6.0;
/// Greatest number of rounds. Each reduces the error to a tenth or less.
const ROUNDS: usize = 12;
/// Relative error at which the force counts as met.
const MET: f64 = 1e-6;
/// Greatest distance of a strike's force from the median, as a part of it. Beyond are echoes or other blows.
const OTHERS: f64 = 0.25;

/// The striker's velocity, by the recorded forces.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct FittedVelocity {
    /// m/s.
    pub velocity: f64,
    /// The mean of the strikes lies within this much of it in 19 cases of 20, m/s.
    pub uncertainty: f64,
    /// Standard deviation from strike to strike, m/s; none for one strike.
    pub scatter: Option<f64>,
    /// Number of strikes it was found from.
    pub strikes: usize,
    /// The scenario's, m/s.
    pub scenario: f64,
}

impl FittedVelocity {
    /// Uncertainty of the chain's energies at this velocity, as a part of them: they go with its square.
    pub(crate) fn energy_uncertainty(&self) -> f64 {
        2.0 * self.uncertainty / self.velocity
    }
}

/// The strikes that a velocity is found from: the first that are not echoes.
pub fn first_strikes(
    strikes: impl Iterator<Item = RecordedStrike>,
    mut echoes: Echoes,
) -> Vec<RecordedStrike> {
    let own = strikes.filter(|strike| !echoes.has(strike));
    own.take(STRIKES_MOST).collect()
}

/// Finds the velocity of the scenario's striker, from strikes at bead `bead`.
///
/// # Errors
/// No strike came whole, with its settings and a force within the sensor's range, no velocity gives these
/// forces, or the scenario cannot be run.
pub fn fit(
    scenario: &Scenario,
    bead: usize,
    strikes: &[RecordedStrike],
) -> Result<FittedVelocity, CompareError> {
    let given = scenario.striker.velocity;
    let mut scenario = scenario.clone();
    for _ in 0..ROUNDS {
        let velocity = scenario.striker.velocity;
        let chain = FullChain::run(&scenario, bead)?;
        let ratios = strikes.iter().filter_map(|strike| chain.force_ratio(strike));
        let ratios = alike(ratios.collect());
        if ratios.is_empty() {
            return Err(CompareError::Unfit(
                "no strike came with its settings, all of its samples and a force within the sensor's range, so no \
                 force gives the striker's velocity; give it with --velocity"
                    .to_owned(),
            ));
        }
        let mut running = RunningMean::default();
        ratios.iter().for_each(|(ratio, _)| running.push(*ratio));
        let (mean, scatter) = (running.mean, running.scatter());
        if (mean - 1.0).abs() > MET {
            scenario.striker.velocity = velocity * mean.clamp(0.1, 10.0).powf(EXPONENT);
            continue;
        }
        let within = match scatter {
            Some(scatter) => mean_uncertainty(scatter, ratios.len()),
            // For one strike: from its residual noise.
            None => 2.0 * ratios[0].1,
        };
        return Ok(FittedVelocity {
            velocity,
            uncertainty: EXPONENT * within * velocity,
            scatter: scatter.map(|scatter| EXPONENT * scatter * velocity),
            strikes: ratios.len(),
            scenario: given,
        });
    }
    Err(CompareError::Unfit(format!(
        "no velocity of the striker gives the recorded forces: after {ROUNDS} rounds it is at {:.3} m/s; is the scenario \
         that of this recording?",
        scenario.striker.velocity
    )))
}

fn alike(ratios: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let mut sorted: Vec<f64> = ratios.iter().map(|(ratio, _)| *ratio).collect();
    sorted.sort_by(f64::total_cmp);
    // Of an even number, the greater of the middle two: echoes are weaker.
    let Some(&median) = sorted.get(sorted.len() / 2) else {
        return ratios;
    };
    let near = |(ratio, _): &(f64, f64)| (ratio / median - 1.0).abs() <= OTHERS;
    ratios.into_iter().filter(near).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::recorded;

    #[test]
    fn the_velocity_of_a_striker_is_found_within_its_uncertainty_from_any_start() {
        for (velocity, start) in [(0.45, 0.9), (0.62, 0.2)] {
            let mut real = Scenario::paper();
            real.striker.velocity = velocity;
            let mut given = Scenario::paper();
            given.striker.velocity = start;
            let strikes: Vec<_> = (1..=4).map(|seed| recorded(&real, &real, seed)).collect();
            for strikes in [&strikes[..1], &strikes] {
                let found = fit(&given, 8, strikes).unwrap();
                let off = (found.velocity / velocity - 1.0).abs();
                println!("{velocity} m/s: {found:?}, off by {off:.1e}");
                // 0.3 % of the velocity would be 0.6 % of the energy: three times the goal of A.
                assert!(found.uncertainty < 1e-3 * velocity, "{found:?}");
                assert!(off < 1e-3, "{found:?}");
                assert_eq!((found.strikes, found.scenario), (strikes.len(), start));
            }
        }
    }

    #[test]
    fn weaker_echoes_do_not_count_and_no_strike_is_an_error() {
        let kept = alike(vec![(1.0, 0.0), (0.3, 0.0), (1.01, 0.0), (0.2, 0.0)]);
        assert_eq!(kept, [(1.0, 0.0), (1.01, 0.0)]);
        let nothing = fit(&Scenario::paper(), 8, &[]).unwrap_err().to_string();
        assert!(nothing.contains("--velocity"), "{nothing}");
    }
}
