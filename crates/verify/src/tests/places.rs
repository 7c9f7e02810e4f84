//! Every leaf of a manifest and every word of every file of a folder, changed one at a time: which changes pass.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::Path;

use serde_json::Value;

use super::says_nothing;
use crate::read::leaves::Leaves;
use terrace_plan::manifest::MANIFEST;

/// Every leaf of a value as a JSON pointer, and as a pattern of [`STEPPED`].
fn leaves(value: &Value, pointer: &str, pattern: &str, out: &mut Vec<(String, String)>) {
    let key = |name: &str| if pattern.is_empty() { name.to_owned() } else { format!("{pattern}.{name}") };
    match value {
        Value::Object(all) => {
            all.iter().for_each(|(name, below)| leaves(below, &format!("{pointer}/{name}"), &key(name), out));
        }
        Value::Array(all) => {
            (0..)
                .zip(all)
                .for_each(|(i, below)| leaves(below, &format!("{pointer}/{i}"), &format!("{pattern}[]"), out));
        }
        _ => out.push((pointer.to_owned(), pattern.to_owned())),
    }
}

/// Whether a pattern with `*` and `**` is that of a leaf.
fn fits(pattern: &str, leaf: &str) -> bool {
    match pattern.strip_suffix(".**") {
        Some(stem) => leaf.strip_prefix(stem).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '['])),
        None => {
            let (wanted, found): (Vec<_>, Vec<_>) = (pattern.split('.').collect(), leaf.split('.').collect());
            wanted.len() == found.len() && wanted.iter().zip(&found).all(|(w, f)| *w == "*" || w == f)
        }
    }
}

/// A value other than this one.
fn other(value: &Value) -> Value {
    match value {
        Value::Bool(is) => Value::Bool(!is),
        Value::String(text) => Value::String(format!("{text}x")),
        Value::Number(n) if n.is_u64() => Value::from(n.as_u64().expect("whole") + 1),
        Value::Number(n) if n.is_i64() => Value::from(n.as_i64().expect("whole") + 1),
        Value::Number(n) => {
            let v = n.as_f64().expect("a number");
            // More than the rounding of any figure.
            Value::from(v + (0.01 * v.abs()).max(0.05))
        }
        _ => Value::from(1),
    }
}

/// Whether a folder is refused, by a rule or since it cannot be read.
fn is_refused(folder: &Path) -> bool {
    crate::verify(folder, None).map_or(true, |proof| !proof.ok)
}

/// Changes, removes and adds leaves of the manifest of a sound folder, one in `step` of them; returns the changes
/// that pass, though they are not listed as not proved.
pub(crate) fn unproved_leaves(folder: &Path, known: &Leaves, step: usize) -> BTreeSet<String> {
    let path = folder.join(MANIFEST);
    let sound = std::fs::read(&path).expect("a manifest");
    let manifest: Value = serde_json::from_slice(&sound).expect("JSON");
    let mut all = Vec::new();
    leaves(&manifest, "", "", &mut all);
    assert!(all.len() > 100, "{}", all.len());
    let mut passed = BTreeSet::new();
    let mut count = 0;
    let mut attempt = |changed: &Value, what: String| {
        count += 1;
        if count % step != 0 {
            return;
        }
        std::fs::write(&path, changed.to_string()).expect("a writable folder");
        if !is_refused(folder) {
            passed.insert(what);
        }
    };
    for (pointer, pattern) in all.iter().filter(|(_, pattern)| !known.stated().any(|stated| fits(stated, pattern))) {
        let mut changed = manifest.clone();
        let leaf = changed.pointer_mut(pointer).expect("a leaf");
        *leaf = other(leaf);
        attempt(&changed, format!("{pattern} ({pointer})"));
        let (parent, key) = pointer.rsplit_once('/').expect("a pointer");
        let mut changed = manifest.clone();
        // A key of the machine that is left out has its default.
        let is_default = pattern.starts_with("machine.");
        if let Some(object) = changed.pointer_mut(parent).and_then(Value::as_object_mut).filter(|_| !is_default) {
            object.remove(key);
            attempt(&changed, format!("without {pattern} ({pointer})"));
        }
    }
    for parent in ["", "/summary", "/files/0", "/pens/0", "/placement", "/job", "/inputs/0"] {
        let mut changed = manifest.clone();
        let object = changed.pointer_mut(parent).and_then(Value::as_object_mut).expect("an object");
        object.insert("further".into(), Value::from(1));
        attempt(&changed, format!("a further key in {parent:?}"));
    }
    std::fs::write(&path, sound).expect("a writable folder");
    passed
}

