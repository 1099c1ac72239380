//! The page on a terminal.
//!
//! # Design
//! ratatui draws the page into cells and writes only those that change. The page is drawn ten times a second
//! at most, on the thread that reads the keys; the recorder never waits for it. The terminal is restored at
//! the end, on a panic, and by [`restore`] where a signal ends the program.

mod keys;
mod page;

use std::env;
use std::io::{self, IsTerminal};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event, KeyEventKind};

use crate::control::Control;
use crate::model::SharedMonitor;
use keys::Keys;

/// Time between two pictures.
const PICTURE_EVERY: Duration = Duration::from_millis(100);

/// True while the page has the terminal.
static IS_SHOWN: AtomicBool = AtomicBool::new(false);

/// Gives the terminal back, if the page has it.
pub fn restore() {
    if IS_SHOWN.swap(false, Ordering::Relaxed) {
        ratatui::restore();
    }
}

/// True if standard input and output are a terminal, as keys and page need.
pub fn is_there() -> bool {
    io::stdin().is_terminal() && io::stdout().is_terminal()
}

/// Shows the page until `q`, or until `stop` is true.
///
/// # Errors
/// The terminal is gone.
pub fn run(monitor: &SharedMonitor, control: Option<&Control>, stop: &AtomicBool) -> io::Result<()> {
    let mut terminal = ratatui::try_init()?;
    IS_SHOWN.store(true, Ordering::Relaxed);
    let shown = show(&mut terminal, monitor, control, stop);
    restore();
    shown
}

fn show(
    terminal: &mut DefaultTerminal,
    monitor: &SharedMonitor,
    control: Option<&Control>,
    stop: &AtomicBool,
) -> io::Result<()> {
    // https://no-color.org: set and not empty.
    let has_colours = env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    let mut keys = Keys::default();
    while !stop.load(Ordering::Relaxed) {
        // The attributes of a terminal that hung up cannot be read; its input may merely seem silent.
        rustix::termios::tcgetattr(io::stdin())?;
        let content = {
            let mut monitor = monitor.lock();
            page::Content::of(&mut monitor, &mut keys)
        };
        terminal.draw(|frame| page::draw(frame, &content, &keys, has_colours))?;
        if !event::poll(PICTURE_EVERY)? {
            continue;
        }
        if let Event::Key(key) = event::read()?
            && key.kind != KeyEventKind::Release
            && keys.press(key, content.bead(), monitor, control)
        {
            return Ok(());
        }
    }
    Ok(())
}
