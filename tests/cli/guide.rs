//! The user guide's chapter "Write a BSDF in ten minutes", as a new user would go through it: the program alone, copied to a
//! folder without a source tree, every command of the chapter in an empty folder, and what it shows.

use std::collections::VecDeque;
use std::path::Path;
use std::process::Command;

/// A command of the chapter and the lines that it is shown to print.
struct Step {
    command: String,
    shown: Vec<String>,
}

/// The steps in the chapter's `console` blocks.
fn steps(guide: &str, chapter: &str) -> Vec<Step> {
    let start = guide.find(&format!("\n## {chapter}\n")).expect("the chapter is there") + 1;
    let text = &guide[start..];
    let end = text[1..].find("\n## ").map_or(text.len(), |at| at + 1);
    let mut steps: Vec<Step> = Vec::new();
    let mut inside = false;
    for line in text[..end].lines() {
        match (line, inside) {
            ("```console", _) => inside = true,
            ("```", _) => inside = false,
            (line, true) => match line.strip_prefix("$ ") {
                Some(command) => steps.push(Step { command: command.to_owned(), shown: Vec::new() }),
                None => steps.last_mut().expect("a command comes first").shown.push(line.to_owned()),
            },
            _ => {}
        }
    }
    steps
}

/// Numbers differ from device to device, and so do names of devices.
fn without_numbers(line: &str) -> String {
    let mut result = String::new();
    let mut rest = line.chars().collect::<VecDeque<_>>();
    while let Some(c) = rest.pop_front() {
        if !c.is_ascii_digit() {
            result.push(c);
            continue;
        }
        // Digits with points, exponents and their signs.
        let mut last = c;
        while let Some(&next) = rest.front() {
            let exponent = next == 'e' && rest.get(1).is_some_and(|c| c.is_ascii_digit() || *c == '-');
            if !(next.is_ascii_digit() || next == '.' || exponent || next == '-' && last == 'e') {
                break;
            }
            last = next;
            rest.pop_front();
        }
        let before = result.chars().next_back();
        if before.is_some_and(|c| c == '-' || c == '+') {
            result.pop();
        }
        result.push('#');
    }
    result
}

/// Every line that is shown is printed, in this order; `…` stands for lines, or for the end of one.
fn assert_shown(step: &Step, printed: &str) {
    let mut lines = printed.lines().map(without_numbers);
    for shown in step.shown.iter().filter(|line| *line != "…") {
        let wanted = without_numbers(shown);
        let fits = |line: &String| match wanted.strip_suffix('…') {
            Some(start) => line.starts_with(start.trim_end()),
            None => *line == wanted,
        };
        assert!(lines.any(|line| fits(&line)), "`{}` does not print\n{shown}\nbut\n{printed}", step.command);
    }
}

/// Runs a step in a shell that finds the program by its name.
fn run(step: &Step, folder: &Path, program: &Path) {
    let path = std::env::var("PATH").unwrap_or_default();
    let output = Command::new("sh")
        .args(["-c", &step.command])
        .current_dir(folder)
        .env("PATH", format!("{}:{path}", program.display()))
        .env_remove("RUST_LOG")
        .output()
        .expect("a shell");
    let printed = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).expect("UTF-8")).concat();
    let fails = step.shown.iter().any(|line| line.starts_with("error: "));
    assert_eq!(!output.status.success(), fails, "`{}` ends with {}:\n{printed}", step.command, output.status);
    assert_shown(step, &printed);
}

#[test]
fn the_chapter_on_bsdfs_works_as_it_says() {
    let place = tempfile::tempdir().unwrap();
    let (bin, work) = (place.path().join("bin"), place.path().join("work"));
    std::fs::create_dir(&bin).unwrap();
    std::fs::create_dir(&work).unwrap();
    std::fs::copy(assert_cmd::cargo::cargo_bin!("sunfleck"), bin.join("sunfleck")).unwrap();
    let guide = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/user-guide.md")).unwrap();
    let steps = steps(&guide, "Write a BSDF in ten minutes");
    let failing = steps.iter().filter(|step| step.shown.iter().any(|line| line.starts_with("error: "))).count();
    assert!(steps.len() > 15 && failing == 2, "{} steps, {failing} of them to fail", steps.len());
    steps.iter().for_each(|step| run(step, &work, &bin));
    for picture in ["before.png", "velvet.png", "velvet.exr"] {
        assert!(work.join(picture).is_file(), "{picture}");
    }
    assert_ne!(std::fs::read(work.join("before.png")).unwrap(), std::fs::read(work.join("velvet.png")).unwrap());
}

#[test]
fn numbers_are_left_out_of_the_comparison() {
    assert_eq!(without_numbers("p = 1.9e-10 at -0.5, 3 files: (12, -7)"), "p = # at #, # files: (#, #)");
    assert_eq!(without_numbers("a.glsl:29:20: 'e1' 2e"), "a.glsl:#:#: 'e#' #e");
    let step = Step { command: String::new(), shown: ["a 1 …", "…", "b 2"].map(str::to_owned).into() };
    assert_shown(&step, "x\na 7 and more\ny\nb 5\n");
    assert!(std::panic::catch_unwind(|| assert_shown(&step, "b 5\na 7 and more\n")).is_err(), "the order counts");
}
