//! The report as a user gets it: what is in the file, and what a browser makes of it.

use std::path::Path;
use std::process::Command;

use demosift::basics::seed::Seed;
use demosift::world::point_mass;
use serde_json::Value;

use crate::support::{Scratch, in_repository, write_set};

const POINT_MASS: &str = "--task point_mass --config tiny.toml";

/// What a page says of itself: what it threw or complained of, its rows, and how many colors each quarter of its picture has.
const PROBE: &str = "<script>
setTimeout(() => {
  const canvas = document.querySelector('canvas');
  const quarters = [];
  if (canvas) {
    const flat = Object.assign(document.createElement('canvas'), { width: canvas.width, height: canvas.height });
    const context = flat.getContext('2d');
    context.drawImage(canvas, 0, 0);
    for (let quarter = 0; quarter < 4; quarter++) {
      const colors = new Set();
      const part = context.getImageData((quarter * flat.width) / 4 | 0, 0, flat.width / 4 | 0, flat.height).data;
      for (let at = 0; at < part.length; at += 4) colors.add((part[at] << 16) | (part[at + 1] << 8) | part[at + 2]);
      quarters.push(colors.size);
    }
  }
  const found = {
    errors: window.complaints, rows: document.querySelectorAll('#places tbody tr, #looks tbody tr').length, quarters,
    images: document.images.length, said: document.querySelectorAll('#numbers li').length, charts: document.querySelectorAll('section svg').length,
    wide: document.documentElement.scrollWidth > innerWidth, title: document.title,
    sections: [...document.querySelectorAll('section')].filter((one) => one.textContent).map((one) => one.id),
  };
  document.body.replaceChildren(Object.assign(document.createElement('pre'), { id: 'found', textContent: btoa(JSON.stringify(found)) }));
}, 1500);
</script>";
const LISTEN: &str = "<script>
window.complaints = [];
addEventListener('error', (event) => complaints.push(String(event.message)));
addEventListener('securitypolicyviolation', (event) => complaints.push('blocked ' + event.blockedURI));
for (const kind of ['error', 'warn']) console[kind] = (...said) => complaints.push(said.join(' '));
</script>";

/// Opens a page and asks it; `None` where there is no browser.
fn looked_at(scratch: &Scratch, page: &str, size: &str) -> Option<Value> {
    if Command::new("chromium").arg("--version").output().is_err() {
        eprintln!("skipped: there is no chromium to look with");
        return None;
    }
    let html = std::fs::read_to_string(scratch.0.join(page)).unwrap();
    let probed = html.replacen("<title>", &format!("{LISTEN}<title>"), 1).replacen(
        "</body>",
        &format!("{PROBE}</body>"),
        1,
    );
    assert_eq!(probed.len(), html.len() + LISTEN.len() + PROBE.len());
    let file = scratch.0.join("probed.html");
    std::fs::write(&file, probed).unwrap();
    let output = Command::new("chromium")
        .args(
            "--headless --no-sandbox --disable-dev-shm-usage --disable-quic --no-first-run --disable-background-networking"
                .split(' '),
        )
        .args("--disable-component-update --disable-sync --use-gl=angle --use-angle=swiftshader".split(' '))
        .args(["--enable-unsafe-swiftshader", "--virtual-time-budget=5000", "--dump-dom"])
        .arg(format!("--user-data-dir={}", scratch.0.join("browser").display()))
        .arg(format!("--window-size={size}"))
        .arg(format!("file://{}#at=0.5", file.display()))
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&output.stdout).into_owned();
    let said = dom.split("id=\"found\">").nth(1).and_then(|rest| rest.split('<').next());
    let said = said.unwrap_or_else(|| panic!("{dom:.2000}\n{}", String::from_utf8_lossy(&output.stderr)));
    use base64::Engine as _;
    let json = base64::engine::general_purpose::STANDARD.decode(said).unwrap();
    Some(serde_json::from_slice(&json).unwrap())
}

