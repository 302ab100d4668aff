//! Fetching a range of a file, in as many requests as it takes.

use std::io::Read;
use std::ops::Range;

use ureq::Body;
use ureq::http::{HeaderMap, Response, header};
use xxhash_rust::xxh3::xxh3_64;

use crate::remote::network::client::{Address, Headers, refusal};
use crate::remote::network::failure::{Failure, FailureKind};
use crate::remote::network::timeouts::{Timeouts, persist};
use crate::remote::traffic::count_bytes;

/// The bytes that are taken from a connection at once.
const PIECE: usize = 1 << 16;

/// What tells one content of a file from another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Version {
    pub(crate) size: u64,
    /// The tag of the content, as the server gives it.
    tag: Option<String>,
    /// When it was written, as the server says it.
    modified: Option<String>,
}

impl Version {
    /// Returns what an answer says of a file of `size` bytes.
    fn of(headers: &HeaderMap, size: u64) -> Version {
        let text =
            |name: header::HeaderName| headers.get(name).and_then(|value| value.to_str().ok()).map(str::to_string);
        Version { size, tag: text(header::ETAG), modified: text(header::LAST_MODIFIED) }
    }

    /// Returns whether the server tells contents of one size apart.
    pub(crate) fn is_sure(&self) -> bool {
        self.tag.is_some() || self.modified.is_some()
    }

    /// Returns a number that tells this content from others. `start` is the beginning of the file, which decides if the server does not.
    pub(crate) fn hash(&self, start: &[u8]) -> u64 {
        match self.tag.as_ref().or(self.modified.as_ref()) {
            Some(said) => xxh3_64(said.as_bytes()),
            None => xxh3_64(start),
        }
    }

    /// Returns how a later version differs; `None` if it does not.
    fn change(&self, now: &Version) -> Option<String> {
        if self.size != now.size {
            return Some(format!("from {} bytes to {}", self.size, now.size));
        }
        let told = |old: &Option<String>, new: &Option<String>| {
            old.as_ref().zip(new.as_ref()).map(|(old, new)| (old != new).then(|| format!("from {old} to {new}")))
        };
        // A copy on another server may have another time.
        told(&self.tag, &now.tag).or_else(|| told(&self.modified, &now.modified)).flatten()
    }
}

/// What a transfer has brought.
pub(crate) struct Transferred {
    pub(crate) bytes: Vec<u8>,
    pub(crate) version: Version,
}

/// Fetches `range` of the file at `address`, or, if it is not yet known what `version` the file has, as much of the range as there is.
/// The bytes take the memory of `room`.
pub(crate) fn transfer(
    address: &Address,
    range: Range<u64>,
    version: Option<&Version>,
    mut room: Vec<u8>,
) -> Result<Transferred, Failure> {
    room.clear();
    let mut transfer = Transfer { address, range, version: version.cloned(), bytes: room };
    persist(Timeouts::standard(), version.is_some(), || {
        let before = transfer.bytes.len();
        transfer.attempt().map_err(|failure| (transfer.bytes.len() - before, failure))
    })?;
    let version = transfer.version.ok_or_else(|| Failure::new(FailureKind::Refused, "the server sent nothing"))?;
    Ok(Transferred { bytes: transfer.bytes, version })
}

struct Transfer<'a> {
    address: &'a Address,
    range: Range<u64>,
    /// What is known of the file.
    version: Option<Version>,
    /// What has come so far.
    bytes: Vec<u8>,
}

