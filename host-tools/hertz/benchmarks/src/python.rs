//! A solver of Python on the same cases, in a process of its own: `peer.py`.

use std::io::Write;
use std::process::{Command, Stdio};

use hertz_chain::{Accuracy, Model, Scenario};
use serde_json::{Value, json};

use crate::cases::Case;
use crate::peers::inverse_masses;
use crate::report::Foreign;
use crate::{ensemble, ours};

const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/peer.py");
/// Chains of the ensemble.
const CHAINS: usize = 64;

/// The constants of a case's equations of motion, in SI units, and its converged end.
fn constants(case: &Case) -> Value {
    let model = Model::of(&case.scenario).expect("the case is sound");
    let intruder = &model.intruders()[0];
    let oscillator = intruder.oscillator;
    json!({
        "name": case.name,
        "stiffness": (1..model.bodies()).map(|j| model.contact(j).stiffness).collect::<Vec<_>>(),
        "viscosity": 1.5 * model.contact(2).relaxation,
        "inverse": inverse_masses(&model),
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

/// Least seconds of the simulator for a case or for the ensemble.
fn own_seconds(
    name: &str,
    cases: &[Case],
    accuracies: &[Option<Accuracy>],
    chains: &[Scenario],
) -> Option<f64> {
    let Some((case, accuracy)) = cases.iter().zip(accuracies).find(|(case, _)| case.name == name) else {
        return Some(ours::least_seconds(10, || ensemble::alone(chains)));
    };
    let accuracy = (*accuracy)?;
    Some(ours::least_seconds(10, || ours::end(&case.scenario, accuracy)))
}

/// Times the solver, and the simulator right after it. `accuracies` are those that the simulator needs for
/// the error allowed, case by case.
///
/// # Errors
/// Python or its packages are not installed.
pub(crate) fn rows(cases: &[Case], accuracies: &[Option<Accuracy>]) -> Result<Vec<Foreign>, String> {
    let chains = ensemble::scenarios(CHAINS);
    let wanted = json!({
        "cases": cases.iter().map(constants).collect::<Vec<_>>(),
        "ensemble": chains.iter().map(chain).collect::<Vec<_>>(),
    });
    let python = std::env::var_os("BEAD_PYTHON").unwrap_or_else(|| "python3".into());
    let failed = |error: std::io::Error| format!("cannot run {}: {error}", python.display());
    let mut child = Command::new(&python)
        .arg(SCRIPT)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .map_err(failed)?;
    let mut input = child.stdin.take().ok_or("no pipe to Python")?;
    writeln!(input, "{wanted}").map_err(failed)?;
    drop(input);
    let output = child.wait_with_output().map_err(failed)?;
    if !output.status.success() {
        return Err(format!(
            "{SCRIPT} ended with an error: pip install numpy jax diffrax"
        ));
    }
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    let mut rows = Vec::new();
    for line in printed.lines() {
        let mut row: Foreign =
            serde_json::from_str(line).map_err(|error| format!("{SCRIPT} printed {line:?}: {error}"))?;
        row.conclude(own_seconds(&row.case, cases, accuracies, &chains), CHAINS);
        rows.push(row);
    }
    Ok(rows)
}
