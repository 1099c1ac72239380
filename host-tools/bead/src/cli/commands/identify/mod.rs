//! `bead identify`: k, c, gains, and contacts of beads from their strikes.

mod arguments;
pub(crate) mod report;
mod strikes;
mod text;

pub(crate) use arguments::Arguments;

use bead_model::design::{Description, Uncertainty};
use bead_model::settings::Settings;
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use crate::cli::chosen::left_out_line;
use crate::cli::commands::prelude::*;
use crate::cli::commands::settings_file;
use arguments::{Method, MountingOption};
use bead_compare::sensed::{load_scenario, only_host};
use bead_identify::chain::ChainOfScenario;
use bead_identify::chain_runs::ChainRuns;
use bead_identify::chain_strike::ChainStrike;
use bead_identify::identified::{Candidate, Identified, Wanted, identify};
use bead_identify::model::{SignalSample, StrikeModel};
use bead_identify::noise::Noise;
use bead_identify::pair::Tap;
use bead_identify::picture;
use bead_identify::quantity::{Quantity, Values};
use bead_identify::report::{About, BeadResult, NoiseResult};
use bead_identify::ring_down::{Mounting, RingDown};
use bead_identify::series::{CHANNELS, noises};
use bead_identify::settings;
use bead_identify::table::{channel_name, columns, rows};
use bead_recording::physical;
use bead_recording::strikes::LeftOut;
use bead_tables::Writer;
use report::IdentifyReport;
use strikes::{BeadStrikes, TakenStrike};

/// Notes of a Parquet file.
const NOTES: [(&str, &str); 1] = [("made_by", concat!("bead ", env!("CARGO_PKG_VERSION")))];
/// Young's modulus where no scenario has one: it has no part in a ringing.
const NO_MODULUS: f64 = 1.0;

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    check_method(arguments)?;
    let outputs = Outputs::new(arguments)?;
    let scenario = arguments.scenario.as_deref().map(load_scenario).transpose()?;
    let scenario = scenario.map(|(scenario, _)| scenario);
    let stated = arguments.uncertainty.as_deref();
    let stated = stated.map(settings_file::uncertainty).transpose()?;
    let from = arguments.from.as_deref().map(description_in).transpose()?;
    let (beads, names) = strikes::read(arguments)?;
    if (outputs.settings.is_some() || outputs.picture.is_some()) && beads.len() > 1 {
        let addresses: Vec<u8> = beads.iter().map(|bead| bead.address).collect();
        bail!(
            Input,
            "settings and picture are those of one bead, and the recordings have the beads {addresses:?}; choose by --bead"
        );
    }
    let inputs = Inputs {
        arguments,
        scenario: scenario.as_ref(),
        stated,
        from,
        names: &names,
    };
    let progress = output::spinner("identifying");
    let (mut results, mut all_made, mut failed) = (Vec::new(), Vec::new(), Vec::new());
    for bead in beads {
        progress.set_message(format!("bead {}: {} strikes", bead.address, bead.gathered.len()));
        match of_bead(&inputs, &bead, &outputs) {
            Ok((result, made)) => {
                if let Some(line) = left_out_line(result.address, &result.left_out) {
                    progress.suspend(|| note!("{line}"));
                }
                results.push(result);
                all_made.push(made);
            }
            // The other beads go on.
            Err(failure) => failed.push(failure),
        }
    }
    progress.finish_and_clear();
    if results.is_empty()
        && let Some(failure) = failed.pop()
    {
        return Err(failure);
    }
    failed.iter().for_each(|failure| note!("{failure}"));
    outputs.write(&results, all_made)?;
    let report = IdentifyReport::new(arguments.chosen(), results);
    output::print(arguments.format, &report, || text::text(&report))
}

