//! Commands, printed before they run.
//!
//! # Design
//! What is printed is what runs. A newcomer learns the commands by watching, and can repeat the one that
//! failed. Commands run in the root of the workspace, whatever directory `cargo xtask` was called from.

use std::ffi::OsStr;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// Why the run ends early, and with which exit status.
#[derive(Debug)]
pub(crate) struct Stop {
    pub(crate) message: String,
    pub(crate) status: u8,
}

/// The exit status for what is missing on this machine.
pub(crate) const MISSING: u8 = 3;

impl Stop {
    pub(crate) fn failed(message: impl Into<String>) -> Self {
        let message = message.into();
        Stop { message, status: 1 }
    }

    pub(crate) fn missing(message: impl Into<String>) -> Self {
        let (message, status) = (message.into(), MISSING);
        Stop { message, status }
    }
}

/// One command as a person would type it.
#[derive(Debug, Clone, Default)]
pub(crate) struct Line {
    words: Vec<String>,
    env: Vec<(String, String)>,
}

impl Line {
    /// A command whose words hold no spaces; [`Line::arg`] adds one that may.
    pub(crate) fn new(words: &str) -> Self {
        Line::default().words(words)
    }

    /// A command that starts with a path.
    pub(crate) fn program(path: impl AsRef<OsStr>) -> Self {
        Line::default().arg(path)
    }

    /// Adds words that hold no spaces.
    pub(crate) fn words(mut self, words: &str) -> Self {
        self.words.extend(words.split_whitespace().map(str::to_owned));
        self
    }

    pub(crate) fn arg(mut self, word: impl AsRef<OsStr>) -> Self {
        self.words.push(word.as_ref().to_string_lossy().into_owned());
        self
    }

    pub(crate) fn env(mut self, name: &str, value: &str) -> Self {
        self.env.push((name.to_owned(), value.to_owned()));
        self
    }

    /// The command, ready to run.
    pub(crate) fn command(&self) -> Command {
        let mut command = Command::new(&self.words[0]);
        command
            .args(&self.words[1..])
            .envs(self.env.iter().map(|(name, value)| (name, value)));
        command
    }
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let env = self.env.iter();
        let env = env.map(|(name, value)| format!("{name}={}", quoted(value)));
        let words = self.words.iter().map(|word| quoted(word));
        f.write_str(&env.chain(words).collect::<Vec<_>>().join(" "))
    }
}

/// A word as a shell would need it.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    match !word.is_empty() && word.chars().all(plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}

/// The steps of one run of xtask, on one clock.
#[derive(Debug)]
pub(crate) struct Steps {
    /// The root of the workspace, in which they run.
    pub(crate) root: PathBuf,
    /// The directory that they build into.
    pub(crate) target: PathBuf,
    start: Instant,
}

impl Steps {
    /// The steps of the workspace that this program belongs to.
    pub(crate) fn start() -> Result<Self, Stop> {
        let manifest = Path::new(env!("CARGO_MANIFEST_DIR"));
        let root = manifest.ancestors().nth(2).unwrap_or(manifest).to_owned();
        // Cargo has put this program into <target>/release: that honours CARGO_TARGET_DIR and cargo's
        // configuration.
        let program =
            std::env::current_exe().map_err(|error| Stop::failed(format!("where is xtask? {error}")))?;
        let target = program.ancestors().nth(2).unwrap_or(&root).to_owned();
        let start = Instant::now();
        Ok(Steps { root, target, start })
    }

    /// A path below the target directory, written relative to the root where it can be.
    pub(crate) fn built(&self, path: &str) -> PathBuf {
        let full = self.target.join(path);
        full.strip_prefix(&self.root).map(Path::to_owned).unwrap_or(full)
    }

    /// Says what comes next.
    pub(crate) fn announce(&self, title: &str) {
        eprintln!("[{:>7}] {title}", clock(self.start.elapsed()));
    }

    /// Announces and runs one command, and passes on its output.
    ///
    /// # Errors
    /// The command cannot be started or ends with another status than 0. The status of a command other than
    /// cargo is passed on: `cargo xtask demo` ends with the status of the `bead` command that failed.
    pub(crate) fn run(&self, title: &str, line: &Line) -> Result<(), Stop> {
        self.run_into(title, line, Stdio::inherit())
    }

    /// As [`Steps::run`], without the command's standard output.
    ///
    /// # Errors
    /// As [`Steps::run`].
    pub(crate) fn run_quietly(&self, title: &str, line: &Line) -> Result<(), Stop> {
        self.run_into(title, line, Stdio::null())
    }

    fn run_into(&self, title: &str, line: &Line, result: Stdio) -> Result<(), Stop> {
        let mut command = self.command(title, line);
        let status = command.stdout(result).status();
        self.ended(title, line, status)
    }

