//! What the steps leave for each other in the job's store, one type a record.

use crate::geometry::Site;
use crate::input::Point;
use crate::job::durable::columns::{ColumnReader, ColumnWriter};
use crate::job::durable::store::{Key, Store, Stored};
use crate::output::normals::NormalSum;
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable};

/// A site as other tiles know it. Sites are numbered by tile, then in the order of the tile.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
pub struct Rim {
    /// The tile that owns the site.
    pub tile: u32,
    /// Its number in that tile.
    pub site: u32,
    /// Lattice integers x, y, z.
    pub position: [i32; 3],
}

impl Rim {
    /// Where it lies in the plane.
    pub fn plane(&self) -> Site {
        [self.position[0], self.position[1]]
    }
}

/// A triangle of the seam, counterclockwise.
pub type SeamTriangle = [Rim; 3];

/// The sites of a tile, in order, and the triangles closed in its leaf.
#[derive(Debug, Default)]
pub struct Leaf {
    /// Lattice integers x, y, z of the sites.
    pub positions: Vec<[i32; 3]>,
    /// Their colours as read.
    pub rgb: Vec<[u16; 3]>,
    /// Their classes.
    pub class: Vec<u8>,
    /// The closed triangles as numbers of sites, counterclockwise.
    pub triangles: Vec<[u32; 3]>,
}

impl Leaf {
    /// Writes the record of `tile`, whose sites are those of `points`; with it, how many triangles there are.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub fn save(
        store: &Store,
        tile: usize,
        points: &[Point],
        triangles: impl Iterator<Item = [u32; 3]>,
    ) -> Result<(Stored, u64)> {
        let positions: Vec<[i32; 3]> = points.iter().map(Point::corner).collect();
        let rgb: Vec<[u16; 3]> = points.iter().map(|p| p.rgb).collect();
        let class: Vec<u8> = points.iter().map(|p| p.class).collect();
        let columns = ColumnWriter::default().push(&positions).push(&rgb).push(&class);
        // These records are most of what a job writes on its way: corners take two bytes where that is enough.
        if has_short_corners(&positions) {
            let triangles: Vec<[u16; 3]> = triangles.map(|t| t.map(|v| v as u16)).collect();
            Ok((columns.push(&triangles).write(store, Key::Leaf(tile))?, triangles.len() as u64))
        } else {
            let triangles: Vec<[u32; 3]> = triangles.collect();
            Ok((columns.push(&triangles).write(store, Key::Leaf(tile))?, triangles.len() as u64))
        }
    }

    /// Reads the record of `tile`.
    ///
    /// # Errors
    /// [`crate::Error::Io`], or [`crate::Error::Broken`] if there is none.
    pub fn load(store: &Store, tile: usize) -> Result<Leaf> {
        let mut columns = ColumnReader::open(store, Key::Leaf(tile))?;
        let mut leaf = Leaf {
            positions: columns.column()?,
            rgb: columns.column()?,
            class: columns.column()?,
            triangles: Vec::new(),
        };
        leaf.triangles = if has_short_corners(&leaf.positions) {
            columns.column::<[u16; 3]>()?.into_iter().map(|t| t.map(u32::from)).collect()
        } else {
            columns.column()?
        };
        Ok(leaf)
    }
}

fn has_short_corners(positions: &[[i32; 3]]) -> bool {
    positions.len() <= 1 << 16
}

/// What a node hands to its parent.
#[derive(Debug, Default)]
pub struct Frontier {
    /// The sites the parent still needs, ascending.
    pub sites: Vec<Rim>,
    /// The directed edges round the closed ground, as positions in `sites`.
    pub boundary: Vec<[u32; 2]>,
}

