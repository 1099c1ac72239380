//! Recordings as other programs read them: by their schemas, in SI units, at times of the host.

use std::fs;
use std::path::{Path, PathBuf};

use crate::program::{DATA, TestFolder, assert_says, documents};
use bead_recording::file::{About, Recording, RecordingWriter};
use bead_recording::frames::Item;
use bead_recording::signal::Signal;
use bead_recording::strikes::assemble;
use bead_tables::whole::Target;
use prost_reflect::{DescriptorPool, DynamicMessage, ReflectMessage};
use serde_json::Value;

/// When the first piece of the recording is received, ns since 1970.
pub(crate) const STARTED: u64 = 1_700_000_000_000_000_000;

/// Records the strike of `tests/data` this many times. Pieces are received a millisecond apart.
pub(crate) fn record_again(path: &Path, times: u64) {
    let old = Recording::open(&Path::new(DATA).join("recording-v1.mcap")).unwrap();
    let mut writer = RecordingWriter::create(&Target::new(path), &About::default()).unwrap();
    let pieces = (0..times).flat_map(|_| old.pieces().unwrap());
    for (received_ns, piece) in (STARTED..).step_by(1_000_000).zip(pieces) {
        writer.write(&piece.bytes, Some(received_ns), |_| {}).unwrap();
    }
    writer.finish().unwrap();
}

fn recorded(folder: &Path) -> PathBuf {
    let path = folder.join("strike.mcap");
    record_again(&path, 1);
    path
}

/// Converts a value of a Protobuf message to JSON. Absent fields are left out.
fn json(value: &prost_reflect::Value) -> Value {
    use prost_reflect::Value::*;
    match value {
        Bool(value) => (*value).into(),
        U32(value) => (*value).into(),
        U64(value) => (*value).into(),
        F32(value) => (*value).into(),
        F64(value) => (*value).into(),
        String(value) => value.as_str().into(),
        List(values) => values.iter().map(json).collect(),
        Message(message) => {
            let fields = message.descriptor();
            let fields = fields
                .fields()
                .filter(|field| !field.supports_presence() || message.has_field(field));
            fields
                .map(|field| (field.name().to_owned(), json(&message.get_field(&field))))
                .collect()
        }
        other => panic!("{other:?}"),
    }
}

/// Log time and fields of every message of a topic, read by the schema in the file.
fn messages(path: &Path, topic: &str) -> Vec<(u64, Value)> {
    let file = fs::read(path).unwrap();
    let messages = mcap::MessageStream::new(&file).unwrap().map(Result::unwrap);
    let of_topic = messages.filter(|message| message.channel.topic == topic);
    let decoded = of_topic.map(|message| {
        let schema = message.channel.schema.clone().unwrap();
        assert_eq!(schema.encoding, "protobuf");
        assert_eq!(message.channel.message_encoding, "protobuf");
        let pool = DescriptorPool::decode(&schema.data[..]).unwrap();
        let of = pool.get_message_by_name(&schema.name).unwrap();
        let fields = DynamicMessage::decode(of, &message.data[..]).unwrap();
        (message.log_time, json(&prost_reflect::Value::Message(fields)))
    });
    decoded.collect()
}

/// Asserts that each field of an object is in another; returns their number.
fn assert_shown(fields: &Value, shown: &Value) -> usize {
    let Some(fields) = fields.as_object() else {
        assert_eq!(fields, shown);
        return 1;
    };
    fields
        .iter()
        .map(|(name, value)| assert_shown(value, &shown[name]))
        .sum()
}

#[test]
fn the_channels_say_in_si_units_what_the_frames_say() {
    let folder = TestFolder::new();
    let path = recorded(&folder);
    let lines = documents(folder.done("decode strike.mcap").as_bytes());
    for (topic, kind, least) in [
        ("strikes", "strike", 20),
        ("shapes", "shape", 12),
        ("status", "status", 12),
        ("health", "health", 10),
    ] {
        let frames: Vec<_> = lines.iter().filter(|line| line["kind"] == kind).collect();
        let messages = messages(&path, topic);
        assert_eq!(messages.len(), frames.len(), "{topic}");
        assert!(!messages.is_empty() || kind == "health");
        for ((_, message), frame) in messages.iter().zip(frames) {
            assert!(assert_shown(message, frame) >= least, "{message}");
        }
    }
}

#[test]
fn a_waveform_is_the_window_in_newtons_and_metres_per_second_squared() {
    let folder = TestFolder::new();
    let path = recorded(&folder);
    let recording = Recording::open(&path).unwrap();
    let frames = recording.frames().unwrap().filter_map(Item::frame);
    let strike = assemble(frames.collect(), None).remove(0);
    let signal = Signal::of(&strike.scans, &strike.settings.unwrap()).unwrap();
    let [(_, waveform)] = &messages(&path, "waveforms")[..] else {
        panic!("one strike")
    };
    let floats = |values: &[f64]| values.iter().map(|value| *value as f32).collect::<Value>();
    assert_eq!(waveform["force_n"], floats(&signal.force));
    assert_eq!(waveform["acceleration_mps2"], floats(&signal.acceleration));
    let highest = signal.force.iter().copied().fold(0.0, f64::max);
    // The bead of this recording corrected its filters' delay a little less exactly.
    let off = highest / strike.said.peak_force.newtons() - 1.0;
    assert!(off.abs() < 1e-5, "{highest}");
    assert_eq!(waveform["time_from_trigger_s"].as_array().unwrap().len(), 672);
    assert_eq!(waveform["time_from_trigger_s"][159], 0.0);
    assert_eq!(waveform["sample_period_s"], 1e-5);
}

#[test]
fn a_recording_that_another_program_compressed_is_refused_with_the_command_that_unpacks_it() {
    let folder = TestFolder::new();
    let path = recorded(&folder);
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
        assert_says(&said, "compressed with zstd");
        assert_says(&said, &format!("mcap decompress {}", path.display()));
    }
}
