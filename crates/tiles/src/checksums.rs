//! Checksums of what a job has written: the list of its files, and the seal of its report.
//!
//! The list has the form that `xxhsum -c` reads: the XXH128 of a file, two blanks, and its path from the output directory. It names
//! every result except itself and the report. The report has the checksum of the list, and its own: that of its text with zeros
//! in place of it. So whichever file is changed, it is this file that no longer fits.

use std::fmt;
use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use sys::fault;
use xxhash_rust::xxh3::{Xxh3, xxh3_128};

/// What stands in front of the checksum in the text of a report. The last place with it counts.
const SEAL: &str = "\"checksum\": \"";
/// Hexadecimal digits of a checksum.
const DIGITS: usize = 32;

/// The XXH128 of some bytes. It finds every accident, but whoever wants to can make other bytes with the same checksum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct Checksum(u128);

impl Checksum {
    /// Returns the checksum of `bytes`.
    pub fn of(bytes: &[u8]) -> Checksum {
        Checksum(xxh3_128(bytes))
    }

    /// Returns the checksum as a number.
    pub fn number(self) -> u128 {
        self.0
    }

    /// Returns the checksum of all bytes that went into `hasher`.
    pub fn of_hasher(hasher: &Xxh3) -> Checksum {
        Checksum(hasher.digest128())
    }

    /// Returns the size and the checksum of the file at `path`.
    ///
    /// # Errors
    /// What the system says if the file cannot be read, or is none.
    pub fn of_file(path: &Path) -> std::io::Result<(u64, Checksum)> {
        let mut file = open_file(path)?;
        let (mut hasher, mut bytes, mut buffer) = (Xxh3::new(), 0, vec![0; 1 << 18]);
        loop {
            fault::read("read-result")?;
            let count = file.read(&mut buffer)?;
            if count == 0 {
                return Ok((bytes, Checksum::of_hasher(&hasher)));
            }
            hasher.update(&buffer[..count]);
            bytes += count as u64;
        }
    }
}

/// Opens the regular file at `path` for reading. Opening a pipe would wait until another process writes to it.
///
/// # Errors
/// As [`read_file`].
pub fn open_file(path: &Path) -> std::io::Result<File> {
    match path.metadata()?.is_file() {
        true => File::open(path),
        false => Err(std::io::Error::other("it is not a regular file")),
    }
}

/// Reads the regular file at `path`.
///
/// # Errors
/// What the system says if the file cannot be read, or is none.
pub fn read_file(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open_file(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

impl fmt::Display for Checksum {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

impl From<Checksum> for String {
    fn from(checksum: Checksum) -> String {
        checksum.to_string()
    }
}

/// A text that is no checksum.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0:?} is not a checksum of 32 hexadecimal digits")]
pub struct NotAChecksum(String);

impl FromStr for Checksum {
    type Err = NotAChecksum;

    fn from_str(text: &str) -> Result<Checksum, NotAChecksum> {
        let is_hex = text.len() == DIGITS && text.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f'));
        let number = is_hex.then(|| u128::from_str_radix(text, 16).ok()).flatten();
        number.map(Checksum).ok_or_else(|| NotAChecksum(text.into()))
    }
}

impl TryFrom<String> for Checksum {
    type Error = NotAChecksum;

    fn try_from(text: String) -> Result<Checksum, NotAChecksum> {
        text.parse()
    }
}

/// Returns the text of the list of files, each given by its path from the output directory and its checksum.
pub fn list_text(files: &[(String, Checksum)]) -> String {
    files.iter().map(|(name, checksum)| format!("{checksum}  {name}\n")).collect()
}

/// Returns the files of a list, or `None` if the text is no list.
pub fn parse_list(text: &[u8]) -> Option<Vec<(String, Checksum)>> {
    let line = |line: &str| {
        let (checksum, name) = line.split_once("  ")?;
        Some((name.to_owned(), checksum.parse().ok()?))
    };
    std::str::from_utf8(text).ok()?.lines().map(line).collect()
}

/// Returns the checksum of a report's text with zeros in place of it, and the checksum that stands there; `None` if none does.
pub fn seal(text: &[u8]) -> Option<(Checksum, Checksum)> {
    let start = memchr::memmem::rfind(text, SEAL.as_bytes())? + SEAL.len();
    let found = std::str::from_utf8(text.get(start..start + DIGITS)?).ok()?.parse().ok()?;
    let mut hasher = Xxh3::new();
    [&text[..start], &[b'0'; DIGITS], &text[start + DIGITS..]].iter().for_each(|piece| hasher.update(piece));
    Some((Checksum::of_hasher(&hasher), found))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksums_are_those_of_xxhsum() {
        // printf abc | xxhsum -H128
        assert_eq!(Checksum::of(b"abc").to_string(), "06b05ab6733a618578af5f94892f3950");
        let text = Checksum::of(b"abc").to_string();
        assert_eq!(text.parse(), Ok(Checksum::of(b"abc")));
        for wrong in ["", &text[1..], &text.to_uppercase(), &format!("+{}", &text[1..])] {
            assert!(wrong.parse::<Checksum>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_list_is_read_back_as_it_was_written() {
        let files = [("tiles/000000.glb".to_owned(), Checksum::of(b"a")), ("a  b".to_owned(), Checksum::of(b"b"))];
        assert_eq!(parse_list(list_text(&files).as_bytes()), Some(files.to_vec()));
        assert_eq!(parse_list(b"no list\n"), None);
        assert_eq!(parse_list(&[0xff]), None);
    }

    #[test]
    fn a_seal_holds_until_any_bit_of_the_text_changes() {
        let open = format!("{{\n  \"a\": \"checksum\",\n  {SEAL}{}\"\n}}\n", Checksum::default());
        let (checksum, _) = seal(open.as_bytes()).unwrap();
        let sealed = open.replace(&Checksum::default().to_string(), &checksum.to_string()).into_bytes();
        let holds = |text: &[u8]| seal(text).is_some_and(|(own, found)| own == found);
        assert!(holds(&sealed));
        for bit in 0..sealed.len() * 8 {
            let mut changed = sealed.clone();
            changed[bit / 8] ^= 1 << (bit % 8);
            assert!(!holds(&changed), "bit {bit}");
        }
    }
}
