//! The report as a table of all figures, for `--verbose`. [`crate::report::summary`] has what everyone should see.

use crate::progress::number_text::{counted, grouped, precise_mebibytes};
use crate::publish::map_tiles::write_map_tiles::MapTileStats;
use crate::report::breakline_report::BreaklineReport;
use crate::report::job_report::{Report, SlowestPart, StepSeconds};
use crate::report::selection_report::SelectionReport;
use delaunay::triangulation::TriangulationCounts;
use delaunay_gpu::figures::GpuFigures;
use points::NetworkTraffic;
use std::fmt;

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{:<14} {:>9} {:>9} {:>9} {:>14}  rate", "stage", "from s", "wall s", "cpu s", "done")?;
        for stage in &self.stages {
            let rate = if stage.done > 0 { stage.done as f64 / stage.wall_s.max(1e-9) } else { 0.0 };
            writeln!(
                f,
                "{:<14} {:>9.2} {:>9.2} {:>9.2} {:>14}  {} {}/s",
                stage.stage,
                stage.start_s,
                stage.wall_s,
                stage.cpu_s,
                grouped(stage.done),
                grouped(rate as u64),
                stage.unit
            )?;
        }
        writeln!(f, "{:<14} {:>9} {:>9.2} {:>9.2}\n", "all", "", self.wall_s, self.cpu_s)?;
        for (unit, steps) in [("cpu s", &self.steps.cpu), ("gpu s", &self.steps.gpu)] {
            for (i, StepSeconds { step, seconds }) in steps.iter().enumerate() {
                let head = if i == 0 { format!("triangulate by step, {unit}") } else { String::new() };
                writeln!(f, "{head:<28} {step:<40} {seconds:>9.2}")?;
            }
        }
        let mut row = |name: &str, value: String| writeln!(f, "{name:<28} {value}");
        row("points read", grouped(self.points.read))?;
        row("  withheld", grouped(self.points.withheld))?;
        row("  of other classes", grouped(self.points.other_class))?;
        if self.points.other_return > 0 {
            row("  of other returns", grouped(self.points.other_return))?;
        }
        let out_of_bounds = if self.clip.is_some() { "  outside bounds, clip's box" } else { "  outside bounds" };
        row(out_of_bounds, grouped(self.points.out_of_bounds))?;
        if self.points.not_decoded > 0 {
            let why = if self.clip.is_some() { "    not decoded" } else { "    by the octree, not decoded" };
            row(why, grouped(self.points.not_decoded))?;
        }
        if self.clip.is_some() {
            row("  outside clip's polygons", grouped(self.points.outside_clip))?;
        }
        if self.points.nodata > 0 {
            row("  nodata", grouped(self.points.nodata))?;
        }
        row("  malformed", grouped(self.points.malformed))?;
        row("  duplicates in x, y", grouped(self.duplicates))?;
        if let Some(BreaklineReport { findings, .. }) = &self.breaklines {
            row("  at breaklines or in lakes", grouped(self.points.at_breaklines))?;
            let of =
                format!("of {} of {}", counted(findings.segments, "segment"), counted(findings.features, "feature"));
            row("edges along breaklines", format!("{}, {of}", grouped(findings.subsegments)))?;
            let of_known = |found: u64, unknown: u64| match unknown {
                0 => grouped(found),
                _ => format!("{}, {} not looked at", grouped(found), grouped(unknown)),
            };
            let disagreements = of_known(findings.disagreements, findings.places_not_compared);
            row("  places where heights disagree", disagreements)?;
            row("  rivers that rise", of_known(findings.rising_rivers, findings.rivers_without_heights))?;
            row("  lakes that are not flat", grouped(findings.uneven_lakes))?;
        }
        if let Some(NetworkTraffic { requests, bytes }) = self.network {
            row("from other machines", format!("{} in {} requests", precise_mebibytes(bytes), grouped(requests)))?;
        }
        if let Some(ground) = self.ground {
            row("  on the ground", grouped(ground))?;
        }
        row("sites", grouped(self.sites))?;
        if let Some(SelectionReport { points, max_error, rounds, greatest_error, mean_error, .. }) = &self.selection {
            let of = format!("of {} points, in {rounds} rounds", grouped(*points));
            row("  selected (max_error)", format!("{of}, within {max_error}"))?;
            row("  vertical error", format!("at most {greatest_error:.3}, mean {mean_error:.4}"))?;
        }
        if let Some(surface) = &self.surface {
            row("surface", surface.clone())?;
        }
        row("triangles", grouped(self.triangles))?;
        row("  crossing tile borders", format!("{:.3} %", self.seam_share * 100.0))?;
        if let Some(length) = self.hull_length {
            let slivers = grouped(self.hull_triangles);
            row("  left out (hull)", format!("{slivers}, with an edge longer than {length:.3} {}", self.unit))?;
        }
        if self.cut_triangles > self.hull_triangles {
            let why = if self.clip.is_some() { "  left out (max_edge, clip)" } else { "  left out (max_edge)" };
            row(why, grouped(self.cut_triangles - self.hull_triangles))?;
        }
        row("tiles", grouped(self.tiles))?;
        if self.levels.files > 0 {
            let levels = &self.levels;
            row("coarser tiles", format!("{}, at most {:.2} m off", grouped(levels.files), levels.error_m))?;
        }
        if let Some(raster) = &self.raster {
            let [columns, rows] = raster.size.map(|side| grouped(side.into()));
            let products: Vec<&str> = raster.products.iter().map(|product| product.names()[0]).collect();
            let (products, bytes) = (products.join(", "), precise_mebibytes(raster.bytes));
            row("raster", format!("{columns} x {rows} cells ({products}), {bytes}"))?;
        }
        if let Some(MapTileStats { encoding, max_zoom, tiles, bytes }) = self.pmtiles {
            let (tiles, bytes) = (grouped(tiles), precise_mebibytes(bytes));
            row("map tiles", format!("{tiles} of zoom 0 to {max_zoom} ({}), {bytes}", encoding.name()))?;
        }
        for export in &self.exports {
            row("export", format!("{}, {}", export.file, precise_mebibytes(export.bytes)))?;
        }
        if let Some(contours) = &self.contours {
            let [lines, points, levels] = [contours.lines, contours.points, contours.levels].map(grouped);
            let size = precise_mebibytes(contours.bytes);
            row("contours", format!("{lines} lines of {points} points, {levels} levels, {size}"))?;
        }
        if let Some(terrain) = &self.terrain {
            let (tiles, last) = (grouped(terrain.tiles), terrain.zooms.len().saturating_sub(1));
            let size = precise_mebibytes(terrain.bytes);
            row("terrain", format!("{tiles} tiles of zooms 0 to {last}, {size}"))?;
        }
        let TriangulationCounts { pipeline, reference, small, crowded, not_accepted, counts } = &self.leaves.outcome;
        let divided = small + crowded + not_accepted;
        row(
            "leaves",
            format!(
                "{}, of them divided and conquered {} ({crowded} crowded, {not_accepted} not accepted, {small} small), by spade {}",
                grouped(pipeline + divided + reference),
                grouped(divided),
                grouped(*reference)
            ),
        )?;
        row("  sites moved to other pixels", grouped(counts.moved))?;
        row("  sites missing, inserted", grouped(counts.missing))?;
        row(
            "  inverted triangles",
            format!("{}, sites taken out {}", grouped(counts.inverted), grouped(counts.removed)),
        )?;
        row("  edges flipped", grouped(counts.flips))?;
        if let Some(gpu) = &self.gpu {
            row("  with the help of a GPU", format!("{} ({gpu})", grouped(self.leaves.outcome.counts.on_gpu)))?;
        }
        if let Some(figures) = &self.gpu_figures {
            let GpuFigures {
                helped, in_vain, flagged, rejected, ns_per_site_helped, ns_per_site_alone, given_up, ..
            } = figures;
            if *helped > 0 {
                let per_site = format!("{ns_per_site_helped:.0} with it, {ns_per_site_alone:.0} without");
                row("  processor ns a site", per_site)?;
            }
            if *in_vain > 0 {
                let unanswered = in_vain.saturating_sub(flagged + rejected);
                let kinds =
                    format!("{unanswered} without an answer, {flagged} given up by it, {rejected} did not suit");
                row("  asked of the GPU in vain", format!("{in_vain}: {kinds}"))?;
            }
            if let Some(why) = given_up {
                row("  the GPU was given up", why.clone())?;
            }
        }
        if let Some(SlowestPart { part, seconds, points }) = self.slowest_part {
            let slowest = format!("the slowest, {part}, took {seconds:.1} s for {} points", grouped(points));
            row("parts", format!("{}; {slowest}", grouped(self.parts)))?;
        }
        for transformation in &self.transformations {
            row("transformed", transformation.to_string())?;
        }
        row("lattice step", format!("{} (z {}) {}", self.lattice.resolution, self.lattice.resolution_z, self.unit))?;
        row("written", precise_mebibytes(self.bytes_written))?;
        row("temporary files", precise_mebibytes(self.bytes_temporary))?;
        if self.resumed > 0 {
            row("steps taken over", format!("{} of an interrupted run", grouped(self.resumed)))?;
        }
        let peak = self.peak_memory.map_or("unknown".into(), precise_mebibytes);
        row("peak memory", format!("{peak} of {}", precise_mebibytes(self.memory_limit)))?;
        Ok(())
    }
}
