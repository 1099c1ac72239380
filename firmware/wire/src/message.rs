//! What the bead tells its host, one type a frame kind.
//!
//! # Design
//! A body is the postcard form of one of these structs, fields in the order written. Postcard has no
//! field names and no lengths to skip by, so a field added, removed or moved is another layout: raise
//! [`VERSION`](crate::VERSION). A new kind is not: hosts that do not know it say so and go on.
//!
//! Numbers travel as the fixed-point bits that the bead computed, never as rounded SI values: the host
//! that replays the samples compares bits.

use serde::{Deserialize, Serialize};

use crate::codes::{Codes, MAX_SCANS};

/// One unit of a force field, in newtons (I16F16).
pub const FORCE_UNIT_N: f64 = 1.0 / (1u32 << 16) as f64;
/// One unit of an acceleration field, in m/s² (I16F16).
pub const ACCELERATION_UNIT_MPS2: f64 = 1.0 / (1u32 << 16) as f64;
/// One unit of an impulse field, in newton samples (I48F16): over the sample rate, newton seconds.
pub const IMPULSE_UNIT_N_SAMPLES: f64 = FORCE_UNIT_N;
/// One unit of a fine time or rate, in samples, hertz or 1/s (U16F16).
pub const FINE_UNIT: f64 = 1.0 / (1u32 << 16) as f64;
/// One unit of an energy field, in joules (I40F24 of a nanojoule).
pub const ENERGY_UNIT_J: f64 = 1e-9 / (1u32 << 24) as f64;

/// Longest package version sent, in bytes.
pub const MAX_FIRMWARE: usize = 24;
/// Longest git description sent, in bytes: a full hash with `-dirty` fits.
pub const MAX_GIT: usize = 48;
/// Longest fault detail sent, in bytes.
pub const MAX_DETAIL: usize = 96;
/// Longest settings block that fits a frame, in bytes; `bead-model`'s longest is 192.
pub const MAX_BLOCK: usize = 256;

/// Frame kind: the second byte of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
#[repr(u8)]
pub enum Kind {
    /// [`Identity`]
    Identity = 1,
    /// [`Status`]
    Status = 2,
    /// [`Strike`]
    Strike = 3,
    /// [`Waveform`]
    Waveform = 4,
    /// [`Fault`]
    Fault = 5,
    /// [`Settings`]
    Settings = 6,
    /// [`Health`]
    Health = 7,
    /// [`Shape`]
    Shape = 8,
    /// [`Sync`]
    Sync = 9,
    /// [`Reply`]
    Reply = 16,
    /// [`Raw`]
    Raw = 17,
    /// [`Link`]
    Link = 18,
    /// [`SelfTest`]
    SelfTest = 19,
}

impl Kind {
    /// The kind with this number on the wire, if there is one.
    pub const fn from_byte(byte: u8) -> Option<Self> {
        match byte {
            1 => Some(Self::Identity),
            2 => Some(Self::Status),
            3 => Some(Self::Strike),
            4 => Some(Self::Waveform),
            5 => Some(Self::Fault),
            6 => Some(Self::Settings),
            7 => Some(Self::Health),
            8 => Some(Self::Shape),
            9 => Some(Self::Sync),
            16 => Some(Self::Reply),
            17 => Some(Self::Raw),
            18 => Some(Self::Link),
            19 => Some(Self::SelfTest),
            _ => None,
        }
    }
}

