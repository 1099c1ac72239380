//! The two chains of the comparison.

use hertz_chain::{Accuracy, Intruder, Oscillator, Scenario};

use crate::ours;

/// A chain, and its motion in a converged run of the simulator. Since the simulator is compared here too, the
/// difference of a converged run of another solver is measured with each case.
pub(crate) struct Case {
    pub(crate) name: &'static str,
    pub(crate) what: &'static str,
    pub(crate) scenario: Scenario,
    /// Velocities of all bodies at the end, m/s.
    pub(crate) end: Vec<f64>,
    /// Velocities of all bodies at each of [`ours::SAMPLES`] times, one after another.
    pub(crate) samples: Vec<f64>,
}

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
    /// Name, what it is, and the scenario.
    pub(crate) fn scenarios() -> [(&'static str, &'static str, Scenario); 2] {
        [
            (
                "A",
                "16 viscoelastic beads, intruder in bead 8, 10 ms",
                plain(16, 4.2e-6, 8, 3.95e5),
            ),
            (
                "B",
                "46 elastic beads, intruder in bead 15, 10 ms",
                plain(46, 0.0, 15, 1e5),
            ),
        ]
    }

    pub(crate) fn all() -> [Self; 2] {
        Self::scenarios().map(|(name, what, scenario)| Self::new(name, what, scenario))
    }

    fn new(name: &'static str, what: &'static str, scenario: Scenario) -> Self {
        let accuracy = Accuracy::new(1e-14, 1.0 / 16.0);
        Self {
            name,
            what,
            end: ours::end(&scenario, accuracy),
            // The first is the start.
            samples: ours::samples(&scenario, accuracy).split_off(scenario.chain.beads + 1),
            scenario,
        }
    }

    /// The greatest error of a velocity at the end, as a part of the greatest velocity.
    pub(crate) fn end_error(&self, velocities: &[f64]) -> f64 {
        distance(velocities, &self.end) / greatest(&self.end)
    }

    /// Error over all samples, with the start before them or not.
    pub(crate) fn sampled_error(&self, samples: &[f64]) -> f64 {
        let samples = &samples[samples.len() - self.samples.len()..];
        distance(samples, &self.samples) / greatest(&self.samples)
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
