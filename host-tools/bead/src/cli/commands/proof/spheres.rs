//! `bead proof spheres`: the error of the image's two estimates over materials and diameters of spheres.
//!
//! # Design
//! Each cell is a chain of other spheres. The intruder is the scenario's own in
//! units of the sphere: the same part of its mass, if no other is asked for, and the same frequency and
//! damping in units of the time of its wave.

use std::f64::consts::PI;
use std::path::Path;

use bead_model::design::Bead;
use clap::{Args, ValueEnum};
use hertz_chain::{Material, Options, Scenario};
use serde::Serialize;

use super::measure::{Common, Errors, cells, check_lengths, check_positive, grid, list, typed};
use crate::cli::failure::Failure;
use bead_bench::error::BenchError;
use bead_compare::error::CompareError;
use bead_compare::front_end::{FrontEnd, SAMPLE_RATE_HZ};
use bead_compare::sensed::{RING_DOWN, bead_of, load_scenario, simulate_with_ring_down};

const AFTER_HELP: &str = "\
Each cell is a chain of equal spheres, as many as the scenario has, struck by one of them at --velocity. Its \
intruder is the scenario's in units of the sphere: the same part of the mass, or --part of it, and the same \
frequency and damping in units of the time that a wave takes. The scenario's wall, sections and starts are \
left out. The flash image runs in QEMU on --strikes strikes, behind sensors whose ranges at the high gain \
the strike fills to two thirds, with the noise of the reference in codes. Spheres whose waves are too short \
are refused, and the table says from which diameter on they are not.

Examples:
  bead proof spheres docs/scenarios/paper-strike.toml --bead 8
  bead proof spheres docs/scenarios/paper-strike.toml --bead 8 \\
      --materials steel,ptfe --diameters 0.015,0.025 --part 0.3
  bead proof spheres docs/scenarios/paper-strike.toml --bead 8 --overwrite \\
      --table docs/spheres.md";

/// Range at the low gain, as a multiple of that at the high one.
const WIDER: f64 = 1.25;

const DIAMETERS: [f64; 7] = [0.005, 0.007, 0.01, 0.014, 0.02, 0.028, 0.04];
const SPEED: f64 = 0.3;
const RELAXATION: f64 = 0.0;
const STRIKES: u32 = 4;

/// Materials of spheres, by handbook values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Kind {
    Steel,
    Glass,
    Aluminium,
    Ptfe,
    Nylon,
    Abs,
    Bakelite,
}

impl Kind {
    /// As it is typed.
    fn name(self) -> String {
        format!("{self:?}").to_lowercase()
    }

    /// Density, kg/m³, Young's modulus, Pa, and Poisson's ratio; Bakelite as in the paper.
    fn material(self) -> Material {
        let (density, young, poisson) = match self {
            Self::Steel => (7780.0, 203e9, 0.27),
            Self::Glass => (2500.0, 70e9, 0.22),
            Self::Aluminium => (2700.0, 70e9, 0.33),
            Self::Ptfe => (2178.0, 1.46e9, 0.46),
            Self::Nylon => (1150.0, 2.8e9, 0.4),
            Self::Abs => (1040.0, 2.3e9, 0.35),
            Self::Bakelite => (1775.0, 4.5e9, 0.44),
        };
        Material {
            density,
            young,
            poisson,
        }
    }
}

/// Arguments of `bead proof spheres`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    #[command(flatten)]
    common: Common,
    /// Materials [default: all].
    #[arg(long, value_enum, value_delimiter = ',')]
    materials: Vec<Kind>,
    /// Diameters, m.
    #[arg(long, value_name = "M", value_delimiter = ',', default_values_t = DIAMETERS)]
    diameters: Vec<f64>,
    /// Mass of the intruder as a part of the bead's, 0.001 to 0.9 [default: as in the scenario].
    #[arg(long, value_name = "PART")]
    part: Option<f64>,
    /// Velocity of the striker, m/s.
    #[arg(long, value_name = "M/S", default_value_t = SPEED)]
    velocity: f64,
    /// Relaxation time of the contacts, s.
    #[arg(long, value_name = "S", default_value_t = RELAXATION)]
    relaxation: f64,
    /// Strikes in each cell, each at another phase of the sample clock.
    #[arg(long, value_name = "K", default_value_t = STRIKES, value_parser = clap::value_parser!(u32).range(1..=1000))]
    strikes: u32,
}

