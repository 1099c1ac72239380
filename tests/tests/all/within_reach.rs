//! A bead answers whatever its settings, its strikes and its input: the image in QEMU. `any_settings.rs`
//! tries thousands on a model of it.

use bead_model::Settings;
use bead_testing::{any_settings, block, bodies, write};
use bead_tests::{Requests, RequestsRun, faults_at, paper, replied};
use bead_wire::{Fault, FaultCause, Guard, Message, Outcome, Request, SettingsSource, Status};
use proptest::prelude::Rng;
use proptest::test_runner::{RngAlgorithm, TestRng};

/// Longest time from a request to its reply, s.
const ANSWERED: f64 = 1.0;

/// A run of `seconds` in which the chain is struck every `every` scans; 0 for noise alone.
fn struck(seconds: f64, every: usize) -> Requests {
    let strike = paper(1, 0.1, Some(1)).machine().stimulus;
    let noise = paper(0, 0.1, Some(2)).machine().stimulus;
    let mut requests = Requests::new(&paper(0, 0.1, Some(1)));
    requests.machine.count_instructions = false;
    // From the touch of the striker.
    let strike = &strike[2000..];
    requests.machine.stimulus = (0..(seconds * 100e3) as usize)
        .map(|at| match at.checked_rem(every) {
            Some(after) => strike[after % strike.len()],
            None => noise[at % noise.len()],
        })
        .collect();
    requests
}

fn answered_within(answered: &RequestsRun, request: u16, asked: f64, seconds: f64) -> f64 {
    let replied = replied(&answered.outcome, request).unwrap_or_else(|| {
        panic!(
            "request {request} has no reply: {:?}",
            answered.received.last::<Guard>()
        )
    });
    let took = replied - asked;
    assert!(took < seconds, "request {request} was answered after {took} s");
    took
}

fn outcome(answered: &RequestsRun, request: u16) -> Outcome {
    answered.received.answer(request).0
}

/// The settings with which noise triggers without end: each sample is compared with the one before it.
fn triggered_by_noise(settings: &Settings) -> Settings {
    let noisy = settings.with(|bead| {
        bead.capture.threshold = 5.0 * bead.force.per_code;
        bead.capture.lookback = 1e-5;
        bead.capture.history = 128e-5;
        bead.capture.length = 1024e-5;
        // Settings that leave out the noise that there is.
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
        (0.7, write(&block(&owners))),
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
    let said = answered.received.answered(1);
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
    assert_eq!(answered.received.status().overruns, 0);
    // The identity of each second finds room too.
    assert_eq!(answered.outcome.resets.len(), 1);
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
                let written = requests.request(at, &write(&block(&settings)));
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
        triggers += answered.received.status().strikes;
        assert_eq!(answered.outcome.resets, []);
        assert_eq!(answered.received.status().overruns, 0);
    }
    println!("slowest reply {worst:.3} s; {triggers} strikes triggered");
    // Arming takes a quiet of history and lookback.
    assert!(triggers > 50, "{triggers}");
}

#[test]
fn five_boots_that_fail_within_a_second_bring_the_built_in_settings_and_a_reboot_the_owners() {
    let mut requests = struck(3.6, 0);
    // The boot that runs for a second and a half does not count as one that fails at once.
    let faults = [0.05, 0.15, 0.25, 0.35, 1.9, 2.0, 2.1, 2.2, 2.3];
    let mut run = paper(0, 0.1, Some(1));
    run.faults = faults_at(&faults.map(|at| (at, "hard_fault")));
    requests.machine.faults = run.machine().faults;
    let [proven, rescued] = [1.5, 2.7].map(|at| requests.request(at, &Request::Status));
    let reboot = requests.request(2.9, &Request::Reboot);
    requests.request(3.3, &Request::Status);
    let answered = requests.run();
    assert_eq!(answered.outcome.resets.len(), faults.len() + 1);
    let source = |request| {
        let messages = answered.received.answered(request);
        // Frames of boots that lasted longer come before.
        let status: &Status = bodies(messages).last().expect("a status");
        (status.settings_source, status.armed)
    };
    assert_eq!(source(proven), (SettingsSource::Flash, true));
    // It looks for no strikes unasked.
    assert_eq!(source(rescued), (SettingsSource::Rescue, false));
    let refused = answered.received.all::<Fault>();
    let refused = refused.filter(|fault| fault.cause == FaultCause::SettingsRefused);
    let refused: Vec<_> = refused.map(|fault| fault.detail.as_str()).collect();
    assert!(
        matches!(refused[..], [why] if why.starts_with("five boots in a row failed")),
        "{refused:?}"
    );
    assert_eq!(outcome(&answered, reboot), Outcome::Done);
    let status = answered.received.status();
    assert_eq!(
        (status.settings_source, status.armed),
        (SettingsSource::Flash, true)
    );
}
