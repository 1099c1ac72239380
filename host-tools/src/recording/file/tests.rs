//! Writer and reader against each other.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::layout::{CHUNK, LONGEST_RUN, TOPIC};
use super::read::Pieces;
use super::{About, Part, Recording, RecordingError, State, Writer};
use crate::recording::frames::Item;
use crate::recording::whole::Target;
use bead_wire::{Block, Decoder, Header, Identity, MAX_FRAME, Message, ResetCauses, Settings, encode};
use tempfile::TempDir;

fn sent(boot: u8, sequence: u32, sample_index: u64, message: &Message) -> Vec<u8> {
    encode(
        &Header {
            address: 0,
            boot,
            sequence,
            sample_index,
        },
        message,
        &mut [0; MAX_FRAME],
    )
    .unwrap()
    .to_vec()
}

fn settings(block: &[u8]) -> Message {
    let block = Block::try_from(block).unwrap();
    Settings { block }.into()
}

fn identity(boot: u8) -> Vec<u8> {
    let identity = Identity {
        firmware: "0.1.0".into(),
        git: "abc".into(),
        uid: [1; 12],
        boot: boot.into(),
        reset_cause: ResetCauses::from_bits(4),
        sample_rate_hz: 50_000,
        channels: 2,
    };
    sent(boot, 0, 0, &identity.into())
}

/// Frames of two boots, noise between them, and the head of a frame at the end.
fn stream(frames: u32) -> Vec<u8> {
    let mut stream = Vec::new();
    for boot in 0..2 {
        stream.extend(identity(boot));
        for n in 1..frames {
            // No two runs are alike: a test finds each in the file by its bytes.
            let block = [n.to_le_bytes().as_slice(), &[boot, 0xEE], &[n as u8; 40]].concat();
            stream.extend(sent(boot, n, 1000 * u64::from(n), &settings(&block)));
        }
        stream.extend(b"noise\0");
    }
    stream.extend(&sent(1, frames, 0, &settings(b"unfinished"))[..20]);
    stream
}

fn runs(stream: &[u8]) -> Vec<Vec<u8>> {
    stream
        .split(|&byte| byte == 0)
        .filter(|run| !run.is_empty())
        .map(<[u8]>::to_vec)
        .collect()
}

/// The runs in a recording, without their delimiters.
fn kept(path: &Path) -> Vec<Vec<u8>> {
    let pieces = Pieces::open(path).unwrap();
    pieces
        .map(|piece| {
            let (end, run) = piece.bytes.split_last().unwrap();
            assert_eq!(*end, 0);
            run.to_vec()
        })
        .collect()
}

fn about() -> About {
    About {
        source: "pty".into(),
        firmware: Some("v0.1.0-3-gabc".into()),
        sample_rate_hz: 100_000,
        notes: BTreeMap::from([("bead".into(), "8".into())]),
    }
}

/// A finished recording of `stream`, its folder, and its bytes.
fn recorded(stream: &[u8]) -> (TempDir, PathBuf, Vec<u8>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("strike.mcap");
    let mut writer = Writer::create(&Target::new(&path), &about()).unwrap();
    writer.attach(Part::Scenario, b"title = \"x\"").unwrap();
    for piece in stream.chunks(33) {
        writer.write(piece, None, |_| {}).unwrap();
    }
    writer.attach(Part::EmulatorReport, b"{}").unwrap();
    writer.finish().unwrap();
    let file = fs::read(&path).unwrap();
    (folder, path, file)
}

#[test]
fn every_run_has_the_time_of_the_piece_that_it_ended_in() {
    let stream = stream(50);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("timed.mcap");
    let mut writer = Writer::create(&Target::new(&path), &about()).unwrap();
    let mut expected = Vec::new();
    for (n, piece) in (1_700_000_000_000_000_000..).zip(stream.chunks(97)) {
        let before = writer.written;
        writer.write(piece, Some(n), |_| {}).unwrap();
        expected.extend((before..writer.written).map(|_| Some(n)));
    }
    // What is never ended by a delimiter has no time.
    writer.finish().unwrap();
    expected.push(None);
    let found: Vec<_> = Pieces::open(&path)
        .unwrap()
        .map(|piece| piece.received_ns)
        .collect();
    assert_eq!(found, expected);
    let (_folder, path, _) = recorded(&stream);
    assert!(
        Pieces::open(&path)
            .unwrap()
            .all(|piece| piece.received_ns.is_none())
    );
}

