//! The equations of motion in general solvers, as a careful user would write them: no allocation, sizes known
//! to the compiler, displacements in a unit that makes all components of one order. The losses are left out,
//! which is less work than the simulator does.

use differential_equations::prelude::{ExplicitRungeKutta, IVP, ODE};
use hertz_chain::{Model, Scenario};
use ode_solvers::dop_shared::OutputType;
use ode_solvers::{Dop853, SVector, System};

use crate::ours::SAMPLES;

/// Unit of displacements, m.
const UNIT: f64 = 1e-5;

/// The inverse mass of each body, 1/kg; of the host without its intruder.
pub(crate) fn inverse_masses(model: &Model) -> Vec<f64> {
    let intruder = &model.intruders()[0];
    let mut inverse: Vec<f64> = (0..model.bodies()).map(|body| 1.0 / model.mass(body)).collect();
    inverse[intruder.bead] = 1.0 / (model.mass(intruder.bead) - intruder.oscillator.mass);
    inverse
}

/// Bodies 0..=N, contacts and one intruder, with D = 2 (N + 2) components: displacements and that of the
/// intruder relative to its host, then their rates.
#[derive(Debug, Clone)]
pub(crate) struct PeerChain<const D: usize> {
    stiffness: Vec<f64>,
    viscosity: f64,
    inverse: Vec<f64>,
    host: usize,
    oscillator: [f64; 3],
    speed: f64,
    duration: f64,
}

impl<const D: usize> PeerChain<D> {
    pub(crate) fn new(scenario: &Scenario, model: &Model) -> Self {
        assert_eq!(D, 2 * (model.bodies() + 1));
        let intruder = &model.intruders()[0];
        let oscillator = intruder.oscillator;
        Self {
            stiffness: (1..model.bodies()).map(|j| model.contact(j).stiffness).collect(),
            viscosity: 1.5 * model.contact(2).relaxation,
            inverse: inverse_masses(model),
            host: intruder.bead,
            oscillator: [oscillator.mass, oscillator.stiffness, oscillator.damping],
            speed: model.striker_speed(),
            duration: scenario.duration,
        }
    }

    fn start(&self) -> [f64; D] {
        let mut state = [0.0; D];
        state[D / 2] = self.speed;
        state
    }

    #[inline(always)]
    fn rate(&self, y: &[f64; D], rate: &mut [f64; D]) {
        let (u, v) = y.split_at(D / 2);
        let (du, dv) = rate.split_at_mut(D / 2);
        for (du, v) in du.iter_mut().zip(v) {
            *du = v / UNIT;
        }
        let bodies = D / 2 - 1;
        let mut before = 0.0;
        for j in 1..bodies {
            let overlap = ((u[j - 1] - u[j]) * UNIT).max(0.0);
            let force =
                self.stiffness[j - 1] * overlap.sqrt() * (overlap + self.viscosity * (v[j - 1] - v[j]));
            dv[j - 1] = (before - force) * self.inverse[j - 1];
            before = force;
        }
        dv[bodies - 1] = before * self.inverse[bodies - 1];
        let [mass, stiffness, damping] = self.oscillator;
        let pull = stiffness * u[bodies] * UNIT + damping * v[bodies];
        dv[self.host] += pull * self.inverse[self.host];
        dv[bodies] = -pull / mass - dv[self.host];
    }

    /// Velocities of the bodies at the end, or at each sample, one after another.
    fn velocities<'a>(states: impl ExactSizeIterator<Item = &'a [f64]>, sampled: bool) -> Option<Vec<f64>> {
        let count = states.len();
        // The first is the start. A rounding of time may add one at the end.
        let kept = if sampled {
            1..SAMPLES + 1
        } else {
            count.checked_sub(1)?..count
        };
        let mut velocities = Vec::with_capacity(kept.len() * (D / 2 - 1));
        for state in states.skip(kept.start).take(kept.len()) {
            velocities.extend_from_slice(&state[D / 2..D - 1]);
        }
        (velocities.len() == kept.len() * (D / 2 - 1)).then_some(velocities)
    }
}

impl<const D: usize> System<f64, SVector<f64, D>> for &PeerChain<D> {
    fn system(&self, _: f64, y: &SVector<f64, D>, dy: &mut SVector<f64, D>) {
        self.rate(&y.data.0[0], &mut dy.data.0[0]);
    }
}

impl<const D: usize> ODE<f64, [f64; D]> for PeerChain<D> {
    fn diff(&self, _: f64, y: &[f64; D], dy: &mut [f64; D]) {
        self.rate(y, dy);
    }
}

/// A solver that can be timed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Peer {
    OdeSolvers,
    Dop853,
    Verner,
}

impl Peer {
    pub(crate) const ALL: [Self; 3] = [Self::OdeSolvers, Self::Dop853, Self::Verner];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::OdeSolvers => "ode_solvers 0.6, Dop853, SVector",
            Self::Dop853 => "differential-equations 0.7, DOP853",
            Self::Verner => "differential-equations 0.7, Verner 9(8)",
        }
    }

    /// Velocities at the end, or at each sample, one after another; none if the solver gives up.
    pub(crate) fn run<const D: usize>(
        self,
        chain: &PeerChain<D>,
        (relative, absolute): (f64, f64),
        sampled: bool,
    ) -> Option<Vec<f64>> {
        let end = chain.duration;
        let interval = end / SAMPLES as f64;
        match self {
            Self::OdeSolvers => {
                let start = SVector::<f64, D>::from(chain.start());
                let dx = if sampled { interval } else { end };
                let mut solver = Dop853::new(chain, 0.0, end, dx, start, relative, absolute);
                solver.set_output(if sampled {
                    OutputType::Dense
                } else {
                    OutputType::Sparse
                });
                solver.integrate().ok()?;
                PeerChain::<D>::velocities(solver.y_out().iter().map(|y| y.as_slice()), sampled)
            }
            Self::Dop853 | Self::Verner => {
                macro_rules! solve {
                    ($method:expr) => {{
                        let problem = IVP::ode(chain, 0.0, end, chain.start());
                        let method = $method.rtol(relative).atol(absolute).max_steps(100_000);
                        let solved = if sampled {
                            problem.even(interval).method(method).solve()
                        } else {
                            problem.method(method).solve()
                        };
                        PeerChain::<D>::velocities(solved.ok()?.y.iter().map(|y| &y[..]), sampled)
                    }};
                }
                if self == Self::Dop853 {
                    solve!(ExplicitRungeKutta::dop853())
                } else {
                    solve!(ExplicitRungeKutta::rkv988e())
                }
            }
        }
    }
}
