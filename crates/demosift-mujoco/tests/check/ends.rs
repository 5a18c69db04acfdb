//! Episodes that end early, and numbers that are clipped.

use super::*;

/// The arm with ranges to keep to: its elbow may bend so far, either way.
fn ending(range: &str) -> MujocoTask {
    let task = TASK.replace(
        "[heuristic]",
        &format!("bend = {{ qpos = \"elbow\" }}\nalive = \"alive\"\n[ends]\nbend = {range}\n[return]\nmeasurement = \"alive\"\n[heuristic]"),
    );
    load(&task, MODEL)
}

#[test]
fn when_an_episode_ends_is_described_and_found() {
    let (seen, findings) = check::look(&ending("[-0.3, 0.3]"));
    assert_eq!(
        (seen.ends.join("|"), seen.true_return.as_deref()),
        ("bend leaves [-0.3, 0.3]".to_owned(), Some("alive"))
    );
    assert_found(&findings, Severity::Warning, "the heuristic is a mean over the steps that were played");
    let found = |range| check::play(&ending(range), &Seed::new(0)).unwrap();
    let (played, findings) = found("[-0.3, 0.3]");
    assert!(played.ended_early > 20 && played.ended_at_start == 0 && played.steps < 125 * 40, "{played:?}");
    let wanted = format!("{} of 125 random episodes end early, after ", played.ended_early);
    assert_found(&findings, Severity::Fine, &wanted);
    let (played, findings) = found("[0.05, 3]");
    assert!(played.ended_at_start > 20, "{played:?}");
    assert_found(&findings, Severity::Error, "start where they should end: bend leaves [0.05, 3]");
    assert_found(
        &found("[-100, 100]").1,
        Severity::Fine,
        "none of 125 random episodes leaves the ranges of [ends]",
    );
    // Where nothing ends an episode, nothing is said of it.
    let (_, findings) = check::play(&load(TASK, MODEL), &Seed::new(0)).unwrap();
    assert!(findings.iter().all(|one| !one.message.contains("[ends]")));
}

#[test]
fn a_heuristic_that_an_early_end_favors_is_found() {
    let heuristic = "fold = \"mean\"\nof = \"reach\"\nnegate = true";
    for (other, part) in [
        ("fold = \"sum\"\nof = \"reach\"\nnegate = true", Some("the sooner it ends the less it costs")),
        ("fold = \"max\"\nof = \"reach\"\nnegate = true", Some("the less can go wrong")),
        ("fold = \"sum\"\nof = \"bend\"", None),
        ("fold = \"min\"\nof = \"reach\"\nnegate = true", None),
    ] {
        let text =
            TASK.replace("[heuristic]", "bend = { qpos = \"elbow\" }\n[ends]\nbend = [-1, 1]\n[heuristic]");
        let (_, findings) = check::look(&load(&text.replace(heuristic, other), MODEL));
        match part {
            Some(part) => assert_found(&findings, Severity::Warning, part),
            None => assert_fine(&findings),
        }
    }
}

/// The episodes of a recording, each cut where this task would end it; the first step at which it does, if it does.
fn cut(set: &[Demonstration], states: &[StateLog], bound: f64) -> (Vec<Demonstration>, Vec<StateLog>) {
    let each = set.iter().zip(states).map(|(one, log)| {
        let left = log.qpos.chunks_exact(2).position(|row| row[1].abs() >= bound);
        let steps = left.unwrap_or(one.steps());
        let (observations, actions) = (one.observations().head(steps), one.actions().head(steps));
        let log = StateLog { qpos: log.qpos[..2 * steps].to_vec(), qvel: log.qvel[..2 * steps].to_vec() };
        (Demonstration::new(observations, actions).unwrap(), log)
    });
    each.unzip()
}

