//! Frames as the host keeps and shows them.
//!
//! # Design
//! `bead-wire` gives frames that borrow from its buffer; here they own what they say and stay as they came:
//! fixed-point bits, ADC codes. Only [`Frame::json`] turns them into SI units, each beside its bits, so that
//! nothing is lost in what `bead decode` prints.

use std::fmt::Write;

use bead_model::{Flags, Settings};
use bead_wire::{
    ACCELERATION_UNIT_MPS2, Arrival, Counters, Decoder, ENERGY_UNIT_J, FINE_UNIT, FORCE_UNIT_N,
    FRACTION_UNIT, FaultCause, GainMatch, Header, Health, IMPULSE_UNIT_N_SAMPLES, Kind, Link, Outcome,
    Reject, SelfTest, Shape, Status, Strike, Sync,
};
use serde_json::{Map, Value, json};

/// A frame that passed every check.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Boot, sequence number, sample index.
    pub header: Header,
    /// How it follows on the frames before it.
    pub arrival: Arrival,
    /// Scans a second, in hertz, as the last identity before it said.
    pub sample_rate_hz: Option<u32>,
    /// What it says.
    pub message: Message,
}

/// What a frame says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Message {
    /// Who is speaking.
    Identity(Identity),
    /// Counters and health.
    Status(Status),
    /// The result of one strike.
    Strike(Strike),
    /// What the samples of one strike say beyond its energies.
    Shape(Shape),
    /// A run of samples of a strike.
    Waveform(Waveform),
    /// Something went wrong.
    Fault(Fault),
    /// The settings block in force, as `bead-model` encoded it.
    Settings(Vec<u8>),
    /// How often sensors and supply failed.
    Health(Health),
    /// An edge on the sync input.
    Sync(Sync),
    /// The answer to one request.
    Reply(Reply),
    /// A run of samples, whether there is a strike or not.
    Raw(Raw),
    /// What came in over the link.
    Link(Link),
    /// The result of one check of a self-test.
    SelfTest(SelfTest),
}

/// [`bead_wire::Identity`] with its own text.
#[derive(Clone, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the fields are those of the wire")]
pub struct Identity {
    pub firmware: String,
    pub git: String,
    pub uid: [u8; 12],
    pub boot: u32,
    pub reset_cause: u8,
    pub sample_rate_hz: u32,
    pub channels: u8,
}

/// [`bead_wire::Waveform`] unpacked.
#[derive(Clone, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the fields are those of the wire")]
pub struct Waveform {
    pub strike: u32,
    pub first_index: u64,
    /// ADC codes at the high gain, force then acceleration.
    pub codes: Vec<[u16; 2]>,
    /// Those at the low gain, where they had a part in the estimates: of the two scans before, then of these.
    pub wide: Vec<[u16; 2]>,
    pub absorbed_measured: i64,
    pub absorbed_predicted: i64,
}

/// [`bead_wire::Fault`] with its own text.
#[derive(Clone, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the fields are those of the wire")]
pub struct Fault {
    pub cause: FaultCause,
    pub boot: u32,
    pub pc: u32,
    pub detail: String,
}

/// [`bead_wire::Reply`] with its own text.
#[derive(Clone, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the fields are those of the wire")]
pub struct Reply {
    pub request: u16,
    pub outcome: Outcome,
    pub detail: String,
}

/// [`bead_wire::Raw`] unpacked.
#[derive(Clone, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the fields are those of the wire")]
pub struct Raw {
    pub first_index: u64,
    /// ADC codes, force then acceleration.
    pub codes: Vec<[u16; 2]>,
}

/// What stood between two delimiters.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Item {
    /// A frame.
    Frame(Frame),
    /// Bytes that are none.
    Rejected(Reject),
}

/// Bytes to frames, over any number of reads.
#[derive(Clone, Debug, Default)]
pub struct Reader {
    decoder: Decoder,
    sample_rate_hz: Option<u32>,
}

