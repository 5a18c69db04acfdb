//! Loading an MJCF model, and finding its parts by name.
//!
//! Names are looked up when a task is loaded, never while it plays.
//! Where a name is unknown, the error lists the names there are.

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use demosift::{Error, Result};
use mujoco_rs::prelude::{MjModel, MjtEq, MjtIntegrator, MjtJoint, MjtObjBase, MjtTrn, MjtWrap};
use mujoco_rs::wrappers::mj_auxiliary::MjVfs;

use crate::names::instead;
use crate::quiet::{complaint, quiet};

/// The largest picture that can be rendered, pixels; MuJoCo wants to know when the model is loaded.
pub const LARGEST_PICTURE: (usize, usize) = (1920, 1080);

/// A compiled MuJoCo model, shared by all environments of a task.
#[derive(Clone, Debug)]
pub struct Model(Arc<MjModel>);

/// A joint and the numbers of the state that belong to it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Joint {
    pub(crate) name: String,
    pub(crate) qpos: Range<usize>,
    pub(crate) qvel: Range<usize>,
}

impl Joint {
    /// What each of its positions is, such as `qpos elbow` or `qpos ball quaternion w`.
    pub(crate) fn columns_of_qpos(&self) -> Vec<String> {
        let quaternion = ["quaternion w", "quaternion x", "quaternion y", "quaternion z"];
        match self.qpos.len() {
            1 => vec![format!("qpos {}", self.name)],
            4 => quaternion.iter().map(|part| format!("qpos {} {part}", self.name)).collect(),
            _ => ["x", "y", "z"]
                .iter()
                .chain(&quaternion)
                .map(|part| format!("qpos {} {part}", self.name))
                .collect(),
        }
    }

    /// What each of its velocities is, such as `qvel elbow` or `qvel ball turn x`.
    pub(crate) fn columns_of_qvel(&self) -> Vec<String> {
        let all = ["x", "y", "z", "turn x", "turn y", "turn z"];
        match self.qvel.len() {
            1 => vec![format!("qvel {}", self.name)],
            // The three of a ball joint are the last ones of a free joint.
            count => {
                all[all.len() - count..].iter().map(|part| format!("qvel {} {part}", self.name)).collect()
            }
        }
    }
}

/// A joint of one number: a hinge, rad, or a slide, m.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Axis {
    pub(crate) name: String,
    pub(crate) is_hinge: bool,
    /// Where its position and its velocity stand in the state.
    pub(crate) qpos: usize,
    pub(crate) qvel: usize,
    /// Where its position may be, if the model limits it.
    pub(crate) range: Option<[f64; 2]>,
}

/// A place in the model that moves with a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Point {
    Body(usize),
    Geom(usize),
    Site(usize),
}

/// MuJoCo's reason against a model, with what most often is the cause.
fn rejected(said: &str) -> Error {
    let error = Error::bad_input(format!("MuJoCo rejects the model: {said}"));
    if said.contains("opening file") || said.contains("Error opening") || said.contains("not found in asset")
    {
        error.with_hint(
            "the model names a file that is not there: meshes lie in the folder that <compiler meshdir=\"...\"/> names, textures in \
             texturedir, relative to the model; copy the folder of assets, too",
        )
    } else if said.contains("plugin") {
        error
            .with_hint("plugins of MuJoCo are not loaded; wanted a model without them, or with them replaced")
    } else {
        error
    }
}

/// What a name can belong to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Kind {
    Body,
    Joint,
    Geom,
    Site,
    Camera,
    Key,
    Actuator,
}

impl Kind {
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Body => "body",
            Self::Joint => "joint",
            Self::Geom => "geom",
            Self::Site => "site",
            Self::Camera => "camera",
            Self::Key => "keyframe",
            Self::Actuator => "actuator",
        }
    }

    /// Whether a task file may call one of them `body 4` or the like where it has no name of its own.
    fn may_be_nameless(self) -> bool {
        matches!(self, Self::Body | Self::Joint | Self::Geom | Self::Site)
    }
}