/// One message, borrowing its text and bytes from the frame that it came in.
///
/// Serialises, in a self-describing format, as the fields of the message beside a `kind`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Message<'a> {
    /// Who is speaking: first frame after a reset, then every few seconds.
    Identity(Identity<'a>),
    /// Counters and health, every few seconds.
    Status(Status),
    /// The result of one strike.
    Strike(Strike),
    /// A run of samples of a strike.
    Waveform(Waveform<'a>),
    /// Something went wrong, in this boot or the one before.
    Fault(Fault<'a>),
    /// The settings that the estimators run with.
    Settings(Settings<'a>),
    /// How often sensors and supply failed.
    Health(Health),
    /// The shape of one strike: follows its [`Strike`].
    Shape(Shape),
    /// An edge on the sync input.
    Sync(Sync),
    /// The answer to one request.
    Reply(Reply<'a>),
    /// A run of samples, whether there is a strike or not.
    Raw(Raw<'a>),
    /// What came in over the link.
    Link(Link),
    /// The result of one check of a self-test.
    SelfTest(SelfTest),
}

impl Message<'_> {
    /// The kind that stands in the frame of this message.
    pub const fn kind(&self) -> Kind {
        match self {
            Self::Identity(_) => Kind::Identity,
            Self::Status(_) => Kind::Status,
            Self::Strike(_) => Kind::Strike,
            Self::Waveform(_) => Kind::Waveform,
            Self::Fault(_) => Kind::Fault,
            Self::Settings(_) => Kind::Settings,
            Self::Health(_) => Kind::Health,
            Self::Shape(_) => Kind::Shape,
            Self::Sync(_) => Kind::Sync,
            Self::Reply(_) => Kind::Reply,
            Self::Raw(_) => Kind::Raw,
            Self::Link(_) => Kind::Link,
            Self::SelfTest(_) => Kind::SelfTest,
        }
    }
}

/// Who is speaking, and what the numbers of the other frames are counted in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity<'a> {
    /// Package version of the image; cut to [`MAX_FIRMWARE`] bytes.
    pub firmware: &'a str,
    /// Git description of the tree that it was built from; cut to [`MAX_GIT`] bytes.
    pub git: &'a str,
    /// 96-bit unique device id (RM0090 section 39.1).
    pub uid: [u8; 12],
    /// Resets since power-up; 0 is the power-up itself. Its low byte stands in every header.
    pub boot: u32,
    /// Why the last reset came: bits 31..24 of RCC_CSR (RM0090 section 7.3.21).
    pub reset_cause: u8,
    /// Scans a second, in hertz: the unit of every sample index.
    pub sample_rate_hz: u32,
    /// ADC channels in a scan.
    pub channels: u8,
}

/// The settings block in force, exactly as `bead-model` encoded it; opaque here.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Settings<'a> {
    /// Magic, version, length, body and CRC; at most [`MAX_BLOCK`] bytes.
    pub block: &'a [u8],
}

/// Where the settings in force came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SettingsSource {
    /// Compiled in: flash has none.
    BuiltIn,
    /// Put into flash by a debug probe.
    Flash,
    /// Compiled in, because what flash holds failed its check.
    FlashRefused,
    /// Written over the link and kept in flash.
    Stored,
}

/// Counters since the last reset, and health.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Status {
    /// Milliseconds since the last reset.
    pub uptime_ms: u64,
    /// Times that acquisition was started; a step means that samples are missing between.
    pub epoch: u32,
    /// Scans taken.
    pub samples: u64,
    /// Strikes found.
    pub strikes: u32,
    /// ADC or DMA overruns.
    pub overruns: u32,
    /// Blocks of samples that the estimators never saw.
    pub blocks_dropped: u32,
    /// Frames made but not sent: the transmit queue was full.
    pub frames_dropped_queue_full: u32,
    /// Frames made but not sent: longer than a frame may be.
    pub frames_dropped_too_long: u32,
    /// Least stack that was ever free, in bytes.
    pub stack_free_min: u32,
    /// Where the settings came from.
    pub settings_source: SettingsSource,
    /// Whether the strike detector is armed.
    pub armed: bool,
}

/// The result of one strike.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Strike {
    /// Number of the strike since the last reset, from 0.
    pub strike: u32,
    /// Sample index of the window's first scan.
    pub first_index: u64,
    /// Sample index at which the detector fired.
    pub trigger_index: u64,
    /// Scans in the window.
    pub samples: u16,
    /// Highest force, in [`FORCE_UNIT_N`].
    pub peak_force: i32,
    /// Sample index of the highest force.
    pub peak_index: u64,
    /// Highest acceleration, in [`ACCELERATION_UNIT_MPS2`].
    pub acceleration_max: i32,
    /// Lowest acceleration, in [`ACCELERATION_UNIT_MPS2`].
    pub acceleration_min: i32,
    /// Absorbed energy from the acceleration alone, in [`ENERGY_UNIT_J`].
    pub absorbed_measured: i64,
    /// Absorbed energy from the force alone, by the reduced chain, in [`ENERGY_UNIT_J`].
    pub absorbed_predicted: i64,
    /// Energy of the wave that came in, from its peak force, in [`ENERGY_UNIT_J`].
    pub incident_energy: i64,
    /// What to hold against the result: the flag bits of `bead-model`, and [`Strike::SENSOR_FAULT`].
    pub flags: u16,
}

