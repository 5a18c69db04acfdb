//! What is written down at every step, for heuristic, success and task reward.

use std::collections::BTreeMap;
use std::sync::Arc;

use demosift::{Error, Result};
use mujoco_rs::prelude::{MjData, MjModel, MjtObjBase};

use crate::model::{Joint, Kind, Model, Point};
use crate::task::columns::column;
use crate::task::ends::Ends;
use crate::task::task_file;

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
    /// Of another column.
    RateOf(usize),
    Effort,
    Alive,
    Sum(Vec<Weighted>),
}

/// A column with its weight in a sum.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Weighted {
    column: usize,
    weight: f64,
}

/// What measurements are taken of.
pub(crate) struct Moment<'a> {
    pub(crate) data: &'a Data,
    /// What led here; `None` right after a reset.
    pub(crate) step: Option<Step<'a>>,
    pub(crate) ends: &'a Ends,
}

/// The control step that led to a moment.
pub(crate) struct Step<'a> {
    /// Measurements before it, `[measurements]`.
    pub(crate) before: &'a [f64],
    /// `[act]`, before it was clipped to [−1, 1].
    pub(crate) action: &'a [f32],
    pub(crate) secs: f64,
}

/// Looks up the names of all measurements, in the order of their `names`.
///
/// # Errors
/// If the model has no such thing (lists what it has), a joint is not a single number, a measurement is made of one that
/// is unknown or itself made of others in the same way, or `alive` has no ranges to look at.
pub(crate) fn resolve(
    file: &BTreeMap<String, task_file::Measurement>,
    names: &[String],
    model: &Model,
    ends: &Ends,
) -> Result<Vec<Measurement>> {
    let during = |name: &str| format!("measurements.{name}");
    let found = file.iter().map(|(name, measurement)| {
        Measurement::resolve(measurement, model, names).map_err(|error| error.during(&during(name)))
    });
    let found = found.collect::<Result<Vec<_>>>()?;
    for (name, measurement) in names.iter().zip(&found) {
        measurement.check(&found, names, ends).map_err(|error| error.during(&during(name)))?;
    }
    for kept in ends.ranges() {
        if found[kept.column].rank() > Rank::Rate {
            let name = &names[kept.column];
            let message = format!("'{name}' is made of other measurements; say the range of one of those");
            return Err(Error::bad_config(message).during("ends"));
        }
    }
    Ok(found)
}

/// The order in which all measurements of a moment can be taken, each after those that it is made of.
pub(crate) fn order(measurements: &[Measurement]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..measurements.len()).collect();
    order.sort_by_key(|column| measurements[*column].rank());
    order
}

/// How far a measurement is from what the simulation tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Rank {
    Taken,
    Rate,
    Alive,
    Sum,
}

impl Measurement {
    fn resolve(file: &task_file::Measurement, model: &Model, names: &[String]) -> Result<Self> {
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
            File::RateOf(name) => Self::RateOf(column(name, names).map_err(|error| error.during("rate_of"))?),
            File::Effort => Self::Effort,
            File::Alive => Self::Alive,
            File::Sum(weights) => {
                let weighted = weights.iter().map(|(name, &weight)| {
                    let column = column(name, names)?;
                    if weight.is_finite() {
                        return Ok(Weighted { column, weight });
                    }
                    Err(Error::bad_config(format!("the weight of '{name}' is {weight}, and must be finite")))
                });
                let weighted: Result<Vec<_>> = weighted.collect();
                Self::Sum(weighted.map_err(|error| error.during("sum"))?)
            }
        })
    }

    fn rank(&self) -> Rank {
        match self {
            Self::RateOf(_) => Rank::Rate,
            Self::Alive => Rank::Alive,
            Self::Sum(_) => Rank::Sum,
            _ => Rank::Taken,
        }
    }

    /// Whether it can be taken after those that it is made of.
    fn check(&self, all: &[Self], names: &[String], ends: &Ends) -> Result<()> {
        match self {
            Self::RateOf(of) if all[*of].rank() > Rank::Taken => Err(Error::bad_config(format!(
                "rate_of: '{}' is itself made of other measurements; name one that is not",
                names[*of]
            ))),
            Self::Alive if ends.is_empty() => Err(Error::bad_config(
                "`alive` says whether the ranges of [ends] hold, and there are none; add [ends]",
            )),
            Self::Sum(weighted) if weighted.is_empty() => {
                Err(Error::bad_config("sum: empty; name at least one measurement, as in { speed = 1.0 }"))
            }
            Self::Sum(weighted) => {
                match weighted.iter().find(|weighted| all[weighted.column].rank() == Rank::Sum) {
                    None => Ok(()),
                    Some(inner) => Err(Error::bad_config(format!(
                        "sum: '{}' is itself a sum; name what it is made of",
                        names[inner.column]
                    ))),
                }
            }
            _ => Ok(()),
        }
    }

    /// What it is, such as `distance of hand and target, m`.
    pub(crate) fn words(&self, model: &Model, names: &[String]) -> String {
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
            Self::RateOf(of) => format!("change of {} a second", names[*of]),
            Self::Effort => "|action|² of the step, clipped to [-1, 1]".to_owned(),
            Self::Alive => "1 while the ranges of [ends] hold, else 0".to_owned(),
            Self::Sum(weighted) => {
                let terms = weighted.iter().map(|one| format!("{} · {}", one.weight, names[one.column]));
                terms.collect::<Vec<_>>().join(" + ")
            }
        }
    }

    /// The column whose rate it is.
    pub(crate) fn rate_of(&self) -> Option<usize> {
        if let Self::RateOf(of) = self { Some(*of) } else { None }
    }

    /// Whether it says that the ranges of `[ends]` hold.
    pub(crate) fn is_alive(&self) -> bool {
        matches!(self, Self::Alive)
    }

    /// Whether it says that things touch.
    pub(crate) fn is_contact(&self) -> bool {
        matches!(self, Self::Contact(..))
    }

    /// Whether it is a distance, of which less is usually better.
    pub(crate) fn is_distance(&self) -> bool {
        matches!(self, Self::Distance(..) | Self::HorizontalDistance(..))
    }

    /// The number, now; `taken` has the measurements of the same moment that come before it in [`order`].
    pub(crate) fn take(&self, moment: &Moment<'_>, taken: &[f64]) -> f64 {
        let data = moment.data;
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
            Self::RateOf(of) => {
                moment.step.as_ref().map_or(0.0, |step| (taken[*of] - step.before[*of]) / step.secs)
            }
            Self::Effort => moment.step.as_ref().map_or(0.0, |step| effort(step.action)),
            Self::Alive => f64::from(u8::from(moment.ends.left(taken).is_none())),
            Self::Sum(weighted) => weighted.iter().map(|one| one.weight * taken[one.column]).sum(),
        }
    }
}

/// ‖a‖² of an action, clipped to [−1, 1].
fn effort(action: &[f32]) -> f64 {
    action.iter().map(|value| f64::from(value.clamp(-1.0, 1.0)).powi(2)).sum()
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
