//! The flash interface (RM0090 section 3): wait states, locks, programming and erasing.
//!
//! # Design
//!
//! All sectors but 0 and 1 can be written ([`WRITABLE`]). Those two hold the start of a program, and QEMU
//! reloads them at every reset. Writes there are refused as if these sectors were protected, and noted. The
//! model holds the bytes of the others. The machine copies changes to where the processor reads them.
//!
//! In a part with two banks, the code is taken to be in the first. The processor goes on while the second is
//! written.
//!
//! An operation takes the data sheet's typical time and does its work at the end of it. A power cut or a
//! reset before that leaves it half done. The share of bits that have changed is then the share of time that
//! has passed. A fixed hash of the addresses says which bits have changed, so that a run can be repeated. On
//! silicon such bits may also read differently from one time to the next. Here they do not.

use std::ops::Range;

use super::clock::{ClockTree, HSI_HZ};
use super::peripheral::{NoRegister, Notes, Peripheral};
use super::register::{bit, field};
use crate::memory::{WRITABLE, sector};
use crate::outcome::FlashOperation;

const PG: u32 = 1 << 0;
const SER: u32 = 1 << 1;
const MER: u32 = 1 << 2;
const STRT: u32 = 1 << 16;
const EOPIE: u32 = 1 << 24;
const ERRIE: u32 = 1 << 25;
const LOCK: u32 = 1 << 31;
/// PG, SER, MER, SNB, PSIZE, STRT, EOPIE, ERRIE, LOCK (section 3.9.6), and the fifth bit of SNB and MER1,
/// which parts with two banks have (section 3.9.7).
const CR_BITS: u32 = 0x8301_037f;
const CR_BITS_OF_TWO_BANKS: u32 = CR_BITS | 1 << 7 | MER1;
const MER1: u32 = 1 << 15;

const EOP: u32 = 1 << 0;
const OPERR: u32 = 1 << 1;
const WRPERR: u32 = 1 << 4;
const PGAERR: u32 = 1 << 5;
const PGPERR: u32 = 1 << 6;
const PGSERR: u32 = 1 << 7;
const BSY: u32 = 1 << 16;

const OPTLOCK: u32 = 1;
const KEYS: [u32; 2] = [0x4567_0123, 0xcdef_89ab];
const OPTION_KEYS: [u32; 2] = [0x0819_2a3b, 0x4c5d_6e7f];

/// Typical times of DocID022152, flash memory programming. A word takes the same time at each parallelism.
const PROGRAM_NS: u64 = 16_000;
/// For sectors of 16, 64 and 128 KiB, erased by 8, 16, 32 and 64 bits. No time is given for 64 bits: that
/// for 32 bits is used.
const ERASE_NS: [[u64; 4]; 3] = [
    [400_000_000, 300_000_000, 250_000_000, 250_000_000],
    [1_200_000_000, 700_000_000, 550_000_000, 550_000_000],
    [2_000_000_000, 1_300_000_000, 1_000_000_000, 1_000_000_000],
];
/// Where the second bank begins.
const BANK_2: u32 = WRITABLE.end;
/// For a bank of 1 MiB (DocID024030, flash memory programming), as above.
const BANK_ERASE_NS: [u64; 4] = [16_000_000_000, 11_000_000_000, 8_000_000_000, 8_000_000_000];
const ROW_BYTES: u32 = 16;

const PROGRAMMED: &str =
    "sector 0 or 1 was programmed: here these two are as if protected, unlike the others";
const ERASED: &str = "sector 0 or 1 was erased: here these two are as if protected, unlike the others";
const MASS_ERASED: &str = "CR.MER: sectors 0 and 1 are as if protected, so that not all can be erased";
const READ_WHILE_BUSY: &str =
    "a DMA stream read flash while BSY: silicon makes it wait; here it does not wait";

