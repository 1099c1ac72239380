//! Coverage of the uncertainties that a bead sends. The true parameters of the simulated beads are drawn
//! from the distributions of a calibration; the beads measure with its settings.
//!
//! # Design
//! A bead's parameters are drawn around those of its settings (JCGM 101, 6.4, the code of `bead budget
//! --monte-carlo`), and so is its strike. The f64 chain has the true masses, springs and contacts, the front
//! end the true gains. The bit-exact code of the bead measures with the settings. If the uncertainties are
//! right, 95.45 % of the intervals of ± 2 u hold the truth, and the rank of the truth within the stated
//! normal distribution is uniform (Talts et al., arXiv:1804.06788).

use std::f64::consts::SQRT_2;

use bead_model::design::{Description, Relative, Uncertainty};
use bead_model::name::Name;
use bead_wire::{Energy, StrikeFlags};
use hertz_chain::Scenario;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use schemars::JsonSchema;
use serde::Serialize;

use crate::emulation::{Placed, settings_of};
use crate::error::BenchError;
use crate::model_bead::measured;
use bead_compare::budget::drawn_settings;
use bead_compare::front_end::AnalogFrontEnd;
use bead_compare::sensed::{Timing, Truth, simulate_with_ring_down};

/// Coverage factor of the intervals.
const COVERAGE_FACTOR: f64 = 2.0;
/// Least and greatest part of the intervals that may hold the truth.
const COVERED: [f64; 2] = [0.92, 0.98];
/// Least probability of the ranks, if they are uniform.
const LEAST_PROBABILITY: f64 = 0.01;
/// Greatest part of the drawn beads that may be flagged: each flag marks those beyond three standard
/// uncertainties.
const FLAGGED: f64 = 0.02;
/// Classes of ranks. Their number is odd, for the closed form of chi-squared.
const CLASSES: usize = 11;
/// Ranges of the striker's radius, m, and velocity, m/s, from which each bead draws.
const RADII: [f64; 2] = [0.0035, 0.0095];
const VELOCITIES: [f64; 2] = [0.2, 1.0];
/// Quiet before the strike, s.
const LEAD_IN: f64 = 0.01;
/// Place of the bead in the paper's chain.
const BEAD: usize = 8;

/// The uncertainties that a careful laboratory could state, those of docs/scenarios/paper-bead.toml.
pub fn careful_laboratory() -> Uncertainty {
    let part = |part| Some(Relative::new(part));
    Uncertainty {
        calibration: Name::new("example").unwrap_or_default(),
        force_gain: part(0.0105),
        force_gain_ratio: part(0.001),
        force_flatness: part(0.003),
        acceleration_gain: part(0.01),
        acceleration_gain_ratio: part(0.001),
        acceleration_flatness: part(0.003),
        supply: part(0.001),
        bead_mass: part(0.0005),
        intruder_mass: part(0.001),
        stiffness: part(0.003),
        damping: part(0.01),
        contact_stiffness: part(0.01),
        relaxation: part(0.05),
        ..Uncertainty::default()
    }
}

/// The energies of a drawn bead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DrawnBead {
    /// Deviation of the truth from A, from B, and of 0 from A - B, in units of their standard uncertainties.
    pub deviations: [f64; 3],
    /// Flags of the strike.
    pub flags: StrikeFlags,
}

impl DrawnBead {
    /// True if a flag doubts the strike.
    pub fn is_doubted(&self) -> bool {
        self.flags.without(StrikeFlags::FROM_OUTSIDE) != StrikeFlags::NONE
    }
}

/// The paper's bead with the settings of a calibration, from which beads are drawn.
pub struct Calibrated {
    scenario: Scenario,
    front_end: AnalogFrontEnd,
    settings: bead_model::Settings,
    stated: Uncertainty,
}

impl Calibrated {
    /// The paper's bead with these uncertainties in its settings.
    ///
    /// # Errors
    /// No bead can have them.
    pub fn new(stated: Uncertainty) -> Result<Self, BenchError> {
        let (scenario, front_end) = (Scenario::paper(), AnalogFrontEnd::default());
        let placed = Placed {
            uncertainty: Some(stated),
            ..Placed::alone(BEAD, None)
        };
        let settings = settings_of(&simulate_with_ring_down(&scenario)?, placed, &front_end)?;
        Ok(Self {
            scenario,
            front_end,
            settings,
            stated,
        })
    }

