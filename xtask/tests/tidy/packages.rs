//! What holds of the packages: ours can be published, and those that they depend on are as `deny.toml` allows.
//!
//! `cargo deny` and `cargo machete` ask the same and more, but they would have to be compiled first, on each machine.
//! So the hosted workflow runs them, and these few lines ask in every test run.

use crate::sources::{Source, checkout, read, rust_files};
use crate::{Violation, caught, caught_among, tidy, with_line};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// In which order they are published.
const PUBLISHED: [&str; 4] = ["demosift", "demosift-mujoco", "demosift-gymnasium", "demosift-cli"];
const RULES_FILE: &str = "deny.toml";
const LOCK: &str = "Cargo.lock";
const CRATES_IO: &str = "registry+https://github.com/rust-lang/crates.io-index";

/// A package of the build, ours or another's.
#[derive(Clone, Debug)]
struct Package {
    name: String,
    version: String,
    license: Option<String>,
    /// Relative to the checkout; of ours only.
    manifest: Option<String>,
    dependencies: Vec<Dependency>,
    /// The keys of the manifest that a registry shows, those that are given.
    shown: BTreeSet<String>,
}

#[derive(Clone, Debug)]
struct Dependency {
    /// As the code says it.
    name: String,
    kind: Kind,
    /// Without a version a package cannot be published.
    has_version: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Normal,
    Dev,
    Build,
}

fn cargo(arguments: &[&str]) -> String {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo).args(arguments).current_dir(checkout()).output().expect("cargo runs");
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "cargo {}: {complaint}", arguments.join(" "));
    String::from_utf8(output.stdout).expect("cargo speaks UTF-8")
}

/// All packages that a build on this machine takes. Where it has been built they are there, and no network is asked.
fn packages() -> Vec<Package> {
    static ALL: OnceLock<Vec<Package>> = OnceLock::new();
    ALL.get_or_init(read_packages).clone()
}

fn read_packages() -> Vec<Package> {
    let rustc = Command::new(std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into())).arg("-vV").output();
    let about = String::from_utf8(rustc.expect("rustc runs").stdout).expect("rustc speaks UTF-8");
    let host = about.lines().find_map(|line| line.strip_prefix("host: ")).expect("rustc names its host");
    let metadata = cargo(&["metadata", "--format-version=1", "--locked", "--filter-platform", host]);
    let metadata: Value = serde_json::from_str(&metadata).expect("cargo speaks JSON");
    let list = metadata["packages"].as_array().expect("a list of packages");
    list.iter().map(package).collect()
}

fn package(value: &Value) -> Package {
    let text = |key: &str| value[key].as_str().map(str::to_owned);
    let is_given = |value: &Value| !value.is_null() && value.as_array().is_none_or(|list| !list.is_empty());
    let dependencies = value["dependencies"].as_array().expect("a list of dependencies");
    let manifest = text("manifest_path").expect("each has a manifest");
    let manifest = Path::new(&manifest).strip_prefix(checkout()).ok();
    Package {
        name: text("name").expect("each has a name"),
        version: text("version").expect("each has a version"),
        license: text("license"),
        manifest: manifest
            .filter(|_| value["source"].is_null())
            .map(|path| path.to_string_lossy().into_owned()),
        dependencies: dependencies.iter().map(dependency).collect(),
        shown: ["description", "keywords", "categories", "license", "readme", "rust_version"]
            .into_iter()
            .filter(|key| is_given(&value[key]))
            .map(str::to_owned)
            .collect(),
    }
}

fn dependency(value: &Value) -> Dependency {
    let name = value["rename"].as_str().or(value["name"].as_str()).expect("each has a name");
    Dependency {
        name: name.replace('-', "_"),
        kind: match value["kind"].as_str() {
            None => Kind::Normal,
            Some("dev") => Kind::Dev,
            Some(_) => Kind::Build,
        },
        has_version: value["req"].as_str().is_some_and(|version| version != "*"),
    }
}

fn ours(packages: &[Package]) -> Vec<Package> {
    packages.iter().filter(|package| package.manifest.is_some()).cloned().collect()
}

