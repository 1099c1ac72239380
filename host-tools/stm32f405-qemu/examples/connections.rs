//! Makes `src/machine/connections.txt` anew from the crate `stm32-metapac`, whose metadata come from ST's own
//! database (that of STM32CubeMX), and from `stm32f4`, which has the numbers of bits:
//!
//! ```sh
//! cargo run -p stm32f405-qemu --example connections -- FOLDER_OF_STM32_METAPAC FOLDER_OF_STM32F4 \
//!     > src/machine/connections.txt
//! ```

use std::collections::BTreeSet;
use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let folders: Vec<String> = std::env::args().skip(1).collect();
    let [metapac, stm32f4] = &folders[..] else {
        eprintln!("give the folders of the crates stm32-metapac and stm32f4");
        return ExitCode::from(2);
    };
    match table(Path::new(metapac), Path::new(stm32f4)) {
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

fn table(metapac: &Path, stm32f4: &Path) -> Result<String, String> {
    let version = |folder: &Path| -> Result<String, String> {
        Ok(between(&read(&folder.join("Cargo.toml"))?, "\nversion = \"", "\"")?.to_owned())
    };
    // The package with the most pins.
    let chips = metapac.join("src/chips");
    let chip = read(&chips.join("stm32f405zg/metadata.rs"))?;
    let shared = read(&chips.join(between(&chip, "include!(\"../", "\")")?))?;

    let mut lines = BTreeSet::new();
    for entry in shared.split("Interrupt {").skip(1) {
        // Those of the peripherals are called PeripheralInterrupt, and have a signal first.
        let Some(entry) = entry.trim_start().strip_prefix("name: \"") else {
            continue;
        };
        let (name, number) = entry.split_once("\",").ok_or("an interrupt without a number")?;
        let number = number.trim_start().trim_start_matches("number: ");
        let number = number.split([',', ' ']).next().unwrap_or_default();
        lines.insert(format!("line {number} {name}"));
    }
    for peripheral in shared.split("\n    Peripheral {\n").skip(1) {
        let name = between(peripheral, "name: \"", "\"")?;
        // Of pins and interrupts only what a model could have.
        let wanted = ["TIM", "USART", "UART", "ADC", "I2C", "SPI", "RNG", "WWDG"]
            .iter()
            .any(|kind| name.starts_with(kind));
        for pin in peripheral.split("PeripheralPin {").skip(1).filter(|_| wanted) {
            let (at, signal) = (between(pin, "pin: \"", "\"")?, between(pin, "signal: \"", "\"")?);
            let function = match between(pin, "af: ", ",\n")? {
                "None" => "-",
                some => between(some, "Some(", ")")?,
            };
            lines.insert(format!("pin {at} {function} {name} {signal}"));
        }
        for channel in peripheral.split("PeripheralDmaChannel {").skip(1) {
            let signal = between(channel, "signal: \"", "\"")?;
            let Ok(stream) = between(channel, "channel: Some(\"DMA", "\")") else {
                continue;
            };
            let (dma, stream) = stream.split_once("_CH").ok_or("a stream of another name")?;
            let request = between(channel, "request: Some(", ")")?;
            let what = if signal == name {
                name.to_owned()
            } else {
                format!("{name}_{signal}")
            };
            lines.insert(format!("request {dma} {stream} {request} {what}"));
        }
        for interrupt in peripheral
            .split("PeripheralInterrupt {")
            .skip(1)
            .filter(|_| wanted)
        {
            let signal = between(interrupt, "signal: \"", "\"")?;
            let line = between(interrupt, "interrupt: \"", "\"")?;
            let number = shared.split("Interrupt {").find_map(|entry| {
                let entry = entry.trim_start().strip_prefix(&format!("name: \"{line}\","))?;
                entry
                    .trim_start()
                    .strip_prefix("number: ")?
                    .split([',', ' '])
                    .next()
            });
            let number = number.ok_or(format!("no number of {line}"))?;
            lines.insert(format!("interrupt {number} {name} {signal}"));
        }
        for which in ["enable", "reset"] {
            let before = format!("{which}: Some(PeripheralRccRegister {{");
            let Ok(register) = between(peripheral, &before, "})") else {
                continue;
            };
            let field = between(register, "field: \"", "\"")?;
            let register = between(register, "register: \"", "\"")?;
            let file = stm32f4.join(format!("src/stm32f405/rcc/{}.rs", register.to_lowercase()));
            let Ok(source) = read(&file) else { continue };
            let Some((before, _)) = source.split_once(&format!("pub fn {}(", field.to_lowercase())) else {
                continue;
            };
            let bit = before
                .rsplit("///Bit ")
                .next()
                .and_then(|rest| rest.split(' ').next());
            lines.insert(format!("{which} {register} {} {name}", bit.unwrap_or_default()));
        }
    }
    let mut text = format!(
        "# Pins, DMA requests, interrupts and clock gates of the STM32F405, from the crates stm32-metapac {} and\n\
         # stm32f4 {} (both MIT OR Apache-2.0), as ST's database has them. Made by examples/connections.rs.\n\
         # pin PIN FUNCTION PERIPHERAL SIGNAL, request DMA STREAM CHANNEL NAME, interrupt NUMBER PERIPHERAL SIGNAL,\n\
         # enable or reset REGISTER BIT PERIPHERAL, line NUMBER NAME.\n",
        version(metapac)?,
        version(stm32f4)?
    );
    for line in lines {
        text += &line;
        text.push('\n');
    }
    Ok(text)
}

fn between<'a>(text: &'a str, before: &str, after: &str) -> Result<&'a str, String> {
    let found = text
        .split_once(before)
        .and_then(|(_, rest)| rest.split_once(after));
    found
        .map(|(found, _)| found)
        .ok_or(format!("no {before:?} with {after:?} after it"))
}

fn read(path: &Path) -> Result<String, String> {
    std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))
}
