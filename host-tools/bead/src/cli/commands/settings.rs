//! `bead settings`: a bead's settings, read, written and shown.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Context;
use bead_model::converter::CONVERSION;
use bead_model::design::{Description, Neighbours};
use bead_model::reduced_chain::FOLLOWERS;
use bead_model::settings::{Settings, SettingsError, VERSION};
use bead_wire::{Block, KEY, Message, Outcome, Request};
use clap::{ArgGroup, Args, Subcommand};
use schemars::JsonSchema;
use serde::Serialize;

use crate::cli::commands::settings_file;
use crate::cli::failure::Failure;
use crate::cli::interrupt;
use crate::cli::line_options::LineOptions;
use crate::cli::output::{self, Format};
use crate::cli::place::{Kind, Overwrite};
use bead_line::conversation::{Answer, Conversation, LineError};
use bead_line::key;
use bead_tables::whole::Target;

const AFTER_HELP: &str = "\
Settings are a file of some 100 bytes: calibration, window and the coefficients of both estimates, with a \
checksum. `make` makes one of a TOML file of physical quantities; `bead emulate … --out DIR` derives one \
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

const KEY_HELP: &str = "\
The key is 16 random bytes. The first key travels to the bead as it is: give it where nobody else listens. A \
key that takes another one's place is masked by the old one. docs/security.md says what a key keeps out and \
what it does not.

Examples:
  bead settings key --new bead-8.key --port /dev/ttyUSB0
  bead settings write bead-8.settings --key bead-8.key --port /dev/ttyUSB0
  bead settings key --new newer.key --key bead-8.key --port /dev/ttyUSB0
  bead settings key --remove --key newer.key --port /dev/ttyUSB0";

/// Arguments of `bead settings`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Make settings of a file of physical quantities, or such a file to start from.
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
        /// How to print them.
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
        /// How to print them.
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
        /// Only say what would change.
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
        /// Give the key in this file: beads may share one.
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
        Action::Read {
            line,
            out,
            overwrite,
            format,
        } => {
            let out = overwrite.optional(out.as_deref(), Kind::Settings, &[])?;
            read(line, out.as_ref(), *format)
        }
        Action::Make(arguments) => settings_file::make(arguments),
        Action::Write {
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
        Action::Show { file, format } => {
            let block = settings_file::load(file, None)?;
            print(&block, *format, || format!("{}: ", file.display()))
        }
        Action::Set {
            changes,
            dry_run,
            line,
        } => set(changes, *dry_run, line),
        Action::Reset { line } => {
            let answer = line.open()?.request_done(&Request::EraseSettings)?;
            note!("settings {}", answer.reply.detail);
            Ok(())
        }
        Action::Key { new, give, line, .. } => set_key(new.as_deref(), give.as_deref(), line),
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
    let shown = new.or(give).map(|path| path.display().to_string());
    let may_have = |path: &str| {
        format!(
            "the bead may have taken the key in {path}: keep it, and try `bead command reset-counters --key {path}`"
        )
    };
    if let Some(path) = &shown {
        interrupt::resumable(may_have(path));
    }
    // Kept before the bead is asked: a key that the bead took must not be lost.
    let key = match new {
        Some(path) => Some(key::create(path)?),
        None => given,
    };
    let bytes = key.as_ref().map_or([0; KEY], |key| *key.bytes());
    if let Err(error) = bead.request_done(&Request::SetKey { key: bytes }) {
        let has_it = match (&error, &key) {
            // Nothing was sent.
            (LineError::Several(_), _) | (_, None) => Ok(false),
            // A reply may have been lost, and the request that was sent again refused: the bead has the key
            // then.
            (_, Some(key)) => bead.has_key(key),
        };
        let refused = matches!(error, LineError::Several(_) | LineError::Refused(_));
        match (has_it, &shown) {
            (Ok(true), _) => {}
            (Ok(false), _) if refused => {
                if let Some(path) = new {
                    let _ = fs::remove_file(path);
                }
                return Err(error.into());
            }
            (_, Some(path)) => bail!(Device, "{error}; {}", may_have(path)),
            (_, None) => return Err(error.into()),
        }
    }
    match shown {
        Some(path) => note!(
            "the bead has the key in {path}; keep it safe, and give --key {path} to what changes the bead's state"
        ),
        None => note!("the bead has no key any more"),
    }
    Ok(())
}

fn read(line: &LineOptions, out: Option<&Target>, format: Format) -> Result<(), Failure> {
    let block = ask(&mut line.open()?)?;
    if let Some(out) = out {
        out.write_bytes(block.bytes())?;
    }
    print(block.bytes(), format, || "the bead has a ".to_owned())
}

