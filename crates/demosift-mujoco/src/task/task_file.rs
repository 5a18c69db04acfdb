//! `task.toml` as it is written: the words and their types, before any name in it is looked up.

use std::collections::BTreeMap;
use std::fmt;
use std::num::{NonZeroU32, NonZeroUsize};

use demosift::world::fold::{ConditionOf, FoldKind, FoldOf, OneOrMore};
use demosift::{Error, Result};
use serde::Deserialize;
use serde::de::{MapAccess, SeqAccess, Visitor, value};

use crate::names::nearest;

/// A whole `task.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TaskFile {
    /// The task's name.
    pub(crate) name: String,
    /// The MJCF file, relative to the folder of the task file.
    pub(crate) model: String,
    /// The camera that shows the task best; the model's first one if not given.
    pub(crate) camera: Option<String>,
    /// Steps of the physics in a control step.
    pub(crate) frame_skip: NonZeroU32,
    /// Control steps in an episode.
    pub(crate) horizon: NonZeroUsize,
    /// The parts of an observation, in order.
    pub(crate) observation: Vec<ObservationPart>,
    /// Terms of the task reward, added up.
    #[serde(default)]
    pub(crate) reward: Vec<RewardTerm>,
    /// How an episode starts.
    #[serde(default)]
    pub(crate) reset: Reset,
    /// What is written down at every step, by name; the columns are in alphabetical order.
    pub(crate) measurements: BTreeMap<String, Measurement>,
    /// Ranges of measurements, `[low, high]` by name; an episode ends with the step that leads out of one.
    #[serde(default)]
    pub(crate) ends: BTreeMap<String, [f64; 2]>,
    /// What others would report of an episode.
    #[serde(rename = "return")]
    pub(crate) true_return: Option<Return>,
    /// How good an episode was.
    pub(crate) heuristic: FoldOf,
    /// Whether an episode reached the goal.
    pub(crate) success: Option<Success>,
    /// The goals of a multi-goal task; one, called `default`, if there are none.
    #[serde(default)]
    pub(crate) variant: Vec<Variant>,
}

impl TaskFile {
    /// Reads the text of a `task.toml`.
    pub(crate) fn parse(text: &str) -> Result<Self> {
        let file = toml::from_str(text)
            .map_err(|error| Error::bad_config(in_words(error.to_string().trim_end())))?;
        if let Ok(table) = text.parse::<toml::Table>() {
            table.iter().try_for_each(|(key, value)| check_numbers(key, value, false))?;
        }
        Ok(file)
    }
}

/// Numbers beyond this are no quantity of a robot, and a few of them multiplied are infinite.
const LARGEST: f64 = 1e30;

/// Whether every number below a key can be calculated with; what the ends of a range may be, the range says.
fn check_numbers(name: &str, value: &toml::Value, is_range: bool) -> Result<()> {
    match value {
        toml::Value::Float(number) if !number.is_finite() && is_range => Ok(()),
        toml::Value::Float(number) if !number.is_finite() => {
            Err(Error::bad_config(format!("{name} = {number}: must be a finite number")))
        }
        toml::Value::Float(number) if number.abs() > LARGEST => {
            Err(Error::bad_config(format!("{name} = {number:e}: must be from -{LARGEST:e} to {LARGEST:e}")))
        }
        toml::Value::Array(values) => {
            values.iter().try_for_each(|value| check_numbers(name, value, is_range))
        }
        toml::Value::Table(table) => table.iter().try_for_each(|(key, value)| {
            let is_range = name == "ends" || key == "clip";
            check_numbers(&format!("{name}.{key}"), value, is_range)
        }),
        _ => Ok(()),
    }
}

/// What the reader of the file says, without words that only a programmer knows, and with the nearest of the names there are.
fn in_words(said: &str) -> String {
    let mut words = said.to_owned();
    for (theirs, ours) in [
        ("a nonzero u32", "a whole number of at least 1"),
        ("a nonzero usize", "a whole number of at least 1"),
        (
            "unit variant, expected newtype variant",
            "this word alone says too little, expected such as { qpos = \"slider\" }",
        ),
        ("unknown variant", "unknown word"),
        ("unknown field", "unknown key"),
        ("missing field", "missing key"),
        ("TOML parse error", "the task file is wrong"),
    ] {
        words = words.replace(theirs, ours);
    }
    if let Some(word) = ["effort", "alive"].into_iter().find(|word| words.contains(&format!("{{ {word} = ")))
    {
        return format!("{words}; `{word}` stands alone, as in name = \"{word}\"");
    }
    let Some(at) = words.find("unknown word `").or_else(|| words.find("unknown key `")) else { return words };
    let mut names = words[at..].split('`').skip(1).step_by(2);
    let wrong = names.next().unwrap_or_default();
    let known: Vec<String> = names.map(str::to_owned).collect();
    match nearest(wrong, &known) {
        Some(meant) => format!("{words}; did you mean `{meant}`?"),
        None => words,
    }
}

