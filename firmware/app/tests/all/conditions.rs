//! Supply and temperature: measured between strikes, sent with each strike, and compared with the settings.

use bead_model::design::Supply;
use bead_wire::{Conditions, Shape, StrikeFlags};

use crate::bead::{TestBead, quiet, status, struck};

/// The paper's bead, calibrated at 3.3 V.
fn calibrated() -> TestBead {
    TestBead::with(|bead| bead.supply = Some(Supply { voltage: 3.3 }))
}

/// Conditions in the shape frames.
fn conditions(bead: &TestBead) -> Vec<Option<Conditions>> {
    bead.running
        .all::<Shape>()
        .map(|shape| shape.conditions)
        .collect()
}

#[test]
fn each_strike_has_supply_and_temperature_and_is_flagged_beyond_a_third_of_a_percent_of_the_calibration() {
    let mut off = Vec::new();
    for (supply, celsius, flagged) in [
        (3.3, 25.0, false),
        (3.3, -40.0, false),
        (3.295, 85.0, false),
        (3.305, 25.0, false),
        (3.27, 25.0, true),
        (3.2, 25.0, true),
        (3.35, 25.0, true),
        (3.1, 25.0, true),
        (3.0, 105.0, true),
    ] {
        let (mut known, mut unknown) = (calibrated(), TestBead::new());
        for bead in [&mut known, &mut unknown] {
            bead.running.hardware.supply.set([supply, celsius]);
            bead.run(0.05);
            let strike = bead.strike()[0];
            let [Some(found)] = conditions(bead)[..] else {
                panic!("{supply} V: {:?}", conditions(bead));
            };
            // Half a code of 1502, and of the 248 codes of 80 °C.
            assert!(
                (found.supply.volts() / supply - 1.0).abs() < 4e-4,
                "{supply} V: {found:?}"
            );
            let temperature = found.die_temperature.degrees_celsius();
            assert!((temperature - celsius).abs() < 0.5, "{celsius} °C: {temperature}");
            let millivolts = f64::from(status(bead).1.supply_mv);
            assert!((millivolts / 1e3 - found.supply.volts()).abs() < 1e-3);
            off.push(strike.flags.has(StrikeFlags::SUPPLY_OFF));
        }
        assert_eq!(off, [flagged, false], "{supply} V");
        off.clear();
    }
}

#[test]
fn a_supply_that_was_never_measured_is_no_zero_and_flags_strikes_of_a_calibrated_bead() {
    // Erased words, the codes of a converter that hangs, and a temperature sensor without calibration points.
    type Break = fn(&mut TestBead);
    let breaks: [Break; 3] = [
        |bead| {
            let mut factory = bead.running.hardware.factory.get();
            (factory.reference, factory.temperatures) = (0xFFFF, [0xFFFF; 2]);
            bead.running.hardware.factory.set(factory);
        },
        |bead| bead.running.hardware.supply.set([1e9, 25.0]),
        |bead| {
            let mut factory = bead.running.hardware.factory.get();
            factory.temperatures[1] = factory.temperatures[0];
            bead.running.hardware.factory.set(factory);
        },
    ];
    for damage in breaks {
        let mut bead = calibrated();
        damage(&mut bead);
        bead.run(0.2);
        assert!(bead.strike()[0].flags.has(StrikeFlags::SUPPLY_OFF));
        assert_eq!(conditions(&bead), [None]);
        assert_eq!(status(&mut bead).1.supply_mv, 0);
    }
    // The first pair of conversions is there before the first window can end.
    let mut bead = calibrated();
    assert!(!bead.strike()[0].flags.has(StrikeFlags::SUPPLY_OFF));
}

#[test]
fn the_supply_is_measured_ten_times_a_second_and_not_while_a_strike_is_unless_strikes_never_end() {
    let mut bead = calibrated();
    bead.run(0.05);
    for supply in [3.2, 3.3, 3.25] {
        bead.running.hardware.supply.set([supply, 25.0]);
        bead.run(0.3);
        let found = f64::from(status(&mut bead).1.supply_mv) / 1e3;
        assert!((found - supply).abs() < 2e-3, "{supply} V: {found}");
    }
    // A measurement of 16 conversions in 16 of 66 blocks.
    bead.running.hardware.conversions.set(0);
    bead.run(10.0);
    let conversions = bead.running.hardware.conversions.get();
    assert!((1150..1250).contains(&conversions), "{conversions}");
    // Every block has a strike in it: 5 s without a measurement, then one in spite of them.
    let start = bead.running.index + 250;
    bead.running.signal = Box::new(move |index| match index.checked_sub(start) {
        Some(since) => struck(since % 690, 0),
        None => quiet(index),
    });
    bead.run(5.0);
    bead.running.hardware.supply.set([3.1, 25.0]);
    bead.run(6.0);
    let found = f64::from(status(&mut bead).1.supply_mv) / 1e3;
    assert!((found - 3.1).abs() < 2e-3, "{found}");
}
