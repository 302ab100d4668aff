//! The difference of two terrains: reads both tile by tile, and overlays what lies over each other.

use crate::areas::{Areas, read_areas};
use crate::common_lattice::{CommonLattice, TOO_FINE};
use crate::difference::{AreaDifference, Difference, Scale};
use crate::tile_meshes::{MeshCache, TileFacts, TileMeshes};
use crate::written::DifferenceOutput;
use crate::written::compared::Compared;
use crate::written::folder::{DifferenceFolder, SUMMARY};
use overlay::{Comparison, FixedSum, Zones, compare};
use rayon::prelude::*;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use sys::{Error, Warnings, address_space, interrupt};
use terrain::{FinishedTerrain, Result, same_system};

/// Comparing a tile takes at most this many times the memory of its meshes.
const MEMORY_FACTOR: u64 = 12;

/// A mesh that is kept takes at most this many times the memory of a tile's meshes.
const KEPT_FACTOR: u64 = 4;

/// More meshes of the earlier terrain than this, for each thread, are not kept: neighbours are few.
const KEPT_FOR_EACH: usize = 32;

/// What is to be compared.
#[derive(Clone, Debug)]
pub struct DiffRequest {
    /// The output directory of the earlier terrain.
    pub before: PathBuf,
    /// The output directory of the later terrain.
    pub after: PathBuf,
    /// Smaller changes, in source units of height, are left out of cut and fill. It is not negative.
    pub threshold: f64,
    /// A file of polygons, each of which gets figures of its own.
    pub areas: Option<PathBuf>,
    /// About how many bytes of memory may be used.
    pub memory: u64,
    /// Where a raster and a mesh of the difference are written; `None` for figures alone.
    pub output: Option<DifferenceOutput>,
}

/// Compares two terrains, and writes the files of their difference if they are wanted.
///
/// # Errors
/// [`Error::Config`] if one is no output directory, their CRSs, units or vertical datums differ, or their lattices have no common step;
/// [`Error::Input`] if something is not as a job wrote it, or the file of areas is bad; [`terrain::Error::Unfinished`]; [`Error::Memory`] if
/// one tile alone needs more memory; [`Error::Io`]; [`Error::Interrupted`]. [`Error::Config`] also if the folder of the output has something
/// else in it, or its raster has too many cells.
pub fn run(request: &DiffRequest) -> Result<Difference> {
    let memory = address_space::at_start().map_or(request.memory, |left| request.memory.min(left.bytes));
    let [before, after] = [FinishedTerrain::open(&request.before)?, FinishedTerrain::open(&request.after)?];
    let mut warnings = Warnings::default();
    let folder = request.output.as_ref().map(|output| DifferenceFolder::at(&output.directory)).transpose()?;
    let names = [&request.before, &request.after].map(|path| path.display().to_string());
    same_system([before.system(), after.system()], names.each_ref().map(String::as_str), &mut warnings)?;
    let lattice = CommonLattice::new([before.lattice(), after.lattice()])?;
    let lattice = if request.areas.is_some() { lattice.for_places() } else { lattice };
    let read = |path: &Path| read_areas(path, before.system(), &lattice, memory, &mut warnings);
    let areas = request.areas.as_deref().map(read).transpose()?;
    let lanes = Lanes::new([&before, &after], memory)?;
    let meshes = [TileMeshes::new(&before, lattice.ways[0]), TileMeshes::new(&after, lattice.ways[1])];
    let facts = (0..before.count()).into_par_iter().map(|number| Ok(TileFacts::of(&meshes[0].read(number)?)));
    let facts = facts.collect::<sys::Result<Vec<TileFacts>>>()?;
    let cache = MeshCache::new(&meshes[0], lanes.kept);
    let run = Run {
        meshes: &meshes,
        cache: &cache,
        facts: &facts,
        zones: areas.as_ref().map(|areas| &areas.zones),
        threshold: lattice.steps_of_height(request.threshold),
        next: AtomicUsize::new(0),
    };
    let found = (0..lanes.count).into_par_iter().map(|_| run.compare_tiles());
    let mut found = found.try_reduce(|| run.nothing(), |a, b| Ok(a.merge(b)))?;
    let area_before = facts.iter().fold(FixedSum::default(), |mut sum, facts| {
        sum.add_half(facts.double_area);
        sum
    });
    let scale = Scale::new(lattice.step_lengths(), before.system());
    let areas_of_both = [area_before, found.area_after];
    let refuse = || Error::Config(format!("the sums are too large for 128 bits: {TOO_FINE}"));
    let figures = difference(request, [&before, &after], &scale, areas_of_both, &found.comparison, areas, warnings);
    let mut difference = figures.ok_or_else(refuse)?;
    let (Some(output), Some(folder)) = (&request.output, &folder) else { return Ok(difference) };
    found.facts.sort_unstable_by_key(|(number, _)| *number);
    let facts_after: Vec<TileFacts> = found.facts.into_iter().map(|(_, facts)| facts).collect();
    let compared = Compared {
        terrains: [&before, &after],
        lattice: &lattice,
        facts: [&facts, &facts_after],
        areas: areas_of_both,
        cache: &cache,
        lanes: lanes.count,
        memory,
        threshold: request.threshold,
        greatest: found.comparison.all.max_rise.max(found.comparison.all.max_fall),
    };
    difference.written = Some(compared.write(output, folder, &mut difference.warnings)?);
    write_summary(folder, &difference)?;
    folder.publish()?;
    Ok(difference)
}

