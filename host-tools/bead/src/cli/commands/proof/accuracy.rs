//! `bead proof accuracy`: the error of the image's two estimates over strikers and speeds, behind each pair
//! of sensors.

use std::path::Path;

use clap::Args;
use hertz_chain::{Scenario, Striker};
use serde::Serialize;

use super::measure::{Common, Errors, cells, check_lengths, check_positive, grid, list, typed};
use crate::cli::failure::Failure;
use crate::cli::output;
use bead_bench::tables::Sensors;
use bead_compare::sensed::{bead_of, load_scenario, simulate_with_ring_down};

const AFTER_HELP: &str = "\
The scenario is struck by full spheres of the given radii at the given speeds; all else in it stays. For \
each cell the flash image runs in QEMU on --strikes strikes, with the noise of the front end: once behind \
the sensors for weak strikes, and once behind those for strong ones. The error of an estimate is the root \
mean square over the strikes, relative to the full f64 chain; the worst error stands beside it. Where the \
bead sees no strike, there is none.

Exit status 1 if in any cell neither pair of sensors keeps A within 0.5 % and B within 1 % without meeting a \
rail.

Examples:
  bead proof accuracy docs/scenarios/paper-strike.toml --bead 8
  bead proof accuracy docs/scenarios/paper-strike.toml --bead 8 --overwrite \\
      --table docs/ranges.md
  bead proof accuracy docs/scenarios/paper-strike.toml --bead 8 --radii 0.0045 \\
      --velocity 0.3,0.6 --strikes 20 --format json";

const RADII: [f64; 4] = [0.0045, 0.007, 0.009, 0.0115];
const SPEEDS: [f64; 6] = [0.1, 0.2, 0.45, 1.0, 2.0, 5.0];

/// Arguments of `bead proof accuracy`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    #[command(flatten)]
    common: Common,
    /// Radii of the striker, m.
    #[arg(long, value_name = "M", value_delimiter = ',', default_values_t = RADII)]
    radii: Vec<f64>,
    /// Velocities of the striker, m/s.
    #[arg(long, value_name = "M/S", value_delimiter = ',', default_values_t = SPEEDS)]
    velocity: Vec<f64>,
    /// Strikes in each cell, each at another phase of the sample clock.
    #[arg(long, value_name = "K", default_value_t = 8, value_parser = clap::value_parser!(u32).range(2..=1000))]
    strikes: u32,
}

/// One striker at one speed.
#[derive(Debug, Serialize, schemars::JsonSchema)]
pub(crate) struct Cell {
    /// m.
    radius: f64,
    /// m/s.
    speed: f64,
    /// Highest force at the bead's incoming contact, N.
    peak_force: f64,
    /// Greatest magnitude of the intruder's acceleration, m/s².
    peak_acceleration: f64,
    /// Behind the sensors for weak strikes, and behind those for strong ones.
    weak: Errors,
    strong: Errors,
    pass: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let (radii, speeds) = (&arguments.radii, &arguments.velocity);
    check_lengths("--radii", radii)?;
    check_positive("--velocity", speeds, "m/s")?;
    let common = &arguments.common;
    let image = common.bench.image()?;
    let target = common.target(&image)?;
    let (scenario, _) = load_scenario(&common.bench.scenario)?;
    let cells = cells(&grid(radii, speeds), |&(radius, speed)| {
        cell(arguments, &struck(&scenario, radius, speed), &image)
    })?;
    let text = text(arguments, &scenario);
    common.publish(target.as_ref(), &cells, &text, HEADINGS, row)?;
    let outside = cells.iter().filter(|cell| !cell.pass).count();
    if outside == 0 {
        return Ok(());
    }
    Err(Failure::Verdict(format!(
        "{outside} of {} cells are measured within 0.5 % (A) and 1 % (B) by neither pair of sensors",
        cells.len()
    )))
}

/// The scenario, struck by a full sphere of this radius, m, at this speed, m/s.
fn struck(scenario: &Scenario, radius: f64, speed: f64) -> Scenario {
    let mut scenario = scenario.clone();
    let striker = &mut scenario.striker;
    (striker.radius, striker.mass, striker.velocity) = (radius, None, speed);
    scenario
}

fn cell(arguments: &Arguments, scenario: &Scenario, image: &Path) -> Result<Cell, Failure> {
    let (common, strikes) = (&arguments.common, arguments.strikes);
    let solution = simulate_with_ring_down(scenario)?;
    bead_of(&solution, common.bench.bead)?;
    let errors = |sensors: Sensors| common.measure(scenario, &solution, &sensors.front_end(), strikes, image);
    let (weak, strong) = (errors(Sensors::Weak)?, errors(Sensors::Strong)?);
    let (_, peak_acceleration) = common.peaks(&solution);
    Ok(Cell {
        radius: scenario.striker.radius,
        speed: scenario.striker.velocity,
        peak_force: weak.peak_force,
        peak_acceleration,
        pass: weak.pass(strikes) || strong.pass(strikes),
        weak,
        strong,
    })
}

