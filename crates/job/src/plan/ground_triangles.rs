//! The long triangles of a mesh with `[output] max_error` that lie on ground: they hold points that are no vertices.

use delaunay::geometry::Site;
use std::collections::HashSet;
use std::sync::{Arc, OnceLock};

/// The long triangles on ground, known once vertices are selected.
#[derive(Clone, Debug, Default)]
pub struct GroundTriangles(OnceLock<Arc<HashSet<[Site; 3]>>>);

impl GroundTriangles {
    /// Sets them: their corners in ascending order. Later calls change nothing.
    pub(crate) fn set(&self, triangles: impl IntoIterator<Item = [Site; 3]>) {
        self.0.get_or_init(|| Arc::new(triangles.into_iter().collect()));
    }

    /// Returns the triangles; `None` before they are known.
    pub(crate) fn get(&self) -> Option<Arc<HashSet<[Site; 3]>>> {
        self.0.get().cloned()
    }
}
