//! The image as flash will hold it: bytes at addresses, sectors, and the name that it carries.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;

use object::read::elf::{ElfFile32, ProgramHeader};
use object::{Object, ObjectSymbol};

use crate::cli::commands::prelude::*;
use bead_bench::image::{find_image, shown};

/// The part's flash (RM0090 section 3.3).
pub(crate) const FLASH: Range<u32> = 0x0800_0000..0x0810_0000;
/// Erased flash.
const ERASED: u8 = 0xff;
/// Size of a block of an image, and alignment of its address, bytes.
pub(crate) const BLOCK: usize = 256;
/// Bytes at the start of an image that contain its name, which is behind 98 vectors.
const HEAD: usize = 512;
/// Sectors in which beads of all versions keep data received over their line.
const STORE: [u8; 2] = [10, 11];

/// Start and length of a sector (RM0090 table 5).
pub(crate) fn sector(number: u8) -> Range<u32> {
    const K: u32 = 1024;
    let (start, length) = match number {
        0..4 => (16 * u32::from(number), 16),
        4 => (64, 64),
        _ => (128 * (u32::from(number) - 4), 128),
    };
    let start = FLASH.start + start * K;
    start..start + length * K
}

/// Start of the sector that contains an address of flash.
fn sector_of(address: u32) -> u32 {
    let sectors = (0..12).map(sector);
    let found = sectors.rev().find(|sector| sector.start <= address);
    found.map_or(FLASH.start, |sector| sector.start)
}

/// The version, the commit and the board of an image, which its build writes into it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub(crate) struct ImageName {
    pub(crate) version: String,
    pub(crate) git: String,
    pub(crate) board: String,
}

impl ImageName {
    /// Mark at the beginning of an image's name (`firmware/build.rs`), and the byte after its end.
    const MARK: &[u8] = b"bead-image:";
    const END: u8 = b';';

    /// Reads the name of the image in a part's flash. Images begin at a sector's start, and the name
    /// follows their vectors. `read` fills bytes from an address.
    pub(crate) fn read(
        mut read: impl FnMut(u32, &mut [u8]) -> Result<(), Failure>,
    ) -> Result<Option<Self>, Failure> {
        for number in (0..12).filter(|number| !STORE.contains(number)) {
            let name = Self::read_at(sector(number).start, &mut read)?;
            if name.is_some() {
                return Ok(name);
            }
        }
        Ok(None)
    }

    /// Reads the name of the image that begins at an address.
    pub(crate) fn read_at(
        address: u32,
        mut read: impl FnMut(u32, &mut [u8]) -> Result<(), Failure>,
    ) -> Result<Option<Self>, Failure> {
        let mut bytes = [ERASED; HEAD];
        read(address, &mut bytes)?;
        Ok(Self::find(&bytes))
    }

    /// Finds the name in the bytes of an image.
    pub(crate) fn find(bytes: &[u8]) -> Option<Self> {
        let marks = (0..bytes.len()).filter(|at| bytes[*at..].starts_with(Self::MARK));
        marks.map(|at| &bytes[at + Self::MARK.len()..]).find_map(|text| {
            let text = &text[..text.len().min(128)];
            let end = text.iter().position(|byte| *byte == Self::END)?;
            let text = str::from_utf8(&text[..end]).ok()?;
            let is_plain = text.bytes().all(|byte| byte == b' ' || byte.is_ascii_graphic());
            let [version, git, board] = Vec::from_iter(text.split(' ')).try_into().ok()?;
            is_plain.then(|| Self {
                version: String::from(version),
                git: String::from(git),
                board: String::from(board),
            })
        })
    }
}

impl fmt::Display for ImageName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { version, git, board } = self;
        write!(f, "{version} ({git}) for {board}")
    }
}

/// An image to flash.
#[derive(Debug)]
pub(crate) struct FlashImage {
    pub(crate) path: PathBuf,
    pub(crate) name: ImageName,
    /// Start of the sector that has the name.
    pub(crate) start: u32,
    /// Blocks of flash by their addresses. Gaps of the image are filled with erased flash.
    pub(crate) blocks: Vec<(u32, [u8; BLOCK])>,
}

impl FlashImage {
    /// Reads the image that was named, or the one for a board, or the one that emulation takes.
    ///
    /// # Errors
    /// The file is not an image of a bead, is for another board, or covers what the bead keeps.
    pub(crate) fn find(given: Option<&Path>, board: Option<&str>) -> Result<Self, Failure> {
        let path = match (given, board) {
            (Some(path), _) => path.to_owned(),
            (None, Some(board)) => built_for(board)?,
            (None, None) => find_image(None)?,
        };
        let bytes = std::fs::read(&path).with_context(|| format!("cannot read {}", shown(&path)))?;
        let image = Self::of_elf(&bytes, path)?;
        match board {
            Some(board) if board != image.name.board => bail!(
                Input,
                "{} is the image for {}, not for {board}; `cargo xtask build {board}` builds that one",
                shown(&image.path),
                image.name.board
            ),
            _ => Ok(image),
        }
    }