/// The block that a bead measures with.
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
    let block = ask(&mut bead)?;
    let settings = Settings::decode(block.bytes()).map_err(|error| {
        failure!(
            Input,
            "the bead has a {error}; give it one by `bead settings write`"
        )
    })?;
    let changed = settings_file::changed(&settings, changes)?;
    for change in &changed.changes {
        output::print_line(&change.to_string())?;
    }
    match (changed.changes.is_empty(), dry_run) {
        (true, _) => note!("the bead has these settings already; nothing is sent"),
        (_, true) => note!("nothing is sent: --dry-run"),
        _ => {
            store(&mut bead, &changed.block)?;
            note!("stored and in force");
        }
    }
    Ok(())
}

/// Gives a bead a block.
fn store(bead: &mut Conversation, block: &[u8]) -> Result<(), Failure> {
    let request = Request::WriteSettings {
        block: Block::try_from(block).context("this is not a settings block")?,
    };
    let mut answer = bead.request(&request)?;
    if answer.reply.outcome == Outcome::StoreFull {
        answer = after_reboot(bead, &request)?;
    }
    match answer.reply.outcome {
        Outcome::Done => Ok(()),
        _ => Err(answer.refusal().into()),
    }
}

/// A bead makes room in a full store when it starts.
fn after_reboot(bead: &mut Conversation, request: &Request) -> Result<Answer, Failure> {
    note!("its flash has no room for another block; resetting it, which makes some and takes a few seconds");
    bead.reboot()?;
    Ok(bead.request(request)?)
}

/// Settings as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct Report {
    version: u16,
    bytes: usize,
    /// In SI units, as a file for `bead settings make` has them.
    settings: Description,
    /// The bits of the coefficients that follow.
    settings_raw: serde_json::Value,
}

fn print(block: &[u8], format: Format, whose: impl FnOnce() -> String) -> Result<(), Failure> {
    let settings = Settings::decode(block).map_err(|error| {
        let advice = match error {
            SettingsError::Version(_) => "; take the tools that were built with the image",
            _ => "",
        };
        failure!(Input, "{}{error}{advice}", whose())
    })?;
    let report = Report {
        version: VERSION,
        bytes: block.len(),
        settings: *settings.description(),
        settings_raw: serde_json::to_value(settings).expect("settings are numbers and texts"),
    };
    output::print(format, &report, || table(&settings))
}

/// Every setting with its unit, and the coefficients that follow, as the numbers that they stand for.
fn table(settings: &Settings) -> String {
    let mut rows = of_bead(settings.description());
    rows.extend(of_sensors(settings.description()));
    rows.extend(of_window(settings));
    rows.extend(of_estimators(settings));
    rows.extend(of_tolerances(settings));
    let rows = rows.into_iter().map(|(name, value)| [name.to_owned(), value]);
    output::table("setting |", rows)
}

