//! The two chains of the comparison.

use hertz_chain::{Accuracy, Intruder, Options, Oscillator, Scenario, simulate_with};

/// A chain, and its motion as an independent, converged run has it.
pub(crate) struct Case {
    pub(crate) name: &'static str,
    pub(crate) what: &'static str,
    pub(crate) scenario: Scenario,
    /// Velocities of all bodies at the end, m/s.
    pub(crate) end: Vec<f64>,
    /// The same at each of [`SAMPLES`] times.
    pub(crate) samples: Vec<Vec<f64>>,
}

/// Samples of a run.
pub(crate) const SAMPLES: usize = 1000;

fn plain(beads: usize, relaxation: f64, host: usize, stiffness: f64) -> Scenario {
    let mut scenario = Scenario::paper();
    scenario.duration = 0.010;
    scenario.chain.beads = beads;
    scenario.chain.relaxation = relaxation;
    let oscillator = Oscillator {
        stiffness,
        ..Oscillator::PAPER
    };
    scenario.intruders = vec![Intruder::new([host], oscillator)];
    scenario
}

impl Case {
    pub(crate) fn all() -> [Self; 2] {
        [
            Self::new(
                "A",
                "16 viscoelastic beads, intruder in bead 8, 10 ms",
                plain(16, 4.2e-6, 8, 3.95e5),
            ),
            Self::new(
                "B",
                "46 elastic beads, intruder in bead 15, 10 ms",
                plain(46, 0.0, 15, 1e5),
            ),
        ]
    }

    fn new(name: &'static str, what: &'static str, scenario: Scenario) -> Self {
        let accuracy = Accuracy {
            tolerance: 1e-14,
            longest_step: 1.0 / 16.0,
        };
        let options = Options {
            accuracy,
            ..Options::default()
        };
        let solution = simulate_with(&scenario, &options).expect("the case can be run");
        let mut sampler = solution.sampler();
        let mut velocities = |t: f64| {
            let snapshot = sampler.at(t);
            (0..=scenario.chain.beads)
                .map(|body| snapshot.velocity(body))
                .collect()
        };
        Self {
            name,
            what,
            end: velocities(scenario.duration),
            samples: (1..=SAMPLES)
                .map(|i| velocities(scenario.duration * i as f64 / SAMPLES as f64))
                .collect(),
            scenario,
        }
    }

    /// The greatest error of a velocity at the end, as a part of the greatest velocity.
    pub(crate) fn end_error(&self, velocities: &[f64]) -> f64 {
        distance(velocities, &self.end) / greatest(&self.end)
    }

    /// The same over all samples.
    pub(crate) fn sampled_error(&self, samples: &[Vec<f64>]) -> f64 {
        let error = samples
            .iter()
            .zip(&self.samples)
            .map(|(one, other)| distance(one, other));
        error.fold(0.0, f64::max)
            / self
                .samples
                .iter()
                .map(|sample| greatest(sample))
                .fold(0.0, f64::max)
    }
}

fn distance(one: &[f64], other: &[f64]) -> f64 {
    one.iter()
        .zip(other)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, |a, b| if b.is_nan() { b } else { a.max(b) })
}

fn greatest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |a, b| a.max(b.abs()))
}
