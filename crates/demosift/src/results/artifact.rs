//! How each result is written and read, with a version each.
//!
//! Results for people are JSON; policies and discriminators are safetensors with the shapes and the filter inside;
//! each policy is also written as ONNX, to be played without demosift;
//! checkpoints and a demonstrator's stages, which are for the next process of the same version only, are compact binary.

mod in_few_lines;
pub mod onnx;
#[cfg(feature = "schema")]
pub mod schema;

use in_few_lines::{Nulls, in_few_lines};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use crate::basics::error::{Error, Result};
use crate::basics::ledger::Ledger;
use crate::basics::observer::Snapshot;
use crate::basics::seal;
use crate::data::demonstration::DemoId;
use crate::data::likeness::TrainedOn;
use crate::data::observation_filter::ObservationFilter;
use crate::learning::adapt::Learner;
use crate::learning::gail::Discriminator;
use crate::math::nn::mlp::Mlp;
use crate::results::data_only::DataOnly;
use crate::results::panel::Panel;
use crate::results::uncertainty::Uncertainty;
use crate::stages::demonstrator::Stage;
use crate::stages::imitate::{CurvePoint, LearningCurve};
use crate::stages::judge::{AdaptedPolicy, Judged, ScoreTable, Suitability};
use crate::stages::method::Spent;
use crate::stages::referee::{ByTrainer, Verdict};
use crate::stages::select::{Ranking, Subset};
use crate::stages::subset_selection::Weighing;
use crate::world::environment::EnvVariant;
use crate::world::policy::Policy;

/// Changes when a file of this version could no longer be read; 7 since batches may score an imitation, 6 since both judges can decide, 5 since stages say what they were computed with, 4 since `panel.json` and `uncertainty.json` grow with
/// the set and not with its square, 3 since each file contains its checksum.
///
/// It is the version of JSON and of checkpoints, and so of a run folder.
pub const FORMAT_VERSION: u32 = 7;

/// The same for tensors, whose layout has not changed, so that policies of earlier runs can still be played.
const TENSORS_VERSION: u32 = 1;

/// Under which key a safetensors file holds that version.
const VERSION_KEY: &str = "demosift_format";

/// A result of the flow that a ledger can store; `part` tells several of a kind apart.
pub trait Artifact: Sized {
    /// Stores it.
    fn store(&self, ledger: &mut dyn Ledger, part: &str) -> Result<()>;
    /// The result, if it was stored; the error says what is wrong with its file.
    fn recall(ledger: &dyn Ledger, part: &str) -> Result<Option<Self>>;
}

/// The first result of a name that fits, of all who work on the run: one of another trainer, say, may lie before it.
///
/// # Errors
/// Those of [`Artifact::recall`].
pub fn recall_fitting<T: Artifact>(
    ledger: &dyn Ledger,
    part: &str,
    fits: impl Fn(&T) -> bool,
) -> Result<Option<T>> {
    let each = ledger.each()?;
    if each.is_empty() {
        return Ok(T::recall(ledger, part)?.filter(fits));
    }
    for one in each {
        if let Some(found) = T::recall(one.as_ref(), part)?.filter(&fits) {
            return Ok(Some(found));
        }
    }
    Ok(None)
}

/// Reads a result from JSON; `what` names it in errors.
fn recall_json<T: DeserializeOwned>(ledger: &dyn Ledger, name: &str) -> Result<Option<T>> {
    let Some(bytes) = ledger.recall(name)? else { return Ok(None) };
    let versioned: Versioned<T> = serde_json::from_slice(&seal::of_json(&bytes, name)?)
        .map_err(|error| Error::bad_input(format!("{name} cannot be read: {error}")))?;
    check_version(versioned.version, FORMAT_VERSION, name)?;
    Ok(Some(versioned.content))
}

fn store_json<T: Serialize>(ledger: &mut dyn Ledger, name: &str, content: &T) -> Result<()> {
    store_json_with(ledger, name, content, Nulls::Written)
}