impl Reader {
    /// A reader that has read nothing.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes bytes as received, and hands on each frame and each reject.
    pub fn feed(&mut self, bytes: &[u8], mut sink: impl FnMut(Item)) {
        let Self {
            decoder,
            sample_rate_hz,
        } = self;
        decoder.feed(bytes, |result| {
            sink(match result {
                Ok(frame) => {
                    let message = Message::from(frame.message);
                    if let Message::Identity(identity) = &message {
                        *sample_rate_hz = Some(identity.sample_rate_hz);
                    }
                    let (header, arrival) = (frame.header, frame.arrival);
                    Item::Frame(Frame {
                        header,
                        arrival,
                        sample_rate_hz: *sample_rate_hz,
                        message,
                    })
                }
                Err(reject) => Item::Rejected(reject),
            });
        });
    }

    /// What came, what was refused and what never came.
    pub fn counters(&self) -> &Counters {
        self.decoder.counters()
    }

    /// Bytes after the last delimiter: at the end of a stream, a frame cut short.
    pub fn pending(&self) -> u64 {
        self.decoder.pending()
    }
}

/// A whole stream at once: its frames, and what became of the others.
pub fn decode(bytes: &[u8]) -> (Vec<Frame>, Counters) {
    let (mut reader, mut frames) = (Reader::new(), Vec::new());
    reader.feed(bytes, |item| {
        if let Item::Frame(frame) = item {
            frames.push(frame);
        }
    });
    (frames, *reader.counters())
}

impl From<bead_wire::Message<'_>> for Message {
    fn from(message: bead_wire::Message<'_>) -> Self {
        match message {
            bead_wire::Message::Identity(identity) => Self::Identity(Identity {
                firmware: identity.firmware.to_owned(),
                git: identity.git.to_owned(),
                uid: identity.uid,
                boot: identity.boot,
                reset_cause: identity.reset_cause,
                sample_rate_hz: identity.sample_rate_hz,
                channels: identity.channels,
            }),
            bead_wire::Message::Status(status) => Self::Status(status),
            bead_wire::Message::Strike(strike) => Self::Strike(strike),
            bead_wire::Message::Shape(shape) => Self::Shape(shape),
            bead_wire::Message::Waveform(waveform) => Self::Waveform(Waveform {
                strike: waveform.strike,
                first_index: waveform.first_index,
                codes: waveform.codes.iter().collect(),
                wide: waveform.wide.iter().collect(),
                absorbed_measured: waveform.absorbed_measured,
                absorbed_predicted: waveform.absorbed_predicted,
            }),
            bead_wire::Message::Fault(fault) => Self::Fault(Fault {
                cause: fault.cause,
                boot: fault.boot,
                pc: fault.pc,
                detail: fault.detail.to_owned(),
            }),
            bead_wire::Message::Settings(settings) => Self::Settings(settings.block.to_owned()),
            bead_wire::Message::Health(health) => Self::Health(health),
            bead_wire::Message::Sync(sync) => Self::Sync(sync),
            bead_wire::Message::Reply(reply) => Self::Reply(Reply {
                request: reply.request,
                outcome: reply.outcome,
                detail: reply.detail.to_owned(),
            }),
            bead_wire::Message::Raw(raw) => Self::Raw(Raw {
                first_index: raw.first_index,
                codes: raw.codes.iter().collect(),
            }),
            bead_wire::Message::Link(link) => Self::Link(link),
            bead_wire::Message::SelfTest(test) => Self::SelfTest(test),
        }
    }
}

impl Message {
    /// Its kind on the wire.
    pub fn kind(&self) -> Kind {
        match self {
            Self::Identity(_) => Kind::Identity,
            Self::Status(_) => Kind::Status,
            Self::Strike(_) => Kind::Strike,
            Self::Shape(_) => Kind::Shape,
            Self::Waveform(_) => Kind::Waveform,
            Self::Fault(_) => Kind::Fault,
            Self::Settings(_) => Kind::Settings,
            Self::Health(_) => Kind::Health,
            Self::Sync(_) => Kind::Sync,
            Self::Reply(_) => Kind::Reply,
            Self::Raw(_) => Kind::Raw,
            Self::Link(_) => Kind::Link,
            Self::SelfTest(_) => Kind::SelfTest,
        }
    }
}

