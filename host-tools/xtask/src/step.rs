//! Commands, printed before they run.
//!
//! # Design
//! What is printed is what runs. A newcomer learns the commands by watching, and can repeat the one that
//! failed. Commands run in the root of the workspace, whatever directory `cargo xtask` was called from.

use std::ffi::OsStr;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Reason to end the run early, and its exit status.
#[derive(Debug)]
pub(crate) struct Stop {
    pub(crate) message: String,
    pub(crate) status: u8,
}

/// The exit status for what is missing on this machine.
pub(crate) const MISSING: u8 = 3;
/// Exit status of a step that does not run, because one beside it has failed. A run never ends with it.
const STOPPED: u8 = 0;

impl Stop {
    fn new(message: impl Into<String>, status: u8) -> Self {
        let message = message.into();
        Stop { message, status }
    }

    pub(crate) fn failed(message: impl Into<String>) -> Self {
        Self::new(message, 1)
    }

    pub(crate) fn missing(message: impl Into<String>) -> Self {
        Self::new(message, MISSING)
    }
}

/// One command as a person would type it.
#[derive(Debug, Clone, Default)]
pub(crate) struct CommandLine {
    words: Vec<String>,
    env: Vec<(String, String)>,
    folder: Option<PathBuf>,
}

impl CommandLine {
    /// A command whose words hold no spaces; [`CommandLine::arg`] adds one that may.
    pub(crate) fn new(words: &str) -> Self {
        CommandLine::default().words(words)
    }

    /// A command that starts with a path.
    pub(crate) fn program(path: impl AsRef<OsStr>) -> Self {
        CommandLine::default().arg(path)
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

    /// Sets the folder to run in, instead of the root of the workspace.
    pub(crate) fn within(mut self, folder: impl Into<PathBuf>) -> Self {
        self.folder = Some(folder.into());
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

impl fmt::Display for CommandLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let env = self.env.iter();
        let env = env.map(|(name, value)| format!("{name}={}", quoted(value)));
        let words = self.words.iter().map(|word| quoted(word));
        if let Some(folder) = &self.folder {
            write!(f, "cd {} && ", quoted(&folder.to_string_lossy()))?;
        }
        f.write_str(&env.chain(words).collect::<Vec<_>>().join(" "))
    }
}

/// A word as a shell would need it.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

/// The steps of one run of xtask, on one clock.
#[derive(Debug, Clone)]
pub(crate) struct Steps {
    /// The root of the workspace, in which they run.
    pub(crate) root: PathBuf,
    /// The directory that they build into.
    pub(crate) target: PathBuf,
    start: Instant,
    /// True if other series run at the same time. The output of a command is then kept, and shown only if it
    /// fails.
    beside: bool,
    /// Set when a step has failed. No other step begins then.
    failed: Arc<AtomicBool>,
}

impl Steps {
    /// The steps of the workspace that this program belongs to.
    pub(crate) fn start() -> Result<Self, Stop> {
        let manifest = Path::new(env!("CARGO_MANIFEST_DIR"));
        let root = manifest.ancestors().nth(2).unwrap_or(manifest).to_owned();
        // Cargo has put this program into <target>/release: that honours CARGO_TARGET_DIR and cargo's
        // configuration.
        let program = std::env::current_exe()
            .map_err(|error| Stop::failed(format!("cannot find the path of xtask: {error}")))?;
        let target = program.ancestors().nth(2).unwrap_or(&root).to_owned();
        Ok(Steps {
            root,
            target,
            start: Instant::now(),
            beside: false,
            failed: Arc::default(),
        })
    }

