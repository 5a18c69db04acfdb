//! What is made of Free Throw: the taller thrower, which is `thrower.xml` with longer limbs, with a task file, and the task whose
//! agent does not observe the ball.
//!
//! Every length of the body grows, so its masses grow with the third power and its inertias with the fifth.
//! Springs, dampers and armatures grow like the inertias, so that the limbs swing back as the shorter ones do.
//! The torques grow with the second power only: the taller thrower is weak for its size and needs all its strength for a
//! throw, as the shorter one does. The same actions are too feeble for it then, and with torques that grow like the inertias
//! they would be too strong; but a throw with half the strength is ruined by the noise from which a demonstrator learns, while
//! noise on a torque that is at its limit is clipped away.
//! The hand's cup keeps its size, since the ball does, and the ball moves to where the hand is.

use std::path::Path;

/// How many times as long the limbs are.
const TALLER: f64 = 1.2;

const THROWER: &str = "crates/demosift-mujoco/tasks/free_throw/thrower.xml";
const TASK: &str = "crates/demosift-mujoco/tasks/free_throw/task.toml";
const TALLER_THROWER: &str = "crates/demosift-mujoco/tasks/free_throw/taller_thrower.xml";
const TALLER_TASK: &str = "crates/demosift-mujoco/tasks/free_throw/taller.toml";

const TASK_WITHOUT_BALL: &str = "crates/demosift-mujoco/tasks/free_throw/without_ball.toml";

const GENERATED: &str = "Made by `cargo xtask free-throw`; a test checks that it is still what that makes.";

/// Writes the files again.
pub(crate) fn write(root: &Path) -> Result<(), String> {
    for (path, text) in files(root)? {
        std::fs::write(root.join(path), text).map_err(|error| format!("cannot write {path}: {error}"))?;
    }
    Ok(())
}

