//! Frames as bytes, one of each kind: yesterday's recordings must decode today.
//!
//! If a test here fails, the layout changed. Was that the purpose? Then raise `VERSION`, leave these frames
//! where they are with a test that they are refused as `Cause::Version(1)`, and add today's beside them.
//! Was it not? Then a message lost, gained or moved a field, or a text its bound: put it back.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use bead_wire::{
    Check, Codes, Decoder, Fault, FaultCause, Header, Health, Identity, Link, MAX_FRAME, MAX_REQUEST,
    Message, Outcome, Raw, Reply, Request, RequestDecoder, SelfTest, Settings, SettingsSource, Shape, Status,
    Strike, Sync, Waveform, encode, encode_request,
};

const HEADER: Header = Header {
    boot: 2,
    sequence: 0x0102_0304,
    sample_index: 0x0A_0000_0B0C,
};

/// The frames of version 1, delimiters included.
const GOLDEN: [(&str, &str); 13] = [
    (
        "identity",
        "000a010102040302010c0b01020a01012005302e312e301776302e312e302d332d67303132333435362d646972747930022a150e5133353930373182800414a08d0602e121c61a00",
    ),
    (
        "status",
        "000a010202040302010c0b01020a01010e80e497d012018090cad2c60e0306c801f0a20409801002011c508e7400",
    ),
    (
        "strike",
        "000a010302040302010c0b01020a01012a03d0c102f0c1029003f2aa32f7c1028080900cfdd0b509c0c586db6780e98cdc67018180026223892100",
    ),
    (
        "waveform",
        "000a010402040302010c0b01020a01010903d0c1020623c1ab0af0ff7f8001bbe610c100",
    ),
    (
        "fault",
        "000a010502040302010c0b01020a0101390101b4a480402d4346535220307830303030383230303a20627573206661756c74206174203078343030315f3234303020e280a6bb7fd0ac00",
    ),
    (
        "settings",
        "000a010602040302010c0b01020a01010707424541440106ffb5082f5800",
    ),
    (
        "health",
        "000a010702040302010c0b01020a01010305010402ac020bf0a204db1912f683aa9300",
    ),
    (
        "shape",
        "000a010802040302010c0b01020a01011d03d0c1028080d405b3e694018080c80e99f3d3348080d236a907fe6800",
    ),
    (
        "sync",
        "000a010902040302010c0b01020a01010f0bd0c102c706c806ac023d5b3ca600",
    ),
    (
        "reply",
        "000a011002040302010c0b01020a010116b2c302060c666f7220353030303020487aa36eb3bf00",
    ),
    (
        "raw",
        "000a011102040302010c0b01020a010108d0c1020623c1ab07f0ff0c8b8a3900",
    ),
    (
        "link",
        "000a011202040302010c0b01020a01011e80e497d0120c0102ac020405f0a20406070809a0b323a0d119f2375f5800",
    ),
    (
        "self_test",
        "000a011302040302010c0b01020a01010a0501d8f504267f5d5300",
    ),
];

/// The requests of version 1, delimiters included.
const REQUESTS: [&str; 11] = [
    "00090140b2a1fd6a409e00",
    "00060141b2a1ca03829f00",
    "00090142b2a193bec49d00",
    "000b0143b2a107424541440106fffaf5e70d00",
    "00090144b2a121c2499900",
    "00090145b2a116a88b9800",
    "00090146b2a14f16cd9a00",
    "00090147b2a1787c0f9b00",
    "000b0148b2a1c4135c83f45600",
    "00090149b2a17251919100",
    "0009014ab2a12befd79300",
];

fn requests() -> [Request<'static>; 11] {
    [
        Request::Identity,
        Request::Status,
        Request::ReadSettings,
        Request::WriteSettings {
            block: b"BEAD\x01\x00\xff",
        },
        Request::EraseSettings,
        Request::Arm,
        Request::Disarm,
        Request::SelfTest,
        Request::Raw { duration_ms: 2_500 },
        Request::ResetCounters,
        Request::Reboot,
    ]
}

