//! The page on a terminal.
//!
//! # Design
//! The page is made of the cells of [`ratatui`], of which only those go out that changed. It marks by bold and
//! reversed text, so it needs no colour; where there is colour, curves have some (`NO_COLOR` is heeded). It
//! is laid out for 80 by 24, and gets shorter, down to a list of the beads, on less.

use std::io::{self, IsTerminal};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use bead_tables::printable::one_line;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style, Stylize};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Axis, Block, Chart, Dataset, GraphType, Paragraph, Row, Table};
use ratatui::{DefaultTerminal, Frame};

use crate::control::Control;
use crate::model::{BeadView, MonitorView, SharedMonitor};
use crate::strike::{Curves, ShownStrike};

/// Interval of the drawing, and longest delay of a key.
const BEAT: Duration = Duration::from_millis(200);
/// Least width and height of the whole page, in cells.
const WHOLE: (u16, u16) = (72, 20);
/// Number of beads in the list of the whole page.
const BEADS_MOST: usize = 5;
/// Longest note that can be typed, in characters.
const NOTE_MOST: usize = 200;

/// Returns the one line that says why no page can be drawn; `None` on a terminal.
pub fn refusal() -> Option<&'static str> {
    let is_terminal = io::stdout().is_terminal() && io::stdin().is_terminal();
    (!is_terminal).then_some(
        "this is no terminal, and the page needs one; run it in one, or give --web for a page in a browser, or use `bead \
         record` in a script",
    )
}

/// Shows the page until q is pressed, it is late, `stop` is set or the terminal is closed; then sets `stop`. The
/// terminal
/// is as before afterwards, also after a panic.
///
/// # Errors
/// The terminal cannot be drawn on. A closed one is no error.
pub fn show(
    monitor: &SharedMonitor,
    control: Option<&Control>,
    deadline: Option<Instant>,
    stop: &AtomicBool,
) -> io::Result<()> {
    let is_over =
        || stop.load(Ordering::Relaxed) || deadline.is_some_and(|deadline| Instant::now() >= deadline);
    let shown = ratatui::try_init().and_then(|mut terminal| run(&mut terminal, monitor, control, is_over));
    stop.store(true, Ordering::Relaxed);
    // A terminal that was closed needs no restoring.
    let _ = ratatui::try_restore();
    match shown {
        Err(error) if is_closed(&error) => Ok(()),
        shown => shown,
    }
}

fn is_closed(error: &io::Error) -> bool {
    use io::ErrorKind::{BrokenPipe, NotConnected, UnexpectedEof};
    // EIO is what a terminal gives that has hung up.
    matches!(error.kind(), BrokenPipe | NotConnected | UnexpectedEof) || error.raw_os_error() == Some(5)
}

fn run(
    terminal: &mut DefaultTerminal,
    monitor: &SharedMonitor,
    control: Option<&Control>,
    is_over: impl Fn() -> bool,
) -> io::Result<()> {
    let mut page = TerminalPage::default();
    while !is_over() {
        page.take(monitor);
        terminal.draw(|frame| page.draw(frame))?;
        let next = Instant::now() + BEAT;
        while let Some(left) = next.checked_duration_since(Instant::now()) {
            if is_over() || !event::poll(left)? {
                break;
            }
            let Event::Key(key) = event::read()? else { break };
            if key.kind == KeyEventKind::Press && page.press(key, monitor, control) {
                return Ok(());
            }
            page.take(monitor);
            terminal.draw(|frame| page.draw(frame))?;
        }
    }
    Ok(())
}

/// What the page shows, and what is being typed.
#[derive(Default)]
struct TerminalPage {
    view: Option<MonitorView>,
    /// Address of the bead whose strikes are shown.
    bead: Option<u8>,
    /// Its strikes, the newest last.
    strikes: Vec<Arc<ShownStrike>>,
    /// Steps back from the newest strike.
    back: usize,
    /// The note that is being typed.
    note: Option<String>,
    /// An answer to the last key.
    answer: Option<String>,
}

