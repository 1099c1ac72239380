//! Writer and reader against each other.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use super::contents::BeadChannels;
use super::layout::{LONGEST_RUN, TOPIC};
use super::read::Pieces;
use super::{About, Origin, Part, Recording, RecordingError, State, Writer};
use crate::frames::Item;
use bead_tables::whole::Target;
use bead_wire::{Block, Header, Identity, Kind, MAX_FRAME, Message, ResetCauses, Settings, encode};
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

/// The frames among the runs.
fn frames(stream: &[u8]) -> Vec<Vec<u8>> {
    let is_frame = |run: &Vec<u8>| crate::frames::decode(&[&run[..], &[0]].concat()).1.frames == 1;
    runs(stream).into_iter().filter(is_frame).collect()
}

fn pieces(path: &Path) -> Pieces {
    Pieces::open(path, false, BeadChannels::default()).unwrap()
}

/// The runs in a recording, without their delimiters.
fn kept(path: &Path) -> Vec<Vec<u8>> {
    pieces(path)
        .map(|piece| {
            let (end, run) = piece.bytes.split_last().unwrap();
            assert_eq!(*end, 0);
            run.to_vec()
        })
        .collect()
}

/// Changes a file in place: one that is cut to nothing first is written to the disk at once, which takes
/// long.
fn put(path: &Path, bytes: &[u8]) -> io::Result<()> {
    use std::os::unix::fs::FileExt;
    let file = fs::OpenOptions::new().write(true).open(path)?;
    file.write_all_at(bytes, 0)?;
    file.set_len(bytes.len() as u64)
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
    recorded_in(stream, 33)
}

/// A finished recording of a stream that came in pieces of this length, of which the writer flushed some
/// hundred at a time.
fn recorded_in(stream: &[u8], length: usize) -> (TempDir, PathBuf, Vec<u8>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("strike.mcap");
    let mut writer = Writer::create(&Target::new(&path), &about()).unwrap();
    writer.attach(Part::Scenario, b"title = \"x\"").unwrap();
    for (n, piece) in (1..).zip(stream.chunks(length)) {
        writer.write(piece, None, |_| {}).unwrap();
        if n % 300 == 0 {
            writer.flush().unwrap();
        }
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
        let before = writer.streams[0].written;
        writer.write(piece, Some(n), |_| {}).unwrap();
        expected.extend((before..writer.streams[0].written).map(|_| Some(n)));
    }
    writer.finish().unwrap();
    // The last run, which no delimiter ended, came with the last piece.
    let last = stream.chunks(97).count() as u64 - 1;
    expected.push(Some(1_700_000_000_000_000_000 + last));
    let found: Vec<_> = pieces(&path).map(|piece| piece.received_ns).collect();
    assert_eq!(found, expected);
    let (_folder, path, _) = recorded(&stream);
    assert!(pieces(&path).all(|piece| piece.received_ns.is_none()));
}

#[test]
fn a_recording_gives_back_every_byte_between_delimiters() {
    let stream = stream(400);
    let (folder, path, _) = recorded(&stream);
    let recording = Recording::open(&path).unwrap();
    assert_eq!(recording.state, State::Whole);
    assert_eq!(recording.warning(), None);
    assert_eq!(*recording.about, about());
    assert_eq!(kept(&path), runs(&stream));
    assert_eq!(recording.runs, runs(&stream).len() as u64);
    assert_eq!(*recording.parts[&Part::Scenario], *b"title = \"x\"");
    assert_eq!(*recording.parts[&Part::EmulatorReport], *b"{}");
    assert!(!recording.parts.contains_key(&Part::Truth));
    let left: Vec<_> = fs::read_dir(folder.path()).unwrap().collect();
    assert_eq!(left.len(), 1, "only the finished file is left: {left:?}");
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
            // With its delimiter.
            from += at + run.len() + 1;
            from
        })
        .collect();
    let summary = mcap::Summary::read(&file).unwrap().unwrap();
    assert!(summary.chunk_indexes.len() > 2, "several chunks are cut");
    for cut in (1..file.len()).step_by(37).chain([file.len() - 1]) {
        put(&path, &file[..cut]).unwrap();
        let recording = Recording::open(&path).unwrap();
        let whole = ends.iter().filter(|&&end| end <= cut).count();
        assert_eq!(kept(&path), runs[..whole], "cut at {cut}");
        let State::CutShort { runs_whole } = recording.state else {
            panic!("cut at {cut}: {:?}", recording.state)
        };
        assert!(!runs_whole || whole == runs.len());
        assert!(
            runs_whole || cut < file.len() - 1,
            "only the end of the index is cut"
        );
        assert!(recording.warning().unwrap().contains(&whole.to_string()));
    }
}