#[derive(Debug, Clone, Copy)]
struct PendingOperation {
    operation: FlashOperation,
    /// Value to program: bits that are 0 here become 0. Unused by an erase.
    value: u32,
    ends_ns: u64,
    power_goes_ns: Option<u64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FlashEvent {
    /// The operation ends: see [`FlashController::finish`].
    Finished,
    /// The power goes in the middle of the operation.
    PowerGone,
}

#[derive(Debug, Clone, Default)]
pub(crate) struct FlashController {
    hclk: u32,
    acr: u32,
    cr: u32,
    sr: u32,
    optcr: u32,
    first_key_seen: bool,
    /// True after a wrong key, which locks CR until the next reset (section 3.6.1).
    shut: bool,
    first_option_key_seen: bool,
    /// Contents of flash from the start of [`WRITABLE`].
    pub(crate) contents: Vec<u8>,
    /// Where the part's flash ends.
    end: u32,
    running: Option<PendingOperation>,
    /// Power cuts: the number of operations that begin before, and the share of the cut one that is over, %.
    cuts: Vec<(u32, u8)>,
    /// Operations that have begun.
    pub(crate) operations: Vec<FlashOperation>,
    pub(crate) notes: Notes,
}

impl FlashController {
    pub(crate) fn new() -> Self {
        Self {
            hclk: HSI_HZ,
            cr: LOCK,
            optcr: 0x0fff_aaed,
            contents: vec![0xff; WRITABLE.len()],
            end: WRITABLE.end,
            ..Self::default()
        }
    }

    /// Cuts the power in a later operation: `after` others, counted from now, begin before it. When the
    /// power goes, `percent` (0 to 100) of it is over.
    pub(crate) fn cut_power_in(&mut self, after: u32, percent: u8) {
        self.cuts.push((after, percent));
    }

    /// Returns `true` if an operation is under way: its bank cannot be read meanwhile.
    pub(crate) fn busy(&self) -> bool {
        self.running.is_some()
    }

    /// Sets the end of the part's flash.
    pub(crate) fn set_end(&mut self, end: u32) {
        self.end = end;
        let space = end.max(WRITABLE.end) - WRITABLE.start;
        self.contents.resize(space as usize, 0xff);
    }

    fn has_two_banks(&self) -> bool {
        self.end > WRITABLE.end
    }

    /// Returns `true` if the bank that holds the code is being written.
    pub(crate) fn stalls(&self) -> bool {
        let running = self.running.as_ref();
        running.is_some_and(|running| running.operation.address < WRITABLE.end)
    }

    /// Returns the next event and its time, ns.
    pub(crate) fn next_event(&self) -> Option<(u64, FlashEvent)> {
        let running = self.running?;
        let finished = (running.ends_ns, FlashEvent::Finished);
        let cut = running.power_goes_ns.map(|at| (at, FlashEvent::PowerGone));
        Some(cut.unwrap_or(finished))
    }

    /// Ends the operation under way. Returns the addresses in [`WRITABLE`] that it has written.
    pub(crate) fn finish(&mut self) -> Range<u32> {
        let Some(running) = self.running.take() else {
            return WRITABLE.start..WRITABLE.start;
        };
        self.cr &= !STRT;
        // Section 3.9.5: only with the interrupt enabled.
        if self.cr & EOPIE != 0 {
            self.sr |= EOP;
        }
        self.change(running, |_| true)
    }

    /// Changes the bits for whose number `done` is true. Returns the addresses of the operation.
    fn change(&mut self, running: PendingOperation, mut done: impl FnMut(u32) -> bool) -> Range<u32> {
        let operation = running.operation;
        let (address, bytes) = (operation.address, operation.bytes);
        let first = (address - WRITABLE.start) as usize;
        for (n, byte) in self.contents[first..][..bytes as usize].iter_mut().enumerate() {
            let programmed = *byte & running.value.to_le_bytes()[n % 4];
            let wanted = if operation.erase { 0xff } else { programmed };
            for bit in 0..8 {
                if (wanted ^ *byte) >> bit & 1 == 1 && done((address + n as u32) * 8 + bit) {
                    *byte ^= 1 << bit;
                }
            }
        }
        address..address + bytes
    }

