//! Strikes for a procedure: of recordings, which a live or a made-up bead may have to fill first.

use std::collections::BTreeSet;

use bead_bench::emulation::{Emulation, Placed};
use bead_bench::image::find_image;
use bead_calibrate::quantity::Stated;
use bead_calibrate::ring_down::StatedMass;
use bead_calibrate::simulated::{SimulatedBead, chance};
use bead_compare::front_end::{AnalogFrontEnd, SAMPLE_RATE_HZ, SensorStimulus};
use bead_compare::sensed::{Timing, Truth, simulate_with_ring_down};
use bead_instrument::{Trace, Waveform};
use bead_model::design::{Bead, Capture, Description, FrontEnd, Relative, Surroundings};
use bead_recording::file::{About, Part, RecordingWriter};
use bead_recording::strikes::assemble;

use crate::cli::commands::calibrate::arguments::{MadeUpBead, SourceOptions};
use crate::cli::commands::compared::no_strike;
use crate::cli::commands::prelude::*;
use crate::cli::commands::settings_file::block;
use crate::cli::provenance::name_of;
use crate::cli::recordings::each_once;

/// Greatest number of strikes of a recording that a procedure takes.
const MOST: usize = 10_000;

/// The strikes of one bead in a recording, in the order of their time.
pub(super) fn strikes(path: &Path, bead: Option<u8>) -> Result<Vec<RecordedStrike>, Failure> {
    let received = Recording::open_named(path)?;
    let mut strikes: Vec<RecordedStrike> = Vec::new();
    for of_bead in received.each() {
        let all = of_bead.strikes()?;
        let wanted = all.filter(|strike| bead.is_none_or(|bead| bead == strike.address));
        strikes.extend(wanted.take(MOST + 1 - strikes.len().min(MOST)));
    }
    let shown = path.display();
    if strikes.len() > MOST {
        bail!(
            Input,
            "{shown} has more than {MOST} strikes; record each calibration in a file of its own"
        );
    }
    if strikes.is_empty() {
        return Err(match bead {
            Some(bead) => failure!(Input, "--bead {bead}: {shown} has no strike from this bead"),
            None => no_strike(&received),
        });
    }
    let addresses: BTreeSet<u8> = strikes.iter().map(|strike| strike.address).collect();
    if addresses.len() > 1 {
        bail!(
            Input,
            "{shown} has strikes of the beads {addresses:?}; say with --bead which is calibrated"
        );
    }
    // A fetched strike comes after later ones.
    strikes.sort_by_key(|strike| (strike.nth_boot, strike.said.trigger_index));
    Ok(strikes)
}

impl SourceOptions {
    /// True if the recordings are made first.
    pub(super) fn is_made(&self) -> bool {
        self.port.is_some() || self.from.is_some()
    }

    /// The recordings that are read: none if they are made.
    pub(super) fn inputs<'a>(&self, recordings: &'a [PathBuf]) -> Vec<&'a Path> {
        let read = recordings.iter().filter(|_| !self.is_made());
        read.map(PathBuf::as_path).collect()
    }

    /// The strikes of recordings that are there, one after another.
    pub(super) fn read(&self, recordings: &[PathBuf]) -> Result<Vec<Vec<RecordedStrike>>, Failure> {
        each_once(recordings)?;
        recordings.iter().map(|path| strikes(path, self.bead)).collect()
    }

    /// A bead without hardware, with these settings.
    pub(super) fn made_up(&self, description: &Description) -> Result<SimulatedBead, Failure> {
        let settings = bead_recording::physical::derived(description)?;
        Ok(SimulatedBead::drawn(&settings, &mut chance(self.seed, 0)))
    }

    /// Strikes that such a bead measures of `seconds` of a stimulus, in a recording if one is wanted.
    pub(super) fn measured(
        &self,
        bead: &SimulatedBead,
        (stimulus, seconds): (&impl SensorStimulus, f64),
        target: Option<&Target>,
        seed: u64,
    ) -> Result<Vec<RecordedStrike>, Failure> {
        match (self.from, target) {
            (Some(MadeUpBead::Emulated), _) => emulate(bead, stimulus, seconds, target, seed),
            (_, None) => Ok(bead.strikes(stimulus, seconds, seed)),
            (_, Some(target)) => {
                bead.record(target, stimulus, seconds, seed)?;
                strikes(target.path(), None)
            }
        }
    }
}

/// The name of a recording; of one that is not kept, its number.
pub(super) fn name(path: Option<&PathBuf>, number: usize) -> String {
    path.map_or_else(|| format!("series {number}"), |path| name_of(path))
}

