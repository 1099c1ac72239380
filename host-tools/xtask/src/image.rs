//! The flash image, and how much of the STM32F405RG's memories it takes.

use std::path::{Path, PathBuf};

use object::read::elf::{ElfFile32, ProgramHeader};

use crate::compiler;
use crate::packages::IMAGE;
use crate::paths;
use crate::setup::TARGET;
use crate::step::{Line, Steps, Stop};

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
    steps.run("the flash image", &Line::new("cargo build").words(IMAGE))?;
    tell_size(steps)
}

/// As [`build`]. If it is the first one, its crates are linted and documented as well: gives whether they
/// are.
///
/// # Errors
/// As [`build`].
pub(crate) fn build_and_check(steps: &Steps) -> Result<bool, Stop> {
    paths::leave_out(steps, paths::cargo_home().as_deref())?;
    let line = Line::new("cargo build").words(IMAGE);
    let built = compiler::build(steps, "the flash image", &line, &path(steps))?;
    tell_size(steps)?;
    Ok(built.checked)
}

fn tell_size(steps: &Steps) -> Result<(), Stop> {
    let image = path(steps);
    let size = Size::of(&steps.root.join(&image))?;
    steps.announce(&format!("the image {} takes {size}", image.display()));
    Ok(())
}

/// Where the flash ends and the RAM begins: between them lies what the image does not use for what is loaded.
const FLASH_END: u32 = 0x1000_0000;
const RAM: u32 = 0x2000_0000;

/// What an image takes, in bytes.
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
    match steps.root.join(path(steps)).exists() {
        true => build(steps),
        false => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An ELF file with nothing but program headers of PT_LOAD: (virtual, physical address, bytes in file, in
    /// memory).
    fn elf(segments: &[[u32; 4]]) -> Vec<u8> {
        let mut file = b"\x7fELF\x01\x01\x01".to_vec();
        file.resize(16, 0);
        let halves = |values: &[u16]| {
            values
                .iter()
                .flat_map(|value| value.to_le_bytes())
                .collect::<Vec<_>>()
        };
        let words = |values: &[u32]| {
            values
                .iter()
                .flat_map(|value| value.to_le_bytes())
                .collect::<Vec<_>>()
        };
        file.extend(halves(&[2, 40])); // an executable, for Arm
        file.extend(words(&[1, 0x0800_0000, 52, 0, 0])); // version, entry, offsets of the headers, flags
        file.extend(halves(&[
            52,
            32,
            u16::try_from(segments.len()).unwrap(),
            40,
            0,
            0,
        ])); // sizes and counts
        for &[virtual_address, physical_address, in_file, in_memory] in segments {
            file.extend(words(&[
                1,
                0,
                virtual_address,
                physical_address,
                in_file,
                in_memory,
                0,
                4,
            ]));
        }
        file
    }

    #[test]
    fn initialised_variables_take_flash_and_ram_and_zeroed_ones_ram_only() {
        let code = [0x0800_0000, 0x0800_0000, 5000, 5000];
        let data = [0x2000_0000, 0x0800_1388, 100, 100];
        let zeroed = [0x2000_0064, 0x2000_0064, 0, 3000];
        let size = Size::of_elf(&elf(&[code, data, zeroed])).unwrap();
        assert_eq!(
            size,
            Size {
                flash: 5100,
                ram: 3100
            }
        );
    }

    #[test]
    fn what_is_no_elf_file_is_refused() {
        assert!(
            Size::of_elf(b"not an ELF file, and long enough to hold the header of one, so it is the magic")
                .is_err()
        );
    }
}
