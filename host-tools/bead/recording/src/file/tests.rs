//! Writer and reader against each other.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::{self, Cursor};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use super::contents::BeadChannels;
use super::layout::{LONGEST_RUN, TOPIC};
use super::read::Pieces;
use super::{About, Part, Recording, RecordingError, RecordingOrigin, RecordingWriter, State};
use crate::frames::Item;
use bead_tables::whole::Target;
use bead_testing::{Speaker, one_sample_strike};
use bead_wire::{Block, Message, Settings};
use tempfile::TempDir;

fn settings(block: &[u8]) -> Message {
    let block = Block::try_from(block).unwrap();
    Settings { block }.into()
}

/// Frames of two boots at 50 kHz, noise between them, and the head of a frame at the end.
fn stream(frames: u32) -> Vec<u8> {
    let mut bead = Speaker::at(0);
    for boot in 0..2 {
        (bead.boot, bead.sequence) = (boot, 0);
        let identity = bead_wire::Identity {
            sample_rate_hz: 50_000,
            ..bead.identity()
        };
        bead.say(0, identity);
        for n in 1..frames {
            // No two runs are alike: a test finds each in the file by its bytes.
            let block = [n.to_le_bytes().as_slice(), &[boot as u8, 0xEE], &[n as u8; 40]].concat();
            bead.say(1000 * u64::from(n), settings(&block));
        }
        bead.bytes.extend(b"noise\0");
    }
    let unfinished = bead.frame(0, &settings(b"unfinished"));
    [&bead.bytes[..], &unfinished[..20]].concat()
}

fn runs(stream: &[u8]) -> Vec<Vec<u8>> {
    let runs = stream.split(|&byte| byte == 0).filter(|run| !run.is_empty());
    runs.map(<[u8]>::to_vec).collect()
}

fn frames(stream: &[u8]) -> Vec<Vec<u8>> {
    let is_frame = |run: &Vec<u8>| crate::frames::decode(&[&run[..], &[0]].concat()).1.frames == 1;
    runs(stream).into_iter().filter(is_frame).collect()
}

fn pieces(path: &Path) -> Pieces {
    Pieces::open(path, false, BeadChannels::default()).unwrap()
}

/// The runs in a recording, without their delimiters.
fn kept(path: &Path) -> Vec<Vec<u8>> {
    let run = |bytes: Vec<u8>| bytes.strip_suffix(&[0]).unwrap().to_vec();
    pieces(path).map(|piece| run(piece.bytes)).collect()
}

/// Changes a file in place: a file that is truncated first is written to the disk at once, which is slow.
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
        remarks: Vec::new(),
    }
}

/// A folder, and a writer of the file `strike.mcap` in it.
fn begun() -> (TempDir, PathBuf, RecordingWriter) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("strike.mcap");
    let writer = RecordingWriter::create(&Target::new(&path), &about()).unwrap();
    (folder, path, writer)
}

/// A finished recording of a stream that came in pieces of this length, which the writer flushed some hundred
/// at a time: its folder, path and bytes.
fn recorded(stream: &[u8], length: usize) -> (TempDir, PathBuf, Vec<u8>) {
    let (folder, path, mut writer) = begun();
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
    let (_folder, path, mut writer) = begun();
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
    let (_folder, path, _) = recorded(&stream, 33);
    assert!(pieces(&path).all(|piece| piece.received_ns.is_none()));
}

#[test]
fn a_recording_gives_back_every_byte_between_delimiters() {
    let stream = stream(400);
    let (folder, path, _) = recorded(&stream, 33);
    let recording = Recording::open(&path).unwrap();
    assert_eq!((&recording.state, recording.warning()), (&State::Whole, None));
    assert_eq!(*recording.about, about());
    assert_eq!(kept(&path), runs(&stream));
    assert_eq!(recording.runs, runs(&stream).len() as u64);
    let parts: Vec<_> = recording
        .parts
        .iter()
        .map(|(part, data)| (*part, &**data))
        .collect();
    assert_eq!(
        parts,
        [
            (Part::Scenario, &b"title = \"x\""[..]),
            (Part::EmulatorReport, b"{}")
        ]
    );
    let left: Vec<_> = fs::read_dir(folder.path()).unwrap().collect();
    assert_eq!(left.len(), 1, "only the finished file is left: {left:?}");
}

