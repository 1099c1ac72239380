//! Which intruders leave least energy in the chain.
//!
//! # Design
//!
//! What is made small is the share of the injected energy that the intruders have *not* dissipated ([`Remaining::share`]).
//! What an intruder still holds counts as remaining, as do a wave sent back and, on a viscoelastic chain, what the contacts
//! lost: none of it was absorbed. Since the dampers only take, the share can only fall the longer one waits; a wave whose
//! last part has passed the hosts decides it, and the scenario's duration says how long to wait for that. Energy that the
//! striker keeps or gets back is not injected.
//!
//! A design has three numbers a host. Stiffness and damping are searched as logarithms, masses as they are: so the bound on
//! their sum is linear, and no step between two designs that keep it breaks it. First all intruders are alike, on a grid,
//! whose best is improved; from there, and from stiffnesses that rise or fall along the hosts by [`RAMP`], each bead goes its
//! own way. Derivatives are differences of runs: at [`Accuracy::DRAFT`] a share is smooth to some 1e-8, which a step of
//! [`STEP`] makes 1e-5 of a derivative. The descent is Kraft's SLSQP.

use std::cell::RefCell;

use rayon::prelude::*;
use serde::Serialize;
use slsqp::{FailStatus, StopTols, SuccessStatus};

use crate::absorption::Absorption;
use crate::model::Model;
use crate::scenario::{InputError, Intruder, MOST_BEADS, Scenario};
use crate::simulate::{Accuracy, Options, SimulateError, simulate_with};

/// What to look for, and where. [`Search::new`] sets bounds that suit the chain.
#[derive(Debug, Clone, PartialEq)]
pub struct Search {
    /// The beads that may hold an intruder each.
    pub hosts: Vec<usize>,
    /// What the intruders may weigh together, kg.
    pub total_mass: f64,
    /// Least and greatest mass of each, kg.
    pub mass: [f64; 2],
    /// Least and greatest stiffness, N/m.
    pub stiffness: [f64; 2],
    /// Least and greatest damping, N·s/m.
    pub damping: [f64; 2],
    /// Speeds of the striker, m/s; none is the scenario's own.
    pub speeds: Vec<f64>,
    /// What several speeds come to.
    pub aim: Aim,
    /// Whether all intruders are to be alike.
    pub alike: bool,
    /// Designs to try at most, each at every speed.
    pub evaluations: usize,
    /// How closely to integrate while searching; what is found is run again at [`Accuracy::REFERENCE`].
    pub accuracy: Accuracy,
}

/// What the shares that remain of several strikes come to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Aim {
    /// Their mean.
    #[default]
    Mean,
    /// The greatest. The descent follows a power mean, which is smooth; designs are compared by the greatest.
    Worst,
}

impl Aim {
    /// Of these shares. Not a number without any.
    pub fn of(self, shares: &[f64]) -> f64 {
        match self {
            Self::Mean => shares.iter().sum::<f64>() / shares.len() as f64,
            Self::Worst => shares.iter().copied().fold(f64::NAN, f64::max),
        }
    }
}

impl Search {
    /// A search with bounds taken from the chain: masses up to half the lightest host; stiffness and damping from far below to
    /// far above what answers to a strike, which is M ω² and M ω with M of the lightest host and π/ω the time of a contact.
    ///
    /// # Errors
    /// [`OptimiseError`]: the scenario, the hosts or the total mass are not what a search can use.
    pub fn new(scenario: &Scenario, hosts: Vec<usize>, total_mass: f64) -> Result<Self, OptimiseError> {
        scenario.check()?;
        check_hosts(scenario, &hosts)?;
        check_total(scenario, &hosts, total_mass)?;
        let (_, host) = lightest(scenario, &hosts);
        let rate = std::f64::consts::PI / Model::new(scenario).shortest_contact();
        let heaviest = 0.5 * host;
        Ok(Self {
            mass: [0.02 * heaviest.min(total_mass / hosts.len() as f64), heaviest],
            stiffness: [1e-5 * host * rate * rate, host * rate * rate],
            damping: [1e-4 * host * rate, 0.2 * host * rate],
            hosts,
            total_mass,
            speeds: Vec::new(),
            aim: Aim::default(),
            alike: false,
            evaluations: 6000,
            accuracy: Accuracy::DRAFT,
        })
    }
}

