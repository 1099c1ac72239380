//! Regenerates `src/machine/registers.txt` from the crate `stm32f4`, whose source is generated from ST's
//! description of the STM32F405 with the corrections of the project stm32-rs:
//!
//! ```sh
//! cargo run -p stm32f405-qemu --example registers -- FOLDER_OF_STM32F4 > src/machine/registers.txt
//! ```
//!
//! The folder is where cargo unpacks that crate. It is too large to be a dependency of a test: its STM32F405
//! is 5 MB of source.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::ExitCode;

/// A register within its block.
struct RegisterEntry {
    offset: u32,
    name: String,
    reset: u32,
    read: u32,
    write: u32,
}

fn main() -> ExitCode {
    let Some(folder) = std::env::args().nth(1) else {
        eprintln!("give the folder of the crate stm32f4, which has src/stm32f405/mod.rs in it");
        return ExitCode::from(2);
    };
    match table(Path::new(&folder)) {
        Ok(table) => {
            print!("{table}");
            ExitCode::SUCCESS
        }
        Err(line) => {
            eprintln!("{line}");
            ExitCode::FAILURE
        }
    }
}

fn table(folder: &Path) -> Result<String, String> {
    let version = between(&read(&folder.join("Cargo.toml"))?, "\nversion = \"", "\"")?.to_owned();
    let device = folder.join("src/stm32f405");
    let mut text = format!(
        "# Registers of the STM32F405, from the crate stm32f4 {version} (stm32-rs, MIT OR Apache-2.0): ST's\n\
         # description with stm32-rs's corrections. Made by examples/registers.rs.\n\
         # block NAME; then offset, name, value after reset, readable bits, writable bits: all in hex.\n\
         # at ADDRESS PERIPHERAL BLOCK.\n"
    );
    let mut blocks = BTreeMap::new();
    let mut places = Vec::new();
    for line in read(&device.join("mod.rs"))?.lines() {
        // pub type TIM2 = crate::Periph<tim2::RegisterBlock, 0x4000_0000>;
        let peripheral = line
            .strip_prefix("pub type ")
            .and_then(|l| l.split_once(" = crate::Periph<"));
        let Some((name, rest)) = peripheral else { continue };
        let block = rest.split("::").next().unwrap_or_default().to_owned();
        let address = number(between(rest, "RegisterBlock, ", ">")?)?;
        // The package with the most pins has no ports J and K (DocID022152 table 7).
        if !matches!(name, "GPIOJ" | "GPIOK") {
            // ADC_CCR in the manual.
            let name = if name == "ADC_COMMON" { "ADC" } else { name };
            places.push((address, name.to_owned(), block.clone()));
            blocks.insert(block, ());
        }
    }
    places.sort();
    for block in blocks.keys() {
        text += &format!("block {block}\n");
        let mut found = registers(&device, &device, block, "RegisterBlock")?;
        found.sort_by_key(|register| register.offset);
        // Two views of one register, as of CCMR1: both have its bits.
        found.dedup_by(|next, first| {
            if next.offset != first.offset {
                return false;
            }
            first.read |= next.read;
            first.write |= next.write;
            first.name = common(&first.name, &next.name);
            true
        });
        for r in found {
            let (offset, name, reset) = (r.offset, r.name, r.reset);
            text += &format!("  {offset:02x} {name} {reset:x} {:x} {:x}\n", r.read, r.write);
        }
    }
    for (address, name, block) in places {
        text += &format!("at {address:x} {name} {block}\n");
    }
    Ok(text)
}

/// The name of a function, and the text after its bracket.
fn function(line: &str) -> Option<(&str, &str)> {
    line.strip_prefix("pub const fn ")?.split_once('(')
}

