//! The report of a bead's strikes against the simulation.

use std::collections::BTreeSet;

use bead_model::settings::Settings;
use bead_wire::{Counters, Identity, SettingsSource, Status};

use crate::agreement::{DECISION_RULE, agrees};
use crate::bead::ComparedBead;
use crate::emulated::EmulatorReport;
use crate::energy_uncertainties::EnergyUncertainties;
use crate::goal::StrikeGoal;
use crate::quantities::{DEVICE, QUANTITIES, StrikeQuantity, energy_unit};
use crate::replay::ReplayWord;
use crate::report::{
    Chapter, DASH, EnergyUnit, Fact, Grid, GridCell, Medium, Passage, Report, count, energy, percent,
    percent_within,
};
use crate::statistics;
use crate::strike::StrikeComparison;
use crate::verdict::passed;
use bead_recording::json::hex;

/// A bead's compared strikes, and the facts of their run.
#[derive(Debug)]
pub struct ComparedStrikes<'a> {
    /// The scenario's title.
    pub title: &'a str,
    /// The recording's name.
    pub recording: &'a str,
    /// The bead that sensed.
    pub bead: usize,
    /// Its strikes: one at least.
    pub compared: &'a ComparedBead,
    /// The striker's velocity in words, if it was fitted.
    pub velocity: Option<String>,
    /// Command, versions and date of the report.
    pub made: &'a [Fact],
    /// The scenario, as its author wrote it.
    pub scenario: &'a str,
}

/// Greatest number of strikes that are all shown in full. Of more, the page shows the first, the worst and
/// the first that failed.
const IN_FULL: usize = 3;
/// Greatest number of strikes with a line each.
const LINES: usize = 1000;