impl TerminalPage {
    fn take(&mut self, monitor: &SharedMonitor) {
        let mut monitor = monitor.lock();
        let view = monitor.view();
        let is_there = |bead: &u8| view.beads.iter().any(|view| view.bead == *bead);
        self.bead = self
            .bead
            .filter(is_there)
            .or(view.beads.first().map(|view| view.bead));
        let (mut strikes, _) = monitor.strikes_after(0);
        strikes.retain(|strike| Some(strike.bead) == self.bead);
        // The strike that is looked at stays while others come.
        if self.back > 0
            && let (Some(before), Some(now)) = (self.strikes.last(), strikes.last())
        {
            self.back += strikes
                .iter()
                .filter(|strike| strike.serial > before.serial && strike.bead == now.bead)
                .count();
        }
        self.back = self.back.min(strikes.len().saturating_sub(1));
        (self.view, self.strikes) = (Some(view), strikes);
    }

    /// Takes a key; true if the page is to end.
    fn press(&mut self, key: KeyEvent, monitor: &SharedMonitor, control: Option<&Control>) -> bool {
        let is_interrupt = key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
        if is_interrupt {
            return true;
        }
        self.answer = None;
        if let Some(mut note) = self.note.take() {
            match key.code {
                KeyCode::Esc => return false,
                KeyCode::Enter => {
                    let noted = control.map(|control| control.note(&note));
                    self.answer = noted.map(|noted| noted.unwrap_or_else(|why| why));
                    return false;
                }
                KeyCode::Backspace => _ = note.pop(),
                KeyCode::Char(letter) if note.chars().count() < NOTE_MOST => note.push(letter),
                _ => {}
            }
            self.note = Some(note);
            return false;
        }
        match key.code {
            KeyCode::Char('q') => return true,
            KeyCode::Char('n' | 'a' | 'd') if control.is_none() => {
                self.answer = Some(
                    "this follows a recording of another program: ask that one, or note it by `bead note`"
                        .to_owned(),
                );
            }
            KeyCode::Char('n') => self.note = Some(String::new()),
            KeyCode::Char(letter @ ('a' | 'd')) => {
                if let (Some(control), Some(bead)) = (control, self.bead) {
                    let asked = control.arm(&mut monitor.lock(), bead, letter == 'a');
                    self.answer = asked.err();
                }
            }
            KeyCode::Down | KeyCode::Char('j') | KeyCode::Tab => self.choose(1),
            KeyCode::Up | KeyCode::Char('k') | KeyCode::BackTab => self.choose(-1),
            KeyCode::Left | KeyCode::Char('h') => {
                self.back = (self.back + 1).min(self.strikes.len().saturating_sub(1));
            }
            KeyCode::Right | KeyCode::Char('l') => self.back = self.back.saturating_sub(1),
            _ => {}
        }
        false
    }

    /// Shows the bead that is `step` further down the list.
    fn choose(&mut self, step: isize) {
        let Some(view) = &self.view else { return };
        let count = view.beads.len() as isize;
        let now = view.beads.iter().position(|bead| Some(bead.bead) == self.bead);
        if let Some(now) = now {
            self.bead = Some(view.beads[(now as isize + step).rem_euclid(count) as usize].bead);
            self.back = 0;
        }
    }

    fn strike(&self) -> Option<&Arc<ShownStrike>> {
        self.strikes.iter().rev().nth(self.back)
    }

    fn draw(&self, frame: &mut Frame<'_>) {
        let Some(view) = &self.view else { return };
        let area = frame.area();
        if area.width < WHOLE.0 || area.height < WHOLE.1 {
            return self.draw_small(frame, view);
        }
        let beads = view.beads.len().clamp(1, BEADS_MOST) as u16;
        let [title, list, strike, charts, below, message, keys] = Layout::vertical([
            Constraint::Length(1),
            Constraint::Length(beads + 1),
            Constraint::Length(3),
            Constraint::Min(6),
            Constraint::Length(6),
            Constraint::Length(1),
            Constraint::Length(1),
        ])
        .areas(area);
        let head = format!(
            "{} strikes, {:.1} kB/s, {}",
            view.strikes,
            view.bytes_per_s as f64 * 1e-3,
            view.recording
        );
        let bar = Style::new().add_modifier(Modifier::REVERSED);
        let head = Line::from(vec![" bead monitor ".bold(), Span::raw(head)]);
        frame.render_widget(Paragraph::new(head).style(bar), title);
        self.draw_beads(frame, list, view);
        self.draw_strike(frame, strike);
        self.draw_curves(frame, charts);
        let [history, losses] =
            Layout::horizontal([Constraint::Min(44), Constraint::Length(34)]).areas(below);
        self.draw_history(frame, history);
        self.draw_losses(frame, losses, view);
        frame.render_widget(Paragraph::new(self.message(view)), message);
        let keys_line = match &self.note {
            Some(_) => " Enter write the note   Esc leave it",
            None => " up/down bead  left/right strike  n note  a arm  d disarm  q quit",
        };
        frame.render_widget(Paragraph::new(keys_line).style(bar), keys);
    }

