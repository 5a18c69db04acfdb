//! Counted words: one step, two steps.

/// `1 episode`, `2 episodes`.
pub fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_one_is_singular() {
        assert_eq!(
            [0, 1, 2].map(|count| counted(count, "step")),
            ["0 steps", "1 step", "2 steps"].map(str::to_owned)
        );
    }
}
