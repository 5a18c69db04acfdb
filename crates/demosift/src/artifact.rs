//! How each noun is written down and read back, with a version each.
//!
//! Nouns for people are JSON; policies and discriminators are safetensors with the shapes and the filter inside;
//! checkpoints, which are for the next process of the same version only, are compact binary.

use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use crate::adapt::Learner;
use crate::error::{Error, Result};
use crate::gail::Discriminator;
use crate::imitate::{CurvePoint, LearningCurve};
use crate::judge::ScoreTable;
use crate::ledger::Ledger;
use crate::nn::mlp::Mlp;
use crate::observation_filter::ObservationFilter;
use crate::observer::Snapshot;
use crate::policy::Policy;
use crate::select::{Ranking, Subset};

/// Changes when a file of this version could no longer be read.
const FORMAT_VERSION: u32 = 1;

/// A noun of the flow that a ledger can keep; `part` tells several of a kind apart.
pub trait Artifact: Sized {
    /// Keeps the noun.
    fn keep(&self, ledger: &mut dyn Ledger, part: &str) -> Result<()>;
    /// The noun, if it was kept; the error says what is wrong with its file.
    fn recall(ledger: &dyn Ledger, part: &str) -> Result<Option<Self>>;
}

/// Reads a noun of JSON; `what` names it in errors.
fn recall_json<T: DeserializeOwned>(ledger: &dyn Ledger, name: &str) -> Result<Option<T>> {
    let Some(bytes) = ledger.recall(name)? else { return Ok(None) };
    let versioned: Versioned<T> = serde_json::from_slice(&bytes)
        .map_err(|error| Error::bad_input(format!("{name} cannot be read: {error}")))?;
    check_version(versioned.version, name)?;
    Ok(Some(versioned.content))
}

fn keep_json<T: Serialize>(ledger: &mut dyn Ledger, name: &str, content: &T) -> Result<()> {
    let versioned = Versioned { version: FORMAT_VERSION, content };
    let mut bytes = serde_json::to_vec_pretty(&versioned).expect("plain data always serializes");
    bytes.push(b'\n');
    ledger.keep(name, &bytes)
}

#[derive(Serialize, Deserialize)]
struct Versioned<T> {
    version: u32,
    #[serde(flatten)]
    content: T,
}

fn check_version(found: u32, name: &str) -> Result<()> {
    if found == FORMAT_VERSION {
        return Ok(());
    }
    Err(Error::bad_input(format!(
        "{name} has format version {found}; this demosift reads version {FORMAT_VERSION}"
    )))
}

macro_rules! json_artifact {
    ($($noun:ty => $name:literal),*) => {$(
        impl Artifact for $noun {
            fn keep(&self, ledger: &mut dyn Ledger, _: &str) -> Result<()> {
                keep_json(ledger, $name, self)
            }

            fn recall(ledger: &dyn Ledger, _: &str) -> Result<Option<Self>> {
                recall_json(ledger, $name)
            }
        }
    )*};
}

json_artifact!(ScoreTable => "scores.json", Ranking => "ranking.json", Subset => "subset.json");

/// θ with D_meta.
impl Artifact for Learner {
    fn keep(&self, ledger: &mut dyn Ledger, _: &str) -> Result<()> {
        let mut tensors = policy_tensors(&self.policy);
        tensors.extend(network_tensors(
            "discriminator",
            self.discriminator.network(),
            self.discriminator.parameters(),
        ));
        ledger.keep(PRIOR, &write_tensors(&tensors))
    }

    fn recall(ledger: &dyn Ledger, _: &str) -> Result<Option<Self>> {
        let Some(bytes) = ledger.recall(PRIOR)? else { return Ok(None) };
        let tensors = Tensors::read(&bytes, PRIOR)?;
        let (network, parameters) = tensors.network("discriminator")?;
        let discriminator = Discriminator::from_parts(network, parameters);
        Ok(Some(Self { policy: tensors.policy()?, discriminator }))
    }
}

const PRIOR: &str = "prior.safetensors";

#[derive(Serialize, Deserialize)]
struct CurveFile {
    demos: Vec<crate::demonstration::DemoId>,
    points: Vec<CurvePoint>,
    outcome: CurvePoint,
}