    /// As [`Steps::run`]; gives what the command prints on standard output.
    ///
    /// # Errors
    /// As [`Steps::run`].
    pub(crate) fn read(&self, title: &str, line: &Line) -> Result<String, Stop> {
        let output = self.command(title, line).stderr(Stdio::inherit()).output();
        let (status, text) = match output {
            Ok(output) => (Ok(output.status), output.stdout),
            Err(error) => (Err(error), Vec::new()),
        };
        self.ended(title, line, status)?;
        Ok(String::from_utf8_lossy(&text).into_owned())
    }

    /// Announces and runs two commands at a time, since one alone leaves a core idle towards its end. What
    /// the second one says is kept, and told only if it fails.
    ///
    /// # Errors
    /// As [`Steps::run`], of the first one that fails.
    pub(crate) fn run_both(&self, first: (&str, &Line), second: (&str, &Line)) -> Result<(), Stop> {
        let mut beside = self.command(second.0, second.1);
        std::thread::scope(|scope| {
            let beside = scope.spawn(move || beside.output());
            let run = self.run(first.0, first.1);
            let output = beside
                .join()
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            run?;
            let status = output.map(|output| {
                if !output.status.success() {
                    eprint!("{}", String::from_utf8_lossy(&output.stderr));
                }
                output.status
            });
            self.ended(second.0, second.1, status)
        })
    }

    /// A command in the root of the workspace, which it announces.
    fn command(&self, title: &str, line: &Line) -> Command {
        self.announce(title);
        eprintln!("          $ {line}");
        let mut command = line.command();
        command.current_dir(&self.root);
        if std::env::var_os("CARGO_TARGET_DIR").is_some() {
            // It may be relative to where `cargo xtask` was called.
            command.env("CARGO_TARGET_DIR", &self.target);
        }
        command
    }

    /// Whether a command has ended well.
    fn ended(&self, title: &str, line: &Line, status: io::Result<ExitStatus>) -> Result<(), Stop> {
        let (root, program) = (self.root.display(), &line.words[0]);
        let repeat = format!("To repeat this step alone, in {root}:\n    {line}");
        let cannot = |error| format!("\"{title}\" could not start `{program}`: {error}.\n{repeat}");
        let status = status.map_err(|error| Stop::missing(cannot(error)))?;
        if status.success() {
            return Ok(());
        }
        let code = match status.code() {
            Some(code) if program != "cargo" => u8::try_from(code).unwrap_or(1),
            _ => 1,
        };
        Err(Stop {
            message: format!("\"{title}\" failed ({status}). {repeat}"),
            status: code,
        })
    }

    /// The time since the first step.
    pub(crate) fn elapsed(&self) -> String {
        clock(self.start.elapsed())
    }
}

fn clock(time: Duration) -> String {
    let seconds = time.as_secs();
    match seconds {
        0..60 => format!("{:.1} s", time.as_secs_f64()),
        _ => format!("{}:{:02}", seconds / 60, seconds % 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_printed_command_can_be_pasted_into_a_shell() {
        let line = Line::new("echo -n")
            .env("FLAGS", "-D warnings")
            .arg("it's a path")
            .arg("");
        assert_eq!(
            line.to_string(),
            r"FLAGS='-D warnings' echo -n 'it'\''s a path' ''"
        );
        let shell = Command::new("sh")
            .arg("-c")
            .arg(line.to_string())
            .output()
            .unwrap();
        assert_eq!(String::from_utf8(shell.stdout).unwrap(), "it's a path ");
    }

    #[test]
    fn the_status_of_a_failed_command_is_passed_on_but_cargos_is_one() {
        let steps = Steps::start().unwrap();
        let stop = steps
            .run("says no", &Line::new("sh -c").arg("exit 2"))
            .unwrap_err();
        assert_eq!(stop.status, 2);
        assert!(stop.message.contains("sh -c 'exit 2'"), "{}", stop.message);
        let stop = steps
            .run("no such subcommand", &Line::new("cargo --no-such-option"))
            .unwrap_err();
        assert_eq!(stop.status, 1);
        let stop = steps
            .run("no such program", &Line::new("no-such-program-here"))
            .unwrap_err();
        assert_eq!(stop.status, MISSING);
    }

    #[test]
    fn what_a_command_prints_can_be_read() {
        let steps = Steps::start().unwrap();
        assert_eq!(steps.read("says", &Line::new("echo a b")).unwrap(), "a b\n");
        assert!(steps.read("fails", &Line::new("sh -c false")).is_err());
    }

    #[test]
    fn of_two_commands_at_a_time_the_one_that_fails_is_named() {
        let steps = Steps::start().unwrap();
        let [good, bad] = ["sh -c true", "sh -c false"].map(Line::new);
        assert!(steps.run_both(("good", &good), ("good too", &good)).is_ok());
        for (first, second) in [(&good, &bad), (&bad, &good)] {
            let stop = steps.run_both(("one", first), ("other", second)).unwrap_err();
            assert!(stop.message.contains("sh -c false"), "{}", stop.message);
        }
    }

    #[test]
    fn the_clock_reads_seconds_then_minutes() {
        assert_eq!(clock(Duration::from_millis(59_900)), "59.9 s");
        assert_eq!(clock(Duration::from_secs(605)), "10:05");
    }
}