/// Why there is no optimum.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OptimiseError {
    /// A scenario could not be run.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    /// A value of the [`Search`] is not what one can use.
    #[error("{key}: {what}; {advice}")]
    Search {
        /// Its field.
        key: &'static str,
        /// What is wrong.
        what: String,
        /// What would do.
        advice: String,
    },
}

impl From<InputError> for OptimiseError {
    fn from(error: InputError) -> Self {
        Self::Simulate(error.into())
    }
}

/// What a strike leaves, at the end of the run. The parts are energies over [`Remaining::injected`]; `before`, `within`,
/// `after` and `contacts` add up to `share`.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Remaining {
    /// Speed of the striker, m/s.
    pub speed: f64,
    /// End of the run, s.
    pub time: f64,
    /// What the striker gave up by then, J.
    pub injected: f64,
    /// What the intruders have not dissipated.
    pub share: f64,
    /// In the beads before the first host: reflected.
    pub before: f64,
    /// In the beads from the first host to the last, and in the intruders.
    pub within: f64,
    /// In the beads after the last host: transmitted. Without an intruder, the whole chain is `after`.
    pub after: f64,
    /// Lost in contacts.
    pub contacts: f64,
    /// Each intruder, in the order of the beads.
    pub intruders: Vec<Absorption>,
}

/// Runs a scenario with its striker at `speed`, m/s, and says what remains.
///
/// The run lasts the scenario's duration times (V/`speed`)^(1/5), V being the scenario's speed: in that time the wave comes as
/// far whatever the speed (exactly so on an elastic chain without intruders).
///
/// # Errors
/// As [`simulate_with`].
pub fn remaining(scenario: &Scenario, speed: f64, accuracy: Accuracy) -> Result<Remaining, SimulateError> {
    let mut struck = scenario.clone();
    struck.striker.velocity = speed;
    struck.duration *= (scenario.striker.velocity / speed).powf(0.2);
    let options = Options {
        accuracy,
        ..Options::default()
    };
    let solution = simulate_with(&struck, &options)?;
    let end = solution.at(solution.end());
    let energies = end.energies();
    let injected = solution.model().striker_energy() - energies.striker;
    let beads = scenario.chain.beads;
    let intruders = solution.model().intruders();
    let first = intruders.first().map_or(1, |intruder| intruder.bead);
    let last = intruders.last().map_or(0, |intruder| intruder.bead);
    // An empty range of beads has no energy.
    let part = |from: usize, to: usize| {
        if from > to {
            0.0
        } else {
            end.region(from..=to).mechanical() / injected
        }
    };
    Ok(Remaining {
        speed,
        time: solution.end(),
        injected,
        share: 1.0 - energies.dissipated_intruders / injected,
        before: part(1, first - 1),
        within: part(first, last),
        after: part(last + 1, beads),
        contacts: energies.dissipated_contacts / injected,
        intruders: solution.absorption(solution.end()),
    })
}

/// The best intruders that were found.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Optimum {
    /// One intruder a host, in the order of the beads.
    pub intruders: Vec<Intruder>,
    /// What remains at each speed, at [`Accuracy::REFERENCE`].
    pub strikes: Vec<Remaining>,
    /// The aim over these strikes.
    pub share: f64,
    /// The same as the search saw it, at its own accuracy.
    pub share_searched: f64,
    /// The best of intruders that are all alike, at the search's accuracy.
    pub share_alike: f64,
    /// How much the share changes if the chain is made twice as long: what the far end has to do with it. Not next to zero, it
    /// says that a wave came back from there and was counted as absorbed the second time.
    pub far_end: f64,
    /// Designs tried.
    pub evaluations: usize,
    /// Whether the descent that led here found no better design near by, rather than its part of the evaluations spent.
    pub settled: bool,
}

impl Optimum {
    /// The scenario with these intruders in place of its own.
    pub fn scenario(&self, scenario: &Scenario) -> Scenario {
        Scenario {
            intruders: self.intruders.clone(),
            ..scenario.clone()
        }
    }
}

