//! Saved pictures as a renderer without media queries and `var()` shows them: resvg, and so Typst.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use hertz_charts::{Axis, Chart, Ink, Map, Mark, Panel, Series};
use resvg::tiny_skia::{Pixmap, PremultipliedColorU8, Transform};
use resvg::usvg::{Options, Tree};

/// Fails unless the picture has a light background and at least `colours` colours on it.
fn assert_light(name: &str, svg: &str, colours: usize) {
    // Without fonts texts are left out, so that the colours counted are those of the curves.
    let tree = Tree::from_str(svg, &Options::default()).unwrap();
    let size = tree.size().to_int_size();
    let mut pixels = Pixmap::new(size.width(), size.height()).unwrap();
    resvg::render(&tree, Transform::default(), &mut pixels.as_mut());
    let corner = pixels.pixel(2, 2).unwrap();
    let least = corner.red().min(corner.green()).min(corner.blue());
    assert!(least > 240, "{name}: the background is {corner:?}");
    // In steps of 32, so that the edges of one line are not many colours.
    let coarse =
        |pixel: &PremultipliedColorU8| [pixel.red(), pixel.green(), pixel.blue()].map(|value| value / 32);
    let seen: BTreeSet<[u8; 3]> = pixels.pixels().iter().map(coarse).collect();
    // A black line on white shows only greys.
    let is_hue = |[red, green, blue]: &&[u8; 3]| red.abs_diff(*green) + green.abs_diff(*blue) > 1;
    let hues = seen.iter().filter(is_hue).count();
    assert!(hues >= colours, "{name}: {hues} hues, not {colours}");
}

fn curve(number: usize, mark: Mark) -> Series {
    let points = (0..50).map(|x| (f64::from(x), f64::from(x * x) / (number + 1) as f64));
    Series::new(format!("curve {number}"), Ink::Curve(number), mark, points)
}

#[test]
fn a_chart_and_a_map_keep_their_colours() {
    use Mark::{Broad, Dashed, Discs, Dots, Line, Rings};
    for mark in [Line, Broad, Dashed, Dots, Rings, Discs] {
        let panel = Panel::new("y", vec![curve(0, mark), curve(1, mark)]);
        let chart = Chart::new(Axis::new("x", 0.0..50.0), vec![panel]);
        assert_light(&format!("{mark:?}"), &chart.standalone_svg().unwrap(), 2);
    }
    let map = Map {
        label: "z".to_owned(),
        x_edges: vec![0.0, 1.0, 2.0],
        y_edges: vec![0.0, 1.0, 2.0],
        values: vec![0.0, 1.0, 2.0, 3.0],
    };
    let panel = Panel::new("y", Vec::new()).range(0.0, 2.0).map(map);
    let chart = Chart::new(Axis::new("x", 0.0..2.0), vec![panel]);
    assert_light("map", &chart.standalone_svg().unwrap(), 8);
}

/// A strike, a row of beads, figures of the paper, benchmarks and two drawings by hand.
#[test]
fn every_picture_of_the_docs_keeps_its_colours() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../docs/images"));
    let files = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    let is_picture = |path: &PathBuf| path.extension().is_some_and(|end| end == "svg");
    let pictures: Vec<_> = files.filter(is_picture).collect();
    assert!(pictures.len() > 9);
    for path in pictures {
        let svg = std::fs::read_to_string(&path).unwrap();
        assert_light(&path.display().to_string(), &svg, 2);
    }
}
