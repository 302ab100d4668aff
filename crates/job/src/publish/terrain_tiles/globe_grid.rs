//! Where points of the lattice lie on the tiles of a zoom.
//!
//! To project every point takes longer than all else. So places are computed at the corners of square cells of the lattice, and between these
//! by bilinear interpolation. A cell is a sixteenth of a tile wide at most, over which the map of a projection bends by a few hundredths of a step.
//! Cells are those of the lattice, not of tiles of the job, so that a point has the same place in all of them.

use crate::plan::job_plan::Plan;
use crate::publish::terrain_tiles::limits::beyond_latitudes;
use quantized_mesh::{GridPoint, Scheme, Tile, TileGrid};
use std::collections::HashMap;
use std::f64::consts::PI;
use sys::{Error, Result};
use tiles::frame::Extras;
use tiles::tiles3d::globe::{Globe, NotPlaced};

/// The sides of cells in a tile, at least.
const CELLS_PER_TILE: f64 = 16.0;

/// The longest side of a cell in metres.
const LONGEST_CELL: f64 = 2048.0;

/// A place on the globe.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// In radians.
    pub(super) longitude: f64,
    /// In radians.
    pub(super) latitude: f64,
    /// Metres to add to heights.
    pub(super) offset: f64,
}

impl Place {
    /// Returns the place of a lattice point.
    ///
    /// # Errors
    /// A sentence if it is not known.
    pub(super) fn of(plan: &Plan, globe: &Globe, point: [i32; 2]) -> std::result::Result<Place, String> {
        place_at(plan.frame.extras(), globe, point.map(f64::from)).map_err(|why| why.to_string())
    }

    /// Returns it with the longitude, of all that mean the same place, that is nearest to another.
    pub(super) fn beside(self, longitude: f64) -> Place {
        let turns = ((longitude - self.longitude) / (2.0 * PI)).round();
        Place { longitude: self.longitude + turns * 2.0 * PI, ..self }
    }
}

fn place_at(extras: &Extras, globe: &Globe, point: [f64; 2]) -> std::result::Result<Place, NotPlaced> {
    let [x, y] = [0, 1].map(|axis: usize| extras.offset[axis] + extras.resolution * point[axis]);
    let [longitude, latitude] = globe.geographic(x, y)?;
    Ok(Place { longitude, latitude, offset: globe.height_offset(x, y)? })
}

/// The grid of a zoom over the lattice.
pub(super) struct GlobeGrid<'a> {
    extras: &'a Extras,
    globe: &'a Globe,
    scheme: Scheme,
    zoom: u8,
    /// The side of a cell is two to the power of this, in lattice steps.
    shift: u32,
    /// A place of the terrain.
    middle: Place,
}

/// The places at the corners of a cell: south-west, south-east, north-west, north-east. `None` if one is not known.
type Cell = Option<[Place; 4]>;

