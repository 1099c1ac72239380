//! Intruders in their hosts.

use crate::oscillator::Oscillator;
use crate::scenario::Scenario;

/// The intruders of a scenario in the order of their beads, those of a bead in the order of their tables. A
/// carrier therefore precedes all that it carries.
pub(super) fn of(scenario: &Scenario) -> Vec<HostedIntruder> {
    let mut places: Vec<(usize, usize)> = (scenario.intruders.iter().enumerate())
        .flat_map(|(table, intruder)| intruder.beads.iter().map(move |&bead| (bead, table)))
        .collect();
    places.sort_unstable();
    let hosted = places.iter().map(|&(bead, table)| {
        let intruder = &scenario.intruders[table];
        HostedIntruder {
            bead,
            // `inside` counts tables from 1.
            carrier: intruder
                .inside
                .and_then(|number| places.binary_search(&(bead, number - 1)).ok()),
            oscillator: intruder.oscillator(),
            cubic_stiffness: intruder.cubic_stiffness,
        }
    });
    hosted.collect()
}

/// An intruder in its host, or in another intruder there.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct HostedIntruder {
    /// The host bead, from 1.
    pub bead: usize,
    /// Number in [`Model::intruders`](crate::Model::intruders) of the intruder that carries it, an earlier
    /// one of this bead; `None` if the bead carries it.
    pub carrier: Option<usize>,
    /// Mass, stiffness and damping.
    pub oscillator: Oscillator,
    /// Cubic stiffness k₃, N/m³; zero for a linear spring.
    pub cubic_stiffness: f64,
}

impl HostedIntruder {
    /// Force k x + k₃ x³ + c x' of spring and damper on the host or carrier, N. `distance` is x, in m from
    /// that body; `rate` is x', in m/s.
    #[inline]
    pub(crate) fn pull(&self, distance: f64, rate: f64) -> f64 {
        let Oscillator {
            stiffness, damping, ..
        } = self.oscillator;
        (stiffness + self.cubic_stiffness * distance * distance) * distance + damping * rate
    }

    /// Rate of [`HostedIntruder::pull`], N/s, where x' changes by `acceleration`, m/s².
    #[inline]
    pub(crate) fn pull_rate(&self, distance: f64, rate: f64, acceleration: f64) -> f64 {
        let Oscillator {
            stiffness, damping, ..
        } = self.oscillator;
        (stiffness + 3.0 * self.cubic_stiffness * distance * distance) * rate + damping * acceleration
    }

    /// Energy ½ k x² + ¼ k₃ x⁴ of the spring at x, in m from the host, J.
    #[inline]
    pub fn elastic_energy(&self, distance: f64) -> f64 {
        let square = 0.5 * self.cubic_stiffness * distance * distance;
        0.5 * (self.oscillator.stiffness + square) * distance * distance
    }

    /// Distance √(-k/k₃) from the host at which a softening spring no longer pulls back, m; `None` for a
    /// spring that does so at any distance.
    pub fn reach(&self) -> Option<f64> {
        self.oscillator.reach(self.cubic_stiffness)
    }
}