impl Strike {
    /// Bit of `flags`: something stood in [`Health::standing`] when the window was complete. Not `bead-model`'s, which sees
    /// one window and no more: a replay does not have it.
    pub const SENSOR_FAULT: u16 = 1 << 14;
}

/// What the samples of one strike say beyond its energies. What could not be told is 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shape {
    /// Number of the strike since the last reset, from 0.
    pub strike: u32,
    /// Sample index of the window's first scan.
    pub first_index: u64,
    /// When the force was highest, in [`FINE_UNIT`] samples after `first_index`.
    pub arrival: u32,
    /// Full width at half height of the pulse of force, in [`FINE_UNIT`] samples.
    pub width: u32,
    /// Momentum that came in over the window, in [`IMPULSE_UNIT_N_SAMPLES`].
    pub impulse: i64,
    /// Frequency at which the intruder rang when the pulse had passed, in [`FINE_UNIT`] Hz.
    pub ring_frequency: u32,
    /// Decay of that ringing's amplitude, in [`FINE_UNIT`] 1/s.
    pub ring_decay: u32,
}

/// A run of samples of a strike, raw, with the estimates as they stood after the last of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Waveform<'a> {
    /// Number of the strike since the last reset, from 0.
    pub strike: u32,
    /// Sample index of the first scan here.
    pub first_index: u64,
    /// The scans, at most [`MAX_SCANS`].
    #[serde(borrow)]
    pub codes: Codes<'a>,
    /// Absorbed energy so far, from the acceleration alone, in [`ENERGY_UNIT_J`].
    pub absorbed_measured: i64,
    /// Absorbed energy so far, from the force alone, in [`ENERGY_UNIT_J`].
    pub absorbed_predicted: i64,
}

/// What became of a request. The order is the wire's: add at the end only.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// It was done.
    Done,
    /// Its frame has another version.
    Version,
    /// There is no such request.
    Kind,
    /// Its body is none of its kind: it has another length, or a value that does not exist.
    Body,
    /// A number in it is out of range.
    OutOfRange,
    /// The settings are none that this image can work with.
    SettingsInvalid,
    /// The settings are for a sample rate that this image does not run at.
    SampleRate,
    /// The store in flash is full: the next boot makes room.
    StoreFull,
    /// The flash did not take or keep what was written.
    FlashFailed,
}

impl Outcome {
    /// Its name in JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Version => "version",
            Self::Kind => "kind",
            Self::Body => "body",
            Self::OutOfRange => "out_of_range",
            Self::SettingsInvalid => "settings_invalid",
            Self::SampleRate => "sample_rate",
            Self::StoreFull => "store_full",
            Self::FlashFailed => "flash_failed",
        }
    }
}

/// The answer to one [`Request`](crate::Request).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Reply<'a> {
    /// Number of the request, as its sender chose it.
    pub request: u16,
    /// What became of it: anything but [`Outcome::Done`] has changed nothing.
    pub outcome: Outcome,
    /// One line for people; cut to [`MAX_DETAIL`] bytes, between characters.
    pub detail: &'a str,
}

/// A run of samples as they came from the converter, whether there is a strike or not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Raw<'a> {
    /// Sample index of the first scan here. Scans missing between two frames were dropped: see [`Link`].
    pub first_index: u64,
    /// The scans, at most [`MAX_SCANS`].
    #[serde(borrow)]
    pub codes: Codes<'a>,
}

/// What came in over the link since the last reset, and what became of it: beside every [`Status`].
///
/// What stood between two delimiters is either an accepted request or in exactly one of the counts of what was rejected.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Link {
    /// Bytes received.
    pub bytes: u64,
    /// Requests accepted.
    pub requests: u32,
    /// Times that the receiver was not emptied in time, and what came was lost.
    pub overruns: u32,
    /// Times that the line was not a line of bytes: no stop bit, or noise.
    pub line_errors: u32,
    /// [`Cause::TooLong`](crate::Cause::TooLong)
    pub rejected_too_long: u32,
    /// [`Cause::Cobs`](crate::Cause::Cobs)
    pub rejected_cobs: u32,
    /// [`Cause::TooShort`](crate::Cause::TooShort)
    pub rejected_too_short: u32,
    /// [`Cause::Crc`](crate::Cause::Crc)
    pub rejected_crc: u32,
    /// [`Cause::Version`](crate::Cause::Version)
    pub rejected_version: u32,
    /// [`Cause::Kind`](crate::Cause::Kind)
    pub rejected_kind: u32,
    /// [`Cause::Body`](crate::Cause::Body)
    pub rejected_body: u32,
    /// [`Cause::Trailing`](crate::Cause::Trailing)
    pub rejected_trailing: u32,
    /// Scans sent in [`Raw`] frames.
    pub raw_sent: u64,
    /// Scans of a raw stream that were not sent: the link carries fewer than are taken.
    pub raw_dropped: u64,
}

