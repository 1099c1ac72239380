//! The table of parts (`src/chips.txt`) against the metadata of the crate stm32-metapac, which come from ST's
//! own database, and a small image on one part of each line.

#![expect(clippy::unwrap_used, reason = "in helpers of tests")]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use object::{Object, ObjectSection};
use serde_json::Value;
use stm32f405_qemu::machine::registers;
use stm32f405_qemu::{Chip, Outcome, Poke, Run, RunError};

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

const HEAD: &str = "\
# Parts of the STM32F4 from the crate stm32-metapac VERSION (MIT OR Apache-2.0), as ST's database has them. Made by
# CHIPS=overwrite cargo test --release -p stm32f405-qemu --test all chips::
# at ADDRESS PERIPHERAL; peripherals N NAMES; pins N MASKS of the ports A to K;
# function LINE PIN FUNCTION PERIPHERAL SIGNAL, where the STM32F405 has no such function of the pin;
# request LINE DMA STREAM CHANNEL NAME, where the STM32F405 has no such request;
# chip NAME, KiB of flash, KiB of SRAM, KiB of CCM, its peripherals, its pins.
";

/// The folder of stm32-metapac in cargo's registry: cargo has it for the images that use embassy.
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

fn between<'a>(text: &'a str, before: &str, after: &str) -> &'a str {
    let (_, rest) = text.split_once(before).unwrap_or_else(|| panic!("no {before:?}"));
    rest.split_once(after).unwrap_or_else(|| panic!("no {after:?}")).0
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
    // Of two layouts the first has one bank.
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

/// A bit for each pin, for each port.
fn pins(metadata: &str) -> String {
    let (_, list) = metadata.split_once("static PINS:").unwrap();
    let mut ports = [0_u16; 11];
    for pin in list.split("name: \"P").skip(1) {
        let (name, _) = pin.split_once('"').unwrap();
        let port = usize::from(name.as_bytes()[0] - b'A');
        // Some are called PC2_C and the like, on others than these parts.
        ports[port] |= 1 << name[1..].parse::<u32>().unwrap();
    }
    ports.map(|mask| format!("{mask:x}")).join(" ")
}

/// The alternate functions of modelled peripherals that the STM32F405's table of connections lacks.
fn new_functions(metadata: &str) -> Vec<String> {
    let known: BTreeSet<&str> = include_str!("../../src/machine/connections.txt")
        .lines()
        .collect();
    let mut found = Vec::new();
    for peripheral in metadata.split("\n    Peripheral {\n").skip(1) {
        let name = between(peripheral, "name: \"", "\"");
        let modelled = known
            .iter()
            .any(|line| line.starts_with("pin ") && line.contains(&format!(" {name} ")));
        for pin in peripheral.split("PeripheralPin {").skip(1).filter(|_| modelled) {
            let (at, signal) = (between(pin, "pin: \"", "\""), between(pin, "signal: \"", "\""));
            let Some(("", function)) = between(pin, "af: ", ",\n").split_once("Some(") else {
                continue;
            };
            let line = format!("{at} {} {name} {signal}", function.trim_end_matches(')'));
            if !signal.starts_with("I2S") && !known.contains(&*format!("pin {line}")) {
                found.push(line);
            }
        }
    }
    found
}

/// The DMA requests of modelled peripherals that the STM32F405's table of connections lacks.
fn new_requests(metadata: &str) -> Vec<String> {
    let known = include_str!("../../src/machine/connections.txt");
    let requests: Vec<_> = known
        .lines()
        .filter_map(|line| line.strip_prefix("request "))
        .collect();
    let mut found = Vec::new();
    for peripheral in metadata.split("\n    Peripheral {\n").skip(1) {
        let name = between(peripheral, "name: \"", "\"");
        for channel in peripheral.split("PeripheralDmaChannel {").skip(1) {
            let request = format!("{name}_{}", between(channel, "signal: \"", "\""));
            let place = between(channel, "channel: Some(\"DMA", "\")").replace("_CH", " ");
            let line = format!("{place} {} {request}", between(channel, "request: Some(", ")"));
            let is_modelled = requests
                .iter()
                .any(|known| known.ends_with(&format!(" {request}")));
            if is_modelled && !requests.contains(&&*line) {
                found.push(line);
            }
        }
    }
    found
}