fn store_json_with<T: Serialize>(
    ledger: &mut dyn Ledger,
    name: &str,
    content: &T,
    nulls: Nulls,
) -> Result<()> {
    let versioned = Versioned { version: FORMAT_VERSION, content };
    ledger.store(name, &seal::to_json_with(&versioned, |text| in_few_lines(text, nulls)))
}

#[derive(Serialize, Deserialize)]
struct Versioned<T> {
    version: u32,
    #[serde(flatten)]
    content: T,
}

fn check_version(found: u32, read: u32, name: &str) -> Result<()> {
    if found == read {
        return Ok(());
    }
    Err(Error::bad_input(format!("{name} has format version {found}; this demosift reads version {read}")))
}

macro_rules! json_artifact {
    ($($noun:ty => $name:literal),*) => {$(
        impl Artifact for $noun {
            fn store(&self, ledger: &mut dyn Ledger, _: &str) -> Result<()> {
                store_json(ledger, $name, self)
            }

            fn recall(ledger: &dyn Ledger, _: &str) -> Result<Option<Self>> {
                recall_json(ledger, $name)
            }
        }
    )*};
}

json_artifact!(
    Ranking => "ranking.json",
    Uncertainty => "uncertainty.json",
    Subset => "subset.json",
    DataOnly => "data_only.json",
    TrainedOn => "trained_on.json",
    Weighing => "weights.json",
    Panel => "panel.json",
    Verdict => "verdict.json"
);

/// What a stage spent; the part is its name.
impl Artifact for Spent {
    fn store(&self, ledger: &mut dyn Ledger, part: &str) -> Result<()> {
        store_json(ledger, &format!("spent_{part}.json"), self)
    }

    fn recall(ledger: &dyn Ledger, part: &str) -> Result<Option<Self>> {
        recall_json(ledger, &format!("spent_{part}.json"))
    }
}

/// S of all by one judge, whose name is the part, as JSON, and beside it the adapted policies; those of somebody else's trainer
/// are not ours to store.
impl Artifact for Judged {
    fn store(&self, ledger: &mut dyn Ledger, judge: &str) -> Result<()> {
        let tensors = self.adapted.iter().flat_map(|AdaptedPolicy { demo, variant, policy }| {
            policy_tensors(&adapted_prefix(*variant, *demo), policy)
        });
        if self.scores.trainer.is_none() {
            ledger.store(&adapted_name(judge), &write_tensors(&tensors.collect::<Vec<_>>()))?;
        }
        // An update has numbers of one of the imitators only.
        store_json_with(ledger, &scores_name(judge), &self.scores, Nulls::LeftOut)
    }

    fn recall(ledger: &dyn Ledger, judge: &str) -> Result<Option<Self>> {
        let name = adapted_name(judge);
        let scores: Option<ScoreTable> = recall_json(ledger, &scores_name(judge))?;
        let Some(scores) = scores else { return Ok(None) };
        if scores.trainer.is_some() {
            return Ok(Some(Self { scores, adapted: Vec::new() }));
        }
        let Some(bytes) = ledger.recall(&name)? else { return Ok(None) };
        let tensors = Tensors::read_sealed(&bytes, &name)?;
        let adapted = |of: &Suitability| {
            let (demo, variant) = (of.demo, of.variant);
            let policy = tensors.policy(&adapted_prefix(variant, demo))?;
            Ok(AdaptedPolicy { demo, variant, policy })
        };
        // Of a large set those of a few are stored; that none is lost of what was stored, the checksum says.
        let has_policy = |of: &&Suitability| tensors.holds(&adapted_prefix(of.variant, of.demo));
        let adapted = scores.suitabilities.iter().filter(has_policy).map(adapted).collect::<Result<_>>()?;
        Ok(Some(Self { scores, adapted }))
    }
}

fn scores_name(judge: &str) -> String {
    format!("scores_{judge}.json")
}