impl Transfer<'_> {
    /// Asks for what has not come yet.
    fn attempt(&mut self) -> Result<(), Failure> {
        let first = self.range.start + self.bytes.len() as u64;
        let mut headers: Headers = vec![("range", format!("bytes={first}-{}", self.range.end - 1))];
        let tag = self.version.as_ref().and_then(|version| version.tag.as_ref());
        // No tag matches that is marked as weak.
        headers.extend(tag.filter(|tag| tag.starts_with('"')).map(|tag| ("if-match", tag.clone())));
        let answer = self.address.ask(&headers)?;
        match answer.status().as_u16() {
            206 => self.take(answer, first),
            200 if self.version.is_none() && answer.body().content_length() == Some(0) => {
                self.version = Some(Version::of(answer.headers(), 0));
                Ok(())
            }
            200 => Err(Failure::new(
                FailureKind::Unsuitable,
                "the server does not send parts of files (it ignores the header Range): download the file and name the copy",
            )),
            412 => Err(changed("the server says 412 Precondition Failed")),
            // Nobody has a part of an empty file.
            416 if self.version.is_none() && size_after(answer.headers()).unwrap_or(0) == 0 => {
                self.version = Some(Version::of(answer.headers(), 0));
                Ok(())
            }
            416 => Err(changed("the server says 416 Range Not Satisfiable")),
            _ => Err(refusal(answer, self.address)),
        }
    }

    /// Takes the bytes of an answer, which must begin at `first`.
    fn take(&mut self, answer: Response<Body>, first: u64) -> Result<(), Failure> {
        let refused = |what: &str| Failure::new(FailureKind::Refused, format!("the server {what}"));
        let headers = answer.headers();
        if headers.get(header::CONTENT_ENCODING).is_some_and(|coding| coding != "identity") {
            return Err(refused("sends a part of a packed file where the file was asked for"));
        }
        let (start, size) =
            place_of_part(headers).ok_or_else(|| refused("does not say which part of the file it sends"))?;
        if start != first {
            return Err(refused(&format!("sends the file from byte {start} on, not from {first}")));
        }
        let now = Version::of(headers, size);
        if let Some(change) = self.version.as_ref().and_then(|known| known.change(&now)) {
            return Err(changed(&change));
        }
        self.version.get_or_insert(now);
        self.range.end = self.range.end.min(size);
        let wanted = (self.range.end - self.range.start) as usize;
        let mut body = answer.into_body().into_reader();
        while self.bytes.len() < wanted {
            let before = self.bytes.len();
            self.bytes.resize((before + PIECE).min(wanted), 0);
            let came = body.read(&mut self.bytes[before..]);
            self.bytes.truncate(before + *came.as_ref().unwrap_or(&0));
            let missing = wanted - before;
            count_bytes(self.bytes.len() - before);
            match came {
                Ok(0) => {
                    return Err(Failure::new(
                        FailureKind::Passing,
                        format!("the answer ended {missing} bytes too early"),
                    ));
                }
                Ok(_) => {}
                Err(error) => {
                    let what = format!("the answer broke off {missing} bytes too early: {error}");
                    return Err(Failure::new(FailureKind::Passing, what));
                }
            }
        }
        // The connection is used again only if the end of the body was seen.
        let _ = body.read(&mut [0]);
        Ok(())
    }
}

fn changed(how: &str) -> Failure {
    let what = format!("it has changed while it was in use ({how}); run again when it is complete");
    Failure::new(FailureKind::Refused, what)
}

/// Returns the first byte of the part that an answer has, and the size of the file.
fn place_of_part(headers: &HeaderMap) -> Option<(u64, u64)> {
    let (part, size) = content_range(headers)?.split_once('/')?;
    Some((part.split_once('-')?.0.trim().parse().ok()?, size.trim().parse().ok()?))
}

/// Returns the size of a file of which no part is where one was asked for.
fn size_after(headers: &HeaderMap) -> Option<u64> {
    content_range(headers)?.strip_prefix("*/")?.trim().parse().ok()
}

fn content_range(headers: &HeaderMap) -> Option<&str> {
    let value = headers.get(header::CONTENT_RANGE)?.to_str().ok()?;
    value.trim().strip_prefix("bytes").map(|rest| rest.trim_start_matches([' ', '=']))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_place_of_a_part_is_read() {
        let headers = |value: &str| HeaderMap::from_iter([(header::CONTENT_RANGE, value.parse().unwrap())]);
        assert_eq!(place_of_part(&headers("bytes 10-19/100")), Some((10, 100)));
        for broken in ["bytes 10-19/*", "10-19/100", "bytes */100", "bytes ", "bytes -/", "lines 1-2/3"] {
            assert_eq!(place_of_part(&headers(broken)), None, "{broken}");
        }
        assert_eq!(size_after(&headers("bytes */0")), Some(0));
    }

    #[test]
    fn a_change_is_told_by_the_size_the_tag_and_the_time() {
        let version = |size, tag: &str, modified: &str| {
            let some = |text: &str| (!text.is_empty()).then(|| text.to_string());
            Version { size, tag: some(tag), modified: some(modified) }
        };
        let known = version(5, "\"a\"", "Monday");
        assert_eq!(known.change(&known.clone()), None);
        assert_eq!(known.change(&version(5, "\"a\"", "Tuesday")), None);
        assert_eq!(known.change(&version(5, "", "Tuesday")).unwrap(), "from Monday to Tuesday");
        assert_eq!(known.change(&version(5, "\"b\"", "Monday")).unwrap(), "from \"a\" to \"b\"");
        assert_eq!(known.change(&version(6, "\"a\"", "Monday")).unwrap(), "from 5 bytes to 6");
        let silent = version(5, "", "");
        assert!(!silent.is_sure() && silent.hash(b"a") != silent.hash(b"b"));
        assert_eq!(known.hash(b"a"), known.hash(b"b"));
    }
}
