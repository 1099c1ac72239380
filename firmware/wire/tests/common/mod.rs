//! Messages that own what they say, drawn at random, for the tests of this folder.

#![allow(
    dead_code,
    unreachable_pub,
    missing_docs,
    reason = "each test uses some of it"
)]

use bead_wire::{
    Check, Codes, Decoder, Fault, FaultCause, Header, Health, Identity, Link, MAX_BLOCK, MAX_DETAIL,
    MAX_FIRMWARE, MAX_FRAME, MAX_GIT, MAX_SCANS, Message, Outcome, Raw, Reject, Reply, SelfTest, Settings,
    SettingsSource, Shape, Status, Strike, Sync, Waveform, encode,
};
use proptest::collection::vec;
use proptest::prelude::*;

/// A message with its text and bytes.
#[derive(Clone, Debug)]
pub enum Draft {
    Identity {
        firmware: String,
        git: String,
        uid: [u8; 12],
        boot: u32,
        reset_cause: u8,
        sample_rate_hz: u32,
    },
    Status(Status),
    Strike(Strike),
    Shape(Shape),
    Waveform {
        strike: u32,
        first_index: u64,
        packed: Vec<u8>,
        measured: i64,
        predicted: i64,
    },
    Fault {
        cause: FaultCause,
        boot: u32,
        pc: u32,
        detail: String,
    },
    Settings {
        block: Vec<u8>,
    },
    Health(Health),
    Sync(Sync),
    Reply {
        request: u16,
        outcome: Outcome,
        detail: String,
    },
    Raw {
        first_index: u64,
        packed: Vec<u8>,
    },
    Link(Link),
    SelfTest(SelfTest),
}

impl Draft {
    pub fn message(&self) -> Message<'_> {
        match self {
            Self::Identity {
                firmware,
                git,
                uid,
                boot,
                reset_cause,
                sample_rate_hz,
            } => Message::Identity(Identity {
                firmware,
                git,
                uid: *uid,
                boot: *boot,
                reset_cause: *reset_cause,
                sample_rate_hz: *sample_rate_hz,
                channels: 2,
            }),
            Self::Status(status) => Message::Status(*status),
            Self::Strike(strike) => Message::Strike(*strike),
            Self::Shape(shape) => Message::Shape(*shape),
            Self::Waveform {
                strike,
                first_index,
                packed,
                measured,
                predicted,
            } => Message::Waveform(Waveform {
                strike: *strike,
                first_index: *first_index,
                codes: Codes::from_bytes(packed).unwrap(),
                absorbed_measured: *measured,
                absorbed_predicted: *predicted,
            }),
            Self::Fault {
                cause,
                boot,
                pc,
                detail,
            } => Message::Fault(Fault {
                cause: *cause,
                boot: *boot,
                pc: *pc,
                detail,
            }),
            Self::Settings { block } => Message::Settings(Settings { block }),
            Self::Health(health) => Message::Health(*health),
            Self::Sync(sync) => Message::Sync(*sync),
            Self::Reply {
                request,
                outcome,
                detail,
            } => Message::Reply(Reply {
                request: *request,
                outcome: *outcome,
                detail,
            }),
            Self::Raw { first_index, packed } => Message::Raw(Raw {
                first_index: *first_index,
                codes: Codes::from_bytes(packed).unwrap(),
            }),
            Self::Link(link) => Message::Link(*link),
            Self::SelfTest(test) => Message::SelfTest(*test),
        }
    }
}

/// Text of at most `bytes` bytes, of characters of any width.
fn text(bytes: usize) -> impl Strategy<Value = String> {
    any::<String>().prop_map(move |text| text[..text.floor_char_boundary(bytes)].to_owned())
}

/// Codes of any scans, packed.
fn packed() -> impl Strategy<Value = Vec<u8>> {
    vec([0..4096u16, 0..4096u16], 0..=MAX_SCANS).prop_map(|scans| {
        let mut packed = vec![0; 3 * scans.len()];
        Codes::pack(scans, &mut packed).unwrap();
        packed
    })
}

