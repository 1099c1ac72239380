//! `bead proof spheres`: the error of the image's two estimates over materials and diameters of spheres.
//!
//! # Design
//! Each cell is a chain of other spheres. The intruder is the scenario's own in units of the sphere: the
//! same part of its mass, unless another is asked for, and the same frequency and damping in units of the
//! time of its wave.

use std::f64::consts::PI;

use bead_model::design::Bead;
use clap::ValueEnum;
use hertz_chain::Options;

use super::measure::{Prepared, ProofOptions, StrikePeaks, grid, metres, shown};
use crate::cli::commands::prelude::*;
use bead_bench::accuracy::EstimateErrors;
use bead_bench::error::BenchError;
use bead_compare::error::CompareError;
use bead_compare::front_end::{AnalogFrontEnd, SAMPLE_RATE_HZ};
use bead_compare::sensed::{RING_DOWN, bead_of, simulate_with_ring_down};

const AFTER_HELP: &str = "\
Each cell is a chain of equal spheres, as many as the scenario has, struck by an equal sphere at --velocity. \
Its intruder is the scenario's in units of the sphere: the same part of the mass, or --part of it, and the \
same frequency and damping in units of the time that a wave takes. The scenario's wall, sections and starts \
are left out. The flash image runs in QEMU on --strikes strikes, behind sensors whose ranges at the high gain \
the strike fills to two thirds, with as many codes of noise as the reference. Spheres whose waves are too \
short are refused, and the table gives the smallest diameter that is accepted.

Examples:
  bead proof spheres docs/scenarios/paper-strike.toml --bead 8
  bead proof spheres docs/scenarios/paper-strike.toml --bead 8 \\
      --materials steel,ptfe --diameters 0.015,0.025 --part 0.3
  bead proof spheres docs/scenarios/paper-strike.toml --bead 8 --overwrite \\
      --table docs/spheres.md";

/// The page's title, and its text above the table.
const PAGE: [&str; 2] = [
    "Spheres of other materials and sizes",
    "\
from runs of the flash image in QEMU: 4 strikes a cell unless --strikes says otherwise, each at a different phase of the sample
clock, with noise. Every chain is of equal spheres and is struck by an equal sphere, at 0.3 m/s unless --velocity says
otherwise. The intruder is the scenario's in units of the sphere: the same part of its mass, or --part of it, and the same
frequency and damping in units of the time of the wave. The strike fills two thirds of the sensors' ranges at the high gain.
Errors are those of the absorbed energy against the full f64 chain: the root mean square over the strikes, and in brackets the
worst. A is measured by the acceleration, B is predicted from the force.

*Wave* is the width, at half its height, of the force of a solitary wave of 1 m/s, in samples. It decides how well the bead can
measure: from 5.6 samples on, the arithmetic alone keeps A within 0.1 % and B within 0.5 %. Below 2.5 samples a sphere is
refused, and the table gives the smallest diameter that is accepted.
",
];

const WIDER: f64 = 1.25;

const DIAMETERS: [f64; 7] = [0.005, 0.007, 0.01, 0.014, 0.02, 0.028, 0.04];

/// Materials of spheres, by handbook values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum SphereMaterial {
    Steel,
    Glass,
    Aluminium,
    Ptfe,
    Nylon,
    Abs,
    Bakelite,
}

impl SphereMaterial {
    /// Density, kg/m³, Young's modulus, Pa, and Poisson's ratio; Bakelite as in the paper.
    const fn material(self) -> (f64, f64, f64) {
        match self {
            Self::Steel => (7780.0, 203e9, 0.27),
            Self::Glass => (2500.0, 70e9, 0.22),
            Self::Aluminium => (2700.0, 70e9, 0.33),
            Self::Ptfe => (2178.0, 1.46e9, 0.46),
            Self::Nylon => (1150.0, 2.8e9, 0.4),
            Self::Abs => (1040.0, 2.3e9, 0.35),
            Self::Bakelite => (1775.0, 4.5e9, 0.44),
        }
    }
}

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    #[command(flatten)]
    common: ProofOptions,
    /// Materials [default: all].
    #[arg(long, value_enum, value_delimiter = ',')]
    materials: Vec<SphereMaterial>,
    /// Diameters, m.
    #[arg(long, value_name = "M", value_delimiter = ',', default_values_t = DIAMETERS, value_parser = metres)]
    diameters: Vec<f64>,
    #[command(flatten)]
    strike: SphereStrike,
    /// Strikes in each cell, each at a different phase of the sample clock.
    #[arg(long, value_name = "K", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=1000))]
    strikes: u32,
}

