//! Files in which pieces and meshes of tiles wait.

use crate::durable::directory::JobDirectory;
use crate::durable::waiting_file::WaitingFile;
use bytemuck::{Pod, Zeroable, bytes_of, bytes_of_mut, cast_slice, cast_slice_mut, zeroed_vec};
use quantized_mesh::{BorderNormal, Node, OUTSIDE, Piece, TileMesh};
use sys::Result;

/// Records in files. Threads may add some in any order. Those that write to one file would wait for each other, so there are several.
pub(super) struct WaitingRecords(Vec<WaitingFile>);

/// The most files of records.
const MOST_FILES: usize = 8;

/// The place of a record in its file has so many bits; the number of the file is above them.
const PLACE_BITS: u32 = 56;

/// What a record has, at its beginning.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Counts {
    border: u32,
    nodes: u32,
    triangles: u32,
    corners: [i32; 4],
}

impl Counts {
    /// Tells whether numbers of vertices take two bytes.
    fn is_short(&self) -> bool {
        self.nodes <= 1 << 16
    }
}

impl WaitingRecords {
    /// Makes the files of this name.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(super) fn create(directory: &JobDirectory, name: &str) -> Result<WaitingRecords> {
        let file = |number: usize| WaitingFile::at(&directory.scratch(&format!("{name}.{number}")));
        (0..rayon::current_num_threads().clamp(1, MOST_FILES)).map(file).collect::<Result<_>>().map(WaitingRecords)
    }

    /// Adds a piece, and returns its place.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(super) fn add_piece(&self, piece: &Piece) -> Result<u64> {
        let corners = piece.corners.map(|corner| corner.unwrap_or(OUTSIDE));
        self.add(corners, &[], &piece.nodes, &piece.triangles)
    }

    /// Adds a mesh with what it adds to the normals on its border, and returns its place.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(super) fn add_mesh(&self, mesh: &TileMesh, border: &[BorderNormal]) -> Result<u64> {
        self.add([OUTSIDE; 4], border, &mesh.nodes, &mesh.triangles)
    }

    fn add(&self, corners: [i32; 4], border: &[BorderNormal], nodes: &[Node], triangles: &[[u32; 3]]) -> Result<u64> {
        let [of_border, of_nodes, of_triangles] =
            [border.len(), nodes.len(), triangles.len()].map(|count| count as u32);
        let counts = Counts { border: of_border, nodes: of_nodes, triangles: of_triangles, corners };
        let short: Vec<u16> = match counts.is_short() {
            true => triangles.as_flattened().iter().map(|&v| v as u16).collect(),
            false => Vec::new(),
        };
        let corners: &[u8] = if counts.is_short() { cast_slice(&short) } else { cast_slice(triangles) };
        let parts = [bytes_of(&counts), cast_slice(border), cast_slice(nodes), corners];
        let number = rayon::current_thread_index().unwrap_or(0) % self.0.len();
        let file = &self.0[number];
        let first = file.reserve(parts.iter().map(|part| part.len() as u64).sum());
        let mut at = first;
        for part in parts {
            file.write(part, at)?;
            at += part.len() as u64;
        }
        Ok((number as u64) << PLACE_BITS | first)
    }

    /// Reads a piece.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(super) fn piece(&self, at: u64) -> Result<Piece> {
        let (counts, mut at) = self.counts(at)?;
        at += u64::from(counts.border) * size_of::<BorderNormal>() as u64;
        let nodes = self.list(&mut at, counts.nodes)?;
        let triangles = self.triangles(&mut at, counts)?;
        let corners = counts.corners.map(|corner| (corner != OUTSIDE).then_some(corner));
        Ok(Piece { nodes, triangles, corners })
    }

    /// Reads a mesh.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(super) fn mesh(&self, at: u64) -> Result<TileMesh> {
        let Piece { nodes, triangles, .. } = self.piece(at)?;
        Ok(TileMesh { nodes, triangles })
    }

    /// Reads the vertices of a mesh.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(super) fn nodes(&self, at: u64) -> Result<Vec<Node>> {
        let (counts, mut at) = self.counts(at)?;
        at += u64::from(counts.border) * size_of::<BorderNormal>() as u64;
        self.list(&mut at, counts.nodes)
    }

    /// Reads what a mesh adds to the normals on its border.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(super) fn border(&self, at: u64) -> Result<Vec<BorderNormal>> {
        let (counts, mut at) = self.counts(at)?;
        self.list(&mut at, counts.border)
    }

    fn counts(&self, at: u64) -> Result<(Counts, u64)> {
        let mut counts = Counts::zeroed();
        self.read(bytes_of_mut(&mut counts), at)?;
        Ok((counts, at + size_of::<Counts>() as u64))
    }

    fn triangles(&self, at: &mut u64, counts: Counts) -> Result<Vec<[u32; 3]>> {
        if !counts.is_short() {
            return self.list(at, counts.triangles);
        }
        let short: Vec<[u16; 3]> = self.list(at, counts.triangles)?;
        Ok(short.into_iter().map(|corners| corners.map(u32::from)).collect())
    }

    /// Reads so many things, and goes on behind them.
    fn list<T: Pod>(&self, at: &mut u64, count: u32) -> Result<Vec<T>> {
        let mut list = zeroed_vec(count as usize);
        self.read(cast_slice_mut(&mut list), *at)?;
        *at += size_of_val(&list[..]) as u64;
        Ok(list)
    }

    fn read(&self, bytes: &mut [u8], at: u64) -> Result<()> {
        self.0[(at >> PLACE_BITS) as usize].read(bytes, at & ((1 << PLACE_BITS) - 1))
    }

    /// Removes the files.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(super) fn discard(self) -> Result<()> {
        self.0.into_iter().try_for_each(WaitingFile::discard)
    }
}
