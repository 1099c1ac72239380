//! No settings that a bead takes, no strikes and no input leave one that does not answer: the image in QEMU.
//! `any_settings.rs` tries thousands on a model of it.

use bead_model::Settings;
use bead_model::settings::BLOCK_MAX;
use bead_recording::strikes::assemble;
use bead_testing::any_settings;
use bead_tests::{Answered, Requests, SUPPLY_WAIT, paper, replied};
use bead_wire::{Block, FaultCause, Message, Outcome, Request, SettingsSource, StrikeFlags};
use proptest::prelude::Rng;
use proptest::test_runner::{RngAlgorithm, TestRng};

/// Longest time from a request to its reply, s.
const ANSWERED: f64 = 1.0;

fn block(settings: &Settings) -> Vec<u8> {
    let mut block = [0; BLOCK_MAX];
    let length = settings
        .encode(&mut block)
        .unwrap_or_else(|error| panic!("{error}"));
    block[..length].to_vec()
}

fn write(settings: &Settings) -> Request {
    Request::WriteSettings {
        block: Block::try_from(&block(settings)[..]).expect("a block fits a frame"),
    }
}

/// A run of `seconds` in which the chain is struck every `every` scans; 0 for noise alone.
fn struck(seconds: f64, every: usize) -> Requests {
    let strike = paper(1, 0.1, Some(1)).machine().stimulus;
    let noise = paper(0, 0.1, Some(2)).machine().stimulus;
    let mut requests = Requests::new(&paper(0, 0.1, Some(1)));
    requests.machine.count_instructions = false;
    // From the striker's touch on.
    let strike = &strike[2000..];
    requests.machine.stimulus = (0..(seconds * 100e3) as usize)
        .map(|at| match at.checked_rem(every) {
            Some(after) => strike[after % strike.len()],
            None => noise[at % noise.len()],
        })
        .collect();
    requests
}

fn answered_within(answered: &Answered, request: u16, asked: f64, seconds: f64) -> f64 {
    let replied = replied(&answered.outcome, request)
        .unwrap_or_else(|| panic!("request {request} has no reply: {:?}", answered.heard.guard()));
    let took = replied - asked;
    assert!(took < seconds, "request {request} was answered after {took} s");
    took
}

fn outcome(answered: &Answered, request: u16) -> Outcome {
    answered.heard.answer(request).0
}

