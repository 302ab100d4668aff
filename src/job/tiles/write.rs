//! Step 6 of a job, by tile: the tile's own triangles and those of the seams that it owns, with finished normals and
//! colours, as one GLB; and its pixels of the preview.

use crate::job::durable::columns::ColumnWriter;
use crate::job::durable::directory::{Directory, Written, write_pieces};
use crate::job::durable::journal::Done;
use crate::job::durable::store::{Key, Store};
use crate::job::partition::tree::Tree;
use crate::job::records::{Leaf, LevelTile, Rim, RimVertices, SeamTriangle};
use crate::job::tiles::border_normals::{owner, seam_of};
use crate::job::tiles::dependencies::Settled;
use crate::job::tiles::max_edge::Cut;
use crate::output::color::Coloring;
use crate::output::frame::Frame;
use crate::output::gltf::glb::Glb;
use crate::output::normals::Sums;
use crate::output::preview::canvas::Canvas;
use crate::output::{Compression, Tile};
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::cell::RefCell;
use std::collections::HashMap;
use std::ops::AddAssign;
use std::path::Path;

/// How tiles are to look.
#[derive(Debug)]
pub struct Look {
    /// Where lattice integers lie in a glTF scene.
    pub frame: Frame,
    /// Where colours come from; `None` for no colours.
    pub coloring: Option<Coloring>,
    /// Whether vertices carry normals.
    pub normals: bool,
    /// How tiles are packed.
    pub compression: Compression,
    /// Which triangles are left out.
    pub cut: Cut,
}

/// What one tile, or all of them, came to.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct TileFigures {
    /// GLB files written; a tile whose triangles all belong to others has none.
    pub files: u64,
    /// Triangles in them.
    pub triangles: u64,
    /// Those of them that cross a border between tiles.
    pub seam_triangles: u64,
    /// Triangles that are left out.
    pub cut_triangles: u64,
    /// Bytes of the GLB files, those with what is left out among them.
    pub bytes: u64,
}

impl AddAssign for TileFigures {
    fn add_assign(&mut self, other: TileFigures) {
        self.files += other.files;
        self.triangles += other.triangles;
        self.seam_triangles += other.seam_triangles;
        self.cut_triangles += other.cut_triangles;
        self.bytes += other.bytes;
    }
}

/// Writes the GLB of a tile, and one of its triangles that are left out, and leaves its part of the preview
/// and its line of `tileset.json` in the store.
///
/// # Errors
/// [`Error::Io`] on the output or the store, [`Error::Config`] if a triangle is too long for f32.
pub fn run(
    directory: &Directory,
    store: &Store,
    tree: &Tree,
    settled: Settled,
    look: &Look,
    canvas: &Canvas,
) -> Result<Done<TileFigures>> {
    let tile = settled.tile;
    let leaf = Leaf::load(store, tile)?;
    let rims = RimVertices::load(store, tile)?;
    let mut sites = Sites::of_leaf(leaf, &rims, look);
    let own = seam_of(store, tree, settled)?.into_iter().filter(|triangle| owner(triangle) == tile as u32);
    let seam_triangles = sites.add_seam(store, tile as u32, own, look)?;
    let left_out = sites.left_out();
    let content = sites.into_tile(look);
    let mut figures = TileFigures {
        triangles: content.triangles.len() as u64,
        seam_triangles,
        cut_triangles: left_out.triangles.len() as u64,
        ..TileFigures::default()
    };
    let pixels = ColumnWriter::default().push(&canvas.draw(&content)).write(store, Key::Pixels(tile))?;
    let known = LevelTile::new(content.bounds(), !content.triangles.is_empty()).save(store, tile)?;
    let mut results = Vec::new();
    if !content.triangles.is_empty() {
        results.push(write_tile(&directory.tile(tile), &content, look)?);
        figures.files = 1;
    }
    if !left_out.triangles.is_empty() {
        directory.create_cut()?;
        results.push(write_tile(&directory.cut_tile(tile), &left_out, look)?);
    }
    figures.bytes = results.iter().map(|file| file.bytes).sum();
    Ok(Done { results, ..Done::new(figures, vec![pixels, known]) })
}

thread_local! {
    /// The bytes of the file at hand, kept from tile to tile so that their pages are faulted in once a thread.
    static GLB: RefCell<Glb> = RefCell::default();
}

/// Writes a GLB.
pub(crate) fn write_tile(path: &Path, content: &Tile, look: &Look) -> Result<Written> {
    GLB.with_borrow_mut(|glb| {
        glb.encode(&look.frame, content, look.compression)?;
        write_pieces(path, &glb.pieces())
    })
}

/// The vertices of a tile while it is put together: its own sites first, then those of its neighbours.
struct Sites {
    positions: Vec<[i32; 3]>,
    normals: Vec<[f32; 3]>,
    colors: Vec<[u16; 3]>,
    triangles: Vec<[u32; 3]>,
    /// Triangles that are left out.
    cut: Vec<[u32; 3]>,
}

