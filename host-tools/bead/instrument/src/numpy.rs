//! Arrays of NumPy in `.npy` files.

use std::fs::File;
use std::io::{self, BufReader, ErrorKind, Read};
use std::path::Path;

use npyz::{DType, NpyFile, Order, TypeChar};

use crate::arrays::{self, Array, MOST_COLUMNS, MOST_NUMBERS, waveform};
use crate::choice::Choice;
use crate::columns::ColumnHeader;
use crate::error::WaveformError;
use crate::signals::Waveform;
use bead_tables::printable::{beginning, one_line};

/// Greatest size of a header, bytes, as in `numpy.load`.
const LONGEST_HEADER: usize = 10_000;
/// Greatest number of brackets in a header: the parser recurses for each.
const MOST_BRACKETS: usize = 20;

/// Reads an array of one dimension, which needs a rate, or of two: rows along the longer one. Columns are
/// named by their numbers.
pub(super) fn read(path: &Path, choice: &Choice) -> Result<Waveform, WaveformError> {
    let unfit = |what: String| Err(WaveformError::unfit(path, what));
    let damaged = |error: io::Error| match error.raw_os_error() {
        Some(_) => WaveformError::unread(path)(error),
        None => WaveformError::unfit(
            path,
            format!(
                "is a damaged .npy file: {}; save it again with numpy.save",
                beginning(&one_line(&error.to_string()), 100)
            ),
        ),
    };
    let file = File::open(path).map_err(damaged)?;
    let length = file.metadata().map_err(damaged)?.len();
    let mut file = BufReader::new(file);
    let header = header(&mut file).map_err(damaged)?;
    let array = NpyFile::new(header.chain(file)).map_err(damaged)?;
    let (rows, columns, by_rows) = match (array.shape(), array.order()) {
        ([rows], _) => (*rows, 1, true),
        ([a, b], order) => (*a.max(b), *a.min(b), (a >= b) == (order == Order::C)),
        (shape, _) => {
            let dimensions = shape.len();
            return unfit(format!(
                "is an array of {dimensions} dimensions; save one with a row for each sample"
            ));
        }
    };
    let numbers = rows
        .checked_mul(columns)
        .filter(|all| *all <= MOST_NUMBERS as u64);
    let Some(numbers) = numbers.filter(|_| columns <= MOST_COLUMNS as u64) else {
        return unfit(format!(
            "is an array of {rows} by {columns}; at most {MOST_COLUMNS} columns and {} million numbers are read",
            MOST_NUMBERS / 1_000_000
        ));
    };
    if numbers > length {
        return unfit(format!(
            "declares {numbers} numbers in {length} bytes; save it again"
        ));
    }
    let kind = array.dtype().descr();
    let Some(values) = values(array) else {
        return unfit(format!(
            "is an array of {}, but only whole numbers and floats of 32 or 64 bits are read; save it with .astype(float)",
            beginning(&one_line(&kind), 40)
        ));
    };
    let values = values.map_err(damaged)?;
    let headers = (0..).map(ColumnHeader::without_name);
    let columns = headers.zip(arrays::columns(&values, columns as usize, by_rows));
    let arrays: Vec<_> = columns.map(|(header, values)| Array { header, values }).collect();
    waveform(path, choice, &arrays, None)
}

/// The bytes before the numbers: magic, version, length, and a Python literal.
fn header(file: &mut impl Read) -> io::Result<io::Cursor<Vec<u8>>> {
    let mut bytes = vec![0; 10];
    file.read_exact(&mut bytes)?;
    let mut length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let is_later_version = bytes[6] > 1;
    if is_later_version {
        let mut high = [0; 2];
        file.read_exact(&mut high)?;
        length += usize::from(u16::from_le_bytes(high)) << 16;
        bytes.extend(high);
    }
    let too_long = |what| Err(io::Error::new(ErrorKind::InvalidData, what));
    if length > LONGEST_HEADER {
        return too_long("its header is too long");
    }
    let start = bytes.len();
    bytes.resize(start + length, 0);
    file.read_exact(&mut bytes[start..])?;
    let brackets = bytes[start..].iter().filter(|byte| b"([{".contains(byte));
    if brackets.count() > MOST_BRACKETS {
        return too_long("its header has too many brackets");
    }
    Ok(io::Cursor::new(bytes))
}