    /// The line above the keys: what is being typed, an answer, or the newest message.
    fn message(&self, view: &MonitorView) -> String {
        if let Some(note) = &self.note {
            return format!(" note, as operator=Ana: {}_", one_line(note));
        }
        let answer = self.answer.as_deref();
        let newest = answer.or(view.messages.last().map(String::as_str));
        format!(" {}", one_line(newest.unwrap_or_default()))
    }

    /// Draws a list of the beads on a terminal that is too small for the page.
    fn draw_small(&self, frame: &mut Frame<'_>, view: &MonitorView) {
        let mut lines = vec![Line::from("q quits").bold()];
        for bead in &view.beads {
            let mark = if Some(bead.bead) == self.bead { ">" } else { " " };
            lines.push(Line::from(format!("{mark}{} {}", bead.bead, state_of(bead))).bold());
            lines.push(Line::from(format!(
                "  {} strikes {} lost",
                bead.strikes,
                lost(bead)
            )));
        }
        if let Some(strike) = self.strike() {
            lines.push(Line::from(format!(
                "#{} {:.3} N",
                strike.strike, strike.peak_force_n
            )));
            for (name, value, u) in energies(strike) {
                lines.push(Line::from(format!("{name} {} nJ", ShownStrike::with_u(value, u))));
            }
            lines.push(Line::from(strike.flags_text()));
        }
        lines.push(Line::from(self.message(view)));
        let size = format!("page: {}x{}", WHOLE.0, WHOLE.1);
        lines.push(Line::from(size));
        frame.render_widget(Paragraph::new(lines), frame.area());
    }

    fn draw_beads(&self, frame: &mut Frame<'_>, area: Rect, view: &MonitorView) {
        if view.beads.is_empty() {
            let line = " waiting for the first frame: is the bead powered, and its line wired?";
            return frame.render_widget(Paragraph::new(line), area);
        }
        let chosen = view.beads.iter().position(|bead| Some(bead.bead) == self.bead);
        // The chosen one is in sight.
        let first = chosen.unwrap_or(0).saturating_sub(BEADS_MOST - 1);
        let rows = view.beads.iter().skip(first).take(BEADS_MOST).map(|bead| {
            let mark = if Some(bead.bead) == self.bead { ">" } else { " " };
            let clock = bead
                .clock_ppm
                .map_or("-".to_owned(), |[drift, u]| format!("{drift:+.1} ± {u:.1}"));
            let supply = bead
                .supply_v
                .map_or("-".to_owned(), |volts| format!("{volts:.3} V"));
            let armed = bead
                .armed
                .map_or("-", |armed| if armed { "armed" } else { "disarmed" });
            let row = Row::new([
                format!("{mark} {}", bead.bead),
                state_of(bead),
                armed.to_owned(),
                bead.strikes.to_string(),
                bead.frames.to_string(),
                lost(bead).to_string(),
                supply,
                clock,
                bead.port.clone(),
            ]);
            let style = Style::new();
            let is_chosen = Some(bead.bead) == self.bead;
            row.style(if is_chosen { style.bold() } else { style })
        });
        let widths = [5, 12, 8, 7, 8, 4, 8, 14].map(Constraint::Length);
        let head = [
            " bead",
            "state",
            "",
            "strikes",
            "frames",
            "lost",
            "supply",
            "clock, ppm",
            "port",
        ];
        let head = Row::new(head).style(Style::new().add_modifier(Modifier::DIM));
        let widths = widths.into_iter().chain([Constraint::Min(0)]);
        frame.render_widget(Table::new(rows, widths).header(head), area);
    }

