//! Solvers of Python on the same cases, in a process of their own: `peers.py`.

use std::io::Write;
use std::process::{Command, Stdio};

use hertz_chain::Model;
use serde_json::{Value, json};

use crate::cases::Case;
use crate::report::Foreign;

const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/peers.py");

/// The constants of a case's equations of motion, in SI units, and its converged end.
fn constants(case: &Case) -> Value {
    let model = Model::of(&case.scenario).expect("the case is sound");
    let intruder = &model.intruders()[0];
    let oscillator = intruder.oscillator;
    let shell = |body: usize| model.mass(body) - if body == intruder.bead { oscillator.mass } else { 0.0 };
    json!({
        "name": case.name,
        "stiffness": (1..model.bodies()).map(|j| model.contact(j).stiffness).collect::<Vec<_>>(),
        "viscosity": 1.5 * model.contact(2).relaxation,
        "inverse": (0..model.bodies()).map(|body| 1.0 / shell(body)).collect::<Vec<_>>(),
        "host": intruder.bead,
        "oscillator": [oscillator.mass, oscillator.stiffness, oscillator.damping],
        "speed": model.striker_speed(),
        "duration": case.scenario.duration,
        "end": case.end,
    })
}

/// Times the solvers that are installed.
pub(crate) fn rows(cases: &[Case]) -> Result<Vec<Foreign>, String> {
    let python = std::env::var_os("BEAD_PYTHON").unwrap_or_else(|| "python3".into());
    let started = Command::new(&python)
        .arg(SCRIPT)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn();
    let mut child = started.map_err(|error| format!("cannot start {}: {error}", python.display()))?;
    let text = Value::from(cases.iter().map(constants).collect::<Vec<_>>()).to_string();
    let mut stdin = child.stdin.take().expect("it has just been piped");
    // A Python that ends at once says why itself.
    let _ = stdin.write_all(text.as_bytes());
    drop(stdin);
    let output = child.wait_with_output().map_err(|error| error.to_string())?;
    if !output.status.success() {
        return Err("the script failed; it needs numpy (pip install numpy scipy numba)".to_owned());
    }
    serde_json::from_slice(&output.stdout).map_err(|error| error.to_string())
}
