//! The scenario and the striker's velocity, which all comparisons with a simulation begin with.

use std::path::Path;
use std::str::FromStr;

use hertz_chain::Scenario;

use crate::cli::failure::Failure;
use crate::cli::output;
use bead_compare::report::count;
use bead_compare::sensed::load_scenario;
use bead_compare::velocity::FittedVelocity;
use bead_recording::file::Part;
use bead_recording::received::Received;

/// The striker's velocity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Velocity {
    /// The one that gives the recorded forces.
    Fit,
    /// In m/s.
    Given(f64),
}

impl FromStr for Velocity {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let given = || {
            text.parse()
                .ok()
                .filter(|velocity: &f64| *velocity > 0.0 && velocity.is_finite())
        };
        match text {
            "fit" => Ok(Self::Fit),
            _ => given()
                .map(Self::Given)
                .ok_or_else(|| "give m/s, above 0, or fit".to_owned()),
        }
    }
}

/// A fitted velocity in one line.
pub(super) fn shown(fitted: &FittedVelocity) -> String {
    let FittedVelocity {
        velocity,
        uncertainty,
        scatter,
        strikes,
        scenario,
    } = fitted;
    let digits = (1.0 - uncertainty.max(1e-9).log10()).ceil().clamp(0.0, 9.0) as usize;
    let from = count(*strikes as u64, "strike");
    let scatter = scatter.map(|scatter| format!(", which scatter by {scatter:.digits$} m/s"));
    format!(
        "{velocity:.digits$} ± {uncertainty:.digits$} m/s, fitted to the force of {from}{}; the scenario says {scenario} m/s",
        scatter.unwrap_or_default()
    )
}

/// A note about echoes: their number, and their beads.
pub(super) fn echoes_left_out(which: &str) -> String {
    format!("echoes that are replayed, but not held against the chain, as a wave came again: {which}")
}

/// A scenario that strikes are held against.
pub(super) struct Given {
    pub(super) scenario: Scenario,
    /// The scenario, as its author wrote it.
    pub(super) text: String,
    /// A note if it is not the scenario of the recording.
    other: Option<String>,
}

impl Given {
    /// Ends a comparison: with its failure, or with a note where the scenario is not the recording's.
    pub(super) fn end(&self, failure: Option<String>) -> Result<(), Failure> {
        match (failure, &self.other) {
            (None, None) => Ok(()),
            (None, Some(note)) => {
                output::note(format_args!("{note}"));
                Ok(())
            }
            (Some(what), None) => Err(Failure::Verdict(what)),
            (Some(what), Some(note)) => Err(Failure::Verdict(format!("{what}; {note}"))),
        }
    }
}

/// The scenario that is given, or the one in the recording.
pub(super) fn scenario(given: Option<&Path>, received: &Received) -> Result<Given, Failure> {
    let shown = received.path.display();
    let carried = received.recording.parts.get(&Part::Scenario).map(|text| {
        let text = String::from_utf8_lossy(text).into_owned();
        let scenario = Scenario::from_toml(&text, &format!("{shown}: {}", Part::Scenario.name()));
        scenario.map(|scenario| (scenario, text))
    });
    let Some(path) = given else {
        let missing = format!("{shown} carries no scenario; say what was struck with --scenario S.toml");
        let (scenario, text) = carried.ok_or_else(|| Failure::input(missing))??;
        return Ok(Given {
            scenario,
            text,
            other: None,
        });
    };
    let (scenario, text) = load_scenario(path)?;
    let is_other = carried.is_some_and(|carried| {
        carried.is_ok_and(|(mut carried, _)| {
            carried.title.clone_from(&scenario.title);
            carried != scenario
        })
    });
    let other = is_other.then(|| {
        format!(
            "{} is not the scenario that {shown} was recorded with; leave --scenario out to compare with that one",
            path.display()
        )
    });
    Ok(Given {
        scenario,
        text,
        other,
    })
}
