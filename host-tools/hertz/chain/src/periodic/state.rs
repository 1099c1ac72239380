//! A motion that repeats, by Newton's method.

use nalgebra::{DMatrix, DVector};
use realfft::num_complex::Complex64;

use super::error::PeriodicError;
use super::map::{ACCURACY, PeriodMap};
use crate::run::Run;
use crate::scenario::{Scenario, Start};

/// Most steps of Newton's method, and most halvings of a step.
const ITERATIONS: usize = 40;
const HALVINGS: usize = 8;
/// Distance between start and end of a period that counts as zero, as a part of the motion. A period is
/// integrated to some 1e-12.
pub(super) const CLOSED: f64 = 1e-10;

/// Error of the multipliers' magnitudes.
const KNOWN: f64 = 1e-8;

/// A motion of a driven chain that repeats with each period of the drive, stable or not.
///
/// ```
/// use hertz_chain::{Drive, DriveQuantity, PeriodicState, Scenario, Wall};
///
/// let mut scenario = Scenario::paper();
/// (scenario.chain.beads, scenario.chain.precompression) = (5, 10.0);
/// scenario.intruders.clear();
/// scenario.striker.velocity = 0.0;
/// scenario.wall = Some(Wall::flat(scenario.striker.material()));
/// scenario.drive = Some(Drive::sine(DriveQuantity::Displacement, 1e-7, 900.0));
/// let state = PeriodicState::of(&scenario)?;
/// assert!(state.is_stable());
/// # Ok::<(), hertz_chain::PeriodicError>(())
/// ```
#[derive(Debug, Clone)]
pub struct PeriodicState {
    pub(super) map: PeriodMap,
    pub(super) scenario: Scenario,
    pub(super) point: DVector<f64>,
    multipliers: Vec<Complex64>,
    residual: f64,
}

impl PeriodicState {
    /// Finds the motion near the chain at rest, or near the state in the scenario's `[[start]]` tables. For a
    /// weak drive it is the linear response. The drive is a sine of one frequency, whose ramp is left out.
    ///
    /// # Errors
    /// [`PeriodicError`]: the scenario is out of range or its drive is not periodic, contacts are clipped or
    /// not Hertz', or no such motion is near.
    pub fn of(scenario: &Scenario) -> Result<Self, PeriodicError> {
        let (map, scenario) = PeriodMap::of(scenario)?;
        let point = map.point(&map.chain.model.initial());
        Self::search(map, scenario, point)
    }

    /// Finds the motion of another drive near this one.
    ///
    /// # Errors
    /// As [`PeriodicState::of`].
    ///
    /// # Panics
    /// If the scenario has a different number of beads or intruders.
    pub fn near(&self, scenario: &Scenario) -> Result<Self, PeriodicError> {
        let (_, scenario) = PeriodMap::of(scenario)?;
        let map = self.map.with_drive_of(&scenario)?;
        Self::search(map, scenario, self.point.clone())
    }

    /// Newton's method from a point.
    fn search(map: PeriodMap, scenario: Scenario, mut point: DVector<f64>) -> Result<Self, PeriodicError> {
        let (mut image, mut derivative) = map.image_and_derivative(&point)?;
        let mut residual = missed(&point, &image);
        for iteration in 0..ITERATIONS {
            if residual <= CLOSED {
                return Ok(Self::found(map, scenario, point, &derivative, residual));
            }
            let gap = &image - &point;
            let count = point.len();
            let equations = DMatrix::identity(count, count) - &derivative;
            let lost = || PeriodicError::NoState {
                iterations: iteration,
                residual,
            };
            let step = equations.lu().solve(&gap).ok_or_else(lost)?;
            let better = (0..=HALVINGS).find_map(|halvings| {
                let near = &point + &step * 0.5_f64.powi(halvings as i32);
                let image = map.image(&near).ok()?;
                (missed_by(&near, &image) < gap.amax()).then_some(near)
            });
            point = better.ok_or_else(lost)?;
            (image, derivative) = map.image_and_derivative(&point)?;
            residual = missed(&point, &image);
        }
        Err(PeriodicError::NoState {
            iterations: ITERATIONS,
            residual,
        })
    }

    pub(super) fn found(
        map: PeriodMap,
        scenario: Scenario,
        point: DVector<f64>,
        derivative: &DMatrix<f64>,
        residual: f64,
    ) -> Self {
        let mut multipliers: Vec<Complex64> = derivative.complex_eigenvalues().iter().copied().collect();
        multipliers.sort_by(|one, other| other.norm().total_cmp(&one.norm()));
        Self {
            map,
            scenario,
            point,
            multipliers,
            residual,
        }
    }

    /// The scenario, without a ramp of its drive.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// Length of a period, s.
    pub fn period(&self) -> f64 {
        self.map.period
    }

    /// Floquet multipliers, the greatest magnitude first: the factors by which small disturbances grow in a
    /// period. There are two for each body that the drive does not move and two for each intruder.
    pub fn multipliers(&self) -> &[Complex64] {
        &self.multipliers
    }

    /// True if no small disturbance grows: no multiplier is outside the unit circle by more than 1e-8, the
    /// error of their magnitudes. The multipliers of a chain without losses are on the circle.
    pub fn is_stable(&self) -> bool {
        self.growing() == 0
    }

    /// Number of multipliers outside the unit circle.
    pub(super) fn growing(&self) -> usize {
        let multipliers = self.multipliers.iter();
        multipliers
            .take_while(|multiplier| multiplier.norm() > 1.0 + KNOWN)
            .count()
    }

    /// Greatest distance between start and end of a period, as a part of the motion.
    pub fn residual(&self) -> f64 {
        self.residual
    }

    /// Displacements and velocities of beads and intruders at the start of a period. A run of
    /// [`PeriodicState::scenario`] with these in place of its own starts follows this motion.
    pub fn starts(&self) -> Vec<Start> {
        let mut run = self.run();
        let now = run.snapshot();
        // All beads touch, and displacements of starts count from there.
        let gap = self.scenario.wall.as_ref().map_or(0.0, |wall| wall.gap);
        let of_bead = |bead: usize| {
            let mut start = Start::moving([bead], now.velocity(bead));
            start.displacement = now.state[bead] + gap;
            let inner = now.intruder_displacement(bead).zip(now.intruder_velocity(bead));
            (start.intruder_displacement, start.intruder_velocity) = inner.unwrap_or_default();
            start
        };
        (1..now.model().bodies()).map(of_bead).collect()
    }

    /// A run of this motion from the start of a period, at t = 0. In an unstable motion rounding errors grow.
    pub fn run(&self) -> Run {
        let run = self.map.chain.run(&self.map.start(&self.point), ACCURACY);
        run.expect("Newton's method ran it at this accuracy")
    }
}

/// Distance between start and end of a period.
fn missed_by(point: &DVector<f64>, image: &DVector<f64>) -> f64 {
    (image - point).amax()
}

/// Distance between start and end of a period, as a part of the motion.
pub(super) fn missed(point: &DVector<f64>, image: &DVector<f64>) -> f64 {
    missed_by(point, image) / image.amax()
}