/// What a self-test looks at. The order is the wire's: add at the end only.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Check {
    /// The supply: `value` in mV, when acquisition was started last.
    Supply,
    /// The force sensor moves and is off the rails: `value` is its bits of [`Health::standing`].
    Force,
    /// The acceleration sensor moves and is off the rails: `value` is its bits of [`Health::standing`].
    Acceleration,
    /// Blocks of samples come: `value` is how many came within 20 ms.
    Acquisition,
    /// The settings in force are those of their block, whose checksum holds: `value` is its length in bytes.
    Settings,
    /// The stack has never come near its end: `value` is what was always free, in bytes.
    Stack,
    /// The estimators give, for a window that is known, what they gave when the image was built: `value` is how many of
    /// their results did not.
    Estimators,
    /// The store in flash can be read: `value` is the length of the block in it, in bytes, 0 for none.
    Store,
}

impl Check {
    /// Its name in JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Supply => "supply",
            Self::Force => "force",
            Self::Acceleration => "acceleration",
            Self::Acquisition => "acquisition",
            Self::Settings => "settings",
            Self::Stack => "stack",
            Self::Estimators => "estimators",
            Self::Store => "store",
        }
    }
}

/// The result of one check of a self-test.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SelfTest {
    /// What was looked at.
    pub check: Check,
    /// Whether it is as it should be.
    pub passed: bool,
    /// What was found, in the unit of the check.
    pub value: u32,
}

/// How often sensors and supply failed since the last reset, and what is wrong now: beside every [`Status`].
///
/// A kind of its own, so that status frames stay what they were and old recordings are read as before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Health {
    /// Frames that the boot before had made and not sent to the end when it was reset; 0 after power-up.
    pub frames_lost_by_reset: u32,
    /// Strikes that ended without a result, since samples of their window were lost.
    pub strikes_cut: u32,
    /// Times that the force sensor got stuck.
    pub force_stuck: u32,
    /// Times that the force came to lie at a rail.
    pub force_railed: u32,
    /// Times that the acceleration sensor got stuck.
    pub acceleration_stuck: u32,
    /// Times that the acceleration came to lie at a rail.
    pub acceleration_railed: u32,
    /// Times that the supply fell below its limit.
    pub supply_low: u32,
    /// The supply when acquisition was started last, in mV; 0 before the first start.
    pub supply_mv: u16,
    /// What is wrong now, if anything: [`Health::FORCE_STUCK`] and the others.
    pub standing: u8,
}

impl Health {
    /// Bit of `standing`: the force sensor is stuck.
    pub const FORCE_STUCK: u8 = 1;
    /// Bit of `standing`: the force lies at a rail.
    pub const FORCE_RAILED: u8 = 1 << 1;
    /// Bit of `standing`: the acceleration sensor is stuck.
    pub const ACCELERATION_STUCK: u8 = 1 << 2;
    /// Bit of `standing`: the acceleration lies at a rail.
    pub const ACCELERATION_RAILED: u8 = 1 << 3;
    /// Bit of `standing`: the supply is below its limit.
    pub const SUPPLY_LOW: u8 = 1 << 4;
}

/// A rising edge on the sync input, by the sample clock: several beads that see the same edges share a time base.
///
/// Index and clocks are those of the very timer clock that makes the samples, so that no rounding stands between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sync {
    /// Number of the edge among those told since the last reset, from 0.
    pub edge: u32,
    /// Index of the last sample trigger at or before the edge.
    pub index: u64,
    /// From that trigger to the edge, in clocks of the sample timer: below `clocks_per_sample`.
    pub clocks: u16,
    /// Clocks in a sample period.
    pub clocks_per_sample: u16,
    /// Times since the last reset that one edge or more came too soon after another to be told.
    pub missed: u32,
}

