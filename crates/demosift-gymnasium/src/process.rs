//! One Python process: frames that are asked and answered, a time limit for each, and what it said last.
//!
//! The frames are described in `python/demosift_worker/worker.py`.

use std::collections::{BTreeSet, VecDeque};
use std::fmt::Write as _;
use std::io::{BufRead as _, BufReader, ErrorKind, Read as _, Write as _};
use std::os::unix::process::{CommandExt as _, ExitStatusExt as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, mpsc};
use std::thread;
use std::time::{Duration, Instant};

use demosift::{Error, Result};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Pid, Signal, kill_process_group};

/// What an interpreter runs: it finds the modules among its arguments.
const BOOT: &str = include_str!("../python/demosift_worker/boot.py");

macro_rules! modules {
    ($($name:literal),+) => {
        [$(($name, include_str!(concat!("../python/demosift_worker/", $name, ".py")))),+]
    };
}

/// The modules of a worker, each with its text.
const MODULES: [(&str, &str); 9] = modules![
    "environment",
    "learner",
    "naming",
    "own",
    "player",
    "problems",
    "robosuite_env",
    "spaces",
    "worker"
];
/// Lines that are remembered of what a process wrote to standard error.
const LAST_LINES: usize = 5;
/// Letters of a line that are remembered.
const LONGEST_LINE: usize = 300;
/// The letter of a frame that is no answer yet: the worker still plays, and each step may take as long as the time limit says.
const BEAT: u8 = b'H';
/// Letter and length of a frame.
const HEAD: usize = 5;
/// A frame that claims to be longer is none.
const LONGEST_FRAME: usize = 1 << 28;
/// How long a process has to close its environment.
const GRACE: Duration = Duration::from_secs(3);
/// How long its last words are waited for once it has died.
const LAST_WORDS: Duration = Duration::from_millis(500);
/// One worker is one thread: libraries of numerics would each start as many as there are processors.
const ONE_THREAD: [&str; 5] = [
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
];

/// The process groups that are under way, by the number of the process that leads each.
static GROUPS: Mutex<BTreeSet<u32>> = Mutex::new(BTreeSet::new());

/// Ends all processes of environments and trainers at once, with what they have started themselves.
///
/// For a command that is about to exit without its destructors: none can be started afterwards, and whoever finds that his
/// process has ended does not go on from there.
pub fn end_all() {
    let groups = groups();
    groups.iter().for_each(|group| end_group(*group));
    // Never given back.
    std::mem::forget(groups);
}

fn groups() -> MutexGuard<'static, BTreeSet<u32>> {
    GROUPS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Ends a process with what it has started, as far as that has not left its group; it may be gone already.
fn end_group(leader: u32) {
    if let Some(group) = Pid::from_raw(leader as i32) {
        let _ = kill_process_group(group, Signal::KILL);
    }
}

/// Which interpreter, and how long it may take over one answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Interpreter {
    pub(crate) python: PathBuf,
    pub(crate) time_limit: Duration,
    pub(crate) whose: Whose,
}

/// Who works in a process, as errors say it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Whose {
    pub(crate) name: String,
    pub(crate) process: String,
}

impl Whose {
    /// An environment.
    pub(crate) fn environment() -> Self {
        Self { name: "the environment".to_owned(), process: "the environment's process".to_owned() }
    }
}

/// A running process; it ends with this value, and with its parent.
pub(crate) struct Process {
    child: Child,
    asks: Option<ChildStdin>,
    answers: ChildStdout,
    /// What was read and not taken yet.
    read: Vec<u8>,
    last_lines: Arc<Mutex<VecDeque<String>>>,
    listener: Option<thread::JoinHandle<()>>,
    time_limit: Duration,
    whose: Whose,
}

/// How long is waited for an answer, and what gives it longer.
#[derive(Clone, Copy)]
struct Patience<'a> {
    limit: Duration,
    hint: &'a str,
}

/// One answer.
pub(crate) struct Answer {
    pub(crate) letter: u8,
    pub(crate) payload: Vec<u8>,
}

