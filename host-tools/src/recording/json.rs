//! Frames as JSON, for people and programs.
//!
//! # Design
//! A body is shown field by field, in the order of the wire. A quantity is shown in its SI unit, which ends
//! the key, with its bits beside it (`…_raw`). A number with a name is shown as its name, with the number
//! beside it. A scan index has the bead's time beside it. Settings are shown as the physical quantities that
//! they stand for, with their bits beside them (`settings_raw`). Nothing is left out.

use std::fmt::Write;

use bead_model::Settings;
use bead_wire::{Arrival, Fields, Message, Value as Field, named, unpacked};
use serde_json::{Map, Value, json};

use crate::recording::frames::Frame;
use crate::recording::physical::Physical;

/// The version of all JSON that this program prints: higher if a key went away or means something else.
pub const SCHEMA_VERSION: u32 = 1;

impl Frame {
    /// One JSON object: the header, then the message.
    ///
    /// `time_s` is the bead's own time since its reset, null until an identity gave the sample rate.
    /// `lost_before` counts the frames lost since the last one received.
    pub fn json(&self) -> Value {
        let (arrival, lost_before) = match self.arrival {
            Arrival::First => ("first", 0),
            Arrival::Next { lost } => ("next", lost),
            Arrival::Restart { lost } => ("restart", lost),
            Arrival::Late => ("late", 0),
            Arrival::Duplicate => ("duplicate", 0),
        };
        let mut object = Map::new();
        let mut show = |key: &str, value: Value| object.insert(key.to_owned(), value);
        show("kind", self.message.kind().name().into());
        show("schema_version", SCHEMA_VERSION.into());
        show("version", self.version.into());
        show("address", self.header.address.into());
        show("boot_low_byte", self.header.boot.into());
        show("sequence", self.header.sequence.into());
        show("sample_index", self.header.sample_index.into());
        show("time_s", self.time(self.header.sample_index));
        show("arrival", arrival.into());
        show("lost_before", lost_before.into());
        object.extend(self.body_map());
        object.into()
    }

    /// What the message says, as [`Self::json`] has it after the header.
    pub fn body(&self) -> Value {
        self.body_map().into()
    }

    fn body_map(&self) -> Map<String, Value> {
        let mut object = self.fields(&self.message);
        // Values that follow from several fields.
        match &self.message {
            Message::Shape(shape) => {
                let arrival = shape.first_index as f64 + shape.arrival.samples();
                object.insert("arrival_time_s".to_owned(), self.seconds(arrival).into());
            }
            Message::Sync(sync) => {
                object.insert("edge_time_s".to_owned(), self.seconds(sync.position()).into());
            }
            Message::Settings(settings) => {
                let (settings, raw, refused) = match Settings::decode(settings.block.bytes()) {
                    Ok(settings) => (json!(Physical::of(&settings)), json!(settings), Value::Null),
                    Err(error) => (Value::Null, Value::Null, error.to_string().into()),
                };
                object.insert("settings".to_owned(), settings);
                object.insert("settings_raw".to_owned(), raw);
                if !refused.is_null() {
                    object.insert("refused".to_owned(), refused);
                }
            }
            _ => {}
        }
        object
    }

    fn time(&self, index: u64) -> Value {
        self.seconds(index as f64).into()
    }

    fn fields(&self, body: &dyn Fields) -> Map<String, Value> {
        let mut object = Map::new();
        body.each(&mut |name, value| {
            let raw = || format!("{name}_raw");
            let mut show = |key: String, value: Value| {
                object.insert(key, value);
            };
            match value {
                Field::Bool(value) => show(name.into(), value.into()),
                Field::Number(number) => {
                    show(name.into(), number.into());
                    if let Some(stem) = name.strip_suffix("_index") {
                        show(format!("{stem}_time_s"), self.time(number));
                    }
                }
                Field::Quantity { bits, unit } => {
                    let value = unit.si(bits, self.sample_rate_hz);
                    show(format!("{name}{}", unit.suffix), value.into());
                    show(raw(), bits.into());
                }
                Field::Name { number, name: known } => {
                    show(name.into(), known.into());
                    show(raw(), number.into());
                }
                Field::Set { bits, names } => {
                    show(name.into(), named(bits, names).collect());
                    show(raw(), bits.into());
                }
                Field::Text(text) => show(name.into(), text.into()),
                Field::Bytes(bytes) => show(name.into(), hex(bytes).into()),
                Field::Scans(packed) => show(name.into(), unpacked(packed).map(|scan| json!(scan)).collect()),
                Field::Group(body) => {
                    show(name.into(), body.map(|body| self.fields(body)).into());
                }
            }
        });
        object
    }
}

