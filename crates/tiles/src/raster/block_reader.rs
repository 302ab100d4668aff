//! Reading the blocks of a written raster of heights back, without its overviews.
//!
//! This reads what `geotiff.rs` writes, and nothing else: the first directory, with one block after the other.

use crate::raster::BLOCK;
use crate::raster::block::unpacked;
use crate::raster::grid::blocks;
use crate::raster::options::RasterCompression;
use crate::raster::tags::TiffKind;
use std::fs::File;
use std::path::{Path, PathBuf};
use sys::positional_io::read_exact_at;
use sys::{Error, Result, fault};

/// No block is longer when it is packed.
const LONGEST: u64 = 2 * (BLOCK * BLOCK * size_of::<f32>()) as u64;

/// The tags that are read: columns, rows, offsets and lengths of blocks.
const TAGS: [u16; 4] = [256, 257, 324, 325];

/// A raster of heights.
pub struct RasterReader {
    path: PathBuf,
    file: File,
    kind: TiffKind,
    compression: RasterCompression,
    blocks: usize,
    /// Where the offsets of the blocks are in the file, and their lengths.
    tables: [u64; 2],
}

impl RasterReader {
    /// Opens the raster at `path`, which has so many columns and rows.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be read, [`Error::Input`] if it is another file.
    pub fn open(path: &Path, size: [u32; 2], compression: RasterCompression) -> Result<RasterReader> {
        let file = File::open(path).map_err(Error::io("open", path))?;
        let count = blocks(size).iter().product();
        let mut reader = RasterReader {
            path: path.into(),
            file,
            kind: TiffKind::Classic,
            compression,
            blocks: count,
            tables: [0; 2],
        };
        let mut magic = [0; 8];
        reader.read(&mut magic, 0)?;
        reader.kind = if magic == TiffKind::Big.magic() { TiffKind::Big } else { TiffKind::Classic };
        if !magic.starts_with(reader.kind.magic()) {
            return Err(reader.is_another());
        }
        let directory = reader.number(reader.kind.magic().len() as u64, reader.kind.offset_bytes())?;
        let [columns, rows, offsets, lengths] = reader.find_tags(directory)?;
        let found = [reader.number(columns, 4)?, reader.number(rows, 4)?];
        if found != size.map(u64::from) {
            return Err(reader.is_another());
        }
        reader.tables = [offsets, lengths];
        Ok(reader)
    }

    /// Returns where the values of the tags are in the file.
    fn find_tags(&self, directory: u64) -> Result<[u64; TAGS.len()]> {
        let (wide, count_bytes) = (self.kind.offset_bytes(), self.kind.count_bytes());
        let entry = (4 + 2 * wide) as u64;
        let mut places = [None; TAGS.len()];
        let count = self.number(directory, count_bytes)?.min(u64::from(u16::MAX));
        for n in 0..count {
            let at = directory.saturating_add(count_bytes as u64 + n * entry);
            let tag = self.number(at, 2)?;
            let Some(known) = TAGS.iter().position(|known| u64::from(*known) == tag) else { continue };
            // Types 4 and 16 are those of 32 and 64 bits.
            let bytes = if self.number(at + 2, 2)? == 16 { 8 } else { 4 };
            let (values, own) = (self.number(at + 4, wide)?, at + 4 + wide as u64);
            let is_inside = values.saturating_mul(bytes) <= wide as u64;
            places[known] = Some(if is_inside { own } else { self.number(own, wide)? });
        }
        match places {
            [Some(columns), Some(rows), Some(offsets), Some(lengths)] => Ok([columns, rows, offsets, lengths]),
            _ => Err(self.is_another()),
        }
    }

    /// Returns the cells of block number `block`, row by row.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read, [`Error::Input`] if it is damaged.
    pub fn block(&self, block: usize) -> Result<Vec<f32>> {
        if block >= self.blocks {
            return Err(self.is_another());
        }
        let [offsets, lengths] = self.tables;
        let wide = self.kind.offset_bytes();
        let at = self.number(offsets.saturating_add((block * wide) as u64), wide)?;
        let length = self.number(lengths.saturating_add((block * 4) as u64), 4)?;
        if length > LONGEST {
            return Err(self.is_another());
        }
        let mut bytes = vec![0; length as usize];
        self.read(&mut bytes, at)?;
        unpacked(&bytes, self.compression).ok_or_else(|| self.is_another())
    }

