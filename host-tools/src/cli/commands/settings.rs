//! `bead settings`: a bead's settings, read, written and shown.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use bead_model::settings::{Settings, VERSION};
use bead_wire::{Block, MAX_BLOCK, Message, Outcome, Reply, Request};
use clap::{Args, Subcommand};
use serde_json::json;

use crate::cli::failure::{Blame, Failure};
use crate::cli::line_options::LineOptions;
use crate::cli::output::{self, Format};
use crate::line::conversation::{Conversation, refused};

const AFTER_HELP: &str = "\
Settings are a file of some 100 bytes: calibration, window and the coefficients of both estimates, with a checksum.
`bead emulate … --out DIR` derives one from a scenario and a front end.

Exit status 1 if the bead refuses, with its reason; 3 if it does not answer.

Examples:
  bead settings read --port /dev/ttyUSB0 --out bead.settings
  bead settings show bead.settings
  bead settings write --port /dev/ttyUSB0 run/bead-8.settings
  bead settings reset --port tcp:192.168.1.7:4000";

/// Arguments of `bead settings`.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Show the settings that a bead measures with, and keep them in a file.
    Read {
        #[command(flatten)]
        line: LineOptions,
        /// Keep the block in this file.
        #[arg(long, value_name = "F.settings")]
        out: Option<PathBuf>,
        /// How to print them.
        #[arg(long, value_enum, default_value_t)]
        format: Format,
    },
    /// Write settings to a bead: they are in force from the next strike on, and kept in its flash.
    Write {
        /// The settings.
        #[arg(value_name = "F.settings")]
        file: PathBuf,
        #[command(flatten)]
        line: LineOptions,
    },
    /// Show the settings in a file.
    Show {
        /// The settings.
        #[arg(value_name = "F.settings")]
        file: PathBuf,
        /// How to print them.
        #[arg(long, value_enum, default_value_t)]
        format: Format,
    },
    /// Erase the settings that a bead was given over the link. It goes back to the settings of the debug
    /// probe, or to the built-in ones.
    Reset {
        #[command(flatten)]
        line: LineOptions,
    },
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    match &arguments.action {
        Action::Read { line, out, format } => read(line, out.as_deref(), *format),
        Action::Write { file, line } => write(file, line),
        Action::Show { file, format } => {
            let block = load(file)?;
            print(&block, *format, || format!("{}: ", file.display()))
        }
        Action::Reset { line } => {
            let answer = line.open()?.request_done(&Request::EraseSettings)?;
            eprintln!("bead: settings {}", answer.reply.detail);
            Ok(())
        }
    }
}

fn read(line: &LineOptions, out: Option<&Path>, format: Format) -> Result<(), Failure> {
    let answer = line.open()?.request_done(&Request::ReadSettings)?;
    let block = answer.last("settings frame", |frame| match &frame.message {
        Message::Settings(settings) => Some(settings.block.clone()),
        _ => None,
    })?;
    if let Some(out) = out {
        output::write_whole(out, |file| Ok(file.write_all(block.bytes())?))?;
    }
    print(block.bytes(), format, || "the bead has a ".to_owned())
}

fn write(file: &Path, line: &LineOptions) -> Result<(), Failure> {
    let block = load(file)?;
    let mut bead = line.open()?;
    let request = Request::WriteSettings {
        block: Block::try_from(&block[..]).or_input(|| "this is not a settings block")?,
    };
    let mut reply = bead.request(&request)?.reply;
    if reply.outcome == Outcome::StoreFull {
        reply = after_reboot(&mut bead, &request)?;
    }
    match reply.outcome {
        Outcome::Done => {
            eprintln!(
                "bead: the {} bytes of {} are stored and in force",
                block.len(),
                file.display()
            );
            Ok(())
        }
        _ => Err(refused(&reply).into()),
    }
}

/// A bead makes room in a full store when it starts.
fn after_reboot(bead: &mut Conversation, request: &Request) -> Result<Reply, Failure> {
    eprintln!(
        "bead: its flash has no room for another block; resetting it, which makes some and takes a few seconds"
    );
    bead.reboot()?;
    Ok(bead.request(request)?.reply)
}

fn load(file: &Path) -> Result<Vec<u8>, Failure> {
    let block = fs::read(file).or_input(|| format!("cannot read {}", file.display()))?;
    match block.len() {
        0..=MAX_BLOCK => Ok(block),
        length => Err(Failure::input(format!(
            "{}: {length} bytes are no settings, which have at most {MAX_BLOCK}; give a file that `bead settings read` \
             or `bead emulate` wrote",
            file.display()
        ))),
    }
}

fn print(block: &[u8], format: Format, whose: impl FnOnce() -> String) -> Result<(), Failure> {
    let settings = Settings::decode(block).map_err(|error| {
        Failure::input(format!(
            "{}{error}; take the tools that were built with the image",
            whose()
        ))
    })?;
    let json = json!({ "version": VERSION, "bytes": block.len(), "settings": settings });
    output::print(format, &json, || table(&settings))
}

