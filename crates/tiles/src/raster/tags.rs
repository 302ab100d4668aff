//! The directories of a TIFF file, in little-endian order, classic or BigTIFF.

/// What stands before the first directory depends on how long offsets are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TiffKind {
    /// Offsets of 32 bits.
    Classic,
    /// Offsets of 64 bits.
    Big,
}

impl TiffKind {
    /// Returns the first bytes of the file, up to the offset of the first directory.
    pub(crate) fn magic(self) -> &'static [u8] {
        match self {
            TiffKind::Classic => b"II\x2a\0",
            TiffKind::Big => b"II\x2b\0\x08\0\0\0",
        }
    }

    /// Returns the bytes of an offset, which are also those of the place for a tag's values in its entry.
    pub(crate) fn offset_bytes(self) -> usize {
        match self {
            TiffKind::Classic => 4,
            TiffKind::Big => 8,
        }
    }

    /// Appends an offset, or a number of the same length.
    pub(crate) fn push(self, value: u64, bytes: &mut Vec<u8>) {
        bytes.extend_from_slice(&value.to_le_bytes()[..self.offset_bytes()]);
    }

    /// Returns the bytes of the number of entries of a directory.
    pub(crate) fn count_bytes(self) -> usize {
        match self {
            TiffKind::Classic => 2,
            TiffKind::Big => 8,
        }
    }
}

/// The values of a tag.
#[derive(Clone, Debug)]
pub(crate) enum TagValues {
    Text(String),
    Short(Vec<u16>),
    Long(Vec<u32>),
    Double(Vec<f64>),
    /// Offsets in the file: as long as the kind of the file has them.
    Offsets(Vec<u64>),
}

impl TagValues {
    /// Returns the number of the type, the number of values and their bytes.
    fn encoded(&self, kind: TiffKind) -> (u16, u64, Vec<u8>) {
        match self {
            TagValues::Text(text) => {
                let bytes = [text.as_bytes(), &[0]].concat();
                (2, bytes.len() as u64, bytes)
            }
            TagValues::Short(values) => (3, values.len() as u64, values.iter().flat_map(|v| v.to_le_bytes()).collect()),
            TagValues::Long(values) => (4, values.len() as u64, values.iter().flat_map(|v| v.to_le_bytes()).collect()),
            TagValues::Double(values) => {
                (12, values.len() as u64, values.iter().flat_map(|v| v.to_le_bytes()).collect())
            }
            TagValues::Offsets(values) => {
                let mut bytes = Vec::with_capacity(values.len() * kind.offset_bytes());
                values.iter().for_each(|value| kind.push(*value, &mut bytes));
                (if kind == TiffKind::Big { 16 } else { 4 }, values.len() as u64, bytes)
            }
        }
    }
}

/// Appends a directory with these tags, in ascending order, and behind it their values. `bytes` begin where the file does.
pub(crate) fn push_directory(tags: &[(u16, TagValues)], is_last: bool, kind: TiffKind, bytes: &mut Vec<u8>) {
    bytes.resize(bytes.len().next_multiple_of(2), 0);
    let entry = 4 + 2 * kind.offset_bytes();
    let mut values_at = bytes.len() + kind.count_bytes() + tags.len() * entry + kind.offset_bytes();
    let mut values: Vec<u8> = Vec::new();
    bytes.extend_from_slice(&(tags.len() as u64).to_le_bytes()[..kind.count_bytes()]);
    for (tag, content) in tags {
        let (code, count, content) = content.encoded(kind);
        bytes.extend([tag.to_le_bytes(), code.to_le_bytes()].concat());
        kind.push(count, bytes);
        if content.len() <= kind.offset_bytes() {
            bytes.extend_from_slice(&content);
            bytes.resize(bytes.len() + kind.offset_bytes() - content.len(), 0);
        } else {
            kind.push(values_at as u64, bytes);
            values_at += content.len().next_multiple_of(2);
            values.extend_from_slice(&content);
            values.resize(values.len().next_multiple_of(2), 0);
        }
    }
    let next = if is_last { 0 } else { values_at as u64 };
    kind.push(next, bytes);
    bytes.extend_from_slice(&values);
}
