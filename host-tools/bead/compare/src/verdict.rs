//! The verdict on a recording: the strikes that are judged, and the checks of the run as a whole.

use std::collections::BTreeMap;

use bead_model::layout::WindowSettings;
use hertz_chain::{Scenario, Solution};

use crate::emulated::{EmulatorReport, RunTruth};
use crate::front_end::SAMPLE_RATE_HZ;
use crate::report::count;
use crate::sensed::RING_DOWN;
use crate::spread::Spread;
use crate::strike::FullChain;
use bead_recording::file::Pieces;
use bead_recording::received::LastSaid;
use bead_recording::strikes::{RecordedStrike, UnfinishedWindow};

/// Separates strikes from their echoes: waves after a strike's window, from beads that parted and meet again.
/// The simulation of a strike does not hold for an echo.
#[derive(Debug, Clone)]
pub struct Echoes {
    /// The truth of an emulated run, with the instants of its strikes.
    truth: Option<RunTruth>,
    /// Simulated time of a strike, s.
    lasts: f64,
    /// The last strike that was not an echo, by address.
    last: BTreeMap<u8, LastStrike>,
}

#[derive(Debug, Clone, Copy)]
struct LastStrike {
    boot: (u8, Option<usize>),
    trigger_index: u64,
    /// Its number in the emulated run, from 0, if that is known.
    begun: Option<usize>,
}

impl Echoes {
    /// Finds echoes of strikes of this scenario: in an emulated run, waves before the striker hits again; in
    /// any other, waves within the simulated time of a strike.
    pub fn of(scenario: &Scenario, truth: Option<RunTruth>) -> Self {
        Self {
            truth,
            lasts: scenario.duration + RING_DOWN,
            last: BTreeMap::new(),
        }
    }

    /// True if the next strike of the recording is an echo.
    pub fn has(&mut self, strike: &RecordedStrike) -> bool {
        let boot = (strike.boot, strike.nth_boot);
        let now = self.strike(boot, strike.said.trigger_index);
        let is_echo = self.is_again(strike.address, now, strike.rate());
        if !is_echo {
            self.last.insert(strike.address, now);
        }
        is_echo
    }

    /// True if a window after the last strike of the recording, without a result, is that of an echo.
    pub(crate) fn has_window(&self, window: &UnfinishedWindow) -> bool {
        let now = self.strike(window.boot, window.first_index);
        self.is_again(window.address, now, Some(SAMPLE_RATE_HZ))
    }

    fn strike(&self, boot: (u8, Option<usize>), trigger_index: u64) -> LastStrike {
        LastStrike {
            boot,
            trigger_index,
            begun: self.truth_of(boot).and_then(|truth| truth.begun(trigger_index)),
        }
    }

    /// The truth of a boot. After a reset the indices begin again and do not identify the strike.
    fn truth_of(&self, (_, nth): (u8, Option<usize>)) -> Option<&RunTruth> {
        self.truth.as_ref().filter(|_| nth.unwrap_or(0) == 0)
    }

    /// True if this is an echo of the last strike.
    fn is_again(&self, address: u8, now: LastStrike, rate: Option<u32>) -> bool {
        let truth = self.truth_of(now.boot);
        let is_soon = |last: &LastStrike| {
            let samples = now.trigger_index.checked_sub(last.trigger_index).zip(rate);
            samples.is_some_and(|(samples, rate)| (samples as f64) < self.lasts * f64::from(rate))
        };
        let is_again = |last: &&LastStrike| match truth {
            _ if last.boot != now.boot => false,
            None => is_soon(last),
            Some(_) if now.begun.is_none() || now.begun != last.begun => false,
            // A waveform that was played may hold several strikes.
            Some(truth) => truth.stimulus.is_none() || is_soon(last),
        };
        self.last.get(&address).filter(is_again).is_some()
    }
}

