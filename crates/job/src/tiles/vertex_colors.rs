//! Where the colours of vertices come from.

use crate::options::JobOptions;
use crate::plan::fingerprint::require_photo;
use crate::plan::job_plan::Plan;
use crate::records::Leaf;
use lattice::Lattice;
use orthophoto::Orthophoto;
use points::open_bytes;
use serde::{Deserialize, Serialize};
use std::path::Path;
use sys::{Result, Warnings};
use tiles::color::{Coloring, LinearRgb, from_srgb};

/// The colour of vertices without a pixel.
const WITHOUT_PIXEL: [u8; 3] = [170, 170, 170];

/// The most bytes of an orthophoto that stay in memory, and the share of the limit that they may be.
const MOST_BYTES: u64 = 64 << 20;
const SHARE_OF_MEMORY: u64 = 16;

/// Where the colours of vertices come from.
#[derive(Debug)]
pub(crate) enum VertexColors {
    /// There are none.
    None,
    /// From what is known of each point.
    OfPoints(Coloring),
    /// From the pixels of an orthophoto.
    OfPhoto(Box<PhotoColors>),
}

/// What gives vertices their colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ColorSource {
    /// Nothing: they have none.
    #[default]
    None,
    /// The colours of the points.
    Rgb,
    /// The heights.
    Elevation,
    /// The classes of the points.
    Class,
    /// The pixels of an orthophoto.
    Orthophoto,
}

/// The colours of an orthophoto.
#[derive(Debug)]
pub(crate) struct PhotoColors {
    photo: Orthophoto,
    lattice: Lattice,
}

/// The colours of some vertices.
#[derive(Debug, Default)]
pub(crate) struct FoundColors {
    /// One for each, or none at all.
    pub(crate) colors: Vec<LinearRgb>,
    /// How many vertices have no pixel.
    pub(crate) without_pixel: u64,
}

impl VertexColors {
    /// Returns what gives vertices their colours.
    pub(crate) fn source(&self) -> ColorSource {
        match self {
            VertexColors::None => ColorSource::None,
            VertexColors::OfPoints(Coloring::Rgb { .. }) => ColorSource::Rgb,
            VertexColors::OfPoints(Coloring::Elevation(_)) => ColorSource::Elevation,
            VertexColors::OfPoints(Coloring::Class) => ColorSource::Class,
            VertexColors::OfPhoto(_) => ColorSource::Orthophoto,
        }
    }

    /// Tells whether vertices have colours.
    pub(crate) fn are_wanted(&self) -> bool {
        !matches!(self, VertexColors::None)
    }

    /// Returns the colours of the sites of a leaf.
    ///
    /// # Errors
    /// As [`PhotoColors::at`].
    pub(crate) fn of_leaf(&self, leaf: &Leaf) -> Result<FoundColors> {
        match self {
            VertexColors::None => Ok(FoundColors::default()),
            VertexColors::OfPoints(coloring) => {
                let colors = coloring.colors(&leaf.positions, &leaf.rgb, &leaf.class);
                Ok(FoundColors { colors, without_pixel: 0 })
            }
            VertexColors::OfPhoto(photo) => photo.at(&leaf.positions),
        }
    }
}

impl PhotoColors {
    /// Opens the orthophoto at `path` for the vertices of a job.
    ///
    /// # Errors
    /// As [`require_photo`], [`open_bytes`] and [`Orthophoto::open`].
    pub(crate) fn open(plan: &Plan, path: &Path) -> Result<PhotoColors> {
        require_photo(path)?;
        let bytes = Box::new(open_bytes(path)?);
        let photo = Orthophoto::open(path, bytes, &plan.crs, most_bytes(&plan.options))?;
        Ok(PhotoColors { photo, lattice: plan.lattice.clone() })
    }

    /// Returns the colours of the pixels at lattice places.
    ///
    /// # Errors
    /// As [`Orthophoto::colors`].
    pub(crate) fn at(&self, positions: &[[i32; 3]]) -> Result<FoundColors> {
        let places = positions.iter().map(|[x, y, _]| [self.lattice.world(0, *x), self.lattice.world(1, *y)]);
        let pixels = self.photo.colors(places)?;
        let without_pixel = pixels.iter().filter(|pixel| pixel.is_none()).count() as u64;
        let colors = pixels.into_iter().map(|pixel| from_srgb(pixel.unwrap_or(WITHOUT_PIXEL))).collect();
        Ok(FoundColors { colors, without_pixel })
    }
}

/// Checks that the orthophoto of a job can be read, before the points are. Returns what the user should know about it.
///
/// # Errors
/// As [`PhotoColors::open`].
pub(crate) fn check_photo(plan: &Plan) -> Result<Warnings> {
    let mut warnings = Warnings::default();
    if let Some(path) = plan.options.output.color.photo() {
        warnings.extend_from_file(path, &PhotoColors::open(plan, path)?.photo.warnings);
    }
    Ok(warnings)
}

/// Returns about how many bytes the orthophoto of a job takes.
pub(crate) fn photo_memory(options: &JobOptions) -> u64 {
    // The pieces that stay in memory, and the one that is read.
    options.output.color.photo().map_or(0, |_| 2 * most_bytes(options))
}

fn most_bytes(options: &JobOptions) -> u64 {
    (options.limits.memory.0 / SHARE_OF_MEMORY).min(MOST_BYTES)
}

/// Returns a warning about the vertices without a pixel.
pub(crate) fn without_pixel_warning(plan: &Plan, vertices: u64) -> Option<String> {
    let path = plan.options.output.color.photo().filter(|_| vertices > 0)?.display();
    let are = if vertices == 1 { "vertex is" } else { "vertices are" };
    Some(format!(
        "{vertices} {are} grey, outside {path} or where it is empty; fix: [output] color with an orthophoto of the whole area"
    ))
}
