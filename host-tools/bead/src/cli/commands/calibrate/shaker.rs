//! `bead calibrate shaker`.

use bead_calibrate::points::Channel;
use bead_calibrate::shaker::{ShakerInputs, evaluate};
use bead_calibrate::simulated::sines::Shaken;
use bead_calibrate::simulated::{SimulatedBead, chance, deviate};
use bead_model::design::Description;
use hertz_chain::Oscillator;

use crate::cli::commands::calibrate::arguments::ShakerArguments;
use crate::cli::commands::calibrate::finish::Prepared;
use crate::cli::commands::calibrate::point_files::simulate;
use crate::cli::commands::calibrate::source;
use crate::cli::commands::prelude::*;

/// Frequencies of a simulated sweep, Hz: from the first, `COUNT` of them, each this step further.
const FIRST: f64 = 120.0;
const STEP: f64 = 110.0;
const COUNT: usize = 22;
/// Acceleration of the shell, m/s² rms.
const ACCELERATION: f64 = 20.0;
/// Relative standard deviations of the true k and c about those of the settings.
const SPREAD: [f64; 2] = [0.03, 0.08];

pub(super) fn run(arguments: &ShakerArguments) -> Result<(), Failure> {
    let options = &arguments.points;
    let prepared = Prepared::new(&arguments.common, &options.inputs())?;
    let before = prepared.before(&source::reference());
    let stated = ShakerInputs {
        intruder: source::intruder_mass(arguments.intruder_mass, &before)?,
        acceleration_per_code: before.acceleration.per_code,
    };
    let truth = options.from.map(|_| make(arguments, &before, &stated));
    let truth = truth.transpose()?;
    let of = (Channel::Acceleration, before.acceleration.pole);
    let gathered = options.gather(&arguments.waveform, arguments.common.overwrite, of)?;
    let mut calibration = evaluate(&gathered.points, &stated).map_err(Failure::input)?;
    calibration.left_out.extend(gathered.left_out);
    prepared.finish(&arguments.common, calibration, &before, &gathered.files, truth)
}

/// Shakes a simulated bead, and returns the truth.
fn make(
    arguments: &ShakerArguments,
    before: &Description,
    stated: &ShakerInputs,
) -> Result<Vec<(&'static str, f64)>, Failure> {
    let options = &arguments.points;
    let settings = bead_recording::physical::derived(before)?;
    let mut random = chance(options.seed, 0);
    let bead = SimulatedBead::drawn(&settings, &mut random);
    let mass = stated.intruder.mass;
    let springs = Oscillator {
        mass: mass.value + mass.u * deviate(&mut random),
        stiffness: before.intruder.stiffness * (1.0 + SPREAD[0] * deviate(&mut random)),
        damping: before.intruder.damping * (1.0 + SPREAD[1] * deviate(&mut random)),
    };
    let gain = 1.0 + options.reference_u * deviate(&mut random);
    let motions: Vec<Shaken> = (0..COUNT)
        .map(|at| {
            Shaken::new(
                FIRST + STEP * at as f64,
                ACCELERATION * (1.0 + 0.05 * deviate(&mut random)),
                Some(springs),
                0.0,
            )
        })
        .collect();
    let made = (gain, options.seed);
    simulate(&options.points, arguments.common.overwrite, &bead, &motions, made)?;
    Ok(vec![
        ("stiffness k", springs.stiffness),
        ("damping c", springs.damping),
        ("intruder mass m", springs.mass),
    ])
}
