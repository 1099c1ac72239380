//! A drawing as pixels: PNG, and GIF for charts that follow one another. The drawing is the same as in the
//! SVG.

use std::fmt::Display;

use hertz_charts::Chart;
use hertz_charts::Error;
use rayon::prelude::*;
use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg;

use crate::drawing::Drawing;

/// Pixels of a PNG for each pixel of the chart: 560 dots an inch for a chart of a column's width.
const PRINT: f32 = 4.0;
/// Pixels of a PNG a metre, so that a chart of a column's width is 86 mm wide.
const DENSITY: u32 = 22_326;
/// Pixels of an animation for each pixel of the chart.
const SCREEN: f32 = 1.5;

/// A PNG of four times the drawing's size in pixels: the same drawing in its light colours, with the text set
/// in a font of this program, so that it looks the same everywhere.
///
/// # Errors
/// The drawing cannot be shown as pixels.
pub(crate) fn png(drawing: &Drawing) -> Result<Vec<u8>, Error> {
    let pixels = pixels(drawing, PRINT)?;
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, pixels.width(), pixels.height());
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_pixel_dims(Some(png::PixelDimensions {
        xppu: DENSITY,
        yppu: DENSITY,
        unit: png::Unit::Meter,
    }));
    // The paper is opaque, so no colour has been multiplied by less than 1.
    let written = encoder
        .write_header()
        .and_then(|mut writer| writer.write_image_data(pixels.data()));
    written.map_err(|reason| drawing.refused(" as PNG", reason))?;
    Ok(bytes)
}

/// The pixels of [`png()`] at any scale.
fn pixels(drawing: &Drawing, scale: f32) -> Result<Pixmap, Error> {
    let refused = |reason: &dyn Display| drawing.refused(" as pixels", reason);
    let tree = usvg::Tree::from_str(&drawing.svg, &drawing.options()).map_err(|error| refused(&error))?;
    let [width, height] =
        [tree.size().width(), tree.size().height()].map(|size| (size * scale).ceil() as u32);
    let mut pixels = Pixmap::new(width, height).ok_or_else(|| refused(&"it has no extent"))?;
    resvg::render(&tree, Transform::from_scale(scale, scale), &mut pixels.as_mut());
    Ok(pixels)
}

/// Duration of a frame, in hundredths of a second.
const FRAME: u16 = 12;

/// The charts as an animation that repeats for ever.
///
/// # Errors
/// As [`Chart::inline_svg`], or there is no chart.
pub(crate) fn gif(charts: &[Chart]) -> Result<Vec<u8>, Error> {
    let what = charts.first().map_or("", |chart| chart.description.as_str());
    let refused = |reason: &dyn Display| Error::new(what, " as an animation", reason);
    let images = charts
        .par_iter()
        .map(|chart| {
            let pixels = pixels(&Drawing::of(chart)?, SCREEN)?;
            let size = |pixels: u32| u16::try_from(pixels).map_err(|error| refused(&error));
            let (width, height) = (size(pixels.width())?, size(pixels.height())?);
            let mut image = gif::Frame::from_rgba_speed(width, height, &mut pixels.take(), 10);
            image.delay = FRAME;
            Ok(image)
        })
        .collect::<Result<Vec<_>, Error>>()?;
    let first = images.first().ok_or_else(|| refused(&"it has no frame"))?;
    let mut encoder =
        gif::Encoder::new(Vec::new(), first.width, first.height, &[]).map_err(|error| refused(&error))?;
    let written = encoder
        .set_repeat(gif::Repeat::Infinite)
        .and_then(|()| images.iter().try_for_each(|image| encoder.write_frame(image)))
        .and_then(|()| encoder.into_inner());
    written.map_err(|error| refused(&error))
}
