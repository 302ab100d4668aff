//! Where points of the lattice lie on the tiles of a zoom.
//!
//! To project every point takes longer than all else. So places are computed at the corners of square cells of the lattice, and between these
//! by bilinear interpolation. A cell is a quarter of a tile wide at most, and the middles of its sides are compared with their true places. Where the
//! map of the projection bends more than [`MOST_BEND`] there, as it does near a pole, cells are halved until it does not. Cells are those of the lattice,
//! not of tiles of the job, so that a point has the same place in all of them.

use crate::plan::job_plan::Plan;
use crate::publish::terrain_tiles::limits::{MOST_LONGITUDES, beyond_latitudes, beyond_longitudes};
use quantized_mesh::{GridPoint, SPAN, Scheme, Tile, TileGrid};
use std::collections::HashMap;
use std::f64::consts::PI;
use sys::{Error, Result};
use tiles::frame::Extras;
use tiles::tiles3d::globe::{Globe, NotPlaced};

/// How many cells lie along a side of a tile, at least.
const CELLS_PER_TILE: f64 = 4.0;

/// The longest side of a cell in metres.
const LONGEST_CELL: f64 = 2048.0;

/// The radius of the earth in metres, about.
const RADIUS: f64 = 6_371_000.0;

/// The most that places between the corners of a cell may be off, in steps of latitude: a rounding is half of one.
const MOST_BEND: f64 = 1.0 / 16.0;

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

    /// Returns how many degrees of longitude a terrain spans that reaches as far to both sides of its middle as to this place.
    pub(super) fn span_around(self, middle: &Place) -> f64 {
        2.0 * (self.beside(middle.longitude).longitude - middle.longitude).to_degrees().abs()
    }
}

fn place_at(extras: &Extras, globe: &Globe, point: [f64; 2]) -> std::result::Result<Place, NotPlaced> {
    let [x, y] = [0, 1].map(|axis: usize| extras.offset[axis] + extras.resolution * point[axis]);
    let [longitude, latitude] = globe.geographic(x, y)?;
    Ok(Place { longitude, latitude, offset: globe.height_of_geoid([longitude, latitude])? })
}

/// The grid of a zoom over the lattice.
pub(super) struct GlobeGrid<'a> {
    extras: &'a Extras,
    globe: &'a Globe,
    scheme: Scheme,
    zoom: u8,
    /// The side of the widest cells is two to the power of this, in lattice steps.
    shift: u32,
    /// A place of the terrain.
    middle: Place,
    /// The most that places may be off, in metres.
    most_bend: f64,
}

/// What is known of a cell.
#[derive(Clone, Copy)]
enum Cell {
    /// The places at its corners, between which all others are: south-west, south-east, north-west, north-east.
    Flat([Place; 4]),
    /// The map bends too much: its quarters decide.
    Bent,
    /// The place of a corner is not known.
    Unknown,
}

/// A cell: the power of two that its side is in lattice steps, its column and its row.
type CellNumber = (u32, [i32; 2]);

/// What has been computed of the places of a tile.
#[derive(Default)]
struct KnownPlaces {
    /// That of the last point, since the next one is often in it too.
    current: Option<(CellNumber, Cell)>,
    cells: HashMap<CellNumber, Cell>,
    /// By lattice place, in halves of a step.
    places: HashMap<[i64; 2], Option<Place>>,
}

