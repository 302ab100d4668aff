//! Reads the JSON chunk of a GLB into the types of `gltf-json`, and refuses what they do not refuse themselves.
//!
//! Those types skip fields that they do not know, cut integers to 32 bits and round numbers to single precision. A damaged file could
//! so pass for a good one. Here a text is compared with the value that was read from it ([`Confirm`]), and elements may have only the
//! fields that this program writes.

use std::fmt;

use gltf::json::accessor::Accessor;
use gltf::json::buffer::View;
use gltf::json::mesh::{Mesh, Mode, Primitive, Semantic};
use gltf::json::scene::{Node, Scene};
use gltf::json::validation::Checked;
use serde::de::{DeserializeOwned, DeserializeSeed, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;
use serde_json::{Map, Number, Value, json};

use crate::gltf::metadata;

/// A decoded value, or a sentence that says what is wrong with the file.
pub(crate) type Decoded<T> = Result<T, String>;

/// Longest text of a node, a mesh, an accessor or a buffer view, in bytes. A hostile element takes up to a hundred times as much
/// memory while it is read; one of this program has some hundred bytes.
const LONGEST_ELEMENT: usize = 1 << 16;

/// Longest text of a scene, which names all nodes and holds the text of a coordinate system.
const LONGEST_SCENE: usize = 1 << 20;

/// Bytes of an element's text that a message repeats.
const SHOWN: usize = 160;

/// The elements of a document as texts. A [`gltf::json::Root`] would take 264 bytes for an empty node, which has two in the file;
/// this way only one element at a time takes more room than the text.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct RawDocument<'a> {
    /// The number of the scene to show.
    #[serde(default)]
    pub(crate) scene: usize,
    #[serde(borrow)]
    scenes: Vec<&'a RawValue>,
    #[serde(borrow, default)]
    nodes: Vec<&'a RawValue>,
    #[serde(borrow, default)]
    meshes: Vec<&'a RawValue>,
    #[serde(borrow, default)]
    accessors: Vec<&'a RawValue>,
    #[serde(borrow, default)]
    buffer_views: Vec<&'a RawValue>,
    #[serde(default)]
    pub(crate) extensions_required: Vec<String>,
}

impl RawDocument<'_> {
    /// Returns all scenes.
    pub(crate) fn scenes(&self) -> impl Iterator<Item = Decoded<Scene>> {
        self.scenes.iter().map(|text| named("scene", text, scene(text.get())))
    }

    /// Returns all nodes. Each has a mesh, and may have a name, a translation and a scale.
    pub(crate) fn nodes(&self) -> impl Iterator<Item = Decoded<Node>> {
        self.nodes.iter().map(|text| named("node", text, node(text.get())))
    }

    /// Returns all meshes. Their primitives have positions and indices, and may have normals, colours, attributes of points and
    /// a material.
    pub(crate) fn meshes(&self) -> impl Iterator<Item = Decoded<Mesh>> {
        self.meshes.iter().map(|text| named("mesh", text, mesh(text.get())))
    }

    /// Returns all accessors. Each is dense and starts where its buffer view does.
    pub(crate) fn accessors(&self) -> impl Iterator<Item = Decoded<Accessor>> {
        self.accessors.iter().map(|text| named("accessor", text, accessor(text.get())))
    }

    /// Returns all buffer views.
    pub(crate) fn buffer_views(&self) -> impl Iterator<Item = Decoded<View>> {
        self.buffer_views.iter().map(|text| named("buffer view", text, buffer_view(text.get())))
    }
}

/// Adds to an error which element it is about.
fn named<T>(kind: &str, text: &RawValue, element: Decoded<T>) -> Decoded<T> {
    element.map_err(|what| {
        let text = text.get();
        let end = (0..=SHOWN.min(text.len())).rev().find(|&end| text.is_char_boundary(end)).unwrap_or(0);
        format!("{what}, in the {kind} {}{}", &text[..end], if end < text.len() { "..." } else { "" })
    })
}

