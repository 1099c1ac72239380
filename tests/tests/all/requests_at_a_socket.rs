//! `bead settings` and `bead command` as their users run them, on the flash image behind a socket.

use std::fs;
use std::io::Read;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use bead::cli::Cli;
use bead_bench::bridge::{Bridge, Door, serve};
use bead_bench::emulation::Emulation;
use bead_tests::{block, paper, settings_at};
use clap::Parser;

/// Runs a command line to its end: its exit status and the line on standard error.
fn bead(arguments: &[&str]) -> (u8, String) {
    match Cli::try_parse_from(["bead"].iter().chain(arguments))
        .unwrap_or_else(|error| panic!("{error}"))
        .run()
    {
        Ok(()) => (0, String::new()),
        Err(failure) => (failure.exit_status(), failure.to_string()),
    }
}

/// Serves the run at a socket while `requests` has its address.
fn behind_a_socket(run: &Emulation, requests: impl FnOnce(&str, &Path)) {
    let folder = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
    let socket = folder.path().join("bead.sock");
    let address = format!("unix:{}", socket.display());
    let stop = AtomicBool::new(false);
    thread::scope(|scope| {
        let server = scope.spawn(|| {
            let at = address.parse().unwrap_or_else(|error| panic!("{error}"));
            let door = Door::open(&at)?;
            let mut bridge = Bridge::new(run, None)?;
            serve(&mut bridge, &door, &stop)
        });
        // The path is there a moment before anybody listens.
        while UnixStream::connect(&socket).is_err() && !server.is_finished() {
            thread::yield_now();
        }
        let answered =
            std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| requests(&address, folder.path())));
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
    behind_a_socket(&run, |port, folder| {
        let path = |name: &str| folder.join(name).display().to_string();
        let read = |name: &str| {
            let arguments = ["settings", "read", "--port", port, "--out", &path(name)];
            assert_eq!(
                bead(&[&arguments[..], &["--timeout", "20"]].concat()),
                (0, String::new())
            );
            fs::read(path(name)).unwrap_or_else(|error| panic!("{error}"))
        };
        assert_eq!(read("first.settings"), run.block);

        let mut other = run.settings;
        other.window.length = 300;
        fs::write(path("other.settings"), block(&other)).unwrap_or_else(|error| panic!("{error}"));
        let write = |name: &str| {
            bead(&[
                "settings",
                "write",
                &path(name),
                "--port",
                port,
                "--timeout",
                "20",
            ])
        };
        assert_eq!(write("other.settings"), (0, String::new()));
        assert_eq!(read("second.settings"), block(&other));
        let arguments = ["settings", "write", &path("other.settings"), "--new-address", "9"];
        assert_eq!(
            bead(&[&arguments[..], &["--port", port, "--timeout", "20"]].concat()),
            (0, String::new())
        );
        let addressed = other
            .with(|bead| bead.address = 9)
            .unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(read("addressed.settings"), block(&addressed));
        assert_eq!(write("other.settings"), (0, String::new()));

        let arguments = ["settings", "set", "address=9", "--port", port, "--timeout", "20"];
        assert_eq!(bead(&arguments), (0, String::new()));
        assert_eq!(read("set.settings"), block(&addressed));
        assert_eq!(write("other.settings"), (0, String::new()));

        fs::write(path("rate.settings"), block(&settings_at(50_000)))
            .unwrap_or_else(|error| panic!("{error}"));
        let refused = "the bead at address 0 refused: sample rate; settings for 50000 Hz; this image samples at 100000 Hz";
        assert_eq!(write("rate.settings"), (1, refused.to_owned()));
        fs::write(path("long.settings"), [0; 257]).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(write("long.settings").0, 2);
        assert_eq!(write("missing.settings").0, 2);

        let command = |name: &str| bead(&["command", name, "--port", port, "--timeout", "20"]);
        assert_eq!(command("reboot"), (0, String::new()));
        assert_eq!(read("third.settings"), block(&other), "kept over the reset");
        assert_eq!(
            bead(&["settings", "reset", "--port", port, "--timeout", "20"]),
            (0, String::new())
        );
        assert_eq!(read("fourth.settings"), run.block);
    });
}

