//! The picture: what the page shows, in cells.

use std::sync::Arc;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Axis, Block, Chart, Dataset, GraphType, Paragraph};

use crate::model::{BeadView, Monitor, MonitorView};
use crate::strike::{Curves, ShownStrike};
use crate::terminal::keys::Keys;

/// The least size of the whole page. A smaller window gets only the numbers.
const WHOLE: (u16, u16) = (72, 20);
/// Greatest number of beads in the table; the chosen one is among them.
const BEADS: usize = 10;
/// Lines for losses and messages.
const LINES: u16 = 3;
/// Least height of the curves, and of the history below them.
const CURVES: u16 = 7;
const HISTORY: u16 = 2;

/// The content of one picture.
pub(super) struct Content {
    view: MonitorView,
    /// Place of the chosen bead.
    chosen: usize,
    /// The strikes of the chosen bead, the newest first.
    strikes: Vec<Arc<ShownStrike>>,
}

impl Content {
    /// The state now. A choice beyond the last bead becomes the last one, and one beyond the oldest strike
    /// the oldest.
    pub(super) fn of(monitor: &mut Monitor, keys: &mut Keys) -> Self {
        let view = monitor.view();
        keys.bead = keys.bead.min(view.beads.len().saturating_sub(1));
        let bead = view.beads.get(keys.bead).map(|bead| bead.bead);
        let strikes: Vec<_> = bead.map_or_else(Vec::new, |bead| monitor.strikes_of(bead));
        keys.back = keys.back.min(strikes.len().saturating_sub(1));
        Self {
            view,
            chosen: keys.bead,
            strikes,
        }
    }

    /// Address of the chosen bead, if there is one.
    pub(super) fn bead(&self) -> Option<u8> {
        self.chosen_bead().map(|bead| bead.bead)
    }

    fn chosen_bead(&self) -> Option<&BeadView> {
        self.view.beads.get(self.chosen)
    }
}

/// Styles. Without colours they are only attributes.
#[derive(Clone, Copy)]
struct Look {
    has_colours: bool,
}

impl Look {
    fn colour(self, colour: Color) -> Style {
        if self.has_colours {
            Style::new().fg(colour)
        } else {
            Style::new()
        }
    }

    fn warning(self) -> Style {
        self.colour(Color::Yellow).add_modifier(Modifier::BOLD)
    }

    fn chosen(self) -> Style {
        Style::new().add_modifier(Modifier::REVERSED)
    }

    fn head(self) -> Style {
        self.colour(Color::Cyan).add_modifier(Modifier::BOLD)
    }
}

/// Draws the page.
pub(super) fn draw(frame: &mut Frame<'_>, content: &Content, keys: &Keys, has_colours: bool) {
    let look = Look { has_colours };
    let area = frame.area();
    if area.width < WHOLE.0 || area.height < WHOLE.1 {
        return draw_small(frame, content, keys, look);
    }
    let beads = content.view.beads.len().clamp(1, BEADS) as u16;
    // Every part keeps its least height; the curves get the rest, up to a third of the window.
    let fixed = 1 + (1 + beads) + 3 + LINES + 1;
    let free = area.height.saturating_sub(fixed + HISTORY);
    let curves = free.clamp(CURVES.min(free), (area.height / 3).max(CURVES));
    let parts = [
        Constraint::Length(1),
        Constraint::Length(1 + beads),
        Constraint::Length(3),
        Constraint::Length(curves),
        Constraint::Min(0),
        Constraint::Length(LINES),
        Constraint::Length(1),
    ];
    let [title, table, strike, charts, history, lines, bottom] = Layout::vertical(parts).areas(area);
    let shown = content.strikes.get(keys.back);
    frame.render_widget(title_line(&content.view, look), title);
    frame.render_widget(Paragraph::new(bead_lines(content, look)), table);
    frame.render_widget(Paragraph::new(strike_lines(content, shown, look)), strike);
    draw_curves(frame, charts, shown.and_then(|strike| strike.curves()), look);
    let rows = history_lines(content, keys.back, history.height, look);
    frame.render_widget(Paragraph::new(rows), history);
    frame.render_widget(Paragraph::new(loss_lines(content, look)), lines);
    frame.render_widget(key_line(keys, bottom.width, look), bottom);
}