impl ComparedStrikes<'_> {
    /// The report.
    pub fn report(&self) -> Report {
        let title = Some(self.title).filter(|title| !title.is_empty());
        let sections = [
            statistics::section(&self.compared.strikes, &self.compared.spread),
            Some(self.agreement()),
            Some(self.checks()),
            self.pictures(),
            self.compared.emulator.as_ref().map(cost),
            Some(self.facts()),
            self.log(),
            Some(Chapter::scenario(self.scenario)),
        ];
        let failure = self.compared.failure.clone();
        Report {
            above: format!("Bead {} · {}", self.bead, self.recording),
            title: title.unwrap_or("A strike").to_owned(),
            verdict: failure.map_or(Ok(passed(&self.compared.spread)), Err),
            tiles: self.tiles(),
            sections: sections.into_iter().flatten().collect(),
        }
    }

    fn tiles(&self) -> Vec<(String, String)> {
        let Some(strike) = self.compared.strikes.first() else {
            return Vec::new();
        };
        let strikes = &self.compared.strikes;
        let identical = strikes.iter().filter(|strike| strike.replay_identical).count();
        let gone = self.compared.counters.lost + self.compared.counters.rejected.total();
        let frames = self.compared.counters.frames + self.compared.counters.lost;
        let [measured, predicted] = if strikes.len() > 1 {
            [
                "A, measured: mean of all strikes",
                "B, predicted: mean of all strikes",
            ]
        } else {
            ["A, measured by the acceleration", "B, predicted from the force"]
        };
        let [a, b] = self.compared.spread.each_ref().map(|spread| percent(spread.mean));
        let absorbed = energy(strike.f64_chain.absorbed_measured);
        let identical = format!("{identical} of {}", strikes.len());
        let tiles = [
            (absorbed, "absorbed, by the full simulation"),
            (a, measured),
            (b, predicted),
            (identical, "strikes replayed bit for bit"),
            (format!("{gone} of {frames}"), "frames lost or corrupt"),
        ];
        tiles.map(|(value, name)| (value, name.to_owned())).into()
    }

    /// Every strike beside the simulation: in full, or a line each if there are many.
    fn agreement(&self) -> Chapter {
        let text = "From right to left each column adds one source of error. The first adds sampling, twelve bits, noise and \
                    the reduced chain. The second adds fixed point. The last adds nothing: device and replay must agree in \
                    every bit.";
        let many = self.compared.strikes.len() > IN_FULL;
        let unit = energy_unit(&self.compared.strikes);
        let mut section = Chapter::new("Agreement").text(text);
        for at in self.in_full() {
            let strike = &self.compared.strikes[at];
            let (number, sample) = (strike.strike, strike.sample_index);
            let heading = format!("Strike {number}{}, sample {sample}", self.shown_as(at));
            let medium = if many { Medium::Page } else { Medium::Both };
            section = section.table(in_full(strike, unit).group(heading).on(medium));
            let difference = strike
                .first_difference
                .as_ref()
                .or(strike.replay_incomplete.as_ref());
            let difference = difference.cloned();
            section = section.with(difference.map(Passage::Failure));
        }
        if !many {
            return section;
        }
        let more = self.compared.strikes.len().saturating_sub(LINES);
        let more =
            (more > 0).then(|| format!("{more} more strikes: bead compare --format json has them all"));
        let folded = Passage::Folded {
            summary: "Every strike, a line each",
            open: false,
            content: vec![Passage::Grid(self.lines().on(Medium::Page))],
        };
        let lines = self.lines().on(Medium::Terminal);
        section.table(lines).with([folded]).line(more)
    }

    /// The reason why a strike among many is shown in full.
    fn shown_as(&self, at: usize) -> &'static str {
        let many = self.compared.strikes.len() > IN_FULL;
        match &self.compared.strikes[at] {
            strike if many && strike.replay_word == ReplayWord::Differs => ", whose replay differs",
            strike if many && !strike.replay_identical => ", whose replay is incomplete",
            _ if many && self.worst() == Some(at) => ", the furthest off",
            _ => "",
        }
    }

    fn in_full(&self) -> BTreeSet<usize> {
        let strikes = &self.compared.strikes;
        if strikes.len() <= IN_FULL {
            return (0..strikes.len()).collect();
        }
        let failed = strikes.iter().position(|strike| !strike.replay_identical);
        [Some(0), self.worst(), failed].into_iter().flatten().collect()
    }

    /// The place of the strike whose estimates are furthest off.
    fn worst(&self) -> Option<usize> {
        let off = |at: &usize| {
            let off = self.compared.strikes[*at].deviation;
            f64::max(off.absorbed_measured.abs(), off.absorbed_predicted.abs())
        };
        (0..self.compared.strikes.len()).max_by(|a, b| off(a).total_cmp(&off(b)))
    }

    fn lines(&self) -> Grid {
        let line = |strike: &StrikeComparison| {
            let off = strike.deviation;
            let (is_same, replay) = (strike.replay_identical, strike.replay_word.name());
            vec![
                strike.strike.to_string().into(),
                strike.sample_index.to_string().into(),
                percent(off.absorbed_measured).into(),
                percent(off.absorbed_predicted).into(),
                percent(off.peak_force).into(),
                GridCell::judged(replay, (!is_same).then_some(false)),
                GridCell::known(strike.conditions.map(|conditions| conditions.to_string())),
                strike.flags.join(", ").into(),
            ]
        };
        let headings = "strike | ~sample | A off by | B off by | peak off by | replay | ~supply | ~flags";
        Grid::new(headings, self.compared.strikes.iter().take(LINES).map(line))
    }

    /// The goals of several strikes, the checks of the run, and the reach of both.
    fn checks(&self) -> Chapter {
        let row = |name: String, found: String, goal: String, met: bool| {
            let (found, verdict) = (GridCell::judged(found, Some(met)), GridCell::verdict(Some(met)));
            vec![name.into(), found, goal.into(), verdict]
        };
        let mut rows = Vec::new();
        for spread in &self.compared.spread {
            let [goal, scatter_goal] = [spread.goal, Some(spread.scatter_goal)].map(goal_of);
            let mean = percent_within(spread.mean, spread.uncertainty);
            let estimate = spread.estimate;
            if let Some(scatter) = spread.scatter {
                let name = format!("{estimate}, mean of {}", count(spread.strikes as u64, "strike"));
                rows.push(row(name, mean, goal, spread.mean_met()));
                let name = format!("{estimate}, scatter (rms)");
                let scatter = format!("{:.3} %", scatter * 100.0);
                rows.push(row(name, scatter, scatter_goal, spread.scatter_met()));
            } else if !self.compared.strikes[0].alone {
                let name = format!("{estimate}, of one strike");
                rows.push(row(name, mean, goal, spread.mean_met()));
            }
        }
        let soundness = self.compared.soundness.rows().into_iter();
        rows.extend(soundness.map(|(name, found, goal, met)| row(name.to_owned(), found, goal, met)));
        let velocity = self.velocity.as_ref();
        let (all, shown) = (self.compared.count, self.compared.strikes.len());
        let left_out = (all > shown).then(|| {
            let more = count((all - shown) as u64, "strike");
            format!("{more} more than shown; means, scatter and the verdict are over all {all}")
        });
        Chapter::new("Checks")
            .table(Grid::new("check | found | goal |", rows))
            .line(Some(format!("decision rule: {DECISION_RULE}")))
            .line(velocity.map(|velocity| format!("striker's velocity: {velocity}")))
            .line(left_out)
    }

    fn pictures(&self) -> Option<Chapter> {
        let [strike_chart, residual_chart] =
            self.compared.strikes.iter().find_map(StrikeComparison::charts)?;
        let strike = "Each dot is one sample, turned back into its unit with the bead’s own calibration. Rings and discs are \
                      the running energies that the bead sent, one of each for a chunk of samples.";
        let residual = "What is left when the simulation is subtracted. For the sensors: noise, and the steps of the twelve \
                        bits. For the energies: the error of each estimate over time. f64 is the same estimate in floating \
                        point from the same samples.";
        let section = Chapter::new("The strike").text(strike).chart(strike_chart);
        Some(section.text(residual).chart(residual_chart))
    }

    fn facts(&self) -> Chapter {
        let facts = [
            self.made.to_vec(),
            self.compared.identity.as_ref().map_or_else(Vec::new, of_identity),
            self.compared.settings.as_ref().map_or_else(Vec::new, of_settings),
            self.received(),
            self.compared.status.as_ref().map_or_else(Vec::new, of_status),
            self.compared.emulator.as_ref().map_or_else(Vec::new, of_emulator),
        ];
        Chapter::facts("The run", facts.into_iter().flatten())
    }

    fn received(&self) -> Vec<Fact> {
        let noise = self.compared.strikes.first().map(|strike| {
            let noise = format!("{:.1} mN rms", strike.force_noise * 1e3);
            ("force noise before the strike", noise)
        });
        let Counters {
            frames,
            bytes,
            lost,
            rejected,
            ..
        } = self.compared.counters;
        let refused = rejected.total();
        let frames = format!("{frames} received in {bytes} bytes, {lost} lost, {refused} refused");
        noise.into_iter().chain([("frames", frames)]).collect()
    }

    fn log(&self) -> Option<Chapter> {
        let log = &self.compared.emulator.as_ref()?.log;
        (!log.is_empty())
            .then(|| Chapter::new("The image’s own log").with([Passage::Verbatim(log.join("\n"))]))
    }
}