/// Checks a damaged file: its runs are those that were sent, in order, and some may be missing.
fn salvaged(path: &Path, sent: &[Vec<u8>]) -> (Recording, usize) {
    let recording = Recording::salvage(path).unwrap();
    let mut rest = sent.iter();
    let mut sound = 0;
    for piece in recording.pieces().unwrap() {
        let run = piece.bytes.split_last().unwrap().1;
        // A run that is damaged itself is given back as well.
        let mut behind = rest.clone();
        if behind.any(|sent| sent == run) {
            rest = behind;
            sound += 1;
        }
    }
    (recording, sound)
}

#[test]
fn behind_a_damaged_sector_the_recording_goes_on() {
    const SECTOR: usize = 512;
    let stream = stream(300);
    let (_folder, path, file) = recorded(&stream);
    let sent = frames(&stream);
    let shortest = sent.iter().map(Vec::len).min().unwrap();
    for byte in [0xFF, 0x00, 0x05, 0x06] {
        for at in (0..file.len() - SECTOR).step_by(SECTOR) {
            let mut damaged = file.clone();
            damaged[at..at + SECTOR].fill(byte);
            put(&path, &damaged).unwrap();
            let (recording, sound) = salvaged(&path, &sent);
            let lost = sent.len() - sound;
            assert_ne!(recording.state, State::Whole, "{byte:#x} at {at}");
            // Those in the sector, and one on each of its sides.
            assert!(lost <= SECTOR / shortest + 2, "{byte:#x} at {at}: {lost} lost");
        }
    }
}

#[test]
fn a_flipped_byte_costs_at_most_one_frame() {
    let stream = stream(60);
    let (_folder, path, file) = recorded(&stream);
    let sent = frames(&stream);
    // Every byte of the head, of the first messages and of the end; some of the rest.
    let edge = 1500;
    let some = (edge..file.len() - edge).step_by(29);
    for at in (0..edge).chain(some).chain(file.len() - edge..file.len()) {
        let mut damaged = file.clone();
        damaged[at] ^= 0xFF;
        put(&path, &damaged).unwrap();
        let (recording, sound) = salvaged(&path, &sent);
        assert_ne!(recording.state, State::Whole, "byte {at}");
        assert!(
            sound + 1 >= sent.len(),
            "byte {at}: {sound} of {}: {:?}",
            sent.len(),
            recording.state,
        );
    }
}

#[test]
fn a_damaged_recording_says_where_and_how_much_is_missing() {
    let stream = stream(300);
    let (_folder, path, file) = recorded(&stream);
    let summary = mcap::Summary::read(&file).unwrap().unwrap();
    let chunk = &summary.chunk_indexes[1];
    let begin = chunk.chunk_start_offset as usize;
    let mut damaged = file.clone();
    damaged[begin + 3000..begin + 5000].fill(0);
    put(&path, &damaged).unwrap();
    let (recording, sound) = salvaged(&path, &frames(&stream));
    let State::Damaged(damage) = &recording.state else {
        panic!("{:?}", recording.state)
    };
    assert_eq!((damage.places, damage.first), (1, Some(begin as u64)));
    assert!((1900..2400).contains(&damage.bytes), "{damage}");
    let missing = recording.runs_missing as usize;
    assert_eq!(missing, frames(&stream).len() - sound);
    let said = recording.warning().unwrap();
    assert!(said.contains(&format!("{missing} before the last")), "{said}");
}