    /// Draws bead number `number` and its strike, and measures it.
    ///
    /// # Errors
    /// Its chain cannot be simulated, it finds no strike, or it sends no uncertainty.
    pub fn draw(&self, seed: u64, number: u32) -> Result<DrawnBead, BenchError> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(number.into());
        let real = drawn_settings(self.settings.description(), &self.stated, &mut random);
        let mut scenario = self.scenario.clone();
        scenario.striker.radius = random.random_range(RADII[0]..RADII[1]);
        scenario.striker.velocity = random.random_range(VELOCITIES[0]..VELOCITIES[1]);
        let lead_in = LEAD_IN + random.random_range(0.0..1e-5);
        self.measure(scenario, &real, lead_in, random.random())
    }

    /// Measures a strike of the calibration's chain at a bead with the true parameters `real`.
    fn measure(
        &self,
        mut scenario: Scenario,
        real: &Description,
        lead_in: f64,
        noise: u64,
    ) -> Result<DrawnBead, BenchError> {
        let (nominal, mut front_end) = (self.settings.description(), self.front_end);
        let chain = &mut scenario.chain;
        chain.density *= real.bead.mass / nominal.bead.mass;
        chain.young *= real.contact.stiffness / nominal.contact.stiffness;
        chain.relaxation = real.contact.relaxation;
        for intruder in &mut scenario.intruders {
            intruder.mass = real.intruder.mass;
            (intruder.stiffness, intruder.damping) = (real.intruder.stiffness, real.intruder.damping);
        }
        front_end.force = front_end.force.with_scale(&real.force, 1.0);
        front_end.acceleration = front_end.acceleration.with_scale(&real.acceleration, 1.0);
        let timing = Timing::once(lead_in);
        let solution = simulate_with_ring_down(&scenario)?;
        let truth = Truth::of(&scenario, &solution, BEAD)?.absorbed;
        let reports = measured(&self.settings, &front_end, (&solution, BEAD), timing, noise);
        let unfit = |why: &str| BenchError::Unfit(format!("a drawn bead {why}"));
        let (strike, shape) = reports.first().ok_or_else(|| unfit("finds no strike"))?;
        let sent = shape.uncertainty.ok_or_else(|| {
            unfit("sends no uncertainty; state every one in [uncertainty] except that of the front mass")
        })?;
        let [a, b] = [strike.absorbed_measured, strike.absorbed_predicted].map(Energy::joules);
        Ok(DrawnBead {
            deviations: [
                (truth - a) / (a * sent.measured.ratio()),
                (truth - b) / (b * sent.predicted.ratio()),
                (b - a) / (a.max(b) * sent.difference.ratio()),
            ],
            flags: strike.flags,
        })
    }
}

/// True if chance explains that `doubted` of the drawn `beads` flag a doubt.
pub fn few_are_doubted(doubted: usize, beads: usize) -> bool {
    doubted as f64 <= FLAGGED * beads as f64
}

/// Coverage of one result over drawn beads.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Coverage {
    /// `A`, `B` or `A - B`. The truth of the last is 0.
    pub result: &'static str,
    /// Number of beads.
    pub beads: usize,
    /// Part of the intervals of ± 2 u that hold the truth.
    pub covered: f64,
    /// Mean of (truth - result) / u: 0 within its standard error if the uncertainties are right.
    pub mean: f64,
    /// Standard deviation of (truth - result) / u: 1 if the uncertainties are right.
    pub scatter: f64,
    /// Probability of ranks that are this uneven or more, if they are uniform (chi-squared).
    pub probability: f64,
    /// True if the intervals cover the truth in 92 to 98 %, and the probability of the ranks is above 0.01.
    pub holds: bool,
}

impl Coverage {
    /// The coverage of A, of B and of A - B.
    pub fn of(beads: &[DrawnBead]) -> [Self; 3] {
        [(0, "A"), (1, "B"), (2, "A - B")].map(|(place, result)| {
            let deviations: Vec<f64> = beads.iter().map(|bead| bead.deviations[place]).collect();
            Self::of_deviations(result, &deviations)
        })
    }

    fn of_deviations(result: &'static str, deviations: &[f64]) -> Self {
        let count = deviations.len() as f64;
        let is_covered = |deviation: &&f64| deviation.abs() <= COVERAGE_FACTOR;
        let covered = deviations.iter().filter(is_covered).count() as f64 / count;
        let [mean, scatter, probability] = rank_statistics(deviations);
        Self {
            result,
            beads: deviations.len(),
            covered,
            mean,
            scatter,
            probability,
            holds: (COVERED[0]..=COVERED[1]).contains(&covered) && probability > LEAST_PROBABILITY,
        }
    }
}

