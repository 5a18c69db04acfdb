//! The system's libraries for off-screen rendering. Everything but pictures works without them, so nothing here fails.

use std::process::Command;

const PACKAGES: [&str; 3] = ["libegl1", "libgl1-mesa-dri", "libgles2"];

/// Installs the libraries where that needs no question, else says what is missing.
pub(crate) fn set_up() {
    if !cfg!(target_os = "linux") || has_egl() {
        return;
    }
    if !(is_root() && succeeds(Command::new("apt-get").arg("--version"))) {
        println!("Rendering is not available: libEGL.so.1 is missing. {}", by_hand());
        return;
    }
    println!("Installing {} for off-screen rendering ...", PACKAGES.join(", "));
    let installed = succeeds(apt().args(["update", "--quiet"]))
        && succeeds(apt().args(["install", "--quiet", "--yes", "--no-install-recommends"]).args(PACKAGES))
        && has_egl();
    if !installed {
        println!("Rendering is not available: installing libEGL.so.1 failed. {}", by_hand());
    }
}

fn by_hand() -> String {
    format!("On Debian or Ubuntu: apt-get install {}", PACKAGES.join(" "))
}

fn has_egl() -> bool {
    // ldconfig is often not on the path of those who are not root.
    ["ldconfig", "/sbin/ldconfig"].into_iter().any(|ldconfig| {
        Command::new(ldconfig)
            .arg("-p")
            .output()
            .is_ok_and(|output| String::from_utf8_lossy(&output.stdout).contains("libEGL.so.1"))
    })
}

pub(crate) fn is_root() -> bool {
    Command::new("id").arg("-u").output().is_ok_and(|output| output.stdout.trim_ascii() == b"0")
}

pub(crate) fn apt() -> Command {
    let mut command = Command::new("apt-get");
    command.env("DEBIAN_FRONTEND", "noninteractive");
    command
}

pub(crate) fn succeeds(command: &mut Command) -> bool {
    command.output().is_ok_and(|output| output.status.success())
}
