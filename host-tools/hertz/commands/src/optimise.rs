//! `bead optimise`: the intruders that leave least energy in the chain, or least force at a contact.

use hertz_chain::{
    Accuracy, Aim, Intruder, Objective, Optimum, Oscillator, Remaining, Robustness, Search, SimulateError,
    remaining,
};

use crate::optimise_front;
use crate::optimise_search::{Arguments, Limits, find, name, percent, search, total_mass};
use bead_console::prelude::*;

/// Intruders of the paper, for comparison: as measured, and with the stiffness that the paper finds best (its
/// Fig. 5).
const PAPER: [(&str, f64); 2] = [
    ("paper, as measured: 3.7 g, 395 kN/m, 12 N·s/m", 3.95e5),
    ("paper, its best k: 3.7 g, 100 kN/m, 12 N·s/m", 1e5),
];

/// The result as JSON.
#[derive(Serialize, JsonSchema)]
pub struct SearchReport {
    beads: Vec<usize>,
    total_mass_kg: f64,
    mass_kg: Limits,
    stiffness_n_per_m: Limits,
    damping_n_s_per_m: Limits,
    /// Of all intruders, where it ties the damping to mass and stiffness.
    loss_factor: Option<f64>,
    /// Greatest displacement of an intruder in its bead that is allowed, m.
    stroke_m: Option<f64>,
    /// Most of the beads that hold an intruder, if not all do.
    hosts_at_most: Option<usize>,
    /// Least and greatest radius of the beads whose size the search varies.
    radius_m: Option<Limits>,
    aim: Aim,
    optimum: Optimum,
    compared: Vec<OtherIntruders>,
}

/// Other intruders under the same strikes.
#[derive(Serialize, JsonSchema)]
struct OtherIntruders {
    name: &'static str,
    /// Together.
    mass_kg: f64,
    share: f64,
    /// Of the objective at each strike, in its own unit.
    values: Vec<f64>,
    strikes: Vec<Remaining>,
}

/// Runs `bead optimise`.
///
/// # Errors
/// [`Failure`], which carries the exit status.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let scenario = Scenario::load(&arguments.scenario)?;
    let &[mass] = &arguments.total_mass[..] else {
        return optimise_front::run(arguments, &scenario);
    };
    if arguments.picture.is_some() {
        bail!(
            Input,
            "--picture: a front needs several masses; give them, such as --total-mass 0.01,0.02,0.04"
        );
    }
    let (out, inputs) = (arguments.out.as_deref(), [arguments.scenario.as_path()]);
    let out = arguments.overwrite.optional(out, FileKind::Scenario, &inputs)?;
    let search = search(arguments, &scenario, mass)?;
    // Before the search, so that a strike that cannot be run is refused at once.
    let compared = compare(&scenario, &search)?;
    let optimum = find(&scenario, &search, "")?;
    if let Some(out) = &out {
        let text = optimum.scenario(&scenario).to_toml();
        out.write_bytes(format!(
            "# Found by bead optimise: {}.\n{text}",
            found(search.aim, &optimum)
        ))?;
    }
    let report = SearchReport {
        beads: search.hosts,
        total_mass_kg: search.total_mass,
        mass_kg: search.mass,
        stiffness_n_per_m: search.stiffness,
        damping_n_s_per_m: search.damping,
        loss_factor: search.loss_factor,
        stroke_m: search.stroke,
        hosts_at_most: search.hosts_at_most,
        radius_m: search.sizes.map(|sizes| sizes.radius),
        aim: search.aim,
        optimum,
        compared,
    };
    output::print(arguments.format, &report, || report.table(&scenario.title))
}

/// The result in words, for the comment in its scenario file.
fn found(aim: Aim, optimum: &Optimum) -> String {
    let speeds = optimum.strikes.iter().map(|strike| strike.speed.to_string());
    let speeds: Vec<_> = speeds.collect();
    let of = match (&speeds[..], aim) {
        ([_], _) => "",
        (_, Aim::Worst) => "at most ",
        (_, Aim::Mean) => "on average ",
    };
    let (share, speeds) = (percent(optimum.share), speeds.join(", "));
    let left = match optimum.objective {
        Objective::Remaining => "the injected energy remains".to_owned(),
        objective => format!("the {} without intruders is left", name(objective)),
    };
    format!("{of}{share} % of {left} at {speeds} m/s")
}