/// Mean and standard deviation of deviations in units of their standard uncertainties, and the probability of
/// ranks that are this uneven or more, if each deviation is normal.
pub(crate) fn rank_statistics(deviations: &[f64]) -> [f64; 3] {
    let count = deviations.len() as f64;
    let mean = deviations.iter().sum::<f64>() / count;
    let squares: f64 = deviations
        .iter()
        .map(|deviation| (deviation - mean).powi(2))
        .sum();
    let mut classes = [0; CLASSES];
    for deviation in deviations {
        // The normal distribution below it.
        let rank = 0.5 * libm::erfc(-deviation / SQRT_2);
        classes[((rank * CLASSES as f64) as usize).min(CLASSES - 1)] += 1;
    }
    [
        mean,
        (squares / (count - 1.0)).sqrt(),
        uniform_probability(&classes),
    ]
}

/// Probability that counts of classes which are equally likely are this uneven or more: the upper tail of
/// chi-squared, a finite sum for an even number of degrees of freedom (Abramowitz and Stegun, 26.4.5).
fn uniform_probability(classes: &[u32; CLASSES]) -> f64 {
    let expected = f64::from(classes.iter().sum::<u32>()) / CLASSES as f64;
    let off = |count: &u32| (f64::from(*count) - expected).powi(2) / expected;
    let half = classes.iter().map(off).sum::<f64>() / 2.0;
    let add = |(sum, term): (f64, f64), power: usize| (sum + term, term * half / power as f64);
    let (sum, _) = (1..=CLASSES / 2).fold((0.0, 1.0), add);
    (-half).exp() * sum
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(calibrated: &Calibrated, change: impl Fn(&mut Description)) -> StrikeFlags {
        let mut real = *calibrated.settings.description();
        change(&mut real);
        let bead = calibrated.measure(calibrated.scenario.clone(), &real, LEAD_IN, 1);
        bead.unwrap().flags
    }

    fn scale_force(real: &mut Description, factor: f64) {
        real.force.per_code *= factor;
        real.force.wide_per_code *= factor;
    }

    #[test]
    fn beads_of_a_calibration_are_covered_by_its_uncertainties_and_not_doubted() {
        let calibrated = Calibrated::new(careful_laboratory()).unwrap();
        let beads: Vec<_> = (0..80)
            .map(|number| calibrated.draw(1, number).unwrap())
            .collect();
        for of in Coverage::of(&beads) {
            println!("{of:?}");
            // 76 of 80, within 2.6 standard deviations; a scatter of 80 is within 8 % of the true one.
            assert!(of.covered >= 0.89 && of.probability > 0.01, "{of:?}");
            assert!((0.8..1.2).contains(&of.scatter), "{of:?}");
        }
        let doubted = beads.iter().filter(|bead| bead.is_doubted()).count();
        assert!(few_are_doubted(doubted, beads.len()), "{doubted}");
    }

    #[test]
    fn a_wave_form_is_doubted_beyond_what_the_uncertainties_explain() {
        let calibrated = Calibrated::new(careful_laboratory()).unwrap();
        let flags = |change: fn(&mut Description)| measured(&calibrated, change);
        let differs = StrikeFlags::MODEL_DIFFERS;
        for (flags, expected) in [
            (flags(|real| real.intruder.stiffness *= 1.006), StrikeFlags::NONE),
            (flags(|real| real.intruder.damping *= 0.98), StrikeFlags::NONE),
            (flags(|real| scale_force(real, 1.02)), StrikeFlags::NONE),
            (flags(|real| real.intruder.stiffness *= 1.02), differs),
            (flags(|real| real.intruder.mass *= 0.97), differs),
            (flags(|real| real.intruder.damping *= 1.2), differs),
            (flags(|real| scale_force(real, 1.06)), differs),
        ] {
            assert_eq!(flags, expected);
        }
    }

    #[test]
    fn the_tail_of_chi_squared_is_that_of_the_tables() {
        // Abramowitz and Stegun, table 26.8: ten degrees of freedom.
        let mut classes = [100; CLASSES];
        for (off, least, most) in [
            (0, 1.0, 1.0),
            (30, 0.05, 0.06),
            (34, 0.01, 0.02),
            (35, 0.005, 0.01),
        ] {
            (classes[0], classes[1]) = (100 + off, 100 - off);
            let found = uniform_probability(&classes);
            assert!((least..=most).contains(&found), "{off}: {found}");
        }
    }
}