impl Frame {
    /// One JSON object: the header, then the message, SI units named in the keys, the bits beside them.
    ///
    /// `time_s` is the bead's own time since its reset, null until an identity told the sample rate.
    /// `lost_before` counts the frames lost since the last one received.
    pub fn json(&self) -> Value {
        let (arrival, lost_before) = match self.arrival {
            Arrival::First => ("first", 0),
            Arrival::Next { lost } => ("next", lost),
            Arrival::Restart { lost } => ("restart", lost),
            Arrival::Late => ("late", 0),
            Arrival::Duplicate => ("duplicate", 0),
        };
        let time = |index: u64| self.sample_rate_hz.map(|rate| index as f64 / f64::from(rate));
        let mut object = match json!({
            "kind": self.message.kind(),
            "boot_low_byte": self.header.boot,
            "sequence": self.header.sequence,
            "sample_index": self.header.sample_index,
            "time_s": time(self.header.sample_index),
            "arrival": arrival,
            "lost_before": lost_before,
        }) {
            Value::Object(object) => object,
            _ => Map::new(),
        };
        if let Value::Object(body) = self.body() {
            object.extend(body);
        }
        Value::Object(object)
    }

    /// What the message says, as [`Self::json`] has it after the header.
    pub fn body(&self) -> Value {
        let time = |index: u64| self.sample_rate_hz.map(|rate| index as f64 / f64::from(rate));
        match &self.message {
            Message::Identity(identity) => json!({
                "firmware": identity.firmware,
                "git": identity.git,
                "uid": hex(&identity.uid),
                "boot": identity.boot,
                "reset_cause": reset_causes(identity.reset_cause),
                "reset_cause_raw": identity.reset_cause,
                "sample_rate_hz": identity.sample_rate_hz,
                "channels": identity.channels,
            }),
            Message::Status(status) => serde_json::to_value(status).unwrap_or_default(),
            Message::Strike(strike) => json!({
                "strike": strike.strike,
                "first_index": strike.first_index,
                "trigger_index": strike.trigger_index,
                "trigger_time_s": time(strike.trigger_index),
                "samples": strike.samples,
                "peak_force_n": f64::from(strike.peak_force) * FORCE_UNIT_N,
                "peak_force_raw": strike.peak_force,
                "peak_index": strike.peak_index,
                "acceleration_max_mps2": f64::from(strike.acceleration_max) * ACCELERATION_UNIT_MPS2,
                "acceleration_max_raw": strike.acceleration_max,
                "acceleration_min_mps2": f64::from(strike.acceleration_min) * ACCELERATION_UNIT_MPS2,
                "acceleration_min_raw": strike.acceleration_min,
                "absorbed_measured_j": joules(strike.absorbed_measured),
                "absorbed_measured_raw": strike.absorbed_measured,
                "absorbed_predicted_j": joules(strike.absorbed_predicted),
                "absorbed_predicted_raw": strike.absorbed_predicted,
                "incident_energy_j": joules(strike.incident_energy),
                "incident_energy_raw": strike.incident_energy,
                "absorbed_fraction": f64::from(strike.absorbed_fraction) * FRACTION_UNIT,
                "absorbed_fraction_raw": strike.absorbed_fraction,
                "noise_energy_j": joules(strike.noise_energy),
                "noise_energy_raw": strike.noise_energy,
                "force_noise_n": f64::from(strike.force_noise) * FORCE_UNIT_N,
                "force_noise_raw": strike.force_noise,
                "flags": flag_names(strike.flags),
                "flags_raw": strike.flags,
            }),
            Message::Shape(shape) => {
                let samples = |fine: u32| f64::from(fine) * FINE_UNIT;
                let seconds = |fine: u32| self.sample_rate_hz.map(|rate| samples(fine) / f64::from(rate));
                let gains = |gains: Option<GainMatch>| {
                    gains.map(|gains| {
                        json!({
                            "deviation": f64::from(gains.deviation) * FRACTION_UNIT,
                            "deviation_raw": gains.deviation,
                            "uncertainty": f64::from(gains.uncertainty) * FRACTION_UNIT,
                            "uncertainty_raw": gains.uncertainty,
                        })
                    })
                };
                json!({
                    "strike": shape.strike,
                    "first_index": shape.first_index,
                    "arrival_time_s": time(shape.first_index).zip(seconds(shape.arrival)).map(|(first, after)| first + after),
                    "arrival_raw": shape.arrival,
                    "width_s": seconds(shape.width),
                    "width_raw": shape.width,
                    "impulse_ns": self.sample_rate_hz.map(|rate| newton_seconds(shape.impulse, rate)),
                    "impulse_raw": shape.impulse,
                    "ring_frequency_hz": samples(shape.ring_frequency),
                    "ring_frequency_raw": shape.ring_frequency,
                    "ring_decay_per_s": samples(shape.ring_decay),
                    "ring_decay_raw": shape.ring_decay,
                    "force_gains": gains(shape.force_gains),
                    "acceleration_gains": gains(shape.acceleration_gains),
                })
            }
            Message::Waveform(waveform) => json!({
                "strike": waveform.strike,
                "first_index": waveform.first_index,
                "first_time_s": time(waveform.first_index),
                "codes": waveform.codes,
                "wide": waveform.wide,
                "absorbed_measured_j": joules(waveform.absorbed_measured),
                "absorbed_measured_raw": waveform.absorbed_measured,
                "absorbed_predicted_j": joules(waveform.absorbed_predicted),
                "absorbed_predicted_raw": waveform.absorbed_predicted,
            }),
            Message::Fault(fault) => json!({
                "cause": fault.cause,
                "boot": fault.boot,
                "pc": fault.pc,
                "detail": fault.detail,
            }),
            Message::Health(health) => {
                let mut object = serde_json::to_value(health).unwrap_or_default();
                object["standing"] = json!(standing_names(health.standing));
                object["standing_raw"] = json!(health.standing);
                object
            }
            Message::Sync(sync) => json!({
                "edge": sync.edge,
                "edge_time_s": self.sample_rate_hz.map(|rate| sync.position() / f64::from(rate)),
                "index": sync.index,
                "clocks": sync.clocks,
                "clocks_per_sample": sync.clocks_per_sample,
                "missed": sync.missed,
            }),
            Message::Reply(reply) => json!({
                "request": reply.request,
                "outcome": reply.outcome,
                "detail": reply.detail,
            }),
            Message::Raw(raw) => json!({
                "first_index": raw.first_index,
                "first_time_s": time(raw.first_index),
                "codes": raw.codes,
            }),
            Message::Link(link) => serde_json::to_value(link).unwrap_or_default(),
            Message::SelfTest(test) => serde_json::to_value(test).unwrap_or_default(),
            Message::Settings(block) => match Settings::decode(block) {
                Ok(settings) => json!({ "settings": settings, "block": hex(block) }),
                Err(error) => {
                    json!({ "settings": null, "refused": error.to_string(), "block": hex(block) })
                }
            },
        }
    }
}