impl Process {
    /// Starts the interpreter with the worker.
    ///
    /// # Errors
    /// `is_bad_input` if there is no such interpreter.
    pub(crate) fn start(interpreter: &Interpreter) -> Result<Self> {
        let Interpreter { python, time_limit, whose } = interpreter;
        let mut command = Command::new(python);
        command
            .args(["-c", BOOT, &std::process::id().to_string()])
            .args(MODULES.iter().flat_map(|(name, text)| [name, text]))
            .envs(ONE_THREAD.map(|name| (name, "1")))
            // The order of Python's sets of words, which is drawn at random otherwise.
            .env("PYTHONHASHSEED", "0")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            // Ctrl-C is for the command that asks; and what the environment starts itself can be ended with it.
            .process_group(0);
        let mut child = started(command).map_err(|error| no_interpreter(python, &error))?;
        let (asks, answers, words) = (child.stdin.take(), child.stdout.take(), child.stderr.take());
        let (Some(asks), Some(answers), Some(words)) = (asks, answers, words) else {
            return Err(Error::simulation(format!("{} has no pipes", whose.process)));
        };
        let last_lines = Arc::new(Mutex::new(VecDeque::new()));
        let remembered = Arc::clone(&last_lines);
        let listener = thread::Builder::new().name("last words".to_owned()).spawn(move || {
            listen(BufReader::new(words), &remembered);
        });
        let listener =
            listener.map_err(|error| Error::simulation(format!("no thread can be started: {error}")))?;
        let listener = Some(listener);
        Ok(Self {
            child,
            asks: Some(asks),
            answers,
            read: Vec::new(),
            last_lines,
            listener,
            time_limit: *time_limit,
            whose: whose.clone(),
        })
    }

    /// Asks and waits for the answer; `what` says in words what is asked, for errors.
    ///
    /// # Errors
    /// `is_simulation` if the process has died, or does not answer within the time limit. It is of no use afterwards.
    pub(crate) fn ask(&mut self, letter: u8, payload: &[u8], what: &str) -> Result<Answer> {
        self.ask_within(self.time_limit, "--time-limit SECONDS gives it longer", letter, payload, what)
    }

    /// The same with a time limit of its own; `hint` says what gives it longer.
    ///
    /// # Errors
    /// As [`ask`](Process::ask).
    pub(crate) fn ask_within(
        &mut self,
        limit: Duration,
        hint: &str,
        letter: u8,
        payload: &[u8],
        what: &str,
    ) -> Result<Answer> {
        let mut frame = Vec::with_capacity(HEAD + payload.len());
        frame.extend((payload.len() as u32).to_le_bytes());
        frame.push(letter);
        frame.extend(payload);
        let sent = self.asks.as_mut().is_some_and(|pipe| pipe.write_all(&frame).is_ok());
        if !sent {
            return Err(self.died(what));
        }
        loop {
            let answer = self.frame(Patience { limit, hint }, what)?;
            if answer.letter != BEAT {
                return Ok(answer);
            }
        }
    }

    /// The next frame, which has to come within the time limit.
    fn frame(&mut self, patience: Patience<'_>, what: &str) -> Result<Answer> {
        let until = Instant::now() + patience.limit;
        if !self.read_to(HEAD, until, what)? {
            return Err(self.hangs(patience, what));
        }
        let length = u32::from_le_bytes([self.read[0], self.read[1], self.read[2], self.read[3]]) as usize;
        if length > LONGEST_FRAME {
            return Err(Error::simulation(format!("the worker's answer to {what} is no frame")));
        }
        if !self.read_to(HEAD + length, until, what)? {
            return Err(self.hangs(patience, what));
        }
        let letter = self.read[HEAD - 1];
        let payload = self.read.drain(..HEAD + length).skip(HEAD).collect();
        Ok(Answer { letter, payload })
    }

    /// Reads until so many bytes are there; says whether that was in time.
    fn read_to(&mut self, count: usize, until: Instant, what: &str) -> Result<bool> {
        let mut bytes = [0; 16 * 1024];
        while self.read.len() < count {
            let left = until.saturating_duration_since(Instant::now());
            let timeout = Timespec { tv_sec: left.as_secs() as i64, tv_nsec: i64::from(left.subsec_nanos()) };
            let mut waited_for = [PollFd::new(&self.answers, PollFlags::IN)];
            match poll(&mut waited_for, Some(&timeout)) {
                Err(rustix::io::Errno::INTR) => continue,
                Err(error) => {
                    let name = &self.whose.name;
                    return Err(Error::simulation(format!("{name} cannot be waited for: {error}")));
                }
                Ok(0) => return Ok(false),
                Ok(_) => {}
            }
            match self.answers.read(&mut bytes) {
                Ok(0) => return Err(self.died(what)),
                Ok(read) => self.read.extend(&bytes[..read]),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => return Err(self.died(what)),
            }
        }
        Ok(true)
    }

    fn hangs(&mut self, Patience { limit, hint }: Patience<'_>, what: &str) -> Error {
        let limit = limit.as_secs_f64();
        self.end();
        let (name, words) = (self.whose.name.clone(), self.last_words());
        Error::simulation(format!("{name} did not finish {what} within {limit} s{words}")).with_hint(hint)
    }

