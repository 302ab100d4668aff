//! What `EXT_meshopt_compression` says of a view, and how to unpack it.

use bytemuck::allocation::pod_collect_to_vec;
use bytemuck::cast_slice_mut;
use serde::Deserialize;

use crate::output::gltf::encoding::{from_exponential, from_octahedral};

/// Bytes of a tile in memory for every byte of its file, at most: the codec of vertices makes up to 64 of one, and 2-byte
/// positions become 4-byte ones.
pub(crate) const MOST_EXPANSION: u64 = 128;

/// A vertex codec spends at least two bits on sixteen bytes.
const MOST_VERTEX_RATIO: u64 = 64;

/// The extension's object of a buffer view.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "camelCase")]
pub(crate) struct Packed {
    pub(crate) buffer: usize,
    #[serde(default)]
    pub(crate) byte_offset: u64,
    pub(crate) byte_length: u64,
    byte_stride: u64,
    count: u64,
    mode: Mode,
    filter: Option<Filter>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
enum Mode {
    Attributes,
    Triangles,
}

/// Those of the extension's filters that this program uses.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
enum Filter {
    Octahedral,
    Exponential,
}

impl Packed {
    /// Bytes of the view when unpacked.
    pub(crate) fn unpacked_length(&self) -> Option<u64> {
        self.count.checked_mul(self.byte_stride)
    }

    /// The view's bytes from `packed`; a sentence where that is not what it says.
    pub(crate) fn unpack(&self, packed: &[u8]) -> Result<Vec<u8>, String> {
        let length = self.unpacked_length().unwrap_or(u64::MAX);
        let plausible = match self.mode {
            Mode::Attributes => length / MOST_VERTEX_RATIO <= packed.len() as u64,
            Mode::Triangles => self.count / 3 <= packed.len() as u64 && self.count.is_multiple_of(3),
        };
        if !plausible {
            return Err(format!("{} packed bytes cannot hold {} elements", packed.len(), self.count));
        }
        let count = self.count as usize;
        let unpacked = match (self.mode, self.byte_stride) {
            (Mode::Attributes, 4) => vertices::<4>(packed, count),
            (Mode::Attributes, 8) => vertices::<8>(packed, count),
            (Mode::Attributes, 12) => vertices::<12>(packed, count),
            (Mode::Triangles, 2) => {
                meshopt::decode_index_buffer::<u16>(packed, count).ok().map(|v| pod_collect_to_vec(&v))
            }
            (Mode::Triangles, 4) => {
                meshopt::decode_index_buffer::<u32>(packed, count).ok().map(|v| pod_collect_to_vec(&v))
            }
            (_, stride) => return Err(format!("packed elements of {stride} bytes")),
        };
        let mut unpacked = unpacked.ok_or("packed data are damaged")?;
        match (self.filter, self.byte_stride) {
            (None, _) => {}
            (Some(Filter::Octahedral), 4) => {
                let normals = cast_slice_mut::<u8, [i8; 4]>(&mut unpacked);
                normals.iter_mut().for_each(|normal| *normal = from_octahedral(*normal));
            }
            (Some(Filter::Exponential), stride) if stride % 4 == 0 => {
                let numbers = cast_slice_mut::<u8, [u8; 4]>(&mut unpacked);
                numbers.iter_mut().for_each(|v| *v = from_exponential(u32::from_le_bytes(*v)).to_le_bytes());
            }
            (Some(Filter::Exponential), stride) => return Err(format!("packed numbers of {stride} bytes")),
            (Some(Filter::Octahedral), stride) => return Err(format!("packed normals of {stride} bytes")),
        }
        Ok(unpacked)
    }
}

fn vertices<const SIZE: usize>(packed: &[u8], count: usize) -> Option<Vec<u8>>
where
    [u8; SIZE]: Default,
{
    // The extension knows version 0 only, and the others have no bound on the ratio.
    if meshopt::decode_vertex_version(packed) != Some(0) {
        return None;
    }
    meshopt::decode_vertex_buffer::<[u8; SIZE]>(packed, count).ok().map(Vec::into_flattened)
}
