//! Reads the image's log out of guest memory, as a debug probe does: SEGGER's Real-Time Transfer, up-channel
//! 0.
//!
//! The control block starts with a name of 16 bytes and the counts of up- and down-channels. Then each
//! channel has six words: name, buffer, size, write offset (the image's), read offset (ours), flags.

const NAME: &[u8; 10] = b"SEGGER RTT";
const BLOCK_BYTES: usize = 24 + 6 * 4;
/// Read offset of channel 0 in the block.
const READ_OFFSET: u32 = 40;
/// Largest size of a buffer. A larger value is memory that has not been set up yet.
const MAX_BUFFER: u32 = 0x2_0000;

/// Guest memory, as far as the log needs it.
pub(super) trait GuestMemory {
    fn read(&mut self, address: u32, bytes: &mut [u8]);
    fn write(&mut self, address: u32, bytes: &[u8]);
}

/// Address of the image's write offset.
pub(super) fn write_offset(block: u32) -> u32 {
    // The block of a foreign image may lie anywhere.
    block.wrapping_add(36)
}

/// Takes the bytes in the buffer, and advances the read offset. `None` before the image has set up the block.
pub(super) fn drain(block: u32, memory: &mut impl GuestMemory) -> Option<Vec<u8>> {
    let mut bytes = [0; BLOCK_BYTES];
    memory.read(block, &mut bytes);
    let word = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
    let (channels, buffer, size, write, read) = (word(16), word(28), word(32), word(36), word(40));
    let set_up = bytes.starts_with(NAME) && channels > 0 && size <= MAX_BUFFER && write < size && read < size;
    if !set_up || write == read {
        return set_up.then(Vec::new);
    }
    let mut taken = Vec::new();
    let mut take = |from: u32, to: u32| {
        let start = taken.len();
        taken.resize(start + (to - from) as usize, 0);
        // The buffer may be at any address.
        memory.read(buffer.wrapping_add(from), &mut taken[start..]);
    };
    if read < write {
        take(read, write);
    } else {
        take(read, size);
        take(0, write);
    }
    memory.write(block + READ_OFFSET, &write.to_le_bytes());
    Some(taken)
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Ram(Vec<u8>);

    impl GuestMemory for Ram {
        fn read(&mut self, address: u32, bytes: &mut [u8]) {
            let at = address as usize;
            bytes.copy_from_slice(&self.0[at..at + bytes.len()]);
        }

        fn write(&mut self, address: u32, bytes: &[u8]) {
            let at = address as usize;
            self.0[at..at + bytes.len()].copy_from_slice(bytes);
        }
    }

    /// A block at 0 and its buffer `01234567` at 64.
    fn image(write: u32, read: u32) -> Ram {
        let mut ram = Ram(vec![0; 128]);
        ram.write(0, NAME);
        for (at, word) in [(16, 1), (28, 64), (32, 8), (36, write), (40, read)] {
            ram.write(at, &u32::to_le_bytes(word));
        }
        ram.write(64, b"01234567");
        ram
    }

    #[test]
    fn what_lies_between_the_offsets_is_taken_once_and_in_order() {
        let mut ram = image(5, 2);
        assert_eq!(drain(0, &mut ram).as_deref(), Some(&b"234"[..]));
        assert_eq!(drain(0, &mut ram).as_deref(), Some(&b""[..]));
        assert_eq!(
            drain(0, &mut image(2, 6)).as_deref(),
            Some(&b"6701"[..]),
            "wrapped"
        );
    }

    #[test]
    fn a_buffer_at_the_end_of_the_address_space_wraps() {
        /// The block, and the addresses that are read.
        struct RecordedReads(Ram, Vec<u32>);
        impl GuestMemory for RecordedReads {
            fn read(&mut self, address: u32, bytes: &mut [u8]) {
                self.1.push(address);
                if address == 0 {
                    self.0.read(address, bytes);
                }
            }

            fn write(&mut self, _address: u32, _bytes: &[u8]) {}
        }
        let mut ram = image(6, 5);
        ram.write(28, &u32::MAX.to_le_bytes());
        let mut memory = RecordedReads(ram, Vec::new());
        assert_eq!(drain(0, &mut memory).as_deref(), Some(&[0][..]));
        assert_eq!(memory.1, [0, 4]);
    }

    #[test]
    fn a_block_that_is_not_set_up_gives_nothing() {
        assert_eq!(drain(0, &mut Ram(vec![0; 128])), None);
        assert_eq!(drain(0, &mut image(9, 0)), None, "an offset beyond the buffer");
    }
}
