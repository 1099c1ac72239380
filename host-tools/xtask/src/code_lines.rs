//! Lines and functions of an image by the addresses of their code: its line tables (DWARF) and its symbols.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;

use addr2line::Context;
use addr2line::gimli::{self, EndianSlice, LittleEndian};
use object::{Object, ObjectSection, ObjectSymbol, SymbolKind};

/// Addresses of flash.
pub(crate) const FLASH: Range<u32> = 0x0800_0000..0x0810_0000;

/// A line of a source file.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Place {
    pub(crate) file: String,
    pub(crate) line: u32,
}

/// Code of an image and the sources that it is made of.
#[derive(Debug, Default)]
pub(crate) struct Code {
    /// Pieces of code with the lines that they come from. For inlined code, the line in the inlined function
    /// comes first, then the line that calls it, and so on.
    pub(crate) pieces: Vec<(Range<u32>, Place)>,
    /// Functions by their names without a hash. Several may have one name.
    pub(crate) functions: BTreeMap<String, Vec<Range<u32>>>,
}

impl Code {
    /// Reads an ELF file with debug information.
    pub(crate) fn of_elf(bytes: &[u8]) -> Result<Self, String> {
        let elf = object::File::parse(bytes).map_err(|error| error.to_string())?;
        let mut code = Self::default();
        code.read_lines(&elf)
            .map_err(|error| format!("its debug information cannot be read: {error}"))?;
        for symbol in elf
            .symbols()
            .filter(|symbol| symbol.kind() == SymbolKind::Text && symbol.size() > 0)
        {
            if let (Ok(name), Some(range)) = (symbol.name(), in_flash(symbol.address() & !1, symbol.size())) {
                let name = format!("{:#}", rustc_demangle::demangle(name));
                code.functions.entry(name).or_default().push(range);
            }
        }
        Ok(code)
    }

    fn read_lines(&mut self, elf: &object::File<'_>) -> gimli::Result<()> {
        let section = |id: gimli::SectionId| {
            let data = elf
                .section_by_name(id.name())
                .and_then(|section| section.uncompressed_data().ok());
            Ok::<_, gimli::Error>(data.unwrap_or_default())
        };
        let sections = gimli::DwarfSections::<Cow<'_, [u8]>>::load(section)?;
        let dwarf = sections.borrow(|data| EndianSlice::new(data, LittleEndian));
        let context = Context::from_dwarf(dwarf)?;
        for (start, length, _) in context.find_location_range(FLASH.start.into(), FLASH.end.into())? {
            let Some(range) = in_flash(start, length) else {
                continue;
            };
            let mut frames = context.find_frames(start).skip_all_loads()?;
            while let Some(frame) = frames.next()? {
                let location = frame.location.and_then(|at| Some((at.file?, at.line?)));
                // Code without a line belongs to none.
                if let Some((file, line)) = location.filter(|(_, line)| *line > 0) {
                    let file = file.trim_start_matches("./").to_owned();
                    self.pieces.push((range.clone(), Place { file, line }));
                }
            }
        }
        Ok(())
    }
}

/// Returns the addresses if there are any and they are in flash: what the linker left out is at 0.
fn in_flash(start: u64, length: u64) -> Option<Range<u32>> {
    let start = u32::try_from(start).ok().filter(|start| FLASH.contains(start))?;
    let end = start.checked_add(u32::try_from(length).ok()?)?;
    (end > start && end <= FLASH.end).then_some(start..end)
}