/// The data inside a page.
fn data(scratch: &Scratch, page: &str) -> Value {
    let html = std::fs::read_to_string(scratch.0.join(page)).unwrap();
    let begun = html.split("<script type=\"application/json\" id=\"data\">").nth(1).unwrap();
    serde_json::from_str(begun.split("</script>").next().unwrap()).unwrap()
}

#[test]
fn the_page_of_a_task_without_a_model_says_so_and_shows_the_rest() {
    let scratch = Scratch::new("report-plain");
    // A name that would become markup if it were not escaped.
    let set = "a<img src=x onerror=alert(1)>";
    std::fs::rename(scratch.0.join("set"), scratch.0.join(set)).unwrap();
    let tiny = ["--task", "point_mass", "--config", "tiny.toml", "--keep", "weights", "--out", "run"];
    let fewer = ["--set", "subset_selection.rounds=3", "--set", "subset_selection.meta_updates=1"];
    let output = scratch.command("sift").arg(set).args(tiny).args(fewer).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(String::from_utf8_lossy(&output.stdout).contains("Report: run/report.html"));
    let found = data(&scratch, "run/report.html");
    assert_eq!(found["made"]["set"], set);
    assert!(found["replay"]["scene"].is_null() && found["replay"]["missing"].is_string());
    let Some(seen) = looked_at(&scratch, "run/report.html", "1100,900") else { return };
    assert_eq!(seen["errors"], Value::Array(vec![]), "{seen}");
    assert_eq!((&seen["rows"], &seen["images"]), (&Value::from(4), &Value::from(0)), "{seen}");
    let sections = [
        "verdict",
        "ranking",
        "judges",
        "replay",
        "adaptation",
        "weights",
        "opinions",
        "costs",
        "configuration",
    ];
    assert_eq!(seen["sections"], Value::from(sections.to_vec()));
}

#[test]
fn the_page_of_free_throws_plays_demonstrations_and_agents() {
    let scratch = Scratch::new("report-replay");
    let set = in_repository("data/free_throw_8");
    let job = "--task free_throw --config tiny.toml --set meta_train.rounds=1 --set judge.iterations=1";
    scratch.succeed(&format!("judge {} {job} --out run", set.display()));
    let said = scratch.succeed("report run --json");
    let said: Value = serde_json::from_str(&said).unwrap();
    let found = data(&scratch, "run/report.html");
    assert_eq!(said["report"], found["report"]);

    // Eight demonstrations, and the agent of each judge before and after each of them.
    let episodes = found["replay"]["episodes"].as_array().unwrap();
    let of = |part: &str| episodes.iter().filter(|episode| episode["part"] == part).count();
    assert_eq!((of("demonstration"), of("before"), of("after")), (8, 2, 16));
    let bodies = found["replay"]["scene"]["bodies"].as_u64().unwrap();
    for episode in episodes {
        let bytes = episode["frames"].as_u64().unwrap() * bodies * 14;
        assert_eq!(episode["poses"].as_str().unwrap().len() as u64, bytes.div_ceil(3) * 4);
    }
    // The files of the scores say what each of these episodes scored.
    for judge in ["cloning", "paper"] {
        let scores = &scratch.files("run")[&format!("scores_{judge}.json")];
        let scores: Value = serde_json::from_slice(scores).unwrap();
        for of in scores["suitabilities"].as_array().unwrap() {
            let is_it =
                |one: &&Value| one["part"] == "after" && one["judge"] == judge && one["demo"] == of["demo"];
            let after = episodes.iter().find(is_it).unwrap();
            assert!(of["after"][0].as_array().unwrap().contains(&after["score"]), "{judge}: {}", of["demo"]);
        }
    }
    let size = std::fs::metadata(scratch.0.join("run/report.html")).unwrap().len();
    assert!(size < 10_000_000, "{size} bytes");

    for window in ["1100,1000", "480,900"] {
        let Some(seen) = looked_at(&scratch, "run/report.html", window) else { return };
        assert_eq!(seen["errors"], Value::Array(vec![]), "{seen}");
        assert_eq!((&seen["rows"], &seen["wide"]), (&Value::from(8), &Value::from(false)), "{seen}");
        // A panel that shows nothing but the sky has one color.
        let quarters = seen["quarters"].as_array().unwrap();
        assert_eq!(quarters.len(), 4);
        assert!(quarters.iter().all(|colors| colors.as_u64().unwrap() > 50), "{seen}");
    }
}

