//! Samples of a run that keeps its motion: their time over that of a run that is sampled as it goes.

use crate::cases::Case;
use crate::ours;
use crate::report::{Aim, Measurements};

/// Greatest ratio aimed at.
const MOST: f64 = 1.15;

/// Times both ways of each case at the accuracy that was the fastest for its samples.
pub(crate) fn measure(report: &mut Measurements, cases: &[Case], quick: bool) {
    for case in cases {
        let mut sampled = report.comparisons.iter().filter(|comparison| comparison.sampled);
        let own = sampled.find(|comparison| comparison.name == case.name);
        let Some(accuracy) = own.and_then(|own| own.rows[0].accuracy) else {
            continue;
        };
        let (mut streamed, mut kept) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..if quick { 20 } else { 400 } {
            streamed = streamed.min(ours::least_seconds(1, || ours::samples(&case.scenario, accuracy)));
            kept = kept.min(ours::least_seconds(1, || {
                ours::kept_samples(&case.scenario, accuracy)
            }));
        }
        let name = format!(
            "{}, 1000 samples: a run that keeps its motion, over one that is sampled as it goes",
            case.name
        );
        report.goal(name, Some(kept / streamed), Aim::AtMost(MOST), "");
        let name = format!(
            "{}, 1000 samples: error of a run that keeps its motion",
            case.name
        );
        let error = case.sampled_error(&ours::kept_samples(&case.scenario, accuracy));
        report.goal(name, Some(error), Aim::AtMost(1e-9), "of the greatest velocity");
    }
}
