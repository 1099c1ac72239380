//! The transfer from one signal to another over several strikes, with its coherence.

use realfft::num_complex::Complex64;

/// Sums of spectra over strikes.
#[derive(Debug, Clone, PartialEq)]
pub struct TransferSums {
    strikes: u32,
    /// |X|², |Y|², and X* Y by frequency.
    sums: Vec<(f64, f64, Complex64)>,
}

/// A transfer at a frequency.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transfer {
    /// Y over X, by the estimate H1: noise in Y does not bias its mean.
    pub value: Complex64,
    /// γ², the part of Y's power that X explains; `None` for one strike, where it would be 1 whatever was
    /// measured.
    pub coherence: Option<f64>,
    /// Relative standard uncertainty of the magnitude by the scatter of the strikes: √((1 - γ²)/(2 n γ²))
    /// (Bendat and Piersol, Random Data, table 9.6).
    pub scatter: Option<f64>,
}

impl TransferSums {
    /// No strike yet, at this many frequencies.
    pub fn new(frequencies: usize) -> Self {
        Self {
            strikes: 0,
            sums: vec![(0.0, 0.0, Complex64::default()); frequencies],
        }
    }

    /// Adds a strike: the spectra of input and output.
    pub fn add(&mut self, input: &[Complex64], output: &[Complex64]) {
        self.strikes += 1;
        for ((of_input, of_output, cross), (x, y)) in self.sums.iter_mut().zip(input.iter().zip(output)) {
            *of_input += x.norm_sqr();
            *of_output += y.norm_sqr();
            *cross += x.conj() * y;
        }
    }

    /// The transfer at each frequency; not a number where the input is zero.
    pub fn transfers(&self) -> impl Iterator<Item = Transfer> {
        let strikes = f64::from(self.strikes);
        self.sums.iter().map(move |(input, output, cross)| {
            let coherence = (strikes > 1.0).then(|| (cross.norm_sqr() / (input * output)).min(1.0));
            let scatter = coherence.map(|part| ((1.0 - part) / (2.0 * strikes * part)).sqrt());
            Transfer {
                value: cross / input,
                coherence,
                scatter,
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_at_the_output_lowers_the_coherence_and_leaves_the_transfer() {
        let truth = Complex64::new(3.0, -4.0);
        let mut sums = TransferSums::new(1);
        let strikes = 4000;
        for n in 0..strikes {
            // Noise of half the output's amplitude, in even directions.
            let noise = Complex64::from_polar(2.5, 2.399_963 * f64::from(n));
            let input = Complex64::from_polar(1.0, 0.1 * f64::from(n));
            sums.add(&[input], &[truth * input + noise]);
            if n == 0 {
                let first = sums.transfers().next().unwrap();
                assert_eq!((first.coherence, first.scatter), (None, None));
            }
        }
        let found = sums.transfers().next().unwrap();
        assert!((found.value - truth).norm() < 0.01, "{found:?}");
        assert!((found.coherence.unwrap() - 0.8).abs() < 0.002, "{found:?}");
        // Of 4000 strikes: √(0.2/(2 · 4000 · 0.8)).
        assert!((found.scatter.unwrap() - 0.005_59).abs() < 1e-4, "{found:?}");
    }
}