/// Files to be written.
struct Outputs {
    settings: Option<Target>,
    picture: Option<Target>,
    table: Option<Target>,
    is_csv: bool,
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
        let is_csv = out
            .as_ref()
            .is_some_and(|out| out.extension().is_some_and(|end| end == "csv"));
        let table = if is_csv {
            FileKind::Table
        } else {
            FileKind::Parquet
        };
        let [settings, picture, out] = names;
        Ok(Self {
            settings: overwrite.optional(settings, FileKind::Scenario, &inputs)?,
            picture: overwrite.optional(picture, FileKind::Drawing, &inputs)?,
            table: overwrite.optional(out, table, &inputs)?,
            is_csv,
        })
    }

    /// Writes the files of the results, of which each bead made some.
    fn write(self, results: &[BeadResult], mut all: Vec<Made>) -> Result<(), Failure> {
        if let Some(table) = self.table {
            table.write(|file| {
                let mut writer = if self.is_csv {
                    Writer::csv(file, &columns())?
                } else {
                    Writer::parquet(file, "samples", &columns(), &NOTES)?
                };
                let mut ids = 0..;
                for (result, made) in results.iter().zip(&mut all) {
                    for (strike, samples) in result.strikes.iter().zip(made.samples.drain(..)) {
                        let id = ids.next().unwrap_or_default();
                        let who = (id, result.address, result.uid.as_deref());
                        let named = (strike.recording.as_str(), strike.strike);
                        rows(who, named, samples).try_for_each(|row| writer.push(row))?;
                    }
                }
                writer.finish()
            })?;
        }
        let Some(made) = all.pop() else { return Ok(()) };
        if let Some(settings) = self.settings {
            // A file that no bead would take is not written.
            physical::derived(&made.description)?;
            let shown = settings.path().display().to_string();
            settings.write_bytes(physical::to_toml(&made.description))?;
            note!("wrote {shown}; make settings of it: bead settings make {shown}");
        }
        if let (Some(picture), Some(svg)) = (self.picture, made.svg) {
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
            "--scenario describes a chain, and the method takes taps at a bead outside of one; leave one of them out"
        ),
        (Method::Pairs, None) if arguments.mounting == MountingOption::Held => bail!(
            Input,
            "--method pairs takes a bead that flies freely after a tap; a clamped one does not move: leave out --mounting"
        ),
        _ => Ok(()),
    }
}

/// The quantities in a file of settings.
fn description_in(file: &Path) -> Result<Description, Failure> {
    let settings = Settings::decode(&settings_file::load(file, None)?);
    let settings = settings.map_err(|error| failure!(Input, "{}: {error}", file.display()))?;
    Ok(*settings.description())
}

/// Inputs of all beads.
struct Inputs<'a> {
    arguments: &'a Arguments,
    scenario: Option<&'a Scenario>,
    stated: Option<Uncertainty>,
    from: Option<Description>,
    names: &'a [String],
}

/// Files that are made of a bead.
struct Made {
    description: Description,
    svg: Option<String>,
    /// Samples of each used strike, if they are wanted.
    samples: Vec<Vec<SignalSample>>,
}

fn of_bead(
    inputs: &Inputs<'_>,
    bead: &BeadStrikes,
    outputs: &Outputs,
) -> Result<(BeadResult, Made), Failure> {
    let Some(last) = bead.gathered.last() else {
        return Err(nothing(bead.address, &bead.left_out));
    };
    let description = inputs.from.unwrap_or(last.series.description);
    let noises = noises(bead.gathered.iter().map(|strike| &strike.series));
    let chain = inputs
        .scenario
        .map(|scenario| chain_of(inputs, scenario, bead.address))
        .transpose()?;
    let start = chain.as_ref().map_or_else(
        || settings::values(&description, NO_MODULUS),
        ChainOfScenario::values,
    );
    let (candidates, mut out) = candidates(inputs, bead, chain.as_ref(), &noises, &start);
    let mut left_out = bead.left_out.clone();
    left_out.append(&mut out);
    if candidates.is_empty() {
        return Err(nothing(bead.address, &left_out));
    }
    let mut free = inputs.arguments.fit.clone();
    if free.is_empty() {
        free = vec![Quantity::Stiffness, Quantity::Damping];
        match inputs.arguments.chosen() {
            Method::RingDown => {}
            Method::Pairs => free.push(Quantity::AccelerationGain),
            Method::Chain => free.extend([Quantity::Young, Quantity::Relaxation]),
        }
    }
    let stated = inputs.stated.or(description.uncertainty);
    // The force has no part in a ringing.
    let of_ringing = inputs.arguments.chosen() == Method::RingDown;
    let used = CHANNELS
        .into_iter()
        .filter(|channel| !of_ringing || !channel.is_force())
        .filter_map(|channel| noises[channel.place()].as_ref());
    let wanted = Wanted {
        start,
        free,
        stated: settings::stated(stated.as_ref()),
        noise_free: used.map(Noise::free).sum(),
        recordings: inputs.names.to_vec(),
    };
    let found =
        identify(&candidates, &wanted).map_err(|error| failure!(Input, "bead {}: {error}", bead.address))?;
    let noise = CHANNELS.into_iter().filter_map(|channel| {
        let noise = noises[channel.place()].as_ref()?;
        Some(NoiseResult {
            channel: channel_name(channel),
            deviation: noise.deviation(),
            order: noise.order(),
        })
    });
    let about = About {
        address: bead.address,
        uid: bead.uid(),
        noise: noise.collect(),
        left_out,
    };
    let result = BeadResult::new(&found, &candidates, &wanted, about);
    let made = made_of(
        &found,
        &wanted,
        &result,
        (&description, stated),
        chain.as_ref(),
        outputs,
    )?;
    Ok((result, made))
}