/// The files by their path in the checkout.
fn files(root: &Path) -> Result<[(&'static str, String); 3], String> {
    let read = |path: &str| {
        std::fs::read_to_string(root.join(path)).map_err(|error| format!("cannot read {path}: {error}"))
    };
    let body = without_comment(&read(THROWER)?).to_owned();
    let thrower = format!(
        "<!-- The thrower of thrower.xml, its limbs {TALLER} times as long. {GENERATED} -->\n{}",
        grown(&body, TALLER)?
    );
    let task = read(TASK)?;
    let without_ball = format!(
        "# Free Throw by an agent that does not observe the ball: all but its name and its observations is task.toml. {GENERATED}\n\n{}",
        without_ball(&task)?
    );
    let task = format!(
        "# Free Throw by a taller thrower: all but its name and its model is task.toml. {GENERATED}\n\n{}",
        task.replace("\"free_throw\"", "\"free_throw_taller\"")
            .replace("free_throw.xml", "free_throw_taller.xml")
    );
    Ok([(TALLER_THROWER, thrower), (TALLER_TASK, task), (TASK_WITHOUT_BALL, without_ball)])
}

/// The task with the numbers of the joints alone.
fn without_ball(task: &str) -> Result<String, String> {
    let of_ball = ", { qpos = \"ball\" }, { qvel = \"ball\" }]";
    let comment = "# 55 numbers: 21 + 21 of the thrower's joints, 7 + 6 of the ball.";
    if !task.contains(of_ball) || !task.contains(comment) {
        return Err(format!("{TASK} no longer observes the ball as this expects"));
    }
    let task = task.replace("\"free_throw\"", "\"free_throw_without_ball\"").replace(of_ball, "]");
    Ok(task.replace(comment, "# 42 numbers: 21 + 21 of the thrower's joints."))
}

/// The text behind the comment with which it begins.
fn without_comment(text: &str) -> &str {
    text.split_once("-->\n").map_or(text, |(_, rest)| rest)
}

/// The body with all its lengths times `factor`, its torques times the second power of it, and what belongs to its inertias
/// times the fifth.
fn grown(body: &str, factor: f64) -> Result<String, String> {
    let mut out = String::with_capacity(body.len());
    // Where the bodies and frames that are open stand in the one around them.
    let mut open: Vec<Place> = Vec::new();
    let mut hand: Option<[f64; 3]> = None;
    for line in body.lines() {
        let tag = line.trim_start();
        let in_cup = open.iter().any(|place| place.is_cup);
        let mut line = line.to_owned();
        if tag.starts_with("<body name=\"ball\"") {
            let hand = hand.ok_or("the site ball_in_hand must stand before the ball")?;
            line = with_numbers(&line, "pos", |axis, _| hand[axis])?;
        } else if !in_cup && !open.iter().any(|place| place.is_ball) {
            // How far from the hoop somebody stands is no length of the body.
            let place = open.is_empty();
            line = with_numbers(
                &line,
                "pos",
                |axis, number| {
                    if place && axis == 0 { number } else { number * factor }
                },
            )?;
            for length in ["fromto", "size"] {
                line = with_numbers(&line, length, |_, number| number * factor)?;
            }
            for inertial in ["stiffness", "damping", "armature"] {
                line = with_numbers(&line, inertial, |_, number| number * factor.powi(5))?;
            }
            line = with_numbers(&line, "gear", |_, number| number * factor.powi(2))?;
        }
        if tag.starts_with("<body ") || tag.starts_with("<frame ") {
            open.push(Place {
                at: position(&line)?,
                is_cup: tag.contains("name=\"cup\""),
                is_ball: tag.contains("name=\"ball\""),
            });
        } else if tag.starts_with("</body>") || tag.starts_with("</frame>") {
            open.pop();
        } else if tag.contains("name=\"ball_in_hand\"") {
            let mut at = position(&line)?;
            for place in &open {
                at.iter_mut().zip(place.at).for_each(|(at, offset)| *at += offset);
            }
            hand = Some(at);
        }
        out += &line;
        out.push('\n');
    }
    Ok(out)
}

struct Place {
    at: [f64; 3],
    is_cup: bool,
    is_ball: bool,
}

fn position(line: &str) -> Result<[f64; 3], String> {
    let mut at = [0.0; 3];
    with_numbers(line, "pos", |axis, number| {
        at[axis] = number;
        number
    })?;
    Ok(at)
}

/// The line with each number of one attribute changed, if it has the attribute.
fn with_numbers(
    line: &str,
    attribute: &str,
    mut change: impl FnMut(usize, f64) -> f64,
) -> Result<String, String> {
    let key = format!(" {attribute}=\"");
    let Some(start) = line.find(&key).map(|start| start + key.len()) else { return Ok(line.to_owned()) };
    let length = line[start..].find('"').ok_or_else(|| format!("an attribute without an end: {line}"))?;
    let numbers = line[start..start + length].split_whitespace().enumerate().map(|(index, text)| {
        let number: f64 =
            text.parse().map_err(|_| format!("{attribute} holds '{text}', no number: {line}"))?;
        Ok(written(change(index, number)))
    });
    let numbers = numbers.collect::<Result<Vec<String>, String>>()?;
    Ok(format!("{}{}{}", &line[..start], numbers.join(" "), &line[start + length..]))
}

/// A number with at most five decimals, and none that are zero.
fn written(number: f64) -> String {
    let text = format!("{number:.5}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
mod tests {
    use super::*;
    use crate::checkout;

    #[test]
    fn what_is_checked_in_is_what_this_makes() {
        for (path, text) in files(&checkout()).unwrap() {
            let found = std::fs::read_to_string(checkout().join(path)).unwrap();
            assert!(found == text, "{path} is not up to date; run `cargo xtask free-throw`");
        }
    }

    /// Also shows that the ball of the thrower itself lies where the hand is.
    #[test]
    fn a_thrower_that_does_not_grow_stays_as_it_is() {
        let text = std::fs::read_to_string(checkout().join(THROWER)).unwrap();
        let body = without_comment(&text);
        assert_eq!(grown(body, 1.0).unwrap(), body);
    }

    #[test]
    fn lengths_grow_but_not_the_cup_and_the_ball_goes_to_the_hand() {
        let body = "<joint armature=\"0.1\" range=\"-5 5\"/>
<body name=\"arm\" pos=\"1 0 2\">
<geom fromto=\"0 0 0 0 -0.5 0.1\" size=\"0.25\" rgba=\"1 1 1 1\"/>
<frame name=\"cup\" pos=\"0 0.5 0\">
<geom size=\"0.3\"/>
<site name=\"ball_in_hand\" pos=\"0 0 1\"/>
</frame>
</body>
<body name=\"ball\" pos=\"1 0.5 3\">
<geom size=\"0.12\"/>
</body>
<motor gear=\"2\"/>
";
        let wanted = "<joint armature=\"3.2\" range=\"-5 5\"/>
<body name=\"arm\" pos=\"1 0 4\">
<geom fromto=\"0 0 0 0 -1 0.2\" size=\"0.5\" rgba=\"1 1 1 1\"/>
<frame name=\"cup\" pos=\"0 1 0\">
<geom size=\"0.3\"/>
<site name=\"ball_in_hand\" pos=\"0 0 1\"/>
</frame>
</body>
<body name=\"ball\" pos=\"1 1 5\">
<geom size=\"0.12\"/>
</body>
<motor gear=\"8\"/>
";
        assert_eq!(grown(body, 2.0).unwrap(), wanted);
    }
}
