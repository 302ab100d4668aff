//! Step 8 of a job: what stands beside the tiles, and `terrain.glb`.

use crate::Result;
use crate::job::durable::columns::ColumnReader;
use crate::job::durable::directory::{self, Directory};
use crate::job::durable::journal::Done;
use crate::job::durable::store::{Key, Store};
use crate::output::gltf::one_file::write_terrain;
use crate::output::preview::canvas::{Canvas, Texel};
use crate::output::preview::picture::Picture;

/// What viewers open.
pub struct Viewers {
    /// The text of `tileset.json`.
    pub tileset: Option<String>,
    /// Whether there is to be a `terrain.glb`.
    pub one_file: bool,
}

/// Writes what stands beside the tiles; its figure is its bytes.
///
/// # Errors
/// [`crate::Error::Io`] on the output or the store, [`crate::Error::Broken`] if it is not what earlier steps have left.
pub fn run(
    directory: &Directory,
    store: &Store,
    georeference: &str,
    viewers: &Viewers,
    canvas: &Canvas,
    tiles: usize,
) -> Result<Done<u64>> {
    let mut results = vec![
        directory::write_result(&directory.georeference(), georeference.as_bytes())?,
        directory::write_result(&directory.preview(), &draw_picture(store, canvas, tiles)?)?,
    ];
    if let Some(tileset) = &viewers.tileset {
        results.push(directory::write_result(&directory.tileset(), tileset.as_bytes())?);
    }
    if viewers.one_file {
        let paths: Vec<_> = (0..tiles).map(|tile| directory.tile(tile)).filter(|path| path.exists()).collect();
        write_terrain(&directory::partial(&directory.terrain()), &paths)?;
        results.push(directory::written_result(&directory.terrain())?);
    }
    let bytes = results.iter().map(|file| file.bytes).sum();
    Ok(Done { results, ..Done::new(bytes, Vec::new()) })
}

fn draw_picture(store: &Store, canvas: &Canvas, tiles: usize) -> Result<Vec<u8>> {
    let mut picture = Picture::new(canvas);
    for tile in 0..tiles {
        picture.add(tile as u32, &ColumnReader::open(store, Key::Pixels(tile))?.column::<Texel>()?);
    }
    Ok(picture.png())
}