    fn draw_strike(&self, frame: &mut Frame<'_>, area: Rect) {
        let Some(strike) = self.strike() else {
            let text = "\n no strike yet";
            return frame.render_widget(Paragraph::new(text), area);
        };
        let at = strike.at_s.map_or(String::new(), |at| format!(" at {at:.5} s"));
        let peak = ShownStrike::with_u(strike.peak_force_n, strike.peak_force_u);
        let [low, high] = strike.acceleration;
        let mut first = vec![
            Span::raw(format!(" Strike {}{at}: ", strike.strike)).bold(),
            Span::raw(format!("{peak} N, {low:+.1} to {high:+.1} m/s²")),
        ];
        if strike.missing > 0 {
            first.push(Span::raw(format!(", {} samples missing", strike.missing)).bold());
        }
        let mut second = Vec::new();
        for (name, value, u) in energies(strike) {
            second.push(Span::raw(format!(" {name} ")));
            second.push(Span::raw(ShownStrike::with_u(value, u)).bold());
            second.push(Span::raw(" nJ  "));
        }
        if let Some(residual) = strike.residual {
            second.push(Span::raw(format!(" residual {:.2} %", 100.0 * residual)));
        }
        let flags = Span::raw(format!(" {}", strike.flags_text()));
        let flags = if strike.flags.is_empty() {
            flags
        } else {
            flags.bold()
        };
        let lines = vec![Line::from(first), Line::from(second), Line::from(flags)];
        frame.render_widget(Paragraph::new(lines), area);
    }

    fn draw_curves(&self, frame: &mut Frame<'_>, area: Rect) {
        let areas: [Rect; 3] = Layout::horizontal([Constraint::Fill(1); 3]).areas(area);
        let none = Curves::default();
        let curves = self.strike().and_then(|strike| strike.curves()).unwrap_or(&none);
        for ((area, (name, values)), color) in areas
            .into_iter()
            .zip([
                ("force, N", &curves.force_n),
                ("acceleration, m/s²", &curves.acceleration),
                ("residual, m/s²", &curves.residual),
            ])
            .zip([Color::Cyan, Color::Yellow, Color::Magenta])
        {
            draw_curve(frame, area, name, curves, values, color);
        }
    }

    fn draw_history(&self, frame: &mut Frame<'_>, area: Rect) {
        let block = Block::bordered().title(" strikes of this bead ");
        let rows = usize::from(area.height.saturating_sub(2));
        // The chosen strike stays in sight.
        let first = self.back.saturating_sub(rows.saturating_sub(1));
        let lines = self.strikes.iter().rev().enumerate().skip(first).take(rows);
        let lines = lines.map(|(place, strike)| {
            let mark = if place == self.back { ">" } else { " " };
            let [(_, a, _), (_, b, _)] = energies(strike);
            let flags = if strike.flags.is_empty() {
                String::new()
            } else {
                format!(" {}", strike.flags.join(", "))
            };
            let line = Line::from(format!(
                "{mark}{:>5} {:>8.3} N  A {a:>9.2}  B {b:>9.2} nJ{flags}",
                strike.strike, strike.peak_force_n
            ));
            if place == self.back { line.bold() } else { line }
        });
        frame.render_widget(Paragraph::new(lines.collect::<Vec<_>>()).block(block), area);
    }

    fn draw_losses(&self, frame: &mut Frame<'_>, area: Rect, view: &MonitorView) {
        let bead = view.beads.iter().find(|bead| Some(bead.bead) == self.bead);
        let mut lines = Vec::new();
        if let Some(bead) = bead {
            let standing = bead.standing.join(", ");
            if !standing.is_empty() {
                lines.push(Line::from(format!("now: {standing}")).bold());
            }
            let losses = bead.losses.iter();
            lines.extend(losses.map(|loss| Line::from(format!("{:>6} {}", loss.count, loss.cause))));
            if lines.is_empty() {
                lines.push(Line::from("healthy, nothing lost"));
            }
            let fault = bead.last_fault.iter();
            lines.extend(fault.map(|fault| Line::from(format!("last fault: {fault}"))));
        }
        let block = Block::bordered().title(" health, losses by cause ");
        frame.render_widget(Paragraph::new(lines).block(block), area);
    }
}

