//! The report of a row.

use hertz_chain::TransmissionFit;
use hertz_charts::Chart;

use crate::agreement::DECISION_RULE;
use crate::report::{
    Chapter, DASH, EnergyUnit, Fact, Grid, GridCell, Passage, Report, count, number, percent, percent_within,
    signed,
};
use crate::row::arrivals::Speed;
use crate::row::chain::RowChain;
use crate::row::compare::RowComparison;
use crate::row::energy::{After, EnergyAlong};
use crate::row::later::Wave;
use crate::row::member::{BeadOfRow, DeviceAndChain};
use crate::row::pictures::charts;
use crate::row::strikes::BeadRow;
use crate::spread::Spread;
use crate::verdict::passed;

/// A compared row, and the facts of its run.
pub struct ComparedRow<'a> {
    /// The recording's name.
    pub recording: &'a str,
    /// The beads' strikes.
    pub row: &'a BeadRow,
    /// The chain that they are compared with.
    pub chain: &'a RowChain,
    /// The comparison.
    pub compared: &'a RowComparison,
    /// The striker's velocity in words, if it was fitted.
    pub velocity: Option<String>,
    /// Command, versions and date of the report.
    pub made: &'a [Fact],
    /// The scenario, as its author wrote it.
    pub scenario: &'a str,
}

