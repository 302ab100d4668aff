//! A configuration of any bytes.

use super::with_file;

/// The bytes of a configuration file. What is accepted keeps what the documentation promises.
pub(crate) fn config(bytes: &[u8]) {
    let loaded = with_file(".toml", bytes, gdt_batch::config::load);
    let config = match loaded {
        Ok(config) => config,
        Err(error) => {
            assert_eq!(error.exit_code(), 2, "{error}");
            return;
        }
    };
    assert!(!config.input.files.is_empty());
    assert!((0.0..=1.0).contains(&config.input.max_malformed_fraction.0));
    assert!(config.input.bounds.is_none_or(|b| b.0[0] < b.0[2] && b.0[1] < b.0[3]));
    assert!(config.input.resolution.step().is_none_or(|step| step > rust_decimal::Decimal::ZERO));
    assert!(config.limits.memory.0 >= 128 << 20 && (1..=1024).contains(&config.threads()));
    assert!(config.triangulation.max_points_per_tile.0 >= 3);
    assert!(config.input.kept_classes().contains(&true));
    serde_json::to_string(&config).expect("what was read can be written");
}
