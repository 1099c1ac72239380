//! The cells of a terminal as a picture that looks alike in every browser: letters at their places, and what
//! fonts draw differently, dots of Braille and frames, as shapes.

use std::iter::Peekable;
use std::str::Chars;

/// Size of a cell, and the margin around all of them.
const WIDE: f64 = 8.0;
const HIGH: f64 = 17.0;
const MARGIN: f64 = 12.0;
const PAPER: &str = "#fdfdfc";
const INK: &str = "#24292f";
/// Colours 0 to 7 of a terminal with a light background, as the other pictures of the book have.
const COLOURS: [&str; 8] = [
    "#24292f", "#c0322b", "#1a7f37", "#8a5a00", "#0a58b8", "#7c3fbf", "#0f7480", "#6e7781",
];

#[derive(Clone, Copy, Default)]
struct Attributes {
    colour: Option<usize>,
    is_bold: bool,
    is_reversed: bool,
}

impl Attributes {
    /// Takes the numbers of a sequence "select graphic rendition" (ECMA-48, 8.3.117), up to its end.
    fn select(&mut self, letters: &mut Peekable<Chars<'_>>) {
        let numbers: String = letters
            .by_ref()
            .skip(1)
            .take_while(|letter| *letter != 'm')
            .collect();
        // Colours as 38;5;n are those of 30 + n.
        let numbers = numbers.replace("38;5;", "3");
        for number in numbers.split(';').map(|number| number.parse().unwrap_or(0)) {
            match number {
                0 => *self = Self::default(),
                1 => self.is_bold = true,
                7 => self.is_reversed = true,
                22 => self.is_bold = false,
                27 => self.is_reversed = false,
                colour @ 30..=37 => self.colour = Some(colour - 30),
                39 => self.colour = None,
                _ => {}
            }
        }
    }
}

/// Draws the cells of a terminal with this many columns, as `tmux capture-pane -e` prints them.
pub(crate) fn svg(cells: &str, columns: usize, title: &str) -> String {
    let lines = cells.lines().count();
    let (width, height) = (
        columns as f64 * WIDE + 2.0 * MARGIN,
        lines as f64 * HIGH + 2.0 * MARGIN,
    );
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         font-family=\"DejaVu Sans Mono, Menlo, Consolas, monospace\" font-size=\"13.3\">\n<title>{title}</title>\n\
         <rect width=\"100%\" height=\"100%\" rx=\"6\" fill=\"{PAPER}\"/>\n"
    );
    let mut attributes = Attributes::default();
    for (line, text) in cells.lines().enumerate() {
        let (mut letters, mut column) = (text.chars().peekable(), 0);
        while let Some(letter) = letters.next() {
            if letter == '\u{1b}' {
                attributes.select(&mut letters);
                continue;
            }
            let (x, y) = (MARGIN + column as f64 * WIDE, MARGIN + line as f64 * HIGH);
            cell(&mut out, letter, [x, y], attributes);
            column += 1;
        }
    }
    out + "</svg>\n"
}

fn cell(out: &mut String, letter: char, [x, y]: [f64; 2], attributes: Attributes) {
    let mut ink = attributes.colour.map_or(INK, |colour| COLOURS[colour]);
    if attributes.is_reversed {
        // A little wider, so that no gap is seen between two.
        let wide = WIDE + 0.3;
        *out +=
            &format!("<rect x=\"{x:.1}\" y=\"{y}\" width=\"{wide}\" height=\"{HIGH}\" fill=\"{ink}\"/>\n");
        ink = PAPER;
    }
    let (middle, centre) = (x + WIDE / 2.0, y + HIGH / 2.0);
    let mut stroke =
        |path: String| *out += &format!("<path d=\"{path}\" stroke=\"#7a8594\" fill=\"none\"/>\n");
    let [left, right, above, below] = [x, x + WIDE, y, y + HIGH];
    match letter {
        ' ' => {}
        '─' => stroke(format!("M{left:.1} {centre}H{right:.1}")),
        '│' => stroke(format!("M{middle:.1} {above}V{below}")),
        '┌' => stroke(format!("M{right:.1} {centre}H{middle:.1}V{below}")),
        '┐' => stroke(format!("M{left:.1} {centre}H{middle:.1}V{below}")),
        '└' => stroke(format!("M{right:.1} {centre}H{middle:.1}V{above}")),
        '┘' => stroke(format!("M{left:.1} {centre}H{middle:.1}V{above}")),
        '\u{2800}'..='\u{28ff}' => {
            // The order of the bits is that of the dots in Unicode: two columns of three, and a row below.
            let places = [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2), (0, 3), (1, 3)];
            let bits = u32::from(letter) - 0x2800;
            let set = places
                .into_iter()
                .enumerate()
                .filter(|(bit, _)| bits >> bit & 1 == 1);
            for (_, (across, down)) in set {
                let dot_x = x + WIDE * (f64::from(across) + 0.5) / 2.0;
                let dot_y = y + HIGH * (f64::from(down) + 0.5) / 4.0;
                *out += &format!("<circle cx=\"{dot_x:.1}\" cy=\"{dot_y:.1}\" r=\"1.4\" fill=\"{ink}\"/>\n");
            }
        }
        letter => {
            let text = match letter {
                '<' => "&lt;".to_owned(),
                '&' => "&amp;".to_owned(),
                letter => letter.to_string(),
            };
            let weight = if attributes.is_bold {
                " font-weight=\"bold\""
            } else {
                ""
            };
            let base = y + 0.75 * HIGH;
            *out += &format!("<text x=\"{x:.1}\" y=\"{base:.1}\" fill=\"{ink}\"{weight}>{text}</text>\n");
        }
    }
}
