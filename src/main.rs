//! The command line: parse, run, print the error, exit with its code.

fn main() {}
