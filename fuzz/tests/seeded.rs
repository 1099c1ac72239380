//! Every target, with its seeds and with mutations of them. The mutations are the same in every run; another
//! `FUZZ_SEED` draws others, and `FUZZ_RUNS` more.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

use std::ffi::OsString;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use bead_fuzz::{FuzzTarget, TARGETS};
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Mutations of each target.
const RUNS: u64 = 300;
/// Longest input, bytes.
const LONGEST: usize = 16 << 10;
/// An input takes some milliseconds. This is the limit of `cargo xtask fuzz` as well.
const LONGEST_TIME: Duration = Duration::from_secs(10);
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

fn seeds(name: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(name);
    let mut paths: Vec<_> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    paths.sort();
    paths
}

/// The words of libFuzzer for TOML.
fn words() -> Vec<Vec<u8>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("toml.words");
    let text = fs::read_to_string(path).unwrap();
    let lines = text
        .lines()
        .filter(|line| !line.is_empty() && !line.starts_with('#'));
    let mut words: Vec<_> = lines.map(word).collect();
    let count = words.len();
    words.sort();
    words.dedup();
    assert_eq!(words.len(), count, "a word is there twice");
    words
}

/// A word as libFuzzer reads it.
fn word(line: &str) -> Vec<u8> {
    let inside = line.strip_prefix('"').and_then(|line| line.strip_suffix('"'));
    let mut rest = inside.unwrap_or_else(|| panic!("{line} has no quotes"));
    let mut word = Vec::new();
    while let Some(first) = rest.chars().next() {
        let (byte, length) = match (first, rest.as_bytes().get(1)) {
            ('\\', Some(b'x')) => (u8::from_str_radix(&rest[2..4], 16).unwrap(), 4),
            ('\\', Some(&escaped @ (b'\\' | b'"'))) => (escaped, 2),
            ('\\' | '"', _) => panic!("{line} has no such escape"),
            _ => (u8::try_from(first).unwrap(), 1),
        };
        word.push(byte);
        rest = &rest[length..];
    }
    word
}

/// Changes some places: bits, bytes, numbers, pieces taken out, doubled, or from another seed; words put in,
/// or in place of what stands between two spaces.
fn mutated(bytes: &[u8], other: &[u8], words: &[Vec<u8>], random: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..1 << random.random_range(0..4) {
        if bytes.is_empty() {
            bytes.push(0);
        }
        let at = random.random_range(0..bytes.len());
        let end = (at + (1 << random.random_range(0..8))).min(bytes.len());
        // Half of the changes are words, where there are any.
        let kinds = if words.is_empty() { 7 } else { 14 };
        match random.random_range(0..kinds) {
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
            5 | 6 => bytes.truncate(random.random_range(bytes.len() / 2..=bytes.len())),
            7..10 => drop(bytes.splice(at..at, words.choose(random).unwrap().iter().copied())),
            _ => {
                let space = |byte: &u8| byte.is_ascii_whitespace();
                let start = bytes[..at].iter().rposition(space).map_or(0, |space| space + 1);
                let end = bytes[at..]
                    .iter()
                    .position(space)
                    .map_or(bytes.len(), |space| at + space);
                bytes.splice(start..end, words.choose(random).unwrap().iter().copied());
            }
        }
    }
    bytes.truncate(LONGEST);
    bytes
}

fn run(&(name, check): &FuzzTarget) {
    let paths = seeds(name);
    assert!(!paths.is_empty(), "{name} has no seeds");
    let of_toml = paths
        .iter()
        .all(|path| path.extension().is_some_and(|end| end == "toml"));
    let words = if of_toml { words() } else { Vec::new() };
    let seeds: Vec<_> = paths.iter().map(|path| fs::read(path).unwrap()).collect();
    let held = |bytes: &[u8], which: &str| {
        let start = Instant::now();
        let held = catch_unwind(AssertUnwindSafe(|| check(bytes))).is_ok();
        let taken = start.elapsed();
        if !held || taken > LONGEST_TIME {
            let path = std::env::temp_dir().join(format!("bead-fuzz-{name}"));
            fs::write(&path, bytes).unwrap();
            let why = if held {
                format!("takes {:.0} s", taken.as_secs_f64())
            } else {
                "fails".into()
            };
            panic!("{name}: {which} {why}; its bytes are in {}", path.display());
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
            &mutated(one, other, &words, &mut random),
            &format!("run {run} of FUZZ_SEED={start}"),
        );
    }
}

#[test]
fn what_must_hold_of_every_input_holds_of_seeds_and_mutations_of_them() {
    for target in TARGETS {
        let start = Instant::now();
        run(target);
        println!("{}: {:.2} s", target.0, start.elapsed().as_secs_f64());
    }
}

#[test]
fn every_target_has_a_program_and_every_program_a_target() {
    let programs = fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("targets")).unwrap();
    let mut programs: Vec<_> = programs.map(|entry| entry.unwrap().file_name()).collect();
    programs.sort();
    let mut targets: Vec<_> = TARGETS
        .iter()
        .map(|(name, _)| OsString::from(format!("{name}.rs")))
        .collect();
    targets.sort();
    assert_eq!(programs, targets);
}