/// Names of what a health frame says is wrong now, as causes of faults are named; bits without a name are in the raw
/// number only.
pub fn standing_names(standing: u8) -> Vec<&'static str> {
    let named = [
        (Health::FORCE_STUCK, FaultCause::ForceStuck),
        (Health::FORCE_RAILED, FaultCause::ForceRailed),
        (Health::ACCELERATION_STUCK, FaultCause::AccelerationStuck),
        (Health::ACCELERATION_RAILED, FaultCause::AccelerationRailed),
        (Health::SUPPLY_LOW, FaultCause::SupplyLow),
    ];
    let set = named.into_iter().filter(|(bit, _)| standing & bit != 0);
    set.map(|(_, cause)| cause.name()).collect()
}

/// Newton seconds of impulse bits, at a sample rate in Hz.
pub fn newton_seconds(bits: i64, sample_rate_hz: u32) -> f64 {
    bits as f64 * IMPULSE_UNIT_N_SAMPLES / f64::from(sample_rate_hz)
}

/// Joules of energy bits.
pub fn joules(bits: i64) -> f64 {
    bits as f64 * ENERGY_UNIT_J
}

/// Names of the flags of a strike; bits that have none are in `flags_raw` only.
pub fn flag_names(bits: u16) -> Vec<&'static str> {
    let flags = Flags::from_bits(bits);
    Flags::NAMES
        .into_iter()
        .filter(|&(flag, _)| flags.contains(flag))
        .map(|(_, name)| name)
        .chain((bits & Strike::SENSOR_FAULT != 0).then_some("sensor_fault"))
        .collect()
}

