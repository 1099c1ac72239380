use crate::body::body;
use crate::message::fault::Detail;
use crate::names::names;

names! {
    /// What became of a request. The list may grow at its end.
    pub enum Outcome {
        /// It was done.
        0 "done" Done,
        /// Its frame has a version that the bead does not know.
        1 "version" Version,
        /// There is no such request.
        2 "kind" Kind,
        /// Its body is not that of its kind: too short, too long, or a value that does not exist.
        3 "body" Body,
        /// A number in it is out of range.
        4 "out_of_range" OutOfRange,
        /// The settings block fails its checksum, is of a version that cannot be migrated, or has a value that the bead
        /// cannot work with.
        5 "settings_invalid" SettingsInvalid,
        /// The settings are for a sample rate that this image does not run at.
        6 "sample_rate" SampleRate,
        /// The store in flash is full: the next boot makes room.
        7 "store_full" StoreFull,
        /// The flash did not take or keep the settings.
        8 "flash_failed" FlashFailed,
    }
}

body! {
    /// The answer to one request. Frames that the request asked for come before it.
    ///
    /// This body is frozen: every version can read it from a frame of every later one.
    pub struct Reply {
        /// Number of the request, as its sender chose it.
        pub request: u16,
        /// What became of it: a request with any other outcome than `done` has changed nothing.
        pub outcome: Outcome,
        /// One line for people; empty where there is nothing to say. Longer ones are cut between characters.
        pub detail: Detail,
    }
}

#[cfg(test)]
pub(crate) fn example() -> Reply {
    Reply {
        request: 0xA1B2,
        outcome: Outcome::SampleRate,
        detail: "for 50000 Hz".into(),
    }
}

#[cfg(test)]
pub(crate) const GOLDEN: &str =
    "000a031002040302010c0b01020a01011707b2c302060c666f7220353030303020487a108d0d3a00";
