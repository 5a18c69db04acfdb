//! Writes into every program of this package where MuJoCo lies at run time.
//!
//! Tests, examples, benchmarks and doctests of this package get it from here. Link arguments do not reach the packages that
//! depend on this one, so `demosift-cli/build.rs` says the same for the command.

fn main() {
    println!("cargo:rerun-if-env-changed=MUJOCO_DYNAMIC_LINK_DIR");
    println!("cargo:rerun-if-changed=build.rs");
    // Other systems have other loaders: macOS finds a library by its install name.
    if std::env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("linux") {
        return;
    }
    if let Ok(folder) = std::env::var("MUJOCO_DYNAMIC_LINK_DIR") {
        println!("cargo:rustc-link-arg=-Wl,-rpath,{folder}");
    }
}
