//! `set.toml`: what the numbers of a set are, where they are not what the task takes.
//!
//! A small file in the folder of a set, or beside its file:
//!
//! ```toml
//! rate = 25                 # steps a second, whatever the set itself says
//!
//! [actions]
//! order = [1, 0]            # number 0 of the task is number 1 of the set
//! sign = [1, -1]            # one for each number of the task, or one for all
//! scale = 2.0
//! offset = 0.1
//! units = "controls"        # or task, degrees, percent, percent_from_0
//!
//! [observations]
//! units = { degrees = "0-3" }   # only these numbers of the task
//! ```
//!
//! Each number of the task is one of the set, times its sign and scale, plus its offset, and then taken out of its unit.
//! What a set holds is never changed: exports pass on what came in, and this file with it.

mod ranges;
mod words;

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde::de::{MapAccess, SeqAccess, Visitor, value};
use serde::{Deserialize, Deserializer, Serialize};

use crate::basics::error::{Error, Result};
use crate::basics::files;
use crate::data::demonstration::episode::{MINARI_HDF5, RECORDED};
use crate::data::demonstration::numbers::Numbers;
use crate::data::demonstration::open::Located;

pub use crate::data::demonstration::conversion::Conversion;
pub use ranges::Ranges;

/// The name of the file.
pub const SET_FILE: &str = "set.toml";

/// What a `set.toml` says; by default nothing.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct SetFile {
    /// Steps a second, whatever the set itself says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate: Option<f64>,
    /// What the numbers of an action are.
    #[serde(skip_serializing_if = "Meaning::is_none")]
    pub actions: Meaning,
    /// What the numbers of an observation are.
    #[serde(skip_serializing_if = "Meaning::is_none")]
    pub observations: Meaning,
}

/// What the numbers of an action or of an observation are; lists have one entry for each number of the task.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Meaning {
    /// The place in the set of each number of the task.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub order: Option<Vec<usize>>,
    /// 1 or −1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sign: Option<Each>,
    /// What a number is multiplied by.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<Each>,
    /// What is added then.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset: Option<Each>,
    /// What the numbers are measured in.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub units: Option<Units>,
}

impl Meaning {
    /// Whether nothing is said.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Whether it is said that all numbers are what the task takes.
    pub fn is_of_task(&self) -> bool {
        self.units == Some(Units::All(Unit::Task))
    }
}

/// One number for all, or one for each.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged)]
pub enum Each {
    /// The same for all.
    All(f64),
    /// In the order of the task.
    Listed(Vec<f64>),
}

/// What numbers are measured in.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged)]
pub enum Units {
    /// All of them in one unit.
    All(Unit),
    /// Some of them, by their places in the task; the others are what the task takes.
    Some(BTreeMap<Unit, Numbers>),
}

/// A unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(into = "String", try_from = "String")]
pub enum Unit {
    /// What the task takes: actions in [−1, 1], of which the rest is cut off, and observations as the task has them.
    Task,
    /// Controls of the model, in the units of `ctrlrange`; actions only.
    Controls,
    /// Degrees where the model has rad, of controls and of observations.
    Degrees,
    /// −100 to 100 over the range of the control, or of the joint that is observed.
    Percent,
    /// 0 to 100 over the same range.
    PercentFrom0,
}

impl Unit {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Task, Self::Controls, Self::Degrees, Self::Percent, Self::PercentFrom0];

    /// The word for it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Task => "task",
            Self::Controls => "controls",
            Self::Degrees => "degrees",
            Self::Percent => "percent",
            Self::PercentFrom0 => "percent_from_0",
        }
    }
}

impl FromStr for Unit {
    type Err = Error;

    fn from_str(typed: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|unit| unit.word() == typed).ok_or_else(|| {
            let known: Vec<&str> = Self::ALL.into_iter().map(Self::word).collect();
            Error::bad_config(format!("there is no unit '{typed}'; there are: {}", known.join(", ")))
        })
    }
}

impl TryFrom<String> for Unit {
    type Error = Error;

    fn try_from(word: String) -> Result<Self> {
        word.parse()
    }
}

impl From<Unit> for String {
    fn from(unit: Unit) -> Self {
        unit.word().to_owned()
    }
}