    /// Returns the little-endian number of so many bytes, at most 8, at a place of the file.
    fn number(&self, at: u64, bytes: usize) -> Result<u64> {
        let mut number = [0; 8];
        self.read(&mut number[..bytes], at)?;
        Ok(u64::from_le_bytes(number))
    }

    fn read(&self, bytes: &mut [u8], at: u64) -> Result<()> {
        let read = fault::read("read-result").and_then(|()| read_exact_at(&self.file, bytes, at));
        match read {
            Err(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => Err(self.is_another()),
            read => read.map_err(Error::io("read", &self.path)),
        }
    }

    fn is_another(&self) -> Error {
        Error::input(
            &self.path,
            "it is not the raster that this job wrote: another program has changed it; run the job again",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raster::block::packed;
    use crate::raster::geokeys::RasterSystem;
    use crate::raster::geotiff::{RasterHead, RasterImage, TRAILER, head};
    use crate::raster::options::RasterOptions;
    use crate::raster::products::RasterProduct;
    use sys::ErrorKind;

    const SIZE: [u32; 2] = [700, 1300];

    fn cells(block: usize) -> Vec<f32> {
        (0..BLOCK * BLOCK).map(|n| block as f32 * 1000.0 + (n % 991) as f32 * 0.13).collect()
    }

    /// Writes a raster of one image.
    fn write(path: &Path, compression: RasterCompression) {
        let options: RasterOptions = toml::from_str("resolution = 1.0").unwrap();
        let options = RasterOptions { compression, ..options };
        let blocks: Vec<Vec<u8>> = (0..6).map(|n| packed(&cells(n), RasterProduct::Height, compression)).collect();
        let about = RasterHead {
            options,
            product: RasterProduct::Height,
            corner: [0.0, 0.0],
            cell_size: 1.0,
            system: &RasterSystem::default(),
            copyright: None,
        };
        let lengths = blocks.iter().map(|block| block.len() as u32).collect();
        let mut bytes = head(&about, &[RasterImage { size: SIZE, lengths }]);
        for block in blocks {
            bytes.extend((block.len() as u32).to_le_bytes());
            bytes.extend(&block);
            bytes.extend(&block[block.len() - TRAILER..]);
        }
        std::fs::write(path, bytes).unwrap();
    }

    #[test]
    fn blocks_come_back() {
        let folder = tempfile::tempdir().unwrap();
        for compression in [RasterCompression::Deflate, RasterCompression::None] {
            let path = folder.path().join("terrain.tif");
            write(&path, compression);
            let reader = RasterReader::open(&path, SIZE, compression).unwrap();
            for block in [5, 0, 3] {
                assert_eq!(reader.block(block).unwrap(), cells(block));
            }
            assert!(reader.block(6).is_err());
        }
    }

    #[test]
    fn a_file_of_another_program_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("terrain.tif");
        write(&path, RasterCompression::Deflate);
        let open = |size| RasterReader::open(&path, size, RasterCompression::Deflate);
        assert!(open([700, 1301]).is_err());
        let bytes = std::fs::read(&path).unwrap();
        for length in [0, 5, 40, 300, bytes.len() - 300_000] {
            std::fs::write(&path, &bytes[..length]).unwrap();
            let error = open(SIZE).and_then(|reader| reader.block(5)).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Input, "{length}: {error}");
        }
        // Whatever bytes are there, nothing worse than an error comes of them.
        for at in (0..500).chain((500..bytes.len()).step_by(40_009)) {
            let mut changed = bytes.clone();
            changed[at] ^= 0x55;
            std::fs::write(&path, &changed).unwrap();
            let _ = open(SIZE).and_then(|reader| reader.block(2));
        }
    }
}
