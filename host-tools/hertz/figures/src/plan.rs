//! A figure: its plan, the drawing, and the results of its checks.

use serde::Serialize;

use crate::check::FigureCheck;
use crate::error::Error;
use crate::lab::Lab;
use hertz_charts::{Axis, Chart, Panel};

/// A figure that can be drawn.
#[derive(Debug, Clone, Copy)]
pub struct FigurePlan {
    /// As the paper numbers it: `5b`, `A4`, `eq9`.
    pub name: &'static str,
    /// Its title, one line.
    pub title: &'static str,
    /// Its simulated setting, one line.
    pub setting: &'static str,
    pub(crate) draw: fn(&Lab) -> Result<Figure, Error>,
}

/// A figure that was drawn.
#[derive(Debug, Clone)]
pub struct Figure {
    /// The picture, which also holds the data.
    pub chart: Chart,
    /// Conditions on it.
    pub checks: Vec<FigureCheck>,
    /// The pictures of an animation; empty for other figures.
    pub frames: Vec<Chart>,
}

impl Figure {
    /// A figure without animation.
    pub fn new(chart: Chart, checks: Vec<FigureCheck>) -> Self {
        let frames = Vec::new();
        Self {
            chart,
            checks,
            frames,
        }
    }

    /// A figure of panels over one axis.
    pub(crate) fn over(axis: Axis, panels: Vec<Panel>, checks: Vec<FigureCheck>) -> Self {
        Self::new(Chart::new(axis, panels), checks)
    }
}

/// The plans of a plate, one in each row: name, title, what is simulated, and the function that draws the
/// figure.
macro_rules! plans {
    ($($name:literal: $title:literal; $setting:expr => $draw:expr,)*) => {
        pub(crate) const PLANS: &[$crate::plan::FigurePlan] = &[$($crate::plan::FigurePlan {
            name: $name,
            title: $title,
            setting: $setting,
            draw: $draw,
        }),*];
    };
}
pub(crate) use plans;

/// The result of one figure, as in the JSON of `bead figures`.
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
pub struct FigureOutcome {
    /// The figure.
    pub name: &'static str,
    /// Its title.
    pub title: &'static str,
    /// Its simulated setting.
    pub setting: &'static str,
    /// True if every check passed.
    pub pass: bool,
    /// The checks.
    pub checks: Vec<FigureCheck>,
    /// The files written.
    pub files: Vec<String>,
    /// The files of its plate, which shows all figures of its number; empty if not all of them were drawn.
    pub plate_files: Vec<String>,
    /// True if it is an animation.
    #[serde(skip)]
    pub animated: bool,
}

/// Greatest error of the energy balance of a run, as a part of the striker's energy.
const BALANCE: f64 = 1e-10;
/// Greatest error of the momentum of a run, as a part of the striker's momentum.
const MOMENTUM: f64 = 1e-12;

impl FigurePlan {
    /// Returns `true` if `name` is the name of the figure or of its plate.
    pub(crate) fn goes_by(&self, name: &str) -> bool {
        self.name.eq_ignore_ascii_case(name) || self.plate().eq_ignore_ascii_case(name)
    }

    /// The plate of the figure: its number without the letter. Figures of one plate share their runs.
    pub fn plate(&self) -> &'static str {
        let number = self
            .name
            .trim_end_matches(|character: char| character.is_ascii_lowercase());
        if number.is_empty() { self.name } else { number }
    }

    /// Its letter on the plate; empty for a figure without one.
    pub(crate) fn letter(&self) -> &'static str {
        &self.name[self.plate().len()..]
    }

    /// Runs what the figure needs, and draws it. The last checks are the conservation laws over the runs that
    /// it used.
    ///
    /// # Errors
    /// A simulation fails, or its result lacks what the figure shows.
    pub fn draw(&self, lab: &Lab) -> Result<Figure, Error> {
        lab.begin();
        let mut figure = (self.draw)(lab)?;
        figure.chart.description = format!("Figure {}: {}", self.name, self.title);
        if let Some((count, worst)) = lab.worst() {
            let runs = if count == 1 { "run" } else { "runs" };
            let law = |law: &'static str, off: f64, bound: f64| {
                let what = format!("{law}, worst of {count} {runs}");
                FigureCheck::at_most(what, "", off, bound).of_law(law)
            };
            let energy = "energy balance as a part of the striker's energy";
            let momentum = "momentum as a part of the striker's";
            figure.checks.push(law(energy, worst.balance, BALANCE));
            figure.checks.push(law(momentum, worst.momentum, MOMENTUM));
        }
        Ok(figure)
    }

    /// The outcome of a figure that was drawn and written.
    pub fn outcome(&self, figure: &Figure, files: Vec<String>) -> FigureOutcome {
        FigureOutcome {
            name: self.name,
            title: self.title,
            setting: self.setting,
            pass: figure.checks.iter().all(|check| check.pass),
            checks: figure.checks.clone(),
            files,
            plate_files: Vec::new(),
            animated: !figure.frames.is_empty(),
        }
    }
}