impl Artifact for LearningCurve {
    fn keep(&self, ledger: &mut dyn Ledger, part: &str) -> Result<()> {
        let Self { demos, points, outcome, best } = self;
        let file = CurveFile { demos: demos.clone(), points: points.clone(), outcome: *outcome };
        ledger.keep(&format!("policy_{part}.safetensors"), &write_policy(best))?;
        keep_json(ledger, &format!("learning_curve_{part}.json"), &file)
    }

    fn recall(ledger: &dyn Ledger, part: &str) -> Result<Option<Self>> {
        let name = format!("policy_{part}.safetensors");
        let file: Option<CurveFile> = recall_json(ledger, &format!("learning_curve_{part}.json"))?;
        let (Some(file), Some(bytes)) = (file, ledger.recall(&name)?) else { return Ok(None) };
        let best = Tensors::read(&bytes, &name)?.policy()?;
        Ok(Some(Self { demos: file.demos, points: file.points, outcome: file.outcome, best }))
    }
}

/// A policy as safetensors: `policy.<layer>.weight` `[in, out]` and `.bias` `[out]`, `policy.log_std` `[act]`,
/// `policy.observation_mean` and `policy.observation_std` `[obs]`.
pub fn write_policy(policy: &Policy) -> Vec<u8> {
    write_tensors(&policy_tensors(policy))
}

/// A policy from the bytes of [`write_policy`]; `name` is for errors.
pub fn read_policy(bytes: &[u8], name: &str) -> Result<Policy> {
    Tensors::read(bytes, name)?.policy()
}

/// Under which name a stage's checkpoint is kept.
pub fn checkpoint_name(stage: &str, part: &str) -> String {
    if part.is_empty() { format!("checkpoint_{stage}.bin") } else { format!("checkpoint_{stage}_{part}.bin") }
}

/// A state with the version of this format before it.
pub fn write_checkpoint(state: &dyn Snapshot) -> Vec<u8> {
    let mut bytes = FORMAT_VERSION.to_le_bytes().to_vec();
    bytes.extend(state.to_bytes());
    bytes
}

/// The state from the bytes of [`write_checkpoint`]; `name` is for errors.
pub fn read_checkpoint<State: DeserializeOwned>(bytes: &[u8], name: &str) -> Result<State> {
    let (version, state) = bytes
        .split_first_chunk()
        .ok_or_else(|| Error::bad_input(format!("{name} is cut short: {} bytes", bytes.len())))?;
    check_version(u32::from_le_bytes(*version), name)?;
    postcard::from_bytes(state).map_err(|error| {
        Error::bad_input(format!("{name} cannot be read: {error}"))
            .with_hint("delete it to start this stage anew")
    })
}

struct Tensor {
    name: String,
    shape: Vec<usize>,
    values: Vec<f32>,
}

fn policy_tensors(policy: &Policy) -> Vec<Tensor> {
    let mut tensors = network_tensors("policy", policy.network(), policy.network_parameters());
    for (name, values) in [
        ("log_std", policy.log_std()),
        ("observation_mean", policy.filter().mean()),
        ("observation_std", policy.filter().std()),
    ] {
        tensors.push(Tensor {
            name: format!("policy.{name}"),
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
    let metadata = [("demosift_format".to_owned(), FORMAT_VERSION.to_string())].into();
    safetensors::serialize(views, Some(metadata)).expect("names are unique and views are whole")
}

struct Tensors<'a> {
    tensors: SafeTensors<'a>,
    name: &'a str,
}

impl<'a> Tensors<'a> {
    fn read(bytes: &'a [u8], name: &'a str) -> Result<Self> {
        let tensors = SafeTensors::deserialize(bytes)
            .map_err(|error| Error::bad_input(format!("{name} is not a safetensors file: {error}")))?;
        Ok(Self { tensors, name })
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
        Ok((view.shape().to_vec(), chunks.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect()))
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

    fn policy(&self) -> Result<Policy> {
        let (network, mut parameters) = self.network("policy")?;
        let vector = |tensor: &str, wanted: usize| {
            let (_, values) = self.values(tensor)?;
            if values.len() != wanted {
                return Err(Error::bad_input(format!(
                    "{}: tensor '{tensor}' has {} numbers, and must have {wanted}",
                    self.name,
                    values.len()
                )));
            }
            Ok(values)
        };
        parameters.extend(vector("policy.log_std", network.output_width())?);
        let mean = vector("policy.observation_mean", network.input_width())?;
        let std = vector("policy.observation_std", network.input_width())?;
        Ok(Policy::from_parts(network, parameters, ObservationFilter::new(mean, std)))
    }
}