#[test]
fn what_is_attached_and_received_behind_damage_is_read() {
    let stream = stream(300);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("timed.mcap");
    let mut writer = Writer::create(&Target::new(&path), &about()).unwrap();
    for (n, piece) in (1_000_000..).zip(stream.chunks(97)) {
        writer.write(piece, Some(n), |_| {}).unwrap();
        writer.flush().unwrap();
    }
    writer.attach(Part::Truth, b"{}").unwrap();
    writer.finish().unwrap();
    let times = |path: &Path| -> BTreeMap<Vec<u8>, Option<u64>> {
        pieces(path)
            .map(|piece| (piece.bytes, piece.received_ns))
            .collect()
    };
    let (sound, mut file) = (times(&path), fs::read(&path).unwrap());
    // The length of a chunk, and a byte in the records of another one.
    let chunks = mcap::Summary::read(&file).unwrap().unwrap().chunk_indexes;
    file[chunks[50].chunk_start_offset as usize + 2] ^= 1;
    file[chunks[90].chunk_start_offset as usize + 100] ^= 1;
    put(&path, &file).unwrap();
    let recording = Recording::open(&path).unwrap();
    assert_eq!(*recording.parts[&Part::Truth], *b"{}");
    assert!(matches!(&recording.state, State::Damaged(damage) if damage.places == 2));
    let damaged = times(&path);
    assert!(
        damaged.len() + 3 >= sound.len(),
        "{} of {}",
        damaged.len(),
        sound.len()
    );
    assert!(
        damaged
            .iter()
            .all(|(run, time)| sound.get(run).is_none_or(|sound| sound == time))
    );
}

