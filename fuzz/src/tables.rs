//! Tables of sweeps, read and drawn.

use bead_tables::Reader;
use hertz_sweep::picture::chart;
use hertz_sweep::view::View;

use crate::file;

/// Opens the bytes as a table.
///
/// # Panics
/// A table has more rows than it declares, or one of another width, or its chart is no picture.
pub fn check(bytes: &[u8]) {
    file::with(bytes, |path| {
        if let Ok(reader) = Reader::open(path) {
            let mut rows = 0;
            for batch in reader.all_batches().map_while(Result::ok) {
                for row in batch.into_rows() {
                    assert_eq!(row.len(), reader.columns().len());
                    rows += 1;
                }
            }
            assert!(rows <= reader.rows());
        }
        if let Ok(chart) = chart(path, &View::default()) {
            let picture = chart.standalone_svg().expect("what can be drawn is drawn");
            assert!(picture.chars().all(is_xml), "{picture:?}");
            for place in [" x=\"", " y=\"", " points=\""] {
                let values = picture.split(place).skip(1);
                let odd = |value: &str| value.contains("NaN") || value.contains("inf");
                assert!(
                    !values.filter_map(|value| value.split('"').next()).any(odd),
                    "{picture}"
                );
            }
        }
    });
}

/// Returns `true` if XML 1.0 allows this character.
fn is_xml(c: char) -> bool {
    matches!(c, '\t' | '\n' | '\r' | ' '..='\u{fffd}' | '\u{10000}'..)
}
