//! Files compressed by gzip.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

use flate2::bufread::MultiGzDecoder;
use tempfile::NamedTempFile;

use crate::error::WaveformError;

/// Greatest size of an unpacked file, bytes. Ten million rows of text with four columns take half of that.
const MOST: u64 = 1 << 30;

/// Unpacks a file into a temporary file.
///
/// # Errors
/// The file is damaged, or holds more than a gibibyte.
pub(super) fn unpack(path: &Path) -> Result<NamedTempFile, WaveformError> {
    let unread = WaveformError::unread(path);
    let packed = BufReader::new(File::open(path).map_err(&unread)?);
    let mut unpacked = NamedTempFile::new().map_err(&unread)?;
    let bytes = io::copy(&mut MultiGzDecoder::new(packed).take(MOST + 1), &mut unpacked);
    match bytes {
        Ok(bytes) if bytes > MOST => Err(WaveformError::unfit(
            path,
            "is larger than 1 GiB when unpacked; save only the strike",
        )),
        Ok(_) => Ok(unpacked),
        Err(error) if error.raw_os_error().is_some() => Err(unread(error)),
        Err(error) => Err(WaveformError::unfit(
            path,
            format!("is a damaged gzip file: {error}; save it again"),
        )),
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use flate2::Compression;
    use flate2::write::GzEncoder;

    use crate::Choice;
    use crate::testing::read;

    fn packed(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    }

    fn table() -> String {
        let row = |n: i32| format!("{n},{}\n", f64::from((n - 10).max(0)) * 0.1);
        "t (ms),F (N)\n".to_owned() + &(0..30).map(row).collect::<String>()
    }

    #[test]
    fn a_packed_table_is_read_also_in_several_members() {
        let table = table();
        let (head, rest) = table.split_at(100);
        for bytes in [
            packed(table.as_bytes()),
            [packed(head.as_bytes()), packed(rest.as_bytes())].concat(),
        ] {
            let force = read(&bytes, &Choice::default()).unwrap().force.unwrap();
            assert!((force.last() - 1.9).abs() < 1e-12);
        }
    }

    #[test]
    fn a_damaged_file_is_refused_by_its_own_name() {
        let whole = packed(table().as_bytes());
        let mut flipped = whole.clone();
        let checksum = flipped.len() - 8;
        flipped[checksum] ^= 1;
        let short = packed(b"t (ms),F (N)\n1,2\n");
        for (bytes, begin) in [
            (&whole[..whole.len() - 12], "F: is a damaged gzip file: "),
            (&flipped, "F: is a damaged gzip file: "),
            (&short, "F: has 1 lines of numbers"),
        ] {
            let error = read(bytes, &Choice::default()).unwrap_err();
            assert!(error.starts_with(begin), "{error}");
        }
    }
}
