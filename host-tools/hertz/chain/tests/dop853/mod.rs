//! The adaptive Runge-Kutta method of Dormand and Prince, order 8(5,3), with a seventh-order dense output.
//!
//! # Design
//!
//! Hairer, Nørsett and Wanner, *Solving Ordinary Differential Equations I*, 2nd ed., II.5, II.6 and II.10.
//! The tests of the solver compare it with this one, which shares nothing with it but the model. Where a
//! contact opens or closes, the force is only Hölder continuous. The error estimate notices that, and the
//! steps shrink until the singular point lies in a step too short to do harm. A mere kink can hide between
//! the stages of a step, so the caller ends a step there.
//!
//! The error of a step is the greatest over the components, not their root mean square. Few beads of a long
//! chain move at a time, and a mean would allow them a larger error the longer the chain is.

mod table;

use table::{A, D, E3, E5};

/// An autonomous system of ordinary differential equations y' = f(y).
pub(crate) trait System {
    /// Writes f(y) to `rate`, which has the length of `y`.
    fn rate(&self, y: &[f64], rate: &mut [f64]);
}

/// Room for the sixteen stages of a step: twelve of the method, the rate at its end, three of the dense
/// output.
#[derive(Debug, Clone)]
struct Stages {
    rates: Vec<Vec<f64>>,
    argument: Vec<f64>,
}

impl Stages {
    fn new(dimension: usize) -> Self {
        Self {
            rates: vec![vec![0.0; dimension]; A.len()],
            argument: vec![0.0; dimension],
        }
    }

    /// `out` = y + h Σ a k over one row of the table.
    fn combine(&self, row: &[(usize, f64)], y: &[f64], h: f64, out: &mut [f64]) {
        out.fill(0.0);
        for &(stage, weight) in row {
            for (sum, rate) in out.iter_mut().zip(&self.rates[stage]) {
                *sum += weight * rate;
            }
        }
        for (sum, start) in out.iter_mut().zip(y) {
            *sum = start + h * *sum;
        }
    }

    fn stage(&mut self, system: &impl System, index: usize, y: &[f64], h: f64) {
        let mut argument = std::mem::take(&mut self.argument);
        self.combine(A[index], y, h, &mut argument);
        system.rate(&argument, &mut self.rates[index]);
        self.argument = argument;
    }
}

/// A trajectory as far as it is known: its state, the length of the next step, and counts.
#[derive(Debug)]
pub(crate) struct Dop853 {
    pub(crate) time: f64,
    pub(crate) state: Vec<f64>,
    pub(crate) evaluations: u64,
    stages: Stages,
    candidate: Vec<f64>,
    /// Error allowed in each component, besides `relative` times its magnitude.
    absolute: Vec<f64>,
    relative: f64,
    step: f64,
    longest: f64,
}

/// A step became too short to move the clock: the system has a singularity or a value that is not a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StepTooShort;

impl Dop853 {
    /// Starts at t = 0 from `state`. `absolute` has the same length; no step exceeds `longest`.
    pub(crate) fn new(
        system: &impl System,
        state: Vec<f64>,
        relative: f64,
        absolute: Vec<f64>,
        longest: f64,
    ) -> Self {
        let mut stages = Stages::new(state.len());
        system.rate(&state, &mut stages.rates[0]);
        Self {
            time: 0.0,
            candidate: state.clone(),
            state,
            evaluations: 1,
            stages,
            absolute,
            relative,
            // Short enough for the singular start of a contact; a smooth system is soon out of it.
            step: 1e-4 * longest,
            longest,
        }
    }

