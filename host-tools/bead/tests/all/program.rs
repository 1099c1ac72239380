//! The program under test: run to its end, started, asked at a port, or typed in a shell.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpListener;
use std::ops::Deref;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, ChildStdout, Command, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

pub(crate) const PROGRAM: &str = env!("CARGO_BIN_EXE_bead");
pub(crate) const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
pub(crate) const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data");
pub(crate) const SCENARIO: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../docs/scenarios/paper-strike.toml"
);

/// Runs `bead` in a folder with the words of a line, until it ends.
pub(crate) fn typed(folder: &Path, line: &str) -> Output {
    let mut command = Command::new(PROGRAM);
    command.current_dir(folder).args(line.split_whitespace());
    command.output().unwrap()
}

/// Text on standard error.
pub(crate) fn said(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// Standard output of a command that must succeed.
pub(crate) fn done(output: Output) -> String {
    assert!(output.status.success(), "{}", said(&output));
    String::from_utf8(output.stdout).unwrap()
}

/// The one JSON document of a command that must succeed.
pub(crate) fn json(output: Output) -> Value {
    serde_json::from_str(&done(output)).unwrap()
}

/// The JSON documents of a text, each on its line.
pub(crate) fn documents(text: &[u8]) -> Vec<Value> {
    let documents = serde_json::Deserializer::from_slice(text).into_iter();
    documents.map(Result::unwrap).collect()
}

/// Asserts that a command failed with this status and one line that holds `part`.
pub(crate) fn refused(output: &Output, status: i32, part: &str) {
    let said = said(output);
    let lines = said.lines().count();
    assert_eq!((output.status.code(), lines), (Some(status), 1), "{said}");
    assert_says(&said, part);
}

/// Asserts that a text holds a part.
pub(crate) fn assert_says(text: &str, part: &str) {
    assert!(text.contains(part), "\"{part}\" is not in: {text}");
}

/// The fields of a row of a table, between bars.
pub(crate) fn fields<const N: usize>(row: &str) -> [&str; N] {
    let fields: Vec<_> = row.split('|').map(str::trim).collect();
    fields.try_into().unwrap_or_else(|_| panic!("{N} fields: {row}"))
}

/// Names of the entries of a folder, sorted.
pub(crate) fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<_> = names.collect();
    names.sort();
    names
}

/// A temporary folder in which `bead` runs.
pub(crate) struct TestFolder(TempDir);

impl TestFolder {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// Runs `bead` with the words of a line.
    pub(crate) fn run(&self, line: &str) -> Output {
        typed(self, line)
    }

    pub(crate) fn done(&self, line: &str) -> String {
        done(self.run(line))
    }

    pub(crate) fn json(&self, line: &str) -> Value {
        json(self.run(line))
    }

    /// Asserts the exit status and a part of the message of a command line, given as a row of `inputs.txt`.
    pub(crate) fn refused(&self, row: &str) {
        let [status, part, line] = fields(row);
        refused(&self.run(line), status.parse().unwrap(), part);
    }

    pub(crate) fn start(&self, line: &str) -> RunningProgram {
        RunningProgram::start(self, line)
    }

    pub(crate) fn write(&self, name: &str, contents: impl AsRef<[u8]>) {
        fs::write(self.join(name), contents).unwrap();
    }

    pub(crate) fn read(&self, name: impl AsRef<Path>) -> Vec<u8> {
        fs::read(self.join(name)).unwrap()
    }

    pub(crate) fn text(&self, name: impl AsRef<Path>) -> String {
        String::from_utf8(self.read(name)).unwrap()
    }

    /// Names of its entries, between spaces.
    pub(crate) fn names(&self) -> String {
        names(self).join(" ")
    }
}

impl Deref for TestFolder {
    type Target = Path;

    fn deref(&self) -> &Path {
        self.0.path()
    }
}

/// Waits until something holds.
pub(crate) fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let started = Instant::now();
    while !holds() {
        assert!(started.elapsed() < Duration::from_secs(60), "never: {what}");
        thread::sleep(Duration::from_millis(2));
    }
}

/// Prepares `bead` in a folder. It heeds signals even if this test ignores them, as under nohup or in the
/// background of a script.
pub(crate) fn interruptible(folder: &Path, arguments: &str) -> Command {
    let mut command = Command::new("env");
    command.current_dir(folder).stdin(Stdio::null());
    command.args(["--default-signal=INT,TERM,HUP", PROGRAM]);
    command.args(arguments.split_whitespace());
    command
}

/// A running program. It is killed when it is dropped.
pub(crate) struct RunningProgram {
    pub(crate) child: Child,
    stdout: Option<BufReader<ChildStdout>>,
    pub(crate) stderr: Option<BufReader<ChildStderr>>,
}

impl RunningProgram {
    /// Wraps a process, with the streams that are pipes.
    pub(crate) fn of(mut child: Child) -> Self {
        Self {
            stdout: child.stdout.take().map(BufReader::new),
            stderr: child.stderr.take().map(BufReader::new),
            child,
        }
    }

    /// Starts a command with pipes.
    pub(crate) fn spawn(command: &mut Command) -> Self {
        let piped = command.stdout(Stdio::piped()).stderr(Stdio::piped());
        Self::of(piped.spawn().unwrap())
    }

