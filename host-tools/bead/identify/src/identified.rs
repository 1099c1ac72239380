//! Identification of one bead from its strikes: the fit, its errors, and the doubts about both.

use crate::consistency::{self, Doubt, Hardening, RecordingValues};
use crate::degeneracy::{Degenerate, separable, singular_values};
use crate::fit::{Fit, FitError, StrikeStart, fit, normal_at};
use crate::model::StrikeModel;
use crate::quantity::{COUNT, Quantity, Values};
use crate::spread::{Goodness, MOST_PROFILED, combined, covariance, coverage_factor, profile};
use nalgebra::DMatrix;
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

/// Multiple of the median of χ²/ν beyond which a strike is left out as unlike the others.
const UNLIKE: f64 = 30.0;
/// Least number of strikes for a median.
const ENOUGH_FOR_MEDIAN: usize = 4;

/// A strike with its place.
pub struct Candidate {
    /// Place of its recording.
    pub recording: usize,
    /// Its number, as its bead counts.
    pub number: u32,
    /// Its model.
    pub model: Box<dyn StrikeModel + Send>,
}

/// Start values, and the quantities to find.
#[derive(Debug, Clone, PartialEq)]
pub struct Wanted {
    /// Values at the start of the fit; held ones keep them.
    pub start: Values,
    /// Quantities to fit, if the data tell them apart.
    pub free: Vec<Quantity>,
    /// Relative standard uncertainties of the start values, where they are known.
    pub stated: [Option<f64>; COUNT],
    /// Degrees of freedom with which the noise is known.
    pub noise_free: f64,
    /// Names of the recordings.
    pub recordings: Vec<String>,
}

/// The identification.
pub struct Identified<'a> {
    /// The best fit.
    pub best: Fit<'a>,
    /// Places of its strikes among the candidates.
    pub used: Vec<usize>,
    /// Candidates that were left out, with the reason as the end of a sentence.
    pub left_out: Vec<(usize, String)>,
    /// Quantities that were wanted and cannot be told apart from others.
    pub degenerate: Vec<Degenerate>,
    /// Singular values of the whitened Jacobian of all wanted quantities, descending.
    pub singular: Vec<f64>,
    /// Agreement of the residuals with the noise.
    pub goodness: Goodness,
    /// Factor in all standard errors: 1 unless residuals or strikes scatter more than the noise.
    pub scale: f64,
    /// Covariance of the logarithms of the fitted quantities, by the noise only.
    pub unscaled: DMatrix<f64>,
    /// Covariance by the scatter: that by the noise, times the square of the scale.
    pub covariance: DMatrix<f64>,
    /// Covariance of all quantities, with the uncertainties of those that were held.
    pub combined: DMatrix<f64>,
    /// Student's t of the intervals.
    pub coverage_factor: f64,
    /// Ends of the interval of each fitted quantity, and true if by its profile.
    pub intervals: Vec<([f64; 2], bool)>,
    /// Values of each recording, if there are several.
    pub recordings: Vec<RecordingValues>,
    /// A spring that hardens or softens.
    pub hardening: Option<Hardening>,
    /// Doubts about the result.
    pub doubts: Vec<Doubt>,
}

/// Strikes that can be computed: places among the candidates, and each model with its own numbers.
type Starts<'a> = (Vec<usize>, Vec<StrikeStart<'a>>);

/// Fits only the own numbers, and leaves out strikes that cannot be computed.
fn begun<'a>(candidates: &'a [Candidate], start: &Values) -> (Starts<'a>, Vec<(usize, String)>) {
    let ((mut used, mut starts), mut left_out) = (Starts::default(), Vec::new());
    let own = |candidate: &Candidate| {
        let model: &dyn StrikeModel = &*candidate.model;
        let one = fit(&[(model, model.own())], start, &[])?;
        Ok(one.strikes[0].own.clone())
    };
    let found: Vec<Result<Vec<f64>, FitError>> = candidates.par_iter().map(own).collect();
    for (place, found) in found.into_iter().enumerate() {
        match found {
            Ok(own) => {
                used.push(place);
                starts.push((&*candidates[place].model, own));
            }
            Err(FitError::Strike { why, .. }) => left_out.push((place, why)),
            Err(error) => left_out.push((place, error.to_string())),
        }
    }
    ((used, starts), left_out)
}

