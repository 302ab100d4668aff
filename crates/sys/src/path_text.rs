//! Paths as text. A name of a file may hold bytes that are not UTF-8, and then JSON and patterns cannot hold it as it is.
//!
//! Each such byte is written as a NUL character and its two hexadecimal digits. No path holds a NUL, so the text leads back to the path.

use serde::{Deserialize, Deserializer, Serializer};
use std::ffi::{OsStr, OsString};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Stands before the digits of a byte that is not UTF-8.
const MARK: char = '\0';

/// The signs that have a meaning in patterns.
pub const PATTERN_SIGNS: [char; 3] = ['*', '?', '['];

/// Tells whether a name has signs that have a meaning in patterns.
pub fn is_pattern(name: &str) -> bool {
    name.contains(PATTERN_SIGNS)
}

/// Returns a text that [`decoded`] makes the name again. A name that is UTF-8 stays as it is.
pub fn encoded(name: &OsStr) -> String {
    let mut text = String::new();
    for chunk in name.as_encoded_bytes().utf8_chunks() {
        text.push_str(chunk.valid());
        for byte in chunk.invalid() {
            // Writing to a string cannot fail.
            let _ = write!(text, "{MARK}{byte:02x}");
        }
    }
    text
}

/// Returns the name that a text from [`encoded`] stands for.
#[cfg(unix)]
pub fn decoded(text: &str) -> OsString {
    use std::os::unix::ffi::OsStringExt;
    let mut pieces = text.split(MARK);
    let mut bytes = pieces.next().unwrap_or_default().as_bytes().to_vec();
    for piece in pieces {
        let (digits, rest) = piece.split_at_checked(2).unwrap_or((piece, ""));
        bytes.extend(u8::from_str_radix(digits, 16));
        bytes.extend(rest.as_bytes());
    }
    OsString::from_vec(bytes)
}

/// Returns the name that a text stands for.
#[cfg(not(unix))]
pub(crate) fn decoded(text: &str) -> OsString {
    text.into()
}

/// Writes a path without loss, for records that lead back to the file.
pub fn serialize<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&encoded(path.as_os_str()))
}

/// Reads what [`serialize`] has written.
pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<PathBuf, D::Error> {
    Ok(decoded(&String::deserialize(deserializer)?).into())
}

/// Writes a path as messages show it, for people and programs that want its name.
pub fn shown<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(&path.display())
}

/// Writes a path, if there is one, as messages show it.
pub fn shown_if_any<S: Serializer>(path: &Option<PathBuf>, serializer: S) -> Result<S::Ok, S::Error> {
    match path {
        Some(path) => shown(path, serializer),
        None => serializer.serialize_none(),
    }
}

/// Writes paths as messages show them.
pub fn all_shown<S: Serializer>(paths: &[PathBuf], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(paths.iter().map(|path| path.display().to_string()))
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;
    use std::os::unix::ffi::OsStrExt;

    #[test]
    fn any_name_leads_back_from_its_text() {
        for name in [&b"a.laz"[..], b"Gel\xe4nde/\xff\xfe", b"\xc3", "Gelände".as_bytes(), b"\xe4ff"] {
            let name = OsStr::from_bytes(name);
            assert_eq!(decoded(&encoded(name)), name);
            assert_eq!(encoded(name) == name.to_string_lossy(), name.to_str().is_some());
        }
        assert_eq!(encoded(OsStr::from_bytes(b"Gel\xe4nde")), "Gel\0e4nde");
    }
}