    /// Begins an operation that takes `ns`: to program a value, or to erase if there is none.
    fn begin(&mut self, now: u64, address: u32, bytes: u32, value: Option<u32>, ns: u64) {
        let operation = FlashOperation {
            at_ns: now,
            address,
            bytes,
            erase: value.is_none(),
        };
        self.operations.push(operation);
        let due = self.cuts.extract_if(.., |(after, _)| *after == 0).last();
        self.cuts.iter_mut().for_each(|(after, _)| *after -= 1);
        self.running = Some(PendingOperation {
            operation,
            value: value.unwrap_or(u32::MAX),
            ends_ns: now + ns,
            power_goes_ns: due.map(|(_, percent)| now + ns * u64::from(percent.min(100)) / 100),
        });
    }

    fn refuse(&mut self, flag: u32) {
        self.sr |= flag;
        if flag != 0 && self.cr & ERRIE != 0 {
            self.sr |= OPERR;
        }
    }

    /// A DMA stream reads flash.
    pub(crate) fn fetched_by_dma(&mut self) {
        self.notes.note_if(self.busy(), READ_WHILE_BUSY);
    }

    /// The processor stores to flash (section 3.6.4).
    pub(crate) fn store(&mut self, address: u32, bytes: u32, value: u32, now: u64) {
        let psize = field(self.cr, 8, 2);
        if self.busy() {
            self.notes
                .note("a store to flash while BSY: silicon makes it wait; here it is lost");
        } else if self.cr & PG == 0 || self.cr & LOCK != 0 {
            self.notes
                .note("a store to flash without CR.PG: nothing was programmed");
            self.refuse(PGSERR);
        } else if address / ROW_BYTES != (address + bytes - 1) / ROW_BYTES {
            self.refuse(PGAERR);
        } else if bytes != 1 << psize || !address.is_multiple_of(bytes) {
            // The processor cuts an unaligned store into smaller ones.
            self.refuse(PGPERR);
        } else if !(WRITABLE.start..self.end).contains(&address) {
            self.notes.note(PROGRAMMED);
            self.refuse(WRPERR);
        } else {
            self.begin(now, address, bytes, Some(value), PROGRAM_NS);
        }
    }

    /// CR.STRT (section 3.6.3).
    fn start(&mut self, now: u64) {
        let sector = sector(field(self.cr, 3, 5)).filter(|sector| sector.start < self.end);
        let parallelism = field(self.cr, 8, 2) as usize;
        let (note, flag) = match (self.cr & (SER | MER | MER1), sector) {
            (SER, Some(sector)) if sector.start >= WRITABLE.start => {
                let bytes = sector.len() as u32;
                let size = match bytes >> 10 {
                    16 => 0,
                    64 => 1,
                    _ => 2,
                };
                let ns = ERASE_NS[size][parallelism];
                return self.begin(now, sector.start, bytes, None, ns);
            }
            (SER, Some(_)) => (ERASED, WRPERR),
            (SER, None) => ("CR.SNB names no sector: nothing was erased", 0),
            (MER, _) => (MASS_ERASED, WRPERR),
            (MER1, _) => {
                let ns = BANK_ERASE_NS[parallelism];
                return self.begin(now, BANK_2, self.end - BANK_2, None, ns);
            }
            // With both set, neither erase can be performed.
            _ => (
                "CR.STRT without exactly one of SER and MER: nothing was erased",
                0,
            ),
        };
        self.notes.note(note);
        self.refuse(flag);
        self.cr &= !STRT;
    }