/// One part of an observation: what is seen, and the range that its numbers are clipped to.
#[derive(Debug)]
pub(crate) struct ObservationPart {
    pub(crate) what: PartOf,
    pub(crate) clip: Option<[f64; 2]>,
}

/// What a part of an observation is of; a slice such as `[2:]` behind a name takes some of its numbers.
#[derive(Debug)]
pub(crate) enum PartOf {
    /// Positions of joints.
    Qpos(Names),
    /// Velocities of joints.
    Qvel(Names),
    /// Where sites, geoms or bodies are, m; 3 numbers each.
    Position(Vec<String>),
    /// How fast sites, geoms or bodies move, m/s; 3 numbers each.
    Velocity(Vec<String>),
    /// Torque and force that contacts exert on bodies; 6 numbers each.
    ContactWrench(Vec<String>),
    /// The share of the episode that has passed; 1 number.
    Phase,
}

/// The keys of a part that is written as a table.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PartTable {
    qpos: Option<Names>,
    qvel: Option<Names>,
    position: Option<Vec<String>>,
    velocity: Option<Vec<String>>,
    contact_wrench: Option<Vec<String>>,
    clip: Option<[f64; 2]>,
}

/// The words that a part may have.
const PARTS: &[&str] = &["qpos", "qvel", "position", "velocity", "contact_wrench", "phase"];

impl<'de> Deserialize<'de> for ObservationPart {
    fn deserialize<D: serde::Deserializer<'de>>(input: D) -> std::result::Result<Self, D::Error> {
        struct Reader;

        impl<'de> Visitor<'de> for Reader {
            type Value = ObservationPart;

            fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
                out.write_str("a part of an observation, such as { qpos = \"all\" } or \"phase\"")
            }

            fn visit_str<E: serde::de::Error>(self, word: &str) -> std::result::Result<ObservationPart, E> {
                match word {
                    "phase" => Ok(ObservationPart { what: PartOf::Phase, clip: None }),
                    known if PARTS.contains(&known) => {
                        Err(E::custom("this word alone says too little, expected such as { qpos = \"all\" }"))
                    }
                    other => Err(E::unknown_variant(other, PARTS)),
                }
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> std::result::Result<ObservationPart, A::Error> {
                let table = PartTable::deserialize(value::MapAccessDeserializer::new(map))?;
                let PartTable { qpos, qvel, position, velocity, contact_wrench, clip } = table;
                let given = [
                    qpos.map(PartOf::Qpos),
                    qvel.map(PartOf::Qvel),
                    position.map(PartOf::Position),
                    velocity.map(PartOf::Velocity),
                    contact_wrench.map(PartOf::ContactWrench),
                ];
                let mut given = given.into_iter().flatten();
                match (given.next(), given.next()) {
                    (Some(what), None) => Ok(ObservationPart { what, clip }),
                    _ => Err(serde::de::Error::custom(
                        "a part has exactly one of: qpos, qvel, position, velocity, contact_wrench; and perhaps clip",
                    )),
                }
            }
        }

        input.deserialize_any(Reader)
    }
}

/// Which joints: `"all"`, a name, a list of names, or `{ except = [names] }`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Names {
    All,
    Only(Vec<String>),
    Except(Vec<String>),
}

impl<'de> Deserialize<'de> for Names {
    fn deserialize<D: serde::Deserializer<'de>>(input: D) -> std::result::Result<Self, D::Error> {
        struct Reader;

        impl<'de> Visitor<'de> for Reader {
            type Value = Names;

            fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
                out.write_str("\"all\", a joint's name, a list of names, or { except = [names] }")
            }

            fn visit_str<E>(self, name: &str) -> std::result::Result<Names, E> {
                Ok(if name == "all" { Names::All } else { Names::Only(vec![name.to_owned()]) })
            }

            fn visit_seq<A: SeqAccess<'de>>(self, names: A) -> std::result::Result<Names, A::Error> {
                Vec::deserialize(value::SeqAccessDeserializer::new(names)).map(Names::Only)
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> std::result::Result<Names, A::Error> {
                #[derive(Deserialize)]
                #[serde(deny_unknown_fields)]
                struct Except {
                    except: Vec<String>,
                }
                let all_but = Except::deserialize(value::MapAccessDeserializer::new(map))?;
                Ok(Names::Except(all_but.except))
            }
        }

        input.deserialize_any(Reader)
    }
}

