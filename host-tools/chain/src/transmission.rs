//! The energy that n intruders leave, as a power of n.

/// The line through ln E over n by least squares: E(n) = E(0) Tⁿ, the paper's E_{n+1} = T E_n.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct TransmissionFit {
    /// T: the part of the energy that each intruder lets pass.
    pub transmission: f64,
    /// Standard error of T, from the scatter about the line.
    pub uncertainty: f64,
    /// E(0) of the line, in the unit of the energies.
    pub initial: f64,
    /// Root mean square distance of ln E from the line, with n - 2 degrees of freedom: how far from
    /// exponential the energies are.
    pub residual: f64,
}

impl TransmissionFit {
    /// Fits points (n, E). None with fewer than three points, with a single n, or with an energy that is not
    /// positive.
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
        let squares: f64 = points
            .iter()
            .map(|(n, energy)| energy.ln() - mean_log - slope * (*n as f64 - mean_n))
            .map(|distance| distance * distance)
            .sum();
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
