//! One environment that is open in a process: it is reset and stepped from here, or plays whole episodes there.

use std::collections::BTreeMap;

use demosift::data::trajectory::Parts;
use demosift::math::arithmetic;
use demosift::{Error, Result};
use serde::Deserialize;
use serde_json::json;

use crate::own::Own;
use crate::process::{Answer, Interpreter, Process};
use crate::source::Source;
use crate::turn::{Turn, TurnSizes, f64s};
use crate::whole::{self, Act, Sizes, Turns};

/// The version of the frames, the same in `python/demosift_worker/worker.py`.
pub(crate) const PROTOCOL: u32 = 6;
const OPEN: u8 = b'O';
const MEASURE: u8 = b'M';
const RESET: u8 = b'R';
const STEP: u8 = b'S';
const PUT: u8 = b'I';
const STATE: u8 = b'Q';
const VIEW: u8 = b'V';
const NUMBERS: u8 = b'A';
const GREETING: u8 = b'G';
pub(crate) const DONE: u8 = b'K';
const TURN: u8 = b'T';
pub(crate) const PROBLEM: u8 = b'E';
const PLAY: u8 = b'P';
const PLAYED: u8 = b'W';
const FUNCTION: &str = "function";
const RETURNED: &str = "returned";

/// What an environment says of itself when it is opened.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub(crate) struct Greeting {
    pub(crate) protocol: u32,
    /// Of Python and of all that the physics depend on.
    pub(crate) versions: BTreeMap<String, String>,
    /// The parts of an observation, by name, and how many numbers each has.
    pub(crate) parts: Vec<(String, usize)>,
    /// Of each number of an action, in the environment's own unit.
    pub(crate) bounds: Vec<[f64; 2]>,
    /// Names of the numbers in info after one step.
    pub(crate) info: Vec<String>,
    /// Steps after which it stops an episode by itself.
    pub(crate) limit: Option<usize>,
    /// Steps that an episode has where nobody says how many.
    pub(crate) usual: Option<usize>,
    /// Whether it can be put into a recorded state.
    pub(crate) is_put: bool,
    /// Simulated seconds of a step, where it says so.
    pub(crate) step_secs: Option<f64>,
    /// Seconds of a picture.
    pub(crate) picture_secs: Option<f64>,
    /// What plays whole episodes there, if demosift can be imported; see [`whole::PLAYER`].
    pub(crate) player: Option<String>,
}

/// What was wrong in the process.
#[derive(Deserialize)]
pub(crate) struct Problem {
    /// `refused` if what the user has works and cannot be used, `raised` if it does not work, `returned` if the message says what
    /// the environment returned, `function` if a function of theirs beside the environment is at fault, whose name the message
    /// begins with.
    pub(crate) kind: String,
    pub(crate) message: String,
    pub(crate) hint: Option<String>,
    /// Where in the code.
    place: Option<String>,
    /// Whether there is an environment that was made.
    made: bool,
}

impl Problem {
    /// Where in the code, as the end of a sentence.
    pub(crate) fn place_in_words(&self) -> String {
        self.place.as_ref().map_or_else(String::new, |place| format!(" ({place})"))
    }
}

/// An open environment. After an error it is of no use.
pub(crate) struct Session {
    process: Process,
    sizes: TurnSizes,
    /// Whether the process plays whole episodes by itself.
    plays: bool,
    /// Whether the last request was answered; only then another one may be made.
    sound: bool,
}

impl Session {
    /// Starts a process and makes the environment in it.
    ///
    /// # Errors
    /// `is_bad_input` if there is no such interpreter or environment, or one that cannot be used.
    pub(crate) fn open(interpreter: &Interpreter, source: &Source, own: &Own) -> Result<(Self, Greeting)> {
        Self::open_as(interpreter, source, own, false)
    }

    /// The same of an environment that can be looked at.
    pub(crate) fn open_to_view(
        interpreter: &Interpreter,
        source: &Source,
        own: &Own,
    ) -> Result<(Self, Greeting)> {
        Self::open_as(interpreter, source, own, true)
    }