/// A warning if the truth does not match the bead's window: the scenario ends before all energy that the bead
/// measures is absorbed, or lasts so long that it includes energy of waves after the window.
pub fn other_length(
    scenario: &Scenario,
    solution: &Solution,
    chain: &FullChain,
    bead: usize,
    window: WindowSettings,
) -> Option<String> {
    /// A negligible part of the energy.
    const LITTLE: f64 = 0.005;
    // The force triggers before it reaches half of its height, so the window ends a little sooner.
    let after = f64::from(window.length - window.history) / f64::from(SAMPLE_RATE_HZ);
    let end = solution.end().min(chain.front() + after);
    let absorbed = |time: f64| solution.at(time).intruder_dissipated(bead);
    let (measured, truth) = (
        absorbed(end)? + held(solution, bead, end)?,
        absorbed(scenario.duration)?,
    );
    let duration = scenario.duration;
    if 1.0 - truth / measured > LITTLE {
        return Some(format!(
            "the scenario ends at {duration} s, and {:.1} % of the energy that bead {bead} measures comes after that, so the \
             truth lacks this energy; make the scenario's duration longer",
            100.0 * (1.0 - truth / measured)
        ));
    }
    let late = 1.0 - measured / truth;
    (late > LITTLE).then(|| {
        format!(
            "the scenario lasts {duration} s, and {:.1} % of the energy that bead {bead} takes until then comes after its \
             window, which ends at {end:.4} s, so the truth has more than the bead measures; make the scenario's duration shorter",
            100.0 * late
        )
    })
}

/// Energy that the intruder of a bead holds at a time, J, if the bead flies free: ½μẋ² and its spring's.
fn held(solution: &Solution, bead: usize, time: f64) -> Option<f64> {
    let (now, model) = (solution.at(time), solution.model());
    let hosted = model.intruders().iter().find(|hosted| hosted.bead == bead)?;
    let (mass, whole) = (hosted.oscillator.mass, model.mass(bead));
    let (x, v) = (now.intruder_displacement(bead)?, now.intruder_velocity(bead)?);
    Some(0.5 * mass * (whole - mass) / whole * v * v + hosted.elastic_energy(x))
}

/// Greatest part of the core that a strike may take.
const BUSY_MOST: f64 = 0.75;

/// The checks of the run as a whole.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Soundness {
    /// Missing parts of the recording, in one line; none if all of it is there.
    pub incomplete: Option<String>,
    /// Frames lost.
    pub lost: u64,
    /// Runs of bytes that are not a frame.
    pub corrupt: u64,
    /// ADC overruns, by the bead or by the emulated converter.
    pub overruns: u64,
    /// Of an emulated run: instructions a sample while a strike was measured, and how many fit.
    pub instructions: Option<(f64, f64)>,
}

impl Soundness {
    /// From the frames of a bead, which were all read, and the emulator's report if there is one.
    pub(crate) fn of(frames: &LastSaid<Pieces>, emulator: Option<&EmulatorReport>) -> Self {
        let counters = frames.counters();
        let reported = frames.statuses.sum(|status| status.overruns);
        let instructions = |emulator: &EmulatorReport| {
            let total = emulator.instructions_per_sample.total?;
            Some((total, emulator.instructions_available))
        };
        Self {
            incomplete: None,
            lost: counters.lost,
            corrupt: counters.rejected.total(),
            overruns: emulator.map_or(reported, |emulator| emulator.overruns.max(reported)),
            instructions: emulator.and_then(instructions),
        }
    }

    /// Each check: its name, value and goal, and true if the goal is met.
    pub(crate) fn rows(&self) -> Vec<(&'static str, String, String, bool)> {
        let counts = [
            ("frames lost", self.lost),
            ("frames corrupt", self.corrupt),
            ("overruns", self.overruns),
        ];
        let counts = counts.map(|(name, count)| (name, count.to_string(), "0".to_owned(), count == 0));
        let whole = match self.incomplete {
            Some(_) => "incomplete",
            None => "whole",
        };
        let is_whole = self.incomplete.is_none();
        let whole = ("recording", whole.to_owned(), "whole".to_owned(), is_whole);
        let cost = self.instructions.map(|(total, available)| {
            let (most, name) = (BUSY_MOST * available, "instructions a sample");
            (name, format!("{total:.1}"), format!("{most:.1}"), total <= most)
        });
        [whole].into_iter().chain(counts).chain(cost).collect()
    }

