//! Frames as JSON, for people and programs.
//!
//! # Design
//! A body is shown field by field, in the order of the wire, under the keys of
//! [`fields`](crate::fields). Settings are shown as the physical quantities that they stand for,
//! with their bits beside them (`settings_raw`). Nothing is left out.

use std::fmt::Write;

use bead_model::Settings;
use bead_wire::{Arrival, Fields, Message, unpacked};
use serde_json::{Map, Value, json};

use crate::fields::{Content, entries};
use crate::frames::Frame;
use crate::uncertainties::{ENERGIES, GROUP, of_energies};

/// Version of all JSON that this program prints. It grows when a key is removed or changes its meaning.
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
        show("time_s", self.seconds(self.header.sample_index as f64).into());
        show("arrival", arrival.into());
        show("lost_before", lost_before.into());
        object.extend(self.body_map());
        object.into()
    }

    /// The message, as [`Self::json`] shows it after the header.
    pub fn body(&self) -> Value {
        self.body_map().into()
    }

    fn body_map(&self) -> Map<String, Value> {
        let mut object = object(&self.message, self.sample_rate_hz);
        // Values that follow from several fields.
        match &self.message {
            Message::Shape(shape) => {
                let arrival = shape.arrival_index().and_then(|index| self.seconds(index));
                object.insert("arrival_time_s".to_owned(), arrival.into());
                let known = self.strike.and_then(|strike| of_energies(shape, &strike));
                let known = known.map(|known| {
                    let keys = ENERGIES.map(str::to_owned).into_iter();
                    keys.zip(known.map(Value::from)).collect::<Map<_, _>>()
                });
                object.insert(GROUP.to_owned(), known.into());
            }
            Message::Sync(sync) => {
                object.insert("edge_time_s".to_owned(), self.seconds(sync.position()).into());
            }
            Message::Settings(settings) => {
                let (settings, raw, refused) = match Settings::decode(settings.block.bytes()) {
                    Ok(settings) => (json!(settings.description()), json!(settings), Value::Null),
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
}

/// A body as an object, at `rate` scans a second.
fn object(body: &dyn Fields, rate: Option<u32>) -> Map<String, Value> {
    let value = |content| match content {
        Content::Bool(value) => value.into(),
        Content::Number(value) => value.into(),
        Content::Bits(value) => value.into(),
        Content::Real(value) => value.into(),
        Content::Name(value) => value.and_then(|(_, name)| name).into(),
        Content::Names(names) => names.into(),
        Content::Text(text) => text.into(),
        Content::Bytes(bytes) => bytes.map(hex).into(),
        Content::Scans(packed) => packed
            .map(|packed| unpacked(packed).map(|scan| json!(scan)).collect::<Vec<_>>())
            .into(),
        Content::Group(_, body) => body.map(|body| object(body, rate)).into(),
    };
    let entries = entries(body, rate).into_iter();
    entries.map(|entry| (entry.key, value(entry.content))).collect()
}

/// Two digits a byte.
pub fn hex(bytes: &[u8]) -> String {
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
    use crate::frames::decode;
    use crate::protobuf;
    use bead_testing::{Speaker, block_of, paper_settings};
    use bead_wire::{
        Acceleration, Block, Body, Check, Codes, Energy, EnergyUncertainty, Force, Fraction, Identity,
        Impulse, Raw, ResetCauses, Samples, SelfTest, Shape, Strike, StrikeFlags, Sync,
    };

    fn shown(messages: &[Message]) -> Vec<Value> {
        let mut bead = Speaker::at(0);
        messages
            .iter()
            .for_each(|message| bead.say(1400, message.clone()));
        decode(&bead.bytes).0.iter().map(Frame::json).collect()
    }

    fn identity() -> Message {
        let identity = Identity {
            uid: [0xA5; 12],
            reset_cause: ResetCauses::from_bits(0b0000_1100),
            ..Speaker::at(0).identity()
        };
        identity.into()
    }

    #[test]
    fn a_strike_is_shown_in_si_units_beside_its_bits() {
        let strike = Strike {
            trigger_index: 1032,
            peak_force: Force::from_bits(3 << 15),
            acceleration_max: Acceleration::from_bits(5 << 16),
            acceleration_min: Acceleration::from_bits(-(1 << 16)),
            absorbed_measured: Energy::from_bits(830 << 24),
            absorbed_predicted: Energy::from_bits(1 << 23),
            incident_energy: Energy::from_bits(-(1 << 24)),
            flags: StrikeFlags::from_bits(1 << 31 | 1 << 14 | 1 << 1),
            ..Strike::draw(&mut || 0)
        };
        let mut bead = Speaker::at(0);
        bead.say(0, identity());
        bead.sequence = 3;
        bead.say(1400, strike);
        let (frames, counters) = decode(&bead.bytes);
        assert_eq!(counters.lost, 2);
        let json = frames[1].json();
        assert!(json.to_string().starts_with("{\"kind\":\"strike\","), "{json}");
        for (key, expected) in [
            ("peak_force_n", 1.5_f64),
            ("acceleration_max_mps2", 5.0),
            ("acceleration_min_mps2", -1.0),
            ("absorbed_measured_j", 830e-9),
            ("absorbed_predicted_j", 0.5e-9),
            ("incident_energy_j", -1e-9),
            ("time_s", 0.014),
            ("trigger_time_s", 0.01032),
        ] {
            let value = json[key].as_f64().unwrap();
            assert!(
                (value - expected).abs() <= 1e-15 * expected.abs(),
                "{key} is {value}"
            );
        }
        for (key, expected) in [
            ("absorbed_measured_raw", json!(830i64 << 24)),
            ("flags", json!(["acceleration_railed", "sensor_fault"])),
            ("flags_raw", json!(0x8000_4002_u32)),
            ("lost_before", json!(2)),
            ("arrival", json!("next")),
        ] {
            assert_eq!(json[key], expected, "{key}");
        }
        assert_eq!(
            shown(&[strike.into()])[0]["time_s"],
            Value::Null,
            "no sample rate is known"
        );
    }

    #[test]
    fn sets_names_bytes_scans_and_times_are_shown_for_people() {
        let shown = shown(&[
            identity(),
            Message::Raw(Raw {
                first_index: 200_000,
                codes: Codes::pack([[7, 4095]]).unwrap(),
            }),
            Message::SelfTest(SelfTest {
                check: Check::Unknown(99),
                passed: true,
                value: 3300,
            }),
            Message::Sync(Sync::at(4, 100_210, 840, 1)),
        ]);
        for (at, key, expected) in [
            (0, "reset_cause", json!(["pin", "power_on"])),
            (0, "uid", json!("a5".repeat(12))),
            (1, "codes", json!([[7, 4095]])),
            (1, "first_time_s", json!(2.0)),
            (2, "passed", json!(true)),
            (2, "check", Value::Null),
            (2, "check_raw", json!(99)),
        ] {
            assert_eq!(shown[at][key], expected, "{key}");
        }
        let time = shown[3]["edge_time_s"].as_f64().unwrap();
        assert!((time - 100_210.0 / 84e6).abs() < 1e-15, "{time}");
    }

    #[test]
    fn settings_are_shown_as_quantities_and_a_block_that_is_none_says_why() {
        let settings = paper_settings();
        let block = Block::try_from(&b"no block"[..]).unwrap();
        let shown = shown(&[block_of(&settings).into(), bead_wire::Settings { block }.into()]);
        assert_eq!(shown[0]["settings_raw"], serde_json::to_value(settings).unwrap());
        assert_eq!(shown[0]["settings"]["intruder"]["stiffness"], json!(3.95e5));
        assert_eq!(shown[1]["settings"], Value::Null);
        assert!(shown[1]["refused"].is_string());
    }

    #[test]
    fn a_shape_has_the_uncertainties_of_its_strike_in_joules_and_of_no_other() {
        let percent = |percent: i32| Fraction::from_bits(percent << 16);
        let shape = |strike| Shape {
            strike,
            uncertainty: Some(EnergyUncertainty {
                measured: percent(1),
                predicted: percent(2),
                difference: percent(3),
            }),
            ..Shape::draw(&mut || 0)
        };
        let strike = Strike {
            strike: 7,
            absorbed_measured: Energy::from_bits(400 << 24),
            absorbed_predicted: Energy::from_bits(500 << 24),
            ..Strike::draw(&mut || 0)
        };
        let mut bead = Speaker::at(0);
        bead.say(1400, strike);
        bead.say(1400, shape(7));
        bead.say(1400, shape(8));
        let (frames, _) = decode(&bead.bytes);
        for (key, nanojoules) in [
            ("absorbed_measured_j", 400.0),
            ("absorbed_predicted_j", 1000.0),
            ("difference_j", 1500.0),
        ] {
            let u = frames[1].json()["u"][key].as_f64().unwrap();
            assert!((u * 1e9 / nanojoules - 1.0).abs() < 1e-12, "{key}: {u}");
        }
        assert_eq!(frames[2].json()["u"], Value::Null);
        // A key of two bytes and a length, and of each value a key and a double.
        let length = |at: usize| protobuf::message(&frames[at]).len();
        assert_eq!(length(1), length(2) + 2 + 1 + 3 * (1 + 8));
    }

    #[test]
    fn quantities_that_were_not_found_are_null_beside_their_bits() {
        let shape = |arrival| Shape {
            first_index: 1000,
            arrival: Samples::from_bits(arrival),
            impulse: Impulse::from_bits(0),
            ..Shape::draw(&mut || 0)
        };
        let shown = shown(&[identity(), shape(0).into(), shape(1 << 17).into()]);
        let unknown = "arrival_s width_s ring_frequency_hz ring_decay_per_s arrival_time_s force_gains";
        for key in unknown.split(' ') {
            assert_eq!(shown[1][key], Value::Null, "{key}");
        }
        assert_eq!(shown[1]["ring_frequency_raw"], json!(0));
        assert_eq!(shown[1]["impulse_n_s"], json!(0.0));
        assert_eq!(shown[2]["arrival_s"], json!(2e-5));
        assert_eq!(shown[2]["arrival_time_s"], json!(0.01002));
    }
}
