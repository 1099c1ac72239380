//! Values over strikes: mean, scatter, envelope, and the limit P95/50.

/// Mean and scatter of values, one after another (B. P. Welford, Technometrics 4, 1962).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Moments {
    count: f64,
    mean: f64,
    squares: f64,
}

impl Moments {
    fn add(&mut self, value: f64) {
        self.count += 1.0;
        let off = value - self.mean;
        self.mean += off / self.count;
        self.squares += off * (value - self.mean);
    }

    fn deviation(&self) -> Option<f64> {
        (self.count > 1.0).then(|| (self.squares / (self.count - 1.0)).sqrt())
    }
}

/// Values of one quantity, zero or above, over strikes.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct OverStrikes {
    values: Moments,
    logarithms: Moments,
    greatest: f64,
}

impl OverStrikes {
    /// Adds the value of a strike.
    pub fn add(&mut self, value: f64) {
        self.values.add(value);
        self.logarithms.add(value.ln());
        self.greatest = self.greatest.max(value);
    }

    /// The mean.
    pub fn mean(&self) -> f64 {
        self.values.mean
    }

    /// The standard deviation of the strikes' values; `None` for a single strike.
    pub fn deviation(&self) -> Option<f64> {
        self.values.deviation()
    }

    /// The greatest.
    pub fn greatest(&self) -> f64 {
        self.greatest
    }

    /// P95/50: with an even chance 95 of 100 strikes are below it, if the logarithms of their values are
    /// normal (NASA-HDBK-7005, 6.1.2). `factor` is that of [`tolerance`] for their number. `None` for fewer
    /// than three strikes, or if a value is zero.
    pub fn upper(&self, factor: f64) -> Option<f64> {
        let deviation = self.logarithms.deviation().filter(|_| self.values.count > 2.0)?;
        let upper = (self.logarithms.mean + factor * deviation).exp();
        upper.is_finite().then_some(upper)
    }
}

/// 95 % of a normal distribution is below its mean plus this many standard deviations.
const PART: f64 = 1.644_853_626_951_472_2;
/// Steps of the integral over the sample's standard deviation.
const STEPS: usize = 4000;

/// The factor k of a one-sided normal tolerance limit, mean + k s of `count` values: with a chance of one
/// half it is above 95 % of the distribution. Two values at least.
pub fn tolerance(count: usize) -> f64 {
    let (count, free) = (count as f64, count as f64 - 1.0);
    // Of w = s/σ: the density of √(χ²/ν), up to a factor.
    let widest = 1.0 + 12.0 / (2.0 * free).sqrt();
    let spread = |step: usize| widest * (step as f64 + 0.5) / STEPS as f64;
    let density = |w: f64| (free * (w.ln() - 0.5 * (w * w - 1.0)) - w.ln()).exp();
    let all: f64 = (0..STEPS).map(|step| density(spread(step))).sum();
    let normal = |z: f64| 0.5 * libm::erfc(-z * std::f64::consts::FRAC_1_SQRT_2);
    // The chance that mean + k s is above the quantile.
    let chance = |k: f64| {
        let at = |w: f64| density(w) * normal(count.sqrt() * (k * w - PART));
        (0..STEPS).map(|step| at(spread(step))).sum::<f64>() / all
    };
    let (mut least, mut most) = (0.0, 20.0);
    for _ in 0..50 {
        let middle = 0.5 * (least + most);
        if chance(middle) < 0.5 {
            least = middle;
        } else {
            most = middle;
        }
    }
    0.5 * (least + most)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tolerance_factors_are_those_of_the_noncentral_t() {
        // scipy.stats.nct.median(n - 1, 1.6448536 √n) / √n
        for (count, exact) in FACTORS {
            let found = tolerance(count);
            assert!((found - exact).abs() < 1e-4, "{count}: {found}");
        }
    }

    const FACTORS: [(usize, f64); 5] = [
        (2, 2.338_726_7),
        (3, 1.938_416_3),
        (5, 1.779_282_7),
        (20, 1.671_164_8),
        (1000, 1.645_344_3),
    ];

    #[test]
    fn values_have_a_mean_a_scatter_an_envelope_and_a_limit() {
        let mut over = OverStrikes::default();
        [1.0, 10.0].into_iter().for_each(|value| over.add(value));
        assert_eq!((over.mean(), over.greatest(), over.upper(2.0)), (5.5, 10.0, None));
        assert!((over.deviation().unwrap() - 4.5 * 2_f64.sqrt()).abs() < 1e-12);
        over.add(100.0);
        // The logarithms are 0, 1 and 2 times ln 10.
        let upper = over.upper(2.0).unwrap();
        assert!((upper / 1000.0 - 1.0).abs() < 1e-9, "{upper}");
        over.add(0.0);
        assert_eq!(over.upper(2.0), None);
    }
}