/// The unit in which values of an objective are shown, and its size.
fn unit(objective: Objective) -> (&'static str, f64) {
    match objective {
        Objective::EnergyBehind(_) => ("µJ", 1e-6),
        Objective::Impulse(_) => ("mN·s", 1e-3),
        _ => (objective.unit(), 1.0),
    }
}

fn compare(scenario: &Scenario, search: &Search) -> Result<Vec<OtherIntruders>, Failure> {
    let speeds = search.strikes(scenario);
    let compared = |name, other: &Scenario| -> Result<_, SimulateError> {
        let strikes = speeds
            .iter()
            .map(|&speed| remaining(other, speed, Accuracy::REFERENCE));
        let strikes = strikes.collect::<Result<Vec<_>, _>>()?;
        let mut bare = other.clone();
        bare.intruders.clear();
        let (mut values, mut shares) = (Vec::new(), Vec::new());
        for (&speed, strike) in speeds.iter().zip(&strikes) {
            let of = |scenario| search.objective.at(scenario, speed, Accuracy::REFERENCE);
            let (value, without) = match search.objective {
                Objective::Remaining => (strike.share, 1.0),
                _ => (of(other)?, of(&bare)?),
            };
            values.push(value);
            shares.push(value / without);
        }
        Ok(OtherIntruders {
            name,
            mass_kg: total_mass(&other.intruders),
            share: search.aim.of(&shares),
            values,
            strikes,
        })
    };
    let mut others = Vec::new();
    if !scenario.intruders.is_empty() {
        others.push(compared("the scenario's own", scenario)?);
    }
    let mut other = scenario.clone();
    for (name, stiffness) in PAPER {
        let paper = Oscillator {
            stiffness,
            ..Oscillator::PAPER
        };
        other.intruders = vec![Intruder::new(search.hosts.iter().copied(), paper)];
        // The paper's intruder may be too heavy for these beads, or too fast.
        others.extend(compared(name, &other).ok());
    }
    Ok(others)
}

impl SearchReport {
    fn table(&self, title: &str) -> String {
        let range = |[low, high]: Limits, unit: f64| format!("{:.3} to {:.3}", low / unit, high / unit);
        let damping = match self.loss_factor {
            Some(factor) => format!("c/√(k m) {factor}"),
            None => format!("c {} N·s/m", range(self.damping_n_s_per_m, 1.0)),
        };
        let stroke = self.stroke_m.map_or(String::new(), |stroke| {
            format!("; stroke up to {:.3} µm", stroke * 1e6)
        });
        let mut parts = Vec::from_iter(Some(title.to_owned()).filter(|title| !title.is_empty()));
        parts.push(format!(
            "Searched: m {} g, {} g together; k {} kN/m; {damping}{stroke}. * marks a value at its bound.",
            range(self.mass_kg, 1e-3),
            self.total_mass_kg * 1e3,
            range(self.stiffness_n_per_m, 1e3),
        ));
        parts.push(self.intruders());
        parts.extend(self.radius_m.map(|limits| self.radii(limits)));
        let optimum = &self.optimum;
        let strikes = optimum.strikes.iter().map(|strike| {
            let mut row = vec![strike.speed.to_string(), format!("{:.4}", strike.injected * 1e6)];
            let shares = [
                strike.share,
                strike.before,
                strike.within,
                strike.after,
                strike.contacts,
            ];
            row.extend(shares.into_iter().chain(strike.ground).map(percent));
            row
        });
        let drags = optimum.strikes.iter().any(|strike| strike.ground.is_some());
        let header = format!(
            "strike (m/s) | injected (µJ) | remains (%) | before hosts | within | after | lost in contacts{}",
            if drags { " | on the ground" } else { "" },
        );
        parts.push(output::table(&header, strikes));

        let objective = optimum.objective;
        if objective != Objective::Remaining {
            parts.push(self.objective());
        }
        let of = match (self.aim, optimum.strikes.len()) {
            (_, 1) => "",
            (Aim::Worst, _) => ", worst",
            _ => ", mean",
        };
        let remains = match objective {
            Objective::Remaining => format!("remains{of} (%)"),
            _ => format!("{}{of} (% of that without intruders)", name(objective)),
        };
        let grams = |mass: f64| format!("{:.3}", mass * 1e3);
        let row = |name: &str, together: String, share: f64| [name.to_owned(), together, percent(share)];
        let others = self.compared.iter();
        let others = others.map(|other| row(other.name, grams(other.mass_kg), other.share));
        let best = [
            row("best if all are alike", String::new(), optimum.share_alike),
            row("best", grams(total_mass(&optimum.intruders)), optimum.share),
        ];
        parts.push(output::table(
            &format!("intruders | together (g) | {remains}"),
            others.chain(best),
        ));
        if let Some(springs) = &optimum.springs {
            parts.push(format!(
                "Springs that can have any stiffness leave {:.3} %, those of the catalogue {:.3} points more ({} choices tried).",
                100.0 * springs.free_share,
                100.0 * (optimum.share_searched - springs.free_share),
                springs.tried,
            ));
        }
        if let Some(robustness) = &optimum.robustness {
            parts.push(of_spread(robustness, optimum.share, &optimum.strokes));
        }
        parts.push(remarks(optimum).join("\n"));
        parts.join("\n\n")
    }

