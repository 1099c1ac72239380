//! The recorded samples through the bead's own fixed-point code: every result must come out bit for bit.

use bead_model::layout::BASELINE;
use bead_model::sensor::GainMatch;
use bead_model::{Meter, Record, Settings, Sink, StrikeReport, Window};
use bead_wire::Strike;

use crate::recording::strikes::{Chunk, RecordedStrike};

/// What became of one strike.
#[derive(Debug, Clone, PartialEq)]
pub struct Replay {
    /// What this computer says of the strike; none where samples or settings are missing.
    pub said: Option<Strike>,
    /// Estimates after every sample, A and B, in [`bead_wire::ENERGY_UNIT_J`].
    pub energies: Vec<(i64, i64)>,
    /// Where device and replay part first; none if they agree in every bit.
    pub first_difference: Option<String>,
}

impl Replay {
    /// Whether everything that the bead said came out again, bit for bit.
    pub fn identical(&self) -> bool {
        self.first_difference.is_none()
    }

    fn impossible(why: String) -> Self {
        Self {
            said: None,
            energies: Vec::new(),
            first_difference: Some(why),
        }
    }
}

/// Replays one strike twice: its window alone, and as a stream through the strike detector, which must fire at the
/// same sample.
pub fn replay(strike: &RecordedStrike) -> Replay {
    let number = strike.said.strike;
    let Some(settings) = &strike.settings else {
        return Replay::impossible(format!(
            "strike {number}: no settings were received, so there is nothing to replay it with"
        ));
    };
    if strike.missing() > 0 {
        return Replay::impossible(format!(
            "strike {number}: {} of its {} samples were not received, from sample index {} on",
            strike.missing(),
            strike.said.samples,
            strike.said.first_index + strike.scans.len() as u64
        ));
    }

    let mut window = Window::open(number, strike.said.first_index);
    let mut record = Record::new();
    record.clear();
    let mut energies = Vec::with_capacity(strike.scans.len());
    for codes in &strike.scans {
        window.process(settings, &[codes.scan()], &mut record);
        energies.push((
            window.absorbed_measured(settings).to_bits(),
            window.absorbed_predicted(settings).to_bits(),
        ));
    }
    let report = window.report(settings, &record);
    let said = wire_strike(&report);
    let first_difference = differs_in_chunks(strike, &energies)
        .or_else(|| differs_in_report(&strike.said, &said))
        .or_else(|| differs_in_shape(&strike.shape?, &wire_shape(&report)))
        .map(|what| format!("strike {number}: {what}"))
        .or_else(|| differs_as_stream(strike, settings));
    Replay {
        said: Some(said),
        energies,
        first_difference,
    }
}

fn differs_in_chunks(strike: &RecordedStrike, energies: &[(i64, i64)]) -> Option<String> {
    strike.chunks.iter().find_map(|chunk| {
        let (measured, predicted) = energies[chunk.end - 1];
        let index = strike.said.first_index + chunk.end as u64 - 1;
        [
            ("absorbed_measured", chunk.absorbed_measured, measured),
            ("absorbed_predicted", chunk.absorbed_predicted, predicted),
        ]
        .into_iter()
        .find(|(_, device, replay)| device != replay)
        .map(|(what, device, replay)| {
            format!("{what} at sample index {index}: device {device:#x}, replay {replay:#x}")
        })
    })
}

fn differs_in_report(device: &Strike, replay: &Strike) -> Option<String> {
    fields(device)
        .into_iter()
        .zip(fields(replay))
        .find(|(device, replay)| device != replay)
        .map(|((what, device), (_, replay))| {
            format!("{what} of the strike frame: device {device:#x}, replay {replay:#x}")
        })
}

fn differs_in_shape(device: &bead_wire::Shape, replay: &bead_wire::Shape) -> Option<String> {
    shape_fields(device)
        .into_iter()
        .zip(shape_fields(replay))
        .find(|(device, replay)| device != replay)
        .map(|((what, device), (_, replay))| {
            format!("{what} of the shape frame: device {device:#x}, replay {replay:#x}")
        })
}

