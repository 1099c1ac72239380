//! `bead settings`: a bead's settings, read, written and shown.

use std::fs;

use bead_model::converter::CONVERSION;
use bead_model::design::Description;
use bead_model::settings::{Settings, SettingsError, VERSION};
use bead_model::violation::SettingKey;
use bead_wire::{Block, KEY, Message, Outcome, Request};
use clap::{ArgGroup, Subcommand};
use serde_json::Value;

use crate::cli::commands::prelude::*;
use crate::cli::commands::settings_file;
use crate::cli::line_options::LineOptions;
use crate::cli::provenance::today;
use bead_line::conversation::{Conversation, LineError};
use bead_line::key;
use bead_recording::physical::{KEYS, calibration_doubt, shown, value};

const AFTER_HELP: &str = "\
Settings are a file of some 100 bytes: calibration, window and the coefficients of both estimates, with a \
checksum. `make` makes one from a TOML file of physical quantities; `bead emulate … --out DIR` derives one \
from a scenario.

Exit status 1 if the bead refuses, with its reason; 3 if it does not answer.

Examples:
  bead settings make --template bead.toml     (then edit it)
  bead settings make bead.toml
  bead settings write bead.toml --port /dev/ttyUSB0
  bead settings set name=left k=3.9e5 --port /dev/ttyUSB0
  bead settings read --port /dev/ttyUSB0 --out bead.settings
  bead settings set name=right --port /dev/ttyUSB0 \\
      --address 4 (one of several on a line)
  bead settings show bead.settings
  bead settings write --port /dev/ttyUSB0 run/bead-8.settings
  bead settings reset --port tcp:192.168.1.7:4000
  bead settings key --new bead-8.key --port /dev/ttyUSB0";

/// Text in place of the supply of the calibration where that is unknown.
const SUPPLY_UNKNOWN: &str =
    "unknown: A and B hold only at that supply, 1 % of it is 2 % of both, and no strike is flagged";

const KEY_HELP: &str = "\
The key is 16 random bytes. The first key is sent to the bead unmasked: give it where nobody else listens. A \
key that replaces another key is masked by the old one. docs/security.md explains what a key protects from and \
what it does not.

Examples:
  bead settings key --new bead-8.key --port /dev/ttyUSB0
  bead settings write bead-8.settings --key bead-8.key --port /dev/ttyUSB0
  bead settings key --new newer.key --key bead-8.key --port /dev/ttyUSB0
  bead settings key --remove --key newer.key --port /dev/ttyUSB0";

#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    action: SettingsAction,
}

