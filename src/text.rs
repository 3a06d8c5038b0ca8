//! Text from strangers, made fit to be shown.
//!
//! A file, its name or a scene may hold any text: sequences that move a terminal's cursor, a line break with a forged verdict
//! behind it, marks that turn the reading direction, a hundred megabytes. Whatever was not written in this program passes
//! through here before it reaches a terminal, a figure, a JSON object or an error.
//!
//! ```
//! use softjam::text::shown;
//! assert_eq!(shown("φ = 0.9 · Größe 粒子.csv"), "φ = 0.9 · Größe 粒子.csv");
//! assert_eq!(shown("a\nverdict  verified\u{1b}[2J"), r"a\nverdict  verified\u{1b}[2J");
//! ```

use core::fmt::Display;

/// Characters of a name or a value that are shown at most.
pub const LONGEST: usize = 240;

/// Characters of a whole message that are shown at most.
const LONGEST_MESSAGE: usize = 8000;

/// A number of things, in the plural unless it is one: for nouns that take an s.
///
/// ```
/// use softjam::text::counted;
/// assert_eq!([0, 1, 2].map(|n| counted(n, "rattler")), ["0 rattlers", "1 rattler", "2 rattlers"]);
/// ```
#[must_use]
pub fn counted(count: impl Display, noun: &str) -> String {
    let count = count.to_string();
    let ending = if count == "1" { "" } else { "s" };
    format!("{count} {noun}{ending}")
}

/// A length as a person reads it, in whatever unit: five digits or more that mean something.
///
/// ```
/// use softjam::text::length;
/// assert_eq!([18.60094, 0.0186, 1.86e-12, 1.86e12].map(length), ["18.601", "0.018600", "1.8600e-12", "1.8600e12"]);
/// ```
#[must_use]
pub fn length(length: f64) -> String {
    match length.abs() {
        1.0..1e6 => format!("{length:.3}"),
        0.01..1.0 => format!("{length:.6}"),
        _ => format!("{length:.4e}"),
    }
}

/// A name or a value as one line: characters that are not seen are written as escapes, and what is longer than [`LONGEST`]
/// ends with an ellipsis. What is fit to be shown comes out as it went in.
///
/// ```
/// use softjam::text::shown;
/// let once = shown("a\tb\u{202e}");
/// assert_eq!(once, r"a\tb\u{202e}");
/// assert_eq!(shown(&once), once);
/// ```
#[must_use]
pub fn shown(text: &str) -> String {
    escaped(text, LONGEST, |_| false)
}

/// A message of several lines, each of which may be long: as [`shown`], but line breaks stay.
///
/// ```
/// assert_eq!(softjam::text::lines("one\ntwo\r"), "one\ntwo\\r");
/// ```
#[must_use]
pub fn lines(text: &str) -> String {
    escaped(text, LONGEST_MESSAGE, |c| c == '\n')
}

/// At most `most` characters; those that are `kept` are not escaped.
fn escaped(text: &str, most: usize, kept: impl Fn(char) -> bool) -> String {
    let mut shown = String::new();
    // How many characters there are, and how many bytes leave room for the ellipsis.
    let (mut count, mut cut) = (0, 0);
    for c in text.chars() {
        let before = shown.len();
        if is_hidden(c) && !kept(c) {
            // Escapes are ASCII.
            shown.extend(c.escape_default());
            count += shown.len() - before;
        } else {
            shown.push(c);
            count += 1;
        }
        if count > most {
            shown.truncate(cut);
            shown.push('…');
            break;
        }
        if count < most {
            cut = shown.len();
        }
    }
    shown
}

/// Whether a character is not seen itself, but changes what is seen: Unicode's controls, format characters, separators of
/// lines and paragraphs, fillers without a glyph, tags, and the two that XML cannot hold.
pub(crate) fn is_hidden(c: char) -> bool {
    c.is_control()
        || matches!(c,
            '\u{ad}' | '\u{34f}' | '\u{600}'..='\u{605}' | '\u{61c}' | '\u{6dd}' | '\u{70f}' | '\u{890}' | '\u{891}' | '\u{8e2}'
            | '\u{115f}' | '\u{1160}' | '\u{17b4}' | '\u{17b5}' | '\u{180b}'..='\u{180f}' | '\u{200b}'..='\u{200f}'
            | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{3164}' | '\u{feff}' | '\u{ffa0}' | '\u{fff0}'..='\u{fffb}'
            | '\u{fffe}' | '\u{ffff}' | '\u{110bd}' | '\u{110cd}' | '\u{13430}'..='\u{1345f}' | '\u{1bca0}'..='\u{1bca3}'
            | '\u{1d173}'..='\u{1d17a}' | '\u{e0000}'..='\u{e0fff}')
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Format characters, the separators of lines and paragraphs, and the byte order mark, as the Unicode standard lists them.
    const FORMAT: [core::ops::RangeInclusive<u32>; 8] = [
        0xad..=0xad,
        0x61c..=0x61c,
        0x180e..=0x180e,
        0x200b..=0x200f,
        0x2028..=0x202e,
        0x2060..=0x206f,
        0xfeff..=0xfeff,
        0xe0000..=0xe007f,
    ];

    proptest! {
        #[test]
        fn whatever_is_shown_is_short_and_hides_nothing(
            characters in prop::collection::vec(
                prop_oneof![any::<char>(), (0..0xa0_u32, 0..8_usize, 0..0x80_u32).prop_map(|(low, range, k)| {
                    let format = FORMAT[range].start() + k % (1 + FORMAT[range].end() - FORMAT[range].start());
                    char::from_u32(if k % 2 == 0 { low } else { format }).unwrap_or('x')
                })],
                0..600,
            ),
        ) {
            let text: String = characters.into_iter().collect();
            let one = shown(&text);
            prop_assert!(one.chars().count() <= LONGEST);
            let hidden = |c: char| c.is_control() || FORMAT.iter().any(|range| range.contains(&u32::from(c)));
            prop_assert!(!one.chars().any(hidden), "{:?}", one);
            prop_assert_eq!(shown(&one), one);
            let all = lines(&text);
            prop_assert!(!all.chars().any(|c| c != '\n' && hidden(c)));
            prop_assert_eq!(lines(&all), all);
        }

        #[test]
        fn ordinary_text_stays_as_it_is(text in "[a-zA-Z0-9 φγρθΔπ°·…äöüßéñçŁж粒子模型한국어/\\\\.,;:!?'\"`<>&()=+-]{0,240}") {
            prop_assert_eq!(shown(&text), text);
        }
    }

    #[test]
    fn an_escape_is_shown_whole_or_not_at_all() {
        for n in LONGEST - 8..LONGEST + 2 {
            let text = format!("{}\u{1b}", "x".repeat(n));
            let shown = shown(&text);
            assert!(
                shown.ends_with(r"\u{1b}") || shown.ends_with("x…"),
                "{shown}"
            );
        }
        assert_eq!(shown(&"x".repeat(LONGEST)).chars().last(), Some('x'));
    }
}
