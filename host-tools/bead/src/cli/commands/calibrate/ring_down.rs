//! `bead calibrate ring-down`.

use bead_calibrate::ring_down::{RingDownInputs, evaluate};
use bead_calibrate::simulated::ring_down::TapRig;

use crate::cli::commands::calibrate::arguments::RingDownArguments;
use crate::cli::commands::calibrate::finish::Prepared;
use crate::cli::commands::calibrate::live::{self, Prompt};
use crate::cli::commands::calibrate::source;
use crate::cli::commands::prelude::*;
use bead_model::design::Description;

/// Taps less than this apart, s, count as one.
const APART: f64 = 0.02;

pub(super) fn run(arguments: &RingDownArguments) -> Result<(), Failure> {
    let (source, paths) = (&arguments.source, &arguments.recordings);
    if paths.is_empty() && source.from.is_none() {
        bail!(
            Input,
            "give a recording of taps, F.mcap, or its name with --port P, which makes it; or --from simulated"
        );
    }
    if source.is_made() && paths.len() > 1 {
        bail!(Input, "--port and --from make one recording; name one file");
    }
    let prepared = Prepared::new(&arguments.common, &source.inputs(paths))?;
    let (strikes, truth) = if source.is_made() {
        let (strikes, truth) = make(arguments, &prepared.before(&source::reference()))?;
        (vec![strikes], truth)
    } else {
        (source.read(paths)?, None)
    };
    let named = |(number, strikes)| (source::name(paths.get(number), number), strikes);
    let recordings: Vec<(String, Vec<RecordedStrike>)> = strikes.into_iter().enumerate().map(named).collect();
    let before = prepared.before(&source::settings_of(
        recordings.iter().flat_map(|(_, strikes)| strikes),
    ));
    let stated = stated(arguments, &before)?;
    let calibration = evaluate(&recordings, &stated).map_err(Failure::input)?;
    prepared.finish(&arguments.common, calibration, &before, paths, truth)
}

fn stated(arguments: &RingDownArguments, before: &Description) -> Result<RingDownInputs, Failure> {
    let intruder = source::intruder_mass(arguments.intruder_mass, before)?;
    let bead = (!arguments.held).then(|| source::bead_mass(arguments.bead_mass, before));
    Ok(RingDownInputs {
        intruder,
        bead: bead.transpose()?,
    })
}

/// The strikes, and the truth if that is known.
type Made = (Vec<RecordedStrike>, Option<Vec<(&'static str, f64)>>);

/// Taps the bead.
fn make(arguments: &RingDownArguments, settings: &Description) -> Result<Made, Failure> {
    let source = &arguments.source;
    let targets = source::targets(&arguments.recordings, 1, arguments.common.overwrite)?;
    let target = targets.first().and_then(Option::as_ref);
    if let (Some(port), Some(target)) = (&source.port, target) {
        let prompt = Prompt {
            act: "tap the cap of the bead once, lightly".to_owned(),
            wanted: arguments.taps,
            apart: APART,
        };
        live::record(port, source.baud, target, &prompt)?;
        return Ok((source::strikes(target.path(), source.bead)?, None));
    }
    if arguments.held {
        bail!(
            Input,
            "the simulated bead hangs on threads; leave --held out with --from"
        );
    }
    let bead = source.made_up(settings)?;
    let rig = TapRig {
        stated: stated(arguments, settings)?,
        taps: arguments.taps,
        seed: source.seed,
    };
    let progress = output::spinner("tapping");
    let (sensed, seconds) = rig.sensed(&bead).map_err(Failure::input)?;
    let strikes = source.measured(&bead, (&sensed, seconds), target, source.seed)?;
    progress.finish_and_clear();
    let truth = rig.truth(&bead);
    let truth = vec![
        ("stiffness k", truth.stiffness),
        ("damping c", truth.damping),
        ("intruder mass m", truth.intruder),
        ("bead mass M", truth.bead),
    ];
    Ok((strikes, Some(truth)))
}
