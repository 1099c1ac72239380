//! `bead calibrate front-mass`.

use bead_calibrate::front_mass::{FrontMassInputs, evaluate};
use bead_calibrate::points::{Channel, Measured};
use bead_calibrate::simulated::sines::Shaken;
use bead_calibrate::simulated::{SimulatedBead, chance, deviate};
use bead_model::design::{Description, Relative};

use crate::cli::commands::calibrate::arguments::FrontMassArguments;
use crate::cli::commands::calibrate::finish::Prepared;
use crate::cli::commands::calibrate::point_files::simulate;
use crate::cli::commands::calibrate::source;
use crate::cli::commands::prelude::*;

/// Frequencies of a simulated shaker, Hz, and its acceleration, m/s² rms.
const FREQUENCIES: [f64; 8] = [63.0, 80.0, 125.0, 160.0, 200.0, 250.0, 315.0, 400.0];
const ACCELERATION: f64 = 20.0;
/// Front mass of a simulated bead whose settings have none, kg, and its relative spread.
const FRONT_MASS: f64 = 8.4e-3;
const SPREAD: f64 = 0.03;

pub(super) fn run(arguments: &FrontMassArguments) -> Result<(), Failure> {
    let options = &arguments.points;
    let prepared = Prepared::new(&arguments.common, &options.inputs())?;
    let before = prepared.before(&source::reference());
    let of_settings = before.uncertainty.and_then(|stated| stated.force_gain);
    let force_gain_u = arguments.force_gain_u.or(of_settings.map(Relative::part));
    let gain_u = force_gain_u.unwrap_or(0.0);
    let stated = FrontMassInputs {
        reference_u: options.reference_u,
        force_per_code: before.force.per_code,
        force_gain_u: gain_u,
    };
    let truth = options.from.map(|_| make(arguments, &before, gain_u));
    let truth = truth.transpose()?;
    let of = (Channel::Force, before.force.pole);
    let gathered = options.gather(&arguments.waveform, arguments.common.overwrite, of)?;
    if gathered.points.measured == Measured::Codes && force_gain_u.is_none() {
        bail!(
            Input,
            "the force's gain has no uncertainty yet: find it first with `bead calibrate drop --update BEAD.toml` and \
             give --update that file here, or state it: --force-gain-u 0.2%"
        );
    }
    let mut calibration = evaluate(&gathered.points, &stated).map_err(Failure::input)?;
    calibration.left_out.extend(gathered.left_out);
    prepared.finish(&arguments.common, calibration, &before, &gathered.files, truth)
}

/// Shakes a simulated bead, and returns the truth.
fn make(
    arguments: &FrontMassArguments,
    before: &Description,
    force_gain_u: f64,
) -> Result<Vec<(&'static str, f64)>, Failure> {
    let options = &arguments.points;
    let settings = bead_recording::physical::derived(before)?;
    let mut random = chance(options.seed, 0);
    let gains = [1.0 + force_gain_u * deviate(&mut random), 1.0];
    let bead = SimulatedBead::with_gains(&settings, gains);
    let nominal = if before.bead.front_mass > 0.0 {
        before.bead.front_mass
    } else {
        FRONT_MASS
    };
    let front_mass = nominal * (1.0 + SPREAD * deviate(&mut random));
    let gain = 1.0 + options.reference_u * deviate(&mut random);
    let motions = FREQUENCIES.map(|frequency| {
        Shaken::new(
            frequency,
            ACCELERATION * (1.0 + 0.05 * deviate(&mut random)),
            None,
            front_mass,
        )
    });
    let made = (gain, options.seed);
    simulate(&options.points, arguments.common.overwrite, &bead, &motions, made)?;
    Ok(vec![("front mass", front_mass)])
}
