//! A picture of a terminal: the cells of a tmux pane as SVG.
//!
//! Letters are text, each run as wide as its cells. Dots of Braille and lines of boxes are drawn, since few
//! fonts have them in the width of a cell.

use std::fmt::Write;

const WIDTH: f64 = 8.4;
const HEIGHT: f64 = 17.0;
const INK: &str = "#d6dbe1";
const PAPER: &str = "#14181d";
/// Colours by the parameter of SGR: red to white.
const COLORS: [&str; 8] = [
    "#14181d", "#e06c75", "#98c379", "#e5c07b", "#61afef", "#c586d8", "#4fc3d9", "#d6dbe1",
];

#[derive(Clone, Copy, PartialEq)]
struct Look {
    ink: &'static str,
    is_bold: bool,
    is_reversed: bool,
    is_dim: bool,
}

const PLAIN: Look = Look {
    ink: INK,
    is_bold: false,
    is_reversed: false,
    is_dim: false,
};

impl Look {
    /// Takes the parameters of an SGR sequence, as `tmux capture-pane -e` prints them.
    fn set(&mut self, parameters: &str) {
        for parameter in parameters.split(';') {
            match parameter.parse().unwrap_or(0) {
                0 => *self = PLAIN,
                1 => self.is_bold = true,
                2 => self.is_dim = true,
                7 => self.is_reversed = true,
                color @ 30..=37 => self.ink = COLORS[color - 30],
                39 => self.ink = INK,
                _ => {}
            }
        }
    }
}

/// The cells of a pane, a row for each line.
fn cells(pane: &str) -> Vec<Vec<(char, Look)>> {
    let mut look = PLAIN;
    let row = |line: &str| {
        let (mut row, mut rest) = (Vec::new(), line);
        while let Some(letter) = rest.chars().next() {
            if let Some(sequence) = rest.strip_prefix("\u{1b}[") {
                let end = sequence
                    .find(|letter: char| letter.is_ascii_alphabetic())
                    .unwrap();
                look.set(&sequence[..end]);
                rest = &sequence[end + 1..];
            } else {
                row.push((letter, look));
                rest = &rest[letter.len_utf8()..];
            }
        }
        row
    };
    pane.lines().map(row).collect()
}

/// The picture of a pane with so many columns.
pub(crate) fn svg(pane: &str, columns: usize) -> String {
    let rows = cells(pane);
    let (width, height) = (columns as f64 * WIDTH + 24.0, rows.len() as f64 * HEIGHT + 24.0);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" font-family=\"ui-monospace, \
         'DejaVu Sans Mono', Menlo, Consolas, monospace\" font-size=\"13.5\">\n\
         <rect width=\"100%\" height=\"100%\" rx=\"8\" fill=\"{PAPER}\"/>\n"
    );
    for (place, row) in rows.iter().enumerate() {
        let y = 12.0 + place as f64 * HEIGHT;
        let mut x = 12.0;
        for run in row.chunk_by(|one, other| one.1 == other.1 && is_drawn(one.0) == is_drawn(other.0)) {
            let length = run.len() as f64 * WIDTH;
            draw(&mut out, run, x, y, length);
            x += length;
        }
    }
    out + "</svg>\n"
}

fn draw(out: &mut String, run: &[(char, Look)], x: f64, y: f64, length: f64) {
    let look = run[0].1;
    let ink = if look.is_reversed {
        writeln!(
            out,
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{length:.1}\" height=\"{HEIGHT}\" fill=\"{INK}\"/>"
        )
        .unwrap();
        PAPER
    } else {
        look.ink
    };
    if is_drawn(run[0].0) {
        for (place, (letter, _)) in run.iter().enumerate() {
            draw_letter(out, *letter, x + place as f64 * WIDTH, y, ink);
        }
        return;
    }
    let text: String = run.iter().map(|(letter, _)| letter).collect();
    let shown = text.trim_end();
    if shown.is_empty() {
        return;
    }
    let shown_length = shown.chars().count() as f64 * WIDTH;
    let weight = if look.is_bold { " font-weight=\"bold\"" } else { "" };
    let opacity = if look.is_dim { " opacity=\"0.65\"" } else { "" };
    let escaped = shown.replace('&', "&amp;").replace('<', "&lt;");
    writeln!(
        out,
        "<text x=\"{x:.1}\" y=\"{:.1}\" fill=\"{ink}\" textLength=\"{shown_length:.1}\" \
         xml:space=\"preserve\"{weight}{opacity}>{escaped}</text>",
        y + 13.0
    )
    .unwrap();
}

fn is_drawn(letter: char) -> bool {
    matches!(letter, '\u{2500}'..='\u{257f}' | '\u{2800}'..='\u{28ff}')
}

fn draw_letter(out: &mut String, letter: char, x: f64, y: f64, ink: &str) {
    let (middle, half) = (x + 0.5 * WIDTH, y + 0.5 * HEIGHT);
    if letter >= '\u{2800}' {
        // Bits of the dots, by row and column (Unicode, chapter 21.1).
        let bits = u32::from(letter) - 0x2800;
        let dots = [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1), (3, 0), (3, 1)];
        for (bit, (row, column)) in dots.into_iter().enumerate() {
            if bits >> bit & 1 == 1 {
                let (dot_x, dot_y) = (
                    x + (0.25 + 0.5 * f64::from(column)) * WIDTH,
                    y + (0.125 + 0.25 * f64::from(row)) * HEIGHT,
                );
                writeln!(
                    out,
                    "<circle cx=\"{dot_x:.1}\" cy=\"{dot_y:.1}\" r=\"1.5\" fill=\"{ink}\"/>"
                )
                .unwrap();
            }
        }
        return;
    }
    let (left, right, top, bottom) = (x, x + WIDTH, y, y + HEIGHT);
    let path = match letter {
        '─' => format!("M{left:.1} {half:.1}H{right:.1}"),
        '│' => format!("M{middle:.1} {top:.1}V{bottom:.1}"),
        '┌' => format!("M{middle:.1} {bottom:.1}V{half:.1}H{right:.1}"),
        '┐' => format!("M{middle:.1} {bottom:.1}V{half:.1}H{left:.1}"),
        '└' => format!("M{middle:.1} {top:.1}V{half:.1}H{right:.1}"),
        '┘' => format!("M{middle:.1} {top:.1}V{half:.1}H{left:.1}"),
        other => panic!("no line for {other}"),
    };
    writeln!(
        out,
        "<path d=\"{path}\" fill=\"none\" stroke=\"{ink}\" opacity=\"0.55\"/>"
    )
    .unwrap();
}
