//! The flash image, and its share of the STM32F405RG's memories.

use std::path::{Path, PathBuf};

use bead_update::manifest::DEVELOPMENT_SEED;
use object::read::elf::{ElfFile32, ProgramHeader};

use crate::packages::IMAGE;
use crate::setup::TARGET;
use crate::step::{CommandLine, Steps, Stop};
use crate::{board_table, files, paths};

/// Path at which cargo leaves the image.
pub(crate) fn path(steps: &Steps) -> PathBuf {
    steps.built(&format!("{TARGET}/firmware/bead-firmware"))
}

/// Builds and signs the image, and prints the memory that it takes.
pub(crate) fn build(steps: &Steps) -> Result<(), Stop> {
    paths::leave_out(steps, paths::cargo_home().as_deref())?;
    steps.run("the flash image", &CommandLine::new("cargo build").words(IMAGE))?;
    let first = board_table::names(steps)?.swap_remove(0);
    let image = path(steps);
    sign(&steps.root.join(&image), &first)?;
    let size = Size::of(&steps.root.join(&image))?;
    steps.announce(&format!("the image {} takes {size}", image.display()));
    Ok(())
}

/// Variable with the file of the key that signs images: 64 hexadecimal digits. Without it the development key
/// signs, which everybody has.
const KEY: &str = "BEAD_SIGNING_KEY";

/// Signs an image for a board, so that beads take it over their line. The file keeps its time, so that
/// nothing compiled from it is compiled again.
///
/// # Errors
/// There is no such image, or no such key.
pub(crate) fn sign(image: &Path, board: &str) -> Result<(), Stop> {
    let seed = match std::env::var_os(KEY) {
        None => DEVELOPMENT_SEED,
        Some(file) => read_key(Path::new(&file))?,
    };
    let signed = bead_update::file::sign(&files::bytes(image)?, board, env!("CARGO_PKG_VERSION"), &seed);
    let signed = signed.map_err(files::cannot("sign", image))?;
    // Written beside the image and then renamed: cargo's own copy is another name of the same file.
    let beside = image.with_extension("signed");
    let put = || {
        let modified = image.metadata()?.modified()?;
        std::fs::write(&beside, &signed)?;
        std::fs::File::options()
            .write(true)
            .open(&beside)?
            .set_modified(modified)?;
        std::fs::rename(&beside, image)
    };
    put().map_err(files::cannot("sign", image))
}

/// Prints the public part of the key in a file.
pub(crate) fn public_key(_: &Steps, words: &[&String]) -> Result<(), Stop> {
    let [file] = words else {
        return Err(Stop::failed(
            "give the file with the key: `public-key image.secret`",
        ));
    };
    let public = bead_update::manifest::public_key(&read_key(Path::new(file))?);
    println!("{}", public.map(|byte| format!("{byte:02x}")).concat());
    Ok(())
}

/// Reads a key that signs.
fn read_key(file: &Path) -> Result<[u8; 32], Stop> {
    let cannot = |why: &dyn std::fmt::Display| Stop::failed(format!("the key in {}: {why}", file.display()));
    let text = std::fs::read_to_string(file).map_err(|error| cannot(&error))?;
    digits(text.trim()).ok_or_else(|| cannot(&"give a file of 64 hexadecimal digits"))
}

/// The bytes of 64 hexadecimal digits.
fn digits(text: &str) -> Option<[u8; 32]> {
    let digit = |at: usize| u8::from_str_radix(text.get(2 * at..2 * at + 2)?, 16).ok();
    let bytes = Vec::from_iter((0..32).map_while(digit));
    bytes.try_into().ok().filter(|_| text.len() == 64)
}

/// Start of the core-coupled memory, which is beyond the flash, and of the SRAM.
const COUPLED: u32 = 0x1000_0000;
const SRAM: u32 = 0x2000_0000;

/// Memory that an image takes, bytes.
#[derive(Debug, Default, PartialEq, Eq)]
struct Size {
    /// Code, constants and the initial values of variables.
    flash: u32,
    /// Variables, and buffers that the DMA reaches.
    sram: u32,
    /// Variables beside the stack.
    coupled: u32,
}

impl Size {
    /// Reads the ELF file at `path`.
    fn of(path: &Path) -> Result<Size, Stop> {
        let size = Size::of_elf(&files::bytes(path)?);
        size.map_err(files::cannot("read as a 32-bit ELF file", path))
    }

    fn of_elf(bytes: &[u8]) -> Result<Size, object::Error> {
        let elf: ElfFile32<'_> = ElfFile32::parse(bytes)?;
        let (mut size, endian) = (Size::default(), elf.endian());
        let segments = elf.elf_program_headers().iter();
        for segment in segments.filter(|segment| segment.p_type(endian) == object::elf::PT_LOAD) {
            // Loaded from flash and, for initialised variables, copied to SRAM at start: counted in both.
            if segment.p_paddr(endian) < COUPLED {
                size.flash += segment.p_filesz(endian);
            }
            match segment.p_vaddr(endian) {
                SRAM.. => size.sram += segment.p_memsz(endian),
                COUPLED.. => size.coupled += segment.p_memsz(endian),
                _ => {}
            }
        }
        Ok(size)
    }
}

impl std::fmt::Display for Size {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [flash, sram, coupled] =
            [self.flash, self.sram, self.coupled].map(|bytes| f64::from(bytes) / 1024.0);
        write!(
            f,
            "{flash:.1} KiB of flash, {sram:.1} KiB of SRAM and {coupled:.1} KiB beside the stack"
        )
    }
}

/// Builds the image anew if there is one: `bead` takes an image that it finds, which must be that of these
/// sources. It builds a missing image itself.
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
    fn initialised_variables_take_flash_and_sram_and_others_the_memory_they_lie_in() {
        let code = [0x0800_0000, 0x0800_0000, 5000, 5000];
        let data = [0x2000_0000, 0x0800_1388, 100, 100];
        let zeroed = [0x2000_0064, 0x2000_0064, 0, 3000];
        let coupled = [0x1000_7000, 0x1000_7000, 0, 700];
        let size = Size::of_elf(&elf(&[code, data, zeroed, coupled])).unwrap();
        let expected = Size {
            flash: 5100,
            sram: 3100,
            coupled: 700,
        };
        assert_eq!(size, expected);
        assert!(Size::of_elf(&[b'x'; 100]).is_err());
    }
}
