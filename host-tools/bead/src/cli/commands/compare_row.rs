//! `bead compare` of a recording of several beads: all of them and one simulation, side by side.

use crate::cli::commands::compare_arguments::Arguments;
use crate::cli::commands::compared::{
    draw, echoes_left_out, figures, made, no_strike, publish, scenario, set_velocity, shown,
};
use crate::cli::commands::prelude::*;
use crate::cli::provenance::{self, name_of};
use bead_compare::row::{self, BeadRow, ComparedRow, PlacedBead, RowBead, RowChain, RowComparison, among};
use bead_compare::sensed::unlike_the_reduced_chain;
use bead_compare::velocity::FittedVelocity;
use bead_compare::verdict::other_length;

/// The result, as in the JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct RowReport<'a> {
    striker_velocity: Option<FittedVelocity>,
    #[serde(flatten)]
    told: &'a RowComparison,
}

pub(super) fn run(received: &Recording, arguments: &Arguments, page: Option<Target>) -> Result<(), Failure> {
    let figures = figures(arguments, ["row.svg", "row-details.svg"])?;
    let given = scenario(arguments.scenario.as_deref(), received)?;
    let (scenario, text) = (given.scenario.clone(), &given.text);
    let progress = output::spinner(format!("simulating {} beads", scenario.chain.beads));
    let mut chain = RowChain::of(scenario)?;
    let (places, mut notes) = among(received, &chain, Some(text));
    if places.is_empty() {
        let (path, why) = (received.path.display(), notes.join("; "));
        bail!(Input, "{path}: none of its beads belongs to this scenario: {why}");
    }
    let mut fitted = None;
    if arguments.velocity.is_some() {
        let mut scenario = chain.scenario.clone();
        let beads = places.iter().map(|place| (place.bead, &place.received));
        fitted = set_velocity(&mut scenario, arguments.velocity, beads)?;
        chain = RowChain::of(scenario)?;
    }
    progress.set_message(format!("comparing {} beads", places.len()));
    let row = BeadRow::read(received, &places, &chain, fitted.as_ref())?;
    progress.finish_and_clear();
    if row.strikes.is_empty() {
        return Err(no_strike(received));
    }
    notes.extend(echoed(&row));
    let told = row::compare(&row, &chain, notes)?;
    let warnings = |place: &PlacedBead| unlike_the_reduced_chain(&chain.solution, place.bead).notes;
    let mut warnings: Vec<_> = places.iter().flat_map(warnings).collect();
    warnings.sort();
    // All beads share a load, so they repeat its warning.
    warnings.dedup();
    warnings.extend(length(&row, &chain));
    for note in warnings.iter().chain(&told.notes) {
        note!("{note}");
    }
    let compared = ComparedRow {
        recording: &name_of(&received.path),
        row: &row,
        chain: &chain,
        compared: &told,
        velocity: fitted.as_ref().map(shown),
        made: &made(page.as_ref(), received, provenance::scenario(text))?,
        scenario: text,
    };
    if let Some(figures) = figures {
        draw(&figures, row::charts(&row, &chain, &told))?;
    }
    let printed = RowReport {
        striker_velocity: fitted,
        told: &told,
    };
    publish(arguments.format, page.as_ref(), &compared.report(), &printed)?;
    given.end(told.failure.clone())
}

/// A warning where the scenario's duration is not that of the windows: of the first bead, and for how many it
/// holds.
fn length(row: &BeadRow, chain: &RowChain) -> Option<String> {
    let of = |member: &RowBead| {
        let RowBead { bead, window, .. } = member;
        other_length(&chain.scenario, &chain.solution, &member.chain, *bead, (*window)?)
    };
    let mut notes = row.members.iter().filter_map(of);
    let first = notes.next()?;
    Some(match notes.count() {
        0 => first,
        more => format!("{first} (beads concerned: {})", more + 1),
    })
}

fn echoed(row: &BeadRow) -> Option<String> {
    let with_echoes = row.members.iter().filter(|member| member.echoes > 0);
    let echoes = with_echoes.map(|member| format!("{} of bead {}", member.echoes, member.bead));
    let which = Vec::from_iter(echoes);
    (!which.is_empty()).then(|| echoes_left_out(&which.join(", ")))
}
