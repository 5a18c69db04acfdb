//! Whole episodes in an environment of this interpreter.

use std::time::{Duration, Instant};

use demosift::Error;
use demosift_gymnasium::turn::{Turn, TurnSizes};
use demosift_gymnasium::whole::{self, Turns};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// How often whoever waits is told that something happens; well below the shortest time limit.
const BEAT: Duration = Duration::from_millis(250);

/// An environment as `worker.py` steps it.
struct InPython<'py> {
    reset: Bound<'py, PyAny>,
    step: Bound<'py, PyAny>,
    beat: Bound<'py, PyAny>,
    sizes: TurnSizes,
    beaten: Instant,
    /// What the environment raised.
    raised: Option<PyErr>,
}

/// Plays the episodes of a request, as `demosift_gymnasium::whole` describes it, in the `Player` of `worker.py`.
#[pyfunction]
pub(crate) fn play<'py>(
    request: &[u8],
    player: &Bound<'py, PyAny>,
    beat: Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyBytes>> {
    let (observation, info) = player.call_method0("sizes")?.extract()?;
    let mut turns = InPython {
        reset: player.getattr("reset")?,
        step: player.getattr("step")?,
        beat,
        sizes: TurnSizes { observation, info },
        beaten: Instant::now(),
        raised: None,
    };
    let answer = whole::answer(request, &mut turns);
    match (answer, turns.raised) {
        (_, Some(raised)) => Err(raised),
        (Err(error), None) => Err(crate::raised(&error)),
        (Ok(answer), None) => Ok(PyBytes::new(player.py(), &answer)),
    }
}

impl InPython<'_> {
    fn turn(&mut self, called: PyResult<Bound<'_, PyAny>>, turn: &mut Turn) -> demosift::Result<()> {
        let sizes = self.sizes;
        let read = called.and_then(|payload| {
            Ok(turn.read(payload.cast::<PyBytes>().map_err(PyErr::from)?.as_bytes(), sizes))
        });
        match read {
            Ok(true) => Ok(()),
            Ok(false) => Err(Error::simulation("what the environment was stepped to is no turn")),
            Err(raised) => {
                self.raised = Some(raised);
                Err(Error::simulation("the environment raised an exception"))
            }
        }
    }
}

impl Turns for InPython<'_> {
    fn reset(&mut self, seed: u64, turn: &mut Turn) -> demosift::Result<()> {
        let called = self.reset.call1((seed,));
        self.turn(called, turn)
    }

    fn step(&mut self, action: &[f64], turn: &mut Turn) -> demosift::Result<()> {
        let payload: Vec<u8> = action.iter().flat_map(|number| number.to_le_bytes()).collect();
        if self.beaten.elapsed() > BEAT {
            self.beaten = Instant::now();
            if let Err(raised) = self.beat.call0() {
                self.raised = Some(raised);
                return Err(Error::simulation("nobody waits for the episode"));
            }
        }
        let called = self.step.call1((PyBytes::new(self.step.py(), &payload),));
        self.turn(called, turn)
    }
}