/// A goal, `–` where the estimate is not judged.
fn goal_of(goal: Option<f64>) -> String {
    goal.map_or(DASH.to_owned(), |goal| format!("{:.1} %", goal * 100.0))
}

/// A strike by all four sources. One of several strikes has no goals: they are judged together.
fn in_full(strike: &StrikeComparison, unit: EnergyUnit) -> Grid {
    let (goals, allowance) = (
        strike.goal.each(),
        strike.noise_allowance.as_ref().map(StrikeGoal::each),
    );
    let row = |(place, quantity): (usize, &StrikeQuantity)| {
        let ((name, scale), digits) = (quantity.shown_in(unit), quantity.digits);
        let shown = |value: f64| format!("{:.digits$}", value * scale);
        let cells = quantity
            .values(strike)
            .map(|value| GridCell::known(value.map(shown)));
        let [mut device, mut replay, mut samples, chain] = cells;
        let u = strike
            .uncertainty
            .and_then(|of| of.each().get(place).copied().flatten());
        if let (Some(u), Some(value)) = (u, quantity.values(strike)[DEVICE]) {
            device = format!("{} ± {}", shown(value), shown(2.0 * u)).into();
        }
        if !quantity.has_four_sources() {
            (replay, samples) = ("".into(), "".into());
        }
        let off = quantity.off(strike);
        let goal = goals.get(place).filter(|_| strike.alone);
        let by_noise = allowance.and_then(|allowance| *allowance.get(place)?);
        let within = by_noise.or(quantity.bias);
        let is_met = |goal: f64| off.is_some_and(|off| agrees(off, goal, by_noise.unwrap_or(0.0)));
        let met = goal.copied().flatten().map(is_met);
        let off = off.map_or(DASH.to_owned(), |off| percent_within(off, within));
        let off = GridCell::judged(off, met);
        let goal = goal.map_or_else(String::new, |goal| goal_of(*goal));
        let mut cells = vec![name.into(), device, replay, samples, chain];
        cells.extend([off, goal.into(), GridCell::verdict(met)]);
        cells
    };
    let is_known =
        |(_, quantity): &(usize, &StrikeQuantity)| quantity.has_four_sources() || strike.shape.is_some();
    let known = QUANTITIES.iter().enumerate().filter(is_known);
    let mut rows: Vec<_> = known.map(row).collect();
    let replay = GridCell::judged(strike.replay_word.name(), Some(strike.replay_identical));
    rows.insert(3, vec!["bits of device and replay".into(), replay]);
    if let Some(conditions) = &strike.conditions {
        rows.push(vec!["supply, temperature".into(), conditions.to_string().into()]);
    }
    if let Some(legend) = EnergyUncertainties::legend(&strike.uncertainty) {
        rows.push(vec!["± of the device's energies".into(), legend.into()]);
    }
    if !strike.flags.is_empty() {
        rows.push(vec!["flags".into(), strike.flags.join(", ").into()]);
    }
    let headings = " | device | ~replay | ~f64, same samples | f64 chain | device off by | ~goal |";
    Grid::new(headings, rows)
}

