//! Least squares over all strikes at once, by Levenberg's and Marquardt's method.

use nalgebra::{DMatrix, DVector};
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use crate::model::StrikeModel;
use crate::normal::{Normal, SharedVector, StrikeNormal};
use crate::quantity::{COUNT, Quantity, Values, moved};

/// Greatest number of steps of a fit, including those that fit worse.
const MOST_STEPS: usize = 40;
/// A fit has ended when a step would lower the sum of squares by less than this.
const ENOUGH: f64 = 1e-3;
/// Factor of the damping after a step that fits better.
const SHRINK: f64 = 0.03;
/// Damping too small to change a variance.
const UNDAMPED: f64 = 1e-7;
/// Greatest step of a quantity's logarithm.
const LONGEST: f64 = 0.3;

/// A strike and its own numbers at the best fit.
pub struct FittedStrike<'a> {
    /// The strike.
    pub model: &'a dyn StrikeModel,
    /// Its own numbers.
    pub own: Vec<f64>,
    /// Its normal equations at the best fit.
    pub normal: StrikeNormal,
}

impl FittedStrike<'_> {
    /// Standard error of an own number, for a covariance of the logarithms of the free quantities.
    pub fn own_error(&self, number: usize, free: &[Quantity], covariance: &DMatrix<f64>) -> f64 {
        self.normal.own_variance(number, free, covariance).sqrt()
    }
}

/// The best fit.
pub struct Fit<'a> {
    /// Values of all quantities; held ones keep their start values.
    pub values: Values,
    /// The quantities that were fitted.
    pub free: Vec<Quantity>,
    /// The strikes.
    pub strikes: Vec<FittedStrike<'a>>,
    /// Sum of their normal equations at the best fit.
    pub normal: Normal,
}

impl<'a> Fit<'a> {
    /// The strikes with their own numbers, as the start of another fit.
    pub(crate) fn starts(&self) -> Vec<StrikeStart<'a>> {
        let strikes = self.strikes.iter();
        strikes.map(|strike| (strike.model, strike.own.clone())).collect()
    }
}

/// A failed fit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// A strike cannot be computed, or its own numbers cannot be told apart.
    #[error("strike {strike}: {why}")]
    Strike {
        /// Its place among the strikes.
        strike: usize,
        /// The reason.
        why: String,
    },
    /// The steps did not end.
    #[error(
        "the fit did not converge in {MOST_STEPS} steps; start nearer to the true values with --from, or fit \
         fewer quantities"
    )]
    NoEnd,
    /// The quantities cannot be told apart.
    #[error("the quantities cannot be told apart; fit fewer of them")]
    Singular,
}

/// A strike with its own numbers at the start of a fit.
pub type StrikeStart<'a> = (&'a dyn StrikeModel, Vec<f64>);

/// The normal equations of strikes at these values.
///
/// # Errors
/// A strike cannot be computed; the error is that of the first.
fn equations(
    strikes: &[StrikeStart<'_>],
    values: &Values,
    (damping, with_shared): (f64, bool),
) -> Result<Vec<StrikeNormal>, FitError> {
    let of = |(model, own): &StrikeStart<'_>| {
        let mut evaluation = model.evaluate(values, own, with_shared)?;
        evaluation.columns().for_each(|column| model.whiten(column));
        StrikeNormal::new(&evaluation, damping)
            .ok_or_else(|| "its strength and timing cannot be told apart; it is too quiet".to_owned())
    };
    let all: Vec<Result<StrikeNormal, String>> = strikes.par_iter().map(of).collect();
    let all = all.into_iter().enumerate();
    all.map(|(strike, one)| one.map_err(|why| FitError::Strike { strike, why }))
        .collect()
}

/// Sum of the normal equations of strikes at these values.
///
/// # Errors
/// A strike cannot be computed.
pub fn normal_at(strikes: &[StrikeStart<'_>], values: &Values) -> Result<Normal, FitError> {
    let all = equations(strikes, values, (0.0, true))?;
    Ok(sum(all.iter().map(|one| &one.shared)))
}

/// Sum of normal equations.
fn sum<'n>(normals: impl IntoIterator<Item = &'n Normal>) -> Normal {
    let mut sum = Normal::default();
    normals.into_iter().for_each(|one| sum.add(one));
    sum
}