fn adapted_name(judge: &str) -> String {
    format!("adapted_{judge}.safetensors")
}

/// Under which names an adapted policy's tensors stand.
fn adapted_prefix(variant: EnvVariant, demo: DemoId) -> String {
    format!("variant_{}.demonstration_{demo}", variant.0)
}

/// θ with D_meta.
impl Artifact for Learner {
    fn store(&self, ledger: &mut dyn Ledger, _: &str) -> Result<()> {
        let mut tensors = policy_tensors(POLICY, &self.policy);
        tensors.extend(discriminator_tensors(&self.discriminator));
        ledger.store(PRIOR, &write_tensors(&tensors))
    }

    fn recall(ledger: &dyn Ledger, _: &str) -> Result<Option<Self>> {
        let Some(bytes) = ledger.recall(PRIOR)? else { return Ok(None) };
        let tensors = Tensors::read_sealed(&bytes, PRIOR)?;
        let policy = tensors.policy(POLICY)?;
        let (network, parameters) = tensors.network("discriminator")?;
        let wanted = (policy.filter().observation_size() + policy.action_size(), 1);
        let found = (network.input_width(), network.output_width());
        if found != wanted {
            return Err(Error::bad_input(format!(
                "{PRIOR}: the discriminator maps {} numbers to {}, and must map {} to {}",
                found.0, found.1, wanted.0, wanted.1
            )));
        }
        let discriminator = Discriminator::from_parts(network, parameters).with_noise(tensors.noise()?);
        Ok(Some(Self { policy, discriminator }))
    }
}

const PRIOR: &str = "prior.safetensors";
const NOISE: &str = "discriminator.noise";

/// Under which prefix a file of one policy holds its tensors.
const POLICY: &str = "policy";

#[derive(Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct CurveFile {
    demos: Vec<DemoId>,
    points: Vec<CurvePoint>,
    outcome: CurvePoint,
    end: CurvePoint,
    played: u64,
}

impl Artifact for LearningCurve {
    fn store(&self, ledger: &mut dyn Ledger, part: &str) -> Result<()> {
        let Self { demos, points, outcome, end, played, best } = self;
        let (demos, points) = (demos.clone(), points.clone());
        let file = CurveFile { demos, points, outcome: *outcome, end: *end, played: *played };
        ledger.store(&format!("policy_{part}.safetensors"), &write_policy(best))?;
        store_json(ledger, &format!("learning_curve_{part}.json"), &file)
    }

    fn recall(ledger: &dyn Ledger, part: &str) -> Result<Option<Self>> {
        let name = format!("policy_{part}.safetensors");
        let file: Option<CurveFile> = recall_json(ledger, &format!("learning_curve_{part}.json"))?;
        let (Some(file), Some(bytes)) = (file, ledger.recall(&name)?) else { return Ok(None) };
        let best = Tensors::read_sealed(&bytes, &name)?.policy(POLICY)?;
        let CurveFile { demos, points, outcome, end, played } = file;
        Ok(Some(Self { demos, points, outcome, end, played, best }))
    }
}

/// A training by a trainer, and beside it the policy where it is a file of ONNX.
impl Artifact for ByTrainer {
    fn store(&self, ledger: &mut dyn Ledger, part: &str) -> Result<()> {
        let policy = format!("policy_{part}.onnx");
        match &self.onnx {
            Some(onnx) => ledger.store(&policy, onnx)?,
            // That of another trainer, which was there before.
            None => ledger.forget(&policy)?,
        }
        store_json(ledger, &format!("training_{part}.json"), self)
    }

    fn recall(ledger: &dyn Ledger, part: &str) -> Result<Option<Self>> {
        let found: Option<Self> = recall_json(ledger, &format!("training_{part}.json"))?;
        let Some(found) = found else { return Ok(None) };
        let onnx = ledger.recall(&format!("policy_{part}.onnx"))?;
        Ok(Some(Self { onnx, ..found }))
    }
}