/// Heads of records that go on for megabytes, each within the one before or behind a byte that is none.
#[test]
fn a_file_that_seems_to_hold_far_more_than_it_has_is_read_in_time() {
    let (_folder, path, bytes) = recorded(&stream(20));
    let sound = &bytes[..bytes.len() / 2];
    let size: usize = 8 << 20;
    let record = |opcode: u8, length: usize| [&[opcode][..], &(length as u64).to_le_bytes()].concat();
    let chunk = |length: usize| {
        let number = (length as u64).to_le_bytes();
        // Two times, the size, a CRC, no name of a compression, the size again.
        [
            &record(6, length + 40)[..],
            &[0; 16],
            &number,
            &[1; 4],
            &[0; 4],
            &number,
        ]
        .concat()
    };
    let message = |length: usize| [&record(5, length)[..], &[1, 0], &[0; 20]].concat();
    type Head<'a> = &'a dyn Fn(usize) -> Vec<u8>;
    let heads: [(Head<'_>, usize); 6] = [
        (&|left| record(4, left / 2), 0),
        (&|left| message(left.saturating_sub(9)), 0),
        (&|left| chunk(left.saturating_sub(49)), 0),
        // Behind the end of the file.
        (&|left| chunk(left + 1), 0),
        (&|_| chunk(1), 2),
        (&|_| chunk(0), 1),
    ];
    for (n, (head, behind)) in heads.into_iter().enumerate() {
        let mut bytes = sound.to_vec();
        while bytes.len() < size {
            bytes.extend(head(size - bytes.len()));
            bytes.extend(std::iter::repeat_n(0xFF, behind));
        }
        fs::write(&path, &bytes).unwrap();
        let started = std::time::Instant::now();
        let handed: usize = Recording::salvage(&path)
            .unwrap()
            .pieces()
            .unwrap()
            .map(|piece| piece.bytes.len())
            .sum();
        let took = started.elapsed();
        assert!(handed <= bytes.len(), "{n}: {handed} of {} bytes", bytes.len());
        assert!(took < Duration::from_secs(20), "{n}: {took:?}");
    }
}

/// The library slices the data of an attachment without a look at its length.
#[test]
fn an_attachment_that_is_too_short_for_its_own_length_is_damage() {
    let (_folder, path, bytes) = recorded(&stream(5));
    let text = |text: &str| [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat();
    let attachment = [
        &[0; 16][..],
        &text("settings.bin"),
        &text("x"),
        &7_u64.to_le_bytes(),
    ]
    .concat();
    for length in 0..=attachment.len() {
        let record = [&[9][..], &(length as u64).to_le_bytes(), &attachment[..length]].concat();
        let mut bytes = bytes.clone();
        let at = mcap::MAGIC.len();
        bytes.splice(at..at, record);
        fs::write(&path, &bytes).unwrap();
        let recording = Recording::open(&path).unwrap();
        assert!(
            matches!(recording.state, State::Damaged(_)),
            "{length}: {:?}",
            recording.state
        );
        assert_eq!(recording.parts.get(&Part::Settings), None);
    }
}

#[test]
fn five_gigabytes_of_nothing_are_passed_over() {
    let stream = stream(30);
    let (_folder, path, file) = recorded(&stream);
    // A file system that lost its blocks gives zeros, and a sparse file takes no room.
    let hole: u64 = 5 << 30;
    let middle = file.len() / 2;
    let sparse = fs::File::create(&path).unwrap();
    use std::os::unix::fs::FileExt;
    sparse.write_all_at(&file[..middle], 0).unwrap();
    sparse
        .write_all_at(&file[middle..], middle as u64 + hole)
        .unwrap();
    let (recording, sound) = salvaged(&path, &frames(&stream));
    let State::Damaged(damage) = &recording.state else {
        panic!("{:?}", recording.state)
    };
    // Beside the frames, a chunk has the schemas of channels.
    assert!(damage.bytes.abs_diff(hole) < 20_000, "{damage}");
    assert!(sound + 1 >= frames(&stream).len(), "{sound}");
}

#[test]
fn noise_takes_little_more_room_than_it_has_bytes() {
    // Runs of one byte, which took 48 bytes each.
    let noise = b"x\0".repeat(500_000);
    let (_folder, path, file) = recorded_in(&noise, 64 * 1024);
    assert!(file.len() < noise.len() + noise.len() / 100, "{}", file.len());
    let kept: Vec<u8> = Recording::open(&path)
        .unwrap()
        .pieces()
        .unwrap()
        .flat_map(|piece| piece.bytes)
        .collect();
    assert_eq!(kept, noise);
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
fn a_recording_that_goes_on_in_other_files_has_each_run_once_and_never_cuts_a_strike() {
    let strike = |n: u32| {
        let codes = bead_wire::Codes::pack((0..8).map(|code| [code, code])).unwrap();
        let waveform = bead_wire::Waveform {
            strike: n,
            first_index: u64::from(n),
            codes,
            wide: bead_wire::Codes::default(),
            absorbed_measured: bead_wire::Energy::from_bits(0),
            absorbed_predicted: bead_wire::Energy::from_bits(0),
        };
        let Message::Shape(shape) = Message::draw(Kind::Shape, &mut || 0) else {
            panic!("a shape");
        };
        let shape = bead_wire::Shape { strike: n, ..shape };
        let frames = [waveform.clone().into(), waveform.into(), shape.into()];
        let frames = (3 * n..).zip(frames);
        frames.flat_map(|(sequence, message)| sent(1, 100 + sequence, u64::from(sequence), &message))
    };
    let mut sent: Vec<u8> = stream(20);
    sent.push(0);
    sent.extend((0..20).flat_map(strike));
    for length in [7, 97, 1000] {
        let folder = tempfile::tempdir().unwrap();
        let target = Target::new(folder.path().join("long.mcap"));
        fs::write(folder.path().join("long-3.mcap"), "of another program").unwrap();
        let mut writer = Writer::create(&target, &about()).unwrap();
        let mut files = Vec::new();
        for (n, piece) in (1..).zip(sent.chunks(length)) {
            writer.write(piece, Some(n), |_| {}).unwrap();
            files.extend(writer.split(Duration::ZERO).unwrap());
        }
        let finished = writer.finish().unwrap();
        assert_eq!(finished.counters.frames, 40 + 60);
        files.push(finished.path);
        assert_eq!(files[0], target.path());
        assert_eq!(files[1], folder.path().join("long-2.mcap"));
        assert_eq!(files[2], folder.path().join("long-4.mcap"));
        let all: Vec<_> = files.iter().flat_map(|file| kept(file)).collect();
        // Runs that are no frames may stand in one message.
        assert!(all.join(&0) == runs(&sent).join(&0), "pieces of {length} bytes");
        for file in &files {
            let recording = Recording::open(file).unwrap();
            assert_eq!(recording.state, State::Whole);
            assert_eq!(*recording.about, about());
            let (mut begun, mut ended) = (0, 0);
            for item in recording.frames().unwrap() {
                match item.frame().map(|frame| frame.message) {
                    Some(Message::Waveform(_)) => begun += 1,
                    Some(Message::Shape(_)) => ended += 2,
                    _ => {}
                }
            }
            assert_eq!(begun, ended, "{}", file.display());
        }
        // Each file begins with the piece in which the first of its runs ended.
        let times: Vec<_> = files
            .iter()
            .flat_map(|file| pieces(file))
            .map(|piece| piece.received_ns)
            .collect();
        assert!(times.is_sorted() && times[0].is_some());
    }
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
    let mut foreign = mcap::WriteOptions::new()
        .compression(None)
        .library("y".repeat(100_000))
        .create(io::Cursor::new(Vec::new()))
        .unwrap();
    for end in ["1", "2"] {
        let name = "\u{1b}".to_owned() + &"x".repeat(100_000) + end;
        foreign.add_channel(0, &name, "x", &BTreeMap::new()).unwrap();
    }
    foreign.finish().unwrap();
    let told = refused(&foreign.into_inner().into_inner()).to_string();
    assert!(
        told.contains("the channels `\\u001bxxx") && told.contains("written by `yyy"),
        "{told}"
    );
    assert!(told.len() < 600, "{} bytes", told.len());
    // All of its frames are of a version of the protocol to come.
    let mut later = mcap::WriteOptions::new()
        .compression(None)
        .library("bead 9.9")
        .create(io::Cursor::new(Vec::new()))
        .unwrap();
    let version = BTreeMap::from([("version".to_owned(), "9".to_owned())]);
    let channel_id = later.add_channel(0, TOPIC, "bead-wire", &version).unwrap();
    let header = mcap::records::MessageHeader {
        channel_id,
        sequence: 0,
        log_time: 0,
        publish_time: 0,
    };
    later.write_to_known_channel(&header, b"\x03\x09\x01\0").unwrap();
    later.finish().unwrap();
    let said = refused(&later.into_inner().into_inner()).to_string();
    assert!(
        said.contains("version 9 of the protocol, written by `bead 9.9`") && said.contains("use the program"),
        "{said}"
    );
    fs::remove_file(&path).unwrap();
    assert!(matches!(
        Recording::open(&path),
        Err(RecordingError::File { action: "read", .. })
    ));
}

/// Three beads with addresses 7, 8 and 200, whose pieces come in turn.
fn recorded_of_three(path: &Path) -> Vec<(u8, Vec<u8>)> {
    let mut writer = Writer::create_for_several(&Target::new(path), &about()).unwrap();
    writer.attach(Part::Scenario, b"title = \"x\"").unwrap();
    let streams: Vec<_> = [7, 8, 200]
        .map(|address: u8| {
            let origin = Origin {
                address,
                bead: Some(address.into()),
                port: Some(format!("/dev/ttyACM{address}")),
                clock: None,
            };
            let bead = writer.join(&origin).unwrap();
            writer.attach_to(bead, Part::Settings, &[address]).unwrap();
            let stream: Vec<u8> = (0..60)
                .flat_map(|n| {
                    let header = Header {
                        address,
                        boot: 0,
                        sequence: n,
                        sample_index: 1000 * u64::from(n),
                    };
                    let block = [n as u8, address, 0xEE, 1, 2, 3, 4, 5, 6, 7, 8, 9];
                    encode(&header, &settings(&block), &mut [0; MAX_FRAME])
                        .unwrap()
                        .to_vec()
                })
                .collect();
            (bead, address, stream)
        })
        .into();
    for at in (0..streams[0].2.len()).step_by(50) {
        for (n, (bead, _, stream)) in streams.iter().enumerate() {
            let piece = &stream[at..stream.len().min(at + 50)];
            let time = 1_000_000 + 1000 * at as u64 + n as u64;
            writer.write_of(*bead, piece, Some(time), |_| {}).unwrap();
        }
    }
    writer.finish().unwrap();
    streams
        .into_iter()
        .map(|(_, address, stream)| (address, stream))
        .collect()
}

#[test]
fn each_bead_of_several_gives_back_its_own_bytes_times_and_attachments() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("three.mcap");
    let streams = recorded_of_three(&path);
    let recording = Recording::open(&path).unwrap();
    assert_eq!(
        (recording.state.clone(), recording.runs_missing),
        (State::Whole, 0)
    );
    assert_eq!(recording.parts.keys().collect::<Vec<_>>(), [&Part::Scenario]);
    assert_eq!(recording.beads.len(), 3);
    for ((address, stream), bead) in streams.iter().zip(&recording.beads) {
        assert_eq!(bead.origin.address, *address);
        assert_eq!(
            bead.origin.port.as_deref(),
            Some(format!("/dev/ttyACM{address}").as_str())
        );
        let alone = recording.of(bead);
        // There can be 254 of these, and an attachment may have megabytes.
        let [own, shared] = [&alone, &recording].map(|recording| &recording.parts[&Part::Scenario]);
        assert!(Arc::ptr_eq(own, shared));
        assert_eq!(*alone.parts[&Part::Settings], [*address]);
        let pieces: Vec<_> = alone.pieces().unwrap().collect();
        let kept: Vec<u8> = pieces.iter().flat_map(|piece| &piece.bytes).copied().collect();
        assert_eq!(runs(&kept), runs(stream));
        assert!(
            pieces
                .iter()
                .all(|piece| piece.received_ns.is_some_and(|ns| ns >= 1_000_000))
        );
    }
    // Through the one iterator, in the order received.
    let frames: Vec<_> = recording.frames().unwrap().filter_map(Item::frame).collect();
    assert_eq!(frames.len(), 180);
    assert!(frames.is_sorted_by_key(|frame| frame.received_ns));
    let of = |address| frames.iter().filter(move |frame| frame.header.address == address);
    assert!([7, 8, 200].iter().all(|address| of(*address).count() == 60));
}

#[test]
fn a_second_bead_with_the_same_address_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let target = Target::new(folder.path().join("two.mcap"));
    let mut writer = Writer::create_for_several(&target, &about()).unwrap();
    let origin = Origin {
        address: 7,
        ..Origin::default()
    };
    writer.join(&origin).unwrap();
    let refused = writer.join(&origin).unwrap_err();
    assert!(
        refused.to_string().contains("two beads have the address 7"),
        "{refused}"
    );
}

#[test]
fn a_flipped_byte_in_a_recording_of_several_costs_at_most_one_frame() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("three.mcap");
    recorded_of_three(&path);
    let file = fs::read(&path).unwrap();
    let sent: std::collections::BTreeSet<_> = kept(&path).into_iter().collect();
    for at in (mcap::MAGIC.len()..file.len()).step_by(7) {
        let mut damaged = file.clone();
        damaged[at] ^= 0xFF;
        put(&path, &damaged).unwrap();
        let recording = Recording::salvage(&path).unwrap();
        assert_ne!(recording.state, State::Whole, "byte {at}");
        let pieces = recording.pieces().unwrap();
        let sound = pieces.filter(|piece| sent.contains(&piece.bytes[..piece.bytes.len() - 1]));
        let sound = sound.count();
        assert!(sound + 1 >= sent.len(), "byte {at}: {sound} of {}", sent.len());
    }
}