/// Two digits a byte.
pub(crate) fn hex(bytes: &[u8]) -> String {
    let mut text = String::with_capacity(2 * bytes.len());
    for byte in bytes {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::frames::decode;
    use bead_model::design::{Bead, Capture, FrontEnd, derive};
    use bead_wire::{
        Acceleration, Block, Check, Codes, Energy, Fault, FaultCause, Force, Fraction, Header, Identity,
        Link, MAX_BLOCK, MAX_FRAME, Outcome, Raw, Reply, ResetCauses, SelfTest, SettingsSource, Status,
        Strike, StrikeFlags, Sync, Waveform, encode,
    };

    fn sent(sequence: u32, sample_index: u64, message: &Message) -> Vec<u8> {
        let header = Header {
            address: 0,
            boot: 0,
            sequence,
            sample_index,
        };
        encode(&header, message, &mut [0; MAX_FRAME]).unwrap().to_vec()
    }

    fn identity() -> Message {
        Message::Identity(Identity {
            firmware: "0.1.0".into(),
            git: "abc".into(),
            uid: [0xA5; 12],
            boot: 256,
            reset_cause: ResetCauses::from_bits(0b0000_1100),
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
            peak_force: Force::from_bits(3 << 15),
            peak_index: 1040,
            acceleration_max: Acceleration::from_bits(5 << 16),
            acceleration_min: Acceleration::from_bits(-(1 << 16)),
            absorbed_measured: Energy::from_bits(830 << 24),
            absorbed_predicted: Energy::from_bits(1 << 23),
            incident_energy: Energy::from_bits(-(1 << 24)),
            absorbed_fraction: Fraction::from_bits(1 << 14),
            noise_energy: Energy::from_bits(1 << 20),
            force_noise: Force::from_bits(328),
            flags: StrikeFlags::from_bits(0b1100_0000_0000_0010),
        }
    }

    #[test]
    fn a_strike_is_shown_in_si_units_beside_its_bits() {
        let stream = [sent(0, 0, &identity()), sent(3, 1400, &Message::Strike(strike()))].concat();
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
        let settings = derive(&Bead::paper(), &FrontEnd::reference(), &Capture::default()).unwrap();
        let mut block = [0; MAX_BLOCK];
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
            settings_source: SettingsSource::BuiltIn,
            armed: false,
        };
        let messages = [
            identity(),
            Message::Status(status),
            Message::Strike(strike()),
            Message::Waveform(Waveform {
                strike: 1,
                first_index: 0,
                codes: Codes::pack([[7, 4095]]).unwrap(),
                wide: Codes::pack([[7, 4095]]).unwrap(),
                absorbed_measured: Energy::from_bits(0),
                absorbed_predicted: Energy::from_bits(0),
            }),
            Message::Fault(Fault {
                cause: FaultCause::Panic,
                boot: 0,
                pc: 0,
                detail: "src/main.rs:1".into(),
            }),
            Message::Settings(bead_wire::Settings {
                block: Block::try_from(&block[..length]).unwrap(),
            }),
            Message::Settings(bead_wire::Settings {
                block: Block::try_from(&b"no block"[..]).unwrap(),
            }),
            Message::Reply(Reply {
                request: 7,
                outcome: Outcome::StoreFull,
                detail: "reboot".into(),
            }),
            Message::Raw(Raw {
                first_index: 200_000,
                codes: Codes::pack([[7, 4095]]).unwrap(),
            }),
            Message::Link(Link {
                rejected_kind: 3,
                ..Link::default()
            }),
            Message::SelfTest(SelfTest {
                check: Check::Supply,
                passed: true,
                value: 3300,
            }),
            Message::Sync(Sync::at(4, 100_210, 840, 1)),
        ];
        let stream: Vec<u8> = (0..)
            .zip(&messages)
            .flat_map(|(sequence, message)| sent(sequence, 9, message))
            .collect();
        let (frames, _) = decode(&stream);
        let lines: Vec<Value> = frames.iter().map(Frame::json).collect();
        assert_eq!(lines.len(), messages.len());
        for (line, message) in lines.iter().zip(&messages) {
            assert_eq!(line["kind"], message.kind().name());
            assert!(line.to_string().starts_with("{\"kind\":"), "{line}");
        }
        assert_eq!(lines[0]["reset_cause"], json!(["pin", "power_on"]));
        assert_eq!(lines[0]["uid"], json!("a5".repeat(12)));
        assert_eq!(lines[1]["frames_dropped_queue_full"], json!(4));
        assert_eq!(lines[3]["codes"], json!([[7, 4095]]));
        assert_eq!(lines[3]["wide"], json!([[7, 4095]]));
        assert_eq!(lines[5]["settings_raw"], serde_json::to_value(settings).unwrap());
        assert_eq!(lines[5]["settings"]["intruder"]["stiffness"], json!(3.95e5));
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
        let (frames, _) = decode(&sent(5, 1400, &Message::Strike(strike())));
        assert_eq!(frames[0].json()["time_s"], Value::Null);
    }
}
