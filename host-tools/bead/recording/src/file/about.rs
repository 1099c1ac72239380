//! The description of a recording, and its attachments.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::file::layout::known;
use crate::file::notes::Note;

/// The description of a recording.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct About {
    /// The source of the bytes: a port, or the emulator.
    pub source: String,
    /// Build id or git description of the firmware's ELF, where it is known.
    pub firmware: Option<String>,
    /// Scans a second, in hertz, until an identity frame says otherwise; with 0 times are 0 until then.
    pub sample_rate_hz: u32,
    /// Other facts that a program noted, by name.
    pub notes: BTreeMap<String, String>,
    /// Notes of people, in the order in which they were written.
    pub remarks: Vec<Note>,
}

impl About {
    pub(super) fn to_map(&self) -> BTreeMap<String, String> {
        let mut map = self.notes.clone();
        map.extend(known([
            ("source", Some(self.source.clone())),
            ("sample_rate_hz", Some(self.sample_rate_hz.to_string())),
            ("firmware", self.firmware.clone()),
        ]));
        map
    }

    /// The description in a map, without remarks, which are records of their own.
    pub(super) fn from_map(mut map: BTreeMap<String, String>) -> Self {
        let rate = map.remove("sample_rate_hz").and_then(|hz| hz.parse().ok());
        Self {
            source: map.remove("source").unwrap_or_default(),
            firmware: map.remove("firmware"),
            sample_rate_hz: rate.unwrap_or(0),
            notes: map,
            remarks: Vec::new(),
        }
    }

    /// The notes that count: the last of each key, without those that were withdrawn.
    pub fn last_remarks(&self) -> BTreeMap<&str, &Note> {
        let all = self.remarks.iter().map(|note| (note.key.as_str(), note));
        let mut last: BTreeMap<_, _> = all.collect();
        last.retain(|_, note| !note.value.is_empty());
        last
    }
}

/// A bead of a recording with several, and the source of its bytes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecordingOrigin {
    /// Address of the bead, which names it in the recording.
    pub address: u8,
    /// Its place in the chain, if that is known.
    pub bead: Option<usize>,
    /// The port that its bytes came from.
    pub port: Option<String>,
    /// Clock of the receive times: `host` or `emulator`.
    pub clock: Option<String>,
}

impl RecordingOrigin {
    pub(super) fn to_map(&self) -> BTreeMap<String, String> {
        known([
            ("address", Some(self.address.to_string())),
            ("bead", self.bead.map(|bead| bead.to_string())),
            ("port", self.port.clone()),
            ("clock", self.clock.clone()),
        ])
    }

    pub(super) fn from_map(address: u8, mut map: BTreeMap<String, String>) -> Self {
        Self {
            address,
            bead: map.remove("bead").and_then(|bead| bead.parse().ok()),
            port: map.remove("port"),
            clock: map.remove("clock"),
        }
    }
}

/// A bead of a recording with several.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecordedBead {
    /// Its address, and where its bytes came from.
    pub origin: RecordingOrigin,
    /// Its own attachments.
    pub parts: BTreeMap<Part, Arc<[u8]>>,
    /// Number of its runs of bytes.
    pub runs: u64,
    /// Number of its runs that are missing.
    pub runs_missing: u64,
}

impl RecordedBead {
    /// Its place in the chain, its address if no place is known.
    pub fn place(&self) -> usize {
        self.origin.bead.unwrap_or(self.origin.address.into())
    }
}

/// An attachment of a recording: each part once for all, and once for each bead of several.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    /// The settings block that the bead was given.
    Settings,
    /// The scenario, as its author wrote it.
    Scenario,
    /// The emulator's measures of the run, JSON.
    EmulatorReport,
    /// The strike by the simulated chain, JSON.
    Truth,
}

impl Part {
    pub(super) const ALL: [Self; 4] = [Self::Settings, Self::Scenario, Self::EmulatorReport, Self::Truth];

    /// Its name in the file.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Settings => "settings.bin",
            Self::Scenario => "scenario.toml",
            Self::EmulatorReport => "emulator.json",
            Self::Truth => "truth.json",
        }
    }

    pub(super) const fn media_type(self) -> &'static str {
        match self {
            Self::Settings => "application/octet-stream",
            Self::Scenario => "application/toml",
            Self::EmulatorReport | Self::Truth => "application/json",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_note_of_a_key_counts_and_an_empty_one_withdraws_it() {
        let notes = ["a=1", "b=2", "a=3", "b=", "c=", "c=4"];
        let remarks = notes.map(|text| Note::parse(text).unwrap()).to_vec();
        let about = About {
            remarks,
            ..About::default()
        };
        let last = about.last_remarks();
        let last: Vec<_> = last
            .iter()
            .map(|(key, note)| (*key, note.value.as_str()))
            .collect();
        assert_eq!(last, [("a", "3"), ("c", "4")]);
    }
}
