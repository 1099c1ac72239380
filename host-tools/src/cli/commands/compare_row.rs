//! `bead compare` of a recording of several beads: all of them and one simulation, side by side.

use std::path::Path;

use hertz_chain::Scenario;
use rayon::prelude::*;
use serde::Serialize;

use crate::bench::sensed::unlike_the_reduced_chain;
use crate::cli::commands::compared::{Velocity, echoes_left_out, scenario, shown};
use crate::cli::failure::Failure;
use crate::cli::output::{self, Format};
use crate::cli::place::{self, Kind, Overwrite};
use crate::cli::provenance;
use crate::comparison::row::{
    self, After, Arrival, BeadOfRow, Chain, Member, Page, Pair, Place, Row, RowComparison, Speed, Wave, among,
};
use crate::comparison::spread::Spread;
use crate::comparison::strike::FullChain;
use crate::comparison::velocity::{self, FittedVelocity};
use crate::comparison::verdict::{Echoes, other_length};
use crate::recording::clock::CommonTime;
use crate::recording::file::Part;
use crate::recording::received::Received;
use crate::tables::whole::Target;

/// What is to be made of a recording.
pub(super) struct Wanted<'a> {
    /// The scenario that is given.
    pub scenario: Option<&'a Path>,
    pub velocity: Option<Velocity>,
    pub report: Option<Target>,
    /// Where the figures go.
    pub figures: Option<&'a Path>,
    /// The files that are read.
    pub inputs: &'a [&'a Path],
    pub overwrite: Overwrite,
    pub format: Format,
}

/// The result, as in the JSON.
#[derive(Serialize, schemars::JsonSchema)]
pub(crate) struct Report<'a> {
    striker_velocity: Option<FittedVelocity>,
    #[serde(flatten)]
    told: &'a RowComparison,
}

pub(super) fn run(received: &Received, wanted: &Wanted<'_>) -> Result<(), Failure> {
    let figures = wanted.figures.map(|directory| {
        let names = ["row.svg", "row-details.svg"].map(|name| (name, Kind::Drawing));
        place::targets(directory, names, wanted.inputs, wanted.overwrite)
    });
    let figures = figures.transpose()?;
    let (scenario, text) = scenario(wanted.scenario, received)?;
    let progress = output::spinner(format!("simulating {} beads", scenario.chain.beads));
    let mut chain = Chain::of(scenario)?;
    let (places, mut notes) = among(received, &chain, &text);
    if places.is_empty() {
        return Err(Failure::input(format!(
            "{}: none of its beads is of this scenario: {}",
            received.path.display(),
            notes.join("; ")
        )));
    }
    let fitted = set_velocity(&mut chain, wanted.velocity, &places)?;
    // The energy goes with the square of the velocity.
    let truth = fitted.map_or(0.0, |fit| 2.0 * fit.uncertainty / fit.velocity);
    let time = CommonTime::of(&received.recording)?;
    progress.set_message(format!("comparing {} beads", places.len()));
    let read = |place: &Place| -> Result<Member, Failure> {
        let full = FullChain::of(&chain.scenario, &chain.solution, place.bead)?;
        let echoes = echoes(&chain.scenario, place)?;
        Ok(Member::read(
            place.bead,
            &place.received,
            full,
            &time,
            truth,
            echoes,
        )?)
    };
    let members: Vec<_> = places.par_iter().map(read).collect();
    let row = Row::of(members.into_iter().collect::<Result<_, _>>()?);
    progress.finish_and_clear();
    if row.strikes.is_empty() {
        let mut heard = received.strikes()?;
        heard.by_ref().for_each(drop);
        return Err(received.no_strike(heard.frames()).into());
    }
    notes.extend(echoed(&row));
    let told = row::compare(&row, &chain, notes)?;
    let warnings = places
        .iter()
        .filter_map(|place| unlike_the_reduced_chain(&chain.solution, place.bead));
    let mut warnings: Vec<_> = warnings.collect();
    // A load is that of all.
    warnings.dedup();
    for note in warnings
        .into_iter()
        .chain(length(&row, &chain))
        .chain(told.notes.iter().cloned())
    {
        output::note(format_args!("{note}"));
    }

    if let Some(report) = &wanted.report {
        let mut made = provenance::made(&received.path, provenance::scenario(&text))?;
        made.extend(fitted.map(|fitted| ("striker's velocity", shown(&fitted))));
        let page = Page {
            recording: &received.path.file_name().unwrap_or_default().to_string_lossy(),
            row: &row,
            chain: &chain,
            told: &told,
            made: &made,
            scenario: &text,
        };
        report.write_bytes(page.html()?)?;
    }
    if let Some((directory, figures)) = wanted.figures.zip(figures) {
        place::make_directory(directory)?;
        let charts = [
            row::overview(&row, &chain, &told),
            row::details(&row, &chain, &told),
        ];
        for (figure, chart) in figures.iter().zip(charts) {
            figure.write_bytes(chart.standalone_svg()?)?;
        }
    }
    let printed = Report {
        striker_velocity: fitted,
        told: &told,
    };
    output::print(wanted.format, &printed, || table(&told, fitted.as_ref()))?;
    told.failure.map_or(Ok(()), |what| Err(Failure::Verdict(what)))
}