#[test]
fn a_page_asks_nothing_of_the_network_and_is_the_same_each_time() {
    let scratch = Scratch::new("report-twice");
    scratch.succeed(&format!("sift set {POINT_MASS} --out run"));
    let first = scratch.files("run");
    scratch.succeed("report run --threads 1");
    assert!(first["report.html"] == scratch.files("run")["report.html"]);
    let html = String::from_utf8_lossy(&first["report.html"]).into_owned();
    assert!(html.contains("default-src 'none'"), "the browser is told to load nothing");
    for wanting in [" src=\"", "@import", "url(", "<link rel=\"stylesheet\""] {
        let markup = html.split("<script").next().unwrap();
        assert!(!markup.contains(wanting), "{wanting}");
    }
    assert!(!html.contains(&scratch.0.display().to_string()), "no path of this machine");
}

/// Ten reaches, of which one jumps and one is there twice.
fn write_reaches(scratch: &Scratch, name: &str) {
    use demosift::data::demonstration::d4rl::{self, Episode};
    use demosift::math::rows::Rows;
    let reach = |size: f32, jumps: bool| {
        let at = |step: usize| {
            size * (1.0 - (step as f32 / 19.0).cos()) + if jumps && step == 30 { 1.5 } else { 0.0 }
        };
        Rows::from_flat((0..60).map(at).collect(), 1).unwrap()
    };
    let sizes = [1.0, 1.01, 0.99, 1.02, 0.98, 1.03, 0.97, 1.04, 1.0, 1.01];
    let observations: Vec<Rows> =
        sizes.iter().enumerate().map(|(place, size)| reach(*size, place == 4)).collect();
    let actions = Rows::from_flat(vec![0.5; 60], 1).unwrap();
    let episode = |observations| Episode { observations, actions: &actions, states: None, terminated: false };
    d4rl::write(&scratch.0.join(name), &observations.iter().map(episode).collect::<Vec<_>>()).unwrap();
}

#[test]
fn the_look_at_a_set_is_a_page_with_the_oddest_first() {
    let scratch = Scratch::new("looks");
    write_reaches(&scratch, "<b>reaches.hdf5");
    let said = scratch.succeed("inspect <b>reaches.hdf5 --html looks.html");
    assert!(said.ends_with("\nPage: looks.html\n"), "{said}");
    let found = data(&scratch, "looks.html");
    let json: Value = serde_json::from_str(&scratch.succeed("inspect <b>reaches.hdf5 --json")).unwrap();
    assert_eq!(found["looks"], json["episodes_by_oddness"]);
    assert_eq!(found["looks"][2]["label"], "4", "{}", found["looks"]);
    let html = String::from_utf8(scratch.files(".")["looks.html"].clone()).unwrap();
    assert!(
        html.contains("default-src 'none'") && html.contains("<title>&lt;b&gt;reaches.hdf5: 10 episodes"),
        "{html:.600}"
    );
    assert!(!html.contains("src=") && !html.contains(&scratch.0.display().to_string()));

    // A page of before is written again, and nothing else.
    scratch.succeed("inspect set --html looks.html");
    std::fs::write(scratch.0.join("notes.txt"), "mine").unwrap();
    let output = scratch.run("inspect set --html notes.txt");
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8(output.stderr).unwrap().contains("something else of this name"));
    assert_eq!(scratch.files(".")["notes.txt"], b"mine");

    std::fs::write(scratch.0.join("<b>reaches.set.toml"), "rate = 20").unwrap();
    scratch.succeed("inspect <b>reaches.hdf5 --html looks.html");
    for window in ["1200,900", "400,900"] {
        let Some(seen) = looked_at(&scratch, "looks.html", window) else { return };
        assert_eq!(seen["errors"], Value::Array(vec![]), "{seen}");
        assert_eq!((&seen["rows"], &seen["wide"]), (&Value::from(10), &Value::from(false)), "{seen}");
        assert_eq!(seen["sections"], Value::from(vec!["spread", "episodes", "meaning"]));
        assert!(seen["charts"].as_u64().unwrap() >= 5, "{seen}");
        assert_eq!(seen["said"], 1, "what set.toml says: {seen}");
    }
}

