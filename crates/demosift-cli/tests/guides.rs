//! The guides, word for word: their files are written, their commands run, and what they show is compared with what comes out.
//!
//! CONTRIBUTING.md says how a guide is marked up for this.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::support::in_repository;

/// A fenced block of a guide.
#[derive(Debug, PartialEq)]
struct Block {
    /// Line of the guide on which its text begins, from 1.
    line: usize,
    text: String,
    what: What,
}

#[derive(Debug, PartialEq)]
enum What {
    /// A file of this name.
    File(String),
    /// Commands that must succeed, or fail by a mistake of the user's.
    Commands { fail: bool },
    /// What the commands before it print; where only `about`, any number may be another one.
    Output { about: bool },
    /// For readers only.
    Words,
}

/// The fenced blocks of a guide, in order.
fn blocks(markdown: &str) -> Vec<Block> {
    let mut blocks = Vec::new();
    let mut lines = markdown.lines().enumerate();
    // The last line with something on it that is in no block.
    let mut before = "";
    while let Some((number, line)) = lines.next() {
        let Some(kind) = line.strip_prefix("```") else {
            before = if line.trim().is_empty() { before } else { line };
            continue;
        };
        let mut text = Vec::new();
        loop {
            match lines.next() {
                Some((_, "```")) => break,
                Some((_, line)) => text.push(line),
                None => panic!("line {}: a block that never ends", number + 1),
            }
        }
        let file = before.strip_prefix('`').and_then(|rest| rest.strip_suffix("`:"));
        let what = match (file, kind.trim()) {
            (Some(name), _) => What::File(name.to_owned()),
            (None, "sh") => What::Commands { fail: false },
            (None, "sh fails") => What::Commands { fail: true },
            (None, "text output") => What::Output { about: false },
            (None, "text about") => What::Output { about: true },
            (None, "sh skip" | "text") => What::Words,
            (None, other) => panic!("line {}: a block of no known kind: ```{other}", number + 1),
        };
        blocks.push(Block { line: number + 2, text: text.join("\n") + "\n", what });
        before = "";
    }
    blocks
}

/// Follows a guide in an empty folder; the error says which line is wrong.
fn follow(markdown: &str, folder: &Path) -> Result<(), String> {
    let mut printed = None;
    for Block { line, text, what } in blocks(markdown) {
        match what {
            What::Words => {}
            What::File(name) => {
                let path = folder.join(name);
                std::fs::create_dir_all(path.parent().unwrap()).unwrap();
                std::fs::write(path, text).unwrap();
            }
            What::Commands { fail } => {
                let (code, said) = run(&text, folder);
                if code != Some(if fail { 2 } else { 0 }) {
                    return Err(format!("line {line}: the commands end with {code:?}\n{text}\n{said}"));
                }
                printed = Some(said);
            }
            What::Output { about } => {
                let said = printed.as_ref().ok_or(format!("line {line}: output before any command"))?;
                let shown = text.lines().map(|line| comparable(line, about)).collect::<Vec<_>>();
                let come = said.lines().map(|line| comparable(line, about)).collect::<Vec<_>>();
                if !match_lines(&shown, &come) {
                    let astray = shown
                        .iter()
                        .zip(text.lines())
                        .find(|(shown, _)| *shown != "..." && !come.iter().any(|come| is_like(shown, come)));
                    let astray = astray.map_or("the order of its lines", |(_, line)| line);
                    return Err(format!("line {line}: what is shown is not what comes: {astray}\n\n{said}"));
                }
            }
        }
    }
    Ok(())
}

/// Exit code and all that was printed, errors too, as a terminal shows it.
fn run(commands: &str, folder: &Path) -> (Option<i32>, String) {
    let ours = Path::new(env!("CARGO_BIN_EXE_demosift")).parent().unwrap().to_owned();
    let others =
        std::env::split_paths(&std::env::var_os("PATH").unwrap_or_default()).collect::<Vec<PathBuf>>();
    let path = std::env::join_paths(std::iter::once(ours).chain(others)).unwrap();
    let script = format!("exec 2>&1\nset -eu\n{commands}");
    let output =
        Command::new("bash").args(["-c", &script]).env("PATH", path).current_dir(folder).output().unwrap();
    (output.status.code(), String::from_utf8(output.stdout).unwrap())
}

/// A line as it is compared: where only `about`, numbers, yes and no are `#` and columns are one space apart.
fn comparable(line: &str, about: bool) -> String {
    if !about {
        return line.trim_end().to_owned();
    }
    // Whether an episode succeeded is a number as well.
    let word = |word| if matches!(word, "yes" | "no") { "#" } else { word };
    let words = line.split_whitespace().map(word).collect::<Vec<_>>().join(" ");
    let mut out = String::new();
    let mut rest = words.chars().peekable();
    while let Some(next) = rest.next() {
        let signs = matches!(next, '+' | '-') && rest.peek().is_some_and(char::is_ascii_digit);
        if !signs && !next.is_ascii_digit() {
            out.push(next);
            continue;
        }
        // Of a number like 1e-5 the minus comes on its own.
        while rest.next_if(|next| next.is_ascii_digit() || matches!(next, '.' | 'e')).is_some() {}
        if !out.ends_with('#') {
            out.push('#');
        }
    }
    out
}

