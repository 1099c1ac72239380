//! Messages about wrong input: the table tests/inputs.txt has a row for each command and class of mistake.
//!
//! # Design
//! A row holds the exit status, a part of the message, and the command line, between bars. It runs in a
//! folder of its own with the files of [`fixture`], and must also keep three rules: the message is one
//! line; every file stays as it was unless the row has `--overwrite`; and a command that fails leaves no
//! new file.
//!
//! A command line may end with `< FILE`, `> /dev/full`, or `| head -1`. `\xFF` in a word is that byte.
//! `@gone` is a port whose other end hangs up at once, `@noise` sends bytes that are no frames, and `@silent`
//! sends nothing.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Write};
use std::os::unix::ffi::OsStringExt;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::Duration;

use crate::flash::image_at;
use crate::program::{PROGRAM, ROOT, assert_says};
use crate::rows::{ModelBead, record};
use bead_recording::physical::to_toml;
use bead_testing::paper_settings;
use clap::CommandFactory;
use hertz_chain::Scenario;
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

const TABLE: &str = include_str!("../inputs.txt");
/// A row of the table.
struct InputCase {
    /// Line in the table.
    number: usize,
    status: i32,
    part: &'static str,
    words: &'static str,
}

fn cases() -> Vec<InputCase> {
    let lines = (1..).zip(TABLE.lines());
    let rows = lines.filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
    let case = |(number, line): (usize, &'static str)| {
        let fields: Vec<_> = line.splitn(3, " | ").map(str::trim).collect();
        let [status, part, words] = fields[..] else {
            panic!("inputs.txt:{number}: status | part | command");
        };
        let status = status.parse().unwrap();
        InputCase {
            number,
            status,
            part,
            words,
        }
    };
    rows.map(case).collect()
}

/// Writes scenarios, each with one thing wrong.
fn wrong_scenarios(scenario: &str, write: &dyn Fn(&str, &[u8])) {
    for (name, was, is) in [
        ("key", "radius = 0.019 ", "radios = 0.019 "),
        ("nan", "velocity = 0.45", "velocity = nan"),
        ("stuck", "relaxation = 4.2e-6", "relaxation = 1e6"),
        ("dust", "radius = 0.0045", "radius = 1e-20"),
        ("slow", "velocity = 0.45", "velocity = 1e-30"),
        (
            "softens",
            "damping = 12.0",
            "cubic_stiffness = -1e18\ndamping = 12.0",
        ),
        (
            "held",
            "damping = 12.0",
            "damping = 12.0\n[[intruder]]\nbeads = 8\nmass = 1e-3\nstiffness = 1e6\ndamping = 1.0",
        ),
        ("years", "duration = 0.006", "duration = 1e30"),
        ("lines", "radius = 0.019 ", "\"radios\\nin lines\" = 0.019 "),
        ("many", "beads = 16", "beads = 1000000000000"),
        ("control", "title = \"", "title = \"\\u001b]2;x\\u0007"),
    ] {
        assert_says(scenario, was);
        write(&format!("{name}.toml"), scenario.replacen(was, is, 1).as_bytes());
    }
}

