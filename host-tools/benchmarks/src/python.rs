//! Solvers of Python on the same cases, in a process of their own: the folder `peers`.
//!
//! # Design
//! The process looks for the fastest setting of each solver by itself. Then it runs each of them once for
//! every line that it gets. Between the lines the simulator is timed here, so whatever else the computer does
//! hits all alike.

use std::io::{BufRead, BufReader, Lines, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Instant;

use hertz_chain::{Accuracy, Model, Scenario};
use serde::Deserialize;
use serde_json::{Value, json};

use crate::cases::Case;
use crate::report::Foreign;
use crate::{ensemble, ours};

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/peers");
/// Chains of the ensemble that it gets.
const CHAINS: usize = 64;

/// The constants of a case's equations of motion, in SI units, and its converged end.
fn constants(case: &Case) -> Value {
    let model = Model::of(&case.scenario).expect("the case is sound");
    let intruder = &model.intruders()[0];
    let oscillator = intruder.oscillator;
    let held = |body: usize| {
        if body == intruder.bead {
            oscillator.mass
        } else {
            0.0
        }
    };
    json!({
        "name": case.name,
        "stiffness": (1..model.bodies()).map(|j| model.contact(j).stiffness).collect::<Vec<_>>(),
        "viscosity": 1.5 * model.contact(2).relaxation,
        "inverse": (0..model.bodies()).map(|body| 1.0 / (model.mass(body) - held(body))).collect::<Vec<_>>(),
        "host": intruder.bead,
        "oscillator": [oscillator.mass, oscillator.stiffness, oscillator.damping],
        "speed": model.striker_speed(),
        "duration": case.scenario.duration,
        "end": case.end,
    })
}

fn chain(scenario: &Scenario) -> Value {
    let intruder = &scenario.intruders[0];
    json!({
        "speed": scenario.striker.velocity,
        "stiffness": intruder.stiffness,
        "damping": intruder.damping,
        "mass": intruder.mass,
        "absorbed": ensemble::absorbed(scenario),
    })
}

/// A line that the process prints.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Told {
    Row(Foreign),
    Ready(Vec<Finalist>),
    Seconds(Vec<f64>),
}

/// A row that can be timed again.
#[derive(Debug, Deserialize)]
struct Finalist {
    case: String,
    solver: String,
}

struct Process {
    child: Child,
    input: Option<ChildStdin>,
    output: Lines<BufReader<ChildStdout>>,
}

impl Process {
    fn start() -> Result<Self, String> {
        let python = std::env::var_os("BEAD_PYTHON").unwrap_or_else(|| "python3".into());
        let started = Command::new(&python)
            .arg(FOLDER)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn();
        let mut child = started.map_err(|error| format!("cannot start {}: {error}", python.display()))?;
        let output = child.stdout.take().expect("it has just been piped");
        Ok(Self {
            input: child.stdin.take(),
            output: BufReader::new(output).lines(),
            child,
        })
    }

    fn ask(&mut self, line: &str) -> Result<(), String> {
        let input = self.input.as_mut().expect("it is open until the end");
        writeln!(input, "{line}").map_err(|error| format!("the script of the peers ended early: {error}"))
    }

    fn next(&mut self) -> Result<Told, String> {
        let line = self.output.next().ok_or("the script of the peers ended early")?;
        let line = line.map_err(|error| error.to_string())?;
        serde_json::from_str(&line)
            .map_err(|error| format!("the script of the peers printed {line:?}: {error}"))
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.input = None;
        // How it ends is of no interest, as long as it does.
        let _ = self.child.wait();
    }
}

/// The simulator's own runs, which the others are timed beside.
struct Ours<'a> {
    cases: &'a [Case],
    accuracies: Vec<Option<Accuracy>>,
    chains: Vec<Scenario>,
}

impl Ours<'_> {
    fn seconds(&self, name: &str) -> Option<f64> {
        let clock = Instant::now();
        if name == "ensemble" {
            std::hint::black_box(ensemble::alone(&self.chains));
        } else {
            let place = self.cases.iter().position(|case| case.name == name)?;
            std::hint::black_box(ours::end(&self.cases[place].scenario, self.accuracies[place]?));
        }
        Some(clock.elapsed().as_secs_f64())
    }
}

/// Times the solvers that are installed. `accuracies` are those that the simulator needs for the error
/// allowed, case by case.
pub(crate) fn rows(
    cases: &[Case],
    accuracies: Vec<Option<Accuracy>>,
    rounds: usize,
) -> Result<Vec<Foreign>, String> {
    let chains = ensemble::scenarios(CHAINS);
    let wanted = json!({
        "cases": cases.iter().map(constants).collect::<Vec<_>>(),
        "ensemble": chains.iter().map(chain).collect::<Vec<_>>(),
    });
    let mut process = Process::start()?;
    process.ask(&wanted.to_string())?;
    let mut rows = Vec::new();
    let finalists = loop {
        match process.next()? {
            Told::Row(row) => rows.push(row),
            Told::Ready(finalists) => break finalists,
            Told::Seconds(_) => {}
        }
    };
    let ours = Ours {
        cases,
        accuracies,
        chains,
    };
    for _ in 0..rounds {
        process.ask("round")?;
        let Told::Seconds(seconds) = process.next()? else {
            return Err("the script of the peers printed no times".to_owned());
        };
        for (finalist, seconds) in finalists.iter().zip(seconds) {
            let own = ours.seconds(&finalist.case);
            let timed = rows
                .iter_mut()
                .find(|row| row.case == finalist.case && row.solver == finalist.solver);
            if let (Some(row), Some(own)) = (timed, own) {
                row.note(seconds, own);
            }
        }
    }
    rows.iter_mut().for_each(|row| row.conclude(CHAINS));
    Ok(rows)
}
