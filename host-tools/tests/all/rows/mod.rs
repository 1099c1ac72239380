//! Rows of beads, recorded without an image: the model on this computer makes what each would send.

use std::path::Path;

use bead::bench::front_end::FrontEnd;
use bead::bench::sensed::{Sensed, Timing, bead_of, neighbours_of, simulate_with_ring_down};
use bead::recording::file::{About, Origin, Part, Writer};
use bead::tables::whole::Target;
use bead_model::design::{Capture, derive_among};
use bead_model::settings::BLOCK_MAX;
use bead_model::{Chunk, Meter, Scan, Settings, Sink, StrikeReport};
use bead_wire::{Block, Header, Identity, MAX_FRAME, Message, ResetCauses, StrikeFlags, Sync, encode};
use hertz_chain::{Scenario, Solution};

const RATE: f64 = 1e5;
const LEAD_IN: f64 = 0.06;
/// From strike to strike, s.
const INTERVAL: f64 = 0.05;
/// Between two edges of the sync line, s.
const EDGES: f64 = 0.0203;

/// What one bead of a row does.
pub(crate) struct Who {
    /// Its place, and its address.
    pub(crate) bead: usize,
    /// Whether its sync input is on the line.
    pub(crate) synced: bool,
    /// The strikes, from 0, that are not in its recording.
    pub(crate) lost: Vec<u32>,
    /// A scenario that it carries in place of the row's.
    pub(crate) carries: Option<String>,
    /// What the emulator measured of its run.
    pub(crate) emulator: Option<Vec<u8>>,
    /// Its estimate B is sent with this many bits more.
    pub(crate) wrong_by: i64,
    /// Frames after the first that are lost on the way.
    pub(crate) frames_lost: usize,
}

impl Who {
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
pub(crate) fn record(path: &Path, scenario: &Scenario, beads: &[Who], strikes: u32) {
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

/// What a bead sends, each frame with the time of its receipt, ns.
fn frames(solution: &Solution, who: &Who, strikes: u32) -> Vec<(u64, Vec<u8>)> {
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
    let mut told = Told {
        who,
        messages: Vec::new(),
    };
    let mut block = [0; BLOCK_MAX];
    let length = settings.encode(&mut block).unwrap();
    let identity = Identity {
        firmware: "0.1.0".into(),
        git: "abc".into(),
        uid: [who.bead as u8; 12],
        boot: 1,
        reset_cause: ResetCauses::from_bits(4),
        sample_rate_hz: RATE as u32,
        channels: 2,
    };
    told.messages.push((1, identity.into()));
    let block = Block::try_from(&block[..length]).unwrap();
    told.messages.push((1, bead_wire::Settings { block }.into()));
    // In units of 840 to a sample, as the timer has.
    let edges = (1..)
        .map(|n| f64::from(n) * EDGES - began)
        .take_while(|at| *at < scans as f64 / RATE);
    for (number, at) in (1..).zip(edges).filter(|_| who.synced) {
        let position = 1.0 + at * RATE;
        let edge = Sync::at(number, (position * 840.0).round() as u64, 840, 0);
        told.messages.push((position as u64 + 1, edge.into()));
    }
    let mut meter = Meter::new();
    let scans: Vec<Scan> = codes.scans.iter().copied().map(Scan::new).collect();
    meter.process(&settings, 1, scans, &mut told);
    told.messages.sort_by_key(|(index, _)| *index);
    let sent = (0..).zip(&told.messages).map(|(sequence, (index, message))| {
        let header = Header {
            address: who.bead as u8,
            boot: 1,
            sequence,
            sample_index: *index,
        };
        let frame = encode(&header, message, &mut [0; MAX_FRAME]).unwrap().to_vec();
        let at = (began + (*index as f64 - 1.0) / RATE + 2e-4) * 1e9;
        (1_000_000_000 + at as u64, frame)
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
    let mut settings = derive_among(&physics, &neighbours, &front, &Capture::of(&physics, &front)).unwrap();
    settings.address = bead as u8;
    settings
}

/// The messages of a bead, each with the sample index at which it is made.
struct Told<'a> {
    who: &'a Who,
    messages: Vec<(u64, Message)>,
}

impl Sink for Told<'_> {
    fn chunk(&mut self, chunk: &Chunk) {
        if !self.who.lost.contains(&chunk.strike) {
            let index = chunk.first_index + chunk.scans.len() as u64;
            self.messages
                .push((index, bead_telemetry::waveform(chunk).into()));
        }
    }

    fn report(&mut self, report: &StrikeReport) {
        if !self.who.lost.contains(&report.strike) {
            let index = report.first_index + u64::from(report.samples);
            let mut strike = bead_telemetry::strike(report, StrikeFlags::NONE);
            let bits = strike.absorbed_predicted.bits() + self.who.wrong_by;
            strike.absorbed_predicted = bead_wire::Energy::from_bits(bits);
            self.messages.push((index, strike.into()));
            self.messages.push((index, bead_telemetry::shape(report).into()));
        }
    }
}