#[test]
fn recorded_episodes_that_end_early_are_explained_by_the_ranges_or_not() {
    let (set, states) = record(&load(TASK, MODEL));
    let bound = 0.12;
    let (short, logs) = cut(&set, &states, bound);
    assert!(short.iter().any(|one| one.steps() < 40), "some leave the range");
    let task = ending("[-0.12, 0.12]");
    // With states of the simulator, and with states from the observations.
    for (recorded, findings) in [compared(&task, &short, &logs), check::compare(&task, &short, None).unwrap()]
    {
        assert_fine(&findings);
        assert_found(
            &findings,
            Severity::Fine,
            "each of these ends where the task ends an episode (bend leaves",
        );
        assert_eq!(recorded.demonstrations.len(), 3);
    }
    let (_, findings) = compared(&ending("[-3, 3]"), &short, &logs);
    assert_found(
        &findings,
        Severity::Warning,
        "and an episode of the task 40, which [ends] does not explain",
    );
    let (_, findings) = compared(&ending("[-0.06, 0.06]"), &short, &logs);
    assert_found(
        &findings,
        Severity::Warning,
        "go on after the task would have ended them, the first at step",
    );
    let (_, findings) = compared(&load(TASK, MODEL), &short, &logs);
    assert_found(&findings, Severity::Warning, "something fell or was reached, say so in [ends]");
    let blind = load(
        &TASK
            .replace("{ qvel = \"all\" }", "{ qvel = \"elbow\" }")
            .replace("[heuristic]", "bend = { qpos = \"elbow\" }\n[ends]\nbend = [-1, 1]\n[heuristic]"),
        MODEL,
    );
    let narrow = changed(&short, |row| [&row[..2], &row[3..]].concat(), same);
    let (_, findings) = check::compare(&blind, &narrow, None).unwrap();
    assert_found(&findings, Severity::Warning, "is not known without the simulator's states");
}

/// The recording with velocities cut off at a bound that some of them pass.
fn clipped(set: &[Demonstration], bound: f32) -> Vec<Demonstration> {
    let cut = |row: &[f32]| {
        [&row[..2], &[row[2].clamp(-bound, bound), row[3].clamp(-bound, bound)], &row[4..]].concat()
    };
    changed(set, cut, same)
}

#[test]
fn velocities_that_are_clipped_are_not_compared_and_no_error() {
    let (set, states) = record(&load(TASK, MODEL));
    let cut = clipped(&set, 0.5);
    let share = |set: &[Demonstration]| {
        let rows = || set.iter().flat_map(|one| one.observations().iter());
        rows().filter(|row| row[2].abs() == 0.5 || row[3].abs() == 0.5).count() as f64 / rows().count() as f64
    };
    assert!((0.05..0.95).contains(&share(&cut)), "{}", share(&cut));
    let task = load(&TASK.replace("{ qvel = \"all\" }", "{ qvel = \"all\", clip = [-0.5, 0.5] }"), MODEL);
    let (recorded, findings) = check::compare(&task, &cut, None).unwrap();
    assert_fine(&findings);
    assert_found(
        &findings,
        Severity::Fine,
        &format!("{:.0} % of them have a clipped number", 100.0 * share(&cut)),
    );
    assert!(
        recorded.demonstrations.iter().all(|one| one.missed.is_none_or(|missed| missed < 1e-4)),
        "{recorded:?}"
    );
    assert!(recorded.demonstrations.iter().any(|one| one.missed.is_some()));
    // The same from what the simulator recorded.
    assert_fine(&compared(&task, &cut, &states).1);
    // A task that does not clip what was clipped, and one that clips what was not.
    let (recorded, findings) = check::compare(&load(TASK, MODEL), &cut, None).unwrap();
    assert_eq!(check::count(&findings, Severity::Error), 0, "{findings:#?}");
    assert_found(&findings, Severity::Warning, "recorded numbers of qvel look clipped to [-0.5, 0.5]");
    assert_found(&findings, Severity::Warning, "add clip = [-0.5, 0.5] to that part of `observation`");
    assert!(
        recorded.demonstrations.iter().all(|one| one.missed.is_none_or(|missed| missed < 1e-4)),
        "{recorded:?}"
    );
    let (_, findings) = check::compare(&task, &set, None).unwrap();
    assert_found(&findings, Severity::Error, "and the task clips them to [-0.5, 0.5]");
    let (_, findings) = compared(&load(TASK, MODEL), &cut, &states);
    assert_found(&findings, Severity::Error, "is qvel elbow clipped to [-0.5, 0.5]");
    // Numbers that nobody clipped do not look so.
    let (_, findings) = check::compare(&load(TASK, MODEL), &set, None).unwrap();
    assert_fine(&findings);
}

