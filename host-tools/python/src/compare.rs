//! Recordings beside simulated chains, as `bead compare` holds them.

use std::error::Error;
use std::sync::Arc;

use bead_compare::agreement::DECISION_RULE;
use bead_compare::bead::ComparedBead;
use bead_compare::emulated::RunTruth;
use bead_compare::row::{self, BeadRow, RowChain, among};
use bead_compare::sensed::{only_host, simulate_with_ring_down};
use bead_compare::strike::FullChain;
use bead_compare::verdict::Echoes;
use bead_recording::file::{Part, RecordedBead, Recording};
use hertz_chain::Scenario;

type Failure = Box<dyn Error + Send + Sync>;

/// Compares the bead asked for, or all beads of a row, with the chain of a scenario, by default that of the
/// recording. Returns JSON as `bead compare` prints it.
pub(crate) fn compared(
    file: &Recording,
    scenario: Option<Scenario>,
    asked: Option<usize>,
) -> Result<String, Failure> {
    let carried = file.parts.get(&Part::Scenario);
    let carried = carried.map(|text| String::from_utf8_lossy(text).into_owned());
    let (scenario, text) = match (scenario, carried) {
        (Some(scenario), _) => (scenario, None),
        (None, Some(text)) => {
            let scenario = Scenario::from_toml(&text, "the recording's scenario")?;
            (scenario, Some(text))
        }
        (None, None) => {
            let path = file.path.display();
            return Err(format!(
                "{path} carries no scenario; say what was struck: scenario=Scenario.load(…)"
            )
            .into());
        }
    };
    if file.beads.len() > 1 && asked.is_none() {
        return row_compared(file, scenario, text.as_deref());
    }
    bead_compared(file, &scenario, asked)
}

fn bead_compared(file: &Recording, scenario: &Scenario, asked: Option<usize>) -> Result<String, Failure> {
    let (file, place) = of_one(file, asked)?;
    let truth: Option<RunTruth> = file.json(Part::Truth)?;
    let bead = asked.or(truth.as_ref().map(|truth| truth.bead)).or(place);
    let bead = bead.map_or_else(|| only_host(scenario), Ok)?;
    let echoes = Echoes::of(scenario, truth);
    let solution = Arc::new(simulate_with_ring_down(scenario)?);
    let chain = FullChain::of(scenario, &solution, bead)?;
    let compared = ComparedBead::read(&file, &chain, echoes, None, |_, _| ())?;
    let result = serde_json::json!({
        "bead": bead,
        "strikes": compared.strikes,
        "pass": compared.failure.is_none(),
        "failure": compared.failure,
        "decision_rule": DECISION_RULE,
    });
    Ok(result.to_string())
}

/// The recording of one bead, and its place if the recording knows it.
fn of_one(file: &Recording, asked: Option<usize>) -> Result<(Recording, Option<usize>), Failure> {
    let places: Vec<usize> = file.beads.iter().map(RecordedBead::place).collect();
    match (&places[..], asked) {
        ([], _) => Ok((file.clone(), None)),
        ([place], None) => Ok((file.of(&file.beads[0]), Some(*place))),
        (_, asked) => {
            let at = asked.and_then(|asked| places.iter().position(|place| *place == asked));
            let at = at.ok_or_else(|| {
                let path = file.path.display();
                format!("{path} has the beads {places:?}; give bead= one of them")
            })?;
            Ok((file.of(&file.beads[at]), asked))
        }
    }
}

fn row_compared(file: &Recording, scenario: Scenario, text: Option<&str>) -> Result<String, Failure> {
    let chain = RowChain::of(scenario)?;
    let (places, notes) = among(file, &chain, text);
    if places.is_empty() {
        let (path, why) = (file.path.display(), notes.join("; "));
        return Err(format!("{path}: none of its beads is in this scenario: {why}").into());
    }
    let row = BeadRow::read(file, &places, &chain, None)?;
    if row.strikes.is_empty() {
        return Err(format!("{} has no strike", file.path.display()).into());
    }
    let compared = row::compare(&row, &chain, notes)?;
    Ok(serde_json::to_string(&compared)?)
}