#[derive(Debug, Subcommand)]
enum SettingsAction {
    /// Make settings from a file of physical quantities, or write such a file to start from.
    Make(settings_file::MakeArguments),
    /// Show the settings that a bead measures with, and keep them in a file.
    Read {
        #[command(flatten)]
        line: LineOptions,
        /// Keep the block in this file.
        #[arg(long, value_name = "F.settings")]
        out: Option<PathBuf>,
        #[command(flatten)]
        overwrite: Overwrite,
        /// Format of the settings.
        #[arg(long, value_enum, default_value_t)]
        format: Format,
    },
    /// Write settings to a bead: they are in force from the next strike on, and kept in its flash.
    Write {
        /// The settings, or the physical quantities that they are made of.
        #[arg(value_name = "F.settings|F.toml")]
        file: PathBuf,
        /// Give the bead this address, 0 to 254, instead of the one in the file.
        ///
        /// It tells beads apart on a shared line.
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(..255))]
        new_address: Option<u8>,
        #[command(flatten)]
        line: LineOptions,
    },
    /// Show the settings in a file.
    Show {
        /// The settings, or the physical quantities that they are made of.
        #[arg(value_name = "F.settings|F.toml")]
        file: PathBuf,
        /// Format of the settings.
        #[arg(long, value_enum, default_value_t)]
        format: Format,
    },
    /// Change some of the settings of a bead: prints what changes, then sends it.
    Set {
        /// Settings to change: `name=left`, `address=3`, `k=3.9e5`, `force.per_code=3.91e-3`. Keys are those
        /// of the file that `bead settings make --template` writes; M, m, k, c, kappa and tau stand for the
        /// masses, springs and contacts. SI units.
        #[arg(value_name = "KEY=VALUE", required = true, value_parser = key_and_value)]
        changes: Vec<String>,
        /// Only print what would change.
        #[arg(long)]
        dry_run: bool,
        #[command(flatten)]
        line: LineOptions,
    },
    /// Erase the settings that a bead was given over the link. It goes back to the settings of the debug
    /// probe, or to the built-in ones.
    Reset {
        #[command(flatten)]
        line: LineOptions,
    },
    /// Give a bead a key. From then on it changes its state only if a request is signed with that key (--key,
    /// here and in `bead command`). It answers questions as before. Only a debug probe helps if a key is
    /// lost.
    #[command(group(ArgGroup::new("which").required(true)), after_help = KEY_HELP)]
    Key {
        /// Make a key and keep it in this new file.
        #[arg(long, value_name = "F.key", group = "which")]
        new: Option<PathBuf>,
        /// Give the key in this file: several beads may share a key.
        #[arg(long, value_name = "F.key", group = "which")]
        give: Option<PathBuf>,
        /// Take the bead's key away. It then does what anybody on its line asks.
        #[arg(long, group = "which")]
        remove: bool,
        #[command(flatten)]
        line: LineOptions,
    },
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    match &arguments.action {
        SettingsAction::Read {
            line,
            out,
            overwrite,
            format,
        } => {
            let out = overwrite.optional(out.as_deref(), FileKind::Settings, &[])?;
            let block = ask(&mut line.open()?)?;
            if let Some(out) = out {
                out.write_bytes(block.bytes())?;
            }
            print(block.bytes(), *format, "the bead's settings: ")
        }
        SettingsAction::Make(arguments) => settings_file::make(arguments),
        SettingsAction::Write {
            file,
            new_address,
            line,
        } => {
            let block = settings_file::load(file, *new_address)?;
            store(&mut line.open()?, &block)?;
            let (length, file) = (block.len(), file.display());
            note!("the {length} bytes of {file} are stored and in force");
            Ok(())
        }
        SettingsAction::Show { file, format } => {
            let block = settings_file::load(file, None)?;
            print(&block, *format, &format!("{}: ", file.display()))
        }
        SettingsAction::Set {
            changes,
            dry_run,
            line,
        } => set(changes, *dry_run, line),
        SettingsAction::Reset { line } => {
            let answer = line.open()?.request_done(&Request::EraseSettings)?;
            note!("settings {}", answer.reply.detail);
            Ok(())
        }
        SettingsAction::Key { new, give, line, .. } => set_key(new.as_deref(), give.as_deref(), line),
    }
}

/// Checks an argument of `bead settings set`, and returns it as typed.
fn key_and_value(text: &str) -> Result<String, String> {
    match text.split_once('=') {
        Some((key, value)) if !key.is_empty() && !value.is_empty() => Ok(text.to_owned()),
        _ => Err("write KEY=VALUE, such as name=left or k=3.9e5".to_owned()),
    }
}

/// Gives the bead the key in a new file, in a file that there is, or none.
fn set_key(new: Option<&Path>, give: Option<&Path>, line: &LineOptions) -> Result<(), Failure> {
    let given = give.map(key::read).transpose()?;
    let mut bead = line.open()?;
    let path = new
        .or(give)
        .map(|path| path.display().to_string())
        .unwrap_or_default();
    let may_have = format!(
        "the bead may have taken the key in {path}: keep it, and try `bead command reset-counters --key {path}`"
    );
    if !path.is_empty() {
        interrupt::resumable(may_have.clone());
    }
    // Kept before the bead is asked: a key that the bead took must not be lost.
    let key = match new {
        Some(path) => Some(key::create(path)?),
        None => given,
    };
    let bytes = key.as_ref().map_or([0; KEY], |key| *key.bytes());
    if let Err(error) = bead.request_done(&Request::SetKey { key: bytes }) {
        let Some(key) = &key else { return Err(error.into()) };
        // A reply may have been lost, and the repeated request refused: the bead then has the key. With
        // several beads on the line, nothing was sent.
        let was_sent = !matches!(error, LineError::Several(_));
        let has_it = if was_sent { bead.has_key(key) } else { Ok(false) };
        match (has_it, &error) {
            (Ok(true), _) => {}
            (Ok(false), LineError::Several(_) | LineError::Refused(_)) => {
                if let Some(path) = new {
                    let _ = fs::remove_file(path);
                }
                return Err(error.into());
            }
            _ => bail!(Device, "{error}; {may_have}"),
        }
    }
    match key {
        Some(_) => note!(
            "the bead has the key in {path}; keep it safe, and give --key {path} to commands that change the bead's state"
        ),
        None => note!("the bead has no key any more"),
    }
    Ok(())
}