fn draw_curve(frame: &mut Frame<'_>, area: Rect, name: &str, curves: &Curves, values: &[f32], color: Color) {
    let time = |place: usize| curves.from_ms + curves.step_ms * place as f64;
    let points: Vec<(f64, f64)> = values
        .iter()
        .enumerate()
        .map(|(place, value)| (time(place), f64::from(*value)))
        .collect();
    let end = time(curves.force_n.len().max(1));
    let low = points.iter().fold(0.0_f64, |low, point| low.min(point.1));
    let high = points.iter().fold(0.0_f64, |high, point| high.max(point.1));
    let span = if high > low { high - low } else { 1.0 };
    let (low, high) = (low - 0.05 * span, high + 0.05 * span);
    let digits = if span >= 20.0 { 0 } else { 2 };
    let label = |value: f64| format!("{value:.digits$}");
    let data = Dataset::default()
        .marker(Marker::Braille)
        .graph_type(GraphType::Line)
        .style(Style::new().fg(color))
        .data(&points);
    let chart = Chart::new(vec![data])
        .block(Block::bordered().title(format!(" {name} ")))
        .x_axis(
            Axis::default()
                .bounds([curves.from_ms, end])
                .labels([format!("{:.1}", curves.from_ms), format!("{end:.1} ms")]),
        )
        .y_axis(
            Axis::default()
                .bounds([low, high])
                .labels([label(low), label(high)]),
        );
    frame.render_widget(chart, area);
}

fn energies(strike: &ShownStrike) -> [(&'static str, f64, Option<f64>); 2] {
    [
        ("A", strike.absorbed_measured_nj, strike.absorbed_measured_u),
        ("B", strike.absorbed_predicted_nj, strike.absorbed_predicted_u),
    ]
}

/// The number of frames that were lost on the way.
fn lost(bead: &BeadView) -> u64 {
    let losses = bead.losses.iter();
    losses
        .filter(|loss| loss.cause.starts_with("frames lost on the way"))
        .map(|loss| loss.count)
        .sum()
}

fn state_of(bead: &BeadView) -> String {
    match (bead.silent_s, bead.standing.len()) {
        (Some(seconds), _) => format!("silent {seconds} s"),
        (None, 0) => "good".to_owned(),
        (None, 1) => bead.standing[0].clone(),
        (None, faults) => format!("{faults} faults"),
    }
}

#[cfg(test)]
mod tests {
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    use super::*;
    use crate::testing::struck;

    fn drawn(width: u16, height: u16, keys: &[KeyCode]) -> String {
        let monitor = struck();
        let mut page = TerminalPage::default();
        page.take(&monitor);
        for key in keys {
            page.press(KeyEvent::from(*key), &monitor, None);
        }
        page.take(&monitor);
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal.draw(|frame| page.draw(frame)).unwrap();
        terminal.backend().to_string()
    }

    #[test]
    fn a_page_of_80_by_24_has_the_strike_its_curves_and_all_keys() {
        let page = drawn(80, 24, &[]);
        for part in [
            "bead monitor",
            "force, N",
            "residual",
            "q quit",
            "A ",
            " nJ",
            "Strike 0",
            "lost",
            "armed",
        ] {
            assert!(page.contains(part), "{part} is not in\n{page}");
        }
        let is_braille = |letter: char| ('\u{2801}'..='\u{28ff}').contains(&letter);
        assert!(
            page.chars().filter(|letter| is_braille(*letter)).count() > 40,
            "{page}"
        );
    }

    #[test]
    fn every_size_down_to_one_cell_is_drawn_and_20_columns_say_how_to_quit() {
        for (width, height) in [(1, 1), (20, 24), (20, 3), (71, 19), (72, 20), (300, 100)] {
            let page = drawn(width, height, &[KeyCode::Down, KeyCode::Left]);
            if width == 20 {
                assert!(page.contains("q quits") && page.contains("7 good"), "{page}");
            }
        }
    }

    #[test]
    fn text_of_a_device_and_typed_text_cannot_steer_the_terminal() {
        let monitor = struck();
        monitor.lock().tell("bead 7: \u{1b}[2J\u{9b}31m");
        let mut page = TerminalPage::default();
        page.take(&monitor);
        let mut terminal = Terminal::new(TestBackend::new(80, 24)).unwrap();
        terminal.draw(|frame| page.draw(frame)).unwrap();
        let text = terminal.backend().to_string();
        assert!(text.contains("\\u001b[2J\\u009b31m"), "{text}");
    }

    #[test]
    fn a_follower_of_a_recording_says_why_it_cannot_note() {
        assert!(drawn(80, 24, &[KeyCode::Char('n')]).contains("follows a recording"));
    }
}
