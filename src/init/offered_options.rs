//! Which options a configuration offers that some clouds take and others refuse: each is tried as `check` would try it.

use crate::init::draft::{Draft, NeededLine};
use job::plan::job_plan::Plan;
use job::preflight::check::{Preflight, inspect};
use points::is_url;
use std::path::Path;
use sys::Result;

/// Options that the job would take.
#[derive(Clone, Copy)]
pub(crate) struct OfferedOptions {
    /// `surface = "ground"`.
    pub(crate) ground: bool,
    /// `surface = "bare-earth"`.
    pub(crate) bare_earth: bool,
    /// `to_crs = "utm"`.
    pub(crate) utm: bool,
}

impl OfferedOptions {
    /// Tries the options on the job of `draft`.
    ///
    /// # Errors
    /// [`sys::Error::Broken`] if the program does not take what is written.
    pub(crate) fn of(draft: &Draft, preflight: &Preflight, plan: &Plan) -> Result<OfferedOptions> {
        let shares = preflight.surface_sample;
        let has_ground = shares.ground > 0 && shares.ground < shares.points && !draft.sets("surface");
        // The rows of a text have to have a class that can be read. Other files have nothing else.
        let has_text = plan.inputs.iter().any(|input| input.source.format.is_text());
        let ground = has_ground && (!has_text || is_taken(draft, "surface", "ground", None)?);
        // The files have one system, so that one of them tells whether there is a way from it.
        let first = plan.inputs.iter().find(|input| input.source.own_crs().is_named()).map(|input| &*input.source.path);
        let may_be_utm = plan.crs.is_named() && !draft.sets("to_crs") && first.is_some();
        let utm = may_be_utm && is_taken(draft, "to_crs", "utm", first)?;
        let bare_earth = shares.ground == 0 && shares.points > 0;
        Ok(OfferedOptions { ground, bare_earth, utm })
    }
}

/// Tells whether the job takes an option too; with `file`, a job of this file alone.
fn is_taken(draft: &Draft, key: &'static str, value: &str, file: Option<&Path>) -> Result<bool> {
    let mut options = draft.with([NeededLine::of_input(key, value, "")]).options()?;
    if let Some(file) = file.and_then(Path::to_str) {
        options.input.files = vec![if is_url(file) { file.into() } else { glob::Pattern::escape(file) }];
    }
    Ok(inspect(&options).is_ok())
}