/// Writes the input files of the commands.
fn fixture(folder: &Path) {
    let write = |name: &str, bytes: &[u8]| fs::write(folder.join(name), bytes).unwrap();
    let read = |of: &str| fs::read(format!("{ROOT}/{of}")).unwrap();
    fs::create_dir(folder.join("folder")).unwrap();
    fs::create_dir(folder.join("run")).unwrap();
    for (name, of) in [
        ("s.toml", "docs/scenarios/paper-strike.toml"),
        ("ten.toml", "docs/scenarios/ten-intruders.toml"),
        ("faults.toml", "docs/scenarios/faults.toml"),
        ("springs.toml", "docs/scenarios/springs.toml"),
        ("trimer.toml", "docs/scenarios/driven-trimer.toml"),
        ("bead.settings", "tests/data/settings-v1.bin"),
        ("future.bin", "tests/data/frame-of-the-future.bin"),
    ] {
        write(name, &read(of));
    }
    let trimer = String::from_utf8(read("docs/scenarios/driven-trimer.toml")).unwrap();
    write("strong.toml", trimer.replace("= 1e-9", "= 3e-7").as_bytes());
    for name in ["x.mcap", "run/bead-8.mcap"] {
        record(&folder.join(name), &Scenario::paper(), &[ModelBead::at(8)], 1);
    }
    let noise = (1..4000_u32).map(|n| (n.wrapping_mul(0x9E37_79B9) >> 24) as u8);
    let noise: Vec<u8> = noise.collect();
    let wav = b"RIFF\x24\0\0\0WAVEfmt \x10\0\0\0\x01\0\x01\0\x80\xbb\0\0\0\x77\x01\0\x02\0\x10\0data\0\0\0\0";
    let recording = read("tests/data/recording-v1.mcap");
    let future = read("tests/data/frame-of-the-future.bin");
    // One recording is cut, and one has a hole like the erased flash of a card.
    let mut hole = recording.clone();
    hole[2000..2512].fill(0xFF);
    for (name, bytes) in [
        ("late.toml", &b"[[fault]]\nat = 0.03\nkind = \"hang\"\n"[..]),
        ("limit.toml", b"[[limit]]\nquantity = \"srs\"\nmaks = 1\n"),
        (
            "mask.toml",
            b"[[limit]]\nquantity = \"srs\"\nmask = [{ max = 1 }, { frequency = 9, max = 1 }]\n",
        ),
        ("kept.toml", b"[[limit]]\nquantity = \"peak_force\"\nmax = 9\n"),
        ("broken.toml", b"[[limit]]\nquantity = \"peak_force\"\nmax = 6\n"),
        ("latin.toml", b"title = \"Sto\xdf\""),
        ("empty", b""),
        ("empty.toml", b""),
        ("empty.mcap", b""),
        ("text.txt", b"this is no bead\n"),
        ("page.html", b"<!doctype html>\n"),
        ("table.csv", b"a,b\n"),
        ("noise", &noise),
        ("cut.mcap", &recording[..9000]),
        ("hole.mcap", &hole),
        ("cut.bin", &future[..future.len() - 5]),
        ("runs.bin", &[&future[..], &[1, 0].repeat(5000)].concat()),
        ("nothing.wav", wav),
        ("cut.wav", &wav[..30]),
        ("cut.parquet", b"PAR1 and no more"),
    ] {
        write(name, bytes);
    }
    write("beyond.elf", &image_at(0x080f_ff00, "weact-f405", 1000).0);
    write("cut.elf", &image_at(0x0800_0000, "weact-f405", 1000).0[..1000]);
    write("store.elf", &image_at(0x080c_0000, "weact-f405", 1000).0);
    let other = image_at(0x0800_0000, "no board of this world", 1000);
    write("other.elf", &other.0);
    // Waveforms of 60 rows, most with one thing wrong.
    let force = |n: i32| 5.0 * (-f64::from(n - 30).powi(2) / 40.0).exp();
    let line = |n: i32| format!("{:.6},{:.6}", f64::from(n) * 1e-5, force(n));
    let wave = |name: &str, head: &str, row: &dyn Fn(i32) -> String| {
        let rows: String = (0..60).map(|n| row(n) + "\n").collect();
        write(name, format!("{head}\n{rows}").as_bytes());
    };
    wave("wave.csv", "time_s,force_n", &line);
    wave("volts.csv", "TIME,CH1,CH2", &|n| line(n) + ",0.5");
    wave("long.csv", "time_s,force_n", &|n| format!("{n}00,{}", force(n)));
    let steers = |n| line(n) + if n == 20 { "\u{1b}]52;c;eA==\u{7}" } else { "" };
    wave("steers.csv", "time_s,force_n", &steers);
    // Behind a gap the times are later.
    wave("gap.csv", "time_s,force_n", &|n| line(n + 3 * i32::from(n > 20)));
    let bead = to_toml(paper_settings().description()).replacen("damping = 12.0", "damping = 0", 1);
    write("undamped.toml", bead.as_bytes());
    let scenario = fs::read_to_string(folder.join("s.toml")).unwrap();
    wrong_scenarios(&scenario, &write);
    let bench = |tables: &str| format!("{scenario}\n{tables}\n").into_bytes();
    write("bench.toml", &bench("[front_end]\nforce_span = 0.0"));
    let wire = "[[analog_wire]]\nfrom = \"PA4\"\nto = \"PA0\"";
    write("wired.toml", &bench(wire));
    write("clocks.toml", &bench("[clock]\nppm = [20.0, -35.0]"));
    symlink("nothing", folder.join("nowhere.mcap")).unwrap();
    symlink("loop.toml", folder.join("loop.toml")).unwrap();
    // Its listener is dropped, so that nobody listens.
    UnixListener::bind(folder.join("stale.sock")).unwrap();
    let pipe = folder.join("pipe");
    assert!(Command::new("mkfifo").arg(pipe).status().unwrap().success());
    fs::create_dir(folder.join("locked")).unwrap();
    fs::set_permissions(folder.join("locked"), fs::Permissions::from_mode(0o555)).unwrap();
}