impl SetFile {
    /// Reads the text of a `set.toml`.
    ///
    /// # Errors
    /// `is_bad_config` if a key is unknown (lists those there are) or a value means nothing.
    pub fn parse(text: &str) -> Result<Self> {
        let read: Self = toml::from_str(text).map_err(|error| {
            let words = error.to_string().replace("TOML parse error", "the set file is wrong");
            Error::bad_config(words.trim_end().replace("unknown field", "unknown key"))
        })?;
        if let Some(rate) = read.rate.filter(|rate| !(rate.is_finite() && *rate > 0.0)) {
            return Err(Error::bad_config(format!("rate = {rate}, and must be a number above 0")));
        }
        for (what, meaning) in [("actions", &read.actions), ("observations", &read.observations)] {
            meaning.check().map_err(|error| error.during(what))?;
        }
        Ok(read)
    }

    /// Reads a file.
    ///
    /// # Errors
    /// As [`SetFile::parse`], and `is_io` if it may not be read.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(&files::read_text(path, "the set file")?).map_err(|error| error.at(path))
    }

    /// Whether nothing is said.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

/// Where the `set.toml` of a set would lie: in its folder, and beside a file `lift.hdf5`, which may be one of many, as
/// `lift.set.toml`.
pub fn place_for(set: &Located) -> PathBuf {
    let name = set.path.file_name();
    let is_of_folder = name.is_some_and(|name| name == RECORDED || name == MINARI_HDF5);
    if !set.path.is_dir() && !is_of_folder {
        return set.path.with_extension(SET_FILE);
    }
    in_folder(set)
}

fn in_folder(set: &Located) -> PathBuf {
    let folder =
        if set.path.is_dir() { set.path.as_path() } else { set.path.parent().unwrap_or(Path::new("")) };
    // Minari keeps its files in a folder `data` within that of the set.
    let is_inner = folder.file_name().is_some_and(|name| name == "data") && set.format.is_minari();
    if is_inner { folder.with_file_name(SET_FILE) } else { folder.join(SET_FILE) }
}

/// The `set.toml` of a set, where it has one.
pub fn find(set: &Located) -> Option<PathBuf> {
    let of_file = (!set.path.is_dir()).then(|| set.path.with_extension(SET_FILE));
    let inner = if set.path.is_dir() { set.path.join(SET_FILE) } else { set.path.with_file_name(SET_FILE) };
    [of_file, Some(inner), Some(in_folder(set))].into_iter().flatten().find(|path| path.is_file())
}

impl Meaning {
    fn check(&self) -> Result<()> {
        let numbers = |each: &Option<Each>| match each {
            None => Vec::new(),
            Some(Each::All(number)) => vec![*number],
            Some(Each::Listed(numbers)) => numbers.clone(),
        };
        let wrong = |key: &str, number: f64, wanted: &str| {
            Err(Error::bad_config(format!("{key} holds {number}; wanted {wanted}")))
        };
        if let Some(number) = numbers(&self.sign).into_iter().find(|number| number.abs() != 1.0) {
            return wrong("sign", number, "1 or -1");
        }
        if let Some(number) =
            numbers(&self.scale).into_iter().find(|number| *number == 0.0 || !number.is_finite())
        {
            return wrong("scale", number, "a finite number other than 0");
        }
        if let Some(number) = numbers(&self.offset).into_iter().find(|number| !number.is_finite()) {
            return wrong("offset", number, "a finite number");
        }
        let order = self.order.as_deref().unwrap_or_default();
        if let Some(at) = (1..order.len()).find(|at| order[..*at].contains(&order[*at])) {
            return Err(Error::bad_config(format!(
                "order holds {} twice; wanted each number once",
                order[at]
            )));
        }
        Ok(())
    }
}

