//! What a viewer outside of MuJoCo needs to draw a task: the shapes of its model, and where its bodies are at each step.

use demosift::data::trajectory::StateLog;
use demosift::{Error, Result};
use mujoco_rs::prelude::{MjData, MjtCamLight, MjtGeom};
use serde::Serialize;

use crate::model::{Kind, Model};
use crate::mujoco_task::MujocoTask;
use crate::replay::Replay;

/// MuJoCo's own viewers show groups 0 to 2 at first, and so is it here.
const LAST_SHOWN_GROUP: i32 = 2;
/// MuJoCo draws a plane without bounds as far as it sees; this is how far a viewer may, in meters each way.
const BOUNDLESS: f64 = 40.0;

/// A model as a viewer draws it; lengths in meters, z up, quaternions w x y z.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Scene {
    /// Everything visible.
    pub shapes: Vec<Shape>,
    /// How many bodies have shapes, besides the world; a [`Motion`] has a pose of each.
    pub bodies: usize,
    /// From where to look, if the model has a camera.
    pub camera: Option<View>,
    /// How many shapes are left out, since they are meshes or fields of heights.
    pub left_out: usize,
}

/// One geom or site.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Shape {
    /// Index of the body that it moves with; `None` if it stands still in the world.
    pub body: Option<usize>,
    /// What it is: `plane`, `sphere`, `capsule`, `ellipsoid`, `cylinder` or `box`.
    pub kind: &'static str,
    /// MuJoCo's size of this kind: half lengths and radii.
    pub size: [f64; 3],
    /// Color and opacity, each from 0 to 1.
    pub rgba: [f32; 4],
    /// Where it is in its body.
    pub position: [f64; 3],
    /// How it is turned in its body.
    pub quaternion: [f64; 4],
}

/// A camera, with the model in its first state.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct View {
    /// Where it is.
    pub position: [f64; 3],
    /// Where it looks, of length 1.
    pub direction: [f64; 3],
    /// Its vertical field of view, degrees.
    pub field_of_view: f64,
    /// The body that it goes along with, if it is not fixed.
    pub follows: Option<usize>,
}

/// Where the bodies are, in 14 bytes a body and frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Frames: every `stride`-th step, and the last one.
    pub frames: usize,
    /// Control steps between two frames.
    pub stride: usize,
    /// The least coordinate on each axis, meters.
    pub low: [f64; 3],
    /// The largest coordinate on each axis, meters.
    pub high: [f64; 3],
    /// `[frames, bodies, 7]` of 16-bit integers, least byte first: x, y, z with −32767 for `low` and 32767 for `high`, then the
    /// quaternion w x y z in 32767ths.
    pub poses: Vec<u8>,
}

/// Bytes of a body in a frame.
pub const POSE_BYTES: usize = 14;
const FULL: f64 = 32767.0;

/// The shapes of a task's model.
///
/// # Errors
/// If MuJoCo has no memory for a simulation of the model.
pub fn scene(task: &MujocoTask) -> Result<Scene> {
    let moving = moving_bodies(task.model());
    let (mut shapes, mut left_out) = (Vec::new(), 0);
    for part in parts(task.model()).into_iter().filter(is_visible) {
        match kind(part.kind) {
            Some(kind) => shapes.push(shape(&part, kind, &moving)),
            None => left_out += 1,
        }
    }
    Ok(Scene { shapes, bodies: moving.len(), camera: camera(task, &moving)?, left_out })
}

/// Where the bodies of an episode are, one frame every `stride` of its `steps`.
///
/// # Errors
/// `is_bad_input` if the states are not of the task's model, or a number in them is not finite.
pub fn motion(task: &MujocoTask, states: &StateLog, steps: usize, stride: usize) -> Result<Motion> {
    let moving = moving_bodies(task.model());
    let mut replay = Replay::new(task, states, steps)?;
    let stride = stride.max(1);
    let shown: Vec<usize> =
        (0..steps).filter(|step| step.is_multiple_of(stride) || step + 1 == steps).collect();
    let mut poses: Vec<([f64; 3], [f64; 4])> = Vec::with_capacity(shown.len() * moving.len());
    for step in &shown {
        let data = replay.at(*step)?.data_mut();
        poses.extend(moving.iter().map(|body| (data.xpos()[*body], data.xquat()[*body])));
    }
    let bound = |pick: fn(f64, f64) -> f64, start: f64| {
        std::array::from_fn(|axis| poses.iter().map(|(position, _)| position[axis]).fold(start, pick))
    };
    let (low, high): ([f64; 3], [f64; 3]) =
        (bound(f64::min, f64::INFINITY), bound(f64::max, f64::NEG_INFINITY));
    let mut bytes = Vec::with_capacity(poses.len() * POSE_BYTES);
    for (position, quaternion) in &poses {
        for axis in 0..3 {
            let range = (high[axis] - low[axis]).max(f64::MIN_POSITIVE);
            bytes.extend(quantized((position[axis] - low[axis]) / range * 2.0 - 1.0));
        }
        quaternion.iter().for_each(|value| bytes.extend(quantized(*value)));
    }
    Ok(Motion { frames: shown.len(), stride, low, high, poses: bytes })
}

