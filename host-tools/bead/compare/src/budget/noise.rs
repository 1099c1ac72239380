//! The noise of a strike: from the quiet before it, through the estimators (type A).
//!
//! # Design
//! The scatter of each channel's codes in the quiet is taken as white. The energies' derivatives by each code
//! of the window are differences of the estimators over a few codes; the variance of the energies is that of
//! a code times the sum of their squares. This includes the zeros of the channels, which are means of quiet
//! codes.

use bead_model::Scan;
use bead_model::layout::BASELINE;
use rayon::prelude::*;

use crate::budget::run::Rerun;
use crate::front_end::CODES;
use crate::spread::RunningMean;
use crate::student::student;
use bead_recording::strikes::RecordedStrike;

/// Least step of a code. Steps of fewer than four codes show the rounding of B; over 32 codes the estimators
/// are still linear.
const STEP: f64 = 8.0;
/// Channels in the order of a scan's codes.
const CHANNELS: [&str; 4] = [
    "force noise",
    "force noise, low gain",
    "acceleration noise",
    "acceleration noise, low gain",
];

/// Noise of a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ChannelNoise {
    pub(super) name: &'static str,
    /// Place of its code in a scan.
    pub(super) place: usize,
    /// Standard deviation of its codes.
    pub(super) codes: f64,
    /// Degrees of freedom of the deviation.
    pub(super) free: f64,
    /// Standard uncertainties of both energies from it, J.
    pub(super) amounts: [f64; 2],
}

/// Expanded uncertainty (95 %) of a strike's energies A and B by its own noise, J. `None` where samples or
/// settings are missing.
pub(crate) fn expanded_noise(strike: &RecordedStrike) -> Option<[f64; 2]> {
    let rerun = Rerun::new(strike, *strike.settings?.description()).ok()?;
    let channels = noise(&rerun);
    let expanded = |place: usize| {
        let squares = channels
            .iter()
            .map(|channel| (student(channel.free) * channel.amounts[place]).powi(2));
        squares.sum::<f64>().sqrt()
    };
    Some([0, 1].map(expanded))
}

/// The codes of each scan in the order of [`CHANNELS`]; `None` where they had no part in the result.
pub(super) fn codes(rerun: &Rerun<'_>) -> Vec<[Option<u16>; 4]> {
    let of = |codes: &bead_recording::strikes::ScanCodes| {
        let [force, acceleration] = codes.sensitive.map(Some);
        let [wide_force, wide_acceleration] = codes.wide.map_or([None; 2], |wide| wide.map(Some));
        [force, wide_force, acceleration, wide_acceleration]
    };
    rerun.strike.scans.iter().map(of).collect()
}

/// A scan of codes; those that are `None` have no part.
pub(super) fn scan(codes: [Option<u16>; 4]) -> Scan {
    Scan::new(codes.map(Option::unwrap_or_default))
}

/// The noise of the channels that have some.
pub(super) fn noise(rerun: &Rerun<'_>) -> Vec<ChannelNoise> {
    let codes = codes(rerun);
    let quiet = usize::from(rerun.settings.window.noise_end()).min(codes.len());
    let of_channel = |(channel, name): (usize, &'static str)| {
        // At the low gain, the quiet has only the codes of the baseline.
        let length = if channel % 2 == 0 { quiet } else { BASELINE.into() };
        let mut running = RunningMean::default();
        let quiet = codes[..length.min(codes.len())]
            .iter()
            .filter_map(|scan| scan[channel]);
        quiet.for_each(|code| running.push(f64::from(code)));
        let deviation = running.scatter().filter(|deviation| *deviation > 0.0)?;
        Some(ChannelNoise {
            name,
            place: channel,
            codes: deviation,
            free: running.count as f64 - 1.0,
            amounts: amounts(rerun, &codes, channel, deviation),
        })
    };
    CHANNELS.into_iter().enumerate().filter_map(of_channel).collect()
}

/// Standard uncertainties of both energies, J, if each code of a channel scatters by `deviation`.
fn amounts(rerun: &Rerun<'_>, codes: &[[Option<u16>; 4]], channel: usize, deviation: f64) -> [f64; 2] {
    let step = (3.0 * deviation).round().max(STEP) as u16;
    let scans: Vec<Scan> = codes.iter().copied().map(scan).collect();
    let slope_squares = |place: usize| {
        let code = codes[place][channel]?;
        let (less, more) = (code.saturating_sub(step), (code + step).min(CODES - 1));
        let [below, above] = [less, more].map(|code| {
            let (mut scans, mut changed) = (scans.clone(), codes[place]);
            changed[channel] = Some(code);
            scans[place] = scan(changed);
            rerun.energies(&rerun.settings, &scans)
        });
        Some([0, 1].map(|i| ((above[i] - below[i]) / f64::from(more - less)).powi(2)))
    };
    let squares: Vec<[f64; 2]> = (0..codes.len())
        .into_par_iter()
        .filter_map(slope_squares)
        .collect();
    [0, 1].map(|i| deviation * squares.iter().map(|one| one[i]).sum::<f64>().sqrt())
}