/// Writes all figures into the folder.
fn write_summary(folder: &DifferenceFolder, difference: &Difference) -> sys::Result<()> {
    #[derive(Serialize)]
    struct Summary<'a> {
        generator: &'a str,
        #[serde(flatten)]
        difference: &'a Difference,
    }
    let generator = concat!("gdt-batch ", env!("CARGO_PKG_VERSION"));
    let text = serde_json::to_string_pretty(&Summary { generator, difference })
        .map_err(|error| Error::Broken(format!("the figures cannot be written as JSON: {error}")))?;
    folder.write(SUMMARY, format!("{text}\n").as_bytes())
}

/// How many tiles may be compared at the same time, and how many meshes kept.
struct Lanes {
    count: usize,
    kept: usize,
}

impl Lanes {
    fn new(terrains: [&FinishedTerrain; 2], memory: u64) -> sys::Result<Lanes> {
        let [before, after] = [terrains[0].largest_tile()?, terrains[1].largest_tile()?];
        let (each, kept) = ((before + after) * MEMORY_FACTOR / 2, (before * KEPT_FACTOR).max(1));
        let lanes = usize::try_from(memory / 2 / each.max(1)).unwrap_or(usize::MAX);
        if lanes == 0 && each > memory {
            let needed = (each >> 20) + 1;
            return Err(Error::Memory(format!(
                "the largest tiles take about {needed} MiB to compare: set --memory \"{needed} MiB\" or more"
            )));
        }
        let count = lanes.clamp(1, rayon::current_num_threads());
        let kept = usize::try_from(memory / 2 / kept).unwrap_or(usize::MAX).min(KEPT_FOR_EACH * count);
        Ok(Lanes { count, kept })
    }
}

/// What the threads share that compare tiles.
struct Run<'a> {
    meshes: &'a [TileMeshes<'a>; 2],
    /// Tiles of the earlier terrain.
    cache: &'a MeshCache<'a>,
    facts: &'a [TileFacts],
    zones: Option<&'a Zones>,
    /// In steps of height.
    threshold: f64,
    /// The number of the next tile of the later terrain.
    next: AtomicUsize,
}

/// What some tiles have shown.
struct Found {
    comparison: Comparison,
    area_after: FixedSum,
    /// What is known of the tiles of the later terrain, by their numbers.
    facts: Vec<(usize, TileFacts)>,
}

impl Found {
    fn merge(mut self, other: Found) -> Found {
        self.comparison.merge(&other.comparison);
        self.area_after.merge(other.area_after);
        self.facts.extend(other.facts);
        self
    }
}

impl Run<'_> {
    fn nothing(&self) -> Found {
        let comparison = Comparison::new(self.zones.map_or(0, Zones::count));
        Found { comparison, area_after: FixedSum::default(), facts: Vec::new() }
    }

    /// Compares one tile of the later terrain after the other until none is left.
    fn compare_tiles(&self) -> sys::Result<Found> {
        let mut found = self.nothing();
        loop {
            let number = self.next.fetch_add(1, Ordering::Relaxed);
            if number >= self.meshes[1].terrain.count() {
                return Ok(found);
            }
            let after = self.meshes[1].read(number)?;
            found.area_after.add_half(after.double_area());
            found.facts.push((number, TileFacts::of(&after)));
            let zones = self.zones.map(|zones| zones.of(&after));
            for (earlier, _) in self.facts.iter().enumerate().filter(|(_, tile)| tile.bounds.overlaps(&after.bounds()))
            {
                interrupt::check()?;
                let before = self.cache.get(earlier)?;
                compare(&before, &after, self.threshold, zones.as_ref(), &mut found.comparison);
            }
        }
    }
}

/// Returns the figures in metres and in source units; `None` if a sum was too large.
fn difference(
    request: &DiffRequest,
    [before, after]: [&FinishedTerrain; 2],
    scale: &Scale,
    areas: [FixedSum; 2],
    comparison: &Comparison,
    named: Option<Areas>,
    mut warnings: Warnings,
) -> Option<Difference> {
    let figures = scale.figures(&comparison.all)?;
    if figures.area == 0.0 {
        warnings.push("the terrains do not overlap");
    }
    let of_area = |((number, name), totals): ((u64, Option<String>), _)| {
        Some(AreaDifference { number, name, figures: scale.figures(totals)? })
    };
    let named = named.map(|named| named.features.into_iter().zip(&comparison.zones).map(of_area).collect());
    let system = if before.system().name().is_some() { before.system() } else { after.system() };
    let [unit, unit_z] = system.units();
    let only = |area: FixedSum| scale.area_only(area, comparison.all.area);
    Some(Difference {
        before: request.before.display().to_string(),
        after: request.after.display().to_string(),
        crs: system.name(),
        unit,
        unit_z,
        metres_per_unit: system.metres[0],
        metres_per_unit_z: system.metres[1],
        threshold: request.threshold,
        figures,
        area_before_only: only(areas[0])?,
        area_after_only: only(areas[1])?,
        areas: match named {
            None => None,
            Some(all) => Some(all_of(all)?),
        },
        written: None,
        warnings,
    })
}

fn all_of(all: Vec<Option<AreaDifference>>) -> Option<Vec<AreaDifference>> {
    all.into_iter().collect()
}
