//! Features in lattice integers.

use crate::plan::extent::to_float;
use breaklines::{Feature, FeatureId, FeatureKind, Vertex};
use delaunay::geometry::Bounds;
use delaunay::geometry::REACH;
use lattice::Lattice;
use points::lines::{LineFeature, LineFile, LineShape};
use sys::{Error, Result};

/// Returns the features of `files` that come near the box `within`, with the number of the others.
///
/// # Errors
/// [`Error::Input`] if a vertex of one lies outside what the lattice reaches.
pub(super) fn on_lattice(files: &[LineFile], lattice: &Lattice, within: Bounds<2>) -> Result<(Vec<Feature>, u64)> {
    let map = LatticeMap::of(lattice);
    let (mut features, mut outside) = (Vec::new(), 0);
    for (number, file) in files.iter().enumerate() {
        for feature in &file.features {
            if map.may_meet(feature, within) {
                let id = FeatureId { file: number as u32, feature: feature.number };
                let refused = |what| Error::input(&file.path, format!("feature {} {what}", feature.number));
                features.push(map.feature(feature, id).map_err(refused)?);
            } else {
                outside += 1;
            }
        }
    }
    Ok((features, outside))
}

/// The way from source units to lattice steps. Sums and quotients of floating point are the same on every machine.
struct LatticeMap {
    offset: [f64; 3],
    step: [f64; 3],
}

impl LatticeMap {
    fn of(lattice: &Lattice) -> LatticeMap {
        LatticeMap { offset: lattice.offset.map(to_float), step: [0, 1, 2].map(|axis| to_float(lattice.step(axis))) }
    }

    fn steps(&self, value: f64, axis: usize) -> f64 {
        ((value - self.offset[axis]) / self.step[axis]).round()
    }

    fn may_meet(&self, feature: &LineFeature, within: Bounds<2>) -> bool {
        let is_apart = |axis: usize| {
            let vertices = || feature.shape.outlines().iter().flatten().map(|vertex| self.steps(vertex[axis], axis));
            vertices().all(|at| at < f64::from(within.min[axis]))
                || vertices().all(|at| at > f64::from(within.max[axis]))
        };
        !is_apart(0) && !is_apart(1)
    }

    fn vertex(&self, vertex: &[f64; 3]) -> std::result::Result<Vertex, &'static str> {
        const TOO_FAR: &str = "reaches farther than 2^29 steps of the lattice from its middle: cut out the area, for example with `ogr2ogr \
                               -clipsrc`, or choose a coarser [input] resolution";
        const TOO_HIGH: &str = "has a height that no lattice of this job reaches: correct it";
        let [x, y, z] = [0, 1, 2].map(|axis| self.steps(vertex[axis], axis));
        if x.abs().max(y.abs()) > f64::from(REACH) {
            return Err(TOO_FAR);
        }
        if z.abs() > f64::from(i32::MAX) {
            return Err(TOO_HIGH);
        }
        Ok(Vertex { place: [x as i32, y as i32], z: (!z.is_nan()).then_some(z as i32) })
    }

    fn feature(&self, feature: &LineFeature, id: FeatureId) -> std::result::Result<Feature, &'static str> {
        let outline = |outline: &Vec<[f64; 3]>| outline.iter().map(|vertex| self.vertex(vertex)).collect();
        let paths = feature.shape.outlines().iter().map(outline).collect::<std::result::Result<Vec<_>, _>>()?;
        let paths = match (&feature.shape, feature.kind) {
            (LineShape::Line(_), _) | (_, FeatureKind::Lake) => paths,
            (LineShape::Area(_), FeatureKind::River) => paths.into_iter().flat_map(banks).collect(),
            (LineShape::Area(_), FeatureKind::Line) => paths.into_iter().map(closed).collect(),
        };
        Ok(Feature { kind: feature.kind, id, paths })
    }
}

/// Returns the outline of an area as a line that ends where it begins.
fn closed(mut ring: Vec<Vertex>) -> Vec<Vertex> {
    ring.extend(ring.first().copied());
    ring
}

