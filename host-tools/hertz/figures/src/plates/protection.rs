//! Two designs of the same weight in the same beads: one leaves the least energy, the other the least force.

use hertz_chain::{Objective, Scenario, Search, optimise};
use hertz_charts::Panel;

use crate::check::checks;
use crate::curve::{force_over_time, line, time_axis, told_apart};
use crate::error::Error;
use crate::lab::{FigureRun, Lab};
use crate::observe::peak;
use crate::plan::{Figure, plans};
use crate::setting::{VISCOUS, strike};

plans! {
    "protection": "force at contact 13 behind intruders chosen for the least energy and for the least force";
        "16 viscous beads, 0.45 m/s; hosts 5, 7 and 8 with 30 g in all, found by `bead optimise`" => protection,
}

const CONTACT: usize = 13;
const HOSTS: [usize; 3] = [5, 7, 8];
const TOTAL_MASS: f64 = 0.03;
const SPAN: std::ops::Range<f64> = 2.5e-3..6e-3;

/// The chain with the intruders that a search finds.
fn designed(objective: Objective) -> Result<Scenario, Error> {
    let scenario = strike(16, VISCOUS, 0.006);
    let mut search = Search::new(&scenario, HOSTS.to_vec(), TOTAL_MASS)?;
    search.objective = objective;
    Ok(optimise(&scenario, &search, None)?.scenario(&scenario))
}

fn protection(lab: &Lab) -> Result<Figure, Error> {
    let bare = lab.run(&strike(16, VISCOUS, 0.006))?;
    let energy = lab.run(&designed(Objective::Remaining)?)?;
    let force = lab.run(&designed(Objective::Force(CONTACT))?)?;
    let peak = |run: &FigureRun| peak(run, CONTACT);
    let share = |run: &FigureRun| {
        let energy = &run.summary.energy;
        100.0 * energy.dissipated_intruders / (energy.striker_initial - energy.striker_final)
    };
    let checks = checks![
        "greatest force at contact 13, intruders for the least energy", "N": peak(&energy) => near(4.574, 0.005);
        "greatest force at contact 13, intruders for the least force", "N": peak(&force) => at_most(4.22);
        "their share of the injected energy, for the least energy", "%": share(&energy) => near(9.54, 0.01);
        "their share of the injected energy, for the least force", "%": share(&force) => near(0.557, 0.001);
    ];
    let over_time = |run: &FigureRun| force_over_time(&run.solution, &SPAN, CONTACT);
    let curves = vec![
        line("no intruder", 0, over_time(&bare)),
        told_apart("least energy", 1, over_time(&energy)),
        told_apart("least force", 2, over_time(&force)),
    ];
    let panels = vec![Panel::new("force at 13 (N)", curves).height(220)];
    Ok(Figure::over(time_axis(SPAN), panels, checks))
}
