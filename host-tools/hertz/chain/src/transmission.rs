//! Energy E(n) that the first n intruders of a row leave, and the part T that each transmits (Fig. 5).

use crate::scenario::Scenario;
use crate::simulate::{SimulateError, simulate};
use crate::solution::Solution;

impl Scenario {
    /// Beads that hold an intruder, in order.
    pub fn hosts(&self) -> Vec<usize> {
        let mut hosts: Vec<usize> = self.intruders.iter().flat_map(|one| one.beads.clone()).collect();
        hosts.sort_unstable();
        hosts.dedup();
        hosts
    }

    /// Returns the scenario with intruders in the first `n` of its hosts only.
    #[must_use]
    pub fn with_first_hosts(&self, n: usize) -> Self {
        let hosts = self.hosts();
        let kept = &hosts[..n.min(hosts.len())];
        let mut fewer = self.clone();
        for intruder in &mut fewer.intruders {
            intruder.beads.retain(|bead| kept.contains(bead));
        }
        // A carrier is named by the number of its table, which changes when empty tables are removed.
        let stays: Vec<bool> = fewer.intruders.iter().map(|one| !one.beads.is_empty()).collect();
        fewer.intruders.retain(|intruder| !intruder.beads.is_empty());
        for inside in fewer.intruders.iter_mut().filter_map(|one| one.inside.as_mut()) {
            *inside = stays[..*inside].iter().filter(|stays| **stays).count();
        }
        fewer
    }
}

impl Solution {
    /// Energy of the chain at the end of the run as the paper prints it, J: the energy that the intruders
    /// have left. Energy that they still hold is not part of it; energy that they have given back is.
    pub fn energy_left(&self) -> f64 {
        self.at(self.end()).energies().chain_as_printed
    }
}

/// Returns E(0), E(1) and so on, as parts of E(0): the energy left by the first 0, 1 and more hosts of a
/// scenario. Each is a run of its own, as in the paper's Fig. 5.
///
/// # Errors
/// The scenario cannot be integrated.
pub fn energies_left(scenario: &Scenario) -> Result<Vec<f64>, SimulateError> {
    let left = |n: usize| Ok(simulate(&scenario.with_first_hosts(n))?.energy_left());
    let left = (0..=scenario.hosts().len()).map(left);
    let left = left.collect::<Result<Vec<f64>, SimulateError>>()?;
    Ok(left.iter().map(|energy| energy / left[0]).collect())
}

/// Least-squares line through ln E over n: E(n) = E(0) Tⁿ, the paper's E_{n+1} = T E_n.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, schemars::JsonSchema)]
#[non_exhaustive]
pub struct TransmissionFit {
    /// T, the part of the energy that each intruder transmits.
    pub transmission: f64,
    /// E(0) of the line, in the unit of the energies.
    pub initial: f64,
    /// Standard error of T, from the scatter about the line.
    pub uncertainty: f64,
    /// Root mean square distance of ln E from the line, with n - 2 degrees of freedom.
    pub residual: f64,
}

impl TransmissionFit {
    /// Fits points (n, E). `None` with fewer than three, a single n, or an energy that is not positive.
    pub fn of(points: &[(usize, f64)]) -> Option<Self> {
        let fits = |(_, energy): &(usize, f64)| energy.is_finite() && *energy > 0.0;
        if points.len() < 3 || !points.iter().all(fits) {
            return None;
        }
        let count = points.len() as f64;
        let mean_n = points.iter().map(|(n, _)| *n as f64).sum::<f64>() / count;
        let mean_log = points.iter().map(|(_, energy)| energy.ln()).sum::<f64>() / count;
        let (mut spread, mut slope) = (0.0, 0.0);
        for (n, energy) in points {
            let distance = *n as f64 - mean_n;
            spread += distance * distance;
            slope += distance * (energy.ln() - mean_log);
        }
        if spread == 0.0 {
            return None;
        }
        slope /= spread;
        let distance = |(n, energy): &(usize, f64)| energy.ln() - mean_log - slope * (*n as f64 - mean_n);
        let squares: f64 = points.iter().map(|point| distance(point).powi(2)).sum();
        let residual = (squares / (count - 2.0)).sqrt();
        let transmission = slope.exp();
        Some(Self {
            transmission,
            uncertainty: transmission * residual / spread.sqrt(),
            initial: (mean_log - slope * mean_n).exp(),
            residual,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Intruder, Oscillator};

    #[test]
    fn hosts_are_counted_from_the_striker_whatever_their_order_in_the_file() {
        let mut scenario = Scenario::paper();
        let hosted = |beads: &[usize]| Intruder::new(beads.to_vec(), Oscillator::PAPER);
        scenario.intruders = vec![hosted(&[12, 7]), hosted(&[9])];
        assert_eq!(scenario.hosts(), [7, 9, 12]);
        let first = |n| scenario.with_first_hosts(n).hosts();
        assert!(first(0).is_empty() && first(1) == [7]);
        assert_eq!((first(2), first(9)), (vec![7, 9], vec![7, 9, 12]));
        // The last intruder sits in that of bead 9, whose table becomes the first.
        scenario.intruders = vec![hosted(&[12]), hosted(&[9]), hosted(&[7]), hosted(&[9])];
        scenario.intruders[3].inside = Some(2);
        assert_eq!(scenario.with_first_hosts(2).intruders[2].inside, Some(1));
    }
}
