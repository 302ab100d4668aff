//! The attributes of points as `EXT_structural_metadata` describes them: the schema in every file, and which vertex attributes hold
//! them. Viewers then know what the numbers mean, and can style by them.

use gltf::json::mesh::Semantic;
use gltf::json::{Value, extensions};
use serde_json::{Map, json};

use crate::attributes::AttributeChoice;

/// The extension.
pub(crate) const METADATA: &str = "EXT_structural_metadata";

/// Both chunks of a GLB with this extension end at a multiple of so many bytes in the file; glTF itself wants four.
pub(crate) const ALIGNMENT: usize = 8;

/// Returns the vertex attribute `_CLASSIFICATION`, which glTF leaves to applications.
pub(crate) fn classification() -> Semantic {
    Semantic::Extras("CLASSIFICATION".into())
}

/// Returns the vertex attribute `_INTENSITY`.
pub(crate) fn intensity() -> Semantic {
    Semantic::Extras("INTENSITY".into())
}

/// Returns the extensions of a document whose vertices carry these attributes; `None` if there are none.
pub(crate) fn of_document(choice: AttributeChoice) -> Option<extensions::root::Root> {
    let (mut schema, mut attributes) = (Map::new(), Map::new());
    if choice.classification {
        let meaning = json!({
            "name": "Class", "description": "Classification as in ASPRS LAS 1.4", "type": "SCALAR", "componentType": "UINT8", "required": true
        });
        schema.insert("classification".into(), meaning);
        attributes.insert("classification".into(), json!({"attribute": "_CLASSIFICATION"}));
    }
    if choice.intensity {
        let meaning = json!({
            "name": "Intensity", "description": "Strength of the return", "type": "SCALAR", "componentType": "UINT16", "required": true
        });
        schema.insert("intensity".into(), meaning);
        attributes.insert("intensity".into(), json!({"attribute": "_INTENSITY"}));
    }
    let point = json!({"name": "Point", "description": "The point that a vertex stands for", "properties": schema});
    let metadata = json!({
        "schema": {"id": "gdt_batch", "classes": {"point": point}},
        "propertyAttributes": [{"class": "point", "properties": attributes}]
    });
    (!choice.is_none()).then(|| extensions::root::Root { others: only_metadata(metadata) })
}

/// Returns the extensions of a primitive whose vertices carry attributes: they are those of the document.
pub(crate) fn of_primitive() -> extensions::mesh::Primitive {
    extensions::mesh::Primitive { others: only_metadata(json!({"propertyAttributes": [0]})) }
}

/// Pads the JSON text of a GLB so that its binary chunk begins at a multiple of [`ALIGNMENT`].
pub(crate) fn align_text(text: &mut Vec<u8>) {
    const BEFORE_TEXT: usize = 20;
    text.resize((BEFORE_TEXT + text.len()).next_multiple_of(ALIGNMENT) - BEFORE_TEXT, b' ');
}

fn only_metadata(value: Value) -> Map<String, Value> {
    Map::from_iter([(METADATA.to_string(), value)])
}
