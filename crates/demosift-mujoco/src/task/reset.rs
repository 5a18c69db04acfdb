//! How an episode starts: a pose and velocity for each variant, and noise on top of it.

use std::collections::BTreeMap;

use demosift::basics::seed::{Rng, Seed};
use demosift::{Error, Result};
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

use crate::model::{Joint, Kind, Model};
use crate::task::measurement::Data;
use crate::task::task_file::{self, Values};

/// Initial states, one for each variant, and the noise that all share.
#[derive(Debug)]
pub(crate) struct Reset {
    states: Vec<State>,
    beside: Option<Beside>,
    qpos_noise: Option<Noise>,
    qvel_noise: Option<Noise>,
}

#[derive(Clone, Debug)]
struct State {
    qpos: Vec<f64>,
    qvel: Vec<f64>,
}

/// What a keyframe sets beside positions and velocities.
#[derive(Debug)]
struct Beside {
    activations: Vec<f64>,
    /// Where the bodies are that nothing moves but the user.
    mocap_positions: Vec<[f64; 3]>,
    mocap_quaternions: Vec<[f64; 4]>,
}

#[derive(Debug)]
struct Noise {
    shape: Shape,
    /// Which numbers of the state it moves.
    addresses: Vec<usize>,
}

#[derive(Clone, Copy, Debug)]
enum Shape {
    /// Evenly within this half width.
    Uniform(f64),
    /// With this standard deviation.
    Normal(f64),
}

impl Reset {
    /// Looks up the names in `[reset]` and `[[variant]]`.
    ///
    /// # Errors
    /// If a joint or keyframe is unknown (lists what there is), a joint gets too many or too few numbers, or a noise is
    /// not one positive number.
    pub(crate) fn resolve(file: &task_file::TaskFile, model: &Model) -> Result<Self> {
        let stage = |error: Error| error.during("reset");
        let start = State::initial(&file.reset, model).map_err(stage)?;
        let plain = std::slice::from_ref(&start).to_vec();
        let states = file.variant.iter().map(|variant| {
            let mut state = start.clone();
            state
                .set(&variant.qpos, &variant.qvel, model)
                .map_err(|error| error.during(&format!("variant '{}'", variant.name)))?;
            Ok(state)
        });
        let states = states.collect::<Result<Vec<_>>>()?;
        let joints = model.joints();
        let noise =
            |noise: &Option<task_file::Noise>, key, addresses: fn(&Joint) -> std::ops::Range<usize>| {
                let noise =
                    noise.as_ref().map(|noise| Noise::resolve(noise, model, &joints, addresses)).transpose();
                noise.map_err(|error| stage(error.during(key)))
            };
        Ok(Self {
            states: if states.is_empty() { plain } else { states },
            beside: Beside::of(&file.reset, model).map_err(stage)?,
            qpos_noise: noise(&file.reset.qpos_noise, "qpos_noise", |joint| joint.qpos.clone())?,
            qvel_noise: noise(&file.reset.qvel_noise, "qvel_noise", |joint| joint.qvel.clone())?,
        })
    }

    /// Whether a variant always starts in the same state.
    pub(crate) fn is_noiseless(&self) -> bool {
        self.qpos_noise.is_none() && self.qvel_noise.is_none()
    }

    /// The position in which a variant starts, without noise.
    pub(crate) fn start(&self, variant: usize) -> &[f64] {
        &self.states[variant].qpos
    }

    /// Sets what a state holds beside position and velocity, after MuJoCo has reset all of it.
    pub(crate) fn write_beside(&self, data: &mut Data) {
        let Some(beside) = &self.beside else { return };
        data.act_mut().copy_from_slice(&beside.activations);
        data.mocap_pos_mut().copy_from_slice(&beside.mocap_positions);
        data.mocap_quat_mut().copy_from_slice(&beside.mocap_quaternions);
    }