pub fn draft() -> impl Strategy<Value = Draft> {
    let cause = prop::sample::select(vec![
        FaultCause::Panic,
        FaultCause::HardFault,
        FaultCause::Watchdog,
        FaultCause::AdcOverrun,
        FaultCause::DmaError,
        FaultCause::BlockLost,
        FaultCause::SettingsRefused,
        FaultCause::StackOverflow,
        FaultCause::StrikeCut,
        FaultCause::ForceStuck,
        FaultCause::ForceRailed,
        FaultCause::AccelerationStuck,
        FaultCause::AccelerationRailed,
        FaultCause::SupplyLow,
        FaultCause::Recovered,
    ]);
    let source = prop::sample::select(vec![
        SettingsSource::BuiltIn,
        SettingsSource::Flash,
        SettingsSource::FlashRefused,
        SettingsSource::Stored,
    ]);
    let outcome = prop::sample::select(vec![
        Outcome::Done,
        Outcome::Version,
        Outcome::Kind,
        Outcome::Body,
        Outcome::OutOfRange,
        Outcome::SettingsInvalid,
        Outcome::SampleRate,
        Outcome::StoreFull,
        Outcome::FlashFailed,
    ]);
    let check = prop::sample::select(vec![
        Check::Supply,
        Check::Force,
        Check::Acceleration,
        Check::Acquisition,
        Check::Settings,
        Check::Stack,
        Check::Estimators,
        Check::Store,
    ]);
    prop_oneof![
        (
            text(MAX_FIRMWARE),
            text(MAX_GIT),
            any::<[u8; 12]>(),
            any::<(u32, u8, u32)>()
        )
            .prop_map(
                |(firmware, git, uid, (boot, reset_cause, sample_rate_hz))| Draft::Identity {
                    firmware,
                    git,
                    uid,
                    boot,
                    reset_cause,
                    sample_rate_hz
                }
            ),
        (any::<(u64, u32, u64, [u32; 6])>(), source, any::<bool>()).prop_map(
            |((uptime_ms, epoch, samples, counts), settings_source, armed)| {
                let [
                    strikes,
                    overruns,
                    blocks_dropped,
                    queue_full,
                    too_long,
                    stack_free_min,
                ] = counts;
                Draft::Status(Status {
                    uptime_ms,
                    epoch,
                    samples,
                    strikes,
                    overruns,
                    blocks_dropped,
                    frames_dropped_queue_full: queue_full,
                    frames_dropped_too_long: too_long,
                    stack_free_min,
                    settings_source,
                    armed,
                })
            }
        ),
        any::<(u32, [u64; 3], u16, [i32; 3], [i64; 3], u16)>().prop_map(
            |(strike, [first_index, trigger_index, peak_index], samples, sensed, energies, flags)| {
                Draft::Strike(Strike {
                    strike,
                    first_index,
                    trigger_index,
                    samples,
                    peak_force: sensed[0],
                    peak_index,
                    acceleration_max: sensed[1],
                    acceleration_min: sensed[2],
                    absorbed_measured: energies[0],
                    absorbed_predicted: energies[1],
                    incident_energy: energies[2],
                    flags,
                })
            }
        ),
        any::<(u32, u64, u16, u16, u32)>().prop_map(|(edge, index, clocks, clocks_per_sample, missed)| {
            Draft::Sync(Sync {
                edge,
                index,
                clocks,
                clocks_per_sample,
                missed,
            })
        }),
        any::<(u32, u64, i64, [u32; 4])>().prop_map(|(strike, first_index, impulse, fine)| {
            Draft::Shape(Shape {
                strike,
                first_index,
                arrival: fine[0],
                width: fine[1],
                impulse,
                ring_frequency: fine[2],
                ring_decay: fine[3],
            })
        }),
        (any::<(u32, u64, i64, i64)>(), packed()).prop_map(
            |((strike, first_index, measured, predicted), packed)| Draft::Waveform {
                strike,
                first_index,
                packed,
                measured,
                predicted,
            }
        ),
        (any::<u64>(), packed()).prop_map(|(first_index, packed)| Draft::Raw { first_index, packed }),
        (any::<u16>(), outcome, text(MAX_DETAIL)).prop_map(|(request, outcome, detail)| Draft::Reply {
            request,
            outcome,
            detail
        }),
        (check, any::<(bool, u32)>()).prop_map(|(check, (passed, value))| Draft::SelfTest(SelfTest {
            check,
            passed,
            value
        })),
        any::<([u64; 3], [u32; 11])>().prop_map(|([bytes, raw_sent, raw_dropped], counts)| {
            let [
                requests,
                overruns,
                line_errors,
                too_long,
                cobs,
                too_short,
                rejected @ ..,
            ] = counts;
            let [crc, version, kind, body, trailing] = rejected;
            Draft::Link(Link {
                bytes,
                requests,
                overruns,
                line_errors,
                rejected_too_long: too_long,
                rejected_cobs: cobs,
                rejected_too_short: too_short,
                rejected_crc: crc,
                rejected_version: version,
                rejected_kind: kind,
                rejected_body: body,
                rejected_trailing: trailing,
                raw_sent,
                raw_dropped,
            })
        }),
        (cause, any::<(u32, u32)>(), text(MAX_DETAIL)).prop_map(|(cause, (boot, pc), detail)| Draft::Fault {
            cause,
            boot,
            pc,
            detail
        }),
        vec(any::<u8>(), 0..=MAX_BLOCK).prop_map(|block| Draft::Settings { block }),
        any::<([u32; 7], u16, u8)>().prop_map(|(counts, supply_mv, standing)| {
            let [
                frames_lost_by_reset,
                strikes_cut,
                force_stuck,
                force_railed,
                acceleration_stuck,
                acceleration_railed,
                supply_low,
            ] = counts;
            Draft::Health(Health {
                frames_lost_by_reset,
                strikes_cut,
                force_stuck,
                force_railed,
                acceleration_stuck,
                acceleration_railed,
                supply_low,
                supply_mv,
                standing,
            })
        }),
    ]
}

/// A message that is not an identity: one that cannot open a boot.
pub fn unopening() -> impl Strategy<Value = Draft> {
    draft().prop_filter("an identity", |draft| !matches!(draft, Draft::Identity { .. }))
}

pub fn bytes(boot: u8, sequence: u32, message: &Message<'_>) -> Vec<u8> {
    let header = Header {
        boot,
        sequence,
        sample_index: u64::from(sequence) * 32,
    };
    encode(&header, message, &mut [0; MAX_FRAME]).unwrap().to_vec()
}

/// Frame of a message that says nothing, for tests of what is around it.
pub fn filler(boot: u8, sequence: u32) -> Vec<u8> {
    bytes(
        boot,
        sequence,
        &Message::Settings(Settings { block: b"\x01\x02" }),
    )
}

/// Feeds a stream; gives the sequence numbers of the frames, and the rejects.
pub fn decode(decoder: &mut Decoder, stream: &[u8]) -> (Vec<u32>, Vec<Reject>) {
    let (mut sequences, mut rejects) = (Vec::new(), Vec::new());
    decoder.feed(stream, |result| match result {
        Ok(frame) => sequences.push(frame.header.sequence),
        Err(reject) => rejects.push(reject),
    });
    (sequences, rejects)
}