/// Twice as many demonstrations may take twice the room, and no file four times.
#[test]
fn a_run_folder_grows_with_the_set_and_not_with_its_square() {
    let scratch = Scratch::new("growth");
    let cheap = "[cloning_judge.judging]\niterations = 1\naveraged = 1\nevaluations = 2\nrepeats = 2\nmost_repeats = 2\n";
    std::fs::write(scratch.0.join("cheap.toml"), cheap).unwrap();
    let run = |count: usize| {
        let bearings: Vec<f32> = (0..count).map(|demo| (demo * 37 % 180) as f32).collect();
        let set = point_mass::planted_set(&bearings, Seed::new(3)).unwrap();
        write_set(&scratch.0.join("set/demonstrations.hdf5"), &set);
        let json = scratch.succeed(&format!(
            "sift set --task point_mass --config cheap.toml --judge cloning --referee none --json --out run_{count}"
        ));
        let mut sizes: Vec<(String, usize)> = scratch
            .files(&format!("run_{count}"))
            .into_iter()
            .map(|(name, bytes)| (name, bytes.len()))
            .collect();
        sizes.push(("--json".to_owned(), json.len()));
        sizes
    };
    let [few, many, large] = [100, 200, 250].map(run);
    let names = |sizes: &[(String, usize)]| sizes.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&few), names(&many));
    for ((name, few), (_, many)) in few.iter().zip(&many) {
        // A rank or an index of three digits takes a digit more.
        assert!(*many < few * 22 / 10 + 1000, "{name}: {few} bytes of 100 demonstrations, {many} of 200");
    }
    let of = |name: &str| many.iter().find(|(of, _)| of == name).unwrap().1;
    assert!(of("panel.json") < 200 * 500 && of("uncertainty.json") < 200 * 300, "{many:?}");
    // Beyond 200 policies and curves are there for those that the report looks at alone.
    for (name, size) in &large {
        let most = match name.as_str() {
            "adapted_cloning.safetensors" | "metrics.jsonl" | "events.out.tfevents.demosift" => of(name) / 3,
            "scores_cloning.json" => of(name),
            _ => of(name) * 27 / 20 + 1000,
        };
        assert!(*size < most, "{name}: {} bytes of 200 demonstrations, {size} of 250", of(name));
    }
}

#[test]
fn mistakes_are_told() {
    let scratch = Scratch::new("report-mistakes");
    let complaint = |arguments: &str| {
        let output = scratch.run(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments}");
        String::from_utf8(output.stderr).unwrap()
    };
    assert!(complaint("report nowhere").contains("not a run folder"));
    assert!(!Path::new(&scratch.0.join("nowhere")).exists());
    scratch.succeed(&format!("meta-train set {POINT_MASS} --out begun"));
    let said = complaint("report begun");
    assert!(said.contains("has not judged") && said.contains("hint: "), "{said}");
    scratch.succeed("judge --out begun --resume");
    scratch.succeed("report begun");
    // A set that has moved is found again where the user says it is.
    std::fs::rename(scratch.0.join("set"), scratch.0.join("moved")).unwrap();
    let said = complaint("report begun");
    assert!(said.contains("demonstrations.hdf5") && said.contains("--data SET"), "{said}");
    scratch.succeed("report begun --data moved");
    scratch.succeed("select --out begun --resume moved");
    assert!(complaint("export begun --as csv").contains("--data SET of `export` and `report`"));
    assert!(scratch.succeed("export begun --as csv --data moved").contains("demonstration,label"));
    let other = demosift::world::point_mass::planted_set(&[0.0, 90.0], demosift::basics::seed::Seed::new(4));
    crate::support::write_set(&scratch.0.join("other.hdf5"), &other.unwrap());
    assert!(complaint("export begun --as csv --data other.hdf5").contains("are not those of the run"));
}
