//! Indented JSON with what belongs together on one line: a list of numbers, and an object of a list that holds no other.
//!
//! A score table of a thousand demonstrations holds a million numbers, and a line with its indentation for each of them is
//! twice as long as the number.

/// What becomes of a member of an object of a list that is `null`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Nulls {
    /// It stays.
    Written,
    /// It is left out, as a reader takes it for `null` anyway.
    LeftOut,
}

/// Rewrites indented JSON as `serde_json` writes it; the content stays the same, but for nulls that are left out.
pub(super) fn in_few_lines(indented: &str, nulls: Nulls) -> String {
    let mut lines: Vec<String> = Vec::new();
    // Where the innermost list or object begins, if nothing within it has begun since.
    let mut begun: Option<usize> = None;
    for line in indented.lines() {
        let content = line.trim_start();
        if line.ends_with(['[', '{']) {
            begun = Some(lines.len());
        } else if content.starts_with([']', '}'])
            && let Some(first) = begun.take_if(|first| belongs_on_a_line(&lines[*first]))
        {
            let is_list = content.starts_with(']');
            let is_written =
                |member: &&str| is_list || nulls == Nulls::Written || !member.ends_with(": null");
            let members = lines[first + 1..].iter().map(|line| line.trim_start().trim_end_matches(','));
            let members: Vec<&str> = members.filter(is_written).collect();
            let (open, close) = if is_list { ("", "") } else { (" ", " ") };
            let joined = format!("{}{open}{}{close}{content}", lines[first], members.join(", "));
            lines.truncate(first);
            lines.push(joined);
            begun = None;
            continue;
        } else if content.starts_with([']', '}']) {
            begun = None;
        }
        lines.push(line.to_owned());
    }
    lines.join("\n") + "\n"
}

/// A list, or an object that stands in a list and so has no name; never the whole.
fn belongs_on_a_line(first: &str) -> bool {
    first.ends_with('[') || first.trim_start() == "{" && first != "{"
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    #[test]
    fn the_content_stays_and_the_innermost_stand_on_one_line() {
        let value = json!({
            "version": 2, "empty": [], "nothing": {}, "words": ["a [", "] {", "\"}", "\n[", ","], "named": { "x": 1 },
            "scores": [[0.1, -2.5e-17], [1.0]],
            "curves": [{ "loss": 0.5, "end": null }, { "inner": [1, 2], "more": { "y": [] } }],
        });
        let text = |value: &Value| serde_json::to_string_pretty(value).expect("plain data");
        let written = in_few_lines(&text(&value), Nulls::Written);
        assert_eq!(serde_json::from_str::<Value>(&written).expect("still JSON"), value);
        for line in
            ["    [0.1, -2.5e-17],", "    { \"end\": null, \"loss\": 0.5 },", "      \"inner\": [1, 2],"]
        {
            assert!(written.lines().any(|one| one == line), "{line} is not in {written}");
        }
        assert!(written.contains("\"named\": {\n    \"x\": 1\n  }"), "{written}");
        assert_eq!(in_few_lines(&text(&json!([1, 2])), Nulls::Written), "[1, 2]\n");
        let fewer = in_few_lines(&text(&value), Nulls::LeftOut);
        assert!(fewer.lines().any(|one| one == "    { \"loss\": 0.5 },"), "{fewer}");
        assert_eq!(written.replace("\"end\": null, ", ""), fewer);
    }
}