/// A warning where the scenario's duration is not that of the windows: of the first bead, and for how many it
/// holds.
fn length(row: &Row, chain: &Chain) -> Option<String> {
    let of = |member: &Member| {
        let Member { bead, window, .. } = member;
        other_length(&chain.scenario, &chain.solution, &member.chain, *bead, (*window)?)
    };
    let mut notes = row.members.iter().filter_map(of);
    let first = notes.next()?;
    Some(match notes.count() {
        0 => first,
        more => format!("{first} (beads that are concerned: {})", more + 1),
    })
}

/// What tells the echoes of a bead.
fn echoes(scenario: &Scenario, place: &Place) -> Result<Echoes, Failure> {
    Ok(Echoes::of(scenario, place.received.json(Part::Truth)?))
}

/// The echoes of a row, if there are any.
fn echoed(row: &Row) -> Option<String> {
    let of = |member: &Member| match member.echoes {
        0 => None,
        count => Some(format!("{count} of bead {}", member.bead)),
    };
    let which: Vec<_> = row.members.iter().filter_map(of).collect();
    (!which.is_empty()).then(|| echoes_left_out(&which.join(", ")))
}

/// Gives the striker the velocity that is wanted: of those that the beads' forces tell, the first bead's.
fn set_velocity(
    chain: &mut Chain,
    velocity: Option<Velocity>,
    places: &[Place],
) -> Result<Option<FittedVelocity>, Failure> {
    let mut scenario = chain.scenario.clone();
    let fitted = match velocity {
        None => return Ok(None),
        Some(Velocity::Given(velocity)) => {
            scenario.striker.velocity = velocity;
            None
        }
        Some(Velocity::Fit) => {
            let (mut fitted, mut failed) = (None, None);
            for place in places {
                let strikes = velocity::first_strikes(place.received.strikes()?, echoes(&scenario, place)?);
                if strikes.is_empty() {
                    continue;
                }
                match velocity::fit(&scenario, place.bead, &strikes) {
                    Ok(found) => {
                        fitted = Some(found);
                        break;
                    }
                    Err(why) => failed = failed.or(Some(why)),
                }
            }
            match (fitted, failed) {
                (Some(fitted), _) => scenario.striker.velocity = fitted.velocity,
                (None, Some(why)) => return Err(why.into()),
                (None, None) => {}
            }
            fitted
        }
    };
    *chain = Chain::of(scenario)?;
    Ok(fitted)
}

fn table(told: &RowComparison, fitted: Option<&FittedVelocity>) -> String {
    let mut parts = vec![beads(told), received(told)];
    parts.extend(speeds(told));
    parts.extend(later(told));
    parts.extend(energy(told));
    parts.extend(fitted.map(|fitted| format!("striker's velocity: {}", shown(fitted))));
    parts.join("\n\n")
}

/// Nothing known.
fn dash() -> String {
    "-".to_owned()
}

fn percent(part: f64) -> String {
    format!("{:+.3} %", part * 100.0)
}

/// The bead's value, and how far it is off.
fn pair(pair: Option<Pair>, scale: f64, digits: usize) -> [String; 2] {
    match pair {
        None => [dash(), dash()],
        Some(pair) => [format!("{:.digits$}", pair.device * scale), percent(pair.off())],
    }
}

/// How far an estimate is off, and whether its goal is met.
fn judged(spread: Option<&Spread>) -> [String; 2] {
    let Some(spread) = spread else {
        return [dash(), dash()];
    };
    let off = match spread.uncertainty {
        None => percent(spread.mean),
        Some(within) => format!("{:+.3} ± {:.3} %", spread.mean * 100.0, within * 100.0),
    };
    [off, output::either(spread.pass, "met", "missed")]
}

