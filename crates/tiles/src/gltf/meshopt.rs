//! Buffer views that `EXT_meshopt_compression` packs: their description, and how to unpack them.

use bytemuck::allocation::{pod_collect_to_vec, try_cast_vec};
use bytemuck::{cast, cast_slice_mut};
use gltf::json::{Value, buffer, extensions};
use serde::{Deserialize, Serialize};
use serde_json::{Map, json};

use crate::gltf::check_json::Decoded;
use crate::gltf::encoding::{from_exponential, from_long_octahedral, from_octahedral};
use crate::gltf::schema::MESHOPT;

/// Bytes of a tile in memory for every byte of its file, at most: the vertex codec unpacks one byte to up to 64, and 2-byte positions
/// become 4-byte ones.
pub(crate) const MOST_EXPANSION: u64 = 128;

/// Bytes that one packed byte stands for, at most: the vertex codec spends at least two bits on sixteen bytes.
const MOST_VERTEX_RATIO: u64 = 64;

/// The extension's object in a buffer view.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "camelCase")]
pub(crate) struct PackedView {
    pub(crate) buffer: usize,
    #[serde(default)]
    pub(crate) byte_offset: u64,
    pub(crate) byte_length: u64,
    pub(crate) byte_stride: u64,
    pub(crate) count: u64,
    pub(crate) mode: PackedMode,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) filter: Option<PackedFilter>,
}

/// What is packed.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub(crate) enum PackedMode {
    Attributes,
    Triangles,
}

/// What follows unpacking: the filters of the extension that this program uses.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub(crate) enum PackedFilter {
    Octahedral,
    Exponential,
}

impl PackedView {
    /// Reads the extension of `view`, which may have no other extension.
    pub(crate) fn of(view: &buffer::View) -> Decoded<Option<PackedView>> {
        let Some(extensions) = &view.extensions else { return Ok(None) };
        match extensions.others.keys().find(|name| *name != MESHOPT) {
            Some(other) => Err(format!("unknown extension {other}")),
            None => extensions.others.get(MESHOPT).map(PackedView::deserialize).transpose().map_err(|e| e.to_string()),
        }
    }

    /// Returns the extensions of the view.
    pub(crate) fn to_extensions(self) -> extensions::buffer::View {
        extensions::buffer::View { others: only_meshopt(json!(self)) }
    }

    /// Returns the number of bytes of the view when unpacked, or `None` if that number is too large.
    pub(crate) fn unpacked_length(&self) -> Option<u64> {
        self.count.checked_mul(self.byte_stride)
    }

    /// Checks that so many `packed` bytes can hold what the view says, before memory is taken for it.
    fn check_length(&self, packed: &[u8]) -> Decoded<()> {
        let length = self.unpacked_length().unwrap_or(u64::MAX);
        let plausible = match self.mode {
            PackedMode::Attributes => length / MOST_VERTEX_RATIO <= packed.len() as u64,
            PackedMode::Triangles => self.count / 3 <= packed.len() as u64 && self.count.is_multiple_of(3),
        };
        match plausible {
            true => Ok(()),
            false => Err(format!("{} packed bytes cannot hold {} elements", packed.len(), self.count)),
        }
    }

    /// Unpacks the view's bytes, but for the filter. The result is a sentence if `packed` is not what the view says.
    pub(crate) fn unpack_unfiltered(&self, packed: &[u8]) -> Decoded<Vec<u8>> {
        self.check_length(packed)?;
        let count = self.count as usize;
        let unpacked = match (self.mode, self.byte_stride) {
            (PackedMode::Attributes, 4) => vertices::<4>(packed, count),
            (PackedMode::Attributes, 8) => vertices::<8>(packed, count),
            (PackedMode::Attributes, 12) => vertices::<12>(packed, count),
            (PackedMode::Triangles, 2) => {
                meshopt::decode_index_buffer::<u16>(packed, count).ok().map(|v| pod_collect_to_vec(&v))
            }
            (PackedMode::Triangles, 4) => {
                meshopt::decode_index_buffer::<u32>(packed, count).ok().map(|v| pod_collect_to_vec(&v))
            }
            (_, stride) => return Err(format!("packed elements of {stride} bytes")),
        };
        unpacked.ok_or_else(|| "packed data are damaged".into())
    }

    /// Unpacks triangles from the view's bytes, whether it has them in 16 or in 32 bits. Corners may be out of range.
    pub(crate) fn unpack_triangles(&self, packed: &[u8]) -> Decoded<Vec<[u32; 3]>> {
        self.check_length(packed)?;
        let corners = meshopt::decode_index_buffer::<u32>(packed, self.count as usize);
        let corners = corners.map_err(|_| "packed data are damaged")?;
        let copied = |corners: Vec<u32>| corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
        Ok(try_cast_vec(corners).unwrap_or_else(|(_, corners)| copied(corners)))
    }

    /// Unpacks the view's bytes. The result is a sentence if `packed` is not what the view says.
    pub(crate) fn unpack(&self, packed: &[u8]) -> Decoded<Vec<u8>> {
        let mut unpacked = self.unpack_unfiltered(packed)?;
        match (self.filter, self.byte_stride) {
            (None, _) => {}
            (Some(PackedFilter::Octahedral), 4) => {
                let normals = cast_slice_mut::<u8, [i8; 4]>(&mut unpacked);
                normals.iter_mut().for_each(|normal| *normal = from_octahedral(*normal));
            }
            (Some(PackedFilter::Octahedral), 8) => {
                let normals = cast_slice_mut::<u8, [u8; 8]>(&mut unpacked);
                normals.iter_mut().for_each(|normal| *normal = cast(from_long_octahedral(cast(*normal))));
            }
            (Some(PackedFilter::Exponential), stride) if stride % 4 == 0 => {
                let numbers = cast_slice_mut::<u8, [u8; 4]>(&mut unpacked);
                numbers.iter_mut().for_each(|v| *v = from_exponential(u32::from_le_bytes(*v)).to_le_bytes());
            }
            (Some(PackedFilter::Exponential), stride) => return Err(format!("packed numbers of {stride} bytes")),
            (Some(PackedFilter::Octahedral), stride) => return Err(format!("packed normals of {stride} bytes")),
        }
        Ok(unpacked)
    }
}

/// Returns the extensions of the buffer of the unpacked data, which no file holds.
pub(crate) fn fallback_buffer() -> extensions::buffer::Buffer {
    extensions::buffer::Buffer { others: only_meshopt(json!({"fallback": true})) }
}

fn only_meshopt(value: Value) -> Map<String, Value> {
    Map::from_iter([(MESHOPT.to_string(), value)])
}

fn vertices<const SIZE: usize>(packed: &[u8], count: usize) -> Option<Vec<u8>>
where
    [u8; SIZE]: Default,
{
    // The extension has version 0 only, and other versions have no bound on the ratio.
    if meshopt::decode_vertex_version(packed) != Some(0) {
        return None;
    }
    meshopt::decode_vertex_buffer::<[u8; SIZE]>(packed, count).ok().map(Vec::into_flattened)
}
