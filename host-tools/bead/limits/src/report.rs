//! The result for people: a table for the terminal, and a page with pictures.

use bead_compare::report::{Chapter, DASH, Fact, Grid, GridCell, Passage, Report, count};
use bead_tables::printable::one_line;

use crate::file::Limits;
use crate::judged::{JudgedLimit, JudgedRecording};
use crate::pictures::charts;
use crate::rule::Outcome;
use crate::words::{Shown, sentence, subject};

/// The report of recordings against limits. `facts` say how it came about.
pub fn report(limits: &Limits, recordings: &[JudgedRecording], facts: Vec<Fact>) -> Report {
    let all = || recordings.iter().flat_map(|recording| &recording.limits);
    let of = |outcome: Outcome| all().filter(|limit| limit.outcome == outcome).count() as u64;
    let (passed, undecided, failed) = (of(Outcome::Pass), of(Outcome::Undecided), of(Outcome::Fail));
    let verdict = verdict(recordings).map_or_else(Err, |()| Ok("Every limit is kept"));
    let tiles = [(passed, "kept"), (failed, "broken"), (undecided, "not decided")];
    let tiles = tiles.map(|(number, name)| (number.to_string(), name.to_owned()));
    let mut rules: Vec<&str> = limits.limits.iter().map(|limit| limit.rule.text()).collect();
    rules.sort_unstable();
    rules.dedup();
    let mut sections: Vec<Chapter> = recordings
        .iter()
        .map(|recording| section(recording, recordings.len() > 1))
        .collect();
    let rules = rules
        .into_iter()
        .map(|rule| Passage::Line(format!("Rule: {rule}.")));
    sections.push(
        Chapter::new("Decision rule").with(rules).text(
            "U is the expanded uncertainty (95 %): twice the standard uncertainty, or for a drift Student's t times the \
             standard error of the line. Every strike is compared with each limit, and the worst is shown.",
        ),
    );
    sections.push(Chapter::facts("How it was made", facts));
    let title = if limits.title.is_empty() {
        "Limits"
    } else {
        &limits.title
    };
    let names = match recordings {
        [one] => one_line(&one.recording).into_owned(),
        several => count(several.len() as u64, "recording"),
    };
    Report {
        above: names,
        title: one_line(title).into_owned(),
        verdict,
        tiles: tiles.into(),
        sections,
    }
}

/// Ok if every limit is kept, else the first that is broken, or that was not decided.
///
/// # Errors
/// The sentence about it, and the number of others.
pub fn verdict(recordings: &[JudgedRecording]) -> Result<(), String> {
    let all = || {
        recordings
            .iter()
            .flat_map(|one| one.limits.iter().map(move |limit| (one, limit)))
    };
    let worst = all()
        .map(|(_, limit)| limit.outcome)
        .max()
        .unwrap_or(Outcome::Undecided);
    if worst == Outcome::Pass {
        return Ok(());
    }
    let mut of_worst = all().filter(|(_, limit)| limit.outcome == worst);
    let Some((recording, limit)) = of_worst.next() else {
        return Err("there is nothing to judge; name a recording with strikes".to_owned());
    };
    let name = match recordings {
        [_] => String::new(),
        _ => format!("{}: ", one_line(&recording.recording)),
    };
    let more = match of_worst.count() {
        0 => String::new(),
        more => format!(" ({more} more)"),
    };
    Err(format!("{name}{}: {}{more}", subject(limit), sentence(limit)))
}

fn section(recording: &JudgedRecording, several: bool) -> Chapter {
    let rows = recording.limits.iter().map(row);
    let name = one_line(&recording.recording).into_owned();
    let mut grid = Grid::new(
        "limit | worst value | ± U | ~min | ~max | ~kept by | outcome",
        rows,
    );
    if several {
        grid = grid.group(name.clone());
    }
    let mut section = Chapter::new(name).table(grid);
    if let Some(what) = &recording.incomplete {
        section = section.with([Passage::Failure(format!("Incomplete: {what}"))]);
    }
    let reasons = recording
        .limits
        .iter()
        .filter(|limit| limit.outcome != Outcome::Pass);
    let reasons: Vec<String> = reasons
        .map(|limit| format!("{}: {}", subject(limit), sentence(limit)))
        .collect();
    if !reasons.is_empty() {
        section = section.with([Passage::List(reasons)]);
    }
    charts(recording).into_iter().fold(section, Chapter::chart)
}

fn row(limit: &JudgedLimit) -> Vec<GridCell> {
    let shown = Shown::of(limit);
    let known = |value: Option<f64>| value.map_or_else(|| DASH.to_owned(), |value| shown.number(value));
    let unit = shown.suffix();
    let at = limit
        .frequency_hz
        .map_or_else(String::new, |at| format!(" at {at:.0} Hz"));
    let judged = match limit.outcome {
        Outcome::Pass => Some(true),
        Outcome::Fail => Some(false),
        Outcome::Undecided => None,
    };
    vec![
        format!("{}{unit}{at}", subject(limit)).into(),
        known(limit.value).into(),
        known(limit.expanded).into(),
        known(limit.interval.min).into(),
        known(limit.interval.max).into(),
        format!(
            "{} of {}",
            limit.passed,
            limit.passed + limit.undecided + limit.failed
        )
        .into(),
        GridCell::judged(limit.outcome.name(), judged),
    ]
}
