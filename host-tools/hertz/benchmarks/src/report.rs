//! Measured numbers beside their targets.

use std::fmt;

use hertz_chain::Accuracy;
use serde::{Deserialize, Serialize};

use crate::machine::Computer;

/// Error, as a part of the greatest velocity, and seconds.
pub(crate) type ErrorAndTime = (f64, f64);

/// The settings that no other one surpasses in both error and time, by error. Noise of the clock leaves steps
/// in the time, but no increase.
pub(crate) fn front(mut points: Vec<ErrorAndTime>) -> Vec<ErrorAndTime> {
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut least = f64::INFINITY;
    points.retain(|(_, seconds)| {
        let surpasses = *seconds < least;
        least = least.min(*seconds);
        surpasses
    });
    points
}

/// One solver's time for the error asked for.
#[derive(Debug, Serialize)]
pub(crate) struct SolverRow {
    pub(crate) solver: String,
    /// ms, the least of many; none if no setting keeps the error.
    pub(crate) milliseconds: Option<f64>,
    pub(crate) error: Option<f64>,
    /// Tolerances: ours and the longest step, or relative and absolute.
    pub(crate) settings: Option<String>,
    #[serde(skip)]
    pub(crate) accuracy: Option<Accuracy>,
    /// The settings that no other one surpasses in both error and time.
    pub(crate) points: Vec<ErrorAndTime>,
}

/// A solver of Python: its time for the error asked for, or its chains a second; neither if it does not reach
/// the error.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Foreign {
    pub(crate) case: String,
    pub(crate) solver: String,
    #[serde(default, skip_serializing)]
    seconds: Option<f64>,
    #[serde(skip_deserializing, skip_serializing_if = "Option::is_none")]
    milliseconds: Option<f64>,
    #[serde(skip_deserializing, skip_serializing_if = "Option::is_none")]
    chains_per_second: Option<f64>,
    /// Factor by which the simulator is faster.
    #[serde(skip_deserializing, skip_serializing_if = "Option::is_none")]
    simulator_faster: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    error: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    settings: Option<String>,
    #[serde(default)]
    pub(crate) points: Vec<ErrorAndTime>,
}

impl Foreign {
    /// Compares the time with the simulator's own, in s. An ensemble is of `chains` chains.
    pub(crate) fn conclude(&mut self, own: Option<f64>, chains: usize) {
        match self.seconds {
            Some(seconds) if self.case == "ensemble" => {
                self.chains_per_second = Some(chains as f64 / seconds)
            }
            seconds => self.milliseconds = seconds.map(|seconds| 1e3 * seconds),
        }
        self.simulator_faster = self.seconds.zip(own).map(|(seconds, own)| seconds / own);
    }
}

/// All solvers on one case.
#[derive(Debug, Serialize)]
pub(crate) struct Comparison {
    /// A or B.
    pub(crate) name: &'static str,
    pub(crate) case: String,
    pub(crate) sampled: bool,
    /// Greatest error allowed, as a part of the greatest velocity.
    pub(crate) allowed: f64,
    /// Difference between a converged run of another solver and the motion that the errors are taken from, in
    /// the same measure.
    pub(crate) reference: f64,
    /// The simulator first.
    pub(crate) rows: Vec<SolverRow>,
    /// Factor by which the simulator should be faster than the best of the others.
    pub(crate) target: f64,
}

/// The bound that a number is to keep.
#[derive(Clone, Copy)]
pub(crate) enum Aim {
    AtLeast(f64),
    AtMost(f64),
}

/// A number with its target.
#[derive(Debug, Serialize)]
pub(crate) struct Goal {
    pub(crate) name: String,
    pub(crate) value: Option<f64>,
    /// The least value that meets it, or the greatest, as `better` says.
    pub(crate) target: f64,
    pub(crate) unit: &'static str,
    pub(crate) better: &'static str,
    pub(crate) verdict: &'static str,
}

fn number(value: f64) -> String {
    if value.abs() < 1e-3 {
        format!("{value:.1e}")
    } else {
        format!("{value:.4}")
            .trim_end_matches('0')
            .trim_end_matches('.')
            .to_owned()
    }
}

