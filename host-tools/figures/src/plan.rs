//! A figure: how it is drawn, what was drawn, and how that came out.

use serde::Serialize;

use crate::chart::Chart;
use crate::check::Check;
use crate::error::Error;
use crate::lab::Lab;

/// A figure that can be drawn.
#[derive(Debug, Clone, Copy)]
pub struct Plan {
    /// As the paper numbers it: `5b`, `A4`, `eq9`.
    pub name: &'static str,
    /// What it shows, one line.
    pub title: &'static str,
    /// What is simulated for it, one line.
    pub setting: &'static str,
    pub(crate) draw: fn(&Lab) -> Result<Figure, Error>,
}

/// A figure that was drawn.
#[derive(Debug, Clone)]
pub struct Figure {
    /// The picture, which holds the data too.
    pub chart: Chart,
    /// What must be true of it.
    pub checks: Vec<Check>,
    /// Pictures that follow one another; none but in an animation.
    pub frames: Vec<Chart>,
}

/// How one figure came out, as in the JSON of `bead figures`.
#[derive(Debug, Clone, Serialize)]
pub struct Outcome {
    /// The figure.
    pub name: &'static str,
    /// What it shows.
    pub title: &'static str,
    /// What was simulated.
    pub setting: &'static str,
    /// Whether every check passed.
    pub pass: bool,
    /// The checks.
    pub checks: Vec<Check>,
    /// The files written.
    pub files: Vec<String>,
    /// Whether it moves.
    #[serde(skip)]
    pub animated: bool,
}

/// Parts of the striker's energy that the balance of a run may be off by.
const BALANCE: f64 = 1e-10;
/// Parts of the striker's momentum that the momentum of a run may be off by.
const MOMENTUM: f64 = 1e-12;

impl Plan {
    /// Whether this is the name of the figure or of its plate.
    pub(crate) fn goes_by(&self, name: &str) -> bool {
        [self.name, self.plate()]
            .iter()
            .any(|own| own.eq_ignore_ascii_case(name))
    }

    /// The figures that share runs: those of one number.
    pub fn plate(&self) -> &'static str {
        let number = self
            .name
            .trim_end_matches(|character: char| character.is_ascii_lowercase());
        if number.is_empty() { self.name } else { number }
    }

    /// Runs what the figure needs, and draws it. The checks end with the conservation laws over the runs used.
    ///
    /// # Errors
    /// A simulation that does not get on.
    pub fn draw(&self, lab: &Lab) -> Result<Figure, Error> {
        lab.begin();
        let mut figure = (self.draw)(lab)?;
        figure.chart.description = format!("Figure {}: {}", self.name, self.title);
        if let Some(worst) = lab.worst() {
            for (law, off, bound) in [
                (
                    "energy balance as a part of the striker's energy",
                    worst.balance,
                    BALANCE,
                ),
                ("momentum as a part of the striker's", worst.momentum, MOMENTUM),
            ] {
                let runs = if worst.runs == 1 { "run" } else { "runs" };
                let what = format!("{law}, worst of {} {runs}", worst.runs);
                figure
                    .checks
                    .push(Check::at_most(what, "", off, bound).of_law(law));
            }
        }
        Ok(figure)
    }

    /// The outcome of a figure that was drawn and written.
    pub fn outcome(&self, figure: &Figure, files: Vec<String>) -> Outcome {
        Outcome {
            name: self.name,
            title: self.title,
            setting: self.setting,
            pass: figure.checks.iter().all(|check| check.pass),
            checks: figure.checks.clone(),
            files,
            animated: !figure.frames.is_empty(),
        }
    }
}
