//! What a file holds, as browsers need to know it: its type, and whether packing it is worth while.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// The extension of packed tiles stands within this many bytes of the end of a tile's JSON at the latest, for tiles of one part.
const GLB_HEAD: u64 = 16 << 10;

const PACKED: &[u8] = b"EXT_meshopt_compression";

/// Returns the content type of a file by its name.
pub(super) fn content_type(path: &Path) -> &'static str {
    match path.extension().and_then(|ending| ending.to_str()) {
        Some("html") => "text/html; charset=utf-8",
        Some("json") => "application/json",
        Some("glb") => "model/gltf-binary",
        Some("png") => "image/png",
        Some("terrain") => "application/vnd.quantized-mesh",
        Some("toml" | "txt" | "csv") => "text/plain; charset=utf-8",
        None => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    }
}

/// Tells whether a file is packed with gzip, as browsers are to be told: terrain tiles are.
pub(super) fn is_packed(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "terrain")
}

/// Tells whether gzip makes a file smaller. On the way to this machine itself, only texts are packed: packing a tile takes longer than
/// sending it.
///
/// # Errors
/// What the system says if the file cannot be read.
pub(super) fn is_worth_packing(path: &Path, file: &mut File, stays_here: bool) -> std::io::Result<bool> {
    match path.extension().and_then(|ending| ending.to_str()) {
        Some("html" | "json" | "toml" | "txt" | "csv") | None => Ok(true),
        Some("glb") if !stays_here => {
            let mut head = Vec::new();
            file.by_ref().take(GLB_HEAD).read_to_end(&mut head)?;
            file.seek(SeekFrom::Start(0))?;
            Ok(memchr::memmem::find(&head, PACKED).is_none())
        }
        _ => Ok(false),
    }
}