impl Frontier {
    /// Writes the record of `node`.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub fn save(&self, store: &Store, node: usize) -> Result<Stored> {
        ColumnWriter::default().push(&self.sites).push(&self.boundary).write(store, Key::Frontier(node))
    }

    /// Reads the record of `node`.
    ///
    /// # Errors
    /// [`crate::Error::Io`], or [`crate::Error::Broken`] if there is none.
    pub fn load(store: &Store, node: usize) -> Result<Frontier> {
        let mut columns = ColumnReader::open(store, Key::Frontier(node))?;
        Ok(Frontier { sites: columns.column()?, boundary: columns.column()? })
    }

    /// The tiles that have sites in it, ascending.
    pub fn tiles(&self) -> Vec<u32> {
        let mut tiles: Vec<u32> = self.sites.iter().map(|rim| rim.tile).collect();
        tiles.dedup();
        tiles
    }
}

/// The triangles that an inner node contributes, by tile: a triangle stands once for each tile that owns a corner of it.
#[derive(Debug, Default)]
pub struct Seam {
    /// Tile, first triangle and number of triangles, by ascending tile.
    index: Vec<[u32; 3]>,
    triangles: Vec<SeamTriangle>,
}

impl Seam {
    /// Sorts `triangles` by the tiles they touch.
    pub fn new(triangles: &[SeamTriangle]) -> Seam {
        let mut touching: Vec<(u32, SeamTriangle)> = Vec::with_capacity(triangles.len() * 2);
        for triangle in triangles {
            let mut tiles = triangle.map(|corner| corner.tile);
            tiles.sort_unstable();
            touching.extend((0..3).filter(|&i| i == 0 || tiles[i] != tiles[i - 1]).map(|i| (tiles[i], *triangle)));
        }
        touching.sort_unstable();
        let mut seam = Seam::default();
        for (tile, triangle) in touching {
            match seam.index.last_mut() {
                Some([last, _, count]) if *last == tile => *count += 1,
                _ => seam.index.push([tile, seam.triangles.len() as u32, 1]),
            }
            seam.triangles.push(triangle);
        }
        seam
    }

    /// Writes the record of `node`.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub fn save(&self, store: &Store, node: usize) -> Result<Stored> {
        ColumnWriter::default().push(&self.index).push(&self.triangles).write(store, Key::Seam(node))
    }

    /// The triangles of `node` that touch `tile`, from its record.
    ///
    /// # Errors
    /// [`crate::Error::Io`], or [`crate::Error::Broken`] if there is none.
    pub fn touching(store: &Store, node: usize, tile: usize) -> Result<Vec<SeamTriangle>> {
        let mut columns = ColumnReader::open(store, Key::Seam(node))?;
        let index: Vec<[u32; 3]> = columns.column()?;
        match index.binary_search_by_key(&(tile as u32), |entry| entry[0]) {
            Ok(at) => columns.column_part(index[at][1] as usize, index[at][2] as usize),
            Err(_) => Ok(Vec::new()),
        }
    }
}

/// The frontier of one leaf as far as the leaf knows it, each column in the order of [`Frontier::sites`].
#[derive(Debug, Default)]
pub struct RimDraft {
    /// The sums of normals over the leaf's closed triangles around the site.
    pub sums: Vec<NormalSum>,
    /// Colours as read.
    pub rgb: Vec<[u16; 3]>,
    /// Classes.
    pub class: Vec<u8>,
}

impl RimDraft {
    /// Writes the record of `tile`.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub fn save(&self, store: &Store, tile: usize) -> Result<Stored> {
        ColumnWriter::default().push(&self.sums).push(&self.rgb).push(&self.class).write(store, Key::RimDraft(tile))
    }

    /// Reads the record of `tile`.
    ///
    /// # Errors
    /// [`crate::Error::Io`], or [`crate::Error::Broken`] if there is none.
    pub fn load(store: &Store, tile: usize) -> Result<RimDraft> {
        let mut columns = ColumnReader::open(store, Key::RimDraft(tile))?;
        Ok(RimDraft { sums: columns.column()?, rgb: columns.column()?, class: columns.column()? })
    }
}

