//! Windows that are asked for from outside: around an instant that another bead or a host names.

use crate::{paper, pulse, replayed};
use bead_model::meter::REACH;
use bead_model::{Energy, Meter, Origin, Scan};
use bead_testing::Collector;

/// Number of scans that the image hands over at once.
const BLOCK: usize = 200;

/// A stream of a pulse of this height, in codes, from scan 2000 on. Neighbouring codes before it differ, so
/// that a window that is shifted by a scan differs.
fn scan(index: u64, height: f64) -> Scan {
    let pulse = index.checked_sub(2000).map_or(0, |at| pulse(at as usize, height));
    let noise = [0, 1, 3, 1, 2, 0, 2][(index % 7) as usize];
    Scan::new([128 + noise + pulse, 128, 2048 + noise, 2048])
}

/// Feeds blocks. Before each, `ask` may return an instant and the scan at which it is requested.
fn hear(height: f64, ask: impl Fn(u64) -> Option<(u64, u64)>) -> Collector {
    let (settings, mut meter, mut heard) = (paper(), Meter::new(), Collector::default());
    for first in (0..8000).step_by(BLOCK) {
        if let Some((trigger, at)) = ask(first) {
            meter.keep_around(trigger, at, Origin::Line);
        }
        let scans: Vec<Scan> = (first..first + BLOCK as u64)
            .map(|index| scan(index, height))
            .collect();
        meter.process(&settings, first, scans, &mut heard);
    }
    heard
}

/// Requests an instant in the block of the scan `at`.
fn told(trigger: u64, at: u64) -> impl Fn(u64) -> Option<(u64, u64)> {
    move |first| {
        (first..first + BLOCK as u64)
            .contains(&at)
            .then_some((trigger, at))
    }
}

#[test]
fn a_bead_that_feels_too_little_keeps_the_window_around_the_instant_and_it_replays() {
    let settings = paper();
    let history = u64::from(settings.window.history);
    // Miri takes ten seconds for each, so it runs only one.
    const TOLD_AT: &[u64] = if cfg!(miri) { &[2400] } else { &[2300, 2399, 2400] };
    for &at in TOLD_AT {
        let heard = hear(20.0, told(at - 300, at));
        assert_eq!(heard.opened, [(at - 300, Origin::Line)]);
        let report = heard.reports[0];
        assert_eq!(report.trigger_index, at - 300);
        assert_eq!(report.first_index, at - 300 + 1 - history);
        assert_eq!(heard.samples(), usize::from(report.samples));
        let indices = report.first_index..;
        assert!(
            heard
                .scans()
                .into_iter()
                .eq(indices.take(heard.samples()).map(|index| scan(index, 20.0)))
        );
        // An intruder at rest has no energy left at the end: its noise does not count.
        assert_eq!(heard.shapes[0].left.unwrap().measured, Energy::default());
        // The pulse is in it, and the same codes give the same bits.
        assert!((2000..2050).contains(&report.peak_index), "{report:?}");
        let (window, record) = replayed(&settings, report.first_index, &heard.scans());
        assert_eq!(window.report(&settings, &record), (report, heard.shapes[0]));
    }
}

#[test]
#[cfg_attr(miri, ignore = "tens of thousands of scans")]
fn what_a_bead_finds_by_itself_goes_first() {
    let alone = hear(1500.0, |_| None);
    let [(trigger, Origin::Force)] = alone.opened[..] else {
        panic!("{:?}", alone.opened);
    };
    for (instant, at) in [
        (trigger - 100, trigger + 200),
        (trigger, trigger + 300),
        (1990, 2290),
    ] {
        let heard = hear(1500.0, told(instant, at));
        assert_eq!(heard, alone);
    }
    // If the force rises later than that, the window of the line comes first, and contains the pulse.
    let heard = hear(1500.0, told(trigger - 310, trigger - 10));
    assert_eq!(heard.opened, [(trigger - 310, Origin::Line)]);
    assert!((2000..2050).contains(&heard.reports[0].peak_index));
}

#[test]
#[cfg_attr(miri, ignore = "tens of thousands of scans")]
fn an_instant_of_another_window_or_beyond_the_reach_is_not_kept() {
    // While a window is measured, and for a history after it: its scans are not quiet.
    let alone = hear(1500.0, |_| None).reports[0];
    let end = alone.first_index + u64::from(alone.samples);
    for at in [end - 1, end, end + 300, end + 400] {
        assert_eq!(hear(1500.0, told(at - 300, at)).opened.len(), 1, "{at}");
    }
    let later = hear(1500.0, told(end + 159, end + 459));
    assert_eq!(later.opened.last(), Some(&(end + 159, Origin::Line)));
    // Scans from before power-up are not there either.
    assert_eq!(hear(0.0, told(100, 400)).opened, []);
    assert_eq!(hear(0.0, told(200, 500)).opened, [(200, Origin::Line)]);
    assert_eq!(hear(0.0, told(1000, 3600)).opened, []);
}

#[test]
#[cfg_attr(miri, ignore = "tens of thousands of scans")]
fn scans_are_kept_as_far_back_as_the_reach_whenever_the_instant_is_told_of() {
    let reach = REACH as u64;
    // Scans are moved in memory between two of these, and the window is opened just after.
    for at in (1000..5000).step_by(40) {
        let heard = hear(0.0, told(at - reach, at));
        assert_eq!(heard.opened, [(at - reach, Origin::Line)], "{at}");
        let first = heard.reports[0].first_index;
        let kept = (first..).take(heard.samples()).map(|index| scan(index, 0.0));
        assert!(heard.scans().into_iter().eq(kept), "{at}");
    }
}

#[test]
fn a_window_is_opened_when_the_scan_comes_at_which_it_was_asked_for_and_not_before() {
    let (settings, mut meter, mut heard) = (paper(), Meter::new(), Collector::default());
    meter.keep_around(700, 1000, Origin::Request);
    meter.process(
        &settings,
        0,
        (0..1000).map(|index| scan(index, 0.0)).collect::<Vec<_>>(),
        &mut heard,
    );
    assert!(heard.opened.is_empty() && meter.is_armed());
    meter.process(&settings, 1000, [scan(1000, 0.0)], &mut heard);
    assert_eq!(heard.opened, [(700, Origin::Request)]);
    assert!(meter.is_measuring());
}

#[test]
#[cfg_attr(miri, ignore = "thousands of scans")]
fn the_scan_after_a_history_of_quiet_is_the_first_around_which_a_window_is_opened() {
    let history = u64::from(paper().window.history);
    assert_eq!(hear(0.0, told(history - 1, history - 1)).opened, []);
    let heard = hear(0.0, told(history, history));
    assert_eq!(heard.opened, [(history, Origin::Line)]);
}

#[test]
#[cfg_attr(miri, ignore = "tens of thousands of scans")]
fn an_instant_may_lie_ahead_and_one_that_passes_unarmed_does_not_come_later() {
    // As a host asks: the scan itself is awaited.
    let heard = hear(0.0, told(3777, 3777));
    assert_eq!(heard.opened, [(3777, Origin::Line)]);
    assert_eq!(heard.reports[0].trigger_index, 3777);
    let measured = hear(1500.0, told(2200, 2200));
    assert_eq!(measured.opened.len(), 1);
    let ahead = |first| (first == 0).then_some((5000, 5000));
    assert_eq!(hear(0.0, ahead).opened, [(5000, Origin::Line)]);
}