/// Finds the intruders that leave least. The scenario's own are left out. `progress` is told the part of the evaluations
/// spent. The same input gives the same result, however many processors there are.
///
/// What is found is a local optimum, the best of four descents (one if [`Search::alike`]); nothing proves that there is none
/// better.
///
/// # Errors
/// [`OptimiseError`]: a value of scenario or search is out of range, or a run does not get on.
pub fn optimise(
    scenario: &Scenario,
    search: &Search,
    progress: Option<&(dyn Fn(f64) + Sync)>,
) -> Result<Optimum, OptimiseError> {
    check(scenario, search)?;
    let mut hosts = search.hosts.clone();
    hosts.sort_unstable();
    let mut bare = scenario.clone();
    bare.intruders.clear();
    let speeds = if search.speeds.is_empty() {
        vec![scenario.striker.velocity]
    } else {
        search.speeds.clone()
    };
    let problem = Problem {
        bare,
        hosts,
        search,
        speeds,
        progress,
    };

    let mut spent = 0;
    let coarse = problem.coarse(&mut spent)?;
    let most = spent + (search.evaluations - spent) / if search.alike { 1 } else { 8 };
    let alike = problem.descend(coarse, 1, most, &mut spent)?;
    let share_alike = alike.value;
    let mut best = alike;
    if !search.alike && problem.hosts.len() > 1 {
        let starts = problem.starts(&best);
        for (index, start) in starts.iter().enumerate() {
            let most = spent + (search.evaluations - spent) / (starts.len() - index);
            let found = problem.descend(start.clone(), problem.hosts.len(), most, &mut spent)?;
            if found.value < best.value {
                best = found;
            }
        }
    }

    let mut intruders = problem.intruders(&best.design);
    // Rounding that breaks the bound on the sum is taken back.
    let total: f64 = intruders.iter().map(|intruder| intruder.mass).sum();
    for intruder in &mut intruders {
        intruder.mass *= (search.total_mass / total).min(1.0);
    }
    let mut scenario = problem.bare.clone();
    scenario.intruders.clone_from(&intruders);
    let strikes = problem.strikes(&scenario, Accuracy::REFERENCE)?;
    let mut longer = scenario;
    longer.chain.beads = (2 * longer.chain.beads).min(MOST_BEADS);
    let longer = problem.strikes(&longer, Accuracy::REFERENCE)?;
    let far_end = strikes
        .iter()
        .zip(&longer)
        .map(|(strike, longer)| (strike.share - longer.share).abs())
        .fold(0.0, f64::max);
    Ok(Optimum {
        intruders,
        share: search
            .aim
            .of(&strikes.iter().map(|strike| strike.share).collect::<Vec<_>>()),
        strikes,
        share_searched: best.value,
        share_alike,
        far_end,
        evaluations: spent,
        settled: best.settled,
    })
}

/// Mass, stiffness, damping.
type Properties = [f64; 3];

/// One design and what it leaves.
#[derive(Debug, Clone)]
struct Tried {
    /// One entry a host, or one for all.
    design: Vec<Properties>,
    value: f64,
    settled: bool,
}

/// What a descent has come to; its objective function cannot return it.
struct Descent<'a> {
    best: Tried,
    spent: &'a mut usize,
    /// The evaluations are spent.
    full: bool,
    failed: Option<SimulateError>,
}

/// Change of a variable that makes a difference quotient.
const STEP: f64 = 1e-3;
/// Relative change of the share below which a descent ends.
const SETTLED: f64 = 1e-5;
/// Stiffnesses of a ramp go from 1/RAMP at one end of the hosts to RAMP at the other.
const RAMP: f64 = 4.0;
/// Exponent of the power mean that stands for the greatest share; of three speeds it is 1.7 % below it at most.
const POWER: f64 = 64.0;
/// Points of the coarse grid in mass, stiffness, damping.
const COARSE: [usize; 3] = [2, 9, 7];

struct Problem<'a> {
    bare: Scenario,
    hosts: Vec<usize>,
    search: &'a Search,
    speeds: Vec<f64>,
    progress: Option<&'a (dyn Fn(f64) + Sync)>,
}