    fn open_as(
        interpreter: &Interpreter,
        source: &Source,
        own: &Own,
        to_view: bool,
    ) -> Result<(Self, Greeting)> {
        let mut process = Process::start(interpreter)?;
        let what = format!("the start of {}", source.words());
        let mut asked = source.request();
        asked["own"] = own.request();
        asked["pictures"] = to_view.into();
        let answer = process.ask(OPEN, asked.to_string().as_bytes(), &what)?;
        if answer.letter == PROBLEM {
            let problem = problem(&answer, &what)?;
            return Err(at_the_start(&problem, interpreter, source));
        }
        let greeting: Greeting = json_of(&answer, GREETING, &what)?;
        if greeting.protocol != PROTOCOL {
            return Err(Error::simulation(format!(
                "the worker speaks protocol {}, and this demosift {PROTOCOL}",
                greeting.protocol
            )));
        }
        let observation = greeting.parts.iter().map(|(_, width)| width).sum();
        if observation == 0 {
            let message = format!("an observation of {} has no numbers", source.words());
            return Err(Error::bad_input(message));
        }
        let sizes = TurnSizes { observation, info: 0 };
        // A process that plays by itself takes the quickest arithmetic that it has.
        let plays = greeting.player.as_deref() == Some(whole::PLAYER) && !arithmetic::is_portable();
        Ok((Self { process, sizes, plays, sound: true }, greeting))
    }

    /// Measures these numbers of info from now on, in episodes of at most `limit` steps. Returns all that were seen: if one of
    /// them is missing, nothing is measured.
    ///
    /// Some are there only at the end of an episode, so for one that is not there after the first step an episode of at most
    /// `look` steps is played; `None` if another process has seen them all.
    pub(crate) fn measure(
        &mut self,
        names: &[String],
        limit: usize,
        look: Option<usize>,
    ) -> Result<Vec<String>> {
        let asked = json!({ "names": names, "limit": limit, "look": look }).to_string();
        let answer = self.ask(MEASURE, asked.as_bytes(), "an episode of random actions")?;
        let known: Vec<String> = json_of(&answer, DONE, "names")?;
        if names.iter().all(|name| known.contains(name)) {
            self.sizes.info = names.len();
        }
        Ok(known)
    }

    /// Goes on from a recorded state, of this model where it is not the environment's own.
    pub(crate) fn put(&mut self, model: Option<&str>, state: &[f64], turn: &mut Turn) -> Result<()> {
        let model = model.unwrap_or("").as_bytes();
        let mut payload = Vec::with_capacity(4 + model.len() + 8 * state.len());
        payload.extend((model.len() as u32).to_le_bytes());
        payload.extend(model);
        payload.extend(state.iter().flat_map(|number| number.to_le_bytes()));
        let answer = self.ask(PUT, &payload, "going on from a recorded state")?;
        self.read_turn(&answer, turn)
    }

    /// The state that it is in: time, positions and velocities.
    pub(crate) fn state(&mut self) -> Result<Vec<f64>> {
        let answer = self.ask(STATE, &[], "a look at its state")?;
        if answer.letter != NUMBERS {
            self.sound = false;
            return Err(Error::simulation("the worker's answer to a look at its state is none"));
        }
        Ok(f64s(&answer.payload).collect())
    }

    /// What it looks like now, in a picture of at most so many columns and rows.
    pub(crate) fn view(&mut self, most: [u32; 2]) -> Result<View> {
        let payload: Vec<u8> = most.iter().flat_map(|side| side.to_le_bytes()).collect();
        let answer = self.ask(VIEW, &payload, "a look at it")?;
        let view = if answer.letter == VIEW { View::read(&answer.payload) } else { None };
        self.sound = view.is_some();
        view.ok_or_else(|| {
            Error::simulation("the worker's answer to a look at the environment is no picture")
        })
    }