/// A violation at the line of our manifest that names a dependency, or at its first line.
fn in_manifest(package: &Package, word: &str, message: String) -> Violation {
    let path = package.manifest.as_deref().unwrap_or(LOCK);
    let dashed = word.replace('_', "-");
    let names = |line: &str| [word, &dashed].iter().any(|word| line.starts_with(word));
    let line = read(path).lines().position(names).map_or(1, |index| index + 1);
    Violation::new(path, line, "packages", message)
}

/// What is said of each of ours where it is published.
fn can_be_published(packages: &[Package]) -> Vec<Violation> {
    let mut violations = Vec::new();
    for package in packages.iter().filter(|package| PUBLISHED.contains(&package.name.as_str())) {
        for key in ["description", "keywords", "categories", "license", "readme", "rust_version"] {
            if !package.shown.contains(key) {
                violations.push(in_manifest(package, key, format!("{}: no {key}", package.name)));
            }
        }
        // Cargo leaves those for tests out where they have none.
        let needed = package.dependencies.iter().filter(|dependency| dependency.kind != Kind::Dev);
        for dependency in needed.filter(|dependency| !dependency.has_version) {
            let message =
                format!("`{}` has no version, so {} cannot be published", dependency.name, package.name);
            violations.push(in_manifest(package, &dependency.name, message));
        }
    }
    violations
}

/// Each dependency is named in code of its kind.
fn dependencies_are_used(packages: &[Package], sources: &[Source]) -> Vec<Violation> {
    let mut violations = Vec::new();
    for package in packages {
        let folder = package.manifest.as_deref().unwrap_or_default().trim_end_matches("Cargo.toml");
        for dependency in &package.dependencies {
            let may = |source: &&Source| {
                let inside = source.path.strip_prefix(folder);
                inside.is_some_and(|path| match dependency.kind {
                    Kind::Normal => path.starts_with("src/"),
                    Kind::Build => path == "build.rs",
                    Kind::Dev => true,
                })
            };
            let mut users = sources.iter().filter(may);
            let is_used = users.any(|source| match dependency.kind {
                // Tests within `src` are blank in a source, and count here.
                Kind::Dev => read(&source.path).contains(&format!("{}::", dependency.name)),
                Kind::Normal | Kind::Build => source.words(&dependency.name).next().is_some(),
            });
            if !is_used {
                let message = format!("no code of {} uses `{}`", package.name, dependency.name);
                violations.push(in_manifest(package, &dependency.name, message));
            }
        }
    }
    violations
}

/// Every file that is built in lies in the package that builds it in.
fn built_in_files_are_packaged(
    sources: &[Source],
    packaged: &BTreeMap<String, BTreeSet<String>>,
) -> Vec<Violation> {
    let mut violations = Vec::new();
    for source in sources {
        let Some((folder, list)) = packaged.iter().find(|(folder, list)| {
            source.path.strip_prefix(folder.as_str()).is_some_and(|path| list.contains(path))
        }) else {
            continue;
        };
        for (position, name) in built_in(&source.code_and_strings) {
            let beside = Path::new(&source.path).parent().expect("a file lies in a folder");
            let file = plain(&beside.join(name)).to_string_lossy().into_owned();
            if !file.strip_prefix(folder.as_str()).is_some_and(|path| list.contains(path)) {
                let message = format!("`{name}` is not in the package, which then does not build");
                violations.push(Violation::new(&source.path, source.line(position), "packages", message));
            }
        }
    }
    violations
}

/// Where a text builds in which files, by the path in its quotes.
fn built_in(text: &str) -> Vec<(usize, &str)> {
    let calls = ["include_str!(\"", "include_bytes!(\""].into_iter();
    calls
        .flat_map(|call| text.match_indices(call))
        .map(|(position, call)| {
            (position, text[position + call.len()..].split('"').next().unwrap_or_default())
        })
        .collect()
}

/// The path without `..`.
fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for component in path.components() {
        match component {
            Component::ParentDir => _ = plain.pop(),
            other => plain.push(other),
        }
    }
    plain
}

/// What cargo would put into each package, by the folder of the package.
fn packaged() -> BTreeMap<String, BTreeSet<String>> {
    let list = |name: &&str| {
        let files = cargo(&["package", "--list", "--allow-dirty", "--package", name]);
        (format!("crates/{name}/"), files.lines().map(str::to_owned).collect())
    };
    PUBLISHED.iter().map(list).collect()
}

