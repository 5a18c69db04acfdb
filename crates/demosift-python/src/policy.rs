//! A policy of a run.

use demosift::results::artifact;
use demosift::world::policy::{self, Player};
use demosift_gymnasium::units::Units;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// A policy from the bytes of its safetensors; with `bounds` it acts in the environment's own unit, without from −1 to 1.
#[pyclass(frozen)]
pub(crate) struct Policy {
    policy: policy::Policy,
    units: Option<Units>,
}

#[pymethods]
impl Policy {
    #[new]
    fn new(safetensors: &[u8], name: &str, bounds: Option<Vec<[f64; 2]>>) -> PyResult<Self> {
        let policy = artifact::read_policy(safetensors, name).map_err(|error| crate::raised(&error))?;
        if bounds.as_ref().is_some_and(|bounds| bounds.len() != policy.action_size()) {
            return Err(PyValueError::new_err("there must be bounds for each number of an action"));
        }
        Ok(Self { policy, units: bounds.as_deref().map(Units::new) })
    }

    #[getter]
    fn observation_size(&self) -> usize {
        self.policy.filter().observation_size()
    }

    #[getter]
    fn action_size(&self) -> usize {
        self.policy.action_size()
    }

    /// The mean action on an observation, both as bytes of f32.
    fn act<'py>(&self, py: Python<'py>, observation: &[u8]) -> PyResult<Bound<'py, PyBytes>> {
        let observation = crate::f32s(observation);
        let (found, wanted) = (observation.len(), self.observation_size());
        if found != wanted {
            return Err(PyValueError::new_err(format!(
                "the observation has {found} numbers, and the policy takes {wanted}"
            )));
        }
        let mut action = vec![0.0; self.action_size()];
        Player::new(&self.policy).mean(&observation, &mut action);
        let action: Vec<f32> = match &self.units {
            None => action.iter().map(|number| number.clamp(-1.0, 1.0)).collect(),
            Some(units) => {
                let mut own = vec![0.0; action.len()];
                units.to_own(&action, &mut own);
                own.iter().map(|number| *number as f32).collect()
            }
        };
        Ok(PyBytes::new(py, &crate::bytes_of(&action)))
    }
}