fn table(metapac: &Path) -> String {
    let version = read(&metapac.join("Cargo.toml"));
    let mut text = HEAD.replace("VERSION", between(&version, "\nversion = \"", "\""));
    let folder = metapac.join("src/chips");
    let mut chips: Vec<String> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| LINES.iter().any(|line| name.starts_with(line)))
        .collect();
    chips.sort();
    let (mut places, mut sets, mut packages) = (BTreeMap::new(), Vec::new(), Vec::new());
    let (mut rows, mut functions, mut requests) = (String::new(), BTreeSet::new(), BTreeSet::new());
    for name in chips {
        let chip = read(&folder.join(&name).join("metadata.rs"));
        let shared = read(&folder.join(between(&chip, "include!(\"../", "\")")));
        let mut names = BTreeSet::new();
        for peripheral in shared.split("\n    Peripheral {\n").skip(1) {
            let name = between(peripheral, "name: \"", "\"").to_owned();
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
        functions.extend(
            new_functions(&shared)
                .iter()
                .map(|what| format!("function {line} {what}\n")),
        );
        requests.extend(
            new_requests(&shared)
                .iter()
                .map(|what| format!("request {line} {what}\n")),
        );
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
    text.extend(functions);
    text.extend(requests);
    text + &rows
}

#[test]
fn the_table_of_parts_is_what_st_says_of_them() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/chips.txt");
    let table = table(&metapac());
    if std::env::var("CHIPS").is_ok_and(|what| what == "overwrite") {
        std::fs::write(&path, &table).unwrap();
    }
    assert!(
        read(&path) == table,
        "make src/chips.txt anew: its first lines say how"
    );
}

/// The address that `images/src/bin/part.rs` looks for the place to try at.
const CHOICE: u32 = 0x2000_f000;

/// The image `part`, as it comes out when it is linked for a part: its stack begins where the SRAM ends.
fn linked_for(chip: Chip, folder: &Path) -> PathBuf {
    let mut bytes = std::fs::read(super::images::image("part")).unwrap();
    let file = object::File::parse(&*bytes).unwrap();
    let (at, _) = file
        .section_by_name(".vector_table")
        .unwrap()
        .file_range()
        .unwrap();
    let at = usize::try_from(at).unwrap();
    bytes[at..at + 4].copy_from_slice(&chip.sram().end.to_le_bytes());
    let path = folder.join(format!("{chip}.elf"));
    std::fs::write(&path, bytes).unwrap();
    path
}

fn run_on(chip: Chip, image: &Path, try_at: u32) -> Result<Outcome, RunError> {
    let mut run = Run::new(image);
    run.chip = chip;
    run.count_instructions = false;
    run.pokes.push(Poke {
        at_ns: 0,
        address: CHOICE,
        bytes: try_at.to_le_bytes().to_vec(),
    });
    run.execute()
}

fn chip(name: &str) -> Chip {
    name.parse().unwrap()
}

