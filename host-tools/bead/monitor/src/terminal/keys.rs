//! Keys, and what they chose.

use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

use crate::control::Control;
use crate::model::SharedMonitor;

/// Greatest number of characters of a note that is typed: key, `=` and text.
const TYPED_MOST: usize = 1000;
/// The reason why a followed recording takes neither notes nor requests.
const ONLY_FOLLOWED: &str = "another program writes this recording: add notes with `bead note` when it is \
                             complete, and send requests with `bead command`";

/// The choices that were made by keys.
#[derive(Debug, Default)]
pub(super) struct Keys {
    /// Place of the chosen bead among those that are shown.
    pub(super) bead: usize,
    /// Number of strikes of the bead after the one that is shown.
    pub(super) back: usize,
    /// A note that is being typed.
    pub(super) typed: Option<String>,
}

impl Keys {
    /// Acts on a key for the chosen bead. Returns true if the key ends the page.
    pub(super) fn press(
        &mut self,
        key: KeyEvent,
        bead: Option<u8>,
        monitor: &SharedMonitor,
        control: Option<&Control>,
    ) -> bool {
        let with_control = key.modifiers.contains(KeyModifiers::CONTROL);
        if with_control && matches!(key.code, KeyCode::Char('c' | 'd')) {
            return true;
        }
        if let Some(typed) = &mut self.typed {
            match key.code {
                KeyCode::Esc => self.typed = None,
                KeyCode::Backspace => drop(typed.pop()),
                KeyCode::Enter => {
                    let typed = self.typed.take().unwrap_or_default();
                    if let (Some(control), false) = (control, typed.is_empty()) {
                        let said = control.note(&typed).unwrap_or_else(|why| why);
                        monitor.lock().tell(&said);
                    }
                }
                KeyCode::Char(letter) if !with_control && typed.len() < TYPED_MOST => typed.push(letter),
                _ => {}
            }
            return false;
        }
        match key.code {
            KeyCode::Char('q') => return true,
            KeyCode::Right | KeyCode::Tab => (self.bead, self.back) = (self.bead.saturating_add(1), 0),
            KeyCode::Left | KeyCode::BackTab => (self.bead, self.back) = (self.bead.saturating_sub(1), 0),
            KeyCode::Up => self.back = self.back.saturating_sub(1),
            KeyCode::Down => self.back = self.back.saturating_add(1),
            KeyCode::Home => self.back = 0,
            KeyCode::Char('n' | 'a' | 'd') if control.is_none() => monitor.lock().tell(ONLY_FOLLOWED),
            KeyCode::Char('n') => self.typed = Some(String::new()),
            KeyCode::Char(letter @ ('a' | 'd')) => {
                if let (Some(control), Some(bead)) = (control, bead) {
                    let mut monitor = monitor.lock();
                    if let Err(why) = control.arm(&mut monitor, bead, letter == 'a') {
                        monitor.tell(&why);
                    }
                }
            }
            _ => {}
        }
        false
    }
}