fn read<T: DeserializeOwned>(text: &str, longest: usize) -> Decoded<T> {
    if text.len() > longest {
        return Err(format!("{} bytes are too many", text.len()));
    }
    serde_json::from_str(text).map_err(|e| e.to_string())
}

/// Reads an element that has no field that its type does not know.
fn read_closed<T: DeserializeOwned + Serialize>(text: &str) -> Decoded<T> {
    let element: T = read(text, LONGEST_ELEMENT)?;
    confirm(text, to_value(&element)?, false)?;
    Ok(element)
}

fn to_value(element: &impl Serialize) -> Decoded<Value> {
    serde_json::to_value(element).map_err(|e| e.to_string())
}

fn node(text: &str) -> Decoded<Node> {
    let node: Node = read_closed(text)?;
    match node {
        Node {
            mesh: Some(_),
            name: _,
            translation: _,
            scale: _,
            camera: None,
            children: None,
            extensions: None,
            extras: None,
            matrix: None,
            rotation: None,
            skin: None,
            weights: None,
        } => Ok(node),
        _ => Err("there is no mesh, or more than a mesh, a translation and a scale".into()),
    }
}

/// Reads a scene. It may have fields that its type does not know.
fn scene(text: &str) -> Decoded<Scene> {
    let scene: Scene = read(text, LONGEST_SCENE).or_else(|error| empty_scene(text).ok_or(error))?;
    confirm(text, json!({"nodes": to_value(&scene.nodes)?}), true)?;
    Ok(scene)
}

/// Reads a scene without nodes, which glTF allows and [`Scene`] does not.
fn empty_scene(text: &str) -> Option<Scene> {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct EmptyScene {
        extras: Box<RawValue>,
    }
    let EmptyScene { extras } = serde_json::from_str(text).ok()?;
    Some(Scene { extensions: None, extras: Some(extras), name: None, nodes: Vec::new() })
}

/// Reads a mesh. It may have fields that its type does not know, but its primitives may not.
fn mesh(text: &str) -> Decoded<Mesh> {
    let mesh: Mesh = read(text, LONGEST_ELEMENT)?;
    confirm(text, json!({"primitives": to_value(&mesh.primitives)?}), true)?;
    mesh.primitives.iter().try_for_each(check_primitive)?;
    Ok(mesh)
}

fn check_primitive(primitive: &Primitive) -> Decoded<()> {
    let Primitive {
        attributes,
        indices: Some(_),
        material: _,
        mode: Checked::Valid(Mode::Triangles),
        extensions,
        extras: None,
        targets: None,
    } = primitive
    else {
        return Err("a primitive has no indices, or more than triangles and a material".into());
    };
    let of_points = [metadata::classification(), metadata::intensity()];
    let is_of_point = |semantic: &Semantic| of_points.contains(semantic);
    let is_known = |semantic: &Checked<Semantic>| match semantic {
        Checked::Valid(Semantic::Positions | Semantic::Normals | Semantic::Colors(0)) => true,
        Checked::Valid(other) => is_of_point(other),
        Checked::Invalid => false,
    };
    let describes_points = match extensions {
        None => false,
        Some(said) if said.others == metadata::of_primitive().others => true,
        Some(_) => return Err("the extensions of a primitive are not of this program".into()),
    };
    let has_of_points = of_points.iter().any(|semantic| attributes.contains_key(&Checked::Valid(semantic.clone())));
    if describes_points != has_of_points {
        return Err("the attributes of points are not described, or are not there".into());
    }
    match attributes.keys().find(|semantic| !is_known(semantic)) {
        Some(semantic) => Err(format!("unknown attribute {}", semantic.to_string())),
        None if !attributes.contains_key(&Checked::Valid(Semantic::Positions)) => Err("there are no positions".into()),
        None => Ok(()),
    }
}

