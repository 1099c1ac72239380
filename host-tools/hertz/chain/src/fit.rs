//! Nonlinear least squares with standard errors of the parameters.

use rmpfit::{MPConfig, MPFitter, MPPar, MPResult, MPSide, MPSuccess};

/// Reason why data cannot be fitted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// Too few points for the parameters and an estimate of their scatter.
    #[error("the fit has {got} points and needs {need}; measure more points")]
    TooFew {
        /// Number of points.
        got: usize,
        /// Least number of points.
        need: usize,
    },
    /// A value is not finite, or not positive where it must be.
    #[error("a fit cannot use {what}; give {advice}")]
    Value {
        /// The name of the value, and the value.
        what: String,
        /// The accepted values.
        advice: &'static str,
    },
    /// No parameters describe the data.
    #[error("the fit does not converge; check that the data show a resonance")]
    NoEnd,
}

/// Result of a least-squares fit.
pub(crate) struct LeastSquares<const P: usize> {
    pub(crate) parameters: [f64; P],
    /// Covariance of the parameters, from the scatter of the points.
    pub(crate) covariance: [[f64; P]; P],
    /// Root mean square distance of the points. Each parameter takes one degree of freedom.
    pub(crate) residual: f64,
}

/// Distances of points 0 to `points` from a model, each with its derivatives with respect to the parameters.
struct FitProblem<F, const P: usize> {
    points: usize,
    distance: F,
    parameters: [MPPar; P],
}

/// Iterates until rounding stops the progress.
static SETTINGS: MPConfig = MPConfig {
    ftol: 30.0 * f64::EPSILON,
    xtol: 30.0 * f64::EPSILON,
    gtol: 30.0 * f64::EPSILON,
    ..MPConfig::new()
};

impl<F, const P: usize> FitProblem<F, P>
where
    F: Fn(&[f64; P], usize) -> (f64, [f64; P]),
{
    fn all(&self, parameters: &[f64]) -> impl Iterator<Item = (f64, [f64; P])> {
        let parameters = std::array::from_fn(|which| parameters[which]);
        (0..self.points).map(move |i| (self.distance)(&parameters, i))
    }
}

impl<F, const P: usize> MPFitter for FitProblem<F, P>
where
    F: Fn(&[f64; P], usize) -> (f64, [f64; P]),
{
    fn eval(&mut self, parameters: &[f64], distances: &mut [f64]) -> MPResult<()> {
        for (to, (distance, _)) in distances.iter_mut().zip(self.all(parameters)) {
            *to = distance;
        }
        Ok(())
    }

    fn jacobian(
        &mut self,
        parameters: &[f64],
        distances: &mut [f64],
        columns: &mut [Option<Vec<f64>>],
    ) -> MPResult<()> {
        for (i, (distance, derivatives)) in self.all(parameters).enumerate() {
            distances[i] = distance;
            for (column, derivative) in columns.iter_mut().flatten().zip(derivatives) {
                column[i] = derivative;
            }
        }
        Ok(())
    }

    fn number_of_points(&self) -> usize {
        self.points
    }

    fn config(&self) -> &MPConfig {
        &SETTINGS
    }

    fn parameters(&self) -> &[MPPar] {
        &self.parameters
    }
}

/// Finds the parameters that minimise Σ distance², starting from `guess`.
pub(crate) fn least_squares<const P: usize>(
    points: usize,
    guess: [f64; P],
    distance: impl Fn(&[f64; P], usize) -> (f64, [f64; P]),
) -> Result<LeastSquares<P>, FitError> {
    if points <= P {
        return Err(FitError::TooFew {
            got: points,
            need: P + 1,
        });
    }
    let with_derivatives = |_| MPPar {
        side: MPSide::User,
        ..MPPar::new()
    };
    let mut problem = FitProblem {
        points,
        distance,
        parameters: std::array::from_fn(with_derivatives),
    };
    let mut parameters = guess;
    let ended = problem.mpfit(&mut parameters).map_err(|_| FitError::NoEnd)?;
    // A direction in which the distances do not change has no variance.
    let undecided = ended.xerror.iter().any(|error| *error <= 0.0);
    if undecided || matches!(ended.success, MPSuccess::NotDone | MPSuccess::MaxIter) {
        return Err(FitError::NoEnd);
    }
    let squares: f64 = ended.resid.iter().map(|distance| distance * distance).sum();
    let variance = squares / (points - P) as f64;
    let of_row = |row| std::array::from_fn(|column| variance * ended.covar[row * P + column]);
    Ok(LeastSquares {
        parameters,
        covariance: std::array::from_fn(of_row),
        residual: variance.sqrt(),
    })
}
