//! Rows of beads, recorded without an image: the model on this computer makes what each would send.

use std::path::Path;

use bead_compare::front_end::FrontEnd;
use bead_compare::sensed::{Sensed, Timing, bead_of, neighbours_of, simulate_with_ring_down};
use bead_model::design::{Capture, derive_among};
use bead_model::{Scan, Settings};
use bead_recording::file::{About, Origin, Part, Writer};
use bead_tables::whole::Target;
use bead_testing::{Collector, Speaker, block_of};
use bead_wire::{Message, Sync, Waveform};
use hertz_chain::{Scenario, Solution};

const RATE: f64 = 1e5;
const LEAD_IN: f64 = 0.06;
/// From strike to strike, s.
const INTERVAL: f64 = 0.05;
/// Between two edges of the sync line, s.
const EDGES: f64 = 0.0203;

/// One bead of a row.
pub(crate) struct RowBead {
    /// Its place, and its address.
    pub(crate) bead: usize,
    /// True if its sync input is on the line.
    pub(crate) synced: bool,
    /// The strikes, from 0, that are not in its recording.
    pub(crate) lost: Vec<u32>,
    /// A scenario that it carries in place of the row's.
    pub(crate) carries: Option<String>,
    /// The emulator's counts of its run.
    pub(crate) emulator: Option<Vec<u8>>,
    /// Its estimate B is sent with this many bits more.
    pub(crate) wrong_by: i64,
    /// Frames after the first that are lost on the way.
    pub(crate) frames_lost: usize,
}

impl RowBead {
    /// A bead with nothing amiss.
    pub(crate) fn at(bead: usize) -> Self {
        Self {
            bead,
            synced: true,
            lost: Vec::new(),
            carries: None,
            emulator: None,
            wrong_by: 0,
            frames_lost: 0,
        }
    }
}

/// Records these beads, in their order, during so many strikes of a scenario.
pub(crate) fn record(path: &Path, scenario: &Scenario, beads: &[RowBead], strikes: u32) {
    let solution = simulate_with_ring_down(scenario).unwrap();
    let about = About {
        source: "a test".to_owned(),
        sample_rate_hz: RATE as u32,
        ..About::default()
    };
    let mut writer = Writer::create_for_several(&Target::new(path), &about).unwrap();
    writer
        .attach(Part::Scenario, scenario.to_toml().as_bytes())
        .unwrap();
    for who in beads {
        let lane = writer
            .join(&Origin {
                address: who.bead as u8,
                ..Origin::default()
            })
            .unwrap();
        if let Some(text) = &who.carries {
            writer.attach_to(lane, Part::Scenario, text.as_bytes()).unwrap();
        }
        if let Some(report) = &who.emulator {
            writer.attach_to(lane, Part::EmulatorReport, report).unwrap();
        }
        for (at, frame) in frames(&solution, who, strikes) {
            writer.write_of(lane, &frame, Some(at), |_| {}).unwrap();
        }
    }
    writer.finish().unwrap();
}

/// Frames of a bead, each with the time of its receipt, ns.
fn frames(solution: &Solution, who: &RowBead, strikes: u32) -> Vec<(u64, Vec<u8>)> {
    let began = 0.000_123_4 * who.bead as f64;
    let timing = Timing {
        lead_in: LEAD_IN - began,
        strikes,
        interval: INTERVAL,
    };
    let settings = settings(solution, who.bead);
    let front_end = FrontEnd::default();
    let sensed = Sensed::new(solution, who.bead, timing);
    let scans = timing.scans(solution.end());
    let codes = front_end.digitise(&sensed, scans, Some(who.bead as u64));
    let mut speaker = Speaker {
        boot: 1,
        ..Speaker::at(who.bead as u8)
    };
    let mut messages: Vec<(u64, Message)> =
        vec![(1, speaker.identity().into()), (1, block_of(&settings).into())];
    // In units of 840 to a sample, as the timer has.
    let edges = (1..)
        .map(|n| f64::from(n) * EDGES - began)
        .take_while(|at| *at < scans as f64 / RATE);
    for (number, at) in (1..).zip(edges).filter(|_| who.synced) {
        let position = 1.0 + at * RATE;
        let edge = Sync::at(number, (position * 840.0).round() as u64, 840, 0);
        messages.push((position as u64 + 1, edge.into()));
    }
    let scans: Vec<Scan> = codes.scans.iter().copied().map(Scan::new).collect();
    let collected = Collector::measure(&settings, 1, &scans);
    messages.extend(strikes_of(&collected, who));
    messages.sort_by_key(|(index, _)| *index);
    let sent = messages.iter().map(|(index, message)| {
        let at = (began + (*index as f64 - 1.0) / RATE + 2e-4) * 1e9;
        (1_000_000_000 + at as u64, speaker.frame(*index, message))
    });
    let mut sent: Vec<_> = sent.collect();
    sent.drain(2..2 + who.frames_lost);
    sent
}

fn settings(solution: &Solution, bead: usize) -> Settings {
    let (physics, front) = (
        bead_of(solution, bead).unwrap(),
        FrontEnd::default().calibration(),
    );
    let neighbours = neighbours_of(solution, bead);
    let settings = derive_among(&physics, &neighbours, &front, &Capture::of(&physics, &front)).unwrap();
    settings.with(|one| one.address = bead as u8).unwrap()
}

/// The messages of the strikes that are not lost, each with the sample index at which it is made.
fn strikes_of(collected: &Collector, who: &RowBead) -> Vec<(u64, Message)> {
    let mut messages: Vec<(u64, Message)> = Vec::new();
    let is_lost = |strike: u32| who.lost.contains(&strike);
    for chunk in collected.chunks.iter().filter(|chunk| !is_lost(chunk.strike)) {
        let index = chunk.first_index + chunk.scans.len() as u64;
        messages.push((index, Waveform::from(chunk).into()));
    }
    let results = collected.reports.iter().zip(&collected.shapes);
    for (report, shape) in results.filter(|(report, _)| !is_lost(report.strike)) {
        let index = report.first_index + u64::from(report.samples);
        let mut strike = *report;
        let bits = strike.absorbed_predicted.bits() + who.wrong_by;
        strike.absorbed_predicted = bead_wire::Energy::from_bits(bits);
        messages.push((index, strike.into()));
        messages.push((index, (*shape).into()));
    }
    messages
}
