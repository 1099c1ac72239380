//! A monitor with a strike, for tests.

use bead_recording::frames::{FrameReader, Item};
use bead_testing::{Speaker, block_of, paper_settings, struck_codes};
use bead_wire::{Body, Health, Identity, Shape, Status, Strike};

use crate::model::{Monitor, SharedMonitor};

/// The frames of a bead at address 7 that was struck once.
pub(crate) fn frames() -> Vec<u8> {
    let mut bead = Speaker::at(7);
    assert_eq!(bead.measure(&paper_settings(), struck_codes()), 1);
    let identity: Identity = bead.identity();
    bead.say(1300, identity);
    let status = Status {
        armed: true,
        ..Status::draw(&mut || 0)
    };
    bead.say(1300, status);
    let supply_mv = 3300;
    bead.say(
        1300,
        Health {
            supply_mv,
            ..Health::default()
        },
    );
    bead.bytes
}

/// A monitor of that bead.
pub(crate) fn struck() -> SharedMonitor {
    let monitor = SharedMonitor::new(Monitor::new(vec!["test".to_owned()], "no recording".to_owned()));
    let mut reader = FrameReader::default();
    reader.feed(&frames(), Some(1), |item: Item| monitor.lock().push(0, &item));
    monitor
}

/// Lets a bead say strikes after its identity and settings, `count` of them, without their samples.
pub(crate) fn strike_again(bead: &mut Speaker, count: u32) {
    let identity: Identity = bead.identity();
    bead.say(0, identity);
    bead.say(0, block_of(&paper_settings()));
    for number in 0..count {
        let strike = Strike {
            strike: number,
            first_index: 1000 * u64::from(number),
            samples: 0,
            ..Strike::draw(&mut || 0)
        };
        let shape = Shape {
            strike: number,
            first_index: strike.first_index,
            ..Shape::default()
        };
        bead.say(strike.first_index, strike);
        bead.say(strike.first_index, shape);
    }
}
