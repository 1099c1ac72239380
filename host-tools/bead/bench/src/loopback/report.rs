//! The result of the checks, as a table and as a file that can be sent.

use std::collections::BTreeMap;

use bead_line::conversation::{Answer, LineError};
use bead_recording::json::hex;
use bead_wire::Message;
use schemars::JsonSchema;
use serde::Serialize;

/// The outcome of a check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CheckVerdict {
    /// Seen as expected.
    Passed,
    /// Seen otherwise.
    Failed,
    /// It needs what a check before did not find.
    NotDone,
    /// A number for the reader, without a bound.
    Reported,
}

impl CheckVerdict {
    /// The word in the table.
    pub fn word(self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::Failed => "FAILED",
            Self::NotDone => "not done",
            Self::Reported => "",
        }
    }
}

/// One check.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct CheckRow {
    /// Its name.
    pub check: String,
    /// The observation.
    pub seen: String,
    /// The expectation; empty for none.
    pub expected: String,
    /// The verdict on both.
    pub verdict: CheckVerdict,
    /// The numbers behind what was seen, by name: codes, scans, energies in J, forces in N.
    pub numbers: BTreeMap<String, f64>,
    /// Numbers that another run on the same board does not repeat, as rates by this computer's time.
    pub passing: BTreeMap<String, f64>,
}

impl CheckRow {
    pub(super) fn of(
        check: &str,
        seen: impl Into<String>,
        expected: impl Into<String>,
        passed: bool,
    ) -> Self {
        Self {
            check: check.to_owned(),
            seen: seen.into(),
            expected: expected.into(),
            verdict: if passed {
                CheckVerdict::Passed
            } else {
                CheckVerdict::Failed
            },
            numbers: BTreeMap::new(),
            passing: BTreeMap::new(),
        }
    }

    pub(super) fn not_done(check: &str, why: &str) -> Self {
        Self {
            verdict: CheckVerdict::NotDone,
            ..Self::of(check, "", why, false)
        }
    }

    pub(super) fn without_bound(self) -> Self {
        Self {
            verdict: CheckVerdict::Reported,
            ..self
        }
    }

    /// Adds a number.
    pub(super) fn with(mut self, name: &str, value: impl Into<f64>) -> Self {
        self.numbers.insert(name.to_owned(), value.into());
        self
    }

    /// Adds a number that is another one each time.
    pub(super) fn told(mut self, name: &str, value: f64) -> Self {
        self.passing.insert(name.to_owned(), value);
        self
    }
}

/// The board that was checked.
#[derive(Debug, Clone, Default, Serialize, JsonSchema)]
pub struct BenchBoard {
    /// The board that its image was built for.
    pub name: String,
    /// DEV_ID and REV_ID of the part, in hexadecimal.
    pub part: String,
    /// Crystal, MHz; 0 for the internal oscillator.
    pub crystal_mhz: u8,
    /// Brown-out level, 1 to 3; 0 if it is off.
    pub brown_out_level: u8,
    /// Unique device id, in hexadecimal.
    pub uid: String,
    /// Version of the firmware.
    pub firmware: String,
    /// Commit that it was built from.
    pub git: String,
    /// Length of the image in flash, in bytes.
    pub image_bytes: u32,
    /// CRC-32/ISO-HDLC of the image in flash, in hexadecimal, as the bead computes it.
    pub image_crc: String,
}

/// The result of all checks.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct BenchReport {
    /// When the checks began, UTC.
    pub date: String,
    /// Version of this program.
    pub bead: &'static str,
    /// The board.
    pub board: BenchBoard,
    /// The checks, in their order.
    pub checks: Vec<CheckRow>,
}

impl BenchReport {
    /// A report without checks, of the bead that answered who it is.
    pub(super) fn of(answer: &Answer, date: String) -> Result<Self, LineError> {
        let mut board = answer.last("board frame", |frame| match &frame.message {
            Message::Board(board) => Some(BenchBoard {
                name: board.name.as_str().to_owned(),
                part: format!("{:#05x} {:#06x}", board.part, board.revision),
                crystal_mhz: board.crystal_mhz,
                brown_out_level: board.brown_out_level,
                ..BenchBoard::default()
            }),
            _ => None,
        })?;
        let identity = answer.last("identity frame", |frame| match &frame.message {
            Message::Identity(identity) => Some(identity.clone()),
            _ => None,
        })?;
        board.uid = hex(&identity.uid);
        board.firmware = identity.firmware.as_str().to_owned();
        board.git = identity.git.as_str().to_owned();
        Ok(Self {
            date,
            bead: env!("CARGO_PKG_VERSION"),
            board,
            checks: Vec::new(),
        })
    }

    /// The checks that failed.
    pub fn failed(&self) -> impl Iterator<Item = &CheckRow> {
        self.checks
            .iter()
            .filter(|row| row.verdict == CheckVerdict::Failed)
    }
}