impl fmt::Display for SetFile {
    /// Lines of a `set.toml`; none where nothing is said.
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(rate) = self.rate {
            writeln!(out, "rate = {rate}")?;
        }
        for (of, Meaning { order, sign, scale, offset, units }) in
            [("actions", &self.actions), ("observations", &self.observations)]
        {
            if let Some(order) = order {
                writeln!(out, "{of}.order = {order:?}")?;
            }
            for (key, each) in [("sign", sign), ("scale", scale), ("offset", offset)] {
                if let Some(each) = each {
                    writeln!(out, "{of}.{key} = {each}")?;
                }
            }
            if let Some(units) = units {
                writeln!(out, "{of}.units = {units}")?;
            }
        }
        Ok(())
    }
}

impl fmt::Display for Each {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::All(number) => number.fmt(out),
            Self::Listed(numbers) => {
                let numbers: Vec<String> = numbers.iter().map(f64::to_string).collect();
                write!(out, "[{}]", numbers.join(", "))
            }
        }
    }
}

impl fmt::Display for Units {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::All(unit) => write!(out, "\"{}\"", unit.word()),
            Self::Some(units) => {
                let of = |(unit, numbers): (&Unit, &Numbers)| format!("{} = \"{numbers}\"", unit.word());
                write!(out, "{{ {} }}", units.iter().map(of).collect::<Vec<_>>().join(", "))
            }
        }
    }
}

impl<'de> Deserialize<'de> for Each {
    fn deserialize<D: Deserializer<'de>>(input: D) -> std::result::Result<Self, D::Error> {
        struct Reader;

        impl<'de> Visitor<'de> for Reader {
            type Value = Each;

            fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
                out.write_str("a number, or a list of one for each number of the task")
            }

            fn visit_f64<E>(self, number: f64) -> std::result::Result<Each, E> {
                Ok(Each::All(number))
            }

            fn visit_i64<E>(self, number: i64) -> std::result::Result<Each, E> {
                Ok(Each::All(number as f64))
            }

            fn visit_u64<E>(self, number: u64) -> std::result::Result<Each, E> {
                Ok(Each::All(number as f64))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, numbers: A) -> std::result::Result<Each, A::Error> {
                Vec::deserialize(value::SeqAccessDeserializer::new(numbers)).map(Each::Listed)
            }
        }

        input.deserialize_any(Reader)
    }
}

impl<'de> Deserialize<'de> for Units {
    fn deserialize<D: Deserializer<'de>>(input: D) -> std::result::Result<Self, D::Error> {
        struct Reader;

        impl<'de> Visitor<'de> for Reader {
            type Value = Units;

            fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
                out.write_str(
                    "a unit such as \"degrees\", or the numbers that are in one, { degrees = \"0-3\" }",
                )
            }

            fn visit_str<E: serde::de::Error>(self, word: &str) -> std::result::Result<Units, E> {
                word.parse().map(Units::All).map_err(E::custom)
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> std::result::Result<Units, A::Error> {
                BTreeMap::deserialize(value::MapAccessDeserializer::new(map)).map(Units::Some)
            }
        }

        input.deserialize_any(Reader)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

    use std::fs;

    use super::*;
    use crate::data::demonstration::episode::Format;

    #[test]
    fn what_is_written_is_read_as_the_same() {
        let text = "rate = 12.5\n[actions]\norder = [1, 0]\nsign = [1, -1]\nscale = 2\noffset = [0.5, 0]\nunits = 'controls'\n\
                    [observations]\nunits = { degrees = '0-3', percent = '5' }\n";
        let read = SetFile::parse(text).unwrap();
        assert_eq!(read.rate, Some(12.5));
        assert_eq!(read.actions.sign, Some(Each::Listed(vec![1.0, -1.0])));
        assert_eq!(read.actions.units, Some(Units::All(Unit::Controls)));
        let lines = read.to_string();
        assert!(
            lines.contains("actions.order = [1, 0]\nactions.sign = [1, -1]\nactions.scale = 2\n"),
            "{lines}"
        );
        assert!(lines.contains("observations.units = { degrees = \"0-3\", percent = \"5\" }\n"), "{lines}");
        assert_eq!(SetFile::parse(&lines).unwrap(), read);
        assert_eq!(serde_json::from_value::<SetFile>(serde_json::to_value(&read).unwrap()).unwrap(), read);
        let nothing = SetFile::parse("").unwrap();
        assert!(nothing.is_none() && nothing.to_string().is_empty());
    }

