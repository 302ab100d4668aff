//! Pieces of contour lines, in a file of their own until all tiles are traced.

use crate::durable::waiting_file::WaitingFile;
use bytemuck::{Zeroable, cast_slice, cast_slice_mut, zeroed_vec};
use contours::{Band, Chain, Piece};
use rayon::prelude::*;
use std::ops::Range;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use sys::Result;

/// The bytes of a point.
pub(super) const POINT: u64 = size_of::<[f64; 2]>() as u64;

/// Pieces are read together if no more than so many bytes lie between them.
const GAP: u64 = 16 << 10;

/// The most bytes that are read at one time, unless one piece is longer.
const READ_AT_ONCE: u64 = 1 << 20;

/// A band of levels of a tile in the file. First come the points, then the chains, then the number of the first chain of each level.
struct StoredBand {
    levels: Range<u32>,
    chains_at: u64,
    starts_at: u64,
}

/// The chains of all tiles. Threads may add bands in any order.
pub(super) struct WaitingChains {
    file: WaitingFile,
    bands: Mutex<Vec<StoredBand>>,
}

impl WaitingChains {
    /// Makes the file at `path`.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(super) fn create(path: &Path) -> Result<WaitingChains> {
        Ok(WaitingChains { file: WaitingFile::at(path)?, bands: Mutex::default() })
    }

    /// Adds a band of a tile.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(super) fn add(&self, mut band: Band) -> Result<()> {
        if band.chains.is_empty() {
            return Ok(());
        }
        let (points, chains) = (size_of_val(&band.points[..]) as u64, size_of_val(&band.chains[..]) as u64);
        let at = self.file.reserve(points + chains + size_of_val(&band.starts[..]) as u64);
        let (chains_at, starts_at) = (at + points, at + points + chains);
        let stored = StoredBand { levels: band.levels(), chains_at, starts_at };
        self.bands.lock().unwrap_or_else(PoisonError::into_inner).push(stored);
        band.chains.iter_mut().for_each(|chain| *chain = chain.moved_to(at + chain.at * POINT));
        self.file.write(cast_slice(&band.points), at)?;
        self.file.write(cast_slice(&band.chains), chains_at)?;
        self.file.write(cast_slice(&band.starts), starts_at)
    }

    /// Ends the adding.
    pub(super) fn finish(self) -> FinishedChains {
        let mut bands = self.bands.into_inner().unwrap_or_else(PoisonError::into_inner);
        bands.sort_unstable_by_key(|band| (band.levels.start, band.chains_at));
        FinishedChains { file: self.file, bands, next: 0, active: Vec::new() }
    }
}

/// The chains of all tiles, to be taken level by level.
pub(super) struct FinishedChains {
    file: WaitingFile,
    /// All bands, by their first levels.
    bands: Vec<StoredBand>,
    /// The number of the first band that no level has reached yet.
    next: usize,
    /// The numbers of the bands that the last level was in.
    active: Vec<usize>,
}

impl FinishedChains {
    /// Returns the chains of a level in all tiles. Levels must be taken in ascending order. The place of a point is that of its bytes.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(super) fn chains_of(&mut self, level: u32) -> Result<Vec<Chain>> {
        while self.bands.get(self.next).is_some_and(|band| band.levels.start <= level) {
            self.active.push(self.next);
            self.next += 1;
        }
        self.active.retain(|band| self.bands[*band].levels.contains(&level));
        let bands = self.active.par_iter().map(|band| self.chains_in(&self.bands[*band], level));
        bands.try_reduce(Vec::new, |mut all, more| {
            all.extend(more);
            Ok(all)
        })
    }

    fn chains_in(&self, band: &StoredBand, level: u32) -> Result<Vec<Chain>> {
        let number = u64::from(level - band.levels.start);
        let mut starts = [0u64; 2];
        self.file.read(cast_slice_mut(&mut starts), band.starts_at + number * size_of::<u64>() as u64)?;
        let [from, to] = starts;
        let mut chains = vec![Chain::zeroed(); (to - from) as usize];
        self.file.read(cast_slice_mut(&mut chains), band.chains_at + from * size_of::<Chain>() as u64)?;
        Ok(chains)
    }

    /// Returns the points of pieces, one after the other.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(super) fn points_of(&self, pieces: &[Piece]) -> Result<Vec<[f64; 2]>> {
        let mut total = 0;
        let mut places: Vec<(Piece, usize)> = Vec::with_capacity(pieces.len());
        for piece in pieces {
            places.push((*piece, total));
            total += piece.points as usize;
        }
        places.sort_unstable_by_key(|(piece, _)| piece.at);
        let mut points: Vec<[f64; 2]> = zeroed_vec(total);
        let mut bytes = Vec::new();
        let end = |piece: &Piece| piece.at + u64::from(piece.points) * POINT;
        let mut left = &places[..];
        while let Some((first, _)) = left.first() {
            let fits = |pair: &[(Piece, usize)]| {
                pair[1].0.at <= end(&pair[0].0) + GAP && end(&pair[1].0) <= first.at + READ_AT_ONCE
            };
            let count = 1 + left.windows(2).take_while(|pair| fits(pair)).count();
            let (together, rest) = left.split_at(count);
            let past = together.iter().map(|(piece, _)| end(piece)).max().unwrap_or(first.at);
            bytes.resize((past - first.at) as usize, 0);
            self.file.read(&mut bytes, first.at)?;
            for (piece, place) in together {
                let target: &mut [u8] = cast_slice_mut(&mut points[*place..][..piece.points as usize]);
                target.copy_from_slice(&bytes[(piece.at - first.at) as usize..][..target.len()]);
            }
            left = rest;
        }
        Ok(points)
    }

    /// Removes the file.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub(super) fn discard(self) -> Result<()> {
        self.file.discard()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_come_back_in_the_order_of_the_pieces() {
        let folder = tempfile::tempdir().unwrap();
        let waiting = WaitingChains::create(&folder.path().join("chains")).unwrap();
        let points: Vec<[f64; 2]> = (0..200_000).map(|n| [f64::from(n), 0.5]).collect();
        waiting.file.add(cast_slice(&points)).unwrap();
        let finished = waiting.finish();
        // Neighbours, far apart, the same twice as where a ring is cut, longer than is read at one time.
        let ranges = [150_000..150_003, 7..9, 3..7, 8..9, 0..100_000, 190_000..190_001, 189_999..190_001];
        let piece = |range: &Range<u32>| Piece { at: u64::from(range.start) * POINT, points: range.len() as u32 };
        let found = finished.points_of(&ranges.each_ref().map(piece)).unwrap();
        let expected = ranges.into_iter().flatten().map(|n| [f64::from(n), 0.5]);
        assert!(found.into_iter().eq(expected));
        assert_eq!(finished.points_of(&[]).unwrap(), [[0.0; 2]; 0]);
    }
}
