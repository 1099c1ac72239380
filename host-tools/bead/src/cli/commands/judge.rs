//! `bead judge`: strikes against limits of one's own.

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use crate::cli::commands::prelude::*;
use crate::cli::commands::settings_file;
use crate::cli::note_options::Author;
use crate::cli::provenance::{command, made_at, made_by, sha256_of};
use crate::cli::recordings::{check_notable, open_all};
use bead_compare::report::Fact;
use bead_limits::file::Limits;
use bead_limits::judge::judge;
use bead_limits::judged::JudgedRecording;
use bead_limits::junit;
use bead_limits::report::{report, verdict};
use bead_limits::rule::Outcome;
use bead_limits::template::TEMPLATE;
use bead_limits::words::{sentence, subject};
use bead_recording::file::{Note, RecordingError, add_notes};

const AFTER_HELP: &str = "\
A limit is on the absorbed energy, peak force, peak acceleration, A over B, drift, the shock response spectrum, or the \
share that a row absorbs. Every strike of every bead is judged by it, and the worst strike is shown. The rule uses the \
expanded uncertainty U (JCGM 106): simple acceptance, guarded acceptance or guarded rejection. A limit is not decided if \
its value is absent, or if its rule needs a U that nobody stated: one line says why and what to do next, and the other \
limits are still judged.

Exit status 0 if every limit is kept, 1 if one is broken or not decided.

--note writes the verdict into each recording, where `bead list --verdict fail` finds it.