/// What `deny.toml` says.
struct Allowed {
    licenses: BTreeSet<String>,
    /// `name@version` of what may stand beside a newer version of itself.
    older: BTreeSet<String>,
}

impl Allowed {
    fn read(text: &str) -> Self {
        let table: toml::Table = text.parse().expect("deny.toml is TOML");
        let strings = |section: &str, key: &str, of: fn(&toml::Value) -> Option<&str>| {
            let list = table[section][key].as_array().expect("a list");
            list.iter().filter_map(of).map(str::to_owned).collect()
        };
        Self {
            licenses: strings("licenses", "allow", toml::Value::as_str),
            older: strings("bans", "skip", |skip| skip.get("crate")?.as_str()),
        }
    }
}

fn licenses_are_allowed(packages: &[Package], allowed: &Allowed) -> Vec<Violation> {
    let wrong = |package: &&Package| {
        let license = package.license.as_deref().unwrap_or_default().replace('/', " OR ");
        let spaced = license.replace('(', " ( ").replace(')', " ) ");
        !Terms { words: spaced.split_whitespace().collect(), next: 0 }.allow(&allowed.licenses)
    };
    let violation = |package: &Package| {
        let license = package.license.as_deref().unwrap_or("no license that cargo knows");
        let message =
            format!("{} {}: {license}, which {RULES_FILE} does not allow", package.name, package.version);
        Violation::new(LOCK, 1, "licenses", message)
    };
    packages.iter().filter(wrong).map(violation).collect()
}

/// The words of a license expression of SPDX, read from left to right.
struct Terms<'a> {
    words: Vec<&'a str>,
    next: usize,
}

impl Terms<'_> {
    /// Whether it may be used under these licenses alone.
    fn allow(&mut self, licenses: &BTreeSet<String>) -> bool {
        self.either(licenses) && self.next == self.words.len()
    }

    fn take(&mut self, word: &str) -> bool {
        let found = self.words.get(self.next) == Some(&word);
        self.next += usize::from(found);
        found
    }

    fn either(&mut self, licenses: &BTreeSet<String>) -> bool {
        let mut allowed = self.both(licenses);
        while self.take("OR") {
            allowed |= self.both(licenses);
        }
        allowed
    }

    fn both(&mut self, licenses: &BTreeSet<String>) -> bool {
        let mut allowed = self.one(licenses);
        while self.take("AND") {
            allowed &= self.one(licenses);
        }
        allowed
    }

    fn one(&mut self, licenses: &BTreeSet<String>) -> bool {
        if self.take("(") {
            return self.either(licenses) & self.take(")");
        }
        let mut license = self.words.get(self.next).copied().unwrap_or_default().to_owned();
        self.next += 1;
        if self.take("WITH") {
            license += " WITH ";
            license += self.words.get(self.next).copied().unwrap_or_default();
            self.next += 1;
        }
        licenses.contains(&license)
    }
}

/// `name version` of all that is really built, in order; metadata and lock also list what features leave out.
fn built() -> BTreeSet<String> {
    let tree = cargo(&["tree", "--workspace", "--locked", "--prefix=none", "--format={p}"]);
    let name_and_version = |line: &str| {
        let (name, rest) = line.split_once(" v")?;
        Some(format!("{name} {}", rest.split(' ').next()?))
    };
    tree.lines().filter_map(name_and_version).collect()
}

/// No package stands beside a newer version of itself, but those that are named for it.
fn versions_are_one(built: &BTreeSet<String>, allowed: &Allowed) -> Vec<Violation> {
    let mut versions: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (name, version) in built.iter().filter_map(|package| package.split_once(' ')) {
        if !allowed.older.contains(&format!("{name}@{version}")) {
            versions.entry(name).or_default().push(version);
        }
    }
    let several = versions.into_iter().filter(|(_, versions)| versions.len() > 1);
    several
        .map(|(name, versions)| {
            let message =
                format!("{name} in versions {}; {RULES_FILE} names what may be", versions.join(" and "));
            Violation::new(LOCK, 1, "versions", message)
        })
        .collect()
}

