//! Parquet files in which anything may be wrong.
//!
//! # Design
//! The library asserts some of what a sound file has, and returns an error for the rest. So its panics are
//! caught where it is called, and become errors of one line. Nothing of its state is used after that. The
//! panic hook says nothing of them; it is set once, and hands all other panics on to the hook that was there.
//!
//! Behind the end of a file the library skips a list of any length, entry by entry, for a minute. So the end
//! of the file is an error to what reads on. And it reserves the memory that a length asks for before it
//! reads: that of a part of the file, that of a page when it is not compressed any more, that of the values
//! of a dictionary, that of the columns of a group, and that of texts which are written as differences. So
//! the first is held against the file, the second against what Snappy can make of so few bytes, the third
//! against the second, and the fourth against the bytes in which all columns are named; texts as differences
//! are not read. What a file and a page tell of themselves is gone through before
//! ([`crate::recording::thrift`]).

use std::any::Any;
use std::cell::Cell;
use std::fs::File;
use std::io::{self, BufReader, ErrorKind, Read};
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

use parquet::errors::ParquetError;
use parquet::file::metadata::{ColumnChunkMetaData, RowGroupMetaData};
use parquet::file::reader::{ChunkReader, FileReader, Length, SerializedFileReader};
use prost::bytes::Bytes;

use crate::recording::parquet_structs::{
    CHILDREN, COMPRESSED_SIZE, COUNT, DELTA_BYTE_ARRAY, DELTA_LENGTH_BYTE_ARRAY, DICTIONARY, ENCODINGS, FILE,
    NAME, PAGE, SCHEMA, SIZE,
};
use crate::recording::thrift::{Numbers, whole_numbers};

/// A file whose end is an error.
#[derive(Debug)]
pub(crate) struct Bounded(File);

/// Its bytes from a place on.
#[derive(Debug)]
pub(crate) struct Rest(BufReader<File>);

impl Length for Bounded {
    fn len(&self) -> u64 {
        self.0.len()
    }
}

impl ChunkReader for Bounded {
    type T = Rest;

    /// Asked for by the library where the footer or a page begins.
    fn get_read(&self, start: u64) -> Result<Rest, ParquetError> {
        if start.saturating_add(FOOTER) != self.len() {
            check_page(Rest(self.0.get_read(start)?))?;
        }
        self.0.get_read(start).map(Rest)
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes, ParquetError> {
        let rest = self.len().saturating_sub(start);
        if length as u64 > rest {
            let words = format!("{length} bytes of it are named where only {rest} follow");
            return Err(ParquetError::EOF(words));
        }
        let bytes = self.0.get_bytes(start, length)?;
        if length as u64 + FOOTER == rest {
            // What the file holds is told before the footer.
            let schema = Some((SCHEMA, &[NAME, CHILDREN][..]));
            check_schema(&whole_numbers(&*bytes, FILE, schema)?, length)?;
        }
        Ok(bytes)
    }
}

impl Read for Rest {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        match self.0.read(bytes)? {
            0 if !bytes.is_empty() => Err(ErrorKind::UnexpectedEof.into()),
            read => Ok(read),
        }
    }
}

/// Bytes of the footer, at the end of a file.
const FOOTER: u64 = 8;
/// Snappy makes at most 64 bytes of 3: a copy of bytes that were there before. Other compressions are not
/// built in.
const GROWTH_MOST: i64 = 22;

/// Groups that lie within each other at most.
const GROUPS: usize = 64;
/// What the library needs for a name beside its bytes.
const NAME_AT_LEAST: u64 = 48;
/// Bytes for names of columns at most, and more for each byte in which they are named.
const NAMES: u64 = 64 << 20;
const NAMES_A_BYTE: u64 = 16;

