//! The variable length records of a LAS file, ordinary and extended: where they are, checked against the file's size.

use std::ops::Range;

use crate::file::random_access::RandomAccessFile;
use crate::las::header::LasHeader;
use sys::bytes::{uint16, uint64};
use sys::{Result, Warnings};

/// The number of bytes before the data of a variable length record.
pub(crate) const HEAD: u64 = 54;

/// The number of bytes before the data of an extended variable length record.
pub(crate) const EXTENDED_HEAD: u64 = 60;

/// The most records that are looked at; real files have a few.
const MOST: u32 = 10_000;

/// The longest record that is read, in bytes. The text of a coordinate system has some thousand bytes.
const LONGEST: u64 = 1 << 20;

/// One variable length record.
#[derive(Clone, Debug)]
pub(crate) struct Vlr {
    user: String,
    id: u16,
    data: Range<u64>,
}

impl Vlr {
    /// Returns whether this is the record `id` of `user`.
    pub(crate) fn is(&self, user: &str, id: u16) -> bool {
        self.id == id && self.user == user
    }

    /// Returns whether `user` has defined this record.
    pub(crate) fn is_of(&self, user: &str) -> bool {
        self.user == user
    }

    /// Returns where the record's data are in the file.
    pub(crate) fn bytes(&self) -> Range<u64> {
        self.data.clone()
    }

    /// Reads the record's data. The data of a record that is longer than 1 MiB counts as empty.
    pub(crate) fn read(&self, file: &RandomAccessFile) -> Result<Vec<u8>> {
        if self.data.end - self.data.start > LONGEST { Ok(Vec::new()) } else { file.bytes(self.data.clone()) }
    }
}

/// Lists all records that lie in the file. Warns if the header promises more.
pub(crate) fn list(file: &RandomAccessFile, header: &LasHeader, warnings: &mut Warnings) -> Result<Vec<Vlr>> {
    let ordinary = VlrSequence { range: header.size..header.points_at, count: header.vlrs, head: HEAD };
    let mut vlrs = ordinary.walk(file)?;
    if (vlrs.len() as u32) < header.vlrs.min(MOST) {
        warnings.push(format!(
            "its header gives {} variable length records, but only {} fit before the points",
            header.vlrs,
            vlrs.len()
        ));
    }
    let (at, count) = header.evlrs;
    if count > 0 {
        let extended = VlrSequence { range: at..file.size(), count, head: EXTENDED_HEAD };
        let found = if at >= header.points_at { extended.walk(file)? } else { Vec::new() };
        if (found.len() as u32) < count.min(MOST) {
            warnings.push(format!(
                "its header gives {count} extended variable length records at byte {at}, but only {} are there",
                found.len()
            ));
        }
        vlrs.extend(found);
    }
    Ok(vlrs)
}

/// A range of the file that holds records one after the other.
struct VlrSequence {
    range: Range<u64>,
    count: u32,
    /// The number of bytes before the data of each record.
    head: u64,
}

impl VlrSequence {
    fn walk(&self, file: &RandomAccessFile) -> Result<Vec<Vlr>> {
        let mut vlrs = Vec::new();
        let mut at = self.range.start;
        while (vlrs.len() as u32) < self.count.min(MOST) && fits(at, self.head, self.range.end) {
            let mut head = [0; EXTENDED_HEAD as usize];
            file.read_exact_at(&mut head[..self.head as usize], at)?;
            let length = if self.head == HEAD { uint16(&head, 20) as u64 } else { uint64(&head, 20) };
            if !fits(at + self.head, length, self.range.end) {
                break;
            }
            let user = head[2..18].split(|&b| b == 0).next().unwrap_or_default();
            let user = String::from_utf8_lossy(user).into_owned();
            let data = at + self.head..at + self.head + length;
            at = data.end;
            vlrs.push(Vlr { user, id: uint16(&head, 18), data });
        }
        Ok(vlrs)
    }
}

fn fits(at: u64, length: u64, end: u64) -> bool {
    at.checked_add(length).is_some_and(|last| last <= end)
}
