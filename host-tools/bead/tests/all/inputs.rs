//! Every command's message about wrong input: the table tests/inputs.txt, a row for each command and class.
//!
//! # Design
//! A row has the exit status, what the message holds, and the command line, between bars. To add one is to
//! add a line. Each runs in a folder of its own with the files of [`fixture`]. Beside status and message it
//! must keep three rules, which no row has to say: the message of `bead` is one line; every file that was
//! there is as it was, if the row has no `--overwrite`; and a command that fails leaves no new file.
//!
//! A command line may end with `< FILE`, `> /dev/full`, or `| head -1`. `\xFF` in a word is that byte.
//! `@gone` is a port whose other end hangs up at once, `@noise` one that sends what are no frames.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::ffi::OsStringExt;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use clap::CommandFactory;

const TABLE: &str = include_str!("../inputs.txt");
const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
/// A command that takes longer than this hangs.
const PATIENCE: Duration = Duration::from_secs(60);

struct Row<'a> {
    /// Line in the table.
    number: usize,
    status: i32,
    part: &'a str,
    words: &'a str,
}

fn rows() -> Vec<Row<'static>> {
    let lines = (1..).zip(TABLE.lines());
    let told = lines.filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
    told.map(|(number, line)| {
        let mut fields = line.splitn(3, " | ");
        let mut field = || {
            fields
                .next()
                .unwrap_or_else(|| panic!("inputs.txt:{number}: status | part | command"))
        };
        Row {
            number,
            status: field().trim().parse().unwrap(),
            part: field().trim(),
            words: field().trim(),
        }
    })
    .collect()
}

/// Files that are there when a command runs.
fn fixture(folder: &Path) {
    let write = |name: &str, bytes: &[u8]| fs::write(folder.join(name), bytes).unwrap();
    let copy = |name: &str, of: &str| write(name, &fs::read(format!("{ROOT}/{of}")).unwrap());
    copy("s.toml", "docs/scenarios/paper-strike.toml");
    copy("ten.toml", "docs/scenarios/ten-intruders.toml");
    copy("faults.toml", "docs/scenarios/faults.toml");
    write("late.toml", b"[[fault]]\nat = 0.03\nkind = \"hang\"\n");
    write("latin.toml", b"title = \"Sto\xdf\"");
    copy("x.mcap", "tests/data/recording-v1.mcap");
    copy("bead.settings", "tests/data/settings-v1.bin");
    copy("future.bin", "tests/data/frame-of-the-future.bin");
    write("empty", b"");
    write("empty.toml", b"");
    write("empty.mcap", b"");
    write("text.txt", b"this is no bead\n");
    write("page.html", b"<!doctype html>\n");
    write("table.csv", b"a,b\n");
    let noise: Vec<u8> = (1..4000_u32)
        .map(|n| (n.wrapping_mul(0x9E37_79B9) >> 24) as u8)
        .collect();
    write("noise", &noise);
    // A recording that was cut, one with a hole as a card's erased flash, and one of a version to come.
    let recording = fs::read(folder.join("x.mcap")).unwrap();
    write("cut.mcap", &recording[..9000]);
    let mut hole = recording.clone();
    hole[2000..2512].fill(0xFF);
    write("hole.mcap", &hole);
    // Waveforms, most with one thing wrong.
    let wave = |head: &str, row: &dyn Fn(i32) -> String| -> String {
        head.to_owned() + &(0..60).map(|n| row(n) + "\n").collect::<String>()
    };
    let force = |n: i32| 5.0 * (-f64::from(n - 30).powi(2) / 40.0).exp();
    let line = |n: i32| format!("{:.6},{:.6}", f64::from(n) * 1e-5, force(n));
    let volts = wave("TIME,CH1,CH2\n", &|n| line(n) + ",0.5");
    write("volts.csv", volts.as_bytes());
    for (name, at, is) in [
        ("hole", 20, "0.00020,"),
        ("nan", 20, "0.00020,nan"),
        ("twice", 20, "0.00019,0.3"),
        ("back", 20, "-1,0.3"),
        ("steers", 20, "0.0002,\u{1b}]52;c;eA==\u{7}"),
    ] {
        let text = wave("time_s,force_n\n", &|n| {
            if n == at { is.to_owned() } else { line(n) }
        });
        write(&format!("{name}.csv"), text.as_bytes());
    }
    let late = |n: i32| {
        format!(
            "{:.6},{:.6}",
            f64::from(n + 3 * i32::from(n > 20)) * 1e-5,
            force(n)
        )
    };
    write("gap.csv", wave("time_s,force_n\n", &late).as_bytes());
    write("wave.csv", wave("time_s,force_n\n", &line).as_bytes());
    write(
        "long.csv",
        wave("time_s,force_n\n", &|n| format!("{n}00,{}", force(n))).as_bytes(),
    );
    write("unitless.csv", wave("time_s,force\n", &line).as_bytes());
    write(
        "both.csv",
        wave("time_s,a_n,b_n\n", &|n| line(n) + ",1").as_bytes(),
    );
    write("wave.wav", wave("time_s,force_n\n", &line).as_bytes());
    let mut wav =
        b"RIFF\x24\0\0\0WAVEfmt \x10\0\0\0\x01\0\x01\0\x80\xbb\0\0\0\x77\x01\0\x02\0\x10\0data\0\0\0\0"
            .to_vec();
    write("nothing.wav", &wav);
    wav.truncate(30);
    write("cut.wav", &wav);
    write("cut.parquet", b"PAR1 and no more");
    // Scenarios with one thing wrong.
    let scenario = fs::read_to_string(folder.join("s.toml")).unwrap();
    for (name, was, is) in [
        ("key", "radius = 0.019 ", "radios = 0.019 "),
        ("word", "velocity = 0.45", "velocity = \"fast\""),
        ("nan", "velocity = 0.45", "velocity = nan"),
        ("inf", "velocity = 0.45", "velocity = inf"),
        ("negative", "velocity = 0.45", "velocity = -0.45"),
        ("stuck", "relaxation = 4.2e-6", "relaxation = 1e6"),
        ("dust", "radius = 0.0045", "radius = 1e-20"),
        ("slow", "velocity = 0.45", "velocity = 1e-30"),
        ("years", "duration = 0.006", "duration = 1e30"),
        ("lines", "radius = 0.019 ", "\"radios\\nin lines\" = 0.019 "),
        ("beyond", "velocity = 0.45", "velocity = 1e31"),
        ("zero", "radius = 0.019 ", "radius = 0.0 "),
        ("many", "beads = 16", "beads = 1000000000000"),
        ("none", "beads = 16", "beads = 0"),
        ("far", "beads = [8]", "beads = [17]"),
        (
            "control",
            "title = \"",
            "title = \"\\u001b]52;c;eA==\\u0007\\u009b2J",
        ),
    ] {
        assert!(scenario.contains(was), "{was}");
        write(&format!("{name}.toml"), scenario.replacen(was, is, 1).as_bytes());
    }
    let bench = |tables: &str| format!("{scenario}\n{tables}\n").into_bytes();
    write("bench.toml", &bench("[front_end]\nforce_span = 0.0"));
    write("clocks.toml", &bench("[clock]\nppm = [20.0, -35.0]"));
    fs::create_dir(folder.join("folder")).unwrap();
    fs::create_dir(folder.join("run")).unwrap();
    copy("run/bead-8.mcap", "tests/data/recording-v1.mcap");
    symlink("nothing", folder.join("nowhere.mcap")).unwrap();
    symlink("loop.toml", folder.join("loop.toml")).unwrap();
    // Its listener is dropped: nobody is there any more.
    UnixListener::bind(folder.join("stale.sock")).unwrap();
    let pipe = folder.join("pipe");
    assert!(Command::new("mkfifo").arg(pipe).status().unwrap().success());
    fs::create_dir(folder.join("locked")).unwrap();
    fs::set_permissions(folder.join("locked"), fs::Permissions::from_mode(0o555)).unwrap();
}