/// Refuses columns in too many groups: the library goes into each by a call of itself. And it reserves the
/// memory of all that a group says to have, though each takes a byte at least of the `length` in which they
/// are named. With each column it keeps the names of all groups that the column lies in, so one long name
/// becomes many.
fn check_schema(numbers: &Numbers, length: usize) -> Result<(), ParquetError> {
    let number = |place, field| numbers.get(&[SCHEMA, place, field][..]).copied().unwrap_or(0);
    let last = numbers
        .keys()
        .rfind(|path| path[0] == SCHEMA)
        .map_or(0, |path| path[1]);
    // Of each group that is open, how many are still to come, and the bytes of its name and those around it.
    let mut open: Vec<(i64, u64)> = Vec::new();
    let mut names = 0_u64;
    for place in 0..=last {
        while open.pop_if(|(rest, _)| *rest == 0).is_some() {}
        let mut name = number(place, NAME).unsigned_abs().saturating_add(NAME_AT_LEAST);
        if let Some((rest, around)) = open.last_mut() {
            *rest -= 1;
            name = name.saturating_add(*around);
        }
        let children = number(place, CHILDREN);
        if !usize::try_from(children).is_ok_and(|children| children < length) {
            let words = format!("a group of {children} columns is named in {length} bytes");
            return Err(ParquetError::General(words));
        }
        match children {
            0 => names = names.saturating_add(name),
            _ => open.push((children, name)),
        }
        if open.len() > GROUPS {
            let words = format!("its columns lie in more than {GROUPS} groups");
            return Err(ParquetError::General(words));
        }
        let most = NAMES + NAMES_A_BYTE * length as u64;
        if names > most {
            let words = format!(
                "the names of its columns, each with its groups', take more than {} MB",
                most >> 20
            );
            return Err(ParquetError::General(words));
        }
    }
    Ok(())
}

/// Refuses a page by its header, if it says that it grows more than Snappy can let it, or that its dictionary
/// has more values than bytes; and texts in pages that say themselves how many, for which the library
/// reserves the memory.
fn check_page(header: impl Read) -> Result<(), ParquetError> {
    let numbers = whole_numbers(header, PAGE, None)?;
    let number = |path: &[i64]| numbers.get(path).copied().unwrap_or(0);
    let (size, compressed) = (number(&[SIZE]), number(&[COMPRESSED_SIZE]));
    // The library keeps the lowest 32 bits.
    let short = [size, compressed]
        .iter()
        .all(|number| i32::try_from(*number).is_ok());
    if !short || !(0..=compressed.saturating_mul(GROWTH_MOST)).contains(&size) {
        let words = format!("a page of {compressed} bytes cannot hold the {size} that it names");
        return Err(ParquetError::General(words));
    }
    let of_texts = |path: &[i64; 2]| {
        let encoding = number(path) as i32;
        [DELTA_LENGTH_BYTE_ARRAY, DELTA_BYTE_ARRAY].contains(&encoding)
    };
    if ENCODINGS.iter().any(of_texts) {
        return Err(ParquetError::NYI(
            "texts as differences (DELTA_BYTE_ARRAY)".to_owned(),
        ));
    }
    let count = number(&[DICTIONARY, COUNT]);
    if !(0..=size).contains(&count) {
        let words = format!("a dictionary of {size} bytes cannot have the {count} values that it names");
        return Err(ParquetError::General(words));
    }
    Ok(())
}

/// Rows for a byte of a file at most. Times in even steps and a force that rests have some 100.
const ROWS_A_BYTE: u64 = 1000;

/// Opens a Parquet file.
///
/// # Errors
/// It is none, or damaged, or names more rows than its bytes can hold: equal ones take no room. Or its
/// columns name more bytes than it has: many could be read from the same ones.
pub(crate) fn open(file: File) -> Result<SerializedFileReader<Bounded>, ParquetError> {
    let length = file.len();
    let reader = guarded(|| SerializedFileReader::new(Bounded(file)))?;
    let groups = reader.metadata().row_groups();
    let rows = sum(groups.iter().map(RowGroupMetaData::num_rows));
    let columns = groups.iter().flat_map(RowGroupMetaData::columns);
    let bytes = sum(columns.map(ColumnChunkMetaData::compressed_size));
    let too_much = match (rows, bytes) {
        _ if rows > length.saturating_mul(ROWS_A_BYTE) => format!("the {rows} rows"),
        _ if bytes > length => format!("the {bytes} bytes of columns"),
        _ => return Ok(reader),
    };
    let words = format!("{length} bytes cannot have {too_much} that it names");
    Err(ParquetError::General(words))
}

fn sum(numbers: impl Iterator<Item = i64>) -> u64 {
    numbers.map(i64::unsigned_abs).fold(0, u64::saturating_add)
}

