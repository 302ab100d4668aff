//! The command line itself: the version, the completions of shells and the man page.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::program::gdt_batch;

#[path = "../../build.rs"]
#[expect(dead_code, reason = "cargo runs it; here only its parts are tested")]
mod build_script;

fn run(arguments: &[&str]) -> String {
    gdt_batch(Path::new("."), arguments).succeeded().out
}

/// Gives `text` to a program and returns what it says on standard error, with its exit code; `None`, and a line about it, without the
/// program.
fn said_by(program: &str, arguments: &[&str], text: &str) -> Option<(bool, String)> {
    let mut command = Command::new(program);
    command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
    let Ok(mut child) = command.spawn() else {
        eprintln!("not tested with {program}, which is not installed");
        return None;
    };
    child.stdin.take().unwrap().write_all(text.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    Some((output.status.success(), String::from_utf8_lossy(&output.stderr).into_owned()))
}

#[test]
fn the_short_version_is_that_of_the_package_and_the_long_one_says_what_is_built_in() {
    let short = format!("gdt-batch {}", env!("CARGO_PKG_VERSION"));
    assert_eq!(run(&["-V"]).trim(), short);
    let long = run(&["--version"]);
    let features = [
        (cfg!(feature = "fault-injection"), "fault-injection"),
        (cfg!(feature = "gpu"), "gpu"),
        (cfg!(feature = "remote"), "remote"),
        (cfg!(feature = "viewer"), "viewer"),
    ];
    let built_in: Vec<&str> = features.iter().filter(|(is, _)| *is).map(|(_, name)| *name).collect();
    let built_in = if built_in.is_empty() { "none".to_string() } else { built_in.join(", ") };
    assert!(
        long.starts_with(&format!("{short} (")) && long.trim().ends_with(&format!("features: {built_in})")),
        "{long}"
    );
    // Of users' builds; tests/installed.rs looks at one.
    let commit =
        build_script::commit(Path::new(env!("CARGO_MANIFEST_DIR"))).filter(|_| !cfg!(feature = "fault-injection"));
    let commit = commit.map_or("features".into(), |commit| format!("{commit}; features"));
    assert!(long.contains(&format!("({commit}: ")), "{long} is not of {commit}");
}

/// Runs git in a folder of its own.
fn git(folder: &Path, arguments: &[&str]) -> bool {
    let identity = ["-c", "user.name=a", "-c", "user.email=a@example.org", "-c", "commit.gpgsign=false"];
    let mut command = Command::new("git");
    command.arg("-C").arg(folder).args(identity).args(arguments).stdout(Stdio::null()).stderr(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}

#[test]
fn the_commit_is_that_of_the_checkout_or_of_the_package_and_of_nothing_around_them() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    assert_eq!(build_script::commit(root), None);
    let package = root.join("package");
    fs::create_dir(&package).unwrap();
    let note =
        "{\n  \"git\": {\n    \"sha1\": \"0123456789abcdef0123456789abcdef01234567\"\n  },\n  \"path_in_vcs\": \"\"\n}";
    fs::write(package.join(".cargo_vcs_info.json"), note).unwrap();
    assert_eq!(build_script::commit(&package).as_deref(), Some("0123456"));
    assert_eq!(build_script::packaged_commit(&note.replace("    \"sha1\"", "    \"dirty\": true, \"sha1\"")), None);
    assert_eq!(build_script::packaged_commit("{\"git\": {\"sha1\": \"no\"}}"), None);
    if !git(root, &["init"]) {
        eprintln!("not tested with git, which is not installed");
        return;
    }
    // Without a commit there is none.
    assert_eq!(build_script::commit(root), None);
    assert!(git(root, &["commit", "--allow-empty", "--message", "first", "--date", "2020-01-02T03:04:05Z"]));
    let commit = build_script::commit(root).unwrap();
    let (hash, date) = commit.split_once(' ').unwrap();
    assert!(hash.len() == 7 && hash.bytes().all(|b| b.is_ascii_hexdigit()) && date.len() == 10, "{commit}");
    // A package within somebody's repository is not of that.
    assert_eq!(build_script::commit(&package).as_deref(), Some("0123456"));
    fs::create_dir(root.join("tarball")).unwrap();
    assert_eq!(build_script::commit(&root.join("tarball")), None);
    // What cargo watches is there, or it would build again each time; it changes with the commit, also without a log.
    let watched = |root: &Path| -> Vec<(std::path::PathBuf, Vec<u8>)> {
        let files = build_script::files_of_commit(root);
        files.into_iter().map(|file| (file.clone(), fs::read(file).unwrap())).collect()
    };
    for without_log in [false, true] {
        if without_log {
            assert!(git(root, &["config", "core.logAllRefUpdates", "false"]));
            fs::remove_dir_all(root.join(".git/logs")).unwrap();
        }
        let before = watched(root);
        assert!(!before.is_empty());
        assert!(git(root, &["commit", "--allow-empty", "--message", "next"]));
        assert_ne!(watched(root), before);
        assert!(watched(&package).iter().all(|(file, _)| file.starts_with(&package)));
    }
}

#[test]
fn versions_say_no_more_than_is_known() {
    let features = || vec!["VIEWER".to_string(), "FAULT_INJECTION".to_string()];
    assert_eq!(
        build_script::long_version("1.2.3", Some("c6555ec 2026-11-23".into()), features()),
        "1.2.3 (c6555ec 2026-11-23; features: fault-injection, viewer)"
    );
    assert_eq!(build_script::long_version("1.2.3", None, vec![]), "1.2.3 (features: none)");
}

#[test]
fn shells_read_their_completions() {
    for (shell, check) in [("bash", "-n"), ("zsh", "-n"), ("fish", "--no-execute")] {
        let script = run(&["completions", shell]);
        if let Some((holds, said)) = said_by(shell, &[check], &script) {
            assert!(holds && said.is_empty(), "{shell}: {said}");
        }
    }
    for shell in ["powershell", "elvish"] {
        assert!(run(&["completions", shell]).contains("gdt-batch"), "{shell}");
    }
    gdt_batch(Path::new("."), &["completions", "sh"]).refused(2, &["bash", "zsh", "fish", "powershell", "elvish"]);
}

/// Bash offers commands, and the options of a command.
#[test]
fn bash_completes_commands_and_options() {
    let script = run(&["completions", "bash"]);
    let ask = "name=$(complete -p gdt-batch | grep -o '_gdt[_-]*batch'); COMP_WORDS=(gdt-batch \"${@:1}\"); COMP_CWORD=$#; \
               $name gdt-batch \"${!#}\" \"${@:$#-1:1}\"; echo \"${COMPREPLY[*]}\"";
    for (words, offered) in [
        (&["com"][..], "completions"),
        (&["init", "--fo"], "--force"),
        (&["completions", "z"], "zsh"),
        (&["man", "ver"], "verify"),
        // Bash itself offers files then.
        (&["init", ""], ""),
        (&["--fr"], ""),
    ] {
        let mut command = Command::new("bash");
        command.arg("-c").arg(format!("{script}\n{ask}")).arg("bash").args(words);
        let Ok(output) = command.output() else {
            eprintln!("not tested with bash, which is not installed");
            return;
        };
        let reply = String::from_utf8_lossy(&output.stdout).into_owned();
        assert_eq!(reply.trim(), offered, "{words:?}: {output:?}");
    }
}

/// Zsh, as somebody uses it at a terminal, completes commands, options behind them, and the configuration of a job.
#[test]
#[cfg(unix)]
fn zsh_completes_what_is_behind_a_command() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("completions"), run(&["completions", "zsh"])).unwrap();
    fs::write(folder.path().join("job.toml"), "").unwrap();
    let whole = [
        "gdt-batch init --force",
        "gdt-batch job.toml",
        "gdt-batch job.toml --restart",
        "gdt-batch completions",
        "gdt-batch man verify",
    ];
    let begun = "'gdt-batch init --fo' 'gdt-batch jo' 'gdt-batch job.toml --res' 'gdt-batch com' 'gdt-batch man ver'";
    // The terminal shows what is typed too, so the marks are typed otherwise.
    let terminal = format!(
        "zmodload zsh/zpty; zpty z zsh -f -i; zpty -w z \"PS1= PS2=; autoload -Uz compinit; compinit -u -D; source completions; \
         compdef _gdt-batch gdt-batch; w() {{ for BUFFER in {begun}; do CURSOR=\\$#BUFFER; zle complete-word; \
         print -r -- LI''NE:\\$BUFFER:; done; print THE''END; exit }}; zle -N w; bindkey '^I' w\"; \
         zpty -w -n z $'\\t'; zpty -r z said '*THEEND*'; print -r -- $said"
    );
    let Ok(output) = Command::new("zsh").args(["-f", "-c", &terminal]).current_dir(folder.path()).output() else {
        eprintln!("not tested with zsh, which is not installed");
        return;
    };
    let said = String::from_utf8_lossy(&output.stdout);
    let lines: Vec<&str> =
        said.split("LINE:").skip(1).filter_map(|rest| rest.split(':').next()).map(str::trim).collect();
    assert_eq!(lines, whole, "{output:?}");
}

#[test]
fn the_man_page_is_clean_roff() {
    for arguments in [&["man"][..], &["man", "init"], &["man", "work"]] {
        let page = run(arguments);
        assert!(page.contains(".TH gdt-batch"), "{page}");
        if let Some((holds, said)) = said_by("groff", &["-ww", "-man", "-Tutf8", "-z"], &page) {
            assert!(holds && said.is_empty(), "{arguments:?}: {said}");
        }
    }
    gdt_batch(Path::new("."), &["man", "sing"]).refused(2, &["no command sing", "verify"]);
}
