//! How the tiles of a job look. All tiles have one style, so that they fit together.

use crate::geometry::Bounds;
use crate::job::mesh::hull_rule::HullRule;
use crate::job::plan::job_plan::Plan;
use crate::job::tiles::max_edge::MaxEdgeRule;
use crate::output::Compression;
use crate::output::color::{Coloring, HeightRange};
use crate::output::frame::Frame;
use crate::output::options::{ColorChoice, Hull};

/// How tiles look.
#[derive(Debug)]
pub struct TileStyle {
    /// Where lattice integers lie in a glTF scene.
    pub frame: Frame,
    /// Where colours come from; `None` for no colours.
    pub coloring: Option<Coloring>,
    /// Whether vertices carry normals.
    pub normals: bool,
    /// How tiles are packed.
    pub compression: Compression,
    /// Which triangles are left out.
    pub max_edge: MaxEdgeRule,
    /// Which triangles are slivers along the hull, which are left out too; `None` if they stay.
    pub hull: Option<HullRule>,
    /// Whose the data are, if the user says.
    pub copyright: Option<String>,
}

impl TileStyle {
    /// Returns the style of the tiles of a job whose points are within `bounds`, and whose greatest colour is `max_rgb`. A ramp of colours
    /// spans `heights`.
    pub fn new(plan: &Plan, max_rgb: u16, bounds: Bounds<3>, heights: HeightRange, max_edge: MaxEdgeRule) -> TileStyle {
        let output = &plan.options.output;
        let coloring = match output.color {
            ColorChoice::None => None,
            ColorChoice::Class => Some(Coloring::Class),
            ColorChoice::Elevation => Some(Coloring::Elevation(heights)),
            ColorChoice::Auto | ColorChoice::Rgb if max_rgb == 0 => Some(Coloring::Elevation(heights)),
            ColorChoice::Auto | ColorChoice::Rgb => Some(Coloring::Rgb { eight_bit: max_rgb <= 255 }),
        };
        let compression = output.packing();
        let frame = match compression {
            Compression::None => plan.frame.clone().refined(bounds),
            _ => plan.frame.clone().packed(),
        };
        let hull = (output.hull == Hull::Trimmed).then(|| HullRule::of(plan));
        let copyright = output.copyright().map(str::to_owned);
        TileStyle { frame, coloring, normals: output.normals, compression, max_edge, hull, copyright }
    }
}
