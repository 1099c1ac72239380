//! The flash image, and its share of the STM32F405RG's memories.

use std::path::{Path, PathBuf};

use object::read::elf::{ElfFile32, ProgramHeader};

use crate::packages::IMAGE;
use crate::paths;
use crate::setup::TARGET;
use crate::step::{CommandLine, Steps, Stop};

/// Where cargo puts it.
pub(crate) fn path(steps: &Steps) -> PathBuf {
    steps.built(&format!("{TARGET}/firmware/bead-firmware"))
}

/// Builds it, and says what it takes.
///
/// # Errors
/// It does not build.
pub(crate) fn build(steps: &Steps) -> Result<(), Stop> {
    paths::leave_out(steps, paths::cargo_home().as_deref())?;
    steps.run("the flash image", &CommandLine::new("cargo build").words(IMAGE))?;
    tell_size(steps)
}

fn tell_size(steps: &Steps) -> Result<(), Stop> {
    let image = path(steps);
    let size = Size::of(&steps.root.join(&image))?;
    steps.announce(&format!("the image {} takes {size}", image.display()));
    Ok(())
}

/// End of the flash and start of the RAM. The image loads nothing between them.
const FLASH_END: u32 = 0x1000_0000;
const RAM: u32 = 0x2000_0000;

/// Memory that an image takes, bytes.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Size {
    /// Code, constants and the initial values of variables.
    pub(crate) flash: u32,
    /// Variables. The stack has a memory of its own.
    pub(crate) ram: u32,
}

impl Size {
    /// Reads the ELF file at `path`.
    ///
    /// # Errors
    /// It cannot be read, or is not a 32-bit ELF file.
    pub(crate) fn of(path: &Path) -> Result<Size, Stop> {
        let cannot = |why: String| Stop::failed(format!("{}: {why}", path.display()));
        let bytes = std::fs::read(path).map_err(|error| cannot(error.to_string()))?;
        Size::of_elf(&bytes).map_err(|error| cannot(format!("not a 32-bit ELF file ({error})")))
    }

    fn of_elf(bytes: &[u8]) -> Result<Size, object::Error> {
        let elf: ElfFile32<'_> = ElfFile32::parse(bytes)?;
        let (mut size, endian) = (Size { flash: 0, ram: 0 }, elf.endian());
        let segments = elf.elf_program_headers().iter();
        for segment in segments.filter(|segment| segment.p_type(endian) == object::elf::PT_LOAD) {
            // Loaded from flash and, for initialised variables, copied to RAM at start: counted in both.
            if segment.p_paddr(endian) < FLASH_END {
                size.flash += segment.p_filesz(endian);
            }
            if segment.p_vaddr(endian) >= RAM {
                size.ram += segment.p_memsz(endian);
            }
        }
        Ok(size)
    }
}

impl std::fmt::Display for Size {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [flash, ram] = [self.flash, self.ram].map(|bytes| f64::from(bytes) / 1024.0);
        write!(
            f,
            "{flash:.1} KiB of flash and {ram:.1} KiB of RAM; the stack has 64 KiB of its own"
        )
    }
}

/// Builds it anew if there is one. `bead` takes an image that is there, which has to be the one of these
/// sources; for one that is not there it waits.
///
/// # Errors
/// As [`build`].
pub(crate) fn build_if_there_is_one(steps: &Steps) -> Result<(), Stop> {
    if steps.root.join(path(steps)).exists() {
        return build(steps);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An ELF file of nothing but loaded segments: virtual address, physical address, bytes in the file,
    /// bytes in memory.
    fn elf(segments: &[[u32; 4]]) -> Vec<u8> {
        let mut file = b"\x7fELF\x01\x01\x01".to_vec();
        file.resize(16, 0);
        let count = u16::try_from(segments.len()).unwrap();
        // Executable for Arm; version, entry, offsets of the headers, flags; sizes and counts.
        file.extend([2, 0, 40, 0]);
        file.extend([1, 0x0800_0000, 52, 0, 0_u32].map(u32::to_le_bytes).concat());
        file.extend([52, 32, count, 40, 0, 0].map(u16::to_le_bytes).concat());
        for &[address, loaded, in_file, in_memory] in segments {
            let header = [1, 0x0800_0000, address, loaded, in_file, in_memory, 0, 4];
            file.extend(header.map(u32::to_le_bytes).concat());
        }
        file
    }

    #[test]
    fn initialised_variables_take_flash_and_ram_and_zeroed_ones_ram_only() {
        let code = [0x0800_0000, 0x0800_0000, 5000, 5000];
        let data = [0x2000_0000, 0x0800_1388, 100, 100];
        let zeroed = [0x2000_0064, 0x2000_0064, 0, 3000];
        let size = Size::of_elf(&elf(&[code, data, zeroed])).unwrap();
        assert_eq!((size.flash, size.ram), (5100, 3100));
        assert!(Size::of_elf(&[b'x'; 100]).is_err());
    }
}