/// Only the numbers, one in a line, as far as they fit.
fn draw_small(frame: &mut Frame<'_>, content: &Content, keys: &Keys, look: Look) {
    let area = frame.area();
    let mut lines = Vec::new();
    if keys.typed.is_none() {
        lines.push(Line::styled("q quit, ←→ bead", look.head()));
    } else {
        lines.push(key_line(keys, area.width, look));
    }
    if let Some(bead) = content.chosen_bead() {
        lines.push(Line::from(format!("bead {}, {}", bead.bead, state(bead))));
        if let Some(strike) = content.strikes.get(keys.back) {
            lines.push(Line::from(format!("A {} nJ", strike.measured())));
            lines.push(Line::from(format!("B {} nJ", strike.predicted())));
            lines.push(Line::from(format!("{:.3} N", strike.peak_force_n)));
            lines.push(Line::from(format!("strike {}", strike.strike)));
            lines.extend(
                strike
                    .flags
                    .iter()
                    .map(|flag| Line::styled(flag.clone(), look.warning())),
            );
        } else {
            lines.push(Line::from("no strike yet"));
        }
        lines.extend(
            bead.losses
                .iter()
                .map(|loss| Line::from(format!("{} {}", loss.count, loss.cause))),
        );
    } else {
        lines.push(Line::from("no bead yet"));
    }
    lines.push(Line::from("widen: 80x24"));
    frame.render_widget(Paragraph::new(lines), area);
}

fn title_line(view: &MonitorView, look: Look) -> Line<'static> {
    let rate = match view.bytes_per_s {
        rate @ ..1000 => format!("{rate} B/s"),
        rate => format!("{:.1} kB/s", rate as f64 * 1e-3),
    };
    Line::from(vec![
        Span::styled("bead monitor", look.head()),
        Span::raw(format!("  {}  {rate}  {} strikes", view.recording, view.strikes)),
    ])
}

/// State of a bead in a word or two.
fn state(bead: &BeadView) -> String {
    match (bead.silent_s, bead.armed) {
        (Some(seconds), _) => format!("silent {seconds} s"),
        (None, Some(true)) => "armed".to_owned(),
        (None, Some(false)) => "disarmed".to_owned(),
        (None, None) => "-".to_owned(),
    }
}

fn bead_lines(content: &Content, look: Look) -> Vec<Line<'static>> {
    let head = format!(
        "{:>5} {:<11} {:>7} {:>8} {:>6} {:>7} {:>15} {}",
        "bead", "state", "strikes", "frames", "lost", "supply", "clock/ppm", "health"
    );
    let mut lines = vec![Line::styled(head, look.head())];
    if content.view.beads.is_empty() {
        lines.push(Line::from("  nothing has come from a bead yet"));
    }
    let first = (content.chosen + 1).saturating_sub(BEADS);
    let shown = content.view.beads.iter().enumerate().skip(first).take(BEADS);
    lines.extend(shown.map(|(place, bead)| {
        let lost: u64 = bead.losses.iter().map(|loss| loss.count).sum();
        let supply = bead
            .supply_v
            .map_or("-".to_owned(), |volts| format!("{volts:.3} V"));
        let clock = bead
            .clock_ppm
            .map_or("-".to_owned(), |[ppm, within]| format!("{ppm:+.1} ± {within:.1}"));
        let health = if bead.standing.is_empty() {
            bead.last_fault.clone().unwrap_or_else(|| "good".to_owned())
        } else {
            bead.standing.join(", ")
        };
        let line = format!(
            "{:>5} {:<11} {:>7} {:>8} {lost:>6} {supply:>7} {clock:>15} {health}",
            bead.bead,
            state(bead),
            bead.strikes,
            bead.frames
        );
        let is_well = bead.standing.is_empty() && bead.last_fault.is_none() && bead.silent_s.is_none();
        let style = match (place == content.chosen, is_well) {
            (true, _) => look.chosen(),
            (false, true) => Style::new(),
            (false, false) => look.warning(),
        };
        Line::styled(line, style)
    }));
    lines
}

fn strike_lines(content: &Content, shown: Option<&Arc<ShownStrike>>, look: Look) -> Vec<Line<'static>> {
    let Some(strike) = shown else {
        let of = content
            .bead()
            .map_or(String::new(), |bead| format!(" of bead {bead}"));
        return vec![Line::default(), Line::from(format!("no strike{of} yet"))];
    };
    let at = strike.at_s.map_or(String::new(), |at| format!(" at {at:.5} s"));
    let fetched = if strike.fetched { ", fetched" } else { "" };
    let flags = if strike.flags.is_empty() {
        Span::raw("no flags")
    } else {
        Span::styled(strike.flags.join(", "), look.warning())
    };
    let title = format!("strike {} of bead {}{at}{fetched}: ", strike.strike, strike.bead);
    let residual = strike
        .residual
        .map_or(String::new(), |part| format!("residual {:.2} %", 100.0 * part));
    let [low, high] = strike.acceleration;
    vec![
        Line::from(vec![Span::styled(title, look.head()), flags]),
        Line::from(format!(
            "A {} nJ   B {} nJ   {residual}",
            strike.measured(),
            strike.predicted()
        )),
        Line::from(format!(
            "peak {} N   {low:+.1} to {high:+.1} m/s²   {} samples missing",
            strike.peak(),
            strike.missing
        )),
    ]
}

