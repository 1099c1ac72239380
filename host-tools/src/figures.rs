//! The paper's figures, each a thing that runs: simulation, picture, data and checks.
//!
//! # Design
//! A [`Plan`] names a figure and says how to draw it; drawing gives a [`Figure`], which is a chart and a list of
//! [`Check`]s. Files are made from the chart alone, so what is written is what is drawn. Figures of one plate share runs
//! through the [`Lab`], which also keeps account of how well energy and momentum held in every run that a figure used.

mod beyond;
pub mod chapter;
mod check;
mod collision;
mod curve;
mod fig2;
mod fig3;
mod fig4;
mod fig5;
mod fig6;
mod fig7;
mod fig_a2_a3;
mod fig_a4;
mod fig_a5_a6;
mod files;
mod lab;
mod observe;
mod setting;
mod shaken;

use serde::Serialize;

pub use check::{Check, Relation};
pub use files::write;
pub use lab::Lab;

use crate::failure::Failure;
use crate::figure::Chart;

/// A figure that can be drawn.
#[derive(Debug, Clone, Copy)]
pub struct Plan {
    /// As the paper numbers it: `5b`, `A4`, `eq9`.
    pub name: &'static str,
    /// What it shows, one line.
    pub title: &'static str,
    /// What is simulated for it, one line.
    pub setting: &'static str,
    draw: fn(&Lab) -> Result<Figure, Failure>,
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

/// Every figure, in the paper's order.
pub fn catalogue() -> Vec<Plan> {
    [
        fig2::PLANS,
        fig3::PLANS,
        fig4::PLANS,
        fig5::PLANS,
        fig6::PLANS,
        fig7::PLANS,
        shaken::PLANS,
        fig_a2_a3::PLANS,
        fig_a4::PLANS,
        fig_a5_a6::PLANS,
        collision::PLANS,
        beyond::PLANS,
    ]
    .concat()
}

/// The figures of these names, in the paper's order; all of them for no name. `6` is all of Fig. 6.
///
/// # Errors
/// A name that is no figure's.
pub fn chosen(names: &[String]) -> Result<Vec<Plan>, Failure> {
    let all = catalogue();
    for name in names {
        if !all.iter().any(|plan| plan.goes_by(name)) {
            let known: Vec<&str> = all.iter().map(|plan| plan.name).collect();
            return Err(Failure::input(format!(
                "{name}: no such figure; there are {}",
                known.join(", ")
            )));
        }
    }
    let wanted = |plan: &Plan| names.is_empty() || names.iter().any(|name| plan.goes_by(name));
    Ok(all.into_iter().filter(wanted).collect())
}

impl Plan {
    /// Whether this is the name of the figure or of its plate.
    fn goes_by(&self, name: &str) -> bool {
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
    pub fn draw(&self, lab: &Lab) -> Result<Figure, Failure> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_check_of_every_figure_passes() {
        let lab = Lab::default();
        let mut failed = Vec::new();
        for plan in catalogue() {
            let figure = match plan.draw(&lab) {
                Ok(figure) => figure,
                Err(error) => {
                    failed.push(format!(
                        "{}: cannot be drawn: {error}, expected a figure",
                        plan.name
                    ));
                    continue;
                }
            };
            assert!(!figure.checks.is_empty(), "figure {} checks nothing", plan.name);
            for check in figure.checks.iter().filter(|check| !check.pass) {
                failed.push(format!(
                    "{}: {} is {}, expected {}",
                    plan.name,
                    check.what,
                    chapter::number(check.value),
                    chapter::expectation(check)
                ));
            }
        }
        assert!(
            failed.is_empty(),
            "{} checks fail:\n{}",
            failed.len(),
            failed.join("\n")
        );
    }

    #[test]
    fn a_figure_goes_by_its_name_and_by_that_of_its_plate() {
        let names = |asked: &str| -> Vec<&str> {
            let plans = chosen(&[asked.to_owned()]).unwrap();
            plans.iter().map(|plan| plan.name).collect()
        };
        assert_eq!(names("5B"), ["5b"]);
        assert_eq!(names("2"), ["2a", "2b", "2c", "2d"]);
        assert_eq!(names("A1"), ["A1"]);
        assert_eq!(names("solitary"), ["solitary"]);
        let message = chosen(&["9z".to_owned()]).unwrap_err().to_string();
        assert!(
            message.starts_with("9z: no such figure; there are 2a, 2b"),
            "{message}"
        );
    }
}
