//! glTF: writes tiles as GLB files, packed or plain, and reads them back.

pub(crate) mod arcs_around;
pub(crate) mod check_json;
pub(crate) mod container;
pub(crate) mod document;
pub(crate) mod element_type;
pub mod encoding;
pub mod glb;
pub(crate) mod index_codec;
pub(crate) mod meshopt;
pub(crate) mod metadata;
pub mod one_file;
pub mod read;
pub(crate) mod schema;
pub(crate) mod split_nodes;
pub mod stored_normals;
pub(crate) mod stored_view;
pub(crate) mod vertex_codec;
pub(crate) mod vertex_order;