/// All that is not ours comes from crates.io, by its hash; for every platform.
fn sources_are_crates_io(lock: &str) -> Vec<Violation> {
    let table: toml::Table = lock.parse().expect("Cargo.lock is TOML");
    let packages = table["package"].as_array().expect("a list of packages");
    let text = |package: &toml::Value, key: &str| package.get(key)?.as_str().map(str::to_owned);
    let mut violations = Vec::new();
    for package in packages {
        let Some(source) = text(package, "source") else { continue };
        if source != CRATES_IO || text(package, "checksum").is_none() {
            let message = format!("{} comes from {source}", text(package, "name").unwrap_or_default());
            violations.push(Violation::new(LOCK, 1, "sources", message));
        }
    }
    violations
}

/// What says a version of demosift says that of the workspace.
fn versions_agree(version: &str, citation: &str) -> Vec<Violation> {
    let said = citation.lines().find_map(|line| line.strip_prefix("version: ")).unwrap_or("none");
    match said == version {
        true => Vec::new(),
        false => {
            let message = format!("version {said}, and Cargo.toml says {version}");
            vec![Violation::new("CITATION.cff", 1, "versions", message)]
        }
    }
}

fn real_rules() -> Allowed {
    Allowed::read(&read(RULES_FILE))
}

fn all_sources() -> Vec<Source> {
    ["crates", "fuzz", "xtask"].map(rust_files).into_iter().flatten().collect()
}

fn planted(name: &str, license: Option<&str>) -> Package {
    Package {
        name: name.to_owned(),
        version: "1.0.0".to_owned(),
        license: license.map(str::to_owned),
        manifest: None,
        dependencies: Vec::new(),
        shown: BTreeSet::new(),
    }
}

fn messages(violations: &[Violation]) -> Vec<&str> {
    violations.iter().map(|violation| violation.message.as_str()).collect()
}

#[test]
fn each_crate_says_what_a_registry_shows() {
    let packages = ours(&packages());
    assert!(PUBLISHED.iter().all(|name| packages.iter().any(|package| package.name == *name)));
    tidy(can_be_published(&packages));
}

#[test]
fn each_crate_says_what_a_registry_shows_catches() {
    let mut packages = ours(&packages());
    let command = packages.iter_mut().find(|package| package.name == "demosift-cli").expect("it is ours");
    command.shown.remove("readme");
    // Tests use it once more, with its schemas.
    let used = command.dependencies.iter_mut().find(|dependency| dependency.name == "demosift_mujoco");
    used.expect("the command plays in it").has_version = false;
    let violations = can_be_published(&packages);
    assert_eq!(
        messages(&violations),
        ["demosift-cli: no readme", "`demosift_mujoco` has no version, so demosift-cli cannot be published"]
    );
}

#[test]
fn built_in_files_lie_in_their_package() {
    let packaged = packaged();
    assert!(packaged.values().all(|list| list.contains("README.md") && list.contains("LICENSE-MIT")));
    assert!(
        packaged.values().flatten().all(|file| !file.starts_with("tests/") && !file.starts_with("benches/"))
    );
    tidy(built_in_files_are_packaged(&rust_files("crates"), &packaged));
}

#[test]
fn built_in_files_lie_in_their_package_catches() {
    let packaged = packaged();
    for (file, line) in [
        (
            "crates/demosift-mujoco/src/registry.rs",
            "const PLANTED: &str = include_str!(\"../../../README.md\");",
        ),
        (
            "crates/demosift-cli/src/task/mod.rs",
            "const PLANTED: &[u8] = include_bytes!(\"../../tests/study.rs\");",
        ),
    ] {
        let (sources, place) = with_line(rust_files("crates"), file, line);
        caught(&built_in_files_are_packaged(&sources, &packaged), &[&place]);
    }
    // A file that is taken out of the package again.
    let mut without = packaged;
    let tasks = without.get_mut("crates/demosift-mujoco/").expect("it is published");
    assert!(tasks.remove("tasks/walker2d/walker2d.xml"));
    let violations = built_in_files_are_packaged(&rust_files("crates"), &without);
    assert_eq!(violations.len(), 1);
    caught_among(&violations, &format!("crates/demosift-mujoco/src/registry.rs:{}", violations[0].line));
}

