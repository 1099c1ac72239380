//! The parts on which an image can run: their memory, their peripherals and their pins.
//!
//! The table `chips.txt` is not hand-written. It comes from the crate `stm32-metapac`, whose metadata come
//! from ST's own database. `tests/all/tables.rs` makes it and checks it against that crate. Device numbers
//! and limits of clocks are not in that database, and are defined here.

use std::fmt;
use std::ops::Range;
use std::str::FromStr;
use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

use crate::memory::{self, FLASH};

const TEXT: &str = include_str!("chips.txt");

/// First address of core-coupled memory and of SRAM on all parts.
const CCM_START: u32 = 0x1000_0000;
const SRAM_START: u32 = 0x2000_0000;
/// The ports of the table's pin masks, in order.
const PORTS: &str = "ABCDEFGHIJK";

#[derive(Debug)]
struct Row {
    name: &'static str,
    flash_kib: u32,
    sram: Range<u32>,
    ccm: Range<u32>,
    peripherals: Vec<&'static str>,
    /// A mask of pins for each port.
    pins: Vec<u16>,
}

struct Table {
    rows: Vec<Row>,
    /// First address and name of each peripheral of any part.
    places: Vec<(u32, &'static str)>,
    functions: Vec<NewFunction>,
    requests: Vec<NewRequest>,
}

static TABLE: LazyLock<Table> = LazyLock::new(|| {
    let (mut rows, mut places, mut functions) = (Vec::new(), Vec::new(), Vec::new());
    let (mut sets, mut packages, mut requests) = (Vec::new(), Vec::new(), Vec::new());
    let hex = |text: &str| u32::from_str_radix(text, 16).expect("the table has hex numbers there");
    for line in TEXT.lines() {
        let words: Vec<&str> = line.split(' ').collect();
        match words[..] {
            ["at", address, name] => places.push((hex(address), name)),
            ["peripherals", _, ref names @ ..] => sets.push(names.to_vec()),
            ["pins", _, ref masks @ ..] => packages.push(masks.iter().map(|mask| hex(mask) as u16).collect()),
            ["function", line, pin, function, peripheral, signal] => functions.push(NewFunction {
                line,
                pin,
                function,
                peripheral,
                signal,
            }),
            ["request", line, dma, stream, channel, name] => {
                let number = |text: &str| text.parse::<usize>().expect("the table has numbers there");
                requests.push(NewRequest {
                    line,
                    dma: number(dma) - 1,
                    stream: number(stream),
                    channel: number(channel) as u32,
                    name,
                });
            }
            ["chip", name, ref numbers @ ..] => {
                let number = |n: usize| -> u32 { numbers[n].parse().expect("the table has numbers there") };
                let set: &Vec<_> = &sets[number(3) as usize];
                let pins: &Vec<_> = &packages[number(4) as usize];
                let region = |start, n| start..start + 1024 * number(n);
                rows.push(Row {
                    name,
                    flash_kib: number(0),
                    sram: region(SRAM_START, 1),
                    ccm: region(CCM_START, 2),
                    peripherals: set.clone(),
                    pins: pins.clone(),
                });
            }
            _ => {}
        }
    }
    Table {
        rows,
        places,
        functions,
        requests,
    }
});

/// An alternate function of a pin that parts of this line have and the STM32F405 lacks.
pub(crate) struct NewFunction {
    line: &'static str,
    pub(crate) pin: &'static str,
    pub(crate) function: &'static str,
    pub(crate) peripheral: &'static str,
    pub(crate) signal: &'static str,
}

/// A request to a DMA stream and channel that parts of this line have and the STM32F405 lacks.
pub(crate) struct NewRequest {
    line: &'static str,
    /// 0 for DMA1.
    pub(crate) dma: usize,
    pub(crate) stream: usize,
    pub(crate) channel: u32,
    pub(crate) name: &'static str,
}

/// New requests of all parts.
pub(crate) fn new_requests() -> &'static [NewRequest] {
    &TABLE.requests
}

/// New functions of all parts. A function that means something else on another part belongs to no model.
pub(crate) fn new_functions() -> &'static [NewFunction] {
    &TABLE.functions
}

/// A part of the STM32F4: F401, F405, F407, F411, F415, F427, F429 or F446. The default is the STM32F405RG.
///
/// ```
/// use stm32f405_qemu::Chip;
///
/// let chip: Chip = "STM32F411CEUx".parse()?;
/// assert_eq!(chip.to_string(), "STM32F411CE");
/// assert_eq!(chip.sram().len(), 128 << 10);
/// assert!(!chip.has_pin("PD5") && !chip.has("DAC1"));
/// # Ok::<(), stm32f405_qemu::UnknownChip>(())
/// ```
#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Chip(&'static Row);

/// Error for an unknown part name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no chip {0:?}; give one of {list}", list = names())]
pub struct UnknownChip(String);

/// All names, with their common prefix given once: `STM32F405 RG VG, ...`.
fn names() -> String {
    let (mut text, mut line) = (String::new(), "");
    for row in &TABLE.rows {
        let (this, rest) = row.name.split_at("STM32F405".len());
        if this != line {
            let separator = if text.is_empty() { "" } else { ", " };
            text += &format!("{separator}{this}");
            line = this;
        }
        text += &format!(" {rest}");
    }
    text
}

