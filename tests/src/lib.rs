//! What the end-to-end tests share: the paper's strike on bead 8, through the flash image in QEMU.
//!
//! The tests need the image and the overlay; `cargo xtask test` builds both before it runs them.

use std::path::{Path, PathBuf};

use bead::emulation::{Emulation, find_image};
use bead::frames::{self, Frame, Message};
use bead::front_end::FrontEnd;
use bead::sensed::{Timing, load_scenario, simulate_with_ring_down};
use bead_wire::Counters;

/// The bead that senses.
pub const HOST: usize = 8;
/// Quiet before the first strike, s.
pub const LEAD_IN: f64 = 0.02;

/// The root of the workspace.
pub fn workspace() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("tests/ lies in the workspace")
}

/// The scenario of the paper's strike.
pub fn scenario() -> PathBuf {
    workspace().join("docs/scenarios/paper-strike.toml")
}

/// The flash image, as built.
///
/// # Panics
/// It is not there; the message says how to build it.
pub fn image() -> PathBuf {
    find_image(None).unwrap_or_else(|failure| panic!("{failure}"))
}

/// A run of the image on `strikes` strikes of the paper, `interval` seconds apart, with the noise of `seed`.
///
/// # Panics
/// Something that it needs is missing; the message says what.
pub fn paper(strikes: u32, interval: f64, seed: Option<u64>) -> Emulation {
    let lead_in = LEAD_IN;
    paper_at(
        Timing {
            lead_in,
            strikes,
            interval,
        },
        seed,
    )
}

/// As [`paper`], the first strike when `timing` says.
///
/// # Panics
/// Something that it needs is missing; the message says what.
pub fn paper_at(timing: Timing, seed: Option<u64>) -> Emulation {
    let (scenario, _) = load_scenario(&scenario()).unwrap_or_else(|failure| panic!("{failure}"));
    let solution = simulate_with_ring_down(&scenario).unwrap_or_else(|failure| panic!("{failure}"));
    Emulation::prepare(
        &scenario,
        &solution,
        HOST,
        &FrontEnd::default(),
        seed,
        timing,
        &image(),
    )
    .unwrap_or_else(|failure| panic!("{failure}"))
}

/// What one run said.
pub struct Heard {
    /// Bytes that left the bead's port.
    pub stream: Vec<u8>,
    /// The frames in them.
    pub frames: Vec<Frame>,
    /// What the decoder counted.
    pub counters: Counters,
}

impl Heard {
    /// The fault frames, in the order in which they came.
    pub fn faults(&self) -> impl Iterator<Item = &frames::Fault> {
        self.frames.iter().filter_map(|frame| match &frame.message {
            Message::Fault(fault) => Some(fault),
            _ => None,
        })
    }

    /// The last health frame.
    ///
    /// # Panics
    /// There is none: the bead sends one at boot.
    pub fn health(&self) -> bead_wire::Health {
        let health = self.frames.iter().rev().find_map(|frame| match &frame.message {
            Message::Health(health) => Some(*health),
            _ => None,
        });
        health.expect("the bead sends its health at boot")
    }

    /// Boot and reset cause of each identity, one a boot.
    pub fn boots(&self) -> Vec<(u32, u8)> {
        let identities = self.frames.iter().filter_map(|frame| match &frame.message {
            Message::Identity(identity) => Some((identity.boot, identity.reset_cause)),
            _ => None,
        });
        let mut boots: Vec<_> = identities.collect();
        boots.dedup();
        boots
    }

    /// Decodes a stream.
    pub fn new(stream: Vec<u8>) -> Self {
        let (frames, counters) = frames::decode(&stream);
        Self {
            stream,
            frames,
            counters,
        }
    }

    /// The last status frame.
    ///
    /// # Panics
    /// There is none: the bead sends one at boot.
    pub fn status(&self) -> bead_wire::Status {
        let status = self.frames.iter().rev().find_map(|frame| match &frame.message {
            Message::Status(status) => Some(*status),
            _ => None,
        });
        status.expect("the bead sends a status at boot")
    }
}
