//! A chart or a plate as one drawing in its light colours, from which files without style sheets are made.

use std::fmt::Display;

use hertz_charts::{Chart, Error, Plate};
use resvg::usvg;

/// A drawing as SVG.
#[derive(Debug)]
pub(crate) struct Drawing {
    /// The content in words.
    description: String,
    /// The drawing, without a style sheet.
    pub(crate) svg: String,
}

impl Drawing {
    /// # Errors
    /// As [`Chart::inline_svg`].
    pub(crate) fn of(chart: &Chart) -> Result<Self, Error> {
        Ok(Self {
            description: chart.description.clone(),
            svg: chart.inline_svg()?,
        })
    }

    /// # Errors
    /// As [`Plate::plain_svg`].
    pub(crate) fn of_plate(plate: &Plate) -> Result<Self, Error> {
        Ok(Self {
            description: plate.description.clone(),
            svg: plate.plain_svg()?,
        })
    }

    /// Options for reading the drawing: text is set in this program's font.
    pub(crate) fn options(&self) -> usvg::Options<'static> {
        let mut options = usvg::Options::default();
        let fonts = options.fontdb_mut();
        fonts.load_font_data(dejavu::sans::regular().to_vec());
        fonts.set_sans_serif_family("DejaVu Sans");
        options
    }

    /// The error of a drawing that cannot have a form, such as ` as PNG`.
    pub(crate) fn refused(&self, form: &'static str, reason: impl Display) -> Error {
        Error::new(&self.description, form, reason)
    }
}
