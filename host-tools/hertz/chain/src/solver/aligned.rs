//! Arrays aligned to cache lines, so that each vector of eight lies in one line.

use std::ops::{Deref, DerefMut};

/// An array of f64 of a fixed length.
#[derive(Debug, Default)]
pub(super) struct CacheAligned {
    room: Vec<f64>,
    start: usize,
    length: usize,
}

/// Bytes of a cache line, and f64 in one.
const LINE: usize = 64;
const SPARE: usize = LINE / size_of::<f64>();

impl CacheAligned {
    pub(super) fn zeros(length: usize) -> Self {
        let room = vec![0.0; length + SPARE];
        let start = room.as_ptr().align_offset(LINE).min(SPARE);
        Self { room, start, length }
    }
}

impl Clone for CacheAligned {
    fn clone(&self) -> Self {
        let mut copy = Self::zeros(self.length);
        copy.copy_from_slice(self);
        copy
    }
}

impl Deref for CacheAligned {
    type Target = [f64];

    #[inline(always)]
    fn deref(&self) -> &[f64] {
        &self.room[self.start..self.start + self.length]
    }
}

impl DerefMut for CacheAligned {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.room[self.start..self.start + self.length]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_array_begins_at_a_cache_line_and_a_copy_of_it_too() {
        for length in 1..40 {
            let array = CacheAligned::zeros(length);
            for array in [&array, &array.clone()] {
                assert_eq!((array.as_ptr() as usize % LINE, array.len()), (0, length));
            }
        }
    }
}
