//! Small pieces of text.

/// Appends a number with at least so many digits.
pub(crate) fn push_padded(mut number: u64, digits: usize, out: &mut Vec<u8>) {
    // 2^64 has 20 digits.
    let mut text = [b'0'; 20];
    let mut first = text.len();
    while number > 0 || text.len() - first < digits.min(text.len()) {
        first -= 1;
        text[first] = b'0' + (number % 10) as u8;
        number /= 10;
    }
    out.extend_from_slice(&text[first..]);
}

/// Returns a text as one line of ASCII, as formats have it that name no encoding.
pub(crate) fn ascii_line(text: &str) -> String {
    let plain = |c: char| match c {
        ' '..='~' => c,
        c if c.is_whitespace() || c.is_control() => ' ',
        _ => '?',
    };
    text.chars().map(plain).collect()
}

/// Returns a text as the value of an XML attribute in double quotes.
pub(crate) fn xml_value(text: &str) -> String {
    let mut value = String::new();
    for c in text.chars() {
        match c {
            '&' => value.push_str("&amp;"),
            '<' => value.push_str("&lt;"),
            '>' => value.push_str("&gt;"),
            '"' => value.push_str("&quot;"),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => value.push(' '),
            c => value.push(c),
        }
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_suit_their_formats() {
        assert_eq!(ascii_line("Größe\n2\t\u{7f}"), "Gr??e 2  ");
        assert_eq!(xml_value("a < \"b\" & ü\u{1}"), "a &lt; &quot;b&quot; &amp; ü ");
        let padded = |number, digits| {
            let mut out = Vec::new();
            push_padded(number, digits, &mut out);
            String::from_utf8(out).unwrap()
        };
        assert_eq!(
            [padded(0, 1), padded(7, 3), padded(1234, 2), padded(u64::MAX, 1)].join(" "),
            "0 007 1234 18446744073709551615"
        );
    }
}
