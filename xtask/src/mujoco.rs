//! The pinned MuJoCo: fetched once, checked always.
//!
//! The library comes out of the Python wheel on the package index, which mirrors serve too, or else out of the official
//! release archive. What is pinned is the hash of the library itself: every wheel of a release holds the same file.

use sha2::{Digest, Sha256};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const VERSION: &str = "3.17.0";
const LIBRARY: &str = "libmujoco.so.3.17.0";
/// The name that the linker looks for.
const LINK_NAME: &str = "libmujoco.so";
const RELEASES: &str = "https://github.com/google-deepmind/mujoco/releases";
/// Set by `.cargo/config.toml` unless the user has set it.
const LINK_DIR_VARIABLE: &str = "MUJOCO_DYNAMIC_LINK_DIR";

/// The library as it is made for one kind of machine.
struct Build {
    /// As `std::env::consts` names it.
    os: &'static str,
    /// The same.
    arch: &'static str,
    /// The platform of the wheel, as pip names it.
    wheel_platform: &'static str,
    /// The machine in the name of the release archive.
    archive_machine: &'static str,
    /// Of the library.
    sha256: &'static str,
}

/// Linux only: elsewhere the binding's renderer wants a window, and demosift does not build.
const BUILDS: [Build; 2] = [
    Build {
        os: "linux",
        arch: "x86_64",
        wheel_platform: "manylinux_2_28_x86_64",
        archive_machine: "linux-x86_64",
        sha256: "23496b023ee80fb61ab71167e94bc649f9941710fde96b18bb8204fb332523ad",
    },
    Build {
        os: "linux",
        arch: "aarch64",
        wheel_platform: "manylinux_2_28_aarch64",
        archive_machine: "linux-aarch64",
        sha256: "e2edd0204fb9229f75f332a4fcd1a32345bb9f90651dc0fddfa20ec0670db789",
    },
];

impl Build {
    /// The one for this machine.
    fn here() -> Result<&'static Self, String> {
        let fits = |build: &&Self| build.os == std::env::consts::OS && build.arch == std::env::consts::ARCH;
        BUILDS.iter().find(fits).ok_or_else(other_platform)
    }

    fn archive_url(&self) -> String {
        format!("{RELEASES}/download/{VERSION}/mujoco-{VERSION}-{}.tar.gz", self.archive_machine)
    }
}

/// Puts the pinned MuJoCo into the checkout's `.mujoco/lib`, unless it is there or the user brought their own.
pub(crate) fn set_up(root: &Path) -> Result<(), String> {
    let folder = own_folder(root);
    if let Some(chosen) = users_own_folder(&folder) {
        return accept_users_own(&chosen);
    }
    let build = Build::here()?;
    create_folder(&folder)?;
    let library = folder.join(LIBRARY);
    if library.exists() {
        check_hash(&library, build).map_err(|problem| {
            format!("{problem}\nDelete this file and run the command again to fetch the right one.")
        })?;
    } else {
        fetch(root, &library, build)?;
        println!("MuJoCo {VERSION} is in {}", folder.display());
    }
    link(&folder)
}

/// Copies the library that [`set_up`] found into a folder, under the name by which programs ask for it.
pub(crate) fn copy_to(folder: &Path, root: &Path) -> Result<(), String> {
    let library = self::folder(root).join(LINK_NAME);
    create_folder(folder)?;
    let target = folder.join(LIBRARY);
    // Under another name first: a program that runs keeps the file that it opened.
    let whole = folder.join(format!("{LIBRARY}-{}", std::process::id()));
    fs::copy(&library, &whole)
        .and_then(|_| fs::rename(&whole, &target))
        .map_err(|error| format!("cannot copy {} to {}: {error}", library.display(), target.display()))
}

/// The folder in which [`set_up`] found the library.
pub(crate) fn folder(root: &Path) -> PathBuf {
    let own = own_folder(root);
    users_own_folder(&own).unwrap_or(own)
}

fn own_folder(root: &Path) -> PathBuf {
    root.join(".mujoco").join("lib")
}

