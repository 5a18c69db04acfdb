//! What the user calls an environment, such as `gymnasium:HalfCheetah-v5`, `my_env.py:make` or `package.module:make`.

use std::fs;
use std::path::{Path, PathBuf};

use demosift::data::demonstration::episode::Format;
use demosift::data::demonstration::{open, robomimic};
use demosift::{Error, Result};
use serde_json::{Value, json};

use crate::robosuite;

/// What stands before the name of a registered environment.
const GYMNASIUM: &str = "gymnasium:";
/// The environment that the demonstrations name themselves.
const FROM_SET: &str = "from-set";
const WANTED: &str = "wanted gymnasium:ID such as gymnasium:HalfCheetah-v5, FILE.py:FUNCTION such as my_env.py:make, \
                      package.module:FUNCTION, or from-set";
const WANTED_OWN: &str = "wanted FILE.py:FUNCTION such as my_env.py:measure, or package.module:FUNCTION";
const WANTED_TRAINER: &str = "wanted FILE.py:FUNCTION such as my_train.py:train, or package.module:FUNCTION";

/// Where an environment or a trainer comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// Registered in Gymnasium.
    Gymnasium(String),
    /// Made by a function, or a class, in a file.
    File {
        /// The file, absolute.
        file: PathBuf,
        /// The function without arguments.
        name: String,
    },
    /// Made by a function, or a class, of a module that Python can import.
    Module {
        /// Such as `package.module`.
        module: String,
        /// The function without arguments.
        name: String,
    },
    /// Named by a set of Minari.
    Set {
        /// The `EnvSpec` as Gymnasium writes it in JSON.
        spec: String,
        /// Whether code that the set names may run although nobody registered it.
        trusted: bool,
    },
    /// Of robosuite, named by a set of robomimic.
    Robosuite {
        /// What decides what is played, in JSON.
        spec: String,
        /// Steps of the longest episode of the set, where that is known.
        longest: Option<usize>,
    },
}

/// The set of demonstrations that may name its environment.
#[derive(Clone, Copy, Debug)]
pub struct NamingSet<'a> {
    /// Where it lies.
    pub path: &'a Path,
    /// Its format, if not the one that is found.
    pub format: Option<Format>,
    /// What of it is an observation; without any, what is usual.
    pub observations: &'a [String],
}

impl<'a> NamingSet<'a> {
    /// A set of which all is as usual.
    pub fn usual(path: &'a Path) -> Self {
        Self { path, format: None, observations: &[] }
    }
}

impl Source {
    /// What is typed, where `set` is the set of demonstrations that `from-set` means.
    ///
    /// # Errors
    /// `is_bad_input` if it is nothing of that kind, the file does not exist, or the set names no environment.
    ///
    /// ```
    /// use demosift_gymnasium::source::Source;
    ///
    /// let source = Source::parse("gymnasium:HalfCheetah-v5", None, false)?;
    /// assert_eq!((source.words(), source.short_name()), ("gymnasium:HalfCheetah-v5".to_owned(), "HalfCheetah-v5".to_owned()));
    /// let error = Source::parse("HalfCheetah-v5", None, false).unwrap_err();
    /// assert_eq!(error.hint(), Some("did you mean gymnasium:HalfCheetah-v5?"));
    /// # Ok::<(), demosift::Error>(())
    /// ```
    pub fn parse(typed: &str, set: Option<NamingSet<'_>>, trusted: bool) -> Result<Self> {
        if typed == FROM_SET {
            let set = set.ok_or_else(|| {
                Error::bad_input("from-set means the environment of the demonstrations, and none are given")
            })?;
            return Self::of_set(set, trusted);
        }
        if let Some(id) = typed.strip_prefix(GYMNASIUM).filter(|id| !id.is_empty()) {
            return Ok(Self::Gymnasium(id.to_owned()));
        }
        Self::of_function(typed, "environment", WANTED)
    }

    /// The environment that a set names.
    fn of_set(set: NamingSet<'_>, trusted: bool) -> Result<Self> {
        if let Ok(located) = open::located(set.path, set.format)
            && located.format == Format::Robomimic
        {
            let named = robomimic::environment(&located.path, set.observations)?;
            let spec = robosuite::specified(&named).map_err(|error| error.at(&located.path))?;
            return Ok(Self::Robosuite { spec, longest: Some(named.longest) });
        }
        Ok(Self::Set { spec: spec_of(set.path)?, trusted })
    }

    /// The environment that a set named when a run was begun, as [`spec`](Source::spec) told it.
    pub fn of_spec(spec: String, trusted: bool) -> Self {
        match robosuite::is_one(&spec) {
            true => Self::Robosuite { spec, longest: None },
            false => Self::Set { spec, trusted },
        }
    }