    /// Fills position and velocity of a variant's start.
    pub(crate) fn write(&self, variant: usize, seed: Seed, qpos: &mut [f64], qvel: &mut [f64]) {
        let state = &self.states[variant];
        let mut rng = seed.into_rng();
        for (to, from, noise) in
            [(qpos, &state.qpos, &self.qpos_noise), (qvel, &state.qvel, &self.qvel_noise)]
        {
            to.copy_from_slice(from);
            if let Some(noise) = noise {
                noise.addresses.iter().for_each(|address| to[*address] += noise.shape.draw(&mut rng));
            }
        }
    }
}

impl State {
    fn initial(file: &task_file::Reset, model: &Model) -> Result<Self> {
        let mujoco = model.mujoco();
        let mut state = Self { qpos: mujoco.qpos0().to_vec(), qvel: vec![0.0; mujoco.nv() as usize] };
        if let Some(name) = &file.keyframe {
            let key = model.id(Kind::Key, name)?;
            let (nq, nv) = (state.qpos.len(), state.qvel.len());
            state.qpos.copy_from_slice(&mujoco.key_qpos()[key * nq..][..nq]);
            state.qvel.copy_from_slice(&mujoco.key_qvel()[key * nv..][..nv]);
        }
        state.set(&file.qpos, &file.qvel, model)?;
        Ok(state)
    }

    fn set(
        &mut self,
        qpos: &BTreeMap<String, Values>,
        qvel: &BTreeMap<String, Values>,
        model: &Model,
    ) -> Result<()> {
        for (name, values) in qpos {
            let range = model.joint(name).map_err(|error| error.during("qpos"))?.qpos;
            fill(&mut self.qpos[range], name, "qpos", values)?;
        }
        for (name, values) in qvel {
            let range = model.joint(name).map_err(|error| error.during("qvel"))?.qvel;
            fill(&mut self.qvel[range], name, "qvel", values)?;
        }
        Ok(())
    }
}

impl Beside {
    fn of(file: &task_file::Reset, model: &Model) -> Result<Option<Self>> {
        let Some(name) = &file.keyframe else { return Ok(None) };
        let key = model.id(Kind::Key, name)?;
        let mujoco = model.mujoco();
        let (activations, bodies) = (mujoco.na() as usize, mujoco.nmocap() as usize);
        let positions = &mujoco.key_mpos()[3 * key * bodies..][..3 * bodies];
        let quaternions = &mujoco.key_mquat()[4 * key * bodies..][..4 * bodies];
        Ok(Some(Self {
            activations: mujoco.key_act()[key * activations..][..activations].to_vec(),
            mocap_positions: positions.as_chunks().0.to_vec(),
            mocap_quaternions: quaternions.as_chunks().0.to_vec(),
        }))
    }
}

fn fill(to: &mut [f64], joint: &str, key: &str, Values(values): &Values) -> Result<()> {
    if values.len() != to.len() || values.iter().any(|value| !value.is_finite()) {
        return Err(Error::bad_config(format!(
            "{key}.{joint}: this joint takes {} finite number(s), got {values:?}",
            to.len()
        )));
    }
    to.copy_from_slice(values);
    Ok(())
}

impl Noise {
    fn resolve(
        file: &task_file::Noise,
        model: &Model,
        joints: &[Joint],
        addresses: fn(&Joint) -> std::ops::Range<usize>,
    ) -> Result<Self> {
        let shape = match (file.uniform, file.normal) {
            (Some(width), None) if width > 0.0 && width.is_finite() => Shape::Uniform(width),
            (None, Some(deviation)) if deviation > 0.0 && deviation.is_finite() => Shape::Normal(deviation),
            _ => {
                return Err(Error::bad_config(
                    "noise is { uniform = half width } or { normal = standard deviation }, a positive number",
                ));
            }
        };
        file.except.iter().try_for_each(|name| model.joint(name).map(drop))?;
        let moved = joints.iter().filter(|joint| !file.except.contains(&joint.name));
        Ok(Self { shape, addresses: moved.flat_map(addresses).collect() })
    }
}

impl Shape {
    fn draw(self, rng: &mut Rng) -> f64 {
        match self {
            Self::Uniform(width) => rng.random_range(-width..width),
            Self::Normal(deviation) => {
                let normal: f64 = StandardNormal.sample(rng);
                deviation * normal
            }
        }
    }
}