    fn of_elf(bytes: &[u8], path: PathBuf) -> Result<Self, Failure> {
        const WANTED: &str = "give the ELF file that `cargo xtask build` makes";
        let shown = shown(&path);
        let elf = ElfFile32::<object::Endianness>::parse(bytes).map_err(|error| {
            failure!(
                Input,
                "{shown}: this is not a 32-bit ELF file ({error}); {WANTED}"
            )
        })?;
        let segments = loaded(&elf, bytes)
            .map_err(|(at, why)| failure!(Input, "{shown}: its bytes for {at:#010x} {why}; {WANTED}"))?;
        let named = |(start, bytes): &Segment<'_>| Some((sector_of(*start), ImageName::find(bytes)?));
        let Some((start, name)) = segments.iter().find_map(named) else {
            bail!(Input, "{shown}: this is not an image of a bead; {WANTED}");
        };
        let mut blocks = BTreeMap::new();
        for (start, bytes) in segments {
            for (address, byte) in (start..).zip(bytes) {
                let base = address - address % BLOCK as u32;
                let block = blocks.entry(base).or_insert([ERASED; BLOCK]);
                block[(address - base) as usize] = *byte;
            }
        }
        let image = Self {
            path,
            name,
            start,
            blocks: blocks.into_iter().collect(),
        };
        let settings = elf.symbols().find(|symbol| symbol.name() == Ok("_settings"));
        let settings = settings.map(|symbol| symbol.address() as u32);
        let keeps =
            |number: &u8| STORE.contains(number) || settings.is_some_and(|at| sector(*number).contains(&at));
        match image.sectors().into_iter().find(keeps) {
            Some(number) => bail!(
                Input,
                "{shown}: it covers sector {number}, in which a bead keeps its settings; nothing was flashed"
            ),
            None => Ok(image),
        }
    }

    /// The sectors that it covers: these are erased, and no other.
    pub(crate) fn sectors(&self) -> Vec<u8> {
        let covers = |number: &u8| {
            let sector = sector(*number);
            self.blocks.iter().any(|(address, _)| sector.contains(address))
        };
        (0..12).filter(covers).collect()
    }

    /// Bytes of all blocks.
    pub(crate) fn length(&self) -> usize {
        self.blocks.len() * BLOCK
    }

    /// Refuses to replace the image for another board, unless `board` was asked for by name.
    pub(crate) fn may_replace(&self, there: Option<&ImageName>, board: Option<&str>) -> Result<(), Failure> {
        match there {
            Some(there) if there.board != self.name.board && board.is_none() => bail!(
                Input,
                "the board has the image {there}, but this image is for {}, which has other pins; nothing was \
                 flashed; name the board that is connected: --board {} or --board {}",
                self.name.board,
                there.board,
                self.name.board
            ),
            _ => Ok(()),
        }
    }
}

/// Bytes and the address of the first.
type Segment<'a> = (u32, &'a [u8]);

/// The bytes that a programmer puts into flash.
///
/// # Errors
/// The address of bytes that are missing from the file or not for flash, and the reason.
fn loaded<'a>(elf: &ElfFile32<'a>, bytes: &'a [u8]) -> Result<Vec<Segment<'a>>, (u32, &'static str)> {
    let endian = elf.endian();
    let headers = elf.elf_program_headers().iter();
    // Memory that is only reserved has no bytes.
    let headers =
        headers.filter(|header| header.p_type(endian) == object::elf::PT_LOAD && header.p_filesz(endian) > 0);
    let segment = |header: &object::elf::ProgramHeader32<object::Endianness>| {
        let start = header.p_paddr(endian);
        let bytes = header.data(endian, bytes).map_err(|()| (start, "are cut off"))?;
        if FLASH.contains(&start) && bytes.len() <= (FLASH.end - start) as usize {
            return Ok((start, bytes));
        }
        Err((start, "are outside of the part's flash"))
    };
    headers.map(segment).collect()
}

/// The image for a board: as `cargo xtask build BOARD` leaves it in the target directory that holds this
/// program or is above the working directory, or as a release has it beside this program.
fn built_for(board: &str) -> Result<PathBuf, Failure> {
    let program = std::env::current_exe().unwrap_or_default();
    let here = std::env::current_dir().unwrap_or_default();
    let beside = program
        .ancestors()
        .map(|folder| folder.join("firmware").join(format!("{board}.elf")));
    let built = program
        .ancestors()
        .map(|folder| folder.join("boards").join(board));
    let above = here
        .ancestors()
        .map(|folder| folder.join("target/boards").join(board));
    // The first board's image is the one that emulation takes.
    let first = find_image(None).ok();
    let is_for = |path: &PathBuf| {
        let name = std::fs::read(path).ok().and_then(|bytes| ImageName::find(&bytes));
        name.is_some_and(|name| name.board == board)
    };
    let mut all = beside.take(2).chain(built).chain(above).chain(first);
    all.find(is_for).ok_or_else(|| {
        failure!(
            Input,
            "there is no image for {board} here; `cargo xtask build {board}` builds it, or says why it cannot; a \
             release has the images of all boards in its folder firmware"
        )
    })
}
