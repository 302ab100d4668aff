//! The JSON chunk of a GLB. The types of `gltf-json` are its one description: for writing here, for reading in
//! [`crate::gltf::check_json`].

use std::io;

use gltf::json::Root;
use serde::Serialize;
use serde_json::ser::{Formatter, Serializer};
use serde_json::{Value, json};

use sys::{Error, Result};

/// The name of this program and its version, which every file carries.
pub(crate) const GENERATOR: &str = concat!("gdt-batch ", env!("CARGO_PKG_VERSION"));

/// The extension of packed buffer views.
pub(crate) const MESHOPT: &str = "EXT_meshopt_compression";

/// The extension of positions and normals in integers.
pub(crate) const QUANTIZATION: &str = "KHR_mesh_quantization";

/// Linear colour of a terrain without vertex colours.
const PLAIN: [f64; 4] = [0.52, 0.5, 0.45, 1.0];

/// Returns `root` as JSON text, with the one material of a terrain if it has any meshes; `colored` says whether they have
/// vertex colours.
pub(crate) fn to_text(root: &Root, colored: bool) -> Result<Vec<u8>> {
    let materials = (!root.meshes.is_empty()).then(|| [material(colored)]);
    let mut text = Vec::new();
    let written = Document { root, materials }.serialize(&mut Serializer::with_formatter(&mut text, ExactFloats));
    written.map_err(|e| Error::Broken(format!("the description of a tile cannot be written: {e}")))?;
    Ok(text)
}

/// A root and its material. The crate's own material would write every default and the digits that single precision gives a colour.
#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    root: &'a Root,
    #[serde(skip_serializing_if = "Option::is_none")]
    materials: Option<[Value; 1]>,
}

/// Returns a dull material seen from both sides, white under vertex colours, which it multiplies.
fn material(colored: bool) -> Value {
    let mut surface = json!({"metallicFactor": 0.0, "roughnessFactor": 1.0});
    if !colored {
        surface["baseColorFactor"] = json!(PLAIN);
    }
    json!({"name": "terrain", "doubleSided": true, "pbrMetallicRoughness": surface})
}

/// Writes numbers of single precision with all their digits. The fewest digits that single precision needs would be another number
/// for viewers that read double precision, and tiles would no longer meet.
struct ExactFloats;

impl Formatter for ExactFloats {
    fn write_f32<W: ?Sized + io::Write>(&mut self, writer: &mut W, value: f32) -> io::Result<()> {
        self.write_f64(writer, f64::from(value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gltf::json::Node;

    #[test]
    fn translations_are_the_same_number_in_double_precision() {
        let translation = [1_234_567.9f32, -0.000_976_562_5, 9.536_743e-7];
        let node = Node { translation: Some(translation), ..Node::default() };
        let text = to_text(&Root { nodes: vec![node], ..Root::default() }, true).unwrap();
        let read: Value = serde_json::from_slice(&text).unwrap();
        assert_eq!(read["nodes"][0]["translation"], json!(translation.map(f64::from)));
        assert!(read.get("materials").is_none());
    }
}
