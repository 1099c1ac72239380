//! One chain: the time that each solver takes for a given error.

use std::time::Instant;

use hertz_chain::{Accuracy, Model};

use crate::cases::Case;
use crate::ours::{self, SAMPLES};
use crate::peers::{Chain, Peer};
use crate::report::{Comparison, Row};

/// Gives velocities of all bodies at the end, or at each sample.
type Runner<'a> = Box<dyn Fn() -> Option<Vec<f64>> + 'a>;

fn ours<'a>(case: &'a Case, tolerance: f64, longest_step: f64, sampled: bool) -> Runner<'a> {
    let accuracy = Accuracy {
        tolerance,
        longest_step,
    };
    Box::new(move || {
        Some(if sampled {
            ours::samples(&case.scenario, accuracy)
        } else {
            ours::end(&case.scenario, accuracy)
        })
    })
}

fn time(run: &Runner<'_>) -> f64 {
    let clock = Instant::now();
    std::hint::black_box(run());
    clock.elapsed().as_secs_f64()
}

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

/// A setting that keeps the error: its name, the error, the run, and its least time.
struct Fit<'a> {
    settings: String,
    error: f64,
    run: Runner<'a>,
    seconds: f64,
}

fn compare_sized<const D: usize>(case: &Case, sampled: bool, rounds: usize) -> Comparison {
    let model = Model::of(&case.scenario).expect("the case is sound");
    let chain = &Chain::<D>::new(&case.scenario, &model);
    let mut solvers: Vec<(String, Vec<Fit<'_>>)> = Vec::new();
    let fits = |settings: String, run: Runner<'_>| {
        let found = run()?;
        let error = if sampled {
            case.sampled_error(&found)
        } else {
            case.end_error(&found)
        };
        (error <= ALLOWED).then_some((settings, error))
    };
    let mut ours_fit = Vec::new();
    for step in 0..24 {
        let tolerance = 10f64.powf(-7.0 - 0.25 * f64::from(step));
        for longest in [1.0, 0.5] {
            let name = format!("tolerance {tolerance:.1e}, longest step {longest}");
            if let Some((settings, error)) = fits(name, ours(case, tolerance, longest, sampled)) {
                let run = ours(case, tolerance, longest, sampled);
                ours_fit.push(Fit {
                    settings,
                    error,
                    run,
                    seconds: f64::INFINITY,
                });
            }
        }
    }
    solvers.push(("hertz-chain".to_owned(), ours_fit));
    for peer in Peer::ALL {
        let mut found = Vec::new();
        for step in 0..20 {
            let relative = 10f64.powf(-6.0 - 0.4 * f64::from(step));
            for part in [1.0, 0.1, 0.01, 1e-3, 1e-4] {
                let absolute = relative * part;
                let run = move || peer.run(chain, (relative, absolute), sampled);
                let name = format!("relative {relative:.1e}, absolute {absolute:.1e}");
                if let Some((settings, error)) = fits(name, Box::new(run)) {
                    found.push(Fit {
                        settings,
                        error,
                        run: Box::new(run),
                        seconds: f64::INFINITY,
                    });
                }
            }
        }
        solvers.push((peer.name().to_owned(), found));
    }
    // A converged run of another solver: the nearest to the reference of those whose tolerances are least.
    let mut reference = f64::INFINITY;
    for peer in Peer::ALL {
        for absolute in [1e-14, 1e-15, 1e-16] {
            let found = peer.run(chain, (1e-14, absolute), sampled);
            let error = found.map(|found| {
                if sampled {
                    case.sampled_error(&found)
                } else {
                    case.end_error(&found)
                }
            });
            reference = reference.min(error.unwrap_or(f64::INFINITY));
        }
    }
    for (_, fits) in &mut solvers {
        for fit in fits.iter_mut() {
            fit.seconds = (0..3).map(|_| time(&fit.run)).fold(f64::INFINITY, f64::min);
        }
        fits.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
        fits.truncate(FINALISTS);
    }
    // One after another, so that whatever else the computer does hits all alike.
    for _ in 0..rounds {
        for fit in solvers.iter_mut().flat_map(|(_, fits)| fits) {
            fit.seconds = fit.seconds.min(time(&fit.run));
        }
    }
    let row = |(solver, fits): (String, Vec<Fit<'_>>)| {
        let best = fits.into_iter().min_by(|a, b| a.seconds.total_cmp(&b.seconds));
        Row {
            solver,
            milliseconds: best.as_ref().map(|fit| 1e3 * fit.seconds),
            error: best.as_ref().map(|fit| fit.error),
            settings: best.map(|fit| fit.settings),
        }
    };
    let what = if sampled {
        format!("{SAMPLES} samples")
    } else {
        "end only".to_owned()
    };
    Comparison {
        case: format!("{} ({}), {what}", case.name, case.what),
        allowed: ALLOWED,
        reference,
        rows: solvers.into_iter().map(row).collect(),
        target: match (case.name, sampled) {
            ("A", false) => 5.0,
            ("A", true) => 4.0,
            (_, false) => 8.0,
            (_, true) => 6.0,
        },
    }
}
