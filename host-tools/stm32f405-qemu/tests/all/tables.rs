//! The tables of parts and of connections (`src/chips.txt`, `src/machine/connections.txt`) against the
//! metadata of the crate stm32-metapac, which come from ST's own database.

#![expect(clippy::unwrap_used, reason = "in helpers of tests")]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// Lines of the STM32F4 whose parts are in the table.
const LINES: [&str; 8] = [
    "stm32f401",
    "stm32f405",
    "stm32f407",
    "stm32f411",
    "stm32f415",
    "stm32f427",
    "stm32f429",
    "stm32f446",
];

const CHIPS: &str = "\
# Parts of the STM32F4 from the crate stm32-metapac VERSION (MIT OR Apache-2.0), as ST's database has them. Made by
# TABLES=overwrite cargo test --release -p stm32f405-qemu --test all tables::
# at ADDRESS PERIPHERAL; peripherals N NAMES; pins N MASKS of the ports A to K;
# function LINE PIN FUNCTION PERIPHERAL SIGNAL, where the STM32F405 has no such function of the pin;
# request LINE DMA STREAM CHANNEL NAME, where the STM32F405 has no such request;
# chip NAME, KiB of flash, KiB of SRAM, KiB of CCM, its peripherals, its pins.
";

const CONNECTIONS: &str = "\
# Pins, DMA requests, interrupts and clock gates of the STM32F405, from the crate stm32-metapac VERSION (MIT OR
# Apache-2.0), as ST's database has them. Made by
# TABLES=overwrite cargo test --release -p stm32f405-qemu --test all tables::
# pin PIN FUNCTION PERIPHERAL SIGNAL, request DMA STREAM CHANNEL NAME, interrupt NUMBER PERIPHERAL SIGNAL,
# enable or reset REGISTER BIT PERIPHERAL, line NUMBER NAME.
";

/// Kinds of peripherals whose pins and interrupts a model could have.
const KINDS: [&str; 8] = ["TIM", "USART", "UART", "ADC", "I2C", "SPI", "RNG", "WWDG"];

