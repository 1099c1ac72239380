//! Writes the seeds that are made: frames, requests, settings with codes, recordings. The others are texts
//! that were written by hand, files in which a target found a fault, columns of kinds that pyarrow writes,
//! and the recording `two` as MCAP's Python library compresses it.
//!
//! `cargo run --release -p bead-fuzz --example seeds`

#![allow(clippy::unwrap_used, reason = "a seed that cannot be made ends this")]

use std::fs;
use std::path::Path;

use bead_fuzz::line::{from_cobs, mended, to_cobs};
use bead_fuzz::strikes::short_window;
use bead_model::settings::BLOCK_MAX;
use bead_recording::file::{About, Part, RecordingOrigin, RecordingWriter};
use bead_recording::physical::to_toml;
use bead_tables::whole::Target;
use bead_testing::{Speaker, paper_settings, xorshift};
use bead_wire::{ANY, Key, Kind, MAX_REQUEST, Message, Request, Ticket, encode_request};

fn seed(target: &str, name: &str, bytes: impl AsRef<[u8]>) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target);
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join(name), bytes).unwrap();
}

/// A frame of each kind.
fn frames() -> Vec<(&'static str, Vec<u8>)> {
    let frame = |&kind: &Kind| {
        let mut line = Speaker {
            boot: 1,
            ..Speaker::at(0)
        };
        (
            kind.name(),
            line.frame(77, &Message::draw(kind, &mut xorshift(7))),
        )
    };
    Kind::ALL.iter().map(frame).collect()
}

/// A short strike of the paper's bead, as it is sent.
fn strike(address: u8) -> Vec<u8> {
    let mut line = Speaker {
        boot: 1,
        ..Speaker::at(address)
    };
    let codes = |n: u32| {
        let x = (f64::from(n) - 340.0) / 8.0;
        let force = 100.0 + 900.0 / (1.0 + x * x).powi(3);
        [force as u16, force as u16 / 8, 2048, 2048]
    };
    line.measure(&short_window(), (0..1000).map(codes));
    line.say(1000, Message::draw(Kind::Sync, &mut xorshift(7)));
    line.bytes
}

/// A recording of this bead, or of several.
fn recording(beads: &[u8]) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let (target, about) = (Target::new(&path), About::default());
    let received = Some(1_700_000_000_000_000_000);
    let mut writer;
    if let [bead] = beads {
        writer = RecordingWriter::create(&target, &about).unwrap();
        writer.attach(Part::Truth, b"{}").unwrap();
        writer.write(&strike(*bead), received, drop).unwrap();
    } else {
        writer = RecordingWriter::create_for_several(&target, &about).unwrap();
        for &address in beads {
            let origin = RecordingOrigin {
                address,
                ..RecordingOrigin::default()
            };
            let lane = writer.join(&origin).unwrap();
            writer
                .write_of(lane, &strike(address)[..600], received, drop)
                .unwrap();
        }
    }
    writer.finish().unwrap();
    fs::read(path).unwrap()
}

fn request(name: &str, request: &Request) {
    let mut buffer = [0; MAX_REQUEST];
    let address = if name == "signed_by_another_key" { 7 } else { ANY };
    seed(
        "requests",
        name,
        encode_request(address, 5, request, &mut buffer).unwrap(),
    );
}

/// Two channels of 16 bits at 100 kHz.
fn wav() -> Vec<u8> {
    let samples: Vec<u8> = (0..64_i16)
        .flat_map(|n| [n.wrapping_mul(499), -n].map(i16::to_le_bytes))
        .flatten()
        .collect();
    let length = samples.len() as u32;
    let mut bytes = b"RIFF".to_vec();
    bytes.extend((36 + length).to_le_bytes());
    bytes.extend(b"WAVEfmt ");
    bytes.extend(16_u32.to_le_bytes());
    // PCM, channels; rate, bytes a second; bytes a frame, bits.
    bytes.extend([1_u16, 2].map(u16::to_le_bytes).as_flattened());
    bytes.extend([100_000_u32, 400_000].map(u32::to_le_bytes).as_flattened());
    bytes.extend([4_u16, 16].map(u16::to_le_bytes).as_flattened());
    bytes.extend(b"data");
    bytes.extend(length.to_le_bytes());
    bytes.extend(samples);
    bytes
}

fn main() {
    for (name, frame) in frames() {
        seed("frames", name, &frame);
        if name == "reply" {
            let mut later = from_cobs(&frame[1..frame.len() - 1]).unwrap();
            later[0] = 9;
            let later = mended(&[&[0], &to_cobs(&later)[..], &[0]].concat());
            seed("frames", "of_a_later_version", later);
        }
    }
    for &(number, name, ..) in Request::LIST {
        let drawn = Request::draw(number, &mut xorshift(7)).unwrap();
        request(&name.replace(' ', "_"), &drawn);
    }
    let key = Key::new(*b"another key here").unwrap();
    let ticket = Ticket {
        counter: 1,
        boot: 3,
        until: 2000,
    };
    let signed = Request::Arm.signed(&key, b"this bead id", 7, 5, ticket);
    request("signed_by_another_key", &signed);

    // Quiet, a pulse in steps, a rail, quiet: number of scans, force, acceleration.
    let codes: [(u8, u16, u16); 5] = [
        (60, 100, 2048),
        (4, 400, 2200),
        (6, 2500, 3000),
        (9, 4095, 500),
        (250, 90, 2048),
    ];
    let mut block = [0; BLOCK_MAX];
    let settings = paper_settings();
    let length = settings.encode(&mut block).unwrap();
    let mut bytes = block[..length].to_vec();
    for (many, force, acceleration) in codes {
        bytes.push(many);
        bytes.extend([force, acceleration].map(u16::to_le_bytes).as_flattened());
    }
    seed("settings", "v1", bytes);
    seed("beads", "paper.toml", to_toml(settings.description()));

    seed("strikes", "one", strike(0));
    seed(
        "strikes",
        "two_beads_cut",
        [&strike(1)[..900], &strike(2)[..900]].concat(),
    );
    let every_kind: Vec<u8> = frames().into_iter().flat_map(|(_, frame)| frame).collect();
    seed("strikes", "every_kind", every_kind);
    seed("recordings", "raw", &strike(0)[..500]);
    seed("recordings", "one", recording(&[0]));
    seed("recordings", "two", recording(&[1, 2]));
    seed("waveforms", "two.wav", wav());
}
