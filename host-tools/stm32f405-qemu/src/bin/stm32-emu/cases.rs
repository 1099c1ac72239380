//! Runs the test cases of an image one by one, each from power-up, as `cargo test` shows them.

use std::time::Duration;

use stm32f405_qemu::{RunEnd, RunError, TestCase};

use super::arguments::Arguments;
use super::report::{self, Verdict};
use super::session::{self, Session};
use super::uart::Lines;

/// Limit of virtual time for a case without its own, s.
const LIMIT_S: u32 = 60;

/// Words that `cargo test` passes after the image.
#[derive(Debug, Default)]
struct Selection {
    filters: Vec<String>,
    skips: Vec<String>,
    exact: bool,
    list: bool,
    show: bool,
    ignored: bool,
    include_ignored: bool,
}

impl Selection {
    fn parse(words: &[String]) -> Result<Self, RunError> {
        let mut selection = Self::default();
        let mut words = words.iter();
        while let Some(word) = words.next() {
            match word.as_str() {
                "--list" => selection.list = true,
                "--exact" => selection.exact = true,
                "--nocapture" | "--no-capture" | "--show-output" => selection.show = true,
                "--ignored" => selection.ignored = true,
                "--include-ignored" => selection.include_ignored = true,
                // Cases always run one at a time, with output in the format pretty.
                "-q" | "--quiet" | "--test" => {}
                "--skip" | "--test-threads" | "--format" | "--color" | "-Z" => {
                    let missing = || RunError::Input(format!("{word} needs a word after it"));
                    let value = words.next().ok_or_else(missing)?;
                    if word == "--skip" {
                        selection.skips.push(value.clone());
                    }
                }
                word if word.starts_with("--test-threads=") || word.starts_with("--color=") => {}
                word if word.starts_with('-') => {
                    let known = "--list, --exact, --skip, --ignored, --include-ignored and --nocapture";
                    let what = format!("the test cases do not take {word}; they take names, {known}");
                    return Err(RunError::Input(what));
                }
                word => selection.filters.push(word.into()),
            }
        }
        Ok(selection)
    }

    fn selects(&self, case: &TestCase) -> bool {
        let fits = |filter: &String| {
            if self.exact {
                case.name == *filter
            } else {
                case.name.contains(filter.as_str())
            }
        };
        let wanted = self.filters.is_empty() || self.filters.iter().any(fits);
        wanted && !self.skips.iter().any(fits) && (!self.ignored || case.ignored)
    }
}

/// Runs the cases selected by the words.
///
/// # Errors
/// [`RunError`] if the words are wrong, or there is no run.
pub(crate) fn run(arguments: &Arguments, all: &[TestCase]) -> Result<Verdict, RunError> {
    let selection = Selection::parse(&arguments.words)?;
    let selected: Vec<_> = all.iter().filter(|case| selection.selects(case)).collect();
    if selection.list {
        for case in &selected {
            println!("{}: test", case.name);
        }
        println!("\n{} tests, 0 benchmarks", selected.len());
        return Ok(Verdict::passed());
    }
    println!("\nrunning {} tests", selected.len());
    let (mut done, mut ignored) = (Vec::new(), 0);
    for case in &selected {
        if case.ignored && !selection.ignored && !selection.include_ignored {
            println!("test {} ... ignored", case.name);
            ignored += 1;
            continue;
        }
        let (took, failed, said) = run_one(arguments, case, selection.show)?;
        let word = if failed.is_some() { "FAILED" } else { "ok" };
        println!("test {} ... {word}", case.name);
        done.push((case.name.clone(), took, failed, said));
    }
    let failed = done.iter().filter(|(_, _, failed, _)| failed.is_some());
    for (name, _, why, said) in failed.clone() {
        println!("\n---- {name} ----");
        said.iter().for_each(|line| println!("{line}"));
        println!("{}", why.as_deref().unwrap_or_default());
    }
    let (failures, filtered) = (failed.count(), all.len() - selected.len());
    let word = if failures > 0 { "FAILED" } else { "ok" };
    println!(
        "\ntest result: {word}. {} passed; {failures} failed; {ignored} ignored; 0 measured; {filtered} filtered out\n",
        done.len() - failures
    );
    if let Some(file) = &arguments.junit {
        let suite = arguments.elf.file_stem().unwrap_or_default().to_string_lossy();
        report::junit(
            file,
            &suite,
            done.into_iter()
                .map(|(name, took, failed, _)| (name, took, failed)),
        )?;
    }
    Ok(if failures > 0 {
        Verdict::test_cases_failed()
    } else {
        Verdict::passed()
    })
}

/// Runs a case. Returns its time, the reason for its failure, and its output.
fn run_one(
    arguments: &Arguments,
    case: &TestCase,
    show: bool,
) -> Result<(Duration, Option<String>, Vec<String>), RunError> {
    let mut run = arguments.run();
    run.semihosting = true;
    run.semihosting_arguments = vec!["run_addr".into(), case.address.to_string()];
    let mut lines = Lines::new(&arguments.uart, arguments.until.as_ref());
    lines.kept = (!show).then(Vec::new);
    let limit_s = case.timeout_s.unwrap_or(LIMIT_S);
    let arguments = arguments.with_time(Duration::from_secs(limit_s.into()));
    let session = session::run(run, &arguments, &mut lines)?;
    let failed = judge(&session, case, limit_s, &arguments);
    Ok((session.took, failed, lines.kept.unwrap_or_default()))
}

/// Reason for a case's failure; `None` if it passed.
fn judge(session: &Session, case: &TestCase, limit_s: u32, arguments: &Arguments) -> Option<String> {
    let verdict = report::verdict(session, arguments);
    let end = session.result.as_ref().ok().map(|outcome| &outcome.end);
    match end {
        Some(RunEnd::Exited(0)) if case.should_panic => Some("it should have panicked, but passed".into()),
        Some(RunEnd::Exited(0)) => verdict.why,
        Some(RunEnd::Exited(_) | RunEnd::Panicked) if case.should_panic => None,
        Some(RunEnd::Over) => Some(format!("it did not end within {limit_s} s of the image's time")),
        _ => Some(
            verdict
                .why
                .unwrap_or_else(|| "it did not end with SYS_EXIT".into()),
        ),
    }
}
