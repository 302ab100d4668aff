//! How the texts of a `.dbf` are written: nothing in them says it, and the `.cpg` beside it is often missing.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::windows_1252::decoded;

/// What the encodings that are read are called in a `.cpg`: UTF-8, and those that Windows-1252 includes.
const KNOWN: [&str; 12] = [
    "",
    "utf8",
    "65001",
    "ascii",
    "usascii",
    "iso88591",
    "88591",
    "latin1",
    "1252",
    "cp1252",
    "ansi1252",
    "windows1252",
];

/// How texts are written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Encoding {
    /// The name in the `.cpg`, if texts in it cannot be read.
    unknown: Option<String>,
}

impl Encoding {
    /// Returns what the `.cpg` file says. One that cannot be read says nothing.
    pub(super) fn of(cpg: Option<&Path>) -> Encoding {
        const LONGEST: u64 = 64;
        let mut name = String::new();
        if let Some(file) = cpg.and_then(|path| File::open(path).ok()) {
            let is_text = file.take(LONGEST).read_to_string(&mut name).is_ok();
            name.truncate(if is_text { name.len() } else { 0 });
        }
        let plain: String = name.chars().filter(char::is_ascii_alphanumeric).collect::<String>().to_lowercase();
        let is_known = KNOWN.contains(&plain.as_str());
        Encoding { unknown: (!is_known).then(|| name.trim().to_string()) }
    }

    /// Returns the text that `bytes` are.
    ///
    /// # Errors
    /// A sentence without its subject, if the encoding is not known and it matters.
    pub(super) fn text(&self, bytes: &[u8]) -> Result<String, String> {
        match &self.unknown {
            Some(name) if std::str::from_utf8(bytes).is_err() => Err(format!(
                "has a text in the encoding {name:?}, according to the .cpg, which is not supported: write the file anew in UTF-8, for \
                 example with \
                 `ogr2ogr -lco ENCODING=UTF-8`"
            )),
            _ => Ok(decoded(bytes).into_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encoding(name: &str) -> Encoding {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.cpg");
        std::fs::write(&path, name).unwrap();
        Encoding::of(Some(&path))
    }

    #[test]
    fn texts_are_utf_8_or_western() {
        for name in ["UTF-8", "ISO-8859-1", "ISO 88591", "ANSI 1252\r\n", ""] {
            let found = encoding(name);
            assert_eq!(found.text("Böschung".as_bytes()).unwrap(), "Böschung", "{name}");
            assert_eq!(found.text(b"B\xf6schung\x85").unwrap(), "Böschung…", "{name}");
        }
        assert_eq!(Encoding::of(None), encoding("UTF-8"));
        let cyrillic = encoding("1251");
        assert_eq!(cyrillic.text(b"river").unwrap(), "river");
        assert!(cyrillic.text(b"\xf0\xe5\xea\xe0").unwrap_err().contains("\"1251\""));
    }
}