/// A demonstrator's stages of training.
impl Artifact for Vec<Stage> {
    fn store(&self, ledger: &mut dyn Ledger, _: &str) -> Result<()> {
        ledger.store(STAGES, &write_checkpoint(self))
    }

    fn recall(ledger: &dyn Ledger, _: &str) -> Result<Option<Self>> {
        ledger.recall(STAGES)?.map(|bytes| read_binary(&bytes, STAGES)).transpose()
    }
}

/// Under which name a demonstrator's stages are stored.
pub const STAGES: &str = "stages.bin";

/// A policy as safetensors: `policy.<layer>.weight` `[in, out]` and `.bias` `[out]`, `policy.log_std` `[act]`,
/// `policy.observation_mean` and `policy.observation_std` `[obs]`.
pub fn write_policy(policy: &Policy) -> Vec<u8> {
    write_tensors(&policy_tensors(POLICY, policy))
}

/// A policy from the bytes of [`write_policy`], or from those of before a policy carried its checksum; `name` is for errors.
pub fn read_policy(bytes: &[u8], name: &str) -> Result<Policy> {
    let tensors = Tensors::read(bytes, name)?;
    if let Some(place) = seal_place(bytes) {
        seal::check(bytes, Some(place), name)?;
    }
    tensors.policy(POLICY)
}

/// Under which name a stage's checkpoint is stored.
pub fn checkpoint_name(stage: &str, part: &str) -> String {
    if part.is_empty() { format!("checkpoint_{stage}.bin") } else { format!("checkpoint_{stage}_{part}.bin") }
}

/// A state with the version of this format and its checksum before it.
pub fn write_checkpoint(state: &dyn Snapshot) -> Vec<u8> {
    let version = FORMAT_VERSION.to_le_bytes();
    let mut bytes = [&version[..], &seal::OPEN, &state.to_bytes()].concat();
    seal::seal(&mut bytes, version.len());
    bytes
}

/// The state from the bytes of [`write_checkpoint`]; `name` is for errors.
pub fn read_checkpoint<State: DeserializeOwned>(bytes: &[u8], name: &str) -> Result<State> {
    read_binary(bytes, name)
        .map_err(|error| error.with_hint("delete it to start this stage from its beginning"))
}

fn read_binary<T: DeserializeOwned>(bytes: &[u8], name: &str) -> Result<T> {
    let (version, state) = bytes
        .split_first_chunk()
        .ok_or_else(|| Error::bad_input(format!("{name} is cut short: {} bytes", bytes.len())))?;
    check_version(u32::from_le_bytes(*version), FORMAT_VERSION, name)?;
    seal::check(bytes, Some(version.len()), name)?;
    postcard::from_bytes(&state[seal::DIGITS..])
        .map_err(|error| Error::bad_input(format!("{name} cannot be read: {error}")))
}

struct Tensor {
    name: String,
    shape: Vec<usize>,
    values: Vec<f32>,
}

fn policy_tensors(prefix: &str, policy: &Policy) -> Vec<Tensor> {
    let mut tensors = network_tensors(prefix, policy.network(), policy.network_parameters());
    for (name, values) in [
        ("log_std", policy.log_std()),
        ("observation_mean", policy.filter().mean()),
        ("observation_std", policy.filter().std()),
    ] {
        tensors.push(Tensor {
            name: format!("{prefix}.{name}"),
            shape: vec![values.len()],
            values: values.to_vec(),
        });
    }
    tensors
}

fn network_tensors(prefix: &str, network: &Mlp, parameters: &[f32]) -> Vec<Tensor> {
    let layers = network.layout().into_iter().enumerate();
    layers
        .flat_map(|(index, layer)| {
            let weight = Tensor {
                name: format!("{prefix}.{index}.weight"),
                shape: vec![layer.inputs, layer.outputs],
                values: parameters[layer.weight].to_vec(),
            };
            let bias = Tensor {
                name: format!("{prefix}.{index}.bias"),
                shape: vec![layer.outputs],
                values: parameters[layer.bias].to_vec(),
            };
            [weight, bias]
        })
        .collect()
}

