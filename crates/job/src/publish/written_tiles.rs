//! The tiles that are written: what step 8 makes of them, and what the user should know.

use crate::durable::directory::JobDirectory;
use crate::durable::listing::is_page_of_others;
use crate::merge_records::HullCount;
use crate::plan::job_plan::Plan;
use crate::plan::no_points::no_triangle;
use crate::progress::number_text::grouped;
use crate::publish::contours::write_contours::drawing_warning;
use crate::publish::flat_tile::FlatScene;
use crate::publish::height_offset_check::unused_height_offset;
use crate::publish::one_file_limits::{fits_one_file, too_large_for_one_file};
use crate::publish::placement::{height_unit_warning, heights_warning, place, placement_warning};
use crate::publish::side_files::{EachTile, SideFiles};
use crate::tiles::appearance::TileAppearance;
use crate::tiles::vertex_colors::{VertexColors, check_photo, without_pixel_warning};
use crate::tiles::write_tile::TileStats;
use crs::geoid::Geoid;
use delaunay::geometry::Bounds;
use sys::{Error, Result, Warnings};
use tiles::color::Coloring;
use tiles::options::{Hull, MaxEdge, OutputFormat};
use tiles::tiles3d::division::divide;
use tiles::tiles3d::georeference::Georeference;
use tiles::tiles3d::globe::NotPlaced;
use tiles::tiles3d::tileset::TilesetNode;

/// The tiles that are written.
pub(crate) struct WrittenTiles<'a> {
    pub stats: TileStats,
    /// The lattice box of the points.
    pub bounds: Bounds<3>,
    /// The lattice box of all vertices.
    pub vertices: Bounds<3>,
    /// How many slivers along the hull the whole mesh has.
    pub hull: HullCount,
    /// How they look.
    pub appearance: &'a TileAppearance,
    pub tiles: &'a dyn EachTile,
}

/// Tells whether viewers get 3D Tiles: where the user wants them, or where one file would be too large.
pub(crate) fn wants_tileset(plan: &Plan, written: &TileStats) -> bool {
    plan.options.output.format != OutputFormat::Glb || !fits_one_file(written)
}

/// Checks that there is a terrain to look at.
///
/// # Errors
/// [`crate::Error::NoTerrain`] or [`Error::Config`] says why there is none.
pub(crate) fn check_some_triangles(written: &TileStats, plan: &Plan) -> crate::Result<()> {
    if written.triangles > 0 {
        return Ok(());
    }
    if written.cut_triangles == 0 {
        return Err(no_triangle(plan));
    }
    let slivers = match written.slivers {
        0 => String::new(),
        slivers => format!(" besides {slivers} slivers along the hull"),
    };
    // The rule for the hull never leaves out more than half of the mesh.
    let by_length = written.cut_triangles - written.slivers;
    if plan.clip.is_some() && plan.options.output.max_edge == MaxEdge::None {
        return Err(crate::Error::NoTerrain(format!(
            "all {by_length} triangles{slivers} lie outside the polygons of [input] clip, which hold only a few points"
        )));
    }
    Err(Error::Config(format!("[output] max_edge leaves out all {by_length} triangles{slivers}: give a greater one"))
        .into())
}

impl<'a> WrittenTiles<'a> {
    /// Returns what the files beside the tiles hold, where the tileset begins with `root`, if there is to be one. Adds what the user should
    /// know to `warnings`.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Input`] on a geoid, a photo or the page in place; [`Error::Broken`] if something cannot be written down.
    pub(crate) fn side_files(
        &self,
        plan: &'a Plan,
        directory: &JobDirectory,
        root: Option<TilesetNode>,
        warnings: &mut Warnings,
    ) -> Result<SideFiles<'a>> {
        let (output, style) = (&plan.options.output, &self.appearance.style);
        let (mut tileset, mut placement) = (None, None);
        if let Some(mut root) = root {
            let geoid = Geoid::open(output.height_offset.as_ref())?;
            let placed = match place(&plan.crs, &style.frame, geoid, &mut root) {
                Err(NotPlaced::Height(error)) => return Err(error),
                placed => placed,
            };
            warnings.extend(placement_warning(&placed));
            warnings.extend(unused_height_offset(plan));
            if placed.is_ok() {
                warnings.extend(heights_warning(&plan.crs, output.height_offset.as_ref()));
            }
            divide(&mut root);
            (tileset, placement) = (Some((&style.frame, root)), placed.ok());
        }
        warnings.extend(height_unit_warning(&plan.crs));
        warnings.extend(drawing_warning(plan));
        warnings.extend(self.hull_warning(plan));
        warnings.extend(check_photo(plan)?);
        warnings.extend(without_pixel_warning(plan, self.stats.without_pixel));
        if output.imagery.is_some() && !output.page {
            warnings.push("[output] imagery has no effect: the page shows it; fix: [output] page = true".to_string());
        } else if output.imagery.is_some() && placement.is_none() {
            warnings.push("the page shows no imagery, because the terrain is not on the globe".to_string());
        }
        let page_of_others = output.page && is_page_of_others(directory.results())?;
        if page_of_others {
            warnings.push(format!(
                "the page is not written: {} appeared during the job, and is not a page of gdt-batch; fix: remove it, and \
             run the job again",
                directory.results().page().display()
            ));
        }
        let fits = fits_one_file(&self.stats);
        if !fits && output.format == OutputFormat::Glb {
            warnings.push(too_large_for_one_file(&self.stats));
        }
        let code = plan.crs.undisputed_code();
        let georeference = Georeference::new(&style.frame, &plan.lattice, self.vertices, &plan.unit, code);
        Ok(SideFiles {
            georeference: georeference.to_json(placement.as_ref())?,
            tileset,
            one_file: fits && output.format != OutputFormat::Tiles3d,
            flat: plan.curvature.is_some().then(|| FlatScene {
                bent: &style.frame,
                flat: style.flat_frame(plan, self.bounds),
                compression: style.compression,
            }),
            page: output.page && !page_of_others,
            imagery: output.imagery.as_ref(),
            copyright: output.copyright(),
            has_ramp: matches!(style.colors, VertexColors::None | VertexColors::OfPoints(Coloring::Elevation(_))),
            breaklines: plan.built_breaklines()?.map(|lines| (lines, &plan.lattice)),
        })
    }

    /// Says that the slivers along the hull stay although the user wants them left out.
    fn hull_warning(&self, plan: &Plan) -> Option<String> {
        let HullCount { slivers, triangles } = self.hull;
        (plan.options.output.hull == Hull::Trimmed && self.hull.is_most()).then(|| {
            format!(
                "no slivers are left out along the hull, because most of the mesh is slivers there ({} of {} triangles); fix: [output] hull \
                 = \"whole\" does the same without this warning",
                grouped(slivers),
                grouped(triangles)
            )
        })
    }
}
