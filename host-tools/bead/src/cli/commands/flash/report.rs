//! The result of `bead flash`.

use crate::cli::commands::flash::image::ImageName;
use crate::cli::commands::prelude::*;

/// The result as JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct FlashReport {
    /// Device number of the part, of `DBGMCU_IDCODE`.
    pub(crate) part: u16,
    /// Level of the brown-out reset, 0 is off; null if the way does not show it.
    pub(crate) brown_out_level: Option<u8>,
    /// Level of the read protection.
    pub(crate) read_protection: u8,
    /// The image that was there; null if there was none with a name.
    pub(crate) before: Option<ImageName>,
    /// The image that is there now.
    pub(crate) after: ImageName,
    /// Sectors that were erased.
    pub(crate) sectors: Vec<u8>,
    /// Bytes that were written and compared.
    pub(crate) bytes: usize,
}

/// The report as a table.
pub(crate) fn table(report: &FlashReport) -> String {
    let FlashReport {
        part,
        brown_out_level,
        read_protection,
        before,
        after,
        sectors,
        bytes,
    } = report;
    let level = brown_out_level.map_or("not shown by the loader".to_owned(), |level| {
        format!("level {level}")
    });
    let before = before
        .as_ref()
        .map_or("none with a name".to_owned(), ToString::to_string);
    let sectors = Vec::from_iter(sectors.iter().map(ToString::to_string)).join(", ");
    output::rows([
        ("part", format!("{part:#x}")),
        ("brown-out reset", level),
        ("read protection", format!("level {read_protection}")),
        ("image before", before),
        ("image now", after.to_string()),
        ("flashed", format!("{bytes} bytes in sectors {sectors}, compared")),
    ])
}
