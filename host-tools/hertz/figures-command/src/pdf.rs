//! A drawing as PDF of one page: lines as lines and text as text, for print.

use hertz_charts::Error;
use krilla::Document;
use krilla::geom::Size;
use krilla::page::PageSettings;
use krilla_svg::{SurfaceExt, SvgSettings};
use resvg::usvg;

use crate::drawing::Drawing;

/// Points of a page for each pixel of a drawing, so that a chart of a column's width is 86 mm wide.
const POINTS: f32 = 86.0 / 25.4 * 72.0 / 480.0;

/// A PDF whose page is the drawing, in its light colours and this program's font.
///
/// # Errors
/// The drawing cannot be shown on a page.
pub(crate) fn pdf(drawing: &Drawing) -> Result<Vec<u8>, Error> {
    const FORM: &str = " as PDF";
    let tree = usvg::Tree::from_str(&drawing.svg, &drawing.options())
        .map_err(|reason| drawing.refused(FORM, reason))?;
    let [width, height] = [tree.size().width(), tree.size().height()].map(|pixels| POINTS * pixels);
    let (Some(size), Some(settings)) = (Size::from_wh(width, height), PageSettings::from_wh(width, height))
    else {
        return Err(drawing.refused(FORM, "it has no extent"));
    };
    let mut document = Document::new();
    let mut page = document.start_page_with(settings);
    let mut surface = page.surface();
    let drawn = surface.draw_svg(&tree, size, SvgSettings::default());
    surface.finish();
    page.finish();
    drawn.ok_or_else(|| drawing.refused(FORM, "it cannot be drawn"))?;
    document
        .finish()
        .map_err(|reason| drawing.refused(FORM, format_args!("{reason:?}")))
}
