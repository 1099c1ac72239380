//! `bead identify`: k, c, gains, and contacts of beads from their strikes.

mod arguments;
mod text;

pub(crate) use arguments::Arguments;

use crate::cli::commands::prelude::*;
use crate::cli::commands::settings_file;
use crate::cli::table_file::TableFile;
use arguments::{Method, MountingOption};
use bead_compare::sensed::load_scenario;
use bead_identify::bead::{BeadError, BeadStrikes, IdentifiedBead, Request, identify_bead, take};
use bead_identify::report::IdentifyReport;
use bead_identify::table::{columns, rows};
use bead_recording::physical;
use bead_recording::strikes::LeftOut;

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    check_method(arguments)?;
    let outputs = Outputs::new(arguments)?;
    let scenario = arguments.scenario.as_deref().map(load_scenario).transpose()?;
    let scenario = scenario.map(|(scenario, _)| scenario);
    let stated = settings_file::uncertainty(arguments.uncertainty.as_deref())?;
    let from = arguments.from.as_deref();
    let from = from.map(settings_file::decoded).transpose()?;
    let (beads, names) = read(arguments)?;
    if (outputs.settings.is_some() || outputs.picture.is_some()) && beads.len() > 1 {
        let addresses: Vec<u8> = beads.iter().map(|bead| bead.address).collect();
        bail!(
            Input,
            "settings and picture are of one bead, but the recordings have the beads {addresses:?}; choose one with --bead"
        );
    }
    let request = Request {
        method: arguments.chosen().into(),
        mounting: arguments.mounting.into(),
        fit: arguments.fit.clone(),
        scenario: scenario.as_ref(),
        place: arguments.place,
        stated,
        from: from.map(|settings| *settings.description()),
        names: &names,
        draws: outputs.picture.is_some(),
        samples: outputs.table.is_some(),
    };
    let progress = output::spinner("identifying");
    let (mut found, mut failed) = (Vec::new(), Vec::new());
    for bead in beads {
        progress.set_message(format!("bead {}: {} strikes", bead.address, bead.gathered.len()));
        match identify_bead(&request, &bead) {
            Ok(bead) => {
                if let Some(line) = LeftOut::line(bead.result.address, &bead.result.left_out) {
                    progress.suspend(|| note!("{line}"));
                }
                found.push(bead);
            }
            // The other beads go on.
            Err(error) => failed.push(refused(&error)),
        }
    }
    progress.finish_and_clear();
    if found.is_empty()
        && let Some(failure) = failed.pop()
    {
        return Err(failure);
    }
    failed.iter().for_each(|failure| note!("{failure}"));
    outputs.write(&mut found)?;
    let results = found.into_iter().map(|bead| bead.result);
    let report = IdentifyReport::new(request.method, results.collect());
    output::print(arguments.format, &report, || text::text(&report))
}

/// Reads the chosen strikes of all recordings. Returns the names of the recordings too.
fn read(arguments: &Arguments) -> Result<(Vec<BeadStrikes>, Vec<String>), Failure> {
    let choice = &arguments.strikes;
    let progress = output::spinner("reading");
    let mut beads: Vec<BeadStrikes> = Vec::new();
    let names = choice.each_strike(&progress, &mut beads, |beads, place, recording, strike| {
        take(&mut beads[place], recording, strike, arguments.doubtful);
        Ok(())
    })?;
    progress.finish_and_clear();
    choice.check(&beads)?;
    beads.retain(|bead| choice.has(bead.address));
    Ok((beads, names))
}

fn refused(error: &BeadError) -> Failure {
    match error {
        BeadError::NoStrike { left_out, .. } if left_out.is_empty() => {
            failure!(Input, "{error}; see --strike")
        }
        _ => Failure::input(error),
    }
}

/// Files to be written.
struct Outputs {
    settings: Option<Target>,
    picture: Option<Target>,
    table: Option<TableFile>,
}

impl Outputs {
    /// The places of the files, before the work.
    fn new(arguments: &Arguments) -> Result<Self, Failure> {
        let inputs: Vec<&Path> = arguments
            .strikes
            .recordings
            .iter()
            .chain(&arguments.scenario)
            .chain(&arguments.from)
            .chain(&arguments.uncertainty)
            .map(PathBuf::as_path)
            .collect();
        let Arguments {
            out_settings,
            picture,
            out,
            overwrite,
            ..
        } = arguments;
        let names = [out_settings, picture, out].map(Option::as_deref);
        for (one, other) in [(0, 1), (0, 2), (1, 2)] {
            place::apart(names[one], names[other])?;
        }
        let [settings, picture, out] = names;
        Ok(Self {
            settings: overwrite.optional(settings, FileKind::Scenario, &inputs)?,
            picture: overwrite.optional(picture, FileKind::Drawing, &inputs)?,
            table: TableFile::optional(*overwrite, out, &inputs)?,
        })
    }

    /// Writes the files of the beads.
    fn write(self, beads: &mut [IdentifiedBead]) -> Result<(), Failure> {
        if let Some(table) = self.table {
            table.write("samples", &columns(), |table| {
                let mut ids = 0..;
                for IdentifiedBead { result, samples, .. } in &mut *beads {
                    for (strike, samples) in result.strikes.iter().zip(samples.drain(..)) {
                        let id = ids.next().unwrap_or_default();
                        let who = (id, result.address, result.uid.as_deref());
                        let named = (strike.recording.as_str(), strike.strike);
                        rows(who, named, samples).try_for_each(|row| table.push(row))?;
                    }
                }
                Ok(())
            })?;
        }
        let Some(made) = beads.last() else { return Ok(()) };
        if let Some(settings) = self.settings {
            // A file that no bead would take is not written.
            physical::derived(&made.description)?;
            let shown = settings.path().display().to_string();
            settings.write_bytes(physical::to_toml(&made.description))?;
            note!("wrote {shown}; make settings of it: bead settings make {shown}");
        }
        if let (Some(picture), Some(svg)) = (self.picture, &made.svg) {
            picture.write_bytes(svg)?;
        }
        Ok(())
    }
}

/// Refuses a method without its data.
fn check_method(arguments: &Arguments) -> Result<(), Failure> {
    match (arguments.chosen(), &arguments.scenario) {
        (Method::Chain, None) => bail!(
            Input,
            "--method chain simulates the chain from the striker to the bead; describe it by --scenario S.toml"
        ),
        (Method::RingDown | Method::Pairs, Some(_)) => bail!(
            Input,
            "--scenario describes a chain, but this --method takes taps on a bead outside of a chain; leave one of them out"
        ),
        (Method::Pairs, None) if arguments.mounting == MountingOption::Held => bail!(
            Input,
            "--method pairs takes a bead that flies freely after a tap; a clamped bead does not move: leave out --mounting"
        ),
        _ => Ok(()),
    }
}