impl ComparedRow<'_> {
    /// The report.
    pub fn report(&self) -> Report {
        let compared = self.compared;
        let title = &self.chain.scenario.title[..];
        let strikes = count(compared.strikes as u64, "strike");
        let missing = Chapter::new("What is missing").with([Passage::List(compared.notes.clone())]);
        let [overview, details] = charts(self.row, self.chain, compared);
        let intruders = "Their accelerations, and the part of the wave’s energy that each lets pass.";
        let sections = [
            (!compared.notes.is_empty()).then_some(missing),
            Some(self.wave(overview)),
            Some(self.beads()),
            Some(Chapter::new("All beads").table(self.totals())),
            Some(Chapter::new("Speed of the wave").table(self.speeds())),
            self.later(),
            energy(&compared.energy),
            Some(Chapter::new("The intruders").text(intruders).chart(details)),
            Some(self.facts()),
            Some(Chapter::scenario(self.scenario)),
        ];
        Report {
            above: format!("{} beads, {strikes} · {}", compared.beads.len(), self.recording),
            title: if title.is_empty() { "A row of beads" } else { title }.to_owned(),
            verdict: compared.failure.clone().map_or(
                Ok(passed(compared.beads.iter().flat_map(|bead| &bead.spread))),
                Err,
            ),
            tiles: self.tiles(),
            sections: sections.into_iter().flatten().collect(),
        }
    }

    fn tiles(&self) -> Vec<(String, String)> {
        let compared = self.compared;
        let is_same = |bead: &&BeadOfRow| bead.replay_identical == Some(true);
        let identical = compared.beads.iter().filter(is_same).count();
        let identical = format!("{identical} of {}", compared.beads.len());
        let worst = |which: usize| {
            let spreads = compared.beads.iter().filter_map(|bead| bead.spread.get(which));
            let worst = spreads.max_by(|a, b| a.mean.abs().total_cmp(&b.mean.abs()));
            worst.map_or(DASH.to_owned(), |worst| percent(worst.mean))
        };
        let fit = |fit: Option<TransmissionFit>| {
            fit.map_or(DASH.to_owned(), |fit| format!("{:.5}", fit.transmission))
        };
        let rms = compared.arrivals.off_rms_s;
        let rms = rms.map_or(DASH.to_owned(), |rms| format!("{:.2} µs", rms * 1e6));
        let in_simulation = fit(compared.energy.fit.f64_chain);
        let transmission = format!("T of an intruder, by the beads’ A; {in_simulation} in the simulation");
        vec![
            (fit(compared.energy.fit.by_a), transmission),
            (worst(0), "A, where it is furthest off".to_owned()),
            (worst(1), "B, where it is furthest off".to_owned()),
            (rms, "arrivals off the simulation, rms".to_owned()),
            (identical, "beads replayed bit for bit".to_owned()),
        ]
    }

    fn wave(&self, chart: Chart) -> Chapter {
        let text = "Green is what the beads sensed, each at its place in the chain, on the common time of their sync edges. The \
                    grey below is the simulation. The energy left after n intruders is the energy that came to the first \
                    bead, less the energy that the beads measured in their intruders.";
        Chapter::new("The wave along the row").text(text).chart(chart)
    }

    fn beads(&self) -> Chapter {
        let compared = self.compared;
        let text = "The wave arrives when the force has risen to half its height. Goals: A within 0.2 % of the simulation, B \
                    within 0.5 %, or more where a note says that the chain is unlike the reduced one, and every bit replayed.";
        let more: usize = compared.beads.iter().map(|bead| bead.strikes_left_out).sum();
        let more = (more > 0).then(|| {
            let more = count(more as u64, "strike");
            format!("{more}, beyond those kept for each bead, count only in its means and in the verdict")
        });
        let rms = compared.arrivals.off_rms_s;
        let velocity = self.velocity.as_ref();
        let mut section = Chapter::new("Each bead")
            .text(text)
            .line(Some(format!("decision rule: {DECISION_RULE}")))
            .table(self.table_of_beads())
            .line(more)
            .line(rms.map(|rms| format!("arrivals are off by {:.3} µs rms", rms * 1e6)))
            .line(velocity.map(|velocity| format!("striker's velocity: {velocity}")));
        for bead in &compared.beads {
            let difference = bead
                .first_difference
                .as_ref()
                .or(bead.incomplete.as_ref())
                .cloned();
            section = section.with(difference.map(Passage::Failure));
            if !bead.flags.is_empty() {
                section = section.text(format!("Bead {} has flags: {}", bead.bead, bead.flags.join(", ")));
            }
        }
        section
    }

    fn table_of_beads(&self) -> Grid {
        let compared = self.compared;
        let energies = |of: fn(&BeadOfRow) -> Option<DeviceAndChain>| {
            EnergyUnit::of(compared.beads.iter().filter_map(of).map(|pair| pair.device))
        };
        let wave = energies(|bead| bead.incident);
        let a = energies(|bead| bead.absorbed_measured);
        let b = energies(|bead| bead.absorbed_predicted);
        let row = |bead: &BeadOfRow| {
            let arrival = compared.arrivals.at(bead.bead);
            let flags = Some(bead.flags.join(", ")).filter(|flags| !flags.is_empty());
            let replay = bead.replay_identical;
            let same = replay.map(|same| if same { "identical" } else { "differs" }.to_owned());
            let mut row = vec![
                bead.bead.to_string().into(),
                format!("{} of {}", bead.strikes - bead.strikes_left_out, compared.strikes).into(),
                GridCell::known(arrival.map(|arrival| format!("{:.5}", arrival.device_s * 1e3))),
                GridCell::known(arrival.map(|arrival| format!("{} µs", signed(arrival.off_s * 1e6, 2)))),
            ];
            row.extend(pair(bead.peak_force, 1.0, 4));
            row.extend(pair(bead.width, 1e6, 2));
            row.extend(pair(bead.incident, wave.scale, 3));
            row.push(pair(bead.absorbed_measured, a.scale, 2)[0].clone());
            row.extend(judged(bead.spread.first()));
            row.push(pair(bead.absorbed_predicted, b.scale, 2)[0].clone());
            row.extend(judged(bead.spread.get(1)));
            row.extend([GridCell::known(same), GridCell::known(flags)]);
            row
        };
        let [wave, a, b] = [wave, a, b].map(|unit| unit.symbol);
        let headings = format!(
            "bead | ^strikes | arrival (ms) | off by | peak (N) | ~off by | width (µs) | ~off by | ^wave ({wave}) | ^off by \
             | ^A ({a}) | A off by | ^±0.2 % | ^B ({b}) | B off by | ^±0.5 % | ~replay | ^flags"
        );
        Grid::new(&headings, compared.beads.iter().map(row))
    }

    fn totals(&self) -> Grid {
        let sum = |of: fn(&BeadOfRow) -> u64| self.compared.beads.iter().map(of).sum::<u64>().to_string();
        let beads = self.compared.beads.iter();
        let costs = beads.filter_map(|bead| bead.instructions_per_sample);
        let most = costs.reduce(f64::max).map(|most| format!("{most:.1}"));
        let rows = [
            ("frames lost", Some(sum(|bead| bead.frames_lost))),
            ("frames corrupt", Some(sum(|bead| bead.frames_corrupt))),
            ("overruns", Some(sum(|bead| bead.overruns))),
            ("instructions a sample, at most", most),
        ];
        let row = |(name, value): (&str, Option<String>)| Some(vec![name.into(), value?.into()]);
        Grid::new("all beads |", rows.into_iter().filter_map(row))
    }

    fn speeds(&self) -> Grid {
        let row = |speed: &Speed| {
            let between = format!("{} to {}", speed.from, speed.to);
            let [device, chain] = [speed.device, speed.f64_chain].map(|speed| format!("{speed:.3}"));
            let cells = [between, device, chain, percent(speed.off())];
            cells.map(GridCell::from).into()
        };
        let headings = "from bead | wave (m/s) | f64 chain (m/s) | off by";
        Grid::new(headings, self.compared.arrivals.speeds.iter().map(row))
    }

    fn later(&self) -> Option<Chapter> {
        let cells = |wave: Option<Wave>| {
            [
                GridCell::known(wave.map(|wave| number(wave.peak_force * 1e3, 1))),
                GridCell::known(wave.map(|wave| number(wave.after * 1e3, 3))),
            ]
        };
        let row = |bead: &BeadOfRow| {
            let later = bead.later_wave?;
            let mut row = vec![bead.bead.to_string().into()];
            row.extend([later.device, later.f64_chain].into_iter().flat_map(cells));
            Some(row)
        };
        let headings = "later wave at bead | peak (mN) | ~after (ms) | f64 chain (mN) | ~after (ms)";
        let table = Grid::new(headings, self.compared.beads.iter().filter_map(row));
        let text = "The strongest wave after the main one, where there is one.";
        (!table.rows.is_empty()).then(|| Chapter::new("Later waves").text(text).table(table))
    }

    fn facts(&self) -> Chapter {
        let sum = |of: fn(&BeadOfRow) -> u64| self.compared.beads.iter().map(of).sum::<u64>();
        let (lost, refused) = (sum(|bead| bead.frames_lost), sum(|bead| bead.frames_corrupt));
        let frames = ("frames", format!("{lost} lost, {refused} refused"));
        Chapter::facts("The run", self.made.iter().cloned().chain([frames]))
    }
}