/// The folder that the user chose by the environment variable, if it is not the checkout's own.
fn users_own_folder(default: &Path) -> Option<PathBuf> {
    let chosen = PathBuf::from(std::env::var_os(LINK_DIR_VARIABLE)?);
    let same = match (chosen.canonicalize(), default.canonicalize()) {
        (Ok(chosen), Ok(default)) => chosen == default,
        _ => chosen == default,
    };
    (!same).then_some(chosen)
}

fn accept_users_own(folder: &Path) -> Result<(), String> {
    let names = [LINK_NAME, "libmujoco.dylib"];
    if !names.iter().any(|name| folder.join(name).exists()) {
        return Err(format!(
            "{LINK_DIR_VARIABLE} is set to {}, which holds neither {} nor {}\n\
             Unset it to use the checkout's own MuJoCo, or put MuJoCo {VERSION} there.",
            folder.display(),
            names[0],
            names[1]
        ));
    }
    println!("MuJoCo is taken from {LINK_DIR_VARIABLE}: {}", folder.display());
    Ok(())
}

/// Tries each source in turn; the library appears under its name only after its hash was right.
fn fetch(root: &Path, library: &Path, build: &Build) -> Result<(), String> {
    let scratch = root.join(".mujoco").join(format!("download-{}", std::process::id()));
    create_folder(&scratch)?;
    println!("Fetching MuJoCo {VERSION} ...");
    let outcome = fetch_into(&scratch, library, build);
    // What is left of a download is of no use to anybody, and a folder that stays does no harm.
    let _ = fs::remove_dir_all(&scratch);
    outcome
}

/// Gets the library into a scratch folder and says where it is.
type Source = fn(&Path, &Build) -> Result<PathBuf, String>;

fn fetch_into(scratch: &Path, library: &Path, build: &Build) -> Result<(), String> {
    let sources: [(&str, Source); 2] =
        [("the Python package index", from_wheel), ("the release archive", from_archive)];
    let mut problems = Vec::new();
    for (name, source) in sources {
        let found = source(scratch, build).and_then(|found| check_hash(&found, build).map(|()| found));
        match found {
            Ok(found) => {
                return fs::rename(&found, library)
                    .map_err(|error| format!("cannot write {}: {error}", library.display()));
            }
            Err(problem) => problems.push(format!("  from {name}: {}", problem.replace('\n', "\n    "))),
        }
    }
    Err(by_hand(library, build, &problems))
}

/// The library out of the wheel. The wheel is named in full, so that the version of the host's Python does not matter.
fn from_wheel(scratch: &Path, build: &Build) -> Result<PathBuf, String> {
    let python = ["python3", "python"]
        .into_iter()
        .find(|python| run(Command::new(python).arg("--version")).is_ok())
        .ok_or("no python3 on the PATH")?;
    let wheels = scratch.join("wheels");
    run(Command::new(python)
        .args(["-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-input"])
        .args(["--no-deps", "--only-binary=:all:", "--python-version", "3.11"])
        .args(["--platform", build.wheel_platform, "--dest"])
        .arg(&wheels)
        .arg(format!("mujoco=={VERSION}")))?;
    let wheel = fs::read_dir(&wheels)
        .map_err(|error| error.to_string())?
        .filter_map(Result::ok)
        .map(|entry| entry.path())
        .find(|path| path.extension().is_some_and(|extension| extension == "whl"))
        .ok_or("pip ended well but left no wheel")?;
    let member = format!("mujoco/{LIBRARY}");
    run(Command::new(python)
        .args(["-c", "import sys, zipfile; zipfile.ZipFile(sys.argv[1]).extract(sys.argv[2], sys.argv[3])"])
        .arg(wheel)
        .arg(&member)
        .arg(scratch))?;
    Ok(scratch.join(member))
}

