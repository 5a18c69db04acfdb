//! What a run would cost, a stage a row.

use demosift::run::forecast::{Forecast, Foreseen};

use super::{costs, table, wrapped};

pub(crate) fn in_words(forecast: &Forecast, threads: usize) -> String {
    if forecast.stages.is_empty() {
        return "Nothing is left to do: the run folder holds all of it.\n".to_owned();
    }
    let mut rows: Vec<Vec<String>> = forecast.stages.iter().map(row).collect();
    rows.push(vec![
        "in all".to_owned(),
        forecast.environment_steps.to_string(),
        String::new(),
        minutes(forecast.minutes),
    ]);
    let on = if threads == 1 { "one thread".to_owned() } else { format!("{threads} threads") };
    let what = format!(
        "What is still to be done, on this machine with {on}. The minutes come from trying a little of each and are a \
         rough guide; loading, tables and the report come on top, usually seconds."
    );
    let mut said = format!(
        "{}\n\n{}",
        wrapped(&what),
        table(&["stage", "environment steps", "updates", "minutes"], &rows)
    );
    let by_trainer: usize = forecast.stages.iter().map(|stage| stage.planned.by_trainer).sum();
    if by_trainer > 0 {
        let trainings = if by_trainer == 1 { "training" } else { "trainings" };
        let words = format!(
            "On top come {by_trainer} {trainings} by your own trainer, whose time is not known: only playing their policies is \
             counted, and asking these for actions is not."
        );
        said += &format!("\n{}\n", wrapped(&words));
    }
    if forecast.stages.iter().any(|stage| stage.planned.at_most) {
        said += "\n* may end earlier\n";
    }
    said
}

fn row(Foreseen { planned, minutes: time }: &Foreseen) -> Vec<String> {
    let star = if planned.at_most { " *" } else { "" };
    let updates = if planned.updates > 0 { planned.updates.to_string() } else { String::new() };
    vec![
        costs::in_words(&planned.stage) + star,
        planned.environment_steps.to_string(),
        updates,
        minutes(*time),
    ]
}

fn minutes(time: f64) -> String {
    if time < 0.05 { "< 0.1".to_owned() } else { format!("{time:.1}") }
}
