//! The demosift command.
fn main() {}
