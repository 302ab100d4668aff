//! Reading attributes from the `.dbf` of a Shapefile: a table of texts of fixed widths, record by record.

use std::fs::File;
use std::io::{BufReader, ErrorKind, Read};
use std::path::{Path, PathBuf};

use crate::lines::attribute::{Attribute, NAME_FIELD, WantedAttributes, no_attribute};
use crate::lines::encoding::Encoding;
use sys::{Error, Result};

/// Bytes of the header before the fields, and of a field's description.
const HEADER: usize = 32;
const FIELD: usize = 32;

/// The table, and the columns that the options name.
pub(super) struct DbfTable {
    path: PathBuf,
    file: BufReader<File>,
    /// The record that was read last.
    record: Vec<u8>,
    encoding: Encoding,
    kind: Option<DbfField>,
    height: Option<DbfField>,
    name: Option<DbfField>,
}

/// A column.
#[derive(Clone)]
struct DbfField {
    name: String,
    /// C for texts; N and F for numbers, as texts; I and O for binary numbers.
    type_letter: u8,
    /// Where it begins in a record, and its bytes.
    at: usize,
    width: usize,
}

impl DbfTable {
    /// Opens the file at `path`, for the attributes of these names. Its texts are in this encoding.
    ///
    /// # Errors
    /// `Io` if it cannot be read, `Input` if it is no such table or lacks one of the attributes.
    pub(super) fn open(
        path: &Path,
        encoding: Encoding,
        kind: Option<&str>,
        height: Option<&str>,
        is_named: bool,
    ) -> Result<DbfTable> {
        let failed = |error| Error::io("read", path)(error);
        let mut file = BufReader::new(File::open(path).map_err(failed)?);
        let mut header = vec![0; HEADER];
        let held = read_up_to(&mut file, &mut header).map_err(failed)?;
        header.truncate(held);
        // The header says its length.
        let start = header.get(8..10).map_or(0, |word| usize::from(word[0]) | usize::from(word[1]) << 8);
        header.resize(start.max(held), 0);
        let held = held + read_up_to(&mut file, &mut header[held..]).map_err(failed)?;
        header.truncate(held);
        let damaged = || Error::input(path, "is damaged or not a dBASE table: copy all files of the Shapefile again");
        let (record, fields) = layout(&header, start).ok_or_else(damaged)?;
        let find = |name: Option<&str>| match name {
            None => Ok(None),
            Some(name) => match fields.iter().find(|field| field.name.eq_ignore_ascii_case(name)) {
                Some(field) => Ok(Some(field.clone())),
                None => {
                    let there: Vec<String> = fields.iter().map(|field| field.name.clone()).collect();
                    Err(Error::input(path, no_attribute(name, &there)))
                }
            },
        };
        let (kind, height) = (find(kind)?, find(height)?);
        let name = fields.iter().find(|field| is_named && field.name.eq_ignore_ascii_case(NAME_FIELD)).cloned();
        Ok(DbfTable { path: path.to_path_buf(), file, record: vec![0; record], encoding, kind, height, name })
    }

    /// Returns the wanted attributes of the next record, or what is wrong with it, without its subject.
    ///
    /// # Errors
    /// `Io` if the file cannot be read.
    pub(super) fn next_record(&mut self) -> Result<std::result::Result<WantedAttributes, String>> {
        let held = read_up_to(&mut self.file, &mut self.record).map_err(Error::io("read", &self.path))?;
        if held < self.record.len() {
            return Ok(Err("has no record in the .dbf, which is cut off or belongs to another file".into()));
        }
        let value = |field: &Option<DbfField>| {
            field.as_ref().map_or(Ok(Attribute::Missing), |field| field.value(&self.record, &self.encoding))
        };
        let wanted = || {
            Ok(WantedAttributes { kind: value(&self.kind)?, height: value(&self.height)?, name: value(&self.name)? })
        };
        Ok(wanted())
    }
}

