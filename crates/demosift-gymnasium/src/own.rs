//! Functions of the user's own beside an environment, which its worker calls: `measure` after each step, and `score`, the
//! heuristic of a whole episode.

use std::path::PathBuf;

use demosift::Result;
use serde_json::{Value, json};

use crate::source::{Source, is_python};

/// The measurement that a score is: 0 until the last step of an episode.
const SCORE: &str = "score";

/// Which functions there are.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Own {
    measure: Option<Source>,
    score: Option<Source>,
}

/// What a user says of a heuristic: words, or a function.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Said {
    /// The functions.
    pub(crate) own: Own,
    /// The fold that the heuristic is, in words.
    pub(crate) fold: String,
}

/// Reads what is typed for a measure and a heuristic, of which the second may be words.
///
/// # Errors
/// `is_bad_input` if one is no function of a file or module, or its file does not exist.
pub(crate) fn said(measure: Option<&str>, heuristic: &str) -> Result<Said> {
    let measure = measure.map(|typed| Source::of_own(typed, "measure")).transpose()?;
    Ok(match is_function(heuristic) {
        true => {
            let score = Some(Source::of_own(heuristic, SCORE)?);
            Said { own: Own { measure, score }, fold: format!("last {SCORE}") }
        }
        false => Said { own: Own { measure, score: None }, fold: heuristic.to_owned() },
    })
}

/// Whether a heuristic is meant to be a function and no words: `my_env.py:score`, or `package.module:score`.
fn is_function(typed: &str) -> bool {
    is_python(typed) || typed.contains(".py:") || typed.contains(':') && !typed.contains(char::is_whitespace)
}

impl Own {
    /// As a worker is asked for them.
    pub(crate) fn request(&self) -> Value {
        let one = |source: &Option<Source>| {
            source.as_ref().map(|source| {
                let mut asked = source.request();
                asked["words"] = json!(source.function_name());
                asked
            })
        };
        json!({ "measure": one(&self.measure), "score": one(&self.score) })
    }

    /// What to type for the function that measures, from any working directory.
    pub(crate) fn measure_words(&self) -> Option<String> {
        self.measure.as_ref().map(Source::words)
    }

    /// What to type for the function that scores, and its name for people.
    pub(crate) fn score_words(&self) -> Option<[String; 2]> {
        self.score.as_ref().map(|source| [source.words(), source.function_name()])
    }

    /// The files of Python that they are in, where these are known.
    pub(crate) fn files(&self) -> Vec<PathBuf> {
        let files = [&self.measure, &self.score].into_iter().flatten().filter_map(Source::file);
        files.map(std::path::Path::to_owned).collect()
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn words_and_functions_are_told_apart() {
        for words in ["sum reward", "negated min gap", "count", "sum a:b", "any is_success"] {
            assert_eq!(said(None, words).unwrap(), Said { own: Own::default(), fold: words.to_owned() });
        }
        let of_module = said(None, "package.module:score").unwrap();
        assert_eq!(of_module.fold, "last score");
        assert_eq!(of_module.own.score_words().unwrap()[0], "package.module:score");
        for file in ["my env.py", "no_such.py"] {
            let error = said(None, &format!("{file}:score")).unwrap_err().to_string();
            assert!(error.starts_with("cannot find the score's file") && error.ends_with(file), "{error}");
        }
        let error = said(None, "my_env.py").unwrap_err();
        assert_eq!(error.to_string(), "'my_env.py' names a file, and no function in it");
        assert_eq!(error.hint(), Some("write my_env.py:FUNCTION"));
        let error = said(Some("measure"), "count").unwrap_err();
        assert!(error.to_string().contains("'measure' is no measure"), "{error}");
        assert!(error.hint().unwrap().contains("FILE.py:FUNCTION"), "{:?}", error.hint());
    }
}