/// Identifies a bead from its strikes.
///
/// # Errors
/// No strike can be computed, or the fit does not converge.
pub fn identify<'a>(candidates: &'a [Candidate], wanted: &Wanted) -> Result<Identified<'a>, FitError> {
    let ((mut used, mut starts), mut left_out) = begun(candidates, &wanted.start);
    if starts.is_empty() {
        let first = left_out.into_iter().next();
        let (strike, why) = first.unwrap_or_else(|| (0, "there is no strike".to_owned()));
        return Err(FitError::Strike { strike, why });
    }
    let at_start = normal_at(&starts, &wanted.start)?;
    let (free, degenerate) = separable(&at_start, &wanted.free);
    let singular = singular_values(&at_start, &wanted.free);
    let mut best = fit(&starts, &wanted.start, &free)?;
    // A strike that is unlike all others would bias the fit.
    let unlike = unlike_others(&best);
    if !unlike.is_empty() {
        for (at, ratio) in unlike.iter().rev() {
            starts.remove(*at);
            let why =
                format!("it is unlike the others: its χ²/ν is {ratio:.0}; look at it with `bead compare`");
            left_out.push((used.remove(*at), why));
        }
        best = fit(&starts, &best.values, &free)?;
    }
    let recording_of: Vec<usize> = used.iter().map(|place| candidates[*place].recording).collect();

    let goodness = Goodness::of(&best.normal, free.len(), wanted.noise_free);
    let unscaled = covariance(&best.normal, &free).ok_or(FitError::Singular)?;
    let scatter = consistency::scatter(&best);
    let scale = goodness.scale().max(scatter);
    let hardening = consistency::hardening(&best, wanted.noise_free);
    let recordings = consistency::by_recording(&best, &recording_of, &wanted.recordings, scale)?;
    let doubts = consistency::doubts(&best, &goodness, scatter, hardening.as_ref(), &recordings);

    let covariance = unscaled.clone() * (scale * scale);
    let free_of_errors = if scale > 1.0 {
        goodness.free
    } else {
        wanted.noise_free
    };
    let factor = coverage_factor(free_of_errors);
    let rise = (factor * scale).powi(2);
    let intervals = free.iter().enumerate().map(|(at, quantity)| {
        let few = best.strikes.len() <= MOST_PROFILED;
        let by_profile = few.then(|| profile(&best, *quantity, &unscaled, rise)).flatten();
        let half = factor * covariance[(at, at)].sqrt();
        let value = best.values[quantity.place()];
        let linear = [value * (-half).exp(), value * half.exp()];
        (by_profile.unwrap_or(linear), by_profile.is_some())
    });
    let intervals = intervals.collect();
    Ok(Identified {
        combined: combined(&best.normal, &free, (&unscaled, scale), &wanted.stated),
        used,
        left_out,
        degenerate,
        singular,
        goodness,
        scale,
        coverage_factor: factor,
        intervals,
        recordings,
        hardening,
        doubts,
        covariance,
        unscaled,
        best,
    })
}

/// Places of strikes that are unlike the others, with their χ²/ν.
fn unlike_others(best: &Fit<'_>) -> Vec<(usize, f64)> {
    let ratio = |strike: &crate::fit::FittedStrike<'_>| {
        strike.normal.shared.squares / strike.normal.shared.free.max(1.0)
    };
    let ratios: Vec<f64> = best.strikes.iter().map(ratio).collect();
    if ratios.len() < ENOUGH_FOR_MEDIAN {
        return Vec::new();
    }
    let mut sorted = ratios.clone();
    sorted.sort_by(f64::total_cmp);
    let median = sorted[sorted.len() / 2].max(1.0);
    ratios
        .into_iter()
        .enumerate()
        .filter(|(_, ratio)| *ratio > UNLIKE * median)
        .collect()
}
