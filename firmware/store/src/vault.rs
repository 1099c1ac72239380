//! A settings block and the secret of its owner, in one record of the store.
//!
//! # Design
//! Both are in one record, so that a power cut leaves the old pair or the new one, and never one without the
//! other. Without a secret, the record holds only the block, as it did before there were secrets. The block
//! begins with "BEAD", so the two forms cannot be taken for each other.
//!
//! A store that cannot be read may hold a secret, so it is not treated as one without. It stays unreadable
//! until the next start, which may erase what is in its way.
//!
//! ```text
//! block
//! "KEY" 1  key (16 bytes)  counter u64 LE  block
//! ```

use embedded_storage::nor_flash::NorFlash;

use crate::store::{MAX_BLOCK, Store, StoreError};

const MAGIC: [u8; 4] = *b"KEY\x01";
/// Bytes before the block.
const HEAD: usize = MAGIC.len() + 16 + 8;
/// Longest settings block beside a secret, in bytes.
pub const MAX_SETTINGS: usize = MAX_BLOCK - HEAD;

/// A secret that owner and bead share.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Secret {
    /// The key.
    pub key: [u8; 16],
    /// No signed request with a higher counter was let through.
    pub counter: u64,
}

impl Secret {
    fn head(&self) -> [u8; HEAD] {
        let mut head = [0; HEAD];
        head[..4].copy_from_slice(&MAGIC);
        head[4..20].copy_from_slice(&self.key);
        head[20..].copy_from_slice(&self.counter.to_le_bytes());
        head
    }

    /// Splits a record into its secret, if it has one, and the block.
    fn split(record: &[u8]) -> (Option<Self>, &[u8]) {
        let parts = record.strip_prefix(&MAGIC).and_then(|rest| {
            let (key, rest) = rest.split_first_chunk()?;
            let (counter, block) = rest.split_first_chunk()?;
            let (key, counter) = (*key, u64::from_le_bytes(*counter));
            Some((Self { key, counter }, block))
        });
        parts.map_or((None, record), |(secret, block)| (Some(secret), block))
    }
}

/// The store, with a settings block and a secret in it.
pub struct Vault<F: NorFlash> {
    store: Store<F>,
    secret: Option<Secret>,
}

impl<F: NorFlash> Vault<F> {
    /// Reads the contents of the store.
    pub fn new(mut store: Store<F>) -> Self {
        let record = store.read().ok().flatten();
        let secret = record.and_then(|record| Secret::split(record).0);
        Self { store, secret }
    }

    /// Returns `true` if the store could not be read when it was opened. It is then unknown whether there is
    /// a secret, and nothing is written.
    pub const fn is_unreadable(&self) -> bool {
        self.store.is_unreadable()
    }

    /// The secret, if one was found.
    pub const fn secret(&self) -> Option<Secret> {
        self.secret
    }

    /// The settings block, if there is one.
    ///
    /// # Errors
    /// [`StoreError::Flash`], also if the store [was unreadable](Self::is_unreadable).
    pub fn read(&mut self) -> Result<Option<&[u8]>, StoreError> {
        if self.is_unreadable() {
            return Err(StoreError::Flash);
        }
        let record = self.store.read()?;
        Ok(record
            .map(|record| Secret::split(record).1)
            .filter(|block| !block.is_empty()))
    }

    /// Writes a settings block beside the secret. After an error, both are unchanged.
    ///
    /// # Errors
    /// As [`Store::write`], and [`StoreError::Flash`] if the store [was unreadable](Self::is_unreadable).
    pub fn write(&mut self, block: &[u8]) -> Result<(), StoreError> {
        if block.len() > MAX_SETTINGS {
            return Err(StoreError::TooLong);
        }
        self.put(self.secret, block)
    }

    /// Forgets the settings block, and keeps the secret.
    ///
    /// # Errors
    /// As [`write`](Self::write).
    pub fn clear(&mut self) -> Result<(), StoreError> {
        self.put(self.secret, &[])
    }

    /// Replaces the secret beside the settings block, or removes it. After an error, both are unchanged.
    ///
    /// # Errors
    /// As [`write`](Self::write).
    pub fn keep(&mut self, secret: Option<Secret>) -> Result<(), StoreError> {
        let mut block = [0; MAX_SETTINGS];
        let stored = self.read()?.unwrap_or_default();
        let length = stored.len();
        block
            .get_mut(..length)
            .ok_or(StoreError::TooLong)?
            .copy_from_slice(stored);
        self.put(secret, &block[..length])
    }

    /// Returns the flash.
    pub fn into_flash(self) -> F {
        self.store.into_flash()
    }

    fn put(&mut self, secret: Option<Secret>, block: &[u8]) -> Result<(), StoreError> {
        if self.is_unreadable() {
            return Err(StoreError::Flash);
        }
        match secret {
            Some(whole) => {
                let mut record = [0; MAX_BLOCK];
                record[..HEAD].copy_from_slice(&whole.head());
                record[HEAD..HEAD + block.len()].copy_from_slice(block);
                self.store.write(&record[..HEAD + block.len()])?;
            }
            None => self.store.write(block)?,
        }
        self.secret = secret;
        Ok(())
    }
}
