//! Every target, with its seeds and with mutations of them. The mutations are the same in every run; another
//! `FUZZ_SEED` draws others, and `FUZZ_RUNS` more.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use bead_fuzz::{TARGETS, Target};
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Mutations of each target.
const RUNS: u64 = 300;
/// Longest input, bytes.
const LONGEST: usize = 16 << 10;
/// Numbers at which something ends.
const EDGES: &[u64] = &[
    0,
    1,
    2,
    0x7F,
    0x80,
    0xFF,
    0x7FFF,
    0xFFFF,
    0x7FFF_FFFF,
    0xFFFF_FFFF,
    u64::MAX >> 1,
    u64::MAX,
];

fn number(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |text| text.parse().unwrap())
}

fn seeds(name: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(name);
    let mut paths: Vec<_> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    paths.sort();
    paths.iter().map(|path| fs::read(path).unwrap()).collect()
}

/// Changes some places: bits, bytes, numbers, pieces taken out, doubled, or from another seed.
fn mutated(bytes: &[u8], other: &[u8], random: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..1 << random.random_range(0..4) {
        if bytes.is_empty() {
            bytes.push(0);
        }
        let at = random.random_range(0..bytes.len());
        let end = (at + (1 << random.random_range(0..8))).min(bytes.len());
        match random.random_range(0..7) {
            0 => bytes[at] ^= 1 << random.random_range(0..8),
            1 => bytes[at] = random.random(),
            2 => {
                let edge = EDGES.choose(random).unwrap().to_le_bytes();
                let length = [1, 2, 4, 8][random.random_range(0..4)].min(bytes.len() - at);
                bytes[at..at + length].copy_from_slice(&edge[..length]);
            }
            3 => drop(bytes.drain(at..end)),
            4 => {
                let piece = bytes[at..end].to_vec();
                bytes.splice(at..at, piece);
            }
            5 if !other.is_empty() => {
                let from = random.random_range(0..other.len());
                let to = (from + end - at).min(other.len());
                bytes.splice(at..at, other[from..to].iter().copied());
            }
            _ => bytes.truncate(random.random_range(bytes.len() / 2..=bytes.len())),
        }
    }
    bytes.truncate(LONGEST);
    bytes
}

fn run(&(name, check): &Target) {
    let seeds = seeds(name);
    assert!(!seeds.is_empty(), "{name} has no seeds");
    let held = |bytes: &[u8], which: &str| {
        if catch_unwind(AssertUnwindSafe(|| check(bytes))).is_err() {
            let path = std::env::temp_dir().join(format!("bead-fuzz-{name}"));
            fs::write(&path, bytes).unwrap();
            panic!("{name}: {which} fails; its bytes are in {}", path.display());
        }
    };
    for (number, seed) in seeds.iter().enumerate() {
        held(seed, &format!("seed {number}"));
    }
    let start = number("FUZZ_SEED", 1);
    for run in 0..number("FUZZ_RUNS", RUNS) {
        let mut random = ChaCha8Rng::seed_from_u64(start << 32 | run);
        let [one, other] = [(); 2].map(|()| seeds.choose(&mut random).unwrap());
        held(
            &mutated(one, other, &mut random),
            &format!("run {run} of FUZZ_SEED={start}"),
        );
    }
}

#[test]
fn what_must_hold_of_every_input_holds_of_seeds_and_mutations_of_them() {
    for target in TARGETS {
        let start = std::time::Instant::now();
        run(target);
        println!("{}: {:.2} s", target.0, start.elapsed().as_secs_f64());
    }
}

#[test]
fn every_target_has_a_program_and_every_program_a_target() {
    let programs = fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("targets")).unwrap();
    let mut programs: Vec<String> = programs
        .map(|entry| {
            entry
                .unwrap()
                .path()
                .file_stem()
                .unwrap()
                .to_string_lossy()
                .into_owned()
        })
        .collect();
    programs.sort();
    let mut targets: Vec<_> = TARGETS.iter().map(|(name, _)| *name).collect();
    targets.sort_unstable();
    assert_eq!(programs, targets);
}
