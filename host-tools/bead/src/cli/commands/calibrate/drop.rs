//! `bead calibrate drop`.

use bead_calibrate::drop::{DropInputs, DropSeries, evaluate};
use bead_calibrate::simulated::drop::DropRig;
use bead_tables::printable::count;

use crate::cli::commands::calibrate::arguments::DropArguments;
use crate::cli::commands::calibrate::finish::Prepared;
use crate::cli::commands::calibrate::live::{self, Prompt};
use crate::cli::commands::calibrate::source;
use crate::cli::commands::prelude::*;

pub(super) fn run(arguments: &DropArguments) -> Result<(), Failure> {
    let stated = stated(arguments)?;
    let (source, recordings) = (&arguments.source, &arguments.recordings);
    let prepared = Prepared::new(&arguments.common, &source.inputs(recordings))?;
    let (strikes, truth) = if source.is_made() {
        make(arguments, &stated, &prepared)?
    } else {
        (source.read(recordings)?, None)
    };
    let series = strikes
        .into_iter()
        .enumerate()
        .map(|(number, strikes)| DropSeries {
            recording: source::name(recordings.get(number), number),
            height: number.min(stated.heights.len() - 1),
            strikes,
        });
    let series: Vec<DropSeries> = series.collect();
    let before = prepared.before(&source::settings_of(series.iter().flat_map(|one| &one.strikes)));
    let calibration = evaluate(&series, &stated).map_err(Failure::input)?;
    prepared.finish(&arguments.common, calibration, &before, recordings, truth)
}

/// Quantities that the operator states. Each recording has its own height, or all share one.
fn stated(arguments: &DropArguments) -> Result<DropInputs, Failure> {
    let (recordings, heights) = (arguments.recordings.len(), arguments.height.len());
    if recordings == 0 && arguments.source.from.is_none() {
        bail!(
            Input,
            "give a recording of drops, F.mcap, or its name with --port P, which makes it; or --from simulated"
        );
    }
    let is_one_for_all = heights == 1 && !arguments.source.is_made();
    if recordings > 0 && recordings != heights && !is_one_for_all {
        bail!(
            Input,
            "{} and {}: give --height once for each, in the order of the recordings",
            count(recordings as u64, "recording"),
            count(heights as u64, "height")
        );
    }
    Ok(DropInputs {
        ball_mass: arguments.ball_mass,
        heights: arguments.height.clone(),
        gravity: arguments.gravity,
        tilt: arguments.tilt,
        high_pass: arguments.high_pass.0,
    })
}

/// The strikes of each series, and the truth if that is known.
type Made = (Vec<Vec<RecordedStrike>>, Option<Vec<(&'static str, f64)>>);

/// Lets the balls drop.
fn make(arguments: &DropArguments, stated: &DropInputs, prepared: &Prepared) -> Result<Made, Failure> {
    let source = &arguments.source;
    let (named, count) = (&arguments.recordings, stated.heights.len());
    let targets = source::targets(named, count, arguments.common.overwrite)?;
    if let Some(port) = &source.port {
        let targets: Vec<&Target> = targets.iter().flatten().collect();
        let mut all = Vec::new();
        for (number, (target, height)) in targets.iter().zip(&stated.heights).enumerate() {
            let prompt = Prompt {
                act: format!("drop the ball from {:.1} mm", 1e3 * height.value),
                wanted: arguments.drops,
                apart: 1.05 * 2.0 * (2.0 * height.value / stated.gravity.value).sqrt(),
            };
            if !live::record(port, source.baud, target, &prompt)? && number + 1 < targets.len() {
                bail!(
                    Input,
                    "interrupted: {} is recorded; record the other heights by `bead record`, then evaluate all of them",
                    target.path().display()
                );
            }
            all.push(source::strikes(target.path(), source.bead)?);
        }
        return Ok((all, None));
    }
    let bead = source.made_up(&prepared.before(&source::reference()))?;
    let rig = DropRig {
        stated: stated.clone(),
        drops: arguments.drops as usize,
        faults: Vec::new(),
        seed: source.seed,
    };
    let progress = output::progress(count as u64).with_message("dropping");
    let mut all = Vec::new();
    for (height, target) in targets.iter().enumerate() {
        let (landings, seconds) = rig.landings(height);
        let seed = source.seed.wrapping_add(height as u64);
        all.push(source.measured(&bead, (&landings, seconds), target.as_ref(), seed)?);
        progress.inc(1);
    }
    progress.finish_and_clear();
    let per_code = bead.settings.description().force.per_code * bead.gains[0];
    Ok((all, Some(vec![("force per code", per_code)])))
}
