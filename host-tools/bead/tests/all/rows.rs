//! Recordings of rows of beads, made without an image: the model on this computer measures for each bead.

use std::path::Path;

use bead_compare::front_end::AnalogFrontEnd;
use bead_compare::sensed::{Sensed, Timing, bead_of, simulate_with_ring_down, surroundings_of};
use bead_model::design::{Capture, Description};
use bead_model::{Scan, Settings};
use bead_recording::file::{About, Part, RecordingOrigin, RecordingWriter};
use bead_tables::whole::Target;
use bead_testing::{Collector, Speaker, block_of};
use bead_wire::{Energy, Message, Sync, Waveform};
use hertz_chain::{Scenario, Solution};

const RATE: f64 = 1e5;
const LEAD_IN: f64 = 0.06;
/// Time from strike to strike, s.
const INTERVAL: f64 = 0.05;
/// Time between two edges of the sync line, s.
const EDGES: f64 = 0.0203;

/// One bead of a row.
#[derive(Clone, Default)]
pub(crate) struct ModelBead {
    /// Its place, and its address.
    pub(crate) bead: usize,
    /// True if its sync input is on the line.
    pub(crate) synced: bool,
    /// Strikes, counted from 0, that are not in its recording.
    pub(crate) lost: Vec<u32>,
    /// Scenario in place of that of the row.
    pub(crate) carries: Option<String>,
    /// The emulator's counts of its run.
    pub(crate) emulator: Option<Vec<u8>>,
    /// Bits by which its estimate B is sent too high.
    pub(crate) wrong_by: i64,
    /// Frames after the first two that are lost on the way.
    pub(crate) frames_lost: usize,
}

impl ModelBead {
    /// A bead with nothing amiss.
    pub(crate) fn at(bead: usize) -> Self {
        let synced = true;
        Self {
            bead,
            synced,
            ..Self::default()
        }
    }

    fn settings(&self, solution: &Solution) -> Settings {
        let front = AnalogFrontEnd::default().calibration();
        let (physics, neighbours) = (
            bead_of(solution, self.bead).unwrap(),
            surroundings_of(solution, self.bead),
        );
        let capture = Capture::of(&physics, &front);
        let settings = Settings::new(&Description::new(&physics, &neighbours, &front, &capture)).unwrap();
        settings.with(|one| one.address = self.bead as u8).unwrap()
    }

    /// The messages of the strikes that are not lost, each with the sample index at which it is made.
    fn strikes(&self, collected: &Collector) -> Vec<(u64, Message)> {
        let mut messages: Vec<(u64, Message)> = Vec::new();
        for chunk in &collected.chunks {
            if !self.lost.contains(&chunk.strike) {
                let index = chunk.first_index + chunk.scans.len() as u64;
                messages.push((index, Waveform::from(chunk).into()));
            }
        }
        for (mut strike, shape) in collected.reports.iter().copied().zip(&collected.shapes) {
            if !self.lost.contains(&strike.strike) {
                let index = strike.first_index + u64::from(strike.samples);
                let bits = strike.absorbed_predicted.bits() + self.wrong_by;
                strike.absorbed_predicted = Energy::from_bits(bits);
                messages.extend([(index, strike.into()), (index, (*shape).into())]);
            }
        }
        messages
    }

    /// Frames, each with the time of its receipt, ns.
    fn frames(&self, solution: &Solution, strikes: u32) -> Vec<(u64, Vec<u8>)> {
        let began = 0.000_123_4 * self.bead as f64;
        let timing = Timing {
            lead_in: LEAD_IN - began,
            strikes,
            interval: INTERVAL,
        };
        let settings = self.settings(solution);
        let sensed = Sensed::new(solution, self.bead, timing);
        let scans = timing.scans(solution.end());
        let codes = AnalogFrontEnd::default().digitise(&sensed, scans, Some(self.bead as u64));
        let mut speaker = Speaker::at(self.bead as u8);
        speaker.boot = 1;
        let mut messages = vec![(1, speaker.identity().into()), (1, block_of(&settings).into())];
        // Positions are in clocks of the timer, 840 to a sample.
        let edges = (1..).map(|n| (n, f64::from(n) * EDGES - began));
        let edges = edges.take_while(|(_, at)| self.synced && *at < scans as f64 / RATE);
        messages.extend(edges.map(|(number, at)| {
            let position = 1.0 + at * RATE;
            let edge = Sync::at(number, (position * 840.0).round() as u64, 840, 0);
            (position as u64 + 1, edge.into())
        }));
        let scans: Vec<Scan> = codes.scans.iter().copied().map(Scan::new).collect();
        messages.extend(self.strikes(&Collector::measure(&settings, 1, &scans)));
        messages.sort_by_key(|(index, _)| *index);
        let sent = messages.iter().map(|(index, message)| {
            let at = (began + (*index as f64 - 1.0) / RATE + 2e-4) * 1e9;
            (1_000_000_000 + at as u64, speaker.frame(*index, message))
        });
        let mut sent: Vec<_> = sent.collect();
        sent.drain(2..2 + self.frames_lost);
        sent
    }
}

/// Records these beads, in this order, during this many strikes of a scenario.
pub(crate) fn record(path: &Path, scenario: &Scenario, beads: &[ModelBead], strikes: u32) {
    let solution = simulate_with_ring_down(scenario).unwrap();
    let about = About {
        sample_rate_hz: RATE as u32,
        ..About::default()
    };
    let mut writer = RecordingWriter::create_for_several(&Target::new(path), &about).unwrap();
    let own = scenario.to_toml();
    writer.attach(Part::Scenario, own.as_bytes()).unwrap();
    for bead in beads {
        let origin = RecordingOrigin {
            address: bead.bead as u8,
            ..RecordingOrigin::default()
        };
        let lane = writer.join(&origin).unwrap();
        if let Some(text) = &bead.carries {
            writer.attach_to(lane, Part::Scenario, text.as_bytes()).unwrap();
        }
        if let Some(report) = &bead.emulator {
            writer.attach_to(lane, Part::EmulatorReport, report).unwrap();
        }
        for (at, frame) in bead.frames(&solution, strikes) {
            writer.write_of(lane, &frame, Some(at), |_| {}).unwrap();
        }
    }
    writer.finish().unwrap();
}
