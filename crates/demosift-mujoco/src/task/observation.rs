//! What the agent sees, part by part.

use std::ops::Range;

use demosift::{Error, Result};

use crate::model::{Joint, Model, Point};
use crate::task::interval::Interval;
use crate::task::measurement::{Data, position, velocity};
use crate::task::slice::{Slice, Sliced, sliced};
use crate::task::task_file::{Names, ObservationPart, PartOf};

/// One part of an observation, its names looked up.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Reading {
    pub(crate) what: What,
    /// What its numbers are clipped to.
    pub(crate) clip: Option<Interval>,
}

/// What a part is of; the range of a place or body says which of its numbers are seen.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum What {
    /// Addresses in qpos.
    Qpos(Range<usize>),
    /// Addresses in qvel.
    Qvel(Range<usize>),
    Position(Point, Range<usize>),
    Velocity(Point, Range<usize>),
    /// Of a body.
    ContactWrench(usize, Range<usize>),
    Phase,
}

/// What an observed number is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Number {
    /// A number of qpos, by its address.
    Position(usize),
    /// A number of qvel, by its address.
    Velocity(usize),
    Other,
}

/// An observation: what is read, and what it is called.
pub(crate) struct Observed {
    pub(crate) readings: Vec<Reading>,
    /// Names such as `qpos knee` or `qvel root[:2] clipped to [-10, 10]`, each with how many numbers it has, in order.
    pub(crate) parts: Vec<(String, usize)>,
}

impl Reading {
    /// How many numbers it writes.
    pub(crate) fn width(&self) -> usize {
        match &self.what {
            What::Qpos(range)
            | What::Qvel(range)
            | What::Position(_, range)
            | What::Velocity(_, range)
            | What::ContactWrench(_, range) => range.len(),
            What::Phase => 1,
        }
    }

    /// What each of its numbers is.
    pub(crate) fn numbers(&self) -> Vec<Number> {
        match &self.what {
            What::Qpos(range) => range.clone().map(Number::Position).collect(),
            What::Qvel(range) => range.clone().map(Number::Velocity).collect(),
            _ => vec![Number::Other; self.width()],
        }
    }

    /// Its key in the task file.
    pub(crate) fn key(&self) -> &'static str {
        match self.what {
            What::Qpos(_) => "qpos",
            What::Qvel(_) => "qvel",
            What::Position(..) => "position",
            What::Velocity(..) => "velocity",
            What::ContactWrench(..) => "contact_wrench",
            What::Phase => "phase",
        }
    }

    pub(crate) fn is_contact_wrench(&self) -> bool {
        matches!(self.what, What::ContactWrench(..))
    }

    /// What each of its numbers is, such as `qpos elbow` or `position hand x`.
    pub(crate) fn columns(&self, model: &Model) -> Vec<String> {
        let key = self.key();
        let of = |name: String, numbers: &[&str]| {
            numbers.iter().map(|number| format!("{key} {name} {number}")).collect()
        };
        match &self.what {
            What::Qpos(range) => {
                let all = model.joints().into_iter().flat_map(|joint| joint.columns_of_qpos());
                all.skip(range.start).take(range.len()).collect()
            }
            What::Qvel(range) => {
                let all = model.joints().into_iter().flat_map(|joint| joint.columns_of_qvel());
                all.skip(range.start).take(range.len()).collect()
            }
            What::Position(point, range) | What::Velocity(point, range) => {
                of(model.name_of(*point), &["x", "y", "z"][range.clone()])
            }
            What::ContactWrench(body, range) => {
                let numbers = ["torque x", "torque y", "torque z", "force x", "force y", "force z"];
                of(model.name_of(Point::Body(*body)), &numbers[range.clone()])
            }
            What::Phase => vec![key.to_owned()],
        }
    }

    /// Writes its numbers; `phase` is the share of the episode that has passed.
    pub(crate) fn write(&self, data: &Data, phase: f64, out: &mut [f32]) {
        let clip = self.clip.unwrap_or(Interval::EVERYTHING);
        let mut copy = |from: &[f64]| {
            out.iter_mut().zip(from).for_each(|(to, from)| *to = clip.clip(*from) as f32);
        };
        match &self.what {
            What::Qpos(range) => copy(&data.qpos()[range.clone()]),
            What::Qvel(range) => copy(&data.qvel()[range.clone()]),
            What::Position(point, range) => copy(&position(data, *point)[range.clone()]),
            What::Velocity(point, range) => copy(&velocity(data, *point)[range.clone()]),
            What::ContactWrench(body, range) => copy(&data.cfrc_ext()[*body][range.clone()]),
            What::Phase => copy(&[phase]),
        }
    }
}

