//! `info --histogram`.

use std::collections::BTreeMap;
use std::fs;

use serde_json::{Value, json};

use crate::las_file::LasFile;
use crate::program::gdt_batch;

/// Counts the values that `of` takes for records 0 to `count`.
fn counts(count: usize, of: impl Fn(usize) -> usize) -> Value {
    let mut counts = BTreeMap::<String, u64>::new();
    (0..count).for_each(|i| *counts.entry(of(i).to_string()).or_default() += 1);
    json!(counts)
}

#[test]
fn classes_and_returns_are_counted_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    const COUNT: usize = 2_000;
    for (minor, format, mask) in [(2, 1, 7u8), (4, 6, 15)] {
        let mut file = LasFile::new(minor, format, 0, COUNT);
        let (length, return_of) = (file.length() as usize, |i: usize| i % 5 % 4);
        for (i, record) in file.records.chunks_exact_mut(length).enumerate() {
            record[14] = record[14] & !mask | return_of(i) as u8;
        }
        let classes = counts(COUNT, |i| if format >= 6 { i % 70 } else { i % 19 });
        let (las, laz) = (folder.path().join("a.las"), folder.path().join("a.laz"));
        fs::write(&las, file.las()).unwrap();
        fs::write(&laz, file.laz(&[300], false)).unwrap();
        for name in ["a.las", "a.laz"] {
            let said = gdt_batch(folder.path(), &["info", "--histogram", "--json", name]).succeeded().json();
            let expected = json!({
                "classes": classes, "returns": counts(COUNT, return_of), "withheld": COUNT.div_ceil(17), "malformed": 0
            });
            let withheld = said["histogram"]["withheld"].as_u64().unwrap();
            assert!(withheld == COUNT as u64 / 17 || withheld == COUNT.div_ceil(17) as u64, "{withheld}");
            for key in ["classes", "returns", "malformed"] {
                assert_eq!(said["histogram"][key], expected[key], "{name} {format} {key}");
            }
            let text = gdt_batch(folder.path(), &["info", "--histogram", name]).succeeded().out;
            let ground = classes["2"].to_string();
            let lines = |word: &str| text.lines().filter(|line| line.trim_start().starts_with(word)).count();
            assert!(text.lines().any(|line| line.contains(&ground) && line.ends_with("ground")), "{text}");
            assert_eq!((lines("class "), lines("return ")), (classes.as_object().unwrap().len(), 4), "{text}");
        }
    }
    let plain = gdt_batch(folder.path(), &["info", "--json", "a.las"]).succeeded().json();
    assert!(plain["histogram"].is_null());
}

#[test]
fn texts_have_classes_but_no_returns_and_bad_lines_are_counted() {
    let folder = tempfile::tempdir().unwrap();
    let rows: String = (0..90).map(|i| format!("{},{},{},{}\n", i % 9, i / 9, i, 2 + i % 3)).collect();
    fs::write(folder.path().join("a.csv"), format!("x,y,z,classification\n{rows}oops,1,2,3\n")).unwrap();
    let said = gdt_batch(folder.path(), &["info", "--histogram", "--json", "a.csv"]).succeeded().json();
    assert_eq!(
        said["histogram"],
        json!({"classes": {"2": 30, "3": 30, "4": 30}, "returns": {}, "withheld": 0, "malformed": 1})
    );
    fs::write(folder.path().join("b.csv"), "x,y,z\n1,2,3\n4,5,6\n").unwrap();
    let none = gdt_batch(folder.path(), &["info", "--histogram", "b.csv"]).succeeded().out;
    assert!(!none.contains("class ") && !none.contains("return "), "{none}");
}