/// What went wrong. The order is the wire's: add at the end only.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultCause {
    /// The image panicked; `detail` has file and line.
    Panic,
    /// The core took a hard fault; `pc` is the instruction.
    HardFault,
    /// The watchdog reset the bead.
    Watchdog,
    /// The ADC overran (RM0090 section 13.8.2): acquisition was started again.
    AdcOverrun,
    /// The DMA stream reported a transfer error: acquisition was started again.
    DmaError,
    /// The estimators fell behind and a block was lost: a strike in progress is void.
    BlockLost,
    /// The settings block in flash failed its check.
    SettingsRefused,
    /// The stack reached its guard.
    StackOverflow,
    /// The window of a strike was cut by lost samples: the strike has no result.
    StrikeCut,
    /// The force code does not move, although noise should move it.
    ForceStuck,
    /// The force lies at a rail for longer than any strike.
    ForceRailed,
    /// The acceleration code does not move, although noise should move it.
    AccelerationStuck,
    /// The acceleration lies at a rail for longer than any strike.
    AccelerationRailed,
    /// The supply is below its limit.
    SupplyLow,
    /// What the cause in `detail` reported is over.
    Recovered,
}

impl FaultCause {
    /// Its name in JSON, and what `detail` says when it is [`Recovered`](Self::Recovered).
    pub const fn name(self) -> &'static str {
        match self {
            Self::Panic => "panic",
            Self::HardFault => "hard_fault",
            Self::Watchdog => "watchdog",
            Self::AdcOverrun => "adc_overrun",
            Self::DmaError => "dma_error",
            Self::BlockLost => "block_lost",
            Self::SettingsRefused => "settings_refused",
            Self::StackOverflow => "stack_overflow",
            Self::StrikeCut => "strike_cut",
            Self::ForceStuck => "force_stuck",
            Self::ForceRailed => "force_railed",
            Self::AccelerationStuck => "acceleration_stuck",
            Self::AccelerationRailed => "acceleration_railed",
            Self::SupplyLow => "supply_low",
            Self::Recovered => "recovered",
        }
    }
}

/// Something went wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fault<'a> {
    /// What went wrong.
    pub cause: FaultCause,
    /// The boot in which it did: the one before, for what ended in a reset.
    pub boot: u32,
    /// Program counter where it did, 0 where that says nothing.
    pub pc: u32,
    /// One line for people; cut to [`MAX_DETAIL`] bytes, between characters.
    pub detail: &'a str,
}

// Postcard: an integer wider than a byte is a varint of seven bits a byte (signed ones zigzag first), a
// string or byte slice its length as a varint, then its bytes, an enum its number as a varint.
const U8: usize = 1;
const U16: usize = 3;
const U32: usize = 5;
const U64: usize = 10;
pub(crate) const fn slice(longest: usize) -> usize {
    assert!(longest < 1 << 14, "a length of three varint bytes");
    longest + if longest < 1 << 7 { 1 } else { 2 }
}

/// Longest body of each kind, in bytes, kinds in the order of their numbers.
pub(crate) const MAX_BODIES: [usize; 13] = [
    slice(MAX_FIRMWARE) + slice(MAX_GIT) + 12 + U32 + U8 + U32 + U8,
    U64 + U32 + U64 + 6 * U32 + U8 + U8,
    U32 + 2 * U64 + U16 + U32 + U64 + 2 * U32 + 3 * U64 + U16,
    U32 + U64 + slice(3 * MAX_SCANS) + 2 * U64,
    U8 + U32 + U32 + slice(MAX_DETAIL),
    slice(MAX_BLOCK),
    7 * U32 + U16 + U8,
    U32 + U64 + 2 * U32 + U64 + 2 * U32,
    U32 + U64 + 2 * U16 + U32,
    U16 + U8 + slice(MAX_DETAIL),
    U64 + slice(3 * MAX_SCANS),
    U64 + 11 * U32 + 2 * U64,
    U8 + U8 + U32,
];