/// Where the words of a text are.
fn words(text: &[u8]) -> Vec<Range<usize>> {
    let is_word = |c: &u8| !b" \t\r\n,".contains(c);
    let mut out = Vec::new();
    let mut at = 0;
    for run in text.chunk_by(|a, b| is_word(a) == is_word(b)) {
        if is_word(&run[0]) {
            out.push(at..at + run.len());
        }
        at += run.len();
    }
    out
}

/// Another word: of a number its last digit, of another its last letter.
fn altered(word: &[u8]) -> Vec<u8> {
    let mut word = word.to_vec();
    let at = word.iter().rposition(u8::is_ascii_digit).unwrap_or(word.len() - 1);
    word[at] = match word[at] {
        digit @ b'0'..=b'8' => digit + 1,
        b'9' => b'0',
        b'Q' => b'R',
        _ => b'Q',
    };
    word
}

/// Whether a change of a word in this line is one on which nothing acts: names in comments, and the sentences around
/// the tables of a run sheet.
fn is_prose(name: &str, line: &str, part: &str) -> bool {
    let is_comment = match name {
        "fly.ngc" => line.starts_with('(') && !line.starts_with("(MARK"),
        "fly.pmc" => line.starts_with("//") && !line.starts_with("// MARK"),
        _ => line.starts_with("(machine:") || line.starts_with("(..."),
    };
    let is_compared =
        ["size ", "machine ", "part zero", "part laid", "part turn"].iter().any(|key| line.starts_with(key));
    match name {
        "runsheet.txt" => match part {
            "PENS" | "BLOCKS" => false,
            "SET-UPS" => !line.contains("SET-UP ") && !line.contains("  point "),
            "" => !is_compared,
            _ => true,
        },
        _ => is_comment,
    }
}

/// Whether a controller does the same with other words in a line: one more time what it did before, a longer dwell, the
/// number of a line, a comment less, the output off or at rest once less where it is off and at rest already (`laser`
/// looks whether it is), the last figure of a time.
fn does_the_same(name: &str, line: &str, [old, new]: [&str; 2]) -> bool {
    let is_program = [".ngc", ".nc", ".pmc"].iter().any(|ending| name.ends_with(ending));
    let is_comment = |text: &str| text.starts_with('(') || text.starts_with("//");
    let begins = |words: &[&str]| words.iter().any(|word| line.starts_with(word));
    let is_off = begins(&["M5", "M65 P0", "G4 "]) || line.starts_with('N') && line.ends_with(['5', '0']);
    // Positions on the fly are held to a micrometre and to the limits of the axes, not to the last figure.
    let is_sample = name.starts_with("fly") && begins(&["TM", "G1 "]);
    // An angle is known to more than its last figure.
    let is_pose = name.ends_with("poses.csv") && new.len() == old.len();
    // Heights of boxes are those of the marks to a nanometre; the flag of a lift says nothing of the first block.
    let is_box = name == "program.txt" && (line.starts_with("block ") || line.starts_with("pen "));
    let near = |a: &str, b: &str| {
        let [a, b] = [a, b].map(|text| text.parse::<f64>().unwrap_or(f64::NAN));
        (a - b).abs() <= 1.0 && a.abs() > 1000.0 || (a - b).abs() <= 1e-12 * a.abs()
    };
    let is_first = line.starts_with("block B0001 ") && (old, new) == ("0", "1");
    // What lies in the middle between two figures is either; lines without text say nothing.
    let is_sheet = name == "runsheet.txt";
    let is_middle = is_sheet && line.contains("B00") && old.split('.').nth(1).is_some_and(|d| d.len() == 1);
    let is_blank = is_sheet && line.is_empty();
    is_pose
        || is_box && (near(old, new) || is_first)
        || is_sheet && (is_blank || is_middle || near(old, new))
        || is_sample && !new.contains(' ') && !old.contains(' ')
        || is_program
            && match (old.is_empty(), new.is_empty()) {
                (true, _) => begins(&["G0 ", "G4 ", "M5", "M65 P0", "G49", "G92.1", "G2", "M66 "]) || is_comment(line),
                (_, true) => is_comment(line) || is_off || old.starts_with('N'),
                _ if new == format!("{old} {old}") => line.starts_with("G2") || is_comment(line),
                _ => line.starts_with("G4 ") || old.starts_with('F') && name.starts_with("fly"),
            }
}

