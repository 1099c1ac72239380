//! Nonlinear least squares, with the uncertainty of the parameters found.

use rmpfit::{MPConfig, MPFitter, MPPar, MPResult, MPSide, MPSuccess};

/// Why data could not be fitted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// Too few points for the parameters and an estimate of their scatter.
    #[error("the fit has {got} points and needs {need}; measure more of them")]
    TooFew {
        /// Number of points.
        got: usize,
        /// Number of points that the fit takes.
        need: usize,
    },
    /// A value of the data, or the mass, is not a positive or not a finite number as it should be.
    #[error("{what} is not what a fit can use; give {advice}")]
    Value {
        /// Which value.
        what: String,
        /// What would do.
        advice: &'static str,
    },
    /// The fit finds no parameters that follow the data.
    #[error("the fit finds no end; see whether the data show a resonance")]
    NoEnd,
}

/// What least squares find: the parameters, their covariance, and the scatter.
pub(crate) struct Found<const P: usize> {
    pub(crate) parameters: [f64; P],
    /// From the scatter of the points.
    pub(crate) covariance: [[f64; P]; P],
    /// Root mean square distance of the points; each parameter takes one degree of freedom.
    pub(crate) residual: f64,
}

/// Distances of points 0 to `points` from a model, each with its derivatives by the parameters.
struct Problem<F, const P: usize> {
    points: usize,
    distance: F,
    parameters: [MPPar; P],
}

/// Until rounding ends it.
static SETTINGS: MPConfig = MPConfig {
    ftol: 30.0 * f64::EPSILON,
    xtol: 30.0 * f64::EPSILON,
    gtol: 30.0 * f64::EPSILON,
    ..MPConfig::new()
};

impl<F, const P: usize> Problem<F, P>
where
    F: Fn(&[f64; P], usize) -> (f64, [f64; P]),
{
    fn all(&self, parameters: &[f64]) -> impl Iterator<Item = (f64, [f64; P])> {
        let parameters = std::array::from_fn(|which| parameters[which]);
        (0..self.points).map(move |i| (self.distance)(&parameters, i))
    }
}

impl<F, const P: usize> MPFitter for Problem<F, P>
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

/// Finds the parameters that make Σ distance² least, from a first guess near them.
pub(crate) fn least_squares<const P: usize>(
    points: usize,
    guess: [f64; P],
    distance: impl Fn(&[f64; P], usize) -> (f64, [f64; P]),
) -> Result<Found<P>, FitError> {
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
    let mut problem = Problem {
        points,
        distance,
        parameters: std::array::from_fn(with_derivatives),
    };
    let mut parameters = guess;
    let ended = problem.mpfit(&mut parameters).map_err(|_| FitError::NoEnd)?;
    // A direction along which nothing changes has no variance there.
    let undecided = ended.xerror.iter().any(|error| *error <= 0.0);
    if undecided || matches!(ended.success, MPSuccess::NotDone | MPSuccess::MaxIter) {
        return Err(FitError::NoEnd);
    }
    let squares: f64 = ended.resid.iter().map(|distance| distance * distance).sum();
    let variance = squares / (points - P) as f64;
    let of_row = |row| std::array::from_fn(|column| variance * ended.covar[row * P + column]);
    Ok(Found {
        parameters,
        covariance: std::array::from_fn(of_row),
        residual: variance.sqrt(),
    })
}