#[test]
fn a_recording_gives_back_every_byte_between_delimiters() {
    let stream = stream(400);
    let (folder, path, _) = recorded(&stream);
    let recording = Recording::open(&path).unwrap();
    assert_eq!(recording.state, State::Whole);
    assert_eq!(recording.warning(), None);
    assert_eq!(recording.about, about());
    assert_eq!(kept(&path), runs(&stream));
    assert_eq!(recording.runs, runs(&stream).len() as u64);
    assert_eq!(recording.parts[&Part::Scenario], b"title = \"x\"");
    assert_eq!(recording.parts[&Part::EmulatorReport], b"{}");
    assert!(!recording.parts.contains_key(&Part::Truth));
    let left: Vec<_> = fs::read_dir(folder.path()).unwrap().collect();
    assert_eq!(left.len(), 1, "only the finished file is left: {left:?}");
}

#[test]
fn what_is_decoded_from_a_recording_is_what_was_decoded_live() {
    let stream = stream(50);
    let (_folder, path, _) = recorded(&stream);
    let mut live = Decoder::new();
    let (mut frames, mut again) = (Vec::new(), Vec::new());
    live.feed(&stream, |result| {
        frames.extend(result.ok().map(|frame| frame.header))
    });
    let mut replayed = Recording::open(&path).unwrap().frames().unwrap();
    again.extend(
        replayed
            .by_ref()
            .filter_map(Item::frame)
            .map(|frame| frame.header),
    );
    assert_eq!(frames.len(), 100);
    assert_eq!(frames, again);
    assert_eq!(replayed.counters().lost, live.counters().lost);
}

#[test]
fn times_are_sample_time_and_go_on_after_a_restart() {
    let (_folder, _, file) = recorded(&stream(3));
    let messages = mcap::MessageStream::new(&file).unwrap().map(Result::unwrap);
    let times: Vec<_> = messages
        .filter(|message| message.channel.topic == TOPIC)
        .map(|message| (message.publish_time / 1000, message.log_time / 1000))
        .collect();
    // 50 kHz as the identity says, not the 100 kHz that was expected: 20 ms for 1000 samples.
    let boot = [(0, 0), (20_000, 20_000), (40_000, 40_000), (40_000, 40_000)];
    let restarted = [
        (0, 40_000),
        (20_000, 60_000),
        (40_000, 80_000),
        (40_000, 80_000),
        (40_000, 80_000),
    ];
    assert_eq!(times, [&boot[..], &restarted[..]].concat());
}

#[test]
fn a_recording_cut_anywhere_gives_back_all_before_the_cut_and_says_so() {
    let stream = stream(200);
    let (_folder, path, file) = recorded(&stream);
    let runs = runs(&stream);
    // Where each message ends in the file: the bytes are stored as they are.
    let mut from = 0;
    let ends: Vec<_> = runs
        .iter()
        .map(|run| {
            let at = file[from..]
                .windows(run.len())
                .position(|window| window == run)
                .unwrap();
            from += at + run.len();
            from
        })
        .collect();
    assert!(file.len() > 2 * CHUNK as usize, "several chunks are cut");
    for cut in (1..file.len()).step_by(37).chain([file.len() - 1]) {
        fs::write(&path, &file[..cut]).unwrap();
        let recording = Recording::open(&path).unwrap();
        let whole = ends.iter().filter(|&&end| end <= cut).count();
        assert_eq!(kept(&path), runs[..whole], "cut at {cut}");
        let State::CutShort { runs_whole } = recording.state else {
            panic!("cut at {cut}: {:?}", recording.state)
        };
        assert!(!runs_whole || whole == runs.len());
        assert!(recording.warning().unwrap().contains(&whole.to_string()));
    }
}