/// Longest body of any kind, in bytes.
pub(crate) const MAX_BODY: usize = {
    let (mut longest, mut kind) = (0, 0);
    while kind < MAX_BODIES.len() {
        if MAX_BODIES[kind] > longest {
            longest = MAX_BODIES[kind];
        }
        kind += 1;
    }
    longest
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_message_of_each_kind_is_as_long_as_stated() {
        let text = str::from_utf8(&[b'x'; 128]).unwrap();
        let identity = Identity {
            firmware: &text[..MAX_FIRMWARE],
            git: &text[..MAX_GIT],
            uid: [0xFF; 12],
            boot: u32::MAX,
            reset_cause: u8::MAX,
            sample_rate_hz: u32::MAX,
            channels: u8::MAX,
        };
        let status = Status {
            uptime_ms: u64::MAX,
            epoch: u32::MAX,
            samples: u64::MAX,
            strikes: u32::MAX,
            overruns: u32::MAX,
            blocks_dropped: u32::MAX,
            frames_dropped_queue_full: u32::MAX,
            frames_dropped_too_long: u32::MAX,
            stack_free_min: u32::MAX,
            settings_source: SettingsSource::FlashRefused,
            armed: true,
        };
        // Zigzag: the lowest number is the longest.
        let strike = Strike {
            strike: u32::MAX,
            first_index: u64::MAX,
            trigger_index: u64::MAX,
            samples: u16::MAX,
            peak_force: i32::MIN,
            peak_index: u64::MAX,
            acceleration_max: i32::MIN,
            acceleration_min: i32::MIN,
            absorbed_measured: i64::MIN,
            absorbed_predicted: i64::MIN,
            incident_energy: i64::MIN,
            flags: u16::MAX,
        };
        let waveform = Waveform {
            strike: u32::MAX,
            first_index: u64::MAX,
            codes: Codes::from_bytes(&[0xFF; 3 * MAX_SCANS]).unwrap(),
            absorbed_measured: i64::MIN,
            absorbed_predicted: i64::MIN,
        };
        let fault = Fault {
            cause: FaultCause::Recovered,
            boot: u32::MAX,
            pc: u32::MAX,
            detail: &text[..MAX_DETAIL],
        };
        let settings = Settings {
            block: &[0xFF; MAX_BLOCK],
        };
        let health = Health {
            frames_lost_by_reset: u32::MAX,
            strikes_cut: u32::MAX,
            force_stuck: u32::MAX,
            force_railed: u32::MAX,
            acceleration_stuck: u32::MAX,
            acceleration_railed: u32::MAX,
            supply_low: u32::MAX,
            supply_mv: u16::MAX,
            standing: u8::MAX,
        };
        let shape = Shape {
            strike: u32::MAX,
            first_index: u64::MAX,
            arrival: u32::MAX,
            width: u32::MAX,
            impulse: i64::MIN,
            ring_frequency: u32::MAX,
            ring_decay: u32::MAX,
        };
        let sync = Sync {
            edge: u32::MAX,
            index: u64::MAX,
            clocks: u16::MAX,
            clocks_per_sample: u16::MAX,
            missed: u32::MAX,
        };
        let reply = Reply {
            request: u16::MAX,
            outcome: Outcome::FlashFailed,
            detail: &text[..MAX_DETAIL],
        };
        let raw = Raw {
            first_index: u64::MAX,
            codes: Codes::from_bytes(&[0xFF; 3 * MAX_SCANS]).unwrap(),
        };
        let link = Link {
            bytes: u64::MAX,
            requests: u32::MAX,
            overruns: u32::MAX,
            line_errors: u32::MAX,
            rejected_too_long: u32::MAX,
            rejected_cobs: u32::MAX,
            rejected_too_short: u32::MAX,
            rejected_crc: u32::MAX,
            rejected_version: u32::MAX,
            rejected_kind: u32::MAX,
            rejected_body: u32::MAX,
            rejected_trailing: u32::MAX,
            raw_sent: u64::MAX,
            raw_dropped: u64::MAX,
        };
        let self_test = SelfTest {
            check: Check::Store,
            passed: true,
            value: u32::MAX,
        };

        let mut buffer = [0; MAX_BODY];
        let lengths = [
            postcard::to_slice(&identity, &mut buffer).unwrap().len(),
            postcard::to_slice(&status, &mut buffer).unwrap().len(),
            postcard::to_slice(&strike, &mut buffer).unwrap().len(),
            postcard::to_slice(&waveform, &mut buffer).unwrap().len(),
            postcard::to_slice(&fault, &mut buffer).unwrap().len(),
            postcard::to_slice(&settings, &mut buffer).unwrap().len(),
            postcard::to_slice(&health, &mut buffer).unwrap().len(),
            postcard::to_slice(&shape, &mut buffer).unwrap().len(),
            postcard::to_slice(&sync, &mut buffer).unwrap().len(),
            postcard::to_slice(&reply, &mut buffer).unwrap().len(),
            postcard::to_slice(&raw, &mut buffer).unwrap().len(),
            postcard::to_slice(&link, &mut buffer).unwrap().len(),
            postcard::to_slice(&self_test, &mut buffer).unwrap().len(),
        ];
        assert_eq!(lengths, MAX_BODIES);
    }
}
