//! `bead settings` and `bead command` as their users run them, on the flash image behind a socket.

use std::fs;
use std::io::Read;
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use bead::cli::Cli;
use bead_bench::bridge::{Bridge, Door, serve};
use bead_bench::emulation::Emulation;
use bead_testing::{block, settings_at};
use bead_tests::paper;
use clap::Parser;

/// A bead behind a socket, and a folder.
struct Served<'a> {
    folder: &'a Path,
    address: String,
}

impl Served<'_> {
    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Runs a command line to its end, where `@name` stands for a file in the folder: its exit status and the
    /// line on standard error.
    fn run(&self, line: &str) -> (u8, String) {
        let words = line.split(' ').map(|word| match word.strip_prefix('@') {
            Some(name) => self.path(name).display().to_string(),
            None => word.to_owned(),
        });
        let port = ["--port", &self.address, "--timeout", "20"].map(str::to_owned);
        let line = ["bead".to_owned()].into_iter().chain(words).chain(port);
        let parsed = Cli::try_parse_from(line).unwrap_or_else(|error| panic!("{error}"));
        match parsed.run() {
            Ok(()) => (0, String::new()),
            Err(failure) => (failure.exit_status(), failure.to_string()),
        }
    }

    /// Runs a command line that must succeed.
    fn done(&self, line: &str) {
        assert_eq!(self.run(line), (0, String::new()), "{line}");
    }

    /// Runs a command line that the bead must refuse.
    fn refused(&self, line: &str, why: &str) {
        let refused = format!("the bead at address 0 refused: {why}");
        assert_eq!(self.run(line), (1, refused), "{line}");
    }

    /// The settings block in force.
    fn settings(&self) -> Vec<u8> {
        let file = self.path("read.settings");
        let _ = fs::remove_file(&file);
        self.done("settings read --out @read.settings");
        fs::read(file).unwrap_or_else(|error| panic!("{error}"))
    }

    fn write(&self, name: &str, bytes: &[u8]) {
        fs::write(self.path(name), bytes).unwrap_or_else(|error| panic!("{error}"));
    }
}

/// Serves the run at a socket while `requests` uses it.
fn behind_a_socket(run: &Emulation, requests: impl FnOnce(&Served<'_>)) {
    let folder = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
    let socket = folder.path().join("bead.sock");
    let bead = Served {
        folder: folder.path(),
        address: format!("unix:{}", socket.display()),
    };
    let stop = AtomicBool::new(false);
    thread::scope(|scope| {
        let server = scope.spawn(|| {
            let at = bead.address.parse().unwrap_or_else(|error| panic!("{error}"));
            let door = Door::open(&at)?;
            let mut bridge = Bridge::new(run, None)?;
            serve(&mut bridge, &door, &stop)
        });
        // The path is there a moment before anybody listens.
        while UnixStream::connect(&socket).is_err() && !server.is_finished() {
            thread::yield_now();
        }
        let answered = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| requests(&bead)));
        stop.store(true, Ordering::Relaxed);
        let served = server
            .join()
            .unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        served.unwrap_or_else(|failure| panic!("{failure}"));
        answered.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    });
    assert!(!socket.exists());
}

#[test]
fn settings_are_read_written_refused_and_reset_from_the_command_line() {
    let run = paper(1, 0.1, Some(1));
    behind_a_socket(&run, |bead| {
        assert_eq!(bead.settings(), run.block);
        let mut other = run.settings;
        other.window.length = 300;
        let addressed = other
            .with(|bead| bead.address = 9)
            .unwrap_or_else(|error| panic!("{error}"));
        bead.write("other.settings", &block(&other));
        bead.done("settings write @other.settings");
        assert_eq!(bead.settings(), block(&other));
        for line in [
            "settings write @other.settings --new-address 9",
            "settings set address=9",
        ] {
            bead.done(line);
            assert_eq!(bead.settings(), block(&addressed));
            bead.done("settings write @other.settings");
        }
        bead.write("rate.settings", &block(&settings_at(50_000)));
        let why = "sample rate; settings for 50000 Hz; this image samples at 100000 Hz";
        bead.refused("settings write @rate.settings", why);
        bead.write("long.settings", &[0; 449]);
        assert_eq!(bead.run("settings write @long.settings").0, 2);
        assert_eq!(bead.run("settings write @missing.settings").0, 2);

        bead.done("command reboot");
        assert_eq!(bead.settings(), block(&other), "kept over the reset");
        bead.done("settings reset");
        assert_eq!(bead.settings(), run.block);
    });
}

