//! Tests of the files that are written (tiles, their borders, the picture), and of the verification that checks them.

#[path = "../common/random.rs"]
mod random;
#[path = "../common/validator.rs"]
mod validator;

mod model;

mod joined;
mod khronos;
mod picture;
mod round_trip;
mod sabotage;
mod tilings;
