//! `bead proof accuracy`: the error of the image's two estimates over strikers and velocities, behind each
//! pair of sensors.

use super::measure::{Prepared, ProofOptions, StrikePeaks, grid, metres, shown};
use crate::cli::commands::prelude::*;
use bead_bench::accuracy::EstimateErrors;
use bead_bench::tables::Sensors;
use bead_compare::sensed::{bead_of, simulate_with_ring_down};

const AFTER_HELP: &str = "\
The scenario is struck by solid spheres of the given radii at the given velocities; all else in it stays. For \
each cell the flash image runs in QEMU on --strikes strikes, with the noise of the front end: once behind \
the sensors for weak strikes, and once behind those for strong ones. The error of an estimate is the root \
mean square over the strikes, relative to the full f64 chain; the worst error is next to it. If the bead sees \
no strike, there is no error.

Exit status 1 if in any cell neither pair of sensors keeps A within 0.5 % and B within 1 % without meeting a \
rail.

Examples:
  bead proof accuracy docs/scenarios/paper-strike.toml --bead 8
  bead proof accuracy docs/scenarios/paper-strike.toml --bead 8 --overwrite \\
      --table docs/ranges.md
  bead proof accuracy docs/scenarios/paper-strike.toml --bead 8 --radii 0.0045 \\
      --velocity 0.3,0.6 --strikes 20 --format json";

/// The page's title, and its text above the table.
pub(super) const PAGE: [&str; 2] = [
    "Striker and speed against error",
    "\
from runs of the flash image in QEMU: 8 strikes a cell unless --strikes says otherwise, each at a different phase of the sample
clock, with noise, by spheres of the striker's material on the chain of the scenario. Errors are those of the absorbed energy
against the full f64 chain: the root mean square over the strikes, and in brackets the worst. A is measured by the
acceleration, B is predicted from the force.

*Weak* and *strong* are two pairs of sensors that the front end can have ([front-end.md](front-end.md)). *Weak* has 16 N and
±250 m/s² at the high gain, 256 N and ±4000 m/s² at the low gain, and noise of 5 mN and 0.05 m/s²; *strong* has six times all
of these. *Railed*: the strike is beyond the low gain's range, and its report says so. The last column but one says whether one
of the two pairs keeps A within 0.5 % and B within 1 %. The other flags are explained in [estimators.md](estimators.md).
",
];

const RADII: [f64; 7] = [0.0045, 0.007, 0.009, 0.0115, 0.019, 0.030, 0.040];
const VELOCITIES: [f64; 6] = [0.1, 0.2, 0.45, 1.0, 2.0, 5.0];

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    #[command(flatten)]
    common: ProofOptions,
    /// Radii of the striker, m.
    #[arg(long, value_name = "M", value_delimiter = ',', default_values_t = RADII, value_parser = metres)]
    radii: Vec<f64>,
    /// Velocities of the striker, m/s.
    #[arg(long, value_name = "M/S", value_delimiter = ',', default_values_t = VELOCITIES, value_parser = positive)]
    velocity: Vec<f64>,
    /// Strikes in each cell, each at a different phase of the sample clock.
    #[arg(long, value_name = "K", default_value_t = 8, value_parser = clap::value_parser!(u32).range(2..=1000))]
    strikes: u32,
}

/// One striker at one velocity.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct StrikerCell {
    radius_m: f64,
    velocity_mps: f64,
    #[serde(flatten)]
    peaks: StrikePeaks,
    /// Behind the sensors for weak strikes, and behind those for strong ones.
    weak: EstimateErrors,
    strong: EstimateErrors,
    pass: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let prepared = arguments.common.prepare()?;
    let points = grid(&arguments.radii, &arguments.velocity);
    let cell = |&(radius, velocity): &_| {
        cell(
            &prepared,
            &struck(&prepared.scenario, radius, velocity),
            arguments.strikes,
        )
    };
    let cells = prepared.tabulate(&points, cell, PAGE, HEADINGS, row)?;
    let outside = cells.iter().filter(|cell| !cell.pass).count();
    if outside > 0 {
        bail!(
            Verdict,
            "in {outside} of {} cells neither pair of sensors keeps A within 0.5 % and B within 1 %",
            cells.len()
        );
    }
    Ok(())
}

/// The scenario, struck by a full sphere of this radius, m, at this velocity, m/s.
fn struck(scenario: &Scenario, radius: f64, velocity: f64) -> Scenario {
    let mut scenario = scenario.clone();
    let striker = &mut scenario.striker;
    (striker.radius, striker.mass, striker.velocity) = (radius, None, velocity);
    scenario
}

fn cell(prepared: &Prepared<'_>, scenario: &Scenario, strikes: u32) -> Result<StrikerCell, Failure> {
    let solution = simulate_with_ring_down(scenario)?;
    bead_of(&solution, prepared.common.bead)?;
    let errors = |sensors: Sensors| prepared.measure(scenario, &solution, &sensors.front_end(), strikes);
    let (weak, strong) = (errors(Sensors::Weak)?, errors(Sensors::Strong)?);
    Ok(StrikerCell {
        radius_m: scenario.striker.radius,
        velocity_mps: scenario.striker.velocity,
        peaks: StrikePeaks::of(scenario, &solution, prepared.common.bead)?,
        pass: weak.pass(strikes) || strong.pass(strikes),
        weak,
        strong,
    })
}

const HEADINGS: [&str; 8] = [
    "striker",
    "peaks",
    "A, weak (%)",
    "B, weak (%)",
    "A, strong (%)",
    "B, strong (%)",
    "0.5 and 1 %",
    "flags",
];

fn row(cell: &StrikerCell) -> [String; 8] {
    let (peaks, mut flags) = (&cell.peaks, Vec::new());
    for &flag in cell.weak.flags.iter().chain(&cell.strong.flags) {
        if !flag.ends_with("railed") && !flags.contains(&flag) {
            flags.push(flag);
        }
    }
    [
        format!("{:.1} mm, {} m/s", cell.radius_m * 1e3, cell.velocity_mps),
        format!(
            "{:.1} N, {:.0} m/s²",
            peaks.peak_force_n, peaks.peak_acceleration_mps2
        ),
        shown(&cell.weak, 0),
        shown(&cell.weak, 1),
        shown(&cell.strong, 0),
        shown(&cell.strong, 1),
        output::either(cell.pass, "yes", "no"),
        flags.join(", "),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sphere_has_the_mass_of_its_radius_whatever_the_striker_of_the_scenario_weighs() {
        let mut scenario = Scenario::paper();
        let expected = struck(&scenario, 0.009, 1.0);
        scenario.striker.mass = Some(0.003);
        assert_eq!(struck(&scenario, 0.009, 1.0), expected);
    }

    #[test]
    fn a_flag_of_both_pairs_of_sensors_is_told_once() {
        let errors = |flags: &[&'static str]| EstimateErrors {
            strikes: 2,
            rms: [0.0; 2],
            worst: [0.0; 2],
            flags: flags.to_vec(),
        };
        let cell = StrikerCell {
            radius_m: 0.0045,
            velocity_mps: 1.0,
            peaks: StrikePeaks {
                peak_force_n: 1.0,
                peak_acceleration_mps2: 1.0,
            },
            weak: errors(&["truncated", "force_railed", "estimates_differ"]),
            strong: errors(&["truncated", "overrun"]),
            pass: true,
        };
        assert_eq!(row(&cell)[7], "truncated, estimates_differ, overrun");
    }
}
