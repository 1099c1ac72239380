//! `bead compare`: device, replay, f64 from the same samples and the full chain, side by side.

use std::sync::Arc;

pub(crate) use crate::cli::commands::compare_arguments::Arguments;
use crate::cli::commands::compared::{
    draw, echoes_left_out, figures, made, no_strike, publish, scenario, set_velocity, shown,
};
use crate::cli::commands::prelude::*;
use crate::cli::commands::{compare_reference, compare_row};
use crate::cli::provenance::{self, name_of};
use bead_compare::agreement::DECISION_RULE;
use bead_compare::bead::ComparedBead;
use bead_compare::emulated::RunTruth;
use bead_compare::sensed::{only_host, simulate_with_ring_down, unlike_the_reduced_chain};
use bead_compare::spread::Spread;
use bead_compare::strike::{FullChain, StrikeComparison};
use bead_compare::strike_report::ComparedStrikes;
use bead_compare::velocity::FittedVelocity;
use bead_compare::verdict::{Echoes, other_length};
use bead_console::beads::BeadNumbers;
use bead_recording::file::{Part, RecordedBead};

/// The result as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct CompareReport<'a> {
    bead: usize,
    striker_velocity: Option<FittedVelocity>,
    strikes: &'a Vec<StrikeComparison>,
    strikes_left_out: usize,
    /// Deviations of estimates A and B.
    spread: &'a [Spread; 2],
    frames_lost: u64,
    frames_corrupt: u64,
    overruns: u64,
    instructions_per_sample: Option<f64>,
    pass: bool,
    failure: Option<&'a str>,
    /// The part of the recording that is missing.
    incomplete: Option<&'a str>,
    /// The rule by which a goal is missed.
    decision_rule: &'static str,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    if arguments.reference.is_none() {
        arguments.columns.without("--reference")?;
    }
    let (page, overwrite) = (arguments.report.as_deref(), arguments.overwrite);
    let page = overwrite.optional(page, FileKind::Page, &arguments.inputs())?;
    let mut received = Recording::open_named(&arguments.recording)?;
    let of_several = received.beads.len() > 1;
    let (only, row) = match &arguments.bead {
        Some(BeadNumbers::One(bead)) => (Some(*bead), false),
        Some(BeadNumbers::Several(beads)) => {
            keep(&mut received, beads)?;
            (None, true)
        }
        Some(BeadNumbers::All) | None => (None, of_several),
    };
    if row && arguments.reference.is_none() {
        return compare_row::run(&received, arguments, page);
    }
    if row {
        bail!(
            Input,
            "{} has several beads; say with --bead which one to compare with the reference",
            received.path.display()
        );
    }
    let figures = figures(arguments, ["strike.svg", "residuals.svg"])?;
    let (received, place) = of_one_bead(received, only)?;
    match &arguments.reference {
        Some(reference) => compare_reference::run(arguments, &received, only.or(place), reference, page),
        None => compare(arguments, &received, (only, place), page, figures),
    }
}

/// Compares the strikes of one bead with the simulation. `asked` is the bead's number on the command line,
/// `place` the one in the recording.
fn compare(
    arguments: &Arguments,
    received: &Recording,
    (asked, place): (Option<usize>, Option<usize>),
    page: Option<Target>,
    figures: Option<Vec<Target>>,
) -> Result<(), Failure> {
    let given = scenario(arguments.scenario.as_deref(), received)?;
    let mut scenario = given.scenario.clone();
    let truth: Option<RunTruth> = received.json(Part::Truth)?;
    let bead = asked.or(truth.as_ref().map(|truth| truth.bead)).or(place);
    let bead = bead.map_or_else(|| only_host(&scenario), Ok)?;
    let echoes = Echoes::of(&scenario, truth);
    let progress = output::spinner(format!("simulating {} beads", scenario.chain.beads));
    let fitted = set_velocity(&mut scenario, arguments.velocity, [(bead, received)])?;
    let solution = Arc::new(simulate_with_ring_down(&scenario)?);
    let chain = FullChain::of(&scenario, &solution, bead)?;
    for note in unlike_the_reduced_chain(&solution, bead).notes {
        progress.suspend(|| note!("{note}"));
    }
    let mut count = 0;
    let compared = ComparedBead::read(received, &chain, echoes, fitted.as_ref(), |_, _| {
        count += 1;
        progress.set_message(format!(
            "compared {}",
            bead_compare::report::count(count, "strike")
        ));
    })?;
    progress.finish_and_clear();
    if compared.strikes.is_empty() {
        return Err(no_strike(received));
    }
    let window = compared.settings.map(|settings| settings.window);
    let length = window.and_then(|window| other_length(&scenario, &solution, &chain, bead, window));
    let left = (compared.echoes > 0).then(|| echoes_left_out(&compared.echoes.to_string()));
    for note in length.into_iter().chain(left) {
        note!("{note}");
    }
    let compared_with = provenance::scenario(&given.text);
    let report = ComparedStrikes {
        title: &scenario.title,
        recording: &name_of(&received.path),
        bead,
        compared: &compared,
        velocity: fitted.as_ref().map(shown),
        made: &made(page.as_ref(), received, compared_with)?,
        scenario: &given.text,
    };
    if let Some(figures) = figures {
        match compared.strikes.iter().find_map(StrikeComparison::charts) {
            Some(charts) => draw(&figures, charts)?,
            // Strikes without charts have no replay either, so the comparison fails.
            None => {
                note!(
                    "no strike came with its settings and all of its samples: --figures has nothing to draw"
                );
            }
        }
    }
    let soundness = &compared.soundness;
    let result = CompareReport {
        bead,
        striker_velocity: fitted,
        strikes: &compared.strikes,
        strikes_left_out: compared.count - compared.strikes.len(),
        spread: &compared.spread,
        frames_lost: soundness.lost,
        frames_corrupt: soundness.corrupt,
        overruns: soundness.overruns,
        instructions_per_sample: soundness.instructions.map(|(total, _)| total),
        pass: compared.failure.is_none(),
        failure: compared.failure.as_deref(),
        incomplete: soundness.incomplete.as_deref(),
        decision_rule: DECISION_RULE,
    };
    publish(arguments.format, page.as_ref(), &report.report(), &result)?;
    given.end(compared.failure.clone())
}

/// Keeps only the beads with these numbers.
fn keep(received: &mut Recording, beads: &[usize]) -> Result<(), Failure> {
    let of_recording = &mut received.beads;
    let places: Vec<usize> = of_recording.iter().map(RecordedBead::place).collect();
    if let Some(missing) = beads.iter().find(|bead| !places.contains(bead)) {
        let path = received.path.display();
        bail!(
            Input,
            "{path} has no bead {missing}; the beads in it are {places:?}"
        );
    }
    of_recording.retain(|bead| beads.contains(&bead.place()));
    Ok(())
}

/// The frames of the one bead that is compared, and its place if the recording knows it. Each bead of a row
/// has its own truth.
fn of_one_bead(received: Recording, asked: Option<usize>) -> Result<(Recording, Option<usize>), Failure> {
    let beads = &received.beads;
    let places: Vec<usize> = beads.iter().map(RecordedBead::place).collect();
    if places.is_empty() {
        return Ok((received, None));
    }
    let asked_for = |place: &usize| asked.is_none_or(|asked| asked == *place);
    let Some(at) = places.iter().position(asked_for) else {
        bail!(
            Input,
            "{} has the beads {places:?}; give --bead one of them, or leave it out to compare them all",
            received.path.display()
        );
    };
    Ok((received.of(&beads[at]), Some(places[at])))
}
