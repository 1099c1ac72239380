//! Many chains that differ in their intruder and speed: how many a second on one core, and the greatest error
//! of the energy that is absorbed.

use std::hint::black_box;
use std::sync::LazyLock;
use std::time::Instant;

use hertz_chain::{
    Accuracy, EnsembleOptions, EnsembleOutcome, Options, Scenario, SimulateError, ensemble, simulate_with,
};
use pulp::{Arch, Simd, WithSimd};
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::report::{Aim, Measurements};

/// Evaluations of the equations of motion a step.
const STAGES: f64 = 9.0;

/// Chains like A with other intruders and speeds, the same at every run. The method was not tuned on them.
pub(crate) fn scenarios(count: usize) -> Vec<Scenario> {
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    let mut draw = |low: f64, high: f64| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        low + (high - low) * ((state >> 11) as f64 / (1_u64 << 53) as f64)
    };
    let scenario = |_| {
        let mut scenario = Scenario::paper();
        scenario.duration = 0.010;
        scenario.striker.velocity = draw(0.2, 1.5);
        let intruder = &mut scenario.intruders[0];
        intruder.stiffness = draw(5e4, 5e5);
        intruder.damping = draw(5.0, 20.0);
        intruder.mass = draw(2e-3, 6e-3);
        scenario
    };
    (0..count).map(scenario).collect()
}

pub(crate) fn absorbed(scenario: &Scenario) -> f64 {
    let options = Options::with(Accuracy::new(1e-13, 0.125));
    let solution = simulate_with(scenario, &options).expect("it runs");
    solution.at(solution.end()).energies().dissipated_intruders
}

/// Square roots a second, as many at once as the processor can.
struct Roots;

impl WithSimd for Roots {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        const ROUNDS: usize = 20_000;
        let mut vectors = [simd.splat_f64s(1.5); 8];
        let clock = Instant::now();
        for _ in 0..ROUNDS {
            for vector in &mut vectors {
                *vector = simd.sqrt_f64s(*vector);
            }
        }
        let seconds = clock.elapsed().as_secs_f64();
        black_box(vectors);
        (ROUNDS * vectors.len() * S::F64_LANES) as f64 / seconds
    }
}

/// A pool of one thread.
pub(crate) static ALONE: LazyLock<ThreadPool> = LazyLock::new(|| {
    let pool = ThreadPoolBuilder::new().num_threads(1).build();
    pool.expect("a thread can be had")
});

/// Runs chains on one thread.
pub(crate) fn alone(chains: &[Scenario]) -> Vec<Result<EnsembleOutcome, SimulateError>> {
    ALONE.install(|| ensemble(chains, &EnsembleOptions::default()))
}

pub(crate) fn measure(report: &mut Measurements, quick: bool) {
    let chains = scenarios(if quick { 256 } else { 2048 });

    let (mut error, mut steps) = (0.0_f64, 0);
    for (chain, outcome) in chains.iter().zip(alone(&chains)) {
        let outcome = outcome.expect("it runs");
        error = error.max((outcome.absorbed() / absorbed(chain) - 1.0).abs());
        steps += outcome.steps();
    }
    // Short pieces: on a shared computer a long one is always disturbed.
    let (mut rate, mut roots) = (0.0_f64, 0.0_f64);
    for part in chains.chunks(64).cycle().take(if quick { 100 } else { 1000 }) {
        let clock = Instant::now();
        black_box(alone(part));
        rate = rate.max(part.len() as f64 / clock.elapsed().as_secs_f64());
        roots = roots.max(Arch::new().dispatch(Roots));
    }
    let contacts = chains[0].chain.beads as f64;
    let bound = roots / (STAGES * contacts * steps as f64 / chains.len() as f64);
    let name = "ensemble of chains like A, chains a second and core";
    report.goal(name, Some(rate), Aim::AtLeast(20_000.0), "chains/s");
    let name = format!(
        "the same: greatest error of the absorbed energy of {} chains",
        chains.len()
    );
    report.goal(name, Some(error), Aim::AtMost(1e-6), "of that energy");
    // The rest of the time goes to all but the square roots of all contacts at every stage.
    let name = "the same: share of what the square roots of all contacts alone would allow";
    report.goal(name, Some(rate / bound), Aim::AtLeast(0.3), "");
}