#[test]
fn programs_share_the_line_and_an_idle_one_holds_nobody_up() {
    let run = paper(1, 0.1, Some(1));
    behind_a_socket(&run, |port, folder| {
        let socket = folder.join("bead.sock");
        let connect = || UnixStream::connect(&socket).unwrap_or_else(|error| panic!("{error}"));
        let idle = connect();
        let mut listener = connect();
        let limit = Some(Duration::from_secs(60));
        listener
            .set_read_timeout(limit)
            .unwrap_or_else(|error| panic!("{error}"));
        let out = folder.join("out.settings").display().to_string();
        let arguments = [
            "settings",
            "read",
            "--port",
            port,
            "--out",
            &out,
            "--timeout",
            "20",
        ];
        assert_eq!(bead(&arguments), (0, String::new()));
        assert_eq!(
            fs::read(&out).unwrap_or_else(|error| panic!("{error}")),
            run.block
        );
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
    let run = paper(1, 0.1, Some(1));
    behind_a_socket(&run, |port, folder| {
        let command = |name: &str, more: &[&str]| {
            let arguments = ["command", name, "--port", port, "--timeout", "20"];
            bead(&[&arguments[..], more].concat())
        };
        for name in [
            "identity",
            "status",
            "self-test",
            "arm",
            "disarm",
            "reset-counters",
        ] {
            for more in [&[][..], &["--format", "json"]] {
                assert_eq!(command(name, more), (0, String::new()), "{name}");
            }
        }
        let csv = folder.join("raw.csv");
        let out = ["--out", &csv.display().to_string()].map(str::to_owned);
        let out: Vec<_> = out.iter().map(String::as_str).collect();
        assert_eq!(
            command("raw", &[&["--duration", "0.1"], &out[..]].concat()),
            (0, String::new())
        );
        let text = fs::read_to_string(&csv).unwrap_or_else(|error| panic!("{error}"));
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
        let none = csv.with_extension("none");
        let none = none.to_str().expect("a path in UTF-8");
        let (status, why) = command("raw", &["--duration", "11", "--out", none]);
        assert_eq!(
            (status, &why[..]),
            (
                1,
                "the bead at address 0 refused: out of range; a raw stream lasts 10000 ms at most"
            )
        );
    });
}

#[test]
fn a_self_test_that_fails_ends_with_status_1_and_says_what_failed() {
    let mut run = paper(1, 0.1, Some(1));
    run.faults =
        bead_bench::faults::parse("[[fault]]\nat = 0.01\nkind = \"supply\"\nvolts = 2.7\n", "faults")
            .unwrap_or_else(|failure| panic!("{failure}"));
    behind_a_socket(&run, |port, _| {
        let (status, why) = bead(&["command", "self-test", "--port", port, "--timeout", "20"]);
        assert_eq!(status, 1);
        assert!(why.starts_with("the self-test failed: supply;"), "{why}");
    });
}

#[test]
fn a_key_is_given_used_replaced_and_taken_away_from_the_command_line() {
    let run = paper(1, 0.1, Some(1));
    behind_a_socket(&run, |port, folder| {
        let path = |name: &str| folder.join(name).display().to_string();
        let [first, second] = ["first.key", "second.key"].map(path);
        let said = |arguments: &[&str]| bead(&[arguments, &["--port", port, "--timeout", "20"]].concat());
        let done = (0, String::new());
        let unsigned = "the bead at address 0 refused: unsigned; this bead has a key: sign the request with it, by --key F.key";
        let forged = "the bead at address 0 refused: forged; signed with another key, for another bead, or changed on the way";

        assert_eq!(said(&["settings", "key", "--new", &first]), done);
        assert_eq!(said(&["command", "disarm"]), (1, unsigned.to_owned()));
        assert_eq!(said(&["command", "status"]), done, "whoever asks is answered");
        assert_eq!(said(&["command", "disarm", "--key", &first]), done);

        assert_eq!(
            said(&["settings", "key", "--new", &second, "--key", &first]),
            done
        );
        assert_eq!(said(&["command", "arm", "--key", &first]), (1, forged.to_owned()));
        assert_eq!(said(&["command", "arm", "--key", &second]), done);
        // A signature counts from the boot that the bead is in.
        assert_eq!(said(&["command", "reboot", "--key", &second]), done);
        assert_eq!(said(&["command", "disarm", "--key", &second]), done);

        let settings = path("bead.settings");
        fs::write(&settings, &run.block).unwrap_or_else(|error| panic!("{error}"));
        let write = ["settings", "write", &settings];
        assert_eq!(said(&write), (1, unsigned.to_owned()));
        assert_eq!(said(&[&write[..], &["--key", &second]].concat()), done);

        assert_eq!(said(&["settings", "key", "--remove", "--key", &second]), done);
        assert_eq!(said(&["command", "arm"]), done);
    });
}
