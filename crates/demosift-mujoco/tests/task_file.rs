//! What a user can get wrong in a task, and what they are told.

use demosift::Error;
use demosift_mujoco::model::Model;
use demosift_mujoco::mujoco_task::MujocoTask;
use demosift_mujoco::registry;

const MODEL: &str = r#"
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 1"/>
    <camera name="front" pos="0 -3 1"/>
    <body name="cart" pos="0 0 1">
      <joint name="slider" type="slide" axis="1 0 0"/>
      <geom name="box" size="0.1"/>
      <site name="cart" pos="0 0 0.2"/>
    </body>
    <body name="ball" pos="2 0 1"><freejoint name="ball"/><geom name="leather" size="0.1"/></body>
  </worldbody>
  <actuator><motor name="push" joint="slider" ctrllimited="true" ctrlrange="-2 4"/></actuator>
</mujoco>"#;

const TASK: &str = r#"
name = "cart"
model = "cart.xml"
frame_skip = 2
horizon = 10
observation = [{ qpos = "all" }, { qvel = ["slider"] }, "phase"]

[measurements]
x = { qpos = "slider" }

[heuristic]
fold = "max"
of = "x"
"#;

fn load(task: &str, model: &str) -> Result<MujocoTask, Error> {
    MujocoTask::from_texts(task, &[("cart.xml", model)], None)
}

/// The error after replacing `old` by `new` in the good task.
fn error_of(old: &str, new: &str) -> String {
    assert!(TASK.contains(old), "{old}");
    let error = load(&TASK.replace(old, new), MODEL).err().unwrap();
    assert!(error.is_bad_config() || error.is_bad_input(), "{error}");
    error.to_string()
}

#[test]
fn the_good_task_is_good() {
    load(TASK, MODEL).unwrap();
}