fn ask(bead: &mut Conversation) -> Result<Block, Failure> {
    let answer = bead.request_done(&Request::ReadSettings)?;
    Ok(answer.last("settings frame", |frame| match &frame.message {
        Message::Settings(settings) => Some(settings.block.clone()),
        _ => None,
    })?)
}

/// Changes some of a bead's settings and says which, before they are sent.
fn set(changes: &[String], dry_run: bool, line: &LineOptions) -> Result<(), Failure> {
    let mut bead = line.open()?;
    let settings = Settings::decode(ask(&mut bead)?.bytes()).map_err(|error| {
        failure!(
            Input,
            "the bead's settings: {error}; write valid ones with `bead settings write`"
        )
    })?;
    let (changes, block) = settings_file::changed(&settings, changes)?;
    for change in &changes {
        output::print_line(&change.to_string())?;
    }
    if changes.is_empty() {
        note!("the bead has these settings already; nothing is sent");
    } else if dry_run {
        note!("nothing is sent: --dry-run");
    } else {
        store(&mut bead, &block)?;
        note!("stored and in force");
    }
    Ok(())
}

/// Gives a bead a block. A bead makes room in a full store when it starts.
fn store(bead: &mut Conversation, block: &[u8]) -> Result<(), Failure> {
    let request = Request::WriteSettings {
        block: Block::try_from(block).context("this is not a settings block")?,
    };
    let mut answer = bead.request(&request)?;
    if answer.reply.outcome == Outcome::StoreFull {
        note!(
            "the bead's flash has no room for another block; resetting it, which makes room and takes a few seconds"
        );
        bead.reboot()?;
        answer = bead.request(&request)?;
    }
    match answer.reply.outcome {
        Outcome::Done => Ok(()),
        _ => Err(answer.refusal().into()),
    }
}

/// Settings as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct SettingsReport {
    version: u16,
    bytes: usize,
    /// In SI units, as a file for `bead settings make` has them.
    settings: Description,
    /// The bits of the coefficients that follow.
    settings_raw: serde_json::Value,
}

/// Prints the settings in a block. `whose` begins the message if they cannot be decoded.
fn print(block: &[u8], format: Format, whose: &str) -> Result<(), Failure> {
    let settings = Settings::decode(block).map_err(|error| match error {
        SettingsError::Version(_) => {
            failure!(
                Input,
                "{whose}{error}; use the tools that were built with the image"
            )
        }
        _ => failure!(Input, "{whose}{error}"),
    })?;
    note_calibration(settings.description());
    let report = SettingsReport {
        version: VERSION,
        bytes: block.len(),
        settings: *settings.description(),
        settings_raw: serde_json::to_value(settings).context("cannot write the settings as JSON")?,
    };
    output::print(format, &report, || table(&settings))
}

/// Says that a calibration is expired today, of a day to come, or not stated.
fn note_calibration(description: &Description) {
    if let Some(doubt) = today().and_then(|today| calibration_doubt(description, today)) {
        note!("{doubt}");
    }
}

