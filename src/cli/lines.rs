//! What a verb says: lines of a name and a value.

use softjam::text::{lines, shown};
use std::fmt::{Display, Write as _};

/// Lines of a name and a value; values pass through [`shown`], since many are text from a file.
#[derive(Default)]
pub struct Lines {
    text: String,
}

impl Lines {
    pub fn line(&mut self, name: &str, value: impl Display) {
        // Writing to a String cannot fail.
        let _ = writeln!(self.text, "{name:<14} {}", shown(&value.to_string()));
    }

    /// What is said at the end, in whole sentences that may be long.
    pub fn say(&mut self, name: &str, sentences: &str) {
        let _ = writeln!(self.text, "{name:<14} {}", lines(sentences));
    }

    pub fn into_text(self) -> String {
        self.text
    }
}
