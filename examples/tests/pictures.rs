//! Every scene is drawn, by Mesa's software driver if there is no other, and what must be on its picture is looked for there.
//!
//! `cargo test -p palpate_examples --features panel,gizmos --test pictures` leaves the pictures in `target/palpate/pictures`. Those of
//! the README are in `assets/pictures`: copy the last of each scene there when it has become better.

use image::{Rgb, RgbImage};
use std::path::{Path, PathBuf};
use std::process::Command;

/// A scene, its times (s), and what must be on its last picture.
struct Scene {
    name: &'static str,
    /// What else it is told.
    args: &'static [&'static str],
    at_s: &'static str,
    /// What is drawn over it.
    gizmos: &'static str,
    /// Pixels that must be there, at least: what, a colour's description, how many.
    has: &'static [(&'static str, fn(Rgb<u8>) -> bool, usize)],
}

/// As the stage paints bodies: flesh, lit or in shadow.
fn is_flesh([r, g, b]: [u8; 3]) -> bool {
    let [r, g, b] = [r, g, b].map(f32::from);
    r > 60.0 && r > 1.35 * g && r > 1.25 * b
}

fn body(Rgb(c): Rgb<u8>) -> bool {
    is_flesh(c)
}

fn first_tool(Rgb([r, g, b]): Rgb<u8>) -> bool {
    let [r, g, b] = [r, g, b].map(f32::from);
    b > 90.0 && b > 1.5 * r && b > 1.15 * g
}

fn second_tool(Rgb([r, g, b]): Rgb<u8>) -> bool {
    let [r, g, b] = [r, g, b].map(f32::from);
    r > 140.0 && g > 0.5 * r && g < 0.85 * r && b < 0.5 * r
}

fn title(Rgb(c): Rgb<u8>) -> bool {
    c.iter().all(|&v| v > 235)
}

fn yellow_curve(Rgb([r, g, b]): Rgb<u8>) -> bool {
    r > 200 && g > 190 && b < 120
}

fn thread(Rgb([r, g, b]): Rgb<u8>) -> bool {
    r > 150 && g > 145 && b > 120 && r >= b && r.abs_diff(g) < 14 && r - b < 60 && !title(Rgb([r, g, b]))
}

const SCENES: [Scene; 6] = [
    Scene {
        name: "probing",
        args: &[],
        at_s: "0.5,2.85",
        gizmos: "1",
        has: &[("body", body, 8_000), ("tool", first_tool, 150), ("title", title, 150)],
    },
    Scene {
        name: "indentation",
        args: &[],
        at_s: "0.6,2.45",
        gizmos: "0",
        has: &[
            ("body", body, 8_000),
            ("tool", first_tool, 800),
            ("title", title, 150),
            ("curve", yellow_curve, 80),
        ],
    },
    Scene {
        name: "suture_pull",
        args: &[],
        at_s: "0.5,3.0",
        gizmos: "0",
        has: &[
            ("body", body, 8_000),
            ("tool", first_tool, 100),
            ("thread", thread, 60),
            ("title", title, 150),
            ("curve", yellow_curve, 60),
        ],
    },
    Scene {
        name: "two_tools",
        args: &[],
        at_s: "0.5,1.7",
        gizmos: "1",
        has: &[
            ("body", body, 8_000),
            ("first tool", first_tool, 150),
            ("second tool", second_tool, 150),
            ("title", title, 150),
        ],
    },
    Scene {
        name: "custom_device",
        args: &[],
        at_s: "0.5,0.75",
        gizmos: "3",
        has: &[("body", body, 8_000), ("tool", first_tool, 100), ("title", title, 150)],
    },
    Scene {
        name: "your_mesh",
        args: &[concat!(env!("CARGO_MANIFEST_DIR"), "/../assets/meshes/organ.glb")],
        at_s: "0.5,0.75",
        gizmos: "1",
        has: &[("body", body, 8_000), ("tool", first_tool, 100), ("title", title, 150)],
    },
];

/// Draws `scene`; `None` where nothing can be drawn.
fn draw(scene: &Scene, folder: &Path) -> Option<Vec<RgbImage>> {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
    let mut run = Command::new(cargo);
    run.args(["run", "--quiet", "--locked", "-p", "palpate_examples", "--features", "panel,gizmos"]);
    if !cfg!(debug_assertions) {
        run.arg("--release");
    }
    run.args(["--example", scene.name, "--", "--gizmos", scene.gizmos, "--at", scene.at_s, "--pictures"])
        .arg(folder)
        .args(scene.args);
    let output = run.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    if said.contains("draws nothing") {
        return None;
    }
    assert!(output.status.success(), "{}: {said}", scene.name);
    let pictures = scene.at_s.split(',').enumerate().map(|(index, _)| {
        let file = folder.join(format!("{}-{}.png", scene.name, index + 1));
        let picture = image::open(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        picture.to_rgb8()
    });
    Some(pictures.collect())
}

/// What is wrong with `pictures` of `scene`.
fn complaints(scene: &Scene, pictures: &[RgbImage]) -> Vec<String> {
    let mut complaints = Vec::new();
    let Some(last) = pictures.last() else { return vec![format!("{}: no pictures", scene.name)] };
    for (what, is_it, least) in scene.has {
        let found = last.pixels().filter(|&&pixel| is_it(pixel)).count();
        if found < *least {
            complaints.push(format!("{}: {found} pixels of {what}, not {least}", scene.name));
        }
    }
    for pair in pictures.windows(2) {
        let differs = |(a, b): (&Rgb<u8>, &Rgb<u8>)| {
            let apart: u32 = a.0.iter().zip(b.0).map(|(&a, b)| u32::from(a.abs_diff(b))).sum();
            // Of the body, not of what moves before it.
            body(*a) && body(*b) && apart > 24
        };
        let moved = pair[0].pixels().zip(pair[1].pixels()).filter(|pair| differs(*pair)).count();
        if moved < 150 {
            complaints.push(format!("{}: the body moved in {moved} pixels only", scene.name));
        }
    }
    complaints
}

fn folder() -> PathBuf {
    let target = std::env::var_os("CARGO_TARGET_DIR")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../target"), PathBuf::from);
    let folder = target.join("palpate/pictures");
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

#[test]
fn every_scene_shows_what_it_is_about() {
    let folder = folder();
    let mut wrong = Vec::new();
    for scene in &SCENES {
        let Some(pictures) = draw(scene, &folder) else {
            #[expect(clippy::print_stderr, reason = "why nothing is tested")]
            {
                eprintln!("skipped: there is no graphics driver (Vulkan on Linux)");
            }
            return;
        };
        wrong.extend(complaints(scene, &pictures));
    }
    assert!(wrong.is_empty(), "{wrong:#?}\nsee {}", folder.display());
}

#[test]
fn a_blank_picture_and_one_that_stands_still_are_noticed() {
    let blank = RgbImage::from_pixel(640, 360, Rgb([20, 24, 30]));
    for scene in &SCENES {
        let said = complaints(scene, &[blank.clone(), blank.clone()]);
        assert_eq!(said.len(), scene.has.len() + 1, "{said:?}");
    }
}
