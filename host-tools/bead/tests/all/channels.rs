//! Recordings as programs see them that know nothing of beads: schemas, values in SI units, times of the
//! host.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use bead_recording::file::{About, Recording, RecordingError, Writer};
use bead_recording::frames::Item;
use bead_recording::signal::Signal;
use bead_recording::strikes::assemble;
use bead_tables::whole::Target;
use prost::Message as _;
use prost::encoding::{WireType, decode_key, decode_varint};
use prost_types::field_descriptor_proto::Type;
use prost_types::{DescriptorProto, FileDescriptorSet};
use serde_json::Value;

const OLD: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/recording-v1.mcap");
/// When the first piece of it is received once more, ns since 1970.
const STARTED: u64 = 1_700_000_000_000_000_000;

/// The strike of `tests/data`, recorded by today's program, with the host's times.
fn recorded(folder: &Path) -> PathBuf {
    let path = folder.join("strike.mcap");
    let mut writer = Writer::create(&Target::new(&path), &About::default()).unwrap();
    for (n, piece) in (0..).zip(Recording::open(Path::new(OLD)).unwrap().pieces().unwrap()) {
        writer
            .write(&piece.bytes, Some(STARTED + n * 1_000_000), |_| {})
            .unwrap();
    }
    writer.finish().unwrap();
    path
}

/// The fields of a Protobuf message, by name, as its own schema says. Repeated fields have several values.
fn decoded(schema: &DescriptorProto, mut data: &[u8]) -> BTreeMap<String, Vec<Value>> {
    let mut fields = BTreeMap::<String, Vec<Value>>::new();
    while !data.is_empty() {
        let (number, wire) = decode_key(&mut data).unwrap();
        let field = schema
            .field
            .iter()
            .find(|field| field.number() == number as i32)
            .unwrap();
        let values = fields.entry(field.name().to_owned()).or_default();
        let mut take = |length: usize| {
            let (taken, rest) = data.split_at(length);
            data = rest;
            taken.to_vec()
        };
        match (wire, field.r#type()) {
            (WireType::SixtyFourBit, Type::Double) => {
                values.push(f64::from_le_bytes(take(8).try_into().unwrap()).into());
            }
            (WireType::Varint, Type::Bool) => values.push((decode_varint(&mut data).unwrap() == 1).into()),
            (WireType::Varint, Type::Uint32 | Type::Uint64) => {
                values.push(decode_varint(&mut data).unwrap().into())
            }
            (WireType::LengthDelimited, kind) => {
                let length = decode_varint(&mut data).unwrap() as usize;
                let (inner, rest) = data.split_at(length);
                data = rest;
                match kind {
                    Type::String => values.push(String::from_utf8(inner.to_vec()).unwrap().into()),
                    Type::Float => values.extend(
                        inner
                            .chunks(4)
                            .map(|four| Value::from(f32::from_le_bytes(four.try_into().unwrap()))),
                    ),
                    Type::Message => {
                        let nested = schema
                            .nested_type
                            .iter()
                            .find(|nested| nested.name() == field.type_name());
                        for (name, inner) in decoded(nested.unwrap(), inner) {
                            fields.insert(format!("{}.{name}", field.name()), inner);
                        }
                    }
                    other => panic!("{other:?}"),
                }
            }
            other => panic!("{other:?}"),
        }
    }
    fields.retain(|_, values| !values.is_empty());
    fields
}

/// Every message of a topic: its log time and its fields.
fn said(path: &Path, topic: &str) -> Vec<(u64, BTreeMap<String, Vec<Value>>)> {
    let file = fs::read(path).unwrap();
    let messages = mcap::MessageStream::new(&file).unwrap().map(Result::unwrap);
    let of_topic = messages.filter(|message| message.channel.topic == topic);
    of_topic
        .map(|message| {
            let schema = message.channel.schema.clone().unwrap();
            assert_eq!(
                (
                    schema.encoding.as_str(),
                    message.channel.message_encoding.as_str()
                ),
                ("protobuf", "protobuf")
            );
            let set = FileDescriptorSet::decode(&schema.data[..]).unwrap();
            let [file] = &set.file[..] else { panic!("one file") };
            let of = &file.message_type[0];
            assert_eq!(schema.name, format!("{}.{}", file.package(), of.name()));
            (message.log_time, decoded(of, &message.data))
        })
        .collect()
}