impl Model {
    /// Loads an MJCF file.
    ///
    /// # Errors
    /// If there is no such file, or MuJoCo rejects it (with MuJoCo's own reason).
    pub fn from_file(path: &Path) -> Result<Self> {
        quiet();
        if !path.is_file() {
            let beside = models_beside(path);
            return Err(Error::bad_input(format!("there is no such file; its folder has: {beside}")).at(path));
        }
        if path.to_str().is_none_or(|path| path.contains('\0')) {
            return Err(Error::bad_input("MuJoCo opens only paths that are valid UTF-8").at(path));
        }
        Self::finish(MjModel::from_xml(path)).map_err(|error| match path.to_str().and_then(complaint) {
            Some(said) => rejected(&said).at(path),
            None => error.at(path),
        })
    }

    /// Loads the MJCF file `main` out of `files`, pairs of name and text, which may include each other.
    ///
    /// # Errors
    /// If `main` is not among them, or MuJoCo rejects it.
    pub fn from_texts(main: &str, files: &[(&str, &str)]) -> Result<Self> {
        quiet();
        if !files.iter().any(|(name, _)| *name == main) {
            let names: Vec<_> = files.iter().map(|(name, _)| *name).collect();
            return Err(Error::bad_input(format!(
                "no model file is called '{main}'; there are: {}",
                names.join(", ")
            )));
        }
        let mut folder = MjVfs::new();
        for (name, text) in files {
            folder
                .add_from_buffer(name, text.as_bytes())
                .map_err(|error| Error::simulation(format!("MuJoCo cannot take the file {name}: {error}")))?;
        }
        Self::finish(MjModel::from_xml_vfs(main, &folder))
    }

    fn finish(loaded: std::result::Result<MjModel, mujoco_rs::error::MjModelError>) -> Result<Self> {
        let mut model = loaded.map_err(|error| rejected(&error.to_string()))?;
        let screen = &mut model.vis_mut().global;
        screen.offwidth = screen.offwidth.max(LARGEST_PICTURE.0 as i32);
        screen.offheight = screen.offheight.max(LARGEST_PICTURE.1 as i32);
        Ok(Self(Arc::new(model)))
    }

    /// The model as MuJoCo's binding knows it.
    pub fn mujoco(&self) -> &Arc<MjModel> {
        &self.0
    }

    /// Names of the cameras.
    pub fn cameras(&self) -> Vec<String> {
        self.names(Kind::Camera).into_iter().flatten().collect()
    }