    fn died(&mut self, what: &str) -> Error {
        // Its end of the pipe is closed, which is not yet its end.
        let status = wait(&mut self.child, LAST_WORDS);
        let how = match status.map(|status| (status.signal(), status.code())) {
            Some((Some(signal), _)) => format!(" by signal {signal}{}", name_of(signal)),
            Some((_, Some(code))) => format!(" with exit code {code}"),
            _ => String::new(),
        };
        self.end();
        let (process, words) = (self.whose.process.clone(), self.last_words());
        Error::simulation(format!("{process} ended{how} during {what}{words}"))
    }

    /// What it wrote to standard error at last, as the end of a sentence.
    fn last_words(&mut self) -> String {
        let until = Instant::now() + LAST_WORDS;
        while self.listener.as_ref().is_some_and(|listener| !listener.is_finished()) && Instant::now() < until
        {
            thread::sleep(Duration::from_millis(5));
        }
        let lines = self.last_lines.lock().unwrap_or_else(PoisonError::into_inner);
        let mut words = String::new();
        for (index, line) in lines.iter().enumerate() {
            let _ = write!(words, "{}{line}", if index == 0 { "; its last words: " } else { " | " });
        }
        words
    }

    /// Lets the process close its environment; [`Drop`] waits for it.
    pub(crate) fn close(&mut self) {
        self.asks = None;
    }

    fn end(&mut self) {
        let leader = self.child.id();
        let mut groups = groups();
        end_group(leader);
        groups.remove(&leader);
        drop(groups);
        let _ = self.child.wait();
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.close();
        if wait(&mut self.child, GRACE).is_none()
            || self.listener.as_ref().is_some_and(|listener| !listener.is_finished())
        {
            self.end();
        }
        groups().remove(&self.child.id());
    }
}

/// The status of a process once it has ended, if that is within some time.
fn wait(child: &mut Child, limit: Duration) -> Option<std::process::ExitStatus> {
    let until = Instant::now() + limit;
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return Some(status),
            Ok(None) if Instant::now() < until => thread::sleep(Duration::from_millis(2)),
            _ => return None,
        }
    }
}

/// Remembers the last lines until the stream ends.
fn listen(mut words: impl std::io::BufRead, remembered: &Mutex<VecDeque<String>>) {
    let mut line = Vec::new();
    loop {
        line.clear();
        // A line without an end does not fill the memory.
        match words.by_ref().take(64 * 1024).read_until(b'\n', &mut line) {
            Ok(0) | Err(_) => return,
            Ok(_) => {}
        }
        let text: String = String::from_utf8_lossy(&line).trim_end().chars().take(LONGEST_LINE).collect();
        if text.is_empty() {
            continue;
        }
        let mut lines = remembered.lock().unwrap_or_else(PoisonError::into_inner);
        if lines.len() == LAST_LINES {
            lines.pop_front();
        }
        lines.push_back(text);
    }
}

fn no_interpreter(python: &Path, error: &std::io::Error) -> Error {
    let message = match error.kind() {
        ErrorKind::NotFound => "there is no such Python interpreter".to_owned(),
        _ => format!("the Python interpreter cannot be started: {error}"),
    };
    Error::bad_input(message).at(python).with_hint(
        "--python PATH names the interpreter in which the environment or the trainer works, such as .venv/bin/python",
    )
}

fn name_of(signal: i32) -> &'static str {
    match signal {
        4 => " (SIGILL)",
        6 => " (SIGABRT)",
        7 => " (SIGBUS)",
        8 => " (SIGFPE)",
        9 => " (SIGKILL, perhaps for want of memory)",
        11 => " (SIGSEGV)",
        15 => " (SIGTERM)",
        _ => "",
    }
}

/// A process that is to be started, and who is told how that went.
struct Order {
    command: Command,
    started: mpsc::Sender<std::io::Result<Child>>,
}

/// Starts a process from a thread that never ends: the kernel takes the end of the *thread* that started a process for the
/// end of its parent.
fn started(command: Command) -> std::io::Result<Child> {
    static STARTER: OnceLock<Option<Mutex<mpsc::Sender<Order>>>> = OnceLock::new();
    let starter = STARTER.get_or_init(|| {
        let (orders, received) = mpsc::channel::<Order>();
        let serve = move || {
            for mut order in received {
                // Held meanwhile: none is under way that is not among them.
                let mut groups = groups();
                let started = order.command.spawn();
                groups.extend(started.as_ref().ok().map(Child::id));
                drop(groups);
                let _ = order.started.send(started);
            }
        };
        let thread = thread::Builder::new().name("starter".to_owned()).spawn(serve);
        thread.ok().map(|_| Mutex::new(orders))
    });
    let gone = || std::io::Error::other("the thread that starts processes is gone");
    let starter = starter.as_ref().ok_or_else(gone)?;
    let (started, outcome) = mpsc::channel();
    let order = Order { command, started };
    starter.lock().unwrap_or_else(PoisonError::into_inner).send(order).map_err(|_| gone())?;
    outcome.recv().map_err(|_| gone())?
}
