//! `bead compare --reference`: a strike against the record of another instrument.

use crate::cli::commands::compare_arguments::Arguments;
use crate::cli::commands::compared::{made, publish};
use crate::cli::commands::prelude::*;
use crate::cli::provenance::{name_of, sha256_of};
use bead_compare::emulated::RunTruth;
use bead_compare::reference::{AgainstReference, compare};
use bead_compare::reference_report::ComparedReference;
use bead_compare::replay::replay;
use bead_recording::file::Part;
use bead_tables::printable::count;

/// Correlation below which a note asks whether it is the same strike.
const LITTLE: f64 = 0.5;

/// The result as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct ReferenceReport<'a> {
    bead: Option<usize>,
    strike: u32,
    sample_index: u64,
    reference: ReferenceFile,
    against: &'a AgainstReference,
    replay_identical: bool,
    pass: bool,
    failure: Option<&'a str>,
}

/// The file of the other instrument.
#[derive(Serialize, JsonSchema)]
struct ReferenceFile {
    file: String,
    sha256: String,
    /// True if this file was the stimulus of the recorded run; null if the recording does not say.
    was_played: Option<bool>,
}

/// Compares a strike with `reference`. `bead` is its bead, if that is named.
pub(super) fn run(
    arguments: &Arguments,
    received: &Recording,
    bead: Option<usize>,
    reference: &Path,
    page: Option<Target>,
) -> Result<(), Failure> {
    let truth: Option<RunTruth> = received.json(Part::Truth)?;
    let bead = bead.or(truth.as_ref().map(|truth| truth.bead));
    let (path, of_reference) = (received.path.display(), reference.display());
    let progress = output::spinner(format!("reading {of_reference}"));
    let waveform = arguments.columns.read(reference, bead)?;

    let mut strikes = received.strikes()?;
    let is_wanted = |(number, strike): &(usize, RecordedStrike)| match arguments.strike {
        Some(wanted) => *number == wanted,
        None => strike.missing() == 0,
    };
    let Some((_, strike)) = strikes.by_ref().enumerate().find(is_wanted) else {
        match (received.strikes()?.count(), arguments.strike) {
            (0, _) => return Err(received.no_strike(strikes.frames()).into()),
            (all, Some(wanted)) => bail!(
                Input,
                "--strike {wanted}: {path} has {}, counted from 0",
                count(all as u64, "strike")
            ),
            (_, None) => bail!(Input, "{path} has no strike with all of its samples"),
        }
    };
    let others = arguments.strike.is_none() && strikes.next().is_some();
    let against = compare(&strike, &waveform).map_err(|why| failure!(Input, "{of_reference}: {why}"))?;
    progress.finish_and_clear();
    for remark in &waveform.remarks {
        note!("{of_reference}: {remark}");
    }
    if others {
        note!("{path} has several strikes; the first whole one is compared; --strike chooses another");
    }
    let mut quantities = [&against.force, &against.acceleration].into_iter().flatten();
    if quantities.any(|aligned| aligned.correlation.abs() < LITTLE) {
        note!("the two have little in common: is it the same strike? try --strike and --read strike=N");
    }

    let failure = replay(&strike).failure();
    let sha256 = sha256_of(reference)?;
    let stimulus = truth.and_then(|truth| truth.stimulus);
    let was_played = stimulus.map(|file| file.sha256 == sha256);
    let mut made = made(page.as_ref(), received, ("reference, SHA-256", sha256.clone()))?;
    if page.is_some() && was_played == Some(true) {
        made.push(("reference", "the waveform that was played to the bead".to_owned()));
    }
    let compared = ComparedReference {
        recording: &name_of(&received.path),
        reference: &name_of(reference),
        strike: strike.said.strike,
        against: &against,
        failure: failure.as_deref(),
        made: &made,
    };
    let result = ReferenceReport {
        bead,
        strike: strike.said.strike,
        sample_index: strike.said.trigger_index,
        reference: ReferenceFile {
            file: of_reference.to_string(),
            sha256,
            was_played,
        },
        against: &against,
        replay_identical: failure.is_none(),
        pass: failure.is_none(),
        failure: failure.as_deref(),
    };
    publish(arguments.format, page.as_ref(), &compared.report(), &result)?;
    failure.map_or(Ok(()), |what| Err(failure!(Verdict, "{what}")))
}