#[test]
fn every_dependency_is_used() {
    tidy(dependencies_are_used(&ours(&packages()), &all_sources()));
}

#[test]
fn every_dependency_is_used_catches() {
    let mut packages = ours(&packages());
    let command = packages.iter_mut().find(|package| package.name == "demosift-cli").expect("it is ours");
    for (name, kind) in [("hdf5_pure", Kind::Normal), ("strsim", Kind::Dev), ("serde", Kind::Build)] {
        command.dependencies.push(Dependency { name: name.to_owned(), kind, has_version: true });
    }
    let violations = dependencies_are_used(&packages, &all_sources());
    let wanted = ["hdf5_pure", "strsim", "serde"];
    assert_eq!(messages(&violations), wanted.map(|name| format!("no code of demosift-cli uses `{name}`")));
    assert!(violations.iter().all(|violation| violation.path == "crates/demosift-cli/Cargo.toml"));
}

#[test]
fn licenses_of_dependencies_are_allowed() {
    tidy(licenses_are_allowed(&packages(), &real_rules()));
}

#[test]
fn licenses_of_dependencies_are_allowed_catches() {
    let (mut packages, mut rules) = (packages(), real_rules());
    let fine = ["MIT", "MIT/Apache-2.0", "GPL-3.0-only OR MIT", "(MIT OR GPL-3.0-only) AND Unicode-3.0"];
    let wrong =
        ["GPL-3.0-only", "MIT AND GPL-3.0-only", "(MIT AND GPL-3.0-only) OR GPL-2.0", "MIT WITH x", "MIT )"];
    packages.extend(fine.map(|license| planted("fine", Some(license))));
    packages.extend(wrong.map(|license| planted("wrong", Some(license))));
    packages.push(planted("wrong", None));
    let violations = licenses_are_allowed(&packages, &rules);
    assert_eq!(violations.len(), wrong.len() + 1);
    assert!(violations.iter().all(|violation| violation.message.starts_with("wrong 1.0.0")));
    rules.licenses.remove("BSD-3-Clause");
    let violations = licenses_are_allowed(&packages, &rules);
    assert!(violations.iter().any(|violation| violation.message.starts_with("snap ")));
}

#[test]
fn no_dependency_is_there_twice() {
    tidy(versions_are_one(&built(), &real_rules()));
}

#[test]
fn no_dependency_is_there_twice_catches() {
    let (mut built, mut rules) = (built(), real_rules());
    assert!(built.len() > 60 && built.iter().any(|package| package.starts_with("parquet ")), "{built:?}");
    built.insert("parquet 0.0.0".to_owned());
    let is_built = |older: &&String| built.contains(&older.replace('@', " "));
    let older = rules.older.iter().find(is_built).expect("an exception that is needed here").clone();
    rules.older.remove(&older);
    let violations = versions_are_one(&built, &rules);
    let mut names: Vec<&str> =
        messages(&violations).iter().filter_map(|message| message.split(' ').next()).collect();
    names.retain(|name| *name != "parquet");
    assert_eq!((violations.len(), names), (2, vec![older.split('@').next().unwrap_or_default()]));
}

#[test]
fn dependencies_come_from_crates_io() {
    tidy(sources_are_crates_io(&read(LOCK)));
}

#[test]
fn dependencies_come_from_crates_io_catches() {
    let lock = read(LOCK);
    let elsewhere = lock.replacen(CRATES_IO, "git+https://example.org/serde#0123", 1);
    assert_eq!(sources_are_crates_io(&elsewhere).len(), 1);
    let (before, after) = lock.split_once("\nchecksum = ").expect("there are hashes");
    let without = format!("{before}\nwas = {after}");
    assert_eq!(sources_are_crates_io(&without).len(), 1);
}

#[test]
fn the_version_is_said_once_more_only() {
    let library = packages().into_iter().find(|package| package.name == "demosift").expect("it is ours");
    tidy(versions_agree(&library.version, &read("CITATION.cff")));
    caught(&versions_agree("99.0.0", &read("CITATION.cff")), &["CITATION.cff:1"]);
}
