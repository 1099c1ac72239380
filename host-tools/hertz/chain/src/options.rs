//! Options of a run, and its errors.

use crate::scenario::{InputError, Scenario};

/// Most values that a solution keeps: 4 GB.
pub(crate) const MOST_VALUES: usize = 500_000_000;

/// Accuracy of the integration.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Accuracy {
    /// Allowed error of each step in each component, as a part of the component's magnitude plus a hundredth
    /// of its scale. The scales are the striker's speed, its depth in a bead at rest, and its energy.
    pub tolerance: f64,
    /// Longest step, as a part of the scenario's shortest contact, so that no step passes over a collision of
    /// bodies in free flight.
    pub longest_step: f64,
}

impl Accuracy {
    /// The accuracy of all stated results of this crate.
    pub const REFERENCE: Self = Self {
        tolerance: 1e-14,
        longest_step: 1.0 / 8.0,
    };
    /// An accuracy for pictures and sweeps.
    pub const DRAFT: Self = Self {
        tolerance: 1e-8,
        longest_step: 1.0 / 2.0,
    };

    /// An accuracy with these values of its fields.
    pub const fn new(tolerance: f64, longest_step: f64) -> Self {
        Self {
            tolerance,
            longest_step,
        }
    }

    pub(crate) fn check(self) -> Result<(), InputError> {
        let (key, value, range) = if !(1e-14..=1e-3).contains(&self.tolerance) {
            ("tolerance", self.tolerance, "1e-14 (rounding) to 1e-3")
        } else if !(self.longest_step > 0.0 && self.longest_step <= 1.0) {
            ("longest_step", self.longest_step, "a part above 0 and at most 1")
        } else {
            return Ok(());
        };
        let what = format!("{key} {value} is out of range");
        Err(InputError::at("accuracy", what, format!("give {range}")))
    }
}

impl Default for Accuracy {
    fn default() -> Self {
        Self::REFERENCE
    }
}

/// Options of a run.
#[derive(Clone, Copy, Default)]
#[non_exhaustive]
pub struct Options<'a> {
    /// Time to simulate, s, in place of the scenario's; longer for a signal that continues after it. The
    /// [`Summary`](crate::Summary) covers the scenario's duration, or this one if it is shorter.
    pub duration: Option<f64>,
    /// Accuracy of the integration.
    pub accuracy: Accuracy,
    /// Called now and then with the completed part, 0 to 1.
    pub progress: Option<&'a (dyn Fn(f64) + Sync)>,
}

impl<'a> Options<'a> {
    /// Options with this accuracy, the scenario's duration, and no progress.
    pub const fn with(accuracy: Accuracy) -> Self {
        Self {
            duration: None,
            accuracy,
            progress: None,
        }
    }

    /// Sets the time to simulate, s.
    #[must_use]
    pub const fn with_duration(mut self, duration: f64) -> Self {
        self.duration = Some(duration);
        self
    }

    /// Sets a function that is called with the completed part, 0 to 1.
    #[must_use]
    pub const fn with_progress(mut self, progress: &'a (dyn Fn(f64) + Sync)) -> Self {
        self.progress = Some(progress);
        self
    }

    /// Reports the completed part of a run at every 64th step, and at the end.
    pub(crate) fn report(&self, steps: u64, part: f64) {
        if let Some(progress) = self.progress
            && (steps.is_multiple_of(64) || part == 1.0)
        {
            progress(part);
        }
    }

    /// The time to simulate, s.
    pub(crate) fn end(&self, scenario: &Scenario) -> Result<f64, InputError> {
        let end = self.duration.unwrap_or(scenario.duration);
        if end.is_finite() && end > 0.0 {
            return Ok(end);
        }
        let what = format!("{end} s cannot be simulated");
        Err(InputError::at("duration", what, "give a number above zero"))
    }
}

/// A time with its unit, s, with significant digits only.
fn shown(seconds: f64) -> String {
    if seconds > 1e6 {
        format!("{seconds:.1e} s")
    } else {
        format!("{seconds:.0} s")
    }
}

/// Reason why a scenario cannot be run.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimulateError {
    /// A value of the scenario or of the [`Options`] is out of range.
    #[error(transparent)]
    Input(#[from] InputError),
    /// A run that keeps its motion needs more steps than fit in memory: it is too long, has too many beads,
    /// or a part of it is much faster than a strike. [`Run`](crate::Run) and
    /// [`summarise`](crate::summarise()) keep no motion.
    #[error("duration: after {time:.3e} s of {end:.3e} s the run fills {} GB; simulate less time or fewer beads, or ask only for the summary, which keeps nothing", MOST_VALUES * 8 / 1_000_000_000)]
    TooLong {
        /// Time that the run reached, s; 0 if its length was clear from the start.
        time: f64,
        /// End of the run, s.
        end: f64,
    },
    /// The run takes more steps than a fast computer makes in a day.
    #[error(
        "duration: {end:.3e} s in steps of at most {step:.1e} s takes more than a day of computing; simulate less time, or check units"
    )]
    TooManySteps {
        /// End of the run, s.
        end: f64,
        /// Length of the longest step, s.
        step: f64,
    },
    /// An intruder is so much faster than a strike that its units are probably wrong.
    #[error(
        "intruder in bead {bead}: its time constant of {time:.1e} s takes {steps:.1e} steps, more than {} of computing; check units: mass in kg, stiffness in N/m, damping in N·s/m",
        shown(*seconds)
    )]
    TooStiff {
        /// The host bead.
        bead: usize,
        /// The time constant, s.
        time: f64,
        /// Least number of steps of the run.
        steps: f64,
        /// Wall-clock time of these steps on a fast computer, s.
        seconds: f64,
    },
    /// A softening spring was stretched so far that it no longer pulls back; the model ends there.
    #[error(
        "intruder in bead {bead}: its spring softens so much that at {time:.3e} s, {:.3e} m from its place, it no longer pulls back; give a cubic_stiffness nearer to zero, or a weaker strike",
        reach
    )]
    SpringGivesWay {
        /// The host bead.
        bead: usize,
        /// Time of the failure, s.
        time: f64,
        /// Distance at which the spring no longer pulls back, m.
        reach: f64,
    },
    /// The record of a drive ends before the run does.
    #[error("drive: the record ends at {last} s, the run at {end} s; simulate less time, or record longer")]
    DriveEnds {
        /// End of the record, s.
        last: f64,
        /// End of the run, s.
        end: f64,
    },
    /// The steps became too short to advance the clock: values lie too many powers of ten apart.
    #[error(
        "the integration is stuck at {time:?} s: values are too many powers of ten apart; check masses, stiffnesses and units"
    )]
    Stuck {
        /// Time of the failure, s.
        time: f64,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_of_computing_has_no_digits_that_say_nothing() {
        let message = |seconds: f64| {
            let error = SimulateError::TooStiff {
                bead: 8,
                time: 1e-12,
                steps: 1e9,
                seconds,
            };
            error.to_string()
        };
        assert!(message(943.7).contains(" 1.0e9 steps, more than 944 s of computing; "));
        assert!(message(2.561_235e20).contains(" 1.0e9 steps, more than 2.6e20 s of computing; "));
    }
}