impl Problem<'_> {
    /// All of them are alike if the design has one entry.
    fn intruders(&self, design: &[Properties]) -> Vec<Intruder> {
        self.hosts
            .iter()
            .enumerate()
            .map(|(index, &bead)| {
                let [mass, stiffness, damping] = design[if design.len() == 1 { 0 } else { index }];
                Intruder {
                    beads: vec![bead],
                    mass,
                    stiffness,
                    damping,
                }
            })
            .collect()
    }

    fn strikes(&self, scenario: &Scenario, accuracy: Accuracy) -> Result<Vec<Remaining>, SimulateError> {
        self.speeds
            .par_iter()
            .map(|&speed| remaining(scenario, speed, accuracy))
            .collect()
    }

    /// Shares that remain at each speed, for each of these sets of intruders.
    fn shares(&self, sets: Vec<Vec<Intruder>>, spent: &mut usize) -> Result<Vec<Vec<f64>>, SimulateError> {
        *spent += sets.len();
        let shares = sets
            .into_par_iter()
            .map(|intruders| {
                let mut scenario = self.bare.clone();
                scenario.intruders = intruders;
                let strikes = self.strikes(&scenario, self.search.accuracy)?;
                Ok(strikes.iter().map(|strike| strike.share).collect())
            })
            .collect();
        if let Some(progress) = self.progress {
            progress(*spent as f64 / self.search.evaluations as f64);
        }
        shares
    }

    /// What the descent follows: the aim, made smooth.
    fn follow(&self, shares: &[f64]) -> f64 {
        match self.search.aim {
            Aim::Mean => self.search.aim.of(shares),
            Aim::Worst => {
                let mean = shares.iter().map(|share| share.powf(POWER)).sum::<f64>() / shares.len() as f64;
                mean.powf(1.0 / POWER)
            }
        }
    }

    /// The best of intruders all alike, on a grid.
    fn coarse(&self, spent: &mut usize) -> Result<Tried, SimulateError> {
        let [masses, stiffnesses, dampings] = COARSE;
        let Search {
            mass,
            stiffness,
            damping,
            ..
        } = self.search;
        let heaviest = mass[1].min(self.search.total_mass / self.hosts.len() as f64);
        // Between the bounds, ends left out.
        let inside = |[low, high]: [f64; 2], index: usize, count: usize| {
            low * (high / low).powf((index as f64 + 0.5) / count as f64)
        };
        let mut designs = Vec::new();
        for i in 0..masses {
            for j in 0..stiffnesses {
                for k in 0..dampings {
                    designs.push(vec![[
                        (heaviest * 0.5f64.powi(i as i32)).max(mass[0]),
                        inside(*stiffness, j, stiffnesses),
                        inside(*damping, k, dampings),
                    ]]);
                }
            }
        }
        let sets = designs.iter().map(|design| self.intruders(design)).collect();
        let values: Vec<f64> = self
            .shares(sets, spent)?
            .iter()
            .map(|shares| self.search.aim.of(shares))
            .collect();
        let best = (0..values.len())
            .min_by(|&a, &b| values[a].total_cmp(&values[b]))
            .expect("the grid has points");
        Ok(Tried {
            design: designs[best].clone(),
            value: values[best],
            settled: false,
        })
    }

    /// Where beads set out from to go their own ways.
    fn starts(&self, alike: &Tried) -> Vec<Tried> {
        let middle = (self.hosts.len() - 1) as f64 / 2.0;
        let [low, high] = self.search.stiffness;
        [0.0, 1.0, -1.0]
            .map(|slope| {
                let design = (0..self.hosts.len())
                    .map(|index| {
                        let [mass, stiffness, damping] = alike.design[0];
                        let ramp = RAMP.powf(slope * (index as f64 - middle) / middle);
                        [mass, (stiffness * ramp).clamp(low, high), damping]
                    })
                    .collect();
                Tried {
                    design,
                    value: if slope == 0.0 { alike.value } else { f64::INFINITY },
                    settled: false,
                }
            })
            .into()
    }

    /// Improves a design, until nothing near by is better or `most` evaluations are spent in all. `kinds` is how many
    /// intruders differ: one or all.
    fn descend(
        &self,
        start: Tried,
        kinds: usize,
        most: usize,
        spent: &mut usize,
    ) -> Result<Tried, SimulateError> {
        let Search {
            mass,
            stiffness,
            damping,
            ..
        } = self.search;
        // Masses are counted in the part of the total that falls to one host, so that all variables are of order one.
        let each = self.search.total_mass / self.hosts.len() as f64;
        let to_bounds =
            |[low, high]: [f64; 2], scale: fn(f64, f64) -> f64| (scale(low, each), scale(high, each));
        let straight: fn(f64, f64) -> f64 = |value, each| value / each;
        let logarithm: fn(f64, f64) -> f64 = |value, _| value.ln();
        let bounds: Vec<(f64, f64)> = (0..kinds)
            .flat_map(|_| {
                [
                    to_bounds(*mass, straight),
                    to_bounds(*stiffness, logarithm),
                    to_bounds(*damping, logarithm),
                ]
            })
            .collect();
        let variables: Vec<f64> = start
            .design
            .iter()
            .flat_map(|[mass, stiffness, damping]| [mass / each, stiffness.ln(), damping.ln()])
            .zip(&bounds)
            .map(|(value, (low, high))| value.clamp(*low, *high))
            .collect();
        let design = |x: &[f64]| -> Vec<Properties> {
            x.chunks_exact(3)
                .map(|x| [x[0] * each, x[1].exp(), x[2].exp()])
                .collect()
        };

        let state = RefCell::new(Descent {
            best: start,
            spent,
            full: false,
            failed: None,
        });
        let objective = |x: &[f64], gradient: Option<&mut [f64]>, _: &mut ()| {
            let state = &mut *state.borrow_mut();
            let count = if gradient.is_some() { 1 + x.len() } else { 1 };
            state.full |= *state.spent + count > most;
            let mut sets = vec![self.intruders(&design(x))];
            let mut steps = Vec::new();
            if gradient.is_some() {
                for (index, (low, high)) in bounds.iter().enumerate() {
                    // Away from the nearer bound: a step is never across it.
                    let step = if x[index] > 0.5 * (low + high) {
                        -STEP
                    } else {
                        STEP
                    };
                    let mut beside = x.to_vec();
                    beside[index] += step;
                    steps.push(step);
                    sets.push(self.intruders(&design(&beside)));
                }
            }
            let shares = if state.full || state.failed.is_some() {
                None
            } else {
                match self.shares(sets, state.spent) {
                    Ok(shares) => Some(shares),
                    Err(error) => {
                        state.failed = Some(error);
                        None
                    }
                }
            };
            // There is no other way to end the descent than that nothing gets better.
            let Some(shares) = shares else {
                if let Some(gradient) = gradient {
                    gradient.fill(0.0);
                }
                return state.best.value;
            };
            let value = self.search.aim.of(&shares[0]);
            if value < state.best.value {
                state.best.value = value;
                state.best.design = design(x);
            }
            let here = self.follow(&shares[0]);
            if let Some(gradient) = gradient {
                for (index, step) in steps.iter().enumerate() {
                    gradient[index] = (self.follow(&shares[index + 1]) - here) / step;
                }
            }
            here
        };
        let overweight = |x: &[f64], gradient: Option<&mut [f64]>, _: &mut ()| {
            let part = 1.0 / kinds as f64;
            if let Some(gradient) = gradient {
                gradient.fill(0.0);
                gradient.iter_mut().step_by(3).for_each(|entry| *entry = part);
            }
            let excess = x.iter().step_by(3).sum::<f64>() * part - 1.0;
            // Rounding is no excess: the descent would never think itself at its end.
            if excess.abs() < 1e-12 { 0.0 } else { excess }
        };
        let stop = StopTols {
            ftol_rel: SETTLED,
            ..StopTols::default()
        };
        let constraints: [&dyn slsqp::Func<()>; 1] = [&overweight];
        // Calls, of which none is counted in `spent` once that has come to `most`.
        let calls = most.min(1_000_000);
        let ended = slsqp::minimize(
            objective,
            &variables,
            &bounds,
            &constraints,
            (),
            calls,
            Some(stop),
        );
        let settled = match ended {
            Ok((status, ..)) => !matches!(status, SuccessStatus::MaxEvalReached),
            Err((status, ..)) => matches!(status, FailStatus::RoundoffLimited),
        };
        let mut state = state.into_inner();
        if let Some(error) = state.failed {
            return Err(error);
        }
        state.best.settled = settled && !state.full;
        Ok(state.best)
    }
}