#[test]
fn programs_share_the_line_and_an_idle_one_holds_nobody_up() {
    let run = paper(1, 0.1, Some(1));
    behind_a_socket(&run, |bead| {
        let connect =
            || UnixStream::connect(bead.path("bead.sock")).unwrap_or_else(|error| panic!("{error}"));
        let (idle, mut listener) = (connect(), connect());
        listener
            .set_read_timeout(Some(Duration::from_secs(60)))
            .unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(bead.settings(), run.block);
        // The settings passed by here too.
        let mut decoder = bead_wire::Decoder::new();
        let mut told = false;
        while !told {
            let mut piece = [0; 1024];
            let length = listener
                .read(&mut piece)
                .unwrap_or_else(|error| panic!("{error}"));
            assert!(length > 0, "it was hung up on");
            decoder.feed(&piece[..length], |frame| {
                told |= frame.is_ok_and(|frame| matches!(frame.message, bead_wire::Message::Settings(_)));
            });
        }
        drop(idle);
    });
}

#[test]
fn a_bead_is_asked_from_the_command_line() {
    behind_a_socket(&paper(1, 0.1, Some(1)), |bead| {
        for name in [
            "identity",
            "status",
            "self-test",
            "arm",
            "disarm",
            "reset-counters",
        ] {
            bead.done(&format!("command {name}"));
            bead.done(&format!("command {name} --format json"));
        }
        bead.done("command raw --duration 0.1 --out @raw.csv");
        let text = fs::read_to_string(bead.path("raw.csv")).unwrap_or_else(|error| panic!("{error}"));
        let rows: Vec<Vec<u64>> = text
            .lines()
            .skip(1)
            .map(|row| row.split(',').filter_map(|field| field.parse().ok()).collect())
            .collect();
        // Half of 10 000 scans and the 2200 that the outbox holds at the end, in order, with codes of a chain
        // at rest or struck.
        assert!((4000..7500).contains(&rows.len()), "{}", rows.len());
        assert!(
            rows.iter()
                .all(|row| row.len() == 3 && row[1] < 4096 && row[2] < 4096)
        );
        assert!(rows.is_sorted_by(|a, b| a[0] < b[0]));
        let why = "out of range; a raw stream lasts 10000 ms at most";
        bead.refused("command raw --duration 11 --out @none.csv", why);
    });
}

#[test]
fn a_self_test_that_fails_ends_with_status_1_and_says_what_failed() {
    let mut run = paper(1, 0.1, Some(1));
    run.faults =
        bead_bench::faults::parse("[[fault]]\nat = 0.01\nkind = \"supply\"\nvolts = 2.7\n", "faults")
            .unwrap_or_else(|failure| panic!("{failure}"));
    behind_a_socket(&run, |bead| {
        let (status, why) = bead.run("command self-test");
        assert_eq!(status, 1);
        assert!(why.starts_with("the self-test failed: supply;"), "{why}");
    });
}

#[test]
fn a_key_is_given_used_replaced_and_taken_away_from_the_command_line() {
    let run = paper(1, 0.1, Some(1));
    behind_a_socket(&run, |bead| {
        let unsigned = "unsigned; this bead has a key: sign the request with it, by --key F.key";
        bead.done("settings key --new @first.key");
        bead.refused("command disarm", unsigned);
        // Whoever asks is answered.
        bead.done("command status");
        bead.done("command disarm --key @first.key");

        bead.done("settings key --new @second.key --key @first.key");
        let forged = "forged; signed with another key, for another bead, or changed on the way";
        bead.refused("command arm --key @first.key", forged);
        bead.done("command arm --key @second.key");
        // A signature counts from the boot that the bead is in.
        bead.done("command reboot --key @second.key");
        bead.done("command disarm --key @second.key");

        bead.write("bead.settings", &run.block);
        bead.refused("settings write @bead.settings", unsigned);
        bead.done("settings write @bead.settings --key @second.key");

        bead.done("settings key --remove --key @second.key");
        bead.done("command arm");
    });
}