/// A finished vertex of a tile's frontier, as neighbouring tiles need it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct RimVertex {
    /// Its number in its tile.
    pub site: u32,
    /// Unit normal, source axes, metres.
    pub normal: [f32; 3],
    /// Colour as read.
    pub rgb: [u16; 3],
    /// Class.
    pub class: u16,
}

/// The finished frontier of one leaf, by ascending site.
#[derive(Debug)]
pub struct RimVertices(pub Vec<RimVertex>);

impl RimVertices {
    /// Writes the record of `tile`.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub fn save(&self, store: &Store, tile: usize) -> Result<Stored> {
        ColumnWriter::default().push(&self.0).write(store, Key::Rim(tile))
    }

    /// Reads the record of `tile`.
    ///
    /// # Errors
    /// [`crate::Error::Io`], or [`crate::Error::Broken`] if there is none.
    pub fn load(store: &Store, tile: usize) -> Result<RimVertices> {
        Ok(RimVertices(ColumnReader::open(store, Key::Rim(tile))?.column()?))
    }

    /// The vertex of `site`.
    pub fn find(&self, site: u32) -> Option<&RimVertex> {
        self.0.binary_search_by_key(&site, |vertex| vertex.site).ok().map(|at| &self.0[at])
    }
}

/// What `tileset.json` says of a tile.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct LevelTile {
    /// The greatest vertical distance to the exact mesh, metres.
    pub error: f64,
    /// The least and greatest lattice x, y, z of the exact mesh below; the least are greater where there is none.
    corners: [[i32; 3]; 2],
    /// Whether there is a GLB: 1 or 0.
    pub content: u32,
    unused: u32,
}

impl LevelTile {
    /// A tile of the exact mesh within `bounds`, with or without content.
    pub fn new(bounds: Option<[[i32; 3]; 2]>, content: bool) -> LevelTile {
        LevelTile { error: 0.0, corners: bounds.unwrap_or([[1; 3], [0; 3]]), content: content.into(), unused: 0 }
    }

    /// Stores it as that of exact tile `tile`.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub fn save(&self, store: &Store, tile: usize) -> Result<Stored> {
        ColumnWriter::default().push(&[*self]).write(store, Key::Tile(tile))
    }

    /// That of exact tile `tile`.
    ///
    /// # Errors
    /// [`crate::Error::Io`], or [`crate::Error::Broken`] if it is not there or not whole.
    pub fn load(store: &Store, tile: usize) -> Result<LevelTile> {
        let own = ColumnReader::open(store, Key::Tile(tile))?.column()?;
        let [own] = own[..] else { return Err(Error::Broken(format!("the record of tile {tile} is damaged"))) };
        Ok(own)
    }

    /// The least and greatest lattice x, y, z; `None` where there is no triangle below.
    pub fn bounds(&self) -> Option<[[i32; 3]; 2]> {
        (self.corners[0][0] <= self.corners[1][0]).then_some(self.corners)
    }
}

/// What a coarser tile leaves for the tile above it and for `tileset.json`.
#[derive(Debug)]
pub struct Level {
    /// The tile itself.
    pub own: LevelTile,
    /// The exact tiles among its children, in their order.
    pub leaves: Vec<LevelTile>,
}

impl Level {
    /// Stores it as that of `node`.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub fn save(&self, store: &Store, node: usize) -> Result<Stored> {
        ColumnWriter::default().push(&[self.own]).push(&self.leaves).write(store, Key::Level(node))
    }

    /// That of `node`.
    ///
    /// # Errors
    /// [`crate::Error::Io`], or [`crate::Error::Broken`] if it is not there or not whole.
    pub fn load(store: &Store, node: usize) -> Result<Level> {
        let mut columns = ColumnReader::open(store, Key::Level(node))?;
        let own = columns.column()?;
        let [own] = own[..] else { return Err(Error::Broken(format!("the record of coarser tile {node} is damaged"))) };
        Ok(Level { own, leaves: columns.column()? })
    }
}