fn draw_curves(frame: &mut Frame<'_>, area: Rect, curves: Option<&Curves>, look: Look) {
    let Some(curves) = curves else {
        let why = "no curves: settings or samples of this strike have not arrived";
        return frame.render_widget(Paragraph::new(why), area);
    };
    let thirds = Layout::horizontal([Constraint::Fill(1); 3]).areas::<3>(area);
    for (area, (name, unit, values, colour)) in thirds.into_iter().zip([
        ("force", "N", &curves.force_n, Color::Green),
        ("acceleration", "m/s²", &curves.acceleration, Color::Magenta),
        ("residual", "m/s²", &curves.residual, Color::Yellow),
    ]) {
        let points: Vec<(f64, f64)> = (0..)
            .zip(values)
            .map(|(place, value)| {
                let at = curves.from_ms + f64::from(place) * curves.step_ms;
                (at, f64::from(*value))
            })
            .collect();
        let [first, last] = [points.first(), points.last()].map(|point| point.map_or(0.0, |point| point.0));
        let (low, high) = points.iter().fold((0.0_f64, 0.0_f64), |(low, high), (_, value)| {
            (low.min(*value), high.max(*value))
        });
        let high = if high > low { high } else { low + 1.0 };
        let dataset = Dataset::default()
            .marker(Marker::Braille)
            .graph_type(GraphType::Line)
            .style(look.colour(colour))
            .data(&points);
        let title = format!("{name} {} to {}", three_digits(low), three_digits(high));
        let time = format!("{unit} over {first:.1} to {last:.1} ms");
        let chart = Chart::new(vec![dataset])
            .block(
                Block::bordered()
                    .title(title)
                    .title_bottom(Line::from(time).right_aligned()),
            )
            .x_axis(Axis::default().bounds([first, last]))
            .y_axis(Axis::default().bounds([low, high]));
        frame.render_widget(chart, area);
    }
}

/// A value with some three digits.
fn three_digits(value: f64) -> String {
    match value.abs() {
        ..10.0 => format!("{value:.2}"),
        ..100.0 => format!("{value:.1}"),
        _ => format!("{value:.0}"),
    }
}

/// The strikes of the chosen bead about the shown one, the newest first.
fn history_lines(content: &Content, back: usize, height: u16, look: Look) -> Vec<Line<'static>> {
    let rows = usize::from(height).saturating_sub(1);
    let first = (back + 1).saturating_sub(rows);
    let head = format!(
        "{:>6} {:>11} {:>9} {:>19} {:>19}  {}",
        "strike", "time/s", "peak/N", "A/nJ", "B/nJ", "flags"
    );
    let line = |(place, strike): (usize, &Arc<ShownStrike>)| {
        let at = strike.at_s.map_or("-".to_owned(), |at| format!("{at:.5}"));
        let text = format!(
            "{:>6} {at:>11} {:>9.4} {:>19} {:>19}  {}",
            strike.strike,
            strike.peak_force_n,
            strike.measured(),
            strike.predicted(),
            strike.flags.join(", ")
        );
        Line::styled(
            text,
            if place == back {
                look.chosen()
            } else {
                Style::new()
            },
        )
    };
    let shown = content.strikes.iter().enumerate().skip(first).take(rows);
    [Line::styled(head, look.head())]
        .into_iter()
        .chain(shown.map(line))
        .collect()
}

/// Losses of the chosen bead by cause, and the newest messages below them.
fn loss_lines(content: &Content, look: Look) -> Vec<Line<'static>> {
    let losses = content.chosen_bead().map_or(&[][..], |bead| &bead.losses[..]);
    let of = content
        .bead()
        .map_or(String::new(), |bead| format!(" of bead {bead}"));
    let first = if losses.is_empty() {
        Line::from(format!("losses{of}: none"))
    } else {
        let each = losses.iter().map(|loss| format!("{} {}", loss.count, loss.cause));
        Line::styled(
            format!("losses{of}: {}", each.collect::<Vec<_>>().join(", ")),
            look.warning(),
        )
    };
    let messages = &content.view.messages;
    let rest = messages.len().saturating_sub(usize::from(LINES) - 1);
    let newest = messages[rest..].iter().map(|line| Line::from(line.clone()));
    [first].into_iter().chain(newest).collect()
}

