//! The MuJoCo that the programs of this package find when they run is the one that they were made for.

#[test]
fn the_library_found_at_run_time_is_the_pinned_one() {
    assert_eq!(demosift_mujoco::mujoco_version(), "3.17.0");
}
