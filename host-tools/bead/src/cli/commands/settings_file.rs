//! Settings in files: blocks, and the physical quantities that blocks are made of.

use std::fs::File;
use std::io::Read;

use bead_model::design::{Bead, Capture, Description, FrontEnd, Surroundings, Uncertainty};
use bead_model::settings::{BLOCK_MAX, Settings, SettingsError};
use bead_wire::MAX_BLOCK;
use hertz_chain::read_text;

use crate::cli::commands::prelude::*;
use bead_compare::sensed::{bead_of, load_scenario, only_host, simulate_with_ring_down, surroundings_of};
use bead_console::beads::one_bead;
use bead_recording::physical::{self, Change};

const AFTER_HELP: &str = "\
The file explains each of its keys. Masses are weighed, springs and damper come from ring-downs (`bead \
compare` finds k and c), scales from the drop test and the shaker: docs/calibration.md.

Examples:
  bead settings make --template bead.toml
  bead settings make --template bead.toml \\
      --scenario docs/scenarios/own-chain.toml --bead 8
  bead settings make --template bead.toml --from before.settings
  bead settings make bead.toml --out left.settings";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct MakeArguments {
    /// The physical quantities, a TOML file in SI units. With --template this file is written.
    #[arg(value_name = "F.toml")]
    file: PathBuf,
    /// File for the settings [default: next to F.toml, with its name and the ending .settings].
    #[arg(long, value_name = "F.settings", conflicts_with = "template")]
    out: Option<PathBuf>,
    /// Write F.toml, to be edited: the paper's bead behind the reference front end, unless --scenario or
    /// --from says otherwise.
    #[arg(long)]
    template: bool,
    /// Take the bead of this scenario.
    #[arg(long, value_name = "S.toml", requires = "template", conflicts_with = "from")]
    scenario: Option<PathBuf>,
    /// Which bead of the scenario [default: the only one with an intruder].
    #[arg(long, value_name = "N", requires = "scenario", value_parser = one_bead)]
    bead: Option<usize>,
    /// Take the bead of this settings block.
    #[arg(long, value_name = "F.settings", requires = "template")]
    from: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
}

pub(super) fn make(arguments: &MakeArguments) -> Result<(), Failure> {
    let file = &arguments.file;
    if arguments.template {
        let inputs = [&arguments.scenario, &arguments.from];
        let inputs: Vec<&Path> = inputs.iter().filter_map(|path| path.as_deref()).collect();
        let target = place::target(file, FileKind::Scenario, &inputs, arguments.overwrite)?;
        let text = physical::to_toml(&template(arguments)?);
        target.write_bytes(text)?;
        note!("wrote {0}; edit it, then: bead settings make {0}", file.display());
        return Ok(());
    }
    let out = arguments
        .out
        .clone()
        .unwrap_or_else(|| file.with_extension("settings"));
    let target = place::target(&out, FileKind::Settings, &[file], arguments.overwrite)?;
    let settings = read_toml(file)?;
    let block = block(&settings).with_context(|| file.display().to_string())?;
    target.write_bytes(&block)?;
    let (length, out) = (block.len(), out.display());
    note!("wrote {out}, {length} bytes; give it to the bead: bead settings write {out} --port P");
    Ok(())
}

fn template(arguments: &MakeArguments) -> Result<Description, Failure> {
    if let Some(from) = &arguments.from {
        return Ok(*decoded(from)?.description());
    }
    let (mut bead, mut around) = (Bead::paper(), Surroundings::default());
    if let Some(path) = &arguments.scenario {
        let (scenario, _) = load_scenario(path)?;
        let place = arguments.bead.map_or_else(|| only_host(&scenario), Ok)?;
        let solution = simulate_with_ring_down(&scenario)?;
        (bead, around) = (bead_of(&solution, place)?, surroundings_of(&solution, place));
    }
    let front_end = FrontEnd::reference();
    let capture = Capture::of(&bead, &front_end);
    Ok(Description::new(&bead, &around, &front_end, &capture))
}

fn read_toml(file: &Path) -> Result<Settings, Failure> {
    let text = read_text(file, "a file that `bead settings make --template` wrote")?;
    Ok(physical::parse(&text, &file.display().to_string())?)
}

/// The block of these settings.
pub(super) fn block(settings: &Settings) -> Result<Vec<u8>, SettingsError> {
    let mut block = [0; BLOCK_MAX];
    let length = settings.encode(&mut block)?;
    Ok(block[..length].to_vec())
}

/// The bytes of a file that may be a block: no more are read than one has.
fn block_in(file: &Path) -> Result<Vec<u8>, Failure> {
    let name = file.display();
    let mut bytes = Vec::new();
    let is_stream = file == Path::new("-");
    let read = File::open(if is_stream { Path::new("/dev/stdin") } else { file })
        .and_then(|open| open.take(MAX_BLOCK as u64 + 1).read_to_end(&mut bytes));
    read.with_context(|| format!("cannot read {name}"))?;
    if bytes.is_empty() || bytes.len() > MAX_BLOCK {
        bail!(
            Input,
            "{name}: this is not a settings block, which has 1 to {MAX_BLOCK} bytes; give a file that `bead settings read`, \
             `bead settings make` or `bead emulate` wrote, or a TOML file of physical quantities, named .toml"
        );
    }
    Ok(bytes)
}

/// The block in a file, or the one made of a file of physical quantities; with another address if one is
/// given.
pub(super) fn load(file: &Path, address: Option<u8>) -> Result<Vec<u8>, Failure> {
    let name = file.display();
    let refused = |error| failure!(Input, "{name}: {error}");
    let is_toml = file.extension().is_some_and(|ending| ending == "toml");
    let bytes = if is_toml {
        block(&read_toml(file)?).map_err(refused)?
    } else {
        block_in(file)?
    };
    let Some(address) = address else {
        return Ok(bytes);
    };
    let settings = Settings::decode(&bytes).map_err(refused)?;
    let settings = settings.with(|description| description.address = address);
    block(&settings.map_err(|violation| refused(violation.into()))?).map_err(refused)
}

/// The settings in a file, a block or physical quantities.
pub(super) fn decoded(file: &Path) -> Result<Settings, Failure> {
    let settings = Settings::decode(&load(file, None)?);
    settings.map_err(|error| failure!(Input, "{}: {error}", file.display()))
}

/// The uncertainties that a file of settings states, if one is given.
pub(super) fn uncertainty(file: Option<&Path>) -> Result<Option<Uncertainty>, Failure> {
    let Some(file) = file else { return Ok(None) };
    let stated = decoded(file)?.description().uncertainty;
    if stated.is_none() {
        let name = file.display();
        bail!(
            Input,
            "{name} states no uncertainties; give them in its table [uncertainty]"
        );
    }
    Ok(stated)
}

/// Changes some keys of settings, as [`physical::set`] does: the differences, and the new block.
pub(super) fn changed(
    settings: &Settings,
    assignments: &[String],
) -> Result<(Vec<Change>, Vec<u8>), Failure> {
    let before = *settings.description();
    let mut after = before;
    for assignment in assignments {
        physical::set(&mut after, assignment)?;
    }
    let block = block(&physical::derived(&after)?).map_err(Failure::input)?;
    Ok((physical::changes(&before, &after), block))
}