impl<'a> GlobeGrid<'a> {
    /// Returns the grid of a zoom. `middle` is a place of the terrain.
    pub(super) fn new(plan: &'a Plan, globe: &'a Globe, scheme: Scheme, zoom: u8, middle: Place) -> GlobeGrid<'a> {
        let step = plan.frame.resolution_metres()[0];
        let [_, height] = scheme.sides_in_metres(zoom, middle.latitude);
        let side = (height / CELLS_PER_TILE).min(LONGEST_CELL);
        let shift = (0..24).take_while(|shift| step * f64::from(2u32 << shift) <= side).count() as u32;
        GlobeGrid { extras: plan.frame.extras(), globe, scheme, zoom, shift, middle }
    }

    /// Returns the grid points of lattice points.
    ///
    /// # Errors
    /// [`Error::Config`] if the place of one is not known, or too near to a pole.
    pub(super) fn points(&self, positions: &[[i32; 3]]) -> Result<Vec<GridPoint>> {
        let mut cells: HashMap<[i32; 2], Cell> = HashMap::new();
        let mut corners: HashMap<[i32; 2], Option<Place>> = HashMap::new();
        let mut current: Option<([i32; 2], Cell)> = None;
        let mut grid = TileGrid::new(self.scheme, self.zoom);
        let most_latitude = self.scheme.most_latitude().to_radians();
        let mut points = Vec::with_capacity(positions.len());
        for &[x, y, z] in positions {
            let number = [x >> self.shift, y >> self.shift];
            let cell = match current {
                Some((last, cell)) if last == number => cell,
                _ => *cells.entry(number).or_insert_with(|| self.cell(number, &mut corners)),
            };
            current = Some((number, cell));
            let place = match cell {
                Some(places) => self.between(places, [x, y]),
                None => self.place([f64::from(x), f64::from(y)])?,
            };
            if place.latitude.abs() > most_latitude {
                return Err(beyond_latitudes(self.scheme, place.latitude.to_degrees().abs()));
            }
            let height =
                (self.extras.offset[2] + self.extras.resolution_z * f64::from(z)) * self.extras.metres_per_unit_z;
            let point = grid.nearest([place.longitude, place.latitude], height + place.offset);
            let too_high = || Error::Config(format!("[output.terrain] has no heights such as {height:.0} m"));
            points.push(point.ok_or_else(too_high)?);
        }
        Ok(points)
    }

    /// Returns the tile of its zoom in a column and a row.
    pub(super) fn tile(&self, [x, y]: [i32; 2]) -> Tile {
        Tile { scheme: self.scheme, zoom: self.zoom, y, x }
    }

    /// Returns the area of a square lattice step at a point in square metres; negative if the axes turn the other way than east and north.
    ///
    /// # Errors
    /// As [`GlobeGrid::points`].
    pub(super) fn area_of_step(&self, point: [i32; 2]) -> Result<f64> {
        const RADIUS: f64 = 6_371_000.0;
        let side = f64::from(1u32 << self.shift);
        let [x, y] = point.map(f64::from);
        let origin = self.place([x, y])?;
        let [east, north] = [self.place([x + side, y])?, self.place([x, y + side])?].map(|place| {
            let scale = libm::cos(origin.latitude);
            [(place.longitude - origin.longitude) * scale, place.latitude - origin.latitude]
        });
        Ok((east[0] * north[1] - east[1] * north[0]) * RADIUS * RADIUS / (side * side))
    }

    /// Returns the place of a lattice place.
    pub(super) fn place(&self, point: [f64; 2]) -> Result<Place> {
        match place_at(self.extras, self.globe, point) {
            Ok(place) => Ok(place.beside(self.middle.longitude)),
            Err(NotPlaced::Height(error)) => Err(error),
            Err(NotPlaced::System(why)) => {
                let [x, y] = [0, 1].map(|axis: usize| self.extras.offset[axis] + self.extras.resolution * point[axis]);
                Err(Error::Config(format!("[output.terrain] cannot place x = {x}, y = {y} on the globe: {why}")))
            }
        }
    }

    fn cell(&self, [column, row]: [i32; 2], corners: &mut HashMap<[i32; 2], Option<Place>>) -> Cell {
        let mut corner = |east: i32, north: i32| {
            let number = [column + east, row + north];
            *corners.entry(number).or_insert_with(|| {
                let side = f64::from(1u32 << self.shift);
                self.place(number.map(|along| f64::from(along) * side)).ok()
            })
        };
        Some([corner(0, 0)?, corner(1, 0)?, corner(0, 1)?, corner(1, 1)?])
    }

    /// Returns the place of a point between the corners of its cell.
    fn between(&self, [sw, se, nw, ne]: [Place; 4], point: [i32; 2]) -> Place {
        let side = f64::from(1u32 << self.shift);
        let [east, north] = point.map(|along| f64::from(along & ((1 << self.shift) - 1)) / side);
        let mix = |of: fn(&Place) -> f64| {
            let south = of(&sw) + (of(&se) - of(&sw)) * east;
            let far = of(&nw) + (of(&ne) - of(&nw)) * east;
            south + (far - south) * north
        };
        Place { longitude: mix(|p| p.longitude), latitude: mix(|p| p.latitude), offset: mix(|p| p.offset) }
    }
}