/// Options of a chain of equal spheres.
#[derive(Debug, Args)]
pub(super) struct SphereStrike {
    /// Mass of the intruder as a part of the bead's, 0.001 to 0.9 [default: as in the scenario].
    #[arg(long, value_name = "PART", value_parser = part)]
    pub(super) part: Option<f64>,
    /// Velocity of the striker, m/s.
    #[arg(long, value_name = "M/S", default_value = "0.3", value_parser = positive)]
    pub(super) velocity: f64,
    /// Relaxation time of the contacts, s.
    #[arg(long, value_name = "S", default_value = "0", value_parser = relaxation)]
    pub(super) relaxation: f64,
}

/// Parses the part of a bead's mass that its intruder has. One without a host around it, or without mass, is
/// too fast for any run.
fn part(text: &str) -> Result<f64, String> {
    let part = text.parse().ok().filter(|part| (0.001..=0.9).contains(part));
    part.ok_or_else(|| "give a part from 0.001 to 0.9".to_owned())
}

fn relaxation(text: &str) -> Result<f64, String> {
    let time = text
        .parse()
        .ok()
        .filter(|time: &f64| time.is_finite() && *time >= 0.0);
    time.ok_or_else(|| "give 0 or more, in s".to_owned())
}

/// One material and one diameter.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct SphereCell {
    material: SphereMaterial,
    diameter_m: f64,
    /// Width of the pulse of a wave of 1 m/s, in samples.
    width_samples: f64,
    #[serde(flatten)]
    outcome: SphereOutcome,
}

#[derive(Debug, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum SphereOutcome {
    Measured(Measured),
    /// Why nothing was measured.
    Refused(String),
}

#[derive(Debug, Serialize, JsonSchema)]
struct Measured {
    #[serde(flatten)]
    peaks: StrikePeaks,
    errors: EstimateErrors,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let prepared = arguments.common.prepare()?;
    let scenario = &prepared.scenario;
    let own = bead_of(&simulate_with_ring_down(scenario)?, arguments.common.bead)?;
    let points = points(arguments, scenario, &own)?;
    let cell = |&point: &_| cell(arguments, &prepared, &own, point);
    prepared.tabulate(&points, cell, PAGE, HEADINGS, row).map(drop)
}

/// Materials and diameters, all of which can be run: a single one that cannot would lose the results of the
/// others.
fn points(
    arguments: &Arguments,
    scenario: &Scenario,
    own: &Bead,
) -> Result<Vec<(SphereMaterial, f64)>, Failure> {
    let materials = match &arguments.materials[..] {
        [] => SphereMaterial::value_variants(),
        some => some,
    };
    let points = grid(materials, &arguments.diameters);
    for &point in &points {
        let (scenario, _) = chain(&arguments.strike, scenario, own, point);
        let options = Options::default().with_duration(scenario.duration + RING_DOWN);
        let checked = options.check(&scenario);
        checked.map_err(|why| failure!(Input, "--diameters {}: {why}", point.1))?;
    }
    Ok(points)
}