/// Every setting by the key that `bead settings set` takes, and the coefficients that follow, as the numbers
/// that they stand for.
fn table(settings: &Settings) -> String {
    let stated = KEYS.iter().map(|row| {
        let letter = Some(row.letter).filter(|letter| !letter.is_empty());
        let letter = letter.map_or(String::new(), |letter| format!(", {letter}"));
        let value = match value(settings.description(), row.key) {
            Value::Null if row.key == SettingKey::SupplyVoltage => SUPPLY_UNKNOWN.to_owned(),
            value => format!("{} {}", shown(&value), row.unit),
        };
        [row.path().to_owned() + &letter, value]
    });
    let derived = derived(settings)
        .into_iter()
        .map(|(name, value)| [name.to_owned(), value]);
    let derived = output::table("derived |", derived);
    format!("{}\n\n{derived}", output::table("setting |", stated))
}

/// The coefficients that follow from the settings.
fn derived(settings: &Settings) -> Vec<(&'static str, String)> {
    let (window, rate) = (&settings.window, f64::from(settings.sample_rate_hz));
    let (a, b, scale) = (&settings.observer, &settings.chain, &settings.scale);
    let samples = |count: u16| format!("{count} samples ({:.2} ms)", f64::from(count) / rate * 1e3);
    let rise = f64::from(window.threshold) * settings.force.sensitive.per_code.to_num::<f64>() * 1e3;
    let number = |value: f64| format!("{value:.6e}");
    let scaled = |value: f64, powers: i32| number(value * 2f64.powi(powers));
    let end = scaled(a.end.to_num(), scale.observer.into());
    let measured = scaled(a.energy.to_num(), scale.measured.into());
    let relaxation = b.relaxation.to_num::<f64>() * 2.0 / 3.0 / rate * 1e6;
    let incoming = scaled(b.incoming.to_num(), scale.incoming.into());
    let intruder = scaled(b.intruder.to_num(), scale.masses.into());
    let predicted = scaled(b.energy.to_num(), scale.predicted.into());
    let gate = b.gate.to_num::<f64>() * 1e3;
    let incident = settings.incident.to_num::<f64>();
    let [frequency, decay]: [f64; 2] = [settings.ringing.frequency, settings.ringing.decay].map(f64::from);
    vec![
        ("low gain sampled later by", format!("{:.3} µs", CONVERSION * 1e6)),
        ("window", samples(window.length)),
        ("before and with the trigger", samples(window.history)),
        (
            "trigger, rise",
            format!("{} codes ({rise:.1} mN)", window.threshold),
        ),
        ("trigger, within", samples(window.lookback)),
        ("A, weight at the start", number(a.start.to_num())),
        ("A, weight at the end", end),
        ("A, energy", measured + " nJ/(m/s²)²"),
        ("B, relaxation of the contacts", format!("{relaxation:.3} µs")),
        ("B, contact", scaled(b.contact.to_num(), scale.contact.into())),
        ("B, incoming force", incoming),
        ("B, stiffness", number(b.stiffness.to_num())),
        ("B, damping", number(b.damping.to_num())),
        ("B, intruder", intruder),
        ("B, gate", format!("{gate:.3} mN")),
        ("B, energy", predicted + " nJ"),
        ("incident wave of 1 N", format!("{incident:.4} nJ")),
        ("the intruder rings at", format!("{frequency:.1} Hz")),
        ("its ringing decays at", format!("{decay:.1} /s")),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use bead_model::design::{Bead, Capture, FrontEnd, derive};

    #[test]
    fn settings_are_shown_by_their_keys_and_what_follows_in_units() {
        let front_end = FrontEnd::reference();
        let settings = derive(&Bead::paper(), &front_end, &Capture::default()).unwrap();
        let text = table(&settings);
        for (name, expected) in [
            ("intruder.stiffness, k", "395000.0 N/m"),
            ("capture.sample_rate", "100000 Hz"),
            ("force.pole", "40000.0 Hz"),
            ("window", "672 samples (6.72 ms)"),
            ("supply.voltage", SUPPLY_UNKNOWN),
            // The paper's beads relax in 4.2 µs.
            ("B, relaxation of the contacts", "4.200 µs"),
        ] {
            let line = text.lines().find(|line| line.starts_with(name));
            let line = line.unwrap_or_else(|| panic!("{name}: {text}"));
            assert_eq!(line[name.len()..].trim(), expected, "{line}");
        }
    }
}