    /// Steps on the same clock in another workspace, which builds into its own folder.
    pub(crate) fn of(&self, root: PathBuf) -> Self {
        let target = root.join("target");
        Steps {
            root,
            target,
            ..self.clone()
        }
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
    pub(crate) fn run(&self, title: &str, line: &CommandLine) -> Result<(), Stop> {
        self.run_shown(title, line, true).map(drop)
    }

    /// Runs a command as [`Steps::run`] does, and returns what it prints on standard output.
    pub(crate) fn read(&self, title: &str, line: &CommandLine) -> Result<String, Stop> {
        let output = self.run_shown(title, line, false)?;
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    }

    /// Announces and runs one command. Its standard output is shown, or kept.
    fn run_shown(&self, title: &str, line: &CommandLine, shown: bool) -> Result<Output, Stop> {
        let mut command = self.command(line)?;
        self.announce(title);
        eprintln!("          $ {line}");
        if !self.beside {
            command.stderr(Stdio::inherit());
        }
        if shown && !self.beside {
            command.stdin(Stdio::inherit()).stdout(Stdio::inherit());
        }
        self.ended(title, line, command.output())
    }

    /// Runs one command of many at a time, and prints a line when it has ended: `tell` makes that line from
    /// the output and the duration. The output is shown only if the command failed.
    pub(crate) fn run_and_tell(
        &self,
        title: &str,
        line: &CommandLine,
        tell: impl FnOnce(&str, Duration) -> String,
    ) -> Result<(), Stop> {
        let mut command = self.command(line)?;
        let began = Instant::now();
        let output = self.ended(title, line, command.output())?;
        self.announce(&tell(&String::from_utf8_lossy(&output.stdout), began.elapsed()));
        Ok(())
    }

    /// Runs two series of steps at a time, since one alone leaves a core idle now and then. The output of the
    /// second series is kept, and shown only if a command fails.
    ///
    /// # Errors
    /// The error of a step that fails. The other series ends after its current step.
    pub(crate) fn both(
        &self,
        first: impl FnOnce(&Steps) -> Result<(), Stop>,
        second: impl FnOnce(&Steps) -> Result<(), Stop> + Send,
    ) -> Result<(), Stop> {
        let beside = self.beside();
        let ended = std::thread::scope(|scope| {
            let second = scope.spawn(|| self.until_one_fails(|| second(&beside)));
            let first = self.until_one_fails(|| first(self));
            let second = second
                .join()
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            [first, second]
        });
        Self::first_failure(ended)
    }

    /// Does something beside other steps. If it fails, no further one of them begins.
    pub(crate) fn until_one_fails(&self, work: impl FnOnce() -> Result<(), Stop>) -> Result<(), Stop> {
        work().inspect_err(|_| self.failed.store(true, Ordering::Relaxed))
    }

    /// A failure of steps beside one another: not of one that stopped only because another failed.
    pub(crate) fn first_failure(ended: impl IntoIterator<Item = Result<(), Stop>>) -> Result<(), Stop> {
        let failures = ended.into_iter().filter_map(Result::err);
        failures
            .max_by_key(|stop| stop.status != STOPPED)
            .map_or(Ok(()), Err)
    }

    /// These steps, for a series that runs beside another one.
    pub(crate) fn beside(&self) -> Self {
        Steps {
            beside: true,
            ..self.clone()
        }
    }

    /// A command in its folder, unless a step beside this one has failed.
    fn command(&self, line: &CommandLine) -> Result<Command, Stop> {
        if self.failed.load(Ordering::Relaxed) {
            return Err(Stop::new("a step beside this one has failed", STOPPED));
        }
        let mut command = line.command();
        command.current_dir(line.folder.as_ref().unwrap_or(&self.root));
        if std::env::var_os("CARGO_TARGET_DIR").is_some() {
            // The variable may be relative to the folder that `cargo xtask` was called from.
            command.env("CARGO_TARGET_DIR", &self.target);
        }
        Ok(command)
    }

    /// Returns the output of a command that ended well.
    fn ended(&self, title: &str, line: &CommandLine, output: io::Result<Output>) -> Result<Output, Stop> {
        let (root, program) = (self.root.display(), &line.words[0]);
        let repeat = format!("To repeat only this step, in {root}:\n    {line}");
        let cannot = |error| format!("\"{title}\" could not start `{program}`: {error}.\n{repeat}");
        let output = output.map_err(|error| Stop::missing(cannot(error)))?;
        let status = output.status;
        if status.success() {
            return Ok(output);
        }
        for kept in [&output.stdout, &output.stderr] {
            let kept = String::from_utf8_lossy(kept);
            // Hides cargo's messages in JSON, which are for programs.
            let lines = kept.lines().filter(|line| !line.starts_with(r#"{"reason":"#));
            lines.for_each(|line| eprintln!("{line}"));
        }
        let code = match status.code() {
            Some(code) if program != "cargo" => u8::try_from(code).unwrap_or(1),
            _ => 1,
        };
        Err(Stop::new(
            format!("\"{title}\" failed ({status}). {repeat}"),
            code,
        ))
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
        let line = CommandLine::new("echo -n").env("FLAGS", "-D warnings");
        let line = line.arg("it's a path").arg("").to_string();
        assert_eq!(line, r"FLAGS='-D warnings' echo -n 'it'\''s a path' ''");
        let shell = CommandLine::new("sh -c").arg(line);
        let printed = Steps::start().unwrap().read("a shell", &shell).unwrap();
        assert_eq!(printed, "it's a path ");
    }

    #[test]
    fn the_status_of_a_failed_command_is_passed_on_but_cargos_is_one() {
        let steps = Steps::start().unwrap();
        for (line, status) in [
            (CommandLine::new("sh -c").arg("exit 2"), 2),
            (CommandLine::new("cargo --no-such-option"), 1),
            (CommandLine::new("no-such-program-here"), MISSING),
        ] {
            let stop = steps.run("a step", &line).unwrap_err();
            assert_eq!(stop.status, status, "{line}");
            assert!(stop.message.contains(&line.to_string()), "{}", stop.message);
        }
    }

    #[test]
    fn of_two_series_at_a_time_the_step_that_fails_is_named_and_ends_the_other() {
        let [good, bad] = ["sh -c true", "sh -c false"].map(CommandLine::new);
        let passes = |steps: &Steps| steps.run("passes", &good);
        let fails = |steps: &Steps| steps.run("fails", &bad).and_then(|()| steps.run("never", &good));
        let after = |steps: &Steps| {
            while !steps.failed.load(Ordering::Relaxed) {
                std::thread::yield_now();
            }
            steps.run("never runs", &good)
        };
        let steps = || Steps::start().unwrap();
        steps().both(passes, passes).unwrap();
        for ended in [
            steps().both(fails, passes),
            steps().both(passes, fails),
            steps().both(fails, after),
        ] {
            let stop = ended.unwrap_err();
            assert!(stop.message.contains("sh -c false"), "{}", stop.message);
            assert_eq!(stop.status, 1);
        }
    }

    #[test]
    fn the_clock_reads_seconds_then_minutes() {
        assert_eq!(clock(Duration::from_millis(59_900)), "59.9 s");
        assert_eq!(clock(Duration::from_secs(605)), "10:05");
    }
}
