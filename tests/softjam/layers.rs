//! The rooms of the house: data flows one way, so a room uses only what stands above it in the list.

use std::fs;
use std::path::{Path, PathBuf};

/// The rooms from the ground up, as ARCHITECTURE.md has them.
const ROOMS: [&str; 16] = [
    "text",
    "budget",
    "domain",
    "numerics",
    "state",
    "neighbors",
    "contacts",
    "models",
    "minimize",
    "analysis",
    "scene",
    "protocol",
    "record",
    "replay",
    "convert",
    "figure",
];

/// All source files below a folder.
fn sources(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, files);
        } else if path.extension().is_some_and(|e| e == "rs") {
            files.push(path);
        }
    }
}

/// The code of a file: without comments, and without what is compiled for tests alone, which stands at its end or is a line.
fn code(text: &str) -> String {
    let mut code = String::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        if line == "#[cfg(test)]" {
            let next = lines.next().unwrap_or_default();
            if next.ends_with('{') {
                break;
            }
            continue;
        }
        if !line.trim_start().starts_with("//") {
            code.push_str(line);
            code.push('\n');
        }
    }
    code
}

/// Whether a module is compiled for tests alone: its parent says so.
fn is_test(file: &Path) -> bool {
    let (Some(folder), Some(name)) = (file.parent(), file.file_stem()) else {
        return false;
    };
    let parent = fs::read_to_string(folder.join("mod.rs")).unwrap_or_default();
    parent.contains(&format!("#[cfg(test)]\nmod {};", name.to_str().unwrap()))
}

/// What a file names of the crate, by room.
fn used(code: &str) -> Vec<&str> {
    let after = code.split("crate::").skip(1);
    let name = |rest: &&str| rest.find(|c: char| !(c.is_alphanumeric() || c == '_'));
    let used = after.filter_map(|rest| name(&rest).map(|end| &rest[..end]));
    used.collect()
}

#[test]
fn a_room_uses_only_what_stands_above_it() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&source, &mut files);
    let place = |room: &str| ROOMS.iter().position(|r| *r == room);
    let (mut wrong, mut uses) = (Vec::new(), 0);
    for file in &files {
        let within = file.strip_prefix(&source).unwrap();
        let first = within.iter().next().unwrap().to_str().unwrap();
        let room = first.trim_end_matches(".rs");
        let text = fs::read_to_string(file).unwrap();
        let code = code(&text);
        if ["lib", "main", "cli"].contains(&room) || is_test(file) {
            continue;
        }
        let here = place(room).unwrap_or_else(|| panic!("{room} is no room of the list"));
        for other in used(&code) {
            let Some(there) = place(other) else {
                // A constant of the crate, or a macro.
                continue;
            };
            uses += usize::from(there < here);
            if there > here {
                wrong.push(format!("{}: {room} uses {other}", within.display()));
            }
        }
    }
    wrong.sort();
    wrong.dedup();
    assert!(uses > 300, "{uses} uses were found");
    assert!(
        wrong.is_empty(),
        "lower rooms use higher ones:\n{}",
        wrong.join("\n")
    );
}