/// Names of the reset flags, RCC_CSR bits 31 to 25 (RM0090 section 7.3.21).
pub fn reset_causes(bits: u8) -> Vec<&'static str> {
    const NAMES: [&str; 7] = [
        "brown_out",
        "pin",
        "power_on",
        "software",
        "independent_watchdog",
        "window_watchdog",
        "low_power",
    ];
    (1..)
        .zip(NAMES)
        .filter(|(bit, _)| bits >> bit & 1 != 0)
        .map(|(_, name)| name)
        .collect()
}

/// Two digits a byte.
pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes
        .iter()
        .fold(String::with_capacity(2 * bytes.len()), |mut text, byte| {
            // Writing to a string cannot fail.
            let _ = write!(text, "{byte:02x}");
            text
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use bead_model::design::{Bead, Capture, FrontEnd, derive};
    use bead_wire::{Codes, MAX_FRAME, encode};

    fn sent(sequence: u32, sample_index: u64, message: &bead_wire::Message<'_>) -> Vec<u8> {
        let header = Header {
            boot: 0,
            sequence,
            sample_index,
        };
        encode(&header, message, &mut [0; MAX_FRAME]).unwrap().to_vec()
    }

    fn identity() -> bead_wire::Message<'static> {
        bead_wire::Message::Identity(bead_wire::Identity {
            firmware: "0.1.0",
            git: "abc",
            uid: [0xA5; 12],
            boot: 256,
            reset_cause: 0b0000_1100,
            sample_rate_hz: 100_000,
            channels: 4,
        })
    }

    fn strike() -> Strike {
        Strike {
            strike: 1,
            first_index: 1000,
            trigger_index: 1032,
            samples: 400,
            peak_force: 3 << 15,
            peak_index: 1040,
            acceleration_max: 5 << 16,
            acceleration_min: -(1 << 16),
            absorbed_measured: 830 << 24,
            absorbed_predicted: 1 << 23,
            incident_energy: -(1 << 24),
            absorbed_fraction: 1 << 14,
            noise_energy: 1 << 20,
            force_noise: 328,
            flags: 0b1100_0000_0000_0010,
        }
    }

    #[test]
    fn a_strike_is_shown_in_si_units_beside_its_bits() {
        let stream = [
            sent(0, 0, &identity()),
            sent(3, 1400, &bead_wire::Message::Strike(strike())),
        ]
        .concat();
        let (frames, counters) = decode(&stream);
        assert_eq!(counters.lost, 2);
        let json = frames[1].json();
        let near = |key: &str, expected: f64| {
            let value = json[key].as_f64().unwrap();
            assert!(
                (value - expected).abs() <= 1e-15 * expected.abs(),
                "{key} is {value}"
            );
        };
        near("peak_force_n", 1.5);
        near("acceleration_max_mps2", 5.0);
        near("acceleration_min_mps2", -1.0);
        near("absorbed_measured_j", 830e-9);
        near("absorbed_predicted_j", 0.5e-9);
        near("incident_energy_j", -1e-9);
        near("time_s", 0.014);
        near("trigger_time_s", 0.01032);
        assert_eq!(json["absorbed_measured_raw"], json!(830i64 << 24));
        assert_eq!(json["flags"], json!(["acceleration_railed", "sensor_fault"]));
        assert_eq!(json["flags_raw"], json!(0xc002));
        assert_eq!(
            (&json["kind"], &json["lost_before"], &json["arrival"]),
            (&json!("strike"), &json!(2), &json!("next"))
        );
    }

    #[test]
    fn every_kind_becomes_an_object_that_begins_with_its_kind() {
        let mut packed = [0; 3];
        let codes = Codes::pack([[7, 4095]], &mut packed).unwrap();
        let settings = derive(&Bead::paper(), &FrontEnd::reference(), &Capture::default()).unwrap();
        let mut block = [0; bead_wire::MAX_BLOCK];
        let length = settings.encode(&mut block).unwrap();
        let status = Status {
            uptime_ms: 1,
            epoch: 1,
            samples: 2,
            strikes: 0,
            overruns: 0,
            blocks_dropped: 0,
            frames_dropped_queue_full: 4,
            frames_dropped_too_long: 0,
            stack_free_min: 0,
            settings_source: bead_wire::SettingsSource::BuiltIn,
            armed: false,
        };
        let messages = [
            identity(),
            bead_wire::Message::Status(status),
            bead_wire::Message::Strike(strike()),
            bead_wire::Message::Waveform(bead_wire::Waveform {
                strike: 1,
                first_index: 0,
                codes,
                wide: codes,
                absorbed_measured: 0,
                absorbed_predicted: 0,
            }),
            bead_wire::Message::Fault(bead_wire::Fault {
                cause: FaultCause::Panic,
                boot: 0,
                pc: 0,
                detail: "src/main.rs:1",
            }),
            bead_wire::Message::Settings(bead_wire::Settings {
                block: &block[..length],
            }),
            bead_wire::Message::Settings(bead_wire::Settings { block: b"no block" }),
            bead_wire::Message::Reply(bead_wire::Reply {
                request: 7,
                outcome: Outcome::StoreFull,
                detail: "reboot",
            }),
            bead_wire::Message::Raw(bead_wire::Raw {
                first_index: 200_000,
                codes,
            }),
            bead_wire::Message::Link(Link {
                rejected_kind: 3,
                ..Link::default()
            }),
            bead_wire::Message::SelfTest(SelfTest {
                check: bead_wire::Check::Supply,
                passed: true,
                value: 3300,
            }),
            bead_wire::Message::Sync(Sync::at(4, 100_210, 840, 1)),
        ];
        let stream: Vec<u8> = (0..)
            .zip(&messages)
            .flat_map(|(sequence, message)| sent(sequence, 9, message))
            .collect();
        let (frames, _) = decode(&stream);
        let lines: Vec<Value> = frames.iter().map(Frame::json).collect();
        assert_eq!(lines.len(), messages.len());
        for (line, message) in lines.iter().zip(&messages) {
            assert_eq!(line["kind"], serde_json::to_value(message.kind()).unwrap());
            assert!(line.to_string().starts_with("{\"kind\":"), "{line}");
        }
        assert_eq!(lines[0]["reset_cause"], json!(["pin", "power_on"]));
        assert_eq!(lines[0]["uid"], json!("a5".repeat(12)));
        assert_eq!(lines[1]["frames_dropped_queue_full"], json!(4));
        assert_eq!(lines[3]["codes"], json!([[7, 4095]]));
        assert_eq!(lines[3]["wide"], json!([[7, 4095]]));
        assert_eq!(lines[5]["settings"], serde_json::to_value(settings).unwrap());
        assert_eq!(lines[6]["settings"], Value::Null);
        assert_eq!(lines[7]["outcome"], json!("store_full"));
        assert_eq!(
            (&lines[8]["codes"], &lines[8]["first_time_s"]),
            (&json!([[7, 4095]]), &json!(2.0))
        );
        assert_eq!(lines[9]["rejected_kind"], json!(3));
        assert_eq!(
            (&lines[10]["check"], &lines[10]["value"]),
            (&json!("supply"), &json!(3300))
        );
        assert_eq!(
            (&lines[11]["index"], &lines[11]["clocks"]),
            (&json!(119), &json!(250))
        );
        let time = lines[11]["edge_time_s"].as_f64().unwrap();
        assert!((time - 100_210.0 / 84e6).abs() < 1e-15, "{time}");
    }

    #[test]
    fn no_time_is_given_before_the_sample_rate_is_known() {
        let (frames, _) = decode(&sent(5, 1400, &bead_wire::Message::Strike(strike())));
        assert_eq!(frames[0].json()["time_s"], Value::Null);
    }
}