type Row = (&'static str, String);

fn of_bead(description: &Description) -> Vec<Row> {
    let bead = description.physics();
    let gram = |kilogram: f64| format!("{:.4} g", kilogram * 1e3);
    let name = description.name.as_str();
    vec![
        ("name", output::either(name.is_empty(), "-", name)),
        ("address", description.address.to_string()),
        (
            "sample rate",
            format!("{} Hz", description.capture.sample_rate_hz),
        ),
        ("bead with its intruder, M", gram(bead.mass)),
        ("intruder, m", gram(bead.intruder_mass)),
        ("in front of the force sensor", gram(bead.front_mass)),
        ("its springs, k", format!("{:.4e} N/m", bead.stiffness)),
        ("its damping, c", format!("{:.4} N·s/m", bead.damping)),
        ("contacts, κ", format!("{:.5e} N/m^1.5", bead.contact_stiffness)),
        ("contacts, τ", format!("{:.3} µs", bead.relaxation * 1e6)),
    ]
}

fn of_sensors(description: &Description) -> Vec<Row> {
    let code = |per_code: f64, scale: f64, unit: &str| format!("{:.6} {unit}", per_code * scale);
    let pole = |hz: f64| {
        if hz > 0.0 {
            format!("{:.1} kHz", 1e-3 * hz)
        } else {
            "none".to_owned()
        }
    };
    let later = || format!("{:.3} µs", CONVERSION * 1e6);
    let (force, acceleration) = (&description.force, &description.acceleration);
    vec![
        ("force, a code", code(force.per_code, 1e3, "mN")),
        ("force, pole", pole(force.pole)),
        (
            "force, a code at the low gain",
            code(force.wide_per_code, 1e3, "mN"),
        ),
        ("force, low gain sampled later by", later()),
        ("acceleration, a code", code(acceleration.per_code, 1.0, "m/s²")),
        ("acceleration, pole", pole(acceleration.pole)),
        (
            "acceleration, a code at the low gain",
            code(acceleration.wide_per_code, 1.0, "m/s²"),
        ),
        ("acceleration, low gain sampled later by", later()),
    ]
}

fn of_window(settings: &Settings) -> Vec<Row> {
    let (window, rate) = (&settings.window, f64::from(settings.sample_rate_hz));
    let samples = |count: u16| format!("{count} samples ({:.2} ms)", f64::from(count) / rate * 1e3);
    let threshold = f64::from(window.threshold) * settings.force.sensitive.per_code.to_num::<f64>();
    vec![
        ("window", samples(window.length)),
        ("before and with the trigger", samples(window.history)),
        (
            "trigger, rise",
            format!("{} codes ({:.1} mN)", window.threshold, threshold * 1e3),
        ),
        ("trigger, within", samples(window.lookback)),
    ]
}

fn of_estimators(settings: &Settings) -> Vec<Row> {
    let Settings {
        observer,
        chain,
        scale,
        incident,
        ..
    } = settings;
    let number = |value: f64| format!("{value:.6e}");
    let scaled = |value: f64, powers: i32| number(value * 2f64.powi(powers));
    let relaxation = chain.relaxation.to_num::<f64>() * 2.0 / 3.0 / f64::from(settings.sample_rate_hz);
    vec![
        ("A, weight at the start", number(observer.start.to_num())),
        (
            "A, weight at the end",
            scaled(observer.end.to_num(), scale.observer.into()),
        ),
        (
            "A, energy",
            scaled(observer.energy.to_num(), scale.measured.into()) + " nJ/(m/s²)²",
        ),
        (
            "B, relaxation of the contacts",
            format!("{:.3} µs", relaxation * 1e6),
        ),
        ("B, contact", scaled(chain.contact.to_num(), scale.contact.into())),
        (
            "B, incoming force",
            scaled(chain.incoming.to_num(), scale.incoming.into()),
        ),
        ("B, stiffness", number(chain.stiffness.to_num())),
        ("B, damping", number(chain.damping.to_num())),
        (
            "B, intruder",
            scaled(chain.intruder.to_num(), scale.masses.into()),
        ),
        ("B, intruders behind", behind(&settings.description().company)),
        ("B, gate", format!("{:.3} mN", chain.gate.to_num::<f64>() * 1e3)),
        (
            "B, energy",
            scaled(chain.energy.to_num(), scale.predicted.into()) + " nJ",
        ),
        (
            "incident wave of 1 N",
            format!("{:.4} nJ", incident.to_num::<f64>()),
        ),
    ]
}

fn of_tolerances(settings: &Settings) -> Vec<Row> {
    let (ringing, capture) = (&settings.ringing, &settings.description().capture);
    let part = |part: f64| format!("{:.1} %", part * 100.0);
    let [frequency, decay]: [f64; 2] = [ringing.frequency.to_num(), ringing.decay.to_num()];
    vec![
        ("A and B are told to differ from", part(capture.disagreement)),
        ("the intruder rings at", format!("{frequency:.1} Hz")),
        (
            "and is told to have drifted from",
            part(capture.ring_frequency_tolerance),
        ),
        ("its ringing dies away with", format!("{decay:.1} /s")),
        ("and so from", part(capture.ring_decay_tolerance)),
    ]
}

/// The intruders of the beads behind.
fn behind(company: &Neighbours) -> String {
    let places: Vec<_> = (0..FOLLOWERS)
        .filter(|follower| company.holds(*follower))
        .map(|follower| (follower + 1).to_string())
        .collect();
    let elsewhere = if company.elsewhere == 1 {
        "; others near by"
    } else {
        ""
    };
    if places.is_empty() {
        return format!("none{elsewhere}");
    }
    format!(
        "in bead {} behind: {} g, {} N/m, {} N·s/m{elsewhere}",
        places.join(", "),
        company.mass * 1e3,
        company.stiffness,
        company.damping
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use bead_model::design::{Bead, Capture, FrontEnd, derive};

    #[test]
    fn settings_are_shown_in_the_units_of_the_front_end_that_they_were_derived_from() {
        let front_end = FrontEnd::reference();
        let settings = derive(&Bead::paper(), &front_end, &Capture::default()).unwrap();
        let text = table(&settings);
        let row = |name: &str| {
            let line = text.lines().find(|line| line.starts_with(name)).unwrap();
            line[name.len()..].trim().to_owned()
        };
        assert_eq!(row("sample rate"), "100000 Hz");
        assert_eq!(row("window"), "672 samples (6.72 ms)");
        // The paper's beads relax in 4.2 µs.
        assert_eq!(row("B, relaxation of the contacts"), "4.200 µs");
        let value = |text: String| text.split(' ').next().unwrap().parse::<f64>().unwrap();
        let near = |value: f64, expected: f64| (value / expected - 1.0).abs() < 1e-3;
        assert!(near(value(row("force, a code")), 1e3 * front_end.force.per_code));
        assert!(near(
            value(row("acceleration, a code")),
            front_end.acceleration.per_code
        ));
        for pole in ["force, pole", "acceleration, pole"] {
            assert!(near(value(row(pole)), 40.0), "{}", row(pole));
        }
    }
}