#[test]
fn each_mistake_is_named_with_what_would_have_been_right() {
    for (old, new, wanted) in [
        (
            r#"qpos = "slider""#,
            r#"qpos = "slide""#,
            &["measurements.x: no joint is called 'slide'", "slider, ball"][..],
        ),
        (
            r#"["slider"]"#,
            r#"["slider", "hip"]"#,
            &["observation: qvel: no joint is called 'hip'", "slider, ball"],
        ),
        (
            r#"qpos = "all""#,
            r#"qpos = { except = ["hip"] }"#,
            &["observation: qpos: no joint is called 'hip'"],
        ),
        (
            r#"qpos = "all""#,
            r#"qpos = 3"#,
            &["invalid type: integer `3`", "a joint's name, a list of names", "qpos = 3"],
        ),
        (r#"qpos = "all""#, r#"angle = "all""#, &["unknown key `angle`", "`qpos`", "`contact_wrench`"]),
        (r#"of = "x""#, r#"of = "y""#, &["heuristic: of: no measurement is called 'y'", "has: x"]),
        (r#"of = "x""#, "of = 1", &["the name of a measurement, or a list of names"]),
        (r#"fold = "max""#, r#"fold = "best""#, &["unknown word `best`", "`last_minus_first`"]),
        (
            "horizon = 10",
            r#"horizon = "ten""#,
            &[r#"invalid type: string "ten""#, "a whole number of at least 1", "horizon"],
        ),
        (r#""phase""#, r#""qvel""#, &["this word alone says too little", r#"{ qpos = "all" }"#]),
        ("[heuristic]", "[heuristics]", &["unknown key `heuristics`", "did you mean `heuristic`?"]),
        (r#"qpos = "slider""#, r#"qpos = "Slider""#, &["did you mean 'slider'? the model has: slider, ball"]),
        ("horizon = 10", "horizon = 0", &["invalid value: integer `0`", "a whole number of at least 1"]),
        ("horizon = 10", "horizont = 10", &["unknown key `horizont`", "did you mean `horizon`?"]),
        ("frame_skip = 2", "", &["missing key `frame_skip`"]),
        (
            r#"{ qpos = "slider" }"#,
            r#"{ qpos = "ball" }"#,
            &["measurements.x: the joint 'ball' has 7 positions"],
        ),
        (
            r#"{ qpos = "slider" }"#,
            r#"{ height = "cart" }"#,
            &["names more than one thing", "site:cart", "body:cart"],
        ),
        (
            r#"{ qpos = "slider" }"#,
            r#"{ height = "hat" }"#,
            &["no site or geom or body is called 'hat'", "leather"],
        ),
        (
            r#"{ qpos = "slider" }"#,
            r#"{ height = "hat:cart" }"#,
            &["no site or geom or body is called 'hat:cart'", "did you mean 'cart'?"],
        ),
        (r#"{ qpos = "slider" }"#, r#"{ contact = ["floor", "site:cart"] }"#, &["sites touch nothing"]),
        (r#"{ qpos = "slider" }"#, r#"{ distance = ["floor"] }"#, &["array of length 2"]),
        (
            "[measurements]",
            "reward = [{ weight = 1.0 }]\n[measurements]",
            &["reward: a term is one of", "rate_of"],
        ),
        (
            "[measurements]",
            "reward = [{ rate_of = 'z' }]\n[measurements]",
            &["reward: no measurement is called 'z'"],
        ),
        (
            "[measurements]",
            "camera = 'back'\n[measurements]",
            &["camera: no camera is called 'back'", "front"],
        ),
        (
            "[heuristic]",
            "[reset]\nkeyframe = 'home'\n[heuristic]",
            &["reset: no keyframe is called 'home'", "none"],
        ),
        (
            "[heuristic]",
            "[reset]\nqpos = { ball = 1 }\n[heuristic]",
            &["reset: qpos.ball: this joint takes 7", "[1.0]"],
        ),
        (
            "[heuristic]",
            "[reset]\nqvel_noise = { normal = -1 }\n[heuristic]",
            &["reset: qvel_noise: noise is"],
        ),
        (
            "[heuristic]",
            "[reset]\nqpos_noise = { uniform = 1, except = ['b'] }\n[heuristic]",
            &["no joint is called 'b'"],
        ),
        (
            "[heuristic]",
            "[success]\nfold = 'max'\nof = 'x'\n[heuristic]",
            &["success: needs exactly one of: above, below"],
        ),
        (
            "[heuristic]",
            "[[variant]]\nname='a'\n[[variant]]\nname='a'\n[heuristic]",
            &["two variants are called 'a'"],
        ),
        (
            "[heuristic]",
            "[[variant]]\nname='a'\nqvel = { c = 1 }\n[heuristic]",
            &["variant 'a': qvel: no joint is called 'c'"],
        ),
        (r#""phase""#, r#""fase""#, &["unknown word `fase`", "did you mean `phase`?"]),
        (
            r#"qpos = "all""#,
            r#"qpos = "all", qvel = "all""#,
            &["a part has exactly one of: qpos, qvel, position"],
        ),
        (r#"qpos = "all""#, "clip = [-1, 1]", &["a part has exactly one of: qpos, qvel, position"]),
        (
            r#"qpos = "all""#,
            r#"qpos = "all", clip = [1, -1]"#,
            &["observation: clip: [1, -1]: nothing lies between its ends"],
        ),
        (
            r#"qpos = "all""#,
            r#"qpos = "all", clip = [-inf, inf]"#,
            &["observation: clip: [-inf, inf]: every number lies in it"],
        ),
        (
            r#"qpos = "all""#,
            r#"qpos = "all", clip = [nan, 1]"#,
            &["clip: [NaN, 1]: its ends must be numbers"],
        ),
        (r#"qpos = "all""#, r#"qpos = "all", clip = 1"#, &["invalid type: integer `1`", "array of length 2"]),
        (
            r#"qpos = "all""#,
            r#"qpos = "ball[2]""#,
            &["observation: qpos: 'ball[2]': a slice is [from:to], such as ball[2:] or ball[:3]"],
        ),
        (
            r#"qpos = "all""#,
            r#"qpos = "ball[2:8]""#,
            &["observation: qpos: ball[2:8]: there are 7 numbers, so a slice takes at least one of [0:7]"],
        ),
        (r#"qpos = "all""#, r#"qpos = "bal[2:]""#, &["no joint is called 'bal'; did you mean 'ball'?"]),
        (
            r#"qpos = "all""#,
            r#"position = ["leather[3:]"]"#,
            &["observation: position: leather[3:]: there are 3 numbers"],
        ),
        ("[heuristic]", "[ends]\nz = [0, 1]\n[heuristic]", &["ends: no measurement is called 'z'", "has: x"]),
        (
            "[heuristic]",
            "[ends]\nx = [1, 0]\n[heuristic]",
            &["ends: x: [1, 0]: nothing lies between its ends"],
        ),
        (
            "[heuristic]",
            "[ends]\nx = [nan, 0]\n[heuristic]",
            &["ends: x: [NaN, 0]: its ends must be numbers"],
        ),
        ("[heuristic]", "[ends]\nx = [0]\n[heuristic]", &["array of length 2"]),
        ("[heuristic]", "y = 'alive'\n[heuristic]", &["measurements.y: `alive` says whether", "add [ends]"]),
        (
            "[heuristic]",
            "y = { sum = { x = 1 } }\n[ends]\ny = [0, 1]\n[heuristic]",
            &["ends: 'y' is made of other measurements"],
        ),
        ("[heuristic]", "y = { rate_of = 'z' }\n[heuristic]", &["measurements.y: rate_of: no measurement"]),
        (
            "[heuristic]",
            "y = { rate_of = 'y' }\n[heuristic]",
            &["measurements.y: rate_of: 'y' is itself made of other measurements"],
        ),
        ("[heuristic]", "y = { sum = {} }\n[heuristic]", &["measurements.y: sum: empty"]),
        ("[heuristic]", "y = { sum = { z = 1 } }\n[heuristic]", &["measurements.y: sum: no measurement"]),
        (
            "[heuristic]",
            "y = { sum = { x = inf } }\n[heuristic]",
            &["measurements.y.sum.x = inf: must be a finite number"],
        ),
        (
            "[heuristic]",
            "y = { sum = { y = 1 } }\n[heuristic]",
            &["measurements.y: sum: 'y' is itself a sum; name what it is made of"],
        ),
        (
            "[heuristic]",
            "y = { effort = 1 }\n[heuristic]",
            &["`effort` stands alone, as in name = \"effort\""],
        ),
        ("[heuristic]", "y = 'qpos'\n[heuristic]", &["this word alone says too little", "slider"]),
        (
            "[heuristic]",
            "[return]\nmeasurement = 'reward'\n[heuristic]",
            &["return: no measurement is called 'reward'", "has: x"],
        ),
        ("[heuristic]", "[return]\nof = 'x'\n[heuristic]", &["unknown key `of`", "`measurement`"]),
        ("cart.xml", "card.xml", &["no model file is called 'card.xml'", "cart.xml"]),
        (
            "of = \"x\"",
            "of = \"x\"\notherwise = nan",
            &["heuristic.otherwise = NaN: must be a finite number"],
        ),
        (
            "of = \"x\"",
            "of = \"x\"\notherwise = -inf",
            &["heuristic.otherwise = -inf: must be a finite number"],
        ),
        (
            "of = \"x\"",
            "of = \"x\"\notherwise = -1e308",
            &["heuristic.otherwise = -1e308: must be from -1e30"],
        ),
        (
            "of = \"x\"",
            "of = \"x\"\notherwise = 0\nwhen = [{ measurement = 'x', above = nan }]",
            &["heuristic.when.above = NaN: must be a finite number"],
        ),
        ("[heuristic]", "[[reward]]\nconstant = nan\n[heuristic]", &["reward.constant = NaN"]),
        ("[heuristic]", "[reset.qpos]\nslider = inf\n[heuristic]", &["reset.qpos.slider = inf"]),
        ("frame_skip = 2", "frame_skip = 4000000000", &["frame_skip = 4000000000: must be at most 10000"]),
        ("frame_skip = 2", "frame_skip = 10001", &["frame_skip = 10001: must be at most 10000"]),
    ] {
        let message = error_of(old, new);
        for part in wanted {
            assert!(message.contains(part), "{new}\nwanted: {part}\ngot: {message}");
        }
    }
}

/// The time of the model goes forward, in steps that an agent can follow.
#[test]
fn a_step_of_no_time_or_of_minutes_is_refused() {
    for (timestep, wanted) in [
        ("-0.01", "timestep is -0.01 s, and must be above 0"),
        ("40", "a control step takes 80 s (frame_skip 2"),
    ] {
        let model = MODEL.replace("<mujoco>", &format!("<mujoco><option timestep=\"{timestep}\"/>"));
        let error = load(TASK, &model).err().unwrap();
        assert!(error.is_bad_config() && error.to_string().contains(wanted), "{error}");
    }
}

/// What is found out about a goal lies in a folder of its name, which must stay within that of the run.
#[test]
fn a_goal_that_no_folder_can_be_called_like_is_refused() {
    for name in ["../../b", "a/b", "", ".hidden", r"bell\u0007"] {
        let error = load(&format!("{TASK}[[variant]]\nname = \"{name}\"\n"), MODEL).err().unwrap();
        assert!(error.is_bad_config() && error.to_string().contains("so that a folder can be"), "{error}");
    }
    load(&format!("{TASK}[[variant]]\nname = 'left, low'\n"), MODEL).unwrap();
}

/// All that MuJoCo says, however long the path, and what most often is the cause.
#[test]
fn a_mesh_that_is_not_there_is_named_whole() {
    let folder =
        std::env::temp_dir().join(format!("demosift-mesh-{}-{}", "long".repeat(30), std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("task.toml"), TASK).unwrap();
    let model = MODEL.replace("<worldbody>", "<asset><mesh name='m' file='shin.stl'/></asset><worldbody>");
    std::fs::write(folder.join("cart.xml"), model).unwrap();
    let error = registry::load(folder.to_str().unwrap()).err().unwrap();
    assert!(error.to_string().contains("shin.stl"), "{error}");
    assert!(error.hint().is_some_and(|hint| hint.contains("meshdir")), "{:?}", error.hint());
    std::fs::remove_dir_all(&folder).unwrap();
}

/// What has no name is called by its kind and number, and so it is listed.
#[test]
fn a_part_without_a_name_can_be_named_as_it_is_listed() {
    let nameless = MODEL
        .replace("<body name=\"ball\" pos", "<body pos")
        .replace("<freejoint name=\"ball\"/>", "<freejoint/>");
    assert!(nameless != MODEL);
    let task = TASK.replace(
        "[measurements]",
        "[reset]\nqpos_noise = { uniform = 0.1, except = ['joint 1'] }\n[measurements]\nh = { height = 'body 2' }\n\
         c = { contact = ['body:body 2', 'floor'] }",
    );
    load(&task.replace("qvel = [\"slider\"]", "qvel = [\"joint 1[:3]\"]"), &nameless).unwrap();
    let error = load(&task.replace("'body 2' }", "'body 3' }"), &nameless).err().unwrap().to_string();
    assert!(error.contains("no site or geom or body is called 'body 3'"), "{error}");
    assert!(error.contains("cart") && error.contains("body 2"), "{error}");
    // A name of its own hides the number.
    let error = load(&task.replace("'body 2' }", "'body 1' }"), &nameless).err().unwrap().to_string();
    assert!(error.contains("no site or geom or body is called 'body 1'"), "{error}");
    let error =
        load(&TASK.replace("qpos = \"slider\"", "qpos = \"hip\""), &nameless).err().unwrap().to_string();
    assert!(error.contains("the model has: slider, joint 1"), "{error}");
}

#[test]
fn names_may_hold_colons_and_a_kind_before_them_says_which_is_meant() {
    // As parts are called that were attached under a prefix.
    let model = MODEL.replace("name=\"cart\"", "name=\"robot0:cart\"").replace("\"box\"", "\"robot0:box\"");
    let task = |measured: &str| TASK.replace("{ qpos = \"slider\" }", measured);
    for measured in [
        "{ distance = ['robot0:box', 'ball'] }",
        "{ height = 'robot0:box' }",
        "{ position = { of = 'site:robot0:cart', axis = 'x' } }",
        "{ velocity = { of = 'body:robot0:cart', axis = 'x' } }",
        "{ contact = ['geom:robot0:box', 'floor'] }",
    ] {
        load(&task(measured), &model).unwrap();
    }
    let error = load(&task("{ height = 'robot0:boks' }"), &model).err().unwrap().to_string();
    assert!(error.contains("no site or geom or body is called 'robot0:boks'; did you mean"), "{error}");
    let error = load(&task("{ height = 'robot0:cart' }"), &model).err().unwrap().to_string();
    assert!(error.contains("names more than one thing; write site:robot0:cart"), "{error}");
    let seen = |part: &str| TASK.replace("\"phase\"", part);
    for part in [
        "{ contact_wrench = ['robot0:cart', 'body:robot0:cart[3:]', 'body:ball'] }",
        "{ position = ['robot0:box[2:]'] }",
        "{ velocity = ['body:robot0:cart'] }",
    ] {
        load(&seen(part), &model).unwrap();
    }
    let error = load(&seen("{ contact_wrench = ['site:robot0:cart'] }"), &model).err().unwrap().to_string();
    assert!(error.contains("no body is called 'site:robot0:cart'"), "{error}");
}

#[test]
fn a_reward_may_be_terms_or_success_and_need_not_be_there() {
    let has = |more: &str| load(&format!("{TASK}\n{more}"), MODEL).unwrap().has_reward();
    let success = "[success]\nfold = 'max'\nof = 'x'\nabove = 1.0\n";
    assert!(!has("") && !has(success));
    assert!(has(&format!("{success}reward = 2.0")));
    let terms = TASK.replace("[measurements]", "reward = [{ constant = 1.0 }]\n[measurements]");
    assert!(load(&terms, MODEL).unwrap().has_reward());
    assert!(registry::load("free_throw").unwrap().has_reward(), "its reward is written in Rust");
}

#[test]
fn a_wrong_model_is_named_with_the_reason() {
    let error = load(TASK, "<mujoco><worldbody><body name='a'></mujoco>").err().unwrap();
    assert!(error.to_string().contains("MuJoCo rejects the model"), "{error}");
    let unlimited = MODEL.replace(r#" ctrllimited="true" ctrlrange="-2 4""#, "");
    let error = load(TASK, &unlimited).err().unwrap();
    assert!(error.to_string().contains("the actuator push has no ctrlrange"), "{error}");
    let (before, after) = MODEL.split_at(MODEL.find("<actuator>").unwrap());
    let passive = format!("{before}{}", &after[after.find("</mujoco>").unwrap()..]);
    let error = load(TASK, &passive).err().unwrap();
    assert!(error.to_string().contains("the model has no actuators"), "{error}");
}

#[test]
fn cameras_and_keyframes_without_a_name_are_not_said_to_be_missing() {
    let keyed = MODEL.replace("</mujoco>", "<keyframe><key/></keyframe></mujoco>");
    let nameless = keyed.replace("<camera name=\"front\"", "<camera");
    for (line, hint) in [
        ("camera = 'front'", "no camera of the model has a name; give it one there"),
        ("reset = { keyframe = 'home' }", "no keyframe of the model has a name; give it one there"),
    ] {
        let error = load(&format!("{line}\n{TASK}"), &nameless).err().unwrap();
        assert_eq!(error.hint(), Some(hint), "{error}");
    }
    let task = load(TASK, &nameless).unwrap();
    assert_eq!((task.camera(), task.model().lacks_camera()), (None, Some("has no camera with a name")));
    assert_eq!(load(TASK, MODEL).unwrap().model().lacks_camera(), None);
}

#[test]
fn files_are_found_beside_each_other_and_errors_name_them() {
    let folder = std::env::temp_dir().join(format!("demosift-task-file-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let name = folder.to_str().unwrap();
    let message = || registry::load(name).err().unwrap().to_string();
    assert!(message().contains("holds no task.toml"), "{}", message());
    std::fs::write(folder.join("task.toml"), TASK).unwrap();
    std::fs::write(folder.join("other.xml"), MODEL).unwrap();
    assert!(message().contains("there is no such file; its folder has: other.xml"), "{}", message());
    assert!(message().ends_with("cart.xml"), "{}", message());
    let error = registry::load(name).err().unwrap();
    assert_eq!(error.hint(), Some("`model` is relative to the folder of its task.toml"));
    // A model that is named alone has no task.toml.
    let error = Model::from_file(&folder.join("cart.xml")).err().unwrap();
    assert!(error.to_string().contains("its folder has: other.xml") && error.hint().is_none(), "{error}");
    std::fs::write(folder.join("cart.xml"), MODEL).unwrap();
    registry::load(name).unwrap();
    registry::load(folder.join("task.toml").to_str().unwrap()).unwrap();
    std::fs::write(folder.join("task.toml"), TASK.replace("of = \"x\"", "of = \"y\"")).unwrap();
    assert!(message().ends_with("task.toml"), "{}", message());
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_model_may_include_files_of_another_folder_and_they_belong_to_the_task() {
    let folder = std::env::temp_dir().join(format!("demosift-task-include-{}", std::process::id()));
    for name in ["task", "robot"] {
        std::fs::create_dir_all(folder.join(name)).unwrap();
    }
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
    write("task/task.toml", TASK);
    write("task/cart.xml", "<mujoco><include file=\"../robot/cart.xml\"/></mujoco>");
    write(
        "robot/cart.xml",
        &MODEL.replace("<mujoco>", "<mujocoinclude>").replace("</mujoco>", "</mujocoinclude>"),
    );
    registry::load(folder.join("task").to_str().unwrap()).unwrap();
    let root = std::fs::canonicalize(&folder).unwrap();
    let wanted = ["robot/cart.xml", "task/cart.xml", "task/task.toml"].map(|name| root.join(name));
    assert_eq!(registry::files(&folder.join("task")).unwrap(), wanted);
    assert_eq!(registry::files(&folder.join("task/task.toml")).unwrap(), wanted);
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_built_in_model_that_includes_another_is_the_same_as_from_its_files() {
    let built_in = registry::load("handstand").unwrap();
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tasks/handstand");
    let from_files = registry::load(folder).unwrap();
    let masses = |task: &MujocoTask| task.model().mujoco().body_mass().to_vec();
    assert_eq!(masses(&built_in), masses(&from_files));
}

#[test]
fn an_unknown_task_lists_the_known_ones() {
    let error = registry::load("half_chetah").err().unwrap();
    assert!(error.is_bad_input());
    let known = registry::names().join(", ");
    let wanted = format!("no task is called 'half_chetah'; did you mean 'half_cheetah'? there are: {known}");
    assert!(error.to_string().contains(&wanted) && known.contains("half_cheetah"), "{error}");
}

/// The task file in the documents.
#[test]
fn the_documented_example_is_a_task() {
    let page = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/task-file.md");
    let page = std::fs::read_to_string(page).unwrap();
    let example = page.split("```toml").nth(1).unwrap().split("```").next().unwrap();
    let model = r#"
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 1"/>
    <camera name="front" pos="0 -3 1"/>
    <body name="pelvis" pos="0 0 1">
      <joint name="slider" type="slide" axis="1 0 0"/>
      <geom size="0.1"/>
      <site name="head" pos="0 0 0.5"/>
      <body name="hand"><joint name="elbow"/><geom size="0.1"/></body>
      <body name="foot"><joint name="ankle"/><geom size="0.1"/></body>
    </body>
    <body name="goal"><joint name="target"/><geom size="0.1"/><site name="target"/></body>
    <body name="ball" pos="2 0 1"><freejoint name="ball"/><geom name="leather" size="0.1"/></body>
  </worldbody>
  <actuator><motor name="push" joint="slider" ctrllimited="true" ctrlrange="-2 4"/></actuator>
  <keyframe><key name="ready" qpos="0 0 0 0 2 0 1 1 0 0 0"/></keyframe>
</mujoco>"#;
    MujocoTask::from_texts(example, &[("arm.xml", model)], None).unwrap();
}