    #[test]
    fn a_mistake_is_named_with_what_would_be_right() {
        for (text, wanted) in [
            ("[actions]\nunit = 'degrees'", "unknown key `unit`, expected one of `order`, `sign`, `scale`"),
            (
                "action.units = 'degrees'",
                "unknown key `action`, expected one of `rate`, `actions`, `observations`",
            ),
            ("actions.units = 'deg'", "there is no unit 'deg'; there are: task, controls, degrees, percent"),
            ("actions.units = { degree = '0' }", "there is no unit 'degree'"),
            ("actions.units = { degrees = 'all' }", "'all' is no list of numbers"),
            ("actions.sign = [1, 2]", "actions: sign holds 2; wanted 1 or -1"),
            ("actions.scale = 0", "actions: scale holds 0; wanted a finite number other than 0"),
            ("observations.order = [0, 2, 0]", "observations: order holds 0 twice"),
            ("rate = -5", "rate = -5, and must be a number above 0"),
            ("actions.scale = 'big'", "a number, or a list of one for each number of the task"),
        ] {
            let error = SetFile::parse(text).unwrap_err();
            assert!(error.is_bad_config() && error.to_string().contains(wanted), "{text}: {error}");
        }
    }

    #[test]
    fn it_may_come_from_another_system_and_a_pipe_is_not_waited_for() {
        let folder = std::env::temp_dir().join(format!("demosift-set-text-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let read = |name: &str, bytes: &[u8]| {
            fs::write(folder.join(name), bytes).unwrap();
            SetFile::read(&folder.join(name))
        };
        let lines = "rate = 25\r\nactions.units = 'degrees'\r\n";
        let marked = read("marked", format!("\u{feff}{lines}").as_bytes()).unwrap();
        assert_eq!(marked, SetFile::parse("rate = 25\nactions.units = 'degrees'").unwrap());
        let wide: Vec<u8> = lines.encode_utf16().flat_map(u16::to_le_bytes).collect();
        let error = read("wide", &[&[0xff, 0xfe][..], &wide].concat()).unwrap_err();
        assert!(
            error.to_string().contains("the set file is text in UTF-16") && error.hint().is_some(),
            "{error}"
        );
        assert!(read("latin", b"# \xe4\n").unwrap_err().to_string().contains("not text in UTF-8"));
        let comma = read("comma", b"rate = 25,5").unwrap_err();
        assert!(
            comma.is_bad_config() && comma.to_string().contains("the set file is wrong at line 1"),
            "{comma}"
        );
        let pipe = folder.join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        for endless in [pipe.as_path(), Path::new("/dev/zero")] {
            assert!(SetFile::read(endless).unwrap_err().to_string().contains("this is a pipe, a device"));
        }
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn it_is_found_in_the_folder_of_a_set_or_beside_its_file() {
        let root = std::env::temp_dir().join(format!("demosift-set-file-{}", std::process::id()));
        fs::create_dir_all(root.join("minari/data")).unwrap();
        let located = |path: PathBuf, format| Located { path, format };
        fs::write(root.join("minari/data/main_data.hdf5"), b"").unwrap();
        let minari = located(root.join("minari/data/main_data.hdf5"), Format::MinariHdf5);
        assert_eq!(find(&minari), None);
        fs::write(root.join("minari/set.toml"), b"").unwrap();
        assert_eq!(find(&minari), Some(root.join("minari/set.toml")));
        assert_eq!(place_for(&minari), root.join("minari/set.toml"));
        let folder = located(root.join("minari"), Format::LeRobotV3);
        assert_eq!(find(&folder), Some(root.join("minari/set.toml")));
        fs::write(root.join("lift.hdf5"), b"").unwrap();
        let file = located(root.join("lift.hdf5"), Format::Robomimic);
        assert_eq!(find(&file), None);
        assert_eq!(place_for(&file), root.join("lift.set.toml"));
        fs::write(root.join("set.toml"), b"").unwrap();
        assert_eq!(find(&file), Some(root.join("set.toml")));
        fs::write(root.join("lift.set.toml"), b"").unwrap();
        assert_eq!(find(&file), Some(root.join("lift.set.toml")));
        fs::remove_dir_all(&root).unwrap();
    }
}