    /// A trainer as it is typed: a function in a file or a module.
    ///
    /// # Errors
    /// `is_bad_input` if it is nothing of that kind, or the file does not exist.
    pub(crate) fn of_trainer(typed: &str) -> Result<Self> {
        Self::of_function(typed, "trainer", WANTED_TRAINER)
    }

    /// A function of the user's beside an environment, called `what` in errors.
    ///
    /// # Errors
    /// As [`of_trainer`](Source::of_trainer).
    pub(crate) fn of_own(typed: &str, what: &str) -> Result<Self> {
        Self::of_function(typed, what, WANTED_OWN)
    }

    /// A function in a file or a module; `what` and `wanted` are for errors.
    fn of_function(typed: &str, what: &str, wanted: &str) -> Result<Self> {
        let parts = typed.rsplit_once(':').filter(|(from, name)| !from.is_empty() && !name.is_empty());
        let Some((from, name)) = parts else {
            if is_python(typed) {
                let message = format!("'{typed}' names a file, and no function in it");
                return Err(Error::bad_input(message).with_hint(format!("write {typed}:FUNCTION")));
            }
            let hint = match what == "environment" && (typed.contains("-v") || typed.contains('/')) {
                true => format!("did you mean {GYMNASIUM}{typed}?"),
                false => wanted.to_owned(),
            };
            let message = format!("'{typed}' is no {what}: what is before the colon is missing");
            return Err(Error::bad_input(message).with_hint(hint));
        };
        if is_python(from) {
            let file = fs::canonicalize(from).map_err(|error| {
                Error::io(&format!("cannot find the {what}'s file"), Path::new(from), &error)
            })?;
            return Ok(Self::File { file, name: name.to_owned() });
        }
        if from.contains(std::path::MAIN_SEPARATOR) {
            let message =
                format!("'{typed}' is no {what}: '{from}' is neither a file of Python nor a module");
            return Err(Error::bad_input(message).with_hint(wanted));
        }
        Ok(Self::Module { module: from.to_owned(), name: name.to_owned() })
    }

    /// What to type for it, from any working directory.
    pub fn words(&self) -> String {
        match self {
            Self::Gymnasium(id) => format!("{GYMNASIUM}{id}"),
            Self::File { file, name } => format!("{}:{name}", file.display()),
            Self::Module { module, name } => format!("{module}:{name}"),
            Self::Set { .. } | Self::Robosuite { .. } => FROM_SET.to_owned(),
        }
    }

    /// Its name for people and for folders.
    pub fn short_name(&self) -> String {
        let name = match self {
            Self::Gymnasium(id) => id.clone(),
            Self::File { file, .. } => file
                .file_stem()
                .map_or_else(|| "environment".to_owned(), |stem| stem.to_string_lossy().into_owned()),
            Self::Module { module, .. } => module.clone(),
            Self::Set { spec, .. } => id_of(spec),
            Self::Robosuite { spec, .. } => robosuite::name(spec).unwrap_or_else(|| "environment".to_owned()),
        };
        // A namespace or a module before an id makes no folder.
        name.rsplit(['/', ':']).next().unwrap_or(&name).to_owned()
    }

    /// A function's name for people, such as `my_env.py:make`.
    pub(crate) fn function_name(&self) -> String {
        match self {
            Self::File { file, name } => {
                let file = file.file_name().map(|file| file.to_string_lossy().into_owned());
                format!("{}:{name}", file.unwrap_or_default())
            }
            _ => self.words(),
        }
    }

    /// The file of Python that it is in, where that is known.
    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::File { file, .. } => Some(file),
            _ => None,
        }
    }

    /// What the set says of its environment, where it is meant.
    pub fn spec(&self) -> Option<&str> {
        match self {
            Self::Set { spec, .. } | Self::Robosuite { spec, .. } => Some(spec),
            _ => None,
        }
    }

    /// The version of robosuite in which the set was recorded that names it, where it says so.
    pub fn recorded_in(&self) -> Option<String> {
        match self {
            Self::Robosuite { spec, .. } => robosuite::version(spec),
            _ => None,
        }
    }

    /// As a worker is asked for it.
    pub(crate) fn request(&self) -> Value {
        match self {
            Self::Gymnasium(id) => json!({ "kind": "gymnasium", "name": id }),
            Self::File { file, name } => json!({ "kind": "file", "file": file, "name": name }),
            Self::Module { module, name } => json!({ "kind": "module", "module": module, "name": name }),
            Self::Set { spec, trusted } => json!({ "spec": spec, "trust": trusted }),
            Self::Robosuite { spec, longest } => robosuite::request(spec, *longest),
        }
    }
}