/// One robot under two engines: the same model, whose contacts are softer or rougher, is not another body.
#[test]
fn the_same_body_with_other_contacts_is_no_error_and_another_body_is() {
    let walker = include_str!("../../tasks/walker2d/walker2d.xml");
    let text = include_str!("../../tasks/walker2d/task.toml");
    let load = |model: &str| MujocoTask::from_texts(text, &[("walker2d.xml", model)], None).unwrap();
    let (set, states) = record(&load(walker));
    let judged = |model: String| {
        assert!(model != walker);
        let (recorded, findings) = compared(&load(&model), &set, &states);
        let errors: Vec<Finding> =
            findings.into_iter().filter(|one| one.severity == Severity::Error).collect();
        (recorded.demonstrations, errors)
    };
    let (softer, errors) = judged(walker.replace("density=\"1000\"", "density=\"1000\" solref=\"0.04 1\""));
    assert!(errors.is_empty(), "{errors:#?}");
    assert!(softer.iter().any(|one| one.missed.unwrap() > 0.05), "contacts matter: {softer:#?}");
    let (_, errors) = judged(walker.replace("friction=\"1.9 0.1 0.1\"", "friction=\"0.9 0.1 0.1\""));
    assert!(errors.is_empty(), "{errors:#?}");
    // One guest among many of the same body under another engine stands out.
    let other = walker.replace("gear=\"100\"", "gear=\"30\"");
    let (guests, guest_states) = record(&load(&other));
    let mixed = [&set[..2], &guests[..1]].concat();
    let mixed_states = [&states[..2], &guest_states[..1]].concat();
    let rougher = load(&walker.replace("damping=\"0.1\"", "damping=\"0.2\""));
    let (_, findings) = compared(&rougher, &mixed, &mixed_states);
    assert_found(&findings, Severity::Warning, "the actions of 1 of 3 demonstrations (2) do not lead");
    assert_found(&findings, Severity::Warning, "with another model or body than the others");
    let (_, errors) = judged(walker.replace("gear=\"100\"", "gear=\"30\""));
    assert!(
        errors.iter().any(|one| one.message.contains("do not lead to the next recorded state")),
        "{errors:#?}"
    );
}

/// Ten runs that others recorded in Gym, half of which end in a fall; their velocities are clipped, and the engine is an old one.
#[test]
fn a_public_set_of_early_ends_and_clipped_velocities_is_explained() {
    use demosift::data::demonstration::d4rl;
    let path = "../../../shared/data/walker2d_noisy/walker2d_noisy.hdf5";
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    if !path.exists() {
        eprintln!("skipped: the public Walker2d set is not there");
        return;
    }
    let set = all(&d4rl::read(&path).unwrap());
    let task = demosift_mujoco::registry::load("walker2d").unwrap();
    let (recorded, findings) = check::compare(&task, &set, None).unwrap();
    assert_eq!(check::count(&findings, Severity::Error), 0, "{findings:#?}");
    assert_found(&findings, Severity::Fine, "6 of 10 demonstrations have 267 to 447 steps");
    assert_found(&findings, Severity::Fine, "each of these ends where the task ends an episode");
    assert_found(&findings, Severity::Warning, "the same body, and imitating it makes sense");
    assert!(recorded.demonstrations.iter().all(|one| one.typically_missed.unwrap() < 0.1), "{recorded:#?}");
    let text = include_str!("../../tasks/walker2d/task.toml").replace(", clip = [-10, 10]", "");
    let models = [("walker2d.xml", include_str!("../../tasks/walker2d/walker2d.xml"))];
    let unclipped = MujocoTask::from_texts(&text, &models, None).unwrap();
    let (_, findings) = check::compare(&unclipped, &set, None).unwrap();
    assert_eq!(check::count(&findings, Severity::Error), 0, "{findings:#?}");
    assert_found(&findings, Severity::Warning, "add clip = [-10, 10] to that part of `observation`");
}