    /// The first check that failed, gravest first.
    fn failure(&self) -> Option<String> {
        if let Some(what) = &self.incomplete {
            return Some(format!("incomplete: {what}"));
        }
        if self.lost + self.corrupt > 0 {
            let lost = count(self.lost, "frame");
            return Some(format!("{lost} lost and {} corrupt", self.corrupt));
        }
        if self.overruns > 0 {
            let overruns = count(self.overruns, "overrun");
            return Some(format!("{overruns}: samples are missing"));
        }
        let (total, available) = self.instructions?;
        (total > BUSY_MOST * available).then(|| {
            let most = BUSY_MOST * 100.0;
            format!(
                "a sample of a strike costs {total:.0} instructions, more than {most:.0} % of the {available:.0} that fit"
            )
        })
    }
}

const RAILED: &str = "; a strike left the range of a sensor: sensors = \"strong\" under [front_end] of the scenario reaches \
     further";

/// The first check that failed, gravest first. `differs` is the first difference of a replay; strikes that
/// are `railed` left the range of a sensor.
pub(crate) fn failure(
    differs: Option<&str>,
    soundness: &Soundness,
    spread: &[Spread],
    railed: bool,
) -> Option<String> {
    let differs = differs.map(|what| format!("replay differs: {what}"));
    let run = differs.or_else(|| soundness.failure());
    let why = if railed { RAILED } else { "" };
    run.or_else(|| Some(spread.iter().find_map(Spread::failure)? + why))
}

