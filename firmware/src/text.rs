//! A line of text for people.

use core::fmt::{self, Write};

use bead_wire::MAX_DETAIL;
use heapless::String;

/// Text, cut to the room of a frame.
#[derive(Clone)]
pub(crate) struct Text(String<MAX_DETAIL>);

impl Text {
    /// Formats like `format!`, and cuts what does not fit.
    pub(crate) fn new(arguments: fmt::Arguments<'_>) -> Self {
        let mut text = Self(String::new());
        // `write_str` never fails. A `Display` that fails has written what it could.
        let _ = text.write_fmt(arguments);
        text
    }

    pub(crate) fn as_str(&self) -> &str {
        &self.0
    }
}

impl Write for Text {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let room = self.0.capacity() - self.0.len();
        let fits = &text[..text.floor_char_boundary(room)];
        self.0.push_str(fits).map_err(|_| fmt::Error)
    }
}
