use crate::body::body;
use crate::message::fault::Detail;
use crate::names::names;

names! {
    /// Outcome of a request. The list may grow at its end.
    pub enum Outcome {
        /// The bead did what was asked.
        0 "done" Done,
        /// The request has a version that the bead does not know.
        1 "version" Version,
        /// The bead knows no request of this kind.
        2 "kind" Kind,
        /// The body does not fit the kind: it is too short, too long, or has a value that does not exist.
        3 "body" Body,
        /// A number in the request is out of range.
        4 "out_of_range" OutOfRange,
        /// The settings block has a wrong checksum, a version that cannot be migrated, or a value that the
        /// bead cannot work with.
        5 "settings_invalid" SettingsInvalid,
        /// The settings are for another sample rate than that of this firmware.
        6 "sample_rate" SampleRate,
        /// The settings store in flash is full. The next boot makes room.
        7 "store_full" StoreFull,
        /// The settings could not be read back from flash, the supply is low, or the store could not be read
        /// at the start.
        8 "flash_failed" FlashFailed,
        /// Settings are written to flash only so often, so that nobody wears it out. The detail says when to
        /// ask again.
        9 "too_soon" TooSoon,
        /// The bead has a key, and the request is not signed with it.
        10 "unsigned" Unsigned,
        /// The signature is not the bead's: another key, another bead, or a request that was changed.
        11 "forged" Forged,
        /// The counter of the signed request was used before, or is too far ahead.
        12 "replayed" Replayed,
        /// The time up to which the signed request holds is over, or it was signed for another boot.
        13 "late" Late,
        /// The request is signed, and the bead has no key.
        14 "no_key" NoKey,
        /// The bead does not keep this strike: it gave way to newer ones, or was never measured, or is not
        /// yet complete.
        15 "not_kept" NotKept,
        /// The line has no room for the answer, because strikes come. Ask again.
        16 "busy" Busy,
        /// The image is not taken: it is not signed with a key of this bead, is for another board, older, too
        /// long, or not the one that was announced. The detail says which.
        17 "image_refused" ImageRefused,
    }
}

body! {
    /// The answer to one request. The frames that the request asks for come before it.
    ///
    /// This body is frozen: a reader of any version understands it in a frame of any later version.
    pub struct Reply {
        /// Number of the request, as its host chose it.
        pub request: u16,
        /// Outcome of the request. A request with any other outcome than `done` has changed nothing.
        pub outcome: Outcome,
        /// One line for people, or nothing. A longer line is cut between two characters.
        pub detail: Detail,
    }
}
