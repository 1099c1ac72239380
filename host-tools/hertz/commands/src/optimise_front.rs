//! `bead optimise` with several total masses: the best design for each.

use hertz_chain::{Aim, Objective, Optimum, Search};
use hertz_charts::{Axis, Chart, Ink, Mark, Panel, Series};

use crate::optimise_search::{Arguments, find, name, percent, search, total_mass};
use bead_console::prelude::*;

/// The result as JSON.
#[derive(Serialize, JsonSchema)]
pub struct FrontReport {
    beads: Vec<usize>,
    aim: Aim,
    objective: Objective,
    /// Of all intruders, where it ties the damping to mass and stiffness.
    loss_factor: Option<f64>,
    /// Greatest displacement of an intruder in its bead that is allowed, m.
    stroke_m: Option<f64>,
    /// Most of the beads that hold an intruder, if not all do.
    hosts_at_most: Option<usize>,
    /// Least and greatest radius of the beads whose size the searches vary.
    radius_m: Option<[f64; 2]>,
    /// From the lightest to the heaviest.
    front: Vec<FrontPoint>,
}

/// The best of all designs up to a mass.
#[derive(Serialize, JsonSchema)]
struct FrontPoint {
    /// Greatest mass of all intruders together.
    total_mass_kg: f64,
    /// Of these intruders.
    mass_kg: f64,
    optimum: Optimum,
}

/// Searches at each total mass. A lighter design is taken where it is better than the one found.
pub(crate) fn run(arguments: &Arguments, scenario: &Scenario) -> Result<(), Failure> {
    if arguments.out.is_some() {
        bail!(
            Input,
            "--out: a front has a design for each mass; give one --total-mass with it"
        );
    }
    if arguments.spread.is_some() {
        bail!(
            Input,
            "--spread: a front is searched without deviations; give one --total-mass with it"
        );
    }
    let inputs = [arguments.scenario.as_path()];
    let (picture, overwrite) = (arguments.picture.as_deref(), arguments.overwrite);
    let picture = overwrite.optional(picture, FileKind::Drawing, &inputs)?;
    let mut masses = arguments.total_mass.clone();
    masses.sort_by(f64::total_cmp);
    // Every mass is checked before the first search.
    let searches = masses.iter().map(|&mass| search(arguments, scenario, mass));
    let searches = searches.collect::<Result<Vec<Search>, _>>()?;
    let mut front: Vec<FrontPoint> = Vec::new();
    for search in &searches {
        let grams = search.total_mass * 1e3;
        let mut optimum = find(scenario, search, &format!("{grams} g: "))?;
        let lighter = front.last().map(|lighter| &lighter.optimum);
        if let Some(lighter) = lighter.filter(|lighter| lighter.share < optimum.share) {
            let stopped = optimum.stopped;
            optimum = lighter.clone();
            optimum.stopped = stopped;
        }
        let stopped = optimum.stopped;
        front.push(FrontPoint {
            total_mass_kg: search.total_mass,
            mass_kg: total_mass(&optimum.intruders),
            optimum,
        });
        if stopped {
            note!("stopped at {grams} g; heavier designs were not searched");
            break;
        }
    }
    let Some(first) = searches.first() else {
        bail!(Input, "--total-mass: give one or more masses in kg");
    };
    let report = FrontReport {
        beads: first.hosts.clone(),
        aim: first.aim,
        objective: first.objective,
        loss_factor: first.loss_factor,
        stroke_m: first.stroke,
        hosts_at_most: first.hosts_at_most,
        radius_m: first.sizes.as_ref().map(|sizes| sizes.radius),
        front,
    };
    if let Some(picture) = picture {
        picture.write_bytes(report.chart().standalone_svg()?)?;
    }
    output::print(arguments.format, &report, || report.table(&scenario.title))
}

impl FrontReport {
    fn label(&self) -> String {
        match self.objective {
            Objective::Remaining => "remains (%)".to_owned(),
            objective => format!("{} (% of that without intruders)", name(objective)),
        }
    }

    fn table(&self, title: &str) -> String {
        let rows = self.front.iter().map(|point| {
            let optimum = &point.optimum;
            [
                format!("{:.3}", point.total_mass_kg * 1e3),
                format!("{:.3}", point.mass_kg * 1e3),
                percent(optimum.share),
                percent(optimum.share_alike),
                optimum.evaluations.to_string(),
                if optimum.settled { "yes" } else { "no" }.to_owned(),
            ]
        });
        let header = format!(
            "at most (g) | together (g) | {} | best if all are alike | runs | settled",
            self.label()
        );
        let title = Some(title.to_owned()).filter(|title| !title.is_empty());
        let parts = title.into_iter().chain([output::table(&header, rows)]);
        parts.collect::<Vec<_>>().join("\n\n")
    }

    fn chart(&self) -> Chart {
        let grams = |point: &FrontPoint| point.total_mass_kg * 1e3;
        let series = |name: &str, curve, mark, share: fn(&Optimum) -> f64| {
            let points = self
                .front
                .iter()
                .map(|point| (grams(point), 100.0 * share(&point.optimum)));
            Series::new(name, Ink::Curve(curve), mark, points)
        };
        let curves = vec![
            series("best", 0, Mark::Line, |one| one.share),
            series("", 0, Mark::Discs, |one| one.share),
            series("best if all are alike", 1, Mark::Dashed, |one| one.share_alike),
        ];
        let heaviest = self.front.iter().map(grams).fold(0.0, f64::max);
        let axis = Axis::new("all intruders together, at most (g)", 0.0..heaviest * 1.02);
        Chart::new(axis, vec![Panel::new(self.label(), curves).height(260)])
    }
}