fn discriminator_tensors(discriminator: &Discriminator) -> Vec<Tensor> {
    let mut tensors = network_tensors("discriminator", discriminator.network(), discriminator.parameters());
    tensors.push(Tensor { name: NOISE.to_owned(), shape: vec![1], values: vec![discriminator.noise()] });
    tensors
}

fn write_tensors(tensors: &[Tensor]) -> Vec<u8> {
    let bytes: Vec<Vec<u8>> = tensors
        .iter()
        .map(|tensor| tensor.values.iter().flat_map(|value| value.to_le_bytes()).collect())
        .collect();
    let views = tensors.iter().zip(&bytes).map(|(tensor, bytes)| {
        let view = TensorView::new(Dtype::F32, tensor.shape.clone(), bytes).expect("shape and bytes agree");
        (tensor.name.clone(), view)
    });
    // One entry only: a map of several would be written in an order of its own each time.
    let metadata = [(VERSION_KEY.to_owned(), TENSORS_VERSION.to_string())].into();
    sealed(&safetensors::serialize(views, Some(metadata)).expect("names are unique and views are whole"))
}

/// Before the digest in the metadata of tensors.
const TENSORS_HEAD: &str = ",\"sha256\":\"";

/// The file with its checksum behind the version in its metadata.
fn sealed(bytes: &[u8]) -> Vec<u8> {
    let (header, tensors) = header_and_tensors(bytes).expect("written just now");
    let version = format!("\"{VERSION_KEY}\":\"{TENSORS_VERSION}\"");
    let found = header.windows(version.len()).position(|window| window == version.as_bytes());
    let (before, behind) = header.split_at(found.expect("written just now") + version.len());
    let mut header = [before, TENSORS_HEAD.as_bytes(), &seal::OPEN, b"\"", behind.trim_ascii_end()].concat();
    header.resize(header.len().next_multiple_of(HEADER_UNIT), b' ');
    let place = HEADER_UNIT + before.len() + TENSORS_HEAD.len();
    let mut bytes = [&(header.len() as u64).to_le_bytes()[..], &header, tensors].concat();
    seal::seal(&mut bytes, place);
    bytes
}

/// A header of safetensors is a multiple of so many bytes long, and so many before it say how long.
const HEADER_UNIT: usize = 8;

fn header_and_tensors(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk::<HEADER_UNIT>()?;
    rest.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)
}

/// Where the checksum stands; tensors of before there were any have none.
fn seal_place(bytes: &[u8]) -> Option<usize> {
    let (header, _) = header_and_tensors(bytes)?;
    let found = header.windows(TENSORS_HEAD.len()).position(|window| window == TENSORS_HEAD.as_bytes())?;
    Some(HEADER_UNIT + found + TENSORS_HEAD.len())
}

struct Tensors<'a> {
    tensors: SafeTensors<'a>,
    name: &'a str,
}

impl<'a> Tensors<'a> {
    fn read(bytes: &'a [u8], name: &'a str) -> Result<Self> {
        let tensors = SafeTensors::deserialize(bytes)
            .map_err(|error| Error::bad_input(format!("{name} is not a safetensors file: {error}")))?;
        let (_, header) = SafeTensors::read_metadata(bytes).expect("read just now");
        let version = header.metadata().as_ref().and_then(|metadata| metadata.get(VERSION_KEY));
        match version.map(|version| version.parse()) {
            Some(Ok(version)) => check_version(version, TENSORS_VERSION, name)?,
            _ => {
                return Err(Error::bad_input(format!(
                    "{name} says no {VERSION_KEY} in its metadata, so it was not written by demosift"
                )));
            }
        }
        Ok(Self { tensors, name })
    }

