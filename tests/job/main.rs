//! Whole jobs as a user runs them: the program on a configuration file, and `verify` on what it wrote.

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/copc_file.rs"]
mod copc_file;
#[path = "../common/ept_files.rs"]
mod ept_files;
#[path = "../common/las_file.rs"]
mod las_file;
#[path = "../common/random.rs"]
mod random;
#[path = "../common/scattered.rs"]
mod scattered;
#[path = "../common/validator.rs"]
mod validator;
#[cfg(feature = "remote")]
#[path = "../common/web_server.rs"]
mod web_server;

mod clouds;
mod program;
mod terrain_tiles;
mod tileset;
mod transformed;

mod areas_of_use;
mod attributes;
mod bad_files;
mod bare_earth;
mod breaklines;
mod broken;
// These take the longest. Tests begin in the order of their names, so that others run beside them.
mod browsers;
mod choices;
mod clip;
mod command_line;
mod configuration;
mod contours;
mod coordinate_systems;
mod copc;
mod copyright;
mod cutting;
mod decimals;
mod diff;
mod doubtful_systems;
mod doubtful_transforms;
mod ept;
mod exports;
mod far_points;
mod globe;
mod hard_shapes;
mod height_offsets;
mod heights;
mod histogram;
mod hull;
mod init;
mod khronos;
mod levels;
mod limits;
mod lists;
mod manual;
mod many_tiles;
mod map_tiles;
mod max_error;
mod messages;
mod mistakes;
#[cfg(unix)]
mod names;
mod nodata;
mod one_command;
mod orthophoto;
mod overlap;
mod parts;
mod preflight;
mod raster;
mod real;
#[cfg(feature = "remote")]
mod remote;
mod same_mesh;
mod schemas;
mod shortage;
mod slow_gpus;
mod steps;
mod stray_heights;
mod surface;
mod tampering;
mod tasks;
mod texts;
mod units;
mod updates;
mod written;