#[test]
fn times_are_sample_time_and_go_on_after_a_restart() {
    let (_folder, _, file) = recorded(&stream(3), 33);
    let messages = mcap::MessageStream::new(&file).unwrap().map(Result::unwrap);
    let messages = messages.filter(|message| message.channel.topic == TOPIC);
    let (bead, log): (Vec<_>, Vec<_>) = messages
        .map(|message| (message.publish_time / 1_000_000, message.log_time / 1_000_000))
        .unzip();
    // 50 kHz as the identity says, not the 100 kHz that was expected: 20 ms for 1000 samples.
    assert_eq!(bead, [0, 20, 40, 40, 0, 20, 40, 40, 40]);
    assert_eq!(log, [0, 20, 40, 40, 40, 60, 80, 80, 80]);
}

#[test]
fn a_recording_cut_anywhere_gives_back_all_before_the_cut_and_says_so() {
    let stream = stream(200);
    let (_folder, path, file) = recorded(&stream, 33);
    let runs = runs(&stream);
    // The end of each message in the file, which stores the bytes as they are.
    let mut from = 0;
    let end = |run: &Vec<u8>| {
        let at = file[from..].windows(run.len()).position(|window| window == run);
        // With its delimiter.
        from += at.unwrap() + run.len() + 1;
        from
    };
    let ends: Vec<_> = runs.iter().map(end).collect();
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
        let is_index_alone = cut == file.len() - 1;
        assert!(runs_whole || !is_index_alone, "only the end of the index is cut");
        assert!(recording.warning().unwrap().contains(&whole.to_string()));
    }
}

/// Reads a damaged file. Returns the recording, and the number of the `sent` frames that are lost. Checks
/// that those of a single line are in order.
fn salvaged(path: &Path, sent: &[Vec<u8>]) -> (Recording, usize) {
    let recording = Recording::salvage(path).unwrap();
    assert_ne!(recording.state, State::Whole);
    let places: BTreeMap<_, _> = sent.iter().map(Vec::as_slice).zip(0..).collect();
    // Damaged runs are returned as well.
    let place = |bytes: &[u8]| places.get(bytes.strip_suffix(&[0])?).copied();
    let pieces = recording.pieces().unwrap();
    let found: Vec<usize> = pieces.filter_map(|piece| place(&piece.bytes)).collect();
    assert!(found.is_sorted() || !recording.beads.is_empty());
    (recording, sent.len() - found.len())
}

#[test]
fn behind_a_damaged_sector_the_recording_goes_on() {
    const SECTOR: usize = 512;
    let stream = stream(300);
    let (_folder, path, file) = recorded(&stream, 33);
    let sent = frames(&stream);
    let shortest = sent.iter().map(Vec::len).min().unwrap();
    for byte in [0xFF, 0x00, 0x05, 0x06] {
        for at in (0..file.len() - SECTOR).step_by(SECTOR) {
            let mut damaged = file.clone();
            damaged[at..at + SECTOR].fill(byte);
            put(&path, &damaged).unwrap();
            let (_, lost) = salvaged(&path, &sent);
            // The frames in the sector, and one on each of its sides.
            assert!(lost <= SECTOR / shortest + 2, "{byte:#x} at {at}: {lost} lost");
        }
    }
}

