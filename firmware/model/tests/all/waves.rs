//! Two equal strikes, one after the other: `cargo test --release -p bead-model waves -- --nocapture` prints
//! what each window has of them.

use crate::sensed::{HOST, felt, front_end, scan};
use crate::{pulse, replayed};
use bead_model::design::{Bead, Capture, derive};
use bead_model::{Meter, Scan, Settings, StrikeFlags};
use bead_testing::Collector;
use hertz_chain::{Scenario, Solution, simulate};

/// Quiet before the first strike, samples.
const LEAD: f64 = 400.0;

/// Scans of two equal strikes, the second one `gap` samples after the first.
fn two_strikes(solution: &Solution, gap: f64) -> Vec<Scan> {
    let front_end = front_end([32.0, 600.0]);
    let felt_after = |samples: f64| felt(solution, HOST, samples / 100e3);
    (0..6000)
        .map(|n| {
            let [first, second] = [0.0, gap].map(|later| felt_after(f64::from(n) - LEAD - later));
            scan(&front_end, [first[0] + second[0], first[1] + second[1]])
        })
        .collect()
}

fn settings() -> Settings {
    derive(&Bead::paper(), &front_end([32.0, 600.0]), &Capture::default()).unwrap()
}

/// Results of a meter for scans that come in calls of `call`, and the number of waves that no window could
/// hold.
fn metered(settings: &Settings, scans: &[Scan], call: usize) -> (Collector, u32) {
    let (mut meter, mut results) = (Meter::new(), Collector::default());
    for (n, some) in scans.chunks(call).enumerate() {
        meter.process(settings, (n * call) as u64, some.iter().copied(), &mut results);
    }
    (results, meter.in_dead_time())
}

#[test]
fn two_strikes_at_any_time_apart_are_measured_each_or_flagged_and_none_is_lost() {
    let mut scenario = Scenario::paper();
    scenario.duration = 0.04;
    let (solution, settings) = (simulate(&scenario).unwrap(), settings());
    let truth = 1e9 * solution.at(0.03).intruder_dissipated(HOST).unwrap();
    for tenths in 5..=120 {
        let gap = f64::from(tenths) / 10.0;
        let scans = two_strikes(&solution, 100.0 * gap);
        let call = [1, 33, 200, 256, 999][tenths as usize % 5];
        let (results, missed) = metered(&settings, &scans, call);
        let mut is_told = false;
        for (report, shape) in results.reports.iter().zip(&results.shapes) {
            let errors = [report.absorbed_measured, report.absorbed_predicted]
                .map(|energy| 1e11 * energy.joules() / truth - 100.0);
            let flags = report.flags;
            println!(
                "{gap} ms: {} samples, A {:+.2} %, B {:+.2} %, {flags:?}",
                report.samples, errors[0], errors[1]
            );
            let another = flags.has(StrikeFlags::ANOTHER_WAVE) || flags.has(StrikeFlags::WINDOW_CUT);
            assert!(
                errors.iter().all(|error| error.abs() < 3.0) || another,
                "{gap} ms"
            );
            is_told |= another;
            // The codes of the window alone say so, too.
            let first = report.first_index as usize;
            let (window, record) = replayed(
                &settings,
                report.first_index,
                &scans[first..][..report.samples.into()],
            );
            let (mut again, again_shape) = window.report(&settings, &record);
            again.strike = report.strike;
            assert_eq!((again, again_shape.left), (*report, shape.left), "{gap} ms");
        }
        // From a history and twice the lookback after the first pulse on, there is a window for each.
        let each = if gap < 2.8 { 1 } else { 2 };
        assert_eq!((results.reports.len(), missed), (each, 0), "{gap} ms");
        assert!(is_told == (gap < 5.2), "{gap} ms");
        let is_cut = results.reports[0].flags.has(StrikeFlags::WINDOW_CUT);
        assert_eq!(is_cut, (2.8..5.2).contains(&gap), "{gap} ms");
    }
}

#[test]
fn of_many_waves_each_is_in_a_window_or_is_counted() {
    let settings = settings();
    // Windows begin at these waves. A wave after them is in the one before, or is missed.
    for (every, windows, missed) in [
        (180, &[0][..], 9),
        (300, &[0, 1, 4, 7, 10], 3),
        (450, &[0, 1, 3, 5, 7, 9, 11], 0),
        (1000, &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11], 0),
    ] {
        let force = |n: usize| match n.checked_sub(1000) {
            Some(after) if after < 12 * every => 128 + pulse(after % every, 1500.0),
            _ => 128,
        };
        let scans: Vec<Scan> = (0..16_000)
            .map(|n| Scan::new([force(n), force(n), 2048, 2048]))
            .collect();
        let (results, in_dead_time) = metered(&settings, &scans, 200);
        let opened = results
            .opened
            .iter()
            .map(|(trigger, _)| (*trigger as usize - 1000) / every);
        println!(
            "{every} samples apart: windows {:?}, {in_dead_time} missed",
            opened.clone().collect::<Vec<_>>()
        );
        assert!(opened.eq(windows.iter().copied()), "{every}");
        assert_eq!(in_dead_time, missed, "{every}");
        let doubtful = |report: &bead_model::Strike| report.flags.has(StrikeFlags::ANOTHER_WAVE);
        assert_eq!(results.reports.iter().any(doubtful), every < 512, "{every}");
    }
}