fn complaint(key: &'static str, what: String, advice: impl Into<String>) -> OptimiseError {
    OptimiseError::Search {
        key,
        what,
        advice: advice.into(),
    }
}

fn lightest(scenario: &Scenario, hosts: &[usize]) -> (usize, f64) {
    let beads = scenario.spheres();
    hosts
        .iter()
        .map(|&bead| (bead, beads[bead - 1].mass()))
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .expect("hosts have been checked to be there")
}

fn check_hosts(scenario: &Scenario, hosts: &[usize]) -> Result<(), OptimiseError> {
    let beads = scenario.chain.beads;
    if hosts.is_empty() {
        let advice = format!("name at least one bead from 1 to {beads}, such as 7-16");
        return Err(complaint("hosts", "names no bead".to_owned(), advice));
    }
    for (index, bead) in hosts.iter().enumerate() {
        if !(1..=beads).contains(bead) {
            let advice = format!("beads are counted from 1 to {beads} (chain.beads)");
            return Err(complaint(
                "hosts",
                format!("bead {bead} is not in the chain"),
                advice,
            ));
        }
        if hosts[..index].contains(bead) {
            let what = format!("bead {bead} is named twice");
            return Err(complaint("hosts", what, "name each bead once"));
        }
    }
    Ok(())
}

