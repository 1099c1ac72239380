//! `bead calibrate reference`.

use bead_calibrate::points::Channel;
use bead_calibrate::reference::{FrontEndGain, ReferenceInputs, Springs, evaluate};
use bead_calibrate::simulated::sines::Shaken;
use bead_calibrate::simulated::{SimulatedBead, chance, deviate};
use bead_model::design::{Description, Relative};
use hertz_chain::Oscillator;

use crate::cli::commands::calibrate::arguments::ReferenceArguments;
use crate::cli::commands::calibrate::finish::Prepared;
use crate::cli::commands::calibrate::point_files::simulate;
use crate::cli::commands::calibrate::source;
use crate::cli::commands::prelude::*;

/// Relative standard uncertainty of k/m where the settings state none: 0.05 % of the gain at 160 Hz.
const SPRINGS_U: f64 = 0.05;
/// Frequencies of a simulated shaker, Hz: of a closed bead, and of an open accelerometer. The gain's own
/// frequency precedes these.
const CLOSED: [f64; 3] = [80.0, 250.0, 400.0];
const OPEN: [f64; 7] = [50.0, 80.0, 315.0, 630.0, 1250.0, 2500.0, 5000.0];
/// Repeats at the frequency of the gain.
const REPEATS: usize = 5;

pub(super) fn run(arguments: &ReferenceArguments) -> Result<(), Failure> {
    let options = &arguments.points;
    let prepared = Prepared::new(&arguments.common, &options.inputs())?;
    let before = prepared.before(&source::reference());
    let stated = ReferenceInputs {
        reference_u: options.reference_u,
        at: arguments.at,
        front_end: front_end(arguments)?,
        springs: None,
    };
    let truth = options.from.map(|_| make(arguments, &before));
    let truth = truth.transpose()?;
    let of = (Channel::Acceleration, before.acceleration.pole);
    let gathered = options.gather(&arguments.waveform, arguments.common.overwrite, of)?;
    let is_in_codes = gathered.points.measured == bead_calibrate::points::Measured::Codes;
    let springs = (is_in_codes && !arguments.open).then(|| springs(&before));
    let stated = ReferenceInputs { springs, ..stated };
    let mut calibration = evaluate(&gathered.points, &stated).map_err(Failure::input)?;
    calibration.left_out.extend(gathered.left_out);
    prepared.finish(&arguments.common, calibration, &before, &gathered.files, truth)
}

/// The way from volts to codes, if it is stated.
fn front_end(arguments: &ReferenceArguments) -> Result<Option<FrontEndGain>, Failure> {
    match (arguments.supply, arguments.divider, arguments.amplifier) {
        (Some(supply), Some(divider), Some(gain)) => Ok(Some(FrontEndGain {
            supply,
            divider,
            gain,
        })),
        (None, None, None) => Ok(None),
        _ => bail!(
            Input,
            "--supply, --divider and --amplifier go together: a code is worth VDDA / (4096 S D G)"
        ),
    }
}

/// The intruder on its springs, as the settings have it.
fn springs(settings: &Description) -> Springs {
    let stated = settings.uncertainty.unwrap_or_default();
    let part = |relative: Option<Relative>| relative.map(Relative::part);
    let relative_u = part(stated.stiffness)
        .zip(part(stated.intruder_mass))
        .map_or(SPRINGS_U, |(k, m)| {
            let together = 2.0 * stated.stiffness_with_mass.part() * k * m;
            (k * k + m * m - together).max(0.0).sqrt()
        });
    Springs {
        oscillator: oscillator(settings),
        relative_u,
    }
}

fn oscillator(settings: &Description) -> Oscillator {
    let intruder = settings.intruder;
    Oscillator {
        mass: intruder.mass,
        stiffness: intruder.stiffness,
        damping: intruder.damping,
    }
}

/// Shakes a simulated bead, and returns the truth.
fn make(arguments: &ReferenceArguments, before: &Description) -> Result<Vec<(&'static str, f64)>, Failure> {
    let options = &arguments.points;
    let settings = bead_recording::physical::derived(before)?;
    let mut random = chance(options.seed, 0);
    let bead = SimulatedBead::drawn(&settings, &mut random);
    let mut springs_of_bead = oscillator(before);
    springs_of_bead.stiffness *= 1.0 + springs(before).relative_u * deviate(&mut random);
    let gain = 1.0 + options.reference_u * deviate(&mut random);
    let others: &[f64] = if arguments.open { &OPEN } else { &CLOSED };
    let frequencies = std::iter::repeat_n(arguments.at, REPEATS).chain(others.iter().copied());
    let motions: Vec<Shaken> = frequencies
        .map(|frequency| {
            Shaken::new(
                frequency,
                50.0 * (1.0 + 0.05 * deviate(&mut random)),
                (!arguments.open).then_some(springs_of_bead),
                0.0,
            )
        })
        .collect();
    let made = (gain, options.seed);
    simulate(&options.points, arguments.common.overwrite, &bead, &motions, made)?;
    let per_code = before.acceleration.per_code * bead.gains[1];
    Ok(vec![("acceleration per code", per_code)])
}