/// The folder of stm32-metapac in cargo's registry, where cargo has it for the images that use embassy.
fn metapac() -> PathBuf {
    let ran = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--locked"])
        .args(["--filter-platform", "thumbv7em-none-eabihf"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    let metadata: Value = serde_json::from_slice(&ran.stdout).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    let package = packages.iter().find(|package| package["name"] == "stm32-metapac");
    let manifest = package.unwrap()["manifest_path"].as_str().unwrap();
    Path::new(manifest).parent().unwrap().to_owned()
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The metadata that a part shares with other parts.
fn shared(metapac: &Path, chip: &str) -> String {
    let name = between(chip, "include!(\"../", "\")");
    read(&metapac.join("src/chips").join(name))
}

fn head(text: &str, metapac: &Path) -> String {
    let version = read(&metapac.join("Cargo.toml"));
    text.replace("VERSION", between(&version, "\nversion = \"", "\""))
}

fn between<'a>(text: &'a str, before: &str, after: &str) -> &'a str {
    let (_, rest) = text.split_once(before).unwrap_or_else(|| panic!("no {before:?}"));
    rest.split_once(after).unwrap_or_else(|| panic!("no {after:?}")).0
}

fn digits(text: &str) -> &str {
    text.split(|c: char| !c.is_ascii_digit())
        .next()
        .unwrap_or_default()
}

/// Name and description of each peripheral.
fn peripherals(metadata: &str) -> impl Iterator<Item = (&str, &str)> {
    let all = metadata.split("\n    Peripheral {\n").skip(1);
    all.map(|peripheral| (between(peripheral, "name: \"", "\""), peripheral))
}

/// Lines of pins, DMA requests and interrupts.
fn connections(metadata: &str) -> BTreeSet<String> {
    // Skips the interrupts of peripherals, whose entries begin with a signal.
    let entries = metadata.split("Interrupt {");
    let entries = entries.filter_map(|entry| entry.trim_start().strip_prefix("name: \"")?.split_once("\","));
    let numbers: BTreeMap<_, _> = entries
        .map(|(name, rest)| (name, digits(between(rest, "number: ", "}"))))
        .collect();
    let lines = numbers
        .iter()
        .map(|(name, number)| format!("line {number} {name}"));
    let mut lines: BTreeSet<String> = lines.collect();
    for (name, peripheral) in peripherals(metadata) {
        for channel in peripheral.split("PeripheralDmaChannel {").skip(1) {
            let signal = between(channel, "signal: \"", "\"");
            let place = between(channel, "channel: Some(\"DMA", "\")").replace("_CH", " ");
            let number = between(channel, "request: Some(", ")");
            let mut request = format!("request {place} {number} {name}");
            if signal != name {
                request += &format!("_{signal}");
            }
            lines.insert(request);
        }
        if !KINDS.iter().any(|kind| name.starts_with(kind)) {
            continue;
        }
        for pin in peripheral.split("PeripheralPin {").skip(1) {
            let (at, signal) = (between(pin, "pin: \"", "\""), between(pin, "signal: \"", "\""));
            let function = match between(pin, "af: ", ",\n") {
                "None" => "-",
                some => between(some, "Some(", ")"),
            };
            lines.insert(format!("pin {at} {function} {name} {signal}"));
        }
        for interrupt in peripheral.split("PeripheralInterrupt {").skip(1) {
            let signal = between(interrupt, "signal: \"", "\"");
            let number = &numbers[between(interrupt, "interrupt: \"", "\"")];
            lines.insert(format!("interrupt {number} {name} {signal}"));
        }
    }
    lines
}

/// Lines of clock gates. Their bits are in the description of RCC.
fn gates(metadata: &str, rcc: &str) -> BTreeSet<String> {
    let mut lines = BTreeSet::new();
    // The STM32F405 has no gate of the RTC.
    for (name, peripheral) in peripherals(metadata).filter(|(name, _)| *name != "RTC") {
        for which in ["enable", "reset"] {
            let register = peripheral.split_once(&format!("{which}: Some(PeripheralRccRegister {{"));
            let Some((_, register)) = register else { continue };
            let field = between(register, "field: \"", "\"").to_lowercase();
            let register = between(register, "register: \"", "\"");
            let (first, rest) = register.split_at(1);
            let fields = format!("name: \"{first}{}\"", rest.to_lowercase());
            let fields = between(rcc, &fields, "FieldSet {");
            let field = between(fields, &format!("name: \"{field}\""), "bit_size");
            let (_, bit) = field.split_once(" offset: ").unwrap();
            lines.insert(format!("{which} {register} {} {name}", digits(bit)));
        }
    }
    lines
}

fn table_of_connections(metapac: &Path) -> String {
    // The package with the most pins.
    let shared = shared(metapac, &read(&metapac.join("src/chips/stm32f405zg/metadata.rs")));
    let rcc = read(&metapac.join("src/registers/rcc_f4.rs"));
    let mut lines = connections(&shared);
    lines.append(&mut gates(&shared, &rcc));
    let lines = lines.iter().map(|line| format!("{line}\n"));
    head(CONNECTIONS, metapac) + &lines.collect::<String>()
}

/// Alternate functions and DMA requests of modelled peripherals that the STM32F405 lacks, for a line of
/// parts.
fn new_connections(metadata: &str, line: &str) -> BTreeSet<String> {
    let known: BTreeSet<&str> = include_str!("../../src/machine/connections.txt")
        .lines()
        .collect();
    let new = |connection: &String| {
        let words: Vec<_> = connection.split(' ').collect();
        match words[..] {
            _ if known.contains(&**connection) => None,
            ["pin", _, "-", ..] => None,
            ["pin", pin, function, name, signal] if !signal.starts_with("I2S") => {
                let name_within = format!(" {name} ");
                let modelled = known.iter().any(|line| line.contains(&name_within));
                modelled.then(|| format!("function {line} {pin} {function} {name} {signal}\n"))
            }
            ["request", dma, stream, channel, name] => {
                let modelled = known.iter().any(|line| line.ends_with(&format!(" {name}")));
                modelled.then(|| format!("request {line} {dma} {stream} {channel} {name}\n"))
            }
            _ => None,
        }
    };
    connections(metadata).iter().filter_map(new).collect()
}

fn number(text: &str) -> u32 {
    let hex = text
        .strip_prefix("0x")
        .map(|digits| u32::from_str_radix(digits, 16));
    hex.unwrap_or_else(|| text.parse()).unwrap()
}

/// KiB of flash, of SRAM and of core-coupled memory.
fn memory(chip: &str) -> [u32; 3] {
    let mut kib = [0; 3];
    // If there are two layouts, the first has one bank.
    let (_, layouts) = chip.split_once("memory: &[").unwrap();
    let layout = between(layouts, "&[", "]");
    for region in layout.split("MemoryRegion {").skip(1) {
        let size = number(between(region, "size: ", ","));
        let name = between(region, "name: \"", "\"");
        let kind = ["BANK", "SRAM", "CCMRAM"]
            .iter()
            .position(|kind| name.starts_with(kind));
        match kind {
            Some(kind) => kib[kind] += size / 1024,
            None => assert_eq!(name, "OTP"),
        }
    }
    kib
}

/// A mask of pins for each port.
fn pins(metadata: &str) -> String {
    let (_, list) = metadata.split_once("static PINS:").unwrap();
    let mut ports = [0_u16; 11];
    for pin in list.split("name: \"P").skip(1) {
        let (name, _) = pin.split_once('"').unwrap();
        let port = usize::from(name.as_bytes()[0] - b'A');
        // Some pins are called PC2_C and the like, on parts other than these.
        ports[port] |= 1 << name[1..].parse::<u32>().unwrap();
    }
    ports.map(|mask| format!("{mask:x}")).join(" ")
}

fn table_of_chips(metapac: &Path) -> String {
    let mut text = head(CHIPS, metapac);
    let folder = metapac.join("src/chips");
    let mut chips: Vec<String> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| LINES.iter().any(|line| name.starts_with(line)))
        .collect();
    chips.sort();
    let (mut places, mut sets, mut packages) = (BTreeMap::new(), Vec::new(), Vec::new());
    let (mut rows, mut new) = (String::new(), BTreeSet::new());
    for name in chips {
        let chip = read(&folder.join(&name).join("metadata.rs"));
        let shared = shared(metapac, &chip);
        let mut names = BTreeSet::new();
        for (name, peripheral) in peripherals(&shared) {
            let name = name.to_owned();
            let address = number(between(peripheral, "address: ", ","));
            let known = places.entry(name.clone()).or_insert(address);
            assert_eq!(*known, address, "{name} lies where it does on other parts");
            names.insert(name);
        }
        let index = |sets: &mut Vec<String>, set: String| {
            let found = sets.iter().position(|known| *known == set);
            found.unwrap_or_else(|| {
                sets.push(set);
                sets.len() - 1
            })
        };
        let names: Vec<String> = names.into_iter().collect();
        let set = index(&mut sets, names.join(" "));
        let package = index(&mut packages, pins(&shared));
        let [flash, sram, ccm] = memory(&chip);
        let name = name.to_uppercase();
        let line = &name["STM32".len().."STM32F405".len()];
        new.append(&mut new_connections(&shared, line));
        rows += &format!("chip {name} {flash} {sram} {ccm} {set} {package}\n");
    }
    let mut places: Vec<_> = places.into_iter().collect();
    places.sort_by_key(|(name, address)| (*address, name.clone()));
    for (name, address) in places {
        text += &format!("at {address:08x} {name}\n");
    }
    for (kind, lines) in [("peripherals", sets), ("pins", packages)] {
        for (n, line) in lines.iter().enumerate() {
            text += &format!("{kind} {n} {line}\n");
        }
    }
    text.extend(new);
    text + &rows
}

#[test]
fn the_tables_of_parts_and_connections_are_what_st_says() {
    let metapac = metapac();
    for (path, table) in [
        ("src/chips.txt", table_of_chips(&metapac)),
        ("src/machine/connections.txt", table_of_connections(&metapac)),
    ] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
        if std::env::var("TABLES").is_ok_and(|what| what == "overwrite") {
            std::fs::write(&path, &table).unwrap();
        }
        let place = path.display();
        assert!(read(&path) == table, "make {place} anew: its first lines say how");
    }
}
