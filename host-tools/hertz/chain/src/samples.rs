//! Samples of chosen quantities at equal intervals, taken during a run.

use crate::run::{Step, StepView};

/// A quantity of one body, contact or intruder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Observable {
    /// Displacement of a body, m; body 0 is the striker.
    Displacement(usize),
    /// Velocity of a body, m/s.
    Velocity(usize),
    /// Total force of a contact, N.
    Force(usize),
    /// Displacement of the intruder in a bead relative to its host, m.
    IntruderDisplacement(usize),
    /// Absolute acceleration of the intruder in a bead, m/s².
    IntruderAcceleration(usize),
}

impl Observable {
    /// The value, in SI units; NaN if there is no such intruder.
    fn value(self, moment: &StepView<'_>) -> f64 {
        match self {
            Self::Displacement(body) => moment.displacement(body),
            Self::Velocity(body) => moment.velocity(body),
            Self::Force(contact) => moment.force(contact),
            Self::IntruderDisplacement(bead) => moment.intruder_displacement(bead).unwrap_or(f64::NAN),
            Self::IntruderAcceleration(bead) => moment.intruder_acceleration(bead).unwrap_or(f64::NAN),
        }
    }
}

/// Samples of a [`Run`](crate::Run) at equal intervals from t = 0 on.
///
/// ```
/// use hertz_chain::{Accuracy, Observable, Run, Samples, Scenario};
///
/// let mut run = Run::new(&Scenario::paper(), Accuracy::DRAFT)?;
/// let mut samples = Samples::new(1e-5, vec![Observable::Velocity(8), Observable::Force(8)]);
/// run.watch(4e-3, |step| samples.observe(step))?;
/// assert_eq!(samples.len(), 401);
/// let force = samples.row(250)[1];
/// # assert!(force.is_finite());
/// # Ok::<(), hertz_chain::SimulateError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Samples {
    interval: f64,
    channels: Vec<Observable>,
    /// Number of the first sample.
    first: Option<u64>,
    /// Values, row by row.
    values: Vec<f64>,
}

impl Samples {
    /// Samples at the multiples of `interval`, s.
    ///
    /// # Panics
    /// If the interval is not above zero, or there is no channel.
    pub fn new(interval: f64, channels: Vec<Observable>) -> Self {
        assert!(
            interval > 0.0,
            "samples need an interval above zero, not {interval} s"
        );
        assert!(!channels.is_empty(), "samples need a channel");
        Self {
            interval,
            channels,
            first: None,
            values: Vec::new(),
        }
    }

    /// Reserves memory for all samples of a run to `end`, s.
    #[must_use]
    pub fn with_end(mut self, end: f64) -> Self {
        let rows = (end / self.interval).ceil().max(0.0) as usize + 1;
        self.values
            .reserve_exact(rows.saturating_mul(self.channels.len()));
        self
    }

    /// Takes the samples of a step. Must be called with each step of the run, in order.
    pub fn observe(&mut self, step: &mut Step<'_>) {
        let (from, to) = (step.from(), step.to());
        let first = *self
            .first
            .get_or_insert_with(|| (from / self.interval * (1.0 - 1e-12)).ceil() as u64);
        loop {
            // Rounding may put a multiple just past the end of the run.
            let time = (first + self.len() as u64) as f64 * self.interval;
            if time > to * (1.0 + 1e-12) {
                return;
            }
            let moment = step.at(time.clamp(from, to));
            self.values
                .extend(self.channels.iter().map(|channel| channel.value(&moment)));
        }
    }

    /// Number of samples taken.
    pub fn len(&self) -> usize {
        self.values.len() / self.channels.len()
    }

    /// Returns true if no sample has been taken.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Time of a sample, s.
    pub fn time(&self, index: usize) -> f64 {
        (self.first.unwrap_or(0) + index as u64) as f64 * self.interval
    }

    /// The values of a sample, in the order of the quantities.
    ///
    /// # Panics
    /// If there is no such sample.
    pub fn row(&self, index: usize) -> &[f64] {
        let width = self.channels.len();
        &self.values[index * width..(index + 1) * width]
    }

    /// Values of all samples, one after another.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Returns all values, one sample after another.
    pub fn into_values(self) -> Vec<f64> {
        self.values
    }
}
