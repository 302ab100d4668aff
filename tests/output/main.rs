//! What is written is what was meant: tiles, their borders, the picture, and that verification sees what is wrong.

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
