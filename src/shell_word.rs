//! Words of the shell, in scripts and in commands that are shown.

/// Returns the word that the shell reads as `text`: as it is if it is plain, otherwise between apostrophes.
pub(crate) fn quoted(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) {
        return text.into();
    }
    format!("'{}'", text.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;

    #[test]
    fn the_shell_reads_what_was_quoted() {
        for text in ["plain/path-1.toml", "", "two words", "it's", "a'b'c", "$HOME `x` \\ \"q\" # ; & *", "ä\tö"] {
            let script = format!("printf %s {}", quoted(text));
            let output = Command::new("sh").args(["-c", &script]).output().unwrap();
            assert_eq!(String::from_utf8(output.stdout).unwrap(), text);
        }
        assert_eq!(quoted("plain/path-1.toml"), "plain/path-1.toml");
    }
}
