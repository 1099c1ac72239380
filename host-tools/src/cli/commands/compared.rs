//! What both kinds of comparison begin with: the scenario, the striker's velocity, and how a page was made.

use std::path::Path;
use std::str::FromStr;

use hertz_chain::Scenario;

use crate::bench::sensed::load_scenario;
use crate::cli::failure::Failure;
use crate::comparison::velocity::FittedVelocity;
use crate::recording::file::Part;
use crate::recording::received::Received;

/// How fast the striker is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Velocity {
    /// As the forces tell.
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
    let from = match strikes {
        1 => "1 strike".to_owned(),
        _ => format!("{strikes} strikes"),
    };
    let scatter = scatter.map(|scatter| format!(", which scatter by {scatter:.digits$} m/s"));
    format!(
        "{velocity:.digits$} ± {uncertainty:.digits$} m/s, fitted to the force of {from}{}; the scenario says {scenario} m/s",
        scatter.unwrap_or_default()
    )
}

/// What is said of echoes: how many, and of which beads.
pub(super) fn echoes_left_out(which: &str) -> String {
    format!("echoes that are replayed, but not held against the chain, as a wave came again: {which}")
}

/// The scenario that is given, or the one in the recording.
pub(super) fn scenario(given: Option<&Path>, received: &Received) -> Result<(Scenario, String), Failure> {
    if let Some(path) = given {
        return Ok(load_scenario(path)?);
    }
    let shown = received.path.display();
    let text = received.recording.parts.get(&Part::Scenario).ok_or_else(|| {
        Failure::input(format!(
            "{shown} carries no scenario; say what was struck with --scenario S.toml"
        ))
    })?;
    let text = String::from_utf8_lossy(text).into_owned();
    let scenario = Scenario::from_toml(&text, &format!("{shown}: {}", Part::Scenario.name()))?;
    Ok((scenario, text))
}
