//! One block in two sectors of flash.

use core::ops::Range;

use embassy_futures::block_on;
use embedded_storage::nor_flash::NorFlash;
use sequential_storage::Error;
use sequential_storage::cache::Cache;
use sequential_storage::cache::key_pointers::ArrayKeyPointers;
use sequential_storage::cache::page_pointers::ArrayPagePointers;
use sequential_storage::cache::page_states::ArrayPageStates;
use sequential_storage::map::{MapConfig, MapStorage};

use crate::sectors::{COUNT, SectorError, Sectors};

/// Longest block, in bytes: settings and a secret.
pub const MAX_BLOCK: usize = 448 + 28;
/// A block with its key, rounded up to words of any flash.
const BUFFER: usize = MAX_BLOCK + 32;
/// Key of the only item in the store.
const KEY: u8 = 1;
/// If there is no room for the longest block, this many writes of any block are enough to move to the other
/// sector.
const WRITES_TO_MOVE: u32 = needed(MAX_BLOCK) / needed(0) + 1;

/// The store.
pub struct Store<F: NorFlash> {
    sectors: Sectors<F>,
    buffer: [u8; BUFFER],
    unreadable: bool,
}

/// Result of [`Store::open`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Opened {
    /// Sectors that were erased.
    pub erased: u32,
    /// True if the flash held data but no whole block, and was erased.
    pub lost: bool,
}

/// Error of reading or writing a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StoreError {
    /// A sector has to be erased first, which happens at the next start.
    #[error("the store is full; the next start makes room")]
    Full,
    /// The block is longer than [`MAX_BLOCK`].
    #[error("a block has at most {MAX_BLOCK} bytes")]
    TooLong,
    /// The flash reported an error, or does not keep what was written.
    #[error("the flash does not take or keep what is written")]
    Flash,
}

impl<F: NorFlash> Store<F> {
    /// Opens the store in `range` of the flash, which is two sectors.
    ///
    /// Erases a sector if one is needed: a few times in the life of a bead, and after a power cut during an
    /// erase.
    ///
    /// # Panics
    /// The range is not two sectors.
    pub fn open(flash: F, range: Range<u32>) -> (Self, Opened) {
        let mut store = Self::new(flash, range);
        store.sectors.may_erase = true;
        let lost = match store.tidy() {
            Ok(worth) => !worth,
            // The flash fails somewhere. A block that can still be read is kept.
            Err(_) => {
                // The library would repair a block that is read wrongly, and erase for that.
                store.sectors.may_erase = false;
                let held = store.reads_block() || store.reads_block();
                store.sectors.may_erase = true;
                if !held {
                    // If this fails too, the store is unreadable.
                    let _ = store.sectors.erase_all();
                }
                !held
            }
        };
        store.sectors.may_erase = false;
        store.unreadable = lost && !store.makes_sense();
        let erased = store.sectors.erased;
        (store, Opened { erased, lost })
    }

    /// Opens the store in `range` of the flash, which is two sectors, and changes nothing there. What is read
    /// may be less than what [`open`](Self::open) would find, and a write may find no room.
    ///
    /// # Panics
    /// The range is not two sectors.
    pub fn open_as_it_is(flash: F, range: Range<u32>) -> Self {
        let mut store = Self::new(flash, range);
        store.unreadable = !store.makes_sense();
        store
    }

    fn new(flash: F, range: Range<u32>) -> Self {
        Self {
            sectors: Sectors::new(flash, range),
            buffer: [0; BUFFER],
            unreadable: false,
        }
    }

    /// Returns `true` if a block is found, or the sectors are blank.
    fn makes_sense(&mut self) -> bool {
        match self.fetch() {
            Ok(Some(_)) => true,
            Ok(None) => {
                let mut sectors = self.sectors.each().into_iter();
                sectors.all(|sector| matches!(self.sectors.is_blank(&sector), Ok(true)))
            }
            Err(_) => false,
        }
    }

