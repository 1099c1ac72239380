//! Facts from the image's ELF: its processor, its functions, and the place of its log.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use object::{Object, ObjectSection, ObjectSegment, ObjectSymbol};

use super::error::RunError;
use crate::ending::CodeAddress;
use crate::exchange::FunctionRange;
use crate::memory::{FLASH, SRAM, is_ram};

/// A function of an image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Function {
    /// Its demangled path.
    pub name: String,
    /// Address of its first instruction.
    pub address: u32,
    /// Its length.
    pub bytes: u32,
}

/// The functions of an image whose demangled path contains a pattern: for example to write over one of them
/// with a [`Poke`](crate::Poke).
///
/// # Errors
/// The file is not an image.
pub fn functions(elf: &Path, pattern: &str) -> Result<Vec<Function>, RunError> {
    let mut functions = Image::read(elf)?.functions;
    functions.retain(|function| function.name.contains(pattern));
    Ok(functions)
}

const NOTHING_TO_LOAD: &str = "it has nothing to load: link it with -Tlink.x";

/// An image with its bytes and its functions.
pub(super) struct Image {
    pub(super) path: PathBuf,
    pub(super) bytes: Vec<u8>,
    functions: Vec<Function>,
    pub(super) rtt: Option<u32>,
    /// Address of the vector table.
    pub(super) vectors: u32,
    /// Its segments: first address and length in memory.
    pub(super) segments: Vec<(u32, u32)>,
    /// Start of its stack, if it has a vector table.
    pub(super) stack: Option<u32>,
    /// Vectors 3 to 6: the handlers of faults.
    pub(super) fault_handlers: Vec<u32>,
}

impl Image {
    /// # Errors
    /// [`RunError::ImageMissing`] and [`RunError::NotArmElf`].
    pub(super) fn read(path: &Path) -> Result<Self, RunError> {
        let bytes = std::fs::read(path).map_err(|source| RunError::ImageMissing(path.into(), source))?;
        let not_arm = |reason: String| RunError::NotArmElf(path.into(), reason);
        let elf = object::File::parse(&*bytes).map_err(|e| not_arm(e.to_string()))?;
        let (format, processor) = (elf.format(), elf.architecture());
        if format != object::BinaryFormat::Elf || processor != object::Architecture::Arm {
            return Err(not_arm(format!("{format:?} for {processor:?}")));
        }
        if elf.segments().all(|segment| segment.size() == 0) {
            return Err(not_arm(NOTHING_TO_LOAD.into()));
        }

        let mut functions = Vec::new();
        let mut rtt = None;
        for symbol in elf.symbols() {
            let Ok(name) = symbol.name() else { continue };
            match symbol.kind() {
                object::SymbolKind::Text if symbol.size() > 0 => functions.push(Function {
                    // The alternate form leaves the hash out.
                    name: format!("{:#}", rustc_demangle::demangle(name)),
                    // Bit 0 of a function's address marks Thumb code.
                    address: symbol.address() as u32 & !1,
                    bytes: symbol.size() as u32,
                }),
                _ if name == "_SEGGER_RTT" => rtt = Some(symbol.address() as u32),
                _ => {}
            }
        }
        // If another program starts first, the image's table lies behind it.
        let table = elf.section_by_name(".vector_table");
        let table = table.map(|section| section.address() as u32);
        let table = table.unwrap_or_else(|| first_segment(&elf));
        let fault_handlers = vectors(&elf, table, 3..7).into_iter().map(|vector| vector & !1);
        let fault_handlers = fault_handlers.collect();
        let segments = elf
            .segments()
            .map(|segment| (segment.address() as u32, segment.size() as u32));
        let segments = segments.filter(|(_, bytes)| *bytes > 0).collect();
        let stack = vectors(&elf, table, 0..1).first().copied();
        Ok(Self {
            segments,
            stack,
            path: path.into(),
            functions,
            rtt,
            vectors: table,
            fault_handlers,
            bytes,
        })
    }

