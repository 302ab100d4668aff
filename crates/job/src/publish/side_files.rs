//! Writing the files beside the tiles: the georeference, the preview, the tilesets and `terrain.glb`.

use crate::durable::atomic_file::{
    PendingFile, PendingWriter, create_folder_of, find_pending, partial_path, write_pending,
};
use crate::durable::columns::ColumnReader;
use crate::durable::directory::JobDirectory;
use crate::index::TileIndex;
use crate::publish::flat_tile::FlatScene;
use crate::records::{StepRecord, Store};
use breaklines::Breaklines;
use lattice::Lattice;
use std::path::PathBuf;
use std::sync::Arc;
use sys::{Error, Result, disk};
use tiles::breakline_list::lines_of;
use tiles::frame::Frame;
use tiles::gltf::one_file::{write_remade_terrain, write_terrain};
use tiles::imagery_url::ImageryUrl;
use tiles::page::page_for;
use tiles::preview::canvas::{Canvas, PreviewPixel};
use tiles::preview::layout::world_file;
use tiles::preview::panel::Legend;
use tiles::preview::picture::Picture;
use tiles::tiles3d::tileset::{TilesetNode, write_tilesets};

/// What the files beside the tiles hold.
pub(crate) struct SideFiles<'a> {
    /// The text of `georeference.json`.
    pub georeference: String,
    /// The map of all tiles, and the root of the tileset, if there is to be one.
    pub tileset: Option<(&'a Frame, TilesetNode)>,
    /// Whether there is to be a `terrain.glb`. It is made from the tiles, which must have their names.
    pub one_file: bool,
    /// How the tiles become flat for it, if they are bent.
    pub flat: Option<FlatScene<'a>>,
    /// Whether there is to be a page that shows the terrain.
    pub page: bool,
    /// The map tiles that it drapes over the terrain.
    pub imagery: Option<&'a ImageryUrl>,
    /// Whose the data are, if the user says.
    pub copyright: Option<&'a str>,
    /// Whether colours stand for heights in the preview.
    pub has_ramp: bool,
    /// The edges along breaklines, if there are any, and their lattice.
    pub breaklines: Option<(Arc<Breaklines>, &'a Lattice)>,
}

/// Writes the files beside the tiles and returns the number of their bytes.
///
/// # Errors
/// [`sys::Error::Io`] on the output or the store, [`sys::Error::Broken`] if they are not what earlier steps wrote,
/// [`sys::Error::Config`] if there is to be a page and it is not built in.
pub(crate) fn write_side_files(
    directory: &JobDirectory,
    content: &SideFiles,
    canvas: &Canvas,
    tiles: &dyn EachTile,
) -> Result<(u64, Vec<PendingFile>)> {
    let output = directory.output();
    let mut files = vec![
        write_pending(&output.georeference(), content.georeference.as_bytes())?,
        write_pending(&output.preview(), &draw_preview(canvas, content.has_ramp, tiles)?)?,
        write_pending(&output.preview_world(), world_file(canvas).as_bytes())?,
    ];
    if let Some((frame, root)) = &content.tileset {
        files.extend(pending_tilesets(directory, frame, root, content.copyright)?);
    }
    if let Some((breaklines, lattice)) = &content.breaklines {
        let mut writer = PendingWriter::create(&output.breaklines())?;
        lines_of(breaklines, lattice).try_for_each(|line| writer.write(line.as_bytes()))?;
        files.push(writer.finish()?);
    }
    if content.page {
        let opened = if content.tileset.is_some() { output.tileset() } else { output.terrain() };
        let name = opened.file_name().unwrap_or_default().to_string_lossy().into_owned();
        files.push(write_pending(&output.page(), page_for(&name, content.imagery)?.as_bytes())?);
    }
    if content.one_file {
        let written = |path: PathBuf| Ok(disk::exists(&path).map_err(Error::io("read", &path))?.then_some(path));
        let mut paths = Vec::new();
        tiles.visit(&mut |_, tile| {
            paths.extend(written(output.tile(tile.number()))?);
            Ok(())
        })?;
        let terrain = partial_path(&output.terrain());
        match &content.flat {
            None => write_terrain(&terrain, &paths, content.copyright)?,
            Some(flat) => write_remade_terrain(&terrain, &paths, &|path| flat.tile(path), content.copyright)?,
        }
        files.push(find_pending(&output.terrain())?);
    }
    Ok((files.iter().map(|file| file.bytes).sum(), files))
}

/// Writes `tileset.json` and the external tilesets.
fn pending_tilesets(
    directory: &JobDirectory,
    frame: &Frame,
    root: &TilesetNode,
    copyright: Option<&str>,
) -> Result<Vec<PendingFile>> {
    let (output, mut files) = (directory.output(), Vec::new());
    write_tilesets(frame, root, copyright, |number, text| {
        let path = number.map_or_else(|| output.tileset(), |number| output.external_tileset(number));
        create_folder_of(&path)?;
        files.push(write_pending(&path, text.as_bytes())?);
        Ok::<(), Error>(())
    })?;
    Ok(files)
}

/// All tiles of a job.
pub(crate) trait EachTile: Sync {
    /// Calls `visit` with each tile, in their order, and the store that has its records.
    ///
    /// # Errors
    /// Those of `visit`, and of opening a store.
    fn visit(&self, visit: &mut dyn FnMut(&Store, TileIndex) -> Result<()>) -> Result<()>;
}

/// Returns the preview as PNG.
fn draw_preview(canvas: &Canvas, has_ramp: bool, tiles: &dyn EachTile) -> Result<Vec<u8>> {
    let mut picture = Picture::new(canvas);
    tiles.visit(&mut |store, tile| {
        picture.add(&ColumnReader::open(store, StepRecord::Pixels(tile))?.column::<PreviewPixel>()?);
        Ok(())
    })?;
    picture.png(&Legend::new(canvas, has_ramp))
}
