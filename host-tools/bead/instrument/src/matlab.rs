//! Arrays of MATLAB in MAT-files of level 5, which MATLAB writes with `-v6` and `-v7`, and SciPy with
//! `savemat`.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use flate2::read::ZlibDecoder;
use mat5::{MatFile, Matrix, NamedArray};

use crate::arrays::{self, Array, MOST_COLUMNS, MOST_NUMBERS, waveform};
use crate::choice::Choice;
use crate::columns::ColumnHeader;
use crate::error::WaveformError;
use crate::signals::Waveform;
use bead_tables::printable::one_line;

/// Bytes of the header: text, version, byte order.
const HEADER: usize = 128;
/// Numbers of types of elements.
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;
/// Greatest size of all arrays, bytes, packed or not.
const MOST_BYTES: u64 = 8 * MOST_NUMBERS as u64;
/// The variable of PicoScope that holds the time between two samples, s.
const INTERVAL: &str = "Tinterval";

/// True if a file that begins with `head` is a MAT-file of level 5: its version is 1.0 in either byte order.
pub(super) fn is_level_5(head: &[u8]) -> bool {
    matches!(head.get(HEADER - 4..HEADER), Some(b"\x00\x01IM" | b"\x01\x00MI"))
}

/// Reads the variables that have as many rows as the longest. A vector is a column with the variable's name;
/// a matrix `m` has the columns `m_1`, `m_2` and so on.
pub(super) fn read(path: &Path, choice: &Choice) -> Result<Waveform, WaveformError> {
    let unfit = |what: &str| WaveformError::unfit(path, what);
    let damaged = |error: io::Error| match error.raw_os_error() {
        Some(_) => WaveformError::unread(path)(error),
        None => unfit("is a damaged MAT-file; save it again"),
    };
    let file = File::open(path).map_err(damaged)?;
    let mut bytes = Vec::new();
    file.take(MOST_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(damaged)?;
    let (header, elements) = bytes
        .split_at_checked(HEADER)
        .ok_or_else(|| unfit("is a damaged MAT-file; save it again"))?;
    if header.ends_with(b"MI") {
        return Err(unfit(
            "is a MAT-file of a big-endian computer; save it again on a little-endian one",
        ));
    }
    let variables = variables(header, elements, MOST_BYTES).map_err(damaged)?;
    let too_many = || {
        unfit(
            "has more numbers than three columns of 10 million rows, or more than 1000 columns; save only the strike",
        )
    };
    let variables = variables.ok_or_else(too_many)?;
    let (mut arrays, mut interval) = (Vec::new(), None);
    let rows = variables.iter().map(rows).max().unwrap_or(0);
    for variable in &variables {
        let Matrix::Dense(matrix) = &variable.matrix else {
            continue;
        };
        let values = matrix.values.to_f64();
        if variable.name == INTERVAL && values.len() == 1 {
            interval = values.first().copied().filter(|seconds| *seconds > 0.0);
        }
        let columns = values.len() / rows.max(1);
        if rows < 2 || self::rows(variable) != rows || columns * rows != values.len() {
            continue;
        }
        let name = one_line(&variable.name);
        // MATLAB stores columns one after another.
        let columns_of = arrays::columns(&values, columns, matrix.rows != rows);
        for (column, values) in (1..).zip(columns_of) {
            let header = ColumnHeader {
                place: arrays.len(),
                name: match columns {
                    1 => name.to_string(),
                    _ => format!("{name}_{column}"),
                },
                unit: None,
            };
            arrays.push(Array { header, values });
            if arrays.len() > MOST_COLUMNS {
                return Err(too_many());
            }
        }
    }
    if arrays.is_empty() {
        return Err(unfit(
            "has no vector or matrix of real numbers; save time, force and acceleration as vectors of one length",
        ));
    }
    waveform(path, choice, &arrays, interval.map(f64::recip))
}

/// The length of the longer side of a matrix, or 0 unless all its numbers are present.
fn rows(variable: &NamedArray) -> usize {
    match &variable.matrix {
        Matrix::Dense(matrix) if matrix.rows.checked_mul(matrix.cols) == Some(matrix.values.len()) => {
            matrix.rows.max(matrix.cols)
        }
        _ => 0,
    }
}

/// The real matrices among the elements of a file; `None` if they have more than `left` bytes, unpacked.
/// Texts, cells and structures are skipped: the library would refuse the whole file for them.
fn variables(header: &[u8], mut elements: &[u8], mut left: u64) -> io::Result<Option<Vec<NamedArray>>> {
    let damaged = || io::Error::from(io::ErrorKind::UnexpectedEof);
    let mut variables = Vec::new();
    while let Some((tag, rest)) = elements.split_at_checked(8) {
        let [of, length] = [&tag[..4], &tag[4..]].map(|bytes| {
            bytes
                .iter()
                .rev()
                .fold(0_u32, |number, byte| number << 8 | u32::from(*byte))
        });
        let length = length as usize;
        let (content, rest) = rest.split_at_checked(length).ok_or_else(damaged)?;
        let mut file = header.to_vec();
        let padding = match of {
            COMPRESSED => {
                ZlibDecoder::new(content).take(left + 1).read_to_end(&mut file)?;
                0
            }
            MATRIX => {
                file.extend(tag);
                file.extend(content);
                length.next_multiple_of(8) - length
            }
            _ => return Err(damaged()),
        };
        elements = rest.get(padding..).unwrap_or_default();
        let Some(after) = left.checked_sub((file.len() - HEADER) as u64) else {
            return Ok(None);
        };
        left = after;
        if let Ok(read) = MatFile::read_bytes(&file) {
            variables.extend(read.arrays);
        }
    }
    Ok(Some(variables))
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use flate2::Compression;
    use flate2::write::ZlibEncoder;
    use mat5::{DenseMatrix, Values};

    use super::*;
    use crate::testing;

    fn array(name: &str, [rows, cols]: [usize; 2], values: Vec<f64>) -> NamedArray {
        let values = Values::F64(values);
        NamedArray {
            name: name.to_owned(),
            matrix: Matrix::Dense(DenseMatrix { rows, cols, values }),
        }
    }

    fn file(arrays: Vec<NamedArray>) -> Vec<u8> {
        let header_text = "MATLAB 5.0 MAT-file".to_owned();
        MatFile { header_text, arrays }.write_bytes().unwrap()
    }

    fn read(bytes: &[u8], force: Option<&str>) -> Result<Waveform, String> {
        let choice = Choice {
            force: force.map(|force| force.parse().unwrap()),
            ..Choice::default()
        };
        testing::read(bytes, &choice)
    }

    fn ramp() -> Vec<f64> {
        (0..30).map(|row| f64::from((row - 10).max(0))).collect()
    }

    #[test]
    fn vectors_are_columns_by_their_names_and_matrices_by_their_columns() {
        let times = (0..30).map(f64::from).collect::<Vec<_>>();
        let vectors = file(vec![
            array("height_m", [1, 1], vec![0.1]),
            array("time_ms", [30, 1], times.clone()),
            array("force_n", [1, 30], ramp()),
        ]);
        let force = read(&vectors, None).unwrap().force.unwrap();
        assert!((force.last() - 19.0).abs() < 1e-12 && (force.end() - 29e-3).abs() < 1e-12);
        // Column and row vectors, beside the time from row to row.
        let upright = [times.clone(), ramp()].concat();
        let lying = times
            .iter()
            .zip(ramp())
            .flat_map(|(time, force)| [*time, force])
            .collect();
        for (size, values) in [([30, 2], upright), ([2, 30], lying)] {
            let bytes = file(vec![
                array("m", size, values),
                array(INTERVAL, [1, 1], vec![1e-3]),
            ]);
            let force = read(&bytes, Some("m_2:N")).unwrap().force.unwrap();
            assert!((force.last() - 19.0).abs() < 1e-12 && (force.end() - 29e-3).abs() < 1e-12);
        }
    }

    #[test]
    fn damaged_files_and_those_without_numbers_are_refused_in_a_line() {
        let whole = file(vec![array("force_n", [30, 1], ramp())]);
        let mut other_order = whole.clone();
        other_order[HEADER - 4..HEADER].copy_from_slice(b"\x01\x00MI");
        for (bytes, part) in [
            (&whole[..whole.len() - 9], "is a damaged MAT-file"),
            (&whole[..HEADER], "has no vector or matrix of real numbers"),
            (&other_order, "of a big-endian computer"),
            (&whole, "has no column of time"),
        ] {
            let error = read(bytes, None).unwrap_err();
            assert!(error.contains(part) && error.lines().count() == 1, "{error}");
        }
    }

    #[test]
    fn an_element_that_unpacks_to_too_much_ends_the_reading() {
        let whole = file(vec![array("zeros", [1000, 1], vec![0.0; 1000])]);
        let (header, element) = whole.split_at(HEADER);
        let mut packed = ZlibEncoder::new(Vec::new(), Compression::best());
        packed.write_all(element).unwrap();
        let packed = packed.finish().unwrap();
        let tag = [COMPRESSED, packed.len() as u32].map(u32::to_le_bytes).concat();
        let elements = [tag, packed].concat();
        for (left, are_read) in [(element.len() as u64, true), (element.len() as u64 - 1, false)] {
            assert_eq!(variables(header, &elements, left).unwrap().is_some(), are_read);
        }
    }
}