/// Returns the outline of a river as two lines, from its highest vertex to its lowest: along either bank heights should fall.
fn banks(mut ring: Vec<Vertex>) -> Vec<Vec<Vertex>> {
    // Of several, the first in the plane, wherever the ring begins.
    let highest = (0..ring.len()).max_by_key(|&at| (ring[at].z, ring[at].place));
    let Some(highest) = highest else { return Vec::new() };
    ring.rotate_left(highest);
    let lowest = (0..ring.len()).min_by_key(|&at| (ring[at].z, ring[at].place)).unwrap_or(0);
    let ring = closed(ring);
    vec![ring[..=lowest].to_vec(), ring[lowest..].to_vec()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crs::Crs;
    use points::lines::options::LinePurpose;
    use rust_decimal::Decimal;
    use sys::Warnings;

    fn lattice() -> Lattice {
        let (offset, step) = (Decimal::new(635_000, 0), Decimal::new(1, 2));
        Lattice::new([offset, offset, Decimal::ZERO], step, step).unwrap()
    }

    fn file(kind: FeatureKind, shape: LineShape) -> LineFile {
        let features = vec![LineFeature { number: 5, name: None, kind, shape }];
        LineFile {
            path: "a.shp".into(),
            crs: Crs::default(),
            purpose: LinePurpose::default(),
            height_scale: 1.0,
            features,
            warnings: Warnings::default(),
        }
    }

    const WITHIN: Bounds<2> = Bounds { min: [0, 0], max: [1000, 1000] };

    fn vertex(x: i32, y: i32, z: i32) -> [f64; 3] {
        [635_000.0 + f64::from(x) * 0.01, 635_000.0 + f64::from(y) * 0.01, f64::from(z) * 0.01]
    }

    fn features(kind: FeatureKind, shape: LineShape) -> Result<(Vec<Feature>, u64)> {
        on_lattice(&[file(kind, shape)], &lattice(), WITHIN)
    }

    #[test]
    fn vertices_meet_the_lattice_and_features_outside_are_counted() {
        let line =
            |x: i32| LineShape::Line(vec![vertex(x, 5, 123), vertex(x + 7, 900, -4), [635_001.0, 635_000.0, f64::NAN]]);
        let (found, outside) = features(FeatureKind::Line, line(3)).unwrap();
        let at = |x, y, z| Vertex { place: [x, y], z };
        assert_eq!(
            (found[0].paths[0].clone(), outside),
            (vec![at(3, 5, Some(123)), at(10, 900, Some(-4)), at(100, 0, None)], 0)
        );
        assert_eq!(found[0].id, FeatureId { file: 0, feature: 5 });
        let beside = LineShape::Line(vec![vertex(-9, -9, 0), vertex(-1, 2000, 0)]);
        assert_eq!(features(FeatureKind::Line, beside).unwrap(), (Vec::new(), 1));
        let far = LineShape::Line(vec![[0.0, 635_000.0, 0.0], [1e9, 635_000.0, 0.0]]);
        let error = features(FeatureKind::Line, far).unwrap_err().to_string();
        assert!(error.starts_with("a.shp: feature 5 reaches farther"), "{error}");
        let high = LineShape::Line(vec![vertex(1, 1, 1), [635_001.0, 635_001.0, 1e12]]);
        assert!(features(FeatureKind::Line, high).unwrap_err().to_string().contains("height"));
    }

    #[test]
    fn the_outline_of_a_river_falls_along_two_banks() {
        let corners = [vertex(0, 0, 3), vertex(9, 0, 9), vertex(9, 9, 5), vertex(0, 9, 1)];
        for start in 0..4 {
            let mut ring = corners.to_vec();
            ring.rotate_left(start);
            let (found, _) = features(FeatureKind::River, LineShape::Area(vec![ring.clone()])).unwrap();
            let heights: Vec<Vec<i32>> =
                found[0].paths.iter().map(|path| path.iter().filter_map(|vertex| vertex.z).collect()).collect();
            assert_eq!(heights, [vec![9, 5, 1], vec![1, 3, 9]]);
            let (lake, _) = features(FeatureKind::Lake, LineShape::Area(vec![ring.clone()])).unwrap();
            assert_eq!(lake[0].paths[0].len(), 4);
            let (line, _) = features(FeatureKind::Line, LineShape::Area(vec![ring])).unwrap();
            assert_eq!(line[0].paths[0].first(), line[0].paths[0].last());
        }
    }
}
