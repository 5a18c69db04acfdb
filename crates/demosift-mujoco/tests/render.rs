//! Pictures. A test binary of its own with one test, since OpenGL wants one thread.

use demosift::basics::seed::Seed;
use demosift::world::environment::{EnvVariant, Environment};
use demosift_mujoco::pictures::render::Viewpoint;
use demosift_mujoco::registry;

#[test]
fn a_picture_shows_a_fawn_cheetah_on_a_gray_floor_under_the_sky() {
    let task = registry::load("half_cheetah").unwrap();
    let error = Viewpoint::new(&task, "back", 320, 240).err().unwrap();
    assert!(
        error.to_string().contains("no camera is called 'back'; the model has: overview, side"),
        "{error}"
    );
    let error = Viewpoint::new(&task, "side", 0, 240).err().unwrap();
    assert!(error.to_string().contains("0 x 240 pixels"), "{error}");
    let mut viewpoint = match Viewpoint::new(&task, task.camera().unwrap(), 320, 240) {
        Ok(viewpoint) => viewpoint,
        Err(error) => {
            assert!(error.is_simulation() && error.hint().unwrap().contains("libegl1"), "{error}");
            return eprintln!("skipped: {error}");
        }
    };
    let mut environment = task.mujoco_environment().unwrap();
    environment.reset(EnvVariant(0), Seed::new(0), &mut [0.0; 17], &mut [0.0; 1]);
    let picture = viewpoint.picture(&mut environment).unwrap();
    assert_eq!((picture.width, picture.height, picture.rgb.len()), (320, 240, 320 * 240 * 3));
    if let Ok(path) = std::env::var("DEMOSIFT_TEST_PICTURE") {
        let mut file = format!("P6 {} {} 255\n", picture.width, picture.height).into_bytes();
        file.extend_from_slice(&picture.rgb);
        std::fs::write(path, file).unwrap();
    }
    let share = |is: fn([i32; 3]) -> bool| {
        let pixels = picture.rgb.chunks_exact(3).map(|rgb| [rgb[0].into(), rgb[1].into(), rgb[2].into()]);
        pixels.filter(|rgb| is(*rgb)).count() as f64 / (320.0 * 240.0)
    };
    let (fur, sky) = (share(|[r, _, b]| r > b + 40), share(|[r, _, b]| b > r + 15));
    assert!((0.02..0.3).contains(&fur) && sky > 0.1, "fur {fur} sky {sky}");
    // Another state, another picture; the same state, the same picture.
    assert_eq!(picture, viewpoint.picture(&mut environment).unwrap());
    environment.step(&[1.0; 6], &mut [0.0; 17], &mut [0.0; 1]);
    assert_ne!(picture, viewpoint.picture(&mut environment).unwrap());
    let mut stranger = registry::load("half_cheetah").unwrap().mujoco_environment().unwrap();
    assert!(viewpoint.picture(&mut stranger).unwrap_err().is_bad_input());
}
