//! Shared by all comparisons: the scenario and the striker's velocity before, the report and figures after.

use hertz_charts::Chart;

use crate::cli::commands::compare_arguments::{Arguments, Velocity};
use crate::cli::commands::prelude::*;
use crate::cli::provenance;
use bead_compare::report::{Fact, Report, count};
use bead_compare::sensed::load_scenario;
use bead_compare::velocity::{FittedVelocity, first_strikes, fit};
use bead_compare::verdict::Echoes;
use bead_recording::file::Part;

/// Gives the striker the velocity that is wanted. A fitted one is from the first bead whose forces allow a
/// fit.
pub(super) fn set_velocity<'a>(
    scenario: &mut Scenario,
    velocity: Option<Velocity>,
    beads: impl IntoIterator<Item = (usize, &'a Recording)>,
) -> Result<Option<FittedVelocity>, Failure> {
    match velocity {
        None => return Ok(None),
        Some(Velocity::Given(velocity)) => {
            scenario.striker.velocity = velocity;
            return Ok(None);
        }
        Some(Velocity::Fit) => {}
    }
    let mut failed = None;
    for (bead, received) in beads {
        let echoes = Echoes::of(scenario, received.json(Part::Truth)?);
        let strikes = first_strikes(received.strikes()?, echoes);
        if strikes.is_empty() {
            continue;
        }
        match fit(scenario, bead, &strikes) {
            Ok(fitted) => {
                scenario.striker.velocity = fitted.velocity;
                return Ok(Some(fitted));
            }
            Err(why) => failed = failed.or(Some(why)),
        }
    }
    failed.map_or(Ok(None), |why| Err(why.into()))
}

pub(super) fn shown(fitted: &FittedVelocity) -> String {
    let FittedVelocity {
        velocity,
        uncertainty,
        scatter,
        strikes,
        scenario,
    } = fitted;
    let digits = (1.0 - uncertainty.max(1e-9).log10()).ceil().clamp(0.0, 9.0) as usize;
    let from = count(*strikes as u64, "strike");
    let scatter = scatter.map(|scatter| format!(", which scatter by {scatter:.digits$} m/s"));
    format!(
        "{velocity:.digits$} ± {uncertainty:.digits$} m/s, fitted to the force of {from}{}; the scenario says {scenario} m/s",
        scatter.unwrap_or_default()
    )
}

/// A note about echoes: their number, and their beads.
pub(super) fn echoes_left_out(which: &str) -> String {
    format!("echoes, which are replayed but not compared with the chain, as a wave came again: {which}")
}

/// A scenario that strikes are held against.
pub(super) struct GivenScenario {
    pub(super) scenario: Scenario,
    /// The scenario, as its author wrote it.
    pub(super) text: String,
    /// A note if it is not the scenario of the recording.
    other: Option<String>,
}

impl GivenScenario {
    /// Ends a comparison: with its failure, or with a note where the scenario is not the recording's.
    pub(super) fn end(&self, failure: Option<String>) -> Result<(), Failure> {
        match (failure, &self.other) {
            (None, None) => {}
            (None, Some(note)) => note!("{note}"),
            (Some(what), None) => bail!(Verdict, "{what}"),
            (Some(what), Some(note)) => bail!(Verdict, "{what}; {note}"),
        }
        Ok(())
    }
}

/// The scenario that is given, or the one in the recording.
pub(super) fn scenario(given: Option<&Path>, received: &Recording) -> Result<GivenScenario, Failure> {
    let shown = received.path.display();
    let carried = received.parts.get(&Part::Scenario).map(|text| {
        let text = String::from_utf8_lossy(text).into_owned();
        let scenario = Scenario::from_toml(&text, &format!("{shown}: {}", Part::Scenario.name()));
        scenario.map(|scenario| (scenario, text))
    });
    let Some(path) = given else {
        let missing = format!("{shown} carries no scenario; give the recorded one with --scenario S.toml");
        let (scenario, text) = carried.ok_or_else(|| Failure::input(missing))??;
        return Ok(GivenScenario {
            scenario,
            text,
            other: None,
        });
    };
    let (scenario, text) = load_scenario(path)?;
    let is_other = carried.is_some_and(|carried| {
        carried.is_ok_and(|(mut carried, _)| {
            carried.title.clone_from(&scenario.title);
            carried != scenario
        })
    });
    let other = is_other.then(|| {
        format!(
            "{} is not the scenario that {shown} was recorded with; leave --scenario out to compare with that one",
            path.display()
        )
    });
    Ok(GivenScenario {
        scenario,
        text,
        other,
    })
}

/// Facts about a page, if one is written: how it was made, of a recording and of `compared`.
pub(super) fn made(
    page: Option<&Target>,
    received: &Recording,
    compared: Fact,
) -> Result<Vec<Fact>, Failure> {
    page.map_or(Ok(Vec::new()), |_| provenance::made(&received.path, compared))
}

/// Writes a report as a page, if one is wanted, and prints it, or `result` as JSON.
pub(super) fn publish(
    format: Format,
    page: Option<&Target>,
    report: &Report,
    result: &impl Serialize,
) -> Result<(), Failure> {
    if let Some(page) = page {
        page.write_bytes(report.page()?)?;
    }
    output::print(format, result, || report.terminal())
}

/// The places of the figures, if they are wanted.
pub(super) fn figures(arguments: &Arguments, names: [&str; 2]) -> Result<Option<Vec<Target>>, Failure> {
    let Some(directory) = &arguments.figures else {
        return Ok(None);
    };
    let files = names.map(|name| (name, FileKind::Drawing));
    place::targets(directory, files, &arguments.inputs(), arguments.overwrite).map(Some)
}

pub(super) fn draw(figures: &[Target], charts: [Chart; 2]) -> Result<(), Failure> {
    for (figure, chart) in figures.iter().zip(charts) {
        place::make_directory(figure.path().parent().unwrap_or(Path::new(".")))?;
        figure.write_bytes(chart.standalone_svg()?)?;
    }
    Ok(())
}

/// The failure of a recording in whose frames no strike came.
pub(super) fn no_strike(received: &Recording) -> Failure {
    match received.strikes() {
        Ok(mut strikes) => {
            strikes.by_ref().for_each(drop);
            received.no_strike(strikes.frames()).into()
        }
        Err(error) => error.into(),
    }
}