    /// Notes too few wait states, with which silicon reads wrong words. Table 10 (for 2.7 V to 3.6 V)
    /// requires one more for every 30 MHz. Without prefetch and caches silicon waits more often. This is
    /// noted only if it stays so, as firmware may turn them on after it has written flash.
    fn check_latency(&mut self) {
        let needed = self.hclk.saturating_sub(1) / 30_000_000;
        let too_few = self.acr & 7 < needed;
        self.notes.note_if(
            too_few,
            "ACR.LATENCY is lower than table 10 requires for this HCLK",
        );
        // Section 3.5: above 30 MHz there are wait states, and these three hide most of them.
        for (n, name) in [(8, "PRFTEN"), (9, "ICEN"), (10, "DCEN")] {
            self.notes.keep_while(
                needed > 0 && !bit(self.acr, n),
                format!("ACR.{name} is clear and HCLK above 30 MHz: silicon waits for flash more often"),
            );
        }
    }

    /// KEYR: both keys in order open CR. Anything else shuts it until the next reset (section 3.6.1).
    fn unlock(&mut self, key: u32) {
        let wanted = KEYS[usize::from(self.first_key_seen)];
        if self.cr & LOCK == 0 || self.shut || key != wanted {
            self.shut = true;
            self.cr |= LOCK;
            self.notes
                .note("KEYR: a wrong key, or one too many, locks CR until the next reset");
        } else if self.first_key_seen {
            self.cr &= !LOCK;
        }
        self.first_key_seen = !self.first_key_seen;
    }
}

/// Spreads numbers evenly (the finaliser of SplitMix, 32 bits).
fn hash(number: u32) -> u32 {
    let mut x = number.wrapping_mul(0x9e37_79b9);
    x = (x ^ (x >> 16)).wrapping_mul(0x85eb_ca6b);
    x = (x ^ (x >> 13)).wrapping_mul(0xc2b2_ae35);
    x ^ (x >> 16)
}

impl Peripheral for FlashController {
    fn read(&mut self, offset: u32, _now: u64) -> Result<u32, NoRegister> {
        Ok(match offset {
            0x00 => self.acr,
            // Keys cannot be read back.
            0x04 | 0x08 => 0,
            0x0c => self.sr | if self.busy() { BSY } else { 0 },
            0x10 => self.cr,
            0x14 => self.optcr,
            _ => return Err(NoRegister),
        })
    }

    fn holds_until(&self, _offset: u32, _now: u64) -> Option<u64> {
        Some(u64::MAX)
    }

    fn write(&mut self, offset: u32, value: u32, now: u64) -> Result<(), NoRegister> {
        match offset {
            // ICRST reads as 0 (section 3.9.1).
            0x00 => self.acr = value & 0x1707,
            0x04 => self.unlock(value),
            0x08 => {
                if self.first_option_key_seen && value == OPTION_KEYS[1] {
                    self.optcr &= !OPTLOCK;
                }
                self.first_option_key_seen = value == OPTION_KEYS[0];
            }
            // rc_w1 (section 3.9.5).
            0x0c => self.sr &= !value,
            0x10 if self.busy() => {
                self.notes
                    .note("CR written while BSY: silicon makes the write wait; here it is lost");
            }
            0x10 if self.cr & LOCK == 0 => {
                let two = self.has_two_banks();
                self.cr = value & if two { CR_BITS_OF_TWO_BANKS } else { CR_BITS };
                if self.cr & STRT != 0 {
                    self.start(now);
                }
            }
            0x10 => self.cr |= value & LOCK,
            0x14 => {
                self.notes
                    .note_if(bit(value, 1), "OPTCR: option bytes are not modelled");
                self.optcr |= value & OPTLOCK;
            }
            _ => return Err(NoRegister),
        }
        self.check_latency();
        Ok(())
    }