impl FromStr for Chip {
    type Err = UnknownChip;

    /// Letters for package and temperature may follow the name, as in `STM32F405RGT6` and `STM32F405RGTx`.
    fn from_str(name: &str) -> Result<Self, UnknownChip> {
        let upper = name.to_ascii_uppercase();
        let fits = |row: &&Row| upper.strip_prefix(row.name).is_some_and(|rest| rest.len() <= 4);
        let found = TABLE.rows.iter().find(fits);
        found.map(Self).ok_or_else(|| UnknownChip(name.into()))
    }
}

impl TryFrom<String> for Chip {
    type Error = UnknownChip;

    fn try_from(name: String) -> Result<Self, UnknownChip> {
        name.parse()
    }
}

impl From<Chip> for String {
    fn from(chip: Chip) -> Self {
        chip.0.name.into()
    }
}

impl Default for Chip {
    fn default() -> Self {
        "STM32F405RG".parse().expect("the table has it")
    }
}

impl PartialEq for Chip {
    fn eq(&self, other: &Self) -> bool {
        self.0.name == other.0.name
    }
}

impl Eq for Chip {}

impl fmt::Display for Chip {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0.name)
    }
}

impl fmt::Debug for Chip {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0.name)
    }
}

/// Highest frequencies of a part, Hz (its data sheet, general operating conditions).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ClockLimits {
    pub(crate) sysclk: u32,
    pub(crate) pclk1: u32,
    pub(crate) pclk2: u32,
}

impl ClockLimits {
    const fn mhz(sysclk: u32, pclk1: u32, pclk2: u32) -> Self {
        let (sysclk, pclk1, pclk2) = (1_000_000 * sysclk, 1_000_000 * pclk1, 1_000_000 * pclk2);
        Self { sysclk, pclk1, pclk2 }
    }
}

impl Default for ClockLimits {
    /// The limits of the STM32F405.
    fn default() -> Self {
        Self::mhz(168, 42, 84)
    }
}

impl Chip {
    /// All parts, sorted by name.
    pub fn all() -> impl Iterator<Item = Self> {
        TABLE.rows.iter().map(Self)
    }

    /// Size of the flash, KiB.
    pub fn flash_kib(self) -> u32 {
        self.0.flash_kib
    }

    /// Addresses of the flash.
    pub fn flash(self) -> Range<u32> {
        FLASH.start..FLASH.start + 1024 * self.0.flash_kib
    }

    /// Addresses of the emulated flash. Those beyond a smaller flash read as erased.
    pub(crate) fn flash_space(self) -> Range<u32> {
        FLASH.start..FLASH.end.max(self.flash().end)
    }

    /// Addresses of the SRAM, which the DMA reaches.
    pub fn sram(self) -> Range<u32> {
        self.0.sram.clone()
    }

    /// Addresses of the core-coupled memory, which the DMA does not reach. Empty if the part has none.
    pub fn ccm(self) -> Range<u32> {
        self.0.ccm.clone()
    }

    /// DEV_ID of DBGMCU_IDCODE (RM0368 section 23.6.1, RM0090 section 38.6.1, RM0383 section 23.6.1, RM0390
    /// section 33.6.1).
    pub fn device_id(self) -> u16 {
        match (self.line(), self.0.flash_kib) {
            ("F401", ..=256) => 0x423,
            ("F401", _) => 0x433,
            ("F411", _) => 0x431,
            ("F427" | "F429", _) => 0x419,
            ("F446", _) => 0x421,
            _ => 0x413,
        }
    }

    /// Returns `true` if the part has a peripheral of this name, for example `SPI4`.
    pub fn has(self, peripheral: &str) -> bool {
        self.0.peripherals.contains(&peripheral)
    }

    /// Returns `true` if the package has a pin of this name, for example `PC13`.
    pub fn has_pin(self, name: &str) -> bool {
        let Some((port, number)) = name.strip_prefix('P').and_then(|rest| rest.split_at_checked(1)) else {
            return false;
        };
        let mask = PORTS.find(port).and_then(|port| self.0.pins.get(port));
        let number = number.parse::<u32>().ok().filter(|number| *number < 16);
        mask.zip(number)
            .is_some_and(|(mask, number)| mask >> number & 1 == 1)
    }