impl Sites {
    fn of_leaf(mut leaf: Leaf, rims: &RimVertices, look: &Look) -> Sites {
        let cut = look.cut.take(&leaf.positions, &mut leaf.triangles);
        let mut normals = Sums::new(&leaf.positions, &leaf.triangles).finish(&look.frame);
        for vertex in &rims.0 {
            normals[vertex.site as usize] = vertex.normal;
        }
        let colors = match &look.coloring {
            Some(coloring) => coloring.colors(&leaf.positions, &leaf.rgb, &leaf.class),
            None => Vec::new(),
        };
        Sites { positions: leaf.positions, normals, colors, triangles: leaf.triangles, cut }
    }

    /// Adds the triangles of the seams that `tile` owns, with the vertices that neighbours share with it; returns how many are written.
    fn add_seam(
        &mut self,
        store: &Store,
        tile: u32,
        seam: impl Iterator<Item = SeamTriangle>,
        look: &Look,
    ) -> Result<u64> {
        let mut neighbours = Neighbours { store, rims: HashMap::new() };
        let mut vertex_of: HashMap<(u32, u32), u32> = HashMap::new();
        let before = self.triangles.len();
        for triangle in seam {
            let mut corners = [0; 3];
            for (corner, rim) in corners.iter_mut().zip(&triangle) {
                *corner = match vertex_of.get(&(rim.tile, rim.site)) {
                    _ if rim.tile == tile => rim.site,
                    Some(&vertex) => vertex,
                    None => {
                        let vertex = self.add_vertex(rim, &mut neighbours, look)?;
                        vertex_of.insert((rim.tile, rim.site), vertex);
                        vertex
                    }
                };
            }
            let is_cut = look.cut.leaves_out(triangle.map(|corner| corner.position));
            if is_cut { &mut self.cut } else { &mut self.triangles }.push(corners);
        }
        Ok((self.triangles.len() - before) as u64)
    }

    fn add_vertex(&mut self, rim: &Rim, neighbours: &mut Neighbours, look: &Look) -> Result<u32> {
        let vertex = neighbours.of(rim.tile)?.find(rim.site).ok_or_else(|| {
            Error::Broken(format!("tile {} does not know site {} that a seam uses", rim.tile, rim.site))
        })?;
        self.positions.push(rim.position);
        self.normals.push(vertex.normal);
        if let Some(coloring) = &look.coloring {
            self.colors.push(coloring.color(rim.position[2], vertex.rgb, vertex.class as u8));
        }
        Ok(self.positions.len() as u32 - 1)
    }

    /// What is left out, without normals and colours.
    fn left_out(&self) -> Tile {
        Tile::of(&self.positions, self.cut.clone())
    }

    /// The finished tile. Sites whose triangles all belong to other tiles, or are left out, are not in it.
    fn into_tile(mut self, look: &Look) -> Tile {
        let mut used = vec![false; self.positions.len()];
        self.triangles.as_flattened().iter().for_each(|&v| used[v as usize] = true);
        if used.contains(&false) {
            self.drop_unused(&used);
        }
        Tile {
            positions: self.positions,
            normals: look.normals.then_some(self.normals),
            colors: look.coloring.map(|_| self.colors),
            triangles: self.triangles,
        }
    }

    fn drop_unused(&mut self, used: &[bool]) {
        let number = |next: &mut u32, &used: &bool| Some(std::mem::replace(next, *next + used as u32));
        let numbers: Vec<u32> = used.iter().scan(0, number).collect();
        self.triangles.as_flattened_mut().iter_mut().for_each(|v| *v = numbers[*v as usize]);
        keep(&mut self.positions, used);
        keep(&mut self.normals, used);
        keep(&mut self.colors, used);
    }
}

/// Keeps the values whose place in `wanted` says so; a column that the tile does not have stays empty.
fn keep<T: Copy>(values: &mut Vec<T>, wanted: &[bool]) {
    let mut kept = 0;
    // Without a branch that cannot be foreseen.
    for at in 0..values.len() {
        values[kept] = values[at];
        kept += wanted[at] as usize;
    }
    values.truncate(kept);
}

/// The finished frontiers of other tiles, read when first asked for.
struct Neighbours<'a> {
    store: &'a Store,
    rims: HashMap<u32, RimVertices>,
}

impl Neighbours<'_> {
    fn of(&mut self, tile: u32) -> Result<&RimVertices> {
        Ok(match self.rims.entry(tile) {
            std::collections::hash_map::Entry::Occupied(entry) => entry.into_mut(),
            std::collections::hash_map::Entry::Vacant(entry) => {
                entry.insert(RimVertices::load(self.store, tile as usize)?)
            }
        })
    }
}