/// The rows and columns of the free quantities.
pub fn part(normal: &Normal, free: &[Quantity]) -> (DMatrix<f64>, DVector<f64>) {
    let at = |n: usize| free[n].place();
    let count = free.len();
    (
        DMatrix::from_fn(count, count, |a, b| normal.information[(at(a), at(b))]),
        DVector::from_fn(count, |a, _| normal.right[at(a)]),
    )
}

/// The step of the free quantities for damped normal equations.
fn step(normal: &Normal, free: &[Quantity], damping: f64) -> Option<SharedVector> {
    let (mut information, right) = part(normal, free);
    for at in 0..free.len() {
        information[(at, at)] *= 1.0 + damping;
    }
    let found = if free.is_empty() {
        DVector::zeros(0)
    } else {
        information.cholesky()?.solve(&right)
    };
    let mut step = SharedVector::zeros();
    for (quantity, value) in free.iter().zip(found.iter()) {
        step[quantity.place()] = value.clamp(-LONGEST, LONGEST);
    }
    Some(step)
}

/// Fits the free quantities to all strikes, each of which starts at its own numbers in `strikes`.
///
/// # Errors
/// A strike cannot be computed at the start, the quantities cannot be told apart, or the fit does not
/// converge.
pub fn fit<'a>(strikes: &[StrikeStart<'a>], start: &Values, free: &[Quantity]) -> Result<Fit<'a>, FitError> {
    let (mut strikes, mut values) = (strikes.to_vec(), *start);
    let mut damping = 1e-4;
    let with_shared = !free.is_empty();
    let mut normals = equations(&strikes, &values, (damping, with_shared))?;
    let mut steps_left = MOST_STEPS;
    loop {
        let total = sum(normals.iter().map(|one| &one.shared));
        let step = step(&total, free, damping).ok_or(FitError::Singular)?;
        let without_own: f64 = normals.iter().map(StrikeNormal::squares_without_own).sum();
        let gain = total.squares - without_own + step.dot(&(2.0 * total.right - total.information * step));
        let mut log = [0.0; COUNT];
        log.copy_from_slice(&step.as_slice()[..COUNT]);
        let next_values = moved(&values, &log);
        let stepped = |((model, own), normal): (&StrikeStart<'a>, &StrikeNormal)| {
            let steps = normal.own_step(&step).into_iter();
            (
                *model,
                own.iter().zip(steps).map(|(own, step)| own + step).collect(),
            )
        };
        let next_strikes: Vec<StrikeStart<'a>> = strikes.iter().zip(&normals).map(stepped).collect();
        let next = equations(&next_strikes, &next_values, (SHRINK * damping, with_shared));
        let next = next.ok().filter(|next| {
            let squares: f64 = next.iter().map(|one| one.shared.squares).sum();
            squares <= total.squares * (1.0 + 1e-12)
        });
        match next {
            Some(next) => {
                (values, strikes, normals) = (next_values, next_strikes, next);
                damping *= SHRINK;
                if gain.abs() < ENOUGH {
                    break;
                }
            }
            None if gain.abs() < ENOUGH => break,
            None => {
                damping *= 10.0;
                if damping > 1e8 {
                    return Err(FitError::NoEnd);
                }
                let again = equations(&strikes, &values, (damping, with_shared));
                normals = again.map_err(|_| FitError::NoEnd)?;
            }
        }
        steps_left -= 1;
        if steps_left == 0 {
            return Err(FitError::NoEnd);
        }
    }
    if damping > UNDAMPED {
        let again = equations(&strikes, &values, (0.0, with_shared));
        normals = again.map_err(|_| FitError::NoEnd)?;
    }
    let normal = sum(normals.iter().map(|one| &one.shared));
    let strikes = strikes.into_iter().zip(normals);
    let strikes = strikes.map(|((model, own), normal)| FittedStrike { model, own, normal });
    Ok(Fit {
        values,
        free: free.to_vec(),
        strikes: strikes.collect(),
        normal,
    })
}
