//! A tile that was read back, to be written again with other colours: its vertices keep their positions, bit for bit.

use std::path::Path;

use crate::compression::Compression;
use crate::frame::{Extras, Frame};
use crate::gltf::glb::GlbEncoder;
use crate::gltf::read::{TileFile, read_packed_tile_of};
use crate::lod::join::Joining;
use crate::tile::Tile;
use lattice::Lattice;
use sys::{Error, Result};

/// A tile, and how its file was written.
#[derive(Clone, Debug)]
pub struct WrittenTile {
    /// The whole content.
    pub tile: Tile,
    frame: Frame,
    compression: Compression,
}

impl WrittenTile {
    /// Reads the tile of the file at `path`, whose `bytes` these are. `extras` and `lattice` are those of its job.
    ///
    /// # Errors
    /// [`Error::Input`] if it is no tile of this job.
    pub fn of(path: &Path, bytes: Vec<u8>, extras: &Extras, lattice: &Lattice) -> Result<WrittenTile> {
        let (file, compression) = read_packed_tile_of(path, bytes)?;
        if file.extras != *extras {
            return Err(Error::input(path, "it comes from another job than the first tile"));
        }
        let frame = frame_of(&file, lattice)?.ok_or_else(|| Error::input(path, "a vertex is not on the lattice"))?;
        let vertices = file.parts.iter().map(|part| part.positions.len()).sum();
        let mut joining = Joining::new(&frame, vertices);
        joining.add(file).map_err(|error| Error::input(path, error.to_string()))?;
        Ok(WrittenTile { tile: joining.finish().into_tile(), frame, compression })
    }

    /// Encodes the tile as its file was.
    ///
    /// # Errors
    /// [`Error::Config`] if the file would pass 4 GiB.
    pub fn encode(&self, copyright: Option<&str>) -> Result<Vec<u8>> {
        let mut encoder = GlbEncoder::default();
        encoder.encode(&self.frame, &self.tile, self.compression, copyright)?;
        Ok(encoder.pieces().concat())
    }
}

/// Returns the frame with the coarsest steps in which all meshes of a tile lie on the lattice, whatever the job has chosen its steps by.
fn frame_of(file: &TileFile, lattice: &Lattice) -> Result<Option<Frame>> {
    let Extras { metres_per_unit, metres_per_unit_z, crs, curvature, .. } = file.extras.clone();
    let flat = Frame::new(lattice, metres_per_unit, metres_per_unit_z, crs)?;
    let frame = match curvature {
        Some(curvature) => flat.curved(curvature),
        None => flat,
    };
    let holds = |frame: &Frame| {
        file.parts.iter().all(|part| frame.points(&part.positions, part.translation, part.scale).is_ok())
    };
    Ok(frame.possible().find(holds))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gltf::read::read_surface_of;
    use delaunay::geometry::Bounds;
    use rust_decimal::Decimal;

    fn lattice() -> Lattice {
        Lattice::new([Decimal::new(6_355_777, 1), Decimal::ZERO, Decimal::TEN], Decimal::new(1, 2), Decimal::new(25, 3))
            .unwrap()
    }

    fn tile() -> Tile {
        let positions = (0..400).map(|n| [n % 20 * 317, n / 20 * 271, (n * n) % 997]).collect();
        let square = |n: u32| [[n, n + 1, n + 21], [n, n + 21, n + 20]];
        let corners = (0..380).filter(|n| n % 20 < 19);
        Tile { positions, triangles: corners.flat_map(square).collect(), ..Tile::default() }
    }

    #[test]
    fn a_tile_with_other_colours_keeps_the_bits_of_its_positions() {
        let path = Path::new("000000.glb");
        let flat = Frame::new(&lattice(), 0.3048, 0.3048, None).unwrap();
        let wide = Bounds { min: [0; 3], max: [20_000, 20_000, 1000] };
        let far = Bounds { min: [0; 3], max: [2_000_000_000, 2_000_000_000, 100_000_000] };
        let frames = [
            (flat.clone().packed(), Compression::Meshopt),
            (flat.clone().packed(), Compression::Quantized),
            (flat.clone().refined(wide), Compression::None),
            (flat.clone().refined(far), Compression::None),
        ];
        for (frame, compression) in frames {
            let mut encoder = GlbEncoder::default();
            encoder.encode(&frame, &tile(), compression, Some("(c) us")).unwrap();
            let bytes = encoder.pieces().concat();
            let places = |bytes: Vec<u8>| {
                let file = read_surface_of(path, bytes).unwrap();
                let of_part = |part: &crate::gltf::read::TilePart| {
                    (0..part.positions.len()).map(|v| part.world(v).map(f64::to_bits)).collect::<Vec<_>>()
                };
                let mut places: Vec<[u64; 3]> = file.parts.iter().flat_map(of_part).collect();
                places.sort_unstable();
                places
            };
            let mut written = WrittenTile::of(path, bytes.clone(), frame.extras(), &lattice()).unwrap();
            assert_eq!(written.compression, compression);
            written.tile.colors = Some(vec![[65535, 0, 0]; written.tile.positions.len()]);
            let again = written.encode(Some("(c) us")).unwrap();
            assert_eq!(places(again.clone()), places(bytes));
            let read = WrittenTile::of(path, again, frame.extras(), &lattice()).unwrap();
            assert!(read.tile.colors.unwrap().iter().all(|color| *color == [65535, 0, 0]));
            let other = Extras { resolution: 0.02, ..frame.extras().clone() };
            assert!(WrittenTile::of(path, encoder.pieces().concat(), &other, &lattice()).is_err());
        }
    }
}