/// The settings with which noise triggers without end: each sample is compared with the one before it.
fn triggered_by_noise(settings: &Settings) -> Settings {
    let noisy = settings.with(|bead| {
        bead.capture.threshold = 5.0 * bead.force.per_code;
        bead.capture.lookback = 1e-5;
        bead.capture.history = 128e-5;
        bead.capture.length = 1024e-5;
        // They do not state the noise that there is.
        bead.force.noise = 0.0;
    });
    noisy.unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn settings_in_which_noise_triggers_without_end_leave_a_bead_that_answers_and_takes_others() {
    let mut requests = struck(1.2, 0);
    let owners = paper(0, 0.1, Some(1)).settings;
    requests.machine.flash[0].1 = block(&triggered_by_noise(&owners));
    let asked: Vec<_> = [
        (0.25, Request::Identity),
        (0.35, Request::Status),
        (0.4, Request::Disarm),
        (0.5, Request::Arm),
        (0.7, write(&owners)),
        (0.9, Request::EraseSettings),
        (1.1, Request::Reboot),
    ]
    .into_iter()
    .map(|(at, request)| (at, requests.request(at, &request)))
    .collect();
    let answered = requests.run();
    let took: Vec<f64> = asked
        .iter()
        .map(|&(at, request)| answered_within(&answered, request, at, 0.2))
        .collect();
    let said = answered.heard.answered(1);
    let [Message::Status(status), _, _, Message::Guard(guard), ..] = said[said.len() - 5..] else {
        panic!("{said:?}");
    };
    println!(
        "answered after {took:.3?} s; {} strikes, {guard:?}",
        status.strikes
    );
    for (_, request) in asked {
        assert_eq!(outcome(&answered, request), Outcome::Done);
    }
    assert!(status.strikes > 20, "noise does trigger: {status:?}");
    assert!(guard.strikes_passed_over > 0, "more than the line carries");
    assert_eq!(answered.heard.status().overruns, 0);
    // The identity of each second finds room too.
    assert_eq!(answered.outcome.resets.len(), 1);
}

#[test]
fn a_chain_struck_every_12_ms_leaves_a_bead_that_answers_and_measures_whole_strikes() {
    let mut requests = struck(1.0, 1210);
    let disarm = requests.request(0.6, &Request::Disarm);
    requests.request(0.9, &Request::Status);
    let answered = requests.run();
    let took = answered_within(&answered, disarm, 0.6, 0.2);
    let (status, guard) = (answered.heard.status(), answered.heard.guard());
    println!(
        "answered after {took:.3} s; {} strikes, {guard:?}",
        status.strikes
    );
    let strikes = assemble(answered.heard.frames.clone(), None);
    assert!(strikes.len() > 30, "{}", strikes.len());
    assert!(
        strikes
            .iter()
            .all(|strike| strike.scans.len() == usize::from(strike.said.samples))
    );
    assert_eq!(status.frames_dropped_queue_full, 0);
    assert!(!status.armed);
}

/// Sixteen settings in one run, each written over the one before, while the chain is struck and the noise
/// triggers; after each the bead is told to look for no strikes.
#[test]
fn after_any_valid_settings_a_bead_is_disarmed_within_a_second() {
    let mut random = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    let mut bits = || random.next_u64();
    let (mut worst, mut triggers) = (0.0_f64, 0);
    for every in [1210, 0, 1000] {
        let mut requests = struck(2.6, every);
        let asked: Vec<_> = (0..16)
            .map(|n| {
                let settings = any_settings(&mut bits);
                let at = 0.1 + 0.15 * f64::from(n);
                let written = requests.request(at, &write(&settings));
                let disarm = requests.request(at + 0.09, &Request::Disarm);
                requests.request(at + 0.14, &Request::Arm);
                (settings, at, written, disarm)
            })
            .collect();
        let answered = requests.run();
        for (settings, at, written, disarm) in asked {
            let took = [(written, at), (disarm, at + 0.09)]
                .map(|(request, at)| answered_within(&answered, request, at, ANSWERED));
            worst = took.into_iter().fold(worst, f64::max);
            assert_eq!(outcome(&answered, written), Outcome::Done, "{settings:?}");
            assert_eq!(outcome(&answered, disarm), Outcome::Done, "{settings:?}");
        }
        triggers += answered.heard.status().strikes;
        assert_eq!(answered.outcome.resets, []);
        assert_eq!(answered.heard.status().overruns, 0);
    }
    println!("slowest reply {worst:.3} s; {triggers} strikes triggered");
    assert!(triggers > 100);
}

#[test]
fn five_boots_that_fail_at_once_bring_the_built_in_settings_and_a_reboot_the_owners() {
    let mut run = paper(0, 0.1, Some(1));
    let faults: String = (0..5)
        .map(|n| {
            format!(
                "[[fault]]\nat = {}\nkind = \"hard_fault\"\n",
                0.05 + 0.1 * f64::from(n)
            )
        })
        .collect();
    run.faults = bead_bench::faults::parse(&faults, "faults").unwrap_or_else(|failure| panic!("{failure}"));
    let mut requests = struck(1.2, 0);
    requests.machine.faults = run.machine().faults;
    requests.machine.flash[0].1 = run.block.clone();
    let rescued = requests.request(0.8, &Request::Status);
    let reboot = requests.request(0.9, &Request::Reboot);
    requests.request(1.15, &Request::Status);
    let answered = requests.run();
    assert_eq!(answered.outcome.resets.len(), 6);
    let [Message::Status(status), ..] = answered.heard.answered(rescued)[..] else {
        panic!("no status");
    };
    assert_eq!(status.settings_source, SettingsSource::Rescue);
    assert!(!status.armed, "it looks for no strikes unasked");
    let refused: Vec<_> = answered
        .heard
        .faults()
        .filter(|fault| fault.cause == FaultCause::SettingsRefused)
        .collect();
    assert_eq!(refused.len(), 1);
    assert!(
        refused[0]
            .detail
            .as_str()
            .starts_with("five boots in a row failed")
    );
    assert_eq!(outcome(&answered, reboot), Outcome::Done);
    let status = answered.heard.status();
    assert_eq!(status.settings_source, SettingsSource::Flash, "tried again");
    assert!(status.armed);
}

#[test]
fn a_boot_that_has_run_for_a_second_is_no_failed_one() {
    let mut requests = struck(2.0, 0);
    let mut run = paper(0, 0.1, Some(1));
    // Four at once, one after a second and a half: not five in a row.
    let faults: String = [0.05, 0.15, 0.25, 0.35, 1.7]
        .map(|at| format!("[[fault]]\nat = {at}\nkind = \"hard_fault\"\n"))
        .concat();
    run.faults = bead_bench::faults::parse(&faults, "faults").unwrap_or_else(|failure| panic!("{failure}"));
    requests.machine.faults = run.machine().faults;
    let answered = requests.run();
    assert_eq!(answered.outcome.resets.len(), 5);
    assert_eq!(answered.heard.status().settings_source, SettingsSource::Flash);
    assert_eq!(answered.heard.guard().boots_failed, 1);
}

#[test]
fn a_fault_whose_frame_never_left_is_told_with_each_identity_and_counted() {
    let mut requests = struck(1.5, 0);
    let first = requests.first_scan();
    // The second comes while the image starts again, before a frame of that boot can leave.
    let again = 0.05 + SUPPLY_WAIT + first + 0.0025;
    let mut run = paper(0, 0.1, Some(1));
    let faults =
        format!("[[fault]]\nat = 0.05\nkind = \"panic\"\n[[fault]]\nat = {again}\nkind = \"hard_fault\"\n");
    run.faults = bead_bench::faults::parse(&faults, "faults").unwrap_or_else(|failure| panic!("{failure}"));
    requests.machine.faults = run.machine().faults;
    let answered = requests.run();
    println!("first scan after {first} s; {:?}", answered.outcome.resets);
    let told: Vec<_> = answered
        .heard
        .frames
        .iter()
        .filter_map(|frame| match &frame.message {
            Message::LastFault(last) => Some((frame.header.boot, last.faults, last.cause, last.boot)),
            _ => None,
        })
        .collect();
    assert_eq!(answered.outcome.resets.len(), 2);
    let newest = (2, 2, FaultCause::HardFault, 1);
    assert_eq!(told.last(), Some(&newest), "{told:?}");
    assert!(
        told.iter().filter(|last| **last == newest).count() >= 2,
        "it comes every second: {told:?}"
    );
}

#[test]
fn an_overrun_in_the_block_of_the_trigger_is_told_with_the_samples_that_it_cost() {
    let quiet = assemble(Requests::new(&paper(2, 0.1, Some(1))).run().heard.frames, None);
    let trigger = quiet[0].said.trigger_index;
    let mut gaps = 0;
    // At any place in the block of 2 ms, the triggers of which are not yet with the estimators.
    for after in [0.0, 0.0005, 0.001, 0.0015] {
        let mut run = paper(2, 0.1, Some(1));
        let at = trigger as f64 / 100e3 + after;
        let faults = format!("[[fault]]\nat = {at}\nkind = \"adc_overrun\"\n");
        run.faults =
            bead_bench::faults::parse(&faults, "faults").unwrap_or_else(|failure| panic!("{failure}"));
        let answered = Requests::new(&run).run();
        let gap = answered
            .heard
            .frames
            .iter()
            .find_map(|frame| match &frame.message {
                Message::Gap(gap) => Some(*gap),
                _ => None,
            });
        let gap = gap.expect("the gap is told");
        assert!(gap.first_index < gap.end_index && gap.epoch == 1);
        let strikes = assemble(answered.heard.frames.clone(), None);
        let measured = strikes.iter().any(|strike| strike.said.trigger_index == trigger);
        let cut = answered.heard.health().strikes_cut == 1;
        let in_gap = (gap.first_index..gap.end_index).contains(&trigger);
        println!("{after} s after the trigger: {gap:?}, cut {cut}, trigger in the gap {in_gap}");
        assert!(
            !measured && (cut || in_gap),
            "the strike is lost, and one can know"
        );
        gaps += u32::from(in_gap && !cut);
        assert_eq!(strikes.len(), 1, "the second one");
    }
    assert!(gaps > 0, "the case that no cut tells of");
}

/// Runs two strikes with `faults`; gives the flags of the strikes, and what was told.
fn flags(faults: &str) -> (Vec<StrikeFlags>, Answered) {
    let mut run = paper(2, 0.1, Some(1));
    run.faults = bead_bench::faults::parse(faults, "faults").unwrap_or_else(|failure| panic!("{failure}"));
    let answered = Requests::new(&run).run();
    let strikes = assemble(answered.heard.frames.clone(), None);
    (strikes.iter().map(|strike| strike.said.flags).collect(), answered)
}

#[test]
fn a_sensor_that_stands_still_in_the_ring_down_flags_the_strike_and_is_counted() {
    let quiet = assemble(Requests::new(&paper(2, 0.1, Some(1))).run().heard.frames, None);
    let trigger = quiet[0].said.trigger_index as f64 / 100e3;
    for after in [0.0008, 0.0015, 0.0025] {
        let (flags, answered) = flags(&format!(
            "[[fault]]\nat = {}\nkind = \"acceleration_stuck\"\nduration = 0.01\n",
            trigger + after
        ));
        assert_eq!(flags.len(), 2);
        assert!(flags[0].has(StrikeFlags::SENSOR_STILL), "{after} s: {flags:?}");
        assert_eq!(flags[1], StrikeFlags::NONE);
        assert_eq!(answered.heard.guard().strikes_still, 1);
    }
    let (flags, _) = flags("[[fault]]\nat = 0.3\nkind = \"supply\"\nvolts = 3.3\n");
    assert_eq!(flags, [StrikeFlags::NONE; 2], "noise alone flags nothing");
}

#[test]
fn a_force_that_is_stuck_for_70_ms_is_told_wherever_it_begins() {
    for n in 0..4 {
        let at = 0.13 + 0.0137 * f64::from(n);
        let (_, answered) = flags(&format!(
            "[[fault]]\nat = {at}\nkind = \"force_stuck\"\nduration = 0.07\n"
        ));
        let causes: Vec<_> = answered.heard.faults().map(|fault| fault.cause).collect();
        assert_eq!(causes, [FaultCause::ForceStuck, FaultCause::Recovered], "{at}");
        assert_eq!(answered.heard.health().force_stuck, 1);
    }
}