/// Control steps between two frames, so that episodes of so many steps in all fit into `most_bytes`; at least 1.
pub fn stride(scene: &Scene, steps: usize, most_bytes: usize) -> usize {
    (steps * scene.bodies * POSE_BYTES).div_ceil(most_bytes.max(1)).max(1)
}

fn quantized(share: f64) -> [u8; 2] {
    ((share.clamp(-1.0, 1.0) * FULL).round() as i16).to_le_bytes()
}

/// A geom or a site, as the model has it.
struct Part {
    body: usize,
    kind: MjtGeom,
    group: i32,
    size: [f64; 3],
    rgba: [f32; 4],
    position: [f64; 3],
    quaternion: [f64; 4],
}

fn parts(model: &Model) -> Vec<Part> {
    let model = model.mujoco();
    let colored = |material: i32, own: [f32; 4]| match usize::try_from(material) {
        // As MuJoCo does it: a color of the geom's own counts unless it is the default.
        Ok(material) if own == [0.5, 0.5, 0.5, 1.0] => model.mat_rgba()[material],
        _ => own,
    };
    let geoms = (0..model.geom_type().len()).map(|geom| Part {
        body: model.geom_bodyid()[geom] as usize,
        kind: model.geom_type()[geom].into(),
        group: model.geom_group()[geom],
        size: model.geom_size()[geom],
        rgba: colored(model.geom_matid()[geom], model.geom_rgba()[geom]),
        position: model.geom_pos()[geom],
        quaternion: model.geom_quat()[geom],
    });
    let sites = (0..model.site_type().len()).map(|site| Part {
        body: model.site_bodyid()[site] as usize,
        kind: model.site_type()[site].into(),
        group: model.site_group()[site],
        size: model.site_size()[site],
        rgba: colored(model.site_matid()[site], model.site_rgba()[site]),
        position: model.site_pos()[site],
        quaternion: model.site_quat()[site],
    });
    geoms.chain(sites).collect()
}

fn is_visible(part: &Part) -> bool {
    part.group <= LAST_SHOWN_GROUP && part.rgba[3] > 0.0
}

fn kind(kind: MjtGeom) -> Option<&'static str> {
    match kind {
        MjtGeom::mjGEOM_PLANE => Some("plane"),
        MjtGeom::mjGEOM_SPHERE => Some("sphere"),
        MjtGeom::mjGEOM_CAPSULE => Some("capsule"),
        MjtGeom::mjGEOM_ELLIPSOID => Some("ellipsoid"),
        MjtGeom::mjGEOM_CYLINDER => Some("cylinder"),
        MjtGeom::mjGEOM_BOX => Some("box"),
        _ => None,
    }
}

fn shape(part: &Part, kind: &'static str, moving: &[usize]) -> Shape {
    let mut size = part.size;
    if kind == "plane" {
        size.iter_mut().take(2).filter(|half| **half <= 0.0).for_each(|half| *half = BOUNDLESS);
    }
    let body = moving.iter().position(|body| *body == part.body);
    Shape { body, kind, size, rgba: part.rgba, position: part.position, quaternion: part.quaternion }
}

/// The bodies with something to show, by id, but for the world.
///
/// One that is fixed to the world has poses too, since its shapes are placed in it.
fn moving_bodies(model: &Model) -> Vec<usize> {
    let mut bodies: Vec<usize> =
        parts(model).iter().filter(|part| is_visible(part) && part.body > 0).map(|part| part.body).collect();
    bodies.sort_unstable();
    bodies.dedup();
    bodies
}

fn camera(task: &MujocoTask, moving: &[usize]) -> Result<Option<View>> {
    let Some(name) = task.camera() else { return Ok(None) };
    let (camera, model) = (task.model().id(Kind::Camera, name)?, task.model().mujoco());
    let mut data = MjData::try_new(model.clone())
        .map_err(|error| Error::simulation(format!("MuJoCo cannot set up a simulation: {error}")))?;
    data.forward();
    // A camera looks along its negative z axis, the third column of its matrix.
    let matrix = data.cam_xmat()[camera];
    let followed = match model.cam_mode()[camera] {
        MjtCamLight::mjCAMLIGHT_FIXED => None,
        MjtCamLight::mjCAMLIGHT_TRACK | MjtCamLight::mjCAMLIGHT_TRACKCOM => {
            Some(model.cam_bodyid()[camera] as usize)
        }
        _ => usize::try_from(model.cam_targetbodyid()[camera]).ok(),
    };
    Ok(Some(View {
        position: data.cam_xpos()[camera],
        direction: [-matrix[2], -matrix[5], -matrix[8]],
        field_of_view: model.cam_fovy()[camera],
        follows: followed.and_then(|body| moving.iter().position(|moving| *moving == body)),
    }))
}
