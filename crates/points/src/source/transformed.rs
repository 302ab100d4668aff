//! A source that looks like a file in another coordinate reference system.

use crate::points::axis::Axis;
use crate::source::{Source, is_box};
use crate::source_transform::{OwnCoordinates, SourceTransform};
use crs::system::Crs;
use rust_decimal::Decimal;

impl Source {
    /// Has the points transformed on their way out: from now on the source looks like a file in the other system.
    pub(crate) fn set_transform(&mut self, transform: SourceTransform, crs: Crs) {
        self.axes = transform.axes();
        self.grid = transform.grid(&self.axes);
        // A header's box without any place in the other system is no box.
        let own = Some([self.min, self.max]).filter(|[min, max]| is_box(*min, *max));
        [self.min, self.max] = own.and_then(|own| transform.around(own)).unwrap_or_default();
        self.crs = crs;
        self.transform = Some(Box::new(transform));
    }

    /// Has the points come in the coordinates of the file again.
    pub fn forget_transform(&mut self) {
        if let Some(transform) = self.transform.take() {
            let OwnCoordinates { axes, grid, min, max, crs } = transform.own;
            (self.axes, self.grid, self.min, self.max, self.crs) = (axes, grid, min, max, crs);
        }
    }

    /// Returns the way of the points into another system, if they go one.
    pub fn transform(&self) -> Option<&SourceTransform> {
        self.transform.as_deref()
    }

    /// Returns what the coordinates of the file are in, if its points are moved into another system.
    pub fn transformed_from(&self) -> Option<&Crs> {
        self.transform().filter(|transform| transform.is_moved).map(|transform| &transform.from)
    }

    /// Returns the system that the file itself says its coordinates are in.
    pub fn own_crs(&self) -> &Crs {
        self.transform.as_ref().map_or(&self.crs, |transform| &transform.own.crs)
    }

    /// Returns how many units of the file's heights one unit of its x and y is long: of degrees many, and else one.
    pub(super) fn steps_of_height(&self) -> f64 {
        self.transform.as_ref().map_or(1.0, |transform| transform.steps_of_height())
    }

    /// Returns what the heights of the file are multiplied by.
    pub fn factor_of_heights(&self) -> f64 {
        self.transform.as_ref().and_then(|transform| transform.heights).unwrap_or(1.0)
    }

    /// Returns what the file itself says of its coordinates, for a transform of them.
    pub(crate) fn own_coordinates(&self) -> OwnCoordinates {
        OwnCoordinates { axes: self.axes, grid: self.grid, min: self.min, max: self.max, crs: self.crs.clone() }
    }

    /// Takes over the axes that a text has with or without its outliers.
    pub(super) fn set_axes_of_text(&mut self, axes: [Axis; 3], grid: [Decimal; 2]) {
        match &mut self.transform {
            Some(transform) => {
                (transform.own.axes, transform.own.grid) = (axes, grid);
                self.axes = transform.axes();
                self.grid = transform.grid(&self.axes);
            }
            None => (self.axes, self.grid) = (axes, grid),
        }
    }
}