/// All numbers in the order of the file, or `None` if they are of another type.
fn values<R: Read>(array: NpyFile<R>) -> Option<io::Result<Vec<f64>>> {
    let DType::Plain(of) = array.dtype() else {
        return None;
    };
    macro_rules! all {
        ($number:ty) => {
            array
                .data::<$number>()
                .ok()?
                .map(|value| value.map(|value| value as f64))
                .collect()
        };
    }
    Some(match (of.type_char(), of.size_field()) {
        (TypeChar::Float, 4) => all!(f32),
        (TypeChar::Float, 8) => all!(f64),
        (TypeChar::Int, 1) => all!(i8),
        (TypeChar::Int, 2) => all!(i16),
        (TypeChar::Int, 4) => all!(i32),
        (TypeChar::Int, 8) => all!(i64),
        (TypeChar::Uint, 1) => all!(u8),
        (TypeChar::Uint, 2) => all!(u16),
        (TypeChar::Uint, 4) => all!(u32),
        (TypeChar::Uint, 8) => all!(u64),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    /// A file with these numbers and a header as NumPy 2 writes it.
    fn file(version: u8, dtype: &str, fortran: &str, shape: &str, numbers: &[u8]) -> Vec<u8> {
        let header = format!("{{'descr': {dtype}, 'fortran_order': {fortran}, 'shape': {shape}, }}");
        let before = if version == 1 { 10 } else { 12 };
        let length = (before + header.len() + 1).next_multiple_of(64) - before;
        let mut bytes = b"\x93NUMPY".to_vec();
        bytes.extend([version, 0]);
        match version {
            1 => bytes.extend((length as u16).to_le_bytes()),
            _ => bytes.extend((length as u32).to_le_bytes()),
        }
        bytes.extend(format!("{header:<width$}\n", width = length - 1).bytes());
        bytes.extend(numbers);
        bytes
    }

    fn read(bytes: &[u8], rate_hz: Option<f64>, force: &str) -> Result<Waveform, String> {
        let choice = Choice {
            time: rate_hz.is_none().then(|| "1:ms".parse().unwrap()),
            force: Some(force.parse().unwrap()),
            rate_hz,
            ..Choice::default()
        };
        testing::read(bytes, &choice)
    }

    fn ramp(row: i32) -> i32 {
        (row - 10).max(0)
    }

    #[test]
    fn arrays_of_one_dimension_are_read_at_a_rate() {
        let big: Vec<u8> = (0..30).flat_map(|row| (ramp(row) as i16).to_be_bytes()).collect();
        let little: Vec<u8> = (0..30)
            .flat_map(|row| f64::from(ramp(row)).to_le_bytes())
            .collect();
        for bytes in [
            file(1, "'>i2'", "False", "(30,)", &big),
            file(2, "'<f8'", "False", "(30,)", &little),
        ] {
            let force = read(&bytes, Some(1000.0), "1:0.5N").unwrap().force.unwrap();
            assert!((force.last() - 9.5).abs() < 1e-12 && (force.end() - 29e-3).abs() < 1e-12);
        }
    }

    #[test]
    fn rows_of_an_array_lie_along_its_longer_side_in_either_order() {
        let number = |row: i32, column: i32| [row, ramp(row)][column as usize] as f32;
        let by_rows: Vec<u8> = (0..30)
            .flat_map(|row| [0, 1].map(|column| number(row, column).to_le_bytes()))
            .flatten()
            .collect();
        let by_columns: Vec<u8> = [0, 1]
            .iter()
            .flat_map(|column| (0..30).flat_map(|row| number(row, *column).to_le_bytes()))
            .collect();
        for (fortran, shape, numbers) in [
            ("False", "(30, 2)", &by_rows),
            ("True", "(30, 2)", &by_columns),
            ("False", "(2, 30)", &by_columns),
            ("True", "(2, 30)", &by_rows),
        ] {
            let force = read(&file(1, "'<f4'", fortran, shape, numbers), None, "2:N").unwrap();
            let force = force.force.unwrap();
            assert!((force.last() - 19.0).abs() < 1e-12, "{fortran} {shape}");
        }
    }

    #[test]
    fn other_arrays_and_damaged_files_are_refused_in_a_line() {
        let nested = format!("{}'<f8'", "(".repeat(5000));
        let of = |dtype, shape, bytes| file(1, dtype, "False", shape, &vec![0; bytes]);
        let cut = file(2, "'<f8'", "False", "(30,)", &[])[..12].to_vec();
        let long = b"\x93NUMPY\x02\x00\xff\xff\xff\xff".to_vec();
        for (bytes, part) in [
            (of("'<c16'", "(30,)", 480), "save it with .astype(float)"),
            (of("[('t', '<f8')]", "(30,)", 240), "with .astype(float)"),
            (of("'<f8'", "(3, 3, 3)", 216), "of 3 dimensions"),
            (of("'<f8'", "(30,)", 232), "is a damaged .npy file"),
            (of("'<f8'", "(9999999,)", 80), "declares 9999999 numbers in"),
            (of("'<f8'", "(99999999999, 99999999999)", 0), "of 99999999999 by"),
            (of(&nested, "(30,)", 0), "too many brackets"),
            (cut, "is a damaged .npy file"),
            (long, "its header is too long"),
        ] {
            let error = read(&bytes, Some(1e3), "1:N").unwrap_err();
            assert!(error.contains(part) && error.lines().count() == 1, "{error}");
        }
    }
}