/// Names and contents of all files below a folder.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let (path, kind) = (entry.path(), entry.file_type().unwrap());
        if kind.is_dir() {
            found.extend(contents(&path));
        } else {
            let bytes = kind.is_file().then(|| fs::read(&path).unwrap());
            found.insert(path, bytes.unwrap_or_default());
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

/// Runs a command line. One that takes longer than a minute ends with status 124.
fn run(words: &str, folder: &Path, ports: &Path) -> Output {
    let [is_full, is_head] = [" > /dev/full", " | head -1"].map(|end| words.ends_with(end));
    let line = words
        .trim_end_matches(" > /dev/full")
        .trim_end_matches(" | head -1");
    let (line, input) = line.split_once(" < ").unwrap_or((line, "/dev/null"));
    let mut command = Command::new("timeout");
    command.current_dir(folder).args(["60", PROGRAM]);
    command.args(line.split_whitespace().map(|text| word(text, ports)));
    command.stdin(File::open(folder.join(input)).unwrap());
    if is_full {
        command.stdout(File::create("/dev/full").unwrap());
    }
    if !is_head {
        return command.output().unwrap();
    }
    let piped = command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = piped.spawn().unwrap();
    let mut stdout = BufReader::new(child.stdout.take().unwrap());
    stdout.read_until(b'\n', &mut Vec::new()).unwrap();
    drop(stdout);
    child.wait_with_output().unwrap()
}

/// Runs a case. The error names the rule that the command broke.
fn try_case(case: &InputCase, ports: &Path) -> Result<(), String> {
    let folder = tempfile::tempdir().unwrap();
    fixture(folder.path());
    let before = contents(folder.path());
    let output = run(case.words, folder.path(), ports);
    let said = String::from_utf8(output.stderr).map_err(|_| "its message is no text")?;
    let printed = String::from_utf8_lossy(&output.stdout);
    if output.status.code() != Some(case.status) {
        return Err(format!("it ended with {}: {said}", output.status));
    }
    if !said.contains(case.part) && !printed.contains(case.part) {
        return Err(format!("it does not say so: {said}"));
    }
    // Notes on the input may come before. Mistakes of the command line are shown with its usage.
    let notes = ["rejected", "recording is ", "more ", ": 0 strikes, 0 frames in"];
    let is_note = |line: &&str| notes.iter().any(|note| line.contains(note));
    let lines = said.lines().filter(|line| !is_note(line)).count();
    let is_usage = said.starts_with("error: ") || case.words.ends_with("--help") || said.contains("Usage: ");
    if case.status != 0 && !is_usage && lines > 1 {
        return Err(format!("its message has {lines} lines: {said}"));
    }
    let steers = |text: &str| text.chars().any(|c| c.is_control() && c != '\n' && c != '\t');
    if steers(&said) || steers(&printed) {
        return Err(format!("it steers the terminal: {said:?}"));
    }
    let after = contents(folder.path());
    let overwrites = case.words.contains("--overwrite") && case.status == 0;
    for (path, bytes) in &before {
        if after.get(path) != Some(bytes) && !overwrites {
            return Err(format!("{} is not as it was", path.display()));
        }
    }
    // A recording is kept, whatever happens.
    let records = case.words.starts_with("record") || case.words.starts_with("monitor");
    let keeps = case.status < 2 || records && case.status == 3;
    match after.keys().find(|path| !before.contains_key(*path)) {
        Some(new) if !keeps => Err(format!("{} is left", new.display())),
        _ => Ok(()),
    }
}

/// Serves the sockets `gone`, `noise` and `silent`.
fn serve(folder: &Path) {
    let ports = ["gone", "noise", "silent"].map(|name| UnixListener::bind(folder.join(name)).unwrap());
    let [gone, noise, silent] = ports;
    thread::spawn(move || gone.incoming().for_each(drop));
    thread::spawn(move || {
        let mut kept = Vec::new();
        silent.incoming().for_each(|stream| kept.push(stream));
    });
    thread::spawn(move || {
        for mut stream in noise.incoming().flatten() {
            // Until the program hangs up.
            thread::spawn(move || {
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
    let mut cases = cases();
    // Building only these tests does not build the program of the figures.
    if !Path::new(PROGRAM).with_file_name("bead-figures").exists() {
        eprintln!("SKIPPED: the rows of `bead figures`; `cargo build --release -p bead-figures` makes it");
        cases.retain(|case| !case.words.starts_with("figures"));
    }
    let failed = cases.par_iter().filter_map(|case| {
        let what = try_case(case, ports.path()).err()?;
        let InputCase { number, words, .. } = case;
        Some(format!("inputs.txt:{number}: bead {words}: {what}\n"))
    });
    let failed: String = failed.collect();
    assert!(failed.is_empty(), "of {} rows:\n{failed}", cases.len());
}

/// The commands that do something, as they are typed.
fn leaves(command: &clap::Command, above: &str) -> Vec<String> {
    if !command.has_subcommands() {
        return vec![above.to_owned()];
    }
    let name = |one: &clap::Command| format!("{above} {}", one.get_name());
    let below = command.get_subcommands();
    below
        .flat_map(|one| leaves(one, name(one).trim_start()))
        .collect()
}

#[test]
fn every_command_is_in_the_table() {
    let (commands, cases) = (leaves(&bead::cli::Cli::command(), ""), cases());
    assert!(commands.len() > 25, "{commands:?}");
    let is_there = |command: &&String| cases.iter().any(|case| case.words.starts_with(&**command));
    let missing: Vec<_> = commands.iter().filter(|command| !is_there(command)).collect();
    assert!(missing.is_empty(), "without a row in inputs.txt: {missing:?}");
}
