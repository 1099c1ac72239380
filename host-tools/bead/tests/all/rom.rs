//! `bead flash --rom` against a model of the loader in the part's ROM (AN3155), with a line that fails.

use std::collections::BTreeMap;

use crate::flash::image;
use crate::program::{ROOT, TestFolder, asked, json, refused};
use crate::schema::assert_valid;

const ACK: u8 = 0x79;
const NACK: u8 = 0x1f;
const FLASH: u32 = 0x0800_0000;
const RAM: u32 = 0x2000_3000;

/// The loader's state: what has to come next.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Waits {
    BitRate,
    Command,
    Complement(u8),
    Address(u8),
    /// The number of bytes that are to be read, and its complement.
    Number(u32),
    /// Bytes to write: their number, themselves, their checksum.
    Data(u32),
    Sectors,
    /// For a reset.
    Nothing,
}

/// The loader, written from AN3155 and not from what `bead` does. Memory follows RM0090: a write clears
/// bits of flash, and an erase sets those of a sector.
struct RomLoader {
    waits: Waits,
    received: Vec<u8>,
    flash: Vec<u8>,
    ram: BTreeMap<u32, u8>,
    part: u16,
    is_locked: bool,
    erased: Vec<u16>,
    /// Address to which Go led.
    started: Option<u32>,
    /// Bytes received in all.
    bytes: usize,
    /// The byte of which the line flips a bit, and the one after which it is cut.
    flips: Option<usize>,
    cut: Option<usize>,
}

impl RomLoader {
    fn new() -> Self {
        Self {
            waits: Waits::BitRate,
            received: Vec::new(),
            flash: vec![0xff; 1 << 20],
            ram: BTreeMap::new(),
            part: 0x413,
            is_locked: false,
            erased: Vec::new(),
            started: None,
            bytes: 0,
            flips: None,
            cut: None,
        }
    }

    /// Takes bytes and returns the answer.
    fn take(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut answer = Vec::new();
        for byte in bytes {
            self.bytes += 1;
            if self.cut.is_some_and(|cut| self.bytes > cut) {
                continue;
            }
            let flip = if self.flips == Some(self.bytes) { 0x10 } else { 0 };
            self.received.push(byte ^ flip);
            if let Some((said, next)) = self.step() {
                self.received.clear();
                self.waits = next;
                answer.extend(said);
            }
        }
        answer
    }

    /// The answer to what was received, if it is whole, and what comes next.
    fn step(&mut self) -> Option<(Vec<u8>, Waits)> {
        let received = self.received.clone();
        let sum = received.iter().fold(0, |sum, byte| sum ^ byte);
        let (ack, nack) = (vec![ACK], (vec![NACK], Waits::Command));
        match (self.waits, received.len()) {
            (Waits::BitRate, _) if received == [0x7f] => Some((ack, Waits::Command)),
            (Waits::Command, _) => Some((Vec::new(), Waits::Complement(received[0]))),
            (Waits::Complement(command), _) if received[0] == !command => Some(self.command(command)),
            (Waits::Complement(_), _) => Some(nack),
            (Waits::Address(_), 5) if sum != 0 => Some(nack),
            (Waits::Address(command), 5) => Some(self.address(command, &received)),
            (Waits::Number(at), 2) if received[0] == !received[1] => {
                let bytes = (at..)
                    .take(usize::from(received[0]) + 1)
                    .map(|address| self.byte(address));
                Some((ack.into_iter().chain(bytes).collect(), Waits::Command))
            }
            (Waits::Number(_), 2) => Some(nack),
            (Waits::Data(at), length) if length == usize::from(received[0]) + 3 => {
                if sum != 0 || (length - 2) % 4 != 0 {
                    return Some(nack);
                }
                (at..)
                    .zip(&received[1..length - 1])
                    .for_each(|(address, byte)| self.write(address, *byte));
                Some((ack, Waits::Command))
            }
            (Waits::Sectors, 2..) => {
                let number = |at: usize| u16::from_be_bytes([received[at], received[at + 1]]);
                let count = usize::from(number(0)) + 1;
                // 0xffff and its neighbours erase banks: nothing here is to send them.
                assert!(count <= 12, "a mass erase");
                if received.len() < 2 + 2 * count + 1 {
                    return None;
                }
                if sum != 0 {
                    return Some(nack);
                }
                (1..=count).for_each(|at| self.erase(number(2 * at)));
                Some((ack, Waits::Command))
            }
            _ => None,
        }
    }