fn key_line(keys: &Keys, width: u16, look: Look) -> Line<'static> {
    match &keys.typed {
        Some(typed) => {
            // The end of a long note, where it is being typed.
            let head = "note KEY=VALUE: ";
            let room = usize::from(width).saturating_sub(head.len() + 1);
            let skipped = typed.chars().count().saturating_sub(room);
            let end: String = typed.chars().skip(skipped).collect();
            Line::from(vec![
                Span::styled(head, look.head()),
                Span::raw(format!("{end}_")),
            ])
        }
        None => Line::styled(
            "q quit   ←→ bead   ↑↓ strike   Home newest   n note   a arm   d disarm   ±: 2u",
            look.chosen(),
        ),
    }
}

#[cfg(test)]
mod tests {
    use bead_recording::frames::FrameReader;
    use bead_testing::{Speaker, paper_settings};
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    use super::*;

    /// A monitor of a bead that was struck once: a pulse of 6 N and an intruder that rings.
    fn struck() -> Monitor {
        let mut bead = Speaker::at(7);
        let codes = (0..3000).map(|sample| {
            let at = f64::from(sample) - 2000.0;
            let force = 128.0 + 6.0 * 256.0 * (-(at / 20.0).powi(2)).exp();
            let ring = if at > 0.0 {
                800.0 * (at / 9.0).sin() * (-at / 80.0).exp()
            } else {
                0.0
            };
            [force as u16, 128, (2048.0 + ring) as u16, 2048].map(|code: u16| code + (sample % 2) as u16)
        });
        assert_eq!(bead.measure(&paper_settings(), codes), 1);
        let mut monitor = Monitor::new(vec!["port".to_owned()], "a.mcap".to_owned());
        FrameReader::default().feed(&bead.bytes, None, |item| monitor.push(0, &item));
        monitor
    }

    /// The lines of a picture of this size.
    fn drawn(monitor: &mut Monitor, size: (u16, u16), keys: &mut Keys, has_colours: bool) -> String {
        let mut terminal = Terminal::new(TestBackend::new(size.0, size.1)).unwrap();
        let content = Content::of(monitor, keys);
        terminal
            .draw(|frame| draw(frame, &content, keys, has_colours))
            .unwrap();
        let cells = &terminal.backend().buffer().content;
        let is_plain = cells
            .iter()
            .all(|cell| (cell.fg, cell.bg) == (Color::Reset, Color::Reset));
        assert!(has_colours || is_plain);
        let lines = cells.chunks(usize::from(size.0));
        let lines = lines.map(|line| line.iter().map(|cell| cell.symbol()).collect::<String>());
        lines.collect::<Vec<_>>().join("\n")
    }

    #[test]
    fn a_window_of_80_by_24_has_all_and_one_of_20_columns_has_the_numbers() {
        let mut monitor = struck();
        let a = monitor.strikes_of(7)[0].measured();
        for has_colours in [false, true] {
            let whole = drawn(&mut monitor, (80, 24), &mut Keys::default(), has_colours);
            for part in [
                "a.mcap",
                "strike 0 of bead 7",
                &a,
                "force",
                "residual",
                "losses of bead 7: none",
                "q quit",
            ] {
                assert!(whole.contains(part), "{part}: {whole}");
            }
            let is_curve = |letter: char| ('\u{2801}'..='\u{28ff}').contains(&letter);
            assert!(
                whole.chars().filter(|letter| is_curve(*letter)).count() > 60,
                "{whole}"
            );
        }
        let narrow = drawn(&mut monitor, (20, 8), &mut Keys::default(), false);
        for part in ["q quit", "bead 7", &format!("A {a}"), "strike 0"] {
            assert!(narrow.contains(part), "{part}: {narrow}");
        }
    }

    #[test]
    fn no_window_is_too_small_or_too_large_and_no_choice_leads_nowhere() {
        let (mut monitor, mut empty) = (struck(), Monitor::new(Vec::new(), String::new()));
        for width in [1, 2, 20, 71, 72, 300] {
            for height in [1, 2, 8, 19, 20, 21, 100] {
                let mut keys = Keys {
                    bead: 9,
                    back: 9,
                    typed: (width % 2 == 0).then(|| "operator=Ana".repeat(9)),
                };
                drawn(&mut monitor, (width, height), &mut keys, false);
                assert_eq!((keys.bead, keys.back), (0, 0));
                drawn(&mut empty, (width, height), &mut keys, false);
            }
        }
    }
}