    /// An operation under way is left half done (section 3.6: what it wrote is not guaranteed). The contents
    /// stay.
    fn reset(&mut self, now: u64) {
        if let Some(running) = self.running.take() {
            let began_ns = running.operation.at_ns;
            let (passed, whole) = (now.saturating_sub(began_ns), running.ends_ns - began_ns);
            let share = (256 * passed.min(whole) / whole) as u32;
            self.change(running, |bit| hash(bit) & 0xff < share);
        }
        let old = std::mem::replace(self, Self::new());
        (self.hclk, self.contents, self.operations) = (old.hclk, old.contents, old.operations);
        (self.cuts, self.notes, self.end) = (old.cuts, old.notes, old.end);
    }

    fn interrupt(&self, _output: usize) -> bool {
        // EOPIE and ERRIE have the order of EOP and OPERR.
        self.sr & (self.cr >> 24) & (EOP | OPERR) != 0
    }

    fn next_interrupt(&self) -> Option<u64> {
        self.next_event().map(|(at, _)| at)
    }

    fn set_clocks(&mut self, clocks: &ClockTree, _now: u64) {
        self.hclk = clocks.hclk;
        self.check_latency();
    }
}

#[cfg(test)]
mod tests {
    use super::super::peripheral::Access;
    use super::*;

    const ACR: u32 = 0x00;
    const KEYR: u32 = 0x04;
    const SR: u32 = 0x0c;
    const CR: u32 = 0x10;
    const BY_WORDS: u32 = 0b10 << 8;
    /// Sector 10.
    const A: u32 = 0x080c_0000;

    fn unlocked() -> FlashController {
        let mut flash = FlashController::new();
        flash.put(0, KEYS.map(|key| (KEYR, key)));
        flash
    }

    fn word(flash: &FlashController, address: u32) -> u32 {
        let at = (address - WRITABLE.start) as usize;
        u32::from_le_bytes(flash.contents[at..at + 4].try_into().unwrap())
    }

    /// Begins to program a word.
    fn begin(flash: &mut FlashController, cr: u32, address: u32, value: u32, now: u64) {
        flash.put(now, [(CR, PG | BY_WORDS | cr)]);
        flash.store(address, 4, value, now);
    }

    /// Programs a word. Returns SR, with its errors.
    fn program(flash: &mut FlashController, address: u32, value: u32, now: u64) -> u32 {
        begin(flash, 0, address, value, now);
        flash.finish();
        flash.get(SR, 0)
    }

    #[test]
    fn too_few_wait_states_are_noted_and_caches_that_are_off_while_they_are() {
        let mut flash = FlashController::new();
        let mut fast = ClockTree::HSI;
        fast.hclk = 168_000_000;
        flash.put(0, [(ACR, 0x705)]);
        flash.set_clocks(&fast, 0);
        let mut notes = |acr: u32| {
            flash.put(0, [(ACR, acr)]);
            assert_eq!(flash.get(ACR, 0), acr);
            flash.notes.iter().count()
        };
        let counts = [0x705, 0x605, 0x505, 0x005, 0x705].map(&mut notes);
        assert_eq!(counts, [0, 1, 1, 3, 0]);
        assert_eq!(notes(0x704), 1);
    }

    #[test]
    fn the_control_register_opens_with_both_keys_in_order_and_shuts_for_good_with_others() {
        let mut flash = unlocked();
        assert_eq!(flash.get(CR, 0), 0);
        flash.put(0, [(CR, LOCK)]);
        assert_eq!(flash.get(CR, 0), LOCK);
        flash.put(0, [KEYS[1], KEYS[0], KEYS[0], KEYS[1]].map(|key| (KEYR, key)));
        assert_eq!(flash.get(CR, 0), LOCK, "the first was wrong");
        flash.reset(0);
        flash.put(0, KEYS.map(|key| (KEYR, key)));
        assert_eq!(flash.get(CR, 0), 0, "a reset forgives");
    }