/// Names and contents of all files below a folder.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let (path, kind) = entry
            .map(|entry| (entry.path(), entry.file_type().unwrap()))
            .unwrap();
        match (kind.is_dir(), kind.is_file()) {
            (true, _) => found.extend(contents(&path)),
            (_, true) => drop(found.insert(path.clone(), fs::read(&path).unwrap())),
            _ => drop(found.insert(path, Vec::new())),
        }
    }
    found
}

/// The bytes of a word.
fn word(text: &str, ports: &Path) -> OsString {
    if let Some(port) = text.strip_prefix('@') {
        return format!("unix:{}", ports.join(port).display()).into();
    }
    let mut pieces = text.split("\\x");
    let mut bytes = pieces.next().unwrap_or("").as_bytes().to_vec();
    for piece in pieces {
        bytes.push(u8::from_str_radix(&piece[..2], 16).unwrap());
        bytes.extend(&piece.as_bytes()[2..]);
    }
    OsString::from_vec(bytes)
}

/// Runs a row. What is wrong with what it did, if anything.
fn tried(row: &Row<'_>, ports: &Path) -> Result<(), String> {
    let folder = tempfile::tempdir().unwrap();
    fixture(folder.path());
    let before = contents(folder.path());
    let (mut words, mut input, mut output) = (row.words, Stdio::null(), Stdio::piped());
    let mut head = false;
    if let Some(rest) = words.strip_suffix(" > /dev/full") {
        (words, output) = (rest, File::create("/dev/full").unwrap().into());
    }
    if let Some(rest) = words.strip_suffix(" | head -1") {
        (words, head) = (rest, true);
    }
    if let Some((rest, file)) = words.split_once(" < ") {
        (words, input) = (rest, File::open(folder.path().join(file)).unwrap().into());
    }
    let mut child = Command::new(env!("CARGO_BIN_EXE_bead"))
        .current_dir(folder.path())
        .args(words.split_whitespace().map(|text| word(text, ports)))
        .stdin(input)
        .stdout(output)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let stdout = child.stdout.take().map(|mut stdout| {
        thread::spawn(move || {
            let mut text = Vec::new();
            if head {
                drop(BufReader::new(stdout).read_until(b'\n', &mut text))
            } else {
                drop(stdout.read_to_end(&mut text))
            }
            text
        })
    });
    let mut stderr = child.stderr.take().unwrap();
    let said = thread::spawn(move || {
        let mut text = Vec::new();
        stderr.read_to_end(&mut text).map(|_| text).unwrap()
    });
    let started = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if started.elapsed() > PATIENCE {
            child.kill().unwrap();
            child.wait().unwrap();
            return Err("it hangs".to_owned());
        }
        thread::sleep(Duration::from_millis(2));
    };
    let printed = stdout.map(|thread| thread.join().unwrap()).unwrap_or_default();
    let said = String::from_utf8(said.join().unwrap()).map_err(|_| "its message is no text".to_owned())?;

    if status.code() != Some(row.status) {
        return Err(format!("it ended with {status}: {said}"));
    }
    if !said.contains(row.part) && !String::from_utf8_lossy(&printed).contains(row.part) {
        return Err(format!("it does not say so: {said}"));
    }
    // Notes on what is read may come before; what a command line lacks is said with its usage.
    let failed = row.status != 0;
    let notes = ["rejected", "recording is ", "more ", ": 0 strikes, 0 frames in"];
    let is_note = |line: &&str| notes.iter().any(|note| line.contains(note));
    let lines = said.lines().filter(|line| !failed || !is_note(line)).count();
    if failed
        && !said.starts_with("error: ")
        && !words.ends_with("--help")
        && lines > 1
        && !said.contains("Usage: ")
    {
        return Err(format!("its message has {lines} lines: {said}"));
    }
    let steers = |text: &str| text.chars().any(|c| c.is_control() && c != '\n' && c != '\t');
    if steers(&said) || steers(&String::from_utf8_lossy(&printed)) {
        return Err(format!("it steers the terminal: {said:?}"));
    }
    let after = contents(folder.path());
    let overwrites = words.contains("--overwrite") && row.status == 0;
    if let Some((path, _)) = before
        .iter()
        .find(|(path, bytes)| after.get(*path) != Some(bytes) && !overwrites)
    {
        return Err(format!("{} is not as it was", path.display()));
    }
    // What came of a bead is kept, whatever happens.
    let keeps = words.starts_with("record") && row.status == 3;
    match after.keys().find(|path| !before.contains_key(*path)) {
        Some(new) if row.status >= 2 && !keeps => Err(format!("{} is left", new.display())),
        _ => Ok(()),
    }
}