/// Every field of a shape frame, by name, as bits.
fn shape_fields(shape: &bead_wire::Shape) -> [(&'static str, i128); 11] {
    let bead_wire::Shape {
        strike,
        first_index,
        arrival,
        width,
        impulse,
        ring_frequency,
        ring_decay,
        force_gains,
        acceleration_gains,
    } = *shape;
    let bits = |gains: Option<bead_wire::GainMatch>| {
        // One that was not told is unlike any that was.
        gains.map_or([i128::MIN; 2], |gains| {
            [gains.deviation.into(), gains.uncertainty.into()]
        })
    };
    let [force, acceleration] = [force_gains, acceleration_gains].map(bits);
    [
        ("strike", strike.into()),
        ("first_index", first_index.into()),
        ("arrival", arrival.into()),
        ("width", width.into()),
        ("impulse", impulse.into()),
        ("ring_frequency", ring_frequency.into()),
        ("ring_decay", ring_decay.into()),
        ("force_gains.deviation", force[0]),
        ("force_gains.uncertainty", force[1]),
        ("acceleration_gains.deviation", acceleration[0]),
        ("acceleration_gains.uncertainty", acceleration[1]),
    ]
}

/// A shape in the bits of its frame.
pub fn wire_shape(report: &StrikeReport) -> bead_wire::Shape {
    let shape = &report.shape;
    let gains = |gains: GainMatch| bead_wire::GainMatch {
        deviation: gains.deviation.to_bits(),
        uncertainty: gains.uncertainty.to_bits(),
    };
    bead_wire::Shape {
        strike: report.strike,
        first_index: report.first_index,
        arrival: shape.arrival.to_bits(),
        width: shape.width.to_bits(),
        impulse: shape.impulse.to_bits(),
        ring_frequency: shape.ring_frequency.to_bits(),
        ring_decay: shape.ring_decay.to_bits(),
        force_gains: shape.force_gains.map(gains),
        acceleration_gains: shape.acceleration_gains.map(gains),
    }
}

/// Every field of a strike frame, by name, as bits; without what the bead knew of its sensors from before the window.
fn fields(strike: &Strike) -> [(&'static str, i128); 15] {
    let Strike {
        strike,
        first_index,
        trigger_index,
        samples,
        peak_force,
        peak_index,
        acceleration_max,
        acceleration_min,
        absorbed_measured,
        absorbed_predicted,
        incident_energy,
        absorbed_fraction,
        noise_energy,
        force_noise,
        flags,
    } = *strike;
    [
        ("strike", strike.into()),
        ("first_index", first_index.into()),
        ("trigger_index", trigger_index.into()),
        ("samples", samples.into()),
        ("peak_force", peak_force.into()),
        ("peak_index", peak_index.into()),
        ("acceleration_max", acceleration_max.into()),
        ("acceleration_min", acceleration_min.into()),
        ("absorbed_measured", absorbed_measured.into()),
        ("absorbed_predicted", absorbed_predicted.into()),
        ("incident_energy", incident_energy.into()),
        ("absorbed_fraction", absorbed_fraction.into()),
        ("noise_energy", noise_energy.into()),
        ("force_noise", force_noise.into()),
        ("flags", (flags & !Strike::SENSOR_FAULT).into()),
    ]
}

/// A report in the bits of its frame.
pub fn wire_strike(report: &StrikeReport) -> Strike {
    Strike {
        strike: report.strike,
        first_index: report.first_index,
        trigger_index: report.trigger_index,
        samples: report.samples,
        peak_force: report.peak_force.to_bits(),
        peak_index: report.peak_index,
        acceleration_max: report.acceleration_max.to_bits(),
        acceleration_min: report.acceleration_min.to_bits(),
        absorbed_measured: report.absorbed_measured.to_bits(),
        absorbed_predicted: report.absorbed_predicted.to_bits(),
        incident_energy: report.incident_energy.to_bits(),
        absorbed_fraction: report.absorbed_fraction.to_bits(),
        noise_energy: report.noise_energy.to_bits(),
        force_noise: report.force_noise.to_bits(),
        flags: report.flags.bits(),
    }
}

#[derive(Default)]
struct Heard {
    chunks: Vec<Chunk>,
    report: Option<StrikeReport>,
    shape: Option<bead_wire::Shape>,
}

impl Sink for Heard {
    fn chunk(&mut self, chunk: &bead_model::Chunk) {
        let end = self.chunks.last().map_or(0, |chunk| chunk.end) + chunk.scans.len();
        self.chunks.push(Chunk {
            end,
            absorbed_measured: chunk.absorbed_measured.to_bits(),
            absorbed_predicted: chunk.absorbed_predicted.to_bits(),
        });
    }

    fn report(&mut self, report: &StrikeReport) {
        self.report = Some(*report);
        self.shape = Some(wire_shape(report));
    }
}

/// The window begins where the detector's history began, and a detector is armed only by quiet before that. The
/// recording does not hold it, so the quiet start of the window stands in for it.
fn differs_as_stream(strike: &RecordedStrike, settings: &Settings) -> Option<String> {
    let number = strike.said.strike;
    let quiet = strike.scans.get(..usize::from(BASELINE))?;
    let before = u64::from(settings.window.history) + 1;
    let mut meter = Meter::new();
    let mut heard = Heard::default();
    // Indices are the recording's; those of the quiet before it only have to be consecutive.
    let first = strike.said.first_index.wrapping_sub(before);
    let stream = quiet.iter().cycle().take(before as usize).chain(&strike.scans);
    for (offset, codes) in (0..).zip(stream) {
        let fired = meter.strikes();
        meter.process(settings, first.wrapping_add(offset), [codes.scan()], &mut heard);
        let index = first.wrapping_add(offset);
        if meter.strikes() > fired && index != strike.said.trigger_index {
            return Some(format!(
                "strike {number}: the detector fires at sample index {index}, the device's at {}",
                strike.said.trigger_index
            ));
        }
    }
    let Some(report) = heard.report else {
        return Some(format!(
            "strike {number}: the detector does not fire on these samples, the device's fired at {}",
            strike.said.trigger_index
        ));
    };
    let said = Strike {
        strike: number,
        ..wire_strike(&report)
    };
    differs_in_report(&strike.said, &said)
        .map(|what| format!("strike {number}, as a stream: {what}"))
        .or_else(|| {
            let heard = bead_wire::Shape {
                strike: number,
                ..heard.shape?
            };
            differs_in_shape(&strike.shape?, &heard)
                .map(|what| format!("strike {number}, as a stream: {what}"))
        })
        .or_else(|| {
            (heard.chunks != strike.chunks)
                .then(|| format!("strike {number}, as a stream: the chunks are cut otherwise"))
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::testing::recorded_strike;

    #[test]
    fn a_strike_that_this_code_made_replays_to_the_same_bits() {
        let replay = replay(&recorded_strike());
        assert_eq!(replay.first_difference, None);
        assert_eq!(replay.energies.len(), 672);
    }

    #[test]
    fn one_bit_of_any_chunk_is_found_with_its_sample_index() {
        let good = recorded_strike();
        for chunk in 0..good.chunks.len() {
            let mut strike = good.clone();
            strike.chunks[chunk].absorbed_predicted ^= 1;
            let what = replay(&strike).first_difference.unwrap();
            let index = strike.said.first_index + strike.chunks[chunk].end as u64 - 1;
            assert!(
                what.contains(&format!("absorbed_predicted at sample index {index}:")),
                "{what}"
            );
        }
    }

    #[test]
    fn one_unit_of_any_field_of_the_report_is_found_by_name() {
        let good = recorded_strike();
        let check = |name: &str, change: fn(&mut Strike)| {
            let mut strike = good.clone();
            change(&mut strike.said);
            let what = replay(&strike).first_difference.unwrap();
            assert!(what.contains(name), "{name}: {what}");
        };
        check("trigger_index", |said| said.trigger_index += 1);
        check("peak_force", |said| said.peak_force += 1);
        check("peak_index", |said| said.peak_index += 1);
        check("acceleration_max", |said| said.acceleration_max += 1);
        check("acceleration_min", |said| said.acceleration_min += 1);
        check("absorbed_measured", |said| said.absorbed_measured += 1);
        check("absorbed_predicted", |said| said.absorbed_predicted += 1);
        check("incident_energy", |said| said.incident_energy += 1);
        check("flags", |said| said.flags ^= 1);
    }

    #[test]
    fn one_unit_of_any_field_of_the_shape_is_found_by_name() {
        let good = recorded_strike();
        let check = |name: &str, change: fn(&mut bead_wire::Shape)| {
            let mut strike = good.clone();
            change(strike.shape.as_mut().unwrap());
            let what = replay(&strike).first_difference.unwrap();
            assert!(what.contains(name), "{name}: {what}");
        };
        check("arrival", |shape| shape.arrival += 1);
        check("width", |shape| shape.width += 1);
        check("impulse", |shape| shape.impulse += 1);
        check("ring_frequency", |shape| shape.ring_frequency += 1);
        check("ring_decay", |shape| shape.ring_decay += 1);
    }

    #[test]
    fn one_code_changed_is_found() {
        let mut strike = recorded_strike();
        strike.scans[300].sensitive[1] ^= 1;
        assert!(!replay(&strike).identical());
    }

    #[test]
    fn missing_samples_and_settings_are_named() {
        let mut strike = recorded_strike();
        strike.scans.truncate(632);
        strike.chunks.pop();
        let what = replay(&strike).first_difference.unwrap();
        assert!(what.contains("40 of its 672 samples"), "{what}");
        let strike = RecordedStrike {
            settings: None,
            ..recorded_strike()
        };
        assert!(replay(&strike).first_difference.unwrap().contains("no settings"));
    }
}
