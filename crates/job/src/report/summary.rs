//! The end of a job in a few lines, for people: what was made, where it is, how exact it is, what to know, and what to do next.

use crate::progress::number_text::{counted, grouped, precise_mebibytes};
use crate::report::change_counts::ChangeCounts;
use crate::report::job_report::Report;
use crate::report::selection_report::SelectionReport;
use crate::report::skipped_inputs::write_skipped;
use std::fmt;
use std::path::PathBuf;
use sys::ShownWarning;
use sys::terminal::name;
use tiles::file_names::OutputFiles;
use tiles::options::{ExportFormat, OutputFormat, OutputOptions};
use tiles::raster::products::PRODUCTS;

/// What is printed of a finished job.
pub struct Summary<'a> {
    report: &'a Report,
    output: &'a OutputOptions,
    /// Says a warning in the words of the command line that started the job.
    words: &'a dyn Fn(&str) -> String,
}

impl<'a> Summary<'a> {
    /// Returns the summary of a job with these options. `words` turns the names of options in warnings into those that the user knows.
    pub fn new(report: &'a Report, output: &'a OutputOptions, words: &'a dyn Fn(&str) -> String) -> Summary<'a> {
        Summary { report, output, words }
    }

    fn made(&self) -> String {
        let Report { triangles, sites, tiles, levels, .. } = self.report;
        let coarser = match levels.files {
            0 => String::new(),
            1 => " and 1 coarser one".into(),
            files => format!(" and {} coarser ones", grouped(files)),
        };
        format!(
            "{} triangles between {} points, in {}{coarser}",
            grouped(*triangles),
            grouped(*sites),
            counted(*tiles, "tile")
        )
    }

    /// Returns how much of the area that the user wants is covered, if there is one.
    fn coverage(&self) -> Option<String> {
        let Report { covered_share, input, .. } = self.report;
        let area = match (input.bounds.is_some(), input.clip.is_some()) {
            (true, true) => "the clip within the bounds",
            (true, false) => "the bounds",
            _ => "the clip",
        };
        // 100 % is shown only where it is exact.
        let share = (*covered_share)?;
        let shown = if share < 1.0 { (share * 1000.0).floor() / 10.0 } else { 100.0 };
        let rest = match share < 1.0 {
            true => ": the rest has no points, or slivers that [output] hull left out",
            false => "",
        };
        Some((self.words)(&format!("{shown} % of {area}{rest}")))
    }

    fn exactness(&self) -> String {
        let Report { lattice, unit, selection, extent, .. } = self.report;
        let step = match lattice.resolution == lattice.resolution_z {
            true => format!("{} {unit}", lattice.resolution),
            false => format!("{} {unit}, heights {}", lattice.resolution, lattice.resolution_z),
        };
        match selection {
            Some(SelectionReport { points, max_error, greatest_error, mean_error, .. }) => format!(
                "Delaunay triangulation; all {} points are within {max_error}{} of it (at most {greatest_error:.3}, mean {mean_error:.4})",
                grouped(*points),
                extent.as_ref().map_or(String::new(), |extent| format!(" {}", extent.height_unit))
            ),
            None => format!("Delaunay triangulation of coordinates in steps of {step}"),
        }
    }

    /// Returns what is missing in the terrain, if anything is.
    fn left_out(&self) -> Option<String> {
        let Report { points, duplicates, hull_triangles, cut_triangles, input, .. } = self.report;
        let has_clip_alone = input.clip.is_some() && input.bounds.is_none();
        let outside = match has_clip_alone {
            true => [(0, ""), (points.out_of_bounds + points.outside_clip, "points outside the clip")],
            false => {
                [(points.out_of_bounds, "points outside the bounds"), (points.outside_clip, "points outside the clip")]
            }
        };
        let kinds = [
            (points.withheld, "withheld points"),
            (points.other_class, "points of other classes"),
            (points.other_return, "points of other returns"),
            outside[0],
            outside[1],
            (points.nodata, "points without a height"),
            (points.malformed, "malformed points"),
            (points.at_breaklines, "points at breaklines or in lakes"),
            (*duplicates, "points with the x and y of another"),
            (*hull_triangles, "slivers along the hull"),
            (cut_triangles.saturating_sub(*hull_triangles), "triangles by max_edge or clip"),
        ];
        let found: Vec<String> =
            kinds.iter().filter(|(count, _)| *count > 0).map(|(count, what)| one_or_more(*count, what)).collect();
        (!found.is_empty()).then(|| found.join(", "))
    }

    /// Returns the files for users.
    fn files(&self) -> String {
        let output = OutputFiles::new(&self.output.directory);
        let mut paths = vec![output.tileset(), output.terrain(), output.page(), output.preview()];
        paths.extend(PRODUCTS.into_iter().flat_map(|product| [output.raster(product), output.raster_list(product)]));
        paths.extend([output.map_tiles(), output.contours(), output.contour_drawing()]);
        paths.extend(ExportFormat::ALL.map(|format| output.export(format)));
        paths.push(output.terrain_layer());
        paths.push(output.classified().0);
        let there = paths.into_iter().filter(|path| path.exists());
        let own = |path: PathBuf| Some(name(path.strip_prefix(output.directory()).ok()?));
        let files: Vec<String> = there.filter_map(own).collect();
        let without = match self.output.format == OutputFormat::Auto && !output.terrain().exists() {
            true => " (terrain.glb is left out: one file would be too large for viewers)",
            false => "",
        };
        let (bytes, directory) = (precise_mebibytes(self.report.bytes_written), name(&self.output.directory));
        format!("{bytes} in {directory}: {}{without}", files.join(", "))
    }

    /// Returns how much an update has changed, if it was one.
    fn update(&self) -> Option<String> {
        let ChangeCounts { changed, added, removed } = self.report.update?;
        let files = counted(changed, "file");
        let whole = match self.report.parts {
            1 => "; the job has one part, which was computed as a whole",
            _ => "",
        };
        Some(format!("{files} changed, {} new, {} gone: see update.json{whole}", grouped(added), grouped(removed)))
    }

    fn costs(&self) -> String {
        let Report { wall_s, cpu_s, peak_memory, memory_limit, resumed, gpu, .. } = self.report;
        let peak = peak_memory.map_or("unknown".into(), precise_mebibytes);
        let resumed = if *resumed > 0 { ", after an interrupted run" } else { "" };
        let gpu = gpu.as_ref().map_or(String::new(), |gpu| format!(", with {gpu}"));
        let limit = precise_mebibytes(*memory_limit);
        format!("{wall_s:.1} s{resumed} ({cpu_s:.1} s of processor time{gpu}), {peak} of {limit} memory")
    }
}

/// Returns a count and what is counted, which is named in the plural.
fn one_or_more(count: u64, what: &str) -> String {
    let singular = || {
        ["points", "slivers", "triangles"]
            .iter()
            .fold(what.to_string(), |what, word| what.replace(word, word.trim_end_matches('s')))
    };
    format!("{} {}", grouped(count), if count == 1 { singular() } else { what.into() })
}

impl fmt::Display for Summary<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut row = |name: &str, value: &str| writeln!(f, "{name:<9} {value}");
        row("terrain", &self.made())?;
        self.report.extent.as_ref().map_or(Ok(()), |extent| row("size", &extent.to_string()))?;
        if let Some(surface) = &self.report.surface {
            row("surface", &(self.words)(surface))?;
        }
        self.coverage().map_or(Ok(()), |coverage| row("covers", &coverage))?;
        row("exact", &self.exactness())?;
        self.left_out().map_or(Ok(()), |left_out| row("left out", &left_out))?;
        row("written", &self.files())?;
        self.update().map_or(Ok(()), |update| row("update", &update))?;
        row("took", &self.costs())?;
        for warning in self.report.warnings.iter() {
            writeln!(f, "{}", ShownWarning(&(self.words)(warning)))?;
        }
        write_skipped(f, self.report.files, &self.report.skipped)
    }
}