/// Every setting with its unit. Coefficients are shown as the numbers that they stand for.
fn table(settings: &Settings) -> String {
    let Settings {
        name,
        sample_rate_hz,
        bead,
        force,
        acceleration,
        window,
        observer,
        chain,
        incident,
        disagreement,
        ringing,
        address,
    } = settings;
    let rate = f64::from(*sample_rate_hz);
    let samples = |count: u16| format!("{count} samples ({:.2} ms)", f64::from(count) / rate * 1e3);
    // The slope is g f_s (1/ω_p - δ) / 2; the sensitive channel has no delay δ.
    let lead = |per_code: f64, slope: f64| 2.0 * slope / per_code / rate;
    let pole = |lead: f64| match lead > 0.0 {
        true => format!("{:.1} kHz", 1e-3 / (std::f64::consts::TAU * lead)),
        false => "none".to_owned(),
    };
    let newton: f64 = force.sensitive.per_code.to_num();
    let newton_wide: f64 = force.wide.per_code.to_num();
    let mps2: f64 = acceleration.sensitive.per_code.to_num();
    let mps2_wide: f64 = acceleration.wide.per_code.to_num();
    let force_lead = lead(newton, force.sensitive.slope.to_num());
    let force_wide_lead = lead(newton_wide, force.wide.slope.to_num());
    let acceleration_lead = lead(mps2, acceleration.sensitive.slope.to_num());
    let acceleration_wide_lead = lead(mps2_wide, acceleration.wide.slope.to_num());
    let later = |sensitive: f64, wide: f64| format!("{:.3} µs", (sensitive - wide) * 1e6);
    let part = |part: f64| format!("{:.1} %", part * 100.0);
    let number = |value: f64| format!("{value:.6e}");
    let rows = [
        (
            "name",
            match name.as_str() {
                "" => "-".to_owned(),
                name => name.to_owned(),
            },
        ),
        ("address", address.to_string()),
        ("sample rate", format!("{rate} Hz")),
        ("bead with its intruder, M", format!("{:.4} g", bead.mass * 1e3)),
        ("intruder, m", format!("{:.4} g", bead.intruder_mass * 1e3)),
        (
            "in front of the force sensor",
            format!("{:.4} g", bead.front_mass * 1e3),
        ),
        ("its springs, k", format!("{:.4e} N/m", bead.stiffness)),
        ("its damping, c", format!("{:.4} N·s/m", bead.damping)),
        ("contacts, κ", format!("{:.5e} N/m^1.5", bead.contact_stiffness)),
        ("contacts, τ", format!("{:.3} µs", bead.relaxation * 1e6)),
        ("force, a code", format!("{:.6} mN", newton * 1e3)),
        ("force, pole", pole(force_lead)),
        (
            "force, a code at the low gain",
            format!("{:.6} mN", newton_wide * 1e3),
        ),
        (
            "force, low gain sampled later by",
            later(force_lead, force_wide_lead),
        ),
        ("acceleration, a code", format!("{mps2:.6} m/s²")),
        ("acceleration, pole", pole(acceleration_lead)),
        (
            "acceleration, a code at the low gain",
            format!("{mps2_wide:.6} m/s²"),
        ),
        (
            "acceleration, low gain sampled later by",
            later(acceleration_lead, acceleration_wide_lead),
        ),
        ("window", samples(window.length)),
        ("before and with the trigger", samples(window.history)),
        (
            "trigger, rise",
            format!(
                "{} codes ({:.1} mN)",
                window.threshold,
                f64::from(window.threshold) * newton * 1e3
            ),
        ),
        ("trigger, within", samples(window.lookback)),
        ("A, weight at the start", number(observer.start.to_num())),
        ("A, weight at the end", number(observer.end.to_num())),
        (
            "A, energy",
            format!("{} nJ/(m/s²)²", number(observer.energy.to_num())),
        ),
        (
            "B, relaxation of the contacts",
            format!(
                "{:.3} µs",
                chain.relaxation.to_num::<f64>() * 2.0 / 3.0 / rate * 1e6
            ),
        ),
        ("B, contact", number(chain.contact.to_num())),
        ("B, incoming force", number(chain.incoming.to_num())),
        ("B, stiffness", number(chain.stiffness.to_num())),
        ("B, damping", number(chain.damping.to_num())),
        ("B, intruder", number(chain.intruder.to_num())),
        ("B, gate", format!("{:.3} mN", chain.gate.to_num::<f64>() * 1e3)),
        ("B, energy", format!("{} nJ", number(chain.energy.to_num()))),
        (
            "incident wave of 1 N",
            format!("{:.4} nJ", incident.to_num::<f64>()),
        ),
        ("A and B are told to differ from", part(disagreement.to_num())),
        (
            "the intruder rings at",
            format!("{:.1} Hz", ringing.frequency.to_num::<f64>()),
        ),
        (
            "and is told to have drifted from",
            part(ringing.frequency_tolerance.to_num()),
        ),
        (
            "its ringing dies away with",
            format!("{:.1} /s", ringing.decay.to_num::<f64>()),
        ),
        ("and so from", part(ringing.decay_tolerance.to_num())),
    ];
    output::table("setting |", rows.map(|(name, value)| [name.to_owned(), value]))
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
        assert!(near(
            value(row("force, a code")),
            1e3 * front_end.force.sensitive.per_code
        ));
        assert!(near(
            value(row("acceleration, a code")),
            front_end.acceleration.sensitive.per_code
        ));
        for pole in ["force, pole", "acceleration, pole"] {
            assert!(near(value(row(pole)), 40.0), "{}", row(pole));
        }
    }
}