    #[test]
    fn programming_takes_16_us_and_clears_bits_only() {
        let mut flash = unlocked();
        begin(&mut flash, 0, A + 8, 0x1234_5678, 1_000);
        assert_eq!(flash.get(SR, 0), BSY);
        assert_eq!(flash.next_event(), Some((17_000, FlashEvent::Finished)));
        assert_eq!(word(&flash, A + 8), u32::MAX, "not before its end");
        assert_eq!(flash.finish(), A + 8..A + 12);
        assert_eq!((flash.get(SR, 0), word(&flash, A + 8)), (0, 0x1234_5678));
        program(&mut flash, A + 8, 0xffff_0000, 20_000);
        assert_eq!([A + 8, A + 12].map(|a| word(&flash, a)), [0x1234_0000, u32::MAX]);
    }

    #[test]
    fn erasing_sets_every_bit_of_one_sector_in_the_time_of_its_size_and_parallelism() {
        let mut flash = unlocked();
        let places = [0x080d_fffc, 0x080e_0000, 0x080f_fffc];
        for address in places {
            program(&mut flash, address, 0, 0);
        }
        for (sector, psize, ms, addresses) in [
            (11, 0, 2_000, 0x080e_0000..0x0810_0000),
            (11, 1, 1_300, 0x080e_0000..0x0810_0000),
            (11, 2, 1_000, 0x080e_0000..0x0810_0000),
            (4, 2, 550, 0x0801_0000..0x0802_0000),
            (2, 2, 250, 0x0800_8000..0x0800_c000),
        ] {
            flash.put(5, [(CR, SER | sector << 3 | psize << 8 | STRT)]);
            assert_eq!(
                flash.next_event(),
                Some((5 + 1_000_000 * ms, FlashEvent::Finished))
            );
            assert_eq!(flash.get(CR, 0) & STRT, STRT);
            assert_eq!(flash.finish(), addresses);
            assert_eq!(flash.get(CR, 0) & STRT, 0);
        }
        let words = places.map(|address| word(&flash, address));
        assert_eq!(words, [0, u32::MAX, u32::MAX], "sector 10 stays");
    }

    #[test]
    fn a_part_of_two_banks_has_twelve_more_sectors_and_does_not_stall_for_them() {
        let mut flash = unlocked();
        flash.set_end(0x0820_0000);
        for (snb, addresses) in [(0x10, 0x0810_0000..0x0810_4000), (0x1b, 0x081e_0000..0x0820_0000)] {
            program(&mut flash, addresses.end - 4, 0, 0);
            assert_eq!(word(&flash, addresses.end - 4), 0);
            flash.put(0, [(CR, SER | snb << 3 | BY_WORDS | STRT)]);
            assert!(flash.busy() && !flash.stalls());
            assert_eq!(flash.finish(), addresses);
            assert_eq!(word(&flash, addresses.end - 4), u32::MAX);
        }
        flash.put(0, [(CR, SER | 11 << 3 | STRT)]);
        assert!(flash.stalls());
        flash.finish();
        let ends = [BANK_2, 0x0820_0000 - 4];
        for address in ends {
            program(&mut flash, address, 0, 0);
        }
        flash.put(0, [(CR, MER1 | BY_WORDS | STRT)]);
        assert_eq!(flash.next_event(), Some((8_000_000_000, FlashEvent::Finished)));
        assert!(!flash.stalls());
        assert_eq!(flash.finish(), BANK_2..0x0820_0000);
        assert_eq!(ends.map(|address| word(&flash, address)), [u32::MAX; 2]);
        assert_eq!(flash.notes.iter().count(), 0);
        let mut one = unlocked();
        one.put(0, [(CR, SER | 0x10 << 3)]);
        assert_eq!(one.get(CR, 0), SER, "no such bit");
    }

