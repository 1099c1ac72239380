//! Forms of files that are recognised but not read, each with a way to convert it to one that is.

/// Number of bytes that identify the form of a file.
pub(super) const HEAD: u64 = 600;

/// The first bytes of each form, with the end of a sentence that begins with the file's name.
const FORMS: [(&[u8], &str); 8] = [
    (
        b"MATLAB 7.3",
        "is a MAT-file of level 7.3, which is HDF5; save it with save(…, '-v7')",
    ),
    (
        b"\x89HDF\r\n\x1a\n",
        "is HDF5; save its columns as Parquet, .npy or CSV",
    ),
    (
        b"TDSm",
        "is a TDMS file; export it from LabVIEW as CSV, or convert it: TdmsFile.read(F).as_dataframe().to_parquet(G) with \
         Python's nptdms",
    ),
    (
        b"TDSh",
        "is the index of a TDMS file, without its numbers; export the file itself as CSV",
    ),
    (b"    -1\n", UNIVERSAL),
    (b"    -1\r\n", UNIVERSAL),
    (
        b"//YOKOGAWA",
        "is the header of a Yokogawa .WVF file; save the record as CSV on the instrument, or in its program",
    ),
    (
        b"PK\x03\x04",
        "is a ZIP archive, as .npz and .xlsx are; unpack it, or save the sheet as CSV",
    ),
];

const UNIVERSAL: &str =
    "is a Universal File (UFF 58); convert it to CSV or .npy, for example with Python's pyuff";

/// The reason why a file that begins with `head` is not read, if its form is known.
pub(super) fn reason(head: &[u8]) -> Option<&'static str> {
    let form = FORMS.iter().find(|(beginning, _)| head.starts_with(beginning))?;
    Some(form.1)
}

#[cfg(test)]
mod tests {
    use crate::Choice;
    use crate::testing::read;

    #[test]
    fn a_known_form_is_named_with_a_way_to_one_that_is_read() {
        for (head, part) in [
            ("MATLAB 7.3 MAT-file, Platform: GLNXA64", "'-v7'"),
            ("\u{89}HDF\r\n\u{1a}\n", "is HDF5"),
            ("TDSm\u{e}\0\0\0", "nptdms"),
            ("TDSh\u{e}\0\0\0", "the file itself"),
            ("    -1\r\n    58\r\n", "pyuff"),
            ("    -1\n    58\n", "pyuff"),
            ("//YOKOGAWA ASCII FILE FORMAT", ".WVF"),
            ("PK\u{3}\u{4}\0", "ZIP archive"),
        ] {
            let bytes: Vec<u8> = head.chars().map(|c| c as u8).collect();
            let error = read(bytes, &Choice::default()).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
    }
}
