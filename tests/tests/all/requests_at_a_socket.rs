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
use bead_line::conversation::Conversation;
use bead_testing::{block, settings_at};
use bead_tests::{paper, planned};
use bead_update::file::UpdateFile;
use bead_update::manifest::DEVELOPMENT_SEED;
use bead_wire::{ANY, UpdateStage};
use clap::Parser;
use object::{Object, ObjectSegment};

use crate::loopback::wires;
use crate::update::{NEW, signed_file};

/// The board of the image.
const BOARD: &str = "stm32f405rg";

/// A bead behind a socket, and a folder.
struct Served<'a> {
    folder: &'a Path,
    address: String,
}

impl Served<'_> {
    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Runs a command line to its end, where `@name` stands for a file in the folder. Returns its exit status
    /// and the line on standard error.
    fn run(&self, line: &str) -> (u8, String) {
        self.type_in(&format!("{line} --timeout 20"))
    }

    /// As [`run`](Self::run), with the time-outs of the command.
    fn type_in(&self, line: &str) -> (u8, String) {
        let words = line.split(' ').map(|word| match word.strip_prefix('@') {
            Some(name) => self.path(name).display().to_string(),
            None => word.to_owned(),
        });
        let port = ["--port", &self.address].map(str::to_owned);
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
fn a_board_on_a_bench_is_checked_from_the_command_line_and_the_wires_are_what_the_last_line_is_about() {
    let mut run = paper(0, 0.1, Some(1));
    let exchanged = "the wires are exchanged: PA0 follows PA5 and PA2 follows PA4; swap them";
    for (pairs, said) in [
        ([("PA4", "PA0"), ("PA5", "PA2")], (0, String::new())),
        ([("PA5", "PA0"), ("PA4", "PA2")], (1, exchanged.to_owned())),
    ] {
        run.wires = wires(&pairs);
        behind_a_socket(&run, |bead| {
            let line = "bench --requests 4 --no-resets --out @capture.json --format json";
            assert_eq!(bead.run(line), said);
            let kept =
                fs::read_to_string(bead.path("capture.json")).unwrap_or_else(|error| panic!("{error}"));
            assert!(
                kept.contains("\"schema_version\"") && kept.contains("\"stm32f405rg\""),
                "{kept}"
            );
            let again = bead.run(line);
            assert!(again.0 == 2 && again.1.contains("already exists"), "{again:?}");
        });
    }
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
    run.faults = planned("[[fault]]\nat = 0.01\nkind = \"supply\"\nvolts = 2.7\n");
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

#[test]
fn an_image_is_flashed_over_the_line_refused_and_taken_back_from_the_command_line() {
    let run = paper(1, 0.1, Some(1));
    behind_a_socket(&run, |bead| {
        let refused = |file: &[u8], status: u8, why: &str| {
            bead.write("new.elf", file);
            let (found, said) = bead.type_in("flash @new.elf");
            assert_eq!(found, status, "{said}");
            assert!(said.contains(why) && !said.contains('\n'), "{said}");
        };
        let file = signed_file(BOARD, "0.1.0", &DEVELOPMENT_SEED);
        for (board, version, seed, why) in [
            (
                "pyboard-1.1",
                "0.1.0",
                &DEVELOPMENT_SEED,
                "for pyboard-1.1, but this board is stm32f405rg",
            ),
            (BOARD, "0.0.9", &DEVELOPMENT_SEED, "0.0.9, older than 0.1.0"),
            (BOARD, "0.1.0", &[7; 32], "not signed with the key"),
        ] {
            let why = format!("refused: image refused; the image is {why}");
            refused(&signed_file(board, version, seed), 1, &why);
        }
        refused(
            &file[..file.len() - 192],
            2,
            "the image is not signed; give the image that",
        );
        let mut changed = file.clone();
        let name = changed.windows(NEW.len()).position(|bytes| bytes == NEW);
        changed[name.expect("it has the name")] = b'A';
        refused(
            &changed,
            2,
            "the image was changed after it was signed, or is cut short",
        );

        // A line that was cut: the bead waits for the rest, and takes the whole anew.
        let open = || {
            let address = bead.address.parse().unwrap_or_else(|error| panic!("{error}"));
            Conversation::open(&address, 0, ANY, Duration::from_secs(60))
                .unwrap_or_else(|error| panic!("{error}"))
        };
        let mut line = open();
        let update = UpdateFile::read(&file).unwrap_or_else(|error| panic!("{error}"));
        let mut parts = 0;
        let cut = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            line.update(&update, false, |_| {
                parts += 1;
                assert!(parts < 20, "the line is cut");
            })
        }));
        assert!(cut.is_err() && parts == 20);
        drop(line);
        refused(
            &resets_at_once(&file),
            1,
            "the new image did not pass its trial, and 0.1.0 (",
        );

        bead.write("new.elf", &file);
        assert_eq!(bead.type_in("flash @new.elf"), (0, String::new()));
        let mut line = open();
        let image = line.image().unwrap_or_else(|error| panic!("{error}"));
        assert!(image.identity.git.as_str().as_bytes().starts_with(NEW));
        assert_eq!(image.stage, UpdateStage::Settled);
    });
}

/// The image of a file with a start that resets the part, signed.
fn resets_at_once(file: &[u8]) -> Vec<u8> {
    /// `nop`; `ldr r0, =0x05fa0004`, `ldr r1, =0xe000ed0c`, `str r0, [r1]`, `b .`, and both words.
    const CODE: [u16; 9] = [
        0xbf00, 0x4801, 0x4902, 0x6008, 0xe7fe, 0x0004, 0x05fa, 0xed0c, 0xe000,
    ];
    let mut file = file.to_vec();
    let (at, address) = {
        let elf = object::File::parse(&*file).unwrap_or_else(|error| panic!("{error}"));
        let reset = elf.entry() & !1;
        let mut segments = elf.segments();
        let segment =
            segments.find(|segment| (segment.address()..segment.address() + segment.size()).contains(&reset));
        let segment = segment.expect("the start lies in a segment");
        (segment.file_range().0 + reset - segment.address(), reset)
    };
    // The words are aligned, with a `nop` before them or without.
    let code = &CODE[usize::from(address.is_multiple_of(4))..];
    for (n, half) in code.iter().enumerate() {
        file[at as usize + 2 * n..][..2].copy_from_slice(&half.to_le_bytes());
    }
    bead_update::file::sign(&file, BOARD, "0.1.0", &DEVELOPMENT_SEED)
        .unwrap_or_else(|error| panic!("{error}"))
}