    #[test]
    fn each_way_to_program_wrongly_has_its_flag_and_programs_nothing() {
        let mut flash = unlocked();
        let mut store = |cr: u32, address: u32, bytes: u32| {
            flash.put(0, [(CR, cr)]);
            flash.store(address, bytes, 0, 0);
            let flags = flash.get(SR, 0);
            flash.put(0, [(SR, flags)]);
            assert_eq!(flash.get(SR, 0), 0, "rc_w1");
            flags
        };
        assert_eq!(store(BY_WORDS, A, 4), PGSERR, "PG is not set");
        assert_eq!(store(PG | BY_WORDS, A, 2), PGPERR, "half a word by words");
        assert_eq!(store(PG, A, 4), PGPERR, "a word by bytes");
        assert_eq!(store(PG | BY_WORDS, A + 2, 4), PGPERR, "unaligned");
        assert_eq!(store(PG | BY_WORDS, A + 14, 4), PGAERR, "across a row");
        assert_eq!(store(PG | BY_WORDS, 0x0800_7ffc, 4), WRPERR, "sector 1");
        assert_eq!(store(PG | BY_WORDS | ERRIE, 0x0800_7ffc, 4), WRPERR | OPERR);
        assert!(flash.contents.iter().all(|byte| *byte == 0xff));
        assert_eq!(flash.operations.len(), 0);
    }

    #[test]
    fn a_sector_of_the_start_and_a_mass_erase_are_refused_and_noted() {
        for cr in [SER | 1 << 3, SER | 12 << 3, MER, MER | SER | 11 << 3] {
            let mut flash = unlocked();
            flash.put(0, [(CR, cr | STRT)]);
            assert!(!flash.busy());
            assert_eq!((flash.get(CR, 0), flash.notes.iter().count()), (cr, 1));
        }
    }

    #[test]
    fn the_end_interrupts_only_if_enabled() {
        let mut flash = unlocked();
        assert_eq!(program(&mut flash, A, 0, 0), 0);
        begin(&mut flash, EOPIE, A + 4, 0, 0);
        assert!(!flash.interrupt(0));
        flash.finish();
        assert!(flash.interrupt(0));
        flash.put(0, [(SR, EOP)]);
        assert!(!flash.interrupt(0));
    }

    #[test]
    fn a_reset_in_the_midst_leaves_as_many_bits_changed_as_time_had_passed() {
        // 256 steps of the share, and three deviations of a million bits drawn.
        for share in [0, 25, 50, 75, 100] {
            let mut flash = unlocked();
            flash.contents.fill(0);
            flash.put(0, [(CR, SER | 10 << 3 | BY_WORDS | STRT)]);
            flash.reset(share * 10_000_000);
            assert!(!flash.busy());
            let (tenth, eleventh) = flash.contents[(A - WRITABLE.start) as usize..].split_at(128 << 10);
            assert!(eleventh.iter().all(|byte| *byte == 0));
            let ones: u32 = tenth.iter().map(|byte| byte.count_ones()).sum();
            let changed = f64::from(ones) / f64::from(1 << 20);
            assert!((changed - share as f64 / 100.0).abs() < 0.0015, "{share} %");
        }
        let mut flash = unlocked();
        begin(&mut flash, 0, A, 0, 0);
        flash.reset(8_000);
        let ones = word(&flash, A).count_ones();
        assert!((8..=24).contains(&ones), "half of 32 bits, by a draw: {ones}");
    }

    #[test]
    fn power_goes_in_the_operation_that_was_named() {
        let mut flash = unlocked();
        program(&mut flash, A, 0, 0);
        flash.cut_power_in(1, 25);
        program(&mut flash, A + 4, 0, 0);
        begin(&mut flash, 0, A + 8, 0, 100_000);
        assert_eq!(flash.next_event(), Some((104_000, FlashEvent::PowerGone)));
        flash.reset(104_000);
        assert!(word(&flash, A + 8).count_ones() > 16, "a quarter was cleared");
        flash = FlashController { cr: 0, ..flash };
        begin(&mut flash, 0, A + 12, 0, 200_000);
        // Once only.
        assert_eq!(flash.next_event(), Some((216_000, FlashEvent::Finished)));
        let addresses: Vec<u32> = flash.operations.iter().map(|o| o.address).collect();
        assert_eq!(addresses, [A, A + 4, A + 8, A + 12]);
    }
}
