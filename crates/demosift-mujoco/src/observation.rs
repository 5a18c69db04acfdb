//! What the agent sees, part by part.

use std::ops::Range;

use demosift::{Error, Result};

use crate::measurement::{Data, position, velocity};
use crate::model::{Joint, Kind, Model, Point};
use crate::task_file::{Names, ObservationPart};

/// One part of an observation, its names looked up.
#[derive(Debug, PartialEq)]
pub(crate) enum Reading {
    Qpos(Range<usize>),
    Qvel(Range<usize>),
    Position(Point),
    Velocity(Point),
    /// Of a body.
    ContactWrench(usize),
    Phase,
}

impl Reading {
    /// How many numbers it writes.
    pub(crate) fn width(&self) -> usize {
        match self {
            Self::Qpos(range) | Self::Qvel(range) => range.len(),
            Self::Position(_) | Self::Velocity(_) => 3,
            Self::ContactWrench(_) => 6,
            Self::Phase => 1,
        }
    }

    /// Its key in the task file.
    pub(crate) fn key(&self) -> &'static str {
        match self {
            Self::Qpos(_) => "qpos",
            Self::Qvel(_) => "qvel",
            Self::Position(_) => "position",
            Self::Velocity(_) => "velocity",
            Self::ContactWrench(_) => "contact_wrench",
            Self::Phase => "phase",
        }
    }

    /// What each of its numbers is, such as `qpos elbow` or `position hand x`.
    pub(crate) fn columns(&self, model: &Model) -> Vec<String> {
        let key = self.key();
        let of = |name: String, numbers: &[&str]| {
            numbers.iter().map(|number| format!("{key} {name} {number}")).collect()
        };
        match self {
            Self::Qpos(range) => {
                let joints = model.joints().into_iter().filter(|joint| range.contains(&joint.qpos.start));
                joints.flat_map(|joint| joint.columns_of_qpos()).collect()
            }
            Self::Qvel(range) => {
                let joints = model.joints().into_iter().filter(|joint| range.contains(&joint.qvel.start));
                joints.flat_map(|joint| joint.columns_of_qvel()).collect()
            }
            Self::Position(point) | Self::Velocity(point) => of(model.name_of(*point), &["x", "y", "z"]),
            Self::ContactWrench(body) => {
                let numbers = ["torque x", "torque y", "torque z", "force x", "force y", "force z"];
                of(model.name_of(Point::Body(*body)), &numbers)
            }
            Self::Phase => vec![key.to_owned()],
        }
    }

    /// Writes its numbers; `phase` is the share of the episode that has passed.
    pub(crate) fn write(&self, data: &Data, phase: f64, out: &mut [f32]) {
        match self {
            Self::Qpos(range) => copy(&data.qpos()[range.clone()], out),
            Self::Qvel(range) => copy(&data.qvel()[range.clone()], out),
            Self::Position(point) => copy(&position(data, *point), out),
            Self::Velocity(point) => copy(&velocity(data, *point), out),
            Self::ContactWrench(body) => copy(&data.cfrc_ext()[*body], out),
            Self::Phase => out[0] = phase as f32,
        }
    }
}

/// Looks up the parts of an observation, in their order.
///
/// # Errors
/// If the model has no such thing (lists what it has), or nothing is observed.
pub(crate) fn resolve(parts: &[ObservationPart], model: &Model) -> Result<Vec<Reading>> {
    let mut readings = Vec::new();
    for part in parts {
        match part {
            ObservationPart::Qpos(names) => {
                let joints = joints(names, model).map_err(|error| error.during("qpos"))?;
                joints.into_iter().for_each(|joint| add(&mut readings, Reading::Qpos(joint.qpos)));
            }
            ObservationPart::Qvel(names) => {
                let joints = joints(names, model).map_err(|error| error.during("qvel"))?;
                joints.into_iter().for_each(|joint| add(&mut readings, Reading::Qvel(joint.qvel)));
            }
            ObservationPart::Position(names) => {
                for name in names {
                    readings.push(Reading::Position(
                        model.point(name).map_err(|error| error.during("position"))?,
                    ));
                }
            }
            ObservationPart::Velocity(names) => {
                for name in names {
                    readings.push(Reading::Velocity(
                        model.point(name).map_err(|error| error.during("velocity"))?,
                    ));
                }
            }
            ObservationPart::ContactWrench(names) => {
                for name in names {
                    let body = model.id(Kind::Body, name).map_err(|error| error.during("contact_wrench"))?;
                    readings.push(Reading::ContactWrench(body));
                }
            }
            ObservationPart::Phase => readings.push(Reading::Phase),
        }
    }
    if readings.is_empty() {
        return Err(Error::bad_config(
            "an agent must see something; parts are: qpos, qvel, position, velocity, contact_wrench, phase",
        ));
    }
    Ok(readings)
}

/// What is observed, by name, such as `qpos knee`, each with how many numbers it has, in the order of the parts.
///
/// # Errors
/// As [`resolve`].
pub(crate) fn names(parts: &[ObservationPart], model: &Model) -> Result<Vec<(String, usize)>> {
    let mut named = Vec::new();
    let each = |names: &[String], what: &str, width| {
        names.iter().map(|name| (format!("{what} {name}"), width)).collect::<Vec<_>>()
    };
    for part in parts {
        match part {
            ObservationPart::Qpos(names) => {
                let joints = joints(names, model)?.into_iter();
                named.extend(joints.map(|joint| (format!("qpos {}", joint.name), joint.qpos.len())));
            }
            ObservationPart::Qvel(names) => {
                let joints = joints(names, model)?.into_iter();
                named.extend(joints.map(|joint| (format!("qvel {}", joint.name), joint.qvel.len())));
            }
            ObservationPart::Position(names) => named.extend(each(names, "position", 3)),
            ObservationPart::Velocity(names) => named.extend(each(names, "velocity", 3)),
            ObservationPart::ContactWrench(names) => named.extend(each(names, "contact_wrench", 6)),
            ObservationPart::Phase => named.push(("phase".to_owned(), 1)),
        }
    }
    Ok(named)
}

/// Appends a reading, joined to the one before where the two are neighbors in the state.
fn add(readings: &mut Vec<Reading>, reading: Reading) {
    match (readings.last_mut(), &reading) {
        (Some(Reading::Qpos(last)), Reading::Qpos(next)) if last.end == next.start => last.end = next.end,
        (Some(Reading::Qvel(last)), Reading::Qvel(next)) if last.end == next.start => last.end = next.end,
        _ => readings.push(reading),
    }
}

fn joints(names: &Names, model: &Model) -> Result<Vec<Joint>> {
    match names {
        Names::All => Ok(model.joints()),
        Names::Only(names) => names.iter().map(|name| model.joint(name)).collect(),
        Names::Except(names) => {
            names.iter().try_for_each(|name| model.joint(name).map(drop))?;
            Ok(model.joints().into_iter().filter(|joint| !names.contains(&joint.name)).collect())
        }
    }
}

fn copy(from: &[f64], to: &mut [f32]) {
    to.iter_mut().zip(from).for_each(|(to, from)| *to = *from as f32);
}
