//! Episodes of an environment in Python that are looked at: they are played again in one that renders.

use demosift::Result;
use demosift_gymnasium::pictures::{self, Reel, View};
use demosift_gymnasium::task::GymnasiumTask;
use demosift_mujoco::pictures::film;
use demosift_mujoco::pictures::picture::Picture;

/// An environment that renders.
pub(crate) struct Camera {
    camera: pictures::Camera,
    width: usize,
}

impl Camera {
    /// Makes it; pictures are as it renders them, made smaller to fit.
    pub(crate) fn open(task: &GymnasiumTask, size: [u32; 2]) -> Result<Self> {
        let mut camera = pictures::Camera::open(task, size)?;
        let width = camera.look()?.width;
        Ok(Self { camera, width })
    }

    /// With these episodes before it.
    pub(crate) fn before(self, reels: Vec<&Reel>) -> OfReels<'_> {
        OfReels { camera: self, reels, shown: None, left: Vec::new() }
    }
}

/// Shows episodes, each played again as its steps are asked for.
pub(crate) struct OfReels<'e> {
    camera: Camera,
    reels: Vec<&'e Reel>,
    shown: Option<usize>,
    /// Of those that did not repeat, which and from which step on.
    left: Vec<(usize, usize)>,
}

impl OfReels<'_> {
    /// Of the episodes that did not come again as they were, which and from which step on.
    pub(crate) fn left(&self) -> &[(usize, usize)] {
        &self.left
    }
}

impl film::Camera for OfReels<'_> {
    fn width(&self) -> usize {
        self.camera.width
    }

    fn picture(&mut self, take: usize, step: usize) -> Result<Picture> {
        let (camera, reel) = (&mut self.camera.camera, self.reels[take]);
        if self.shown != Some(take) {
            camera.begin(reel)?;
            self.shown = Some(take);
        }
        let View { width, height, rgb } = camera.picture(reel, step)?;
        if let Some(step) = camera.left_at()
            && self.left.last().is_none_or(|(last, _)| *last != take)
        {
            self.left.push((take, step));
        }
        Ok(Picture { width, height, rgb })
    }
}
