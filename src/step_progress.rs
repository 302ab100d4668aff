//! Progress of commands that are no jobs.

use std::sync::{Mutex, MutexGuard, PoisonError};

use job::progress::stage::{ProgressOutput, Stage};
use verify::Watcher;

/// Shows the steps of a command, one after the other.
pub struct StepProgress {
    output: ProgressOutput,
    stage: Mutex<Option<Stage>>,
}

impl StepProgress {
    /// Returns the progress of a command that has not begun a step yet.
    pub fn new(output: ProgressOutput) -> StepProgress {
        StepProgress { output, stage: Mutex::new(None) }
    }

    /// Ends the last step, so that its bar does not stay.
    pub fn finish(&self) {
        self.stage().take().map(Stage::finish);
    }

    fn stage(&self) -> MutexGuard<'_, Option<Stage>> {
        self.stage.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Watcher for StepProgress {
    fn begin(&self, step: &'static str, total: u64, unit: &'static str) {
        self.finish();
        *self.stage() = Some(self.output.stage(step, total, unit));
    }

    fn advance(&self, amount: u64) {
        if let Some(stage) = &*self.stage() {
            stage.advance(amount);
        }
    }
}