#[test]
fn a_recording_cut_in_its_index_has_lost_no_frame() {
    let (_folder, path, file) = recorded(&stream(20));
    fs::write(&path, &file[..file.len() - 1]).unwrap();
    assert_eq!(
        Recording::open(&path).unwrap().state,
        State::CutShort { runs_whole: true }
    );
}

#[test]
fn a_damaged_byte_anywhere_is_noticed_and_survived() {
    let (_folder, path, file) = recorded(&stream(8));
    for at in mcap::MAGIC.len()..file.len() {
        let mut damaged = file.clone();
        damaged[at] ^= 0x55;
        fs::write(&path, &damaged).unwrap();
        match Recording::open(&path) {
            Ok(recording) => assert_ne!(recording.state, State::Whole, "byte {at}"),
            Err(error) => panic!("byte {at}: {error}"),
        }
    }
}

#[test]
fn an_unfinished_recording_is_readable_and_does_not_bear_the_name() {
    let stream = stream(30);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("strike.mcap");
    let mut writer = Writer::create(&Target::new(&path), &about()).unwrap();
    writer.write(&stream, None, |_| {}).unwrap();
    writer.flush().unwrap();
    // Read while it is written: what a crash would leave.
    let recording = Recording::open(writer.partial_path()).unwrap();
    assert_eq!(recording.state, State::CutShort { runs_whole: false });
    // The last run has no delimiter yet.
    assert_eq!(recording.runs, runs(&stream).len() as u64 - 1);
    assert!(!path.exists());
}

#[test]
fn what_a_crash_left_is_not_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("strike.mcap");
    let crashed = Writer::create(&Target::new(&path), &about()).unwrap();
    let left = crashed.partial_path().to_owned();
    drop(crashed);
    let next = Writer::create(&Target::new(&path), &about()).unwrap();
    assert_ne!(left, next.partial_path());
    next.finish().unwrap();
    assert!(left.exists() && path.exists());
}

#[test]
fn a_name_has_one_writer_at_a_time_and_a_recording_that_comes_second_takes_another() {
    let folder = tempfile::tempdir().unwrap();
    let target = Target::new(folder.path().join("strike.mcap"));
    let first = Writer::create(&target, &about()).unwrap();
    let refused = Writer::create(&target, &about()).err().unwrap();
    assert!(matches!(refused, RecordingError::Busy(_)), "{refused}");
    assert!(refused.to_string().contains("another program"), "{refused}");
    // Where files cannot be locked, the name of the finished file decides.
    fs::write(target.path(), "of another program").unwrap();
    let finished = first.finish().unwrap();
    assert_eq!(finished.path, folder.path().join("strike-2.mcap"));
    assert_eq!(Recording::open(&finished.path).unwrap().state, State::Whole);
    assert_eq!(fs::read_to_string(target.path()).unwrap(), "of another program");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
}

#[test]
fn a_line_without_delimiters_is_recorded_in_pieces() {
    let (_folder, path, _) = recorded(&vec![1; 2 * LONGEST_RUN + 5]);
    let lengths: Vec<_> = kept(&path).iter().map(Vec::len).collect();
    assert_eq!(lengths, [LONGEST_RUN, LONGEST_RUN, 5]);
}

#[test]
fn other_files_are_refused_by_what_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other");
    let refused = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        Recording::open(&path).unwrap_err()
    };
    assert!(matches!(refused(b""), RecordingError::Empty(_)));
    assert!(matches!(
        refused(b"time,force\n0,1\n"),
        RecordingError::NotMcap(_)
    ));
    let mut foreign = mcap::Writer::new(io::Cursor::new(Vec::new())).unwrap();
    foreign.finish().unwrap();
    assert!(matches!(
        refused(&foreign.into_inner().into_inner()),
        RecordingError::NotOurs(..)
    ));
    fs::remove_file(&path).unwrap();
    assert!(matches!(
        Recording::open(&path),
        Err(RecordingError::File { action: "read", .. })
    ));
}