/// The registers of a struct in the file of a module.
fn registers(
    device: &Path,
    folder: &Path,
    module: &str,
    structure: &str,
) -> Result<Vec<RegisterEntry>, String> {
    let source = read(&folder.join(format!("{module}.rs")))?;
    let inner = folder.join(module);
    let body = between(&source, &format!("impl {structure} {{"), "\n}")?;
    let mut found = Vec::new();
    let mut place = None;
    for line in body.lines().map(str::trim) {
        if let Some(doc) = line.strip_prefix("///0x") {
            place = doc.split(" - ").next().map(str::to_owned);
        } else if let Some((name, rest)) = function(line)
            && let Some(place) = place.take()
        {
            let kind = between(rest, "-> &", " {")?;
            let array = rest.contains("n: usize");
            let mut module = kind.to_lowercase();
            // A register may be the copy of another: pub use dr as tsdr;
            let copied = source.lines().find_map(|line| {
                let (of, name) = line.strip_prefix("pub use ")?.split_once(" as ")?;
                (name == format!("{module};")).then(|| of.to_owned())
            });
            let is_copy = copied.is_some();
            module = copied.unwrap_or(module);
            // A block may share registers with another: pub use crate::stm32f405::gpioa::otyper;
            let shared = source.lines().find_map(|line| {
                let path = line
                    .strip_prefix("pub use crate::stm32f405::")?
                    .strip_suffix(';')?;
                path.rsplit_once("::").filter(|(_, register)| *register == module)
            });
            if is_copy || shared.is_some() || source.contains(&format!("pub type {kind} = crate::Reg<")) {
                if !array {
                    let offset = number(&format!("0x{place}"))?;
                    let home = shared.map(|(block, _)| device.join(block.replace("::", "/")));
                    found.push(register(home.as_ref().unwrap_or(&inner), &module, offset, name)?);
                }
            } else {
                // A group of registers, alone or one of an array. Most arrays are listed one by one too.
                let (from, to) = place.split_once("..0x").unwrap_or((&place, &place));
                let (from, to) = (number(&format!("0x{from}"))?, number(&format!("0x{to}"))?);
                let mut groups = vec![(from, name.to_uppercase() + "_")];
                if array {
                    let listed = source.contains(&format!("self.{name}(0)"));
                    let count = between(&source, &format!(": [{kind}; "), "]").and_then(number);
                    let count = if listed { 0 } else { count? };
                    // ST is a stream of the DMA: the manual has DMA_S0CR.
                    let is_stream = kind == "ST";
                    let prefix = |n| {
                        if is_stream {
                            format!("S{n}")
                        } else {
                            format!("{kind}{n}_")
                        }
                    };
                    let group = |n| (from + n * (to - from) / count, prefix(n));
                    groups = (0..count).map(group).collect();
                }
                for (start, prefix) in groups {
                    for mut inside in registers(device, &inner, &module, kind)? {
                        inside.offset += start;
                        inside.name.insert_str(0, &prefix);
                        found.push(inside);
                    }
                }
            }
        }
    }
    Ok(found)
}

fn register(folder: &Path, module: &str, offset: u32, name: &str) -> Result<RegisterEntry, String> {
    let source = read(&folder.join(format!("{module}.rs")))?;
    let reset = source
        .split_once("const RESET_VALUE: ")
        .map(|(_, rest)| between(rest, " = ", ";"));
    let reset = reset.map_or(Ok(0), |value| number(value?))?;
    let bits = |of: &str| -> Result<u32, String> {
        let Some((_, body)) = source.split_once(&format!("\nimpl {of} {{\n")) else {
            return Ok(0);
        };
        let body = body.split("\n}").next().unwrap_or_default();
        let mut mask = 0;
        for line in body.lines().map(str::trim) {
            let bits = line.strip_prefix("///Bits ").or(line.strip_prefix("///Bit "));
            let Some(range) = bits.and_then(|rest| rest.split(" - ").next()) else {
                continue;
            };
            let (low, high) = range.split_once(':').unwrap_or((range, range));
            let (low, high) = (number(low)?, number(high)?);
            mask |= (u32::MAX >> (31 - (high - low))) << low;
        }
        Ok(mask)
    };
    Ok(RegisterEntry {
        offset,
        name: name.to_uppercase(),
        reset,
        read: bits("R")?,
        write: bits("W")?,
    })
}

/// The common prefix of two names, without a trailing `_`.
fn common(a: &str, b: &str) -> String {
    let same = a.chars().zip(b.chars()).take_while(|(a, b)| a == b);
    let name: String = same.map(|(a, _)| a).collect();
    name.trim_end_matches('_').to_owned()
}

fn between<'a>(text: &'a str, before: &str, after: &str) -> Result<&'a str, String> {
    let found = text
        .split_once(before)
        .and_then(|(_, rest)| rest.split_once(after));
    found
        .map(|(found, _)| found)
        .ok_or(format!("no {before:?} with {after:?} after it"))
}

fn number(text: &str) -> Result<u32, String> {
    let digits = text.replace('_', "");
    let parsed = match digits.strip_prefix("0x") {
        Some(hex) => u32::from_str_radix(hex, 16),
        None => digits.parse(),
    };
    parsed.map_err(|e| format!("{text:?}: {e}"))
}

fn read(path: &Path) -> Result<String, String> {
    std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))
}
