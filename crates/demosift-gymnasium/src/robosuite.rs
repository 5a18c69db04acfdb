//! The environment of robosuite that a set of robomimic names, as `python/demosift_worker/robosuite_env.py` makes it.

use demosift::data::demonstration::robomimic::{NamedEnvironment, Observed};
use demosift::{Error, Result};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

/// Robomimic's numbers for kinds of environments, of which the first is robosuite's.
const KINDS: [(i64, &str); 4] = [(1, "robosuite"), (2, "gym"), (3, "iGibson"), (4, "a real robot")];
const ANOTHER_WAY: &str =
    "name an environment of your own, such as --env my_env.py:make or --env gymnasium:ID";

/// What a set of robomimic says of its environment, as far as that decides what is played; a run writes it down.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Specified {
    env_name: String,
    /// The version of robosuite in which the set was recorded, where it says so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    env_version: Option<String>,
    env_kwargs: Map<String, Value>,
    /// What an observation is made of, in the order of the set's columns.
    observed: Vec<Observed>,
}

/// The environment that a set names, as a run writes it down.
///
/// # Errors
/// `is_bad_input` if `env_args` cannot be read, or is not of an environment of robosuite.
pub(crate) fn specified(named: &NamedEnvironment) -> Result<String> {
    let NamedEnvironment { arguments, observed, .. } = named;
    let arguments: Value = serde_json::from_str(arguments)
        .map_err(|error| Error::bad_input(format!("env_args of the set cannot be read: {error}")))?;
    match arguments.get("type").and_then(Value::as_i64) {
        Some(1) => {}
        kind => return Err(another_kind(kind, &arguments)),
    }
    let Some(env_name) = arguments.get("env_name").and_then(Value::as_str) else {
        return Err(
            Error::bad_input("the set names no environment: env_args has no env_name").with_hint(ANOTHER_WAY)
        );
    };
    let env_version = arguments.get("env_version").and_then(Value::as_str);
    let env_kwargs = arguments.get("env_kwargs").and_then(Value::as_object);
    let specified = Specified {
        env_name: env_name.to_owned(),
        env_version: env_version.map(str::to_owned),
        env_kwargs: env_kwargs.cloned().unwrap_or_default(),
        observed: observed.clone(),
    };
    serde_json::to_string(&specified)
        .map_err(|error| Error::bad_input(format!("env_args of the set cannot be written down: {error}")))
}

fn another_kind(kind: Option<i64>, arguments: &Value) -> Error {
    let words = match kind {
        None => "does not say of which kind".to_owned(),
        Some(kind) => {
            let known = KINDS.iter().find(|(number, _)| *number == kind);
            format!("says type {kind}{}", known.map_or_else(String::new, |(_, name)| format!(", {name}")))
        }
    };
    let name = arguments.get("env_name").and_then(Value::as_str).unwrap_or("");
    Error::bad_input(format!(
        "env_args of the set names the environment '{name}' and {words}; from-set makes those of type 1, robosuite"
    ))
    .with_hint(ANOTHER_WAY)
}

/// Whether this is what [`specified`] wrote, and not an `EnvSpec` of Gymnasium.
pub(crate) fn is_one(spec: &str) -> bool {
    read(spec).is_some()
}

/// The name of the environment.
pub(crate) fn name(spec: &str) -> Option<String> {
    read(spec).map(|specified| specified.env_name)
}

/// The version of robosuite in which the set was recorded, where it says so.
pub(crate) fn version(spec: &str) -> Option<String> {
    read(spec)?.env_version
}

fn read(spec: &str) -> Option<Specified> {
    serde_json::from_str(spec).ok()
}

/// As a worker is asked for it; `longest` is the number of steps of the longest episode of the set, where that is known.
pub(crate) fn request(spec: &str, longest: Option<usize>) -> Value {
    let spec: Value = serde_json::from_str(spec).unwrap_or_default();
    json!({ "kind": "robosuite", "robosuite": spec, "longest": longest })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn named(arguments: &str) -> NamedEnvironment {
        let observed = vec![
            Observed { key: "object".to_owned(), part: None },
            Observed { key: "robot0_eef_pos".to_owned(), part: Some((0, Some(2))) },
        ];
        NamedEnvironment { arguments: arguments.to_owned(), observed, longest: 57 }
    }

    #[test]
    fn what_decides_what_is_played_is_written_down() {
        let arguments =
            r#"{"env_name": "Lift", "type": 1, "env_version": "1.4.1", "env_kwargs": {"robots": ["Panda"]}}"#;
        let spec = specified(&named(arguments)).unwrap();
        let written: Value = serde_json::from_str(&spec).unwrap();
        let wanted = json!({
            "env_name": "Lift",
            "env_version": "1.4.1",
            "env_kwargs": { "robots": ["Panda"] },
            "observed": [{ "key": "object", "part": null }, { "key": "robot0_eef_pos", "part": [0, 2] }],
        });
        assert_eq!(written, wanted);
        assert_eq!((name(&spec).as_deref(), version(&spec).as_deref()), (Some("Lift"), Some("1.4.1")));
        assert!(is_one(&spec) && !is_one(r#"{"id": "Pendulum-v1"}"#));
    }

    #[test]
    fn what_is_not_of_robosuite_is_refused_with_what_would_be() {
        for (arguments, said) in [
            ("{", "cannot be read"),
            (
                r#"{"env_name": "Hopper-v3", "type": 2, "env_kwargs": {}}"#,
                "'Hopper-v3' and says type 2, gym; from-set makes those of type 1, robosuite",
            ),
            (r#"{"env_name": "x", "type": 3}"#, "says type 3, iGibson"),
            (r#"{"env_name": "x", "type": 9}"#, "says type 9;"),
            (r#"{"env_name": "x"}"#, "does not say of which kind"),
            (r#"{"type": 1}"#, "env_args has no env_name"),
        ] {
            let error = specified(&named(arguments)).unwrap_err();
            assert!(error.is_bad_input() && error.to_string().contains(said), "{arguments}: {error}");
        }
    }
}