fn cost(emulator: &EmulatorReport) -> Chapter {
    let available = emulator.instructions_available;
    let rows = emulator.instructions_per_sample.rows().into_iter();
    let known = rows.filter_map(|(name, count)| Some((name, count?)));
    let row = |(name, count): (&str, f64)| {
        let part = count / available;
        let (count, percent) = (format!("{count:.0}"), format!("{:.1} %", part * 100.0));
        let cells = [name.to_owned(), count, percent].map(GridCell::from).into_iter();
        cells.chain([GridCell::Bar(part)]).collect()
    };
    let text = format!(
        "Instructions for each sample. The emulator executes {available:.0} in a sample period; the core at 168 MHz has 1680 \
         cycles."
    );
    let table = Grid::new(" | instructions | of those that fit |", known.map(row));
    Chapter::new("What it costs")
        .text(text)
        .table(table.on(Medium::Page))
}

fn of_identity(identity: &Identity) -> Vec<Fact> {
    let causes: Vec<_> = identity.reset_cause.names().collect();
    let (channels, rate) = (identity.channels, identity.sample_rate_hz);
    let boot = format!("{}, reset by {}", identity.boot, causes.join(", "));
    let firmware = format!("{} ({})", identity.firmware, identity.git);
    let sampling = format!("{channels} channels at {rate} Hz");
    let device = hex(&identity.uid);
    vec![
        ("firmware", firmware),
        ("device", device),
        ("boot", boot),
        ("sampling", sampling),
    ]
}

fn of_settings(settings: &Settings) -> Vec<Fact> {
    let (force, acceleration, window) = (&settings.force, &settings.acceleration, &settings.window);
    let per_code = force.sensitive.per_code.to_num::<f64>();
    let ms = |samples: u16| f64::from(samples) / f64::from(settings.sample_rate_hz) * 1e3;
    let window = format!(
        "{:.2} ms, {:.2} ms of it before the trigger, which is a rise of {:.3} N in {:.2} ms",
        ms(window.length),
        ms(window.history),
        f64::from(window.threshold) * per_code,
        ms(window.lookback),
    );
    let resolution = format!(
        "{:.2} mN and {:.3} m/s² a code; at the low gain {:.2} N and {:.1} m/s²",
        per_code * 1e3,
        acceleration.sensitive.per_code.to_num::<f64>(),
        force.wide.per_code.to_num::<f64>(),
        acceleration.wide.per_code.to_num::<f64>(),
    );
    let bead = settings.description().physics();
    let physics = format!(
        "M = {:.3} g, m = {:.3} g, k = {:.1} kN/m, c = {:.2} N·s/m, κ = {:.4e} N/m^1.5, τ = {:.2} µs",
        bead.mass * 1e3,
        bead.intruder_mass * 1e3,
        bead.stiffness * 1e-3,
        bead.damping,
        bead.contact_stiffness,
        bead.relaxation * 1e6,
    );
    vec![
        ("settings: bead", physics),
        ("window", window),
        ("resolution", resolution),
    ]
}