/// Sockets that are ports of no bead: `gone` and `noise`.
fn serve(folder: &Path) {
    let [gone, noise] = ["gone", "noise"].map(|name| UnixListener::bind(folder.join(name)).unwrap());
    thread::spawn(move || gone.incoming().for_each(drop));
    thread::spawn(move || {
        for stream in noise.incoming().flatten() {
            thread::spawn(move || {
                let mut stream = stream;
                // Until the program hangs up.
                while stream.write_all(&[0x55; 300]).is_ok() {
                    thread::sleep(Duration::from_millis(20));
                }
            });
        }
    });
}

#[test]
fn every_wrong_input_is_told_in_one_line_and_loses_nothing() {
    let ports = tempfile::tempdir().unwrap();
    serve(ports.path());
    let mut rows = rows();
    // A program of its own, which a build of these tests alone does not make.
    if !Path::new(env!("CARGO_BIN_EXE_bead"))
        .with_file_name("bead-figures")
        .exists()
    {
        eprintln!("SKIPPED: the rows of `bead figures`; `cargo build --release -p bead-figures` makes it");
        rows.retain(|row| !row.words.starts_with("figures"));
    }
    let (next, wrong) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    let threads = thread::available_parallelism().map_or(2, usize::from) + 2;
    thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some(row) = rows.get(next.fetch_add(1, Ordering::Relaxed)) {
                    if let Err(what) = tried(row, ports.path()) {
                        let told = format!("inputs.txt:{}: bead {}: {what}", row.number, row.words);
                        wrong.lock().unwrap().push(told);
                    }
                }
            });
        }
    });
    let wrong = wrong.into_inner().unwrap();
    assert!(
        wrong.is_empty(),
        "{} of {} rows:\n{}",
        wrong.len(),
        rows.len(),
        wrong.join("\n")
    );
}

/// The commands that do something, as they are typed.
fn leaves(command: &clap::Command, above: &str) -> Vec<String> {
    let below: Vec<_> = command.get_subcommands().collect();
    let below_it = below.into_iter().flat_map(|one| {
        let name = format!("{above} {}", one.get_name());
        if one.has_subcommands() {
            leaves(one, name.trim())
        } else {
            vec![name.trim().to_owned()]
        }
    });
    below_it.collect()
}

#[test]
fn every_command_is_in_the_table() {
    let commands = leaves(&bead::cli::Cli::command(), "");
    assert!(commands.len() > 25, "{commands:?}");
    let rows = rows();
    for command in commands {
        let of_it = rows.iter().filter(|row| row.words.starts_with(&*command)).count();
        assert!(
            of_it > 0,
            "bead {command} has no row in host-tools/bead/tests/inputs.txt: add what may be wrong with it"
        );
    }
}
