//! A small image on one part of each line.

#![expect(clippy::unwrap_used, reason = "in helpers of tests")]

use std::path::{Path, PathBuf};

use object::{Object, ObjectSection};
use stm32f405_qemu::machine::registers;
use stm32f405_qemu::{Chip, Outcome, Poke, Run, RunError};

/// The address at which `images/src/bin/part.rs` finds the place to try.
const CHOICE: u32 = 0x2000_f000;

/// The image `part` as linked for a part: its stack begins at the end of the SRAM.
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
    run.pokes.push(Poke::word(0, CHOICE, try_at));
    run.execute()
}

fn chip(name: &str) -> Chip {
    name.parse().unwrap()
}

/// One part of each line and size of memory, with its DEV_ID and size of flash from its manual.
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
        let moved = format!("GPIO PE3 moved, but the {name} has no such pin");
        assert_eq!(
            outcome.unmodelled.contains(&moved),
            !chip.has_pin("PE3"),
            "{name}"
        );
        // Beyond memory is a bus fault, also in core-coupled memory or a second bank that the part lacks.
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
        let mut runner = super::emulator();
        let ran = runner
            .args(["--strict", "--chip", name])
            .arg(&image)
            .output()
            .unwrap();
        let said = super::said(&ran);
        assert_eq!(ran.status.code(), Some(status), "{name}: {said}");
        assert_eq!(
            said.contains("moved PE3, but the STM32F405RG has no such pin"),
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
            "its stack begins at 0x20030000, but the STM32F411CE has 512 KiB of flash",
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