    /// Brings the sectors into the order that the library expects: one in use, one blank. Returns false if
    /// there was data but no whole block.
    fn tidy(&mut self) -> Result<bool, StoreError> {
        let mut worthless = false;
        for sector in self.sectors.each() {
            // The library reads a mark at each end of a sector, and an erase that was cut may leave either
            // mark. A sector without a whole block is worthless, whatever its marks.
            // An erase destroys what was perhaps only misread. So the sector is read twice.
            if !self.sectors.is_blank(&sector)? && !self.holds_block(&sector) && !self.holds_block(&sector) {
                self.sectors.erase(&sector)?;
                worthless = true;
            }
        }
        let mut current = [0; MAX_BLOCK];
        let Some(block) = self.fetch()? else {
            return Ok(!worthless);
        };
        let length = block.len();
        current[..length].copy_from_slice(block);
        let (mut blank, mut closed) = (false, false);
        for sector in self.sectors.each() {
            blank |= self.sectors.is_blank(&sector)?;
            closed |= self.sectors.is_closed(&sector)?;
        }
        if !blank || closed {
            // Power was lost while the library moved to the other sector. A write that may erase completes
            // the move.
            self.put(&current[..length])?;
        }
        for _ in 0..WRITES_TO_MOVE {
            if self.sectors.room()? >= needed(MAX_BLOCK) {
                break;
            }
            self.put(&current[..length])?;
        }
        Ok(true)
    }

    /// The block, if there is one.
    ///
    /// # Errors
    /// [`StoreError::Flash`].
    pub fn read(&mut self) -> Result<Option<&[u8]>, StoreError> {
        // An empty block stands for no block: the library removes an item by writing over it.
        Ok(self.fetch()?.filter(|block| !block.is_empty()))
    }

    /// Returns `true` if the sectors held something when they were opened, and no block was found there. This
    /// happens to a store that was [opened as it is](Self::open_as_it_is) after a power cut in an erase, and
    /// to any store on flash that fails.
    pub const fn is_unreadable(&self) -> bool {
        self.unreadable
    }

    /// Writes a block, and reads it back. After an error the block before it remains; on flash that has worn
    /// out it may be this one, if only data beside it was not kept.
    ///
    /// # Errors
    /// See [`StoreError`].
    pub fn write(&mut self, block: &[u8]) -> Result<(), StoreError> {
        if block.len() > MAX_BLOCK {
            return Err(StoreError::TooLong);
        }
        if self.sectors.room()? < needed(block.len()) {
            return Err(StoreError::Full);
        }
        self.put(block)?;
        if self.fetch()? == Some(block) {
            Ok(())
        } else {
            Err(StoreError::Flash)
        }
    }

    /// Returns the flash.
    pub fn into_flash(self) -> F {
        self.sectors.flash
    }

    /// Returns `true` if the sector holds a whole block. The other sector reads as blank meanwhile.
    fn holds_block(&mut self, sector: &Range<u32>) -> bool {
        self.sectors.alone = Some(sector.clone());
        let found = self.reads_block();
        self.sectors.alone = None;
        found
    }

    fn reads_block(&mut self) -> bool {
        matches!(self.fetch(), Ok(Some(_)))
    }

    fn fetch(&mut self) -> Result<Option<&[u8]>, StoreError> {
        let Self { sectors, buffer, .. } = self;
        block_on(map(sectors).fetch_item(buffer, &KEY)).map_err(|error| blame(&error))
    }

    fn put(&mut self, block: &[u8]) -> Result<(), StoreError> {
        let Self { sectors, buffer, .. } = self;
        block_on(map(sectors).store_item(buffer, &KEY, &block)).map_err(|error| blame(&error))
    }
}

/// Bytes of flash for a block: header with checksum, key and block, rounded up to words of 4 bytes.
const fn needed(length: usize) -> u32 {
    8 + (1 + length as u32).next_multiple_of(4)
}

/// The memory of the library during one operation. Without it, the library would search a sector anew for
/// each item that it moves, and take seconds for a full sector.
type Remembered = Cache<ArrayPageStates<COUNT>, ArrayPagePointers<COUNT>, ArrayKeyPointers<u8, 1>, u8>;

fn map<F: NorFlash>(sectors: &mut Sectors<F>) -> MapStorage<u8, &mut Sectors<F>, Remembered> {
    let cache = Cache::new(
        ArrayPageStates::new(),
        ArrayPagePointers::new(),
        ArrayKeyPointers::new(),
    );
    let config = MapConfig::new(sectors.range.clone());
    MapStorage::new(sectors, config, cache)
}

impl From<SectorError> for StoreError {
    fn from(error: SectorError) -> Self {
        match error {
            SectorError::EraseRefused => Self::Full,
            SectorError::Flash => Self::Flash,
        }
    }
}

fn blame(error: &Error<SectorError>) -> StoreError {
    match error {
        Error::FullStorage => StoreError::Full,
        Error::Storage { value, .. } => (*value).into(),
        _ => StoreError::Flash,
    }
}
