//! Least squares over all strikes at once, by Levenberg's and Marquardt's method.

use nalgebra::{DMatrix, DVector};
use rayon::iter::{IndexedParallelIterator, IntoParallelIterator, IntoParallelRefIterator, ParallelIterator};

use crate::model::StrikeModel;
use crate::normal::{Normal, SharedVector, StrikeNormal};
use crate::quantity::{COUNT, Quantity, Values, moved};

/// Most evaluations of all strikes in a fit.
const MOST_STEPS: usize = 40;
/// A fit has ended when a step would lower the sum of squares by less than this.
const ENOUGH: f64 = 1e-3;
/// Factor of the damping after a step that fits better.
const SHRINK: f64 = 0.03;
/// Damping that changes no variance.
const UNDAMPED: f64 = 1e-7;
/// Greatest step of a quantity's logarithm.
const LONGEST: f64 = 0.3;

/// A strike and what it has of its own at the best fit.
pub struct FittedStrike<'a> {
    /// The strike.
    pub model: &'a dyn StrikeModel,
    /// Its own numbers.
    pub own: Vec<f64>,
    /// Its normal equations at the best fit.
    pub normal: Normal,
    whole: StrikeNormal,
}

impl FittedStrike<'_> {
    /// Standard error of an own number, for a covariance of the logarithms of the free quantities.
    pub fn own_error(&self, number: usize, free: &[Quantity], covariance: &DMatrix<f64>) -> f64 {
        self.whole.own_variance(number, free, covariance).sqrt()
    }
}

/// The best fit.
pub struct Fit<'a> {
    /// Values of all quantities; those that were held have their start.
    pub values: Values,
    /// The quantities that were fitted.
    pub free: Vec<Quantity>,
    /// The strikes.
    pub strikes: Vec<FittedStrike<'a>>,
    /// Sum of their normal equations at the best fit.
    pub normal: Normal,
}

/// Why a fit found nothing.
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
        "the fit found no end in {MOST_STEPS} steps; begin nearer to the true values, by --from, or fit fewer quantities"
    )]
    NoEnd,
    /// The quantities cannot be told apart.
    #[error("the quantities cannot be told apart; fit fewer of them")]
    Singular,
}

type Evaluated = Result<StrikeNormal, String>;

fn evaluated(
    model: &dyn StrikeModel,
    values: &Values,
    own: &[f64],
    (damping, with_shared): (f64, bool),
) -> Evaluated {
    let evaluation = model.evaluate(values, own, with_shared)?;
    StrikeNormal::new(&evaluation, damping)
        .ok_or_else(|| "its speed and moment cannot be told apart; it is too quiet".to_owned())
}

/// Sum of the normal equations of strikes at these values.
///
/// # Errors
/// A strike cannot be computed.
pub fn normal_at(strikes: &[(&dyn StrikeModel, Vec<f64>)], values: &Values) -> Result<Normal, FitError> {
    let all: Result<Vec<StrikeNormal>, FitError> = strikes
        .par_iter()
        .enumerate()
        .map(|(strike, (model, own))| {
            evaluated(*model, values, own, (0.0, true)).map_err(|why| FitError::Strike { strike, why })
        })
        .collect();
    Ok(sum(all?.iter().map(|one| &one.normal)))
}

/// Sum of normal equations.
pub fn sum<'n>(normals: impl IntoIterator<Item = &'n Normal>) -> Normal {
    let mut sum = Normal::none();
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

/// Fits the free quantities to all strikes, each with its own numbers from `own` on.
///
/// # Errors
/// A strike cannot be computed at the start, the quantities cannot be told apart, or no end is found.
pub fn fit<'a>(
    strikes: &[(&'a dyn StrikeModel, Vec<f64>)],
    start: &Values,
    free: &[Quantity],
) -> Result<Fit<'a>, FitError> {
    let models: Vec<&'a dyn StrikeModel> = strikes.iter().map(|(model, _)| *model).collect();
    let mut owns: Vec<Vec<f64>> = strikes.iter().map(|(_, own)| own.clone()).collect();
    let mut values = *start;
    let mut damping = 1e-4;
    let with_shared = !free.is_empty();
    let all = |values: &Values, owns: &[Vec<f64>], damping: f64| -> Vec<Evaluated> {
        let pairs: Vec<_> = models.iter().zip(owns).collect();
        pairs
            .into_par_iter()
            .map(|(model, own)| evaluated(*model, values, own, (damping, with_shared)))
            .collect()
    };
    let first: Result<Vec<StrikeNormal>, FitError> = all(&values, &owns, damping)
        .into_iter()
        .enumerate()
        .map(|(strike, one)| one.map_err(|why| FitError::Strike { strike, why }))
        .collect();
    let mut normals = first?;
    let mut steps_left = MOST_STEPS;
    loop {
        let total = sum(normals.iter().map(|one| &one.normal));
        let step = step(&total, free, damping).ok_or(FitError::Singular)?;
        let steps: Vec<Vec<f64>> = normals.par_iter().map(|one| one.own_step(&step)).collect();
        let without_own: f64 = normals.iter().map(StrikeNormal::squares_without_own).sum();
        let gain = total.squares - without_own + step.dot(&(2.0 * total.right - total.information * step));
        let mut log = [0.0; COUNT];
        log.copy_from_slice(&step.as_slice()[..COUNT]);
        let next_values = moved(&values, &log);
        let next_owns: Vec<Vec<f64>> = owns
            .iter()
            .zip(&steps)
            .map(|(own, step)| own.iter().zip(step).map(|(own, step)| own + step).collect())
            .collect();
        let next: Result<Vec<StrikeNormal>, String> = all(&next_values, &next_owns, SHRINK * damping)
            .into_iter()
            .collect();
        let next = next.ok().filter(|next| {
            let squares: f64 = next.iter().map(|one| one.normal.squares).sum();
            squares <= total.squares * (1.0 + 1e-12)
        });
        match next {
            Some(next) => {
                (values, owns, normals) = (next_values, next_owns, next);
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
                let again: Result<Vec<StrikeNormal>, String> =
                    all(&values, &owns, damping).into_iter().collect();
                normals = again.map_err(|_| FitError::NoEnd)?;
            }
        }
        steps_left -= 1;
        if steps_left == 0 {
            return Err(FitError::NoEnd);
        }
    }
    if damping > UNDAMPED {
        let again: Result<Vec<StrikeNormal>, String> = all(&values, &owns, 0.0).into_iter().collect();
        normals = again.map_err(|_| FitError::NoEnd)?;
    }
    Ok(finished(values, free, &models, owns, normals))
}

fn finished<'a>(
    values: Values,
    free: &[Quantity],
    models: &[&'a dyn StrikeModel],
    owns: Vec<Vec<f64>>,
    normals: Vec<StrikeNormal>,
) -> Fit<'a> {
    let strikes: Vec<FittedStrike<'a>> = models
        .iter()
        .zip(owns)
        .zip(normals)
        .map(|((model, own), normal)| FittedStrike {
            model: *model,
            own,
            normal: normal.normal.clone(),
            whole: normal,
        })
        .collect();
    Fit {
        values,
        free: free.to_vec(),
        normal: sum(strikes.iter().map(|strike| &strike.normal)),
        strikes,
    }
}