    fn command(&mut self, command: u8) -> (Vec<u8>, Waits) {
        match command {
            0x02 => {
                let [high, low] = self.part.to_be_bytes();
                (vec![ACK, 1, high, low, ACK], Waits::Command)
            }
            0x11 | 0x21 | 0x31 | 0x44 if self.is_locked => (vec![NACK], Waits::Command),
            0x11 | 0x21 | 0x31 => (vec![ACK], Waits::Address(command)),
            0x44 => (vec![ACK], Waits::Sectors),
            _ => (vec![NACK], Waits::Command),
        }
    }

    fn address(&mut self, command: u8, bytes: &[u8]) -> (Vec<u8>, Waits) {
        let address = u32::from_be_bytes(bytes[..4].try_into().unwrap());
        let is_memory =
            (FLASH..FLASH + (1 << 20)).contains(&address) || (RAM..0x2002_0000).contains(&address);
        match command {
            _ if !is_memory => (vec![NACK], Waits::Command),
            0x11 => (vec![ACK], Waits::Number(address)),
            0x31 => (vec![ACK], Waits::Data(address)),
            _ => {
                self.started = Some(address);
                (vec![ACK], Waits::Nothing)
            }
        }
    }

    fn byte(&self, address: u32) -> u8 {
        match self.flash.get(address.wrapping_sub(FLASH) as usize) {
            Some(byte) => *byte,
            None => self.ram.get(&address).copied().unwrap_or(0),
        }
    }

    fn word(&self, address: u32) -> u32 {
        u32::from_le_bytes([0, 1, 2, 3].map(|at| self.byte(address + at)))
    }

    fn write(&mut self, address: u32, byte: u8) {
        match self.flash.get_mut(address.wrapping_sub(FLASH) as usize) {
            Some(there) => *there &= byte,
            None => drop(self.ram.insert(address, byte)),
        }
    }

    fn erase(&mut self, sector: u16) {
        let starts = [0, 16, 32, 48, 64, 128, 256, 384, 512, 640, 768, 896, 1024];
        let [start, end] = [0, 1].map(|at| starts[usize::from(sector) + at] * 1024);
        self.flash[start..end].fill(0xff);
        self.erased.push(sector);
    }

    /// Runs the code that Go started, and returns the word that it writes and its address. It may load
    /// words, store one, and then stand still (ARMv7-M manual: LDR literal, STR immediate, B, encodings T1
    /// and T2).
    fn stored(&self) -> Option<(u32, u32)> {
        let start = self.started?;
        assert!((RAM..0x2002_0000).contains(&self.word(start)), "a stack in RAM");
        let mut at = self.word(start + 4);
        assert_eq!(at & 1, 1, "Thumb");
        at &= !1;
        let (mut registers, mut stored) = ([0; 8], None);
        loop {
            let code = self.word(at & !3) >> (8 * (at & 2)) & 0xffff;
            match code >> 11 {
                0b01001 => {
                    registers[(code >> 8 & 7) as usize] = self.word(((at + 4) & !3) + 4 * (code & 0xff))
                }
                0b01100 if code >> 6 & 31 == 0 => {
                    stored = Some(
                        [code, code >> 3]
                            .map(|number| registers[(number & 7) as usize])
                            .into(),
                    );
                }
                0b11100 if code & 0x7ff == 0x7fe => return stored,
                _ => panic!("{code:#06x} at {at:#010x}"),
            }
            at += 2;
        }
    }
}

const LENGTH: usize = 20_001;

/// Runs `bead flash --rom` with the loader at the other end.
fn flash(folder: &TestFolder, words: &str, loader: &mut RomLoader) -> std::process::Output {
    folder.write("image", image("weact-f405", LENGTH).0);
    let line = format!("flash --rom image {words}");
    asked(folder, &line, |bytes| loader.take(bytes))
}

