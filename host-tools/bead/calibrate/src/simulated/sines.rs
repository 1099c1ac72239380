//! A shaker with a reference accelerometer: scans of the bead and the record of the reference, tone by tone.

use std::fmt::Write;

use bead_compare::front_end::{SAMPLE_RATE_HZ, SensorStimulus};
use hertz_chain::Oscillator;

use crate::points::{Channel, Point};
use crate::simulated::bead::{SimulatedBead, chance, deviate};
use crate::sine;

/// Samples a second of the reference's record, Hz.
const REFERENCE_RATE: f64 = 51_200.0;
/// Noise of the reference, m/s² rms.
const REFERENCE_NOISE: f64 = 0.02;
/// Deviation of the reference's clock from the bead's, as a part.
const CLOCKS: f64 = 30e-6;
/// Scans in each run that the line carries, and in each run that it drops, in turn.
const SENT: usize = 200;

/// Motion of a shaken bead: a steady tone.
#[derive(Debug, Clone, Copy)]
pub struct Shaken {
    /// Frequency, Hz.
    pub frequency: f64,
    /// Acceleration of the bead's body, m/s² rms.
    rms: f64,
    /// The intruder's motion over that of the body, and its lead, s.
    follows: (f64, f64),
    /// Mass in front of the crystal, kg.
    front_mass: f64,
}

impl Shaken {
    /// A tone with a frequency, Hz, an acceleration, m/s² rms, and a front mass, kg. Without springs the
    /// accelerometer is fixed to the reference.
    pub fn new(frequency: f64, rms: f64, springs: Option<Oscillator>, front_mass: f64) -> Self {
        let h = springs.map(|springs| springs.transmissibility(frequency));
        let follows = h.map_or((1.0, 0.0), |h| {
            (h.norm(), h.arg() / (std::f64::consts::TAU * frequency))
        });
        Self {
            frequency,
            rms,
            follows,
            front_mass,
        }
    }

    fn wave(&self, time: f64) -> f64 {
        self.rms * std::f64::consts::SQRT_2 * (std::f64::consts::TAU * self.frequency * time).sin()
    }
}

impl SensorStimulus for Shaken {
    fn force(&mut self, time: f64) -> f64 {
        self.front_mass * self.wave(time)
    }

    fn acceleration(&mut self, time: f64) -> f64 {
        let (part, ahead) = self.follows;
        part * self.wave(time + ahead)
    }
}

/// The point of a tone, without files.
///
/// # Errors
/// There is no tone.
pub fn point(
    bead: &SimulatedBead,
    shaken: &Shaken,
    channel: Channel,
    (gain, seconds, seed): (f64, f64, u64),
) -> Result<Point, String> {
    let count = (seconds * f64::from(SAMPLE_RATE_HZ)) as usize;
    let codes = bead.front_end.digitise(shaken, count, Some(seed)).scans;
    let place = if channel == Channel::Force { 0 } else { 2 };
    let sent = codes.iter().enumerate().filter(|(at, _)| is_sent(*at));
    let samples: Vec<_> = sent
        .map(|(at, scan)| (at as f64 / f64::from(SAMPLE_RATE_HZ), f64::from(scan[place])))
        .collect();
    let of_reference = sine::fit(&reference_samples(shaken, gain, seconds, seed), None)?;
    let of_bead = sine::fit(&samples, Some(of_reference.frequency))?;
    Ok(Point {
        subject: format!("{:.0} Hz", shaken.frequency),
        frequency: of_reference.frequency,
        reference: of_reference.rms,
        measured: of_bead.rms,
    })
}

/// True for a scan that fits the line.
fn is_sent(at: usize) -> bool {
    (at / SENT).is_multiple_of(2)
}

/// The scans of a shaken bead as `bead command raw` writes them: every second run of scans, which is all that
/// a line carries.
pub fn scans(bead: &SimulatedBead, shaken: &Shaken, seconds: f64, seed: u64) -> String {
    let count = (seconds * f64::from(SAMPLE_RATE_HZ)) as usize;
    let codes = bead.front_end.digitise(shaken, count, Some(seed)).scans;
    let mut text = String::from("sample_index,force_code,acceleration_code\n");
    for (at, [force, _, acceleration, _]) in codes.iter().enumerate() {
        if is_sent(at) {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{},{force},{acceleration}", at + 1);
        }
    }
    text
}

/// The record of the reference, CSV; its gain is off by the factor `gain`.
pub fn reference(shaken: &Shaken, gain: f64, seconds: f64, seed: u64) -> String {
    let mut text = String::from("time_s,acceleration_mps2\n");
    for (time, value) in reference_samples(shaken, gain, seconds, seed) {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{time:.9},{value:.6}");
    }
    text
}

fn reference_samples(shaken: &Shaken, gain: f64, seconds: f64, seed: u64) -> Vec<(f64, f64)> {
    let mut random = chance(seed, 21);
    let phase = deviate(&mut random);
    let sample = |at: usize| {
        let time = at as f64 / REFERENCE_RATE;
        let value = gain * shaken.wave(time * (1.0 + CLOCKS) + phase);
        (time, value + REFERENCE_NOISE * deviate(&mut random))
    };
    (0..(seconds * REFERENCE_RATE) as usize).map(sample).collect()
}
