//! How the tiles of a job look. All tiles have one style, so that they fit together.

use crate::mesh::hull_rule::HullRule;
use crate::plan::job_plan::Plan;
use crate::tiles::clip_rule::ClipRule;
use crate::tiles::max_edge::MaxEdgeRule;
use crate::tiles::vertex_colors::{PhotoColors, VertexColors};
use breaklines::Breaklines;
use delaunay::geometry::Bounds;
use std::sync::Arc;
use sys::Result;
use tiles::Compression;
use tiles::attributes::AttributeChoice;
use tiles::color::{Coloring, HeightRange};
use tiles::compression::CompressionChoice;
use tiles::curvature::Curvature;
use tiles::frame::Frame;
use tiles::options::{ColorChoice, Hull, OutputOptions};

/// How tiles look.
#[derive(Debug)]
pub(crate) struct TileStyle {
    /// Where lattice integers lie in a glTF scene.
    pub frame: Frame,
    /// Where colours come from.
    pub(crate) colors: VertexColors,
    /// What vertices carry of their points.
    pub attributes: AttributeChoice,
    /// Whether vertices carry normals.
    pub normals: bool,
    /// How tiles are packed.
    pub compression: Compression,
    /// Which triangles are left out, unless they are flat water.
    pub max_edge: MaxEdgeRule,
    /// Which triangles lie outside the polygons of the clip; `None` without one.
    pub(crate) clip: Option<ClipRule>,
    /// The breaklines, which stay in coarser tiles, and whose flat water is never left out; `None` without any.
    pub lines: Option<Arc<Breaklines>>,
    /// Which triangles are slivers along the hull, which are left out too; `None` if they stay.
    pub hull: Option<HullRule>,
    /// Whose the data are, if the user says.
    pub copyright: Option<String>,
}

/// Returns the frame with the steps of tiles that are packed like this and lie within `bounds`.
fn with_steps(frame: Frame, compression: Compression, bounds: Bounds<3>) -> Frame {
    match compression {
        Compression::None => frame.refined(bounds),
        Compression::Meshopt | Compression::Quantized => frame.packed(),
    }
}

/// Returns how the tiles of a job are packed whose scene is bent like this.
pub(crate) fn packing(output: &OutputOptions, curvature: Option<&Curvature>) -> Compression {
    match (output.compression, curvature) {
        // Only viewers of 3D Tiles see such a scene, and they know meshopt. What reads quantized tiles takes x and y as they are.
        (CompressionChoice::Auto, Some(bent)) if !bent.is_vertical() => Compression::Meshopt,
        _ => output.packing(),
    }
}

/// Returns the frame of the tiles of a job whose scene follows the curve of the earth, and whose points are within `bounds`.
pub(crate) fn bent_frame(plan: &Plan, curvature: Curvature, bounds: Bounds<3>) -> Frame {
    let packing = packing(&plan.options.output, Some(&curvature));
    with_steps(plan.frame.clone().curved(curvature), packing, bounds)
}

impl TileStyle {
    /// Returns the style of the tiles of a job whose points are within `bounds`, and whose greatest colour is `max_rgb`. A ramp of colours
    /// spans `heights`.
    ///
    /// # Errors
    /// Those of [`Plan::built_breaklines`] and of [`PhotoColors::open`].
    pub(crate) fn new(
        plan: &Plan,
        max_rgb: u16,
        bounds: Bounds<3>,
        heights: HeightRange,
        max_edge: MaxEdgeRule,
    ) -> Result<TileStyle> {
        let output = &plan.options.output;
        let colors = match &output.color {
            ColorChoice::None => VertexColors::None,
            ColorChoice::Class => VertexColors::OfPoints(Coloring::Class),
            ColorChoice::Elevation => VertexColors::OfPoints(Coloring::Elevation(heights)),
            ColorChoice::Auto | ColorChoice::Rgb if max_rgb == 0 => {
                VertexColors::OfPoints(Coloring::Elevation(heights))
            }
            ColorChoice::Auto | ColorChoice::Rgb => VertexColors::OfPoints(Coloring::Rgb { eight_bit: max_rgb <= 255 }),
            ColorChoice::Photo(path) => VertexColors::OfPhoto(Box::new(PhotoColors::open(plan, path)?)),
        };
        let compression = packing(output, plan.curvature.as_ref());
        let frame = match &plan.curvature {
            Some(curvature) => bent_frame(plan, curvature.clone(), bounds),
            None => with_steps(plan.frame.clone(), compression, bounds),
        };
        let hull = (output.hull == Hull::Trimmed).then(|| HullRule::of(plan)).transpose()?;
        let copyright = output.copyright().map(str::to_owned);
        let OutputOptions { attributes, normals, .. } = *output;
        let lines = plan.built_breaklines()?;
        let clip = plan.clip.as_ref().map(|clip| ClipRule::new(clip.area(), output.selects()));
        Ok(TileStyle { frame, colors, attributes, normals, compression, max_edge, clip, lines, hull, copyright })
    }

    /// Tells whether the triangle with these corners is left out because it lies outside the polygons of the clip, or is long. A lake has
    /// no points, and a river often has none, so the triangles of their water are long.
    #[inline]
    pub(crate) fn leaves_out(&self, corners: [[i32; 3]; 3]) -> bool {
        let places = corners.map(|[x, y, _]| [x, y]);
        if self.clip.as_ref().is_some_and(|clip| clip.leaves_out(places)) {
            return true;
        }
        let is_water = |lines: &Arc<Breaklines>| lines.is_water(places) || lines.is_between_shores(places);
        self.max_edge.leaves_out(corners) && !self.lines.as_ref().is_some_and(is_water)
    }

    /// Tells whether no triangle at all is left out, apart from slivers along the hull.
    pub(crate) fn keeps_all(&self) -> bool {
        self.max_edge.keeps_all() && self.clip.is_none()
    }

    /// Removes the triangles that are left out because they lie outside or are long from `triangles` and returns them. Both stay in order.
    pub(crate) fn take_long(&self, positions: &[[i32; 3]], triangles: &mut Vec<[u32; 3]>) -> Vec<[u32; 3]> {
        if self.keeps_all() {
            return Vec::new();
        }
        let (out, kept) = triangles.iter().partition(|t| self.leaves_out(t.map(|v| positions[v as usize])));
        *triangles = kept;
        out
    }

    /// Returns the frame of these tiles in a scene that is not bent. The points of the job are within `bounds`.
    pub(crate) fn flat_frame(&self, plan: &Plan, bounds: Bounds<3>) -> Frame {
        with_steps(plan.frame.clone(), self.compression, bounds)
    }
}
