//! Settings over the link: in force from the next strike on and after a reset, and refused by name.

use bead_model::SettingsError;
use bead_store::Store;
use bead_testing::{PowerCutFlash, block, paper_settings, settings_at, write};
use bead_wire::{
    ANY, FaultCause, MAX_REQUEST, Outcome, Request, SettingsSource, StrikeFlags, encode_request,
};
use crc::{CRC_32_ISO_HDLC, Crc};

use crate::bead::{SECTOR, StartState, TestBead, status, windows_of};

/// A block with other contents, and a checksum that holds.
fn forged(change: impl Fn(&mut Vec<u8>)) -> Vec<u8> {
    let mut bytes = windows_of(300);
    bytes.truncate(bytes.len() - 4);
    change(&mut bytes);
    let crc = Crc::<u32>::new(&CRC_32_ISO_HDLC).checksum(&bytes);
    bytes.extend(crc.to_le_bytes());
    bytes
}

#[test]
fn each_way_of_being_no_valid_settings_is_refused_by_name_and_leaves_flash_alone() {
    // The damping of the intruder and the place where a block has it: after the name, the address and four
    // numbers. With 0 in its place the checksum holds.
    const DAMPING: usize = 8 + 16 + 1 + 4 * 8;
    let good = windows_of(300);
    let mut damaged = good.clone();
    damaged[20] ^= 1;
    let cut = good[..good.len() - 1].to_vec();
    let shorter = |bytes: &mut Vec<u8>| {
        bytes.pop();
        bytes[6] -= 1;
    };
    let damping = "settings that a bead cannot work with: intruder.damping must be above 0";
    let invalid = [
        (
            forged(|bytes| bytes[4] = 8),
            SettingsError::Version(8).to_string(),
        ),
        (damaged, SettingsError::Checksum.to_string()),
        (cut, SettingsError::Truncated.to_string()),
        (
            [&good[..], &[0]].concat(),
            "bytes follow the settings block".into(),
        ),
        (b"not a settings block".to_vec(), SettingsError::Magic.to_string()),
        (Vec::new(), SettingsError::Truncated.to_string()),
        (forged(shorter), SettingsError::Body.to_string()),
        (
            forged(|bytes| bytes[DAMPING..DAMPING + 8].fill(0)),
            damping.into(),
        ),
    ];
    let mut bead = TestBead::new();
    let flash = bead.flash.0.borrow().bytes.clone();
    for (block, why) in invalid {
        assert_eq!(bead.answer(&write(&block)), (Outcome::SettingsInvalid, why));
    }
    for rate in [50_000, 200_000] {
        let why = format!("settings for {rate} Hz; this image samples at 100000 Hz");
        assert_eq!(
            bead.answer(&write(&block(&settings_at(rate)))),
            (Outcome::SampleRate, why)
        );
    }
    assert_eq!(bead.flash.0.borrow().bytes, flash);
    bead.ask(&Request::ReadSettings);
    assert_eq!(bead.running.blocks(), [block(&paper_settings())]);
    assert_eq!(status(&mut bead).0.settings_source, SettingsSource::Flash);
}

#[test]
fn what_a_start_finds_decides_which_settings_hold_what_it_tells_and_whether_it_looks_for_strikes() {
    let mut damaged = block(&paper_settings());
    damaged[20] ^= 1;
    let later = forged(|bytes| bytes[4] = 8);
    let cases = [
        (block(&paper_settings()), SettingsSource::Flash, None, true),
        (vec![0xFF; 100], SettingsSource::BuiltIn, None, true),
        (
            damaged,
            SettingsSource::FlashRefused,
            Some("wrong checksum"),
            true,
        ),
        (
            block(&settings_at(50_000)),
            SettingsSource::FlashRefused,
            Some("the settings are for another sample rate"),
            true,
        ),
        (
            later,
            SettingsSource::FlashRefused,
            Some("a block of another version: arm the bead by request"),
            false,
        ),
    ];
    for (probe, source, refused, armed) in cases {
        let mut bead = TestBead::probed(probe);
        bead.run(0.01);
        let expected: Vec<_> = refused
            .iter()
            .map(|why| (FaultCause::SettingsRefused, (*why).to_owned()))
            .collect();
        assert_eq!(bead.running.faults(), expected);
        let status = status(&mut bead).0;
        assert_eq!((status.settings_source, status.armed), (source, armed));
        // A bead that did not look for strikes does so once a host arms it.
        assert_eq!(bead.outcome(&Request::Arm), Outcome::Done);
        bead.run(0.01);
        let strikes = bead.strike();
        let flagged = strikes[0].flags.has(StrikeFlags::SETTINGS_NOT_OWNERS);
        assert_eq!(flagged, source != SettingsSource::Flash);
    }
}

