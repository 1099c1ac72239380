//! The record that a boot ended by a fault leaves for the next boot, and the number of the boot.
//!
//! # Design
//! The record is in memory that a reset does not change. A checksum distinguishes it from the random contents
//! of RAM after power-up. The power-up flag is checked as well, since RAM may survive a short loss of power.

use bead_crc::checksum_of;
use bead_wire::{Detail, FaultCause, MAX_DETAIL};

/// This boot, and the faults before it.
pub struct ThisBoot {
    /// Resets since power-up.
    pub number: u32,
    /// Bits 31..24 of RCC_CSR.
    pub reset_cause: u8,
    /// The fault that ended the previous boot, if any.
    pub ended_by: Option<BootFault>,
    /// The last fault that ended a boot since power-up.
    pub last_fault: Option<BootFault>,
    /// Boots since power-up that ended in a fault.
    pub faults: u32,
    /// Number of boots in a row, up to this one, that ended in a fault before they were
    /// [`proven`](BootRecord::prove).
    pub failed: u32,
    /// Frames that the previous boot had made but not completely sent.
    pub frames_lost: u32,
    /// Settings that were written lately, as [`bead_store::Pace`] counts them.
    pub settings_written: u32,
}

/// A fault that ended a boot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BootFault {
    /// Its cause.
    pub cause: FaultCause,
    /// The boot that it ended.
    pub boot: u32,
    /// Program counter, if it is known; else 0.
    pub pc: u32,
    /// A line about it.
    pub detail: Detail,
}

/// Number of waiting frames. It is not part of the record, since it changes with every frame.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct FramesWaiting {
    frames: u32,
    /// `frames` inverted: after power-up RAM does not hold such a pair.
    inverted: u32,
}

impl FramesWaiting {
    /// The number with its inverse.
    pub const fn new(frames: u32) -> Self {
        Self {
            frames,
            inverted: !frames,
        }
    }

    /// Returns the number if its inverse matches.
    fn number(self) -> Option<u32> {
        (self.inverted == !self.frames).then_some(self.frames)
    }
}

/// Words of the detail of a fault.
const DETAIL: usize = MAX_DETAIL / 4;
const _: () = assert!(MAX_DETAIL.is_multiple_of(4));

/// The record. It consists of plain words: any memory contents are a valid value, and it is read word by
/// word.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct BootRecord {
    magic: u32,
    boot: u32,
    /// Boots that ended in a fault, and how many of the last ones in a row did so early.
    faults: u32,
    failed: u32,
    /// See [`ThisBoot`].
    pub settings_written: u32,
    /// Cause of the last boot that ended in a fault: [`NONE`], or a number of [`CAUSES`].
    cause: u32,
    fault_boot: u32,
    pc: u32,
    detail_length: u32,
    detail: [u32; DETAIL],
    /// CRC-32 of all fields before it.
    crc: u32,
}

/// "BEAD" and the version of the layout.
const MAGIC: u32 = u32::from_le_bytes(*b"BEA\x02");
const NONE: u32 = 0;
const CAUSES: [(u32, FaultCause); 6] = [
    (1, FaultCause::Panic),
    (2, FaultCause::HardFault),
    (3, FaultCause::DmaError),
    (4, FaultCause::StackOverflow),
    (5, FaultCause::Watchdog),
    (6, FaultCause::CrystalFailed),
];

impl BootRecord {
    /// The record of the first boot after power-up.
    pub const fn new() -> Self {
        Self {
            magic: MAGIC,
            boot: 0,
            faults: 0,
            failed: 0,
            settings_written: 0,
            cause: NONE,
            fault_boot: u32::MAX,
            pc: 0,
            detail_length: 0,
            detail: [0; DETAIL],
            crc: 0,
        }
    }

    /// Counts the boot and takes over the record of the previous one, if it `survived` the reset.
    /// `reset_cause` holds bits 31..24 of RCC_CSR. Returns the boot and the record to keep.
    pub fn begin(survived: Option<Self>, waiting: FramesWaiting, reset_cause: u8) -> (ThisBoot, Self) {
        const POWER_ON: u8 = 1 << 3;
        const WATCHDOG: u8 = 1 << 5;
        let before = survived.filter(|_| reset_cause & POWER_ON == 0);
        let frames_lost = before.and_then(|_| waiting.number()).unwrap_or(0);
        let mut record = before.unwrap_or_default();
        if before.is_some() && record.fault_boot != record.boot && reset_cause & WATCHDOG != 0 {
            record.note_end(FaultCause::Watchdog, 0, "");
        }
        let ended_by = record
            .last_fault()
            .filter(|last| before.is_some() && last.boot == record.boot);
        record.boot = before.map_or(0, |record| record.boot.wrapping_add(1));
        record.faults = record.faults.saturating_add(ended_by.is_some().into());
        record.failed = match &ended_by {
            Some(_) => record.failed.saturating_add(1),
            None => 0,
        };
        let boot = ThisBoot {
            number: record.boot,
            reset_cause,
            ended_by,
            last_fault: record.last_fault(),
            faults: record.faults,
            failed: record.failed,
            frames_lost,
            settings_written: record.settings_written,
        };
        (boot, record.sealed())
    }

    /// The record, if its checksum holds.
    // Not inlined, to save flash.
    #[inline(never)]
    pub fn checked(self) -> Option<Self> {
        (self.magic == MAGIC && self.crc == self.checksum()).then_some(self)
    }

    /// The record with its checksum.
    #[must_use]
    pub fn sealed(mut self) -> Self {
        self.crc = self.checksum();
        self
    }

    /// Marks this boot as one that has run long enough: earlier failed boots no longer count.
    pub const fn prove(&mut self) {
        self.failed = 0;
    }

    /// Notes the fault that ends `boot`.
    pub fn end(&mut self, boot: u32, cause: FaultCause, pc: u32, detail: &str) {
        self.boot = boot;
        self.note_end(cause, pc, detail);
    }

    fn note_end(&mut self, cause: FaultCause, pc: u32, detail: &str) {
        self.cause = CAUSES
            .into_iter()
            .find_map(|(number, known)| (known == cause).then_some(number))
            .unwrap_or(NONE);
        self.fault_boot = self.boot;
        self.pc = pc;
        self.detail_length = detail.len() as u32;
        let mut bytes = [0; MAX_DETAIL];
        bytes[..detail.len()].copy_from_slice(detail.as_bytes());
        for (word, bytes) in self.detail.iter_mut().zip(bytes.as_chunks().0) {
            *word = u32::from_le_bytes(*bytes);
        }
    }

    #[inline(never)]
    fn checksum(&self) -> u32 {
        let words = [
            self.magic,
            self.boot,
            self.faults,
            self.failed,
            self.settings_written,
            self.cause,
            self.fault_boot,
            self.pc,
            self.detail_length,
        ];
        let (words, detail) = (words.map(u32::to_le_bytes), self.detail.map(u32::to_le_bytes));
        checksum_of(&[words.as_flattened(), detail.as_flattened()])
    }

    fn last_fault(&self) -> Option<BootFault> {
        let (_, cause) = CAUSES.into_iter().find(|&(number, _)| number == self.cause)?;
        let detail = self.detail.map(u32::to_le_bytes);
        let text = detail.as_flattened().get(..self.detail_length as usize)?;
        Some(BootFault {
            cause,
            boot: self.fault_boot,
            pc: self.pc,
            detail: core::str::from_utf8(text).ok()?.into(),
        })
    }
}

impl Default for BootRecord {
    fn default() -> Self {
        Self::new()
    }
}