/// Fills `bytes` as far as the file goes. Returns how many there are.
fn read_up_to(file: &mut impl Read, bytes: &mut [u8]) -> std::io::Result<usize> {
    let mut held = 0;
    while held < bytes.len() {
        match file.read(&mut bytes[held..]) {
            Ok(0) => break,
            Ok(count) => held += count,
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(held)
}

impl DbfField {
    fn value(&self, record: &[u8], encoding: &Encoding) -> std::result::Result<Attribute, String> {
        let bytes = &record[self.at..self.at + self.width];
        Ok(match (self.type_letter, bytes) {
            (b'I', &[a, b, c, d]) => Attribute::Number(f64::from(i32::from_le_bytes([a, b, c, d]))),
            (b'O', bytes) if bytes.len() == 8 => {
                let mut eight = [0; 8];
                eight.copy_from_slice(bytes);
                Attribute::Number(f64::from_le_bytes(eight))
            }
            _ => {
                let text = encoding.text(bytes)?;
                let text = text.trim_matches(['\0', ' ']);
                // Numbers that do not fit, or are not there, are stars or blanks.
                let is_missing = text.is_empty() || text.bytes().all(|byte| byte == b'*');
                let is_number = matches!(self.type_letter, b'N' | b'F');
                match text.parse() {
                    _ if is_missing => Attribute::Missing,
                    Ok(number) if is_number => Attribute::Number(number),
                    _ => Attribute::Text(text.to_string()),
                }
            }
        })
    }
}

/// Returns the bytes of a record and the columns of the header `bytes`, after which records begin at `start`; `None` if the table is
/// damaged.
fn layout(bytes: &[u8], start: usize) -> Option<(usize, Vec<DbfField>)> {
    let word = |at: usize| Some(usize::from(*bytes.get(at)?) | usize::from(*bytes.get(at + 1)?) << 8);
    let record = word(10)?;
    let described = bytes.get(HEADER..start)?;
    let mut fields = Vec::new();
    // The first byte of a record says whether it is deleted.
    let mut at = 1;
    for field in described.chunks_exact(FIELD).take_while(|field| field[0] != b'\r') {
        let name = field[..11].split(|&byte| byte == 0).next().unwrap_or_default();
        let width = usize::from(field[16]);
        fields.push(DbfField {
            name: String::from_utf8_lossy(name).trim().to_string(),
            type_letter: field[11],
            at,
            width,
        });
        at += width;
    }
    (at <= record).then_some((record, fields))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A table with the columns KIND (text) and Z (number), and a record of each pair.
    fn table(records: &[(&str, &str)]) -> Vec<u8> {
        let (start, record) = (HEADER + 2 * FIELD + 1, 1 + 8 + 10);
        let mut bytes = vec![0; HEADER];
        bytes[0] = 3;
        bytes[8..10].copy_from_slice(&(start as u16).to_le_bytes());
        bytes[10..12].copy_from_slice(&(record as u16).to_le_bytes());
        for (name, letter, width) in [("KIND", b'C', 8), ("Z", b'N', 10)] {
            let mut field = [0; FIELD];
            field[..name.len()].copy_from_slice(name.as_bytes());
            (field[11], field[16]) = (letter, width);
            bytes.extend(field);
        }
        bytes.push(b'\r');
        records.iter().for_each(|(kind, z)| bytes.extend(format!(" {kind:<8}{z:>10}").bytes()));
        bytes
    }

    fn read(bytes: &[u8], kind: &str, height: &str) -> Result<DbfTable> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.dbf");
        std::fs::write(&path, bytes).unwrap();
        DbfTable::open(&path, Encoding::of(None), Some(kind), Some(height), false)
    }

    #[test]
    fn texts_and_numbers_are_read() {
        let mut dbf = read(&table(&[("river", "12.5"), ("", "*****")]), "kind", "Z").unwrap();
        let first = WantedAttributes {
            kind: Attribute::Text("river".into()),
            height: Attribute::Number(12.5),
            ..WantedAttributes::NONE
        };
        assert_eq!(dbf.next_record().unwrap(), Ok(first));
        assert_eq!(dbf.next_record().unwrap(), Ok(WantedAttributes::NONE));
        assert!(dbf.next_record().unwrap().unwrap_err().contains("no record"));
        let error = read(&table(&[]), "KIND", "HEIGHT").err().unwrap().to_string();
        assert!(error.contains("\"HEIGHT\"") && error.contains("it has KIND, Z"), "{error}");
    }

    #[test]
    fn a_damaged_table_is_named() {
        let sound = table(&[("river", "1")]);
        for length in 0..HEADER + 2 * FIELD {
            assert!(read(&sound[..length], "KIND", "Z").is_err(), "{length}");
        }
        let mut wide = sound.clone();
        wide[HEADER + 16] = 255;
        assert!(read(&wide, "KIND", "Z").err().unwrap().to_string().contains("damaged"));
        assert!(read(&sound[..sound.len() - 1], "KIND", "Z").unwrap().next_record().unwrap().is_err());
    }

    #[test]
    fn texts_that_are_no_utf_8_are_read() {
        let mut latin = table(&[("B..sch", "1")]);
        let at = latin.len() - 18 + 1;
        latin[at..at + 2].copy_from_slice(&[0xf6, 0x80]);
        let wanted = read(&latin, "KIND", "Z").unwrap().next_record().unwrap().unwrap();
        assert_eq!(wanted.kind, Attribute::Text("Bö€sch".into()));
    }
}
