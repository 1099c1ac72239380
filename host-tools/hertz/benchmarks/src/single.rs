//! One chain: the time that each solver takes for a given error.

use hertz_chain::{Accuracy, Model};

use crate::cases::Case;
use crate::ours::{self, SAMPLES};
use crate::peers::{Peer, PeerChain};
use crate::report::{Comparison, SolverRow, front};

/// Returns velocities of all bodies at the end, or at each sample.
type Runner<'a> = Box<dyn Fn() -> Option<Vec<f64>> + 'a>;

/// The simulator's name.
const OURS: &str = "hertz-chain";

/// Greatest error of a velocity, as a part of the greatest.
const ALLOWED: f64 = 1e-9;
/// Settings of a solver that go into the last rounds.
const FINALISTS: usize = 4;

/// Times all solvers on a case, each with its best setting.
pub(crate) fn compare(case: &Case, sampled: bool, rounds: usize) -> Comparison {
    match case.scenario.chain.beads {
        16 => compare_sized::<36>(case, sampled, rounds),
        _ => compare_sized::<96>(case, sampled, rounds),
    }
}

/// A setting that was tried: its name, the error, the run, and its least time.
struct TimedSetting<'a> {
    settings: String,
    accuracy: Option<Accuracy>,
    error: f64,
    run: Runner<'a>,
    seconds: f64,
}

/// All settings of a solver that give a result.
struct TriedSettings<'a> {
    solver: &'static str,
    fits: Vec<TimedSetting<'a>>,
}

impl<'a> TriedSettings<'a> {
    fn new(solver: &'static str) -> Self {
        let fits = Vec::new();
        Self { solver, fits }
    }

    fn add(
        &mut self,
        settings: String,
        accuracy: Option<Accuracy>,
        run: Runner<'a>,
        error_of: &impl Fn(&[f64]) -> f64,
    ) {
        let Some(error) = run().map(|found| error_of(&found)) else {
            return;
        };
        if error < LARGEST {
            let seconds = ours::least_seconds(3, &run);
            self.fits.push(TimedSetting {
                settings,
                accuracy,
                error,
                run,
                seconds,
            });
        }
    }

    /// Keeps the fastest of the settings that keep the error.
    fn finalists(&mut self) {
        self.fits.retain(|fit| fit.error <= ALLOWED);
        self.fits.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
        self.fits.truncate(FINALISTS);
    }
}

/// Errors from this one up do not count as results.
const LARGEST: f64 = 1e-3;

fn compare_sized<const D: usize>(case: &Case, sampled: bool, rounds: usize) -> Comparison {
    let model = Model::of(&case.scenario).expect("the case is sound");
    let chain = &PeerChain::<D>::new(&case.scenario, &model);
    let error_of = |found: &[f64]| {
        if sampled {
            case.sampled_error(found)
        } else {
            case.end_error(found)
        }
    };
    let mut own = TriedSettings::new(OURS);
    for step in 0..32 {
        let tolerance = 10f64.powf(-5.0 - 0.25 * f64::from(step));
        for longest_step in [1.0, 0.5] {
            let accuracy = Accuracy::new(tolerance, longest_step);
            let name = format!("tolerance {tolerance:.1e}, longest step {longest_step}");
            let ours = if sampled { ours::samples } else { ours::end };
            let run = Box::new(move || Some(ours(&case.scenario, accuracy)));
            own.add(name, Some(accuracy), run, &error_of);
        }
    }
    let mut solvers = vec![own];
    for peer in Peer::ALL {
        let mut tried = TriedSettings::new(peer.name());
        for step in 0..25 {
            let relative = 10f64.powf(-4.0 - 0.4 * f64::from(step));
            for part in [1.0, 0.1, 0.01, 1e-3, 1e-4] {
                let absolute = relative * part;
                let run = move || peer.run(chain, (relative, absolute), sampled);
                let name = format!("relative {relative:.1e}, absolute {absolute:.1e}");
                tried.add(name, None, Box::new(run), &error_of);
            }
        }
        solvers.push(tried);
    }
    // A converged run of another solver: the nearest to the reference of those whose tolerances are least.
    let mut reference = f64::INFINITY;
    for peer in Peer::ALL {
        for absolute in [1e-14, 1e-15, 1e-16] {
            let found = peer.run(chain, (1e-14, absolute), sampled);
            reference = reference.min(found.map_or(f64::INFINITY, |found| error_of(&found)));
        }
    }
    let fronts: Vec<_> = solvers
        .iter()
        .map(|tried| front(tried.fits.iter().map(|fit| (fit.error, fit.seconds)).collect()))
        .collect();
    solvers.iter_mut().for_each(TriedSettings::finalists);
    // One after another, so that whatever else the computer does hits all alike.
    for _ in 0..rounds {
        for fit in solvers.iter_mut().flat_map(|tried| &mut tried.fits) {
            fit.seconds = fit.seconds.min(ours::least_seconds(1, &fit.run));
        }
    }
    let row = |(tried, points): (TriedSettings<'_>, Vec<(f64, f64)>)| {
        let fits = tried.fits.into_iter();
        let best = fits.min_by(|a, b| a.seconds.total_cmp(&b.seconds));
        SolverRow {
            solver: tried.solver.to_owned(),
            milliseconds: best.as_ref().map(|fit| 1e3 * fit.seconds),
            error: best.as_ref().map(|fit| fit.error),
            accuracy: best.as_ref().and_then(|fit| fit.accuracy),
            settings: best.map(|fit| fit.settings),
            points,
        }
    };
    let what = if sampled {
        &*format!("{SAMPLES} samples")
    } else {
        "end only"
    };
    Comparison {
        name: case.name,
        case: format!("{} ({}), {what}", case.name, case.what),
        sampled,
        allowed: ALLOWED,
        reference,
        rows: solvers.into_iter().zip(fronts).map(row).collect(),
        target: match (case.name, sampled) {
            ("A", false) => 5.0,
            ("A", true) => 4.0,
            (_, false) => 8.0,
            (_, true) => 6.0,
        },
    }
}
