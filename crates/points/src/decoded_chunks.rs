//! Which chunks of a source are decoded, if an index and bounds leave some out.

/// The chunks of a source of which something is decoded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DecodedChunks {
    count: usize,
    /// Their numbers; `None` for all.
    listed: Option<Vec<usize>>,
    /// The number of records that are decoded.
    pub records: u64,
}

impl DecodedChunks {
    /// Returns all chunks of a source that has so many chunks and records.
    pub(crate) fn all(count: usize, records: u64) -> DecodedChunks {
        DecodedChunks { count, listed: None, records }
    }

    /// Returns the chunks of a source that have records to decode. `records` has their number for each chunk.
    pub(crate) fn listed(records: impl Iterator<Item = u64>) -> DecodedChunks {
        let some: Vec<(usize, u64)> = records.enumerate().filter(|(_, records)| *records > 0).collect();
        let records = some.iter().map(|(_, records)| records).sum();
        DecodedChunks { count: some.len(), listed: Some(some.into_iter().map(|(chunk, _)| chunk).collect()), records }
    }

    /// Returns how many there are.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Returns whether there is none.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Returns whether an index tells which chunks there are.
    pub fn are_listed(&self) -> bool {
        self.listed.is_some()
    }

    /// Returns the number in the source of the one with this `index` below [`DecodedChunks::len`].
    pub fn chunk(&self, index: usize) -> usize {
        self.listed.as_ref().map_or(index, |listed| listed[index])
    }
}
