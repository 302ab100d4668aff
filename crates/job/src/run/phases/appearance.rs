//! How the tiles of a job look.

use crate::durable::columns::{ColumnReader, ColumnWriter};
use crate::index::TileIndex;
use crate::plan::job_plan::Claims;
use crate::records::{Leaf, StepRecord, Store};
use crate::run::job::Job;
use crate::tiles::appearance::TileAppearance;
use crate::tiles::max_edge::MaxEdgeRule;
use delaunay::geometry::Bounds;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use sys::{Error, Result};
use tiles::options::MaxEdge;

/// What all parts hold.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct SitesOfParts {
    pub(crate) sites: u64,
    /// The lattice box of the points.
    pub(crate) bounds: Bounds<3>,
}

/// Returns how tiles look, unless all sites decide that.
///
/// # Errors
/// [`Error::Broken`] if nothing is known of the points yet.
pub(crate) fn early_appearance(job: &Job) -> Result<Option<Arc<TileAppearance>>> {
    match job.plan.options.output.max_edge {
        MaxEdge::Auto => Ok(None),
        choice => {
            // No rule but "auto" looks at the sites.
            let rule = MaxEdgeRule::new(choice, &job.plan.frame, 0, claims(job)?.bounds, &|_| Ok(()))?;
            appearance(job, rule).map(Some)
        }
    }
}

/// Counts all sites for the rule that looks at them, if the job has it, and stores the counts. Its grid is that of the points themselves,
/// whatever headers claim.
///
/// # Errors
/// [`Error::Io`] or [`Error::Broken`] on a store.
pub(crate) fn count_sites(job: &Job, all: SitesOfParts, store: &Store) -> Result<()> {
    let choice = job.plan.options.output.max_edge;
    if choice != MaxEdge::Auto {
        return Ok(());
    }
    let visit = |visit: &(dyn Fn(&[i32; 3]) + Sync)| {
        job.parts.all().try_for_each(|part| {
            let open = job.open(part)?;
            let tiles: Vec<TileIndex> = open.partition.tree.tiles().collect();
            tiles.into_par_iter().try_for_each(|tile| Leaf::visit_positions(&open.store, tile, visit))
        })
    };
    let rule = MaxEdgeRule::new(choice, &job.plan.frame, all.sites, all.bounds, &visit)?;
    ColumnWriter::default().push(rule.counts()).write(store, StepRecord::Spacing)
}

/// Returns how tiles look. If all sites decide that, `store` has their counts.
///
/// # Errors
/// [`Error::Io`] or [`Error::Broken`] on the store.
pub(crate) fn final_appearance(job: &Job, all: SitesOfParts, store: &Store) -> Result<Arc<TileAppearance>> {
    if let Some(appearance) = early_appearance(job)? {
        return Ok(appearance);
    }
    let counts = ColumnReader::open(store, StepRecord::Spacing)?.column()?;
    appearance(job, MaxEdgeRule::of_counts(all.sites, all.bounds, counts)?)
}

fn appearance(job: &Job, rule: MaxEdgeRule) -> Result<Arc<TileAppearance>> {
    let Claims { bounds, max_rgb } = claims(job)?;
    TileAppearance::new(job.plan, max_rgb, bounds, rule).map(Arc::new)
}

fn claims(job: &Job) -> Result<Claims> {
    job.plan.claims.ok_or_else(|| Error::Broken("nothing is known of the points yet".into()))
}
