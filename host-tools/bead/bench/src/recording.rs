//! A recording of emulated beads.

use std::path::PathBuf;

use bead_wire::Message;
use serde::Serialize;

use crate::emulation::{Emulation, Ran};
use crate::error::BenchError;
use crate::several;
use bead_compare::front_end::SAMPLE_RATE_HZ;
use bead_recording::file::{About, Part, RecordingError, RecordingOrigin, RecordingWriter};
use bead_tables::whole::Target;

/// Writes everything that belongs to a run to one recording, and returns its path. `scenario` is the text
/// of the scenario's file. `about` holds its notes; this adds what the run knows. A recording that fails is
/// removed.
///
/// # Errors
/// The file cannot be written.
pub fn write(
    target: &Target,
    ran: &[(Emulation, Ran)],
    of_several: bool,
    scenario: &str,
    about: About,
) -> Result<PathBuf, BenchError> {
    let mut frames = ran.iter().flat_map(|(_, ran)| &ran.frames);
    let firmware = frames.find_map(|frame| match &frame.message {
        Message::Identity(identity) => Some(format!("{} ({})", identity.firmware, identity.git)),
        _ => None,
    });
    let about = About {
        source: "bead emulate".to_owned(),
        firmware,
        sample_rate_hz: SAMPLE_RATE_HZ,
        ..about
    };
    let mut parts = Vec::new();
    for (emulation, ran) in ran {
        let (truth, report) = (json(&emulation.truth)?, json(&ran.report)?);
        let settings = (Part::Settings, emulation.block.clone());
        parts.push([settings, (Part::Truth, truth), (Part::EmulatorReport, report)]);
    }
    let scenario = (Part::Scenario, scenario.as_bytes());
    let written = match (ran, &parts[..]) {
        ([(emulation, ran)], [[settings, others @ ..]]) if !of_several => {
            RecordingWriter::create(target, &about).and_then(|writer| {
                writer.fill(|writer| {
                    writer.attach(settings.0, &settings.1)?;
                    writer.attach(scenario.0, scenario.1)?;
                    for (part, data) in others {
                        writer.attach(*part, data)?;
                    }
                    ran.write(writer, (emulation.truth.began * 1e9).round() as u64)
                })
            })
        }
        _ => RecordingWriter::create_for_several(target, &about).and_then(|writer| {
            writer.fill(|writer| {
                writer.attach(scenario.0, scenario.1)?;
                let mut of_beads = Vec::new();
                for ((emulation, ran), parts) in ran.iter().zip(&parts) {
                    let bead = writer.join(&RecordingOrigin {
                        address: emulation.settings.description().address,
                        bead: Some(emulation.truth.bead),
                        port: None,
                        clock: Some("emulator".to_owned()),
                    })?;
                    for (part, data) in parts {
                        writer.attach_to(bead, *part, data)?;
                    }
                    of_beads.push((bead, ran, emulation.truth.began));
                }
                several::write(&of_beads, writer)
            })
        }),
    };
    let unwritten = |error: RecordingError| BenchError::Unfit(error.to_string());
    Ok(written.map_err(unwritten)?.path)
}

fn json(value: &impl Serialize) -> Result<Vec<u8>, BenchError> {
    serde_json::to_vec_pretty(value).map_err(|error| BenchError::unfit("cannot write JSON", error))
}