    /// Why nobody can look through one of its cameras, if nobody can.
    pub fn lacks_camera(&self) -> Option<&'static str> {
        match (self.0.ncam(), &self.cameras()[..]) {
            (0, _) => Some("has no camera"),
            (_, []) => Some("has no camera with a name"),
            _ => None,
        }
    }

    /// What has no name, such as `geom 3`: bodies, joints, geoms, sites, cameras and actuators.
    pub fn nameless(&self) -> Vec<String> {
        let kinds = [Kind::Body, Kind::Joint, Kind::Geom, Kind::Site, Kind::Camera, Kind::Actuator];
        let nameless = kinds.into_iter().flat_map(|kind| {
            let names = self.names(kind).into_iter().enumerate();
            names.filter(|(_, name)| name.is_none()).map(move |(id, _)| format!("{} {id}", kind.word()))
        });
        nameless.collect()
    }

    /// What decides how a state goes on beside positions and velocities, where something does.
    pub(crate) fn hidden_state(&self) -> Option<&'static str> {
        if self.0.na() > 0 {
            return Some("activations of actuators");
        }
        let is_delayed = self.0.actuator_history().iter().any(|[samples, _]| *samples > 0);
        is_delayed.then_some("controls that act later")
    }

    /// Simulated seconds of one step of the physics.
    pub fn timestep_secs(&self) -> f64 {
        self.0.opt().timestep
    }

    /// Whether a step can be cut after the stage that knows position and velocity.
    pub(crate) fn has_split_step(&self) -> bool {
        let one_stage =
            [MjtIntegrator::mjINT_EULER, MjtIntegrator::mjINT_IMPLICIT, MjtIntegrator::mjINT_IMPLICITFAST];
        one_stage.iter().any(|known| self.0.opt().integrator == *known as i32)
    }

    /// The names of all things of a kind, by id; `None` where one has no name.
    pub(crate) fn names(&self, kind: Kind) -> Vec<Option<String>> {
        let (object, count) = match kind {
            Kind::Body => (MjtObjBase::mjOBJ_BODY, self.0.nbody()),
            Kind::Joint => (MjtObjBase::mjOBJ_JOINT, self.0.njnt()),
            Kind::Geom => (MjtObjBase::mjOBJ_GEOM, self.0.ngeom()),
            Kind::Site => (MjtObjBase::mjOBJ_SITE, self.0.nsite()),
            Kind::Camera => (MjtObjBase::mjOBJ_CAMERA, self.0.ncam()),
            Kind::Key => (MjtObjBase::mjOBJ_KEY, self.0.nkey()),
            Kind::Actuator => (MjtObjBase::mjOBJ_ACTUATOR, self.0.nactuator()),
        };
        let name = |id| self.0.id_to_name(object, id).filter(|name| !name.is_empty()).map(str::to_owned);
        (0..count as usize).map(name).collect()
    }

    /// The id of the thing with this name, or without one and called `body 4` or the like.
    ///
    /// # Errors
    /// If there is none; lists the names there are.
    pub(crate) fn id(&self, kind: Kind, name: &str) -> Result<usize> {
        let names = self.names(kind);
        let has_it = names.iter().position(|known| known.as_deref() == Some(name));
        has_it.or_else(|| self.nameless_id(kind, name)).ok_or_else(|| {
            let known = self.known(kind);
            let all_are_nameless = known.is_empty() && !names.is_empty();
            let error = unknown(&[kind], name, known);
            match all_are_nameless {
                true => {
                    error.with_hint(format!("no {} of the model has a name; give it one there", kind.word()))
                }
                false => error,
            }
        })
    }

    /// The id of a thing without a name that goes by `body 4` or the like.
    fn nameless_id(&self, kind: Kind, name: &str) -> Option<usize> {
        if !kind.may_be_nameless() {
            return None;
        }
        let names = self.names(kind);
        let is_it = |id: usize| names[id].is_none() && name == format!("{} {id}", kind.word());
        (0..names.len()).find(|id| is_it(*id))
    }

    /// What [`Model::id`] finds: names, and `body 4` or the like for what has none.
    fn known(&self, kind: Kind) -> Vec<String> {
        if kind.may_be_nameless() {
            self.called(kind)
        } else {
            self.names(kind).into_iter().flatten().collect()
        }
    }

    /// All joints in order of their ids, which is the order of their numbers in the state.
    pub(crate) fn joints(&self) -> Vec<Joint> {
        let names = self.called(Kind::Joint).into_iter().enumerate();
        names
            .map(|(id, name)| {
                let (positions, velocities) = match self.0.jnt_type()[id] {
                    MjtJoint::mjJNT_FREE => (7, 6),
                    MjtJoint::mjJNT_BALL => (4, 3),
                    MjtJoint::mjJNT_SLIDE | MjtJoint::mjJNT_HINGE => (1, 1),
                };
                let (qpos, qvel) = (self.0.jnt_qposadr()[id] as usize, self.0.jnt_dofadr()[id] as usize);
                Joint { name, qpos: qpos..qpos + positions, qvel: qvel..qvel + velocities }
            })
            .collect()
    }

    /// All hinges and slides, in order of their ids.
    pub(crate) fn axes(&self) -> Vec<Axis> {
        let kinds = self.0.jnt_type().iter().zip(self.0.jnt_limited()).zip(self.0.jnt_range());
        let joints = self.joints().into_iter().zip(kinds);
        joints
            .filter(|(joint, _)| joint.qpos.len() == 1)
            .map(|(Joint { name, qpos, qvel }, ((kind, limited), range))| Axis {
                name,
                is_hinge: *kind == MjtJoint::mjJNT_HINGE,
                qpos: qpos.start,
                qvel: qvel.start,
                range: limited.then_some(*range),
            })
            .collect()
    }

    /// The name of a place; `body 3` or the like where it has none.
    pub(crate) fn name_of(&self, point: Point) -> String {
        let (kind, id) = match point {
            Point::Body(id) => (Kind::Body, id),
            Point::Geom(id) => (Kind::Geom, id),
            Point::Site(id) => (Kind::Site, id),
        };
        self.called(kind)[id].clone()
    }

    /// The names of all things of a kind, by id; `geom 3` or the like for one without.
    pub(crate) fn called(&self, kind: Kind) -> Vec<String> {
        let names = self.names(kind).into_iter().enumerate();
        names.map(|(id, name)| name.unwrap_or_else(|| format!("{} {id}", kind.word()))).collect()
    }

    /// Which numbers of the position only say where on the floor something stands, which the physics does not ask: x and y of free
    /// joints, and slides that carry a body of the world over it.
    pub(crate) fn places(&self) -> Vec<usize> {
        let joints = self.0.jnt_type().iter().zip(self.0.jnt_qposadr()).enumerate();
        let numbers = joints.map(|(joint, (kind, at))| {
            let count = match kind {
                MjtJoint::mjJNT_SLIDE if self.is_level(joint) && self.is_loose(joint) => 1,
                MjtJoint::mjJNT_FREE => 2,
                MjtJoint::mjJNT_SLIDE | MjtJoint::mjJNT_BALL | MjtJoint::mjJNT_HINGE => 0,
            };
            *at as usize..*at as usize + count
        });
        numbers.flatten().collect()
    }

    /// Whether a slide moves a body of the world, and no other one, sideways.
    fn is_level(&self, joint: usize) -> bool {
        const LEVEL: f64 = 1e-6;
        let body = self.0.jnt_bodyid()[joint] as usize;
        let [w, x, y, z] = self.0.body_quat()[body];
        let [along, aside, up] = self.0.jnt_axis()[joint];
        let rises = 2.0 * (x * z - w * y) * along
            + 2.0 * (y * z + w * x) * aside
            + (1.0 - 2.0 * (x * x + y * y)) * up;
        // What a joint before it turns, it moves elsewhere.
        let before = &self.0.jnt_type()[self.0.body_jntadr()[body] as usize..joint];
        let is_turned = before.iter().any(|kind| *kind != MjtJoint::mjJNT_SLIDE);
        self.0.body_parentid()[body] == 0 && !is_turned && rises.abs() < LEVEL
    }

    /// Whether nothing holds a joint anywhere: no limit, spring, actuator, tendon or equality.
    fn is_loose(&self, joint: usize) -> bool {
        let is_it = |id: &i32| *id as usize == joint;
        let is_sprung = self.0.jnt_stiffness()[joint] != 0.0
            || self.0.jnt_stiffnesspoly()[joint].iter().any(|factor| *factor != 0.0);
        let is_driven =
            self.0.actuator_trntype().iter().zip(self.0.actuator_trnid()).any(|(kind, [id, _])| {
                matches!(kind, MjtTrn::mjTRN_JOINT | MjtTrn::mjTRN_JOINTINPARENT) && is_it(id)
            });
        let mut of_tendons = self.0.wrap_type().iter().zip(self.0.wrap_objid());
        let is_tied = of_tendons.any(|(kind, id)| *kind == MjtWrap::mjWRAP_JOINT && is_it(id));
        let pairs = self.0.eq_obj1id().iter().zip(self.0.eq_obj2id());
        let is_equal = self
            .0
            .eq_type()
            .iter()
            .zip(pairs)
            .any(|(kind, (one, other))| *kind == MjtEq::mjEQ_JOINT && (is_it(one) || is_it(other)));
        !(self.0.jnt_limited()[joint] || is_sprung || is_driven || is_tied || is_equal)
    }

    /// The joint with this name.
    ///
    /// # Errors
    /// If there is none; lists the joints there are.
    pub(crate) fn joint(&self, name: &str) -> Result<Joint> {
        let id = self.id(Kind::Joint, name)?;
        Ok(self.joints().swap_remove(id))
    }

    /// The body with this name; it may have `body:` before it.
    ///
    /// # Errors
    /// If there is none; lists the bodies there are.
    pub(crate) fn body(&self, name: &str) -> Result<usize> {
        self.id(Kind::Body, name.strip_prefix("body:").unwrap_or(name))
    }

    /// The site, geom or body with this name; `site:`, `geom:` or `body:` before it says which.
    ///
    /// # Errors
    /// If nothing has the name, or more than one thing.
    pub(crate) fn point(&self, name: &str) -> Result<Point> {
        // A name may hold a colon itself, such as that of a part which was attached under a prefix.
        match name.split_once(':') {
            Some(("site", name)) => return self.id(Kind::Site, name).map(Point::Site),
            Some(("geom", name)) => return self.id(Kind::Geom, name).map(Point::Geom),
            Some(("body", _)) => return self.body(name).map(Point::Body),
            _ => {}
        }
        let found: Vec<Point> = [
            self.id(Kind::Site, name).ok().map(Point::Site),
            self.id(Kind::Geom, name).ok().map(Point::Geom),
            self.id(Kind::Body, name).ok().map(Point::Body),
        ]
        .into_iter()
        .flatten()
        .collect();
        match found[..] {
            [point] => Ok(point),
            [] => {
                let kinds = [Kind::Site, Kind::Geom, Kind::Body];
                let names = kinds.iter().flat_map(|kind| self.known(*kind));
                Err(unknown(&kinds, name, names.collect()))
            }
            _ => Err(Error::bad_config(format!(
                "'{name}' names more than one thing; write site:{name}, geom:{name} or body:{name}"
            ))),
        }
    }

    /// Which geoms a name means, by id: the geom with this name, or all geoms of the body with it.
    ///
    /// # Errors
    /// As [`Model::point`]; also for a site, which touches nothing, and a body without geoms.
    pub(crate) fn geoms(&self, name: &str) -> Result<Box<[bool]>> {
        let of_body = self.0.geom_bodyid();
        let chosen: Box<[bool]> = match self.point(name)? {
            Point::Geom(chosen) => (0..of_body.len()).map(|geom| geom == chosen).collect(),
            Point::Body(body) => of_body.iter().map(|owner| *owner as usize == body).collect(),
            Point::Site(_) => {
                let message = format!("'{name}' is a site, and sites touch nothing; name a geom or a body");
                return Err(Error::bad_config(message));
            }
        };
        if chosen.contains(&true) {
            return Ok(chosen);
        }
        Err(Error::bad_config(format!("the body '{name}' has no geoms, so it touches nothing")))
    }

    /// What each control is called, in order: as its actuator, or `servo[0]`, `servo[1]` where that takes several.
    pub(crate) fn controls(&self) -> Vec<String> {
        let mut controls = vec![String::new(); self.0.nu() as usize];
        let places = self.0.actuator_ctrladr().iter().zip(self.0.actuator_ctrlnum());
        for (name, (first, count)) in self.called(Kind::Actuator).into_iter().zip(places) {
            for number in 0..*count {
                let called = if *count == 1 { name.clone() } else { format!("{name}[{number}]") };
                controls[(first + number) as usize] = called;
            }
        }
        controls
    }

    /// The range of each control.
    ///
    /// # Errors
    /// If an actuator has no `ctrlrange`: then [−1, 1] would mean nothing.
    pub(crate) fn control_ranges(&self) -> Result<Vec<[f64; 2]>> {
        let limited = self.0.actuator_ctrllimited();
        let without = self.controls().into_iter().zip(limited).filter(|(_, limited)| !**limited);
        let without: Vec<String> = without.map(|(name, _)| name).collect();
        if let [first, rest @ ..] = &without[..] {
            let others =
                if rest.is_empty() { String::new() } else { format!(" (nor have: {})", rest.join(", ")) };
            let error = Error::bad_input(format!(
                "the actuator {first} has no ctrlrange{others}; every actuator needs one, such as ctrlrange=\"-1 1\", since \
                 actions in [-1, 1] are scaled to it"
            ));
            let takes_several = self.0.actuator_ctrlnum().iter().any(|count| *count > 1);
            return Err(match takes_several {
                true => error.with_hint(
                    "an actuator of several inputs takes a range for each, such as posrange, velrange and ffrange of <pid>",
                ),
                false => error,
            });
        }
        if limited.is_empty() {
            return Err(Error::bad_input(
                "the model has no actuators that take a control; an agent needs at least one",
            ));
        }
        Ok(self.0.actuator_ctrlrange().to_vec())
    }
}

/// The MJCF files in the folder of a path.
fn models_beside(path: &Path) -> String {
    // That of a bare name is called "", and is the one that the user stands in.
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let mut names: Vec<String> = names.filter(|name| name.ends_with(".xml")).collect();
    names.sort();
    if names.is_empty() { "no .xml file".to_owned() } else { names.join(", ") }
}

fn unknown(kinds: &[Kind], name: &str, all: Vec<String>) -> Error {
    // A geom is often called as its body is.
    let mut known: Vec<String> = Vec::with_capacity(all.len());
    all.into_iter().for_each(|one| {
        if !known.contains(&one) {
            known.push(one)
        }
    });
    let kinds: Vec<_> = kinds.iter().map(|kind| kind.word()).collect();
    let instead = instead(name, "the model", &known);
    Error::bad_config(format!("no {} is called '{name}'; {instead}", kinds.join(" or ")))
}