fn made_of(
    found: &Identified<'_>,
    wanted: &Wanted,
    result: &BeadResult,
    (description, stated): (&Description, Option<Uncertainty>),
    chain: Option<&ChainOfScenario>,
    outputs: &Outputs,
) -> Result<Made, Failure> {
    let before = Description {
        uncertainty: stated,
        ..*description
    };
    let known = |quantity: Quantity| {
        let of = |one: &&bead_identify::report::QuantityResult| one.quantity == quantity;
        result
            .quantities
            .iter()
            .find(of)
            .is_some_and(|one| one.relative_uncertainty.is_some())
    };
    let description = settings::identified(&before, found, chain, known).map_err(Failure::input)?;
    let draws = outputs.picture.is_some();
    let svg = draws
        .then(|| picture::svg(found, wanted))
        .transpose()
        .map_err(Failure::input)?;
    let strikes = found.best.strikes.iter().filter(|_| outputs.table.is_some());
    let samples = strikes.map(|strike| {
        let samples = strike.model.samples(&found.best.values, &strike.own);
        samples.map_err(Failure::input)
    });
    Ok(Made {
        description,
        svg,
        samples: samples.collect::<Result<_, _>>()?,
    })
}

/// The place of a bead in the chain of a scenario.
fn chain_of(inputs: &Inputs<'_>, scenario: &Scenario, address: u8) -> Result<ChainOfScenario, Failure> {
    let is_host = |bead: usize| scenario.intruders.iter().any(|one| one.beads.contains(&bead));
    let place = match inputs.arguments.place {
        Some(place) => place,
        None if is_host(address.into()) => address.into(),
        None => only_host(scenario)?,
    };
    ChainOfScenario::new(scenario, place).map_err(Failure::input)
}

/// The models of the strikes, and the strikes that have none.
fn candidates(
    inputs: &Inputs<'_>,
    bead: &BeadStrikes,
    chain: Option<&ChainOfScenario>,
    noises: &[Option<Noise>; 4],
    start: &Values,
) -> (Vec<Candidate>, Vec<LeftOut>) {
    let mounting = match inputs.arguments.mounting {
        MountingOption::Free => Mounting::Free,
        MountingOption::Held => Mounting::Held,
    };
    let runs = chain.map(|chain| ChainRuns::new(chain.clone()));
    let model = |strike: &TakenStrike| -> Result<Box<dyn StrikeModel + Send>, String> {
        Ok(match (&runs, inputs.arguments.chosen()) {
            (Some(runs), _) => Box::new(ChainStrike::new(runs, &strike.series, noises, start)?),
            (None, Method::Pairs) => Box::new(Tap::new(&strike.series, noises)?),
            (None, _) => Box::new(RingDown::new(&strike.series, noises, start, mounting)?),
        })
    };
    let models: Vec<_> = bead.gathered.par_iter().map(model).collect();
    let (mut candidates, mut left_out) = (Vec::new(), Vec::new());
    for (strike, model) in bead.gathered.iter().zip(models) {
        match model {
            Ok(model) => candidates.push(Candidate {
                recording: strike.recording,
                number: strike.number,
                model,
            }),
            Err(why) => left_out.push(LeftOut {
                recording: inputs.names[strike.recording].clone(),
                strike: strike.number,
                why,
            }),
        }
    }
    (candidates, left_out)
}

/// The failure of a bead of which no strike has a part.
fn nothing(address: u8, left_out: &[LeftOut]) -> Failure {
    let why = left_out_line(address, left_out);
    failure!(
        Input,
        "{}",
        why.unwrap_or_else(|| format!("bead {address}: no strike was chosen; see --strike"))
    )
}