#[test]
fn the_channels_say_in_si_units_what_the_frames_say() {
    let folder = tempfile::tempdir().unwrap();
    let path = recorded(folder.path());
    let decode = Command::new(env!("CARGO_BIN_EXE_bead"))
        .arg("decode")
        .arg(&path)
        .output()
        .unwrap();
    let lines: Vec<Value> = decode
        .stdout
        .split(|&byte| byte == b'\n')
        .filter(|line| !line.is_empty())
        .map(|line| serde_json::from_slice(line).unwrap())
        .collect();
    for (topic, kind, least) in [
        ("strikes", "strike", 20),
        ("shapes", "shape", 12),
        ("status", "status", 12),
        ("health", "health", 10),
    ] {
        let frames: Vec<_> = lines.iter().filter(|line| line["kind"] == kind).collect();
        let messages = said(&path, topic);
        assert_eq!(messages.len(), frames.len(), "{topic}");
        assert!(!messages.is_empty() || kind == "health");
        for ((_, message), frame) in messages.iter().zip(frames) {
            assert!(message.len() >= least, "{message:?}");
            for (name, values) in message {
                // Groups are one object deep; a set is a list.
                let shown = match name.split_once('.') {
                    Some((group, name)) => &frame[group][name],
                    None => &frame[name],
                };
                match shown {
                    Value::Array(list) => assert_eq!(values, list, "{name}"),
                    shown => assert_eq!(values[..], *std::slice::from_ref(shown), "{topic}: {name}"),
                }
            }
        }
    }
}

#[test]
fn a_waveform_is_the_window_in_newtons_and_metres_per_second_squared() {
    let folder = tempfile::tempdir().unwrap();
    let path = recorded(folder.path());
    let frames: Vec<_> = Recording::open(&path)
        .unwrap()
        .frames()
        .unwrap()
        .filter_map(Item::frame)
        .collect();
    let strike = assemble(frames, None).remove(0);
    let signal = Signal::of(&strike.scans, &strike.settings.unwrap()).unwrap();
    let [(_, waveform)] = &said(&path, "waveforms")[..] else {
        panic!("one strike")
    };
    let floats =
        |values: &[f64]| -> Vec<Value> { values.iter().map(|value| Value::from(*value as f32)).collect() };
    assert_eq!(waveform["force_n"], floats(&signal.force));
    assert_eq!(waveform["acceleration_mps2"], floats(&signal.acceleration));
    let highest = signal.force.iter().copied().fold(0.0, f64::max);
    assert_eq!(highest, strike.said.peak_force.newtons());
    assert_eq!(waveform["time_from_trigger_s"].len(), 672);
    assert_eq!(waveform["time_from_trigger_s"][159], 0.0);
    assert_eq!(waveform["sample_period_s"], [Value::from(1e-5)]);
}

#[test]
fn log_times_are_those_of_the_host_and_equal_runs_have_equal_files() {
    let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    let [one, other] = folders.each_ref().map(|folder| recorded(folder.path()));
    let (at, _) = said(&one, "strikes")[0];
    assert!((STARTED..STARTED + 1_000_000_000).contains(&at), "{at}");
    let file = fs::read(&one).unwrap();
    let times: Vec<u64> = mcap::MessageStream::new(&file)
        .unwrap()
        .map(|message| message.unwrap().log_time)
        .collect();
    assert!(times.is_sorted() && times[0] == STARTED, "{times:?}");
    assert_eq!(file, fs::read(other).unwrap());
}

#[test]
fn a_recording_that_another_program_compressed_is_refused_with_the_command_that_unpacks_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = recorded(folder.path());
    let mut file = fs::read(&path).unwrap();
    // A chunk: two times, size and CRC, the name of the compression, the length of the records, the records.
    let chunk = [
        &[6][..],
        &48_u64.to_le_bytes(),
        &[0; 16],
        &100_u64.to_le_bytes(),
        &[0; 4],
        &4_u32.to_le_bytes(),
        b"zstd",
        &4_u64.to_le_bytes(),
        &[1, 2, 3, 4],
    ];
    file.splice(mcap::MAGIC.len()..mcap::MAGIC.len(), chunk.concat());
    fs::write(&path, &file).unwrap();
    for open in [Recording::open, Recording::salvage] {
        let said = open(&path).unwrap_err().to_string();
        assert!(said.contains("compressed with zstd"), "{said}");
        assert!(
            said.contains(&format!("mcap decompress {}", path.display())),
            "{said}"
        );
    }
}

#[test]
fn a_file_of_another_program_is_named_as_what_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    let mut writer = mcap::WriteOptions::new()
        .compression(None)
        .library("camera 1.2")
        .create(std::io::BufWriter::new(fs::File::create(&path).unwrap()))
        .unwrap();
    for (topic, encoding) in [("/imu", "cdr"), ("frames", "jpeg")] {
        let channel = writer.add_channel(0, topic, encoding, &BTreeMap::new()).unwrap();
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: 0,
            log_time: 0,
            publish_time: 0,
        };
        writer.write_to_known_channel(&header, b"x").unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    let error = Recording::open(&path).unwrap_err();
    assert!(matches!(error, RecordingError::NotOurs(..)));
    let said = error.to_string();
    assert!(
        said.contains("with the channels `/imu`, `frames`, written by `camera 1.2`"),
        "{said}"
    );
}