fn of_status(status: &Status) -> Vec<Fact> {
    let source = match status.settings_source {
        SettingsSource::Stored => "flash, written over the link",
        SettingsSource::Flash => "flash, put there by a probe",
        SettingsSource::BuiltIn => "the image: flash has none",
        SettingsSource::FlashRefused => "the image: those in flash were refused",
        SettingsSource::Rescue => "the image: boots with those in flash failed",
        SettingsSource::Unknown(number) => &format!("source {number}, of a later version"),
    };
    let acquisition = format!(
        "{} samples in epoch {}, {} overruns, {} blocks dropped",
        status.samples, status.epoch, status.overruns, status.blocks_dropped
    );
    let dropped = format!(
        "{} for a full queue, {} too long",
        status.frames_dropped_queue_full, status.frames_dropped_too_long
    );
    vec![
        ("settings came from", source.to_owned()),
        ("acquisition", acquisition),
        ("frames dropped by the bead", dropped),
        ("least free stack", format!("{} bytes", status.stack_free_min)),
    ]
}

fn of_emulator(emulator: &EmulatorReport) -> Vec<Fact> {
    let run = format!(
        "{}: {:.2} s of virtual time; {} resets; {} overruns seen by the converter",
        emulator.qemu.as_deref().unwrap_or("QEMU"),
        emulator.virtual_seconds,
        emulator.resets,
        emulator.overruns
    );
    let registers = match &emulator.unknown_registers[..] {
        [] => "none touched".to_owned(),
        touched => touched.join(", "),
    };
    let image = emulator.image.clone();
    vec![
        ("image", image),
        ("emulator", run),
        ("registers without a model", registers),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spread::Deviations;
    use crate::strike::FullChain;
    use crate::testing::recorded_strike;
    use bead_recording::strikes::RecordedStrike;
    use bead_wire::{EnergyUncertainty, Fraction};
    use hertz_chain::Scenario;

    /// Page and terminal of a recording with this many equal strikes.
    fn rendered(strikes: usize, failure: Option<&str>) -> [String; 2] {
        let strike = recorded_strike();
        let mut comparison = FullChain::run(&Scenario::paper(), 8).unwrap().compare(&strike);
        comparison.alone = strikes == 1;
        let mut deviations = Deviations::default();
        for _ in 0..strikes {
            deviations.push(&comparison.deviation);
        }
        let compared = ComparedBead {
            strikes: vec![comparison; strikes],
            count: strikes,
            spread: deviations.spread(None),
            failure: failure.map(str::to_owned),
            settings: strike.settings,
            ..ComparedBead::default()
        };
        let compared = ComparedStrikes {
            title: "One absorber",
            recording: "bead-8.mcap",
            bead: 8,
            compared: &compared,
            velocity: None,
            made: &[("command", "bead compare".to_owned())],
            scenario: "title = \"x\"",
        };
        let report = compared.report();
        [report.page().unwrap(), report.terminal()]
    }

    fn line<'a>(text: &'a str, words: &str) -> &'a str {
        let line = text.lines().find(|line| line.contains(words));
        line.unwrap_or_else(|| panic!("{words}: {text}"))
    }

    #[test]
    fn one_strike_is_shown_in_full_and_judged_alone() {
        let [page, terminal] = rendered(1, None);
        for name in [
            "width at half height (µs)",
            "impulse (mN·s)",
            "k from the ringing (kN/m)",
        ] {
            let times = [&page, &terminal].map(|text| text.matches(name).count());
            assert_eq!(times, [1, 1], "{name}");
        }
        assert!(page.contains("Every check passed") && !page.contains("All 1 strikes"));
        let measured = line(&terminal, "A, measured (nJ)");
        assert!(measured.ends_with("0.2 %  met"), "{terminal}");
        for label in [
            "acceleration (m/s²)",
            "absorbed energy (nJ)",
            "energy (% of final)",
        ] {
            assert!(page.contains(label), "{label}");
        }
        let failed = &rendered(1, Some("replay differs: strike 0"))[0];
        assert!(failed.contains("replay differs: strike 0") && !failed.contains("Every check passed"));
    }

    #[test]
    fn many_strikes_have_their_means_first_and_then_a_line_each() {
        let [page, terminal] = rendered(100, None);
        assert!(page.contains("All 100 strikes"));
        assert_eq!(page.matches("<td>identical</td>").count(), 100);
        for shown in [">Strike 0, sample", ">Strike 0, the furthest off, sample"] {
            assert_eq!(page.matches(shown).count(), 1, "{shown}");
        }
        assert!(terminal.starts_with("all 100 strikes"), "{terminal}");
        assert!(terminal.lines().count() < 130 && !terminal.contains("f64, same samples"));
        for check in ["A, mean of 100 strikes", "B, scatter (rms)", "frames lost"] {
            assert!(line(&terminal, check).ends_with("met"), "{terminal}");
        }
    }

    #[test]
    fn a_mean_has_one_uncertainty_wherever_it_is_shown() {
        let within = |text: &String| -> Vec<String> {
            let after = text.split(" ± ").skip(1);
            after.map(|rest| rest.split(' ').next().unwrap().into()).collect()
        };
        let [shown, printed] = rendered(2, None).each_ref().map(within);
        assert!(printed.len() > 3);
        assert_eq!(shown, printed);
    }

    #[test]
    fn energies_have_twice_their_uncertainty_beside_them_if_the_bead_sent_it() {
        let mut strike = recorded_strike();
        let chain = FullChain::run(&Scenario::paper(), 8).unwrap();
        // The cells of A and of B, by the device.
        let cells = |strike: &RecordedStrike| {
            let rows = in_full(&chain.compare(strike), EnergyUnit::of([1e-9])).rows;
            [0, 1].map(|row| match &rows[row][1] {
                GridCell::Text(text) => text.clone(),
                other => panic!("{other:?}"),
            })
        };
        let before = cells(&strike);
        let [one, two, three] = [1, 2, 3].map(|percent| Fraction::from_bits(percent * 65_536 / 100));
        strike.shape.as_mut().unwrap().uncertainty = Some(EnergyUncertainty {
            measured: one,
            predicted: two,
            difference: three,
        });
        // Replay differs then, and the energies do not.
        for ((before, shown), part) in before.iter().zip(cells(&strike)).zip([one, two]) {
            let u = 2.0 * part.ratio() * before.parse::<f64>().unwrap();
            let (value, within) = shown.split_once(" ± ").unwrap();
            assert_eq!(value, before);
            assert!((within.parse::<f64>().unwrap() - u).abs() < 0.01, "{shown}");
        }
        let energies = EnergyUncertainties::of(&strike, [0.0; 2]).unwrap();
        let greater = strike.said.absorbed_measured.max(strike.said.absorbed_predicted);
        assert_eq!(energies.u_difference, Some(three.ratio() * greater.joules()));
        // The chain explains 3 % of A, and an error of B that has no bound.
        let unlike = EnergyUncertainties::of(&strike, [0.03, f64::INFINITY]).unwrap();
        let parts = unlike.u_absorbed_measured.unwrap() / strike.said.absorbed_measured.joules();
        assert!((parts / 2e-2 - 1.0).abs() < 1e-3, "{unlike:?}");
        assert_eq!((unlike.u_absorbed_predicted, unlike.u_difference), (None, None));
        let legends = [&unlike, &energies].map(|of| EnergyUncertainties::legend([of]).unwrap());
        let has_bounds = legends.map(|legend| !legend.contains("without a bound"));
        assert_eq!(has_bounds, [false, true]);
    }
}
