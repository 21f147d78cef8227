//! Escaping of untrusted text, such as names in files.

use std::borrow::Cow;

/// Escapes control characters as `\u{…}`: C0 including line breaks, DEL, C1, line and paragraph separators, and the
/// marks, embeddings, overrides and isolates of bidirectional text. The result is one line that neither controls a
/// terminal nor reorders adjacent text. Of a long text the middle is left out ([`shortened`]).
pub fn printable(text: &str) -> Cow<'_, str> {
    fn escape(text: &str) -> Cow<'_, str> {
        escaped(text, is_control, |c| c.escape_unicode().to_string())
    }
    match shortened(text) {
        Cow::Borrowed(text) => escape(text),
        Cow::Owned(text) => escape(&text).into_owned().into(),
    }
}

/// Characters that are printed of each end of a long text, such as a message that quotes a name of a file.
const END: usize = 1000;

/// A text of which the middle is left out, if it is much longer than messages are.
pub fn shortened(text: &str) -> Cow<'_, str> {
    let start = text.char_indices().nth(END).map_or(text.len(), |(start, _)| start);
    let end = text.char_indices().rev().nth(END - 1).map_or(0, |(end, _)| end);
    match text.get(start..end).map(|middle| middle.chars().count()) {
        None | Some(0) => text.into(),
        Some(count) => format!("{}… ({count} more characters) …{}", &text[..start], &text[end..]).into(),
    }
}

/// As [`printable`], but keeps line breaks.
pub fn printable_lines(text: &str) -> Cow<'_, str> {
    escaped(text, |c| c != '\n' && is_control(c), |c| c.escape_unicode().to_string())
}

/// Replaces the characters of [`printable`] in serialised JSON by JSON escapes, except line breaks between tokens.
/// Serializers escape C0 only.
pub fn printable_json(json: &str) -> Cow<'_, str> {
    // All of them are in the basic multilingual plane.
    escaped(json, |c| c != '\n' && is_control(c), |c| format!("\\u{:04x}", u32::from(c)))
}

fn is_control(c: char) -> bool {
    let is_bidirectional =
        matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    c.is_control() || is_bidirectional
}

fn escaped(text: &str, is_escaped: impl Fn(char) -> bool, escape: impl Fn(char) -> String) -> Cow<'_, str> {
    if !text.contains(&is_escaped) {
        return text.into();
    }
    let mut shown = String::with_capacity(text.len() + 8);
    for c in text.chars() {
        if is_escaped(c) { shown += &escape(c) } else { shown.push(c) }
    }
    shown.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_shown_and_other_text_stays() {
        for (text, shown) in [
            ("a\x1b[2Jb", "a\\u{1b}[2Jb"),
            ("a\nkiln: error: b\r\tc\0", "a\\u{a}kiln: error: b\\u{d}\\u{9}c\\u{0}"),
            ("\x7f\u{80}\u{9b}31m\u{9f}", "\\u{7f}\\u{80}\\u{9b}31m\\u{9f}"),
            ("\u{200e}\u{200f}\u{61c}", "\\u{200e}\\u{200f}\\u{61c}"),
            ("\u{2028}\u{2029}\u{202a}\u{202e}", "\\u{2028}\\u{2029}\\u{202a}\\u{202e}"),
            ("\u{2066}\u{2069}", "\\u{2066}\\u{2069}"),
        ] {
            assert_eq!(printable(text), shown);
        }
        let plain =
            ["", "größe 3 µm", "木", "שלום", "👩\u{200d}🚀", "a\u{a0}b", "C:\\u{1b}", "\u{202f}\u{2065}"];
        for text in plain {
            assert!(matches!(printable(text), Cow::Borrowed(same) if same == text), "{text}");
        }
        assert_eq!(printable_lines("a\nb\x1b\n"), "a\nb\\u{1b}\n");
    }

    /// 2000 characters stay; of one more, those in the middle are counted.
    #[test]
    fn the_middle_of_a_long_text_is_left_out() {
        let text = |count: usize| format!("{}{}", "ä".repeat(END), "\n".repeat(count));
        assert_eq!(shortened(&text(END)), text(END));
        let escaped = "\\u{a}".repeat(END);
        let shown = format!("{}… (1 more characters) …{escaped}", "ä".repeat(END));
        assert_eq!(printable(&text(END + 1)), shown);
        assert!(printable(&"x".repeat(20_000_000)).contains("… (19998000 more characters) …"));
    }

    #[test]
    fn json_keeps_its_values() {
        let value = serde_json::json!({ "a\u{9b}b": "c\x1b\x7f\u{202e}\nd" });
        let text = format!("{value:#}");
        let shown = printable_json(&text);
        let read: serde_json::Value = serde_json::from_str(&shown).expect("it is JSON still");
        assert_eq!(read, value);
        assert!(!shown.contains(|c| c != '\n' && is_control(c)), "{shown}");
    }
}