/// The verdict when no check failed, with these estimates.
pub(crate) fn passed<'a>(spread: impl IntoIterator<Item = &'a Spread>) -> &'static str {
    if spread.into_iter().all(|spread| spread.goal.is_some()) {
        "Every check passed"
    } else {
        "Every check passed; no goal applies where the chain is unlike the reduced one"
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use bead_model::design::{Capture, FrontEnd, derive};

    use super::*;
    use crate::sensed::{bead_of, simulate_with_ring_down, unlike_the_reduced_chain};
    use crate::testing::{recorded_strike, scenario};

    /// True for the echoes among strikes with these boots and trigger indices. A strike is simulated for 12
    /// ms.
    fn echoes(truth: Option<RunTruth>, strikes: &[(usize, u64)]) -> Vec<bool> {
        let mut echoes = Echoes::of(&Scenario::paper(), truth);
        let mut strike = recorded_strike();
        let has = |(boot, index): &(usize, u64)| {
            (strike.nth_boot, strike.said.trigger_index) = (Some(*boot), *index);
            echoes.has(&strike)
        };
        strikes.iter().map(has).collect()
    }

    #[test]
    fn what_comes_before_the_striker_hits_again_is_an_echo_and_a_reset_begins_anew() {
        let truth = RunTruth {
            starts: vec![2000.3, 3000.8, 12_000.0],
            ..RunTruth::default()
        };
        let strikes = [(0, 2144), (0, 2900), (0, 3144), (0, 11_000), (0, 12_144)];
        let expected = [false, true, false, true, false];
        assert_eq!(echoes(Some(truth.clone()), &strikes), expected);
        // The first strike after a reset, at an index that came before, and a wave 10 ms after it.
        let strikes = [(0, 2144), (1, 2500), (1, 3500), (1, 5000)];
        assert_eq!(echoes(Some(truth), &strikes), [false, false, true, false]);
    }

    /// The warnings for each host of a scenario, in the window that its settings would have.
    fn other_lengths(scenario: &Scenario) -> Vec<String> {
        let solution = Arc::new(simulate_with_ring_down(scenario).unwrap());
        let hosts = solution.model().intruders().iter().map(|one| one.bead);
        let warnings = hosts.filter_map(|bead| {
            let (physics, front_end) = (bead_of(&solution, bead).unwrap(), FrontEnd::reference());
            let settings = derive(&physics, &front_end, &Capture::of(&physics, &front_end)).unwrap();
            let chain = FullChain::of(scenario, &solution, bead).unwrap();
            other_length(scenario, &solution, &chain, bead, settings.window)
        });
        warnings.collect()
    }

    #[test]
    fn a_scenario_that_is_shorter_or_longer_than_the_window_is_warned_of() {
        for sound in ["paper-strike", "own-chain", "row-of-ten", "ten-intruders"] {
            assert_eq!(other_lengths(&scenario(sound)), [""; 0], "{sound}");
        }
        let mut scenario = Scenario::paper();
        let mut lasting = |duration| {
            scenario.duration = duration;
            other_lengths(&scenario)
        };
        assert_eq!(lasting(3.7e-3), [""; 0]);
        assert_eq!(lasting(1.8e-3).len(), 1);
        let early = lasting(2.7e-3);
        let part = "the scenario ends at 0.0027 s, and 11.1 % of the energy that bead 8 measures come";
        assert!(early.len() == 1 && early[0].starts_with(part), "{early:?}");
        // The window has all of the intruder's ringing, but not what comes back from a wall.
        (scenario.chain.beads, scenario.duration) = (32, 0.02);
        assert_eq!(other_lengths(&scenario), [""; 0]);
        let walled = format!("{}\n[wall]\nyoung = 203e9\npoisson = 0.27\n", scenario.to_toml());
        let late = other_lengths(&Scenario::from_toml(&walled, "walled.toml").unwrap());
        let advice = "make the scenario's duration shorter";
        assert!(late[0].contains(advice), "{late:?}");
    }

    #[test]
    fn a_goal_is_as_much_wider_as_the_chain_explains_and_none_applies_where_that_has_no_bound() {
        let own = scenario("own-chain");
        let mut light = own.clone();
        light.chain.precompression = 0.0;
        let mut mixed = light.clone();
        let mut heavier = mixed.intruders[1].clone();
        (mixed.intruders[1].beads, heavier.beads) = (vec![8], vec![9]);
        heavier.mass *= 1.2;
        mixed.intruders.push(heavier);
        let (narrow, wider) = ("3.9 samples wide", Some(8.3e-3));
        let (pressed, another) = ("under a load of 2 N", "bead 9 has another kind of intruder");
        for (scenario, bead, notes, goals) in [
            (&Scenario::paper(), 8, &[][..], [Some(2e-3), Some(5e-3)]),
            (&light, 6, &[narrow], [wider, Some(3.1e-2)]),
            (&own, 6, &[pressed, narrow], [wider, Some(3.1e-2)]),
            (&mixed, 6, &[another, narrow], [wider, None]),
        ] {
            let solution = Arc::new(simulate_with_ring_down(scenario).unwrap());
            let told = unlike_the_reduced_chain(&solution, bead).notes;
            assert!(told.len() == notes.len(), "{told:?}");
            let are_told = |(told, part): (&String, &&str)| told.contains(part);
            assert!(told.iter().zip(notes).all(are_told), "{told:?}");
            let found = FullChain::of(scenario, &solution, bead).unwrap().goal.each();
            for (found, goal) in found.into_iter().zip(goals) {
                let off = found.zip(goal).map(|(found, goal)| found / goal - 1.0);
                assert_eq!(off.is_some(), found.is_some() || goal.is_some());
                assert!(off.is_none_or(|off| off.abs() < 0.1), "{found:?}");
            }
        }
    }

    #[test]
    fn without_a_truth_an_echo_comes_within_the_time_that_is_simulated() {
        // The echo of an echo is also one of its strike.
        let strikes = [(0, 2144), (0, 2900), (0, 3343), (0, 3344), (0, 4600)];
        assert_eq!(echoes(None, &strikes), [false, true, true, false, false]);
        assert_eq!(echoes(None, &[(0, 2144), (1, 2200), (1, 1000)]), [false; 3]);
    }
}
