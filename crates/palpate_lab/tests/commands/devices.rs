//! `palpate-lab devices` with any devices plugged in.

use std::process::Output;

fn devices(arguments: &[&str]) -> Output {
    super::run(&[&["devices"], arguments].concat())
}

fn rejected(arguments: &[&str]) -> String {
    super::rejected(&[&["devices"], arguments].concat())
}

#[test]
fn devices_are_listed_as_a_table_or_as_json() {
    let output = devices(&["--json", "--all"]);
    assert!(output.status.success());
    let listed: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    for device in listed["devices"].as_array().unwrap() {
        assert!(["kind", "name", "vendor", "path", "error"].iter().all(|key| device.get(key).is_some()));
    }
    let output = devices(&[]);
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(
        text.starts_with("no device of a supported kind is plugged in") || text.starts_with("kind "),
        "{text}"
    );
}

#[test]
fn watch_ends_after_its_time_and_prints_a_line_for_each_device() {
    let output = devices(&["--watch", "--seconds", "0.2", "--json"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    for line in String::from_utf8(output.stdout).unwrap().lines() {
        let change: serde_json::Value = serde_json::from_str(line).unwrap();
        assert_eq!(change["change"], "in");
    }
}

#[test]
fn rejects_invalid_arguments_in_one_line() {
    let text = rejected(&["--test", "no such serial number"]);
    assert!(text.contains("no such serial number"), "{text}");
    for force in ["0", "0.5", "-0.1", "nan"] {
        let text = rejected(&["--test", "x", "--force-n", force]);
        assert!(text.contains("--force-n is") && text.contains("above 0 and below 0.5"), "{text}");
    }
    assert!(rejected(&["--watch", "--seconds", "inf"]).contains("above 0 and at most 86400"));
    assert!(rejected(&["--watch", "--test", "x"]).contains("cannot be used with"));
    assert!(rejected(&["--yes"]).contains("--test"));
}