/// Whether the shown lines are the ones that came; a line `...` stands for any number of lines.
fn match_lines(shown: &[String], come: &[String]) -> bool {
    match shown.split_first() {
        None => come.iter().all(String::is_empty),
        Some((first, rest)) if first.trim() == "..." => {
            (0..=come.len()).any(|skipped| match_lines(rest, &come[skipped..]))
        }
        Some((first, rest)) => {
            come.split_first().is_some_and(|(line, others)| is_like(first, line) && match_lines(rest, others))
        }
    }
}

/// Whether a line is the one that is shown, in which ` ...` at its end stands for anything.
fn is_like(shown: &str, line: &str) -> bool {
    shown.strip_suffix(" ...").map_or(shown == line, |beginning| line.starts_with(beginning))
}

/// An empty folder with the sets of the checkout in `data`.
fn empty_folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("demosift-guide-{}-{name}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    std::os::unix::fs::symlink(std::fs::canonicalize(in_repository("data")).unwrap(), folder.join("data"))
        .unwrap();
    folder
}

/// A test for each, so that they run side by side.
const GUIDES: [&str; 3] = ["rank-my-set", "reacher", "use-my-subset"];

#[test]
fn every_guide_has_a_test() {
    let files = std::fs::read_dir(in_repository("docs/guides")).unwrap().map(|entry| entry.unwrap().path());
    let pages = files.filter(|path| path.extension().is_some_and(|extension| extension == "md"));
    let mut names: Vec<String> =
        pages.map(|path| path.file_stem().unwrap().to_str().unwrap().to_owned()).collect();
    names.sort();
    assert_eq!(names, GUIDES);
}

#[test]
fn rank_my_set_leads_where_it_says() {
    leads_where_it_says(GUIDES[0]);
}

#[test]
fn reacher_leads_where_it_says() {
    leads_where_it_says(GUIDES[1]);
}

#[test]
fn use_my_subset_leads_where_it_says() {
    leads_where_it_says(GUIDES[2]);
}

#[track_caller]
fn leads_where_it_says(name: &str) {
    let text = std::fs::read_to_string(in_repository(&format!("docs/guides/{name}.md"))).unwrap();
    let folder = empty_folder(name);
    let outcome = follow(&text, &folder);
    std::fs::remove_dir_all(&folder).unwrap();
    if let Err(why) = outcome {
        panic!("{name}.md, {why}");
    }
}

const GUIDE: &str = "\
`notes/two.txt`:

```text
one 1.5
two   -2
```

Words.

```sh
cat notes/two.txt
```

```text output
one 1.5
...
```

```text about
one 7
two 10
```

```sh fails
exit 2
```

```sh skip
exit 1
```
";

#[test]
fn a_guide_that_is_right_is_followed_to_its_end() {
    let folder = empty_folder("right");
    assert_eq!(follow(GUIDE, &folder), Ok(()));
    assert_eq!(std::fs::read_to_string(folder.join("notes/two.txt")).unwrap(), "one 1.5\ntwo   -2\n");
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_guide_that_leads_astray_is_caught_where_it_does() {
    for (old, new, wanted) in [
        ("cat notes/two.txt", "cat notes/three.txt", "line 11: the commands end with Some(1)"),
        ("one 1.5\n...", "one 1.6\n...", "line 15: what is shown is not what comes: one 1.6"),
        ("one 1.5\n...", "one 1.5", "line 15: what is shown is not what comes: the order of its lines"),
        (
            "one 7\ntwo 10",
            "two 10\none 7",
            "line 20: what is shown is not what comes: the order of its lines",
        ),
        ("one 7", "only 7", "line 20: what is shown is not what comes: only 7"),
        ("exit 2", "exit 0", "line 25: the commands end with Some(0)"),
    ] {
        let folder = empty_folder("astray");
        assert!(GUIDE.contains(old));
        let why = follow(&GUIDE.replacen(old, new, 1), &folder).unwrap_err();
        assert!(why.starts_with(wanted), "{new}\nwanted: {wanted}\ngot: {why}");
        std::fs::remove_dir_all(&folder).unwrap();
    }
}

#[test]
#[should_panic(expected = "line 28: a block that never ends")]
fn a_block_that_never_ends_is_caught() {
    blocks(GUIDE.strip_suffix("```\n").unwrap());
}

#[test]
fn numbers_may_differ_where_a_guide_shows_about_what_comes() {
    assert_eq!(comparable("  6   -0.069   [+0.078, +1e-05]   97 %", true), "# # [#, #] # %");
    assert_eq!(comparable("  6   -0.069 ", false), "  6   -0.069");
    assert!(is_like("Report: ...", "Report: runs/report.html") && !is_like("Report: ...", "No report"));
}