    /// The tensors of a file of a run, which contains its checksum.
    fn read_sealed(bytes: &'a [u8], name: &'a str) -> Result<Self> {
        let tensors = Self::read(bytes, name)?;
        seal::check(bytes, seal_place(bytes), name)?;
        Ok(tensors)
    }

    fn values(&self, tensor: &str) -> Result<(Vec<usize>, Vec<f32>)> {
        let view = self.tensors.tensor(tensor).map_err(|_| {
            let known = self.tensors.names().join(", ");
            Error::bad_input(format!("{} has no tensor '{tensor}'; it has: {known}", self.name))
        })?;
        if view.dtype() != Dtype::F32 {
            return Err(Error::bad_input(format!(
                "{}: tensor '{tensor}' is not of 32-bit floats",
                self.name
            )));
        }
        let (chunks, _) = view.data().as_chunks();
        let values: Vec<f32> = chunks.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
        if let Some(value) = values.iter().find(|value| !value.is_finite()) {
            return Err(Error::bad_input(format!(
                "{}: tensor '{tensor}' holds {value}, and must hold finite numbers",
                self.name
            )));
        }
        Ok((view.shape().to_vec(), values))
    }

    /// Whether a network stands under these names.
    fn holds(&self, prefix: &str) -> bool {
        self.tensors.tensor(&format!("{prefix}.0.weight")).is_ok()
    }

    /// That with which the discriminator learned; it learned with none where the file does not say.
    fn noise(&self) -> Result<f32> {
        if self.tensors.tensor(NOISE).is_err() {
            return Ok(0.0);
        }
        match self.values(NOISE)?.1.as_slice() {
            [noise] if (0.0..=1.0).contains(noise) => Ok(*noise),
            _ => Err(Error::bad_input(format!(
                "{}: tensor '{NOISE}' must hold one number from 0 to 1",
                self.name
            ))),
        }
    }

    fn network(&self, prefix: &str) -> Result<(Mlp, Vec<f32>)> {
        let (mut widths, mut parameters) = (Vec::new(), Vec::new());
        while widths.is_empty()
            || self.tensors.tensor(&format!("{prefix}.{}.weight", widths.len() - 1)).is_ok()
        {
            let index = widths.len().saturating_sub(1);
            let (shape, weight) = self.values(&format!("{prefix}.{index}.weight"))?;
            let (_, bias) = self.values(&format!("{prefix}.{index}.bias"))?;
            let fits = match (shape.as_slice(), widths.last()) {
                ([inputs, outputs], None) => *inputs > 0 && *outputs == bias.len() && *outputs > 0,
                ([inputs, outputs], Some(last)) => inputs == last && *outputs == bias.len() && *outputs > 0,
                _ => false,
            };
            if !fits {
                return Err(Error::bad_input(format!(
                    "{}: the shape {shape:?} of '{prefix}.{index}.weight' does not fit its neighbors",
                    self.name
                )));
            }
            if widths.is_empty() {
                widths.push(shape[0]);
            }
            widths.push(shape[1]);
            parameters.extend(weight);
            parameters.extend(bias);
        }
        Ok((Mlp::new(&widths), parameters))
    }

    fn policy(&self, prefix: &str) -> Result<Policy> {
        let (network, mut parameters) = self.network(prefix)?;
        let vector = |name: &str, wanted: usize| {
            let tensor = format!("{prefix}.{name}");
            let (_, values) = self.values(&tensor)?;
            if values.len() != wanted {
                return Err(Error::bad_input(format!(
                    "{}: tensor '{tensor}' has {} numbers, and must have {wanted}",
                    self.name,
                    values.len()
                )));
            }
            Ok(values)
        };
        parameters.extend(vector("log_std", network.output_width())?);
        let mean = vector("observation_mean", network.input_width())?;
        let std = vector("observation_std", network.input_width())?;
        Ok(Policy::from_parts(network, parameters, ObservationFilter::new(mean, std)))
    }
}

#[cfg(test)]
mod tests;