    /// Names of the part's peripherals.
    pub fn peripherals(self) -> &'static [&'static str] {
        &self.0.peripherals
    }

    /// Returns `true` if the part has a new request.
    pub(crate) fn has_request(self, new: &NewRequest) -> bool {
        let place = |request: &NewRequest| (request.dma, request.stream, request.channel);
        let mut own = TABLE.requests.iter().filter(|own| own.line == self.line());
        own.any(|own| place(own) == place(new))
    }

    /// Returns `true` if the part has a new function.
    pub(crate) fn has_function(self, pin: &str, function: &str) -> bool {
        let functions = &mut TABLE.functions.iter();
        functions.any(|new| (new.line, new.pin, new.function) == (self.line(), pin, function))
    }

    /// The part's peripheral at an address: its first address and name.
    pub(crate) fn peripheral_at(self, address: u32) -> Option<(u32, &'static str)> {
        places_at(address).find(|(_, name)| self.has(name))
    }

    /// Returns `true` if other parts have a peripheral at an address and this one has none.
    pub(crate) fn lacks(self, address: u32) -> bool {
        places_at(address).next().is_some() && self.peripheral_at(address).is_none()
    }

    /// Returns `true` if these bytes are in the part's SRAM or CCM.
    pub(crate) fn is_ram(self, address: u32, bytes: usize) -> bool {
        memory::within(&self.0.sram, address, bytes) || memory::within(&self.0.ccm, address, bytes)
    }

    pub(crate) fn is_sram(self, address: u32) -> bool {
        self.0.sram.contains(&address)
    }

    /// Returns `true` if the part has the regulator's overdrive, for more than 168 MHz.
    pub(crate) fn has_overdrive(self) -> bool {
        matches!(self.line(), "F427" | "F429" | "F446")
    }

    /// Bits of RCC_DCKCFGR and RCC_DCKCFGR2, as RM0368, RM0383, RM0090 (chapter 6) and RM0390 have them.
    pub(crate) fn clock_selections(self) -> [u32; 2] {
        match self.line() {
            "F401" | "F411" => [0x0100_0000, 0],
            "F427" | "F429" => [0x01f3_1f1f, 0],
            "F446" => [0x1ff0_1f1f, 0x3cc0_0000],
            _ => [0, 0],
        }
    }

    pub(crate) fn clock_limits(self) -> ClockLimits {
        match self.line() {
            "F401" => ClockLimits::mhz(84, 42, 84),
            "F411" => ClockLimits::mhz(100, 50, 100),
            _ if self.has_overdrive() => ClockLimits::mhz(180, 45, 90),
            _ => ClockLimits::default(),
        }
    }

    /// ADC1's channel of the temperature sensor. Channel 18 is also the battery's, which takes precedence
    /// (RM0090 section 13.10, RM0390 section 13.10; embassy-stm32 and stm32f4xx-hal for F401 and F411).
    pub(crate) fn temperature_channel(self) -> u32 {
        match self.line() {
            "F427" | "F429" | "F446" => 18,
            _ => 16,
        }
    }

    /// Divider of the battery voltage that ADC1 measures (RM0090 section 13.11; F401 and F411 are taken as
    /// the F405).
    pub(crate) fn battery_divider(self) -> u32 {
        if self.temperature_channel() == 18 { 4 } else { 2 }
    }

    fn line(self) -> &'static str {
        &self.0.name["STM32".len().."STM32F405".len()]
    }
}

/// The peripherals at an address, of any part. A page has one, or two if parts differ.
fn places_at(address: u32) -> impl Iterator<Item = (u32, &'static str)> {
    let before = TABLE
        .places
        .iter()
        .take_while(move |(start, _)| *start <= address);
    let start = before.last().map(|(start, _)| *start);
    // Four converter blocks share a page; all others have at least a page each.
    let start = start.filter(|start| address - start < 0x400);
    let all = TABLE.places.iter();
    all.filter(move |place| Some(place.0) == start).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_may_end_with_package_and_temperature_and_an_unknown_one_lists_all() {
        for name in ["STM32F446RE", "stm32f446re", "STM32F446RETx", "STM32F446RET6"] {
            assert_eq!(name.parse::<Chip>().unwrap().to_string(), "STM32F446RE");
        }
        for name in ["STM32F446", "STM32F103C8", "", "STM32F446RE and more"] {
            let said = name.parse::<Chip>().unwrap_err().to_string();
            let listed = "STM32F405 OE OG RG VG ZG, STM32F407 IE";
            assert!(said.contains(listed) && !said.contains('\n'), "{said}");
        }
    }

    /// Data sheets: DocID024738 (F401xD/E), DocID026289 (F411), DocID024030 (F429), DocID027107 (F446).
    #[test]
    fn parts_have_the_memory_and_pins_of_their_data_sheets() {
        for (name, flash_kib, sram_kib, ccm_kib, pins) in [
            ("STM32F401CC", 256, 64, 0, 36),
            ("STM32F405RG", 1024, 128, 64, 51),
            ("STM32F411CE", 512, 128, 0, 36),
            ("STM32F427ZG", 1024, 192, 64, 114),
            ("STM32F429ZI", 2048, 192, 64, 114),
            ("STM32F446RE", 512, 128, 0, 50),
        ] {
            let chip: Chip = name.parse().unwrap();
            let kib = |range: Range<u32>| range.len() >> 10;
            assert_eq!(
                (chip.flash_kib(), kib(chip.sram()), kib(chip.ccm())),
                (flash_kib, sram_kib, ccm_kib),
                "{name}"
            );
            let ports = PORTS
                .chars()
                .flat_map(|port| (0..16).map(move |n| format!("P{port}{n}")));
            assert_eq!(ports.filter(|pin| chip.has_pin(pin)).count(), pins, "{name}");
        }
    }
}
