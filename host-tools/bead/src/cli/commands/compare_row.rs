//! `bead compare` of a recording of several beads: all of them and one simulation, side by side.

use std::path::Path;

use hertz_chain::Scenario;
use rayon::prelude::*;
use serde::Serialize;

use crate::cli::commands::compared::{Velocity, echoes_left_out, scenario, shown};
use crate::cli::failure::Failure;
use crate::cli::output::{self, Format};
use crate::cli::place::{self, Kind, Overwrite};
use crate::cli::provenance;
use bead_compare::row::{self, Chain, ComparedRow, Member, Place, Row, RowComparison, among};
use bead_compare::sensed::unlike_the_reduced_chain;
use bead_compare::strike::FullChain;
use bead_compare::velocity::{self, FittedVelocity};
use bead_compare::verdict::{Echoes, other_length};
use bead_recording::clock::CommonTime;
use bead_recording::file::Part;
use bead_recording::received::Received;
use bead_tables::whole::Target;

/// The options of the comparison.
pub(super) struct Wanted<'a> {
    /// The scenario that is given.
    pub scenario: Option<&'a Path>,
    pub velocity: Option<Velocity>,
    pub report: Option<Target>,
    /// The folder of the figures.
    pub figures: Option<&'a Path>,
    /// The files that are read.
    pub inputs: &'a [&'a Path],
    pub overwrite: Overwrite,
    pub format: Format,
}

/// The result, as in the JSON.
#[derive(Serialize, schemars::JsonSchema)]
pub(crate) struct Report<'a> {
    striker_velocity: Option<FittedVelocity>,
    #[serde(flatten)]
    told: &'a RowComparison,
}

pub(super) fn run(received: &Received, wanted: &Wanted<'_>) -> Result<(), Failure> {
    let figures = wanted.figures.map(|directory| {
        let names = ["row.svg", "row-details.svg"].map(|name| (name, Kind::Drawing));
        place::targets(directory, names, wanted.inputs, wanted.overwrite)
    });
    let figures = figures.transpose()?;
    let given = scenario(wanted.scenario, received)?;
    let (scenario, text) = (given.scenario.clone(), &given.text);
    let progress = output::spinner(format!("simulating {} beads", scenario.chain.beads));
    let mut chain = Chain::of(scenario)?;
    let (places, mut notes) = among(received, &chain, text);
    if places.is_empty() {
        return Err(Failure::input(format!(
            "{}: none of its beads is of this scenario: {}",
            received.path.display(),
            notes.join("; ")
        )));
    }
    let fitted = set_velocity(&mut chain, wanted.velocity, &places)?;
    // The energy goes with the square of the velocity.
    let truth = fitted.map_or(0.0, |fit| 2.0 * fit.uncertainty / fit.velocity);
    let time = CommonTime::of(&received.recording)?;
    progress.set_message(format!("comparing {} beads", places.len()));
    let read = |place: &Place| -> Result<Member, Failure> {
        let full = FullChain::of(&chain.scenario, &chain.solution, place.bead)?;
        let echoes = echoes(&chain.scenario, place)?;
        Ok(Member::read(
            place.bead,
            &place.received,
            full,
            &time,
            truth,
            echoes,
        )?)
    };
    let members: Vec<_> = places.par_iter().map(read).collect();
    let row = Row::of(members.into_iter().collect::<Result<_, _>>()?);
    progress.finish_and_clear();
    if row.strikes.is_empty() {
        let mut heard = received.strikes()?;
        heard.by_ref().for_each(drop);
        return Err(received.no_strike(heard.frames()).into());
    }
    notes.extend(echoed(&row));
    let told = row::compare(&row, &chain, notes)?;
    let warnings = places
        .iter()
        .filter_map(|place| unlike_the_reduced_chain(&chain.solution, place.bead));
    let mut warnings: Vec<_> = warnings.collect();
    // A load is that of all.
    warnings.dedup();
    for note in warnings
        .into_iter()
        .chain(length(&row, &chain))
        .chain(told.notes.iter().cloned())
    {
        output::note(format_args!("{note}"));
    }

    let made = wanted.report.as_ref().map_or(Ok(Vec::new()), |_| {
        provenance::made(&received.path, provenance::scenario(text))
    })?;
    let compared = ComparedRow {
        recording: &received.path.file_name().unwrap_or_default().to_string_lossy(),
        row: &row,
        chain: &chain,
        compared: &told,
        velocity: fitted.as_ref().map(shown),
        made: &made,
        scenario: text,
    };
    let report = compared.report();
    if let Some(target) = &wanted.report {
        target.write_bytes(report.page()?)?;
    }
    if let Some((directory, figures)) = wanted.figures.zip(figures) {
        place::make_directory(directory)?;
        let charts = [
            row::overview(&row, &chain, &told),
            row::details(&row, &chain, &told),
        ];
        for (figure, chart) in figures.iter().zip(charts) {
            figure.write_bytes(chart.standalone_svg()?)?;
        }
    }
    let printed = Report {
        striker_velocity: fitted,
        told: &told,
    };
    output::print(wanted.format, &printed, || report.terminal())?;
    given.end(told.failure.clone())
}

/// A warning where the scenario's duration is not that of the windows: of the first bead, and for how many it
/// holds.
fn length(row: &Row, chain: &Chain) -> Option<String> {
    let of = |member: &Member| {
        let Member { bead, window, .. } = member;
        other_length(&chain.scenario, &chain.solution, &member.chain, *bead, (*window)?)
    };
    let mut notes = row.members.iter().filter_map(of);
    let first = notes.next()?;
    Some(match notes.count() {
        0 => first,
        more => format!("{first} (beads that are concerned: {})", more + 1),
    })
}

/// Separates the echoes of a bead.
fn echoes(scenario: &Scenario, place: &Place) -> Result<Echoes, Failure> {
    Ok(Echoes::of(scenario, place.received.json(Part::Truth)?))
}

/// The echoes of a row, if there are any.
fn echoed(row: &Row) -> Option<String> {
    let of = |member: &Member| match member.echoes {
        0 => None,
        count => Some(format!("{count} of bead {}", member.bead)),
    };
    let which: Vec<_> = row.members.iter().filter_map(of).collect();
    (!which.is_empty()).then(|| echoes_left_out(&which.join(", ")))
}

/// Gives the striker the velocity that is wanted: of those that the beads' forces tell, the first bead's.
fn set_velocity(
    chain: &mut Chain,
    velocity: Option<Velocity>,
    places: &[Place],
) -> Result<Option<FittedVelocity>, Failure> {
    let mut scenario = chain.scenario.clone();
    let fitted = match velocity {
        None => return Ok(None),
        Some(Velocity::Given(velocity)) => {
            scenario.striker.velocity = velocity;
            None
        }
        Some(Velocity::Fit) => {
            let (mut fitted, mut failed) = (None, None);
            for place in places {
                let strikes = velocity::first_strikes(place.received.strikes()?, echoes(&scenario, place)?);
                if strikes.is_empty() {
                    continue;
                }
                match velocity::fit(&scenario, place.bead, &strikes) {
                    Ok(found) => {
                        fitted = Some(found);
                        break;
                    }
                    Err(why) => failed = failed.or(Some(why)),
                }
            }
            match (fitted, failed) {
                (Some(fitted), _) => scenario.striker.velocity = fitted.velocity,
                (None, Some(why)) => return Err(why.into()),
                (None, None) => {}
            }
            fitted
        }
    };
    *chain = Chain::of(scenario)?;
    Ok(fitted)
}
