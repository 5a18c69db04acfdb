//! What a file of demonstrations holds, as arrays.

use std::path::PathBuf;

use demosift::data::demonstration::choice::Choice;
use demosift::data::demonstration::episode::{Columns, Format};
use demosift::data::demonstration::numbers::Numbers;
use demosift::data::demonstration::open;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// One episode: its position in the file, its label, and observations `[T, obs]` and actions `[T, act]` as bytes of f32 with
/// their widths.
type Recorded<'py> = (usize, String, Bound<'py, PyBytes>, usize, Bound<'py, PyBytes>, usize);

/// The episodes of a file or folder of any format that is known, in its own numbers; `episodes` chooses some, such as `0-9,12`.
#[pyfunction]
pub(crate) fn read<'py>(
    py: Python<'py>,
    path: PathBuf,
    format: Option<String>,
    observation_columns: Vec<String>,
    action_columns: Vec<String>,
    episodes: Option<String>,
) -> PyResult<Vec<Recorded<'py>>> {
    let source = py.detach(|| {
        let format = format.map(|format| format.parse::<Format>()).transpose()?;
        let columns = Columns { observations: observation_columns, actions: action_columns };
        let episodes = episodes.map(|episodes| episodes.parse::<Numbers>()).transpose()?;
        open::open_chosen(&path, format, &columns, &Choice { episodes, ..Choice::default() })
    });
    let source = source.map_err(|error| crate::raised(&error))?;
    let bytes = |numbers: &[f32]| PyBytes::new(py, &crate::bytes_of(numbers));
    let episodes = source.ids.iter().zip(&source.episodes).map(|(id, episode)| {
        let (observations, actions) = (&episode.observations, &episode.actions);
        let (observed, acted) = (bytes(observations.flat()), bytes(actions.flat()));
        (id.0, episode.label.clone(), observed, observations.width(), acted, actions.width())
    });
    Ok(episodes.collect())
}