/// Looks up the parts of an observation, in their order.
///
/// # Errors
/// If the model has no such thing (lists what it has), a slice or a range to clip to is none, or nothing is observed.
pub(crate) fn resolve(parts: &[ObservationPart], model: &Model) -> Result<Observed> {
    let mut observed = Observed { readings: Vec::new(), parts: Vec::new() };
    for part in parts {
        let clip = part.clip.map(Interval::resolve).transpose().map_err(|error| error.during("clip"))?;
        let clipped = clip.map_or(String::new(), |clip| format!(" clipped to {}", clip.words()));
        for Named { name, what } in look_up(&part.what, model)? {
            let reading = Reading { what, clip };
            observed.parts.push((format!("{name}{clipped}"), reading.width()));
            add(&mut observed.readings, reading);
        }
    }
    if observed.readings.is_empty() {
        return Err(Error::bad_config(
            "an agent must see something; parts are: qpos, qvel, position, velocity, contact_wrench, phase",
        ));
    }
    Ok(observed)
}

/// What is seen of one thing, and how the task file calls it, such as `qpos knee`.
struct Named {
    name: String,
    what: What,
}

fn look_up(part: &PartOf, model: &Model) -> Result<Vec<Named>> {
    match part {
        PartOf::Qpos(names) => of_joints(names, model, "qpos", |joint| joint.qpos.clone(), What::Qpos),
        PartOf::Qvel(names) => of_joints(names, model, "qvel", |joint| joint.qvel.clone(), What::Qvel),
        PartOf::Position(names) => of_each(names, "position", 3, |name| model.point(name), What::Position),
        PartOf::Velocity(names) => of_each(names, "velocity", 3, |name| model.point(name), What::Velocity),
        PartOf::ContactWrench(names) => {
            of_each(names, "contact_wrench", 6, |name| model.body(name), What::ContactWrench)
        }
        PartOf::Phase => Ok(vec![Named { name: "phase".to_owned(), what: What::Phase }]),
    }
}

/// Things that have `width` numbers each.
fn of_each<T>(
    names: &[String],
    key: &str,
    width: usize,
    find: impl Fn(&str) -> Result<T>,
    make: fn(T, Range<usize>) -> What,
) -> Result<Vec<Named>> {
    let each = names.iter().map(|name| {
        let Sliced { of, slice } = sliced(name, &find)?;
        let range = slice.of(width).map_err(|error| error.during(name))?;
        Ok(Named { name: format!("{key} {name}"), what: make(of, range) })
    });
    each.collect::<Result<_>>().map_err(|error: Error| error.during(key))
}

/// The numbers of joints, each joint's as one part.
fn of_joints(
    names: &Names,
    model: &Model,
    key: &str,
    addresses: fn(&Joint) -> Range<usize>,
    make: fn(Range<usize>) -> What,
) -> Result<Vec<Named>> {
    let mut found = Vec::new();
    for Sliced { of: Called { name, joints }, slice } in
        called(names, model).map_err(|error| error.during(key))?
    {
        let width = joints.iter().map(|joint| addresses(joint).len()).sum();
        if width == 0 {
            continue;
        }
        let taken = slice.of(width).map_err(|error| error.during(&name).during(key))?;
        let mut first = 0;
        for joint in &joints {
            let all = addresses(joint);
            let of_joint = first..first + all.len();
            first = of_joint.end;
            let (from, to) = (taken.start.max(of_joint.start), taken.end.min(of_joint.end));
            if from >= to {
                continue;
            }
            let range = all.start + from - of_joint.start..all.start + to - of_joint.start;
            let part = if range == all {
                String::new()
            } else {
                format!("[{}:{}]", range.start - all.start, range.end - all.start)
            };
            found.push(Named { name: format!("{key} {}{part}", joint.name), what: make(range) });
        }
    }
    Ok(found)
}

/// The joints that a name in the task file means.
struct Called {
    name: String,
    joints: Vec<Joint>,
}

fn called(names: &Names, model: &Model) -> Result<Vec<Sliced<Called>>> {
    let whole =
        |name: &str, joints| Sliced { of: Called { name: name.to_owned(), joints }, slice: Slice::WHOLE };
    match names {
        Names::All => Ok(vec![whole("all", model.joints())]),
        Names::Only(names) => {
            let one = |name: &str| match name {
                "all" => Ok(model.joints()),
                name => Ok(vec![model.joint(name)?]),
            };
            let each = names.iter().map(|name| {
                let Sliced { of: joints, slice } = sliced(name, one)?;
                Ok(Sliced { of: Called { name: name.clone(), joints }, slice })
            });
            each.collect()
        }
        Names::Except(names) => {
            names.iter().try_for_each(|name| model.joint(name).map(drop))?;
            let others = model.joints().into_iter().filter(|joint| !names.contains(&joint.name));
            Ok(vec![whole("except", others.collect())])
        }
    }
}

/// Appends a reading, joined to the one before where the two are neighbors in the state and clipped alike.
fn add(readings: &mut Vec<Reading>, reading: Reading) {
    if let Some(before) = readings.last_mut()
        && before.clip == reading.clip
        && let (What::Qpos(last), What::Qpos(next)) | (What::Qvel(last), What::Qvel(next)) =
            (&mut before.what, &reading.what)
        && last.end == next.start
    {
        last.end = next.end;
        return;
    }
    readings.push(reading);
}