    /// The objective at each strike.
    fn objective(&self) -> String {
        let optimum = &self.optimum;
        let (unit, size) = unit(optimum.objective);
        let values = optimum.values.iter().zip(&optimum.without);
        let strikes = optimum.strikes.iter().zip(values);
        let rows = strikes.map(|(strike, (value, without))| {
            [
                strike.speed.to_string(),
                format!("{:.4}", value / size),
                format!("{:.4}", without / size),
                percent(value / without),
            ]
        });
        let name = name(optimum.objective);
        let header = format!("strike (m/s) | {name} ({unit}) | without intruders ({unit}) | part (%)");
        output::table(&header, rows)
    }

    fn radii(&self, [low, high]: Limits) -> String {
        let rows = self.optimum.radii.iter().map(|one| {
            let bound = one.radius < low * 1.0001 || one.radius > high * 0.9999;
            let radius = format!("{:.3}{}", one.radius * 1e3, if bound { "*" } else { "" });
            [one.bead.to_string(), radius]
        });
        output::table("bead | radius (mm)", rows)
    }

    fn intruders(&self) -> String {
        let figure = |value: f64, unit: f64, [low, high]: Limits| {
            let bound = value < low * 1.001 || value > high * 0.999;
            format!("{:.3}{}", value / unit, if bound { "*" } else { "" })
        };
        let dampings = match self.loss_factor {
            Some(_) => [0.0, f64::INFINITY],
            None => self.damping_n_s_per_m,
        };
        let Optimum { strikes, strokes, .. } = &self.optimum;
        let room = [0.0, self.stroke_m.unwrap_or(f64::INFINITY)];
        let intruders = self.optimum.intruders.iter().enumerate();
        let rows = intruders.map(|(index, intruder)| {
            let (mass, stiffness, damping) = (intruder.mass, intruder.stiffness, intruder.damping);
            let of_injected = strikes.iter().map(|strike| strike.intruders[index].of_injected);
            [
                intruder.beads.iter().map(usize::to_string).collect(),
                figure(mass, 1e-3, self.mass_kg),
                figure(stiffness, 1e3, self.stiffness_n_per_m),
                figure(damping, 1.0, dampings),
                format!("{:.0}", (stiffness / mass).sqrt() / std::f64::consts::TAU),
                format!("{:.3}", damping / (2.0 * (stiffness * mass).sqrt())),
                figure(strokes[index], 1e-6, room),
                percent(of_injected.sum::<f64>() / strikes.len() as f64),
            ]
        });
        let columns = "m (g) | k (kN/m) | c (N·s/m) | f0 (Hz) | ζ | stroke (µm) | absorbed (%)";
        let Some(choice) = &self.optimum.springs else {
            return output::table(&format!("bead | {columns}"), rows);
        };
        let named = rows.zip(&choice.springs).map(|(row, spring)| {
            let [bead, properties @ ..] = row;
            [bead, spring.name.clone()].into_iter().chain(properties)
        });
        output::table(&format!("bead | spring | {columns}"), named)
    }
}