#[test]
fn a_stored_block_that_this_image_does_not_know_stays_in_the_store_and_the_one_of_the_probe_holds() {
    let mut bead = TestBead::new();
    assert_eq!(bead.outcome(&write(&windows_of(300))), Outcome::Done);
    // Its version, where the store has it; the store's own checksum of the record comes before.
    let other = forged(|bytes| bytes[4] = 8);
    let (mut store, _) = Store::open(PowerCutFlash::<SECTOR>::blank(2), 0..2 * SECTOR as u32);
    store.write(&other).expect("there is room");
    *bead.flash.0.borrow_mut() = store.into_flash();
    let before = bead.flash.0.borrow().bytes.clone();
    let mut bead = bead.reboot(&Request::Reboot);
    bead.run(0.01);
    assert_eq!(bead.running.causes(), [FaultCause::SettingsRefused]);
    assert_eq!(bead.running.blocks(), [block(&paper_settings())]);
    let status = status(&mut bead).0;
    assert_eq!(
        (status.settings_source, status.armed),
        (SettingsSource::Flash, false)
    );
    assert_eq!(bead.flash.0.borrow().bytes, before, "another image may know it");
}

#[test]
fn a_full_store_refuses_and_takes_more_after_a_reset() {
    let range = 0..2 * SECTOR as u32;
    let (mut store, _) = Store::open(PowerCutFlash::<SECTOR>::blank(2), range.clone());
    let blocks = std::iter::repeat_with(|| store.write(&windows_of(300)));
    let all = blocks.take_while(Result::is_ok).count();
    let (mut store, _) = Store::open(PowerCutFlash::<SECTOR>::blank(2), range);
    (3..all).for_each(|_| store.write(&windows_of(300)).expect("there is room"));
    let start = StartState::default();
    *start.flash.0.borrow_mut() = store.into_flash();
    let mut bead = TestBead::start(start);
    for length in 301..304 {
        assert_eq!(bead.outcome(&write(&windows_of(length))), Outcome::Done);
    }
    let refused = bead.answer(&write(&windows_of(304)));
    let why = "no room in flash for another block; reboot the bead to make room";
    assert_eq!(refused, (Outcome::StoreFull, why.into()));
    let mut bead = bead.reboot(&Request::Reboot);
    assert_eq!(bead.outcome(&write(&windows_of(305))), Outcome::Done);
    assert_eq!(bead.running.blocks(), [303, 305].map(windows_of));
}

#[test]
fn without_a_block_of_a_probe_settings_are_stored_over_the_built_in_ones() {
    let mut bead = TestBead::probed(vec![0xFF; 100]);
    assert_eq!(bead.outcome(&write(&windows_of(300))), Outcome::Done);
    let said = bead.answer(&Request::EraseSettings);
    assert_eq!(said, (Outcome::Done, "built in, as flash has none".into()));
    assert_eq!(bead.running.blocks()[1], windows_of(300));
    assert_eq!(status(&mut bead).0.settings_source, SettingsSource::BuiltIn);
}

#[test]
fn a_bead_answers_its_own_address_and_every_beads_and_says_it_in_its_frames() {
    let mut bead = TestBead::with(|bead| bead.address = 7);
    for (address, number) in [(7, 100), (8, 101), (ANY, 102)] {
        let mut buffer = [0; MAX_REQUEST];
        let request = encode_request(address, number, &Request::Identity, &mut buffer);
        bead.receive(request.expect("it fits"));
    }
    bead.run(0.1);
    let frames = &bead.running.frames;
    assert_eq!(
        bead.running.replies(),
        [100, 102].map(|number| (number, Outcome::Done))
    );
    assert!(frames.iter().all(|(header, _)| header.address == 7));
}