/// The settings that a recording's strikes were measured with, else those of the paper's bead.
pub(super) fn settings_of<'a>(strikes: impl IntoIterator<Item = &'a RecordedStrike>) -> Description {
    let settings = strikes.into_iter().find_map(|strike| strike.settings);
    settings.map_or_else(reference, |settings| *settings.description())
}

/// The paper's bead behind the reference front end.
pub(in crate::cli::commands) fn reference() -> Description {
    let (bead, front_end) = (Bead::paper(), FrontEnd::reference());
    let capture = Capture::of(&bead, &front_end);
    Description::new(&bead, &Surroundings::default(), &front_end, &capture)
}

/// The places of recordings that are made: those that are named, or none for each of `count`.
pub(super) fn targets(
    named: &[PathBuf],
    count: usize,
    overwrite: Overwrite,
) -> Result<Vec<Option<Target>>, Failure> {
    if named.is_empty() {
        return Ok(vec![None; count]);
    }
    let target = |path: &PathBuf| place::target(path, FileKind::Recording, &[], overwrite).map(Some);
    named.iter().map(target).collect()
}

/// Strikes that the flash image in QEMU measures of `seconds` of a stimulus, in a recording if one is wanted.
fn emulate(
    bead: &SimulatedBead,
    stimulus: &impl SensorStimulus,
    seconds: f64,
    target: Option<&Target>,
    seed: u64,
) -> Result<Vec<RecordedStrike>, Failure> {
    let count = (seconds * RATE) as usize;
    let sampled = |value: fn(&mut _, f64) -> f64| {
        let mut stimulus = stimulus.clone();
        let values = (0..count).map(|at| value(&mut stimulus, at as f64 / RATE));
        Trace::even(values.collect(), RATE)
    };
    let waveform = Waveform {
        force: Some(sampled(SensorStimulus::force)),
        acceleration: Some(sampled(SensorStimulus::acceleration)),
        start: 0.0,
        remarks: Vec::new(),
    };
    let scenario = Scenario::paper();
    let solution = simulate_with_ring_down(&scenario)?;
    let host = 8;
    let timing = Timing {
        lead_in: LEAD_IN,
        strikes: 1,
        interval: 1.0,
    };
    let (placed, truth) = (
        Placed::alone(host, Some(seed)),
        Truth::of(&scenario, &solution, host)?,
    );
    let front_end: &AnalogFrontEnd = &bead.front_end;
    let image = find_image(None)?;
    let mut emulation = Emulation::play(&solution, placed, front_end, timing, &image, waveform, truth)?;
    let block = block(&bead.settings).map_err(Failure::input)?;
    (emulation.settings, emulation.block) = (bead.settings, block);
    let ran = emulation.run()?.whole()?;
    let Some(target) = target else {
        return Ok(assemble(ran.frames, None));
    };
    let about = About {
        source: "emulated bead".to_owned(),
        sample_rate_hz: SAMPLE_RATE_HZ,
        ..About::default()
    };
    let writer = RecordingWriter::create(target, &about)?;
    writer.fill(|writer| {
        writer.attach(Part::Settings, &emulation.block)?;
        ran.write(writer, 0)
    })?;
    strikes(target.path(), None)
}

/// Values a second of a signal that the emulator plays, Hz.
const RATE: f64 = 200e3;
/// Quiet time before the signal, s, in which the image starts and arms its detector.
const LEAD_IN: f64 = 0.02;

/// The intruder's mass: the stated one, else that of the settings with its uncertainty.
pub(super) fn intruder_mass(stated: Option<Stated>, settings: &Description) -> Result<StatedMass, Failure> {
    let uncertainty = settings.uncertainty.and_then(|stated| stated.intruder_mass);
    let advice = "the intruder's mass is unknown; weigh it: --intruder-mass 3.700g±4mg";
    mass(stated, settings.intruder.mass, uncertainty, advice)
}

/// The bead's mass, likewise.
pub(super) fn bead_mass(stated: Option<Stated>, settings: &Description) -> Result<StatedMass, Failure> {
    let uncertainty = settings.uncertainty.and_then(|stated| stated.bead_mass);
    let advice = "the bead's mass is unknown; weigh it with its intruder: --bead-mass 51.00g±10mg; or hold it \
                  fast: --held";
    mass(stated, settings.bead.mass, uncertainty, advice)
}

fn mass(
    stated: Option<Stated>,
    value: f64,
    uncertainty: Option<Relative>,
    advice: &str,
) -> Result<StatedMass, Failure> {
    let u = uncertainty.map(|relative| relative.part() * value);
    let (mass, is_new) = match (stated, u) {
        (Some(stated), _) => (stated, true),
        (None, Some(u)) => (Stated { value, u }, false),
        (None, None) => bail!(Input, "the uncertainty of {advice}"),
    };
    Ok(StatedMass { mass, is_new })
}