fn from_archive(scratch: &Path, build: &Build) -> Result<PathBuf, String> {
    let archive = scratch.join("mujoco.tar.gz");
    run(Command::new("curl")
        .args(["--fail", "--location", "--silent", "--show-error", "--connect-timeout", "20", "--output"])
        .arg(&archive)
        .arg(build.archive_url()))?;
    let member = format!("mujoco-{VERSION}/lib/{LIBRARY}");
    run(Command::new("tar").arg("-xzf").arg(&archive).arg("-C").arg(scratch).arg(&member))?;
    Ok(scratch.join(member))
}

/// Runs a program quietly; the error is the last thing that it said.
fn run(command: &mut Command) -> Result<(), String> {
    let program = command.get_program().to_string_lossy().into_owned();
    let output = command.output().map_err(|error| format!("cannot run {program}: {error}"))?;
    if output.status.success() {
        return Ok(());
    }
    let complaints = String::from_utf8_lossy(&output.stderr);
    let last = complaints.lines().map(str::trim).rfind(|line| !line.is_empty());
    Err(last.map_or_else(|| format!("{program} failed with {}", output.status), str::to_owned))
}

fn check_hash(library: &Path, build: &Build) -> Result<(), String> {
    let bytes = fs::read(library).map_err(|error| format!("cannot read {}: {error}", library.display()))?;
    let found = hex(&Sha256::digest(&bytes));
    if found == build.sha256 {
        return Ok(());
    }
    Err(format!(
        "{LIBRARY} is not the one that demosift was tested with\n\
         found    SHA-256 {found}\n\
         expected SHA-256 {}\n\
         in {}",
        build.sha256,
        library.display()
    ))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The symbolic link under which the linker finds the library.
fn link(folder: &Path) -> Result<(), String> {
    let link = folder.join(LINK_NAME);
    if link.exists() {
        return Ok(());
    }
    // A link that points nowhere does not exist for `exists`, but is in the way.
    let _ = fs::remove_file(&link);
    #[cfg(unix)]
    let made = std::os::unix::fs::symlink(LIBRARY, &link);
    #[cfg(not(unix))]
    let made = fs::copy(folder.join(LIBRARY), &link).map(|_| ());
    made.map_err(|error| format!("cannot make the link {}: {error}", link.display()))
}

fn create_folder(folder: &Path) -> Result<(), String> {
    fs::create_dir_all(folder)
        .map_err(|error| format!("cannot make the folder {}: {error}", folder.display()))
}

fn by_hand(library: &Path, build: &Build, problems: &[String]) -> String {
    format!(
        "MuJoCo {VERSION} could not be fetched\n\
         {}\n\
         \n\
         To do it by hand, get one of these two on a machine that can:\n  \
         pip download --no-deps --only-binary=:all: --python-version 3.11 --platform {} mujoco=={VERSION}\n  \
         {}\n\
         Take {LIBRARY} out of it (a wheel is a zip file), put it here, and run the command again:\n  \
         {}",
        problems.join("\n"),
        build.wheel_platform,
        build.archive_url(),
        library.display()
    )
}

fn other_platform() -> String {
    format!(
        "the set-up knows Linux on x86-64 and on aarch64 only, and this is {} on {}\n\
         The library needs no MuJoCo and is tested by: cargo test --package demosift\n\
         To do it by hand, get MuJoCo {VERSION}, exactly this version, for your platform from\n  \
         {RELEASES}/tag/{VERSION}\n\
         set {LINK_DIR_VARIABLE} to the absolute path of the folder that holds its library, and run the command again.",
        std::env::consts::OS,
        std::env::consts::ARCH
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hex_is_what_sha256sum_prints() {
        // The digest of no bytes, from FIPS 180-4's test vectors.
        assert_eq!(
            hex(&Sha256::digest(b"")),
            "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
        );
    }

    #[test]
    fn a_wrong_hash_names_both() {
        let path = std::env::temp_dir().join(format!("xtask-wrong-hash-{}", std::process::id()));
        fs::write(&path, b"").unwrap();
        let message = check_hash(&path, &BUILDS[0]).unwrap_err();
        fs::remove_file(&path).unwrap();
        assert!(message.contains("e3b0c44298fc1c149afbf4c8996fb924"), "{message}");
        assert!(message.contains(BUILDS[0].sha256), "{message}");
    }
}