fn accessor(text: &str) -> Decoded<Accessor> {
    let accessor: Accessor = read(text, LONGEST_ELEMENT)?;
    let mut expected = to_value(&accessor)?;
    expected["normalized"] = accessor.normalized.into();
    confirm(text, expected, false)?;
    let is_bounds = |value: &Option<Value>| {
        let all_numbers = |v: &Value| v.as_array().is_some_and(|numbers| numbers.iter().all(Value::is_number));
        value.as_ref().is_none_or(all_numbers)
    };
    match &accessor {
        Accessor {
            buffer_view: Some(_),
            count: _,
            component_type: _,
            type_: _,
            normalized: _,
            min,
            max,
            byte_offset: None,
            extensions: None,
            extras: None,
            name: None,
            sparse: None,
        } if is_bounds(min) && is_bounds(max) => Ok(accessor),
        _ => Err("there is no buffer view, or more than whole elements of one".into()),
    }
}

fn buffer_view(text: &str) -> Decoded<View> {
    let view: View = read_closed(text)?;
    match view {
        View {
            buffer: _,
            byte_length: _,
            byte_offset: _,
            byte_stride: _,
            target: _,
            extensions: _,
            name: None,
            extras: None,
        } => Ok(view),
        _ => Err("a name or extras are not of this program".into()),
    }
}

/// Fails unless every field of `text` is in `read`, once, and with the same value. With `open`, the outermost object may have others.
fn confirm(text: &str, read: Value, open: bool) -> Decoded<()> {
    let mut deserializer = serde_json::Deserializer::from_str(text);
    Confirm { read, open }.deserialize(&mut deserializer).map_err(|e| e.to_string())
}

/// Compares a text, while it is parsed, with the value that was read from it before.
struct Confirm {
    read: Value,
    open: bool,
}

impl Confirm {
    fn closed(read: Value) -> Confirm {
        Confirm { read, open: false }
    }

    fn number<E: Error>(&self, said: Number) -> Result<(), E> {
        let is_same = |read: &Number| *read == said || read.as_f64() == said.as_f64();
        self.is(self.read.as_number().is_some_and(is_same), said)
    }

    fn is<E: Error>(&self, same: bool, said: impl fmt::Display) -> Result<(), E> {
        if same { Ok(()) } else { Err(E::custom(format!("the value {said} is out of range or said twice"))) }
    }
}

