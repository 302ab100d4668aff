//! What each shader needs of an AMD GPU: instructions, registers, spills. Mesa's compiler for those GPUs (RADV) tells it without one.
//! Every entry point has a budget in `budgets`, and CONTRIBUTING.md says how to change it.

mod budgets;
mod compile;
mod programs;
mod radv;
mod statistics;

use budgets::{BUDGETS, MESA, NEVER, Verdict};
use compile::compile;
use programs::{name, on_disk, programs};
use radv::{FAMILY, NullDevice};
use statistics::Statistics;
use std::collections::BTreeSet;
use std::process::Command;

#[test]
fn programs_are_all_compute_functions_of_the_shaders() {
    let listed: BTreeSet<String> = programs().iter().map(name).collect();
    assert_eq!(listed, on_disk(), "programs() of tests/shaders/programs.rs on the left, shaders/ on the right");
}

#[test]
fn every_program_has_a_budget() {
    let budgets: BTreeSet<String> = BUDGETS.iter().map(|budget| budget.program.into()).collect();
    let listed: BTreeSet<String> = programs().iter().map(name).collect();
    let without: Vec<_> = listed.difference(&budgets).collect();
    let gone: Vec<_> = budgets.difference(&listed).collect();
    assert!(
        without.is_empty() && gone.is_empty() && budgets.len() == BUDGETS.len(),
        "tests/shaders/budgets.rs: there is no budget for {without:?}; {gone:?} exist no more; {} budgets are there twice",
        BUDGETS.len() - budgets.len()
    );
}

/// The Vulkan loader and the driver read the environment when they start. So the test runs itself again in a process of its own.
#[test]
fn no_shader_needs_more_than_its_budget() {
    if std::env::var("RADV_FORCE_FAMILY").is_ok_and(|family| family == FAMILY) {
        return check_budgets();
    }
    let output = Command::new(std::env::current_exe().expect("this program has a path"))
        .args(["no_shader_needs_more_than_its_budget", "--exact", "--nocapture"])
        // Newer versions of Mesa have the second name.
        .envs([("RADV_FORCE_FAMILY", FAMILY), ("AMD_FORCE_FAMILY", FAMILY), ("MESA_SHADER_CACHE_DISABLE", "true")])
        .output()
        .expect("this program starts");
    print!("{}", String::from_utf8_lossy(&output.stdout));
    eprint!("{}", String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{}", output.status);
}

fn check_budgets() {
    let device = match NullDevice::open() {
        Ok(device) => device,
        Err(why) => {
            let why = format!("{why}; Debian's mesa-vulkan-drivers and libvulkan1 have what is missing");
            assert!(std::env::var_os("GDT_TEST_ALL").is_none() || !cfg!(target_os = "linux"), "{why}");
            return eprintln!("skipped: {why}");
        }
    };
    let is_same = device.driver == MESA;
    println!("{} with {}, {:?}\n{}", device.name, device.driver, device.abilities, Statistics::header());
    let (mut broken, mut untold) = (Vec::new(), BTreeSet::new());
    for program in programs() {
        let compiled = compile(&program, &device.abilities);
        let statistics =
            device.statistics(&program, &compiled).unwrap_or_else(|why| panic!("{}: {why}", name(&program)));
        println!("{}", statistics.row(&name(&program)));
        let budget = BUDGETS.iter().find(|budget| budget.program == name(&program));
        untold.extend(NEVER.into_iter().filter(|name| statistics.get(name).is_none()));
        let verdict = Verdict { budget: budget.filter(|_| is_same), statistics: &statistics };
        broken.extend(verdict.complaints().map(|complaint| format!("{}: {complaint}", name(&program))));
    }
    if !is_same {
        eprintln!("only spills and scratch memory were checked: the budgets are for {MESA}, here is {}", device.driver);
        eprintln!("what this version does not tell was not checked: {untold:?}");
    }
    assert!(broken.is_empty(), "CONTRIBUTING.md says how to change a budget\n{}", broken.join("\n"));
}