    /// Makes one step that meets the tolerance and does not pass `stop`. A step that reaches `stop` ends on
    /// it exactly.
    pub(crate) fn advance(&mut self, system: &impl System, stop: f64) -> Result<(), StepTooShort> {
        const SAFETY: f64 = 0.9;
        let mut rejected = false;
        loop {
            let left = stop - self.time;
            // A remainder shorter than the rounding of the clock would be a step of nothing: this step takes
            // it along.
            let last = self.step >= left * (1.0 - 1e-9);
            let h = if last { left } else { self.step };
            if self.time + h <= self.time || h.is_nan() {
                return Err(StepTooShort);
            }
            for index in 1..12 {
                self.stages.stage(system, index, &self.state, h);
            }
            self.stages.combine(A[12], &self.state, h, &mut self.candidate);
            self.evaluations += 11;
            let error = self.error(h);
            // A NaN counts as too great an error, and the step shrinks until it is stuck.
            if error <= 1.0 {
                system.rate(&self.candidate, &mut self.stages.rates[12]);
                self.evaluations += 1;
                self.stages.rates.swap(0, 12);
                std::mem::swap(&mut self.state, &mut self.candidate);
                self.time = if last { stop } else { self.time + h };
                let growth = (SAFETY * error.powf(-1.0 / 8.0)).clamp(0.2, if rejected { 1.0 } else { 10.0 });
                let next = h * growth;
                // A step that `stop` cut short does not tell how long the next may be.
                let next = if last { next.max(self.step) } else { next };
                self.step = next.min(self.longest);
                return Ok(());
            }
            rejected = true;
            let shrink = SAFETY * error.powf(-1.0 / 8.0);
            self.step = h * if shrink > 0.2 { shrink } else { 0.2 };
        }
    }

    /// Returns to an earlier state.
    pub(crate) fn return_to(&mut self, system: &impl System, time: f64, state: &[f64]) {
        self.time = time;
        self.state.copy_from_slice(state);
        system.rate(&self.state, &mut self.stages.rates[0]);
        self.evaluations += 1;
    }

    /// Hairer's blend of the third and fifth order estimates, of order 7 in the step; 1 is allowed.
    fn error(&self, h: f64) -> f64 {
        let mut greatest = 0.0_f64;
        for index in 0..self.state.len() {
            let part = |&(s, w): &(usize, f64)| w * self.stages.rates[s][index];
            let [fifth, third] = [E5, E3].map(|row| row.iter().map(part).sum::<f64>());
            let both = fifth * fifth + 0.01 * third * third;
            let size = self.state[index].abs().max(self.candidate[index].abs());
            let allowed = self.absolute[index] + self.relative * size;
            let error = if both > 0.0 {
                h * fifth * fifth / both.sqrt() / allowed
            } else {
                both
            };
            // `max` would pass over a NaN.
            if error.is_nan() {
                return error;
            }
            greatest = greatest.max(error);
        }
        greatest
    }
}

/// The dense output of one step: a polynomial of seventh order in time, exact at both ends.
#[derive(Debug, Clone)]
pub(crate) struct Interpolant {
    start: f64,
    length: f64,
    state: Vec<f64>,
    coefficients: [Vec<f64>; 7],
}

impl Interpolant {
    /// Repeats the step from `from` = (t, y) to `to`, both as the [`Dop853`] left them.
    pub(crate) fn new(system: &impl System, from: (f64, &[f64]), to: (f64, &[f64])) -> Self {
        let ((start, y0), (end, y1)) = (from, to);
        let length = end - start;
        let mut stages = Stages::new(y0.len());
        system.rate(y0, &mut stages.rates[0]);
        for index in 1..12 {
            stages.stage(system, index, y0, length);
        }
        system.rate(y1, &mut stages.rates[12]);
        for index in 13..16 {
            stages.stage(system, index, y0, length);
        }
        let mut coefficients: [Vec<f64>; 7] = std::array::from_fn(|_| vec![0.0; y0.len()]);
        for i in 0..y0.len() {
            let change = y1[i] - y0[i];
            let (first, last) = (length * stages.rates[0][i], length * stages.rates[12][i]);
            coefficients[0][i] = change;
            coefficients[1][i] = first - change;
            coefficients[2][i] = 2.0 * change - (first + last);
            for (row, coefficient) in D.iter().zip(&mut coefficients[3..]) {
                coefficient[i] = length * row.iter().map(|&(s, w)| w * stages.rates[s][i]).sum::<f64>();
            }
        }
        Self {
            start,
            length,
            state: y0.to_vec(),
            coefficients,
        }
    }

    /// The state at time `t` of the step.
    pub(crate) fn at(&self, t: f64, out: &mut [f64]) {
        let x = (t - self.start) / self.length;
        for (i, value) in out.iter_mut().enumerate() {
            let mut sum = 0.0;
            for (power, coefficient) in self.coefficients.iter().enumerate().rev() {
                sum = (sum + coefficient[i]) * if power % 2 == 0 { x } else { 1.0 - x };
            }
            *value = self.state[i] + sum;
        }
    }
}

