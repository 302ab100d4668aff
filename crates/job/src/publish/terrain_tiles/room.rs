//! Which tiles of a zoom are worked on at the same time, so that they fit the memory together.

use crate::options::JobOptions;
use crate::plan::job_plan::Plan;
use crate::plan::terrain_crowd::{remedy, room_for_tiles};
use crate::progress::number_text::{grouped, mebibytes};
use crate::publish::terrain_tiles::lakes::shore_memory;
use quantized_mesh::Tile;
use rayon::prelude::*;
use std::cmp::Reverse;
use sys::{Error, Result};

/// The memory that terrain tiles may take.
pub(super) struct Room<'a> {
    bytes: u64,
    /// What the shores of lakes take besides.
    shores: u64,
    options: &'a JobOptions,
}

/// What a tile takes while something is done with it.
pub(super) struct Load {
    pub(super) tile: Tile,
    pub(super) vertices: u64,
    pub(super) bytes: u64,
}

impl<'a> Room<'a> {
    /// Returns the room in the job of `plan`.
    pub(super) fn of(plan: &'a Plan) -> Room<'a> {
        let shores = shore_memory(plan);
        Room { bytes: room_for_tiles(&plan.options).saturating_sub(shores), shores, options: &plan.options }
    }

    /// Calls `work` with all of `items`, each of which takes `load`: on all threads as long as these are small, and on fewer for great ones. What comes
    /// after that may take `later` bytes. Returns the results in the order of the items.
    ///
    /// # Errors
    /// [`Error::Config`] if there is no room for one of them alone, and those of `work`.
    pub(super) fn share<T: Sync, R: Send>(
        &self,
        items: &[T],
        load: impl Fn(&T) -> Load,
        later: u64,
        work: impl Fn(&T) -> Result<R> + Sync,
    ) -> Result<Vec<R>> {
        let loads: Vec<Load> = items.iter().map(load).collect();
        let greatest = loads.iter().max_by_key(|load| load.bytes).filter(|load| load.bytes > self.bytes);
        greatest.map_or(Ok(()), |load| Err(self.too_great(load, later)))?;
        let bytes: Vec<u64> = loads.iter().map(|load| load.bytes).collect();
        let mut results: Vec<Option<R>> = items.iter().map(|_| None).collect();
        for batch in batches(&bytes, self.bytes, rayon::current_num_threads() as u64) {
            let made = match batch[..] {
                // What the allocator keeps of one thread is not there for another, so great tiles are made by one.
                [only] => vec![work(&items[only])?],
                _ => batch.par_iter().with_max_len(1).map(|&i| work(&items[i])).collect::<Result<Vec<R>>>()?,
            };
            batch.into_iter().zip(made).for_each(|(i, made)| results[i] = Some(made));
        }
        Ok(results.into_iter().flatten().collect())
    }

    fn too_great(&self, Load { tile, vertices, bytes }: &Load, later: u64) -> Error {
        Error::Config(format!(
            "[output.terrain] takes {} for the terrain tile {}/{}/{} with {} vertices: [limits] memory = \"{}\" has no room for it; fix: {}",
            mebibytes(*bytes),
            tile.zoom,
            tile.column(),
            tile.y,
            grouped(*vertices),
            self.options.limits.memory,
            remedy((*bytes).max(later).saturating_add(self.shores), self.options)
        ))
    }
}

/// Divides things that take so many bytes: first all that fit on as many threads at the same time, then great ones, as many as have room together.
fn batches(bytes: &[u64], room: u64, threads: u64) -> Vec<Vec<usize>> {
    let (small, mut great): (Vec<usize>, Vec<usize>) =
        (0..bytes.len()).partition(|&i| bytes[i].saturating_mul(threads) <= room);
    great.sort_by_key(|&i| Reverse(bytes[i]));
    let mut batches = vec![small];
    let mut left = 0;
    for i in great {
        match (bytes[i] <= left, batches.last_mut()) {
            (true, Some(batch)) => batch.push(i),
            _ => {
                batches.push(vec![i]);
                left = room;
            }
        }
        left = left.saturating_sub(bytes[i]);
    }
    batches
}

#[cfg(test)]
mod tests {
    use super::*;
    use quantized_mesh::Scheme;

    fn options() -> JobOptions {
        let text = r#"{"input":{"files":[]},"triangulation":{"backend":"auto"},"gpu":{"voronoi":"auto","adapter":null,"texture":"auto"},
            "output":{"directory":"out"},"limits":{"threads":2}}"#;
        serde_json::from_str(text).unwrap()
    }

    fn load(bytes: u64) -> Load {
        Load { tile: Tile { scheme: Scheme::Geographic, zoom: 12, y: 3, x: 4 }, vertices: 77_000, bytes }
    }

    #[test]
    fn what_is_worked_on_at_the_same_time_has_room() {
        let bytes = [3, 90, 30, 25, 1, 60, 40, 26, 10];
        let found = batches(&bytes, 100, 4);
        assert_eq!(found, [vec![0, 3, 4, 8], vec![1], vec![5, 6], vec![2, 7]]);
        assert!(found[1..].iter().all(|batch| batch.iter().map(|&i| bytes[i]).sum::<u64>() <= 100));
    }

    /// The allocator keeps of each thread what it has had.
    #[test]
    fn great_things_are_made_by_one_thread() {
        let options = options();
        let room = Room { bytes: 100, shores: 0, options: &options };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(4).build().unwrap();
        let threads = pool.install(|| {
            room.share(&[90u64; 12], |bytes| load(*bytes), 0, |_| Ok(std::thread::current().id())).unwrap()
        });
        assert!(threads.iter().all(|thread| *thread == threads[0]), "{threads:?}");
    }

    #[test]
    fn results_come_in_the_order_of_the_items_and_one_without_room_is_refused() {
        let options = options();
        let room = Room { bytes: 100, shores: 0, options: &options };
        let items = [5u64, 80, 7, 99, 60, 1];
        let doubled = room.share(&items, |item| load(*item), 0, |item| Ok(item * 2)).unwrap();
        assert_eq!(doubled, items.map(|item| item * 2));
        let why = |sizes: &[u64], later: u64| {
            let none = room.share(sizes, |bytes| load(*bytes), later, |bytes| Ok(*bytes));
            none.unwrap_err().to_string()
        };
        let of_one = why(&[5, 101], 0);
        assert!(
            of_one.contains("the terrain tile 12/4/3 with ") && of_one.contains("memory = \"128 MiB\""),
            "{of_one}"
        );
        // The limit that is named has room for the greatest, and for what comes after it.
        assert!(why(&[101, 190 << 20, 5], 0).contains("memory = \"320 MiB\""));
        assert!(why(&[101], 190 << 20).contains("memory = \"320 MiB\""));
    }
}
