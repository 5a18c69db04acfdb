//! Pictures of a running task, rendered off the screen (EGL; no display or graphics card is needed).

use demosift::{Error, Result};
use mujoco_rs::prelude::MjvCamera;
use mujoco_rs::renderer::MjRenderer;

use crate::environment::MujocoEnvironment;
use crate::model::{Kind, LARGEST_PICTURE, Model};
use crate::mujoco_task::MujocoTask;
use crate::pictures::picture::Picture;
use crate::quiet::NEEDED_TO_RENDER;

/// Looks at environments of one task through one camera; must stay on the thread that made it.
pub struct Viewpoint {
    renderer: MjRenderer,
    model: Model,
    width: usize,
    height: usize,
}

impl Viewpoint {
    /// Sets up rendering of pictures of `width` × `height` pixels from the model's camera with this name.
    ///
    /// # Errors
    /// If there is no such camera (lists those there are), the size is zero or larger than [`LARGEST_PICTURE`], or
    /// EGL cannot be used.
    pub fn new(task: &MujocoTask, camera: &str, width: usize, height: usize) -> Result<Self> {
        let camera = task.model().id(Kind::Camera, camera)?;
        let (widest, highest) = LARGEST_PICTURE;
        if !(1..=widest).contains(&width) || !(1..=highest).contains(&height) {
            return Err(Error::bad_config(format!(
                "a picture of {width} x {height} pixels; from 1 x 1 to {widest} x {highest} can be rendered"
            )));
        }
        let renderer = MjRenderer::new(task.model().mujoco(), width, height, 0).map_err(|error| {
            let source =
                std::error::Error::source(&error).map_or(String::new(), |cause| format!(": {cause}"));
            Error::simulation(format!("off-screen rendering is not possible: {error}{source}"))
                .with_hint(NEEDED_TO_RENDER)
        })?;
        let renderer = renderer.with_camera(MjvCamera::new_fixed(camera));
        Ok(Self { renderer, model: task.model().clone(), width, height })
    }

    /// Pixels in a row of its pictures.
    pub fn width(&self) -> usize {
        self.width
    }

    /// A picture of the environment as it is now.
    ///
    /// # Errors
    /// If the environment is of another task, or rendering fails.
    pub fn picture(&mut self, environment: &mut MujocoEnvironment) -> Result<Picture> {
        let failed = |error| Error::simulation(format!("cannot render: {error}"));
        if !std::sync::Arc::ptr_eq(self.model.mujoco(), environment.model().mujoco()) {
            return Err(Error::bad_input("the environment is of another task than the viewpoint"));
        }
        self.renderer.sync_data(environment.data_mut()).map_err(failed)?;
        self.renderer.render().map_err(failed)?;
        let rgb = self.renderer.rgb_flat().expect("color rendering is on from the start").to_vec();
        Ok(Picture { width: self.width, height: self.height, rgb })
    }
}