/// One material and one diameter.
#[derive(Debug, Serialize, schemars::JsonSchema)]
pub(crate) struct Cell {
    material: Kind,
    /// m.
    diameter: f64,
    /// Width of the pulse of a wave of 1 m/s, in samples.
    width_samples: f64,
    #[serde(flatten)]
    outcome: Outcome,
}

#[derive(Debug, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Outcome {
    Measured(Measured),
    /// Why nothing was measured.
    Refused(String),
}

#[derive(Debug, Serialize, schemars::JsonSchema)]
struct Measured {
    /// Highest force at the bead's incoming contact, N.
    peak_force: f64,
    /// Greatest magnitude of the intruder's acceleration, m/s².
    peak_acceleration: f64,
    errors: Errors,
}

/// Parts of a bead's mass that an intruder may have. One without a host around it, or without mass, is too
/// fast for any run.
fn check_part(part: Option<f64>) -> Result<(), Failure> {
    match part.filter(|part| !(0.001..=0.9).contains(part)) {
        Some(value) => Err(Failure::input(format!(
            "--part {value}: give a part between 0 and 1, from 0.001 to 0.9"
        ))),
        None => Ok(()),
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    check_lengths("--diameters", &arguments.diameters)?;
    check_positive("--velocity", &[arguments.velocity], "m/s")?;
    if !(arguments.relaxation.is_finite() && arguments.relaxation >= 0.0) {
        let value = arguments.relaxation;
        return Err(Failure::input(format!(
            "--relaxation {value}: give 0 or more, in s"
        )));
    }
    check_part(arguments.part)?;
    let common = &arguments.common;
    let image = common.bench.image()?;
    let target = common.target(&image)?;
    let (scenario, _) = load_scenario(&common.bench.scenario)?;
    let own = bead_of(&simulate_with_ring_down(&scenario)?, common.bench.bead)?;
    let points = points(arguments, &scenario, &own)?;
    let cells = cells(&points, |&(material, diameter)| {
        cell(arguments, &scenario, &own, material, diameter, &image)
    })?;
    common.publish(target.as_ref(), &cells, &text(arguments), HEADINGS, row)
}

/// Materials and diameters, each of which can be run: one that cannot would lose the results of all others.
fn points(arguments: &Arguments, scenario: &Scenario, own: &Bead) -> Result<Vec<(Kind, f64)>, Failure> {
    let materials = match &arguments.materials[..] {
        [] => Kind::value_variants(),
        some => some,
    };
    let points = grid(materials, &arguments.diameters);
    for &(kind, diameter) in &points {
        let (scenario, _) = chain(arguments, scenario, own, kind, diameter);
        let options = Options::default().with_duration(scenario.duration + RING_DOWN);
        let checked = options.check(&scenario);
        checked.map_err(|why| Failure::input(format!("--diameters {diameter}: {why}")))?;
    }
    Ok(points)
}

/// The scenario with equal spheres of a material, and its bead. `own` is the bead of the scenario as it is.
fn chain(
    arguments: &Arguments,
    scenario: &Scenario,
    own: &Bead,
    kind: Kind,
    diameter: f64,
) -> (Scenario, Bead) {
    let (radius, material) = (0.5 * diameter, kind.material());
    let Material {
        density,
        young,
        poisson,
    } = material;
    let mass = 4.0 / 3.0 * PI * radius.powi(3) * density;
    let mut bead = Bead {
        mass,
        intruder_mass: mass * arguments.part.unwrap_or(own.intruder_mass / own.mass),
        contact_stiffness: young / (1.5 * (1.0 - poisson * poisson)) * (0.5 * radius).sqrt(),
        relaxation: arguments.relaxation,
        ..*own
    };
    let time = bead.pulse_width(1.0) / own.pulse_width(1.0);
    let reduced = |bead: &Bead| bead.intruder_mass * (bead.mass - bead.intruder_mass) / bead.mass;
    bead.stiffness = own.stiffness / reduced(own) / time.powi(2) * reduced(&bead);
    bead.damping = own.damping / reduced(own) / time * reduced(&bead);

    let mut scenario = scenario.clone();
    scenario.duration *= time.max(1.0);
    scenario.wall = None;
    scenario.sections.clear();
    scenario.starts.clear();
    let chain = &mut scenario.chain;
    (chain.radius, chain.density, chain.young, chain.poisson) = (radius, density, young, poisson);
    (chain.relaxation, chain.precompression) = (arguments.relaxation, 0.0);
    let striker = &mut scenario.striker;
    (striker.radius, striker.density, striker.young, striker.poisson) = (radius, density, young, poisson);
    (striker.mass, striker.relaxation, striker.velocity) = (None, None, arguments.velocity);
    for intruder in &mut scenario.intruders {
        intruder.mass = bead.intruder_mass;
        (intruder.stiffness, intruder.damping) = (bead.stiffness, bead.damping);
    }
    (scenario, bead)
}

fn cell(
    arguments: &Arguments,
    scenario: &Scenario,
    own: &Bead,
    kind: Kind,
    diameter: f64,
    image: &Path,
) -> Result<Cell, Failure> {
    let (scenario, bead) = chain(arguments, scenario, own, kind, diameter);
    let solution = simulate_with_ring_down(&scenario)?;
    let (peak_force, peak_acceleration) = arguments.common.peaks(&solution);
    let front_end = filled(peak_force, peak_acceleration);
    let measured = arguments
        .common
        .measure(&scenario, &solution, &front_end, arguments.strikes, image);
    let outcome = match measured {
        Ok(errors) => Outcome::Measured(Measured {
            peak_force,
            peak_acceleration,
            errors,
        }),
        // The table says which spheres are refused.
        Err(BenchError::Unfit(why) | BenchError::Compare(CompareError::Unfit(why))) => Outcome::Refused(why),
        Err(error) => return Err(error.into()),
    };
    Ok(Cell {
        material: kind,
        diameter,
        width_samples: bead.pulse_width(1.0) * f64::from(SAMPLE_RATE_HZ),
        outcome,
    })
}

/// The reference front end behind sensors of which the strike fills two thirds of the range at the high gain.
/// The low gain is little less, since the amplifiers of a fast bead have no room for more: ±65 km/s² is the
/// limit.
fn filled(peak_force: f64, peak_acceleration: f64) -> FrontEnd {
    let mut front_end = FrontEnd::default();
    // The reference reaches from -0.5 to 15.5 N, and to 250 m/s² to either side.
    for (sensor, span, times) in [
        (&mut front_end.force, 16.0, peak_force / (15.5 * 2.0 / 3.0)),
        (
            &mut front_end.acceleration,
            500.0,
            peak_acceleration / (250.0 * 2.0 / 3.0),
        ),
    ] {
        sensor.sensitive.sensitivity /= times;
        sensor.sensitive.noise_rms *= times;
        sensor.wide = sensor.sensitive.with_span(WIDER * span * times);
        sensor.wide.noise_rms *= WIDER;
    }
    front_end
}

const HEADINGS: [&str; 7] = [
    "material",
    "diameter (mm)",
    "wave (samples)",
    "peaks",
    "A (%)",
    "B (%)",
    "flags",
];

fn row(cell: &Cell) -> [String; 7] {
    let [peaks, a, b, flags] = match &cell.outcome {
        Outcome::Measured(measured) => [
            format!(
                "{:.3} N, {:.0} m/s²",
                measured.peak_force, measured.peak_acceleration
            ),
            measured.errors.shown(0),
            measured.errors.shown(1),
            measured.errors.flags.join(", "),
        ],
        Outcome::Refused(why) => ["-".into(), "refused".into(), "refused".into(), short(why).into()],
    };
    let (diameter, width) = (
        format!("{:.1}", cell.diameter * 1e3),
        format!("{:.1}", cell.width_samples),
    );
    [cell.material.name(), diameter, width, peaks, a, b, flags]
}

/// A short form of a refusal for a table: the least diameter, or else the message without its beginning.
fn short(why: &str) -> &str {
    let small = why
        .split(": ")
        .nth(1)
        .and_then(|rest| rest.split(" of this").next());
    let rest = why.split_once("this front end: ").map(|(_, rest)| rest);
    small
        .filter(|small| small.ends_with("at least"))
        .or(rest)
        .unwrap_or(why)
}

/// The page above its table.
fn text(arguments: &Arguments) -> String {
    let materials = list(arguments.materials.iter().map(|kind| kind.name()));
    let part = arguments.part.map(|part| part.to_string()).unwrap_or_default();
    let intruder = match arguments.part {
        None => "is the scenario's in units of the sphere: the same part\nof its mass, and the same".into(),
        Some(part) => format!("has {part} of the sphere's mass,\nand the scenario's"),
    };
    let (strikes, velocity) = (arguments.strikes, arguments.velocity);
    let options = [
        typed("--materials", materials, ""),
        typed("--diameters", list(&arguments.diameters), list(DIAMETERS)),
        typed("--part", part, ""),
        typed("--velocity", velocity, SPEED),
        typed("--relaxation", arguments.relaxation, RELAXATION),
        typed("--strikes", strikes, STRIKES),
    ];
    let line = arguments.common.line("spheres", &options);
    format!(
        "# Spheres of other materials and sizes

Written by

    {line}

from runs of the flash image in QEMU: {strikes} strikes a cell, each at another phase of the sample clock, with noise. Every chain is
of equal spheres and is struck by one of them at {velocity} m/s. The intruder {intruder} \
frequency and damping in units of the time of the wave. The strike fills two thirds of the sensors'
ranges at the high gain. An error is that of the absorbed energy against the full f64 chain, its root mean square over the
strikes, in brackets the worst. A is measured by the acceleration, B predicted from the force.

*Wave* is the width, at half its height, of the force of a solitary wave of 1 m/s, in samples. It decides how well the bead can
measure: from 5.6 samples on, the arithmetic alone keeps A within 0.1 % and B within 0.5 %. Below 2.5 samples a sphere is
refused, and the table says which diameter is the least.

"
    )
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use hertz_chain::{Section, Start, Wall};

    use super::*;

    const SCENARIO: &str = "docs/scenarios/paper-strike.toml";

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        arguments: Arguments,
    }

    fn read(options: &[&str]) -> Arguments {
        let line = ["spheres", SCENARIO, "--bead", "8"].iter().chain(options);
        Line::try_parse_from(line).unwrap().arguments
    }

    #[test]
    fn an_intruder_is_a_thousandth_to_nine_tenths_of_its_bead() {
        for part in [None, Some(0.001), Some(0.3), Some(0.9)] {
            assert!(check_part(part).is_ok(), "{part:?}");
        }
        for part in [0.0, 0.0009, 0.999_999_999_999_999_9, 1.0, -0.1, f64::NAN] {
            let refused = check_part(Some(part)).unwrap_err().to_string();
            let expected = format!("--part {part}: give a part between 0 and 1, from 0.001 to 0.9");
            assert_eq!(refused, expected);
        }
    }

    #[test]
    fn a_page_tells_the_command_that_wrote_it_and_whose_intruder() {
        let kept = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/spheres.md");
        let kept = std::fs::read_to_string(kept).unwrap();
        let own = text(&read(&["--table", "docs/spheres.md"]));
        assert!(kept.starts_with(&own), "{own}");

        let options = "--materials steel,ptfe --diameters 0.015,0.025 --part 0.3 --velocity 1 --relaxation 0.000001 \
                       --strikes 2 --seed 7 --overwrite --table a.md";
        let options: Vec<&str> = options.split_whitespace().collect();
        let other = text(&read(&options));
        let line = format!(
            "    bead proof spheres {SCENARIO} --bead 8 {}\n",
            options.join(" ")
        );
        assert!(
            other.contains(&line) && other.contains("has 0.3 of the sphere's mass"),
            "{other}"
        );
    }

    #[test]
    fn a_chain_is_of_equal_spheres_alone() {
        let (arguments, own) = (read(&[]), Bead::paper());
        let equal = |scenario: &Scenario| chain(&arguments, scenario, &own, Kind::Glass, 0.02).0;
        let mut scenario = Scenario::paper();
        let expected = equal(&scenario);
        scenario.wall = Some(Wall::flat(Kind::Steel.material()));
        scenario.sections = vec![Section::of([3])];
        scenario.starts = vec![Start::moving([16], -0.2)];
        assert_eq!(equal(&scenario), expected);
    }

    #[test]
    fn a_sphere_that_cannot_be_run_is_refused_before_the_first_run() {
        let scenario = Scenario::paper();
        let own = Bead::paper();
        let cells = |diameters: &str| {
            let arguments = read(&["--materials", "steel,ptfe", "--diameters", diameters]);
            points(&arguments, &scenario, &own).map_err(|why| why.to_string())
        };
        assert_eq!(cells("0.02,0.001").unwrap().len(), 4);
        for (diameter, why) in [
            (
                "1e-31",
                "--diameters 0.0000000000000000000000000000001: chain.radius: 5e-32 is out of the range",
            ),
            ("1e-8", "--diameters 0.00000001: "),
        ] {
            let refused = cells(&format!("0.02,{diameter}")).unwrap_err();
            assert!(refused.starts_with(why), "{refused}");
        }
    }
}
