//! What an update takes over from the plan of the first run, and the keys of its inputs.

use crate::plan::fingerprint::Fingerprint;
use crate::plan::job_plan::{Claims, Plan, PlannedInput};
use delaunay::geometry::Bounds;
use points::PointRules;
use sys::{Error, Result};
use xxhash_rust::xxh3::xxh3_64;

impl Plan {
    /// Returns this plan with a key for each input: a hash of its content, as `fingerprint` knows it, and of how its points come to the
    /// lattice. Where points have no numbers, those of other files have no say in it.
    ///
    /// # Errors
    /// [`Error::Broken`] if an input cannot be described.
    pub(crate) fn with_keys(mut self, fingerprint: &Fingerprint) -> Result<Plan> {
        for PlannedInput { source, rules, claimed, key } in &mut self.inputs {
            let first_order = if rules.numbered { rules.first_order } else { 0 };
            let rules = PointRules { first_order, ..rules.clone() };
            let content = fingerprint.content_of(&source.path);
            let text = serde_json::to_vec(&(content, rules, claimed));
            *key = xxh3_64(&text.map_err(|e| Error::Broken(format!("{}: {e}", source.path.display())))?);
        }
        Ok(self)
    }

    /// Returns the key of reading these inputs, with `--update`: a hash of their keys. Else 0.
    pub(crate) fn key_of_inputs(&self, inputs: &[usize]) -> u64 {
        let keys: Vec<u64> = inputs.iter().map(|&input| self.inputs[input].key).collect();
        if self.options.updates { xxh3_64(bytemuck::cast_slice(&keys)) } else { 0 }
    }

    /// Returns this plan with all that parts and tiles have in common as it was in the `first` run. An update does no part again but those
    /// with other points.
    ///
    /// # Errors
    /// Says why that is not possible.
    pub(crate) fn laid_out_as(self, first: &Plan) -> std::result::Result<Plan, &'static str> {
        let metres = |plan: &Plan| (plan.frame.extras().metres_per_unit, plan.frame.extras().metres_per_unit_z);
        let (Some(claims), Some(first_claims)) = (self.claims, first.claims) else {
            return Err("there are few points");
        };
        if self.lattice != first.lattice {
            return Err("the coordinates of the files have other steps");
        }
        if (&self.crs, &self.unit, metres(&self)) != (&first.crs, &first.unit, metres(first)) {
            return Err("the files are in another CRS");
        }
        if first_claims.are_broken_by(claims.bounds, claims.max_rgb) {
            return Err("the files reach beyond the area or the heights of the first run, or have other colors");
        }
        let texts = [&self, first].map(|plan| serde_json::to_string(&(&plan.breaklines, &plan.clip)).ok());
        if texts[0] != texts[1] {
            return Err("the lines take other heights");
        }
        let Plan { claims, heights, curvature, .. } = first.clone();
        let cut = Some(first.cut().into_owned());
        Ok(Plan { claims, heights, curvature, cut, frame: first.frame.clone(), ..self })
    }
}

impl Claims {
    /// By how much of their greatest extent on the plane the claims of a job with `--update` reach beyond what headers claim.
    const ROOM: i64 = 256;

    /// Returns the claims with some room for files that are to come: a flight of the same area ends elsewhere by some metres, and finds
    /// other heights.
    #[must_use]
    pub(crate) fn with_room(self) -> Claims {
        let Bounds { mut min, mut max } = self.bounds;
        let aside = self.bounds.extent(0).max(self.bounds.extent(1)) / Claims::ROOM + 1;
        for (axis, room) in [aside, aside, self.bounds.extent(2) / 2 + 1].into_iter().enumerate() {
            let room = i32::try_from(room).unwrap_or(i32::MAX);
            min[axis] = min[axis].saturating_sub(room);
            max[axis] = max[axis].saturating_add(room);
        }
        Claims { bounds: Bounds { min, max }, ..self }
    }
}