fn check_total(scenario: &Scenario, hosts: &[usize], total: f64) -> Result<(), OptimiseError> {
    if !(total.is_finite() && total > 0.0) {
        let what = format!("{total} is not a positive number");
        return Err(complaint(
            "total_mass",
            what,
            "give a number above zero in kg, such as 0.037",
        ));
    }
    let (bead, host) = lightest(scenario, hosts);
    let most = host * hosts.len() as f64;
    if total >= most {
        let what = format!(
            "{total} kg in {} hosts leaves bead {bead}, of {host:.3e} kg, nothing but intruder",
            hosts.len()
        );
        return Err(complaint(
            "total_mass",
            what,
            format!("give less than {most:.3} kg"),
        ));
    }
    Ok(())
}

fn check(scenario: &Scenario, search: &Search) -> Result<(), OptimiseError> {
    scenario.check()?;
    check_hosts(scenario, &search.hosts)?;
    check_total(scenario, &search.hosts, search.total_mass)?;
    for (key, [low, high]) in [
        ("mass", search.mass),
        ("stiffness", search.stiffness),
        ("damping", search.damping),
    ] {
        if !(low.is_finite() && high.is_finite() && low > 0.0 && low < high) {
            let what = format!("{low} to {high} is no range to search");
            return Err(complaint(
                key,
                what,
                "give two positive numbers, the lesser first",
            ));
        }
    }
    let (bead, host) = lightest(scenario, &search.hosts);
    if search.mass[1] >= host {
        let what = format!(
            "{} kg is as heavy as bead {bead} of {host:.3e} kg",
            search.mass[1]
        );
        return Err(complaint("mass", what, "let the greatest mass be less"));
    }
    let least = search.mass[0] * search.hosts.len() as f64;
    if least > search.total_mass {
        let what = format!(
            "{} hosts of at least {} kg are more than the total mass of {} kg",
            search.hosts.len(),
            search.mass[0],
            search.total_mass
        );
        return Err(complaint("mass", what, "let the least mass be less"));
    }
    for speed in &search.speeds {
        if !(speed.is_finite() && *speed > 0.0) {
            let what = format!("{speed} is not a positive number");
            return Err(complaint(
                "speeds",
                what,
                "give numbers above zero in m/s, such as 0.45",
            ));
        }
    }
    let fewest = COARSE.iter().product::<usize>();
    if search.evaluations < fewest {
        let what = format!(
            "{} are too few: the first, coarse search takes {fewest}",
            search.evaluations
        );
        return Err(complaint("evaluations", what, "give 1000 or more"));
    }
    Ok(())
}