/// What they say.
fn messages() -> [Message<'static>; 13] {
    const PACKED: [u8; 6] = [0x23, 0xC1, 0xAB, 0x00, 0xF0, 0xFF];
    [
        Message::Identity(Identity {
            firmware: "0.1.0",
            git: "v0.1.0-3-g0123456-dirty",
            uid: *b"\x30\x00\x2a\x00\x0e\x51\x33\x35\x39\x30\x37\x31",
            boot: 0x1_0002,
            reset_cause: 0x14,
            sample_rate_hz: 100_000,
            channels: 2,
        }),
        Message::Status(Status {
            uptime_ms: 5_000_000_000,
            epoch: 1,
            samples: 500_000_000_000,
            strikes: 3,
            overruns: 0,
            blocks_dropped: 200,
            frames_dropped_queue_full: 70_000,
            frames_dropped_too_long: 0,
            stack_free_min: 2_048,
            settings_source: SettingsSource::FlashRefused,
            armed: true,
        }),
        Message::Strike(Strike {
            strike: 3,
            first_index: 41_168,
            trigger_index: 41_200,
            samples: 400,
            peak_force: 412_345,
            peak_index: 41_207,
            acceleration_max: 12_713_984,
            acceleration_min: -9_876_543,
            absorbed_measured: 13_919_900_000,
            absorbed_predicted: 13_921_000_000,
            incident_energy: -1,
            flags: 0x8001,
        }),
        Message::Waveform(Waveform {
            strike: 3,
            first_index: 41_168,
            codes: Codes::from_bytes(&PACKED).unwrap(),
            absorbed_measured: -64,
            absorbed_predicted: 64,
        }),
        Message::Fault(Fault {
            cause: FaultCause::HardFault,
            boot: 1,
            pc: 0x0800_1234,
            detail: "CFSR 0x00008200: bus fault at 0x4001_2400 \u{2026}",
        }),
        Message::Settings(Settings {
            block: b"BEAD\x01\x00\xff",
        }),
        Message::Health(Health {
            frames_lost_by_reset: 5,
            strikes_cut: 1,
            force_stuck: 0,
            force_railed: 2,
            acceleration_stuck: 300,
            acceleration_railed: 0,
            supply_low: 70_000,
            supply_mv: 3_291,
            standing: Health::FORCE_RAILED | Health::SUPPLY_LOW,
        }),
        Message::Shape(Shape {
            strike: 3,
            first_index: 41_168,
            arrival: 11_862_016,
            width: 2_437_939,
            impulse: 15_269_888,
            ring_frequency: 110_426_521,
            ring_decay: 114_589_696,
        }),
        Message::Sync(Sync {
            edge: 11,
            index: 41_168,
            clocks: 839,
            clocks_per_sample: 840,
            missed: 300,
        }),
        Message::Reply(Reply {
            request: 0xA1B2,
            outcome: Outcome::SampleRate,
            detail: "for 50000 Hz",
        }),
        Message::Raw(Raw {
            first_index: 41_168,
            codes: Codes::from_bytes(&PACKED).unwrap(),
        }),
        Message::Link(Link {
            bytes: 5_000_000_000,
            requests: 12,
            overruns: 1,
            line_errors: 2,
            rejected_too_long: 300,
            rejected_cobs: 4,
            rejected_too_short: 5,
            rejected_crc: 70_000,
            rejected_version: 6,
            rejected_kind: 7,
            rejected_body: 8,
            rejected_trailing: 9,
            raw_sent: 580_000,
            raw_dropped: 420_000,
        }),
        Message::SelfTest(SelfTest {
            check: Check::Stack,
            passed: true,
            value: 80_600,
        }),
    ]
}

fn from_hex(hex: &str) -> Vec<u8> {
    (0..hex.len())
        .step_by(2)
        .map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap())
        .collect()
}

fn to_hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[test]
fn yesterdays_frames_decode() {
    for ((kind, hex), message) in GOLDEN.into_iter().zip(messages()) {
        let mut decoded = 0;
        Decoder::new().feed(&from_hex(hex), |result| {
            let frame = result.unwrap();
            assert_eq!((frame.header, frame.message), (HEADER, message), "{kind}");
            decoded += 1;
        });
        assert_eq!(decoded, 1, "{kind}");
    }
}

#[test]
fn todays_frames_are_the_same_bytes() {
    for ((kind, hex), message) in GOLDEN.into_iter().zip(messages()) {
        let mut buffer = [0; MAX_FRAME];
        assert_eq!(
            to_hex(encode(&HEADER, &message, &mut buffer).unwrap()),
            hex,
            "{kind}"
        );
    }
}

#[test]
fn requests_are_the_same_bytes_and_are_understood() {
    for (hex, request) in REQUESTS.into_iter().zip(requests()) {
        let mut buffer = [0; MAX_REQUEST];
        let sent = encode_request(0xA1B2, &request, &mut buffer).unwrap();
        assert_eq!(to_hex(sent), hex, "{request:?}");
        let mut decoder = RequestDecoder::new();
        let mut understood = 0;
        for byte in from_hex(hex) {
            if let Some(heard) = decoder.push(byte) {
                let heard = heard.unwrap();
                assert_eq!((heard.number, heard.request), (0xA1B2, request));
                understood += 1;
            }
        }
        assert_eq!(understood, 1, "{request:?}");
    }
}

#[test]
fn causes_and_sources_keep_their_numbers() {
    let causes = [
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
    ];
    for (number, cause) in (0..).zip(causes) {
        assert_eq!(postcard::to_slice(&cause, &mut [0; 2]).unwrap(), [number]);
        assert_eq!(serde_json::to_value(cause).unwrap(), cause.name());
    }
    let sources = [
        SettingsSource::BuiltIn,
        SettingsSource::Flash,
        SettingsSource::FlashRefused,
        SettingsSource::Stored,
    ];
    for (number, source) in (0..).zip(sources) {
        assert_eq!(postcard::to_slice(&source, &mut [0; 2]).unwrap(), [number]);
    }
    let outcomes = [
        Outcome::Done,
        Outcome::Version,
        Outcome::Kind,
        Outcome::Body,
        Outcome::OutOfRange,
        Outcome::SettingsInvalid,
        Outcome::SampleRate,
        Outcome::StoreFull,
        Outcome::FlashFailed,
    ];
    for (number, outcome) in (0..).zip(outcomes) {
        assert_eq!(postcard::to_slice(&outcome, &mut [0; 2]).unwrap(), [number]);
        assert_eq!(serde_json::to_value(outcome).unwrap(), outcome.name());
    }
    let checks = [
        Check::Supply,
        Check::Force,
        Check::Acceleration,
        Check::Acquisition,
        Check::Settings,
        Check::Stack,
        Check::Estimators,
        Check::Store,
    ];
    for (number, check) in (0..).zip(checks) {
        assert_eq!(postcard::to_slice(&check, &mut [0; 2]).unwrap(), [number]);
        assert_eq!(serde_json::to_value(check).unwrap(), check.name());
    }
}