fn beads(told: &RowComparison) -> String {
    let row = |bead: &BeadOfRow| {
        let arrival = told.arrivals.at(bead.bead);
        let mut row = vec![
            bead.bead.to_string(),
            format!("{} of {}", bead.strikes - bead.strikes_left_out, told.strikes),
            arrival.map_or_else(dash, |Arrival { device_s, .. }| format!("{:.5}", device_s * 1e3)),
            arrival.map_or_else(dash, |Arrival { off_s, .. }| format!("{:+.2} µs", off_s * 1e6)),
        ];
        row.extend(pair(bead.peak_force, 1.0, 4));
        row.extend(pair(bead.width, 1e6, 2));
        row.extend(pair(bead.incident, 1e6, 3));
        row.extend(pair(bead.absorbed_measured, 1e9, 2).into_iter().take(1));
        row.extend(judged(bead.spread.first()));
        row.extend(pair(bead.absorbed_predicted, 1e9, 2).into_iter().take(1));
        row.extend(judged(bead.spread.get(1)));
        let replay = bead.replay_identical;
        row.push(replay.map_or_else(dash, |same| output::either(same, "identical", "differs")));
        row.push(output::either(bead.flags.is_empty(), "-", &bead.flags.join(", ")));
        row
    };
    let header = "bead | strikes | arrival (ms) | off by | peak (N) | off by | width (µs) | off by | wave (µJ) | off by | A (nJ) | off by | ±0.2 % \
                  | B (nJ) | off by | ±0.5 % | replay | flags";
    let mut text = output::table(header, told.beads.iter().map(row));
    let more = told.beads.iter().map(|bead| bead.strikes_left_out).sum::<usize>();
    if more > 0 {
        text += &format!(
            "\n{more} strikes, after the first of each bead, are only in its means and in the verdict"
        );
    }
    if let Some(rms) = told.arrivals.off_rms_s {
        text += &format!("\narrivals are off by {:.3} µs rms", rms * 1e6);
    }
    text
}

/// What was lost, in all.
fn received(told: &RowComparison) -> String {
    let sum = |of: fn(&BeadOfRow) -> u64| told.beads.iter().map(of).sum::<u64>();
    let most = told.beads.iter().filter_map(|bead| bead.instructions_per_sample);
    let most = most.fold(f64::NAN, f64::max);
    let mut rows = vec![
        ["frames lost".to_owned(), sum(|bead| bead.frames_lost).to_string()],
        [
            "frames corrupt".to_owned(),
            sum(|bead| bead.frames_corrupt).to_string(),
        ],
        ["overruns".to_owned(), sum(|bead| bead.overruns).to_string()],
    ];
    if most.is_finite() {
        rows.push(["instructions a sample, at most".to_owned(), format!("{most:.1}")]);
    }
    output::table("all beads |", rows)
}

fn speeds(told: &RowComparison) -> Option<String> {
    let row = |speed: &Speed| {
        [
            format!("{} to {}", speed.from, speed.to),
            format!("{:.3}", speed.device),
            format!("{:.3}", speed.f64_chain),
            percent(speed.off()),
        ]
    };
    let speeds = &told.arrivals.speeds;
    (!speeds.is_empty()).then(|| {
        output::table(
            "from bead | wave (m/s) | f64 chain | off by",
            speeds.iter().map(row),
        )
    })
}

fn later(told: &RowComparison) -> Option<String> {
    let cells = |wave: Option<Wave>| match wave {
        None => [dash(), dash()],
        Some(wave) => [
            format!("{:.1}", wave.peak_force * 1e3),
            format!("{:.3}", wave.after * 1e3),
        ],
    };
    let rows: Vec<_> = told
        .beads
        .iter()
        .filter_map(|bead| {
            let [device, chain] = bead
                .later_wave
                .map(|wave| [wave.device, wave.f64_chain].map(cells))?;
            let mut row = vec![bead.bead.to_string()];
            row.extend(device);
            row.extend(chain);
            Some(row)
        })
        .collect();
    let header = "later wave at bead | peak (mN) | after (ms) | f64 chain (mN) | after (ms)";
    (!rows.is_empty()).then(|| output::table(header, rows))
}

fn energy(told: &RowComparison) -> Option<String> {
    let energy = &told.energy;
    let incident = energy.incident?;
    let row = |after: &After| {
        let mut row = vec![
            after.n.to_string(),
            after.bead.map_or_else(dash, |bead| bead.to_string()),
        ];
        row.extend(after.left.each().map(|left| format!("{:.3}", left * 100.0)));
        let through = after.transmission.map(|through| through.each());
        let cell = |through: Option<f64>| through.map_or_else(dash, |through| format!("{through:.5}"));
        row.extend(through.map_or([(); 4].map(|()| dash()), |through| through.map(cell)));
        row
    };
    let mut rows: Vec<_> = energy.after.iter().map(row).collect();
    let mut fit = vec!["Tⁿ".to_owned()];
    fit.resize(6, String::new());
    fit.extend(energy.fit.each().map(|fit| match fit {
        None => dash(),
        Some(fit) => format!("{:.5} ± {:.5}", fit.transmission, fit.uncertainty),
    }));
    rows.push(fit);
    let header =
        "n | bead | E(n), % by A | by B | f64 chain | rows of n | T by A | by B | f64 chain | rows of n";
    let by = match energy.incident_by {
        "bead" => "by its own force",
        _ => "of the simulation",
    };
    Some(format!(
        "{}\nenergy of the wave at bead {}: {:.3} µJ {by}, {:.3} µJ in the f64 chain",
        output::table(header, rows),
        energy.incident_at.unwrap_or_default(),
        incident.device * 1e6,
        incident.f64_chain * 1e6,
    ))
}
