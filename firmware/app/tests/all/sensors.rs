//! Sensors and supply: faults are reported when they begin and when they end, and flag strikes.

use bead_wire::{FaultCause, Gap, Health, Standing, StrikeFlags};

use crate::bead::{TestBead, quiet, status, struck};

/// Holds a channel pair of the signal at this code from one scan to another.
fn held(pair: usize, code: u16, scans: std::ops::Range<u64>) -> Box<dyn FnMut(u64) -> [u16; 4]> {
    Box::new(move |index| {
        let mut codes = quiet(index);
        if scans.contains(&index) {
            codes[pair..pair + 2].fill(code);
        }
        codes
    })
}

#[test]
fn a_sensor_that_is_stuck_or_railed_for_70_ms_is_told_once_wherever_it_begins_and_when_it_is_over() {
    type Count = fn(&Health) -> u32;
    let cases: [(usize, u16, FaultCause, Count); 4] = [
        (0, 1500, FaultCause::ForceStuck, |health| health.force_stuck),
        (0, 4095, FaultCause::ForceRailed, |health| health.force_railed),
        (2, 1500, FaultCause::AccelerationStuck, |health| {
            health.acceleration_stuck
        }),
        (2, 3, FaultCause::AccelerationRailed, |health| {
            health.acceleration_railed
        }),
    ];
    for (pair, code, cause, count) in cases {
        for n in 0..12 {
            let start = 20_000 + 137 * n;
            let mut bead = TestBead::new();
            bead.running.signal = held(pair, code, start..start + 7_000);
            bead.run(0.4);
            let name = cause.name().expect("it has one").to_owned();
            let faults = bead.running.faults();
            assert_eq!(faults[0].0, cause, "{n}");
            assert_eq!(faults[1..], [(FaultCause::Recovered, name)], "{n}");
            let health = status(&mut bead).1;
            assert_eq!((count(&health), health.standing), (1, Standing::NONE));
        }
    }
}

#[test]
fn a_sensor_that_is_still_for_40_ms_is_not_stuck() {
    let mut bead = TestBead::new();
    bead.running.signal = held(2, 1500, 20_000..24_000);
    bead.run(0.4);
    assert_eq!(bead.running.causes(), []);
}

#[test]
fn a_sensor_that_stands_still_in_the_ring_down_flags_the_strike_and_is_counted() {
    for (still, flagged) in [(80, true), (150, true), (250, true), (10_000, false)] {
        let mut bead = TestBead::new();
        bead.running.signal = Box::new(move |index| {
            let mut codes = struck(index, 600);
            if index > 600 + still {
                codes[2..].fill(1100);
            }
            codes
        });
        bead.run(0.03);
        let strikes = bead.running.strikes();
        assert_eq!(
            strikes[0].flags.has(StrikeFlags::SENSOR_STILL),
            flagged,
            "{still}"
        );
        assert_eq!(status(&mut bead).3.strikes_still, u32::from(flagged));
    }
}

#[test]
fn a_low_supply_is_told_when_it_begins_and_20_ms_after_it_is_over() {
    let mut bead = TestBead::new();
    bead.run(0.01);
    for low in [true, false, true, false] {
        bead.running.hardware.supply_is_low.set(low);
        bead.run(0.01);
        assert_eq!(status(&mut bead).1.standing, Standing::SUPPLY_LOW);
    }
    bead.run(0.03);
    assert_eq!(
        bead.running.causes(),
        [FaultCause::SupplyLow, FaultCause::Recovered]
    );
    let health = status(&mut bead).1;
    assert_eq!((health.supply_low, health.standing), (1, Standing::NONE));
}

#[test]
fn a_window_that_a_gap_cuts_has_no_result_and_is_counted_and_the_gap_is_told() {
    let mut bead = TestBead::new();
    bead.running.signal = Box::new(|index| struck(index, 251));
    bead.run(0.004);
    bead.running.index += 1000;
    bead.running.epoch += 1;
    bead.run(0.03);
    assert_eq!(bead.running.strikes(), []);
    assert_eq!(bead.running.causes(), [FaultCause::StrikeCut]);
    let gaps = bead.running.all::<Gap>();
    let gaps: Vec<_> = gaps
        .map(|gap| (gap.epoch, gap.first_index, gap.end_index))
        .collect();
    assert_eq!(gaps, [(1, 401, 1401)]);
    assert_eq!(status(&mut bead).1.strikes_cut, 1);
    assert_eq!(bead.strike()[0].strike, 1, "the cut one has a number");
}