/// The robust design beside the optimum for exact springs and dampers.
fn of_spread(robustness: &Robustness, share: f64, strokes: &[f64]) -> String {
    let row = |name: &str, share: f64, worst: f64, [stiffness, damping]: [f64; 2]| {
        let place = format!("{stiffness:.2} k, {damping:.2} c");
        [name.to_owned(), percent(share), percent(worst), place]
    };
    let rows = [
        row("best", share, robustness.worst, robustness.worst_at),
        row(
            "best if nothing deviates",
            robustness.plain_share,
            robustness.plain_worst,
            robustness.plain_worst_at,
        ),
    ];
    let table = output::table("intruders | nominal (%) | worst (%) | at", rows);
    let points = |one: f64, other: f64| 100.0 * (one - other);
    let longest = |strokes: &[f64]| 1e6 * strokes.iter().copied().fold(0.0, f64::max);
    let (cost, gain) = (
        points(share, robustness.plain_share),
        points(robustness.plain_worst, robustness.worst),
    );
    let balance = if cost < 0.0 {
        format!(
            "The search without deviations did not get as far: this design is {:.3} points better even at the nominal values, and {gain:.3} at the worst. Allow more --evaluations.",
            -cost
        )
    } else {
        format!("Robustness costs {cost:.3} points at the nominal values and gains {gain:.3} at the worst.")
    };
    format!(
        "Under {}, the same for all intruders:\n\n{table}\n\n{balance} The longest stroke is {:.3} µm, and {:.3} µm in the design that is best if nothing deviates.",
        robustness.spread,
        longest(strokes),
        longest(&robustness.plain_strokes),
    )
}

fn remarks(optimum: &Optimum) -> Vec<String> {
    let robust = optimum.robustness.as_ref();
    let mut remarks = vec![format!(
        "{} runs: {} designs, and {} gradients that count as {} runs each. The result is {:.5} % at the accuracy of the search, {:.5} % at the reference accuracy. A chain twice as long changes that by {:.5} %.",
        optimum.evaluations,
        optimum.evaluations - Search::GRADIENT_RUNS * optimum.gradients,
        optimum.gradients,
        Search::GRADIENT_RUNS,
        100.0 * optimum.share_searched,
        100.0 * robust.map_or(optimum.share, |found| found.worst),
        100.0 * optimum.far_end,
    )];
    remarks.push(match (optimum.settled, optimum.stopped) {
        (true, _) => format!(
            "Settled after {} descents: nothing better is near, and the last {}, from fresh starts around the best, found nothing better.",
            optimum.descents, optimum.in_vain,
        ),
        (false, true) => format!(
            "Stopped in descent {}: this is the best so far, and more time may find a better design.",
            optimum.descents
        ),
        (false, false) => format!(
            "The --evaluations ran out in descent {}, before the search had settled: more of them may find a better design.",
            optimum.descents
        ),
    });
    if optimum.far_end > 1e-3 {
        remarks.push(
            "The far end of the chain affects this result. If it should not, give the chain more beads, or the run less time.".to_owned(),
        );
    }
    let energy = optimum.objective == Objective::Remaining;
    let lost = |strike: &Remaining| strike.contacts + strike.ground.unwrap_or(0.0);
    if energy && optimum.strikes.iter().any(|strike| lost(strike) > 0.01) {
        remarks.push(
            "Losses in contacts and on the ground count as remaining, though they reach no bead behind the hosts."
                .to_owned(),
        );
    }
    if energy && optimum.strikes.iter().any(|strike| strike.within > 0.01) {
        remarks.push("Energy is still between the hosts: in a longer run more of it is absorbed.".to_owned());
    }
    remarks
}
