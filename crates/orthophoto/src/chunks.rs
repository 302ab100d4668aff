//! The tiles or strips of a picture, read one by one. The last ones stay in memory.

use crate::bands::Bands;
use crate::errors::{PhotoError, if_there};
use crate::image::Image;
use crate::jpeg;
use std::collections::VecDeque;
use std::io::SeekFrom;
use std::sync::{Arc, Mutex, PoisonError};
use sys::catch_panic::catch_panic;
use tiff::decoder::{ChunkType, DecodingResult, Limits};
use tiff::tags::Tag;

/// A tile or strip.
#[derive(Debug)]
pub(crate) struct Chunk {
    /// Pixels in a row.
    width: usize,
    /// All pixels, row by row, with their bands side by side. Empty where the file has no picture.
    bytes: Vec<u8>,
}

impl Chunk {
    /// Returns the values of a pixel, each of `bands` bytes; none outside the chunk.
    pub(crate) fn pixel(&self, column: u32, row: u32, bands: usize) -> &[u8] {
        let at =
            (row as usize).checked_mul(self.width).and_then(|at| at.checked_add(column as usize)?.checked_mul(bands));
        at.and_then(|at| self.bytes.get(at..at.checked_add(bands)?)).unwrap_or_default()
    }
}

/// How the chunks of a picture lie in it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ChunkGrid {
    /// Columns and rows of the picture.
    pub(crate) size: [u32; 2],
    /// Columns and rows of a chunk.
    chunk: [u32; 2],
}

impl ChunkGrid {
    /// Returns the number of the chunk that has a pixel, and the pixel's column and row there.
    pub(crate) fn place(&self, [column, row]: [u32; 2]) -> (u32, [u32; 2]) {
        let across = self.size[0].div_ceil(self.chunk[0]);
        let [i, j] = [column / self.chunk[0], row / self.chunk[1]];
        (j.saturating_mul(across).saturating_add(i), [column % self.chunk[0], row % self.chunk[1]])
    }

    /// Returns the bytes of a chunk.
    fn bytes(&self, bands: usize) -> u64 {
        u64::from(self.chunk[0]) * u64::from(self.chunk[1]) * bands as u64
    }
}

/// Reads chunks.
pub(crate) struct Chunks {
    pub(crate) grid: ChunkGrid,
    bands: Bands,
    most_bytes: u64,
    kind: ChunkType,
    /// Where each chunk begins in the file, and how many bytes it has there.
    places: Vec<(u64, u64)>,
    /// What all JPEG chunks have in common.
    tables: Vec<u8>,
    state: Mutex<State>,
}

struct State {
    image: Image,
    /// The chunks that were used last, the latest one at the end.
    recent: VecDeque<(u32, Arc<Chunk>)>,
    bytes: u64,
}

impl std::fmt::Debug for Chunks {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Chunks").field("grid", &self.grid).finish_non_exhaustive()
    }
}

impl Chunks {
    /// Returns the chunks of an image. All that stay in memory have `most_bytes` bytes at most, or one has as many.
    ///
    /// # Errors
    /// What is wrong with the picture.
    pub(crate) fn new(mut image: Image, bands: Bands, most_bytes: u64) -> Result<Chunks, PhotoError> {
        let (width, height) = image.dimensions()?;
        let (columns, rows) = image.chunk_dimensions();
        let grid = ChunkGrid { size: [width, height], chunk: [columns, rows.min(height)] };
        if grid.size.contains(&0) || grid.chunk.contains(&0) {
            return Err("it has no pixels".into());
        }
        let bytes = grid.bytes(bands.count);
        if bytes > most_bytes {
            return Err(format!(
                "its tiles or strips have {} MiB each, and {} MiB fit: cut it into smaller tiles, for example with `gdal_translate -of COG`, or \
                 raise [limits] memory",
                bytes >> 20,
                most_bytes >> 20
            )
            .into());
        }
        let limit = usize::try_from(most_bytes).unwrap_or(usize::MAX);
        let mut limits = Limits::default();
        limits.decoding_buffer_size = limit;
        limits.intermediate_buffer_size = limit;
        image = image.with_limits(limits);
        let kind = image.get_chunk_type();
        let [offsets, counts] = match kind {
            ChunkType::Tile => [Tag::TileOffsets, Tag::TileByteCounts],
            ChunkType::Strip => [Tag::StripOffsets, Tag::StripByteCounts],
        };
        let mut numbers = |tag| image.get_tag_u64_vec(tag);
        let places: Vec<_> = numbers(offsets)?.into_iter().zip(numbers(counts)?).collect();
        let last = grid.place([width - 1, height - 1]).0;
        if places.len() <= last as usize {
            return Err(
                format!("it has {} tiles or strips, and its size needs {}", places.len(), u64::from(last) + 1).into()
            );
        }
        let tables = if bands.is_jpeg { if_there(image.get_tag_u8_vec(Tag::JPEGTables))? } else { Vec::new() };
        let state = Mutex::new(State { image, recent: VecDeque::new(), bytes: 0 });
        Ok(Chunks { grid, bands, most_bytes, kind, places, tables, state })
    }

    /// Returns a chunk.
    ///
    /// # Errors
    /// What is wrong with the picture.
    pub(crate) fn get(&self, number: u32) -> Result<Arc<Chunk>, PhotoError> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(at) = state.recent.iter().position(|(known, _)| *known == number) {
            let found = state.recent.remove(at);
            return found.map(|found| state.keep(found)).ok_or_else(|| "it is gone".into());
        }
        let read = catch_panic(|| self.read(&mut state.image, number)).unwrap_or_else(|e| Err(e.to_string().into()));
        let chunk = Arc::new(read.map_err(|what| what.with(format!("tile or strip {number} cannot be read")))?);
        state.bytes += chunk.bytes.len() as u64;
        while state.bytes > self.most_bytes
            && let Some((_, oldest)) = state.recent.pop_front()
        {
            state.bytes -= oldest.bytes.len() as u64;
        }
        Ok(state.keep((number, chunk)))
    }

    fn read(&self, image: &mut Image, number: u32) -> Result<Chunk, PhotoError> {
        let place = self.places.get(number as usize).copied();
        let (offset, count) = place.ok_or("it is not there")?;
        if count == 0 {
            return Ok(Chunk { width: 0, bytes: Vec::new() });
        }
        let (width, height) = image.chunk_data_dimensions(number);
        if !self.bands.is_jpeg {
            return match image.read_chunk(number)? {
                DecodingResult::U8(bytes) => Ok(Chunk { width: width as usize, bytes }),
                _ => Err("its data type differs from its tags".into()),
            };
        }
        if count > self.most_bytes {
            return Err(format!("it has {count} bytes, more than fit").into());
        }
        let mut piece = vec![0; usize::try_from(count).map_err(|e| e.to_string())?];
        let bytes = image.inner();
        bytes.seek(SeekFrom::Start(offset))?;
        bytes.read_exact(&mut piece)?;
        // Tiles at the border are whole, strips are not.
        let [columns, rows] = match self.kind {
            ChunkType::Tile => self.grid.chunk,
            ChunkType::Strip => [width, height],
        };
        let size = [columns as usize, rows as usize, self.bands.count];
        let bytes = jpeg::decode(&self.tables, &piece, size, self.bands.is_ycbcr)?;
        Ok(Chunk { width: columns as usize, bytes })
    }
}

impl State {
    /// Puts a chunk at the end of the recent ones.
    fn keep(&mut self, (number, chunk): (u32, Arc<Chunk>)) -> Arc<Chunk> {
        self.recent.push_back((number, chunk.clone()));
        chunk
    }
}