impl<'de> DeserializeSeed<'de> for Confirm {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Confirm {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}", self.read)
    }

    fn visit_unit<E: Error>(self) -> Result<(), E> {
        self.is(self.read.is_null(), "null")
    }

    fn visit_bool<E: Error>(self, said: bool) -> Result<(), E> {
        self.is(self.read == said, said)
    }

    fn visit_u64<E: Error>(self, said: u64) -> Result<(), E> {
        self.number(said.into())
    }

    fn visit_i64<E: Error>(self, said: i64) -> Result<(), E> {
        self.number(said.into())
    }

    fn visit_f64<E: Error>(self, said: f64) -> Result<(), E> {
        match Number::from_f64(said) {
            Some(said) => self.number(said),
            None => self.is(false, said),
        }
    }

    fn visit_str<E: Error>(self, said: &str) -> Result<(), E> {
        self.is(self.read == said, said)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut said: A) -> Result<(), A::Error> {
        let Value::Array(read) = self.read else { return Err(A::Error::custom("a list is out of place")) };
        for element in read {
            said.next_element_seed(Confirm::closed(element))?;
        }
        match said.next_element::<IgnoredAny>()? {
            None => Ok(()),
            Some(_) => Err(A::Error::custom("a list is too long")),
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, mut said: A) -> Result<(), A::Error> {
        let mut read = match self.read {
            Value::Object(read) => read,
            _ => Map::new(),
        };
        while let Some(field) = said.next_key::<String>()? {
            match read.remove(&field) {
                Some(value) => said.next_value_seed(Confirm::closed(value))?,
                None if self.open => drop(said.next_value::<IgnoredAny>()?),
                None => return Err(A::Error::custom(format!("unknown or repeated field `{field}`"))),
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused<T>(element: Decoded<T>, words: &str) {
        let said = element.err().unwrap();
        assert!(said.contains(words), "{said}");
    }

    #[test]
    fn elements_of_this_program_are_read() {
        node(r#"{"mesh": 0, "name": "", "translation": [0, -1.5, 1e3], "scale": [0.5, 0.5, 0.5]}"#).unwrap();
        mesh(r#"{"primitives":[{"attributes":{"POSITION":0,"NORMAL":1,"COLOR_0":2},"indices":3}],"comment":1}"#)
            .unwrap();
        accessor(r#"{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","normalized":false,"min":[0,1.5]}"#)
            .unwrap();
        buffer_view(r#"{"buffer":1,"byteLength":8,"extensions":{"EXT_meshopt_compression":{"count":7}}}"#).unwrap();
        assert_eq!(scene(r#"{"extras":{"crs":null}}"#).unwrap().nodes, []);
        assert_eq!(scene(r#"{"extras":{"crs":null},"nodes":[3],"comment":1}"#).unwrap().nodes[0].value(), 3);
    }

    #[test]
    fn what_the_crate_would_skip_cut_or_round_is_refused() {
        refused(node(r#"{"mesh":4294967296}"#), "4294967296");
        refused(node(r#"{"mesh":0,"translation":[0.1,0.0,0.0]}"#), "0.1");
        refused(node(r#"{"mesh":0,"morph":1}"#), "morph");
        refused(node(r#"{"mesh":0,"rotation":[0.0,0.0,0.0,1.0]}"#), "more than a mesh");
        refused(node(r#"{}"#), "no mesh");
        refused(scene(r#"{"extras":null,"nodes":[4294967297]}"#), "4294967297");
        refused(accessor(r#"{"bufferView":0,"componentType":4294972422,"count":3,"type":"VEC3"}"#), "4294972422");
        refused(
            accessor(r#"{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","byteOffset":0}"#),
            "more than",
        );
        refused(accessor(r#"{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":"low"}"#), "more than");
        refused(accessor(r#"{"bufferView":0,"componentType":5126,"count":3,"type":"VEC9"}"#), "invalid");
        refused(buffer_view(r#"{"buffer":0,"byteLength":1,"byteOffset":2,"byteOffset":2}"#), "duplicate");
        refused(buffer_view(r#"{"buffer":0,"byteLength":1,"extensions":{"X":{"a":1,"a":1}}}"#), "repeated");
        let primitive = |text: &str| mesh(&format!(r#"{{"primitives":[{{{text}}}]}}"#));
        refused(primitive(r#""attributes":{"POSITION":0,"POSITION":1},"indices":1"#), "said twice");
        refused(primitive(r#""attributes":{"POSITION":0,"COLOR_00":1},"indices":1"#), "COLOR_00");
        refused(primitive(r#""attributes":{"POSITION":0,"TEXCOORD_0":1},"indices":1"#), "TEXCOORD_0");
        refused(primitive(r#""attributes":{"POSITION":0,"_NAME":1},"indices":1"#), "_NAME");
        let described = |attribute: &str, numbers: &str| {
            let said = format!(r#""extensions":{{"EXT_structural_metadata":{{"propertyAttributes":[{numbers}]}}}}"#);
            primitive(&format!(r#""attributes":{{"POSITION":0,"{attribute}":1}},"indices":1,{said}"#))
        };
        described("_INTENSITY", "0").unwrap();
        refused(described("_INTENSITY", "1"), "not of this program");
        refused(described("NORMAL", "0"), "not described, or are not there");
        refused(primitive(r#""attributes":{"POSITION":0,"_INTENSITY":1},"indices":1"#), "not described");
        refused(primitive(r#""attributes":{"NORMAL":0},"indices":1"#), "no positions");
        refused(primitive(r#""attributes":{"POSITION":0}"#), "no indices");
        refused(primitive(r#""attributes":{"POSITION":0},"indices":1,"mode":1"#), "more than triangles");
        refused(primitive(r#""attributes":{"POSITION":0},"indices":1,"mode":4294967300"#), "mode");
    }

    #[test]
    fn a_long_element_is_refused_before_it_takes_memory() {
        let children = "0,".repeat(LONGEST_ELEMENT);
        refused(node(&format!(r#"{{"mesh":0,"children":[{children}0]}}"#)), "too many");
    }
}