/// Asserts that the image is in flash, the sectors beside it are as they were, and the part was reset.
fn assert_flashed(loader: &RomLoader) {
    let flat = image("weact-f405", LENGTH).1;
    assert!(loader.flash.starts_with(&flat));
    // SYSRESETREQ with its key into AIRCR (PM0214 section 4.4.5).
    assert_eq!(loader.stored(), Some((0x05fa_0004, 0xe000_ed0c)));
}

#[test]
fn an_image_replaces_another_one_and_nothing_else_in_flash() {
    let (folder, mut loader) = (TestFolder::new(), RomLoader::new());
    loader.flash.fill(0x5a);
    let old = image("weact-f405", 60_000).1;
    loader.flash[..old.len()].copy_from_slice(&old);
    let report = json(flash(&folder, "--format json", &mut loader));
    assert_valid(&format!("{ROOT}/docs/schemas"), "flash", &report);
    assert!(report["before"]["version"] == "9.8.7" && report["after"]["board"] == "weact-f405");
    assert_flashed(&loader);
    assert_eq!(loader.erased, [0, 1]);
    assert!(loader.flash[LENGTH..32 << 10].iter().all(|byte| *byte == 0xff));
    assert_eq!(loader.flash[32 << 10..old.len()], old[32 << 10..]);
    assert!(loader.flash[old.len()..].iter().all(|byte| *byte == 0x5a));
}

#[test]
fn a_loader_that_was_spoken_to_before_and_a_line_that_flips_a_bit_do_no_harm() {
    let (folder, mut loader) = (TestFolder::new(), RomLoader::new());
    loader.waits = Waits::Command;
    json(flash(&folder, "--format json", &mut loader));
    assert_flashed(&loader);
    let whole = loader.bytes;
    // Bytes of every kind, near the end: of commands, addresses, data and checksums.
    let ends = (whole - 340..whole)
        .step_by(29)
        .chain([900, 5000, 5001, 5002, 9000]);
    for flips in ends {
        let mut loader = RomLoader::new();
        loader.flips = Some(flips);
        json(flash(&folder, "--format json", &mut loader));
        assert_flashed(&loader);
    }
}

#[test]
fn another_part_a_locked_one_or_another_board_s_image_is_told_before_anything_is_erased() {
    let folder = TestFolder::new();
    let [mut part, mut locked, mut other] = [(); 3].map(|()| RomLoader::new());
    part.part = 0x421;
    locked.is_locked = true;
    other.flash[..1000].copy_from_slice(&image("olimex-h405", 1000).1);
    for (loader, status, why) in [
        (&mut part, 2, "the part is 0x421 (STM32F446"),
        (&mut locked, 3, "refuses Read Memory: the part is locked"),
        (&mut other, 2, "the image 9.8.7 (0123456789ab) for olimex-h405"),
    ] {
        refused(&flash(&folder, "", loader), status, why);
        assert!(loader.erased.is_empty());
    }
    json(flash(&folder, "--board weact-f405 --format json", &mut other));
    assert_flashed(&other);
}

#[test]
fn a_line_that_is_cut_leaves_no_vectors_to_start_from_and_the_same_command_again_ends_it() {
    let (folder, mut loader) = (TestFolder::new(), RomLoader::new());
    loader.flash[..1000].copy_from_slice(&image("weact-f405", 1000).1);
    // In the middle of writing.
    loader.cut = Some(15_000);
    let why = "the line was cut, or the loader has stopped, during Write Memory at 0x0800";
    refused(&flash(&folder, "", &mut loader), 3, why);
    assert_eq!(loader.word(FLASH), u32::MAX);
    assert!(loader.flash[..LENGTH] != image("weact-f405", LENGTH).1);
    // A reset with BOOT0 high.
    loader.waits = Waits::BitRate;
    loader.received.clear();
    loader.cut = None;
    json(flash(&folder, "--format json", &mut loader));
    assert_flashed(&loader);
}