Examples:
  bead judge --template limits.toml
  bead judge run/bead-8.mcap --limits limits.toml
  bead judge monday/*.mcap --limits limits.toml --report monday.html
  bead judge run/chain.mcap --limits limits.toml --junit junit.xml
  bead judge run/bead-8.mcap --limits limits.toml --uncertainty bead.toml --note";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// Recordings made by `bead record` or `bead emulate`.
    #[arg(value_name = "F.mcap", required_unless_present = "template")]
    recordings: Vec<PathBuf>,
    /// The limits, a TOML file.
    #[arg(long, value_name = "L.toml", required_unless_present = "template")]
    limits: Option<PathBuf>,
    /// Only write a file of limits that explains each of its keys; - for standard output.
    #[arg(long, value_name = "L.toml", conflicts_with_all = ["recordings", "limits"], num_args = 0..=1, default_missing_value = "-")]
    template: Option<PathBuf>,
    /// Take the uncertainties that these settings state in place of those in the recording.
    #[arg(long, value_name = "F.toml|F.settings")]
    uncertainty: Option<PathBuf>,
    /// Write the result as an HTML page with pictures.
    #[arg(long, value_name = "F.html")]
    report: Option<PathBuf>,
    /// Write the result as JUnit XML, for CI.
    #[arg(long, value_name = "F.xml")]
    junit: Option<PathBuf>,
    /// Write the verdict as a note into each recording.
    #[arg(long)]
    note: bool,
    #[command(flatten)]
    author: Author,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Format of the result.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// The result as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct JudgeReport {
    /// Name of the limits.
    title: String,
    /// The worst outcome of all.
    outcome: Outcome,
    /// The first limit that is broken or not decided, in a sentence.
    failure: Option<String>,
    /// Decision rules of the limits, in words.
    rules: Vec<&'static str>,
    /// The recordings, in the order in which they were named.
    recordings: Vec<JudgedRecording>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    if let Some(template) = &arguments.template {
        let target = place::target(template, FileKind::Scenario, &[], arguments.overwrite)?;
        return Ok(target.write_bytes(TEMPLATE)?);
    }
    let Some(path) = &arguments.limits else {
        bail!(
            Input,
            "--limits L.toml is missing; `bead judge --template L.toml` makes one"
        );
    };
    let inputs: Vec<&Path> = arguments
        .recordings
        .iter()
        .chain([path])
        .chain(&arguments.uncertainty)
        .map(PathBuf::as_path)
        .collect();
    place::apart(arguments.report.as_deref(), arguments.junit.as_deref())?;
    let overwrite = arguments.overwrite;
    let page = overwrite.optional(arguments.report.as_deref(), FileKind::Page, &inputs)?;
    let junit = overwrite.optional(arguments.junit.as_deref(), FileKind::Xml, &inputs)?;
    let text = hertz_chain::read_text(
        path,
        "a file of limits in TOML; `bead judge --template L.toml` makes one",
    )?;
    let limits = Limits::parse(&text, &path.display().to_string())?;
    let stated = settings_file::uncertainty(arguments.uncertainty.as_deref())?;
    let recordings = open_all(&arguments.recordings)?;
    if arguments.note {
        check_notable(&recordings)?;
    }
    let judged = judged(&recordings, &limits, stated.as_ref())?;
    if let Some(junit) = junit {
        let document = junit::document(&limits.title, &judged).context("cannot write the result as XML")?;
        junit.write_bytes(document)?;
    }
    let failure = verdict(&judged).err();
    let mut facts = Vec::new();
    if page.is_some() {
        facts = how(arguments, path)?;
    }
    let shown = report(&limits, &judged, facts);
    if let Some(page) = page {
        page.write_bytes(shown.page()?)?;
    }
    let bad = judged.iter().flat_map(|one| &one.limits);
    let lines = bad
        .filter(|limit| limit.outcome != Outcome::Pass)
        .map(|limit| format!("{}: {}", subject(limit), sentence(limit)));
    // The failure, printed last, names the gravest limit.
    let is_last = |line: &String| failure.as_ref().is_some_and(|failure| failure.contains(line));
    for line in lines.filter(|line| !is_last(line)) {
        note!("{line}");
    }
    if arguments.note {
        note_verdicts(arguments, &limits, &judged)?;
    }
    let mut rules: Vec<&str> = limits.limits.iter().map(|limit| limit.rule.text()).collect();
    rules.sort_unstable();
    rules.dedup();
    let result = JudgeReport {
        title: limits.title.clone(),
        outcome: judged
            .iter()
            .map(|one| one.outcome)
            .max()
            .unwrap_or(Outcome::Undecided),
        failure: failure.clone(),
        rules,
        recordings: judged,
    };
    output::print(arguments.format, &result, || shown.terminal())?;
    match failure {
        None => Ok(()),
        Some(why) => bail!(Verdict, "{why}"),
    }
}

/// Holds each recording against the limits, as many at once as there are cores.
fn judged(
    recordings: &[Recording],
    limits: &Limits,
    stated: Option<&bead_model::design::Uncertainty>,
) -> Result<Vec<JudgedRecording>, Failure> {
    let bar = output::progress(recordings.len() as u64);
    bar.set_message("judging");
    let done = AtomicUsize::new(0);
    let judged: Vec<Result<JudgedRecording, RecordingError>> = recordings
        .par_iter()
        .map(|recording| {
            let judged = judge(recording, limits, stated);
            bar.set_position(done.fetch_add(1, Ordering::Relaxed) as u64 + 1);
            judged
        })
        .collect();
    bar.finish_and_clear();
    Ok(judged.into_iter().collect::<Result<_, _>>()?)
}

/// Notes the verdict, and by which limits, in each recording.
fn note_verdicts(arguments: &Arguments, limits: &Limits, judged: &[JudgedRecording]) -> Result<(), Failure> {
    let file = arguments
        .limits
        .as_deref()
        .and_then(Path::file_name)
        .unwrap_or_default();
    let name = format!("{} {}", file.to_string_lossy(), limits.title);
    for (path, one) in arguments.recordings.iter().zip(judged) {
        let notes = [
            format!("verdict={}", one.outcome.name()),
            format!("limits={}", name.trim()),
        ];
        let notes = notes
            .iter()
            .map(|text| Note::parse(text))
            .collect::<Result<_, _>>();
        add_notes(path, &arguments.author.sign(notes.map_err(Failure::input)?))?;
    }
    Ok(())
}

/// The origin of the page.
fn how(arguments: &Arguments, limits: &Path) -> Result<Vec<Fact>, Failure> {
    let mut facts = vec![("command", command()), made_by(), made_at()];
    facts.push(("limits, SHA-256", sha256_of(limits)?));
    for recording in &arguments.recordings {
        facts.push((
            "recording, SHA-256",
            format!("{} {}", recording.display(), sha256_of(recording)?),
        ));
    }
    facts.push(match &arguments.uncertainty {
        Some(file) => ("uncertainties, SHA-256", sha256_of(file)?),
        None => (
            "uncertainties",
            "as the beads sent them, from their settings".to_owned(),
        ),
    });
    Ok(facts)
}