#[derive(Debug, Serialize)]
pub(crate) struct Measurements {
    machine: Computer,
    pub(crate) comparisons: Vec<Comparison>,
    /// The solver of Python.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) peers: Vec<Foreign>,
    pub(crate) targets: Vec<Goal>,
}

impl Measurements {
    pub(crate) fn new() -> Self {
        Self {
            machine: Computer::new(),
            comparisons: Vec::new(),
            peers: Vec::new(),
            targets: Vec::new(),
        }
    }

    /// Adds a number and its bound; `None` where there is no number.
    pub(crate) fn goal(&mut self, name: impl Into<String>, value: Option<f64>, aim: Aim, unit: &'static str) {
        let (target, better, is_met) = match aim {
            Aim::AtLeast(least) => (least, "greater", value.is_some_and(|value| value >= least)),
            Aim::AtMost(most) => (most, "less", value.is_some_and(|value| value <= most)),
        };
        self.targets.push(Goal {
            name: name.into(),
            value,
            target,
            unit,
            better,
            verdict: if is_met { "met" } else { "short" },
        });
    }

    pub(crate) fn add(&mut self, comparison: Comparison) {
        let ours = comparison.rows[0].milliseconds;
        let others = comparison.rows[1..].iter().filter_map(|row| row.milliseconds);
        let best = others.fold(f64::INFINITY, f64::min);
        let ratio = ours.filter(|_| best.is_finite()).map(|ours| best / ours);
        let name = format!("{}: times faster than the best peer", comparison.case);
        self.goal(name, ratio, Aim::AtLeast(comparison.target), "times");
        let name = format!("{}: error of the reference", comparison.case);
        let most = Aim::AtMost(0.1 * comparison.allowed);
        self.goal(name, Some(comparison.reference), most, "of the greatest velocity");
        self.comparisons.push(comparison);
    }

    pub(crate) fn json(&self) -> String {
        serde_json::to_string_pretty(self).expect("numbers and strings are JSON")
    }
}

impl fmt::Display for Measurements {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.machine)?;
        for comparison in &self.comparisons {
            let (case, allowed, reference) = (&comparison.case, comparison.allowed, comparison.reference);
            writeln!(
                f,
                "\n{case}, error at most {allowed:e} (reference: {reference:.1e} from another solver's)"
            )?;
            for row in &comparison.rows {
                match (row.milliseconds, row.error, &row.settings) {
                    (Some(ms), Some(error), Some(settings)) => {
                        writeln!(f, "  {ms:8.3} ms  {error:.1e}  {}  ({settings})", row.solver)?;
                    }
                    _ => writeln!(f, "  not reached           {}", row.solver)?,
                }
            }
        }
        if !self.peers.is_empty() {
            writeln!(
                f,
                "\na solver of Python, and how many times faster hertz-chain was"
            )?;
        }
        for row in &self.peers {
            let time = match (row.milliseconds, row.chains_per_second) {
                (Some(ms), _) => format!("{ms:8.2} ms"),
                (_, Some(rate)) => format!("{rate:8.1} chains/s"),
                _ => "not reached".to_owned(),
            };
            let (error, times) = (
                row.error.unwrap_or(f64::NAN),
                row.simulator_faster.unwrap_or(f64::NAN),
            );
            let settings = row.settings.as_deref().unwrap_or_default();
            let (case, solver) = (&row.case, &row.solver);
            writeln!(
                f,
                "  {time}  {error:.1e}  {times:.1} times  {case}, {solver}  ({settings})"
            )?;
        }
        writeln!(f)?;
        for target in &self.targets {
            let value = target.value.map_or("none".to_owned(), number);
            let (name, aim, verdict) = (&target.name, target.target, target.verdict);
            let sign = if target.better == "greater" { "≥" } else { "≤" };
            writeln!(
                f,
                "{verdict:8} {name}: {value} {} (target {sign} {})",
                target.unit,
                number(aim)
            )?;
        }
        Ok(())
    }
}