/// One number that is written down at every step.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Measurement {
    /// Position of a hinge or slide joint, rad or m.
    Qpos(String),
    /// Velocity of a hinge or slide joint, rad/s or m/s.
    Qvel(String),
    /// Distance of two places, m.
    Distance([String; 2]),
    /// Distance of two places seen from above, m.
    HorizontalDistance([String; 2]),
    /// Height of a place over the origin of the world, m.
    Height(String),
    /// How much higher the first place is than the second, m.
    HeightAbove([String; 2]),
    /// One coordinate of a place, m.
    Position(Component),
    /// One component of the velocity of a place, m/s.
    Velocity(Component),
    /// 1 while two geoms (or any geoms of two bodies) touch, else 0.
    Contact([String; 2]),
    /// What another measurement changed over the control step, a second; 0 after the reset.
    RateOf(String),
    /// ‖a‖² of the step's action, clipped to [−1, 1]; 0 after the reset.
    Effort,
    /// 1 while every range of `[ends]` holds, else 0.
    Alive,
    /// Other measurements, each times its weight, added up.
    Sum(BTreeMap<String, f64>),
}

/// What others would report of an episode: a measurement, added up over its steps.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Return {
    pub(crate) measurement: String,
}

/// One coordinate of a vector that belongs to a place.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Component {
    pub(crate) of: String,
    pub(crate) axis: Axis,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Axis {
    X,
    Y,
    Z,
}

/// One term of the task reward: `{ measurement, weight }`, `{ rate_of, weight }`, `{ control_cost }` or `{ constant }`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RewardTerm {
    pub(crate) measurement: Option<String>,
    pub(crate) rate_of: Option<String>,
    pub(crate) weight: Option<f64>,
    pub(crate) control_cost: Option<f64>,
    pub(crate) constant: Option<f64>,
}

/// How an episode starts: the model's own initial pose or a keyframe, then values, then noise.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Reset {
    pub(crate) keyframe: Option<String>,
    #[serde(default)]
    pub(crate) qpos: BTreeMap<String, Values>,
    #[serde(default)]
    pub(crate) qvel: BTreeMap<String, Values>,
    pub(crate) qpos_noise: Option<Noise>,
    pub(crate) qvel_noise: Option<Noise>,
}

/// A goal: how its episodes start differently.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Variant {
    pub(crate) name: String,
    #[serde(default)]
    pub(crate) qpos: BTreeMap<String, Values>,
    #[serde(default)]
    pub(crate) qvel: BTreeMap<String, Values>,
}

/// The numbers of a joint: one for a hinge or slide, a list for a ball or free joint.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Values(pub(crate) Vec<f64>);

impl<'de> Deserialize<'de> for Values {
    fn deserialize<D: serde::Deserializer<'de>>(input: D) -> std::result::Result<Self, D::Error> {
        struct Reader;

        impl<'de> Visitor<'de> for Reader {
            type Value = Values;

            fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
                out.write_str("a number or a list of numbers")
            }

            fn visit_f64<E>(self, number: f64) -> std::result::Result<Values, E> {
                Ok(Values(vec![number]))
            }

            fn visit_i64<E>(self, number: i64) -> std::result::Result<Values, E> {
                Ok(Values(vec![number as f64]))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, numbers: A) -> std::result::Result<Values, A::Error> {
                Vec::deserialize(value::SeqAccessDeserializer::new(numbers)).map(Values)
            }
        }

        input.deserialize_any(Reader)
    }
}

/// Noise on the initial state: `{ uniform = half_width }` or `{ normal = standard_deviation }`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Noise {
    pub(crate) uniform: Option<f64>,
    pub(crate) normal: Option<f64>,
    /// Joints without noise.
    #[serde(default)]
    pub(crate) except: Vec<String>,
}

/// When an episode counts as a success: exactly one of `above`, `below`, on a fold.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Success {
    pub(crate) fold: FoldKind,
    #[serde(default)]
    pub(crate) of: OneOrMore,
    #[serde(default)]
    pub(crate) when: Vec<ConditionOf>,
    #[serde(default, rename = "while")]
    pub(crate) as_long_as: Vec<ConditionOf>,
    pub(crate) otherwise: Option<f64>,
    pub(crate) above: Option<f64>,
    pub(crate) below: Option<f64>,
    /// Paid into the task reward, once, when success is certain.
    #[serde(default)]
    pub(crate) reward: f64,
}
