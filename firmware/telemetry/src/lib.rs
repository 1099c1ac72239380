//! The results of `bead-model` as the messages of `bead-wire`: once for the image, the replay on the host,
//! and tests.
//!
//! # Design
//! The model computes in fixed point and the wire carries the same bits. Both crates know nothing of each
//! other; this one knows which quantity of the one becomes which field of the other.
#![no_std]
#![forbid(unsafe_code)]

use bead_model::{Chunk, Flags, Scan, Settings, StrikeReport, sensor};
use bead_wire::{
    Acceleration, Codes, Decay, Energy, Force, Fraction, Frequency, GainMatch, Impulse, Kind, MAX_SCANS,
    Packed, Raw, Samples, Shape, Strike, StrikeFlags, Waveform, taken,
};

// A piece of a window fills a frame, and the flags of a window are the same bits at both ends.
const _: () = assert!(bead_model::meter::CHUNK == MAX_SCANS);
const _: () = {
    let pairs = [
        (Flags::FORCE_RAILED, StrikeFlags::FORCE_RAILED),
        (Flags::ACCELERATION_RAILED, StrikeFlags::ACCELERATION_RAILED),
        (Flags::CHAIN_RANGE, StrikeFlags::CHAIN_RANGE),
        (Flags::ESTIMATES_DIFFER, StrikeFlags::ESTIMATES_DIFFER),
        (Flags::INTRUDER_DRIFTED, StrikeFlags::INTRUDER_DRIFTED),
        (Flags::GAINS_DIFFER, StrikeFlags::GAINS_DIFFER),
    ];
    let mut at = 0;
    while at < pairs.len() {
        assert!(pairs[at].0.bits() == pairs[at].1.bits());
        at += 1;
    }
};

/// Bytes of the bead's outbox: the windows of three strikes, about 3.6 KB each.
pub const OUTBOX: usize = 13 * 1024;
/// Bytes of it that waveforms, strikes, raw scans and edges leave free: room for all that a request can ask
/// for, and for all that is told every second.
pub const KEPT: usize = 2048;

/// Bytes of an outbox ([`bead_wire::Queue`]) that the frames of a window take at most, when every piece of it
/// is loud.
pub fn room_for_window(settings: &Settings) -> usize {
    let frame = |kind: Kind| taken(Packed::HEADER + kind.longest());
    let pieces = usize::from(settings.window.length).div_ceil(MAX_SCANS);
    pieces * frame(Kind::Waveform) + frame(Kind::Strike) + frame(Kind::Shape)
}

/// The strike frame of a report, with the flags that the bead sets from its state outside the window
/// ([`StrikeFlags::OF_THE_BEAD`]).
pub fn strike(report: &StrikeReport, of_the_bead: StrikeFlags) -> Strike {
    Strike {
        strike: report.strike,
        first_index: report.first_index,
        trigger_index: report.trigger_index,
        samples: report.samples,
        peak_force: Force::from_bits(report.peak_force.to_bits()),
        peak_index: report.peak_index,
        acceleration_max: Acceleration::from_bits(report.acceleration_max.to_bits()),
        acceleration_min: Acceleration::from_bits(report.acceleration_min.to_bits()),
        absorbed_measured: energy(report.absorbed_measured),
        absorbed_predicted: energy(report.absorbed_predicted),
        incident_energy: energy(report.incident_energy),
        absorbed_fraction: Fraction::from_bits(report.absorbed_fraction.to_bits()),
        noise_energy: energy(report.noise_energy),
        force_noise: Force::from_bits(report.force_noise.to_bits()),
        flags: StrikeFlags::from_bits(report.flags.bits()).with(of_the_bead),
    }
}

/// The shape frame of a report.
pub fn shape(report: &StrikeReport) -> Shape {
    let shape = &report.shape;
    let gains = |gains: sensor::GainMatch| GainMatch {
        deviation: Fraction::from_bits(gains.deviation.to_bits()),
        uncertainty: Fraction::from_bits(gains.uncertainty.to_bits()),
    };
    Shape {
        strike: report.strike,
        first_index: report.first_index,
        arrival: Samples::from_bits(shape.arrival.to_bits()),
        width: Samples::from_bits(shape.width.to_bits()),
        impulse: Impulse::from_bits(shape.impulse.to_bits()),
        ring_frequency: Frequency::from_bits(shape.ring_frequency.to_bits()),
        ring_decay: Decay::from_bits(shape.ring_decay.to_bits()),
        force_gains: shape.force_gains.map(gains),
        acceleration_gains: shape.acceleration_gains.map(gains),
    }
}

/// Packs the waveform frame of a piece of a window. Returns whether it is whole, which it always is.
#[inline(never)]
pub fn pack_waveform(packed: &mut Packed, address: u8, boot: u8, chunk: &Chunk) -> bool {
    packed
        .pack_body(address, boot, Kind::Waveform, &waveform(chunk))
        .is_ok()
}

/// The waveform frame of a piece of a window. The codes at the low gain travel only if they had a part in the
/// estimates.
pub fn waveform(chunk: &Chunk) -> Waveform {
    let scans = match chunk.loud {
        true => &chunk.scans[..],
        false => &[],
    };
    let before = &chunk.before[..if chunk.loud { 2 } else { 0 }];
    Waveform {
        strike: chunk.strike,
        first_index: chunk.first_index,
        codes: pack(chunk.scans.iter().copied().map(Scan::sensitive)),
        wide: pack(before.iter().chain(scans).copied().map(Scan::wide)),
        absorbed_measured: energy(chunk.absorbed_measured),
        absorbed_predicted: energy(chunk.absorbed_predicted),
    }
}

/// The frame of a piece of a raw stream: at most [`MAX_SCANS`] scans from this index on.
pub fn raw(first_index: u64, scans: impl Iterator<Item = Scan>) -> Raw {
    Raw {
        first_index,
        codes: pack(scans.map(Scan::sensitive)),
    }
}

fn energy(energy: bead_model::Energy) -> Energy {
    Energy::from_bits(energy.to_bits())
}

fn pack<const BYTES: usize>(scans: impl Iterator<Item = [u16; 2]>) -> Codes<BYTES> {
    // No `expect`: it would print the error, and formats take flash.
    let Ok(codes) = Codes::pack(scans) else {
        panic!("a piece has at most MAX_SCANS scans, of codes of 12 bits");
    };
    codes
}