/// The scenario with equal spheres of a material, and its bead. `own` is the bead of the scenario as it is.
pub(super) fn chain(
    strike: &SphereStrike,
    scenario: &Scenario,
    own: &Bead,
    (sphere, diameter): (SphereMaterial, f64),
) -> (Scenario, Bead) {
    let (radius, (density, young, poisson)) = (0.5 * diameter, sphere.material());
    let mass = 4.0 / 3.0 * PI * radius.powi(3) * density;
    let mut bead = Bead {
        mass,
        intruder_mass: mass * strike.part.unwrap_or(own.intruder_mass / own.mass),
        contact_stiffness: young / (1.5 * (1.0 - poisson * poisson)) * (0.5 * radius).sqrt(),
        relaxation: strike.relaxation,
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
    (chain.relaxation, chain.precompression) = (strike.relaxation, 0.0);
    let striker = &mut scenario.striker;
    (striker.radius, striker.density, striker.young, striker.poisson) = (radius, density, young, poisson);
    (striker.mass, striker.relaxation, striker.velocity) = (None, None, strike.velocity);
    for intruder in &mut scenario.intruders {
        intruder.mass = bead.intruder_mass;
        (intruder.stiffness, intruder.damping) = (bead.stiffness, bead.damping);
    }
    (scenario, bead)
}

fn cell(
    arguments: &Arguments,
    prepared: &Prepared<'_>,
    own: &Bead,
    (material, diameter_m): (SphereMaterial, f64),
) -> Result<SphereCell, Failure> {
    let (scenario, bead) = chain(&arguments.strike, &prepared.scenario, own, (material, diameter_m));
    let solution = simulate_with_ring_down(&scenario)?;
    let peaks = StrikePeaks::of(&scenario, &solution, prepared.common.bead)?;
    let outcome = match prepared.measure(&scenario, &solution, &filled(&peaks), arguments.strikes) {
        Ok(errors) => SphereOutcome::Measured(Measured { peaks, errors }),
        // The table names refused spheres, so they are no error.
        Err(BenchError::Unfit(why) | BenchError::Compare(CompareError::Unfit(why))) => {
            SphereOutcome::Refused(why)
        }
        Err(error) => return Err(error.into()),
    };
    Ok(SphereCell {
        material,
        diameter_m,
        width_samples: bead.pulse_width(1.0) * f64::from(SAMPLE_RATE_HZ),
        outcome,
    })
}

/// The reference front end behind sensors of which the strike fills two thirds of the range at the high gain.
/// The low gain is little less, since the amplifiers of a fast bead have no room for more: ±65 km/s² is the
/// limit.
pub(super) fn filled(peaks: &StrikePeaks) -> AnalogFrontEnd {
    let mut front_end = AnalogFrontEnd::default();
    // The reference reaches from -0.5 to 15.5 N, and to 250 m/s² to either side.
    let (force, acceleration) = (&mut front_end.force, &mut front_end.acceleration);
    for (sensor, span, times) in [
        (force, 16.0, peaks.peak_force_n / (15.5 * 2.0 / 3.0)),
        (
            acceleration,
            500.0,
            peaks.peak_acceleration_mps2 / (250.0 * 2.0 / 3.0),
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

fn row(cell: &SphereCell) -> [String; 7] {
    let [peaks, a, b, flags] = match &cell.outcome {
        SphereOutcome::Measured(Measured { peaks, errors }) => [
            format!(
                "{:.3} N, {:.0} m/s²",
                peaks.peak_force_n, peaks.peak_acceleration_mps2
            ),
            shown(errors, 0),
            shown(errors, 1),
            errors.flags.join(", "),
        ],
        SphereOutcome::Refused(why) => ["-", "refused", "refused", short(why)].map(str::to_owned),
    };
    let material = format!("{:?}", cell.material).to_lowercase();
    let [diameter, width] = [cell.diameter_m * 1e3, cell.width_samples].map(|number| format!("{number:.1}"));
    [material, diameter, width, peaks, a, b, flags]
}

/// A short form of a refusal for a table: the least diameter, or else the message without its beginning.
fn short(why: &str) -> &str {
    let small = why
        .split("this material needs ")
        .nth(1)
        .and_then(|rest| rest.split(", since").next());
    let rest = why.split_once("this front end: ").map(|(_, rest)| rest);
    small
        .filter(|small| small.ends_with(" mm"))
        .or(rest)
        .unwrap_or(why)
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use hertz_chain::{Material, Section, Start, Wall};

    use super::*;

    #[derive(Parser)]
    struct ProofLine {
        #[command(flatten)]
        arguments: Arguments,
    }

    #[test]
    fn an_intruder_is_a_thousandth_to_nine_tenths_of_its_bead() {
        for text in ["0.001", "0.3", "0.9"] {
            assert!(part(text).is_ok(), "{text}");
        }
        for text in ["0", "0.0009", "0.9999999999999999", "1", "-0.1", "nan", ""] {
            assert!(part(text).is_err(), "{text}");
        }
    }

    #[test]
    fn the_pages_in_the_docs_have_the_texts_of_the_proofs() {
        use super::super::accuracy;

        for ([title, text], page) in [
            (PAGE, include_str!("../../../../../../docs/spheres.md")),
            (accuracy::PAGE, include_str!("../../../../../../docs/ranges.md")),
        ] {
            let is_its = page.starts_with(&format!("# {title}\n")) && page.contains(text);
            assert!(is_its, "{title}");
        }
    }

    #[test]
    fn a_chain_is_of_equal_spheres_alone() {
        let line = ["spheres", "paper-strike.toml", "--bead", "8"];
        let (arguments, own) = (ProofLine::parse_from(line).arguments, Bead::paper());
        let equal =
            |scenario: &Scenario| chain(&arguments.strike, scenario, &own, (SphereMaterial::Glass, 0.02)).0;
        let mut scenario = Scenario::paper();
        let expected = equal(&scenario);
        let (density, young, poisson) = SphereMaterial::Steel.material();
        scenario.wall = Some(Wall::flat(Material {
            density,
            young,
            poisson,
        }));
        scenario.sections = vec![Section::of([3])];
        scenario.starts = vec![Start::moving([16], -0.2)];
        assert_eq!(equal(&scenario), expected);
    }
}