fn row(cell: &Cell) -> [String; 8] {
    let mut flags = Vec::new();
    for &flag in cell.weak.flags.iter().chain(&cell.strong.flags) {
        if !flag.ends_with("railed") && !flags.contains(&flag) {
            flags.push(flag);
        }
    }
    [
        format!("{:.1} mm, {} m/s", cell.radius * 1e3, cell.speed),
        format!("{:.1} N, {:.0} m/s²", cell.peak_force, cell.peak_acceleration),
        cell.weak.shown(0),
        cell.weak.shown(1),
        cell.strong.shown(0),
        cell.strong.shown(1),
        output::either(cell.pass, "yes", "no"),
        flags.join(", "),
    ]
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

/// The page above its table.
fn text(arguments: &Arguments, scenario: &Scenario) -> String {
    let material = |striker: &Striker| (striker.density, striker.young, striker.poisson);
    let is_steel = material(&scenario.striker) == material(&Striker::PAPER);
    let kind = if is_steel { "steel" } else { "spherical" };
    let strikes = arguments.strikes;
    let options = [
        typed("--radii", list(&arguments.radii), list(RADII)),
        typed("--velocity", list(&arguments.velocity), list(SPEEDS)),
        format!(" --strikes {strikes}"),
    ];
    let line = arguments.common.line("accuracy", &options);
    format!(
        "# Striker and speed against error

Written by

    {line}

from runs of the flash image in QEMU: {strikes} strikes a cell, each at another phase of the sample clock, with noise, by {kind}
strikers on the chain of the scenario. An error is that of the absorbed energy against the full f64 chain, its root mean
square over the strikes, in brackets the worst. A is measured by the acceleration, B predicted from the force.

*Weak* and *strong* are the two pairs of sensors that the front end is fitted with ([front-end.md](front-end.md)): 16 N and
±250 m/s² at the high gain, 256 N and ±4000 m/s² at the low one, with noise of 5 mN and 0.05 m/s²; and six times all that.
*Railed*: the strike is beyond the low gain's range, and its report says so. The last column but one: whether one of the two
pairs keeps A within 0.5 % and B within 1 %. The other flags are explained in [estimators.md](estimators.md).

"
    )
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    const SCENARIO: &str = "docs/scenarios/paper-strike.toml";

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        arguments: Arguments,
    }

    fn read(options: &[&str]) -> Arguments {
        let line = ["accuracy", SCENARIO, "--bead", "8"].iter().chain(options);
        Line::try_parse_from(line).unwrap().arguments
    }

    #[test]
    fn a_page_tells_the_command_that_wrote_it_and_whose_strikers() {
        let mut scenario = Scenario::paper();
        let kept = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/ranges.md");
        let kept = std::fs::read_to_string(kept).unwrap();
        let own = text(&read(&["--table", "docs/ranges.md"]), &scenario);
        assert!(kept.starts_with(&own), "{own}");

        let options = "--radii 0.0045,0.02 --velocity 3 --strikes 2 --seed 7 --overwrite --table a.md";
        let options: Vec<&str> = options.split(' ').collect();
        scenario.striker.density = 2500.0;
        let other = text(&read(&options), &scenario);
        let line = format!(
            "    bead proof accuracy {SCENARIO} --bead 8 {}\n",
            options.join(" ")
        );
        assert!(other.contains(&line) && !other.contains("steel"), "{other}");
    }

    #[test]
    fn a_sphere_has_the_mass_of_its_radius_whatever_the_striker_of_the_scenario_weighs() {
        let mut scenario = Scenario::paper();
        let expected = struck(&scenario, 0.009, 1.0);
        scenario.striker.mass = Some(0.003);
        assert_eq!(struck(&scenario, 0.009, 1.0), expected);
    }

    #[test]
    fn a_flag_of_both_pairs_of_sensors_is_told_once() {
        let errors = |flags: &[&'static str]| Errors {
            strikes: 2,
            peak_force: 1.0,
            rms: [0.0; 2],
            worst: [0.0; 2],
            flags: flags.to_vec(),
        };
        let cell = Cell {
            radius: 0.0045,
            speed: 1.0,
            peak_force: 1.0,
            peak_acceleration: 1.0,
            weak: errors(&["truncated", "force_railed", "estimates_differ"]),
            strong: errors(&["truncated", "overrun"]),
            pass: true,
        };
        assert_eq!(row(&cell)[7], "truncated, estimates_differ, overrun");
    }
}