impl<'a> GlobeGrid<'a> {
    /// Returns the grid of a zoom. `middle` is a place of the terrain.
    pub(super) fn new(plan: &'a Plan, globe: &'a Globe, scheme: Scheme, zoom: u8, middle: Place) -> GlobeGrid<'a> {
        let step = plan.frame.resolution_metres()[0];
        let [_, height] = scheme.sides_in_metres(zoom, middle.latitude);
        let side = (height / CELLS_PER_TILE).min(LONGEST_CELL);
        let shift = (0..24).take_while(|shift| step * f64::from(2u32 << shift) <= side).count() as u32;
        let most_bend = height / SPAN as f64 * MOST_BEND;
        GlobeGrid { extras: plan.frame.extras(), globe, scheme, zoom, shift, middle, most_bend }
    }

    /// Returns the grid points of lattice points.
    ///
    /// # Errors
    /// [`Error::Config`] if the place of one is not known, too near to a pole, or too far east or west.
    pub(super) fn points(&self, positions: &[[i32; 3]]) -> Result<Vec<GridPoint>> {
        let mut known = KnownPlaces::default();
        let mut grid = TileGrid::new(self.scheme, self.zoom);
        let most_latitude = self.scheme.most_latitude().to_radians();
        let most_longitude = MOST_LONGITUDES.to_radians() / 2.0;
        let mut points = Vec::with_capacity(positions.len());
        for &[x, y, z] in positions {
            let place = self.near([x, y], &mut known)?;
            if place.latitude.abs() > most_latitude {
                return Err(beyond_latitudes(self.scheme, place.latitude.to_degrees().abs()));
            }
            if (place.longitude - self.middle.longitude).abs() > most_longitude {
                return Err(beyond_longitudes(None));
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

    /// Returns the place of a lattice point, off by [`MOST_BEND`] at most.
    fn near(&self, [x, y]: [i32; 2], known: &mut KnownPlaces) -> Result<Place> {
        let (number, cell) = match known.current {
            Some(((shift, number), cell)) if number == [x >> shift, y >> shift] => ((shift, number), cell),
            _ => self.cell_of([x, y], known),
        };
        known.current = Some((number, cell));
        match cell {
            Cell::Flat(places) => Ok(between(places, inside(number.0, [x, y]))),
            Cell::Bent | Cell::Unknown => self.place([f64::from(x), f64::from(y)]),
        }
    }

    /// Returns the cell that decides about a lattice point: one that is flat, or no wider than a step.
    fn cell_of(&self, [x, y]: [i32; 2], known: &mut KnownPlaces) -> (CellNumber, Cell) {
        let mut shift = self.shift;
        loop {
            let number = (shift, [x >> shift, y >> shift]);
            let cell = match known.cells.get(&number) {
                Some(cell) => *cell,
                None => {
                    let cell = self.cell(number, &mut known.places);
                    known.cells.insert(number, cell);
                    cell
                }
            };
            if shift == 0 || !matches!(cell, Cell::Bent) {
                return (number, cell);
            }
            shift -= 1;
        }
    }

    fn cell(&self, (shift, number): CellNumber, places: &mut HashMap<[i64; 2], Option<Place>>) -> Cell {
        // In halves of its side.
        let mut at = |east: i64, north: i64| {
            let place =
                [(number[0], east), (number[1], north)].map(|(line, half)| (2 * i64::from(line) + half) << shift);
            *places.entry(place).or_insert_with(|| self.place(place.map(|along| along as f64 / 2.0)).ok())
        };
        let corners = [at(0, 0), at(2, 0), at(0, 2), at(2, 2)];
        let sides = [at(1, 0), at(1, 2), at(0, 1), at(2, 1)];
        let ([Some(sw), Some(se), Some(nw), Some(ne)], [Some(s), Some(n), Some(w), Some(e)]) = (corners, sides) else {
            return Cell::Unknown;
        };
        let corners = [sw, se, nw, ne];
        let off = |place: Place, share: [f64; 2]| distance(place, between(corners, share));
        // The middle of a cell alone would not tell: in a conformal map, bends along both axes cancel out there.
        let along = [off(s, [0.5, 0.0]).max(off(n, [0.5, 1.0])), off(w, [0.0, 0.5]).max(off(e, [1.0, 0.5]))];
        if along[0] + along[1] <= self.most_bend { Cell::Flat(corners) } else { Cell::Bent }
    }
}

/// Returns how far along a cell of this shift a lattice point lies, in parts of its side.
fn inside(shift: u32, point: [i32; 2]) -> [f64; 2] {
    let side = f64::from(1u32 << shift);
    point.map(|along| f64::from(along & ((1 << shift) - 1)) / side)
}

/// Returns the place between the corners of a cell.
fn between([sw, se, nw, ne]: [Place; 4], [east, north]: [f64; 2]) -> Place {
    let mix = |of: fn(&Place) -> f64| {
        let south = of(&sw) + (of(&se) - of(&sw)) * east;
        let far = of(&nw) + (of(&ne) - of(&nw)) * east;
        south + (far - south) * north
    };
    Place { longitude: mix(|p| p.longitude), latitude: mix(|p| p.latitude), offset: mix(|p| p.offset) }
}

/// Returns about how many metres two places near each other are apart, by their heights too.
fn distance(a: Place, b: Place) -> f64 {
    let scale = libm::cos(a.latitude);
    let along = [(a.longitude - b.longitude) * scale, a.latitude - b.latitude].map(|angle| angle * RADIUS);
    (along[0] * along[0] + along[1] * along[1]).sqrt() + (a.offset - b.offset).abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crs::geoid::Geoid;
    use tiles::tiles3d::globe::GlobeSystem;

    /// The plane around the north pole, in centimetres.
    fn extras() -> Extras {
        let (resolution, metres) = (0.01, 1.0);
        Extras {
            offset: [0.0; 3],
            resolution,
            resolution_z: resolution,
            metres_per_unit: metres,
            metres_per_unit_z: metres,
            crs: None,
            curvature: None,
        }
    }

    fn around_the_pole() -> Globe {
        let way = |[x, y]: [f64; 2]| Some([libm::atan2(x, -y), PI / 2.0 - (x * x + y * y).sqrt() / RADIUS]);
        Globe::new(GlobeSystem { definition: String::new(), way: Box::new(way) }, 1.0, Geoid::open(None).unwrap())
    }

    #[test]
    fn places_near_a_pole_are_where_the_projection_has_them() {
        let (extras, globe) = (extras(), around_the_pole());
        // 1.1 degrees from the pole, with cells of a kilometre to begin with.
        let middle = Place { longitude: 0.0, latitude: 88.9f64.to_radians(), offset: 0.0 };
        for zoom in [10, 14, 18] {
            let [_, height] = Scheme::Geographic.sides_in_metres(zoom, middle.latitude);
            let most_bend = height / SPAN as f64 * MOST_BEND;
            let (scheme, shift) = (Scheme::Geographic, 17);
            let grid = GlobeGrid { extras: &extras, globe: &globe, scheme, zoom, shift, middle, most_bend };
            let (mut known, mut farthest) = (KnownPlaces::default(), 0.0f64);
            for i in 0..20_000 {
                let point = [i * 7_919 % 200_003 - 100_000, -12_231_200 - i * 104_729 % 300_007];
                let exact = grid.place(point.map(f64::from)).unwrap();
                farthest = farthest.max(distance(exact, grid.near(point, &mut known).unwrap()));
            }
            assert!(farthest <= most_bend, "zoom {zoom}: {farthest} m, where {most_bend} m are allowed");
            assert!(farthest > 0.0, "zoom {zoom}: nothing is interpolated");
        }
    }
}
