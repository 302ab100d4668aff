//! A configuration of any bytes, and a whole job with it.

use ::job::options::{JobOptions, Threads};
use delaunay_gpu::triangulation_options::Backend;

use super::{job, with_file};
use sys::ErrorKind;

/// The bytes of a configuration file, with a whole job.
pub(crate) fn config(bytes: &[u8]) {
    with_config(bytes, run);
}

/// The same without a job.
pub(crate) fn config_without_job(bytes: &[u8]) {
    with_config(bytes, drop);
}

/// Loads the configuration and calls `run` if it is accepted. Then it keeps what the documentation promises.
fn with_config(bytes: &[u8], run: fn(JobOptions)) {
    let options = match with_file(".toml", bytes, gdt_batch::config::load) {
        Ok(options) => options,
        Err(error) => {
            assert_eq!(error.kind(), ErrorKind::Usage, "{error}");
            return;
        }
    };
    assert!(!options.input.files.is_empty());
    assert!((0.0..=1.0).contains(&options.input.max_malformed_fraction.0));
    assert!(options.input.bounds.is_none_or(|b| b.0[0] < b.0[2] && b.0[1] < b.0[3]));
    assert!(options.input.resolution.step().is_none_or(|step| step > rust_decimal::Decimal::ZERO));
    assert!(options.limits.memory.0 >= 128 << 20 && (1..=1024).contains(&options.threads()));
    assert!(options.triangulation.max_points_per_tile.0 >= 3);
    assert!(options.input.kept_classes().contains(&true));
    serde_json::to_string(&options).expect("options are JSON");
    run(options);
}

/// Runs the job on a small cloud of its own.
fn run(mut options: JobOptions) {
    with_file(".csv", cloud().as_bytes(), |path| {
        options.input.files = vec![path.to_str().expect("a plain path").to_owned()];
        options.limits.threads = Threads(options.threads().min(2));
        if options.triangulation.backend != Backend::Reference {
            // A software renderer would take long.
            options.triangulation.backend = Backend::Cpu;
        }
        if job::preflight(&options) {
            job::run_and_verify(options);
        }
    });
}

/// 400 points with classes and colours, within the bounds of full.toml.
fn cloud() -> String {
    let mut text = "x,y,z,red,green,blue,classification\n".to_owned();
    for point in 0..400u32 {
        let (column, row) = (point % 20, point / 20);
        let [x, y, height] = [565_000 + 19 * column + row % 3, 5_933_000 + 17 * row + column % 5, column * row % 13];
        let (color, class) = (160 * point, [2, 9, 5, 7][(point % 4) as usize]);
        text += &format!("{x}.{row},{y}.25,{height}.5,{color},0,65535,{class}\n");
    }
    text
}