    /// Starts `bead` in a folder with the words of a line.
    pub(crate) fn start(folder: &Path, arguments: &str) -> Self {
        Self::spawn(&mut interruptible(folder, arguments))
    }

    /// Waits for a line on standard output. Empty when the program has ended.
    pub(crate) fn line(&mut self) -> String {
        read_line(&mut self.stdout)
    }

    /// Waits for a line on standard error.
    pub(crate) fn error_line(&mut self) -> String {
        read_line(&mut self.stderr)
    }

    pub(crate) fn signal(&self, name: &str) {
        signal(name, &self.child.id().to_string());
    }

    pub(crate) fn has_ended(&mut self) -> bool {
        self.child.try_wait().unwrap().is_some()
    }

    /// Waits for the end. The output holds the rest of both streams.
    pub(crate) fn finish(mut self) -> Output {
        let mut stdout = Vec::new();
        self.stdout.take().unwrap().read_to_end(&mut stdout).unwrap();
        let mut stderr = Vec::new();
        self.stderr.take().unwrap().read_to_end(&mut stderr).unwrap();
        let status = self.child.wait().unwrap();
        Output {
            status,
            stdout,
            stderr,
        }
    }

    /// Asserts that it ends with this status and returns the rest of standard error. Standard output is not
    /// read.
    pub(crate) fn end(mut self, status: i32) -> String {
        let mut said = String::new();
        if let Some(stderr) = &mut self.stderr {
            stderr.read_to_string(&mut said).unwrap();
        }
        assert_eq!(self.child.wait().unwrap().code(), Some(status), "{said}");
        said
    }

    /// Interrupts it and asserts that it ends with this status.
    pub(crate) fn interrupt(self, status: i32) -> String {
        self.signal("INT");
        self.end(status)
    }
}

impl Drop for RunningProgram {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn read_line(stream: &mut Option<impl BufRead>) -> String {
    let mut line = String::new();
    stream.as_mut().unwrap().read_line(&mut line).unwrap();
    line
}

/// Sends a signal to a process, or to the group `-- -PID`.
pub(crate) fn signal(name: &str, whom: &str) {
    let kill = format!("kill -{name} {whom}");
    done(Command::new("bash").args(["-c", &kill]).output().unwrap());
}

/// A TCP port of this computer, and its address as `--port` takes it.
pub(crate) fn tcp() -> (TcpListener, String) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = format!("tcp:{}", listener.local_addr().unwrap());
    (listener, port)
}

/// Runs `bead` in a folder with `--port` at a socket, whose other end answers with `peer` until `bead` hangs
/// up.
pub(crate) fn asked(folder: &Path, arguments: &str, peer: impl FnMut(&[u8]) -> Vec<u8> + Send) -> Output {
    let socket = folder.join("line.sock");
    let _ = fs::remove_file(&socket);
    let listener = UnixListener::bind(&socket).unwrap();
    let mut peer = peer;
    thread::scope(|scope| {
        let listening = scope.spawn(move || {
            let (mut stream, _) = listener.accept().unwrap();
            let mut buffer = [0; 4096];
            while let Ok(length @ 1..) = stream.read(&mut buffer) {
                // The program may have hung up meanwhile.
                let _ = stream.write_all(&peer(&buffer[..length]));
            }
        });
        let output = typed(folder, &format!("{arguments} --port unix:line.sock"));
        if !listening.is_finished() {
            // The program may never have connected: this ends the other side.
            let _ = UnixStream::connect(&socket);
        }
        output
    })
}

/// Runs a line of a shell with `bead` in its path; returns what it printed.
pub(crate) fn shell(folder: &Path, line: &str) -> String {
    let path = std::env::var("PATH").unwrap();
    let path = format!("{}:{path}", Path::new(PROGRAM).parent().unwrap().display());
    let mut shell = Command::new("sh");
    shell.args(["-ec", line]).current_dir(folder).env("PATH", path);
    done(shell.output().unwrap())
}

/// The paper's strike on twelve beads, over half the time: a search takes less than a second.
pub(crate) fn short_scenario() -> String {
    let text = fs::read_to_string(SCENARIO).unwrap();
    text.replace("beads = 16", "beads = 12")
        .replace("= 0.006", "= 0.003")
}

/// Runs a Python with pandas, polars, pyuff, xarray and mcap in a folder; returns what it printed. `None`
/// where there is none: `cargo xtask test` sets it up where it can.
pub(crate) fn python(folder: &Path, arguments: &[&str]) -> Option<String> {
    let built = Path::new(PROGRAM).ancestors().nth(2).unwrap();
    let own = std::env::var_os("BEAD_PYTHON").map(PathBuf::from);
    let python = own.or_else(|| Some(built.join("python/bin/python3")).filter(|path| path.exists()));
    let Some(python) = python else {
        eprintln!("SKIPPED: no Python with pandas, xarray and mcap; `cargo xtask python` sets one up");
        return None;
    };
    let mut command = Command::new(python);
    let output = command.current_dir(folder).args(arguments).output();
    Some(done(output.unwrap()))
}
