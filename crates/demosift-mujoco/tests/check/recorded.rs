//! Recordings that are held against the task: of the task itself, with mistakes planted in them, and public ones.

use super::*;

#[test]
fn a_recording_of_the_task_itself_is_found_fine() {
    let task = load(TASK, MODEL);
    let (set, states) = record(&task);
    let (recorded, findings) = compared(&task, &set, &states);
    assert_fine(&findings);
    assert_eq!(recorded.states, StatesFrom::Recording);
    for one in &recorded.demonstrations {
        let drift = one.drift.unwrap();
        assert!(drift.greatest < 1e-9 && drift.left_at.is_none() && one.missed.unwrap() < 1e-9, "{one:?}");
        assert!(one.score.unwrap() < 0.0 && one.outside == 0, "{one:?}");
    }
}

#[test]
fn a_position_that_is_not_observed_is_left_open_only_where_the_physics_does_not_ask_for_it() {
    const CART: &str = r#"
<mujoco>
  <worldbody>
    <body name="cart"><joint name="way" type="slide" axis="1 1 0"/><geom size="0.1" mass="1"/>
      <body name="pole"><joint name="pole" axis="0 1 0" damping="0.1"/><geom size="0.05" pos="0 0 0.3" mass="1"/></body>
    </body>
  </worldbody>
  <actuator><motor name="swing" joint="pole" ctrlrange="-1 1"/></actuator>
</mujoco>"#;
    let task = TASK.replace(
        r#"[{ qpos = "all" }, { qvel = "all" }, { position = ["hand"] }, "phase"]"#,
        r#"[{ qpos = { except = ["way"] } }, { qvel = "all" }]"#,
    );
    let task = task.replace(r#"["hand", "target"]"#, r#"["pole", "cart"]"#);
    let states_from = |old: &str, new: &str| {
        assert!(CART.contains(old), "{old}");
        let task = load(&task, &CART.replace(old, new));
        let (set, _) = record(&task);
        check::compare(&task, &set, None).unwrap().0.states
    };
    for (old, new) in [
        ("<mujoco>", "<mujoco>"),
        ("axis=\"1 1 0\"", "axis=\"1 1 0\" damping=\"3\" frictionloss=\"1\""),
        ("name=\"cart\"", "name=\"cart\" euler=\"0 0 40\""),
    ] {
        assert_eq!(states_from(old, new), StatesFrom::Observations, "{new}");
    }
    for (old, new) in [
        ("axis=\"1 1 0\"", "axis=\"0 0 1\""),
        ("axis=\"1 1 0\"", "axis=\"1 1 0\" range=\"-5 5\""),
        ("axis=\"1 1 0\"", "axis=\"1 1 0\" stiffness=\"3\""),
        ("axis=\"1 1 0\"", "axis=\"1 1 0.1\""),
        ("name=\"cart\"", "name=\"cart\" euler=\"0 90 0\""),
        ("<joint name=\"way\"", "<joint name=\"turn\"/><joint name=\"way\""),
        ("</actuator>", "<motor name=\"drive\" joint=\"way\" ctrlrange=\"-1 1\"/></actuator>"),
        ("</mujoco>", "<tendon><fixed><joint joint=\"way\" coef=\"1\"/></fixed></tendon></mujoco>"),
        ("</mujoco>", "<equality><joint joint1=\"pole\" joint2=\"way\"/></equality></mujoco>"),
    ] {
        assert_eq!(states_from(old, new), StatesFrom::Nowhere, "{new}");
    }
}

#[test]
fn where_actuators_have_activations_no_step_is_played_by_itself_and_nothing_is_blamed() {
    let [motor, filter] =
        ["<motor name=\"push\" ", "<general name=\"push\" dyntype=\"filter\" dynprm=\"0.3\" "];
    let task = load(TASK, &MODEL.replace(motor, filter));
    let (set, states) = record(&task);
    let why = "a state of the model also holds activations of actuators";
    let (recorded, findings) = compared(&task, &set, &states);
    assert_fine(&findings);
    assert_found(&findings, Severity::Fine, why);
    let one = &recorded.demonstrations[0];
    assert!(one.missed.is_none() && one.typically_missed.is_none(), "{one:?}");
    // From where the task starts the activations are known.
    assert!(one.drift.unwrap().greatest < 1e-9 && one.score.is_some(), "{one:?}");
    let states = Some(&states[..]);
    let findings = check::fit(task.specification(), Some(&task), &Presented::plain(&set, states)).unwrap();
    assert_fine(&findings);
    assert_found(&findings, Severity::Fine, why);
    // Observations follow from positions and velocities, and are compared as ever.
    let swapped = |row: &[f32]| [&row[2..4], &row[..2], &row[4..]].concat();
    let swapped = changed(&set, swapped, same);
    let findings =
        check::fit(task.specification(), Some(&task), &Presented::plain(&swapped, states)).unwrap();
    assert_found(&findings, Severity::Error, "number 0 is qvel shoulder");
}

#[test]
fn observations_in_another_order_or_unit_are_found_and_named() {
    let task = load(TASK, MODEL);
    let (set, states) = record(&task);
    let swapped = |row: &[f32]| [&row[2..4], &row[..2], &row[4..]].concat();
    let (_, findings) = compared(&task, &changed(&set, swapped, same), &states);
    assert_found(&findings, Severity::Error, "4 of the 8 numbers of the recorded observations are not");
    assert_found(
        &findings,
        Severity::Error,
        "number 0 is qvel shoulder, number 1 is qvel elbow, number 2 is qpos shoulder",
    );
    let degrees = |row: &[f32]| [&[row[0], row[1].to_degrees()], &row[2..]].concat();
    let (_, findings) = compared(&task, &changed(&set, degrees, same), &states);
    assert_found(
        &findings,
        Severity::Error,
        "number 1 should be qpos elbow: in the recording number 1 is in degrees, qpos elbow",
    );
    let fewer = |row: &[f32]| vec![row[0].cos(), row[0].sin(), row[3]];
    let (_, findings) = compared(&task, &changed(&set, fewer, same), &states);
    assert_found(&findings, Severity::Error, "a recorded observation has 3 numbers, and the task observes 8");
    assert_found(
        &findings,
        Severity::Error,
        "number 0 is the cosine of qpos shoulder, number 1 is the sine of qpos shoulder, number 2 is qvel elbow",
    );
    let strange = |row: &[f32]| [&[row[0] * row[1]], &row[1..]].concat();
    let (_, findings) = compared(&task, &changed(&set, strange, same), &states);
    assert_found(&findings, Severity::Error, "number 0 should be qpos shoulder: none of them is a position");
}

#[test]
fn observations_of_the_next_step_are_found() {
    let task = load(TASK, MODEL);
    let (set, states) = record(&task);
    let demonstrations = set.iter().map(|one| {
        let rows: Rows =
            (0..one.steps()).map(|step| one.observations().row((step + 1).min(one.steps() - 1))).collect();
        Demonstration::new(rows, one.actions().clone()).unwrap()
    });
    let late: Vec<Demonstration> = demonstrations.collect();
    let (_, findings) = compared(&task, &late, &states);
    assert_found(&findings, Severity::Error, "seem to be those after the action");
}

#[test]
fn actions_that_lead_elsewhere_are_found_and_explained() {
    let task = load(TASK, MODEL);
    let (set, states) = record(&task);
    let observe = |row: &[f32]| row.to_vec();
    for (words, act) in [
        (
            "each action one step late",
            (|actions, step| actions.row(step.saturating_sub(1)).to_vec()) as fn(&Rows, usize) -> Vec<f32>,
        ),
        ("each action one step early", |actions, step| {
            actions.row((step + 1).min(actions.len() - 1)).to_vec()
        }),
        ("controls in the units of ctrlrange", |actions, step| {
            vec![actions.row(step)[0], 2.0 * actions.row(step)[1]]
        }),
    ] {
        let (recorded, findings) = compared(&task, &changed(&set, observe, act), &states);
        assert_found(&findings, Severity::Error, words);
        assert!(recorded.demonstrations.iter().all(|one| one.drift.unwrap().left_at.is_some()));
    }
    let (_, findings) =
        compared(&load(&TASK.replace("frame_skip = 4", "frame_skip = 2"), MODEL), &set, &states);
    assert_found(
        &findings,
        Severity::Error,
        "it was recorded with frame_skip = 4, a control step of 0.0400 s",
    );
    let other = MODEL.replace("damping=\"0.05\" armature=\"0.01\"", "damping=\"0.5\" armature=\"0.5\"");
    let (_, findings) = compared(&load(TASK, &other), &set, &states);
    assert_found(&findings, Severity::Error, "the model is another one");
}

#[test]
fn a_demonstration_by_another_body_is_told_from_the_others() {
    let task = load(TASK, MODEL);
    let heavier = load(TASK, &MODEL.replace("armature=\"0.01\"", "armature=\"0.03\""));
    let ((own, mut states), (others, other_states)) = (record(&task), record(&heavier));
    let demonstrations = own.iter().zip(others.iter()).enumerate();
    let mixed = demonstrations.map(|(at, (own, other))| if at == 1 { other } else { own }.clone());
    let mixed: Vec<Demonstration> = mixed.collect();
    states[1] = other_states[1].clone();
    let (recorded, findings) = compared(&task, &mixed, &states);
    assert_found(&findings, Severity::Warning, "the actions of 1 of 3 demonstrations (1) do not lead");
    assert_found(&findings, Severity::Warning, "another model or body than the others");
    let missed: Vec<bool> =
        recorded.demonstrations.iter().map(|one| one.typically_missed.unwrap() > 0.2).collect();
    assert_eq!(missed, [false, true, false]);
}

#[test]
fn what_does_not_fit_is_said_with_sizes() {
    let task = load(TASK, MODEL);
    let (set, states) = record(&task);
    let three = changed(&set, |row| row.to_vec(), |actions, step| [actions.row(step), &[0.0]].concat());
    let (recorded, findings) = compared(&task, &three, &states);
    assert_found(&findings, Severity::Error, "an action of the set has 3 numbers, and one of the task 2");
    assert!(recorded.demonstrations.iter().all(|one| one.drift.is_none()));
    let wild = changed(&set, |row| row.to_vec(), |actions, step| vec![3.0, actions.row(step)[1]]);
    let (_, findings) = compared(&task, &wild, &states);
    assert_found(
        &findings,
        Severity::Warning,
        "50.0 % of the numbers of actions are outside [-1, 1], up to 3.00",
    );
    let (_, findings) = check::compare(&task, &changed(&set, |row| row[..5].to_vec(), same), None).unwrap();
    assert_found(
        &findings,
        Severity::Error,
        "an observation of the set has 5 numbers, and one of the task 8: change `observation` (qpos 2, qvel 2, position 3, phase 1)",
    );
    let short: Vec<StateLog> =
        states.iter().map(|log| StateLog { qpos: log.qpos[1..].to_vec(), ..log.clone() }).collect();
    let (_, findings) = compared(&task, &set, &short);
    assert_found(&findings, Severity::Error, "demonstration 0: 79 numbers of qpos in 40 steps do not fit");
    let other = changed(&set, |row| row[..5].to_vec(), same);
    let (_, findings) = compared(&task, &other, &short);
    assert_found(&findings, Severity::Error, "an observation of the set has 5 numbers");
    let (_, findings) = compared(&load(&TASK.replace("horizon = 40", "horizon = 50"), MODEL), &set, &states);
    assert_found(
        &findings,
        Severity::Warning,
        "3 of 3 demonstrations have 40 steps, and an episode of the task 50",
    );
}

#[test]
fn one_demonstration_is_enough_and_none_or_two_sizes_are_not() {
    let task = load(TASK, MODEL);
    let (set, states) = record(&task);
    let (recorded, findings) = compared(&task, &set[..1], &states[..1]);
    assert_fine(&findings);
    assert_eq!(recorded.demonstrations.len(), 1);
    let narrow = changed(&set[1..2], |row| row[..5].to_vec(), same);
    let (_, findings) = compared(&task, &[&set[..1], &narrow].concat(), &states[..2]);
    assert_found(
        &findings,
        Severity::Error,
        "demonstration 1 has 5 observed numbers and 2 actions, but demonstration 0 has 8 and 2",
    );
    assert_found(&compared(&task, &[], &[]).1, Severity::Error, "the set holds no demonstration");
}

#[test]
fn positions_or_velocities_that_were_not_recorded_are_found() {
    let task = load(TASK, MODEL);
    let (set, states) = record(&task);
    let still = states.iter().map(|log| StateLog { qpos: vec![0.0; log.qpos.len()], ..log.clone() });
    let (recorded, findings) = compared(&task, &set, &still.collect::<Vec<_>>());
    assert_found(
        &findings,
        Severity::Error,
        "positions never change in the recording of 3 of 3 demonstrations",
    );
    assert!(recorded.demonstrations.iter().all(|one| one.missed.unwrap() < 10.0), "{recorded:?}");
    assert!(findings.iter().all(|one| one.message.len() < 300), "{findings:#?}");
    let slow = states.iter().map(|log| StateLog { qvel: vec![0.0; log.qvel.len()], ..log.clone() });
    let (_, findings) = compared(&task, &set, &slow.collect::<Vec<_>>());
    assert_found(&findings, Severity::Error, "velocities are 0 all along in the recording of 3 of 3");
}

/// What is wrong after the first steps of a very large set is not seen, which is said.
#[test]
fn of_a_large_set_the_first_steps_are_looked_at() {
    let task = load(TASK, MODEL);
    let (set, states) = record(&task);
    let many: Vec<Demonstration> = set.iter().cycle().take(600).cloned().collect();
    let logs: Vec<StateLog> = states.iter().cycle().take(600).cloned().collect();
    let (_, findings) = compared(&task, &many, &logs);
    assert_fine(&findings);
    assert_found(&findings, Severity::Fine, "number by number (of the first 33 steps of each demonstration)");
    assert_found(&findings, Severity::Fine, "of its change) (of the first 33 steps of each demonstration)");
    let swapped = |row: &[f32]| [&row[2..4], &row[..2], &row[4..]].concat();
    let (_, findings) = compared(&task, &changed(&many, swapped, same), &logs);
    assert_found(
        &findings,
        Severity::Error,
        "(of the first 33 steps of each demonstration): in the recording number 0",
    );
}

#[test]
fn of_very_long_episodes_the_beginning_is_played() {
    let long = load(&TASK.replace("horizon = 40", "horizon = 10000000"), MODEL);
    let (played, findings) = check::play(&long, &Seed::new(0)).unwrap();
    assert_eq!((played.episodes, played.steps_per_episode, played.steps), (4, 50_000, 200_000));
    // Two episodes again, and two actuators either way.
    assert_eq!(played.steps_in_all, 200_000 + 2 * 50_000 + 2 * 2 * 10);
    assert_eq!((played.success, played.steps_per_sec(2.0)), (None, 150_020.0));
    assert_eq!(check::count(&findings, Severity::Error), 0, "{findings:#?}");
}

#[test]
fn a_part_without_a_name_is_called_the_same_everywhere() {
    let task = load(
        TASK,
        &MODEL
            .replace("<joint name=\"elbow\"/>", "<joint/>")
            .replace("\"bend\" joint=\"elbow\"", "\"bend\" joint=\"shoulder\""),
    );
    let (seen, _) = check::look(&task);
    assert_eq!(seen.joints, ["shoulder", "joint 1"]);
    assert_eq!(seen.observation[0].columns, ["qpos shoulder", "qpos joint 1"]);
}

#[test]
fn states_are_taken_from_observations_that_hold_all_of_them() {
    let task = load(TASK, MODEL);
    let (set, _) = record(&task);
    let (recorded, findings) = check::compare(&task, &set, None).unwrap();
    assert_eq!(recorded.states, StatesFrom::Observations);
    assert_fine(&findings);
    assert!(recorded.demonstrations.iter().all(|one| one.missed.unwrap() < 1e-4));
    let swapped = |row: &[f32]| [&row[2..4], &row[..2], &row[4..]].concat();
    let (_, findings) = check::compare(&task, &changed(&set, swapped, same), None).unwrap();
    assert_found(
        &findings,
        Severity::Error,
        "the recorded observations stand in another order: [2, 3, 0, 1, 4, 5, 6, 7]",
    );
    let blind = load(&TASK.replace("{ qvel = \"all\" }", "{ qvel = \"elbow\" }"), MODEL);
    let (set, _) = record(&blind);
    let (recorded, findings) = check::compare(&blind, &set, None).unwrap();
    assert_eq!(recorded.states, StatesFrom::Nowhere);
    assert_found(&findings, Severity::Warning, "the set holds no states");
}

/// Where a cheetah is does not matter to it, so its task does not show it, and it can be played again without.
#[test]
fn states_are_taken_from_observations_without_the_place_of_a_slide() {
    let task = demosift_mujoco::registry::load("half_cheetah").unwrap();
    let (set, _) = record(&task);
    let (recorded, findings) = check::compare(&task, &set, None).unwrap();
    assert_eq!(recorded.states, StatesFrom::Observations);
    assert_fine(&findings);
    assert_found(&findings, Severity::Fine, "every position that matters and velocity");
    // The heuristic is the place, which is not known.
    assert!(recorded.demonstrations.iter().all(|one| one.score.is_none() && one.missed.unwrap() < 0.01));
}

/// Ten runs that others recorded in Gymnasium: another program, with the same physics.
#[test]
fn a_public_set_leads_where_its_recorder_says() {
    use demosift::data::demonstration::d4rl;
    let path = "../../../shared/data/half_cheetah_noisy/half_cheetah_noisy.hdf5";
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    if !path.exists() {
        eprintln!("skipped: the public HalfCheetah set is not there");
        return;
    }
    let task = demosift_mujoco::registry::load("half_cheetah").unwrap();
    let (recorded, findings) = check::compare(&task, &all(&d4rl::read(&path).unwrap()), None).unwrap();
    assert_eq!(check::count(&findings, Severity::Error), 0, "{findings:#?}");
    let missed: Vec<f64> = recorded.demonstrations.iter().map(|one| one.missed.unwrap()).collect();
    assert!(missed.iter().all(|missed| *missed < 0.04), "{missed:?}");
}

/// The sets of the repository are of their tasks, but for the guests of one.
#[test]
fn the_sets_of_the_repository_are_of_their_tasks() {
    use demosift::data::demonstration::d4rl;
    for (task, set, others) in [
        ("free_throw", "free_throw_8", 0),
        ("free_throw", "free_throw_20", 6),
        ("penalty_save", "penalty_save_12", 0),
    ] {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data").join(set);
        let path = path.join("demonstrations.hdf5");
        let (set, states) = (all(&d4rl::read(&path).unwrap()), d4rl::read_states(&path).unwrap().unwrap());
        let task = demosift_mujoco::registry::load(task).unwrap();
        let (recorded, findings) = compared(&task, &set, &states);
        assert_eq!(check::count(&findings, Severity::Error), 0, "{findings:#?}");
        let missing = recorded.demonstrations.iter().filter(|one| one.missed.unwrap() > 0.05).count();
        assert_eq!(missing, others);
    }
}