#[test]
fn a_flipped_byte_costs_at_most_one_frame() {
    let stream = stream(60);
    let (_folder, one, file) = recorded(&stream, 33);
    // Every byte of the head, of the first messages and of the end; some of the rest.
    let edge = 1500;
    let some = (edge..file.len() - edge).step_by(29);
    let places: Vec<_> = (0..edge)
        .chain(some)
        .chain(file.len() - edge..file.len())
        .collect();
    let folder = tempfile::tempdir().unwrap();
    let three = folder.path().join("three.mcap");
    recorded_of_three(&three);
    let some = (mcap::MAGIC.len()..fs::read(&three).unwrap().len()).step_by(7);
    let of_three = kept(&three);
    for (path, sent, places) in [(one, frames(&stream), places), (three, of_three, some.collect())] {
        let file = fs::read(&path).unwrap();
        for at in places {
            let mut damaged = file.clone();
            damaged[at] ^= 0xFF;
            put(&path, &damaged).unwrap();
            let (recording, lost) = salvaged(&path, &sent);
            assert!(lost <= 1, "byte {at}: {lost} lost: {:?}", recording.state);
        }
    }
}

#[test]
fn a_damaged_recording_says_where_and_how_much_is_missing() {
    let stream = stream(300);
    let (_folder, path, mut file) = recorded(&stream, 33);
    let summary = mcap::Summary::read(&file).unwrap().unwrap();
    let begin = summary.chunk_indexes[1].chunk_start_offset as usize;
    file[begin + 3000..begin + 5000].fill(0);
    put(&path, &file).unwrap();
    let (recording, lost) = salvaged(&path, &frames(&stream));
    let State::Damaged(damage) = &recording.state else {
        panic!("{:?}", recording.state)
    };
    assert_eq!((damage.places, damage.first), (1, Some(begin as u64)));
    assert!((1900..2400).contains(&damage.bytes), "{damage}");
    assert_eq!(recording.runs_missing, lost as u64);
    let warning = recording.warning().unwrap();
    assert!(warning.contains(&format!("{lost} before the last")), "{warning}");
}