/// Whether a name is that of a file of Python.
pub(crate) fn is_python(name: &str) -> bool {
    Path::new(name).extension().is_some_and(|extension| extension == "py")
}

fn id_of(spec: &str) -> String {
    let id = serde_json::from_str::<Value>(spec).ok();
    id.and_then(|spec| Some(spec.get("id")?.as_str()?.to_owned())).unwrap_or_else(|| "environment".to_owned())
}

/// The `env_spec` of a Minari set: its folder, the folder `data` in it, or a file of that.
fn spec_of(set: &Path) -> Result<String> {
    let places =
        [set.join("data/metadata.json"), set.join("metadata.json"), set.with_file_name("metadata.json")];
    let Some(place) = places.iter().find(|place| place.is_file()) else {
        if !set.exists() {
            open::located(set, None)?;
        }
        return Err(Error::bad_input(
            "the set names no environment: only sets of Minari do, in data/metadata.json, and of robomimic, in env_args",
        )
        .at(set)
        .with_hint("name it yourself, such as --env gymnasium:HalfCheetah-v5"));
    };
    let text = fs::read_to_string(place).map_err(|error| Error::io("cannot read", place, &error))?;
    let metadata: Value = serde_json::from_str(&text)
        .map_err(|error| Error::bad_input(format!("the metadata cannot be read: {error}")).at(place))?;
    match metadata.get("env_spec") {
        Some(Value::String(spec)) => Ok(spec.clone()),
        Some(spec @ Value::Object(_)) => Ok(spec.to_string()),
        _ => Err(Error::bad_input("the set names no environment: env_spec is missing or null")
            .at(place)
            .with_hint("name it yourself, such as --env gymnasium:HalfCheetah-v5")),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn each_way_to_name_an_environment_is_understood() {
        let gymnasium = Source::parse("gymnasium:panda_gym:PandaPush-v3", None, false).unwrap();
        assert_eq!(gymnasium, Source::Gymnasium("panda_gym:PandaPush-v3".to_owned()));
        assert_eq!(gymnasium.short_name(), "PandaPush-v3");
        let module = Source::parse("lab.envs:make", None, false).unwrap();
        assert_eq!(module, Source::Module { module: "lab.envs".to_owned(), name: "make".to_owned() });
        assert_eq!((module.words().as_str(), module.short_name().as_str()), ("lab.envs:make", "lab.envs"));
    }

    #[test]
    fn what_is_no_environment_is_refused_with_what_would_be_one() {
        for (typed, said) in [
            ("HalfCheetah", "what is before the colon is missing"),
            ("gymnasium:", "what is before the colon is missing"),
            (":make", "what is before the colon is missing"),
            ("folder/module:make", "neither a file of Python nor a module"),
            ("my_env.py", "'my_env.py' names a file, and no function in it"),
            ("no_such_file.py:make", "cannot find the environment's file"),
            ("from-set", "none are given"),
        ] {
            let error = Source::parse(typed, None, false).unwrap_err();
            assert!(error.to_string().contains(said), "{typed}: {error}");
        }
    }

    #[test]
    fn a_set_of_minari_names_its_environment() {
        let folder = std::env::temp_dir().join(format!("demosift-spec-{}", std::process::id()));
        fs::create_dir_all(folder.join("data")).unwrap();
        let metadata = folder.join("data/metadata.json");
        let error_with = |text: &str| {
            fs::write(&metadata, text).unwrap();
            Source::parse("from-set", Some(NamingSet::usual(&folder)), false).unwrap_err().to_string()
        };
        assert!(error_with(r#"{"env_spec": null}"#).contains("env_spec is missing or null"));
        assert!(error_with("{").contains("cannot be read"));
        fs::write(
            &metadata,
            r#"{"action_space": "{\"low\": [-Infinity]}", "env_spec": "{\"id\": \"Reach/Far-v1\"}"}"#,
        )
        .unwrap();
        for path in [folder.clone(), folder.join("data"), folder.join("data/main_data.hdf5")] {
            let source = Source::parse("from-set", Some(NamingSet::usual(&path)), true).unwrap();
            assert_eq!(source.short_name(), "Far-v1");
            assert_eq!(source, Source::Set { spec: r#"{"id": "Reach/Far-v1"}"#.to_owned(), trusted: true });
        }
        let nowhere = folder.join("nowhere");
        let error = Source::parse("from-set", Some(NamingSet::usual(&nowhere)), false).unwrap_err();
        assert!(error.to_string().contains("does not exist"), "{error}");
        fs::remove_dir_all(&folder).unwrap();
    }
}