    /// A program for the beginning of flash that starts an image whose vectors are in RAM, as a debug probe
    /// does: VTOR, stack pointer and program counter from its table. `None` for an image in flash.
    pub(super) fn starter(&self) -> Option<Vec<u8>> {
        if !is_ram(self.vectors, 8) {
            return None;
        }
        // ldr r0, =VTOR; ldr r1, =table; str r1, [r0]; ldr r0, [r1]; msr MSP, r0; ldr r0, [r1, #4]; bx r0
        const CODE: [u16; 8] = [0x4803, 0x4904, 0x6001, 0x6808, 0xf380, 0x8808, 0x6848, 0x4700];
        const VTOR: u32 = 0xe000_ed08;
        let code_at = FLASH.start + 8;
        let stack = SRAM.end;
        let vectors = [stack, code_at | 1].into_iter().flat_map(u32::to_le_bytes);
        let code = CODE.into_iter().flat_map(u16::to_le_bytes);
        let literals = [VTOR, self.vectors].into_iter().flat_map(u32::to_le_bytes);
        Some(vectors.chain(code).chain(literals).collect())
    }

    /// First addresses of the functions that every panic enters.
    pub(super) fn panic_functions(&self) -> Vec<u32> {
        let named = |end: &str| -> Vec<u32> {
            let fits = |function: &&Function| function.name.ends_with(end);
            let found = self.functions.iter().filter(fits);
            found.map(|function| function.address).collect()
        };
        let handler = named("rust_begin_unwind");
        // The compiler may put the handler into what calls it.
        if handler.is_empty() {
            named("core::panicking::panic_fmt")
        } else {
            handler
        }
    }

    /// Sets the function around an address.
    pub(super) fn name(&self, place: &mut CodeAddress) {
        let within = |function: &&Function| {
            (function.address..function.address.saturating_add(function.bytes)).contains(&place.address)
        };
        let found = self.functions.iter().find(within);
        place.function = found.map(|function| function.name.clone());
    }

    /// The functions whose demangled path contains the pattern of an entry, each with the label of that
    /// entry. The labels come in the order in which they are first named.
    ///
    /// # Errors
    /// [`RunError::NoSymbols`] where functions are asked for and the image names none.
    pub(super) fn find(
        &self,
        wanted: &[(String, String)],
    ) -> Result<(Vec<String>, Vec<FunctionRange>), RunError> {
        if !wanted.is_empty() && self.functions.is_empty() {
            return Err(RunError::NoSymbols(self.path.clone()));
        }
        let mut labels: Vec<String> = Vec::new();
        // A set, since two patterns of a label may find the same function, or a function may have two names
        // (folded code).
        let mut ranges = BTreeSet::new();
        for (label, pattern) in wanted {
            let index = labels.iter().position(|l| l == label).unwrap_or_else(|| {
                labels.push(label.clone());
                labels.len() - 1
            });
            for function in &self.functions {
                if function.name.contains(pattern) {
                    let end = function.address.saturating_add(function.bytes);
                    ranges.insert((index, function.address, end));
                }
            }
        }
        let range = |(label, start, end)| FunctionRange { label, start, end };
        Ok((labels, ranges.into_iter().map(range).collect()))
    }
}

/// Start of an image that does not say where its vectors are: in flash, if it has anything there.
fn first_segment(elf: &object::File<'_>) -> u32 {
    let starts: Vec<u32> = elf.segments().map(|segment| segment.address() as u32).collect();
    let lowest = starts.iter().copied().filter(|start| is_ram(*start, 8)).min();
    let in_flash = starts.iter().any(|start| FLASH.contains(start));
    lowest.filter(|_| !in_flash).unwrap_or(FLASH.start)
}

/// Some vectors of the table at this address. None if the image has no such table.
fn vectors(elf: &object::File<'_>, table: u32, numbers: std::ops::Range<u32>) -> Vec<u32> {
    let address = |number: u32| u64::from(table + 4 * number);
    let vector = |number: u32| {
        let word = elf
            .segments()
            .find_map(|s| s.data_range(address(number), 4).ok()?)?;
        Some(u32::from_le_bytes(word.try_into().ok()?))
    };
    numbers.filter_map(vector).collect()
}