#[test]
fn attachments_and_times_behind_damage_are_read() {
    let (_folder, path, mut writer) = begun();
    for (n, piece) in (1_000_000..).zip(stream(300).chunks(97)) {
        writer.write(piece, Some(n), |_| {}).unwrap();
        writer.flush().unwrap();
    }
    writer.attach(Part::Truth, b"{}").unwrap();
    writer.finish().unwrap();
    let times = |path: &Path| -> BTreeMap<Vec<u8>, Option<u64>> {
        let pieces = pieces(path).map(|piece| (piece.bytes, piece.received_ns));
        pieces.collect()
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
    assert!(damaged.len() + 3 >= sound.len(), "{} runs", damaged.len());
    let is_same = |(run, time): (&Vec<u8>, _)| sound.get(run).is_none_or(|sound| sound == time);
    assert!(damaged.iter().all(is_same));
}

#[test]
fn noise_and_a_line_without_delimiters_take_little_more_room_than_they_have_bytes() {
    // Runs of one byte, which took 48 bytes each.
    let noise = b"x\0".repeat(500_000);
    let (_folder, path, file) = recorded(&noise, 64 * 1024);
    assert!(file.len() < noise.len() + noise.len() / 100, "{}", file.len());
    let kept_noise: Vec<u8> = pieces(&path).flat_map(|piece| piece.bytes).collect();
    assert_eq!(kept_noise, noise);
    let (_folder, path, _) = recorded(&vec![1; 2 * LONGEST_RUN + 5], 33);
    let lengths: Vec<_> = kept(&path).iter().map(Vec::len).collect();
    assert_eq!(lengths, [LONGEST_RUN, LONGEST_RUN, 5]);
}

#[test]
fn an_unfinished_recording_is_readable_does_not_bear_the_name_and_is_not_overwritten() {
    let stream = stream(30);
    let (_folder, path, mut writer) = begun();
    writer.write(&stream, None, |_| {}).unwrap();
    writer.flush().unwrap();
    // Read while it is written: what a crash would leave.
    let left = writer.partial_path().to_owned();
    let recording = Recording::open(&left).unwrap();
    assert_eq!(recording.state, State::CutShort { runs_whole: false });
    // The last run has no delimiter yet.
    assert_eq!(recording.runs, runs(&stream).len() as u64 - 1);
    assert!(!path.exists());
    drop(writer);
    let next = RecordingWriter::create(&Target::new(&path), &about()).unwrap();
    assert_ne!(left, next.partial_path());
    next.finish().unwrap();
    assert!(left.exists() && path.exists());
}

#[test]
fn a_name_has_one_writer_at_a_time_and_a_recording_that_comes_second_takes_another() {
    let (folder, path, first) = begun();
    let refused = RecordingWriter::create(&Target::new(&path), &about())
        .err()
        .unwrap();
    assert!(matches!(refused, RecordingError::Busy(_)), "{refused}");
    assert!(refused.to_string().contains("another program"), "{refused}");
    // On a file system without locks, the name of the finished file decides.
    fs::write(&path, "of another program").unwrap();
    let finished = first.finish().unwrap();
    assert_eq!(finished.path, folder.path().join("strike-2.mcap"));
    assert_eq!(Recording::open(&finished.path).unwrap().state, State::Whole);
    assert_eq!(fs::read_to_string(&path).unwrap(), "of another program");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
}

#[test]
fn a_recording_that_goes_on_in_other_files_has_each_run_once_and_never_cuts_a_strike() {
    let mut bead = Speaker {
        boot: 1,
        sequence: 100,
        bytes: [&stream(20)[..], &[0]].concat(),
        ..Speaker::at(0)
    };
    for strike in 0..20 {
        let [waveform, _, shape] = one_sample_strike(strike, 0);
        let frames = [waveform.clone(), waveform, shape];
        frames.into_iter().for_each(|frame| bead.say(0, frame));
    }
    let sent = bead.bytes;
    for length in [7, 97, 1000] {
        let (folder, path, mut writer) = begun();
        let path_of = |name: &str| folder.path().join(name);
        fs::write(path_of("strike-3.mcap"), "of another program").unwrap();
        let mut files = Vec::new();
        for (n, piece) in (1..).zip(sent.chunks(length)) {
            writer.write(piece, Some(n), |_| {}).unwrap();
            files.extend(writer.split(Duration::ZERO).unwrap());
        }
        let finished = writer.finish().unwrap();
        assert_eq!(finished.counters.frames, 40 + 60);
        files.push(finished.path);
        assert_eq!(
            files[..3],
            [path, path_of("strike-2.mcap"), path_of("strike-4.mcap")]
        );
        let all: Vec<_> = files.iter().flat_map(|file| kept(file)).collect();
        // Runs that are not frames may share a message.
        assert!(all.join(&0) == runs(&sent).join(&0), "pieces of {length} bytes");
        for file in &files {
            let recording = Recording::open(file).unwrap();
            assert_eq!((&recording.state, &*recording.about), (&State::Whole, &about()));
            let frames: Vec<_> = recording.frames().unwrap().filter_map(Item::frame).collect();
            let count = |is: fn(&Message) -> bool| frames.iter().filter(|frame| is(&frame.message)).count();
            let windows = count(|message| matches!(message, Message::Waveform(_)));
            let shapes = count(|message| matches!(message, Message::Shape(_)));
            assert_eq!(windows, 2 * shapes, "{}", file.display());
        }
        // Each file begins with the piece in which the first of its runs ended.
        let times = files
            .iter()
            .flat_map(|file| pieces(file))
            .map(|piece| piece.received_ns);
        let times: Vec<_> = times.collect();
        assert!(times.is_sorted() && times[0].is_some());
    }
}

/// A file with no more than a channel, its library, and messages on it.
fn foreign(library: &str, topic: &str, metadata: &[(&str, &str)], data: &[&[u8]]) -> Vec<u8> {
    let options = mcap::WriteOptions::new().compression(None).library(library);
    let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
    let metadata = metadata
        .iter()
        .map(|(key, value)| ((*key).to_owned(), (*value).to_owned()));
    let channel_id = writer
        .add_channel(0, topic, "bead-wire", &metadata.collect())
        .unwrap();
    for data in data {
        let header = mcap::records::MessageHeader {
            channel_id,
            sequence: 0,
            log_time: 0,
            publish_time: 0,
        };
        writer.write_to_known_channel(&header, data).unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

#[test]
fn other_mcap_files_are_refused_by_what_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other");
    let refused = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        Recording::open(&path).unwrap_err()
    };
    let topic = format!("\u{1b}{}", "x".repeat(100_000));
    let message = refused(&foreign(&"y".repeat(100_000), &topic, &[], &[])).to_string();
    assert!(
        message.contains("the channels `\\u001bxxx") && message.contains("written by `yyy"),
        "{message}"
    );
    assert!(message.len() < 600, "{} bytes", message.len());
    // All of its frames are of a future version of the protocol.
    let later = foreign("bead 9.9", TOPIC, &[("version", "9")], &[b"\x03\x09\x01\0"]);
    let message = refused(&later).to_string();
    let expected = "version 9 of the protocol, written by `bead 9.9`, and this program";
    assert!(
        message.contains(expected) && message.contains("use the program"),
        "{message}"
    );
}

/// Three beads with addresses 7, 8 and 200, whose pieces come in turn.
fn recorded_of_three(path: &Path) -> Vec<Speaker> {
    let mut writer = RecordingWriter::create_for_several(&Target::new(path), &about()).unwrap();
    writer.attach(Part::Scenario, b"title = \"x\"").unwrap();
    let beads = [7, 8, 200].map(|address: u8| {
        let origin = RecordingOrigin {
            address,
            bead: Some(address.into()),
            port: Some(format!("/dev/ttyACM{address}")),
            clock: None,
        };
        let bead = writer.join(&origin).unwrap();
        writer.attach_to(bead, Part::Settings, &[address]).unwrap();
        let mut speaker = Speaker::at(address);
        for n in 0..60 {
            speaker.say(
                1000 * n,
                settings(&[n as u8, address, 0xEE, 1, 2, 3, 4, 5, 6, 7, 8, 9]),
            );
        }
        (bead, speaker)
    });
    for at in (0..beads[0].1.bytes.len()).step_by(50) {
        for (n, (bead, speaker)) in beads.iter().enumerate() {
            let piece = &speaker.bytes[at..speaker.bytes.len().min(at + 50)];
            let time = 1_000_000 + 1000 * at as u64 + n as u64;
            writer.write_of(*bead, piece, Some(time), |_| {}).unwrap();
        }
    }
    writer.finish().unwrap();
    beads.map(|(_, speaker)| speaker).into()
}

#[test]
fn each_bead_of_several_gives_back_its_own_bytes_times_and_attachments() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("three.mcap");
    let speakers = recorded_of_three(&path);
    let recording = Recording::open(&path).unwrap();
    assert_eq!((&recording.state, recording.runs_missing), (&State::Whole, 0));
    assert_eq!(recording.parts.keys().collect::<Vec<_>>(), [&Part::Scenario]);
    assert_eq!(recording.beads.len(), 3);
    for (speaker, bead) in speakers.iter().zip(&recording.beads) {
        let (address, port) = (speaker.address, format!("/dev/ttyACM{}", speaker.address));
        assert_eq!(
            (bead.origin.address, bead.origin.port.as_ref()),
            (address, Some(&port))
        );
        let alone = recording.of(bead);
        // There can be 254 of these, and an attachment may have megabytes.
        let [own, shared] = [&alone, &recording].map(|recording| &recording.parts[&Part::Scenario]);
        assert!(Arc::ptr_eq(own, shared));
        assert_eq!(*alone.parts[&Part::Settings], [address]);
        let pieces: Vec<_> = alone.pieces().unwrap().collect();
        assert!(pieces.iter().all(|piece| piece.received_ns >= Some(1_000_000)));
        let kept: Vec<u8> = pieces.into_iter().flat_map(|piece| piece.bytes).collect();
        assert_eq!(runs(&kept), runs(&speaker.bytes));
    }
    // Through the one iterator, in the order received.
    let frames: Vec<_> = recording.frames().unwrap().filter_map(Item::frame).collect();
    assert_eq!(frames.len(), 180);
    assert!(frames.is_sorted_by_key(|frame| frame.received_ns));
    let addresses: BTreeSet<u8> = frames.iter().map(|frame| frame.header.address).collect();
    assert_eq!(addresses, BTreeSet::from([7, 8, 200]));
}
