//! `bead compare --reference`: a strike against the record of another instrument.

use std::path::Path;

use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::failure::Failure;
use crate::cli::output::{self, Format};
use crate::cli::provenance::{made, sha256_of};
use crate::cli::waveform_options::WaveformOptions;
use bead_compare::emulated::RunTruth;
use bead_compare::reference::{AgainstReference, compare};
use bead_compare::reference_report::ComparedReference;
use bead_compare::replay::replay;
use bead_recording::file::Part;
use bead_recording::received::Received;
use bead_tables::whole::Target;

/// A strike and its reference, and the places of the results.
pub(super) struct Request<'a> {
    pub(super) received: &'a Received,
    pub(super) reference: &'a Path,
    /// The bead, if it is named.
    pub(super) bead: Option<usize>,
    /// The strike, from 0 in the recording; the first that is whole, if it is not named.
    pub(super) strike: Option<usize>,
    pub(super) columns: &'a WaveformOptions,
    pub(super) report: Option<Target>,
    pub(super) format: Format,
}

/// Correlation below which a note asks whether it is the same strike.
const LITTLE: f64 = 0.5;

/// The result as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct Report<'a> {
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

pub(super) fn run(request: &Request<'_>) -> Result<(), Failure> {
    let Request {
        received, reference, ..
    } = request;
    let truth: Option<RunTruth> = received.json(Part::Truth)?;
    let bead = request.bead.or(truth.as_ref().map(|truth| truth.bead));
    let progress = output::spinner(format!("reading {}", reference.display()));
    let waveform = request.columns.read(reference, bead)?;

    let mut strikes = received.strikes()?;
    let wanted = |(number, strike): &(usize, _)| {
        let strike: &bead_recording::strikes::RecordedStrike = strike;
        request
            .strike
            .map_or(strike.missing() == 0, |wanted| *number == wanted)
    };
    let found = strikes.by_ref().enumerate().find(wanted);
    let Some((_, strike)) = found else {
        let all = received.strikes()?.count();
        return Err(match (all, request.strike) {
            (0, _) => received.no_strike(strikes.frames()).into(),
            (_, Some(wanted)) => Failure::input(format!(
                "--strike {wanted}: {} has {all} strikes, counted from 0",
                received.path.display()
            )),
            (_, None) => Failure::input(format!("{}: no strike of it is whole", received.path.display())),
        });
    };
    let others = request.strike.is_none() && strikes.next().is_some();
    let against = compare(&strike, &waveform)
        .map_err(|why| Failure::input(format!("{}: {why}", reference.display())))?;
    progress.finish_and_clear();
    for remark in &waveform.remarks {
        output::note(format_args!("{}: {remark}", reference.display()));
    }
    if others {
        output::note(format_args!(
            "{} has several strikes, and the first that is whole is compared; --strike chooses",
            received.path.display()
        ));
    }
    let quantities = [&against.force, &against.acceleration].into_iter().flatten();
    if quantities
        .into_iter()
        .any(|aligned| aligned.correlation.abs() < LITTLE)
    {
        output::note(format_args!(
            "the two have little in common: is it the same strike? --strike and --waveform-strike choose"
        ));
    }

    let differs = replay(&strike).first_difference;
    let failure = differs.map(|what| format!("replay differs: {what}"));
    let sha256 = sha256_of(reference)?;
    let played = truth
        .and_then(|truth| truth.stimulus)
        .map(|file| file.sha256 == sha256);
    let made = match &request.report {
        None => Vec::new(),
        Some(_) => {
            let mut made = made(&received.path, ("reference, SHA-256", sha256.clone()))?;
            if played == Some(true) {
                made.push(("reference", "the waveform that was played to the bead".to_owned()));
            }
            made
        }
    };
    let name = |path: &Path| {
        path.file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned()
    };
    let compared = ComparedReference {
        recording: &name(&received.path),
        reference: &name(reference),
        strike: strike.said.strike,
        against: &against,
        failure: failure.as_deref(),
        made: &made,
    };
    let shown = compared.report();
    if let Some(target) = &request.report {
        target.write_bytes(shown.page()?)?;
    }
    let result = Report {
        bead,
        strike: strike.said.strike,
        sample_index: strike.said.trigger_index,
        reference: ReferenceFile {
            file: reference.display().to_string(),
            sha256,
            was_played: played,
        },
        against: &against,
        replay_identical: failure.is_none(),
        pass: failure.is_none(),
        failure: failure.as_deref(),
    };
    output::print(request.format, &result, || shown.terminal())?;
    failure.map_or(Ok(()), |what| Err(Failure::Verdict(what)))
}
