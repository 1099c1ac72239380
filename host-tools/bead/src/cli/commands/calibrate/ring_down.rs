//! `bead calibrate ring-down`.

use bead_calibrate::ring_down::{RingDownInputs, evaluate};
use bead_calibrate::simulated::ring_down::TapRig;

use crate::cli::commands::calibrate::arguments::{MadeUpBead, RingDownArguments};
use crate::cli::commands::calibrate::finish::Prepared;
use crate::cli::commands::calibrate::live::{self, Prompt};
use crate::cli::commands::calibrate::source;
use crate::cli::commands::prelude::*;
use crate::cli::recordings::each_once;
use bead_model::design::Description;

/// Taps that are less apart, s, are one.
const APART: f64 = 0.02;

pub(super) fn run(arguments: &RingDownArguments) -> Result<(), Failure> {
    let source = &arguments.source;
    let is_made = source.port.is_some() || source.from.is_some();
    if arguments.recordings.is_empty() && source.from.is_none() {
        bail!(
            Input,
            "give a recording of taps, F.mcap, or its name with --port P, which makes it; or --from simulated"
        );
    }
    if is_made && arguments.recordings.len() > 1 {
        bail!(Input, "--port and --from make one recording; name one file");
    }
    let inputs: Vec<&Path> = if is_made {
        Vec::new()
    } else {
        arguments.recordings.iter().map(PathBuf::as_path).collect()
    };
    let prepared = Prepared::new(&arguments.common, &inputs)?;
    let mut truth = None;
    let strikes = if is_made {
        let of_file = prepared.before(&source::reference());
        let (strikes, of_bead) = make(arguments, &of_file)?;
        truth = of_bead;
        vec![strikes]
    } else {
        each_once(&arguments.recordings)?;
        let read = |path: &PathBuf| source::strikes(path, source.bead);
        arguments.recordings.iter().map(read).collect::<Result<_, _>>()?
    };
    let named = |(number, strikes)| (source::name(arguments.recordings.get(number), number), strikes);
    let recordings: Vec<(String, Vec<RecordedStrike>)> = strikes.into_iter().enumerate().map(named).collect();
    let before = prepared.before(&source::settings_of(
        recordings.iter().flat_map(|(_, strikes)| strikes),
    ));
    let stated = stated(arguments, &before)?;
    let calibration = evaluate(&recordings, &stated).map_err(Failure::input)?;
    prepared.finish(
        &arguments.common,
        calibration,
        &before,
        &arguments.recordings,
        truth,
    )
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
    let bead = source::made_up(settings, source)?;
    let rig = TapRig {
        stated: stated(arguments, settings)?,
        taps: arguments.taps,
        seed: source.seed,
    };
    let progress = output::spinner("tapping");
    let (sensed, seconds) = rig.sensed(&bead).map_err(Failure::input)?;
    let strikes = if source.from == Some(MadeUpBead::Emulated) {
        source::emulate(&bead, &sensed, seconds, target, source.seed)?
    } else {
        source::simulate(&bead, &sensed, seconds, target, source.seed)?
    };
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