fn pair(pair: Option<DeviceAndChain>, scale: f64, digits: usize) -> [GridCell; 2] {
    [
        GridCell::known(pair.map(|pair| number(pair.device * scale, digits))),
        GridCell::known(pair.map(|pair| percent(pair.off()))),
    ]
}

/// The deviation of an estimate, and whether its goals are met.
fn judged(spread: Option<&Spread>) -> [GridCell; 2] {
    let met = spread
        .filter(|spread| spread.goal.is_some())
        .map(|spread| spread.pass);
    let off = spread.map(|spread| percent_within(spread.mean, spread.uncertainty));
    [
        GridCell::judged(off.unwrap_or(DASH.to_owned()), met),
        GridCell::verdict(met),
    ]
}

/// The energy along the row; `None` where no wave came to it.
fn energy(energy: &EnergyAlong) -> Option<Chapter> {
    let (incident, at) = (energy.incident?, energy.incident_at?);
    let row = |after: &After| {
        let mut row = vec![
            after.n.to_string().into(),
            GridCell::known(after.bead.map(|bead| bead.to_string())),
        ];
        row.extend(after.left.each().map(|left| number(left * 100.0, 3).into()));
        let through = after.transmission.map_or([None; 4], |through| through.each());
        row.extend(through.map(|through| GridCell::known(through.map(|through| number(through, 5)))));
        row
    };
    let mut fit: Vec<GridCell> = vec!["Tⁿ".into()];
    fit.resize(6, "".into());
    let shown = |fit: TransmissionFit| format!("{:.5} ± {:.5}", fit.transmission, fit.uncertainty);
    fit.extend(energy.fit.each().map(|fit| GridCell::known(fit.map(shown))));
    // A narrow window shows only the two sides that are compared.
    let headings =
        "n | ~bead | E(n), % by A | ~by B | f64 chain | ~rows of n | T by A | ~by B | f64 chain | ~rows of n";
    let table = Grid::new(headings, energy.after.iter().map(row).chain([fit]));
    let by = if energy.incident_by == "bead" {
        "by its own force"
    } else {
        "by the simulation, as its own force is not fully known"
    };
    let unit = EnergyUnit::of([incident.device, incident.f64_chain]);
    let [device, f64_chain] = [incident.device, incident.f64_chain].map(|joules| unit.number(joules, 3));
    let symbol = unit.symbol;
    let line = format!(
        "energy of the wave at bead {at}: {device} {symbol} {by}, {f64_chain} {symbol} in the f64 chain"
    );
    let text = "E(n) is the energy of the wave at the first bead, less what each bead measured, by A and by B; the column f64 \
                chain is the same sum in the simulation of this row. Rows of n is the paper’s Fig. 5: for each n a chain with \
                n intruders, and the energy that it has at the end. Heavy intruders send waves back to those before them, and \
                then these two columns differ. The line through ln E(n) gives one T for all; its standard error, after ±, \
                comes from the distance of the energies from the line.";
    let section = Chapter::new("Energy after n intruders");
    Some(section.text(text).table(table).line(Some(line)))
}