/// One part of each line and size of memory; its DEV_ID and size of flash are typed from its manual.
#[test]
fn an_image_finds_identity_memory_and_peripherals_of_its_part() {
    let folder = tempfile::tempdir().unwrap();
    for (name, identity, lacking) in [
        ("STM32F401CC", "device 0x423, 256 KiB", "TIM8_CR1"),
        ("STM32F401RE", "device 0x433, 512 KiB", "USART3_SR"),
        ("STM32F405RG", "device 0x413, 1024 KiB", ""),
        ("STM32F407VE", "device 0x413, 512 KiB", ""),
        ("STM32F411CE", "device 0x431, 512 KiB", "DAC_CR"),
        ("STM32F415ZG", "device 0x413, 1024 KiB", ""),
        ("STM32F427ZG", "device 0x419, 1024 KiB", ""),
        ("STM32F429ZI", "device 0x419, 2048 KiB", ""),
        ("STM32F446RE", "device 0x421, 512 KiB", "RNG_CR"),
    ] {
        let chip = chip(name);
        let image = linked_for(chip, folder.path());
        let outcome = run_on(chip, &image, chip.sram().end - 0x100).unwrap();
        let log: Vec<_> = outcome.log.iter().map(|line| &*line.text).collect();
        assert_eq!(log, [&format!("{identity} of flash"), "keeps a word"], "{name}");
        assert_eq!(outcome.unknown_registers.len(), 0, "{name}");
        let moved = format!("GPIO PE3 moved, and the {name} has no such pin");
        assert_eq!(
            outcome.unmodelled.contains(&moved),
            !chip.has_pin("PE3"),
            "{name}"
        );
        // Beyond memory is a bus fault, and so is core-coupled memory or the second bank where there is none.
        let mut edges = vec![(chip.sram().end, false)];
        edges.push((0x1000_fffc, !chip.ccm().is_empty()));
        edges.push((0x081f_fffc, chip.flash_kib() > 1024));
        for (address, there) in edges {
            let outcome = run_on(chip, &image, address).unwrap();
            let fault = outcome.exceptions.first().and_then(|exception| exception.address);
            assert_eq!(fault, (!there).then_some(address), "{name}: {address:#x}");
        }
        let registers = registers::all().find(|register| register.to_string() == lacking);
        if let Some(register) = registers {
            let outcome = run_on(chip, &image, register.address).unwrap();
            let said = format!("{lacking} (not on the {name})");
            assert_eq!(outcome.unknown_registers[0].name, said);
        }
    }
}

#[test]
fn what_a_part_has_and_no_model_knows_is_named_as_on_that_part() {
    let folder = tempfile::tempdir().unwrap();
    for (name, address, said) in [
        ("STM32F405RG", 0x4000_6400, "CAN1_MCR"),
        ("STM32F411CE", 0x4001_3404, "SPI4+0x04"),
        ("STM32F429ZI", 0x4001_5808, "SAI1+0x08"),
        ("STM32F446RE", 0x4000_4004, "SPDIFRX1+0x04"),
        ("STM32F405RG", 0x4002_3894, "RCC+0x94"),
    ] {
        let chip = chip(name);
        let outcome = run_on(chip, &linked_for(chip, folder.path()), address).unwrap();
        let names = outcome.unknown_registers.iter().map(|register| &*register.name);
        assert_eq!(names.collect::<Vec<_>>(), [said], "{name}");
    }
}

#[test]
fn a_pin_that_the_package_lacks_fails_a_strict_run() {
    let image = super::images::image("part");
    for (name, status) in [("STM32F405RG", 6), ("STM32F405VG", 0)] {
        let mut runner = Command::new(env!("CARGO_BIN_EXE_stm32-emu"));
        let ran = runner
            .args(["--strict", "--chip", name])
            .arg(&image)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&ran.stderr);
        assert_eq!(ran.status.code(), Some(status), "{name}: {said}");
        assert_eq!(
            said.contains("moved PE3, and the STM32F405RG has no such pin"),
            status > 0
        );
    }
}

#[test]
fn an_image_for_another_part_is_refused_before_it_runs() {
    let folder = tempfile::tempdir().unwrap();
    let large = linked_for(chip("STM32F429ZI"), folder.path());
    let coupled = super::images::image("part");
    for (image, name, why) in [
        (
            &large,
            "STM32F411CE",
            "its stack begins at 0x20030000, and the STM32F411CE has 512 KiB of flash",
        ),
        (&coupled, "STM32F446RE", "128 KiB of SRAM and 0 KiB of CCM"),
    ] {
        let error = run_on(chip(name), image, CHOICE).unwrap_err().to_string();
        assert!(
            error.contains("is an image for another part") && error.contains(why),
            "{error}"
        );
    }
    let mut run = Run::new(&large);
    run.wires = vec![("PA9".into(), "PD5".into())];
    let error = run.execute().unwrap_err().to_string();
    assert!(error.contains("the STM32F405RG has no pin PD5"), "{error}");
}