/// The line that holds a byte.
fn line_of(text: &str, at: usize) -> String {
    let at = (0..=at).rev().find(|&i| text.is_char_boundary(i)).unwrap_or(0);
    let start = text[..at].rfind('\n').map_or(0, |n| n + 1);
    text[start..].lines().next().unwrap_or_default().to_owned()
}

/// Changes the files of a sound folder but pictures and pages, every `step`th place of each; returns the changes
/// that pass.
pub(crate) fn unproved_words(folder: &Path, step: usize) -> BTreeSet<String> {
    let sound = std::fs::read(folder.join(MANIFEST)).expect("a manifest");
    let manifest: Value = serde_json::from_slice(&sound).expect("JSON");
    let names: Vec<String> = manifest["files"]
        .as_array()
        .expect("files")
        .iter()
        .map(|f| f["file"].as_str().expect("a name").to_owned())
        .filter(|name| !name.ends_with(".svg") && !name.ends_with(".html"))
        .collect();
    assert!(names.len() > 1, "{names:?}");
    let mut passed = BTreeSet::new();
    for name in &names {
        let path = folder.join(name);
        let bytes = std::fs::read(&path).expect("a file");
        for (place, new) in changes(name, &bytes).into_iter().step_by(step) {
            let changed = [&bytes[..place.start], &new, &bytes[place.end..]].concat();
            if changed == bytes || name.ends_with(".ovf") && says_nothing(&bytes, &changed, place.start) {
                continue;
            }
            std::fs::write(&path, changed).expect("a writable folder");
            super::renew_hash(folder, name);
            if !is_refused(folder) {
                let shown = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
                let line = line_of(&shown(&bytes), place.start);
                let [old, new] = [&bytes[place.clone()], &new].map(shown);
                if does_the_same(name, &line, [&old, &new]) {
                    continue;
                }
                passed.insert(format!("{name}, {place:?}: {old:?} -> {new:?} in {line:?}"));
            }
        }
        std::fs::write(&path, &bytes).expect("a writable folder");
        std::fs::write(folder.join(MANIFEST), &sound).expect("a writable folder");
    }
    passed
}

/// The changes of a file: of a text each word altered, left out and doubled, and each line left out and doubled; of
/// other files a bit of each byte.
fn changes(name: &str, bytes: &[u8]) -> Vec<(Range<usize>, Vec<u8>)> {
    let text = std::str::from_utf8(bytes).ok().filter(|_| !name.ends_with(".ovf") && !name.ends_with(".lmc"));
    let Some(text) = text else {
        return (0..bytes.len()).map(|at| (at..at + 1, vec![bytes[at] ^ 0x40])).collect();
    };
    let mut out = Vec::new();
    let (mut at, mut part) = (0, String::new());
    for line in text.split_inclusive('\n') {
        if let Some(head) = ["PENS", "SET-UPS", "BLOCKS", "BEFORE", "HOW"].into_iter().find(|h| line.starts_with(h)) {
            part = head.to_owned();
        }
        if !is_prose(name, line, &part) {
            out.push((at..at + line.len(), Vec::new()));
            out.push((at..at, line.as_bytes().to_vec()));
            for word in words(line.as_bytes()) {
                let typed = &line.as_bytes()[word.clone()];
                let place = at + word.start..at + word.end;
                out.push((place.clone(), altered(typed)));
                out.push((place.clone(), Vec::new()));
                out.push((place, [typed, b" ", typed].concat()));
            }
        }
        at += line.len();
    }
    out
}
