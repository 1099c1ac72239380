//! Writes the seeds that are made: frames, requests, settings with codes, recordings. The others are texts
//! that were written by hand, files in which a target found a fault, columns of kinds that pyarrow writes,
//! and the recording `two` as MCAP's Python library compresses it.
//!
//! `cargo run --release -p bead-fuzz --example seeds`

#![allow(clippy::unwrap_used, reason = "a seed that cannot be made ends this")]

use std::fs;
use std::path::{Path, PathBuf};

use bead_fuzz::line::{crc, mended, to_cobs};
use bead_fuzz::strikes::short_window;
use bead_model::design::{Bead, Capture, FrontEnd, derive};
use bead_model::settings::BLOCK_MAX;
use bead_model::{Meter, Scan};
use bead_recording::file::{About, Origin, Part, Writer};
use bead_recording::physical::to_toml;
use bead_tables::whole::Target;
use bead_testing::{Speaker, block_of};
use bead_wire::{ANY, Key, Kind, MAX_REQUEST, Message, Request, Ticket, encode_request};

fn seed(target: &str, name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target);
    fs::create_dir_all(&folder).unwrap();
    folder.join(name)
}

/// Numbers that are drawn (SplitMix64, Steele et al. 2014).
fn draws() -> impl FnMut() -> u64 {
    let mut state = 7_u64;
    move || {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mixed = (state ^ state >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ mixed >> 31
    }
}

fn drawn(kind: Kind) -> Message {
    Message::draw(kind, &mut draws())
}

/// A short strike of the paper's bead, as it is sent.
fn strike(address: u8) -> Vec<u8> {
    let settings = short_window();
    let mut line = Speaker {
        boot: 1,
        ..Speaker::at(address)
    };
    line.say(0, drawn(Kind::Identity));
    line.say(0, block_of(&settings));
    let scan = |n: usize| {
        let x = (n as f64 - 340.0) / 8.0;
        let force = 100.0 + 900.0 / (1.0 + x * x).powi(3);
        Scan::new([force as u16, force as u16 / 8, 2048, 2048])
    };
    let mut meter = Meter::new();
    let scans: Vec<Scan> = (0..1000).map(scan).collect();
    for (number, scans) in (0..).zip(scans.chunks(32)) {
        meter.process(&settings, number * 32, scans.iter().copied(), &mut line);
    }
    line.say(1000, drawn(Kind::Sync));
    line.bytes
}

fn recording(name: &str, beads: &[u8]) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let about = About::default();
    let mut writer = match beads {
        [_] => Writer::create(&Target::new(&path), &about),
        _ => Writer::create_for_several(&Target::new(&path), &about),
    }
    .unwrap();
    for &address in beads {
        let bytes = strike(address);
        let received = Some(1_700_000_000_000_000_000);
        match beads {
            [_] => {
                writer.attach(Part::Truth, b"{}").unwrap();
                writer.write(&bytes, received, drop).unwrap();
            }
            _ => {
                let origin = Origin {
                    address,
                    ..Origin::default()
                };
                let lane = writer.join(&origin).unwrap();
                writer.write_of(lane, &bytes[..600], received, drop).unwrap();
            }
        }
    }
    writer.finish().unwrap();
    fs::copy(path, seed("recordings", name)).unwrap();
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
    for &kind in Kind::ALL {
        let frame = Speaker {
            boot: 1,
            ..Speaker::at(0)
        }
        .frame(77, &drawn(kind));
        fs::write(seed("frames", kind.name()), frame).unwrap();
    }
    let sound = fs::read(seed("frames", "reply")).unwrap();
    let mut later = bead_fuzz::line::from_cobs(&sound[1..sound.len() - 1]).unwrap();
    later[0] = 9;
    fs::write(
        seed("frames", "of_a_later_version"),
        mended(&[&[0], &to_cobs(&later)[..], &[0]].concat()),
    )
    .unwrap();

    let key = Key::new(*b"another key here").unwrap();
    let ticket = Ticket {
        counter: 1,
        boot: 3,
        until: 2000,
    };
    for &(number, name, ..) in Request::LIST {
        let request = Request::draw(number, &mut draws()).unwrap();
        let bytes = encode_request(ANY, 5, &request, &mut [0; MAX_REQUEST])
            .unwrap()
            .to_vec();
        fs::write(seed("requests", &name.replace(' ', "_")), bytes).unwrap();
    }
    let signed = Request::Arm.signed(&key, b"this bead id", 7, 5, ticket);
    let bytes = encode_request(7, 5, &signed, &mut [0; MAX_REQUEST])
        .unwrap()
        .to_vec();
    fs::write(seed("requests", "signed_by_another_key"), bytes).unwrap();

    // Quiet, a pulse in steps, a rail, quiet: number of scans, force, acceleration.
    let codes: Vec<u8> = [
        (60, 100, 2048),
        (4, 400, 2200),
        (6, 2500, 3000),
        (9, 4095, 500),
        (250, 90, 2048),
    ]
    .iter()
    .flat_map(|(many, force, acceleration): &(u8, u16, u16)| {
        [&[*many][..], &force.to_le_bytes(), &acceleration.to_le_bytes()].concat()
    })
    .collect();
    let mut block = [0; BLOCK_MAX];
    let settings = derive(&Bead::paper(), &FrontEnd::reference(), &Capture::default()).unwrap();
    let length = settings.encode(&mut block).unwrap();
    assert_eq!(crc(&block[..length - 4]), block[length - 4..length]);
    fs::write(seed("settings", "v1"), [&block[..length], &codes].concat()).unwrap();

    fs::write(seed("strikes", "one"), strike(0)).unwrap();
    let two = [strike(1), strike(2)];
    let mixed: Vec<u8> = two.iter().flat_map(|bytes| bytes[..900].to_vec()).collect();
    fs::write(seed("strikes", "two_beads_cut"), mixed).unwrap();
    let all: Vec<u8> = Kind::ALL
        .iter()
        .flat_map(|kind| fs::read(seed("frames", kind.name())).unwrap())
        .collect();
    fs::write(seed("strikes", "every_kind"), all).unwrap();
    fs::write(seed("recordings", "raw"), &strike(0)[..500]).unwrap();
    recording("one", &[0]);
    recording("two", &[1, 2]);
    fs::write(seed("beads", "paper.toml"), to_toml(settings.description())).unwrap();
    fs::write(seed("waveforms", "two.wav"), wav()).unwrap();
}
