//! What is written down at every step, for heuristic, success and task reward.

use std::sync::Arc;

use demosift::{Error, Result};
use mujoco_rs::prelude::{MjData, MjModel, MjtObjBase};

use crate::model::{Joint, Kind, Model, Point};
use crate::task_file;

/// The simulation that an environment owns.
pub(crate) type Data = MjData<Arc<MjModel>>;

/// A measurement whose names have become ids.
#[derive(Debug)]
pub(crate) enum Measurement {
    Qpos(usize),
    Qvel(usize),
    Distance(Point, Point),
    HorizontalDistance(Point, Point),
    HeightAbove(Point, Point),
    Position(Point, usize),
    Velocity(Point, usize),
    /// Masks over geoms.
    Contact(Box<[bool]>, Box<[bool]>),
}

impl Measurement {
    /// Looks up the names of a measurement.
    ///
    /// # Errors
    /// If the model has no such thing (lists what it has), or a joint is not a single number.
    pub(crate) fn resolve(file: &task_file::Measurement, model: &Model) -> Result<Self> {
        use task_file::Measurement as File;
        let two = |[a, b]: &[String; 2]| Ok::<_, Error>((model.point(a)?, model.point(b)?));
        Ok(match file {
            File::Qpos(joint) => Self::Qpos(single(model.joint(joint)?)?.qpos.start),
            File::Qvel(joint) => Self::Qvel(single(model.joint(joint)?)?.qvel.start),
            File::Distance(names) => two(names).map(|(a, b)| Self::Distance(a, b))?,
            File::HorizontalDistance(names) => two(names).map(|(a, b)| Self::HorizontalDistance(a, b))?,
            File::HeightAbove(names) => two(names).map(|(a, b)| Self::HeightAbove(a, b))?,
            File::Height(name) => Self::Position(model.point(name)?, 2),
            File::Position(component) => Self::Position(model.point(&component.of)?, component.axis as usize),
            File::Velocity(component) => Self::Velocity(model.point(&component.of)?, component.axis as usize),
            File::Contact([a, b]) => Self::Contact(model.geoms(a)?, model.geoms(b)?),
        })
    }

    /// What it is, such as `distance of hand and target, m`.
    pub(crate) fn words(&self, model: &Model) -> String {
        let name = |point: &Point| model.name_of(*point);
        let joint = |found: Option<Joint>| found.map_or_else(String::new, |joint| joint.name);
        let of_qpos = |at| joint(model.joints().into_iter().find(|joint| joint.qpos.start == at));
        let of_qvel = |at| joint(model.joints().into_iter().find(|joint| joint.qvel.start == at));
        let geoms = |mask: &[bool]| {
            let names = model.called(Kind::Geom).into_iter().zip(mask).filter(|(_, is_in)| **is_in);
            names.map(|(name, _)| name).collect::<Vec<_>>().join(", ")
        };
        let axis = |axis: &usize| ["x", "y", "z"][*axis];
        match self {
            Self::Qpos(at) => format!("position of the joint {}", of_qpos(*at)),
            Self::Qvel(at) => format!("velocity of the joint {}", of_qvel(*at)),
            Self::Distance(a, b) => format!("distance of {} and {}, m", name(a), name(b)),
            Self::HorizontalDistance(a, b) => {
                format!("distance of {} and {} seen from above, m", name(a), name(b))
            }
            Self::HeightAbove(a, b) => format!("height of {} above {}, m", name(a), name(b)),
            Self::Position(of, 2) => format!("height (z) of {}, m", name(of)),
            Self::Position(of, at) => format!("{} of {}, m", axis(at), name(of)),
            Self::Velocity(of, at) => format!("velocity of {} along {}, m/s", name(of), axis(at)),
            Self::Contact(a, b) => format!("1 while {} touches {}, else 0", geoms(a), geoms(b)),
        }
    }

    /// Whether it says that things touch.
    pub(crate) fn is_contact(&self) -> bool {
        matches!(self, Self::Contact(..))
    }

    /// Whether it is a distance, of which less is usually better.
    pub(crate) fn is_distance(&self) -> bool {
        matches!(self, Self::Distance(..) | Self::HorizontalDistance(..))
    }

    /// The number, now.
    pub(crate) fn take(&self, data: &Data) -> f64 {
        match self {
            Self::Qpos(address) => data.qpos()[*address],
            Self::Qvel(address) => data.qvel()[*address],
            Self::Distance(a, b) => {
                let [x, y, z] = difference(data, *a, *b);
                (x * x + y * y + z * z).sqrt()
            }
            Self::HorizontalDistance(a, b) => {
                let [x, y, _] = difference(data, *a, *b);
                x.hypot(y)
            }
            Self::HeightAbove(a, b) => difference(data, *a, *b)[2],
            Self::Position(point, axis) => position(data, *point)[*axis],
            Self::Velocity(point, axis) => velocity(data, *point)[*axis],
            Self::Contact(a, b) => f64::from(u8::from(touches(data, a, b))),
        }
    }
}

/// Where a point is in the world, m.
pub(crate) fn position(data: &Data, point: Point) -> [f64; 3] {
    match point {
        Point::Body(id) => data.xpos()[id],
        Point::Geom(id) => data.geom_xpos()[id],
        Point::Site(id) => data.site_xpos()[id],
    }
}

/// How fast a point moves in the world, m/s.
pub(crate) fn velocity(data: &Data, point: Point) -> [f64; 3] {
    let (object, id) = match point {
        // The frame of the body, whose place `position` tells; mjOBJ_BODY would be its center of mass.
        Point::Body(id) => (MjtObjBase::mjOBJ_XBODY, id),
        Point::Geom(id) => (MjtObjBase::mjOBJ_GEOM, id),
        Point::Site(id) => (MjtObjBase::mjOBJ_SITE, id),
    };
    let [_, _, _, x, y, z] = data.object_velocity(object, id, false);
    [x, y, z]
}

fn difference(data: &Data, a: Point, b: Point) -> [f64; 3] {
    let (a, b) = (position(data, a), position(data, b));
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn touches(data: &Data, a: &[bool], b: &[bool]) -> bool {
    data.contact().iter().any(|contact| {
        // Parts of flexible bodies have no geom; their id is -1.
        let [Ok(one), Ok(other)] = contact.geom.map(usize::try_from) else { return false };
        contact.exclude == 0 && (a[one] && b[other] || a[other] && b[one])
    })
}

fn single(joint: Joint) -> Result<Joint> {
    if joint.qpos.len() == 1 {
        return Ok(joint);
    }
    Err(Error::bad_config(format!(
        "the joint '{}' has {} positions, and a measurement is one number; use `position` or `velocity` of its body",
        joint.name,
        joint.qpos.len()
    )))
}