mod tests {
    use super::{A, Dop853, Interpolant, Stages, StepTooShort, System};

    /// A planet at the end of its orbit's long axis: smooth, not linear, and closed.
    struct Kepler;

    const PLANET: [f64; 4] = [1.5, 0.0, 0.0, 0.577_350_269_189_625_8];

    impl System for Kepler {
        fn rate(&self, y: &[f64], rate: &mut [f64]) {
            let cube = (y[0] * y[0] + y[1] * y[1]).powf(1.5);
            rate.copy_from_slice(&[y[2], y[3], -y[0] / cube, -y[1] / cube]);
        }
    }

    /// One step of length h from [`PLANET`].
    fn step(h: f64) -> Vec<f64> {
        let mut stages = Stages::new(4);
        Kepler.rate(&PLANET, &mut stages.rates[0]);
        for index in 1..12 {
            stages.stage(&Kepler, index, &PLANET, h);
        }
        let mut end = vec![0.0; 4];
        stages.combine(A[12], &PLANET, h, &mut end);
        end
    }

    /// The state a time h after [`PLANET`], by many short steps.
    fn exact(h: f64) -> Vec<f64> {
        let mut stepper = Dop853::new(&Kepler, PLANET.to_vec(), 1e-15, vec![1e-16; 4], 0.05);
        while stepper.time < h {
            stepper.advance(&Kepler, h).expect("the orbit is smooth");
        }
        stepper.state
    }

    fn distance(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn halving_a_step_divides_its_error_by_two_to_the_ninth() {
        let error = |h: f64| distance(&step(h), &exact(h));
        let order = (error(0.8) / error(0.4)).log2();
        assert!((8.5..10.5).contains(&order), "{order}");
    }

    #[test]
    fn halving_a_step_divides_the_error_inside_it_by_two_to_the_eighth() {
        let error = |h: f64| {
            let mut inside = vec![0.0; 4];
            Interpolant::new(&Kepler, (0.0, &PLANET), (h, &exact(h))).at(0.4 * h, &mut inside);
            distance(&inside, &exact(0.4 * h))
        };
        let order = (error(0.8) / error(0.4)).log2();
        assert!((7.5..9.5).contains(&order), "{order}");
    }

    #[test]
    fn dense_output_meets_both_ends_of_its_step() {
        let end = step(0.3);
        let dense = Interpolant::new(&Kepler, (2.0, &PLANET), (2.3, &end));
        let mut y = vec![0.0; 4];
        dense.at(2.0, &mut y);
        assert_eq!(y, PLANET);
        dense.at(2.3, &mut y);
        assert!(distance(&y, &end) < 1e-15);
    }

    #[test]
    fn an_orbit_closes_within_a_hundred_tolerances() {
        let axis: f64 = 1.0 / (2.0 / 1.5 - PLANET[3] * PLANET[3]);
        let period = std::f64::consts::TAU * axis.powf(1.5);
        for tolerance in [1e-6, 1e-9, 1e-12] {
            let mut stepper = Dop853::new(&Kepler, PLANET.to_vec(), tolerance, vec![tolerance; 4], 1.0);
            while stepper.time < period {
                stepper.advance(&Kepler, period).expect("the orbit is smooth");
            }
            assert_eq!(stepper.time, period);
            let error = distance(&stepper.state, &PLANET);
            assert!(error < 100.0 * tolerance, "{error:e} at {tolerance:e}");
        }
    }

    #[test]
    fn a_singularity_is_reported_instead_of_tried_for_ever() {
        /// y' = y² from 1: at infinity when t = 1.
        struct Blowup;
        impl System for Blowup {
            fn rate(&self, y: &[f64], rate: &mut [f64]) {
                rate[0] = y[0] * y[0];
            }
        }
        let mut stepper = Dop853::new(&Blowup, vec![1.0], 1e-10, vec![1e-10], 0.1);
        let stuck = (0..100_000).find_map(|_| stepper.advance(&Blowup, 2.0).err());
        assert_eq!(stuck, Some(StepTooShort));
        assert!((stepper.time - 1.0).abs() < 1e-6, "{}", stepper.time);
    }
}