thread_local! {
    /// Whether a panic of this thread is caught here.
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// What the library returns of a file's bytes.
///
/// # Errors
/// Its own; and its words where it panicked, without line breaks.
pub(crate) fn guarded<T, E: From<ParquetError>>(read: impl FnOnce() -> Result<T, E>) -> Result<T, E> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |panicked| {
            if !GUARDED.get() {
                before(panicked);
            }
        }));
    });
    let outside = GUARDED.replace(true);
    let result = panic::catch_unwind(AssertUnwindSafe(read));
    GUARDED.set(outside);
    result.unwrap_or_else(|panicked| {
        let words = words(panicked.as_ref()).replace('\n', " ");
        Err(ParquetError::General(words).into())
    })
}

fn words(panicked: &dyn Any) -> &str {
    let text = panicked.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panicked.downcast_ref::<&str>().copied())
        .unwrap_or("the library says no more")
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;
    use std::sync::Arc;

    use parquet::data_type::Int64Type;
    use parquet::file::metadata::ParquetMetaDataWriter;
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::parser::parse_message_type;

    use super::*;

    #[test]
    fn a_length_that_the_file_does_not_have_is_refused_before_memory_is_reserved() {
        let mut file = tempfile::tempfile().expect("a temporary file");
        file.write_all(b"PAR1 and more").expect("it is written");
        let file = Bounded(file);
        assert_eq!(file.get_bytes(4, 9).expect("they are there"), &b" and more"[..]);
        for (start, length) in [(4, 10), (14, 1), (0, usize::MAX), (u64::MAX, 1)] {
            let why = file.get_bytes(start, length).unwrap_err().to_string();
            assert!(why.contains("bytes of it are named where only"), "{why}");
        }
    }

    #[test]
    fn a_page_that_grows_more_than_snappy_lets_it_is_refused() {
        // Type 0, sizes of 44 and 2.
        assert!(check_page(&[0x15, 0, 0x15, 88, 0x15, 4, 0][..]).is_ok());
        let why = check_page(&[0x15, 0, 0x15, 90, 0x15, 4, 0][..]).unwrap_err();
        let why = why.to_string();
        assert!(why.contains("a page of 2 bytes cannot hold the 45"), "{why}");
        assert!(check_page(&[0x15, 0, 0x15, 88, 0x15][..]).is_err());
        // Sizes of -1 and of -6442450945, whose lowest 32 bits are 2^31 - 1; and one of 2^33 in the file.
        for header in [
            &[0x15, 0, 0x15, 1, 0x15, 4, 0][..],
            &[0x15, 0, 0x15, 0x81, 0x80, 0x80, 0x80, 0x30, 0x15, 4, 0],
            &[0x15, 0, 0x15, 2, 0x15, 0x80, 0x80, 0x80, 0x80, 64, 0],
        ] {
            assert!(check_page(header).is_err(), "{header:?}");
        }
        // A dictionary of 44 bytes with 44 values, 45 and 2^33.
        let dictionary = |count: &[u8]| {
            let header = [&[0x15, 4, 0x15, 88, 0x15, 4, 0x4C, 0x15], count, &[0, 0]].concat();
            check_page(&*header).map_err(|error| error.to_string())
        };
        assert_eq!(dictionary(&[88]), Ok(()));
        for (count, said) in [
            (&[90][..], "45 values"),
            (&[0x80, 0x80, 0x80, 0x80, 64], "8589934592 values"),
        ] {
            let why = dictionary(count).unwrap_err();
            assert!(why.contains(said), "{why}");
        }
    }

    #[test]
    fn texts_as_differences_are_refused() {
        for (encoding, reads) in [(5, true), (6, false), (7, false), (8, true)] {
            let first = [0x15, 0, 0x15, 88, 0x15, 4, 0x2C, 0x25, 2 * encoding, 0, 0];
            let second = [0x15, 0, 0x15, 88, 0x15, 4, 0x5C, 0x45, 2 * encoding, 0, 0];
            for header in [first, second] {
                assert_eq!(check_page(&header[..]).is_ok(), reads, "{encoding}");
            }
        }
    }

    #[test]
    fn columns_lie_in_some_groups_and_a_group_has_no_more_than_there_are() {
        let check = |children: &[i64]| {
            let places = children.iter().zip(0..);
            let numbers = places.map(|(children, place)| (vec![SCHEMA, place, CHILDREN], *children));
            check_schema(&numbers.collect(), 1000).map_err(|error| error.to_string())
        };
        assert_eq!(check(&[3, 0, 2, 0, 0, 0]), Ok(()));
        let says = |children: &[i64], words: &str| {
            let why = check(children).unwrap_err();
            assert!(why.contains(words), "{why}");
        };
        assert_eq!(check(&[999]), Ok(()));
        says(&[2, 0, 1000], "a group of 1000 columns is named in 1000 bytes");
        says(&[1 << 32 | 1, 0], "a group of 4294967297 columns");
        says(&[-1, 0], "a group of -1 columns");
        let nested = |groups| [vec![1; groups], vec![0]].concat();
        assert_eq!(check(&nested(GROUPS)), Ok(()));
        says(&nested(GROUPS + 1), "in more than 64 groups");
        // Groups beside one another are no deeper.
        assert_eq!(check(&[vec![200], [1, 0].repeat(200)].concat()), Ok(()));
    }

    #[test]
    fn a_long_name_of_a_group_is_not_kept_with_each_of_many_columns() {
        let check = |elements: &[(i64, i64)], length| {
            let places = elements.iter().zip(0..);
            let numbers = places.flat_map(|((name, children), place)| {
                [(NAME, name), (CHILDREN, children)].map(|(field, is)| (vec![SCHEMA, place, field], *is))
            });
            check_schema(&numbers.collect(), length).map_err(|error| error.to_string())
        };
        // A group in the root, and its columns.
        let wide =
            |name, columns: usize| [vec![(1, 1), (name, columns as i64)], vec![(1, 0); columns]].concat();
        assert_eq!(check(&wide(1 << 18, 200), 1 << 18), Ok(()));
        let why = check(&wide(1 << 18, 300), 1 << 18).unwrap_err();
        assert!(
            why.ends_with("the names of its columns, each with its groups', take more than 68 MB"),
            "{why}"
        );
        // Columns that are many, or lie deep, have room in a file that is as long as they need.
        assert_eq!(check(&wide(10, 1_000_000), 10_000_000), Ok(()));
        // A group that is closed is not around the next.
        let beside = [vec![(1, 301), (1 << 18, 1), (1, 0)], vec![(1, 0); 300]].concat();
        assert_eq!(check(&beside, 1 << 18), Ok(()));
        // Many short names around each of many columns take memory too.
        let deep = [vec![(1, 1); 60], vec![(1, 100_000)], vec![(1, 0); 100_000]].concat();
        assert!(check(&deep, 500_000).is_err());
    }

    /// A megabyte of zeros, which each of 10,000 groups read anew, kept a core busy for minutes.
    #[test]
    fn columns_that_share_their_bytes_are_refused() {
        let schema = parse_message_type("message shared { REQUIRED INT64 force_n; }").expect("a schema");
        let mut bytes = Vec::new();
        let mut writer =
            SerializedFileWriter::new(&mut bytes, Arc::new(schema), Arc::default()).expect("a file");
        let mut group = writer.next_row_group().expect("a group");
        let mut column = group.next_column().expect("it has a column").expect("one");
        let numbers: Vec<i64> = (0..1000).collect();
        let written = column.typed::<Int64Type>().write_batch(&numbers, None, None);
        assert_eq!(written.expect("they are written"), 1000);
        column.close().expect("it is written");
        group.close().expect("it is written");
        let metadata = writer.close().expect("it is written");
        let body = metadata.row_group(0).column(0).byte_range();
        let body = bytes[..(body.0 + body.1) as usize].to_vec();
        let of_groups = |groups: usize| {
            let group = metadata.row_group(0).clone();
            let metadata = metadata.clone().into_builder();
            let metadata = metadata.set_row_groups(vec![group; groups]).build();
            let mut bytes = body.clone();
            let footer = ParquetMetaDataWriter::new(&mut bytes, &metadata);
            footer.finish().expect("it is written");
            let mut file = tempfile::tempfile().expect("a temporary file");
            file.write_all(&bytes).expect("it is written");
            open(file).map(drop).map_err(|error| error.to_string())
        };
        assert_eq!(of_groups(1), Ok(()));
        let why = of_groups(2).unwrap_err();
        assert!(why.contains("bytes of columns that it names"), "{why}");
    }

    #[test]
    fn a_panic_becomes_an_error_of_one_line_and_the_next_call_is_as_before() {
        let number = |text: &str| {
            guarded(|| Ok::<u8, ParquetError>(text.parse().expect("no\nnumber")))
                .map_err(|error| error.to_string())
        };
        assert_eq!(number("7"), Ok(7));
        let why = number("x").unwrap_err();
        assert!(why.contains("no number: ") && !why.contains('\n'), "{why}");
        assert_eq!(number("8"), Ok(8));
        assert!(!GUARDED.get());
    }
}
