//! How much memory a file from somebody else may take.
//!
//! What a file claims is held against a budget before anything of that size is read, unpacked, built or run.
//!
//! ```
//! use softjam::budget::Budget;
//! let budget: Budget = "2G".parse().unwrap();
//! assert_eq!(budget.bytes(), 2 << 30);
//! let error = budget.allow("a run of 9 particles", 3 << 30).unwrap_err();
//! assert_eq!(error.to_string(), "a run of 9 particles takes about 3.0 GiB, more than the 2.0 GiB of --memory");
//! ```

use core::fmt;
use core::str::FromStr;

/// So many bytes of memory.
///
/// See the example of the [module](self).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    bytes: u64,
}

/// Something asks for more memory than there may be.
///
/// See the example of the [module](self).
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what} takes about {}, more than {} of --memory", Size(*.bytes), .share.of(*.most))]
pub struct Exceeded {
    what: String,
    bytes: u64,
    share: Share,
    most: u64,
}

/// How much of the budget may be asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Share {
    All,
    Eighth,
}

impl Share {
    fn of(self, most: u64) -> String {
        match self {
            Self::All => format!("the {}", Size(most)),
            Self::Eighth => format!("an eighth, {},", Size(most)),
        }
    }
}

/// A piece of a file lies in memory several times while it is read: packed, unpacked, and as what it says.
const PIECES: u64 = 8;

impl Default for Budget {
    /// 4 GiB.
    fn default() -> Self {
        Self::of(4 << 30)
    }
}

impl Budget {
    /// A budget of so many bytes.
    #[must_use]
    pub fn of(bytes: u64) -> Self {
        Self { bytes }
    }

    /// Bytes in all.
    #[must_use]
    pub fn bytes(self) -> u64 {
        self.bytes
    }

    /// Bytes that a piece of a file may have (a message, a chunk, a start file): an eighth of all.
    #[must_use]
    pub fn piece(self) -> u64 {
        self.bytes / PIECES
    }

    /// Whether `what` may take so many bytes.
    ///
    /// # Errors
    ///
    /// [`Exceeded`] names it, the number and the way out.
    ///
    /// See the example of the [module](self).
    pub fn allow(self, what: impl fmt::Display, bytes: u64) -> Result<(), Exceeded> {
        within(what, bytes, Share::All, self.bytes)
    }

    /// Whether `what`, a piece of a file, may have so many bytes.
    ///
    /// # Errors
    ///
    /// [`Exceeded`] names it, the number and the way out.
    pub fn allow_piece(self, what: impl fmt::Display, bytes: u64) -> Result<(), Exceeded> {
        within(what, bytes, Share::Eighth, self.piece())
    }
}

fn within(what: impl fmt::Display, bytes: u64, share: Share, most: u64) -> Result<(), Exceeded> {
    if bytes <= most {
        return Ok(());
    }
    Err(Exceeded {
        what: what.to_string(),
        bytes,
        share,
        most,
    })
}

impl FromStr for Budget {
    type Err = &'static str;

    /// Reads `2G`, `500M`, `64K` or plain bytes; powers of 1024.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        const EXPECTED: &str = "a size is expected, such as 2G, 500M or plain bytes";
        let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
        let shift = match &text[digits.len()..] {
            "" | "B" => 0,
            "K" | "k" | "KiB" => 10,
            "M" | "MiB" => 20,
            "G" | "GiB" => 30,
            "T" | "TiB" => 40,
            _ => return Err(EXPECTED),
        };
        let number: u64 = digits.parse().map_err(|_| EXPECTED)?;
        let bytes = number.checked_mul(1 << shift).filter(|bytes| *bytes > 0);
        bytes.map(Self::of).ok_or(EXPECTED)
    }
}

/// A number of bytes as a person reads it.
struct Size(u64);

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let units = ["KiB", "MiB", "GiB", "TiB", "PiB", "EiB"];
        if self.0 < 1024 {
            return write!(f, "{} bytes", self.0);
        }
        let k = (self.0.ilog2() / 10) as usize;
        let size = self.0 as f64 / (1_u64 << (10 * k)) as f64;
        write!(f, "{size:.1} {}", units[k - 1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_read_back_as_they_are_written() {
        for (text, bytes) in [
            ("1", 1),
            ("500M", 500 << 20),
            ("64k", 64 << 10),
            ("3TiB", 3 << 40),
        ] {
            assert_eq!(text.parse(), Ok(Budget::of(bytes)), "{text}");
        }
        for text in ["", "G", "-1", "1.5G", "0", "1X", "99999999999T", "2 G"] {
            assert!(text.parse::<Budget>().is_err(), "{text}");
        }
        for (bytes, text) in [
            (1023, "1023 bytes"),
            (1024, "1.0 KiB"),
            (u64::MAX, "16.0 EiB"),
        ] {
            assert_eq!(Size(bytes).to_string(), text);
        }
    }
}
