//! Questions and changes that the disk refuses (EIO), at every place: no result is lost, and results beside a report are those of one
//! job.

use std::fs;

use crate::disk_model::{Change, read_trace};
use crate::earlier_results::{Earlier, base, found_whole};
use crate::rig::{Run, Setup};

/// A disk that refuses may refuse what does not matter, so a run succeeds. After so many in a row there was no more to refuse.
const SUCCESSES: usize = 12;

/// Runs the job over the results of the earlier one with this fault, and asserts that no result is lost. Returns whether the run
/// succeeded, and whether it was stopped while results took their places.
#[track_caller]
fn run_with(earlier: &Earlier, fault: &str) -> (bool, bool) {
    let rig = &earlier.rig;
    earlier.put_back();
    rig.configure(&base());
    let end = Run::start(rig.command().env("GDT_FAULT", fault)).end();
    if end.status.success() {
        rig.is_complete(fault);
        return (true, false);
    }
    assert_eq!(end.status.code(), Some(1), "{fault}: {end:?}");
    assert!(end.err.contains("Input/output error") && end.err.contains("error: cannot "), "{fault}: {}", end.err);
    let was_placing = !rig.out().join("report.json").exists();
    if was_placing {
        let refused = verify::verify(&rig.out(), 1 << 28).unwrap_err().to_string();
        assert!(refused.contains("not all in place: run the job again"), "{fault}: {refused}");
        // The next run puts them in place, even if its own inputs are gone.
        rig.configure(&Setup { input: "files = [\"gone.csv\"]".into(), ..base() });
        assert_eq!(rig.run().status.code(), Some(2), "{fault}");
        found_whole(rig, 0);
    } else if fs::read(rig.out().join("report.json")).unwrap() == earlier.report {
        earlier.stay(fault);
    } else {
        found_whole(rig, 0);
    }
    rig.configure(&base());
    rig.completes(fault);
    (false, was_placing)
}

/// Lets the n-th question called `name` fail, for every n. Returns how many runs failed.
#[track_caller]
fn refuse_each(earlier: &Earlier, name: &str) -> usize {
    let (mut failed, mut succeeded) = (0, 0);
    for count in 1.. {
        match run_with(earlier, &format!("{name}:{count}")).0 {
            true => succeeded += 1,
            false => (failed, succeeded) = (failed + 1, 0),
        }
        if succeeded == SUCCESSES {
            break;
        }
    }
    failed
}

#[test]
fn a_disk_that_does_not_say_what_is_there_costs_no_result() {
    let earlier = Earlier::new();
    let failed = refuse_each(&earlier, "stat");
    assert!(failed > 40, "{failed}");
}

#[test]
fn a_disk_that_does_not_list_a_folder_costs_no_result() {
    let earlier = Earlier::new();
    let failed = refuse_each(&earlier, "list");
    assert!(failed > 8, "{failed}");
}

#[test]
fn a_disk_that_refuses_a_change_leaves_the_results_of_one_job_or_the_next_run_does() {
    let earlier = Earlier::new();
    let rig = &earlier.rig;
    let trace = rig.folder.path().join("trace");
    Run::start(rig.command().env("GDT_TRACE", &trace)).end().succeeded();
    let changes: Vec<Change> = read_trace(&trace);
    let changes = changes.into_iter().filter(|change| !matches!(change, Change::Mark)).count();
    // Results take their places near the end. The trace lacks removals of files that were not there, so there are some more changes.
    let (last, mut placing, mut succeeded) = (changes.saturating_sub(60), 0, 0);
    for count in (1..last).step_by(23).chain(last..) {
        let (success, was_placing) = run_with(&earlier, &format!("change:{count}"));
        placing += usize::from(was_placing);
        succeeded = if success { succeeded + 1 } else { 0 };
        if succeeded == SUCCESSES && count > last {
            break;
        }
    }
    assert!(placing > rig.expected.len(), "{placing} of {changes}");
}

/// Nothing is touched before the folders of the new results are there.
#[test]
fn a_folder_that_cannot_be_made_leaves_the_results_of_the_one_before() {
    let earlier = Earlier::new();
    let rig = &earlier.rig;
    let trace = rig.folder.path().join("trace");
    let without_cut = || {
        earlier.put_back();
        fs::remove_dir_all(rig.out().join("cut")).unwrap();
    };
    without_cut();
    Run::start(rig.command().env("GDT_TRACE", &trace)).end().succeeded();
    let changes: Vec<Change> = read_trace(&trace).into_iter().filter(|c| !matches!(c, Change::Mark)).collect();
    let is_cut = |change: &Change| matches!(change, Change::Folder { path } if path.ends_with("out/cut"));
    let making = changes.iter().rposition(is_cut).unwrap() + 1;
    // The trace lacks removals of files that were not there, and two threads make changes: the number is not quite that.
    let refused = (making.saturating_sub(9)..making + 90).find_map(|count| {
        without_cut();
        let end = Run::start(rig.command().env("GDT_FAULT", format!("change:{count}"))).end();
        end.err.contains("cannot create the directory out/cut").then_some(end)
    });
    refused.unwrap().stopped(&["run the same command again"]);
    assert_eq!(fs::read(rig.out().join("report.json")).unwrap(), earlier.report);
    rig.completes("with its folder");
}
