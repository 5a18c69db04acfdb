//! Writes into the `demosift` command where MuJoCo lies at run time; see `demosift-mujoco/build.rs`.

fn main() {
    println!("cargo:rerun-if-env-changed=MUJOCO_DYNAMIC_LINK_DIR");
    println!("cargo:rerun-if-changed=build.rs");
    if std::env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("linux") {
        return;
    }
    // A library beside the command first, so that the two can be moved together; then where `cargo xtask install` puts it;
    // then the checkout of `target/release/demosift`, wherever it has been moved to; then the folder it was linked with.
    println!("cargo:rustc-link-arg=-Wl,-rpath,$ORIGIN");
    println!("cargo:rustc-link-arg=-Wl,-rpath,$ORIGIN/../lib/demosift");
    println!("cargo:rustc-link-arg=-Wl,-rpath,$ORIGIN/../../.mujoco/lib");
    if let Ok(folder) = std::env::var("MUJOCO_DYNAMIC_LINK_DIR") {
        println!("cargo:rustc-link-arg=-Wl,-rpath,{folder}");
    }
}
