//! Nonlinear least squares, with the uncertainty of the parameters found.

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{Const, DMatrix, DVector, Dyn, Owned, SMatrix, SVector};

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
    pub(crate) parameters: SVector<f64, P>,
    /// From the scatter of the points.
    pub(crate) covariance: SMatrix<f64, P, P>,
    /// Root mean square distance of the points; each parameter takes one degree of freedom.
    pub(crate) residual: f64,
}

/// Distances of points 0 to `points` from a model, each with its derivatives by the parameters.
struct Problem<F, const P: usize> {
    points: usize,
    distance: F,
    parameters: SVector<f64, P>,
}

impl<F, const P: usize> LeastSquaresProblem<f64, Dyn, Const<P>> for Problem<F, P>
where
    F: Fn(&SVector<f64, P>, usize) -> (f64, [f64; P]),
{
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Const<P>>;
    type ParameterStorage = Owned<f64, Const<P>>;

    fn set_params(&mut self, parameters: &SVector<f64, P>) {
        self.parameters = *parameters;
    }

    fn params(&self) -> SVector<f64, P> {
        self.parameters
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        let distance = |i, _| (self.distance)(&self.parameters, i).0;
        Some(DVector::from_fn(self.points, distance))
    }

    fn jacobian(&self) -> Option<nalgebra::OMatrix<f64, Dyn, Const<P>>> {
        let mut rows = nalgebra::OMatrix::<f64, Dyn, Const<P>>::zeros(self.points);
        for i in 0..self.points {
            let (_, derivatives) = (self.distance)(&self.parameters, i);
            rows.row_mut(i).copy_from_slice(&derivatives);
        }
        Some(rows)
    }
}

/// Finds the parameters that make Σ distance² least, from a first guess near them.
pub(crate) fn least_squares<const P: usize>(
    points: usize,
    guess: [f64; P],
    distance: impl Fn(&SVector<f64, P>, usize) -> (f64, [f64; P]),
) -> Result<Found<P>, FitError> {
    if points <= P {
        return Err(FitError::TooFew {
            got: points,
            need: P + 1,
        });
    }
    let problem = Problem {
        points,
        distance,
        parameters: SVector::from(guess),
    };
    let (problem, report) = LevenbergMarquardt::new().minimize(problem);
    if !report.termination.was_successful() {
        return Err(FitError::NoEnd);
    }
    let squares = 2.0 * report.objective_function;
    let residual = (squares / (points - P) as f64).sqrt();
    let jacobian = problem.jacobian().ok_or(FitError::NoEnd)?;
    let jacobian = DMatrix::from_iterator(points, P, jacobian.iter().copied());
    let information = jacobian.transpose() * &jacobian;
    let inverse = information.try_inverse().ok_or(FitError::NoEnd)?;
    Ok(Found {
        parameters: problem.parameters,
        covariance: SMatrix::from_fn(|row, column| residual * residual * inverse[(row, column)]),
        residual,
    })
}