    /// Plays whole episodes of one policy, one for each of `acts`, in the process if it has what plays there.
    pub(crate) fn play(&mut self, sizes: &Sizes, acts: &[Act<'_>]) -> Result<Vec<Parts>> {
        if !self.plays {
            return acts.iter().map(|act| whole::play(self, sizes, act)).collect();
        }
        let answer = self.ask(PLAY, &whole::request(sizes, acts)?, "a step of an episode")?;
        self.sound = false;
        let wanted = if answer.letter == PLAYED { answer.payload.as_slice() } else { &[] };
        let played = whole::episodes(wanted, acts.len(), sizes)?;
        self.sound = true;
        Ok(played)
    }

    /// Whether it answered all that was asked, so that it may be asked again.
    pub(crate) fn is_sound(&self) -> bool {
        self.sound
    }

    /// Lets the process close the environment, without waiting for it.
    pub(crate) fn close(&mut self) {
        self.process.close();
    }

    fn ask(&mut self, letter: u8, payload: &[u8], what: &str) -> Result<Answer> {
        self.sound = false;
        let answer = self.process.ask(letter, payload, what)?;
        if answer.letter == PROBLEM {
            let found = problem(&answer, what)?;
            let place = found.place_in_words();
            let Problem { kind, message, hint, .. } = found;
            let error = Error::simulation(match kind.as_str() {
                FUNCTION => message,
                RETURNED => format!("the environment {message}"),
                _ => format!("the environment failed in {what}: {message}{place}"),
            });
            return Err(match hint {
                Some(hint) => error.with_hint(hint),
                None => error,
            });
        }
        self.sound = true;
        Ok(answer)
    }

    fn read_turn(&mut self, answer: &Answer, turn: &mut Turn) -> Result<()> {
        if answer.letter != TURN || !turn.read(&answer.payload, self.sizes) {
            self.sound = false;
            return Err(Error::simulation("the worker's answer to a step is no turn"));
        }
        Ok(())
    }
}

/// A picture of an environment.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Red, green, blue of each pixel, row after row from the top; `[height · width · 3]`.
    pub rgb: Vec<u8>,
}

impl View {
    fn read(payload: &[u8]) -> Option<Self> {
        let (head, rgb) = payload.split_at_checked(8)?;
        let mut sides = head
            .chunks_exact(4)
            .map(|side| u32::from_le_bytes([side[0], side[1], side[2], side[3]]) as usize);
        let (width, height) = (sides.next()?, sides.next()?);
        let is_whole = width.checked_mul(height)?.checked_mul(3)? == rgb.len() && !rgb.is_empty();
        is_whole.then(|| Self { width, height, rgb: rgb.to_vec() })
    }
}

impl Turns for Session {
    fn reset(&mut self, seed: u64, turn: &mut Turn) -> Result<()> {
        let answer = self.ask(RESET, &seed.to_le_bytes(), "a reset")?;
        self.read_turn(&answer, turn)
    }

    fn step(&mut self, action: &[f64], turn: &mut Turn) -> Result<()> {
        let payload: Vec<u8> = action.iter().flat_map(|number| number.to_le_bytes()).collect();
        let answer = self.ask(STEP, &payload, "a step")?;
        self.read_turn(&answer, turn)
    }
}

fn problem(answer: &Answer, what: &str) -> Result<Problem> {
    json_of(answer, PROBLEM, what)
}

fn json_of<T: for<'a> Deserialize<'a>>(answer: &Answer, letter: u8, what: &str) -> Result<T> {
    let read = if answer.letter == letter { serde_json::from_slice(&answer.payload).ok() } else { None };
    read.ok_or_else(|| Error::simulation(format!("the worker's answer to {what} cannot be read")))
}

/// An environment that could not be made, or fails at once, is the user's to mend.
fn at_the_start(problem: &Problem, interpreter: &Interpreter, source: &Source) -> Error {
    let Problem { kind, message, hint, made, .. } = problem;
    let words = source.words();
    if kind == FUNCTION {
        let error = Error::bad_input(message.clone());
        return match message.contains("cannot be imported") {
            true => error.with_hint(install_or_name(message, interpreter)),
            false => error,
        };
    }
    if kind == "refused" || kind == RETURNED {
        let colon = if kind == RETURNED { "" } else { ":" };
        let error = Error::bad_input(format!("{words}{colon} {message}"));
        return match hint {
            Some(hint) => error.with_hint(hint),
            None => error,
        };
    }
    let place = problem.place_in_words();
    let what = if *made { "was made, and fails when it is tried" } else { "cannot be made" };
    Error::bad_input(format!("{words} {what}: {message}{place}"))
        .with_hint(hint.clone().unwrap_or_else(|| install_or_name(message, interpreter)))
}

/// What helps where something could not be imported or made.
pub(crate) fn install_or_name(message: &str, interpreter: &Interpreter) -> String {
    let python = interpreter.python.display();
    match message.split('\'').nth(1).filter(|_| message.starts_with("ModuleNotFoundError")) {
        Some(module) => format!(
            "install what holds '{module}' into the interpreter {python}, or name another one with --python PATH"
        ),
        None => format!("the interpreter is {python}; --python PATH names another one"),
    }
}
