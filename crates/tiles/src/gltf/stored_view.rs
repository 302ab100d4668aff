//! Where the data of a buffer view are in the file.

use std::borrow::Cow;

use gltf::json::buffer::View;

use crate::gltf::check_json::Decoded;
use crate::gltf::meshopt::{PackedFilter, PackedMode, PackedView};

/// The data of a buffer view in the binary chunk, packed or not.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StoredView {
    buffer: usize,
    start: u64,
    length: u64,
    packed: Option<PackedView>,
}

impl StoredView {
    /// Returns where `view` has its data.
    pub(crate) fn of(view: &View) -> Decoded<StoredView> {
        let packed = PackedView::of(view)?;
        let (buffer, start, length) = match &packed {
            Some(packed) => (packed.buffer, packed.byte_offset, packed.byte_length),
            None => (view.buffer.value(), view.byte_offset.map_or(0, |offset| offset.0), view.byte_length.0),
        };
        Ok(StoredView { buffer, start, length, packed })
    }

    /// Returns the view's bytes as they are in the `binary` chunk.
    pub(crate) fn stored<'a>(&self, binary: &'a [u8]) -> Decoded<&'a [u8]> {
        let end = self.start.checked_add(self.length).and_then(|end| usize::try_from(end).ok());
        let bytes = end.and_then(|end| binary.get(self.start as usize..end)).filter(|_| self.buffer == 0);
        bytes.ok_or_else(|| "a buffer view goes past the end of the data".into())
    }

    /// Returns what the view shows, from its `stored` bytes.
    pub(crate) fn unpack<'a>(&self, stored: &'a [u8]) -> Decoded<Cow<'a, [u8]>> {
        match &self.packed {
            Some(packed) => packed.unpack(stored).map(Cow::Owned),
            None => Ok(Cow::Borrowed(stored)),
        }
    }

    /// Returns what the view shows, from its `stored` bytes, before the filter.
    pub(crate) fn unpack_unfiltered<'a>(&self, stored: &'a [u8]) -> Decoded<Cow<'a, [u8]>> {
        match &self.packed {
            Some(packed) => packed.unpack_unfiltered(stored).map(Cow::Owned),
            None => Ok(Cow::Borrowed(stored)),
        }
    }

    /// Returns how the view's triangles are packed, if they are.
    pub(crate) fn packed_triangles(&self) -> Option<PackedView> {
        self.packed.filter(|packed| matches!(packed.mode, PackedMode::Triangles))
    }

    /// Returns the bytes of a packed element, if the view is packed.
    pub(crate) fn packed_stride(&self) -> Option<u64> {
        self.packed.map(|packed| packed.byte_stride)
    }

    /// Returns the filter that follows unpacking.
    pub(crate) fn filter(&self) -> Option<PackedFilter> {
        self.packed.and_then(|packed| packed.filter)
    }

    /// Returns the number of bytes that the view shows.
    pub(crate) fn unpacked_length(&self) -> u64 {
        self.packed.map_or(Some(self.length), |packed| packed.unpacked_length()).unwrap_or(u64::MAX)
    }
}
